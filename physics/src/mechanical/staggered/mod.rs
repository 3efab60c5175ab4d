//! Staggered solids: the displacement lives at the corners of the cells of a lattice, everything else at the points.
//!
//! ```text
//! H_i = sum_q U_q (x) phi_q,  phi_q = K^-1 d_q,  K = sum_q d_q (x) d_q     q: the 2^d corners of the cell, d_q = X_q - x_i
//! z_q = U_q - mean(U) - H d_q - z*_q - z0_q
//! W   = sum_i V_i [ psi(H_i) + 1/2 g_i sum_q |z_q|^2 ],   g = G mu / h^2
//! F_q = sum_i V_i [ sigma_i phi_q + g_i z_q ]                              i: the points around the corner
//! u_i = mean of U over the corners
//! ```
//!
//! The limit of a correspondence solid at its smallest horizon: a point has the family of its corners, one strain and one
//! stress, and H is exact for quadratic displacements also at bare surfaces. The springs g against modes without strain follow
//! the *shear* modulus. See docs/theory/mechanics.md, "Staggered solids", for G, for the displacement z* of eigenstrains
//! that vary linearly, and for z0 of material that was deposited or annealed. Related to finite elements of one point with
//! stabilisation, Flanagan & Belytschko (1981), Int. J. Numer. Methods Eng. 17, 679-706.
//!
//! Small displacements in equilibrium on lattices; bonds do not exist, and do not break.

mod births;
mod checks;
mod corners;
#[cfg(test)]
mod growth_tests;
mod kernels;
mod solid;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::body::Lattice;
use perimelt_core::{Body, Face, Family};
use rayon::prelude::*;

pub(super) use births::Births;
pub(super) use checks::{check, lattice};
pub use corners::Corners;

use super::base::{Properties, SolidBase};
use super::classical::Point;
use super::gradient::Gradient;
use super::moduli::Moduli;
use super::nodes::Nodes;
use super::points::{At, LawPoints};
use super::solid::{Constitution, EnergyKind, StrainKind};
use kernels::{
    Amplitudes, Cell, CellState, Elastic, MODES, amplitudes, gather, mode_at, modes, sums,
};

/// Points swept by one task.
const CHUNK: usize = 512;

/// Stiffness of the springs against modes without strain.
#[derive(Clone, Copy, Debug)]
pub enum Springs {
    /// A plate that is one cell thick has its exact bending stiffness.
    Bending,
    /// G.
    Factor(f64),
}

impl Springs {
    /// G mu of a point, Pa. The strip of a plate that is one cell thick bends by `E' kappa^2 h^2 / 24` in energy per volume, with the
    /// plate modulus `E' = 4 mu (lame + mu) / (lame + 2 mu)`, and its springs by `2^d G mu kappa^2 h^2 / 32`.
    fn modulus(self, moduli: &Moduli, dimension: usize) -> f64 {
        let Moduli { lame, shear, .. } = *moduli;
        match self {
            Springs::Bending => {
                let plate = 4.0 * shear * (lame + shear) / (lame + 2.0 * shear);
                4.0 / 3.0 * plate / f64::from(1 << dimension)
            }
            Springs::Factor(factor) => factor * shear,
        }
    }
}

/// A staggered solid of `D` dimensions.
#[derive(Debug)]
pub struct Staggered<const D: usize> {
    base: SolidBase,
    corners: Arc<Corners>,
    cell: Cell,
    springs: Springs,
    /// By component and corner, m.
    displacement: Vec<[f64; 3]>,
    /// H of each point.
    gradient: Gradient,
    /// g of each point, N/m⁵; zero without material.
    spring: Vec<f64>,
    /// Sum of g around each corner.
    corner_spring: Vec<f64>,
    /// Modes at which points are free of stress, but for those of the eigenstrain; empty if there are none.
    relieved: Vec<Amplitudes>,
    /// The points behind the faces of a cell across which the eigenstrain is continuous; `u32::MAX` where there is none.
    neighbours: Vec<[u32; 6]>,
    /// `sum g (z* + z0)` of each corner, N/m³; empty if it is zero.
    mode_load: Vec<[f64; 3]>,
    /// Whether `mode_load` is that of the present eigenstrain, springs and relieved modes.
    is_mode_load_current: bool,
    states: Vec<CellState<D>>,
    blocks: Vec<[f64; 6]>,
}

