//! Creep by Norton (1929) with strain hardening (Bailey 1935): `p' = A q^n / p^m`.
//!
//! Inverted, and with the rate over the step, it is a flow stress: `q = (dp (p + dp)^m / (A dt))^(1/n)`. The step is
//! implicit: stresses relax without limit on the step, with an error in proportion to it.
//!
//! Metal with a yield stress flows at once where it reaches it. Creep and plastic flow are in series under one stress, so
//! that the flow stress is the smaller of both.

use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{EquivalentStrain, FlowPoint, FlowStressLaw};

/// Creep by a power of the stress, with strain hardening, and plastic flow at the yield stress, if the metal has one.
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
        Constant::or("yield_stress", f64::INFINITY),
        Constant::or("hardening_modulus", 0.0),
    ];

    #[inline(always)]
    fn flow_stress(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        creep_stress(point, strain).min(yield_stress(point, strain))
    }

    fn hardening(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let [_, exponent, hardening, _, slope] = constants(point);
        let creep = creep_stress(point, strain);
        if creep > yield_stress(point, strain) {
            return slope;
        }
        let relative = 1.0 / (strain.increment + NEGLIGIBLE) + hardening / strain.end;
        creep * relative / exponent
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

/// Increment of strain that changes no stress: metal that creeps by less is elastic, and has an elastic tangent.
const NEGLIGIBLE: f64 = 1e-16;

fn constants(point: &FlowPoint<'_>) -> [f64; 5] {
    [0, 1, 2, 3, 4].map(|i| point.constants[i])
}

/// Stress at which creep alone makes the increment of strain, Pa.
#[inline(always)]
fn creep_stress(point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
    let [coefficient, exponent, hardening, ..] = constants(point);
    let rate = (strain.increment + NEGLIGIBLE) / point.step;
    (rate * strain.end.powf(hardening) / coefficient).powf(1.0 / exponent)
}

/// Stress at which the metal yields at the end of the step, Pa.
#[inline(always)]
fn yield_stress(point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
    let [.., start, slope] = constants(point);
    start + slope * strain.end
}

crate::register_flow_stress_law!("norton", Norton);
