//! One material property: a number, a table against temperature, or one of these per phase.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, DeserializeSeed, Deserializer, MapAccess, Visitor};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};

use super::directional::Directional;
use super::table::{Table, check_increasing};
use super::values::Values;
use super::vocabulary::nearest_name;

/// A property of a material, constant or a function of temperature and phase.
///
/// In a case file it has one of four forms:
///
/// ```toml
/// conductivity = 50
/// conductivity = { temperature = [293.15, 1273.15], value = [50, 30] }
/// conductivity = { temperature = [293.15, 1273.15], value = "50 - 0.02 * (T - 293.15)" }
/// conductivity = { solid = 50, liquid = { temperature = [1700, 2500], value = [25, 35] } }
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum Property {
    /// A constant.
    Constant(f64),
    /// A function of temperature (K).
    Table(Table),
    /// One property for the solid and one for the liquid; the mixture rule is linear in the
    /// liquid fraction. Phases are not nested.
    ByPhase {
        /// Property of the solid.
        solid: Box<Property>,
        /// Property of the liquid.
        liquid: Box<Property>,
    },
}

impl Property {
    /// Value at a temperature (K) and liquid fraction (0 solid, 1 liquid).
    ///
    /// By phase: (1 − f) solid(T) + f liquid(T).
    pub fn at(&self, temperature: f64, liquid_fraction: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Table(table) => table.at(temperature),
            Self::ByPhase { solid, liquid } => {
                if liquid_fraction <= 0.0 {
                    solid.at(temperature, 0.0)
                } else if liquid_fraction >= 1.0 {
                    liquid.at(temperature, 1.0)
                } else {
                    let solid = solid.at(temperature, 0.0);
                    solid + liquid_fraction * (liquid.at(temperature, 1.0) - solid)
                }
            }
        }
    }

    /// Value and derivative by the temperature (1/K) of a number or a table; of the solid where it depends on the phase.
    pub fn with_slope(&self, temperature: f64) -> (f64, f64) {
        match self {
            Self::Constant(value) => (*value, 0.0),
            Self::Table(table) => table.with_slope(temperature),
            Self::ByPhase { solid, .. } => solid.with_slope(temperature),
        }
    }

    /// That of the liquid, where it depends on the phase.
    pub fn of_liquid(&self) -> &Property {
        match self {
            Self::ByPhase { liquid, .. } => liquid,
            same => same,
        }
    }

    /// Whether it depends on neither temperature nor phase.
    pub fn is_constant(&self) -> bool {
        self.constant().is_some()
    }

    /// The number, if the property is one.
    pub fn constant(&self) -> Option<f64> {
        match self {
            Self::Constant(value) => Some(*value),
            _ => None,
        }
    }

    /// The number that all of `properties` are, if they are one; `None` without any.
    pub fn common(properties: &[Property]) -> Option<f64> {
        let first = properties.first()?.constant();
        first.filter(|_| properties.iter().all(|p| p.constant() == first))
    }

    /// Whether solid and liquid have separate properties.
    pub fn is_by_phase(&self) -> bool {
        matches!(self, Self::ByPhase { .. })
    }

    /// All numbers given for it; every value it can take lies between the least and the
    /// largest of them.
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::Constant(value) => vec![*value],
            Self::Table(table) => table.values().to_vec(),
            Self::ByPhase { solid, liquid } => [solid.values(), liquid.values()].concat(),
        }
    }

    /// Temperatures (K) of all table rows, in no order.
    pub fn temperatures(&self) -> Vec<f64> {
        match self {
            Self::Constant(_) => Vec::new(),
            Self::Table(table) => table.abscissae().to_vec(),
            Self::ByPhase { solid, liquid } => {
                [solid.temperatures(), liquid.temperatures()].concat()
            }
        }
    }
}

/// Forms besides [`FORMS`] of a property that may have directions.
const DIRECTIONS: &str = ", or { along = ..., across = ... } or { axes = [..., ..., ...] } of such values along the axes of the \
                          material";

