//! Conduction of plies by the heat potentials of their three conductivities.
//!
//! The heat of a bond is linear in the conductivities k1 and k2 along and across the fibres, or, between layers, in k3 through the
//! thickness. Each is integrated over the temperatures between the ends of the bond, as in bodies that conduct alike in all directions:
//!
//! ```text
//! within a layer   2 / |xi| ( w [Theta_2] + e [Theta_1 - Theta_2] )     Theta_a(T) = int k_a dT,  [.]: difference of the ends
//! between layers   2 / |xi| w [Theta_3]
//! ```
//!
//! with the weights w and e of the bond ([`plies`](crate::thermal::plies)).

use perimelt_core::body::Layers;
use perimelt_core::family::Mirrored;
use perimelt_core::material::{EnthalpyCurve, HeatPotential};
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use super::Matter;
use crate::plies::turned;
use crate::thermal::plies::PlyConductivity;

/// Points per parallel task.
const POINTS_PER_TASK: usize = 4096;

/// The conductivities of plies with their work arrays.
#[derive(Debug)]
pub(super) struct PlyFlow {
    conductivity: PlyConductivity,
    layers: Layers,
    /// Of each conductivity; made with the first temperatures.
    potentials: Option<[HeatPotential; 3]>,
    /// Potentials of k2, of k1 - k2 and of k3, W/m.
    fields: Vec<[f64; 3]>,
    slots: [SlotField; 3],
}

/// Heat from the potentials of k2, of k1 - k2 and of k3.
pub(in crate::thermal) struct PlyBonds;

impl BondKernel<3, 1> for PlyBonds {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        let [across, excess, through] = std::array::from_fn(|k| other[k] - own[k]);
        let by_weight = if bond.xi[2] == 0.0 { across } else { through };
        [2.0 * bond.inverse_length * (bond.weight * by_weight + bond.dual * excess)]
    }
}

/// Bound of the coefficients of a point's bonds, W/(m³ K), from the largest of the k2, `|k1 - k2|` and k3.
struct LargestOfPlies([f64; 3]);

impl BondKernel<0, 1> for LargestOfPlies {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 1] {
        let [across, excess, through] = self.0;
        let of_weight = if bond.xi[2] == 0.0 { across } else { through };
        let sum = bond.weight.abs() * of_weight + bond.dual.abs() * excess;
        [2.0 * bond.inverse_length * sum]
    }
}

impl PlyFlow {
    pub(super) fn new(conductivity: PlyConductivity, layers: &Layers) -> PlyFlow {
        PlyFlow {
            conductivity,
            layers: layers.clone(),
            potentials: None,
            fields: Vec::new(),
            slots: Default::default(),
        }
    }

    pub(super) fn is_constant(&self) -> bool {
        self.conductivity.is_constant()
    }

    /// Inputs of [`PlyBonds`].
    pub(super) fn inputs(&self) -> [&[f64]; 3] {
        self.slots.each_ref().map(|slots| &slots[..])
    }

    /// Conductivity of a point along an axis of space at a temperature (K) and liquid fraction, W/(m K).
    pub(super) fn along(&self, point: usize, axis: usize, temperature: f64, liquid: f64) -> f64 {
        let values = self.conductivity.at(temperature, liquid);
        self.along_axis(point, axis, values)
    }

    /// Largest conductivity of a point along an axis of space, W/(m K).
    pub(super) fn largest_along(&self, point: usize, axis: usize) -> f64 {
        self.along_axis(point, axis, self.conductivity.largest())
    }

    fn along_axis(&self, point: usize, axis: usize, [along, across, through]: [f64; 3]) -> f64 {
        let (sin, cos) = self.layers.angle(point).sin_cos();
        match axis {
            2 => through,
            _ => turned([cos, sin], [along, across])[(axis, axis)],
        }
    }

    /// Fills the slots from temperatures, K.
    pub(super) fn load(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        let curves = matter.curves;
        let new = || self.conductivity.potentials(&curves[0]);
        let potentials = self.potentials.get_or_insert_with(new);
        let of_point = |&t: &f64| {
            let [along, across, through] = potentials.each_ref().map(|potential| potential.at(t));
            [across, along - across, through]
        };
        let points = temperature.par_iter().with_min_len(POINTS_PER_TASK);
        points.map(of_point).collect_into_vec(&mut self.fields);
        self.fill(matter.family);
    }

    /// Fills the slots for the derivative along a change (K) of the temperature (K).
    pub(super) fn load_change(&mut self, matter: &Matter<'_>, temperature: &[f64], change: &[f64]) {
        let (curve, conductivity): (&EnthalpyCurve, _) = (&matter.curves[0], &self.conductivity);
        let of_point = |(&t, &change): (&f64, &f64)| {
            let [along, across, through] = conductivity.at(t, curve.liquid_fraction(t));
            [across * change, (along - across) * change, through * change]
        };
        let points = temperature.par_iter().zip(change);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.map(of_point).collect_into_vec(&mut self.fields);
        self.fill(matter.family);
    }

    fn fill(&mut self, family: &Family) {
        let fields = &self.fields;
        for (number, slots) in self.slots.iter_mut().enumerate() {
            slots.load(
                family,
                |point: usize| fields[point][number],
                Mirrored::Scalar,
            );
        }
    }

    /// Sum of the coefficients of each point's bonds at the largest conductivities, W/(m³ K).
    pub(super) fn largest_row_sums(&self, family: &Family) -> Vec<[f64; 1]> {
        let mut sums = vec![[0.0]; family.points()];
        let [_, across, through] = self.conductivity.largest();
        let kernel = LargestOfPlies([across, self.conductivity.largest_excess(), through]);
        family.sum(&kernel, [], &mut sums);
        sums
    }
}
