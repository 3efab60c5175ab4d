//! Rates that keep momentum to rounding, also of a fluid with free surfaces (docs/theory/fluids.md, "Conservative form").
//!
//! The divergence is the operator of first order, exact for linear velocities on any family; the force of the
//! pressure is its adjoint:
//!
//! ```text
//! A_i    = sum_j w xi xi^T V_j,   g_ij = A_i^-1 w xi
//! div v  = sum_j g_ij . (v_j - v_i) V_j
//! rho a  = sum_j (p_j g_ji - p_i g_ij) V_j  =  -sum_j w (p_i A_i^-1 + p_j A_j^-1) xi V_j
//! ```
//!
//! so that the work of the pressure is the energy of compression; behind walls both take mirror images, whether or not
//! the fluid slips. A rigid motion has no divergence, therefore the forces and their moments add up to zero. Where a
//! family is incomplete no pressure acts from outside: a free surface needs no condition. A family that is too thin to
//! determine the velocity gradient across it (a splash, a single point) counts with a least eigenvalue
//! ([`crate::shape_tensor`]).
//!
//! Viscosity and diffusion of density are pairwise, `lap f = (2/a) sum_j w (f_j - f_i) V_j` with
//! `A = a I` of a complete family, so that each pair exchanges equal and opposite amounts. Friction heats by the work
//! that viscosity does. Only the part of the density that is not hydrostatic diffuses.
//!
//! The density of a point is the time integral of divergences, which do not measure how close the points lie. Over a
//! long time the points may crowd without a pressure that separates them. Therefore the density relaxes slowly towards
//! the kernel sum `sum W m` with the kernel of Wendland (1995), C2, where families are complete.

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::{Mirrored, Rising};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::pddo::largest_wave_number;
use perimelt_core::solver::SolverError;
use perimelt_core::{Body, BondKernel, Family, SlotField, World};
use rayon::prelude::*;

use crate::shape_tensor::{COMPONENTS, CompleteFamily, components, inverted};

use super::FollowedFamily;
use super::pair_laws::{Push, PushInputs, Survey, SurveyInputs, SurveySums, kernel_over_influence};
use super::walls::FluidAtWall;
use crate::fluid::kinds::ConservativeKeys;
use crate::fluid::medium::Medium;
use crate::fluid::points::Surroundings;
use crate::fluid::rates::{POINTS_PER_TASK, Rates, Stability, Terms};
use crate::fluid::walls::Walls;

/// Rates of the conservative form.
#[derive(Debug)]
pub(super) struct Conservative {
    dimension: usize,
    family: Arc<Family>,
    complete: CompleteFamily,
    pub(super) walls: Walls,
    pub(super) keys: ConservativeKeys,
    /// Kernel sum of a complete family, 1/m.
    crowd: f64,
    /// m.
    horizon: f64,
    /// Fields by slot; the velocity is mirrored by walls.
    velocity: Vec<SlotField>,
    density: SlotField,
    viscosity: SlotField,
    /// Whether the halves of a bond resist shear in series.
    in_series: bool,
    pressure: SlotField,
    inverse: Vec<SlotField>,
    /// Sums of the survey, one row for each point.
    sums: Vec<f64>,
    surveyed: Vec<Surveyed>,
    /// Force of the pressure, N/m³, one row for each point.
    push: Vec<f64>,
}

/// What is found at a point from the velocity and density around it.
#[derive(Clone, Copy, Debug, Default)]
struct Surveyed {
    inverse: [f64; 6],
    /// 1/s.
    divergence: f64,
    /// Force of viscosity, N/m³.
    force: Vector3<f64>,
    /// Heat of viscous friction, W/m³.
    friction: f64,
    /// `(2/a) sum w (rho_j - rho_i)`, kg/m⁵.
    density_laplacian: f64,
    /// `(2/a) sum w xi`, 1/m.
    kernel_asymmetry: Vector3<f64>,
    /// Relative excess of the kernel sum over that of a complete family; zero where the family is incomplete.
    crowding: f64,
}

