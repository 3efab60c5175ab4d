//! What surrounds a surface that exchanges heat: a temperature in time, or a body, such as a gas.
//!
//! A body is seen as the mean temperature of its points near each point of the surface (Gao (2020), eq. 8.37, with weights by
//! volume). In a one-way exchange it keeps its heat; in a two-way exchange it loses what the surface gains, from the same points
//! ([`SurroundingBody`](perimelt_core::world::surrounding_body::SurroundingBody)).

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;

use perimelt_core::in_time::{Rows, WrongValue};
use perimelt_core::numbers::check_positive;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::surrounding_body::{NewSurroundingBody, SurroundingBody};
use perimelt_core::{
    Change, ExpectedGift, Face, Programme, Read, Setup, SetupError, Step, World, keys,
};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{
    F64Deserializer, I64Deserializer, MapAccessDeserializer, StrDeserializer, U64Deserializer,
};
use serde::de::{self, Deserializer, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

use crate::InTime;
use crate::surface::SurfacePlace;

/// Greatest distance of points that surround a point of the surface, in their spacings, where the case gives none: that of
/// Gao (2020), 8.4.2.
const USUAL_HORIZON: f64 = 3.015;

/// What surrounds a surface.
///
/// ```toml
/// ambient = 300
/// ambient = { time = [0, 10], value = [300, 500] }   # s, K
/// ambient = "293.15 + fire_iso_834(t)"
/// ambient = { body = "gas", horizon = 3.015, exchange = "two_way" }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Ambient {
    /// A temperature in time, K.
    InTime(InTime),
    /// A body.
    Body(AmbientBody),
}

/// A body that surrounds a surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AmbientBody {
    /// Its name.
    pub body: String,
    /// Greatest distance of its points from a point of the surface whose surroundings they are, in their spacings.
    pub horizon: f64,
    /// Whether it loses what the surface gains.
    pub exchange: ExchangeKind,
}

/// Which body an exchange of heat changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExchangeKind {
    /// The surroundings keep their heat, as those of a large fire.
    OneWay,
    /// The surroundings lose what the surface gains.
    #[default]
    TwoWay,
}

const FORMS: &str = "a number, { time = [...], value = [...] } with times in seconds, { file = \"...\" }, a formula in t (s), or \
                     { body = \"...\" }";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    time: Option<Vec<f64>>,
    value: Option<Vec<f64>>,
    file: Option<PathBuf>,
    column: Option<String>,
    body: Option<String>,
    horizon: Option<f64>,
    exchange: Option<ExchangeKind>,
}

impl<'de> Deserialize<'de> for Ambient {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AmbientVisitor)
    }
}

struct AmbientVisitor;

