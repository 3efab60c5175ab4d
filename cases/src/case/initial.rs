//! Initial fields, `[bodies.<name>.initial]`.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use perimelt_core::Formula;
use perimelt_core::samples::FieldFile;
use schemars::JsonSchema;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::sections::{Components, ComponentsVisitor};

/// An initial field: one value, one value with others in some regions, a gradient, a formula, or a file.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(untagged)]
#[serde(untagged)]
pub enum Initial {
    /// One value for all positions.
    Uniform(InitialValue),
    /// Different values in some regions.
    ByRegion {
        /// Value outside of these regions.
        value: InitialValue,
        /// By region.
        regions: BTreeMap<String, InitialValue>,
    },
    /// `value + gradient (x - origin)`.
    Linear(Linear),
    /// A formula, or one for each component, in the position.
    Formula(Formula),
    /// One formula for each component.
    Formulas(Vec<Formula>),
    /// Values of another program or a measurement, such as `{ file = "temperature.csv" }`, interpolated between its points.
    File(FieldFile),
}

/// One value of an initial field.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(untagged)]
#[serde(untagged)]
pub enum InitialValue {
    /// A number or a list of components.
    Components(Components),
    /// An `orientation` that is turned about z.
    Turn(Turn),
}

/// A rotation about z, from x towards y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// Angle in degrees.
    pub angle: f64,
}

impl InitialValue {
    /// The components; of a turn those of its rotation vector, rad.
    pub fn values(&self) -> Vec<f64> {
        match self {
            InitialValue::Components(components) => components.as_slice().to_vec(),
            InitialValue::Turn(Turn { angle }) => vec![0.0, 0.0, angle.to_radians()],
        }
    }
}

impl From<Components> for InitialValue {
    fn from(components: Components) -> Self {
        InitialValue::Components(components)
    }
}

struct InitialValueVisitor;

impl<'de> Visitor<'de> for InitialValueVisitor {
    type Value = InitialValue;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or [x, y, z], or { angle = ... }")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<InitialValue, E> {
        ComponentsVisitor.visit_f64(value).map(Into::into)
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<InitialValue, E> {
        ComponentsVisitor.visit_i64(value).map(Into::into)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<InitialValue, A::Error> {
        ComponentsVisitor.visit_seq(list).map(Into::into)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<InitialValue, A::Error> {
        Turn::deserialize(de::value::MapAccessDeserializer::new(map)).map(InitialValue::Turn)
    }
}

impl<'de> Deserialize<'de> for InitialValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InitialValueVisitor)
    }
}

/// A linear field: `value + gradient (x - origin)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// At the origin; zero when left out.
    #[serde(default)]
    pub value: Option<InitialValue>,
    /// Derivatives along x, y and z, one row for each component, per m.
    pub gradient: Vec<[f64; 3]>,
    /// Reference position, m.
    #[serde(default)]
    pub origin: [f64; 3],
}

impl Linear {
    /// The components at a reference position, m.
    pub fn at(&self, position: [f64; 3]) -> Vec<f64> {
        let value = self
            .value
            .as_ref()
            .map(InitialValue::values)
            .unwrap_or_default();
        let row = |(i, row): (usize, &[f64; 3])| {
            let slopes = row.iter().zip(position.iter().zip(self.origin));
            let growth: f64 = slopes.map(|(g, (x, origin))| g * (x - origin)).sum();
            value.get(i).copied().unwrap_or(0.0) + growth
        };
        self.gradient.iter().enumerate().map(row).collect()
    }
}

impl Initial {
    /// The components outside of all regions at a reference position, m; none of a file.
    pub fn at(&self, position: [f64; 3]) -> Vec<f64> {
        match self {
            Initial::Uniform(value) | Initial::ByRegion { value, .. } => value.values(),
            Initial::Linear(linear) => linear.at(position),
            Initial::Formula(formula) => vec![formula.at(position, 0.0)],
            Initial::Formulas(all) => all.iter().map(|f| f.at(position, 0.0)).collect(),
            Initial::File(_) => Vec::new(),
        }
    }

    /// Whether the value outside of all regions depends on the position.
    pub fn varies(&self) -> bool {
        !matches!(self, Initial::Uniform(_) | Initial::ByRegion { .. })
    }

    /// Whether a value is an angle about z.
    pub fn turns(&self) -> bool {
        let value = match self {
            Initial::Uniform(value) | Initial::ByRegion { value, .. } => Some(value),
            Initial::Linear(linear) => linear.value.as_ref(),
            _ => None,
        };
        let all = value.into_iter().chain(self.regions().map(|(_, v)| v));
        all.into_iter().any(|v| matches!(v, InitialValue::Turn(_)))
    }

    /// The exceptions.
    pub fn regions(&self) -> impl Iterator<Item = (&String, &InitialValue)> {
        let regions = match self {
            Initial::ByRegion { regions, .. } => Some(regions),
            _ => None,
        };
        regions.into_iter().flatten()
    }
}

struct InitialVisitor;

