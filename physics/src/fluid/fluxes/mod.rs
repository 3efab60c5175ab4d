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

mod kernels;
mod mass;
mod momentum;
mod motion;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::Rising;
use perimelt_core::pddo::largest_wave_number;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Family, PddoError, SlotField, World};
use rayon::prelude::*;

use kernels::{MappedViscosity, Outflow, Viscosity};
use momentum::ShortWaveWork;

use crate::shape_tensor::CompleteFamily;

use super::immersed::ImmersedFlow;
use super::medium::Medium;
use super::point_motion::PointMotion;
use super::rates::{POINTS_PER_TASK, Rates, Stability, Terms};
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
    mass: Vec<SlotField>,
    flux: Vec<SlotField>,
    density: SlotField,
    viscosity: SlotField,
    pressure: SlotField,
    /// `s`, kg/m⁴.
    slopes: SlotField,
    /// What is carried, by slot, m/s.
    carried_velocity: Vec<SlotField>,
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
    short_wave_work: ShortWaveWork,
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
            mass: vec![SlotField::default(); dimension],
            flux: vec![SlotField::default(); dimension],
            density: SlotField::default(),
            viscosity: SlotField::default(),
            pressure: SlotField::default(),
            slopes: SlotField::default(),
            carried_velocity: vec![SlotField::default(); dimension],
            outflow: vec![[0.0]; points],
            middle_density: Vec::new(),
            middle_velocity: Vec::new(),
            diffusion: Vec::new(),
            push: Vec::new(),
            carried: Vec::new(),
            short_waves: Vec::new(),
            short_wave_work: ShortWaveWork::new(dimension),
        }
    }

    fn points(&self) -> usize {
        self.slot.len()
    }

    /// `1 / a`, 1/m.
    fn inverse(&self) -> f64 {
        1.0 / self.complete.moment
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
        velocity: &'a [SlotField],
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

    fn give_impulses(&mut self, world: &World, _velocity: &[SlotField], time: f64) {
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

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        let mut by_slot = std::mem::take(&mut self.density);
        let hydrostatic = Rising(|axis, point, distance| {
            self.on_lattice(point, terms.density_gradient(point))[axis] * distance
        });
        by_slot.load(&self.family, density, hydrostatic);
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
        let hydrostatic =
            Rising(|axis, point, distance| self.on_lattice(point, weight(point))[axis] * distance);
        by_slot.load(&self.family, pressure, hydrostatic);
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
        let points = flux.par_iter_mut().zip(&self.slot);
        points.with_min_len(POINTS_PER_TASK).for_each(|(m, slot)| {
            *m = Vector3::from_fn(|a, _| self.mass.get(a).map_or(0.0, |m| m[*slot as usize]));
        });
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        dt: f64,
        (density, pressure): (&mut [f64], &mut [f64]),
    ) {
        let volumes = self.fullness.par_iter_mut().zip(&self.swept);
        let volumes = volumes.zip(&self.outflow);
        let points = density.par_iter_mut().zip(pressure).zip(volumes);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_each(|(i, ((rho, p), ((fullness, [rate]), [outflow])))| {
            let (old, before) = (*rho, *fullness);
            *fullness += dt * rate;
            *rho = (old * before - dt * outflow) / *fullness;
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
