//! Flow in the stress state of a body, by a law along the deviator or by a law in three dimensions.

use nalgebra::Matrix6;
use perimelt_core::SetupError;
use perimelt_core::law::{Constant, LawFacts, StateVariable};
use serde::Serialize;

use super::law::{EquivalentStrain, Flow, FlowLaw, FlowPoint, FlowStressLaw};
use super::return_mapping::{
    Flowed, StressState, flow_along_deviator, radial_tangent, return_to_yield,
};
use super::zero_stress::flow_without_stress_across;
use crate::mechanical::moduli::Moduli;

/// A point in the stress state of its body.
#[derive(Clone, Copy, Debug)]
pub struct RulePoint<'a> {
    /// The point as laws see it.
    pub point: FlowPoint<'a>,
    /// Moduli in the dimensions of the body.
    pub moduli: &'a Moduli,
    /// The components that the stress of the body has.
    pub stress_state: StressState,
    /// Flow along the deviator by transformation plasticity, before that of the law: 3/2 of the growth of the compliance,
    /// 1/Pa.
    pub transformation: f64,
}

/// What a sweep over the points of a body needs of a law.
pub trait FlowRule: std::fmt::Debug + Send + Sync + Serialize {
    /// See [`FlowLaw::CONSTANTS`].
    const CONSTANTS: &'static [Constant];
    /// See [`FlowLaw::STATE`].
    const STATE: &'static [StateVariable];
    /// See [`FlowLaw::IS_SYMMETRIC`].
    const IS_SYMMETRIC: bool;

    /// See [`FlowLaw::prepare`].
    ///
    /// # Errors
    /// Errors of the law.
    fn prepare(&mut self) -> Result<(), SetupError>;

    /// Flow from a trial stress (Pa) without transformation plasticity; sets the state variables.
    fn flow(&self, at: &RulePoint<'_>, trial: &[f64; 6], state: &mut [f64]) -> Option<Flow>;

    /// Derivative of the inelastic strain by the strain, with transformation plasticity; `None` without a closed form.
    fn tangent(
        &self,
        at: &RulePoint<'_>,
        trial: &[f64; 6],
        strain: EquivalentStrain,
        state: &[f64],
    ) -> Option<Matrix6<f64>>;

    /// See [`FlowLaw::scale`].
    fn scale(&self, point: &FlowPoint<'_>) -> f64;
}

/// Flow by transformation plasticity, then by the law; the state variables at the end in `state`.
#[inline(always)]
pub(super) fn flow_of<R: FlowRule>(
    rule: &R,
    at: &RulePoint<'_>,
    trial: &[f64; 6],
    state: &mut [f64],
) -> Option<Flow> {
    let g = at.transformation;
    if g == 0.0 {
        return rule.flow(at, trial, state);
    }
    let (stress, mut strain) = flow_along_deviator(at.stress_state, trial, at.moduli, g);
    let rest = rule.flow(at, &stress, state).unwrap_or_default();
    (0..6).for_each(|c| strain[c] += rest.strain[c]);
    Some(Flow { strain, ..rest })
}

const FORMULATIONS: (&str, &str) = ("formulations", "ordinary, correspondence, staggered");

/// A law of flow along the deviator.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct Radial<L>(L);

impl<L: FlowStressLaw> Radial<L> {
    /// What `perimelt explain` says besides the keys.
    pub const FACTS: LawFacts = LawFacts {
        constants: L::CONSTANTS,
        state: &[],
        others: &[
            (
                "tangent",
                "closed form; central differences in plane stress",
            ),
            FORMULATIONS,
        ],
    };
}

impl<L> From<L> for Radial<L> {
    fn from(law: L) -> Self {
        Radial(law)
    }
}

impl<L: FlowStressLaw> FlowRule for Radial<L> {
    const CONSTANTS: &'static [Constant] = L::CONSTANTS;
    const STATE: &'static [StateVariable] = &[];
    const IS_SYMMETRIC: bool = true;

    fn prepare(&mut self) -> Result<(), SetupError> {
        self.0.prepare()
    }

    #[inline(always)]
    fn flow(&self, at: &RulePoint<'_>, trial: &[f64; 6], _: &mut [f64]) -> Option<Flow> {
        let point = &at.point;
        let flow_stress = |strain: EquivalentStrain| self.0.flow_stress(point, strain);
        let start = point.equivalent;
        let (strain, equivalent) =
            return_to_yield(at.stress_state, trial, at.moduli, flow_stress, start)?;
        let end = start + equivalent;
        let increment = end - start;
        Some(Flow {
            strain,
            equivalent,
            work: flow_stress(EquivalentStrain { end, increment }) * increment,
        })
    }

    fn tangent(
        &self,
        at: &RulePoint<'_>,
        trial: &[f64; 6],
        strain: EquivalentStrain,
        _: &[f64],
    ) -> Option<Matrix6<f64>> {
        let flowed = Flowed {
            transformation: at.transformation,
            increment: strain.increment,
            hardening: self.0.hardening(&at.point, strain),
        };
        radial_tangent(at.stress_state, trial, at.moduli, flowed)
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        self.0.scale(point)
    }
}

/// A law in three dimensions.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct Spatial<L>(L);

impl<L: FlowLaw> Spatial<L> {
    /// What `perimelt explain` says besides the keys.
    pub const FACTS: LawFacts = LawFacts {
        constants: L::CONSTANTS,
        state: L::STATE,
        others: &[
            (
                "tangent",
                if L::HAS_TANGENT {
                    "closed form; central differences in bars, plane stress and with transformation plasticity"
                } else {
                    "central differences"
                },
            ),
            FORMULATIONS,
        ],
    };
}

impl<L> From<L> for Spatial<L> {
    fn from(law: L) -> Self {
        Spatial(law)
    }
}

impl<L: FlowLaw> FlowRule for Spatial<L> {
    const CONSTANTS: &'static [Constant] = L::CONSTANTS;
    const STATE: &'static [StateVariable] = L::STATE;
    const IS_SYMMETRIC: bool = L::IS_SYMMETRIC;

    fn prepare(&mut self) -> Result<(), SetupError> {
        self.0.prepare()
    }

    #[inline(always)]
    fn flow(&self, at: &RulePoint<'_>, trial: &[f64; 6], state: &mut [f64]) -> Option<Flow> {
        // a loose point has no stiffness
        if at.moduli.shear <= 0.0 {
            return None;
        }
        match at.stress_state {
            StressState::Full => self.0.flow(&at.point, trial, state),
            _ => flow_without_stress_across(&self.0, at, trial, state),
        }
    }

    fn tangent(
        &self,
        at: &RulePoint<'_>,
        trial: &[f64; 6],
        strain: EquivalentStrain,
        state: &[f64],
    ) -> Option<Matrix6<f64>> {
        let is_closed = at.stress_state == StressState::Full && at.transformation == 0.0;
        match L::HAS_TANGENT && is_closed {
            true => self.0.tangent(&at.point, trial, strain, state),
            false => None,
        }
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        self.0.scale(point)
    }
}
