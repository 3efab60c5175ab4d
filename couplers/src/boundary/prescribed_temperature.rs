//! Prescribed temperature behind a face or at points.
//!
//! Behind a face, at the end of the step: `theta(layer) = 2 b(t) - theta(mirror)` (Wang (2025), eq. 7.17) or
//! `b(t)`. The points of a region have the temperature b(t); they lie half a spacing inside the face of
//! the body.

use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Coupler, Face, Programme, RunError, Setup, SetupError, Step, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LayerKind, Place, place};
use crate::InTime;

/// Temperature of a face or of the points of a region.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PrescribedTemperature {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Face of the body's box, such as `"x-"`; or give `region`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub face: Option<Face>,
    /// Region whose points are held; or give `face`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// Temperature (K): a number, `{ time = [...], value = [...] }` with times in s, or a formula in t (s).
    pub value: InTime,
    /// Values in the layer behind a face; default `mirrored`.
    #[serde(default)]
    pub layer: LayerKind,
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<TemperatureSink>,
}

/// Where the prescribed temperature goes.
#[derive(Debug)]
enum TemperatureSink {
    Layer(LayerHandle),
    Points {
        points: Vec<u32>,
        constraint: Write<f64>,
        held: Write<f64>,
    },
}

#[typetag::serialize(name = "prescribed_temperature")]
impl Coupler for PrescribedTemperature {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        // `thermal` holds points with material only
        setup.follow_activity(body);
        let prepared = match place(setup, body, self.face, self.region.as_deref())? {
            Place::Face(face) => {
                TemperatureSink::Layer(setup.layer(body, &keys::TEMPERATURE, face, true)?)
            }
            Place::Points(points) => TemperatureSink::Points {
                points,
                constraint: setup.add(body, &keys::TEMPERATURE_CONSTRAINT)?,
                held: setup.add(body, &keys::HELD_TEMPERATURE)?,
            },
        };
        self.prepared = Some(prepared);
        Ok(())
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let value = self.value.at(step.end());
        match self.prepared.as_ref().expect("prepared before the run") {
            TemperatureSink::Layer(layer) => {
                let (scale, offset) = self.layer.rule(value);
                world.set_layer(*layer, [scale; 3], [offset; 3]);
            }
            TemperatureSink::Points {
                points,
                constraint,
                held,
            } => {
                let (mut constraint, mut held) = (world.write(*constraint), world.write(*held));
                for &point in points {
                    constraint[point as usize] += 1.0;
                    held[point as usize] += value;
                }
            }
        }
        Ok(())
    }

    fn next_event(&self, after: f64) -> Option<f64> {
        self.value.next_event(after)
    }

    fn programme(&self, _run_end: f64) -> Option<Programme> {
        Programme::of_values([("value", &self.value)])
    }
}

perimelt_core::register_coupler!("prescribed_temperature", PrescribedTemperature);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, values};

    const RAMP: &str = "value = { time = [0, 4], value = [300, 700] }";

    #[test]
    fn a_layer_follows_the_value_at_the_end_of_the_step() {
        for (kind, rule) in [("mirrored", (-1.0, 1000.0)), ("constant", (0.0, 500.0))] {
            let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
            let table = format!("face = 'x+'\nlayer = '{kind}'\n{RAMP}");
            let mut boundary: PrescribedTemperature = read(&table);
            let (layers, claimed, prescribed) = prepare(&mut world, &mut boundary, |setup| {
                setup.own(0, &keys::TEMPERATURE).expect("free");
                setup.layers(0, &keys::TEMPERATURE)
            })
            .expect("valid");
            assert_eq!((claimed, prescribed), (vec![Face::XMax], vec![Face::XMax]));
            apply(&world, &mut boundary, 1.0);
            let rules = world.layer_rules(layers);
            assert_eq!((rules[0].scale[0], rules[0].offset[0]), rule, "{kind}");
            assert_eq!(boundary.next_event(0.0), Some(4.0));
        }
    }

    #[test]
    fn the_points_of_a_region_are_held_and_no_others() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        let mut boundary: PrescribedTemperature = read(&format!("region = 'left'\n{RAMP}"));
        prepare(&mut world, &mut boundary, |setup| {
            setup
                .consume(0, &keys::TEMPERATURE_CONSTRAINT)
                .expect("free");
            setup.consume(0, &keys::HELD_TEMPERATURE).expect("free");
        })
        .expect("valid");
        apply(&world, &mut boundary, 0.0);
        assert_eq!(
            values(&world, &keys::TEMPERATURE_CONSTRAINT),
            [1.0, 0.0, 0.0]
        );
        assert_eq!(values(&world, &keys::HELD_TEMPERATURE), [400.0, 0.0, 0.0]);
    }

    #[test]
    fn a_place_is_needed_and_only_one() {
        let both = "value = 1\nface = 'x-'\nregion = 'left'";
        for (table, message) in [("value = 1", "neither `face` nor `region`"), (both, "both")] {
            let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
            let mut boundary: PrescribedTemperature = read(table);
            assert!(refusal(&mut world, &mut boundary).contains(message));
        }
    }
}
