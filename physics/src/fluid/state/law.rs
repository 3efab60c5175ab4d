//! Equations of state as plugins: [`StateLaw`].
//!
//! A law is the struct of its keys in the case file, `state.<name> = { keys }`; the reference density is the property
//! `density` of the material. Points, forms of the equations and steps are not the law's business.

use std::fmt::Debug;

use perimelt_core::SetupError;
use perimelt_core::law::{Constant, LawFacts};

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

/// An equation of state: how the pressure follows from the flow. The law implements `Clone` and `Serialize`.
pub trait StateLaw: CopyState + Debug + Send + Sync + erased_serde::Serialize {
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

    /// Tolerance of the divergence, over largest speed by spacing, of a fluid that keeps its volume; `None` where sound carries the
    /// pressure.
    fn incompressible(&self) -> Option<f64> {
        None
    }

    /// Speed of sound (m/s), the largest for which the law is meant: the stable step follows from it.
    fn sound_speed(&self, reference: f64) -> f64;
}

/// Copies of equations of state behind a dynamic call.
pub trait CopyState {
    /// A copy.
    fn copy(&self) -> Box<dyn StateLaw>;
}

impl<L: StateLaw + Clone + 'static> CopyState for L {
    fn copy(&self) -> Box<dyn StateLaw> {
        Box::new(self.clone())
    }
}

erased_serde::serialize_trait_object!(StateLaw);

impl Clone for Box<dyn StateLaw> {
    fn clone(&self) -> Self {
        (**self).copy()
    }
}

perimelt_core::law_kind! {
    /// A registered equation of state.
    pub StateRegistration, dyn StateLaw, "state"
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
