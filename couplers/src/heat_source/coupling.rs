//! Moving sources as couplers: those of this crate, and those that another crate registers.

use super::MovingSource;
use crate::source;

/// A coupler that consists of a [`MovingSource`].
pub trait HasSource {
    /// Shape of the source.
    type Shape;

    /// The source.
    fn moving(&self) -> &MovingSource<Self::Shape>;

    /// The source.
    fn moving_mut(&mut self) -> &mut MovingSource<Self::Shape>;
}

impl<S> HasSource for MovingSource<S> {
    type Shape = S;

    fn moving(&self) -> &MovingSource<S> {
        self
    }

    fn moving_mut(&mut self) -> &mut MovingSource<S> {
        self
    }
}

/// Implements `Coupler` for a type that [`HasSource`], and registers it.
#[doc(hidden)]
#[macro_export]
macro_rules! couple_source {
    ($name:literal, $source:ty) => {
        #[typetag::serialize(name = $name)]
        impl $crate::perimelt_core::Coupler for $source {
            fn publish(
                &mut self,
                setup: &mut $crate::perimelt_core::Setup<'_>,
            ) -> ::std::result::Result<(), $crate::perimelt_core::SetupError> {
                $crate::heat_source::HasSource::moving_mut(self).publish_path(setup)
            }

            fn prepare(
                &mut self,
                setup: &mut $crate::perimelt_core::Setup<'_>,
            ) -> ::std::result::Result<(), $crate::perimelt_core::SetupError> {
                $crate::heat_source::HasSource::moving_mut(self).prepare_source(setup)
            }

            fn apply(
                &mut self,
                world: &$crate::perimelt_core::World,
                step: $crate::perimelt_core::Step,
            ) -> ::std::result::Result<(), $crate::perimelt_core::RunError> {
                $crate::heat_source::HasSource::moving_mut(self).apply_source(world, step)
            }

            fn begin_step(&mut self, world: &$crate::perimelt_core::World, time: f64) {
                $crate::heat_source::HasSource::moving_mut(self).begin_source(world, time);
            }

            fn unfinished(&self, time: f64) -> ::std::option::Option<String> {
                $crate::heat_source::HasSource::moving(self).unfinished_path(time)
            }

            fn next_event(&self, after: f64) -> ::std::option::Option<f64> {
                $crate::heat_source::HasSource::moving(self).next_switch(after)
            }

            fn programme(
                &self,
                run_end: f64,
            ) -> ::std::option::Option<$crate::perimelt_core::Programme> {
                $crate::heat_source::HasSource::moving(self).path_programme(run_end)
            }

            fn step_limit(&self, time: f64) -> ::std::option::Option<f64> {
                $crate::heat_source::HasSource::moving(self).longest_step(time)
            }

            fn report(&self) -> ::std::vec::Vec<$crate::perimelt_core::Report> {
                $crate::heat_source::HasSource::moving(self).report_source()
            }

            fn save(&self) -> ::std::boxed::Box<dyn $crate::erased_serde::Serialize + '_> {
                $crate::heat_source::HasSource::moving(self).saved()
            }

            fn load(
                &mut self,
                state: &mut dyn $crate::erased_serde::Deserializer<'_>,
            ) -> ::std::result::Result<(), $crate::erased_serde::Error> {
                $crate::heat_source::HasSource::moving_mut(self).restore(state)
            }
        }

        $crate::perimelt_core::register_coupler!(
            $name,
            $source,
            supports: [Motion, Flow, Births, Cuts, Window]
        );
    };
}

/// Makes a shape of another crate known as a moving heat source: `register_source!("ring_source", RingSource, Ring)` defines the coupler
/// `RingSource` of a shape `Ring`, which implements [`SourceShape`](crate::heat_source::SourceShape), `Serialize`, `Deserialize` (with
/// `deny_unknown_fields`) and `JsonSchema`. Its keys are those of the shape, beside `body`, `toolpath`, `voltage`, `current` and
/// `pulse`. The crate needs `typetag`.
#[macro_export]
macro_rules! register_source {
    ($name:literal, $source:ident, $shape:ty) => {
        #[doc = concat!("The moving heat source `", $name, "`.")]
        pub struct $source($crate::heat_source::MovingSource<$shape>);

        impl $crate::heat_source::HasSource for $source {
            type Shape = $shape;

            fn moving(&self) -> &$crate::heat_source::MovingSource<$shape> {
                &self.0
            }

            fn moving_mut(&mut self) -> &mut $crate::heat_source::MovingSource<$shape> {
                &mut self.0
            }
        }

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

        $crate::couple_source!($name, $source);
    };
}

couple_source!("goldak", MovingSource<source::Goldak>);
couple_source!("ellipsoid", MovingSource<source::SemiEllipsoid>);
couple_source!("gaussian_source", MovingSource<source::Gaussian>);
couple_source!("point_source", MovingSource<source::Point>);
couple_source!("super_gaussian", MovingSource<source::SuperGaussian>);
couple_source!("profile_source", MovingSource<source::Profile>);