const INPUTS_2D: usize = SurveyInputs::<2>::COUNT;
const INPUTS_3D: usize = SurveyInputs::<3>::COUNT;
const SUMS_2D: usize = SurveySums::<2>::COUNT;
const SUMS_3D: usize = SurveySums::<3>::COUNT;
const PUSH_2D: usize = PushInputs::<2>::COUNT;
const PUSH_3D: usize = PushInputs::<3>::COUNT;

impl Conservative {
    pub(super) fn new(
        keys: ConservativeKeys,
        body: &Body,
        family: Arc<Family>,
        around: Surroundings,
    ) -> Self {
        let Surroundings {
            complete, walls, ..
        } = around;
        let dimension = body.dimension;
        let horizon = family.spec().horizon.of(body.finest_spacing());
        let mut crowd = complete.own_content;
        family.for_each_bond(complete.point, |_, bond, _| {
            crowd += bond.weight * kernel_over_influence(bond.length / horizon);
        });
        Conservative {
            dimension,
            family,
            complete,
            walls,
            keys,
            crowd,
            horizon,
            velocity: vec![SlotField::default(); dimension],
            density: SlotField::default(),
            viscosity: SlotField::default(),
            in_series: false,
            pressure: SlotField::default(),
            inverse: vec![SlotField::default(); components(dimension)],
            sums: Vec::new(),
            surveyed: Vec::new(),
            push: Vec::new(),
        }
    }

    /// `2 / a`, 1/m.
    fn laplacian(&self) -> f64 {
        2.0 / self.complete.moment
    }

    fn survey_kernel<const D: usize, const IN_SERIES: bool>(&self) -> Survey<D, IN_SERIES> {
        Survey::new(&self.complete, self.horizon, self.keys.is_central)
    }

    /// In `D` dimensions, with `I` inputs and `O` sums.
    fn survey<const D: usize, const I: usize, const O: usize, const IN_SERIES: bool>(
        &mut self,
        held: &[SlotField],
    ) {
        let kernel = self.survey_kernel::<D, IN_SERIES>();
        let mut all_sums = std::mem::take(&mut self.sums);
        all_sums.resize(self.surveyed.len() * O, 0.0);
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match i {
            _ if i < SurveyInputs::<D>::HELD => &self.velocity[i][..],
            _ if i < SurveyInputs::<D>::DENSITY => &held[i - SurveyInputs::<D>::HELD],
            _ if i < SurveyInputs::<D>::VISCOSITY => &self.density,
            _ => &self.viscosity,
        });
        let (sums, _) = all_sums.as_chunks_mut::<O>();
        self.family.sum(&kernel, inputs, sums);
        if !self.walls.is_empty() {
            let own = |point: usize| inputs.map(|input| input[self.family.slot_of(point)]);
            self.walls
                .add_velocity::<D, I, O>(&kernel, own, SurveySums::<D>::VISCOUS, sums);
        }

