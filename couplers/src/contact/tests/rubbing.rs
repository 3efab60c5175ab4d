//! Rigid bodies on an incline that stick and slide.

use super::*;

const GRAVITY: f64 = 9.81;
const STIFF: &str = "density = 1000\nyoungs_modulus = 3e10";

/// A body whose points move together in a plane, on a body at rest.
struct Rolling {
    world: World,
    contact: Box<dyn RunningCoupler>,
    /// Reference positions, from the centre, m.
    arms: Vec<Vector3<f64>>,
    mass: f64,
    inertia: f64,
    /// Displacement of the centre and angle; velocities.
    place: [f64; 3],
    velocity: [f64; 3],
    time: f64,
}

impl Rolling {
    /// A body of points at `positions` (m) above a floor whose surface is at y = 0.
    fn new(positions: &[Vector3<f64>], friction: f64) -> Rolling {
        let mut body = block([positions.len(), 1, 1], 2, STIFF);
        body.points.position.copy_from_slice(positions);
        let mut floor = block([120, 3, 1], 2, STIFF);
        floor.name = "floor".into();
        let below = Vector3::new(-20.0, -3.0, 0.0);
        floor.points.position.iter_mut().for_each(|x| *x += below);
        let mass = 1000.0 * body.points.volume.iter().sum::<f64>();
        let centre = positions.iter().sum::<Vector3<f64>>() / positions.len() as f64;
        let arms: Vec<Vector3<f64>> = positions.iter().map(|x| x - centre).collect();
        let squares = arms.iter().map(|r| r.x * r.x + r.y * r.y).sum::<f64>();
        let mut world = World::new(vec![body, floor]);
        let keys = format!("body = 'block'\nother = 'floor'\nfriction = {friction}");
        let contact: Contact = read(&keys);
        let (contact, _) = prepare(&mut world, contact, |setup| own(setup, 2)).expect("valid");
        Rolling {
            world,
            contact,
            inertia: mass * squares / positions.len() as f64,
            arms,
            mass,
            place: [0.0; 3],
            velocity: [0.0; 3],
            time: 0.0,
        }
    }

    fn set(&mut self, field: &str, value: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        let index = self.world.fields().find(0, field).expect("owned");
        let values = self.world.values_mut(index).chunks_exact_mut(3);
        for (value_of, arm) in values.zip(&self.arms) {
            value_of.copy_from_slice(value(arm).as_slice());
        }
    }

    /// Steps until a time on an incline of an angle; what bounces off the floor at the beginning is damped. A body that does
    /// not turn keeps its angle.
    fn run(&mut self, end: f64, angle: f64, turns: bool) {
        let dt = 0.5 * self.contact.stable_step(&self.world).expect("a limit");
        while self.time < end {
            let ([x, y, turned], [u, v, spin]) = (self.place, self.velocity);
            let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), turned);
            self.set("displacement", |arm| {
                turn * arm - arm + Vector3::new(x, y, 0.0)
            });
            self.set("velocity", |arm| {
                let arm = turn * arm;
                Vector3::new(u - spin * arm.y, v + spin * arm.x, 0.0)
            });
            for body in 0..2 {
                let index = self.world.fields().find(body, "impulse").expect("a sink");
                self.world.values_mut(index).fill(0.0);
            }
            let step = Step::new(self.time, dt);
            self.contact.apply(&self.world, step).expect("applies");
            let index = self.world.fields().find(0, "impulse").expect("a sink");
            let field = self.world.fields().field(index).data();
            let volume = self.world.body(0).points.volume[0];
            let (mut sum, mut moment) = (Vector3::zeros(), 0.0);
            for (impulse, arm) in field.flat().as_chunks::<3>().0.iter().zip(&self.arms) {
                let impulse = volume * Vector3::from(*impulse);
                sum += impulse;
                moment += (turn * arm).cross(&impulse).z;
            }
            drop(field);
            self.velocity[0] += dt * GRAVITY * angle.sin() + sum.x / self.mass;
            self.velocity[1] += -dt * GRAVITY * angle.cos() + sum.y / self.mass;
            if self.time < 0.2 * end {
                self.velocity[1] *= 0.95;
            }
            if turns {
                self.velocity[2] += moment / self.inertia;
            }
            (0..3).for_each(|c| self.place[c] += dt * self.velocity[c]);
            self.time += dt;
        }
    }
}

fn brick() -> Vec<Vector3<f64>> {
    let rows = (0..6).flat_map(|j| (0..10).map(move |i| (f64::from(i), f64::from(j))));
    rows.map(|(x, y)| Vector3::new(x, y + 0.5, 0.5)).collect()
}

/// A block stays where mu > tan(angle), and slides with `g (sin - mu cos)` elsewhere.
#[test]
fn a_block_on_an_incline_sticks_or_slides_by_coulombs_law() {
    let angle = 0.3f64.atan();
    let free = GRAVITY * angle.sin();
    for friction in [0.35, 0.6, 2.0] {
        let mut block = Rolling::new(&brick(), friction);
        block.run(2.0, angle, false);
        let drift = block.place[0] / (0.5 * free * block.time.powi(2));
        assert!(drift.abs() < 1e-3, "mu {friction}: {drift:e}");
    }
    for friction in [0.0, 0.1, 0.25] {
        let mut block = Rolling::new(&brick(), friction);
        block.run(2.0, angle, false);
        let expected = GRAVITY * (angle.sin() - friction * angle.cos());
        let found = block.place[0] / (0.5 * block.time.powi(2));
        assert!(
            (found / expected - 1.0).abs() < 0.02,
            "mu {friction}: {found} {expected}"
        );
    }
}
