//! What the solvers ask of a staggered solid.

use perimelt_core::family::{AxisPlane, LayerRule};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Spring;
use rayon::prelude::*;

use super::super::base::SolidBase;
use super::super::classical::COMPONENTS;
use super::super::deformation::Deformation;
use super::super::fracture::{FractureState, NewBreaks};
use super::super::moduli::Moduli;
use super::super::solid::{Evaluated, PointStates, Solid, Stiffness, StressKind, Wanted};
use super::corners::sign;
use super::kernels::{Amplitudes, CellState, Elastic, mode_at, modes};
use super::{CHUNK, Staggered};

impl<const D: usize> Solid for Staggered<D> {
    fn base(&self) -> &SolidBase {
        &self.base
    }

    fn base_mut(&mut self) -> &mut SolidBase {
        &mut self.base
    }

    fn set_points(&mut self, states: PointStates<'_>) {
        let PointStates {
            moduli,
            eigenstrain,
            stress_free,
            present,
        } = states;
        if let Some(present) = present {
            self.set_present(present);
        }
        if let Some(moduli) = moduli
            && self.base.set_moduli(moduli)
        {
            self.load_springs();
        }
        if let Some(eigenstrain) = eigenstrain {
            self.base.relieved.is_load_current &= !self.base.elastic.set_eigenstrain(eigenstrain);
        }
        if let Some(stress_free) = stress_free {
            self.base.elastic.set_stress_free(stress_free);
        }
    }

    fn set_displacement(&mut self, displacement: &[f64], _rules: &[LayerRule]) {
        let (nodes, _) = displacement.as_chunks::<3>();
        self.displacement.copy_from_slice(nodes);
    }

