//! Keys of one table that belong to several structs.
//!
//! Serde's `flatten` reads the whole table into a buffer first, which loses the position of a mistake. Here each value is read
//! where it stands in the table:
//!
//! - [`shared_keys!`](crate::shared_keys) defines a struct with keys that several tables share, documented once;
//! - [`flattened!`](crate::flattened!) defines a table with keys of its own besides shared keys;
//! - [`read`] reads shared keys besides a type that is known to a generic parameter only.

mod macros;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::value::{CowStrDeserializer, MapAccessDeserializer, StrDeserializer};
use serde::de::{self, Deserialize, DeserializeSeed, Deserializer, MapAccess, Visitor};
use serde_json::{Value, json};

/// Keys that are read one by one from a table that has other keys, too.
pub trait SharedKeys: Sized {
    /// The values read so far.
    type Slots: Default;

    /// Whether `key` is one of these keys.
    fn has_key(key: &str) -> bool;

    /// Reads the value of `key`, one of these keys, which is the next value of `table`.
    ///
    /// # Errors
    /// A value of another type.
    fn read<'de, M: MapAccess<'de>>(
        slots: &mut Self::Slots,
        key: &str,
        table: &mut M,
    ) -> Result<(), M::Error>;

    /// The keys, once the table is read.
    ///
    /// # Errors
    /// A key that is missing.
    fn finish<E: de::Error>(slots: Self::Slots) -> Result<Self, E>;
}

macro_rules! tuple_of_keys {
    ($($keys:ident $slot:tt),+) => {
        impl<$($keys: SharedKeys),+> SharedKeys for ($($keys,)+) {
            type Slots = ($($keys::Slots,)+);

            fn has_key(key: &str) -> bool {
                $($keys::has_key(key))||+
            }

            fn read<'de, M: MapAccess<'de>>(
                slots: &mut Self::Slots,
                key: &str,
                table: &mut M,
            ) -> Result<(), M::Error> {
                $(if $keys::has_key(key) {
                    return $keys::read(&mut slots.$slot, key, table);
                })+
                Ok(())
            }

            fn finish<E: de::Error>(slots: Self::Slots) -> Result<Self, E> {
                Ok(($($keys::finish(slots.$slot)?,)+))
            }
        }
    };
}

tuple_of_keys!(A 0);
tuple_of_keys!(A 0, B 1);
tuple_of_keys!(A 0, B 1, C 2);

/// Reads a table with the shared keys `K`; all other keys belong to `T`, which refuses those that it does not have.
///
/// # Errors
/// A key that is missing or unknown, or a value of another type.
pub fn read<'de, K, T, D>(deserializer: D) -> Result<(K, T), D::Error>
where
    K: SharedKeys,
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    deserializer.deserialize_map(TableVisitor(PhantomData))
}

/// Adds the keys of `K` to the schema of a table.
pub fn add_schema<K: JsonSchema>(schema: &mut Schema, generator: &mut SchemaGenerator) {
    let mut keys = K::json_schema(generator).to_value();
    let table = schema.ensure_object();
    if let Value::Object(keys) = keys["properties"].take() {
        let properties = table.entry("properties").or_insert_with(|| json!({}));
        keys.into_iter()
            .for_each(|(name, key)| properties[name] = key);
    }
    if let Value::Array(names) = keys["required"].take() {
        let required = table.entry("required").or_insert_with(|| json!([]));
        if let Some(required) = required.as_array_mut() {
            required.extend(names);
        }
    }
}

struct TableVisitor<K, T>(PhantomData<(K, T)>);

impl<'de, K: SharedKeys, T: Deserialize<'de>> Visitor<'de> for TableVisitor<K, T> {
    type Value = (K, T);

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<M: MapAccess<'de>>(self, table: M) -> Result<(K, T), M::Error> {
        let mut slots = K::Slots::default();
        let rest = Rest::<K, M> {
            table,
            slots: &mut slots,
        };
        let own = T::deserialize(MapAccessDeserializer::new(rest))?;
        Ok((K::finish(slots)?, own))
    }
}

/// The entries of a table without shared keys, which are read on the way.
struct Rest<'a, K: SharedKeys, M> {
    table: M,
    slots: &'a mut K::Slots,
}

impl<'de, K: SharedKeys, M: MapAccess<'de>> MapAccess<'de> for Rest<'_, K, M> {
    type Error = M::Error;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        mut seed: S,
    ) -> Result<Option<S::Value>, M::Error> {
        loop {
            let sorter = Sorter::<K, S>(seed, PhantomData);
            match self.table.next_key_seed(sorter)? {
                None => return Ok(None),
                Some(Sorted::Own(key)) => return Ok(Some(key)),
                Some(Sorted::Shared(key, unused)) => {
                    K::read(self.slots, &key, &mut self.table)?;
                    seed = unused;
                }
            }
        }
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, M::Error> {
        self.table.next_value_seed(seed)
    }
}

/// Sorts a key. It runs inside the deserialisation of the key, so that the error for an unknown key points at that key.
struct Sorter<K, S>(S, PhantomData<K>);

enum Sorted<'de, V, S> {
    Own(V),
    Shared(Cow<'de, str>, S),
}

impl<'de, K: SharedKeys, S: DeserializeSeed<'de>> DeserializeSeed<'de> for Sorter<K, S> {
    type Value = Sorted<'de, S::Value, S>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let key = Cow::<str>::deserialize(deserializer)?;
        if K::has_key(&key) {
            return Ok(Sorted::Shared(key, self.0));
        }
        let key = CowStrDeserializer::<D::Error>::new(key);
        self.0.deserialize(key).map(Sorted::Own)
    }
}

/// A table with one entry of another table.
#[doc(hidden)]
pub struct Entry<'a, M> {
    key: Option<&'static str>,
    table: &'a mut M,
}

impl<'a, M> Entry<'a, M> {
    /// The deserializer of a table with `key`, whose value is the next one of `table`.
    pub fn next(key: &'static str, table: &'a mut M) -> MapAccessDeserializer<Self> {
        let key = Some(key);
        MapAccessDeserializer::new(Entry { key, table })
    }
}

impl<'de, M: MapAccess<'de>> MapAccess<'de> for Entry<'_, M> {
    type Error = M::Error;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, M::Error> {
        let key = self.key.take().map(StrDeserializer::<M::Error>::new);
        key.map(|key| seed.deserialize(key)).transpose()
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, M::Error> {
        self.table.next_value_seed(seed)
    }
}

/// The deserializer of a table without keys.
#[doc(hidden)]
pub fn empty<'de, E: de::Error>() -> impl Deserializer<'de, Error = E> {
    de::value::MapDeserializer::new(std::iter::empty::<(&str, &str)>())
}
