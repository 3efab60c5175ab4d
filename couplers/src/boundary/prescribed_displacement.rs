//! Prescribed displacement behind a face or at points, component by component.
//!
//! Behind a face, at the end of the step: `u(layer) = 2 b(t) - u(mirror)` or `b(t)` for the components that
//! are given, `u(mirror)` for the others. In explicit motion the forces on the layer act on the mirror points, so that
//! energy is conserved. The points of a region have the displacement b(t) in the
//! components that are given.

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::in_space::{Placed, PlacedError};
use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Coupler, GivenValue, InSpace, LayerRole, Prepared, Programme, RunError, RunningCoupler, Setup,
    SetupError, Step, StepLimits, World, Write, flattened, keys,
};

use super::{BoundaryLocation, HeldPlace, LayerKind, with_programme};
use crate::in_time::earlier;

flattened! {
    /// Displacement of a face or of the points of a region; components left out are free.
    #[derive(Debug)]
    pub struct PrescribedDisplacement {
        ..place: HeldPlace,
        /// Displacement along x (m): a number, `{ time = [...], value = [...] }` with times in s, or a formula in t (s); of a region
        /// also a formula in x, y, z (m) and t (s), or files.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub x: Option<InSpace>,
        /// Displacement along y (m).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub y: Option<InSpace>,
        /// Displacement along z (m).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub z: Option<InSpace>,
        /// Values in the layer behind a face; default `mirrored`.
        #[serde(default)]
        pub layer: LayerKind,
    }
}

/// A prescribed displacement that is ready to act.
struct RunningPrescribedDisplacement {
    layer: LayerKind,
    /// Values at the points of the region, or one value for a face.
    values: [Option<Placed>; 3],
    sink: DisplacementSink,
}

/// Target of the prescribed displacement.
#[derive(Debug)]
enum DisplacementSink {
    Layer(LayerHandle),
    Points {
        points: Vec<u32>,
        constraint: Write<Vector3<f64>>,
        held: Write<Vector3<f64>>,
    },
}

impl PrescribedDisplacement {
    fn components(&self) -> [Option<&InSpace>; 3] {
        [self.x.as_ref(), self.y.as_ref(), self.z.as_ref()]
    }
}

#[typetag::serialize(name = "prescribed_displacement")]
impl Coupler for PrescribedDisplacement {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.place.body.as_deref())?;
        let dimension = setup.body(body).dimension;
        let given = self.components().map(|c| c.is_some());
        if given == [false; 3] {
            let message = "no component is prescribed";
            return Err(SetupError::value(
                "",
                message,
                "at least one of `x`, `y`, `z`",
            ));
        }
        if let Some(axis) = (dimension..3).find(|&axis| given[axis]) {
            let name = ["x", "y", "z"][axis];
            let message = format!("a {dimension}D body has no displacement along {name}");
            return Err(SetupError::value(
                name,
                message,
                "components within the dimensions",
            ));
        }
        let mut positions = vec![Vector3::zeros()];
        let sink = match self.place.location(setup, body)? {
            BoundaryLocation::Face(face) => {
                let by_place = |c: &Option<&InSpace>| c.is_some_and(|c| c.uniform().is_none());
                if let Some(axis) = self.components().iter().position(by_place) {
                    let message = "the displacement of a face cannot depend on the position";
                    let expected = "a uniform value, or `region` in place of `face`";
                    return Err(SetupError::value(["x", "y", "z"][axis], message, expected));
                }
                let layer = setup.layer(body, &keys::DISPLACEMENT, face, LayerRole::Prescribed)?;
                let scale = given.map(|given| if given { self.layer.rule(0.0).0 } else { 1.0 });
                let rule = LayerRule {
                    scale,
                    ..LayerRule::even(face)
                };
                setup.announce_layer(layer, rule);
                DisplacementSink::Layer(layer)
            }
            BoundaryLocation::Points(points) => {
                let position = &setup.body(body).points.position;
                positions = points.iter().map(|p| position[*p as usize]).collect();
                DisplacementSink::Points {
                    points,
                    constraint: setup.add(body, &keys::CONSTRAINT)?,
                    held: setup.add(body, &keys::HELD_DISPLACEMENT)?,
                }
            }
        };
        let mut values = [None, None, None];
        for (axis, value) in self.components().into_iter().enumerate() {
            let Some(value) = value else { continue };
            let key = ["x", "y", "z"][axis];
            let given = GivenValue {
                key,
                value,
                column: key,
            };
            values[axis] = Some(setup.placed(body, given, positions.clone())?);
        }
        let named = ["x", "y", "z"].into_iter().zip(self.components());
        let uniform = named.filter_map(|(key, value)| Some((key, value?.uniform()?)));
        setup.stepping(with_programme(Programme::of_values(uniform)));
        Ok(Box::new(RunningPrescribedDisplacement {
            layer: self.layer,
            values,
            sink,
        }))
    }
}