impl<const D: usize> Staggered<D> {
    /// The solid of a body on a lattice, whose points follow a law or the linear one.
    pub(super) fn new(
        body: &Body,
        lattice: &Lattice,
        constitution: Constitution,
        springs: Springs,
        law: Option<LawPoints>,
    ) -> Self {
        let properties = Properties {
            bonds_shear: true,
            has_symmetric_plastic_tangent: true,
        };
        let corners = Arc::new(Corners::new(body, lattice));
        let (points, nodes) = (body.points.len(), corners.position.len());
        // a body without bonds
        let mut base = SolidBase::new(body, Arc::new(Family::default()), constitution, properties);
        base.horizons.fill(lattice.spacing);
        base.nodes = Nodes::Corners(corners.clone());
        base.set_law(law);
        let behind = |point: usize, face: Face| {
            let other = body.neighbour(point, face)?;
            let material = &body.material_of_point;
            (material[other] == material[point]).then_some(other as u32)
        };
        let neighbours = (0..points).map(|point| {
            Face::ALL.map(|face| match face.axis() < D {
                true => behind(point, face).unwrap_or(u32::MAX),
                false => u32::MAX,
            })
        });
        let mut this = Staggered {
            cell: Cell::new(lattice.spacing, D),
            springs,
            displacement: vec![[0.0; 3]; nodes],
            gradient: Gradient::of_cells(points, D),
            spring: vec![0.0; points],
            corner_spring: vec![0.0; nodes],
            relieved: Vec::new(),
            neighbours: neighbours.collect(),
            mode_load: Vec::new(),
            is_mode_load_current: true,
            states: vec![CellState::ZERO; points],
            blocks: vec![[0.0; 6]; nodes],
            corners,
            base,
        };
        this.load_springs();
        this
    }

    fn load_springs(&mut self) {
        let square = self.cell.spacing * self.cell.spacing;
        for (point, spring) in self.spring.iter_mut().enumerate() {
            *spring = match self.gradient.is_loose(point) {
                true => 0.0,
                false => self.springs.modulus(&self.base.elastic.moduli(point), D) / square,
            };
        }
        let spring = &self.spring;
        let corners = self.corner_spring.iter_mut().enumerate();
        corners.for_each(|(corner, sum)| {
            let around = self.corners.around(corner, &[]);
            *sum = around.map(|(_, point)| spring[point]).sum();
        });
        self.is_mode_load_current = false;
    }

    /// Modes of the displacement that a linear eigenstrain with the gradient of the present one makes, m:
    /// `u* = e d + (grad e . d) d - 1/2 grad e |d|^2` at the corners.
    fn eigenstrain_modes(&self, point: usize) -> Amplitudes {
        let eigenstrain = &self.base.elastic.eigenstrain;
        let value = |face: usize| {
            let other = self.neighbours[point][face];
            let is_there = other != u32::MAX && !self.gradient.is_loose(other as usize);
            is_there.then(|| eigenstrain[other as usize] - eigenstrain[point])
        };
        let quarter = 0.25 * self.cell.spacing * self.cell.spacing;
        let slope = |axis: usize| {
            let difference = match (value(2 * axis), value(2 * axis + 1)) {
                (Some(below), Some(above)) => 0.5 * (above - below),
                (Some(below), None) => -below,
                (None, Some(above)) => above,
                (None, None) => 0.0,
            };
            quarter * difference / self.cell.spacing
        };
        let slopes: [f64; D] = std::array::from_fn(slope);
        let mut found = Amplitudes::default();
        for (mode, amplitude) in found.iter_mut().enumerate().take(modes(D).min(3)) {
            for (a, amplitude) in amplitude.iter_mut().enumerate().take(D) {
                // the other axis of the mode
                let other = (0..D).find(|b| MODES[mode] == 1 << a | 1 << b && *b != a);
                *amplitude = other.map_or(0.0, |b| slopes[b]);
            }
        }
        found
    }

    /// Modes at which a point is free of stress.
    fn free_modes(&self, point: usize) -> Amplitudes {
        let mut free = self.eigenstrain_modes(point);
        if let Some(relieved) = self.relieved.get(point) {
            for (free, relieved) in free.iter_mut().zip(relieved) {
                (0..D).for_each(|a| free[a] += relieved[a]);
            }
        }
        free
    }

    /// Lets points have material or none. The stress of those that had material before does not change, also where they have
    /// other neighbours now.
    fn set_present(&mut self, present: &[bool]) {
        let points = 0..present.len();
        let modes = |this: &Self| points.clone().map(|p| this.eigenstrain_modes(p)).collect();
        let was_loose: Vec<bool> = points.clone().map(|p| self.gradient.is_loose(p)).collect();
        let before: Vec<Amplitudes> = modes(self);
        self.gradient.set_present(present);
        let after: Vec<Amplitudes> = modes(self);
        self.relieved.resize(present.len(), Amplitudes::default());
        for point in points {
            let relieved = self.relieved[point].as_flattened_mut();
            if was_loose[point] || !present[point] {
                relieved.fill(0.0);
                continue;
            }
            let changes = before[point]
                .iter()
                .zip(&after[point])
                .flat_map(|(b, a)| b.iter().zip(a));
            relieved
                .iter_mut()
                .zip(changes)
                .for_each(|(z, (before, after))| *z += before - after);
        }
        self.load_springs();
    }