const FORMS: &str = "a number, or { temperature = [...], value = [...] } with temperatures in \
                     kelvin, or { solid = ..., liquid = ... }";

impl<'de> Deserialize<'de> for Property {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let visitor = PropertyVisitor {
            has_directions: false,
        };
        match deserializer.deserialize_any(visitor)? {
            Directional::Same(property) => Ok(property),
            Directional::Axes(_) => {
                unreachable!("the visitor does not know the keys of directions")
            }
        }
    }
}

/// Reads a property; `along`, `across` and `axes` only where it may have directions.
pub(super) struct PropertyVisitor {
    pub(super) has_directions: bool,
}

impl PropertyVisitor {
    fn forms(&self) -> String {
        match self.has_directions {
            true => format!("{FORMS}{DIRECTIONS}"),
            false => FORMS.to_owned(),
        }
    }
}

impl<'de> Visitor<'de> for PropertyVisitor {
    type Value = Directional<Property>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.forms())
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Self::Value, E> {
        if value.is_finite() {
            Ok(Directional::Same(Property::Constant(value)))
        } else {
            Err(E::custom(format_args!("{value} is not a finite number")))
        }
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Self::Value, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Self::Value, E> {
        self.visit_f64(value as f64)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut parts = Parts::default();
        while let Some(part) = map.next_key_seed(PropertyKeySeed(&self))? {
            match part {
                PropertyKey::Temperature => parts.temperature = Some(map.next_value()?),
                PropertyKey::Value => parts.value = Some(map.next_value()?),
                PropertyKey::Solid => parts.solid = Some(map.next_value()?),
                PropertyKey::Liquid => parts.liquid = Some(map.next_value()?),
                PropertyKey::Along => parts.along = Some(map.next_value()?),
                PropertyKey::Across => parts.across = Some(map.next_value()?),
                PropertyKey::Axes => parts.axes = Some(map.next_value()?),
            }
        }
        parts.property(&self)
    }
}

/// The keys of a property that were given.
#[derive(Default)]
struct Parts {
    temperature: Option<Temperatures>,
    value: Option<Values>,
    solid: Option<OnePhase>,
    liquid: Option<OnePhase>,
    along: Option<Property>,
    across: Option<Property>,
    axes: Option<[Property; 3]>,
}

impl Parts {
    /// The property, if the keys are those of one form.
    fn property<E: de::Error>(self, visitor: &PropertyVisitor) -> Result<Directional<Property>, E> {
        let one = |first: bool, second: bool| usize::from(first || second);
        let forms = one(self.temperature.is_some(), self.value.is_some())
            + one(self.solid.is_some(), self.liquid.is_some())
            + one(self.along.is_some(), self.across.is_some())
            + one(self.axes.is_some(), false);
        if forms != 1 {
            return Err(E::custom(format_args!("expected {}", visitor.forms())));
        }
        let missing = |key| Err(E::missing_field(key));
        if let Some(axes) = self.axes {
            return Ok(Directional::Axes(Box::new(axes)));
        }
        let same = match (self.temperature, self.value, self.solid, self.liquid) {
            (Some(temperature), Some(value), ..) => {
                Property::Table(value.table(temperature.0).map_err(E::custom)?)
            }
            (Some(_), ..) => return missing("value"),
            (_, Some(_), ..) => return missing("temperature"),
            (_, _, Some(solid), Some(liquid)) => Property::ByPhase {
                solid: Box::new(solid.0),
                liquid: Box::new(liquid.0),
            },
            (_, _, Some(_), _) => return missing("liquid"),
            (_, _, _, Some(_)) => return missing("solid"),
            _ => {
                return match (self.along, self.across) {
                    (Some(along), Some(across)) => {
                        let axes = [along, across.clone(), across];
                        Ok(Directional::Axes(Box::new(axes)))
                    }
                    (None, _) => missing("along"),
                    (_, None) => missing("across"),
                };
            }
        };
        Ok(Directional::Same(same))
    }
}

