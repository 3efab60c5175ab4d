//! Forces of pressure and viscosity, and the momentum that the flux of mass carries.

use nalgebra::Vector3;
use perimelt_core::family::ByRules;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{BondKernel, SlotField, World};
use rayon::prelude::*;

use super::kernels::{Carry, FlowInputs, In, Push, ViscosityInputs};
use super::{FlowNow, Fluxes};
use crate::fluid::rates::{POINTS_PER_TASK, Terms};

impl Fluxes {
    /// Finds force and work of viscosity.
    pub(super) fn find_viscosity<const D: usize, const I: usize, const O: usize>(
        &mut self,
        kernel: impl BondKernel<I, O>,
        flow: &FlowNow<'_>,
    ) {
        let FlowNow {
            terms,
            velocity,
            density,
        } = *flow;
        let mut rows = std::mem::take(&mut self.diffusion);
        rows.resize(self.points() * O, 0.0);
        let stretch = self.motion.as_ref().map(|m| &m.stretch);
        let first = ViscosityInputs::<D>::STRETCH;
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match stretch {
            _ if i < ViscosityInputs::<D>::VISCOSITY => &velocity[i][..],
            Some(stretch) if i >= first => &stretch[i - first],
            _ => &self.viscosity,
        });
        let (sums, _) = rows.as_chunks_mut::<O>();
        self.family.sum(&kernel, inputs, sums);
        let mut walls = std::mem::take(&mut self.walls);
        let flow = self.at_walls(terms, density, velocity);
        walls.find_slopes(&flow);
        drop(flow);
        walls.add_viscosity::<D, I, O>(&kernel, sums);
        (self.diffusion, self.walls) = (rows, walls);
    }

    /// Finds the momentum that flows out of each point with this velocity (m/s).
    pub(super) fn find_carried<const D: usize, const I: usize>(
        &mut self,
        terms: &Terms<'_>,
        velocity: &[Vector3<f64>],
    ) {
        for (axis, slots) in self.carried_velocity.iter_mut().enumerate() {
            let along = |point: usize| velocity[point][axis];
            slots.load(&self.family, along, ByRules(terms.rules, axis));
        }
        let mut rows = std::mem::take(&mut self.carried);
        rows.resize(self.points() * D, 0.0);
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match i {
            _ if i < FlowInputs::<D>::DENSITY => &self.flux[i][..],
            _ if i < FlowInputs::<D>::VELOCITY => &self.density,
            _ => &self.carried_velocity[i - FlowInputs::<D>::VELOCITY],
        });
        let kernel = In::<D, _>(Carry(self.outflow_kernel(terms)));
        let (sums, _) = rows.as_chunks_mut::<D>();
        self.family.sum(&kernel, inputs, sums);
        let mut walls = std::mem::take(&mut self.walls);
        walls.add_carried(velocity, sums);
        (self.carried, self.walls) = (rows, walls);
    }

    pub(super) fn find_push<const D: usize>(&mut self) {
        let mut rows = std::mem::take(&mut self.push);
        rows.resize(self.points() * D, 0.0);
        let kernel = Push {
            inverse: self.inverse(),
        };
        let (sums, _) = rows.as_chunks_mut::<D>();
        match &self.motion {
            None => self.family.sum(&kernel, [&self.pressure], sums),
            Some(motion) => {
                let times = |row: &SlotField| {
                    let slots = row.par_iter().zip(&*self.pressure);
                    let mut product = SlotField::default();
                    product.set(slots.map(|(c, p)| c * p));
                    product
                };
                let rows: Vec<SlotField> = motion.cofactors.iter().map(times).collect();
                self.push_by::<D>(&rows, sums);
            }
        }
        let own = |point: usize| [self.pressure[self.slot[point] as usize]];
        self.walls
            .add_pressure(&kernel, own, self.complete.moment, sums);
        self.push = rows;
    }

    pub(super) fn carry_in<const D: usize, const I: usize>(
        &mut self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) {
        self.find_carried::<D, I>(terms, velocity);
        let mut middle = std::mem::take(&mut self.middle_velocity);
        let half = 0.5 * time * terms.acceleration_fraction;
        let of_point =
            |(i, v): (usize, &Vector3<f64>)| v + half * self.acceleration(terms, i, v, density[i]);
        let points = velocity.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK).map(of_point);
        points.fill(&mut middle);
        self.find_carried::<D, I>(terms, &middle);
        self.middle_velocity = middle;
    }

    pub(super) fn give<const D: usize, const I: usize, const O: usize>(
        &mut self,
        viscosity: impl BondKernel<I, O>,
        world: &World,
        time: f64,
    ) {
        let mut walls = std::mem::take(&mut self.walls);
        let push = Push {
            inverse: self.inverse(),
        };
        let (pressure, moment) = (&self.pressure, self.complete.moment);
        let own = |point: usize| [pressure[self.slot[point] as usize]];
        walls.give(world, time, |wall, n| {
            let viscous = wall.held_part::<D, I, O>(n, &viscosity);
            let pressure: [f64; D] = wall.pressure_part(n, &push, &own, moment);
            let mut force = Vector3::zeros();
            (0..D).for_each(|a| force[a] = pressure[a] + viscous[a]);
            force
        });
        self.walls = walls;
    }
}