impl<'de> Visitor<'de> for InitialVisitor {
    type Value = Initial;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or [x, y, z], or { value = ..., regions = { <region> = ... } }, or { gradient = [...] }, or { angle = ... }, or formulas in x, y and z, or { file = \"...\" }")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Initial, E> {
        InitialValueVisitor.visit_f64(value).map(Initial::Uniform)
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Initial, E> {
        InitialValueVisitor.visit_i64(value).map(Initial::Uniform)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Initial, E> {
        Formula::new(text).map(Initial::Formula).map_err(E::custom)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Initial, A::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a number or a formula")]
        enum ListEntry {
            Number(f64),
            Formula(String),
        }
        let (mut numbers, mut formulas) = (Vec::new(), Vec::new());
        while let Some(part) = list.next_element()? {
            let text = match part {
                ListEntry::Number(number) => {
                    numbers.push(number);
                    number.to_string()
                }
                ListEntry::Formula(text) => text,
            };
            formulas.push(text);
        }
        if numbers.len() == formulas.len() {
            return Ok(Initial::Uniform(Components::List(numbers).into()));
        }
        let formulas: Result<Vec<Formula>, _> = formulas.iter().map(|f| Formula::new(f)).collect();
        formulas.map(Initial::Formulas).map_err(de::Error::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Initial, A::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Keys {
            value: Option<InitialValue>,
            regions: Option<BTreeMap<String, InitialValue>>,
            gradient: Option<Vec<[f64; 3]>>,
            #[serde(default)]
            origin: [f64; 3],
            file: Option<PathBuf>,
            column: Option<String>,
            angle: Option<f64>,
        }
        let table = Keys::deserialize(de::value::MapAccessDeserializer::new(map))?;
        if let Some(angle) = table.angle {
            let others = [
                table.value.is_some(),
                table.regions.is_some(),
                table.gradient.is_some(),
                table.file.is_some(),
            ];
            return match others.contains(&true) {
                true => Err(de::Error::custom("an `angle` stands alone")),
                false => Ok(Initial::Uniform(InitialValue::Turn(Turn { angle }))),
            };
        }
        if let Some(file) = table.file {
            if table.value.is_some() || table.regions.is_some() || table.gradient.is_some() {
                let message = "a field from a file has no `value`, `regions` or `gradient`";
                return Err(de::Error::custom(message));
            }
            let column = table.column;
            return Ok(Initial::File(FieldFile { file, column }));
        }
        match (table.value, table.regions, table.gradient) {
            (Some(value), Some(regions), None) => Ok(Initial::ByRegion { value, regions }),
            (value, None, Some(gradient)) => Ok(Initial::Linear(Linear {
                value,
                gradient,
                origin: table.origin,
            })),
            (_, Some(_), Some(_)) => Err(de::Error::custom(
                "a field can have a gradient or values by region, not both",
            )),
            (None, ..) => Err(de::Error::missing_field("value")),
            _ => Err(de::Error::missing_field("regions")),
        }
    }
}

impl<'de> Deserialize<'de> for Initial {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InitialVisitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    struct Keys {
        initial: Initial,
    }

    fn read(initial: &str) -> Result<Initial, toml::de::Error> {
        toml::from_str::<Keys>(&format!("initial = {initial}")).map(|t| t.initial)
    }

    #[test]
    fn an_initial_field_may_grow_with_the_position() {
        let plain = read("{ gradient = [[2, 0, 0], [0, 0, 1], [0, 0, 0]], origin = [1, 0, 0] }");
        assert_eq!(plain.expect("valid").at([3.0, 5.0, 7.0]), [4.0, 7.0, 0.0]);
        let lifted = read("{ value = 300, gradient = [[0, 10, 0]] }").expect("valid");
        assert_eq!(lifted.at([1.0, 2.0, 3.0]), [320.0]);
        assert_eq!(
            read("[1, 2, 3]").expect("valid").at([9.0; 3]),
            [1.0, 2.0, 3.0]
        );
    }

    #[test]
    fn an_initial_field_may_be_a_formula() {
        let scalar = read("'300 + 10 * x'").expect("valid");
        assert_eq!(
            (scalar.at([2.0, 0.0, 0.0]), scalar.varies()),
            (vec![320.0], true)
        );
        let vector = read("['y * z', 0, 'x']").expect("valid");
        assert_eq!(vector.at([2.0, 3.0, 4.0]), [12.0, 0.0, 2.0]);
        assert!(read("['q', 0, 0]").is_err());
    }

    #[test]
    fn an_orientation_may_be_an_angle() {
        let quarter = [0.0, 0.0, 0.5 * std::f64::consts::PI];
        let turned = read("{ angle = 90 }").expect("valid");
        assert_eq!(
            (turned.at([0.0; 3]), turned.turns()),
            (quarter.to_vec(), true)
        );
        let plies = "{ value = [0, 0, 0], regions = { ply = { angle = 90 } } }";
        let plies = read(plies).expect("valid");
        let regions: Vec<_> = plies.regions().map(|(_, v)| v.values()).collect();
        assert_eq!((regions, plies.turns()), (vec![quarter.to_vec()], true));
        assert!(!read("[0, 0, 1]").expect("valid").turns());
        assert!(read("{ angle = 90, value = 1 }").is_err(), "both");
    }

    #[test]
    fn a_field_grows_or_differs_by_region() {
        let both = read("{ value = 1, regions = { left = 2 }, gradient = [[1, 0, 0]] }");
        assert!(both.expect_err("both").message().contains("not both"));
        assert!(read("{ value = 1 }").is_err(), "neither");
        assert!(matches!(read("{ file = 'a.vtu' }"), Ok(Initial::File(_))));
        assert!(read("{ file = 'a.vtu', value = 1 }").is_err(), "both");
    }
}
