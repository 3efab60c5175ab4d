//! Flow stress by Johnson & Cook (1983), Proc. 7th Int. Symp. on Ballistics, 541-547:
//! `(A + B p^n) (1 + C ln(p'/p0')) (1 - T*^m)`, `T* = (T - T0)/(T_melting - T0)`.
//!
//! Below the reference rate `p0'` the flow stress does not depend on the rate; T* lies between 0 and 1.

use perimelt_core::SetupError;
use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{EquivalentStrain, FlowPoint, FlowStressLaw};

/// Flow stress of Johnson and Cook: power hardening, logarithm of the rate, softening up to the solidus.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JohnsonCook {
    /// Rate of the equivalent plastic strain (1/s) up to which the flow stress does not depend on it.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_rate: f64,
    /// Temperature (K) up to which the flow stress does not depend on it.
    #[serde(default = "room")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_temperature: f64,
}

fn one() -> f64 {
    1.0
}

fn room() -> f64 {
    293.0
}

perimelt_core::register_property! { "johnson_cook_yield_stress", "Pa", "A of the flow stress of Johnson and Cook: yield stress at the reference rate and temperature", ValueRange::Positive }
perimelt_core::register_property! { "johnson_cook_hardening", "Pa", "B of the flow stress of Johnson and Cook: factor of the power of the equivalent plastic strain", ValueRange::NotNegative }
perimelt_core::register_property! { "johnson_cook_exponent", "1", "n of the flow stress of Johnson and Cook: power of the equivalent plastic strain", ValueRange::Positive }
perimelt_core::register_property! { "johnson_cook_rate", "1", "C of the flow stress of Johnson and Cook: factor of the logarithm of the rate", ValueRange::NotNegative }
perimelt_core::register_property! { "johnson_cook_softening", "1", "m of the flow stress of Johnson and Cook: power of the temperature between reference and solidus", ValueRange::Positive }

/// Factors of the flow stress and their derivatives.
struct Factors {
    strength: f64,
    hardening: f64,
    rate: f64,
    /// Derivative of `rate` by the increment of the equivalent plastic strain.
    rate_slope: f64,
    softening: f64,
}

impl JohnsonCook {
    #[inline(always)]
    fn factors(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> Factors {
        let &[a, b, n, c, m, melting] = point.constants else {
            return Factors::NONE;
        };
        let over = strain.increment / (point.step * self.reference_rate);
        let (rate, rate_slope) = match over > 1.0 {
            true => (1.0 + c * over.ln(), c / strain.increment),
            false => (1.0, 0.0),
        };
        let reference = self.reference_temperature;
        let temperature = point.temperature.unwrap_or(reference);
        let homologous = ((temperature - reference) / (melting - reference)).clamp(0.0, 1.0);
        Factors {
            strength: a + b * strain.end.powf(n),
            hardening: if b > 0.0 {
                b * n * strain.end.powf(n - 1.0)
            } else {
                0.0
            },
            rate,
            rate_slope,
            softening: 1.0 - homologous.powf(m),
        }
    }
}

impl Factors {
    /// Factors of a point without constants.
    const NONE: Factors = Factors {
        strength: f64::NAN,
        hardening: f64::NAN,
        rate: 1.0,
        rate_slope: 0.0,
        softening: 1.0,
    };
}

impl FlowStressLaw for JohnsonCook {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("johnson_cook_yield_stress"),
        Constant::required("johnson_cook_hardening"),
        Constant::required("johnson_cook_exponent"),
        Constant::required("johnson_cook_rate"),
        Constant::required("johnson_cook_softening"),
        Constant::required("solidus"),
    ];

    fn prepare(&mut self) -> Result<(), SetupError> {
        let positive = |key: &str, value: f64| match value > 0.0 {
            true => Ok(()),
            false => {
                let message = format!("`{key}` is {value}");
                Err(SetupError::value(key, message, "a number above 0"))
            }
        };
        positive("reference_rate", self.reference_rate)?;
        positive("reference_temperature", self.reference_temperature)
    }

    #[inline(always)]
    fn flow_stress(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let factors = self.factors(point, strain);
        factors.strength * factors.rate * factors.softening
    }

    fn hardening(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let Factors {
            strength,
            hardening,
            rate,
            rate_slope,
            softening,
        } = self.factors(point, strain);
        (hardening * rate + strength * rate_slope) * softening
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        point.constants[0]
    }
}

crate::register_flow_stress_law!("johnson_cook", JohnsonCook);
