//! Plastic flow of hot metal: J2 plasticity with isotropic hardening and annealing.
//!
//! ```text
//! q = sqrt(3/2 s : s) <= flow stress = yield_stress(T) h(p) + hardening_modulus(T) p
//! d(plastic strain) = 3/2 s/q dp,   p' >= 0
//! ```
//!
//! with s the stress deviator, p the equivalent plastic strain, h a table. The stress is returned implicitly to
//! the flow stress: by radial return in 3D and plane strain, by Simo & Hughes (1998), Computational Inelasticity,
//! section 3.4, in plane stress. At and above the annealing temperature a point loses its stress and its
//! hardening: its elastic strain becomes inelastic, so that it is free of stress in the shape in which it
//! solidifies.
//!
//! Where another physics provides the field `yield_stress`, it takes the place of the property; where one provides
//! `transformation_compliance`, the plastic strain grows by 3/2 s times the growth of that field, too.
//!
//! Small elastic strains; no kinematic hardening, no rate dependence.

mod law;
mod return_mapping;
mod store;

use nalgebra::{Matrix3, Matrix6, Vector6};
use perimelt_core::material::Table;
use perimelt_core::{Setup, SetupError};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::classical::{COMPONENTS, Point};
use super::elastic::StrainedPoints;
use super::moduli::{Moduli, Plane};
pub use law::{FlowLaw, FlowPoint, J2};
pub use return_mapping::{FlowStress, StressState, return_to_yield};
use return_mapping::{elastic_strain, relieved_strain};
pub use store::{Inelastic, InelasticStates};

/// Plastic flow by the material properties `yield_stress` and, if given, `hardening_modulus`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlasticitySection {
    /// Temperature (K) at and above which a point loses its stress and its hardening; default never.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub annealing_temperature: Option<f64>,
    /// Flow stress over yield stress by equivalent plastic strain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening: Option<HardeningTable>,
}

/// Rows of a hardening curve; beyond the last row the flow stress is constant.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HardeningTable {
    /// Equivalent plastic strain, increasing from 0.
    pub plastic_strain: Vec<f64>,
    /// Flow stress over the yield stress at the same temperature; never falling.
    pub factor: Vec<f64>,
}

impl HardeningTable {
    fn table(&self) -> Result<Table, SetupError> {
        let Self {
            plastic_strain,
            factor,
        } = self;
        let falls = factor.windows(2).any(|w| w[1] < w[0]);
        if falls || plastic_strain.first() != Some(&0.0) {
            return Err(SetupError::value(
                "plasticity.hardening",
                "the hardening curve falls or does not start at 0",
                "`plastic_strain` increasing from 0, `factor` never falling",
            ));
        }
        Table::new(plastic_strain.clone(), factor.clone())
            .map_err(|e| SetupError::other("plasticity.hardening", e))
    }
}

/// Plastic flow of a body: its law, and the states of its points.
#[derive(Debug)]
pub struct Plasticity {
    /// The components that the stress has.
    pub stress_state: StressState,
    /// The law of the flow.
    pub law: J2,
    /// K.
    pub annealing_temperature: Option<f64>,
    /// States of the points.
    pub states: InelasticStates,
    /// Derivative of the inelastic strain by the strain, of the points that flow in the linearised state.
    tangents: Vec<(usize, Matrix6<f64>)>,
    /// Change of the inelastic strain of each point with a change of the displacement, by the tangents.
    pub(super) change: Vec<[f64; 6]>,
}