impl<'de> Visitor<'de> for AmbientVisitor {
    type Value = Ambient;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(FORMS)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Ambient, E> {
        let value: F64Deserializer<E> = value.into_deserializer();
        InTime::deserialize(value).map(Ambient::InTime)
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Ambient, E> {
        let value: I64Deserializer<E> = value.into_deserializer();
        InTime::deserialize(value).map(Ambient::InTime)
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Ambient, E> {
        let value: U64Deserializer<E> = value.into_deserializer();
        InTime::deserialize(value).map(Ambient::InTime)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Ambient, E> {
        let text: StrDeserializer<'_, E> = text.into_deserializer();
        InTime::deserialize(text).map(Ambient::InTime)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Ambient, A::Error> {
        let Keys {
            time,
            value,
            file,
            column,
            body,
            horizon,
            exchange,
        } = Keys::deserialize(MapAccessDeserializer::new(map))?;
        let has_rows = time.is_some() || value.is_some() || file.is_some() || column.is_some();
        match body {
            Some(_) if has_rows => Err(de::Error::custom(format_args!(
                "a body has a temperature of its own; expected {FORMS}"
            ))),
            Some(body) => Ok(Ambient::Body(AmbientBody {
                body,
                horizon: horizon.unwrap_or(USUAL_HORIZON),
                exchange: exchange.unwrap_or_default(),
            })),
            None if horizon.is_some() || exchange.is_some() => {
                Err(de::Error::missing_field("body"))
            }
            None => {
                let rows = Rows {
                    time,
                    value,
                    file,
                    column,
                };
                rows.value().map(Ambient::InTime)
            }
        }
    }
}

impl Serialize for Ambient {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Ambient::InTime(value) => value.serialize(serializer),
            Ambient::Body(body) => body.serialize(serializer),
        }
    }
}

impl JsonSchema for Ambient {
    fn schema_name() -> Cow<'static, str> {
        "Ambient".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let in_time = InTime::json_schema(generator);
        let mut forms = in_time.get("anyOf").cloned().unwrap_or_default();
        let body = json_schema!({
            "type": "object",
            "description": "A body that surrounds the surface, such as a gas: the mean temperature of its points near each point of the surface",
            "properties": {
                "body": { "type": "string", "description": "Name of the body" },
                "horizon": {
                    "type": "number", "exclusiveMinimum": 0, "default": USUAL_HORIZON,
                    "description": "Greatest distance of these points, in their spacings"
                },
                "exchange": generator.subschema_for::<ExchangeKind>(),
            },
            "required": ["body"],
            "additionalProperties": false
        });
        if let Some(forms) = forms.as_array_mut() {
            forms.push(body.into());
        }
        json_schema!({
            "description": "Temperature of the surroundings (K): by time, or that of a body",
            "anyOf": forms
        })
    }
}

/// Surroundings that a boundary asks for their temperatures.
#[derive(Debug)]
pub(super) enum RunningAmbient {
    InTime(InTime),
    Body(Read<f64>),
}

/// The body around a surface, and the faces that it reaches.
pub(super) struct Reach {
    pub ambient: RunningAmbient,
    pub faces: Vec<Face>,
    pub around: Option<NewSurroundingBody>,
}

impl Reach {
    /// Where the boundary exchanges heat, in a region where one is given.
    pub fn place<'a>(&'a self, region: Option<&'a str>) -> SurfacePlace<'a> {
        SurfacePlace {
            faces: &self.faces,
            region,
            around: self.around,
        }
    }
}

impl Ambient {
    /// The temperatures known in advance: every one lies between the least and the largest of them; none of a formula or a body.
    pub fn values(&self) -> &[f64] {
        match self {
            Ambient::InTime(value) => value.values(),
            Ambient::Body(_) => &[],
        }
    }

    /// The temperatures at the start, empty where they are those of a body.
    pub(super) fn first(&self) -> AmbientTemperatures {
        AmbientTemperatures(match self {
            Ambient::InTime(value) => vec![value.at(0.0)],
            Ambient::Body(_) => Vec::new(),
        })
    }

    /// The times at which the temperature changes its course, as far as they are known.
    pub(super) fn programme(&self) -> Option<Programme> {
        match self {
            Ambient::InTime(value) => Programme::of_values([("ambient", value)]),
            Ambient::Body(_) => None,
        }
    }

