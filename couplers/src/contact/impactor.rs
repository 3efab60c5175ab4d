//! A rigid ball that strikes a body.
//!
//! Points that would lie inside it at the end of a step are pushed out along the normal, as if a point of
//! the body's own material lay at its surface: `f = k V depth n`, with k as for the contact of points.

use nalgebra::Vector3;
use perimelt_core::numbers::check_positive;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{
    Coupler, LoadError, Prepared, Read, Report, RunError, RunningCoupler, SavedState, Setup,
    SetupError, Step, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{default_stiffness, stiffness};

/// A rigid ball (a disc in 2D) that moves on its way or, with a `mass`, as the body pushes back.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Impactor {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Centre at the start, m.
    pub centre: [f64; 3],
    /// Radius, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Velocity at the start, m/s.
    pub velocity: [f64; 3],
    /// Mass, kg; left out: nothing stops it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mass: Option<f64>,
    /// Stiffness of the contact in those of a bond.
    #[serde(default = "default_stiffness")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stiffness: f64,
}

/// An impactor that is ready to act.
struct RunningImpactor {
    body: usize,
    radius: f64,
    mass: Option<f64>,
    displacement: Read<Vector3<f64>>,
    velocity: Read<Vector3<f64>>,
    body_force: Write<Vector3<f64>>,
    /// Contact stiffness by point, N/m⁷.
    stiffness: Vec<f64>,
    /// Positions of the points at the end of the step, m.
    position: Vec<Vector3<f64>>,
    /// Force on each point, N.
    push: Vec<Vector3<f64>>,
    ball: Ball,
    /// Force on the ball, N.
    force: Vector3<f64>,
}

impl RunningImpactor {
    /// Computes the positions after `time` (s) at the present velocities.
    fn extrapolate(&mut self, world: &World, time: f64) {
        let reference = &world.body(self.body).points.position;
        let (displacement, velocity) = (world.read(self.displacement), world.read(self.velocity));
        let points = self.position.par_iter_mut().zip(&reference[..]);
        let points = points.zip(&*displacement);
        let points = points.zip(&*velocity).with_min_len(4096);
        points.for_all(|(((y, x), u), v)| *y = x + u + time * v);
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Ball {
    centre: Vector3<f64>,
    velocity: Vector3<f64>,
}

#[typetag::serialize(name = "impactor")]
impl Coupler for Impactor {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        check_positive("stiffness", self.stiffness, "")?;
        check_positive("radius", self.radius, "m")?;
        check_positive("mass", self.mass, "kg")?;
        let body = setup.find_body(self.body.as_deref())?;
        let this = setup.body(body);
        let (dimension, position) = (this.dimension, this.points.position.to_vec());
        let mut centre = Vector3::from(self.centre);
        (dimension..3).for_each(|axis| centre[axis] = position[0][axis]);
        let is_inside = position.iter().any(|x| (x - centre).norm() < self.radius);
        if setup.world().reducer(body).any(is_inside) {
            let message = "the ball starts inside the body";
            return Err(SetupError::value(
                "centre",
                message,
                "a position outside the body",
            ));
        }
        Ok(Box::new(RunningImpactor {
            body,
            radius: self.radius,
            mass: self.mass,
            displacement: setup.read(body, &keys::DISPLACEMENT)?,
            velocity: setup.read(body, &keys::VELOCITY)?,
            body_force: setup.add(body, &keys::BODY_FORCE)?,
            stiffness: stiffness(setup, body, self.stiffness)?,
            push: vec![Vector3::zeros(); position.len()],
            position,
            ball: Ball {
                centre,
                velocity: self.velocity.into(),
            },
            force: Vector3::zeros(),
        }))
    }
}

impl RunningCoupler for RunningImpactor {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let points = &world.body(self.body).points;
        self.extrapolate(world, step.size);
        self.ball.centre += step.size * self.ball.velocity;
        let mut body_force = world.write(self.body_force);
        let (radius, centre, stiffness) = (self.radius, self.ball.centre, &self.stiffness);
        let all = self.position.par_iter().zip(&mut body_force[..]);
        let all = all.zip(&mut self.push).enumerate().with_min_len(4096);
        all.for_all(|(i, ((y, sum), push))| {
            let out = y - centre;
            let distance = out.norm();
            *push = Vector3::zeros();
            if distance < radius && distance > 0.0 {
                let volume = points.volume[i];
                let force = out * (stiffness[i] * volume * (radius - distance) / distance);
                *sum += force;
                *push = force * volume;
            }
        });
        let push = &self.push;
        let on_body = world
            .reducer(self.body)
            .sum_points(|point| push[point].into());
        self.force = -Vector3::from(on_body);
        if let Some(mass) = self.mass {
            self.ball.velocity += self.force * (step.size / mass);
        }
        Ok(())
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.ball)
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.ball = erased_serde::deserialize(state)?;
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        let vectors = [
            ("centre", "m", self.ball.centre),
            ("velocity", "m/s", self.ball.velocity),
            ("force", "N", self.force),
        ];
        let report = |(name, unit, vector): (&'static str, &'static str, Vector3<f64>)| {
            let axes = ["x", "y", "z"].into_iter().zip(vector.data.0[0]);
            axes.map(move |(axis, value)| Report::new(format!("{name}.{axis}"), unit, value))
        };
        vectors.into_iter().flat_map(report).collect()
    }
}

