//! Clamps: points held at zero displacement until the clamp is released.

use nalgebra::Vector3;
use perimelt_core::{
    Axis, Coupler, Programme, RunError, Setup, SetupError, Step, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<ClampedPoints>,
}

#[derive(Debug)]
struct ClampedPoints {
    points: Vec<u32>,
    held: [bool; 3],
    constraint: Write<Vector3<f64>>,
}

impl Clamp {
    /// Whether the clamp is closed at the end of `step`. The tolerance keeps rounding from releasing it a step early.
    fn is_closed(&self, step: Step) -> bool {
        self.until
            .is_none_or(|until| step.end() - until <= 1e-6 * step.size)
    }
}

#[typetag::serialize(name = "clamp")]
impl Coupler for Clamp {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
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
        // the sum of held displacements is zero without an addition
        self.prepared = Some(ClampedPoints {
            points: setup.region(body, "region", &self.region)?.points,
            held,
            constraint: setup.add(body, &keys::CONSTRAINT)?,
        });
        Ok(())
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let p = self.prepared.as_ref().expect("prepared before the run");
        if self.is_closed(step) {
            let mut constraint = world.write(p.constraint);
            let held = Vector3::from(p.held.map(|h| f64::from(u8::from(h))));
            p.points
                .iter()
                .for_each(|&point| constraint[point as usize] += held);
        }
        Ok(())
    }

    fn next_event(&self, after: f64) -> Option<f64> {
        self.until.filter(|until| *until > after)
    }

    fn programme(&self, _run_end: f64) -> Option<Programme> {
        let until = self.until?;
        Some(Programme::new("the clamp is released", until))
    }
}

perimelt_core::register_coupler!("clamp", Clamp, supports: [Births, Cuts]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set_vector, values};

    #[test]
    fn a_clamp_holds_its_components_up_to_its_release() {
        let mut world = World::new(vec![block([2, 1, 1], 2, STEEL)]);
        let mut clamp: Clamp = read("region = 'left'\nuntil = 3");
        prepare(&mut world, &mut clamp, |setup| {
            setup.consume(0, &keys::CONSTRAINT).expect("free");
        })
        .expect("valid");
        assert_eq!(clamp.next_event(0.0), Some(3.0));
        assert_eq!(clamp.next_event(3.0), None);
        for (start, held) in [(0.0, 1.0), (2.0, 1.0), (2.0 + 1e-15, 1.0), (3.0, 0.0)] {
            set_vector(&mut world, &keys::CONSTRAINT, Vector3::zeros());
            apply(&world, &mut clamp, start);
            let constraint = values(&world, &keys::CONSTRAINT);
            assert_eq!(constraint, [held, held, 0.0, 0.0, 0.0, 0.0], "from {start}");
        }
    }

    #[test]
    fn a_clamp_may_hold_some_components_for_ever() {
        let mut world = World::new(vec![block([2, 1, 1], 3, STEEL)]);
        let mut clamp: Clamp = read("region = 'left'\ncomponents = ['z', 'x']");
        prepare(&mut world, &mut clamp, |setup| {
            setup.consume(0, &keys::CONSTRAINT).expect("free");
        })
        .expect("valid");
        apply(&world, &mut clamp, 1e9);
        let held = [1.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        assert_eq!(values(&world, &keys::CONSTRAINT), held);
    }

    #[test]
    fn a_plate_is_not_held_along_z() {
        for components in ["['z']", "['x', 'z']", "[]"] {
            let mut world = World::new(vec![block([2, 1, 1], 2, STEEL)]);
            let mut clamp: Clamp = read(&format!("region = 'left'\ncomponents = {components}"));
            assert!(refusal(&mut world, &mut clamp).contains("one that a 2D body does not have"));
        }
    }
}
