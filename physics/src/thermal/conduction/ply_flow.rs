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
//! with the weights w and e of the bond ([`plies`](crate::thermal::plies)). The parts of a bond between two materials conduct in series:
//!
//! ```text
//! within a layer   2 / |xi| (T_j - T_i) (d_i + d_j) / (d_i / C_i + d_j / C_j)     C = w k2 + e (k1 - k2), d: distance from the other material
//! between layers   2 / |xi| w (T_j - T_i) / (f / k3_i + (1 - f) / k3_j)           f: part of the distance of the layers in the cell of i
//! ```

use perimelt_core::body::Layers;
use perimelt_core::family::Mirrored;
use perimelt_core::material::{EnthalpyCurve, HeatPotential, in_series};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use super::{KernelInputs, Matter};
use crate::plies::turned;
use crate::thermal::interfaces::Interfaces;
use crate::thermal::plies::{ConductingPlies, PlyConductivity};

/// Points per parallel task.
const POINTS_PER_TASK: usize = 4096;

/// The conductivities of plies with their work arrays.
#[derive(Debug)]
pub(super) struct PlyFlow {
    /// By material.
    conductivity: Vec<PlyConductivity>,
    layers: Layers,
    /// Of each conductivity by material; made with the first temperatures.
    potentials: Vec<[HeatPotential; 3]>,
    /// Potentials of k2, of k1 - k2 and of k3, W/m.
    fields: Vec<[f64; 3]>,
    /// Conductivities of the three fields about which the flow is linear, W/(m K).
    slopes: Vec<[f64; 3]>,
    slots: [SlotField; 3],
    /// Where there are several materials.
    parts: Option<Parts>,
}

/// What bonds between two materials take besides potentials.
#[derive(Debug)]
struct Parts {
    /// Distances from other materials in the layer.
    interfaces: Interfaces,
    /// Temperature (K), k2, k1 - k2 and k3 (W/(m K)), material and distance (m).
    fields: Vec<[f64; 6]>,
    slots: [SlotField; 6],
}

/// Heat from the potentials of k2, of k1 - k2 and of k3.
pub(in crate::thermal) struct PlyBonds;

impl BondKernel<3, 1> for PlyBonds {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        let [across, excess, through] = std::array::from_fn(|k| other[k] - own[k]);
        let within = bond.weight * across + bond.dual * excess;
        let between = bond.weight * through;
        let flow = if bond.xi[2] == 0.0 { within } else { between };
        [2.0 * bond.inverse_length * flow]
    }
}

/// Heat from what [`PlyBonds`] takes, and from temperature, k2, k1 - k2, k3, material and distance from other materials.
pub(in crate::thermal) struct MixedPlies;

impl BondKernel<9, 1> for MixedPlies {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 9], other: [f64; 9]) -> [f64; 1] {
        let potentials = |end: &[f64; 9]| [end[0], end[1], end[2]];
        let [same] = PlyBonds.bond(bond, potentials(&own), potentials(&other));
        let conducts = |end: &[f64; 9]| bond.weight * end[4] + bond.dual * end[5];
        let within = in_series([conducts(&own), conducts(&other)], [own[8], other[8]]);
        let parts = [bond.dual, 1.0 - bond.dual];
        let between = bond.weight * in_series([own[6], other[6]], parts);
        let conductance = if bond.xi[2] == 0.0 { within } else { between };
        let flow = 2.0 * bond.inverse_length * conductance * (other[3] - own[3]);
        [if own[7] == other[7] { same } else { flow }]
    }
}

/// Bound of the coefficients of a point's bonds, W/(m³ K), from the largest of the k2, `|k1 - k2|` and k3 of both ends: parts in series conduct
/// at most as much as the better one.
struct LargestOfPlies;

impl BondKernel<3, 1> for LargestOfPlies {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        let [across, excess, through] = std::array::from_fn(|k| own[k].max(other[k]));
        let within = bond.weight.abs() * across + bond.dual.abs() * excess;
        let between = bond.weight * through;
        let sum = if bond.xi[2] == 0.0 { within } else { between };
        [2.0 * bond.inverse_length * sum]
    }
}

impl PlyFlow {
    pub(super) fn new(plies: &ConductingPlies, layers: &Layers) -> PlyFlow {
        let parts = |interfaces: &Interfaces| Parts {
            interfaces: interfaces.clone(),
            fields: Vec::new(),
            slots: Default::default(),
        };
        PlyFlow {
            conductivity: plies.conductivity.clone(),
            layers: layers.clone(),
            potentials: Vec::new(),
            fields: Vec::new(),
            slopes: Vec::new(),
            slots: Default::default(),
            parts: plies.interfaces.as_ref().map(parts),
        }
    }

    pub(super) fn is_constant(&self) -> bool {
        self.conductivity.iter().all(PlyConductivity::is_constant)
    }

