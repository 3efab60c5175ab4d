//! A forcing zone (relaxation zone): a region of space in which the flow relaxes towards a target velocity.
//!
//! ```text
//! body_force += rho (v_target(x, t) - v) / time     for the points that lie in the zone now
//! ```
//!
//! with the reference density. In a channel that is periodic along its axis the zone is outflow and inflow at once: fluid
//! that leaves through `x+` enters at `x-`, and the zone restores the profile and the pressure lost in the channel and at
//! the bodies in it. Points enter and leave the zone as they move.
//!
//! The flow does not reach the target exactly: to supply a rise of pressure dp over the length L of a zone the velocity
//! stays below the target by `dp time / (rho L)`.

use nalgebra::Vector3;
use perimelt_core::numbers::{check_at_least, check_positive};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::shape::{Shape, StlError};
use perimelt_core::text::position;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, Formula, Read, Report, RunError, RunningCoupler, Setup, SetupError, Step, World,
    Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Least number of points that a thread processes.
const POINTS: usize = 256;

/// Draws the velocity in a region of space towards a target; needs the material property `density`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForcingZone {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Region of space, such as `shape.box = { min = [0, 0, 0], max = [0.1, 0.4, 0.01] }` (m). It counts where points
    /// are now, not where they were at the start.
    pub shape: Shape,
    /// Components of the target velocity, m/s: numbers, or formulas in x, y, z (m) and t (s).
    pub velocity: [Formula; 3],
    /// Relaxation time, s: differences from the target decay with it. Steps are not longer.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time: f64,
    /// Time during which the target grows from zero, s, as `(1 - cos(pi t / ramp)) / 2`.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub ramp: f64,
}

/// A forcing zone that is ready to act.
struct RunningForcingZone {
    keys: ForcingZone,
    body: BodyIndex,
    /// Density by material, kg/m³.
    density: Vec<f64>,
    velocity: Read<Vector3<f64>>,
    body_force: Write<Vector3<f64>>,
    /// Force per volume by point, N/m³.
    added: Vec<Vector3<f64>>,
    /// Force on the body in the last step, N.
    force: Vector3<f64>,
}

impl ForcingZone {
    fn check_numbers(&self) -> Result<(), SetupError> {
        check_positive("time", self.time, "s")?;
        check_at_least("ramp", self.ramp, 0.0, "s")?;
        match self.shape.mistake() {
            Some(message) => Err(SetupError::value("shape", message, "a shape")),
            None => Ok(()),
        }
    }

    /// Refuses a zone that the body cannot reach, and targets that are no velocity at its points.
    fn check_zone(&self, setup: &Setup<'_>, body: BodyIndex) -> Result<(), SetupError> {
        let body = setup.body(body);
        let (low, high) = body.tank.unwrap_or_else(|| body.bounds());
        let is_beside = self.shape.bounds().is_some_and(|(min, max)| {
            (0..body.dimension).any(|a| max[a] <= low[a] || min[a] >= high[a])
        });
        if is_beside {
            let message = format!(
                "the zone lies outside of the box of body `{}`, which reaches from {} m to {} m",
                body.name,
                position(low),
                position(high)
            );
            return Err(SetupError::value("shape", message, "a zone in the body"));
        }
        let inside = body.points.position.iter();
        for x in inside.filter(|x| self.shape.contains(x, 0.0)) {
            let target = self.target(x, 0.0);
            if target.iter().any(|v| !v.is_finite()) {
                let at = position(*x);
                let message = format!("the target velocity at {at} m is {target:?}");
                let expected = "finite components at every point of the zone";
                return Err(SetupError::value("velocity", message, expected));
            }
            if body.dimension == 2 && target.z != 0.0 {
                let message = "the target velocity of a 2D body has a z component";
                return Err(SetupError::value("velocity", message, "0 along z"));
            }
        }
        Ok(())
    }

    /// Target velocity without the ramp, m/s.
    fn target(&self, x: &Vector3<f64>, time: f64) -> Vector3<f64> {
        Vector3::from_fn(|a, _| self.velocity[a].at((*x).into(), time))
    }

    /// Fraction of the target velocity at a time (s).
    fn fraction(&self, time: f64) -> f64 {
        match time < self.ramp {
            true => 0.5 * (1.0 - (std::f64::consts::PI * time / self.ramp).cos()),
            false => 1.0,
        }
    }
}

#[typetag::serialize(name = "forcing_zone")]
impl Coupler for ForcingZone {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let unreadable =
            |e: StlError| SetupError::value("shape", e.to_string(), "a closed surface");
        self.shape.load(&setup.path("")).map_err(unreadable)?;
        self.check_numbers()?;
        self.check_zone(setup, body)?;
        Ok(Box::new(RunningForcingZone {
            keys: *self,
            body,
            density: setup.world().reference_densities(body)?,
            velocity: setup.read(body, &keys::VELOCITY)?,
            body_force: setup.add(body, &keys::BODY_FORCE)?,
            added: Vec::new(),
            force: Vector3::zeros(),
        }))
    }
}

