//! A number, or a formula in position and time.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize};

use crate::formula::Formula;

/// A number that may depend on position and time.
///
/// ```toml
/// value = 300
/// value = "9800 * (0.14 - y)"   # x, y, z in m, t in s
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum InSpace {
    /// The same everywhere.
    Uniform(f64),
    /// A formula in x, y, z and t.
    Formula(Formula),
}

impl InSpace {
    /// Value at a position (m) and time (s).
    pub fn at(&self, position: [f64; 3], time: f64) -> f64 {
        match self {
            InSpace::Uniform(value) => *value,
            InSpace::Formula(formula) => formula.at(position, time),
        }
    }
}

impl<'de> Deserialize<'de> for InSpace {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(InSpaceVisitor)
    }
}

struct InSpaceVisitor;

impl Visitor<'_> for InSpaceVisitor {
    type Value = InSpace;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or a formula in x, y, z (m) and t (s)")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<InSpace, E> {
        if value.is_finite() {
            Ok(InSpace::Uniform(value))
        } else {
            Err(E::custom(format_args!("{value} is not a finite number")))
        }
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<InSpace, E> {
        Ok(InSpace::Uniform(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<InSpace, E> {
        Ok(InSpace::Uniform(value as f64))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<InSpace, E> {
        Formula::new(text).map(InSpace::Formula).map_err(E::custom)
    }
}

impl JsonSchema for InSpace {
    fn schema_name() -> Cow<'static, str> {
        "InSpace".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number, or a formula in position and time",
            "anyOf": [
                { "type": "number", "description": "The same everywhere" },
                generator.subschema_for::<Formula>()
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

    #[test]
    fn a_formula_is_evaluated_at_a_position_and_time() {
        let value = read("'10 * (2 - y) * t'").expect("valid");
        assert_eq!(value.at([7.0, 0.5, 7.0], 3.0), 45.0);
        assert_eq!(read("5").expect("valid").at([1.0; 3], 1.0), 5.0);
        let json = serde_json::to_string(&value).expect("serialises");
        assert_eq!(
            serde_json::from_str::<InSpace>(&json).expect("reads"),
            value
        );
    }

    #[test]
    fn mistakes_are_explained() {
        for (text, message) in [
            ("[1, 2]", "a number, or a formula in x, y, z"),
            ("inf", "not a finite number"),
            ("'9.8 * depth'", "`depth` in the formula"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.message().contains(message), "{text}: {error}");
        }
    }
}