        let (complete, crowd) = (self.complete, self.crowd);
        let found = self.surveyed.par_iter_mut().zip(&*sums);
        found
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(found, sums)| {
                let slopes = &sums[SurveySums::<D>::SLOPES..];
                let shape = &sums[..SurveySums::<D>::SLOPES];
                let (inverse, is_complete) = inverted::<D>(shape, complete.moment);
                for (kept, &(a, b)) in found.inverse.iter_mut().zip(&COMPONENTS[..components(D)]) {
                    *kept = inverse[(a, b)];
                }
                let along = |a: usize| {
                    (0..D)
                        .map(|b| slopes[a * D + b] * inverse[(b, a)])
                        .sum::<f64>()
                };
                found.divergence = (0..D).map(along).sum();
                found.friction = sums[SurveySums::<D>::FRICTION];
                found.density_laplacian = sums[SurveySums::<D>::DENSITY_LAPLACIAN];
                for a in 0..D {
                    found.force[a] = sums[SurveySums::<D>::FORCE + a];
                    found.kernel_asymmetry[a] = sums[SurveySums::<D>::ASYMMETRY + a];
                }
                found.crowding = match is_complete {
                    true => (sums[SurveySums::<D>::CROWDING] + complete.own_content) / crowd - 1.0,
                    false => 0.0,
                };
            });
        self.sums = all_sums;
        let surveyed = &mut self.surveyed;
        self.walls
            .for_each_compression(|point, extra| surveyed[point].divergence += extra);
    }

    /// Takes the family of the points at their current positions.
    pub(super) fn follow(&mut self, family: FollowedFamily<'_>) {
        self.family = Arc::default();
        self.family = (family.take)();
    }

    /// Gives the walls the opposite of what they do to the fluid in a time (s), with the velocity by slot as last set.
    pub(super) fn give_impulses(&mut self, world: &World, velocity: &[SlotField], time: f64) {
        match (self.dimension, self.in_series) {
            _ if self.walls.is_empty() => (),
            (2, false) => {
                let survey = self.survey_kernel::<2, false>();
                self.give::<2, INPUTS_2D, SUMS_2D, PUSH_2D>(&survey, world, velocity, time);
            }
            (2, true) => {
                let survey = self.survey_kernel::<2, true>();
                self.give::<2, INPUTS_2D, SUMS_2D, PUSH_2D>(&survey, world, velocity, time);
            }
            (_, false) => {
                let survey = self.survey_kernel::<3, false>();
                self.give::<3, INPUTS_3D, SUMS_3D, PUSH_3D>(&survey, world, velocity, time);
            }
            (_, true) => {
                let survey = self.survey_kernel::<3, true>();
                self.give::<3, INPUTS_3D, SUMS_3D, PUSH_3D>(&survey, world, velocity, time);
            }
        }
    }

    /// Gives the walls the opposite of what pressure and viscosity do to the fluid in a time (s).
    fn give<const D: usize, const I: usize, const O: usize, const P: usize>(
        &mut self,
        survey: &impl BondKernel<I, O>,
        world: &World,
        held: &[SlotField],
        time: f64,
    ) {
        let mut walls = std::mem::take(&mut self.walls);
        let moment = self.complete.moment;
        let moving = |point: usize| -> [f64; I] {
            let slot = self.family.slot_of(point);
            std::array::from_fn(|i| match i {
                _ if i < SurveyInputs::<D>::HELD => self.velocity[i][slot],
                _ if i < SurveyInputs::<D>::DENSITY => held[i - SurveyInputs::<D>::HELD][slot],
                _ if i < SurveyInputs::<D>::VISCOSITY => self.density[slot],
                _ => self.viscosity[slot],
            })
        };
        let pressed = |point: usize| self.pressed::<P>(point);
        walls.give(world, time, |wall, n| {
            let forces = SurveySums::<D>::VISCOUS;
            let viscous: [f64; O] = wall.velocity_part::<D, I, O>(n, survey, &moving, &forces);
            let pressure: [f64; D] = wall.pressure_part(n, &Push::<D>, &pressed, moment);
            let mut force = Vector3::zeros();
            for a in 0..D {
                force[a] = pressure[a] + viscous[forces.start + a];
            }
            force
        });
        self.walls = walls;
    }

    /// Pressure and `A^-1` of a point: inputs of [`Push`].
    fn pressed<const P: usize>(&self, point: usize) -> [f64; P] {
        let slot = self.family.slot_of(point);
        std::array::from_fn(|i| match i {
            0 => self.pressure[slot],
            _ => self.inverse[i - 1][slot],
        })
    }

    fn push<const D: usize, const I: usize>(&mut self) {
        self.push.resize(self.surveyed.len() * D, 0.0);
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match i {
            0 => &self.pressure[..],
            _ => &self.inverse[i - 1],
        });
        let mut push = std::mem::take(&mut self.push);
        let (sums, _) = push.as_chunks_mut::<D>();
        self.family.sum(&Push::<D>, inputs, sums);
        if !self.walls.is_empty() {
            let own = |point: usize| self.pressed::<I>(point);
            let (walls, moment) = (&self.walls, self.complete.moment);
            walls.add_pressure(&Push::<D>, own, moment, sums);
        }
        self.push = push;
    }
}

impl Rates for Conservative {
    fn family(&self) -> &Family {
        &self.family
    }

    fn stability(&self) -> Stability {
        let CompleteFamily {
            point,
            moment,
            content,
            ..
        } = self.complete;
        let wave_number = largest_wave_number(self.dimension, |receive| {
            self.family.for_each_bond(point, |_, bond, _| {
                receive(bond, bond.xi.map(|x| bond.weight * x / moment));
            });
        });
        Stability {
            // incomplete and crowded families respond more strongly
            wave_number: 2.0 * wave_number,
            laplacian: self.laplacian() * content,
        }
    }

