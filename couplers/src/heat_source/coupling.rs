//! Moving sources as couplers: those of this crate, and those that another crate registers.

use super::MovingSource;
use super::shape;

/// Implements `Coupler` for a [`MovingSource`], or for a type with one in a field, and registers it.
#[doc(hidden)]
#[macro_export]
macro_rules! couple_source {
    ($name:literal, $source:ty $(, $field:tt)?) => {
        #[typetag::serialize(name = $name)]
        impl $crate::perimelt_core::Coupler for $source {
            fn publish(
                &mut self,
                setup: &mut $crate::perimelt_core::Setup<'_>,
            ) -> ::std::result::Result<(), $crate::perimelt_core::SetupError> {
                self$(.$field)?.publish_path(setup)
            }

            fn prepare(
                self: ::std::boxed::Box<Self>,
                setup: &mut $crate::perimelt_core::Setup<'_>,
            ) -> $crate::perimelt_core::Prepared<dyn $crate::perimelt_core::RunningCoupler> {
                (*self)$(.$field)?.prepare_source(setup)
            }
        }

        $crate::perimelt_core::register_coupler!(
            $name,
            $source,
            supports: [Motion, Flow, Births, Cuts, Window, Division]
        );
    };
}

/// Registers a shape of another crate as a moving heat source: `register_source!("ring_source", RingSource, Ring)` defines the coupler
/// `RingSource` of a shape `Ring`, which implements [`SourceShape`](crate::heat_source::SourceShape), `Serialize`, `Deserialize` (with
/// `deny_unknown_fields`) and `JsonSchema`. Its keys are those of the shape, beside `body`, `toolpath`, `voltage`, `current` and
/// `pulse`. The crate needs `typetag`.
#[macro_export]
macro_rules! register_source {
    ($name:literal, $source:ident, $shape:ty) => {
        #[doc = concat!("The moving heat source `", $name, "`.")]
        pub struct $source($crate::heat_source::MovingSource<$shape>);

        impl $crate::perimelt_core::serde::Serialize for $source {
            fn serialize<S: $crate::perimelt_core::serde::Serializer>(
                &self,
                serializer: S,
            ) -> ::std::result::Result<S::Ok, S::Error> {
                $crate::perimelt_core::serde::Serialize::serialize(&self.0, serializer)
            }
        }

        impl<'de> $crate::perimelt_core::serde::Deserialize<'de> for $source {
            fn deserialize<D: $crate::perimelt_core::serde::Deserializer<'de>>(
                deserializer: D,
            ) -> ::std::result::Result<Self, D::Error> {
                $crate::perimelt_core::serde::Deserialize::deserialize(deserializer).map($source)
            }
        }

        impl $crate::perimelt_core::schemars::JsonSchema for $source {
            fn schema_name() -> ::std::borrow::Cow<'static, str> {
                <$shape as $crate::perimelt_core::schemars::JsonSchema>::schema_name()
            }

            fn json_schema(
                generator: &mut $crate::perimelt_core::schemars::SchemaGenerator,
            ) -> $crate::perimelt_core::schemars::Schema {
                <$crate::heat_source::MovingSource<$shape> as $crate::perimelt_core::schemars::JsonSchema>::json_schema(generator)
            }
        }

        $crate::couple_source!($name, $source, 0);
    };
}

couple_source!("goldak", MovingSource<shape::Goldak>);
couple_source!("ellipsoid", MovingSource<shape::SemiEllipsoid>);
couple_source!("gaussian_source", MovingSource<shape::Gaussian>);
couple_source!("point_source", MovingSource<shape::Point>);
couple_source!("super_gaussian", MovingSource<shape::SuperGaussian>);
couple_source!("profile_source", MovingSource<shape::Profile>);
