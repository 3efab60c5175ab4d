//! A fluid that keeps its volume: the pressure follows from the divergence of the flow, which it removes.

use perimelt_core::SetupError;
use perimelt_core::numbers::{check_positive, check_within};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{DensityChange, StateLaw};

/// No change of volume: the pressure is the one with which nothing accumulates anywhere, found in each step by conjugate
/// gradients from that of the step before. No sound limits the step. Eulerian description, conservative form, closed boxes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Incompressible {
    /// Root mean square of the divergence at which the pressure is good enough, over largest speed by spacing; 1e-6 where
    /// the flow carries heat that has to balance.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default = "usual_tolerance")]
    pub tolerance: f64,
}

fn usual_tolerance() -> f64 {
    1e-4
}

impl StateLaw for Incompressible {
    fn check(&self) -> Result<(), SetupError> {
        check_positive("tolerance", self.tolerance, "")?;
        check_within("tolerance", self.tolerance, 0.0, 1.0).map(|_| ())
    }

    fn pressure(&self, change: DensityChange) -> f64 {
        change.pressure
    }

    fn density(&self, _: f64, reference: f64) -> f64 {
        reference
    }

    fn sound_speed(&self, _: f64) -> f64 {
        f64::INFINITY
    }

    fn incompressible(&self) -> Option<f64> {
        Some(self.tolerance)
    }
}

crate::register_state_law!("incompressible", Incompressible);