    /// Evaluates what the springs contribute because of the modes at which points are free of stress.
    fn follow_modes(&mut self) {
        if self.is_mode_load_current {
            return;
        }
        self.is_mode_load_current = true;
        let points = (0..self.spring.len()).into_par_iter();
        let free: Vec<Amplitudes> = points.map(|point| self.free_modes(point)).collect();
        let is_zero = |free: &Amplitudes| free.iter().flatten().all(|z| *z == 0.0);
        self.mode_load.clear();
        if free.par_iter().all(is_zero) {
            return;
        }
        let load = |corner: usize| {
            let mut sum = [0.0; 3];
            for (q, point) in self.corners.around(corner, &[]) {
                for (mode, amplitude) in free[point].iter().enumerate().take(modes(D)) {
                    let factor = self.spring[point] * mode_at(mode, q);
                    (0..D).for_each(|a| sum[a] += factor * amplitude[a]);
                }
            }
            sum
        };
        let nodes = (0..self.corner_spring.len()).into_par_iter();
        self.mode_load = nodes.map(load).collect();
    }

    /// Evaluates H and the means.
    fn load_gradient(&mut self) {
        let (cell, corners) = (self.cell, &self.corners.of_point);
        let (displacement, spring) = (&self.displacement[..], &self.spring);
        let values = self.gradient.cells_mut();
        let points = self.states.par_iter_mut().zip(values).zip(corners);
        let points = points.zip(spring).with_min_len(CHUNK);
        points.for_each(|(((state, (value, is_loose)), corners), spring)| {
            let (slope, sum) = sums::<D>(displacement, corners);
            *value = match is_loose {
                true => Matrix3::zeros(),
                false => cell.gradient(&slope),
            };
            (0..D).for_each(|a| state.mean[a] = spring / f64::from(1 << D) * sum[a]);
        });
    }

    fn point(&self, point: usize, strain: StrainKind) -> Point {
        self.base.law_of(&self.gradient, point, strain)
    }

    /// Evaluates stresses and loads the states of the cells, after [`Staggered::load_gradient`].
    fn load_states(&mut self, strain: StrainKind) {
        let mut states = std::mem::take(&mut self.states);
        let points = states.par_iter_mut().enumerate().with_min_len(CHUNK);
        points.for_each(|(i, state)| {
            let gradient = &self.gradient.values[i];
            let stress = match self.base.law_points_of(&self.gradient, i) {
                Some(points) => self.stress_by(points, i, strain),
                None => self.point(i, strain).piola(gradient, false),
            };
            state.slope = self.cell.slope(gradient, &stress, self.spring[i]);
        });
        self.states = states;
    }

    /// Stress of a point by its law, or the change of it.
    fn stress_by(&self, points: &LawPoints, point: usize, strain: StrainKind) -> Matrix3<f64> {
        let (gradient, elastic) = (&self.gradient.values[point], &self.base.elastic);
        let at = |gradient| At {
            point,
            mirror: [1.0; 3],
            gradient,
        };
        match strain {
            StrainKind::Change => points.tangent(elastic, at(&points.about[point]), gradient),
            StrainKind::Elastic | StrainKind::Total => points.piola(elastic, at(gradient)),
        }
    }

    /// Loads the states of the cells by the elastic stiffness.
    fn load_elastic_states(&mut self) {
        let (cell, corners) = (self.cell, &self.corners.of_point);
        let (displacement, spring) = (&self.displacement[..], &self.spring);
        let (elastic, gradient) = (&self.base.elastic, &self.gradient);
        let points = self.states.par_iter_mut().enumerate().with_min_len(CHUNK);
        points.for_each(|(i, state)| {
            if gradient.is_loose(i) {
                *state = CellState::ZERO;
                return;
            }
            let Moduli { lame, shear, .. } = elastic.moduli(i);
            let sums = sums::<D>(displacement, &corners[i]);
            *state = cell.elastic_state(sums, Elastic { lame, shear }, spring[i]);
        });
    }