impl Plasticity {
    /// Takes the properties of the materials of a body.
    ///
    /// # Errors
    /// A material without yield stress, a hardening table that falls or does not start at 0, an annealing temperature that is
    /// not above 0 K.
    pub fn of(
        section: &PlasticitySection,
        setup: &Setup<'_>,
        body: usize,
        plane: Plane,
    ) -> Result<Self, SetupError> {
        if let Some(limit) = section.annealing_temperature.filter(|limit| *limit <= 0.0) {
            let message = format!("the annealing temperature is {limit} K");
            let key = "plasticity.annealing_temperature";
            return Err(SetupError::value(key, message, "a temperature above 0 K"));
        }
        let this = setup.body(body);
        let table = match &section.hardening {
            None => None,
            Some(hardening) => Some(hardening.table()?),
        };
        let points = this.points.len();
        let stress_state = StressState::of(this.dimension, plane);
        let law = J2 {
            stress_state,
            yield_stress: setup.world().property(body, "yield_stress")?,
            hardening_modulus: this
                .materials
                .iter()
                .map(|m| m.get("hardening_modulus").cloned())
                .collect(),
            table,
            flow: vec![[0.0; 2]; points],
            transformation: Vec::new(),
        };
        Ok(Plasticity::new(law, section.annealing_temperature, points))
    }

    fn new(law: J2, annealing_temperature: Option<f64>, points: usize) -> Self {
        Plasticity {
            stress_state: law.stress_state,
            law,
            annealing_temperature,
            states: InelasticStates::new(points),
            tangents: Vec::new(),
            change: vec![[0.0; 6]; points],
        }
    }

    /// Returns the stresses of all points to the flow stress: sets the trial state.
    pub(super) fn try_strains(&mut self, points: StrainedPoints<'_>) {
        let (law, state) = (&self.law, self.stress_state);
        let (settled, tried) = self.states.try_from_settled();
        tried.par_iter_mut().enumerate().for_each(|(i, tried)| {
            let settled = &settled[i];
            *tried = *settled;
            let elastic = points.law(i).with_inelastic(state, settled.strain);
            let trial = points.stress(i, &elastic);
            let point = FlowPoint {
                number: i,
                moduli: &elastic.moduli,
                settled,
            };
            if let Some(increment) = law.flow(point, &trial) {
                let strain = tried.strain.iter_mut().zip(increment.strain);
                strain.for_each(|(e, de)| *e += de);
                tried.equivalent += increment.equivalent;
            }
        });
    }