    fn set_viscosity(&mut self, medium: &Medium) {
        self.in_series = medium.viscosity.needs_shear_rate();
        medium.viscosity.load(&self.family, &mut self.viscosity);
    }

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        let hydrostatic =
            Rising(|axis, point, distance| terms.density_slope(point, axis) * distance);
        self.density.load(&self.family, density, hydrostatic);
        for (a, (mirrored, held)) in self.velocity.iter_mut().zip(velocity).enumerate() {
            mirrored.set(held.par_iter().copied());
            mirrored.fill_ghosts(&self.family, Mirrored::Vector(a));
        }
        self.surveyed.resize(density.len(), Surveyed::default());
        let slope = |i: usize| Vector3::from_fn(|a, _| terms.density_slope(i, a));
        self.walls.set_velocity(&FluidAtWall {
            slot_of: |point| self.family.slot_of(point),
            velocity: &self.velocity,
            density: &self.density,
            viscosity: &self.viscosity,
            slope,
            moment: self.complete.moment,
        });
        match (self.dimension, self.in_series) {
            (2, false) => self.survey::<2, INPUTS_2D, SUMS_2D, false>(velocity),
            (2, true) => self.survey::<2, INPUTS_2D, SUMS_2D, true>(velocity),
            (_, false) => self.survey::<3, INPUTS_3D, SUMS_3D, false>(velocity),
            (_, true) => self.survey::<3, INPUTS_3D, SUMS_3D, true>(velocity),
        }
        for (n, (slots, &(a, b))) in self.inverse.iter_mut().zip(&COMPONENTS).enumerate() {
            let inverse = |point: usize| self.surveyed[point].inverse[n];
            slots.load(&self.family, inverse, Mirrored::Tensor(a, b));
        }
    }

    fn set_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        let hydrostatic =
            Rising(|axis, point, distance| force.map_or(0.0, |f| f[point][axis] * distance));
        self.pressure.load(&self.family, pressure, hydrostatic);
        let family = &self.family;
        self.walls.set_pressure(
            |point| family.slot_of(point),
            &self.pressure,
            |point| force.map_or_else(Vector3::zeros, |f| f[point]),
        );
        match self.dimension {
            2 => self.push::<2, PUSH_2D>(),
            _ => self.push::<3, PUSH_3D>(),
        }
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) -> Result<(), SolverError> {
        let medium = terms.medium;
        let points = density.par_iter_mut().zip(pressure).zip(&self.surveyed);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, ((rho, p), found))| {
            let before = *rho;
            let mut rate = -before * found.divergence;
            if terms.density_diffusion > 0.0 {
                let slope = Vector3::from_fn(|a, _| terms.density_slope(i, a));
                let laplacian = found.density_laplacian - slope.dot(&found.kernel_asymmetry);
                rate += terms.density_diffusivity(i) * laplacian;
            }
            let sound = medium.sound_speed(i) / medium.spacing[i];
            rate += self.keys.volume_relaxation * sound * before * found.crowding;
            medium.change_density(i, before + terms.dt * rate, rho, p);
        });
        Ok(())
    }

    fn advance_velocity(
        &mut self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &mut [Vector3<f64>],
        _density: &[f64],
    ) {
        let dimension = self.dimension;
        let push = self.push.par_chunks_exact(dimension);
        let points = velocity.par_iter_mut().zip(push).zip(&self.surveyed);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, ((v, push), found))| {
            // momentum is conserved with the density that belongs to the volumes of the sums
            let density = self.density[self.family.slot_of(i)];
            for a in 0..dimension {
                let acceleration = (push[a] + found.force[a]) / density;
                v[a] += time
                    * terms.acceleration_fraction
                    * (acceleration + terms.body_acceleration(i, a));
            }
        });
    }

    fn friction(&self, _medium: &Medium, friction: &mut Vec<f64>) {
        friction.clear();
        friction.extend(self.surveyed.iter().map(|found| found.friction));
    }
}
