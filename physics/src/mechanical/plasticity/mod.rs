//! Plastic flow: a law of flow, and the states of the points of a body. Elastic strains are small.
//!
//! ```text
//! stress = C : (strain - inelastic strain),   inelastic strain = function of trial stress and state at the start of a step
//! ```
//!
//! | file | has |
//! |---|---|
//! | `law` | the traits of laws, and how a law makes itself known |
//! | `j2`, `chaboche`, `johnson_cook`, `norton`, `drucker_prager` | the laws |
//! | `rule`, `return_mapping` | flow along the deviator in each stress state: radial return in 3D and plane strain, Simo & Hughes (1998), Computational Inelasticity, section 3.4, in plane stress |
//! | `zero_stress` | laws in three dimensions under plane stress and in bars |
//! | `sweep` | all points of a body behind one dynamic call |
//! | `store` | states at the end of the last step, and tried in this one |
//! | `keys` | `plasticity`, `flow` and `annealing_temperature` |
//!
//! At and above the annealing temperature a point loses its stress, its hardening and the state of the law: its elastic
//! strain becomes inelastic, so that it is free of stress in the shape in which it solidifies.
//!
//! Where another physics provides the field `yield_stress`, it takes the place of the property; where one provides
//! `transformation_compliance`, the plastic strain grows by 3/2 of the deviator times the growth of that field, too.

mod chaboche;
mod drucker_prager;
mod j2;
mod johnson_cook;
mod keys;
mod law;
#[cfg(test)]
mod law_tests;
mod norton;
mod return_mapping;
mod rule;
mod store;
mod sweep;
mod tensor;
mod zero_stress;

use nalgebra::{Matrix3, Matrix6, Vector6};
use perimelt_core::law::{Constants, Law, StateVariable};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Body, SetupError};
use rayon::prelude::*;

use super::classical::{COMPONENTS, Point};
use super::elastic::StrainedPoints;
use super::moduli::{Moduli, Plane};
pub use chaboche::Chaboche;
pub use drucker_prager::DruckerPrager;
pub use j2::{HardeningTable, J2};
pub use johnson_cook::JohnsonCook;
pub(super) use keys::ChosenFlow;
pub use keys::PlasticitySection;
pub use law::{EquivalentStrain, Flow, FlowLaw, FlowPoint, FlowRegistration, FlowStressLaw};
pub use norton::Norton;
pub use return_mapping::{StressState, return_to_yield};
use return_mapping::{elastic_strain, relieved_strain};
pub use rule::{FlowRule, Radial, RulePoint, Spatial};
pub use store::{Inelastic, InelasticStates};
pub(super) use sweep::bulk_modulus;
pub use sweep::{Conditions, FlowSweep};

/// Plastic flow of a body: its law, and the states of its points.
#[derive(Debug)]
pub struct Plasticity {
    /// The components that the stress has.
    pub stress_state: StressState,
    /// K.
    pub annealing_temperature: Option<f64>,
    /// States of the points.
    pub states: InelasticStates,
    law: Law<dyn FlowSweep>,
    constants: Constants,
    conditions: Conditions,
    /// Derivative of the inelastic strain by the strain, of the points that flow in the linearised state.
    tangents: Vec<(usize, Matrix6<f64>)>,
    /// Change of the inelastic strain of each point with a change of the displacement, by the tangents.
    pub(super) change: Vec<[f64; 6]>,
}

impl Plasticity {
    /// Takes the constants of the law from the materials of a body.
    ///
    /// # Errors
    /// A material without a constant of the law, keys of the law that make no sense.
    pub(super) fn of(chosen: ChosenFlow, body: &Body, plane: Plane) -> Result<Self, SetupError> {
        let ChosenFlow {
            mut law,
            key,
            annealing,
        } = chosen;
        law.law.prepare().map_err(|e| e.below(&key))?;
        let name = law.key();
        let constants = law.law.constants();
        let points = body.points.len();
        let stress_state = StressState::of(body.dimension, plane);
        Ok(Plasticity {
            stress_state,
            annealing_temperature: annealing.map(|annealing| annealing.limit),
            states: InelasticStates::new(points, StateVariable::width_of(law.law.state())),
            constants: Constants::of(body, &key, &name, constants)?,
            conditions: Conditions {
                stress_state,
                constants: vec![0.0; points * constants.len()],
                temperature: Vec::new(),
                step: 0.0,
                transformation: Vec::new(),
            },
            law,
            tangents: Vec::new(),
            change: vec![[0.0; 6]; points],
        })
    }

