//! Modes of the displacement without a gradient: those at which points are free of stress, and the springs against the others.
//!
//! In finite kinematics the modes at which a point is free of stress are carried by its deformation gradient,
//!
//! ```text
//! W = 1/2 g sum_q |z_q - F (z*_q + z0_q)|^2
//! ```
//!
//! so that a rotation of the body changes no energy; the derivative by F is a stress.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::super::solid::{EnergyKind, StrainKind};
use super::Staggered;
use super::kernels::{Amplitudes, MODES, amplitudes, mode_at, modes};

impl<const D: usize> Staggered<D> {
    /// Modes of the displacement that a linear eigenstrain with the gradient of the present one makes, m:
    /// `u* = e d + (grad e . d) d - 1/2 grad e |d|^2` at the corners.
    pub(super) fn eigenstrain_modes(&self, point: usize) -> Amplitudes {
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
        if let Some(relieved) = self.base.relieved.modes.get(point) {
            for (free, relieved) in free.iter_mut().zip(relieved) {
                (0..D).for_each(|a| free[a] += relieved[a]);
            }
        }
        free
    }

    /// What carries the modes at which a point is free of stress: its deformation gradient or, of a change, that of the
    /// displacement.
    fn carrier(&self, point: usize, strain: StrainKind) -> Matrix3<f64> {
        let gradient = self.gradient.values[point];
        match strain {
            StrainKind::Change => gradient,
            StrainKind::Elastic | StrainKind::Total => Matrix3::identity() + gradient,
        }
    }

    /// [`Staggered::free_modes`] in space, of the gradient that was evaluated.
    pub(super) fn carried_modes(&self, point: usize) -> Amplitudes {
        let free = self.free_modes(point);
        match self.base.is_finite() {
            true => carried(&self.carrier(point, StrainKind::Elastic), &free),
            false => free,
        }
    }

    /// Amplitudes of the present displacement.
    pub(super) fn amplitudes(&self, point: usize) -> Amplitudes {
        amplitudes::<D>(&self.displacement, &self.corners.of_point[point])
    }

    /// Lets a point be free of stress in the modes of the displacement that was set.
    pub(super) fn relieve(&mut self, point: usize) {
        let mut modes = self.amplitudes(point);
        if self.base.is_finite() {
            let deformation = self.carrier(point, StrainKind::Elastic);
            // a point that is turned inside out is no longer relieved
            let Some(back) = deformation.try_inverse() else {
                return;
            };
            modes = carried(&back, &modes);
        }
        let of_eigenstrain = self.eigenstrain_modes(point);
        let relieved = self.base.relieved.modes[point].iter_mut();
        for (mode, relieved) in relieved.enumerate() {
            (0..D).for_each(|a| relieved[a] = modes[mode][a] - of_eigenstrain[mode][a]);
        }
    }

    /// Evaluates what the springs contribute because of the modes at which points are free of stress, after
    /// [`Staggered::load_gradient`].
    pub(super) fn follow_modes(&mut self, strain: StrainKind) {
        let finite = self.base.is_finite();
        if self.base.relieved.is_load_current && !finite {
            return;
        }
        if !self.base.relieved.is_load_current {
            let points = (0..self.spring.len()).into_par_iter();
            let free: Vec<Amplitudes> = points.map(|point| self.free_modes(point)).collect();
            let is_zero = |free: &Amplitudes| free.iter().flatten().all(|z| *z == 0.0);
            self.free = if free.par_iter().all(is_zero) {
                Vec::new()
            } else {
                free
            };
            self.base.relieved.is_load_current = true;
        }
        let mut loads = std::mem::take(&mut self.mode_load);
        loads.clear();
        if !self.free.is_empty() {
            let load = |corner: usize| {
                let mut sum = [0.0; 3];
                for (q, point) in self.corners.around(corner, &[]) {
                    let free = match finite {
                        true => carried(&self.carrier(point, strain), &self.free[point]),
                        false => self.free[point],
                    };
                    for (mode, amplitude) in free.iter().enumerate().take(modes(D)) {
                        let factor = self.spring[point] * mode_at(mode, q);
                        (0..D).for_each(|a| sum[a] += factor * amplitude[a]);
                    }
                }
                sum
            };
            let nodes = (0..self.corner_spring.len()).into_par_iter();
            nodes.map(load).fill(&mut loads);
        }
        self.mode_load = loads;
        if !finite {
            self.free = Vec::new();
        }
    }

    /// Stress by which the springs resist a deformation that carries the modes at which a point is free of stress, Pa;
    /// `None` without such modes, or in linear kinematics.
    pub(super) fn stress_of_modes(&self, point: usize, strain: StrainKind) -> Option<Matrix3<f64>> {
        let free = self.free.get(point)?;
        let relative = carried(&self.carrier(point, strain), free);
        let modes = self.amplitudes(point);
        let factor = f64::from(1 << D) * self.spring[point];
        let products = modes.iter().zip(relative).zip(free);
        let sum = products.map(|((mode, carried), free)| {
            let [mode, carried, free] = [*mode, carried, *free].map(Vector3::from);
            (carried - mode) * free.transpose()
        });
        Some(factor * sum.sum::<Matrix3<f64>>())
    }

    /// Energy density of the springs, J/m³, without the modes at which the point is free of stress, or of all modes.
    pub(super) fn energy_of_modes(&self, point: usize, kind: EnergyKind) -> f64 {
        let mut modes = self.amplitudes(point);
        if kind == EnergyKind::Elastic {
            let free = self.carried_modes(point);
            for (mode, free) in modes.iter_mut().zip(free) {
                (0..D).for_each(|a| mode[a] -= free[a]);
            }
        }
        let square: f64 = modes.iter().flatten().map(|z| z * z).sum();
        0.5 * self.spring[point] * f64::from(1 << D) * square
    }
}

/// Modes under a gradient.
fn carried(gradient: &Matrix3<f64>, modes: &Amplitudes) -> Amplitudes {
    modes.map(|mode| (gradient * Vector3::from(mode)).into())
}