impl RunningCoupler for RunningPrescribedDisplacement {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let time = step.end();
        let error = |e: PlacedError| e.during("prescribed_displacement", time);
        let mut at_time: [Option<&[f64]>; 3] = [None; 3];
        for (at_time, value) in at_time.iter_mut().zip(&mut self.values) {
            *at_time = value
                .as_mut()
                .map(|v| v.at(time))
                .transpose()
                .map_err(error)?;
        }
        match &self.sink {
            DisplacementSink::Layer(layer) => {
                let rules = at_time.map(|v| v.map_or((1.0, 0.0), |v| self.layer.rule(v[0])));
                world.set_layer(*layer, rules.map(|r| r.0), rules.map(|r| r.1));
            }
            DisplacementSink::Points {
                points,
                constraint,
                held,
            } => {
                let (mut constraint, mut held) = (world.write(*constraint), world.write(*held));
                for (axis, values) in at_time.into_iter().enumerate() {
                    let Some(values) = values else { continue };
                    for (&point, value) in points.iter().zip(values) {
                        constraint[point as usize][axis] += 1.0;
                        held[point as usize][axis] += value;
                    }
                }
            }
        }
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let values = self.values.iter().flatten();
        StepLimits {
            next_event: values.map(|v| v.next_event(time)).fold(None, earlier),
            ..StepLimits::default()
        }
    }
}

perimelt_core::register_coupler!("prescribed_displacement", PrescribedDisplacement, supports: [Births, Cuts, Layers, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, values};

    #[test]
    fn a_layer_prescribes_the_given_components_and_mirrors_the_others() {
        let mut world = World::new(vec![block([3, 3, 1], 2, STEEL)]);
        let boundary: PrescribedDisplacement =
            read("face = 'x-'\ny = { time = [0, 2], value = [0, 1e-3] }");
        let (mut boundary, layers) = prepare(&mut world, boundary, |setup| {
            setup.own(0, &keys::DISPLACEMENT).expect("free");
            setup.layers(0, &keys::DISPLACEMENT).handle
        })
        .expect("valid");
        apply(&world, &mut *boundary, 0.0);
        let rule = &world.layer_rules(layers)[0];
        assert_eq!(
            (rule.scale, rule.offset),
            ([1.0, -1.0, 1.0], [0.0, 1e-3, 0.0])
        );
        assert_eq!(boundary.step_limits(0.0).next_event, Some(2.0));
    }

    #[test]
    fn points_are_held_in_the_given_components() {
        let mut world = World::new(vec![block([2, 1, 1], 3, STEEL)]);
        let boundary: PrescribedDisplacement = read("region = 'left'\nx = 0.5\nz = 0");
        let (mut boundary, _) = prepare(&mut world, boundary, |setup| {
            setup.consume(0, &keys::CONSTRAINT).expect("free");
            setup.consume(0, &keys::HELD_DISPLACEMENT).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *boundary, 0.0);
        assert_eq!(
            values(&world, &keys::CONSTRAINT),
            [1.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        );
        assert_eq!(
            values(&world, &keys::HELD_DISPLACEMENT)[..3],
            [0.5, 0.0, 0.0]
        );
    }

    #[test]
    fn the_displacement_of_a_region_may_depend_on_the_place() {
        let mut world = World::new(vec![block([2, 1, 1], 3, STEEL)]);
        let boundary: PrescribedDisplacement = read("region = 'left'\nx = '2 * x * t'");
        let (mut boundary, _) = prepare(&mut world, boundary, |setup| {
            setup.consume(0, &keys::CONSTRAINT).expect("free");
            setup.consume(0, &keys::HELD_DISPLACEMENT).expect("free");
        })
        .expect("valid");
        apply(&world, &mut *boundary, 2.0);
        // at x = 0.5 m and the end of the step, 3 s
        assert_eq!(
            values(&world, &keys::HELD_DISPLACEMENT)[..3],
            [3.0, 0.0, 0.0]
        );
    }

    #[test]
    fn components_must_exist_and_be_given() {
        for (table, message) in [
            (
                "face = 'x-'\ny = 'x'",
                "the displacement of a face cannot depend on the position",
            ),
            ("face = 'x-'", "no component is prescribed"),
            (
                "face = 'x-'\nz = 0",
                "a 2D body has no displacement along z",
            ),
        ] {
            let mut world = World::new(vec![block([3, 3, 1], 2, STEEL)]);
            let boundary: PrescribedDisplacement = read(table);
            assert!(refusal(&mut world, boundary).contains(message), "{table}");
        }
    }
}
