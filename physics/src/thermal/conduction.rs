//! The conduction operator: heat flow between the points of a body.

use perimelt_core::family::LayerRule;
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Bond, BondKernel, BrokenBonds, Family};
use rayon::prelude::*;

/// The conduction operator with its work arrays.
#[derive(Debug)]
pub(super) struct Conduction {
    conductivity: Vec<Property>,
    uniform: Option<f64>,
    temperature_slots: Vec<f64>,
    conductivity_slots: Vec<f64>,
    conductivity_field: Vec<f64>,
    /// Bonds that conduct no more.
    pub(super) broken: Option<BrokenBonds>,
    /// Heat that flowed to each point when last asked for, W/m³.
    pub(super) rate: Vec<[f64; 1]>,
}

/// Conduction with one conductivity, W/(m K); the micro-conductivity is `2 k / M`, and weights
/// of bonds hold the `1 / M`.
struct Uniform {
    conductivity: f64,
}

impl BondKernel<1, 1> for Uniform {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [2.0 * self.conductivity * bond.mean() * bond.inverse_length * (other - own)]
    }
}

/// Conduction with a conductivity at each point; the bond takes the mean of its ends.
struct Varying;

impl BondKernel<2, 1> for Varying {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; 1] {
        let twice_mean = own[1] + other[1];
        [twice_mean * bond.mean() * bond.inverse_length * (other[0] - own[0])]
    }
}

/// Sum of the coefficients of a point's bonds, W/(m³ K).
struct RowSum;

impl BondKernel<1, 1> for RowSum {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [bond.mean() * bond.inverse_length * (own + other)]
    }
}

impl Conduction {
    pub(super) fn new(family: &Family, conductivity: Vec<Property>, points: usize) -> Self {
        let uniform = Property::common(&conductivity);
        let varying = if uniform.is_some() { 0 } else { points };
        Conduction {
            conductivity,
            uniform,
            temperature_slots: vec![0.0; family.slots()],
            conductivity_slots: vec![0.0; if varying == 0 { 0 } else { family.slots() }],
            conductivity_field: vec![0.0; varying],
            broken: None,
            rate: vec![[0.0]; points],
        }
    }

    /// Fills the slots from a temperature field (K) and evaluates the conductivities.
    pub(super) fn load(
        &mut self,
        family: &Family,
        rules: &[LayerRule],
        temperature: &[f64],
        material: &[u16],
        curves: &[EnthalpyCurve],
    ) {
        family.scatter(temperature, 1, 0, &mut self.temperature_slots);
        family.fill_layers(rules, 0, &mut self.temperature_slots);
        if self.uniform.is_none() {
            let properties = &self.conductivity;
            let values = self
                .conductivity_field
                .par_iter_mut()
                .zip(temperature)
                .zip(material);
            values.for_each(|((k, &t), &m)| {
                let m = m as usize;
                *k = properties[m].at(t, curves[m].liquid_fraction(t));
            });
            family.scatter(&self.conductivity_field, 1, 0, &mut self.conductivity_slots);
            family.fill_layers(&[], 0, &mut self.conductivity_slots);
        }
    }

    /// Heat that flows to each point, W/m³, from what was loaded.
    pub(super) fn flow(&mut self, family: &Family) {
        let (slots, broken) = (&self.temperature_slots[..], self.broken.as_ref());
        match self.uniform {
            Some(k) => {
                let kernel = Uniform { conductivity: k };
                family.sum_unbroken(&kernel, [slots], broken, &mut self.rate);
            }
            None => {
                let inputs = [slots, &self.conductivity_slots];
                family.sum_unbroken(&Varying, inputs, broken, &mut self.rate);
            }
        }
    }

    /// Heat that flows in through layers with prescribed values, W, from what was loaded.
    pub(super) fn inflow(&self, family: &Family, volume: &[f64]) -> f64 {
        let mut total = 0.0;
        let add = |point: usize, [rate]: [f64; 1]| total += volume[point] * rate;
        let slots = &self.temperature_slots[..];
        match self.uniform {
            Some(k) => {
                let kernel = Uniform { conductivity: k };
                family.sum_from_layers(&kernel, [slots], add);
            }
            None => {
                family.sum_from_layers(&Varying, [slots, &self.conductivity_slots], add);
            }
        }
        total
    }

    /// Whether the flow is linear in the temperature.
    pub(super) fn is_linear(&self) -> bool {
        self.uniform.is_some() || self.conductivity.iter().all(Property::is_constant)
    }

    /// Sum of the coefficients of each point's bonds at the largest conductivities, W/(m³ K).
    pub(super) fn largest_row_sums(&self, family: &Family, material: &[u16]) -> Vec<[f64; 1]> {
        let largest: Vec<f64> = self
            .conductivity
            .iter()
            .map(|k| max_abs(&k.values()))
            .collect();
        let conductivity: Vec<f64> = material.iter().map(|&m| largest[m as usize]).collect();
        let mut slots = vec![0.0; family.slots()];
        family.scatter(&conductivity, 1, 0, &mut slots);
        family.fill_layers(&[], 0, &mut slots);
        let mut sums = vec![[0.0]; conductivity.len()];
        family.sum(&RowSum, [&slots], &mut sums);
        sums
    }
}
