//! The pressure from the rate of compression: `Dp/Dt = -K div v` (Gao (2020), eqs. 5.40, 5.82).

use perimelt_core::SetupError;
use perimelt_core::numbers::check_positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{DensityChange, StateLaw};

/// From the rate of compression, `Dp/Dt = -K div v` (Gao (2020), eqs. 5.40, 5.82).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// Bulk modulus K, Pa.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bulk_modulus: f64,
}

impl StateLaw for Rate {
    fn check(&self) -> Result<(), SetupError> {
        check_positive("bulk_modulus", self.bulk_modulus, "Pa").map(|_| ())
    }

    fn pressure(&self, change: DensityChange) -> f64 {
        change.pressure + self.bulk_modulus * (change.after / change.before - 1.0)
    }

    fn density(&self, pressure: f64, reference: f64) -> f64 {
        reference * (1.0 + pressure / self.bulk_modulus)
    }

    fn sound_speed(&self, reference: f64) -> f64 {
        (self.bulk_modulus / reference).sqrt()
    }
}

crate::register_state_law!("rate", Rate);