#[derive(Clone, Copy)]
enum PropertyKey {
    Temperature,
    Value,
    Solid,
    Liquid,
    Along,
    Across,
    Axes,
}

/// Reads a key on its own, so that the reader's error points at the key.
struct PropertyKeySeed<'a>(&'a PropertyVisitor);

impl<'de> DeserializeSeed<'de> for PropertyKeySeed<'_> {
    type Value = PropertyKey;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<PropertyKey, D::Error> {
        let key = Cow::<str>::deserialize(deserializer)?;
        let parts = [
            ("temperature", PropertyKey::Temperature),
            ("value", PropertyKey::Value),
            ("solid", PropertyKey::Solid),
            ("liquid", PropertyKey::Liquid),
            ("along", PropertyKey::Along),
            ("across", PropertyKey::Across),
            ("axes", PropertyKey::Axes),
        ];
        const WITHOUT_DIRECTIONS: usize = 4;
        let found = parts.iter().position(|(name, _)| *name == key);
        let (forms, has_directions) = (self.0.forms(), self.0.has_directions);
        match found {
            Some(at) if has_directions || at < WITHOUT_DIRECTIONS => return Ok(parts[at].1),
            Some(_) => {
                return Err(de::Error::custom(format_args!(
                    "`{key}` belongs to properties with directions, but here a property is {forms}"
                )));
            }
            None => {}
        }
        let parts = match has_directions {
            true => &parts[..],
            false => &parts[..WITHOUT_DIRECTIONS],
        };
        Err(match nearest_name(&key, parts.iter().map(|part| part.0)) {
            Some(nearest) => de::Error::custom(format_args!(
                "unknown key `{key}`, did you mean `{nearest}`? A property is {forms}"
            )),
            None => de::Error::custom(format_args!("unknown key `{key}`: a property is {forms}")),
        })
    }
}

/// Temperatures checked while they are read, so that the reader's error points at them.
struct Temperatures(Vec<f64>);

impl<'de> Deserialize<'de> for Temperatures {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let rows = Vec::<f64>::deserialize(deserializer)?;
        check_increasing(&rows).map_err(de::Error::custom)?;
        match rows.iter().position(|&temperature| temperature < 0.0) {
            Some(i) => Err(de::Error::custom(format_args!(
                "row {} of the table is {}; temperatures are in kelvin and cannot be below 0",
                i + 1,
                rows[i]
            ))),
            None => Ok(Self(rows)),
        }
    }
}

/// The property of one phase, which has no phases itself.
struct OnePhase(Property);

impl<'de> Deserialize<'de> for OnePhase {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let property = Property::deserialize(deserializer)?;
        if property.is_by_phase() {
            return Err(de::Error::custom(
                "the property of one phase cannot have `solid` and `liquid` itself; give a number \
                 or { temperature = [...], value = [...] }",
            ));
        }
        Ok(Self(property))
    }
}

impl Serialize for Property {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Constant(value) => serializer.serialize_f64(*value),
            Self::Table(table) => {
                let mut map = serializer.serialize_map(Some(2))?;
                map.serialize_entry("temperature", table.abscissae())?;
                map.serialize_entry("value", table.values())?;
                map.end()
            }
            Self::ByPhase { solid, liquid } => {
                let mut map = serializer.serialize_map(Some(2))?;
                map.serialize_entry("solid", solid)?;
                map.serialize_entry("liquid", liquid)?;
                map.end()
            }
        }
    }
}

