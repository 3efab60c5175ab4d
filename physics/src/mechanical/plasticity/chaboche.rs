//! J2 plasticity with kinematic and isotropic hardening by Chaboche (1986), Int. J. Plasticity 2, 149-188:
//!
//! ```text
//! q(s - x) <= yield_stress(T) + hardening_modulus p + Q (1 - exp(-b p)),   x = x1 + x2
//! dx_k = 2/3 C_k d(plastic strain) - gamma_k x_k dp
//! ```
//!
//! Without recovery (gamma = 0) back stresses harden linearly (Prager). The implicit step is one equation for dp (Kobayashi &
//! Ohno (2002), Int. J. Numer. Meth. Engng 53, 2217-2238), since the direction of flow is that of
//! `trial deviator - sum of x_k / (1 + gamma_k dp)`.

use nalgebra::Matrix6;
use perimelt_core::law::{Constant, StateVariable};
use perimelt_core::material::ValueRange;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{EquivalentStrain, Flow, FlowLaw, FlowPoint};
use super::return_mapping::root;
use super::tensor::{contract, deviator, deviatoric, dyad};

/// J2 plasticity with two back stresses, with or without recovery, and isotropic hardening.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Chaboche {}

perimelt_core::register_property! { "isotropic_saturation", "Pa", "Q of the isotropic hardening Q (1 - exp(-b p))", ValueRange::Any }
perimelt_core::register_property! { "isotropic_rate", "1", "b of the isotropic hardening Q (1 - exp(-b p))", ValueRange::NotNegative }
perimelt_core::register_property! { "kinematic_modulus", "Pa", "C of the first back stress: its initial growth in tension by plastic strain", ValueRange::NotNegative }
perimelt_core::register_property! { "kinematic_recovery", "1", "gamma of the first back stress, which saturates at C/gamma; 0 for linear hardening", ValueRange::NotNegative }
perimelt_core::register_property! { "kinematic_modulus_2", "Pa", "C of the second back stress", ValueRange::NotNegative }
perimelt_core::register_property! { "kinematic_recovery_2", "1", "gamma of the second back stress", ValueRange::NotNegative }

/// The equation of an implicit step.
struct Implicit<'a> {
    point: &'a FlowPoint<'a>,
    deviator: [f64; 6],
    moduli: [f64; 2],
    recoveries: [f64; 2],
}

impl<'a> Implicit<'a> {
    #[inline(always)]
    fn new(point: &'a FlowPoint<'a>, trial: &[f64; 6]) -> Self {
        let constant = |i: usize| point.constants[i];
        Implicit {
            point,
            deviator: deviator(trial),
            moduli: [constant(4), constant(6)],
            recoveries: [constant(5), constant(7)],
        }
    }

    /// A back stress at the start of the step.
    #[inline(always)]
    fn back_stress(&self, number: usize) -> &'a [f64] {
        &self.point.state[6 * number..][..6]
    }

    /// `1/(1 + gamma dp)` of both back stresses.
    #[inline(always)]
    fn left(&self, increment: f64) -> [f64; 2] {
        self.recoveries.map(|gamma| 1.0 / (1.0 + gamma * increment))
    }

    /// The trial deviator without what is left of the back stresses.
    #[inline(always)]
    fn relative(&self, increment: f64) -> [f64; 6] {
        let left = self.left(increment);
        let (first, second) = (self.back_stress(0), self.back_stress(1));
        let mut relative = self.deviator;
        for c in 0..6 {
            relative[c] -= left[0] * first[c] + left[1] * second[c];
        }
        relative
    }

    /// The yield stress after isotropic hardening, Pa, and its derivative by the equivalent plastic strain.
    #[inline(always)]
    fn flow_stress(&self, increment: f64) -> [f64; 2] {
        let [yield_stress, modulus, saturation, rate] =
            [0, 1, 2, 3].map(|i| self.point.constants[i]);
        let end = self.point.equivalent + increment;
        let decay = (-rate * end).exp();
        [
            yield_stress + modulus * end + saturation * (1.0 - decay),
            modulus + saturation * rate * decay,
        ]
    }

    /// Excess of the equivalent stress over the flow stress after an increment, Pa.
    #[inline(always)]
    fn excess(&self, increment: f64) -> f64 {
        let left = self.left(increment);
        let kinematic = left[0] * self.moduli[0] + left[1] * self.moduli[1];
        let stiffness = 3.0 * self.point.shear_modulus + kinematic;
        let [flow_stress, _] = self.flow_stress(increment);
        equivalent(&self.relative(increment)) - stiffness * increment - flow_stress
    }

    /// The direction of flow, `3/2 (s - x)/q`.
    #[inline(always)]
    fn direction(&self, increment: f64) -> [f64; 6] {
        let mut direction = self.relative(increment);
        let factor = 1.5 / equivalent(&direction);
        direction.iter_mut().for_each(|c| *c *= factor);
        direction
    }
}

