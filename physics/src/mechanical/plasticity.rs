//! Plastic flow of hot metal: J2 plasticity with isotropic hardening and annealing.
//!
//! ```text
//! q = sqrt(3/2 s : s) <= flow stress = yield_stress(T) h(p) + hardening_modulus(T) p
//! d(plastic strain) = 3/2 s/q dp,   p' >= 0
//! ```
//!
//! with s the stress deviator, p the equivalent plastic strain, h a table. The stress is returned to the
//! flow stress implicitly: along the radius in 3D and plane strain, by Simo & Hughes (1998),
//! Computational Inelasticity, section 3.4, in plane stress. At and above the annealing temperature a
//! point keeps no stress and no hardening: its elastic strain becomes inelastic, so that it is free of
//! stress in the shape in which it solidifies.
//!
//! Small elastic strains; no kinematic hardening, no rate dependence.

use nalgebra::{Matrix3, Matrix6, Vector6};
use perimelt_core::material::{Property, Table};
use perimelt_core::{Setup, SetupError};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::classical::{COMPONENTS, Point, symmetric};
use super::moduli::{Moduli, Plane};

/// Plastic flow by the material properties `yield_stress` and, if given, `hardening_modulus`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlasticitySection {
    /// Temperature (K) from which on a point keeps neither stress nor hardening; default never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub annealing_temperature: Option<f64>,
    /// Flow stress over yield stress by equivalent plastic strain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening: Option<HardeningTable>,
}

/// Rows of a hardening curve; beyond the last one the flow stress stays.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HardeningTable {
    /// Equivalent plastic strain, increasing from 0.
    pub plastic_strain: Vec<f64>,
    /// Flow stress over the yield stress at the same temperature; never falling.
    pub factor: Vec<f64>,
}

/// Which components of the stress there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StressState {
    /// 1D.
    Uniaxial,
    /// 2D, none across the plane.
    Plane,
    /// 3D and plane strain.
    Full,
}

impl StressState {
    /// That of a body.
    pub fn of(dimension: usize, plane: Plane) -> Self {
        match (dimension, plane) {
            (1, _) => StressState::Uniaxial,
            (2, Plane::Stress) => StressState::Plane,
            _ => StressState::Full,
        }
    }

    /// Components of an inelastic strain that change the volume as far as the dimensions see.
    pub fn trace(self, strain: &[f64; 6]) -> f64 {
        match self {
            StressState::Uniaxial => strain[0],
            StressState::Plane => strain[0] + strain[1],
            StressState::Full => strain[0] + strain[1] + strain[2],
        }
    }
}

/// Resistance of a point to flow.
#[derive(Clone, Copy, Debug)]
pub struct FlowStress<'a> {
    /// Yield stress, Pa.
    pub yield_stress: f64,
    /// Hardening modulus, Pa.
    pub modulus: f64,
    /// h(p).
    pub table: Option<&'a Table>,
}

impl FlowStress<'_> {
    /// Flow stress at an equivalent plastic strain, Pa.
    pub fn at(&self, equivalent: f64) -> f64 {
        let factor = self.table.map_or(1.0, |t| t.at(equivalent));
        self.yield_stress * factor + self.modulus * equivalent
    }
}

