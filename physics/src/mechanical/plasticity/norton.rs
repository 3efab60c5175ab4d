//! Creep by Norton (1929) with strain hardening (Bailey 1935): `p' = A q^n / p^m`.
//!
//! Inverted, and with the rate over the step, it is a flow stress: `q = (dp (p + dp)^m / (A dt))^(1/n)`. The step is
//! implicit: stresses relax without limit on the step, with an error in proportion to it.

use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{EquivalentStrain, FlowPoint, FlowStressLaw};

/// Creep by a power of the stress, with strain hardening.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Norton {}

perimelt_core::register_property! { "creep_coefficient", "1/(s Pa^n)", "A of the rate A q^n / p^m of creep, q the equivalent stress, p the equivalent strain of creep", ValueRange::Positive }
perimelt_core::register_property! { "creep_exponent", "1", "n of the rate A q^n / p^m of creep", ValueRange::Positive }
perimelt_core::register_property! { "creep_hardening_exponent", "1", "m of the rate A q^n / p^m of creep; 0 without strain hardening", ValueRange::NotNegative }

impl FlowStressLaw for Norton {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("creep_coefficient"),
        Constant::required("creep_exponent"),
        Constant::or("creep_hardening_exponent", 0.0),
    ];

    #[inline(always)]
    fn flow_stress(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let [coefficient, exponent, hardening] = [0, 1, 2].map(|i| point.constants[i]);
        let rate = strain.increment / point.step;
        (rate * strain.end.powf(hardening) / coefficient).powf(1.0 / exponent)
    }

    fn hardening(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let [_, exponent, hardening] = [0, 1, 2].map(|i| point.constants[i]);
        let relative = 1.0 / strain.increment + hardening / strain.end;
        self.flow_stress(point, strain) * relative / exponent
    }

    /// The stress that creeps by 1e-3 in the step.
    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        let strain = EquivalentStrain {
            end: 1e-3,
            increment: 1e-3,
        };
        self.flow_stress(point, strain)
    }
}

crate::register_flow_stress_law!("norton", Norton);