/// `sqrt(3/2 s : s)`.
#[inline(always)]
fn equivalent(s: &[f64; 6]) -> f64 {
    (1.5 * contract(s, s)).sqrt()
}

impl FlowLaw for Chaboche {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("yield_stress"),
        Constant::or("hardening_modulus", 0.0),
        Constant::or("isotropic_saturation", 0.0),
        Constant::or("isotropic_rate", 0.0),
        Constant::required("kinematic_modulus"),
        Constant::or("kinematic_recovery", 0.0),
        Constant::or("kinematic_modulus_2", 0.0),
        Constant::or("kinematic_recovery_2", 0.0),
    ];
    const STATE: &'static [StateVariable] = &[
        StateVariable::tensor("back_stress", "Pa", "first back stress"),
        StateVariable::tensor("back_stress_2", "Pa", "second back stress"),
    ];
    const HAS_TANGENT: bool = true;

    #[inline(always)]
    fn flow(&self, point: &FlowPoint<'_>, trial: &[f64; 6], state: &mut [f64]) -> Option<Flow> {
        let step = Implicit::new(point, trial);
        // beyond it the equivalent stress would be below zero: back stresses that recover shrink
        let both: f64 = (0..2).map(|k| norm(step.back_stress(k))).sum();
        let most = (equivalent(&step.deviator) + both) / (3.0 * point.shear_modulus);
        let increment = root(|increment| step.excess(increment), most)?;
        let direction = step.direction(increment);
        let left = step.left(increment);
        for k in 0..2 {
            let before = step.back_stress(k);
            let after = &mut state[6 * k..][..6];
            let growth = 2.0 / 3.0 * step.moduli[k] * increment;
            for c in 0..6 {
                after[c] = left[k] * (before[c] + growth * direction[c]);
            }
        }
        let strain = direction.map(|n| increment * n);
        let relieved = 2.0 * point.shear_modulus * contract(&strain, &strain);
        Some(Flow {
            strain,
            equivalent: increment,
            work: contract(&step.deviator, &strain) - relieved,
        })
    }

    fn tangent(
        &self,
        point: &FlowPoint<'_>,
        trial: &[f64; 6],
        strain: EquivalentStrain,
        _: &[f64],
    ) -> Option<Matrix6<f64>> {
        let (step, increment) = (Implicit::new(point, trial), strain.increment);
        let direction = step.direction(increment);
        let q = equivalent(&step.relative(increment));
        let left = step.left(increment);
        // derivatives by the increment: of what is left of the back stresses, and of the excess
        let faded = [0, 1].map(|k| step.recoveries[k] * left[k] * left[k]);
        let (first, second) = (step.back_stress(0), step.back_stress(1));
        let fading = std::array::from_fn(|c| faded[0] * first[c] + faded[1] * second[c]);
        let sum = |weights: [f64; 2]| weights[0] * step.moduli[0] + weights[1] * step.moduli[1];
        let [_, hardening] = step.flow_stress(increment);
        let slope = 3.0 * point.shear_modulus + sum(left) - increment * sum(faded) + hardening
            - contract(&direction, &fading);
        let shear = 2.0 * point.shear_modulus;
        // d(increment) = rise : d(strain)
        let rise = direction.map(|n| shear * n / slope);
        let relative = deviatoric() * shear + dyad(&fading, &rise);
        let turn = Matrix6::identity() - dyad(&direction, &direction) * (2.0 / 3.0);
        Some(dyad(&direction, &rise) + turn * relative * (1.5 * increment / q))
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        point.constants[0]
    }
}

/// `sqrt(3/2 x : x)` of a back stress.
#[inline(always)]
fn norm(back_stress: &[f64]) -> f64 {
    let square = |c: usize| back_stress[c] * back_stress[c];
    let normal: f64 = (0..3).map(square).sum();
    let shear: f64 = (3..6).map(square).sum();
    (1.5 * (normal + 2.0 * shear)).sqrt()
}

crate::register_flow_law!("chaboche", Chaboche);
