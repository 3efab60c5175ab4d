//! Forces of the cells on their corners, their tangent, and stresses and energies of the points.

use nalgebra::Matrix3;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::super::classical::Point;
use super::super::moduli::Moduli;
use super::super::points::At;
use super::super::solid::{EnergyKind, Stiffness, StrainKind};
use super::kernels::{CellState, Elastic, gather, sums};
use super::{About, CHUNK, Staggered};

impl<const D: usize> Staggered<D> {
    /// Evaluates H and the means.
    pub(super) fn load_gradient(&mut self) {
        let (cell, corners) = (self.cell, &self.corners.of_point);
        let (displacement, spring) = (&self.displacement[..], &self.spring);
        let values = self.gradient.cells_mut();
        let points = self.states.par_iter_mut().zip(values).zip(corners);
        let points = points.zip(spring).with_min_len(CHUNK);
        points.for_all(|(((state, (value, is_loose)), corners), spring)| {
            let (slope, sum) = sums::<D>(displacement, corners);
            *value = match is_loose {
                true => Matrix3::zeros(),
                false => cell.gradient(&slope),
            };
            (0..D).for_each(|a| state.mean[a] = spring / f64::from(1 << D) * sum[a]);
        });
    }

    /// First Piola-Kirchhoff stress of a point by its law, Pa.
    fn piola(&self, point: usize) -> Matrix3<f64> {
        let (base, gradient) = (&self.base, &self.gradient.values[point]);
        match base.law_points_of(&self.gradient, point) {
            Some(points) => points.piola(&base.elastic, At::point(point, gradient)),
            None => {
                let law = base.law_of(&self.gradient, point, StrainKind::Elastic);
                law.piola(gradient, base.is_finite())
            }
        }
    }

    /// Change of [`Staggered::piola`] with that of the gradient.
    fn change_of_piola(&self, point: usize) -> Matrix3<f64> {
        // without material, or a point of another process whose corners are not known
        if self.gradient.is_loose(point) {
            return Matrix3::zeros();
        }
        let (base, change) = (&self.base, &self.gradient.values[point]);
        if let Some(points) = base.law_points_of(&self.gradient, point) {
            let about = At::point(point, &points.about[point]);
            return points.tangent(&base.elastic, about, change);
        }
        let About {
            deformation,
            stress,
        } = &self.about[point];
        let strain = Point::strain(&(deformation.transpose() * change), false);
        let law = base.law_of(&self.gradient, point, StrainKind::Change);
        change * stress + deformation * law.stress(&strain)
    }

    /// Loads the states of the cells by a stress of each point, after [`Staggered::load_gradient`] and
    /// [`Staggered::follow_modes`].
    fn load_states(
        &mut self,
        strain: StrainKind,
        stress: impl Fn(&Self, usize) -> Matrix3<f64> + Sync,
    ) {
        let mut states = std::mem::take(&mut self.states);
        let points = states.par_iter_mut().enumerate().with_min_len(CHUNK);
        points.for_all(|(i, state)| {
            let mut stress = stress(self, i);
            if let Some(of_modes) = self.stress_of_modes(i, strain) {
                stress += of_modes;
            }
            let gradient = &self.gradient.values[i];
            state.slope = self.cell.slope(gradient, &stress, self.spring[i]);
        });
        self.states = states;
    }

    /// Loads the states of the cells of a linear body by the elastic stiffness, or by that of the linearised state.
    pub(super) fn load_linear_states(&mut self, kind: Stiffness) {
        let (cell, corners) = (self.cell, &self.corners.of_point);
        let (displacement, spring) = (&self.displacement[..], &self.spring);
        let (elastic, gradient) = (&self.base.elastic, &self.gradient);
        let reliefs = match kind {
            Stiffness::Tangent => &self.reliefs[..],
            Stiffness::Elastic => &[],
        };
        let chunks = self.states.par_chunks_mut(CHUNK).enumerate();
        chunks.for_all(|(chunk, states)| {
            let first = chunk * CHUNK;
            for (i, state) in (first..).zip(&mut *states) {
                if gradient.is_loose(i) {
                    *state = CellState::ZERO;
                    continue;
                }
                let Moduli { lame, shear, .. } = elastic.moduli(i);
                let sums = sums::<D>(displacement, &corners[i]);
                *state = cell.elastic_state(sums, Elastic { lame, shear }, spring[i]);
            }
            let [start, end] = [first, first + states.len()]
                .map(|bound| reliefs.partition_point(|(point, _)| *point < bound));
            for (point, relief) in &reliefs[start..end] {
                let (slope, _) = sums::<D>(displacement, &corners[*point]);
                let relief = cell.relief(&slope, relief);
                let rows = states[point - first].slope.iter_mut().zip(relief);
                rows.for_each(|(row, relief)| (0..D).for_each(|b| row[b] -= relief[b]));
            }
        });
    }

