//! Rates of the conservative form at points of a lattice that rest or follow walls of any shape.
//!
//! The points lie on a lattice, whose families are completed by mirrored layers behind faces and by the points of bodies that
//! are walls ([`ImmersedFlow`]). With `A = a I` of a complete family, the force of the pressure and the flux of mass between two
//! points are
//!
//! ```text
//! F_ij = -w/a (p_i + p_j) xi                                              N/m³ per m³
//! N_ij =  w/a [(m_i + m_j) . xi - 2 D (rho_j - rho_i - (s_i + s_j)/2 . xi)],   m = rho* v
//! rho' = rho - dt sum_j N_ij V_j
//! v'   = v + dt / rho' [F + viscosity + v sum_j N_ij V_j - sum_j N_ij (v_i* + v_j*)/2 V_j]
//! ```
//!
//! with the density diffusion D, the slope s of the hydrostatic density, and values in the middle of the step marked by a
//! star, as in [`super::convection`]. Each is opposite at the two ends of a bond: mass and momentum are kept to rounding, and
//! since `sum_j w xi V_j = 0` the flux of mass is the adjoint of the force of the pressure, so that the work of the pressure is
//! the energy of compression. Uniform fields stay uniform. Viscosity is pairwise as in [`super::conservative`].
//!
//! A wall that moves displaces fluid. The points of the lattice keep their places and their weight in the sums, but the
//! volume of fluid around them, the fraction `fullness` of a cell, changes; `rho` is the density in that volume. Where the points
//! follow the walls, the sums are those of [`super::point_motion`].

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::pddo::largest_wave_number;
use perimelt_core::world::BodyIndex;
use perimelt_core::{BondKernel, Family, PddoError, World};
use rayon::prelude::*;

use super::flux_kernels::{
    Carry, In, Laplacian, MappedPush, MappedViscosity, Outflow, Push, Viscosity,
};
use super::immersed::ImmersedFlow;
use super::medium::Medium;
use super::point_motion::PointMotion;
use super::rates::{POINTS_PER_TASK, Rates, Stability, Terms, load_weighted};
use super::treatments::CompleteFamily;
use super::walls::Walls;

/// Rate of the Laplacian at walls over that of a complete family: values behind them are extrapolated.
const AT_WALLS: f64 = 1.5;

/// Rates of the conservative form at points at rest.
#[derive(Debug)]
pub(super) struct Fluxes {
    dimension: usize,
    family: Arc<Family>,
    complete: CompleteFamily,
    walls: Walls,
    /// Where points follow the walls.
    motion: Option<PointMotion>,
    /// Slot of each point.
    slot: Vec<u32>,
    /// Volume of the fluid at a point over that of its cell.
    fullness: Vec<f64>,
    /// Rate at which it changes, 1/s.
    swept: Vec<[f64; 1]>,
    /// By slot: of mass, kg/(m² s), and with `D s`.
    mass: Vec<Vec<f64>>,
    flux: Vec<Vec<f64>>,
    density: Vec<f64>,
    viscosity: Vec<f64>,
    pressure: Vec<f64>,
    /// What is carried, by slot, m/s.
    carried_velocity: Vec<Vec<f64>>,
    /// By point: mass that flows out, kg/(m³ s).
    outflow: Vec<[f64; 1]>,
    /// In the middle of the step: kg/m³, m/s.
    middle_density: Vec<f64>,
    middle_velocity: Vec<Vector3<f64>>,
    /// Rows of the sums, one for each point: force of viscosity (N/m³) and friction (W/m³), force of the pressure (N/m³),
    /// momentum that flows out (N/m³), decay of short waves (N/m³).
    diffusion: Vec<f64>,
    push: Vec<f64>,
    carried: Vec<f64>,
    short_waves: Vec<f64>,
    work: Vec<f64>,
}

