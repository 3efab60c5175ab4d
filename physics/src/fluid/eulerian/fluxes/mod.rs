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
//! star, as in [`crate::fluid::eulerian::carried_flow`]. Each is opposite at the two ends of a bond: mass and momentum are kept to rounding, and
//! since `sum_j w xi V_j = 0` the flux of mass is the adjoint of the force of the pressure, so that the work of the pressure is
//! the energy of compression. Uniform fields stay uniform. Viscosity is pairwise as in [`crate::fluid::lagrangian`].
//!
//! A wall that moves displaces fluid. The points of the lattice keep their places and their weight in the sums, but the
//! volume of fluid around them, the fraction `fullness` of a cell, changes; `rho` is the density in that volume. Where the points
//! follow the walls, the sums are those of [`crate::fluid::eulerian::point_motion`].

pub(super) mod kernels;
mod mass;
mod momentum;
mod motion;
pub(super) mod short_waves;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::Rising;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::pddo::largest_wave_number;
use perimelt_core::solver::SolverError;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, Family, SlotField, World};
use rayon::prelude::*;

use kernels::{FlowInputs, MappedViscosity, Outflow, Viscosity, ViscosityInputs, ViscositySums};
use short_waves::{DecayingWaves, FlowBonds};

use crate::advection::Convection;
use crate::shape_tensor::CompleteFamily;

use crate::fluid::eulerian::immersed::ImmersedFlow;
use crate::fluid::eulerian::point_motion::PointMotion;
use crate::fluid::medium::Medium;
use crate::fluid::rates::{POINTS_PER_TASK, Rates, Stability, Terms};
use crate::fluid::walls::Walls;

/// Rate of the Laplacian at walls over that of a complete family: values behind them are extrapolated.
pub(super) const AT_WALLS: f64 = 1.5;

/// Rates of the conservative form at points at rest.
#[derive(Debug)]
pub(super) struct Fluxes {
    dimension: usize,
    family: Arc<Family>,
    complete: CompleteFamily,
    pub(super) walls: Walls,
    /// Motion of points that follow the walls.
    pub(super) motion: Option<PointMotion>,
    /// Slot of each point.
    slot: Vec<u32>,
    /// Volume of the fluid at a point over that of its cell.
    pub(super) fullness: Vec<f64>,
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
    /// momentum that flows out (N/m³).
    diffusion: Vec<f64>,
    push: Vec<f64>,
    carried: Vec<f64>,
    short_waves: DecayingWaves,
}

const OUTFLOW_2D: usize = FlowInputs::<2>::OUTFLOW;
const OUTFLOW_3D: usize = FlowInputs::<3>::OUTFLOW;
const CARRY_2D: usize = FlowInputs::<2>::CARRY;
const CARRY_3D: usize = FlowInputs::<3>::CARRY;
const PLAIN_2D: usize = ViscosityInputs::<2>::PLAIN;
const PLAIN_3D: usize = ViscosityInputs::<3>::PLAIN;
const MAPPED_2D: usize = ViscosityInputs::<2>::MAPPED;
const MAPPED_3D: usize = ViscosityInputs::<3>::MAPPED;
const VISCOUS_2D: usize = ViscositySums::<2>::COUNT;
const VISCOUS_3D: usize = ViscositySums::<3>::COUNT;

/// What sums are taken over.
pub(super) struct FluxDomain {
    pub(super) family: Arc<Family>,
    pub(super) complete: CompleteFamily,
    pub(super) walls: Walls,
    /// Motion of points that follow the walls.
    pub(super) motion: Option<PointMotion>,
}

impl Fluxes {
    /// Rates of the points of `body`, whose families walls complete.
    pub(super) fn new(convection: Convection, body: &Body, domain: FluxDomain) -> Self {
        let FluxDomain {
            family,
            complete,
            walls,
            motion,
        } = domain;
        let (dimension, points) = (body.dimension, body.points.len());
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
            short_waves: DecayingWaves::new(convection, dimension),
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
        velocity: &Vector3<f64>,
        density: f64,
    ) -> Vector3<f64> {
        let d = self.dimension;
        let mass = density * self.fullness[i];
        let [outflow] = self.outflow[i];
        let mut acceleration = Vector3::zeros();
        for a in 0..d {
            let short = self.short_waves.rate(i, a);
            let force = self.push[i * d + a] + self.diffusion[i * (d + 1) + a] + short;
            let carried = velocity[a] * outflow - self.carried[i * d + a];
            acceleration[a] = (force + carried) / mass + terms.body_acceleration(i, a);
        }
        acceleration
    }
}

/// The flow as last set.
pub(super) struct FlowNow<'a> {
    pub(super) terms: &'a Terms<'a>,
    /// Components by slot, m/s.
    pub(super) velocity: &'a [SlotField],
    /// By point, kg/m³.
    pub(super) density: &'a [f64],
}

impl Fluxes {
    /// Takes positions and velocities of the bodies that are walls for the fluid of `body`, and lets points follow them in a
    /// step of `dt` (s).
    pub(super) fn follow_walls(&mut self, world: &World, body: BodyIndex, dt: f64) {
        self.walls.follow(world, body);
        self.move_points(dt);
        match self.dimension {
            2 => self.find_swept::<2, OUTFLOW_2D>(),
            _ => self.find_swept::<3, OUTFLOW_3D>(),
        }
    }

