//! Flux of mass, and the density in the middle of the step.

use rayon::prelude::*;

use super::Fluxes;
use super::kernels::In;
use crate::fluid::rates::{POINTS_PER_TASK, Terms};

impl Fluxes {
    /// Sets the flux of mass along an axis of the lattice: `rho v`, or `rho C^T (v - w)` through points that move.
    pub(super) fn set_mass_flux<const D: usize>(
        &mut self,
        axis: usize,
        work: &mut Vec<f64>,
        density: &[f64],
        velocity: &[Vec<f64>],
    ) {
        work.clear();
        let points = density.iter().zip(&self.slot);
        match &self.motion {
            None => work.extend(points.map(|(rho, slot)| rho * velocity[axis][*slot as usize])),
            Some(motion) => {
                let points = points.zip(motion.points());
                work.extend(points.map(|((rho, slot), mapped)| {
                    let past = |a: usize| velocity[a][*slot as usize] - mapped.velocity[a];
                    let along = (0..D).map(|a| mapped.cofactors[(a, axis)] * past(a));
                    rho * along.sum::<f64>()
                }));
            }
        }
        let mass = &mut self.mass[axis];
        mass.resize(self.family.slots(), 0.0);
        self.family.scatter(work, 1, 0, mass);
        self.family.fill_layers_turning(mass, |a| a == axis);
    }

    /// Finds the flux of mass with this density (kg/m³) and what flows out of each point.
    pub(super) fn find_outflow<const D: usize, const I: usize>(
        &mut self,
        terms: &Terms<'_>,
        density: &[f64],
        velocity: &[Vec<f64>],
    ) {
        let mut work = std::mem::take(&mut self.work);
        let diffusivity = terms.density_diffusivity(0);
        for axis in 0..D {
            self.set_mass_flux::<D>(axis, &mut work, density, velocity);
            let mut flux = std::mem::take(&mut self.flux[axis]);
            flux.clone_from(&self.mass[axis]);
            if diffusivity > 0.0 && terms.force.is_some() {
                let slope = |i| self.on_lattice(i, terms.density_gradient(i))[axis];
                work.clear();
                work.extend((0..density.len()).map(slope));
                let mut slopes = Vec::new();
                self.family.load((&work, 1), 0, &[], &mut slopes);
                let slots = flux.iter_mut().zip(&slopes);
                slots.for_each(|(flux, slope)| *flux += diffusivity * slope);
            }
            self.flux[axis] = flux;
        }
        self.work = work;
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match i {
            _ if i < D => &self.flux[i][..],
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
    pub(super) fn find_mass<const D: usize, const I: usize>(
        &mut self,
        terms: &Terms<'_>,
        density: &[f64],
        velocity: &[Vec<f64>],
    ) {
        self.find_outflow::<D, I>(terms, density, velocity);
        let mut middle = std::mem::take(&mut self.middle_density);
        let half = 0.5 * terms.dt;
        let of_point = |(i, rho): (usize, &f64)| {
            let (full, [outflow], [swept]) = (self.fullness[i], self.outflow[i], self.swept[i]);
            (rho * full - half * outflow) / (full + half * swept)
        };
        let points = density.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK).map(of_point);
        points.collect_into_vec(&mut middle);
        self.find_outflow::<D, I>(terms, &middle, velocity);
        self.middle_density = middle;
    }
}