    /// Takes what flowing points give way from the states of their cells.
    fn subtract_flow(&mut self) {
        let Some(plasticity) = &mut self.base.plasticity else {
            return;
        };
        let (cell, corners) = (self.cell, &self.corners.of_point);
        let displacement = &self.displacement[..];
        plasticity.follow(|i| cell.gradient(&sums::<D>(displacement, &corners[i]).0));
        let state = plasticity.stress_state;
        for i in plasticity.flowing() {
            let law = self
                .base
                .elastic
                .strained(&self.gradient)
                .law(i)
                .of_change();
            let law = law.with_inelastic(state, plasticity.change[i]);
            let stress = law.stress(&Matrix3::zeros());
            let relief = cell.slope::<D>(&Matrix3::zeros(), &stress, 0.0);
            for (row, relief) in self.states[i].slope.iter_mut().zip(relief) {
                (0..D).for_each(|b| row[b] += relief[b]);
            }
        }
    }

    /// Sum of the forces of the cells on each corner, N/m³, times a factor; with that of the free modes, or without.
    fn gather(&self, factor: f64, with_modes: bool, out: &mut [f64]) {
        let (out, _) = out.as_chunks_mut::<3>();
        let nodes = out.par_iter_mut().enumerate().with_min_len(CHUNK);
        let mode_load: &[[f64; 3]] = if with_modes { &self.mode_load } else { &[] };
        nodes.for_each(|(corner, out)| {
            let sum = gather(&self.states, &self.corners.points[corner]);
            let (u, spring) = (&self.displacement[corner], self.corner_spring[corner]);
            *out = [0.0; 3];
            for a in 0..D {
                out[a] = factor * (sum[a] + spring * u[a]);
            }
            if let Some(load) = mode_load.get(corner) {
                (0..D).for_each(|a| out[a] -= factor * load[a]);
            }
        });
    }

    fn evaluate_force(&mut self, out: &mut [f64]) {
        self.load_force_states();
        self.follow_modes();
        self.gather(-1.0, true, out);
    }

    /// Loads the states of cells under the displacement, with the flow that follows from it.
    fn load_force_states(&mut self) {
        self.base.try_gradients(&self.gradient);
        self.load_states(StrainKind::Elastic);
    }

    fn evaluate_stress(&mut self) {
        let mut tensors = std::mem::take(&mut self.base.tensors);
        let points = tensors.par_iter_mut().enumerate();
        points.for_each(|(i, tensor)| {
            let gradient = &self.gradient.values[i];
            if let Some(points) = self.base.law_points_of(&self.gradient, i) {
                *tensor = points.spatial_stress(&self.base.elastic, i, gradient);
                return;
            }
            let point = self.point(i, StrainKind::Elastic);
            let stress = point.piola(gradient, false);
            *tensor = point.components(&stress, self.base.elastic.is_plane_strain());
        });
        self.base.tensors = tensors;
    }

    /// Energy density of the springs, J/m³, without the modes at which the point is free of stress, or of all modes.
    fn energy_of_modes(&self, point: usize, kind: EnergyKind) -> f64 {
        let mut modes = amplitudes::<D>(&self.displacement, &self.corners.of_point[point]);
        if kind == EnergyKind::Elastic {
            let free = self.free_modes(point);
            for (mode, free) in modes.iter_mut().zip(free) {
                (0..D).for_each(|a| mode[a] -= free[a]);
            }
        }
        let square: f64 = modes.iter().flatten().map(|z| z * z).sum();
        0.5 * self.spring[point] * f64::from(1 << D) * square
    }

    fn evaluate_energy(&mut self, kind: EnergyKind) {
        let mut energy = std::mem::take(&mut self.base.energy);
        let points = energy.par_iter_mut().enumerate();
        points.for_each(|(i, energy)| {
            let gradient = &self.gradient.values[i];
            let modes = self.energy_of_modes(i, kind);
            let elastic = &self.base.elastic;
            let law = self.base.law_points_of(&self.gradient, i);
            *energy = match (kind, law) {
                (EnergyKind::Elastic, Some(points)) => {
                    [points.energy(elastic, i, gradient) + modes, 0.0]
                }
                (EnergyKind::Total, Some(points)) => {
                    let [density, conjugate] = points.total_energy(elastic, i, gradient);
                    [density + modes, conjugate]
                }
                (EnergyKind::Elastic, None) => {
                    let point = self.point(i, StrainKind::Elastic);
                    [point.energy_of(&point.piola(gradient, false)) + modes, 0.0]
                }
                (EnergyKind::Total, None) => {
                    let point = self.point(i, StrainKind::Total);
                    let [density, conjugate] = self.base.total_energy(i, &point, gradient);
                    [density + modes, conjugate]
                }
            };
        });
        self.base.energy = energy;
    }
}