    /// Gives the walls the opposite of what they do to the fluid in a time, s.
    pub(super) fn give_impulses(&mut self, world: &World, time: f64) {
        let laplacian = 2.0 * self.inverse();
        match (self.dimension, self.motion.is_some()) {
            _ if self.walls.is_empty() => (),
            (2, false) => self.give::<2, PLAIN_2D, VISCOUS_2D>(
                Viscosity::<2, false> { laplacian },
                world,
                time,
            ),
            (2, true) => self.give::<2, MAPPED_2D, VISCOUS_2D>(
                MappedViscosity::<2> { laplacian },
                world,
                time,
            ),
            (_, false) => self.give::<3, PLAIN_3D, VISCOUS_3D>(
                Viscosity::<3, false> { laplacian },
                world,
                time,
            ),
            (_, true) => self.give::<3, MAPPED_3D, VISCOUS_3D>(
                MappedViscosity::<3> { laplacian },
                world,
                time,
            ),
        }
    }

    /// Finds what the flow carries in the middle of the next advance of the velocity by a time (s); after velocity and pressure.
    pub(super) fn carry(
        &mut self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) {
        match self.dimension {
            2 => self.carry_in::<2, CARRY_2D>(terms, time, velocity, density),
            _ => self.carry_in::<3, CARRY_3D>(terms, time, velocity, density),
        }
    }

    /// Advances the velocity by a time (s) with what the flow carries.
    pub(super) fn accelerate(
        &self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let time = time * terms.acceleration_fraction;
        let points = velocity.par_iter_mut().enumerate();
        points.with_min_len(POINTS_PER_TASK).for_all(|(i, v)| {
            *v += time * self.acceleration(terms, i, v, density[i]);
        });
    }

    /// Copies the flux of mass to points, kg/(m² s).
    pub(super) fn mass_flux(&self, flux: &mut [Vector3<f64>]) {
        let points = flux.par_iter_mut().zip(&self.slot);
        points.with_min_len(POINTS_PER_TASK).for_all(|(m, slot)| {
            *m = Vector3::from_fn(|a, _| self.mass.get(a).map_or(0.0, |m| m[*slot as usize]));
        });
    }
}

/// How viscosity acts along bonds.
enum ViscousBonds {
    /// With the mean of the ends.
    Mean,
    /// With the halves in series.
    InSeries,
    /// With the mean, and the tensor of points that follow walls.
    Mapped,
}

impl Rates for Fluxes {
    fn family(&self) -> &Family {
        &self.family
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

    fn set_viscosity(&mut self, medium: &Medium) {
        medium.viscosity.load(&self.family, &mut self.viscosity);
    }

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        let mut by_slot = std::mem::take(&mut self.density);
        let hydrostatic = Rising(|axis, point, distance| {
            self.on_lattice(point, terms.density_gradient(point))[axis] * distance
        });
        by_slot.load(&self.family, density, hydrostatic);
        self.density = by_slot;
        let flow = FlowNow {
            terms,
            velocity,
            density,
        };
        let laplacian = 2.0 * self.inverse();
        let bonds = match (
            self.motion.is_some(),
            terms.medium.viscosity.needs_shear_rate(),
        ) {
            (true, _) => ViscousBonds::Mapped,
            (false, false) => ViscousBonds::Mean,
            (false, true) => ViscousBonds::InSeries,
        };
        match (self.dimension, bonds) {
            (2, ViscousBonds::Mean) => {
                let kernel = Viscosity::<2, false> { laplacian };
                self.find_viscosity::<2, PLAIN_2D, VISCOUS_2D>(kernel, &flow);
            }
            (2, ViscousBonds::InSeries) => {
                let kernel = Viscosity::<2, true> { laplacian };
                self.find_viscosity::<2, PLAIN_2D, VISCOUS_2D>(kernel, &flow);
            }
            (2, ViscousBonds::Mapped) => {
                let kernel = MappedViscosity::<2> { laplacian };
                self.find_viscosity::<2, MAPPED_2D, VISCOUS_2D>(kernel, &flow);
            }
            (_, ViscousBonds::Mean) => {
                let kernel = Viscosity::<3, false> { laplacian };
                self.find_viscosity::<3, PLAIN_3D, VISCOUS_3D>(kernel, &flow);
            }
            (_, ViscousBonds::InSeries) => {
                let kernel = Viscosity::<3, true> { laplacian };
                self.find_viscosity::<3, PLAIN_3D, VISCOUS_3D>(kernel, &flow);
            }
            (_, ViscousBonds::Mapped) => {
                let kernel = MappedViscosity::<3> { laplacian };
                self.find_viscosity::<3, MAPPED_3D, VISCOUS_3D>(kernel, &flow);
            }
        }
        let bonds = FlowBonds {
            family: &self.family,
            complete: &self.complete,
            slot: &self.slot,
        };
        match self.dimension {
            2 => {
                (self.short_waves).find::<2>(bonds, &flow, &terms.medium.viscosity.value);
                self.find_mass::<2, OUTFLOW_2D>(&flow);
            }
            _ => {
                (self.short_waves).find::<3>(bonds, &flow, &terms.medium.viscosity.value);
                self.find_mass::<3, OUTFLOW_3D>(&flow);
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

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) -> Result<(), SolverError> {
        let volumes = self.fullness.par_iter_mut().zip(&self.swept);
        let volumes = volumes.zip(&self.outflow);
        let points = density.par_iter_mut().zip(pressure).zip(volumes);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, ((rho, p), ((fullness, [rate]), [outflow])))| {
            let before = *fullness;
            *fullness += terms.dt * rate;
            let after = (*rho * before - terms.dt * outflow) / *fullness;
            terms.medium.change_density(i, after, rho, p);
        });
        Ok(())
    }

    fn advance_velocity(
        &mut self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        self.carry(terms, time, velocity, density);
        self.accelerate(terms, time, velocity, density);
    }

    fn friction(&self, _medium: &Medium, friction: &mut Vec<f64>) {
        let d = self.dimension;
        friction.clear();
        friction.extend(self.diffusion.chunks_exact(d + 1).map(|row| row[d]));
    }
}