perimelt_core::register_coupler!("impactor", Impactor, supports: [Motion, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, prepare, read, refusal, values};

    const ELASTIC: &str = "density = 1000\nyoungs_modulus = 1e6";

    fn own(setup: &mut Setup<'_>) {
        setup.own(0, &keys::DISPLACEMENT).expect("free");
        setup.own(0, &keys::VELOCITY).expect("free");
        setup.consume(0, &keys::BODY_FORCE).expect("free");
    }

    #[test]
    fn what_the_ball_loses_the_body_gets() {
        let mut world = World::new(vec![block([3, 3, 3], 3, ELASTIC)]);
        let keys_given =
            "centre = [1.5, 1.5, 4.4]\nradius = 1.5\nvelocity = [0, 0, -10]\nmass = 500";
        let impactor: Impactor = read(keys_given);
        let (mut impactor, _) = prepare(&mut world, impactor, own).expect("valid");
        // 0.4 m above the topmost point: after one tenth of a second it is 0.6 m deep
        impactor
            .apply(&world, Step::new(0.0, 0.03))
            .expect("applies");
        assert!(values(&world, &keys::BODY_FORCE).iter().all(|f| *f == 0.0));
        impactor
            .apply(&world, Step::new(0.03, 0.07))
            .expect("applies");
        let force = values(&world, &keys::BODY_FORCE);
        let along_z: f64 = force.iter().skip(2).step_by(3).sum();
        assert!(along_z < 0.0 && total_of(&force, 0).abs() < 1e-9 * along_z.abs());
        let reports = impactor.report();
        let of = |name: &str| {
            reports
                .iter()
                .find(|r| r.name == name)
                .expect("known")
                .value
        };
        assert!((of("force.z") + along_z).abs() < 1e-12 * along_z.abs());
        let gained = 0.07 / 500.0 * of("force.z");
        assert!((of("velocity.z") - (-10.0 + gained)).abs() < 1e-12 * gained);
    }

    /// `f = k V depth n` on each point inside of the ball, and the opposite on the ball.
    #[test]
    fn points_inside_the_ball_are_pushed_out_by_their_depth() {
        let mut world = World::new(vec![block([3, 1, 1], 2, ELASTIC)]);
        let setup = Setup::new(&mut world, std::path::Path::new("."));
        let k = stiffness(&setup, 0, 15.0).expect("a modulus")[1];
        // in a plane the centre has the height of the points
        let keys_given = "centre = [1.5, 2.3, 9]\nradius = 1.25\nvelocity = [0, -10, 0]";
        let impactor: Impactor = read(keys_given);
        let (mut impactor, _) = prepare(&mut world, impactor, own).expect("valid");
        impactor
            .apply(&world, Step::new(0.0, 0.1))
            .expect("applies");
        // 0.8 m above the middle point, sqrt(1.64) m from its neighbours
        let force = values(&world, &keys::BODY_FORCE);
        let expected = [0.0, 0.0, 0.0, 0.0, -0.45 * k, 0.0, 0.0, 0.0, 0.0];
        for (found, expected) in force.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12 * k, "{force:?}");
        }
        let reported: Vec<f64> = impactor.report().iter().map(|r| r.value).collect();
        assert_eq!(reported[2..6], [0.5, 0.0, -10.0, 0.0]);
        assert!((reported[1] - 1.3).abs() < 1e-12 && reported[0] == 1.5);
        assert!((reported[7] - 0.45 * k).abs() < 1e-12 * k, "{reported:?}");
        assert_eq!([reported[6], reported[8]], [0.0; 2]);
        // nothing stops a ball without a mass
        impactor
            .apply(&world, Step::new(0.1, 0.05))
            .expect("applies");
        assert!((impactor.report()[1].value - 0.8).abs() < 1e-12);
    }

    fn total_of(field: &[f64], axis: usize) -> f64 {
        field.iter().skip(axis).step_by(3).sum()
    }

    #[test]
    fn a_ball_inside_the_body_or_without_size_is_refused() {
        for (keys, message) in [
            ("centre = [1, 1, 1]\nradius = 1", "starts inside"),
            ("centre = [9, 1, 1]\nradius = 0", "`radius` is 0"),
            ("centre = [9, 1, 1]\nradius = 1\nmass = -1", "`mass` is -1"),
        ] {
            let mut world = World::new(vec![block([3, 3, 3], 3, ELASTIC)]);
            let impactor: Impactor = read(&format!("{keys}\nvelocity = [1, 0, 0]"));
            assert!(refusal(&mut world, impactor).contains(message), "{keys}");
        }
    }
}
