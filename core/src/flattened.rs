//! Keys of one table that belong to several structs.
//!
//! Serde's `flatten` reads the whole table into a buffer first, which loses the position of a mistake. Here each value is read
//! where it stands in the table:
//!
//! - [`shared_keys!`](crate::shared_keys) defines a struct with keys that several tables share, documented once;
//! - [`flattened!`](crate::flattened) defines a table with keys of its own besides shared keys;
//! - [`keys_by_choice!`](crate::keys_by_choice) defines an enum with keys for each choice, selected by another key of the same table;
//! - [`read`] reads shared keys besides a type that is known to a generic parameter only.

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

    /// A key that the table had.
    fn given(slots: &Self::Slots) -> Option<&'static str>;

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

            fn given(slots: &Self::Slots) -> Option<&'static str> {
                None$(.or_else(|| $keys::given(&slots.$slot)))+
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

/// The error for a key that does not belong to the choice of `tag`.
#[doc(hidden)]
pub fn other_choice<E: de::Error>(key: &str, tag: &str, choice: &str) -> E {
    E::custom(format_args!(
        "key `{key}` does not belong to `{tag} = \"{choice}\"`"
    ))
}

/// The schema of the key `tag` with its choices and their documentation.
#[doc(hidden)]
pub fn choices(tag: &str, choices: &[(&str, &str)]) -> Schema {
    let choice = |(name, doc): &(&str, &str)| json!({ "const": name, "description": doc.trim() });
    let choices: Vec<Value> = choices.iter().map(choice).collect();
    schemars::json_schema!({
        "type": "object",
        "properties": { tag: { "type": "string", "oneOf": choices } }
    })
}

