//! Generalised Newtonian fluids: `mu = min(K g^(n-1), mu_max)` of Ostwald (1925) and de Waele (1923), and
//! `mu = min(t_y / g + K g^(n-1), mu_max)` of Herschel and Bulkley (1926); g is the shear rate.
//!
//! The bound `mu_max` regularises fluids at rest, of which the laws ask for an infinite viscosity: below the yield stress the
//! fluid creeps at the shear rate `t / mu_max` (docs/theory/fluids.md, "Laws of viscosity").

use perimelt_core::SetupError;
use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use perimelt_core::numbers::check_positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ViscosityLaw;

perimelt_core::register_property! { "consistency", "Pa s^n", "K of the viscous stress K g^n, g the shear rate", ValueRange::Positive }
perimelt_core::register_property! { "flow_index", "1", "n of the viscous stress K g^n, g the shear rate: below 1 where shear thins, above where it thickens", ValueRange::Positive }
perimelt_core::register_property! { "shear_yield_stress", "Pa", "shear stress below which a fluid does not flow", ValueRange::Positive }

/// A power of the shear rate.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerLaw {
    /// Viscosity that is not exceeded, Pa s. The stable step is in inverse proportion to it where it is large.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub largest: f64,
}

impl ViscosityLaw for PowerLaw {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("consistency"),
        Constant::required("flow_index"),
    ];
    const NEEDS_SHEAR_RATE: bool = true;

    fn check(&self) -> Result<(), SetupError> {
        check_positive("largest", self.largest, "Pa s").map(drop)
    }

    #[inline(always)]
    fn viscosity(&self, constants: &[f64], shear_rate: f64) -> f64 {
        power(constants, shear_rate).min(self.largest)
    }

    fn largest(&self, _: &[f64]) -> f64 {
        self.largest
    }
}

crate::register_viscosity_law!("power_law", PowerLaw);

/// A yield stress, and above it a power of the shear rate.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HerschelBulkley {
    /// Viscosity that is not exceeded, Pa s: that of the fluid below its yield stress. The stable step is in inverse proportion to it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub largest: f64,
}

impl ViscosityLaw for HerschelBulkley {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("consistency"),
        Constant::required("flow_index"),
        Constant::required("shear_yield_stress"),
    ];
    const NEEDS_SHEAR_RATE: bool = true;

    fn check(&self) -> Result<(), SetupError> {
        check_positive("largest", self.largest, "Pa s").map(drop)
    }

    #[inline(always)]
    fn viscosity(&self, constants: &[f64], shear_rate: f64) -> f64 {
        (constants[2] / shear_rate + power(constants, shear_rate)).min(self.largest)
    }

    fn largest(&self, _: &[f64]) -> f64 {
        self.largest
    }
}

crate::register_viscosity_law!("herschel_bulkley", HerschelBulkley);

/// `K g^(n-1)`, Pa s.
#[inline(always)]
fn power(constants: &[f64], shear_rate: f64) -> f64 {
    constants[0] * shear_rate.powf(constants[1] - 1.0)
}