impl JsonSchema for Property {
    fn schema_name() -> Cow<'static, str> {
        "Property".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let table = json_schema!({
            "type": "object",
            "description": "Piecewise linear in temperature, clamped outside the rows",
            "properties": {
                "temperature": {
                    "type": "array", "items": { "type": "number", "minimum": 0 }, "minItems": 1,
                    "description": "Temperatures of the rows [K], strictly increasing"
                },
                "value": {
                    "type": ["array", "string"], "items": { "type": "number" }, "minItems": 1,
                    "description": "Values of the rows, or a formula in the temperature T [K] between the first temperature and the last"
                }
            },
            "required": ["temperature", "value"],
            "additionalProperties": false
        });
        let number =
            json_schema!({ "type": "number", "description": "The same at every temperature" });
        json_schema!({
            "description": "A material property: a number, a table against temperature, or one of these per phase",
            "anyOf": [
                number,
                table,
                {
                    "type": "object",
                    "description": "Separate properties of solid and liquid, mixed linearly by liquid fraction",
                    "properties": {
                        "solid": { "description": "Property of the solid", "anyOf": [number, table] },
                        "liquid": { "description": "Property of the liquid", "anyOf": [number, table] }
                    },
                    "required": ["solid", "liquid"],
                    "additionalProperties": false
                }
            ]
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Holder {
        k: Property,
    }

    pub(in crate::material) fn read(text: &str) -> Result<Property, toml::de::Error> {
        toml::from_str::<Holder>(&format!("k = {text}")).map(|holder| holder.k)
    }

    #[test]
    fn the_three_forms_are_read_and_evaluated() {
        let by_phase =
            read("{ solid = { temperature = [300, 500], value = [10, 20] }, liquid = 40 }")
                .expect("valid");
        for (temperature, fraction, expected) in [
            (400.0, 0.0, 15.0),
            (400.0, 1.0, 40.0),
            (400.0, 0.5, 27.5),
            (900.0, 0.0, 20.0),
        ] {
            assert_eq!(by_phase.at(temperature, fraction), expected);
        }
        let constant = read("7820").expect("valid");
        assert!(constant.is_constant() && !by_phase.is_constant());
        assert_eq!(constant.at(1e4, 0.3), 7820.0);
        assert_eq!(read("2.5e1").expect("valid").constant(), Some(25.0));
    }

    #[test]
    fn each_mistake_is_explained_where_it_is() {
        // input, what the message must say, text the span must cover
        let cases = [
            ("'hot'", "{ temperature = [...], value = [...] }", "'hot'"),
            ("true", "{ solid = ..., liquid = ... }", "true"),
            ("nan", "finite", "nan"),
            (
                "{ temperature = [300, 300], value = [1, 2] }",
                "row 2 is 300 after 300",
                "[300, 300]",
            ),
            (
                "{ temperature = [-10, 300], value = [1, 2] }",
                "kelvin",
                "[-10, 300]",
            ),
            (
                "{ temperature = [300], value = [1, 2] }",
                "1 abscissae but 2 values",
                "{ temperature = [300], value = [1, 2] }",
            ),
            (
                "{ temperatur = [300], value = [1] }",
                "did you mean `temperature`?",
                "temperatur",
            ),
            ("{ solid = 1 }", "missing field `liquid`", "{ solid = 1 }"),
            (
                "{ solid = 1, liquid = 2, value = [1] }",
                "expected a number",
                "{ solid = 1, liquid = 2, value = [1] }",
            ),
            (
                "{ solid = 1, liquid = { solid = 1, liquid = 2 } }",
                "cannot have `solid`",
                "{ solid = 1, liquid = 2 }",
            ),
            (
                "{ temperature = [300], value = ['x'] }",
                "invalid type: string",
                "'x'",
            ),
        ];
        for (input, message, place) in cases {
            let error = read(input).expect_err(input);
            assert!(error.message().contains(message), "{input}: {error}");
            let source = format!("k = {input}");
            let span = error.span().expect("an error has a place");
            assert_eq!(&source[span], place, "{input}");
        }
    }

    #[test]
    fn writing_and_reading_gives_the_same_property() {
        for text in [
            "12.5",
            "{ temperature = [300, 500], value = [10, 20] }",
            "{ solid = 3.0, liquid = { temperature = [300], value = [10] } }",
        ] {
            let property = read(text).expect("valid");
            let json = serde_json::to_string(&property).expect("serialises");
            assert_eq!(
                serde_json::from_str::<Property>(&json).expect("reads"),
                property
            );
        }
    }
}
