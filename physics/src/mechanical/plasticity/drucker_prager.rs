//! Friction by Drucker & Prager (1952), Quart. Appl. Math. 10, 157-165, with the cone through the corners of
//! Mohr and Coulomb under compression:
//!
//! ```text
//! f = sqrt(J2) + a I1 - k <= 0,   a = 2 sin(phi) / (sqrt(3) (3 - sin(phi))),   k = 6 c cos(phi) / (sqrt(3) (3 - sin(phi)))
//! d(inelastic strain) = dg (s / (2 sqrt(J2)) + b 1),   b as a with the angle of dilation
//! ```
//!
//! The stress returns to the cone, or to its apex (de Souza Neto, Peric & Owen (2008), section 8.3). The equivalent plastic
//! strain grows by `sqrt(2/3 de : de)`. Perfectly plastic.

use nalgebra::Matrix6;
use perimelt_core::law::Constant;
use perimelt_core::material::ValueRange;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{EquivalentStrain, Flow, FlowLaw, FlowPoint};
use super::tensor::{contract, deviator, deviatoric, dyad, mean};

/// Flow with friction and dilation: soil, rock, concrete.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DruckerPrager {}

perimelt_core::register_property! { "cohesion", "Pa", "cohesion of a material with friction", ValueRange::Positive }
perimelt_core::register_property! { "friction_angle", "degrees", "angle of friction", ValueRange::Between(0.0, 89.0) }
perimelt_core::register_property! { "dilation_angle", "degrees", "angle of dilation under flow; 0 without change of volume", ValueRange::Between(0.0, 89.0) }

const UNIT: [f64; 6] = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0];

/// A trial stress and its return.
struct Return {
    /// Trial deviator over `sqrt(J2)`.
    direction: [f64; 6],
    /// `sqrt(J2)` of the trial.
    size: f64,
    /// a, b.
    slopes: [f64; 2],
    /// `G + 9 K a b`.
    stiffness: f64,
    /// Increment along the normal of the cone.
    increment: f64,
    /// Mean stress of the apex, Pa.
    apex: f64,
}

impl Return {
    /// `None` inside the cone.
    #[inline(always)]
    fn of(point: &FlowPoint<'_>, trial: &[f64; 6]) -> Option<Self> {
        let [cohesion, friction, dilation] = [0, 1, 2].map(|i| point.constants[i]);
        let sine = friction.to_radians().sin();
        let slope = |sine: f64| 2.0 * sine / (3.0f64.sqrt() * (3.0 - sine));
        let [a, b] = [slope(sine), slope(dilation.to_radians().sin())];
        let strength =
            6.0 * cohesion * friction.to_radians().cos() / (3.0f64.sqrt() * (3.0 - sine));
        let s = deviator(trial);
        let size = (0.5 * contract(&s, &s)).sqrt();
        let excess = size + 3.0 * a * mean(trial) - strength;
        if excess <= 0.0 {
            return None;
        }
        let stiffness = point.shear_modulus + 9.0 * point.bulk_modulus * a * b;
        Some(Return {
            direction: s.map(|c| c / size.max(f64::MIN_POSITIVE)),
            size,
            slopes: [a, b],
            stiffness,
            increment: excess / stiffness,
            apex: strength / (3.0 * a),
        })
    }

    /// Whether the cone is left beyond its apex.
    fn is_at_apex(&self, point: &FlowPoint<'_>) -> bool {
        self.size < point.shear_modulus * self.increment
    }
}

impl FlowLaw for DruckerPrager {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("cohesion"),
        Constant::required("friction_angle"),
        Constant::or("dilation_angle", 0.0),
    ];
    const HAS_TANGENT: bool = true;

    #[inline(always)]
    fn flow(&self, point: &FlowPoint<'_>, trial: &[f64; 6], _: &mut [f64]) -> Option<Flow> {
        let (shear, bulk) = (point.shear_modulus, point.bulk_modulus);
        let to = Return::of(point, trial)?;
        let mut strain = [0.0; 6];
        if to.is_at_apex(point) {
            let volumetric = (mean(trial) - to.apex) / (3.0 * bulk);
            for c in 0..6 {
                strain[c] = 0.5 * to.size / shear * to.direction[c] + volumetric * UNIT[c];
            }
        } else {
            let [_, b] = to.slopes;
            for c in 0..6 {
                strain[c] = to.increment * (0.5 * to.direction[c] + b * UNIT[c]);
            }
        }
        let volumetric = 3.0 * mean(&strain);
        let relieved = deviator(&strain).map(|e| 2.0 * shear * e);
        let mut stress = *trial;
        for c in 0..6 {
            stress[c] -= relieved[c] + bulk * volumetric * UNIT[c];
        }
        Some(Flow {
            strain,
            equivalent: (2.0 / 3.0 * contract(&strain, &strain)).sqrt(),
            work: contract(&stress, &strain),
        })
    }

    fn tangent(
        &self,
        point: &FlowPoint<'_>,
        trial: &[f64; 6],
        _: EquivalentStrain,
        _: &[f64],
    ) -> Option<Matrix6<f64>> {
        let to = Return::of(point, trial)?;
        if to.is_at_apex(point) {
            return Some(Matrix6::identity());
        }
        let (shear, bulk, [a, b]) = (point.shear_modulus, point.bulk_modulus, to.slopes);
        let along = std::array::from_fn(|c| 0.5 * to.direction[c] + b * UNIT[c]);
        let rise = |c: usize| (shear * to.direction[c] + 3.0 * a * bulk * UNIT[c]) / to.stiffness;
        let rise = std::array::from_fn(rise);
        let turn = deviatoric() - 0.5 * dyad(&to.direction, &to.direction);
        Some(dyad(&along, &rise) + turn * (to.increment * shear / to.size))
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        point.constants[0]
    }
}

crate::register_flow_law!("drucker_prager", DruckerPrager);