    /// Linearises the points about the gradient and the trial state.
    pub(super) fn linearise_points(&mut self, damping: f64) {
        self.load_gradient();
        self.base.linearise(Some(&self.gradient), damping);
        if let Some(plasticity) = &self.base.plasticity
            && self.has_linear_points()
        {
            let points = self.base.elastic.strained(&self.gradient);
            plasticity.reliefs(points).fill(&mut self.reliefs);
        }
        if !self.base.is_finite() || self.base.law_points.is_some() {
            return;
        }
        let about = |point: usize| {
            let gradient = &self.gradient.values[point];
            let law = self.base.law_of(&self.gradient, point, StrainKind::Elastic);
            About {
                deformation: Matrix3::identity() + gradient,
                stress: law.material_stress(gradient, true),
            }
        };
        let mut states = std::mem::take(&mut self.about);
        let points = (0..self.states.len()).into_par_iter();
        points.map(about).collect_into_vec(&mut states);
        self.about = states;
    }

    /// Whether the tangent is the elastic stiffness but for plastic flow.
    pub(super) fn has_linear_points(&self) -> bool {
        !self.base.is_finite() && self.base.law_points.is_none()
    }

    /// Loads the states of the cells by the change of the stresses that were linearised.
    pub(super) fn load_tangent_states(&mut self) {
        self.load_gradient();
        self.follow_modes(StrainKind::Change);
        if let Some(plasticity) = &mut self.base.plasticity {
            let (about, values) = (&self.about, &self.gradient.values);
            plasticity.follow(|i| about[i].deformation.transpose() * values[i]);
        }
        self.load_states(StrainKind::Change, Self::change_of_piola);
    }

    /// Sum of the forces of the cells on each corner, N/m³, times a factor; with that of the free modes, or without.
    pub(super) fn gather(&self, factor: f64, with_modes: bool, out: &mut [f64]) {
        let (out, _) = out.as_chunks_mut::<3>();
        let nodes = out.par_iter_mut().enumerate().with_min_len(CHUNK);
        let mode_load: &[[f64; 3]] = if with_modes { &self.mode_load } else { &[] };
        nodes.for_all(|(corner, out)| {
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

    pub(super) fn evaluate_force(&mut self, out: &mut [f64]) {
        self.load_force_states();
        self.gather(-1.0, true, out);
    }

    /// Loads the states of cells under the displacement, with the trial state that follows from it, after
    /// [`Staggered::load_gradient`].
    pub(super) fn load_force_states(&mut self) {
        self.base.try_gradients(&self.gradient);
        self.follow_modes(StrainKind::Elastic);
        self.load_states(StrainKind::Elastic, Self::piola);
    }

    pub(super) fn evaluate_stress(&mut self) {
        let mut tensors = std::mem::take(&mut self.base.tensors);
        let points = tensors.par_iter_mut().enumerate();
        points.for_all(|(i, tensor)| {
            let gradient = &self.gradient.values[i];
            *tensor = self.base.spatial_stress(&self.gradient, i, gradient);
        });
        self.base.tensors = tensors;
    }

    pub(super) fn evaluate_energy(&mut self, kind: EnergyKind) {
        let mut energy = std::mem::take(&mut self.base.energy);
        let points = energy.par_iter_mut().enumerate();
        points.for_all(|(i, energy)| {
            let gradient = &self.gradient.values[i];
            let modes = self.energy_of_modes(i, kind);
            let [density, conjugate] = self.base.energy_density(&self.gradient, i, gradient, kind);
            *energy = [density + modes, conjugate];
        });
        self.base.energy = energy;
    }
}