/// Increments of plastic strain (xx, yy, zz, xy, yz, zx) and equivalent plastic strain that bring a
/// trial stress (Pa) back to the flow stress; `None` when it is below.
pub fn return_to_yield(
    state: StressState,
    trial: &[f64; 6],
    moduli: &Moduli,
    flow: FlowStress<'_>,
    equivalent: f64,
) -> Option<([f64; 6], f64)> {
    let [xx, yy, zz, xy, yz, zx] = *trial;
    match state {
        StressState::Uniaxial => {
            let q = xx.abs();
            let excess = |dp: f64| q - moduli.bulk * dp - flow.at(equivalent + dp);
            let dp = root(excess, q / moduli.bulk)?;
            let along = dp * xx.signum();
            Some(([along, -0.5 * along, -0.5 * along, 0.0, 0.0, 0.0], dp))
        }
        StressState::Full => {
            let mean = (xx + yy + zz) / 3.0;
            let deviator = [xx - mean, yy - mean, zz - mean, xy, yz, zx];
            let q = equivalent_stress(&deviator);
            let excess = |dp: f64| q - 3.0 * moduli.shear * dp - flow.at(equivalent + dp);
            let dp = root(excess, q / (3.0 * moduli.shear))?;
            Some((deviator.map(|s| 1.5 * dp * s / q), dp))
        }
        StressState::Plane => {
            // the in-plane mean and the rest fall with g by different moduli
            let (sum, difference) = (xx + yy, xx - yy);
            let fall = |g: f64| {
                (
                    1.0 / (1.0 + 2.0 / 3.0 * moduli.bulk * g),
                    1.0 / (1.0 + 2.0 * moduli.shear * g),
                )
            };
            let q = |g: f64| {
                let (mean, rest) = fall(g);
                let square = (sum * mean).powi(2) / 6.0
                    + (0.5 * difference.powi(2) + 2.0 * xy * xy) * rest * rest;
                (1.5 * square).sqrt()
            };
            let excess = |g: f64| q(g) - flow.at(equivalent + 2.0 / 3.0 * g * q(g));
            // q g stays below its limit for large g, so the flow stress is reached in the end
            let mut most = 1.0 / moduli.shear;
            while excess(most) > 0.0 {
                most *= 4.0;
            }
            let g = root(excess, most)?;
            let (mean, rest) = fall(g);
            let (sum, difference, shear) = (sum * mean, difference * rest, xy * rest);
            let (x, y) = (0.5 * (sum + difference), 0.5 * (sum - difference));
            let across = -(x + y) / 3.0;
            let strain = [x + across, y + across, across, shear, 0.0, 0.0].map(|s| g * s);
            Some((strain, 2.0 / 3.0 * g * q(g)))
        }
    }
}

/// `sqrt(3/2 s : s)` of a deviator.
fn equivalent_stress(s: &[f64; 6]) -> f64 {
    let normal: f64 = s[..3].iter().map(|c| c * c).sum();
    let shear: f64 = s[3..].iter().map(|c| 2.0 * c * c).sum();
    (1.5 * (normal + shear)).sqrt()
}

/// Root between 0 and `most` of a function that falls through zero, by the Illinois method; `None`
/// when it is not positive at 0.
fn root(f: impl Fn(f64) -> f64, most: f64) -> Option<f64> {
    let (mut low, mut f_low) = (0.0, f(0.0));
    let scale = f_low;
    if f_low <= 0.0 {
        return None;
    }
    let (mut high, mut f_high) = (most, f(most));
    let mut x = high;
    for _ in 0..100 {
        x = (low * f_high - high * f_low) / (f_high - f_low);
        let value = f(x);
        if value.abs() <= 1e-14 * scale || high - low <= 1e-16 * most {
            break;
        }
        if value > 0.0 {
            (low, f_low) = (x, value);
            f_high *= 0.5;
        } else {
            (high, f_high) = (x, value);
            f_low *= 0.5;
        }
    }
    Some(x)
}

/// Inelastic strain of a point (xx, yy, zz, xy, yz, zx) and equivalent plastic strain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inelastic {
    /// Plastic and annealed strain.
    pub strain: [f64; 6],
    /// Equivalent plastic strain since the last annealing.
    pub equivalent: f64,
}

/// How the points of a body are strained.
#[derive(Clone, Copy)]
pub(super) struct Strains<'a> {
    /// Displacement gradients.
    pub(super) gradients: &'a [Matrix3<f64>],
    /// Finite kinematics.
    pub(super) finite: bool,
    pub(super) plane_strain: bool,
}

impl Strains<'_> {
    /// Elastic stress of a strain (xx, yy, zz, xy, yz, zx) alone, Pa.
    fn elastic_stress(&self, law: &Point, strain: &[f64; 6]) -> [f64; 6] {
        let law = law.of_change();
        law.components(&law.stress(&symmetric(strain)), self.plane_strain)
    }

    /// Stress of a point by its law, Pa: unrotated.
    fn stress(&self, point: usize, law: &Point) -> [f64; 6] {
        let stress = law.material_stress(&self.gradients[point], self.finite);
        law.components(&stress, self.plane_strain)
    }
}

