//! What a material has in all directions alike, or along each of its three axes.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Deserializer, Serialize};

use super::property::{Property, PropertyVisitor};

/// A value in all directions alike, or one along each of the three axes of the material, which the field `orientation` of a
/// body turns.
///
/// In a case file the property of a material that may have directions has one of the forms of [`Property`], or
///
/// ```toml
/// conductivity = { along = 8.3, across = 0.76 }       # along the first axis, and along both others
/// conductivity = { axes = [8.3, 0.76, 0.5] }
/// ```
///
/// of which each value is a [`Property`]. As a tensor it is `k_1 a a^T + k_2 b b^T + k_3 c c^T` of the axes a, b, c, which is
/// positive definite where all values are positive: at every temperature where they are so in all rows of their tables.
#[derive(Clone, Debug, PartialEq)]
pub enum Directional<T> {
    /// In all directions.
    Same(T),
    /// Along each axis.
    Axes(Box<[T; 3]>),
}

impl<T> Directional<T> {
    /// The value along an axis, 0 to 2.
    #[inline]
    pub fn along(&self, axis: usize) -> &T {
        match self {
            Directional::Same(value) => value,
            Directional::Axes(values) => &values[axis],
        }
    }

    /// The value, if it is given for all directions.
    pub fn same(&self) -> Option<&T> {
        match self {
            Directional::Same(value) => Some(value),
            Directional::Axes(_) => None,
        }
    }

    /// Whether there is a value for each axis.
    pub fn has_directions(&self) -> bool {
        self.same().is_none()
    }

    /// The one value, or the three along the axes.
    pub fn values(&self) -> &[T] {
        match self {
            Directional::Same(value) => std::slice::from_ref(value),
            Directional::Axes(values) => &values[..],
        }
    }

    /// The values after `change`.
    pub fn map<U>(&self, mut change: impl FnMut(&T) -> U) -> Directional<U> {
        match self {
            Directional::Same(value) => Directional::Same(change(value)),
            Directional::Axes(values) => Directional::Axes(Box::new(values.each_ref().map(change))),
        }
    }
}

impl<T, E> Directional<Result<T, E>> {
    /// The values, or the first error.
    ///
    /// # Errors
    /// The first error.
    pub fn transpose(self) -> Result<Directional<T>, E> {
        Ok(match self {
            Directional::Same(value) => Directional::Same(value?),
            Directional::Axes(values) => {
                let [a, b, c] = *values;
                Directional::Axes(Box::new([a?, b?, c?]))
            }
        })
    }
}

impl<'de> Deserialize<'de> for Directional<Property> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PropertyVisitor {
            has_directions: true,
        })
    }
}

impl Serialize for Directional<Property> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Directional::Same(property) => property.serialize(serializer),
            Directional::Axes(properties) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry("axes", &**properties)?;
                map.end()
            }
        }
    }
}

impl JsonSchema for Directional<Property> {
    fn schema_name() -> Cow<'static, str> {
        "DirectionalProperty".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let property = generator.subschema_for::<Property>();
        json_schema!({
            "description": "A material property that may differ by direction: one for all directions, or one along each axis of the material",
            "anyOf": [
                property,
                {
                    "type": "object",
                    "description": "Transversely isotropic, such as fibres",
                    "properties": {
                        "along": { "description": "Along the first axis", "allOf": [property] },
                        "across": { "description": "Along both others", "allOf": [property] }
                    },
                    "required": ["along", "across"],
                    "additionalProperties": false
                },
                {
                    "type": "object",
                    "description": "Orthotropic",
                    "properties": {
                        "axes": {
                            "type": "array", "items": property, "minItems": 3, "maxItems": 3,
                            "description": "Along each axis"
                        }
                    },
                    "required": ["axes"],
                    "additionalProperties": false
                }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Holder {
        k: Directional<Property>,
    }

    fn read(text: &str) -> Result<Directional<Property>, toml::de::Error> {
        toml::from_str::<Holder>(&format!("k = {text}")).map(|holder| holder.k)
    }

    #[test]
    fn values_may_differ_by_axis() {
        for (text, expected) in [
            ("5", [5.0; 3]),
            ("{ temperature = [300, 500], value = [4, 6] }", [5.0; 3]),
            ("{ along = 8.3, across = 0.76 }", [8.3, 0.76, 0.76]),
            (
                "{ axes = [1, { temperature = [300, 500], value = [4, 6] }, { solid = 3, liquid = 7 }] }",
                [1.0, 5.0, 3.0],
            ),
        ] {
            let property = read(text).expect(text);
            let found = [0, 1, 2].map(|axis| property.along(axis).at(400.0, 0.0));
            assert_eq!(found, expected, "{text}");
            assert_eq!(property.has_directions(), property.values().len() == 3);
            let json = serde_json::to_string(&property).expect("serialises");
            let back: Directional<Property> = serde_json::from_str(&json).expect("reads");
            assert_eq!(back, property, "{text}");
        }
    }

    #[test]
    fn each_mistake_is_explained_where_it_is() {
        for (input, message, place) in [
            ("{ along = 1 }", "missing field `across`", "{ along = 1 }"),
            ("{ across = 1 }", "missing field `along`", "{ across = 1 }"),
            ("{ axes = [1, 2] }", "invalid length 2", "[1, 2]"),
            (
                "{ axes = [1, 2, 3], along = 1 }",
                "expected a number",
                "{ axes = [1, 2, 3], along = 1 }",
            ),
            ("{ alon = 1 }", "did you mean `along`?", "alon"),
            (
                "{ along = { along = 1, across = 2 }, across = 1 }",
                "`across` belongs to properties with directions",
                "across",
            ),
        ] {
            let error = read(input).expect_err(input);
            assert!(error.message().contains(message), "{input}: {error}");
            let source = format!("k = {input}");
            let span = error.span().expect("an error has a place");
            assert_eq!(&source[span], place, "{input}");
        }
    }
}
