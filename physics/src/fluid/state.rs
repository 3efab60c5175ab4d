//! Equation of state: the pressure of a weakly compressible fluid.

use perimelt_core::SetupError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Equation of state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum State {
    /// From the density.
    Tait(Tait),
    /// From the rate of compression, `Dp/Dt = -K div v` (Gao (2020), eqs. 5.40, 5.82).
    Rate {
        /// Bulk modulus K, Pa.
        bulk_modulus: f64,
    },
}

/// `p = B ((rho/rho0)^gamma - 1) + p0`, `B = rho0 c^2 / gamma` (Gao (2020), eqs. 5.34, 5.35).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tait {
    /// Speed of sound c, m/s: ten times the largest speed, and more where walls or weight make pressure.
    pub sound_speed: f64,
    /// Exponent gamma: 7 for liquids, 1 for gases.
    #[serde(default = "seven")]
    pub exponent: f64,
    /// Pressure at the reference density, Pa.
    #[serde(default)]
    pub background: f64,
}

fn seven() -> f64 {
    7.0
}

impl State {
    pub(super) fn check(&self) -> Result<(), SetupError> {
        let (key, value) = match self {
            State::Tait(tait) if tait.exponent.is_nan() || tait.exponent <= 0.0 => {
                ("state.tait.exponent", tait.exponent)
            }
            State::Tait(tait) => ("state.tait.sound_speed", tait.sound_speed),
            State::Rate { bulk_modulus } => ("state.rate.bulk_modulus", *bulk_modulus),
        };
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        let message = format!("`{key}` is {value}");
        Err(SetupError::value(key, message, "a positive number"))
    }

    /// Pressure after the density went from `before` to `after` (kg/m³), Pa.
    pub(super) fn pressure(
        &self,
        (before, after): (f64, f64),
        pressure: f64,
        reference: f64,
    ) -> f64 {
        match self {
            State::Tait(t) => {
                let stiffness = reference * t.sound_speed.powi(2) / t.exponent;
                stiffness * (power(after / reference, t.exponent) - 1.0) + t.background
            }
            State::Rate { bulk_modulus } => pressure + bulk_modulus * (after / before - 1.0),
        }
    }

    /// Density at a pressure, kg/m³.
    pub(super) fn density(&self, pressure: f64, reference: f64) -> f64 {
        match self {
            State::Tait(t) => {
                let stiffness = reference * t.sound_speed.powi(2) / t.exponent;
                reference * ((pressure - t.background) / stiffness + 1.0).powf(1.0 / t.exponent)
            }
            State::Rate { bulk_modulus } => reference * (1.0 + pressure / bulk_modulus),
        }
    }

    /// Speed of sound, m/s.
    pub(super) fn sound_speed(&self, density: f64) -> f64 {
        match self {
            State::Tait(tait) => tait.sound_speed,
            State::Rate { bulk_modulus } => (bulk_modulus / density).sqrt(),
        }
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
