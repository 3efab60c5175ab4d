//! Newtonian fluids: the viscosity is the property `viscosity`, of temperature and phase.

use perimelt_core::law::Constant;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ViscosityLaw;

/// The property `viscosity` of the material.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Newtonian {}

impl ViscosityLaw for Newtonian {
    const CONSTANTS: &'static [Constant] = &[Constant::required("viscosity")];
    const NEEDS_SHEAR_RATE: bool = false;

    #[inline(always)]
    fn viscosity(&self, constants: &[f64], _: f64) -> f64 {
        constants[0]
    }

    fn largest(&self, constants: &[f64]) -> f64 {
        constants[0]
    }
}

crate::register_viscosity_law!("newtonian", Newtonian);
