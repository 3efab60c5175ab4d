//! Components of vectors and tensors, and scalars computed from them.

use std::cell::Ref;

use nalgebra::Matrix3;
use perimelt_core::field::FieldIndex;
use perimelt_core::world::refinement::Level;
use perimelt_core::{Face, SetupError, Simulation, World};

/// Components of a vector.
pub(crate) const VECTOR: [&str; 3] = ["x", "y", "z"];
/// Components of a tensor, in the order of memory.
pub(crate) const TENSOR: [&str; 9] = ["xx", "yx", "zx", "xy", "yy", "zy", "xz", "yz", "zz"];

/// One number of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    Entry(usize),
    /// Magnitude of a vector.
    Magnitude,
    /// `sqrt(3/2 s:s)` with the deviator s of a tensor.
    VonMises,
    /// Third of the trace of a tensor.
    Hydrostatic,
    /// Principal value of a symmetric tensor, the largest first.
    Principal(usize),
}

/// Names of the scalars of a tensor besides its components.
const OF_TENSOR: [(&str, Number); 5] = [
    ("von_mises", Number::VonMises),
    ("hydrostatic", Number::Hydrostatic),
    ("principal_1", Number::Principal(0)),
    ("principal_2", Number::Principal(1)),
    ("principal_3", Number::Principal(2)),
];

impl Number {
    /// The number called `name` of a field with this number of components.
    pub(crate) fn find(components: usize, name: &str) -> Option<Number> {
        let entry = |names: &[&str]| names.iter().position(|n| *n == name).map(Number::Entry);
        match components {
            3 if name == "magnitude" => Some(Number::Magnitude),
            3 => entry(&VECTOR),
            9 => {
                let other = OF_TENSOR.iter().find(|(n, _)| *n == name);
                entry(&TENSOR).or(other.map(|(_, number)| *number))
            }
            _ => None,
        }
    }

    /// The valid names for a field with this number of components.
    pub(crate) fn names(components: usize) -> Vec<&'static str> {
        match components {
            3 => VECTOR.into_iter().chain(["magnitude"]).collect(),
            9 => {
                let others = OF_TENSOR.iter().map(|(name, _)| *name);
                others.chain(TENSOR).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The number of a value.
    pub(crate) fn of(self, value: &[f64]) -> f64 {
        let mean = |t: &[f64]| (t[0] + t[4] + t[8]) / 3.0;
        match self {
            Number::Entry(entry) => value[entry],
            Number::Magnitude => value.iter().map(|x| x * x).sum::<f64>().sqrt(),
            Number::Hydrostatic => mean(value),
            Number::VonMises => {
                let mean = mean(value);
                let contraction: f64 = (0..9)
                    .map(|c| {
                        if c % 4 == 0 {
                            value[c] - mean
                        } else {
                            value[c]
                        }
                    })
                    .map(|deviator| deviator * deviator)
                    .sum();
                (1.5 * contraction).sqrt()
            }
            // the iteration would not end
            Number::Principal(_) if value.iter().any(|x| !x.is_finite()) => f64::NAN,
            Number::Principal(rank) => {
                let mut values = Matrix3::from_column_slice(value).symmetric_eigenvalues();
                values.as_mut_slice().sort_by(|a, b| b.total_cmp(a));
                values[rank]
            }
        }
    }
}

/// A number of a field.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Component {
    pub(crate) field: FieldIndex,
    number: Number,
}

impl Component {
    pub(crate) fn new(
        world: &World,
        field: FieldIndex,
        name: Option<&str>,
    ) -> Result<Component, SetupError> {
        let components = world.fields().field(field).data().components();
        let number = match (name, components) {
            (None, 1) => Number::Entry(0),
            (None, 3) => Number::Magnitude,
            (None, _) => {
                let expected = format!(
                    "`component`, one of {}",
                    Number::names(components).join(", ")
                );
                let message = "the field is a tensor and the probe has no component";
                return Err(SetupError::value("field", message, expected));
            }
            (Some(name), _) => Number::find(components, name).ok_or_else(|| {
                let known = Number::names(components);
                SetupError::unknown("component", "component of this field", name, known)
            })?,
        };
        Ok(Component { field, number })
    }

    /// This number on the refined window that moves over a body, if there is one with that field.
    pub(crate) fn on_window(self, simulation: &Simulation, body: usize) -> Option<Component> {
        let world = simulation.world();
        let name = &world.fields().field(self.field).name;
        let window = match world.refinement(body)? {
            (refinement, Level::Plate) => refinement.window(),
            (_, Level::Window) => return None,
        };
        let is_there = simulation
            .lasting()
            .any(|f| f.body == window && f.name == *name);
        let field = world.fields().find(window, name).filter(|_| is_there)?;
        Some(Component { field, ..self })
    }

    /// Activity of the points of the body; `None` where all have material.
    pub(crate) fn activity(self, world: &World) -> Option<Ref<'_, [f64]>> {
        world.activity(world.fields().field(self.field).body)
    }

    /// The value on the cell face in front of a point; `None` where it is unknown.
    pub(crate) fn on_face(self, world: &World, point: usize, face: Face) -> Option<f64> {
        let Number::Entry(component) = self.number else {
            return None;
        };
        world.value_on_face(self.field, component, point as u32, face)
    }

    pub(crate) fn at(self, world: &World, point: usize) -> f64 {
        let data = world.fields().field(self.field).data();
        let components = data.components();
        let values = &data.flat()[point * components..][..components];
        self.number.of(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tensor_that_is_not_finite_has_no_principal_value() {
        for bad in [f64::NAN, f64::INFINITY] {
            let value = [1.0, 0.0, 0.0, 0.0, bad, 0.0, 0.0, 0.0, 1.0];
            assert!(Number::Principal(0).of(&value).is_nan());
        }
    }

    fn number(name: &str, value: &[f64]) -> Option<f64> {
        Number::find(value.len(), name).map(|n| n.of(value))
    }

    #[test]
    fn tensors_become_their_textbook_numbers() {
        // tension of 7 along x and y halfway between them, with a pressure of 2
        let stress = [1.5, 3.5, 0.0, 3.5, 1.5, 0.0, 0.0, 0.0, -2.0];
        let expected = [
            ("xx", 1.5),
            ("von_mises", 7.0),
            ("hydrostatic", 1.0 / 3.0),
            ("principal_1", 5.0),
            ("principal_2", -2.0),
            ("principal_3", -2.0),
        ];
        for (name, expected) in expected {
            let found = number(name, &stress).expect("a number of tensors");
            assert!((found - expected).abs() < 1e-14, "{name}: {found}");
        }
        let sheared = [0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let found = number("von_mises", &sheared).expect("a number of tensors");
        assert!((found - 3f64.sqrt()).abs() < 1e-15);
        // pure shear under pressure: sqrt(3) times the shear stress, at any pressure
        let sheared = [7.0, 2.0, 0.0, 2.0, 7.0, 0.0, 0.0, 0.0, 7.0];
        let found = number("von_mises", &sheared).expect("a number of tensors");
        assert!((found - 12f64.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn every_name_is_found_and_no_other() {
        for components in [1, 3, 9] {
            for name in Number::names(components) {
                assert!(Number::find(components, name).is_some(), "{name}");
            }
            assert_eq!(Number::find(components, "q"), None);
        }
        assert_eq!(number("magnitude", &[3.0, 0.0, -4.0]), Some(5.0));
        assert_eq!(number("z", &[3.0, 0.0, -4.0]), Some(-4.0));
        assert_eq!(number("y", &[3.0, 4.0, 0.0]), Some(4.0));
    }
}
