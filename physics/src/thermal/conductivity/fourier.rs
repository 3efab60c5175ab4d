//! The conductivity of the material.

use perimelt_core::law::Constant;
use perimelt_core::material::{Directional, Property};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ConductivityLaw;

/// The property `conductivity` of the material, in all directions or along its axes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fourier {}

impl ConductivityLaw for Fourier {
    const CONSTANTS: &'static [Constant] = &[Constant::directional("conductivity")];

    fn conductivity(&self, properties: &[Directional<Property>]) -> Directional<Property> {
        properties[0].clone()
    }
}

crate::register_conductivity_law!("fourier", Fourier);
