//! The macros that define shared keys and the tables that have them.

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