/// Defines a struct whose keys several tables share. Its fields have documentation and then at most one `serde` and one `schemars`
/// attribute, with the meaning that serde gives them. The crate needs `serde` and `schemars`.
#[macro_export]
macro_rules! shared_keys {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $(
            $(#[doc = $doc:literal])*
            $(#[serde($($serde:tt)*)])?
            $(#[schemars($($schemars:tt)*)])?
            $field_vis:vis $field:ident: $type:ty,
        )*
    }) => {
        $(#[$meta])*
        #[derive(::serde::Serialize, ::schemars::JsonSchema)]
        $vis struct $name {
            $(
                $(#[doc = $doc])*
                $(#[serde($($serde)*)])?
                $(#[schemars($($schemars)*)])?
                $field_vis $field: $type,
            )*
        }

        const _: () = {
            use ::serde::de::{Deserialize, Deserializer, Error, MapAccess};

            #[derive(Default)]
            $vis struct Slots {
                $($field: Option<$type>,)*
            }

            /// Reads tables with one key or none, so that serde handles keys that are left out.
            struct Reader;

            impl Reader {
                $(
                    fn $field<'de, D: Deserializer<'de>>(table: D) -> Result<$type, D::Error> {
                        #[derive(::serde::Deserialize)]
                        struct OneKey {
                            $(#[serde($($serde)*)])?
                            $field: $type,
                        }
                        OneKey::deserialize(table).map(|key| key.$field)
                    }
                )*
            }

            impl $crate::flattened::SharedKeys for $name {
                type Slots = Slots;

                fn has_key(key: &str) -> bool {
                    matches!(key, $(stringify!($field))|*)
                }

                fn read<'de, M: MapAccess<'de>>(
                    slots: &mut Slots,
                    key: &str,
                    table: &mut M,
                ) -> Result<(), M::Error> {
                    match key {
                        $(stringify!($field) => {
                            let entry = $crate::flattened::Entry::next(stringify!($field), table);
                            slots.$field = Some(Reader::$field(entry)?);
                        })*
                        _ => {}
                    }
                    Ok(())
                }

                fn given(slots: &Slots) -> Option<&'static str> {
                    None$(.or(slots.$field.as_ref().map(|_| stringify!($field))))*
                }

                fn finish<E: Error>(slots: Slots) -> Result<Self, E> {
                    Ok($name {
                        $($field: match slots.$field {
                            Some(value) => value,
                            None => Reader::$field($crate::flattened::empty::<E>())?,
                        },)*
                    })
                }
            }
        };
    };
}

/// Defines a table with keys of its own besides [`shared_keys!`](crate::shared_keys), which are written first as `..name: Type`. Its
/// fields have documentation and then at most one `serde` and one `schemars` attribute. The crate needs `serde` and `schemars`.
#[macro_export]
macro_rules! flattened {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $(..$group:ident: $keys:ty,)+
        $(
            $(#[doc = $doc:literal])*
            $(#[serde($($serde:tt)*)])?
            $(#[schemars($($schemars:tt)*)])?
            $field_vis:vis $field:ident: $type:ty,
        )*
    }) => {
        $(#[$meta])*
        #[derive(::serde::Serialize, ::schemars::JsonSchema)]
        #[schemars(deny_unknown_fields)]
        $vis struct $name {
            $(
                #[doc = concat!("Keys of [`", stringify!($keys), "`].")]
                #[serde(flatten)]
                pub $group: $keys,
            )+
            $(
                $(#[doc = $doc])*
                $(#[serde($($serde)*)])?
                $(#[schemars($($schemars)*)])?
                $field_vis $field: $type,
            )*
        }

        const _: () = {
            #[derive(::serde::Deserialize)]
            #[serde(deny_unknown_fields)]
            struct Own {
                $(
                    $(#[serde($($serde)*)])?
                    $field: $type,
                )*
            }

            impl<'de> ::serde::Deserialize<'de> for $name {
                fn deserialize<D: ::serde::Deserializer<'de>>(table: D) -> Result<Self, D::Error> {
                    let (($($group,)+), own) =
                        $crate::flattened::read::<($($keys,)+), Own, D>(table)?;
                    let Own { $($field,)* } = own;
                    Ok($name { $($group,)+ $($field,)* })
                }
            }
        };
    };
}

/// Defines an enum with [`shared_keys!`](crate::shared_keys) for each choice, selected by the key `tag` of the same table; the first
/// choice is the default. A key that several choices have belongs to the table. The crate needs `serde` and `schemars`.
#[macro_export]
macro_rules! keys_by_choice {
    ($(#[$meta:meta])* $vis:vis enum $name:ident, tag $tag:literal {
        $(
            $(#[doc = $doc:literal])*
            $choice:literal => $variant:ident($keys:ty),
        )+
    }) => {
        $(#[$meta])*
        #[derive(::serde::Serialize)]
        #[serde(tag = $tag)]
        $vis enum $name {
            $(
                $(#[doc = $doc])*
                #[serde(rename = $choice)]
                $variant($keys),
            )+
        }

        const _: () = {
            use $crate::flattened::SharedKeys;
            use ::schemars::{JsonSchema, Schema, SchemaGenerator};
            use ::serde::de::{Error, MapAccess};

            #[derive(Clone, Copy, PartialEq, ::serde::Deserialize)]
            $vis enum Choice {
                $(#[serde(rename = $choice)] $variant,)+
            }

            #[derive(Default)]
            #[allow(non_snake_case, reason = "named after the variants")]
            $vis struct Slots {
                choice: Option<Choice>,
                $($variant: <$keys as SharedKeys>::Slots,)+
            }

            impl SharedKeys for $name {
                type Slots = Slots;

                fn has_key(key: &str) -> bool {
                    key == $tag $(|| <$keys>::has_key(key))+
                }

                fn read<'de, M: MapAccess<'de>>(
                    slots: &mut Slots,
                    key: &str,
                    table: &mut M,
                ) -> Result<(), M::Error> {
                    if key == $tag {
                        slots.choice = Some(table.next_value()?);
                        return Ok(());
                    }
                    $(if <$keys>::has_key(key) {
                        return <$keys>::read(&mut slots.$variant, key, table);
                    })+
                    Ok(())
                }

                fn given(slots: &Slots) -> Option<&'static str> {
                    let choice = slots.choice.as_ref().map(|_| $tag);
                    choice$(.or_else(|| <$keys>::given(&slots.$variant)))+
                }

                fn finish<E: Error>(slots: Slots) -> Result<Self, E> {
                    let all = [$((Choice::$variant, $choice, <$keys>::given(&slots.$variant)),)+];
                    let chosen = slots.choice.unwrap_or(all[0].0);
                    let name = all.iter().find(|(choice, ..)| *choice == chosen).map_or("", |all| all.1);
                    let others = all.iter().filter(|(choice, ..)| *choice != chosen);
                    if let Some(key) = others.filter_map(|(.., given)| *given).next() {
                        return Err($crate::flattened::other_choice(key, $tag, name));
                    }
                    Ok(match chosen {
                        $(Choice::$variant => $name::$variant(<$keys>::finish(slots.$variant)?),)+
                    })
                }
            }

            impl JsonSchema for $name {
                fn schema_name() -> ::std::borrow::Cow<'static, str> {
                    stringify!($name).into()
                }

                fn json_schema(generator: &mut SchemaGenerator) -> Schema {
                    let choices = [$(($choice, concat!($($doc),*)),)+];
                    let mut schema = $crate::flattened::choices($tag, &choices);
                    $($crate::flattened::add_schema::<$keys>(&mut schema, generator);)+
                    // the keys of a choice are not required by other choices
                    schema.remove("required");
                    schema
                }
            }
        };
    };
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;
    use serde_json::{Value, json};

    shared_keys! {
        #[derive(Clone, Debug, Default, PartialEq)]
        struct Place {
            /// Body.
            #[serde(skip_serializing_if = "Option::is_none")]
            body: Option<String>,
            /// Position, m.
            at: [f64; 2],
            /// Whether it counts.
            #[serde(default = "yes")]
            counts: bool,
        }
    }

    shared_keys! {
        #[derive(Clone, Debug, Default, PartialEq)]
        struct Ordinary {
            /// Stabilisation.
            #[serde(default)]
            stabilisation: f64,
        }
    }

    shared_keys! {
        #[derive(Clone, Debug, Default, PartialEq)]
        struct Conservative {
            /// Surface.
            surface: String,
        }
    }

    keys_by_choice! {
        #[derive(Clone, Debug, PartialEq)]
        enum Form, tag "form" {
            /// The ordinary form.
            "ordinary" => Ordinary(Ordinary),
            /// The conservative form.
            "conservative" => Conservative(Conservative),
        }
    }

    flattened! {
        /// A table.
        #[derive(Clone, Debug, PartialEq)]
        struct Table {
            ..place: Place,
            ..form: Form,
            /// Power, W.
            #[serde(alias = "watts")]
            #[schemars(extend("minimum" = 0))]
            power: f64,
        }
    }

    fn yes() -> bool {
        true
    }

    fn read(text: &str) -> Table {
        toml::from_str(text).expect("valid")
    }

    /// The message of a mistake and the text at its place.
    fn mistake(text: &str) -> (String, String) {
        let error = toml::from_str::<Table>(text).expect_err("a mistake");
        let span = error.span().expect("a place");
        (error.message().into(), text[span].into())
    }

    #[test]
    fn keys_are_distributed_and_defaults_taken() {
        let table = read("watts = 5\nat = [1, 2]");
        let place = Place {
            body: None,
            at: [1.0, 2.0],
            counts: true,
        };
        let form = Form::Ordinary(Ordinary { stabilisation: 0.0 });
        assert_eq!((table.place, table.form, table.power), (place, form, 5.0));
        let table = read(
            "at = [1, 2]\npower = 1\nsurface = 'open'\nform = 'conservative'\nbody = 'b'\ncounts = false",
        );
        assert!(matches!(&table.form, Form::Conservative(keys) if keys.surface == "open"));
        assert_eq!(
            (table.place.body.as_deref(), table.place.counts),
            (Some("b"), false)
        );
        let saved = serde_json::to_value(&table).expect("serialises");
        assert_eq!(
            saved,
            json!({ "at": [1.0, 2.0], "body": "b", "counts": false, "form": "conservative", "power": 1.0, "surface": "open" })
        );
        assert_eq!(Table::deserialize(saved).expect("the same"), table);
    }

    #[test]
    fn a_mistake_keeps_its_place() {
        let (message, place) = mistake("power = 1\nat = [1, 'two']");
        assert!(
            message.starts_with("invalid type: string") && place == "'two'",
            "{message}"
        );
        let (message, place) = mistake("power = 1\nat = [1, 2]\nbodi = 'b'");
        assert!(
            message.starts_with("unknown field `bodi`") && place == "bodi",
            "{message}"
        );
        let (message, place) = mistake("power = 1\nat = [1, 2]\nform = 'other'");
        assert!(
            message.starts_with("unknown variant `other`") && place == "'other'",
            "{message}"
        );
        assert_eq!(mistake("power = 1").0, "missing field `at`");
        assert_eq!(mistake("at = [1, 2]").0, "missing field `power`");
        let chosen = "power = 1\nat = [1, 2]\nform = 'conservative'";
        assert_eq!(mistake(chosen).0, "missing field `surface`");
        let other = mistake(&format!("{chosen}\nsurface = 'open'\nstabilisation = 1")).0;
        assert_eq!(
            other,
            "key `stabilisation` does not belong to `form = \"conservative\"`"
        );
    }

    #[test]
    fn the_schema_lists_all_keys_with_their_documentation() {
        let schema = schemars::schema_for!(Table).to_value();
        let properties = schema["properties"].as_object().expect("keys");
        let names: Vec<_> = properties.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            [
                "at",
                "body",
                "counts",
                "form",
                "power",
                "stabilisation",
                "surface"
            ]
        );
        assert_eq!(schema["required"], json!(["at", "power"]));
        assert_eq!(schema["additionalProperties"], Value::Bool(false));
        assert_eq!(schema["description"], "A table.");
        for (key, description) in [("at", "Position, m."), ("stabilisation", "Stabilisation.")] {
            assert_eq!(properties[key]["description"], description);
        }
        assert_eq!(
            (
                &properties["counts"]["default"],
                &properties["power"]["minimum"]
            ),
            (&json!(true), &json!(0))
        );
        assert_eq!(
            properties["form"]["oneOf"][1]["description"],
            "The conservative form."
        );
    }
}
