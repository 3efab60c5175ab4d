//! Prescribed temperature behind a face or at points.
//!
//! Behind a face, at the end of the step: `theta(layer) = 2 b(t) - theta(mirror)` (Wang (2025), eq. 7.17) or
//! `b(t)`. Where b depends on the position, it is evaluated on the face in front of the mirror point. The points of a region
//! have the temperature b(t) at their reference positions; they lie half a spacing inside the face of the body.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Body, Coupler, Face, GivenValue, InSpace, LayerRole, Placed, Prepared, Programme, RunError,
    RunningCoupler, Setup, Step, StepLimits, World, Write, flattened, keys,
};

use super::{BoundaryLocation, HeldPlace, LayerKind, with_programme};

flattened! {
    /// Temperature of a face or of the points of a region.
    #[derive(Debug)]
    pub struct PrescribedTemperature {
        ..place: HeldPlace,
        /// Temperature (K): a number, `{ time = [...], value = [...] }` with times in s, a formula in x, y, z (m) and t (s), or files of
        /// a measurement or another program.
        pub value: InSpace,
        /// Values in the layer behind a face; default `mirrored`.
        #[serde(default)]
        pub layer: LayerKind,
    }
}

/// A prescribed temperature that is ready to act.
struct RunningPrescribedTemperature {
    layer: LayerKind,
    sink: TemperatureSink,
}

/// Target of the prescribed temperature.
#[derive(Debug)]
enum TemperatureSink {
    /// One value on the whole face.
    Layer(LayerHandle, Placed),
    LayerByPlace(LayerHandle, OnFace),
    Points {
        points: Vec<u32>,
        value: Placed,
        constraint: Write<f64>,
        held: Write<f64>,
    },
}

/// Values at the positions on a face in front of points.
#[derive(Debug)]
struct OnFace {
    places: Placed,
    /// Index of the position in front of each point of the body.
    place: Vec<u32>,
}

/// The distinct positions on a face in front of the points of a body, and the index of the position of each point. On a lattice
/// they are as many as the points of a layer.
fn in_front(body: &Body, face: Face) -> (Vec<Vector3<f64>>, Vec<u32>) {
    let (min, max) = body.bounds();
    let axis = face.axis();
    let on_face = if face.is_upper() {
        max[axis]
    } else {
        min[axis]
    };
    let grain = 1e-6 * body.finest_spacing();
    let (mut places, mut known) = (Vec::new(), BTreeMap::new());
    let place = body.points.position.iter().map(|position| {
        let mut at = *position;
        at[axis] = on_face;
        let key: [i64; 3] = std::array::from_fn(|a| (at[a] / grain).round() as i64);
        *known.entry(key).or_insert_with(|| {
            places.push(at);
            places.len() as u32 - 1
        })
    });
    let place = place.collect();
    (places, place)
}

#[typetag::serialize(name = "prescribed_temperature")]
impl Coupler for PrescribedTemperature {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.place.body.as_deref())?;
        let given = GivenValue {
            key: "value",
            value: &self.value,
            column: "temperature",
        };
        let sink = match self.place.location(setup, body)? {
            BoundaryLocation::Face(face) if self.value.uniform().is_some() => {
                let centre = vec![Vector3::zeros()];
                let value = setup.placed(body, given, centre)?;
                TemperatureSink::Layer(
                    setup.layer(body, &keys::TEMPERATURE, face, LayerRole::Prescribed)?,
                    value,
                )
            }
            BoundaryLocation::Face(face) => {
                let (places, place) = in_front(setup.body(body), face);
                let places = setup.placed(body, given, places)?;
                let layer = setup.layer(body, &keys::TEMPERATURE, face, LayerRole::Prescribed)?;
                TemperatureSink::LayerByPlace(layer, OnFace { places, place })
            }
            BoundaryLocation::Points(points) => TemperatureSink::Points {
                value: {
                    let position = &setup.body(body).points.position;
                    let positions = points.iter().map(|p| position[*p as usize]).collect();
                    setup.placed(body, given, positions)?
                },
                points,
                constraint: setup.add(body, &keys::TEMPERATURE_CONSTRAINT)?,
                held: setup.add(body, &keys::HELD_TEMPERATURE)?,
            },
        };
        let programme = Programme::of_values(self.value.uniform().map(|value| ("value", value)));
        setup.stepping(with_programme(programme));
        let layer = self.layer;
        Ok(Box::new(RunningPrescribedTemperature { layer, sink }))
    }
}

