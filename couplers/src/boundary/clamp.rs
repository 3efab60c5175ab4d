//! Clamps: points held at zero displacement until the clamp is released.

use nalgebra::Vector3;
use perimelt_core::numbers::check_at_least;
use perimelt_core::{
    Axis, Coupler, Prepared, Programme, RunError, RunningCoupler, Setup, SetupError, Step,
    StepLimits, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::with_programme;

/// Holds the points of a region at zero displacement.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clamp {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Region whose points are held.
    pub region: String,
    /// Components that are held, such as `["y"]`; default all that the body has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub components: Option<Vec<Axis>>,
    /// Time of release (s); default never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<f64>,
}

/// A clamp that is ready to act.
struct RunningClamp {
    points: Vec<u32>,
    held: [bool; 3],
    until: Option<f64>,
    constraint: Write<Vector3<f64>>,
}

impl RunningClamp {
    /// Whether the clamp is closed at the end of `step`, with a tolerance for rounding.
    fn is_closed(&self, step: Step) -> bool {
        self.until
            .is_none_or(|until| step.end() - until <= 1e-6 * step.size)
    }
}

#[typetag::serialize(name = "clamp")]
impl Coupler for Clamp {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        let dimension = setup.body(body).dimension;
        let held = match &self.components {
            None => std::array::from_fn(|axis| axis < dimension),
            Some(components) => {
                let mut held = [false; 3];
                components
                    .iter()
                    .for_each(|axis| held[*axis as usize] = true);
                held
            }
        };
        if held == [false; 3] || held[dimension..].contains(&true) {
            return Err(SetupError::value(
                "components",
                format!("no component, or one that a {dimension}D body does not have"),
                format!("some of {:?}", &["x", "y", "z"][..dimension]),
            ));
        }
        check_at_least("until", self.until, 0.0, "s")?;
        // the sum of held displacements is zero without an addition
        let released = |until| Programme::new("the clamp is released", until);
        setup.stepping(with_programme(self.until.map(released)));
        Ok(Box::new(RunningClamp {
            points: setup.region(body, "region", &self.region)?.points,
            held,
            until: self.until,
            constraint: setup.add(body, &keys::CONSTRAINT)?,
        }))
    }
}

impl RunningCoupler for RunningClamp {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        if self.is_closed(step) {
            let mut constraint = world.write(self.constraint);
            let held = Vector3::from(self.held.map(|h| f64::from(u8::from(h))));
            self.points
                .iter()
                .for_each(|&point| constraint[point as usize] += held);
        }
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: self.until.filter(|until| *until > time),
            ..StepLimits::default()
        }
    }
}

perimelt_core::register_coupler!("clamp", Clamp, supports: [Births, Cuts, Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set_vector, values};

    #[test]
    fn a_clamp_holds_its_components_up_to_its_release() {
        let mut world = World::new(vec![block([2, 1, 1], 2, STEEL)]);
        let clamp: Clamp = read("region = 'left'\nuntil = 3");
        let (mut clamp, _) = prepare(&mut world, clamp, |setup| {
            setup.consume(0, &keys::CONSTRAINT).expect("free");
        })
        .expect("valid");
        assert_eq!(clamp.step_limits(0.0).next_event, Some(3.0));
        assert_eq!(clamp.step_limits(3.0).next_event, None);
        for (start, held) in [(0.0, 1.0), (2.0, 1.0), (2.0 + 1e-15, 1.0), (3.0, 0.0)] {
            set_vector(&mut world, &keys::CONSTRAINT, Vector3::zeros());
            apply(&world, &mut *clamp, start);
            let constraint = values(&world, &keys::CONSTRAINT);
            assert_eq!(constraint, [held, held, 0.0, 0.0, 0.0, 0.0], "from {start}");
        }
    }

    #[test]
    fn a_clamp_may_hold_some_components_for_ever() {
        let mut world = World::new(vec![block([2, 1, 1], 3, STEEL)]);
        let clamp: Clamp = read("region = 'left'\ncomponents = ['z', 'x']");
        let (mut clamp, _) = prepare(&mut world, clamp, |setup| {
            setup.consume(0, &keys::CONSTRAINT).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *clamp, 1e9);
        let held = [1.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        assert_eq!(values(&world, &keys::CONSTRAINT), held);
    }

    #[test]
    fn a_plate_is_not_held_along_z() {
        for components in ["['z']", "['x', 'z']", "[]"] {
            let mut world = World::new(vec![block([2, 1, 1], 2, STEEL)]);
            let clamp: Clamp = read(&format!("region = 'left'\ncomponents = {components}"));
            assert!(refusal(&mut world, clamp).contains("one that a 2D body does not have"));
        }
    }
}