    fn deformation(&mut self) -> Deformation<'_> {
        self.load_gradient();
        Deformation::Gradients(&self.base, &self.gradient.values)
    }

    fn evaluate(&mut self, wanted: Wanted<'_>) -> Evaluated<'_> {
        let Wanted {
            force,
            stress,
            energy,
            gradient,
        } = wanted;
        self.load_gradient();
        if let Some(out) = force {
            self.evaluate_force(out);
        }
        match stress {
            Some(StressKind::Spatial) => self.evaluate_stress(),
            Some(StressKind::Material) => self.base.evaluate_tried_stress(Some(&self.gradient)),
            Some(StressKind::Conjugate) => self.base.evaluate_conjugate_stress(&self.gradient),
            None => {}
        }
        if let Some(kind) = energy {
            self.evaluate_energy(kind);
        }
        Evaluated {
            stress: self.base.stress_of(stress),
            energy: self.base.energy_of(energy),
            gradient: if gradient { &self.gradient.values } else { &[] },
            smoothing: &[],
        }
    }

    fn linearise(&mut self, damping: f64) {
        self.linearise_points(damping);
    }

    fn stiffness(&mut self, kind: Stiffness, out: &mut [f64]) {
        if kind == Stiffness::Tangent && !self.has_linear_points() {
            self.load_tangent_states();
            self.gather(1.0, self.base.is_finite(), out);
            return;
        }
        self.load_linear_states(kind);
        self.gather(1.0, false, out);
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        let square = self.cell.weight * self.cell.weight;
        // the part of the displacement of a corner that is neither mean nor gradient
        let modes = f64::from(1 << D);
        let left = (modes - 1.0 - D as f64) / modes;
        let mut blocks = std::mem::take(&mut self.blocks);
        let nodes = blocks.par_iter_mut().enumerate().with_min_len(CHUNK);
        nodes.for_all(|(corner, block)| {
            *block = [0.0; 6];
            for (q, point) in self.corners.around(corner, &[]) {
                if self.gradient.is_loose(point) {
                    continue;
                }
                let Moduli { lame, shear, .. } = self.base.elastic.moduli(point);
                let isotropic = square * shear * D as f64 + left * self.spring[point];
                for (entry, (a, b)) in block.iter_mut().zip(COMPONENTS) {
                    if a < D && b < D {
                        *entry += square * (lame + shear) * sign(q, a) * sign(q, b);
                        *entry += if a == b { isotropic } else { 0.0 };
                    }
                }
            }
        });
        self.blocks = blocks;
        &self.blocks
    }

    fn couplings(&self, corner: usize, receive: &mut dyn FnMut(Spring)) {
        /// Places of the corners of the cells around a corner, relative to it.
        const PLACES: usize = 27;
        // cells that share two corners have one spring between them, unless a crack gives each a corner of its own
        let mut springs: [Option<Spring>; PLACES] = [None; PLACES];
        for (q, point) in self.corners.around(corner, &[]) {
            if self.gradient.is_loose(point) {
                continue;
            }
            let Moduli { lame, shear, .. } = self.base.elastic.moduli(point);
            let elastic = Elastic { lame, shear };
            for (r, &other) in self.corners.of(point).iter().enumerate() {
                if r == q {
                    continue;
                }
                let spring = Spring {
                    stiffness: self.cell.coupling::<D>([q, r], elastic, self.spring[point]),
                    to: other as usize,
                    scale: [1.0; 3],
                };
                let along = |axis: usize| 1 + (r >> axis & 1) - (q >> axis & 1);
                let place = (0..D).fold(0, |place, axis| 3 * place + along(axis));
                match &mut springs[place] {
                    Some(sum) if sum.to == spring.to => sum.stiffen(&spring.stiffness),
                    other => {
                        let other = other.replace(spring);
                        other.into_iter().for_each(&mut *receive);
                    }
                }
            }
        }
        springs.into_iter().flatten().for_each(receive);
    }

    /// The largest frequency of a single cell, which that of no body of such cells exceeds, whatever is held or missing
    /// (docs/theory/mechanics.md): its corners move along `d_q`, or by a mode without strain.
    fn largest_frequency(&mut self, density: &[f64], _rules: &[LayerRule]) -> f64 {
        let square = self.cell.spacing * self.cell.spacing;
        let of_point = |(point, density): (usize, &f64)| {
            let moduli = self.base.elastic.moduli(point);
            let strain = 4.0 / square * (D as f64 * moduli.bulk).max(2.0 * moduli.shear);
            let modes = f64::from(1 << D) * self.springs.modulus(&moduli, D) / square;
            strain.max(modes) / density
        };
        let squares = density.iter().enumerate().map(of_point);
        (squares.fold(0.0, f64::max) * self.base.elastic_law.steepest).sqrt()
    }

    fn relieve_modes(&mut self, is_relieved: &dyn Fn(usize) -> bool) {
        let modes = &mut self.base.relieved.modes;
        modes.resize(self.spring.len(), Amplitudes::default());
        self.load_gradient();
        for point in (0..self.spring.len()).filter(|p| is_relieved(*p)) {
            self.relieve(point);
        }
        self.base.relieved.is_load_current = false;
    }

    fn replace_fracture_state(&mut self, _state: FractureState) -> Option<FractureState> {
        None
    }

    fn break_bonds(&mut self, _fraction: f64, _damage: &mut [f64]) -> NewBreaks {
        NewBreaks::default()
    }

    /// The force of the cells above the plane of corners that is nearest, on the corners in it.
    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_gradient();
        self.load_force_states();
        let AxisPlane { axis, at } = plane;
        let is_in_plane = |corner: &usize| {
            let distance = at - self.corners.position[*corner][axis];
            distance > -0.5 * self.cell.spacing && distance <= 0.5 * self.cell.spacing
        };
        for corner in (0..self.displacement.len()).filter(is_in_plane) {
            let around = || {
                let points = self.corners.around(corner, &[]);
                points.filter(|(_, point)| !self.gradient.is_loose(*point))
            };
            let below = || around().filter(|(q, _)| sign(*q, axis) > 0.0);
            let share = 1.0 / below().count() as f64;
            let mut force = [0.0; 3];
            for (q, point) in around().filter(|(q, _)| sign(*q, axis) < 0.0) {
                let on_corner = self.force_of_cell(point, q, corner);
                (0..D).for_each(|a| force[a] -= on_corner[a]);
            }
            below().for_each(|(_, point)| receive(point, force.map(|f| share * f)));
        }
    }
}

impl<const D: usize> Staggered<D> {
    /// Force density of a cell against the displacement of one of its corners, N/m³.
    fn force_of_cell(&self, point: usize, q: usize, corner: usize) -> [f64; D] {
        let CellState { slope, mean } = &self.states[point];
        let free = self.carried_modes(point);
        std::array::from_fn(|a| {
            let along: f64 = (0..D).map(|b| slope[a][b] * sign(q, b)).sum();
            let modes: f64 = (0..modes(D)).map(|m| free[m][a] * mode_at(m, q)).sum();
            along - mean[a] + self.spring[point] * (self.displacement[corner][a] - modes)
        })
    }
}
