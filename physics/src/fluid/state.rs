//! Equation of state: the pressure of a weakly compressible fluid.

use perimelt_core::SetupError;
use perimelt_core::numbers::check_positive;
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
        #[schemars(extend("exclusiveMinimum" = 0))]
        bulk_modulus: f64,
    },
}

/// `p = B ((rho/rho0)^gamma - 1) + p0`, `B = rho0 c^2 / gamma` (Gao (2020), eqs. 5.34, 5.35).
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

impl State {
    pub(super) fn check(&self) -> Result<(), SetupError> {
        match self {
            State::Tait(tait) => {
                check_positive("state.tait.exponent", tait.exponent, "")?;
                check_positive("state.tait.sound_speed", tait.sound_speed, "m/s")?;
            }
            State::Rate { bulk_modulus } => {
                check_positive("state.rate.bulk_modulus", *bulk_modulus, "Pa")?;
            }
        }
        Ok(())
    }

    /// Pressure (Pa) after the density went from `before` to `after` (kg/m³).
    pub(super) fn pressure(&self, before: f64, after: f64, pressure: f64, reference: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn tait(exponent: f64) -> State {
        State::Tait(Tait {
            sound_speed: 20.0,
            exponent,
            background: 30.0,
        })
    }

    /// `p = rho0 c²/gamma ((rho/rho0)^gamma - 1) + p0` of 5 kg/m³ and 20 m/s, whatever the pressure before; and
    /// `p + K (rho/rho_before - 1)`. The density belongs to the pressure of a medium that was at rest.
    #[test]
    fn pressure_and_density_belong_to_each_other() {
        for (exponent, density, pressure) in [
            (1.0, 5.5, 2000.0 * 0.1 + 30.0),
            (2.0, 4.0, 1000.0 * (0.64 - 1.0) + 30.0),
            (7.0, 5.5, 2000.0 / 7.0 * (1.1_f64.powi(7) - 1.0) + 30.0),
            (7.0, 5.0, 30.0),
        ] {
            let state = tait(exponent);
            let found = state.pressure(77.0, density, -9.0, 5.0);
            assert!((found - pressure).abs() < 1e-10, "{exponent}: {found}");
            let found = state.density(pressure, 5.0);
            assert!((found - density).abs() < 1e-12, "{exponent}: {found}");
            assert_eq!(state.sound_speed(density), 20.0);
        }
        let rate = State::Rate {
            bulk_modulus: 2000.0,
        };
        assert!((rate.pressure(4.0, 5.0, 7.0, 77.0) - 507.0).abs() < 1e-10);
        assert!((rate.density(500.0, 4.0) - 5.0).abs() < 1e-12);
        assert_eq!(rate.sound_speed(5.0), 20.0);
    }

    #[test]
    fn numbers_of_a_state_are_positive() {
        let rate = |bulk_modulus| State::Rate { bulk_modulus };
        let sound = |sound_speed| {
            State::Tait(Tait {
                sound_speed,
                exponent: 7.0,
                background: -5.0,
            })
        };
        for (state, at_fault) in [
            (tait(7.0), None),
            (sound(1e-9), None),
            (rate(1.0), None),
            (tait(0.0), Some("state.tait.exponent")),
            (tait(f64::NAN), Some("state.tait.exponent")),
            (sound(0.0), Some("state.tait.sound_speed")),
            (sound(f64::INFINITY), Some("state.tait.sound_speed")),
            (rate(0.0), Some("state.rate.bulk_modulus")),
            (rate(-1.0), Some("state.rate.bulk_modulus")),
        ] {
            let found = state.check().err().map(|e| e.key);
            assert_eq!(found.as_deref(), at_fault, "{state:?}");
        }
    }
}
