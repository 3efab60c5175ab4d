//! Bonds with the force `c (s + b s^3)` at the stretch s: a law of elasticity of a crate of its own, `law.cubic`.
use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use perimelt_core::{Number, register_property};
use perimelt_physics::mechanical::stretch::{BondConstants, BondLaw};
use perimelt_physics::register_bond_law;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

register_property! { "cubic_stiffness", "1", "b of the force c (s + b s^3) of a bond", ValueRange::NotNegative }

/// Bonds that stiffen with the cube of their stretch.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cubic {
    /// The largest stretch that occurs; the step of explicit motion is stable up to it.
    pub largest_stretch: f64,
}

impl BondLaw for Cubic {
    const CONSTANTS: &'static [Constant] = &[Constant::required("cubic_stiffness")];

    #[inline(always)]
    fn force<N: Number>(&self, [b, ..]: &BondConstants, s: N) -> N {
        s * (s * *b * s + 1.0)
    }

    #[inline(always)]
    fn mean_force(&self, [b, ..]: &BondConstants, s: f64) -> f64 {
        s * (0.5 + 0.25 * b * s * s)
    }

    #[inline(always)]
    fn slope(&self, [b, ..]: &BondConstants, s: f64) -> f64 {
        1.0 + 3.0 * b * s * s
    }

    fn steepest(&self, constants: &BondConstants) -> f64 {
        self.slope(constants, self.largest_stretch)
    }
}

register_bond_law!("cubic", Cubic);