impl RunningCoupler for RunningPrescribedTemperature {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let time = step.end();
        let error =
            |e: perimelt_core::in_space::PlacedError| e.during("prescribed_temperature", time);
        match &mut self.sink {
            TemperatureSink::Layer(layer, value) => {
                let value = value.at(time).map_err(error)?[0];
                let (scale, offset) = self.layer.rule(value);
                world.set_layer(*layer, [scale; 3], [offset; 3]);
            }
            TemperatureSink::LayerByPlace(layer, OnFace { places, place }) => {
                let values = places.at(time).map_err(error)?;
                let values: Arc<[f64]> = place.iter().map(|p| values[*p as usize]).collect();
                let (scale, _) = self.layer.rule(0.0);
                world.set_layer_values(*layer, scale, values);
            }
            TemperatureSink::Points {
                points,
                value,
                constraint,
                held,
            } => {
                let values = value.at(time).map_err(error)?;
                let (mut constraint, mut held) = (world.write(*constraint), world.write(*held));
                for (&point, value) in points.iter().zip(values) {
                    constraint[point as usize] += 1.0;
                    held[point as usize] += value;
                }
            }
        }
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let (TemperatureSink::Layer(_, value)
        | TemperatureSink::LayerByPlace(_, OnFace { places: value, .. })
        | TemperatureSink::Points { value, .. }) = &self.sink;
        StepLimits {
            next_event: value.next_event(time),
            ..StepLimits::default()
        }
    }
}

perimelt_core::register_coupler!("prescribed_temperature", PrescribedTemperature, supports: [Motion, Flow, Births, Cuts, Layers, Division]);

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
            let boundary: PrescribedTemperature = read(&table);
            let (mut boundary, layers) = prepare(&mut world, boundary, |setup| {
                setup.own(0, &keys::TEMPERATURE).expect("free");
                setup.layers(0, &keys::TEMPERATURE)
            })
            .expect("valid");
            assert_eq!(layers.faces(), [Face::XMax]);
            assert_eq!(layers.prescribed, [Face::XMax]);
            apply(&world, &mut *boundary, 1.0);
            let rules = world.layer_rules(layers.handle);
            assert_eq!((rules[0].scale[0], rules[0].offset[0]), rule, "{kind}");
            assert_eq!(boundary.step_limits(0.0).next_event, Some(4.0));
        }
    }

    #[test]
    fn the_points_of_a_region_are_held_and_no_others() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        let boundary: PrescribedTemperature = read(&format!("region = 'left'\n{RAMP}"));
        let (mut boundary, _) = prepare(&mut world, boundary, |setup| {
            setup
                .consume(0, &keys::TEMPERATURE_CONSTRAINT)
                .expect("free");
            setup.consume(0, &keys::HELD_TEMPERATURE).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *boundary, 0.0);
        assert_eq!(
            values(&world, &keys::TEMPERATURE_CONSTRAINT),
            [1.0, 0.0, 0.0]
        );
        assert_eq!(values(&world, &keys::HELD_TEMPERATURE), [400.0, 0.0, 0.0]);
    }

    /// The value on the face is that at the place in front of the point, not at the point.
    #[test]
    fn a_value_may_depend_on_the_place() {
        for (layer, factor) in [("mirrored", -1.0), ("constant", 0.0)] {
            let mut world = World::new(vec![block([3, 2, 1], 2, STEEL)]);
            let table = format!("face = 'x+'\nlayer = '{layer}'\nvalue = '100 * x + 10 * y + t'");
            let boundary: PrescribedTemperature = read(&table);
            let (mut boundary, layers) = prepare(&mut world, boundary, |setup| {
                setup.own(0, &keys::TEMPERATURE).expect("free");
                setup.layers(0, &keys::TEMPERATURE)
            })
            .expect("valid");
            apply(&world, &mut *boundary, 1.0);
            let rule = &world.layer_rules(layers.handle)[0];
            assert_eq!(rule.scale[0], factor, "{layer}");
            // at x = 3, y = 0.5 and 1.5 and the end of the step, 2 s
            let values = rule.values.as_ref().expect("by place");
            assert_eq!(
                values[..],
                [307.0, 307.0, 307.0, 317.0, 317.0, 317.0],
                "{layer}"
            );
        }
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        let boundary: PrescribedTemperature = read("region = 'left'\nvalue = '100 * x + 300'");
        let (mut boundary, _) = prepare(&mut world, boundary, |setup| {
            setup
                .consume(0, &keys::TEMPERATURE_CONSTRAINT)
                .expect("free");
            setup.consume(0, &keys::HELD_TEMPERATURE).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *boundary, 0.0);
        assert_eq!(values(&world, &keys::HELD_TEMPERATURE), [350.0, 0.0, 0.0]);
    }

    #[test]
    fn a_value_that_is_not_finite_is_refused() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        let boundary: PrescribedTemperature = read("face = 'x-'\nvalue = '300 + sqrt(x - 1)'");
        let message = refusal(&mut world, boundary);
        assert!(
            message.contains("value: `300 + sqrt(x - 1)` is NaN at [0, 0.5, 0.5] m"),
            "{message}"
        );
    }

    #[test]
    fn a_place_is_needed_and_only_one() {
        let both = "value = 1\nface = 'x-'\nregion = 'left'";
        for (table, message) in [("value = 1", "neither `face` nor `region`"), (both, "both")] {
            let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
            assert!(refusal(&mut world, read::<PrescribedTemperature>(table)).contains(message));
        }
    }
}
