//! Laws of conductivity as plugins: [`ConductivityLaw`].
//!
//! A law is the struct of its keys in the case file, `conductivity.<name> = { keys }`, and says at set-up how the conductivity of a
//! material follows from its properties, which are numbers, tables of the temperature, or given by phase. Nothing is called in a
//! step.

use std::fmt::Debug;

use perimelt_core::SetupError;
use perimelt_core::law::{Constant, LawFacts};
use perimelt_core::material::{Directional, Property};
use serde::Serialize;

/// A law of the conductivity of materials, W/(m K). Axes of the material are turned by the field `orientation` of the body.
pub trait ConductivityLaw: Clone + Debug + Send + Sync + Serialize + 'static {
    /// Properties of materials that the law needs.
    const CONSTANTS: &'static [Constant];
    /// Checks the keys.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn check(&self) -> Result<(), SetupError> {
        Ok(())
    }

    /// The conductivity of a material with these properties, in the order of their declaration.
    fn conductivity(&self, properties: &[Directional<Property>]) -> Directional<Property>;
}

/// A law of conductivity, whose type is not known.
pub trait AnyConductivity: Debug + Send + Sync + erased_serde::Serialize {
    /// See [`ConductivityLaw::CONSTANTS`].
    fn constants(&self) -> &'static [Constant];

    /// See [`ConductivityLaw::check`].
    ///
    /// # Errors
    /// Errors of the law.
    fn check(&self) -> Result<(), SetupError>;

    /// See [`ConductivityLaw::conductivity`].
    fn conductivity(&self, properties: &[Directional<Property>]) -> Directional<Property>;

    /// A copy.
    fn copy(&self) -> Box<dyn AnyConductivity>;
}

erased_serde::serialize_trait_object!(AnyConductivity);

impl Clone for Box<dyn AnyConductivity> {
    fn clone(&self) -> Self {
        (**self).copy()
    }
}

impl<L: ConductivityLaw> AnyConductivity for L {
    fn constants(&self) -> &'static [Constant] {
        L::CONSTANTS
    }

    fn check(&self) -> Result<(), SetupError> {
        ConductivityLaw::check(self)
    }

    fn conductivity(&self, properties: &[Directional<Property>]) -> Directional<Property> {
        ConductivityLaw::conductivity(self, properties)
    }

    fn copy(&self) -> Box<dyn AnyConductivity> {
        Box::new(self.clone())
    }
}

perimelt_core::law_kind! {
    /// A registered law of conductivity.
    pub ConductivityRegistration, dyn AnyConductivity, "conductivity"
}

/// What `perimelt explain` says about a law besides its keys.
pub const fn facts<L: ConductivityLaw>() -> LawFacts {
    LawFacts {
        constants: L::CONSTANTS,
        state: &[],
        others: &[],
    }
}

/// Makes a [`ConductivityLaw`] known as `conductivity.<name>`: `register_conductivity_law!("fourier", Fourier)`. The law
/// implements `Serialize`, `Deserialize` (with `deny_unknown_fields`) and `JsonSchema`.
#[macro_export]
macro_rules! register_conductivity_law {
    ($name:literal, $law:ty) => {
        $crate::perimelt_core::inventory::submit! {
            $crate::thermal::conductivity::ConductivityRegistration(
                $crate::perimelt_core::law_registration!($name, $law, ::core::convert::identity, $crate::thermal::conductivity::facts::<$law>()),
            )
        }
    };
}
