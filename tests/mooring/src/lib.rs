//! A body of its own physics that meets a body of ours: the points of a fender sit on springs and dashpots (`fender`), and a
//! coupler pushes them and the points of a ship apart (`bumper`). Linking this crate makes both known.
use nalgebra::Vector3;
use perimelt_core::{
    Coupler, PairList, Physics, Prepared, Read, RunError, RunningCoupler, RunningPhysics, Setup,
    Step, Work, World, Write, keys, register_coupler, register_physics,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Points on springs and dashpots: `rho u'' = -k u - c u' + j`, with the impulses j of others.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fender {
    /// Body that yields.
    body: String,
    /// Stiffness by volume, N/m⁴.
    stiffness: f64,
    /// Damping by volume, N s/m⁴.
    damping: f64,
}

struct RunningFender {
    stiffness: f64,
    damping: f64,
    displacement: Write<Vector3<f64>>,
    velocity: Write<Vector3<f64>>,
    impulse: Option<Read<Vector3<f64>>>,
    density: Vec<f64>,
}

#[typetag::serialize(name = "fender")]
impl Physics for Fender {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        let body = setup.find_body(Some(&self.body))?;
        Ok(Box::new(RunningFender {
            stiffness: self.stiffness,
            damping: self.damping,
            displacement: setup.own(body, &keys::DISPLACEMENT)?,
            velocity: setup.own(body, &keys::VELOCITY)?,
            impulse: setup.take_if_added(body, &keys::IMPULSE)?,
            density: setup.world().density_at_points(body)?,
        }))
    }
}

register_physics!("fender", Fender);

impl RunningPhysics for RunningFender {
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        let lightest = self.density.iter().copied().fold(f64::INFINITY, f64::min);
        Some((2.0 * (lightest / self.stiffness).sqrt()).min(lightest / self.damping))
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        let mut u = world.write(self.displacement);
        let mut v = world.write(self.velocity);
        let impulse = self.impulse.map(|j| world.read(j));
        for (i, rho) in self.density.iter().enumerate() {
            let given = impulse.as_deref().map_or_else(Vector3::zeros, |j| j[i]);
            let force = -self.stiffness * u[i] - self.damping * v[i];
            v[i] += (given + step.size * force) / *rho;
            u[i] += step.size * v[i];
        }
        Ok(Work::of_stages(1))
    }
}

/// Points of two bodies that are closer than `reach` push each other apart.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Bumper {
    /// The two bodies.
    bodies: [String; 2],
    /// Distance at which points meet, m.
    reach: f64,
    /// Force by distance and volumes, N/m⁷.
    stiffness: f64,
}

struct RunningBumper {
    keys: Bumper,
    pairs: PairList,
    sides: [BumperSide; 2],
}

/// Momentum that a body gets, and the volumes of its points, m³.
struct BumperSide(Write<Vector3<f64>>, Vec<f64>);

#[typetag::serialize(name = "bumper")]
impl Coupler for Bumper {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let [a, b] = &self.bodies;
        let bodies = [setup.find_body(Some(a))?, setup.find_body(Some(b))?];
        let volumes = bodies.map(|body| setup.body(body).points.volume.to_vec());
        let reach = volumes.each_ref().map(|v| vec![self.reach; v.len()]);
        let pairs = PairList::between(
            setup.world(),
            bodies,
            reach.each_ref().map(|reach| &reach[..]),
        );
        let [first, second] = volumes;
        let first = BumperSide(setup.add(bodies[0], &keys::IMPULSE)?, first);
        let second = BumperSide(setup.add(bodies[1], &keys::IMPULSE)?, second);
        Ok(Box::new(RunningBumper {
            keys: *self,
            pairs,
            sides: [first, second],
        }))
    }
}

register_coupler!("bumper", Bumper, supports: [Motion]);

impl RunningCoupler for RunningBumper {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let (pairs, [a, b]) = (&mut self.pairs, &self.sides);
        pairs.update(world);
        let (first, positions) = (pairs.first_points(), pairs.positions());
        let (mut on_first, mut on_second) = (world.write(a.0), world.write(b.0));
        for i in 0..first {
            for &j in pairs.candidates(i) {
                let apart = positions[i] - positions[j as usize];
                let overlap = self.keys.reach - apart.norm();
                if overlap > 0.0 {
                    let j = j as usize - first;
                    let impulse = apart.normalize() * (step.size * self.keys.stiffness * overlap);
                    on_first[i] += impulse * b.1[j];
                    on_second[j] -= impulse * a.1[i];
                }
            }
        }
        Ok(())
    }
}