    /// Inputs of [`PlyBonds`] or [`MixedPlies`].
    pub(super) fn inputs(&self) -> KernelInputs<'_> {
        let [across, excess, through] = self.slots.each_ref().map(|slots| &slots[..]);
        let Some(parts) = &self.parts else {
            return KernelInputs::Plies([across, excess, through]);
        };
        let [t, k2, k12, k3, material, distance] = parts.slots.each_ref().map(|slots| &slots[..]);
        KernelInputs::PliesOfMaterials([
            across, excess, through, t, k2, k12, k3, material, distance,
        ])
    }

    /// Conductivity of a point of a material along an axis of space at a temperature (K) and liquid fraction, W/(m K).
    pub(super) fn along(
        &self,
        point: usize,
        axis: usize,
        material: u16,
        temperature: f64,
        liquid: f64,
    ) -> f64 {
        let values = self.conductivity[material as usize].at(temperature, liquid);
        self.along_axis(point, axis, values)
    }

    /// Largest conductivity of a point of a material along an axis of space, W/(m K).
    pub(super) fn largest_along(&self, point: usize, axis: usize, material: u16) -> f64 {
        self.along_axis(point, axis, self.conductivity[material as usize].largest())
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
        let (curves, conductivity) = (matter.curves, &self.conductivity);
        if self.potentials.is_empty() {
            let materials = conductivity.iter().zip(curves);
            self.potentials = materials.map(|(k, c)| k.potentials(c)).collect();
        }
        let potentials = &self.potentials;
        let of_point = |(&t, &m): (&f64, &u16)| {
            let of_material = &potentials[m as usize];
            let [along, across, through] = of_material.each_ref().map(|potential| potential.at(t));
            [across, along - across, through]
        };
        let points = temperature.par_iter().zip(matter.material);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.map(of_point).fill(&mut self.fields);
        fill(&mut self.slots, matter.family, &self.fields);
        if let Some(parts) = &mut self.parts {
            parts.load(matter, conductivity, temperature);
        }
    }

    /// Takes the conductivities at temperatures, K, of plies of one material.
    pub(super) fn linearise(&mut self, matter: &Matter<'_>, temperature: &[f64]) {
        let [conductivity] = &self.conductivity[..] else {
            return;
        };
        let curve: &EnthalpyCurve = &matter.curves[0];
        let of_point = |&t: &f64| {
            let [along, across, through] = conductivity.at(t, curve.liquid_fraction(t));
            [across, along - across, through]
        };
        let points = temperature.par_iter().with_min_len(POINTS_PER_TASK);
        points.map(of_point).fill(&mut self.slopes);
    }

    /// Fills the slots for the derivative along a change (K) of the temperatures of [`PlyFlow::linearise`]. Returns false, without an effect, with several materials.
    pub(super) fn load_change(&mut self, matter: &Matter<'_>, change: &[f64]) -> bool {
        if self.conductivity.len() > 1 {
            return false;
        }
        let of_point = |(slopes, change): (&[f64; 3], &f64)| slopes.map(|slope| slope * change);
        let points = self.slopes.par_iter().zip(change);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.map(of_point).fill(&mut self.fields);
        fill(&mut self.slots, matter.family, &self.fields);
        true
    }

    /// Sum of the coefficients of each point's bonds at the largest conductivities, W/(m³ K).
    pub(super) fn largest_row_sums(&self, family: &Family, material: &[u16]) -> Vec<[f64; 1]> {
        let largest = |k: &PlyConductivity| {
            let [_, across, through] = k.largest();
            [across, k.largest_excess(), through]
        };
        let largest: Vec<[f64; 3]> = self.conductivity.iter().map(largest).collect();
        let fields: Vec<[f64; 3]> = material.iter().map(|m| largest[*m as usize]).collect();
        let mut slots: [SlotField; 3] = Default::default();
        fill(&mut slots, family, &fields);
        let mut sums = vec![[0.0]; family.points()];
        let inputs = slots.each_ref().map(|slots| &slots[..]);
        family.sum(&LargestOfPlies, inputs, &mut sums);
        sums
    }
}

impl Parts {
    fn load(&mut self, matter: &Matter<'_>, conductivity: &[PlyConductivity], temperature: &[f64]) {
        let (interfaces, curves) = (&self.interfaces, matter.curves);
        let points = temperature.par_iter().zip(matter.material);
        let points = points.with_min_len(POINTS_PER_TASK).enumerate();
        let of_point = |(point, (&t, &m)): (usize, (&f64, &u16))| {
            let liquid = curves[m as usize].liquid_fraction(t);
            let [along, across, through] = conductivity[m as usize].at(t, liquid);
            let distance = interfaces.of(point);
            [t, across, along - across, through, f64::from(m), distance]
        };
        points.map(of_point).fill(&mut self.fields);
        fill(&mut self.slots, matter.family, &self.fields);
    }
}

/// Copies fields of points to slots.
fn fill<const N: usize>(slots: &mut [SlotField; N], family: &Family, fields: &[[f64; N]]) {
    for (number, slots) in slots.iter_mut().enumerate() {
        slots.load(
            family,
            |point: usize| fields[point][number],
            Mirrored::Scalar,
        );
    }
}
