//! The radius of a family, the same everywhere or by the spacing of each point.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{self, Deserializer, MapAccess};
use serde::{Deserialize, Serialize, Serializer};

use super::Body;

/// Neighbours of a point beyond which a horizon is taken for a mistake.
const MOST_NEIGHBOURS: f64 = 65_535.0;

/// Radius of a family. In a case file `3` is in spacings of each point, `{ length = 0.03 }` in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Horizon {
    /// In spacings of the point itself: families of about the same size everywhere (locally
    /// defined horizon, Wang (2025), section 5.4).
    Spacings(f64),
    /// In m, the same for every point (constant horizon).
    Length(f64),
}

/// A horizon that does not suit a body.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}; expected {expected}")]
pub struct HorizonError {
    /// What is wrong.
    pub message: String,
    /// What was expected.
    pub expected: String,
}

impl Horizon {
    /// Horizon of a point with the given spacing, m, where its zone has no factor of its own
    /// ([`Points::horizon`](crate::body::Points::horizon)).
    pub fn of(self, spacing: f64) -> f64 {
        match self {
            Horizon::Spacings(count) => count * spacing,
            Horizon::Length(length) => length,
        }
    }

    /// Refuses what cannot reach the nearest neighbours on `body`.
    ///
    /// # Errors
    /// A horizon below the (coarsest) spacing.
    pub fn check(self, body: &Body) -> Result<(), HorizonError> {
        let points = &body.points;
        // the estimate assumes complete neighbourhoods
        let most = (0..points.len())
            .map(|p| points.horizon(p, self) / points.spacing[p])
            .fold(0.0, f64::max);
        let neighbours = |m: f64| match body.dimension {
            1 => 2.0 * m,
            2 => std::f64::consts::PI * m * m,
            _ => 4.0 / 3.0 * std::f64::consts::PI * m.powi(3),
        };
        if !(neighbours(most) <= MOST_NEIGHBOURS) {
            let message = format!(
                "`horizon` = {self} is {most:.3e} spacings, within which a point has {:.1e} neighbours",
                neighbours(most)
            );
            let expected = "some 2 to 6 spacings; at most 65535 neighbours of a point".into();
            return Err(HorizonError { message, expected });
        }
        let reaches_a_neighbour = |p: usize| {
            // a length given in decimals may fall short by rounding
            points.horizon(p, self) >= points.spacing[p] * (1.0 - 1e-9)
        };
        let Some(point) = (0..points.len()).find(|p| !reaches_a_neighbour(*p)) else {
            return Ok(());
        };
        if !points.horizon_factor.is_empty() {
            let message = format!(
                "`horizon` = {self} and the `horizon_factor` of a zone reach no neighbour: {} m with a spacing of {} m",
                points.horizon(point, self),
                points.spacing[point]
            );
            let expected = "horizons of at least the spacing of each zone".into();
            return Err(HorizonError { message, expected });
        }
        let spacing = body.coarsest_spacing();
        let message = format!("`horizon` = {self} reaches no neighbour");
        let expected = match self {
            Horizon::Spacings(_) => "at least 1 (spacing)".to_string(),
            Horizon::Length(_) => format!("at least the largest spacing, {spacing} m"),
        };
        Err(HorizonError { message, expected })
    }
}

impl fmt::Display for Horizon {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Horizon::Spacings(count) => write!(f, "{count}"),
            Horizon::Length(length) => write!(f, "{length} m"),
        }
    }
}

/// The table of a length.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Length {
    length: f64,
}

impl Serialize for Horizon {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Horizon::Spacings(count) => serializer.serialize_f64(count),
            Horizon::Length(length) => Length { length }.serialize(serializer),
        }
    }
}

/// By hand, because an untagged enum cannot say what it expected.
impl<'de> Deserialize<'de> for Horizon {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Horizon;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of spacings or { length = ... } in m")
            }

            fn visit_f64<E: de::Error>(self, count: f64) -> Result<Horizon, E> {
                Ok(Horizon::Spacings(count))
            }

            fn visit_i64<E: de::Error>(self, count: i64) -> Result<Horizon, E> {
                self.visit_f64(count as f64)
            }

            fn visit_u64<E: de::Error>(self, count: u64) -> Result<Horizon, E> {
                self.visit_f64(count as f64)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Horizon, A::Error> {
                let map = de::value::MapAccessDeserializer::new(map);
                Length::deserialize(map).map(|given| Horizon::Length(given.length))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl JsonSchema for Horizon {
    fn schema_name() -> Cow<'static, str> {
        "Horizon".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schemars::json_schema!({ "oneOf": [
            { "type": "number", "minimum": 1 },
            {
                "type": "object",
                "properties": { "length": { "type": "number", "exclusiveMinimum": 0, "description": "Horizon of every point, m." } },
                "required": ["length"],
                "additionalProperties": false
            }
        ] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spacings_and_lengths_are_named() {
        #[derive(Deserialize, Serialize)]
        struct Keys {
            horizon: Horizon,
        }
        for (text, horizon) in [
            ("horizon = 3", Horizon::Spacings(3.0)),
            ("horizon = 3.015", Horizon::Spacings(3.015)),
            ("horizon.length = 0.03", Horizon::Length(0.03)),
        ] {
            let keys: Keys = toml::from_str(text).expect("a horizon");
            assert_eq!(keys.horizon, horizon);
            let again: Keys =
                toml::from_str(&toml::to_string(&keys).expect("TOML")).expect("reads back");
            assert_eq!(again.horizon, horizon);
        }
        let wrong = toml::from_str::<Keys>("horizon = 'wide'")
            .err()
            .expect("text");
        assert!(wrong.to_string().contains("a number of spacings or"));
    }
}