impl RunningCoupler for RunningForcingZone {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let keys = &self.keys;
        let body = world.body(self.body);
        let now = world.configuration(self.body);
        let (time, fraction) = (step.middle(), keys.fraction(step.middle()));
        let velocity = world.read(self.velocity);
        let velocity: &[Vector3<f64>] = &velocity;
        let (density, positions) = (&self.density, now.positions());
        let added = |i: usize| {
            let x = &positions[i];
            if !keys.shape.contains(x, 0.0) {
                return Vector3::zeros();
            }
            let density = density[body.material_of_point[i] as usize];
            (fraction * keys.target(x, time) - velocity[i]) * (density / keys.time)
        };
        let points = (0..velocity.len()).into_par_iter().with_min_len(POINTS);
        points.map(added).fill(&mut self.added);
        self.force = Vector3::zeros();
        let mut body_force = world.write(self.body_force);
        for ((sum, added), volume) in body_force
            .iter_mut()
            .zip(&self.added)
            .zip(&body.points.volume)
        {
            *sum += added;
            self.force += added * *volume;
        }
        Ok(())
    }

    /// The difference from the target is evaluated at the start of a step, so that longer steps overshoot.
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        Some(self.keys.time)
    }

    /// Force on the body, N.
    fn report(&self) -> Vec<Report> {
        let axes = ["x", "y", "z"].into_iter().zip(&self.force);
        axes.map(|(axis, force)| Report::new(format!("force.{axis}"), "N", *force))
            .collect()
    }
}

perimelt_core::register_coupler!("forcing_zone", ForcingZone, supports: [Motion, Flow]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set_vector, values};

    const ZONE: &str = "shape.box = { min = [1, 0, 0], max = [3, 1, 1] }\ntime = 0.5\n";

    fn ready(keys: &str) -> (World, Box<dyn RunningCoupler>) {
        let mut world = World::new(vec![block([4, 1, 1], 3, STEEL)]);
        let zone: ForcingZone = read(&format!("{keys}\n{ZONE}"));
        let (zone, _) = prepare(&mut world, zone, |setup| {
            setup.own(0, &keys::VELOCITY).expect("free");
            setup.consume(0, &keys::BODY_FORCE).expect("free");
        })
        .expect("valid");
        (world, zone)
    }

    #[test]
    fn points_in_the_zone_are_drawn_towards_the_target() {
        let (mut world, mut zone) = ready("velocity = ['2 * x + t', 1, 0]");
        set_vector(&mut world, &keys::VELOCITY, Vector3::new(1.0, 0.0, -3.0));
        apply(&world, &mut *zone, 0.0);
        // points at 0.5, 1.5, 2.5, 3.5 m; the middle of the step is at 0.5 s; rho / time = 16000 kg/(m3 s)
        let force = values(&world, &keys::BODY_FORCE);
        let expected = [
            [0.0; 3],
            [2.5 * 16e3, 16e3, 48e3],
            [4.5 * 16e3, 16e3, 48e3],
            [0.0; 3],
        ];
        assert_eq!(force, expected.concat());
        // volumes of 1 m3
        let reported: Vec<f64> = zone.report().iter().map(|r| r.value).collect();
        assert_eq!(reported, [7.0 * 16e3, 32e3, 96e3]);
        assert_eq!(zone.stable_step(&world), Some(0.5));
    }

    #[test]
    fn the_momentum_that_the_zone_supplies_is_the_deficit_within_its_relaxation_time() {
        let (mut world, mut zone) = ready("velocity = [4, 0, 0]");
        set_vector(&mut world, &keys::VELOCITY, Vector3::new(4.0, 0.0, 0.0));
        apply(&world, &mut *zone, 0.0);
        assert_eq!(values(&world, &keys::BODY_FORCE), [0.0; 12]);
        set_vector(&mut world, &keys::VELOCITY, Vector3::new(3.0, 0.0, 0.0));
        apply(&world, &mut *zone, 0.0);
        // two points of 8000 kg, 1 m/s too slow, within 0.5 s
        let total: f64 = values(&world, &keys::BODY_FORCE).iter().sum();
        assert_eq!(total * 0.5, 16e3);
        assert_eq!(zone.report()[0].value * 0.5, 16e3);
    }

    #[test]
    fn the_target_grows_along_the_ramp() {
        let keys = "velocity = [2, 0, 0]\nramp = 2";
        let (world, mut zone) = ready(keys);
        // the middle of the second from 0.5 s
        apply(&world, &mut *zone, 0.5);
        let force = values(&world, &keys::BODY_FORCE)[3];
        assert!((force - 16e3).abs() < 1e-9, "half of the target: {force}");
        let zone: ForcingZone = read(&format!("{keys}\n{ZONE}"));
        assert_eq!((zone.fraction(0.0), zone.fraction(2.0)), (0.0, 1.0));
    }

    #[test]
    fn mistakes_are_refused() {
        let inside = "shape.box = { min = [0, 0, 0], max = [1, 1, 1] }";
        let target = "velocity = [1, 0, 0]";
        for (keys, message) in [
            (format!("{inside}\n{target}\ntime = 0"), "time: `time` is 0"),
            (
                format!("{inside}\n{target}\ntime = 1\nramp = -1"),
                "ramp: `ramp` is -1",
            ),
            (
                format!("shape.box = {{ min = [1, 0, 0], max = [0, 1, 1] }}\n{target}\ntime = 1"),
                "shape: the box has max 0 below min 1 along x",
            ),
            (
                format!("shape.box = {{ min = [7, 0, 0], max = [8, 1, 1] }}\n{target}\ntime = 1"),
                "shape: the zone lies outside of the box of body `block`",
            ),
            (
                format!("{inside}\nvelocity = ['1 / (x - 0.5)', 0, 0]\ntime = 1"),
                "velocity: the target velocity at [0.5, 0.5, 0.5] m",
            ),
            (
                format!("{inside}\nvelocity = [1, 0, 'x']\ntime = 1"),
                "velocity: the target velocity of a 2D body has a z component",
            ),
        ] {
            let mut world = World::new(vec![block([4, 1, 1], 2, STEEL)]);
            let found = refusal(&mut world, read::<ForcingZone>(&keys));
            assert!(found.contains(message), "{found}");
        }
        let unknown = "velocity = ['r', 0, 0]\ntime = 1";
        let error = toml::from_str::<ForcingZone>(unknown).expect_err("r is unknown");
        assert!(error.message().contains("`r`"), "{error}");
    }
}
