//! The keys of a heat source in a case file: those of its shape, `body` and `toolpath`, side by
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

use crate::toolpath::Toolpath;

/// A shape, the body that it heats and the toolpath of a moving source.
#[derive(Serialize)]
pub(super) struct Keys<S> {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toolpath: Option<Toolpath>,
    #[serde(flatten)]
    pub shape: S,
}

/// Reads [`Keys`]. With `moves` the key `toolpath` is known and required.
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
        let (mut body, mut toolpath) = (None, None);
        let rest = Rest {
            map,
            moves: self.moves,
            body: &mut body,
            toolpath: &mut toolpath,
        };
        let shape = S::deserialize(MapAccessDeserializer::new(rest))?;
        Ok(Keys {
            body,
            toolpath,
            shape,
        })
    }
}

/// The entries of the table that belong to the shape; `body` and `toolpath` are stored on the way.
struct Rest<'a, A> {
    map: A,
    moves: bool,
    body: &'a mut Option<String>,
    toolpath: &'a mut Option<Toolpath>,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Rest<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        mut seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        loop {
            let moves = self.moves;
            match self.map.next_key_seed(Sorter { seed, moves })? {
                None => return Ok(None),
                Some(Sorted::Shape(key)) => return Ok(Some(key)),
                Some(Sorted::Body(back)) => {
                    *self.body = Some(self.map.next_value()?);
                    seed = back;
                }
                Some(Sorted::Toolpath(back)) => {
                    *self.toolpath = Some(self.map.next_value()?);
                    seed = back;
                }
            }
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.map.next_value_seed(seed)
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
    Body(K),
    Toolpath(K),
}

impl<'de, K: DeserializeSeed<'de>> DeserializeSeed<'de> for Sorter<K> {
    type Value = Sorted<K::Value, K>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let key = Cow::<str>::deserialize(deserializer)?;
        match &*key {
            "body" => Ok(Sorted::Body(self.seed)),
            "toolpath" if self.moves => Ok(Sorted::Toolpath(self.seed)),
            _ => {
                let key = CowStrDeserializer::<D::Error>::new(key);
                self.seed.deserialize(key).map(Sorted::Shape)
            }
        }
    }
}
