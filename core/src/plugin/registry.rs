//! How plugins make themselves known.

use schemars::Schema;

use super::{Coupler, Physics};
use crate::named::{HasName, by_name};
use crate::world::changes::Changes;

/// Builds a plugin of one kind from its table in a case file, keeping exact error positions.
pub type FromToml<P> = fn(toml::de::ValueDeserializer<'_>) -> Result<Box<P>, toml::de::Error>;

/// A registered kind of plugin.
pub struct Registration<P: ?Sized + 'static> {
    /// The `type` in case files.
    pub name: &'static str,
    /// Keys, types, defaults, documentation.
    pub schema: fn() -> Schema,
    /// Constructor.
    pub from_toml: FromToml<P>,
    /// What may happen to the points of the bodies on which it acts.
    pub supports: Changes,
}

inventory::collect!(Registration<dyn Physics>);
inventory::collect!(Registration<dyn Coupler>);

impl<P: ?Sized> HasName for Registration<P> {
    fn name(&self) -> &'static str {
        self.name
    }
}

/// All registered plugins of one kind (`dyn Physics` or `dyn Coupler`), by name.
pub fn registered<P: ?Sized + 'static>() -> Vec<&'static Registration<P>>
where
    Registration<P>: inventory::Collect,
{
    by_name(|registration| registration)
}

/// What a plugin of this type supports; everything where the type is not registered, so that no case file can name it.
pub(crate) fn supported<P: ?Sized + 'static>(name: &str) -> Changes
where
    Registration<P>: inventory::Collect,
{
    let all = registered::<P>();
    let plugin = all.iter().find(|r| r.name == name);
    plugin.map_or(Changes::ALL, |r| r.supports)
}

/// Makes a physics known under the name of its `typetag` attribute, with what may happen to the points of the bodies on
/// which it acts ([`Change`](crate::Change)); without a list, points have to rest and keep their material.
///
/// ```text
/// register_physics!("diffusion", Diffusion, supports: [Births, Cuts]);
/// ```
#[macro_export]
macro_rules! register_physics {
    ($name:literal, $physics:ty $(, supports: [$($change:ident),*])?) => {
        $crate::register!(dyn $crate::Physics, $name, $physics, [$($($change),*)?]);
    };
}

/// Makes a coupler known, as [`register_physics!`] does a physics.
#[macro_export]
macro_rules! register_coupler {
    ($name:literal, $coupler:ty $(, supports: [$($change:ident),*])?) => {
        $crate::register!(dyn $crate::Coupler, $name, $coupler, [$($($change),*)?]);
    };
}

/// Makes a material property known: its name, SI unit, meaning, and
/// [`ValueRange`](crate::material::ValueRange), and `directional` if it may differ along the axes of the material.
#[macro_export]
macro_rules! register_property {
    (@is) => { false };
    (@is directional) => { true };
    ($name:literal, $unit:literal, $meaning:literal, $range:expr $(, $directional:ident)?) => {
        $crate::inventory::submit! {
            $crate::material::PropertyKey {
                name: $name,
                unit: $unit,
                meaning: $meaning,
                range: $range,
                has_directions: $crate::register_property!(@is $($directional)?),
            }
        }
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! register {
    ($kind:ty, $name:literal, $plugin:ty, [$($change:ident),*]) => {
        $crate::inventory::submit! {
            $crate::plugin::Registration::<$kind> {
                name: $name,
                schema: || $crate::schemars::schema_for!($plugin),
                from_toml: |value| {
                    let plugin = <$plugin as $crate::serde::Deserialize>::deserialize(value)?;
                    Ok(Box::new(plugin))
                },
                supports: $crate::Changes::of(&[$($crate::Change::$change),*]),
            }
        }
    };
}