    /// The name of the law.
    pub fn law_name(&self) -> &'static str {
        self.law.name
    }

    /// State variables of the law.
    pub fn state_variables(&self) -> &'static [StateVariable] {
        self.law.law.state()
    }

    /// Whether the derivative of the stress by the strain is symmetric.
    pub fn is_symmetric(&self) -> bool {
        self.law.law.is_symmetric()
    }

    /// Evaluates the constants of the law at the temperature of each point, K, for a step (s); `given` yield stresses (Pa) of
    /// the points take the place of the materials'.
    pub fn set_conditions(
        &mut self,
        material: &[u16],
        temperature: Option<&[f64]>,
        given: Option<&[f64]>,
        step: f64,
    ) {
        let constants = self.law.law.constants();
        let strength = constants.iter().position(|c| c.property == "yield_stress");
        let given = strength.zip(given);
        let values = &mut self.conditions.constants;
        let points = values.par_chunks_exact_mut(constants.len().max(1));
        points
            .zip(material)
            .enumerate()
            .for_all(|(i, (values, &m))| {
                let temperature = temperature.map_or(0.0, |t| t[i]);
                self.constants.load(m as usize, temperature, 0.0, values);
                if let Some((strength, given)) = given {
                    values[strength] = given[i];
                }
            });
        let kept = &mut self.conditions.temperature;
        kept.clear();
        kept.extend_from_slice(temperature.unwrap_or_default());
        self.conditions.step = step;
    }

    /// Sets the growth of the compliance of transformation plasticity in this step (1/Pa, by point).
    pub fn set_transformation(&mut self, growth: impl Iterator<Item = f64>) {
        let transformation = &mut self.conditions.transformation;
        transformation.clear();
        transformation.extend(growth.map(|k| 1.5 * k));
    }

    /// Returns the stresses of all points to the flow stress: sets the trial state.
    pub(super) fn try_strains(&mut self, points: StrainedPoints<'_>) {
        let law = &self.law.law;
        law.try_strains(points, &self.conditions, &mut self.states);
    }

    /// Derivatives of the inelastic strains of the trial state by the strains, for points that flow: the consistent
    /// tangent of the law, or central differences.
    pub(super) fn linearise(&mut self, points: StrainedPoints<'_>, damping: f64) {
        let law = &self.law.law;
        self.tangents = law.tangents(points, &self.conditions, &self.states);
        let of_tangents = self.tangents.iter_mut();
        of_tangents.for_each(|(_, tangent)| *tangent *= 1.0 - damping);
    }

    /// Sets the change of the inelastic strains under a change of the displacement gradients.
    pub(super) fn follow(&mut self, gradient: impl Fn(usize) -> Matrix3<f64>) {
        self.change.fill([0.0; 6]);
        for (i, tangent) in &self.tangents {
            let strain = Point::strain(&gradient(*i), false);
            let change = tangent * Vector6::from(COMPONENTS.map(|at| strain[at]));
            self.change[*i] = change.into();
        }
    }

    /// The points that flow in the linearised state, in order, with the derivative of the stress that they give way by (Pa) by the
    /// strain, xx, yy, zz, xy, yz, zx.
    pub(super) fn reliefs<'a>(
        &'a self,
        points: StrainedPoints<'a>,
    ) -> impl IndexedParallelIterator<Item = (usize, Matrix6<f64>)> {
        self.tangents.par_iter().map(move |(point, tangent)| {
            let law = points.law(*point);
            let relief = |column: usize| {
                let flow: Vector6<f64> = tangent.column(column).into();
                Vector6::from(points.relief(&law, flow.into()))
            };
            (
                *point,
                Matrix6::from_columns(&[0, 1, 2, 3, 4, 5].map(relief)),
            )
        })
    }

    /// Stress of each point in the trial state, Pa, without the rotation of the point.
    pub(super) fn tried_stress(&self, points: StrainedPoints<'_>, stress: &mut [[f64; 6]]) {
        for (i, (stress, tried)) in stress.iter_mut().zip(self.states.tried()).enumerate() {
            let law = points.law(i);
            *stress = points.stress(i, &law.with_inelastic(self.stress_state, tried.strain));
        }
    }

    /// Accepts the trial state; adds the work of the flow, J/m³, to `work`.
    pub fn settle(&mut self, work: &mut [f64]) {
        let done = work.iter_mut().zip(self.states.work());
        done.for_each(|(work, done)| *work += done);
        self.states.commit();
    }

    /// Turns the elastic strain of points at or above the annealing temperature into inelastic strain
    /// and forgets their hardening and the state of the law; `stress` in Pa by point.
    pub fn anneal(
        &mut self,
        temperature: &[f64],
        stress: &[[f64; 6]],
        moduli: impl Fn(usize) -> Moduli,
    ) {
        let Some(limit) = self.annealing_temperature else {
            return;
        };
        for (i, stress) in stress.iter().enumerate() {
            if temperature[i] < limit {
                continue;
            }
            let relieved = relieved_strain(self.stress_state, stress, &moduli(i));
            let mut strain = self.states.take(i).strain;
            strain.iter_mut().zip(relieved).for_each(|(e, de)| *e += de);
            self.states.settled_mut(i).strain = strain;
        }
    }

    /// Takes all inelastic strain and hardening from a point with a stress (Pa); the sum of its elastic and inelastic
    /// strain.
    pub(super) fn reset(&mut self, point: usize, stress: &[f64; 6], moduli: &Moduli) -> [f64; 6] {
        let mut strain = elastic_strain(self.stress_state, stress, moduli);
        let settled = self.states.take(point);
        (0..6).for_each(|c| strain[c] += settled.strain[c]);
        strain
    }
}

#[cfg(test)]
mod tests;
