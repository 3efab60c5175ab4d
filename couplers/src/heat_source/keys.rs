//! The keys of a heat source in a case file: those of its shape, `body`, `toolpath` and those of its supply, side by
//! side in one table.
//!
//! Serde's flattening reads the table into a buffer first, which loses the position of a mistake. Here the
//! keys are passed on one by one.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::value::{CowStrDeserializer, MapAccessDeserializer};
use serde::de::{self, DeserializeSeed, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::supply::Supply;
use crate::toolpath::{Pulse, Toolpath};

/// A shape, the body that it heats, and the toolpath and the supply of a moving source.
#[derive(Serialize)]
pub(super) struct Keys<S> {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toolpath: Option<Toolpath>,
    #[serde(flatten)]
    pub supply: Supply,
    #[serde(flatten)]
    pub shape: S,
}

/// Reads [`Keys`]. With `moves` the key `toolpath` is known and required, and those of the supply are known.
pub(super) fn read<'de, S: Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
    moves: bool,
) -> Result<Keys<S>, D::Error> {
    let keys = deserializer.deserialize_map(KeysVisitor::<S> {
        moves,
        shape: std::marker::PhantomData,
    })?;
    if moves && keys.toolpath.is_none() {
        return Err(de::Error::missing_field("toolpath"));
    }
    Ok(keys)
}

/// The schema of `S` with `body` and, for a source that moves, `toolpath`.
pub(super) fn schema<S: JsonSchema>(generator: &mut SchemaGenerator, moves: bool) -> Schema {
    let mut body = generator.subschema_for::<Option<String>>();
    body.insert(
        "description".into(),
        "Body; may be left out when there is one only.".into(),
    );
    let mut toolpath = generator.subschema_for::<Toolpath>();
    toolpath.insert(
        "description".into(),
        "Where the source is, which way it travels and how strong it is.".into(),
    );
    let mut schema = S::json_schema(generator);
    let object = schema.ensure_object();
    let properties = object.entry("properties").or_insert_with(|| json!({}));
    properties["body"] = body.into();
    if moves {
        properties["toolpath"] = toolpath.into();
        let mut described = |key: &str, mut schema: Schema, description: &str| {
            schema.insert("description".into(), description.into());
            properties[key] = schema.into();
        };
        let number = generator.subschema_for::<Option<f64>>();
        described(
            "voltage",
            number.clone(),
            "Voltage (V) of an arc or a beam; times `current` it is the power, instead of `power`.",
        );
        described(
            "current",
            number,
            "Current (A) of an arc or a beam; times `voltage` it is the power, instead of `power`.",
        );
        described(
            "pulse",
            generator.subschema_for::<Option<Pulse>>(),
            "Pulses of the power; default none.",
        );
        let required = object.entry("required").or_insert_with(|| json!([]));
        if let Some(required) = required.as_array_mut() {
            required.push("toolpath".into());
        }
    }
    schema
}

struct KeysVisitor<S> {
    moves: bool,
    shape: std::marker::PhantomData<S>,
}

impl<'de, S: Deserialize<'de>> Visitor<'de> for KeysVisitor<S> {
    type Value = Keys<S>;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a table with the keys of a heat source")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Keys<S>, A::Error> {
        let mut own = Own::default();
        let rest = Rest {
            map,
            moves: self.moves,
            own: &mut own,
        };
        let shape = S::deserialize(MapAccessDeserializer::new(rest))?;
        let Own {
            body,
            toolpath,
            supply,
        } = own;
        Ok(Keys {
            body,
            toolpath,
            supply,
            shape,
        })
    }
}

/// Values of the keys that do not belong to the shape.
#[derive(Default)]
struct Own {
    body: Option<String>,
    toolpath: Option<Toolpath>,
    supply: Supply,
}

/// The entries of the table that belong to the shape; the others are stored on the way.
struct Rest<'a, A> {
    map: A,
    moves: bool,
    own: &'a mut Own,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Rest<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        mut seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        loop {
            let moves = self.moves;
            let (key, back) = match self.map.next_key_seed(Sorter { seed, moves })? {
                None => return Ok(None),
                Some(Sorted::Shape(key)) => return Ok(Some(key)),
                Some(Sorted::Own(key, back)) => (key, back),
            };
            seed = back;
            let (own, map) = (&mut *self.own, &mut self.map);
            match key {
                OwnKey::Body => own.body = Some(map.next_value()?),
                OwnKey::Toolpath => own.toolpath = Some(map.next_value()?),
                OwnKey::Voltage => own.supply.voltage = Some(map.next_value()?),
                OwnKey::Current => own.supply.current = Some(map.next_value()?),
                OwnKey::Pulse => own.supply.pulse = Some(map.next_value()?),
            }
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.map.next_value_seed(seed)
    }
}

/// A key that does not belong to the shape.
enum OwnKey {
    Body,
    Toolpath,
    Voltage,
    Current,
    Pulse,
}

impl OwnKey {
    fn of(key: &str, moves: bool) -> Option<OwnKey> {
        match key {
            "body" => Some(OwnKey::Body),
            _ if !moves => None,
            "toolpath" => Some(OwnKey::Toolpath),
            "voltage" => Some(OwnKey::Voltage),
            "current" => Some(OwnKey::Current),
            "pulse" => Some(OwnKey::Pulse),
            _ => None,
        }
    }
}

/// Sorts a key. It runs inside the deserialisation of the key, so that the error for an unknown key points
/// at that key.
struct Sorter<K> {
    seed: K,
    moves: bool,
}

enum Sorted<V, K> {
    Shape(V),
    Own(OwnKey, K),
}

impl<'de, K: DeserializeSeed<'de>> DeserializeSeed<'de> for Sorter<K> {
    type Value = Sorted<K::Value, K>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let key = Cow::<str>::deserialize(deserializer)?;
        if let Some(own) = OwnKey::of(&key, self.moves) {
            return Ok(Sorted::Own(own, self.seed));
        }
        let key = CowStrDeserializer::<D::Error>::new(key);
        self.seed.deserialize(key).map(Sorted::Shape)
    }
}