/// Plastic state of a body: as of the last step, and as of the displacement that is tried.
#[derive(Debug)]
pub struct Plasticity {
    /// Which components the stress has.
    pub stress_state: StressState,
    yield_stress: Vec<Property>,
    hardening_modulus: Vec<Option<Property>>,
    table: Option<Table>,
    /// K.
    pub annealing_temperature: Option<f64>,
    /// Yield stress and hardening modulus of each point now, Pa.
    flow: Vec<[f64; 2]>,
    /// At the end of the last step.
    pub settled: Vec<Inelastic>,
    /// For the displacement that was tried last.
    pub tried: Vec<Inelastic>,
    /// Of points that flow in the displacement that was linearised about: how their inelastic strain
    /// follows their strain.
    tangents: Vec<(usize, Matrix6<f64>)>,
    /// Change of the inelastic strain of each point with a change of the displacement, by the tangents.
    pub(super) change: Vec<[f64; 6]>,
}

impl Plasticity {
    /// Takes the properties of the materials of a body.
    ///
    /// # Errors
    /// A material without yield stress, a hardening table that falls or does not start at 0.
    pub fn of(
        section: &PlasticitySection,
        setup: &Setup<'_>,
        body: usize,
        plane: Plane,
    ) -> Result<Self, SetupError> {
        let this = setup.body(body);
        let table = match &section.hardening {
            None => None,
            Some(HardeningTable {
                plastic_strain,
                factor,
            }) => {
                let falls = factor.windows(2).any(|w| w[1] < w[0]);
                if falls || plastic_strain.first() != Some(&0.0) {
                    return Err(SetupError::value(
                        "plasticity.hardening",
                        "the hardening curve falls or does not start at 0",
                        "`plastic_strain` increasing from 0, `factor` never falling",
                    ));
                }
                let table = Table::new(plastic_strain.clone(), factor.clone());
                Some(table.map_err(|e| SetupError::other("plasticity.hardening", e))?)
            }
        };
        let points = this.points.len();
        Ok(Plasticity {
            stress_state: StressState::of(this.dimension, plane),
            yield_stress: setup.property(body, "yield_stress")?,
            hardening_modulus: this
                .materials
                .iter()
                .map(|m| m.get("hardening_modulus").cloned())
                .collect(),
            table,
            annealing_temperature: section.annealing_temperature,
            flow: vec![[0.0; 2]; points],
            settled: vec![Inelastic::default(); points],
            tried: vec![Inelastic::default(); points],
            tangents: Vec::new(),
            change: vec![[0.0; 6]; points],
        })
    }

    /// Evaluates yield stress and hardening modulus at the temperature of each point, K.
    pub fn set_temperature(&mut self, material: &[u16], temperature: Option<&[f64]>) {
        let (yields, moduli) = (&self.yield_stress, &self.hardening_modulus);
        let points = self.flow.par_iter_mut().zip(material).enumerate();
        points.for_each(|(i, (flow, &m))| {
            let t = temperature.map_or(0.0, |t| t[i]);
            let modulus = moduli[m as usize].as_ref();
            *flow = [
                yields[m as usize].at(t, 0.0),
                modulus.map_or(0.0, |h| h.at(t, 0.0)),
            ];
        });
    }

    /// Returns the stresses of all points to the flow stress: sets the tried state. `law` gives the
    /// elastic law of a point, `strains` how it is strained.
    pub(super) fn try_strains(
        &mut self,
        strains: Strains<'_>,
        law: impl Fn(usize) -> Point + Sync,
    ) {
        let Self {
            stress_state,
            table,
            flow,
            settled,
            tried,
            ..
        } = self;
        tried.par_iter_mut().enumerate().for_each(|(i, tried)| {
            let [yield_stress, modulus] = flow[i];
            let flow = FlowStress {
                yield_stress,
                modulus,
                table: table.as_ref(),
            };
            *tried = settled[i];
            let law = law(i).with_inelastic(*stress_state, settled[i].strain);
            let trial = strains.stress(i, &law);
            let equivalent = settled[i].equivalent;
            let moved = return_to_yield(*stress_state, &trial, &law.moduli, flow, equivalent);
            if let Some((strain, increment)) = moved {
                tried
                    .strain
                    .iter_mut()
                    .zip(strain)
                    .for_each(|(e, de)| *e += de);
                tried.equivalent += increment;
            }
        });
    }

