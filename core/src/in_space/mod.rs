//! A value by place: a number, a table in time, a formula in position and time, or files of another program.

mod placed;

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::formula::Formula;
use crate::in_time::InTime;
use crate::material::Table;

use crate::samples::{FieldFile, FieldSeries};
pub use placed::{Placed, PlacedError};

/// A number that may depend on position and time.
///
/// ```toml
/// value = 300
/// value = "9800 * (0.14 - y)"                       # x, y, z in m, t in s
/// value = { time = [0, 10], value = [300, 500] }    # s; the same everywhere
/// value = { file = "temperature.csv" }              # columns x, y, z (m) and the values; or a .vtu file
/// value = { file = "run.pvd", column = "T" }        # files by time, and which of their arrays
/// value = { time = [0, 5], file = ["a.vtu", "b.vtu"] }
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum InSpace {
    /// A value that is uniform in space.
    Uniform(InTime),
    /// A formula in x, y, z and t.
    Formula(Formula),
    /// A file, at one time or several.
    File(FieldFile),
    /// Files by time.
    Series(FieldSeries),
}

impl From<f64> for InSpace {
    fn from(value: f64) -> Self {
        InSpace::Uniform(InTime::Constant(value))
    }
}

impl InSpace {
    /// The value that is the same everywhere.
    pub fn uniform(&self) -> Option<&InTime> {
        match self {
            InSpace::Uniform(value) => Some(value),
            _ => None,
        }
    }

    /// The number, where the value is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            InSpace::Uniform(InTime::Constant(value)) => Some(*value),
            _ => None,
        }
    }

    /// The values at positions (m) of a body with so many dimensions. A file has a column with the name of the `field`, or
    /// only one; its path starts at `folder`.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn at(
        &self,
        field: &str,
        folder: &Path,
        positions: Vec<Vector3<f64>>,
        dimension: usize,
    ) -> Result<Placed, PlacedError> {
        Placed::new(self, field, folder, positions, dimension)
    }
}

const FORMS: &str = "a number, a formula in x, y, z (m) and t (s), { time = [...], value = [...] }, { file = \"...\" } or { time = [...], file = [...] }";

impl<'de> Deserialize<'de> for InSpace {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InSpaceVisitor)
    }
}

struct InSpaceVisitor;

/// One file or several.
#[derive(Deserialize)]
#[serde(untagged, expecting = "the name of a file, or a list of names")]
enum Files {
    One(PathBuf),
    Several(Vec<PathBuf>),
}

impl<'de> Visitor<'de> for InSpaceVisitor {
    type Value = InSpace;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(FORMS)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<InSpace, E> {
        if value.is_finite() {
            Ok(value.into())
        } else {
            Err(E::custom(format_args!("{value} is not a finite number")))
        }
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<InSpace, E> {
        Ok((value as f64).into())
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<InSpace, E> {
        Ok((value as f64).into())
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<InSpace, E> {
        let formula = Formula::new(text).map_err(E::custom)?;
        Ok(match formula.is_of_time() {
            true => InSpace::Uniform(InTime::Formula(formula)),
            false => InSpace::Formula(formula),
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<InSpace, A::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Keys {
            time: Option<Vec<f64>>,
            value: Option<Vec<f64>>,
            file: Option<Files>,
            column: Option<String>,
        }
        let keys = Keys::deserialize(MapAccessDeserializer::new(map))?;
        let column = keys.column;
        match (keys.time, keys.value, keys.file) {
            (Some(time), Some(value), None) if column.is_none() => {
                let table = Table::new(time, value).map_err(de::Error::custom)?;
                Ok(InSpace::Uniform(InTime::Table(table)))
            }
            (None, None, Some(Files::One(file))) => Ok(InSpace::File(FieldFile { file, column })),
            (Some(time), None, Some(Files::Several(file))) => {
                Ok(InSpace::Series(FieldSeries { time, file, column }))
            }
            (Some(_), None, Some(Files::One(_))) => Err(de::Error::custom(
                "`file` is one file and `time` a list; expected a list of files, one for each time",
            )),
            (None, None, Some(Files::Several(_))) | (None, Some(_), None) => {
                Err(de::Error::missing_field("time"))
            }
            (Some(_), None, None) => Err(de::Error::missing_field("value")),
            _ => Err(de::Error::custom(format_args!("expected {FORMS}"))),
        }
    }
}

impl JsonSchema for InSpace {
    fn schema_name() -> Cow<'static, str> {
        "InSpace".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A value by place: a number, a table in time, a formula in position and time, or files",
            "anyOf": [
                { "type": "number", "description": "The same everywhere" },
                generator.subschema_for::<Formula>(),
                {
                    "type": "object",
                    "description": "The same everywhere, piecewise linear in time",
                    "properties": {
                        "time": { "type": "array", "items": { "type": "number" }, "minItems": 1, "description": "Times of the rows [s], strictly increasing" },
                        "value": { "type": "array", "items": { "type": "number" }, "minItems": 1, "description": "Values of the rows" }
                    },
                    "required": ["time", "value"],
                    "additionalProperties": false
                },
                generator.subschema_for::<FieldFile>(),
                generator.subschema_for::<FieldSeries>()
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Holder {
        value: InSpace,
    }

    fn read(value: &str) -> Result<InSpace, toml::de::Error> {
        toml::from_str::<Holder>(&format!("value = {value}")).map(|h| h.value)
    }

    fn at(value: &InSpace, position: [f64; 3], time: f64) -> f64 {
        let placed = value.at("value", Path::new(""), vec![position.into()], 3);
        placed.expect("no file").at(time).expect("finite")[0]
    }

    #[test]
    fn a_value_is_evaluated_at_a_position_and_time() {
        let value = read("'10 * (2 - y) * t'").expect("valid");
        assert_eq!(at(&value, [7.0, 0.5, 7.0], 3.0), 45.0);
        assert_eq!(at(&read("5").expect("valid"), [1.0; 3], 1.0), 5.0);
        let ramp = read("{ time = [0, 2], value = [10, 30] }").expect("valid");
        assert_eq!(at(&ramp, [1.0; 3], 1.0), 20.0);
        assert_eq!(at(&read("'3 * t'").expect("valid"), [1.0; 3], 2.0), 6.0);
    }

    #[test]
    fn writing_and_reading_gives_the_same() {
        for text in [
            "5.5",
            "'x * t'",
            "'t^2'",
            "{ time = [1, 3], value = [10, 30] }",
            "{ file = 'a.csv' }",
            "{ file = 'a.pvd', column = 'T' }",
            "{ time = [1, 3], file = ['a.csv', 'b.csv'] }",
        ] {
            let value = read(text).expect(text);
            let json = serde_json::to_string(&value).expect("serialises");
            assert_eq!(
                serde_json::from_str::<InSpace>(&json).expect("reads"),
                value,
                "{text}"
            );
        }
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, message) in [
            ("[1, 2]", "a number, a formula in x, y, z"),
            ("inf", "not a finite number"),
            ("'9.8 * depth'", "`depth` in the formula"),
            (
                "{ time = [0, 1], file = 'a.csv' }",
                "expected a list of files",
            ),
            ("{ file = ['a.csv'] }", "missing field `time`"),
            ("{ time = [0, 1] }", "missing field `value`"),
            ("{ column = 'T' }", "expected a number, a formula"),
            ("{ files = 'a.csv' }", "unknown field `files`"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.message().contains(message), "{text}: {error}");
        }
    }
}
