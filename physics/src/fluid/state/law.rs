//! Equations of state as plugins: [`StateLaw`].
//!
//! A law is the struct of its keys in the case file, `state.<name> = { keys }`; the reference density is the property
//! `density` of the material. Points, forms of the equations and steps are not the law's business.

use std::fmt::Debug;

use perimelt_core::SetupError;
use perimelt_core::law::{Constant, LawFacts, LawKind, LawRegistration};
use perimelt_core::plugin::by_name;
use serde::Serialize;

/// A point whose density changes.
#[derive(Clone, Copy, Debug)]
pub struct DensityChange {
    /// Density before, kg/m³.
    pub before: f64,
    /// Density after, kg/m³.
    pub after: f64,
    /// Pressure before, Pa.
    pub pressure: f64,
    /// Density of the material, kg/m³.
    pub reference: f64,
}

/// An equation of state: the pressure of a weakly compressible fluid.
pub trait StateLaw: Clone + Debug + Send + Sync + Serialize + 'static {
    /// Checks the keys.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn check(&self) -> Result<(), SetupError> {
        Ok(())
    }

    /// Pressure after a change of the density, Pa.
    fn pressure(&self, change: DensityChange) -> f64;

    /// Density (kg/m³) of a fluid that was brought from its reference density to a pressure (Pa).
    fn density(&self, pressure: f64, reference: f64) -> f64;

    /// Speed of sound (m/s), the largest for which the law is meant: the stable step follows from it.
    fn sound_speed(&self, reference: f64) -> f64;
}

/// An equation of state behind a dynamic call.
pub trait AnyState: Debug + Send + Sync + erased_serde::Serialize {
    /// See [`StateLaw::check`].
    ///
    /// # Errors
    /// Errors of the law.
    fn check(&self) -> Result<(), SetupError>;

    /// See [`StateLaw::pressure`].
    fn pressure(&self, change: DensityChange) -> f64;

    /// See [`StateLaw::density`].
    fn density(&self, pressure: f64, reference: f64) -> f64;

    /// See [`StateLaw::sound_speed`].
    fn sound_speed(&self, reference: f64) -> f64;

    /// A copy.
    fn copy(&self) -> Box<dyn AnyState>;
}

erased_serde::serialize_trait_object!(AnyState);

impl Clone for Box<dyn AnyState> {
    fn clone(&self) -> Self {
        (**self).copy()
    }
}

impl<L: StateLaw> AnyState for L {
    fn check(&self) -> Result<(), SetupError> {
        StateLaw::check(self)
    }

    fn pressure(&self, change: DensityChange) -> f64 {
        StateLaw::pressure(self, change)
    }

    fn density(&self, pressure: f64, reference: f64) -> f64 {
        StateLaw::density(self, pressure, reference)
    }

    fn sound_speed(&self, reference: f64) -> f64 {
        StateLaw::sound_speed(self, reference)
    }

    fn copy(&self) -> Box<dyn AnyState> {
        Box::new(self.clone())
    }
}

/// A registered equation of state.
pub struct StateRegistration(pub LawRegistration<dyn AnyState>);

perimelt_core::inventory::collect!(StateRegistration);

impl LawKind for dyn AnyState {
    const KEY: &'static str = "state";

    fn registered() -> Vec<&'static LawRegistration<Self>> {
        by_name(|registration: &'static StateRegistration| &registration.0)
    }
}

/// What `perimelt explain` says about equations of state besides their keys.
pub const FACTS: LawFacts = LawFacts {
    constants: &[Constant::required("density")],
    state: &[],
    others: &[],
};

/// Makes a [`StateLaw`] known as `state.<name>`: `register_state_law!("tait", Tait)`. The law implements `Serialize`,
/// `Deserialize` (with `deny_unknown_fields`) and `JsonSchema`.
#[macro_export]
macro_rules! register_state_law {
    ($name:literal, $law:ty) => {
        $crate::perimelt_core::inventory::submit! {
            $crate::fluid::state::StateRegistration(
                $crate::perimelt_core::law_registration!($name, $law, ::core::convert::identity, $crate::fluid::state::FACTS),
            )
        }
    };
}
