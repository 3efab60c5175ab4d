//! Flux of mass, and the density in the middle of the step.

use perimelt_core::SlotField;
use perimelt_core::family::Mirrored;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::kernels::{FlowInputs, In};
use super::{FlowNow, Fluxes};
use crate::fluid::rates::{POINTS_PER_TASK, Terms};

impl Fluxes {
    /// Sets the flux of mass along an axis of the lattice: `rho v`, or `rho C^T (v - w)` through points that move.
    pub(super) fn set_mass_flux<const D: usize>(
        &mut self,
        axis: usize,
        density: &[f64],
        velocity: &[SlotField],
    ) {
        let (family, mass) = (&self.family, &mut self.mass[axis]);
        let of_point = |axis: usize, point: usize| velocity[axis][self.slot[point] as usize];
        let ghosts = Mirrored::Vector(axis);
        match &self.motion {
            None => {
                let flux = |point: usize| density[point] * of_point(axis, point);
                mass.load(family, flux, ghosts);
            }
            Some(motion) => {
                let flux = |point: usize| {
                    let mapped = &motion.points()[point];
                    let past = |a: usize| of_point(a, point) - mapped.velocity[a];
                    let along = (0..D).map(|a| mapped.cofactors[(a, axis)] * past(a));
                    density[point] * along.sum::<f64>()
                };
                mass.load(family, flux, ghosts);
            }
        }
    }

    /// Finds the flux of mass with this density (kg/m³) and what flows out of each point.
    pub(super) fn find_outflow<const D: usize, const I: usize>(
        &mut self,
        terms: &Terms<'_>,
        density: &[f64],
        velocity: &[SlotField],
    ) {
        let mut slopes = std::mem::take(&mut self.slopes);
        let diffusivity = terms.density_diffusivity(0);
        for axis in 0..D {
            self.set_mass_flux::<D>(axis, density, velocity);
            let mass = self.mass[axis].par_iter();
            if diffusivity > 0.0 && terms.force.is_some() {
                let slope = |i: usize| self.on_lattice(i, terms.density_gradient(i))[axis];
                slopes.load(&self.family, slope, Mirrored::Scalar);
                let slots = mass.zip(&*slopes);
                self.flux[axis].set(slots.map(|(flux, slope)| flux + diffusivity * slope));
            } else {
                self.flux[axis].set(mass.copied());
            }
        }
        self.slopes = slopes;
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match i {
            _ if i < FlowInputs::<D>::DENSITY => &self.flux[i][..],
            _ => &self.density,
        });
        let kernel = In::<D, _>(self.outflow_kernel(terms));
        let mut outflow = std::mem::take(&mut self.outflow);
        self.family.sum(&kernel, inputs, &mut outflow);
        let mut walls = std::mem::take(&mut self.walls);
        let flow = self.at_walls(terms, density, velocity);
        walls.find_flux(&flow);
        drop(flow);
        walls.add_outflow(&mut outflow);
        (self.outflow, self.walls) = (outflow, walls);
    }

    /// Finds density and flux of mass in the middle of the step.
    pub(super) fn find_mass<const D: usize, const I: usize>(&mut self, flow: &FlowNow<'_>) {
        let FlowNow {
            terms,
            velocity,
            density,
        } = *flow;
        self.find_outflow::<D, I>(terms, density, velocity);
        let mut middle = std::mem::take(&mut self.middle_density);
        let half = 0.5 * terms.dt;
        let of_point = |(i, rho): (usize, &f64)| {
            let (full, [outflow], [swept]) = (self.fullness[i], self.outflow[i], self.swept[i]);
            (rho * full - half * outflow) / (full + half * swept)
        };
        let points = density.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK).map(of_point);
        points.fill(&mut middle);
        self.find_outflow::<D, I>(terms, &middle, velocity);
        self.middle_density = middle;
    }
}
