//! Sweeps of a law of flow over the points of a body, behind one dynamic call.

use nalgebra::{Matrix6, Vector6};
use perimelt_core::SetupError;
use perimelt_core::law::{Constant, StateVariable};
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::law::{EquivalentStrain, FlowPoint};
use super::return_mapping::StressState;
use super::rule::{FlowRule, RulePoint, flow_of};
use super::store::{InelasticStates, SettledPoint};
use crate::mechanical::elastic::StrainedPoints;
use crate::mechanical::moduli::Moduli;

/// What the flow of the points of a body depends on in a step, besides their strain and state.
#[derive(Debug)]
pub struct Conditions {
    pub(super) stress_state: StressState,
    /// Constants of the law at each point, one after the other.
    pub(super) constants: Vec<f64>,
    /// K, by point; empty in a body without temperature.
    pub(super) temperature: Vec<f64>,
    /// s.
    pub(super) step: f64,
    /// 3/2 of the compliance of transformation plasticity in this step, 1/Pa, by point; empty without.
    pub(super) transformation: Vec<f64>,
}

impl Conditions {
    /// A point with its state at the start of the step.
    #[inline(always)]
    fn at<'a>(
        &'a self,
        number: usize,
        count: usize,
        moduli: &'a Moduli,
        settled: SettledPoint<'a>,
    ) -> RulePoint<'a> {
        RulePoint {
            point: FlowPoint {
                constants: &self.constants[number * count..][..count],
                temperature: self.temperature.get(number).copied(),
                step: self.step,
                shear_modulus: moduli.shear,
                bulk_modulus: bulk_modulus(self.stress_state, moduli),
                equivalent: settled.inelastic.equivalent,
                state: settled.variables,
            },
            moduli,
            stress_state: self.stress_state,
            transformation: self.transformation.get(number).copied().unwrap_or(0.0),
        }
    }
}

/// Bulk modulus of three dimensions, Pa, from the moduli of a stress state.
#[inline(always)]
pub(in crate::mechanical) fn bulk_modulus(state: StressState, moduli: &Moduli) -> f64 {
    let Moduli {
        bulk, shear, lame, ..
    } = *moduli;
    match state {
        StressState::Full => lame + 2.0 / 3.0 * shear,
        // (bulk - shear)/(bulk + shear) is Poisson's ratio
        StressState::Plane => {
            let poissons_ratio = (bulk - shear) / (bulk + shear);
            2.0 / 3.0 * shear * (1.0 + poissons_ratio) / (1.0 - 2.0 * poissons_ratio)
        }
        // the stress of a bar does not depend on Poisson's ratio, which is 1/4 with the shear modulus 2/5 bulk
        StressState::Uniaxial => 2.0 / 3.0 * bulk,
    }
}

/// A law of flow, swept over the points of a body: one dynamic call for all points.
pub trait FlowSweep: std::fmt::Debug + Send + Sync + erased_serde::Serialize {
    /// Properties of materials that the law needs.
    fn constants(&self) -> &'static [Constant];

    /// Its state variables.
    fn state(&self) -> &'static [StateVariable];

    /// Whether the derivative of the stress by the strain is symmetric.
    fn is_symmetric(&self) -> bool;

    /// Checks the keys, and computes from them what each point needs.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn prepare(&mut self) -> Result<(), SetupError>;

    /// Sets the trial states that follow the strains.
    fn try_strains(
        &self,
        points: StrainedPoints<'_>,
        conditions: &Conditions,
        states: &mut InelasticStates,
    );

    /// Derivatives of the inelastic strains of the trial states by the strains, of points that flow.
    fn tangents(
        &self,
        points: StrainedPoints<'_>,
        conditions: &Conditions,
        states: &InelasticStates,
    ) -> Vec<(usize, Matrix6<f64>)>;
}

erased_serde::serialize_trait_object!(FlowSweep);

impl<R: FlowRule> FlowSweep for R {
    fn constants(&self) -> &'static [Constant] {
        R::CONSTANTS
    }

    fn state(&self) -> &'static [StateVariable] {
        R::STATE
    }

    fn is_symmetric(&self) -> bool {
        R::IS_SYMMETRIC
    }

    fn prepare(&mut self) -> Result<(), SetupError> {
        FlowRule::prepare(self)
    }

    fn try_strains(
        &self,
        points: StrainedPoints<'_>,
        conditions: &Conditions,
        states: &mut InelasticStates,
    ) {
        let (state, count) = (conditions.stress_state, R::CONSTANTS.len());
        let all = states.try_from_settled().enumerate();
        all.for_all(|(i, (settled, tried))| {
            let elastic = points
                .law(i)
                .with_inelastic(state, settled.inelastic.strain);
            let trial = points.stress(i, &elastic);
            let at = conditions.at(i, count, &elastic.moduli, settled);
            match flow_of(self, &at, &trial, tried.variables) {
                Some(flow) => tried.advance(settled.inelastic, &flow),
                None => tried.rest(settled),
            }
        });
    }

    fn tangents(
        &self,
        points: StrainedPoints<'_>,
        conditions: &Conditions,
        states: &InelasticStates,
    ) -> Vec<(usize, Matrix6<f64>)> {
        /// Step of the differences in strains of the scale of the law: errors of 1e-8 from the curvature, and less from
        /// the return, which is found to rounding.
        const STEP: f64 = 1e-4;
        let (state, count) = (conditions.stress_state, R::CONSTANTS.len());
        let width = StateVariable::width_of(R::STATE);
        let (tried, settled) = (states.tried(), states.settled());
        let transforms = |i: usize| conditions.transformation.get(i).is_some_and(|g| *g > 0.0);
        let flows = |i: usize| tried[i].equivalent > settled[i].equivalent || transforms(i);
        let flowing: Vec<usize> = (0..tried.len()).filter(|&i| flows(i)).collect();
        let tangent = |scratch: &mut Vec<f64>, i: usize| {
            let elastic = points.law(i);
            let point = SettledPoint {
                inelastic: &settled[i],
                variables: states.variables.settled(i),
            };
            let at = conditions.at(i, count, &elastic.moduli, point);
            let trial = points.stress(i, &elastic.with_inelastic(state, settled[i].strain));
            let strain = EquivalentStrain {
                end: tried[i].equivalent,
                increment: tried[i].equivalent - settled[i].equivalent,
            };
            let tangent = self.tangent(&at, &trial, strain, states.variables.tried(i));
            if let Some(tangent) = tangent {
                return (i, tangent);
            }
            let step = STEP * self.scale(&at.point) / (2.0 * elastic.moduli.shear);
            let mut returned = |change: &[f64; 6], factor: f64| {
                let stress = std::array::from_fn(|c| trial[c] + factor * change[c]);
                flow_of(self, &at, &stress, scratch).map_or([0.0; 6], |flow| flow.strain)
            };
            let tangent = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|component| {
                let mut unit = [0.0; 6];
                unit[component] = 1.0;
                let stress = points.elastic_stress(&elastic, &unit);
                let (up, down) = (returned(&stress, step), returned(&stress, -step));
                Vector6::from_fn(|c, _| (up[c] - down[c]) / (2.0 * step))
            }));
            (i, tangent)
        };
        let flowing = flowing.into_par_iter();
        flowing.map_init(|| vec![0.0; width], tangent).collect()
    }
}
