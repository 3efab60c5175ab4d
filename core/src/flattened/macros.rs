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