impl Fluxes {
    /// `points` of them; `walls` complete their families.
    pub(super) fn new(
        family: Arc<Family>,
        (dimension, points): (usize, usize),
        complete: CompleteFamily,
        (walls, motion): (Walls, Option<PointMotion>),
    ) -> Self {
        Fluxes {
            dimension,
            slot: (0..points).map(|i| family.slot_of(i) as u32).collect(),
            fullness: vec![1.0; points],
            swept: vec![[0.0]; points],
            family,
            complete,
            walls,
            motion,
            mass: vec![Vec::new(); dimension],
            flux: vec![Vec::new(); dimension],
            density: Vec::new(),
            viscosity: Vec::new(),
            pressure: Vec::new(),
            carried_velocity: vec![Vec::new(); dimension],
            outflow: vec![[0.0]; points],
            middle_density: Vec::new(),
            middle_velocity: Vec::new(),
            diffusion: Vec::new(),
            push: Vec::new(),
            carried: Vec::new(),
            short_waves: Vec::new(),
            work: Vec::new(),
        }
    }

    fn points(&self) -> usize {
        self.slot.len()
    }

    /// `1 / a`, 1/m.
    fn inverse(&self) -> f64 {
        1.0 / self.complete.moment
    }

    /// A gradient (of x) at a point as one of the lattice.
    fn on_lattice(&self, point: usize, gradient: Vector3<f64>) -> Vector3<f64> {
        match &self.motion {
            Some(motion) => motion.points()[point].gradient.tr_mul(&gradient),
            None => gradient,
        }
    }

    /// A gradient (of x) at a point as one of the bonds to walls, which have the cofactors in their vectors.
    fn on_bonds(&self, point: usize, gradient: Vector3<f64>) -> Vector3<f64> {
        match &self.motion {
            Some(motion) => {
                let mapped = &motion.points()[point];
                let stretch = mapped.gradient * mapped.gradient.transpose();
                stretch * gradient / mapped.gradient.determinant()
            }
            None => gradient,
        }
    }

    fn outflow_kernel(&self, terms: &Terms<'_>) -> Outflow {
        Outflow {
            inverse: self.inverse(),
            diffusion: 2.0 * terms.density_diffusivity(0),
        }
    }