    /// Prepares the surroundings of `faces` of a body.
    pub(super) fn prepare(
        self,
        setup: &mut Setup<'_>,
        body: BodyIndex,
        mut faces: Vec<Face>,
    ) -> Result<Reach, SetupError> {
        let ambient = match self {
            Ambient::InTime(value) => {
                return Ok(Reach {
                    ambient: RunningAmbient::InTime(value),
                    faces,
                    around: None,
                });
            }
            Ambient::Body(ambient) => ambient,
        };
        let blame = |e: SetupError| SetupError {
            key: "ambient".into(),
            ..e
        };
        check_positive("horizon", Some(ambient.horizon), "spacings").map_err(blame)?;
        let around = setup.find_body(Some(&ambient.body)).map_err(blame)?;
        if around == body {
            let message = format!("body `{}` cannot surround itself", ambient.body);
            return Err(SetupError::value("ambient", message, "another body"));
        }
        let dimension = setup.body(around).dimension;
        let is_beyond = |face: &&Face| face.axis() >= dimension;
        if faces.len() < Face::ALL.len()
            && let Some(face) = faces.iter().find(is_beyond)
        {
            let message = format!(
                "body `{}` is {dimension}D and does not reach face `{}`",
                ambient.body,
                face.name()
            );
            let expected = "faces within the dimensions of the body around them";
            return Err(SetupError::value("faces", message, expected));
        }
        faces.retain(|face| !is_beyond(&face));
        let can_be = [Change::Flow, Change::Layers];
        for change in Change::ALL.into_iter().filter(|c| !can_be.contains(c)) {
            let message = format!(
                "the points of body `{}` near the surface would change",
                ambient.body
            );
            let expected = "a body whose points stay, such as a gas in the Eulerian description";
            let error = SetupError::value("ambient", message, expected);
            setup.refuse(around, change, error)?;
        }
        let is_two_way = ambient.exchange == ExchangeKind::TwoWay;
        if is_two_way {
            setup.publish(around, ExpectedGift::of(&keys::GIVEN_HEAT))?;
        }
        Ok(Reach {
            ambient: RunningAmbient::Body(setup.read(around, &keys::TEMPERATURE)?),
            faces,
            around: Some(NewSurroundingBody {
                body: around,
                radius: ambient.horizon * setup.body(around).coarsest_spacing(),
                is_two_way,
            }),
        })
    }
}

impl RunningAmbient {
    /// The first time after `time` (s) on which steps should land.
    pub fn next_event(&self, time: f64) -> Option<f64> {
        match self {
            RunningAmbient::InTime(value) => value.next_event(time),
            RunningAmbient::Body(_) => None,
        }
    }

    /// Writes the temperatures at the start of a run, where they are not known yet.
    pub fn begin(
        &self,
        world: &World,
        around: Option<&SurroundingBody>,
        temperatures: &mut AmbientTemperatures,
    ) {
        if !temperatures.is_known() {
            self.update(world, Step::new(0.0, 0.0), around, temperatures);
        }
    }

    /// Writes the temperatures of a step.
    pub fn update(
        &self,
        world: &World,
        step: Step,
        around: Option<&SurroundingBody>,
        temperatures: &mut AmbientTemperatures,
    ) {
        let temperatures = &mut temperatures.0;
        temperatures.clear();
        match (self, around) {
            (RunningAmbient::InTime(value), _) => temperatures.push(value.at(step.middle())),
            (RunningAmbient::Body(field), Some(around)) => {
                let values = world.read(*field);
                let near = around.near();
                let cells = 0..near.cells();
                temperatures.extend(cells.map(|cell| near.mean(cell, |point| values[point])));
            }
            (RunningAmbient::Body(_), None) => {}
        }
    }
}

/// Temperatures around a surface, K: one, or one for each cell face; empty before they are known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct AmbientTemperatures(Vec<f64>);

impl AmbientTemperatures {
    /// In front of a cell face.
    pub fn at(&self, cell: usize) -> f64 {
        match &self.0[..] {
            [one] => *one,
            all => all.get(cell).copied().unwrap_or_default(),
        }
    }

    /// Refuses temperatures at a time (s) that no surroundings have.
    pub fn check(&self, time: f64) -> Result<(), WrongValue> {
        let is_wrong = |t: &&f64| !(t.is_finite() && **t >= 0.0);
        match self.0.iter().find(is_wrong) {
            None => Ok(()),
            Some(&value) => Err(WrongValue {
                key: "ambient",
                value,
                time,
                expected: "kelvins, zero or above",
            }),
        }
    }

    pub fn highest(&self) -> f64 {
        self.0.iter().copied().fold(0.0, f64::max)
    }

    pub fn is_known(&self) -> bool {
        !self.0.is_empty()
    }
}

#[cfg(test)]
mod tests;
