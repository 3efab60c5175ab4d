//! Equal conductivity in all directions.

use perimelt_core::law::Constant;
use perimelt_core::material::Property;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Conductivity, ConductivityLaw};

/// The property `conductivity` of the material, in all directions.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Isotropic {}

impl ConductivityLaw for Isotropic {
    const CONSTANTS: &'static [Constant] = &[Constant::required("conductivity")];

    fn conductivity(&self, properties: &[Property]) -> Conductivity {
        Conductivity::Isotropic(properties[0].clone())
    }
}

crate::register_conductivity_law!("isotropic", Isotropic);