    /// What the walls see of the fluid, with a density (kg/m³) and a velocity by slot (m/s).
    fn at_walls<'a>(
        &'a self,
        terms: &'a Terms<'_>,
        density: &'a [f64],
        velocity: &'a [Vec<f64>],
    ) -> ImmersedFlow<
        'a,
        impl Fn(usize) -> Vector3<f64> + Sync + 'a,
        impl Fn(usize) -> [f64; 6] + Sync + 'a,
    > {
        ImmersedFlow {
            slot: &self.slot,
            velocity,
            density,
            viscosity: &terms.medium.viscosity.value,
            slope: |i| self.on_bonds(i, terms.density_gradient(i)),
            stretch: |i| (self.motion.as_ref()).map_or([0.0; 6], |m| m.points()[i].stretch),
            moment: self.complete.moment,
            diffusion: 2.0 * terms.density_diffusivity(0),
        }
    }

    /// Sets the flux of mass along an axis of the lattice: `rho v`, or `rho C^T (v - w)` through points that move.
    fn set_mass_flux<const D: usize>(
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

    /// Finds the rates at which points that move and walls change the volumes.
    fn find_swept<const D: usize, const I: usize>(&mut self) {
        self.swept.fill([0.0]);
        if let Some(motion) = &self.motion {
            let mut slots = vec![Vec::new(); D];
            for (axis, slots) in slots.iter_mut().enumerate() {
                let points = motion.points().iter();
                let along = points.map(|m| m.cofactors.column(axis).dot(&m.velocity));
                let along: Vec<f64> = along.collect();
                slots.resize(self.family.slots(), 0.0);
                self.family.scatter(&along, 1, 0, slots);
                self.family.fill_layers_turning(slots, |a| a == axis);
            }
            let inputs: [&[f64]; I] = std::array::from_fn(|i| &slots[i.min(D - 1)][..]);
            let kernel = In::<D, _>(Outflow {
                inverse: self.inverse(),
                diffusion: 0.0,
            });
            self.family.sum(&kernel, inputs, &mut self.swept);
        }
        let swept = &mut self.swept;
        let inverse = 1.0 / self.complete.moment;
        self.walls
            .for_each_swept(inverse, |point, rate| swept[point][0] += rate);
    }

    /// Finds the flux of mass with this density (kg/m³) and what flows out of each point.
    fn find_outflow<const D: usize, const I: usize>(
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
    fn find_mass<const D: usize, const I: usize>(
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

    /// Finds force and work of viscosity.
    fn find_viscosity<const D: usize, const I: usize, const O: usize>(
        &mut self,
        kernel: impl BondKernel<I, O>,
        (terms, density): (&Terms<'_>, &[f64]),
        velocity: &[Vec<f64>],
    ) {
        let mut rows = std::mem::take(&mut self.diffusion);
        rows.resize(self.points() * O, 0.0);
        let stretch = self.motion.as_ref().map(|m| &m.stretch);
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match (i, stretch) {
            _ if i < D => &velocity[i][..],
            (_, Some(stretch)) if i > D => &stretch[i - D - 1],
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

    /// Finds the decay of short waves of the velocity; the same in all directions, as [`super::convection`] has it.
    fn find_short_waves<const D: usize>(
        &mut self,
        (terms, density): (&Terms<'_>, &[f64]),
        velocity: &[Vec<f64>],
    ) {
        self.short_waves.clear();
        let (Some(convection), medium) = (terms.convection, terms.medium) else {
            return;
        };
        let laplacian = 2.0 * self.inverse();
        let sum = laplacian * self.complete.content;
        let missing = |i: usize| {
            let slot = self.slot[i] as usize;
            let square: f64 = velocity.iter().map(|v| v[slot] * v[slot]).sum();
            let diffusivity = medium.viscosity.value[i] / density[i];
            let flow = (square.sqrt(), medium.spacing[i]);
            density[i] * convection.missing_diffusivity(flow, sum, diffusivity) / sum
        };
        let missing: Vec<f64> = (0..self.points()).into_par_iter().map(missing).collect();
        if missing.iter().all(|m| *m == 0.0) {
            return;
        }
        let mut rows = vec![0.0; self.points() * D];
        let (sums, _) = rows.as_chunks_mut::<D>();
        let kernel = Laplacian { laplacian };
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &velocity[a][..]);
        self.family.sum(&kernel, inputs, sums);
        for (sums, missing) in sums.iter_mut().zip(&missing) {
            sums.iter_mut().for_each(|s| *s *= -missing);
        }
        let rules: Vec<LayerRule> = terms.rules.iter().map(LayerRule::homogeneous).collect();
        let mut slots = vec![Vec::new(); D];
        let flat: Vec<f64> = rows;
        for (axis, slots) in slots.iter_mut().enumerate() {
            slots.resize(self.family.slots(), 0.0);
            self.family.scatter(&flat, D, axis, slots);
            self.family.fill_layers(&rules, axis, slots);
        }
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &slots[a][..]);
        self.short_waves.resize(flat.len(), 0.0);
        let mut rows = std::mem::take(&mut self.short_waves);
        let (sums, _) = rows.as_chunks_mut::<D>();
        self.family.sum(&kernel, inputs, sums);
        self.short_waves = rows;
    }

    /// Finds the momentum that flows out of each point with this velocity (m/s).
    fn find_carried<const D: usize, const I: usize>(
        &mut self,
        terms: &Terms<'_>,
        velocity: &[Vector3<f64>],
    ) {
        let flat = (bytemuck::cast_slice(velocity), 3);
        for (axis, slots) in self.carried_velocity.iter_mut().enumerate() {
            self.family.load(flat, axis, terms.rules, slots);
        }
        let mut rows = std::mem::take(&mut self.carried);
        rows.resize(self.points() * D, 0.0);
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match i {
            _ if i < D => &self.flux[i][..],
            _ if i == D => &self.density,
            _ => &self.carried_velocity[i - D - 1],
        });
        let kernel = In::<D, _>(Carry(self.outflow_kernel(terms)));
        let (sums, _) = rows.as_chunks_mut::<D>();
        self.family.sum(&kernel, inputs, sums);
        let mut walls = std::mem::take(&mut self.walls);
        walls.add_carried(velocity, sums);
        (self.carried, self.walls) = (rows, walls);
    }

    /// Acceleration of a point with this velocity at the start of the step (m/s) and this density now (kg/m³), m/s².
    fn acceleration(
        &self,
        terms: &Terms<'_>,
        i: usize,
        (velocity, density): (&Vector3<f64>, f64),
    ) -> Vector3<f64> {
        let d = self.dimension;
        let mass = density * self.fullness[i];
        let [outflow] = self.outflow[i];
        let mut acceleration = Vector3::zeros();
        for a in 0..d {
            let short = self.short_waves.get(i * d + a).copied().unwrap_or(0.0);
            let force = self.push[i * d + a] + self.diffusion[i * (d + 1) + a] + short;
            let carried = velocity[a] * outflow - self.carried[i * d + a];
            acceleration[a] = (force + carried) / mass + terms.body_acceleration(i, a);
        }
        acceleration
    }

    fn find_push<const D: usize>(&mut self) {
        let mut rows = std::mem::take(&mut self.push);
        rows.resize(self.points() * D, 0.0);
        let kernel = Push {
            inverse: self.inverse(),
        };
        let (sums, _) = rows.as_chunks_mut::<D>();
        match &self.motion {
            None => self.family.sum(&kernel, [&self.pressure], sums),
            Some(motion) => {
                let times = |row: &Vec<f64>| {
                    let slots = row.iter().zip(&self.pressure);
                    slots.map(|(c, p)| c * p).collect()
                };
                let rows: Vec<Vec<f64>> = motion.cofactors.iter().map(times).collect();
                self.push_by::<D>(&rows, sums);
            }
        }
        let own = |point: usize| [self.pressure[self.slot[point] as usize]];
        self.walls
            .add_pressure(&kernel, own, self.complete.moment, sums);
        self.push = rows;
    }

    /// Sums [`MappedPush`] over these inputs.
    fn push_by<const D: usize>(&self, rows: &[Vec<f64>], sums: &mut [[f64; D]]) {
        let inverse = self.inverse();
        match D {
            2 => {
                let inputs: [&[f64]; 4] = std::array::from_fn(|n| &rows[n][..]);
                self.family.sum(&MappedPush { inverse }, inputs, sums);
            }
            _ => {
                let inputs: [&[f64]; 9] = std::array::from_fn(|n| &rows[n][..]);
                self.family.sum(&MappedPush { inverse }, inputs, sums);
            }
        }
    }

    /// Lets points follow the walls in a step of `dt` (s).
    fn move_points(&mut self, dt: f64) {
        let Some(motion) = &mut self.motion else {
            return;
        };
        let displaced = self.walls.displacements();
        motion.follow(&self.family, &displaced, dt);
        self.map_walls();
    }

    /// Displaces the points by this much at each place (m) in a step of `dt` (s).
    #[cfg(test)]
    pub(super) fn displace_points(
        &mut self,
        family: &Family,
        dt: f64,
        by: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) {
        if let Some(motion) = &mut self.motion {
            motion.displace(family, dt, by);
        }
        match self.dimension {
            2 => self.find_swept::<2, 3>(),
            _ => self.find_swept::<3, 4>(),
        }
    }

    /// Maps the bonds to walls as the points are now.
    fn map_walls(&mut self) {
        let points = self.points();
        let mut rows = std::mem::take(&mut self.push);
        rows.resize(points * self.dimension, 0.0);
        if let Some(motion) = &self.motion {
            match self.dimension {
                2 => self.push_by::<2>(&motion.cofactors, rows.as_chunks_mut().0),
                _ => self.push_by::<3>(&motion.cofactors, rows.as_chunks_mut().0),
            }
            let (d, moment) = (self.dimension, self.complete.moment);
            let open = |i: usize| {
                let row = &rows[i * d..(i + 1) * d];
                Vector3::from_fn(|a, _| row.get(a).map_or(0.0, |sum| -0.5 * moment * sum))
            };
            let cofactors = |i: usize| motion.points()[i].cofactors;
            self.walls.map_bonds(points, cofactors, open);
            self.walls
                .displace_relative(|place| motion.displacement_at(place));
        }
        self.push = rows;
    }

    fn carry_in<const D: usize, const I: usize>(
        &mut self,
        (terms, time): (&Terms<'_>, f64),
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) {
        self.find_carried::<D, I>(terms, velocity);
        let mut middle = std::mem::take(&mut self.middle_velocity);
        let half = 0.5 * time * terms.acceleration_fraction;
        let of_point = |(i, v): (usize, &Vector3<f64>)| {
            v + half * self.acceleration(terms, i, (v, density[i]))
        };
        let points = velocity.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK).map(of_point);
        points.collect_into_vec(&mut middle);
        self.find_carried::<D, I>(terms, &middle);
        self.middle_velocity = middle;
    }

    fn give<const D: usize, const I: usize, const O: usize>(
        &mut self,
        viscosity: impl BondKernel<I, O>,
        (world, time): (&World, f64),
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

impl Rates for Fluxes {
    fn family(&self) -> &Family {
        &self.family
    }

    fn follow(
        &mut self,
        _positions: &[Vector3<f64>],
        _family: &dyn Fn() -> Arc<Family>,
    ) -> Result<(), PddoError> {
        Ok(())
    }

    fn follow_walls(&mut self, world: &World, body: BodyIndex, dt: f64) {
        self.walls.follow(world, body);
        self.move_points(dt);
        match self.dimension {
            2 => self.find_swept::<2, 3>(),
            _ => self.find_swept::<3, 4>(),
        }
    }

    fn motion(&self) -> Option<&PointMotion> {
        self.motion.as_ref()
    }

    fn motion_mut(&mut self) -> Option<&mut PointMotion> {
        self.motion.as_mut()
    }

    fn give_impulses(&mut self, world: &World, _velocity: &[Vec<f64>], time: f64) {
        let (laplacian, to) = (2.0 * self.inverse(), (world, time));
        match (self.dimension, self.motion.is_some()) {
            _ if self.walls.is_empty() => (),
            (2, false) => self.give::<2, 3, 3>(Viscosity::<2> { laplacian }, to),
            (2, true) => self.give::<2, 6, 3>(MappedViscosity::<2> { laplacian }, to),
            (_, false) => self.give::<3, 4, 4>(Viscosity::<3> { laplacian }, to),
            (_, true) => self.give::<3, 10, 4>(MappedViscosity::<3> { laplacian }, to),
        }
    }

    fn observe_walls(&mut self, world: &World, body: BodyIndex) {
        self.walls.observe(world, body);
    }

    fn walls(&self) -> Option<&Walls> {
        Some(&self.walls)
    }

    fn walls_mut(&mut self) -> Option<&mut Walls> {
        Some(&mut self.walls)
    }

    fn fullness(&self) -> Option<&Vec<f64>> {
        Some(&self.fullness)
    }

    fn set_fullness(&mut self, fullness: Vec<f64>) {
        self.fullness = fullness;
    }

    fn stability(&self) -> Stability {
        let CompleteFamily { point, content, .. } = self.complete;
        let wave_number = largest_wave_number(self.dimension, |receive| {
            self.family.for_each_bond(point, |_, bond, _| {
                receive(bond, bond.xi.map(|x| bond.weight * x * self.inverse()));
            });
        });
        Stability {
            wave_number: wave_number * (1.0 + self.walls.largest_density_ratio()).sqrt(),
            laplacian: AT_WALLS * 2.0 * self.inverse() * content,
        }
    }

    /// The viscosity is copied to slots together with the velocity.
    fn set_viscosity(&mut self, _medium: &Medium) {}

    fn set_velocity(&mut self, velocity: &[Vec<f64>], density: &[f64], terms: &Terms<'_>) {
        let mut by_slot = std::mem::take(&mut self.density);
        let rise = |axis, point, distance| {
            self.on_lattice(point, terms.density_gradient(point))[axis] * distance
        };
        load_weighted(&self.family, density, &mut by_slot, rise);
        self.density = by_slot;
        let viscosity = &terms.medium.viscosity;
        viscosity.load(&self.family, &mut self.viscosity);
        let (laplacian, fluid) = (2.0 * self.inverse(), (terms, density));
        match (self.dimension, self.motion.is_some()) {
            (2, false) => {
                self.find_viscosity::<2, 3, 3>(Viscosity::<2> { laplacian }, fluid, velocity);
            }
            (2, true) => {
                let kernel = MappedViscosity::<2> { laplacian };
                self.find_viscosity::<2, 6, 3>(kernel, fluid, velocity);
            }
            (_, false) => {
                self.find_viscosity::<3, 4, 4>(Viscosity::<3> { laplacian }, fluid, velocity);
            }
            (_, true) => {
                let kernel = MappedViscosity::<3> { laplacian };
                self.find_viscosity::<3, 10, 4>(kernel, fluid, velocity);
            }
        }
        match self.dimension {
            2 => {
                self.find_short_waves::<2>((terms, density), velocity);
                self.find_mass::<2, 3>(terms, density, velocity);
            }
            _ => {
                self.find_short_waves::<3>((terms, density), velocity);
                self.find_mass::<3, 4>(terms, density, velocity);
            }
        }
    }

    fn set_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        let mut by_slot = std::mem::take(&mut self.pressure);
        let weight = |point: usize| force.map_or_else(Vector3::zeros, |f| f[point]);
        let rise = |axis: usize, point: usize, distance| {
            self.on_lattice(point, weight(point))[axis] * distance
        };
        load_weighted(&self.family, pressure, &mut by_slot, rise);
        self.pressure = by_slot;
        let mut walls = std::mem::take(&mut self.walls);
        let slot = |point: usize| self.slot[point] as usize;
        walls.set_pressure(slot, &self.pressure, |point| {
            self.on_bonds(point, weight(point))
        });
        self.walls = walls;
        match self.dimension {
            2 => self.find_push::<2>(),
            _ => self.find_push::<3>(),
        }
    }

    fn carry(&mut self, terms: &Terms<'_>, time: f64, velocity: &[Vector3<f64>], density: &[f64]) {
        match self.dimension {
            2 => self.carry_in::<2, 5>((terms, time), velocity, density),
            _ => self.carry_in::<3, 7>((terms, time), velocity, density),
        }
    }

    fn mass_flux(&self, flux: &mut [Vector3<f64>]) {
        let points = flux.iter_mut().zip(&self.slot);
        points.for_each(|(m, slot)| {
            *m = Vector3::from_fn(|a, _| self.mass.get(a).map_or(0.0, |m| m[*slot as usize]));
        });
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        dt: f64,
        (density, pressure): (&mut [f64], &mut [f64]),
    ) {
        let before = self.fullness.clone();
        let volumes = self.fullness.iter_mut().zip(&self.swept);
        volumes.for_each(|(fullness, [rate])| *fullness += dt * rate);
        let points = density.par_iter_mut().zip(pressure).enumerate();
        points
            .with_min_len(POINTS_PER_TASK)
            .for_each(|(i, (rho, p))| {
                let old = *rho;
                *rho = (old * before[i] - dt * self.outflow[i][0]) / self.fullness[i];
                *p = terms.medium.pressure(i, (old, *rho), *p);
            });
    }

    fn advance_velocity(
        &self,
        terms: &Terms<'_>,
        dt: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let time = dt * terms.acceleration_fraction;
        let points = velocity.par_iter_mut().enumerate();
        points.with_min_len(POINTS_PER_TASK).for_each(|(i, v)| {
            *v += time * self.acceleration(terms, i, (v, density[i]));
        });
    }

    fn friction(&self, _medium: &Medium, friction: &mut Vec<f64>) {
        let d = self.dimension;
        friction.clear();
        friction.extend(self.diffusion.chunks_exact(d + 1).map(|row| row[d]));
    }
}
