//! Stresses and energies of the points.

use nalgebra::Matrix3;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::Correspondence;
use super::kernels::SquaredExtension;
use crate::mechanical::solid::EnergyKind;

impl Correspondence {
    /// `sum_j w |u_j - u_i|^2` of each point, m².
    fn squared_extension(&self) -> Vec<[f64; 1]> {
        let mut extension = vec![[0.0]; self.base.energy.len()];
        let inputs = std::array::from_fn(|axis| self.inputs.along(axis));
        self.base.family.sum_unbroken(
            &SquaredExtension,
            inputs,
            self.base.broken(),
            &mut extension,
        );
        extension
    }

    /// The sum of [`Correspondence::squared_extension`] without the displacement of prescribed strains that are not uniform.
    fn squared_elastic_extension(&self) -> Vec<[f64; 1]> {
        let mut extension = vec![[0.0]; self.base.energy.len()];
        let displacement = std::array::from_fn(|axis| self.inputs.along(axis));
        let bonds = self.base.bonds();
        self.gradient
            .stress_free
            .squared_extension(bonds, displacement, &mut extension);
        extension
    }

    /// Energy density of the stabilisation, J/m³: `sum_j w |z|^2 = sum_j w |u_j - u_i|^2 - H : H K`, with K the inverse
    /// of its inverse.
    fn energy_of_modes(&self, i: usize, gradient: &Matrix3<f64>, extension: &[[f64; 1]]) -> f64 {
        let mut shape = self.gradient.inverse_shape[i];
        (self.base.dimension..3).for_each(|a| shape[(a, a)] = 1.0);
        // a loose point has no shape tensor; it has no springs either
        let affine = shape
            .try_inverse()
            .map_or(0.0, |shape| gradient.dot(&(gradient * shape)));
        0.5 * self.spring(i) * (extension[i][0] - affine).max(0.0)
    }

    pub(super) fn evaluate_elastic_gradient(&mut self) {
        let (gradient, finite) = (&self.gradient, self.base.elastic.finite);
        let points = (0..self.force_state.len()).into_par_iter();
        let values = points.map(|i| gradient.elastic(i, finite));
        values.fill(&mut self.elastic_gradient);
    }

    pub(super) fn evaluate_stress(&mut self) {
        let finite = self.base.elastic.finite;
        let mut tensors = std::mem::take(&mut self.base.tensors);
        for (i, tensor) in tensors.iter_mut().enumerate() {
            let gradient = self.gradient.elastic(i, finite);
            *tensor = self.base.spatial_stress(&self.gradient, i, &gradient);
        }
        self.base.tensors = tensors;
    }

    pub(super) fn evaluate_total_energy(&mut self) {
        let extension = self.squared_extension();
        let mut energy = std::mem::take(&mut self.base.energy);
        for (i, energy) in energy.iter_mut().enumerate() {
            let gradient = &self.gradient.values[i];
            let [density, conjugate] =
                (self.base).energy_density(&self.gradient, i, gradient, EnergyKind::Total);
            let modes = self.energy_of_modes(i, gradient, &extension);
            *energy = [density + modes, conjugate];
        }
        self.base.energy = energy;
    }

    pub(super) fn evaluate_elastic_energy(&mut self) {
        let finite = self.base.elastic.finite;
        let extension = match self.has_spring_forces() {
            true => self.squared_elastic_extension(),
            false => self.squared_extension(),
        };
        let mut energy = std::mem::take(&mut self.base.energy);
        for (i, energy) in energy.iter_mut().enumerate() {
            let gradient = self.gradient.elastic(i, finite);
            let [density, _] =
                (self.base).energy_density(&self.gradient, i, &gradient, EnergyKind::Elastic);
            let of_modes = match finite {
                true => &self.gradient.values[i],
                false => &gradient,
            };
            let modes = self.energy_of_modes(i, of_modes, &extension);
            *energy = [density + modes, 0.0];
        }
        self.base.energy = energy;
    }
}