    /// Derivatives of the inelastic strains of the trial state by the strains, for points that flow: the consistent
    /// tangent of the law, or central differences.
    pub(super) fn linearise(&mut self, points: StrainedPoints<'_>) {
        /// Step of the differences in yield strains: errors of 1e-8 from the curvature, and less from
        /// the return, which is found to rounding.
        const STEP: f64 = 1e-4;
        let (law, state) = (&self.law, self.stress_state);
        let (tried, settled) = (self.states.tried(), self.states.settled());
        let flowing = (0..tried.len()).filter(|&i| law.flows(i, &settled[i], &tried[i]));
        let flowing: Vec<usize> = flowing.collect();
        let tangents = flowing.into_par_iter().map(|i| {
            let elastic = points.law(i);
            let point = FlowPoint {
                number: i,
                moduli: &elastic.moduli,
                settled: &settled[i],
            };
            let trial = points.stress(i, &elastic.with_inelastic(state, settled[i].strain));
            if let Some(tangent) = law.tangent(point, &trial, &tried[i]) {
                return (i, tangent);
            }
            let step = STEP * law.yield_stress(i) / (2.0 * elastic.moduli.shear);
            let returned = |change: &[f64; 6], factor: f64| {
                let stress = std::array::from_fn(|c| trial[c] + factor * change[c]);
                law.flow(point, &stress)
                    .map_or([0.0; 6], |increment| increment.strain)
            };
            let tangent = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|component| {
                let mut unit = [0.0; 6];
                unit[component] = 1.0;
                let stress = points.elastic_stress(&elastic, &unit);
                let (up, down) = (returned(&stress, step), returned(&stress, -step));
                Vector6::from_fn(|c, _| (up[c] - down[c]) / (2.0 * step))
            }));
            (i, tangent)
        });
        self.tangents = tangents.collect();
    }

    /// Sets the change of the inelastic strains under a change of the displacement gradients.
    pub(super) fn follow(&mut self, gradients: &[Matrix3<f64>]) {
        self.change.fill([0.0; 6]);
        for (i, tangent) in &self.tangents {
            let strain = Point::strain(&gradients[*i], false);
            let change = tangent * Vector6::from(COMPONENTS.map(|at| strain[at]));
            self.change[*i] = change.into();
        }
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
        let (settled, tried) = (self.states.settled(), self.states.tried());
        for (i, work) in work.iter_mut().enumerate() {
            *work += self.law.work(i, &settled[i], &tried[i]);
        }
        self.states.commit();
    }

    /// Turns the elastic strain of points at or above the annealing temperature into inelastic strain
    /// and forgets their hardening; `stress` in Pa by point.
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
            let settled = self.states.settled_mut(i);
            let strain = settled.strain.iter_mut().zip(relieved);
            strain.for_each(|(e, de)| *e += de);
            settled.equivalent = 0.0;
        }
    }

    /// Takes all inelastic strain and hardening from a point with a stress (Pa); the sum of its elastic and inelastic
    /// strain.
    pub(super) fn reset(&mut self, point: usize, stress: &[f64; 6], moduli: &Moduli) -> [f64; 6] {
        let mut strain = elastic_strain(self.stress_state, stress, moduli);
        let settled = std::mem::take(self.states.settled_mut(point));
        (0..6).for_each(|c| strain[c] += settled.strain[c]);
        strain
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{material, read};

    /// Two points of two materials, and the hardening factor 1 + 10 p up to p = 0.1.
    fn plasticity(keys: &str) -> Plasticity {
        let soft = material(
            "yield_stress = { temperature = [300, 400], value = [200e6, 100e6] }\nhardening_modulus = 1e9",
        );
        let hard = material("yield_stress = 500e6");
        let section: PlasticitySection = read(keys);
        let property = |m: &perimelt_core::material::Material, name: &str| m.get(name).cloned();
        let law = J2 {
            stress_state: StressState::Full,
            yield_stress: vec![
                property(&soft, "yield_stress").expect("given"),
                property(&hard, "yield_stress").expect("given"),
            ],
            hardening_modulus: vec![
                property(&soft, "hardening_modulus"),
                property(&hard, "hardening_modulus"),
            ],
            table: section.hardening.map(|h| h.table().expect("it rises")),
            flow: vec![[0.0; 2]; 2],
            transformation: Vec::new(),
        };
        Plasticity::new(law, section.annealing_temperature, 2)
    }

    #[test]
    fn yield_stresses_are_those_of_material_and_temperature_or_given() {
        let mut plasticity = plasticity("");
        for (temperature, given, expected) in [
            (None, None, [[200e6, 1e9], [500e6, 0.0]]),
            (Some([350.0, 350.0]), None, [[150e6, 1e9], [500e6, 0.0]]),
            (Some([400.0, 300.0]), None, [[100e6, 1e9], [500e6, 0.0]]),
            (
                Some([400.0, 300.0]),
                Some([7e6, 8e6]),
                [[7e6, 1e9], [8e6, 0.0]],
            ),
        ] {
            let temperature = temperature.as_ref().map(|t| &t[..]);
            let given = given.as_ref().map(|g| &g[..]);
            plasticity.law.set_temperature(&[0, 1], temperature, given);
            assert_eq!(plasticity.law.flow, expected);
        }
    }

    /// The work of the flow is the flow stress at its end times the increment of the equivalent strain.
    #[test]
    fn an_accepted_flow_has_done_its_work() {
        let table = "hardening = { plastic_strain = [0, 0.1], factor = [1, 2] }";
        for (keys, flow) in [
            // 200 MPa and 1 GPa times 0.05
            ("", [250e6, 500e6]),
            // and a factor of 1.5 at 0.05
            (table, [350e6, 750e6]),
        ] {
            let mut plasticity = plasticity(keys);
            plasticity.law.set_temperature(&[0, 1], None, None);
            let (_, tried) = plasticity.states.try_from_settled();
            for tried in tried {
                tried.equivalent = 0.05;
                tried.strain[3] = 0.01;
            }
            (0..2).for_each(|i| plasticity.states.settled_mut(i).equivalent = 0.03);
            let mut work = [1.0; 2];
            plasticity.settle(&mut work);
            for (work, flow) in work.iter().zip(flow) {
                assert!((work - 1.0 - flow * 0.02).abs() < 1e-6, "{keys}: {work}");
            }
            let settled = plasticity.states.settled()[1];
            assert_eq!((settled.equivalent, settled.strain[3]), (0.05, 0.01));
        }
    }

    /// From the annealing temperature on points forget their hardening, and their deviatoric elastic strain becomes inelastic.
    #[test]
    fn annealing_begins_at_its_temperature() {
        let moduli = Moduli::new(2e11, 0.3, 3, Plane::Stress);
        let stress = [[30e6, 0.0, 0.0, 5e6, 0.0, 0.0]; 2];
        let shear = 2.0 * moduli.shear;
        let relieved = [
            20e6 / shear,
            -10e6 / shear,
            -10e6 / shear,
            5e6 / shear,
            0.0,
            0.0,
        ];
        for (keys, anneals) in [
            ("", [false; 2]),
            ("annealing_temperature = 1300", [false, true]),
        ] {
            let mut plasticity = plasticity(keys);
            let hardened = Inelastic {
                strain: [0.01; 6],
                equivalent: 0.1,
            };
            plasticity.states.load([hardened; 2].into_iter());
            plasticity.anneal(&[1299.9, 1300.0], &stress, |_| moduli);
            for (settled, anneals) in plasticity.states.settled().iter().zip(anneals) {
                assert_eq!(settled.equivalent, if anneals { 0.0 } else { 0.1 });
                for (found, relieved) in settled.strain.iter().zip(relieved) {
                    let expected = if anneals { 0.01 + relieved } else { 0.01 };
                    assert!((found - expected).abs() < 1e-15, "{keys}: {found}");
                }
            }
        }
    }

    #[test]
    fn a_hardening_curve_starts_at_zero_and_never_falls() {
        for (keys, is_valid) in [
            ("plastic_strain = [0, 0.1], factor = [1, 2]", true),
            ("plastic_strain = [0, 0.1], factor = [1, 1]", true),
            ("plastic_strain = [0, 0.1], factor = [2, 1]", false),
            ("plastic_strain = [0.01, 0.1], factor = [1, 2]", false),
            ("plastic_strain = [], factor = []", false),
            ("plastic_strain = [0, 0], factor = [1, 2]", false),
        ] {
            let section: PlasticitySection = read(&format!("hardening = {{ {keys} }}"));
            let table = section.hardening.expect("given").table();
            assert_eq!(table.is_ok(), is_valid, "{keys}");
            if let Err(error) = table {
                assert_eq!(error.key, "plasticity.hardening");
            }
        }
    }

    /// A trial state is accepted or given up as a whole.
    #[test]
    fn a_rejected_trial_leaves_the_settled_state() {
        let mut plasticity = plasticity("");
        let (_, tried) = plasticity.states.try_from_settled();
        tried.iter_mut().for_each(|t| t.equivalent = 0.05);
        plasticity.states.reject();
        for states in [plasticity.states.settled(), plasticity.states.tried()] {
            assert!(states.iter().all(|s| s.equivalent == 0.0));
        }
        let (_, tried) = plasticity.states.try_from_settled();
        tried.iter_mut().for_each(|t| t.equivalent = 0.05);
        plasticity.states.commit();
        for states in [plasticity.states.settled(), plasticity.states.tried()] {
            assert!(states.iter().all(|s| s.equivalent == 0.05));
        }
    }

    /// Three halves of the growth of the compliance.
    #[test]
    fn transformation_flows_by_three_halves_of_its_compliance() {
        let mut plasticity = plasticity("");
        plasticity.law.set_transformation([2e-10, 0.0].into_iter());
        assert_eq!(plasticity.law.transformation, [3e-10, 0.0]);
    }
}
