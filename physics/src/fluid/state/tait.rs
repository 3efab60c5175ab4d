//! The equation of Tait: `p = B ((rho/rho0)^gamma - 1) + p0`, `B = rho0 c^2 / gamma` (Gao (2020), eqs. 5.34, 5.35).

use perimelt_core::SetupError;
use perimelt_core::numbers::check_positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{DensityChange, StateLaw};

/// From the density: `p = B ((rho/rho0)^gamma - 1) + p0`, `B = rho0 c^2 / gamma` (Gao (2020), eqs. 5.34, 5.35).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tait {
    /// Speed of sound c, m/s: ten times the largest speed, and more where walls or weight make pressure.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sound_speed: f64,
    /// Exponent gamma: 7 for liquids, 1 for gases.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default = "seven")]
    pub exponent: f64,
    /// Pressure at the reference density, Pa.
    #[serde(default)]
    pub background: f64,
}

fn seven() -> f64 {
    7.0
}

impl StateLaw for Tait {
    fn check(&self) -> Result<(), SetupError> {
        check_positive("exponent", self.exponent, "")?;
        check_positive("sound_speed", self.sound_speed, "m/s").map(|_| ())
    }

    fn pressure(&self, change: DensityChange) -> f64 {
        let DensityChange {
            after, reference, ..
        } = change;
        let stiffness = reference * self.sound_speed.powi(2) / self.exponent;
        stiffness * (power(after / reference, self.exponent) - 1.0) + self.background
    }

    fn density(&self, pressure: f64, reference: f64) -> f64 {
        let stiffness = reference * self.sound_speed.powi(2) / self.exponent;
        reference * ((pressure - self.background) / stiffness + 1.0).powf(1.0 / self.exponent)
    }

    fn sound_speed(&self, _: f64) -> f64 {
        self.sound_speed
    }
}

/// The usual exponents are whole numbers, for which multiplication is faster than `powf`.
fn power(base: f64, exponent: f64) -> f64 {
    match exponent {
        1.0 => base,
        7.0 => base.powi(7),
        _ => base.powf(exponent),
    }
}

crate::register_state_law!("tait", Tait);
