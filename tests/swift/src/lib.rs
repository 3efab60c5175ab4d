//! Plastic flow with the power hardening of Swift (1952), J. Mech. Phys. Solids 1, 1-18: a law of a crate of its own.
//! `flow stress = K (e0 + p)^n`, p the equivalent plastic strain. Linking this crate makes the law known; see `main.rs`.
use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use perimelt_core::register_property;
use perimelt_physics::mechanical::plasticity::{EquivalentStrain, FlowPoint, FlowStressLaw};
use perimelt_physics::register_flow_stress_law;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

register_property! { "swift_strength", "Pa", "K of the flow stress K (e0 + p)^n of Swift", ValueRange::Positive }
register_property! { "swift_offset", "1", "e0 of the flow stress K (e0 + p)^n of Swift", ValueRange::Positive }
register_property! { "swift_exponent", "1", "n of the flow stress K (e0 + p)^n of Swift", ValueRange::Between(0.0, 1.0) }

/// Power hardening of Swift.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Swift {}

impl FlowStressLaw for Swift {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("swift_strength"),
        Constant::required("swift_offset"),
        Constant::required("swift_exponent"),
    ];

    #[inline(always)]
    fn flow_stress(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let [strength, offset, exponent] = [0, 1, 2].map(|i| point.constants[i]);
        strength * (offset + strain.end).powf(exponent)
    }

    fn hardening(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let [offset, exponent] = [1, 2].map(|i| point.constants[i]);
        exponent * self.flow_stress(point, strain) / (offset + strain.end)
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        point.constants[0]
    }
}

register_flow_stress_law!("swift", Swift);