    /// Derivatives of the tried inelastic strains by the strains, of points that flow: of the return to
    /// the flow stress itself (the consistent tangent), by central differences.
    pub(super) fn linearise(&mut self, strains: Strains<'_>, law: impl Fn(usize) -> Point + Sync) {
        /// Step of the differences in yield strains: errors of 1e-8 from the curvature, and less from
        /// the return, which is found to rounding.
        const STEP: f64 = 1e-4;
        let (tried, settled, state) = (&self.tried, &self.settled, self.stress_state);
        let flows = |&i: &usize| tried[i].equivalent > settled[i].equivalent;
        let flowing: Vec<usize> = (0..tried.len()).filter(flows).collect();
        let tangents = flowing.into_par_iter().map(|i| {
            let law = law(i);
            let settled = &settled[i];
            let [yield_stress, modulus] = self.flow[i];
            let flow = FlowStress {
                yield_stress,
                modulus,
                table: self.table.as_ref(),
            };
            let trial = strains.stress(i, &law.with_inelastic(state, settled.strain));
            let step = STEP * yield_stress / (2.0 * law.moduli.shear);
            let returned = |change: &[f64; 6], factor: f64| {
                let stress = std::array::from_fn(|c| trial[c] + factor * change[c]);
                return_to_yield(state, &stress, &law.moduli, flow, settled.equivalent)
                    .map_or([0.0; 6], |(strain, _)| strain)
            };
            let tangent = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|component| {
                let mut unit = [0.0; 6];
                unit[component] = 1.0;
                let stress = strains.elastic_stress(&law, &unit);
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

    /// Stress of each point in the tried state as plastic flow sees it, Pa: unrotated.
    pub(super) fn tried_stress(
        &self,
        strains: Strains<'_>,
        law: impl Fn(usize) -> Point,
    ) -> Vec<[f64; 6]> {
        let stress = |(i, tried): (usize, &Inelastic)| {
            strains.stress(i, &law(i).with_inelastic(self.stress_state, tried.strain))
        };
        self.tried.iter().enumerate().map(stress).collect()
    }

    /// Makes the tried state the settled one; adds the work of the flow, J/m³, to `work`.
    pub fn settle(&mut self, work: &mut [f64]) {
        for (i, work) in work.iter_mut().enumerate() {
            let [yield_stress, modulus] = self.flow[i];
            let flow = FlowStress {
                yield_stress,
                modulus,
                table: self.table.as_ref(),
            };
            let equivalent = self.tried[i].equivalent;
            *work += flow.at(equivalent) * (equivalent - self.settled[i].equivalent);
        }
        self.settled.copy_from_slice(&self.tried);
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
        for (i, settled) in self.settled.iter_mut().enumerate() {
            if temperature[i] < limit {
                continue;
            }
            let relieved = relieved_strain(self.stress_state, &stress[i], &moduli(i));
            let strain = settled.strain.iter_mut().zip(relieved);
            strain.for_each(|(e, de)| *e += de);
            settled.equivalent = 0.0;
        }
    }
}

/// The elastic strain that annealing relieves. Where there is no free direction it is that of the
/// deviator: metal that can flow nowhere keeps its volume, and with it its pressure. To relieve that too
/// would lose percents of a weld pool that cold metal confines, and leave GPa of hydrostatic stress.
fn relieved_strain(state: StressState, stress: &[f64; 6], moduli: &Moduli) -> [f64; 6] {
    let mut strain = elastic_strain(state, stress, moduli);
    if state == StressState::Full {
        let mean = (strain[0] + strain[1] + strain[2]) / 3.0;
        strain[..3].iter_mut().for_each(|e| *e -= mean);
    }
    strain
}

/// Elastic strain of a stress (Pa); in plane stress, of the components in the plane.
fn elastic_strain(state: StressState, stress: &[f64; 6], moduli: &Moduli) -> [f64; 6] {
    let [xx, yy, zz, ..] = *stress;
    let shear = 2.0 * moduli.shear;
    let mut strain = stress.map(|s| s / shear);
    // mean stress, what it strains along each axis
    let (axes, mean, expansion) = match state {
        StressState::Uniaxial => return [xx / moduli.bulk, 0.0, 0.0, 0.0, 0.0, 0.0],
        StressState::Plane => (2, 0.5 * (xx + yy), 0.25 * (xx + yy) / moduli.bulk),
        StressState::Full => {
            let mean = (xx + yy + zz) / 3.0;
            (3, mean, mean / (3.0 * moduli.lame + shear))
        }
    };
    (0..axes).for_each(|a| strain[a] = (stress[a] - mean) / shear + expansion);
    strain
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn annealing_keeps_the_volume_where_no_direction_is_free() {
        let full = moduli(StressState::Full);
        let stress = [90e6, -30e6, 60e6, 10e6, 0.0, 0.0];
        let strain = relieved_strain(StressState::Full, &stress, &full);
        assert!((strain[0] + strain[1] + strain[2]).abs() < 1e-18);
        let deviator = [50e6, -70e6, 20e6, 10e6, 0.0, 0.0];
        for (strain, deviator) in strain.iter().zip(deviator) {
            assert!((strain - deviator / (2.0 * full.shear)).abs() < 1e-15);
        }
        // across a plane in plane stress metal flows freely
        let (state, plane) = (StressState::Plane, moduli(StressState::Plane));
        let all = relieved_strain(state, &stress, &plane);
        assert_eq!(all, elastic_strain(state, &stress, &plane));
    }

    const YIELD: f64 = 250e6;

    fn moduli(state: StressState) -> Moduli {
        let dimension = match state {
            StressState::Uniaxial => 1,
            StressState::Plane => 2,
            StressState::Full => 3,
        };
        Moduli::new(2e11, 0.3, dimension, Plane::Stress)
    }

    /// Stress of an elastic strain in the dimensions of the state.
    fn stress_of(state: StressState, strain: &[f64; 6]) -> [f64; 6] {
        let moduli = moduli(state);
        let mut stress = strain.map(|e| 2.0 * moduli.shear * e);
        let axes = match state {
            StressState::Uniaxial => 1,
            StressState::Plane => 2,
            StressState::Full => 3,
        };
        let trace: f64 = strain[..axes].iter().sum();
        (0..6).for_each(|c| match c < axes {
            true => stress[c] += moduli.lame * trace,
            false if c < 3 || axes == 1 || axes == 2 && c > 3 => stress[c] = 0.0,
            false => {}
        });
        stress
    }

    fn von_mises(stress: &[f64; 6]) -> f64 {
        let mean = stress[..3].iter().sum::<f64>() / 3.0;
        let mut deviator = *stress;
        deviator[..3].iter_mut().for_each(|s| *s -= mean);
        equivalent_stress(&deviator)
    }

    proptest! {
        #[test]
        fn the_returned_stress_lies_on_the_flow_stress(
            strain in prop::array::uniform6(-0.01..0.01f64),
            equivalent in 0.0..0.05f64,
        ) {
            let table = Table::new(vec![0.0, 0.01, 0.1], vec![1.0, 1.2, 1.5]).expect("rows");
            for state in [StressState::Uniaxial, StressState::Plane, StressState::Full] {
                let flow = FlowStress { yield_stress: YIELD, modulus: 2e9, table: Some(&table) };
                let trial = stress_of(state, &strain);
                let moved = return_to_yield(state, &trial, &moduli(state), flow, equivalent);
                let Some((plastic, increment)) = moved else {
                    prop_assert!(von_mises(&trial) <= flow.at(equivalent));
                    continue;
                };
                let relieved = stress_of(state, &plastic);
                let stress: [f64; 6] = std::array::from_fn(|c| trial[c] - relieved[c]);
                let flow_stress = flow.at(equivalent + increment);
                prop_assert!((von_mises(&stress) / flow_stress - 1.0).abs() < 1e-9, "{state:?}");
                let volume: f64 = plastic[..3].iter().sum();
                prop_assert!(volume.abs() < 1e-15);
                // the flow is as large as its equivalent and along the deviator of the result
                let size = equivalent_stress(&plastic) / 1.5;
                prop_assert!((size / increment - 1.0).abs() < 1e-9, "{state:?} {size} {increment}");
                let along: f64 = (0..6).map(|c| {
                    let mean = if c < 3 { stress[..3].iter().sum::<f64>() / 3.0 } else { 0.0 };
                    (if c < 3 { 1.0 } else { 2.0 }) * plastic[c] * (stress[c] - mean)
                }).sum();
                prop_assert!((along / (flow_stress * increment) - 1.0).abs() < 1e-9);
            }
        }

        #[test]
        fn elastic_strains_belong_to_their_stress(strain in prop::array::uniform6(-0.01..0.01f64)) {
            for state in [StressState::Uniaxial, StressState::Plane, StressState::Full] {
                let stress = stress_of(state, &strain);
                let found = elastic_strain(state, &stress, &moduli(state));
                let again = stress_of(state, &found);
                for (a, b) in stress.iter().zip(again) {
                    prop_assert!((a - b).abs() < 1e-12 * 2e11 * 0.01, "{state:?}");
                }
            }
        }
    }
}
