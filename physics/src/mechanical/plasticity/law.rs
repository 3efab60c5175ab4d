//! The law of inelastic flow, and J2 plasticity.
//!
//! A further law is a type that implements [`FlowLaw`] and takes the place of [`J2`] in
//! [`Plasticity`](super::Plasticity), which is compiled for its law.

use nalgebra::Matrix6;
use perimelt_core::material::{Property, Table};
use rayon::prelude::*;

use super::return_mapping::{
    FlowStress, Flowed, StressState, flow_along_deviator, radial_tangent, return_to_yield,
};
use super::store::Inelastic;
use crate::mechanical::moduli::Moduli;

/// A point that may flow in a step.
#[derive(Clone, Copy, Debug)]
pub struct FlowPoint<'a> {
    /// Number of the point.
    pub number: usize,
    /// Its elastic moduli.
    pub moduli: &'a Moduli,
    /// Its state at the start of the step.
    pub settled: &'a Inelastic,
}

/// A law of inelastic flow of points that are elastic and isotropic. Tensors are xx, yy, zz, xy, yz, zx.
pub trait FlowLaw: Sync {
    /// The increment of the state of a point from its trial stress (Pa), which is elastic from the settled state on;
    /// `None` without flow.
    fn flow(&self, point: FlowPoint<'_>, trial: &[f64; 6]) -> Option<Inelastic>;

    /// Whether a point flows between its settled state and a tried one.
    fn flows(&self, point: usize, settled: &Inelastic, tried: &Inelastic) -> bool;

    /// Derivative of the inelastic strain by the strain, from the trial stress (Pa) and the state that
    /// [`FlowLaw::flow`] found; `None` without a closed form, which differences replace.
    fn tangent(
        &self,
        point: FlowPoint<'_>,
        trial: &[f64; 6],
        tried: &Inelastic,
    ) -> Option<Matrix6<f64>>;

    /// Work of the flow of a point in a step, J/m³.
    fn work(&self, point: usize, settled: &Inelastic, tried: &Inelastic) -> f64;

    /// Stress at which a point starts to flow, Pa: the scale of differences.
    fn yield_stress(&self, point: usize) -> f64;
}

/// J2 plasticity with isotropic hardening and transformation plasticity.
#[derive(Debug)]
pub struct J2 {
    pub(super) stress_state: StressState,
    /// By material.
    pub(super) yield_stress: Vec<Property>,
    /// By material.
    pub(super) hardening_modulus: Vec<Option<Property>>,
    pub(super) table: Option<Table>,
    /// Yield stress and hardening modulus of each point at its present temperature, Pa.
    pub(super) flow: Vec<[f64; 2]>,
    /// 3/2 of the compliance of transformation plasticity in this step, 1/Pa, by point; empty without.
    pub(super) transformation: Vec<f64>,
}

impl J2 {
    /// Evaluates yield stress and hardening modulus at the temperature of each point, K; `given` yield stresses (Pa) of the
    /// points take the place of the materials'.
    pub fn set_temperature(
        &mut self,
        material: &[u16],
        temperature: Option<&[f64]>,
        given: Option<&[f64]>,
    ) {
        let (yields, moduli) = (&self.yield_stress, &self.hardening_modulus);
        let points = self.flow.par_iter_mut().zip(material).enumerate();
        points.for_each(|(i, (flow, &m))| {
            let t = temperature.map_or(0.0, |t| t[i]);
            let modulus = moduli[m as usize].as_ref();
            *flow = [
                given.map_or_else(|| yields[m as usize].at(t, 0.0), |given| given[i]),
                modulus.map_or(0.0, |h| h.at(t, 0.0)),
            ];
        });
    }

    /// Sets the growth of the compliance of transformation plasticity in this step (1/Pa, by point).
    pub fn set_transformation(&mut self, growth: impl Iterator<Item = f64>) {
        self.transformation.clear();
        self.transformation.extend(growth.map(|k| 1.5 * k));
    }

    /// Resistance of a point to flow.
    fn flow_stress(&self, point: usize) -> FlowStress<'_> {
        let [yield_stress, modulus] = self.flow[point];
        FlowStress {
            yield_stress,
            modulus,
            table: self.table.as_ref(),
        }
    }
}

impl FlowLaw for J2 {
    /// Flow by transformation, then by the excess over the flow stress.
    fn flow(&self, point: FlowPoint<'_>, trial: &[f64; 6]) -> Option<Inelastic> {
        let FlowPoint {
            number,
            moduli,
            settled,
        } = point;
        let state = self.stress_state;
        let returned = |stress: &[f64; 6]| {
            let flow = self.flow_stress(number);
            let excess = return_to_yield(state, stress, moduli, flow, settled.equivalent);
            excess.map(|(strain, equivalent)| Inelastic { strain, equivalent })
        };
        match self.transformation.get(number) {
            None | Some(0.0) => returned(trial),
            Some(&g) => {
                let (stress, mut strain) = flow_along_deviator(state, trial, moduli, g);
                let rest = returned(&stress).unwrap_or_default();
                strain
                    .iter_mut()
                    .zip(rest.strain)
                    .for_each(|(e, de)| *e += de);
                Some(Inelastic { strain, ..rest })
            }
        }
    }

    fn flows(&self, point: usize, settled: &Inelastic, tried: &Inelastic) -> bool {
        tried.equivalent > settled.equivalent
            || self.transformation.get(point).is_some_and(|g| *g > 0.0)
    }

    fn tangent(
        &self,
        point: FlowPoint<'_>,
        trial: &[f64; 6],
        tried: &Inelastic,
    ) -> Option<Matrix6<f64>> {
        let FlowPoint {
            number,
            moduli,
            settled,
        } = point;
        let flowed = Flowed {
            transformation: self.transformation.get(number).copied().unwrap_or(0.0),
            increment: tried.equivalent - settled.equivalent,
            hardening: self.flow_stress(number).slope(tried.equivalent),
        };
        radial_tangent(self.stress_state, trial, moduli, flowed)
    }

    /// The flow stress at the end of the step times the increment of the equivalent strain.
    fn work(&self, point: usize, settled: &Inelastic, tried: &Inelastic) -> f64 {
        let flow = self.flow_stress(point).at(tried.equivalent);
        flow * (tried.equivalent - settled.equivalent)
    }

    fn yield_stress(&self, point: usize) -> f64 {
        self.flow[point][0]
    }
}
