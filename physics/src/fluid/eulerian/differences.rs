//! Rates by derivatives of second order at points through which the fluid flows.

use nalgebra::Vector3;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::SolverError;
use perimelt_core::{Family, SlotField};
use rayon::prelude::*;

use super::carried_flow::{CarriedFields, CarriedFlow, Operator, largest_rate_at_walls};
use crate::advection::Convection;
use crate::fluid::differences::Differences;
use crate::fluid::medium::Medium;
use crate::fluid::rates::{POINTS_PER_TASK, Rates, Stability, Terms};

/// Rates at points through which the fluid flows.
#[derive(Debug)]
pub(super) struct EulerianDifferences {
    core: Differences,
    carried: CarriedFlow,
    /// By pressure, viscosity, forces and the decay of short waves, m/s².
    acceleration: Vec<Vector3<f64>>,
    /// In the middle of the step, m/s.
    middle_velocity: Vec<Vector3<f64>>,
}

impl EulerianDifferences {
    pub(super) fn new(core: Differences, convection: Convection) -> Self {
        EulerianDifferences {
            carried: CarriedFlow::new(&core.pddo, convection),
            core,
            acceleration: Vec::new(),
            middle_velocity: Vec::new(),
        }
    }

    /// Copies the flux of mass to points, kg/(m² s).
    pub(super) fn mass_flux(&self, flux: &mut [Vector3<f64>]) {
        self.carried.copy_mass_flux(flux);
    }

    /// Finds the acceleration but for convection, and the velocity after half a step of this size (s).
    fn find_middle<const D: usize>(
        &mut self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) {
        let half = 0.5 * time * terms.acceleration_fraction;
        let (core, carried) = (&self.core, &self.carried);
        let at_point = |(i, velocity): (usize, &Vector3<f64>)| {
            let acceleration = core.acceleration::<D>(terms, i, density[i], Some(carried));
            let mut middle = *velocity;
            for a in 0..D {
                let slope = core.velocity_row(a, i);
                let carried: f64 = (0..D).map(|b| velocity[b] * slope[b]).sum();
                middle[a] += half * (acceleration[a] - carried);
            }
            (acceleration, middle)
        };
        let points = velocity.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK).map(at_point);
        points.unzip_into_vecs(&mut self.acceleration, &mut self.middle_velocity);
    }
}

impl Rates for EulerianDifferences {
    fn family(&self) -> &Family {
        self.core.family()
    }

    fn stability(&self) -> Stability {
        let within = self.core.stability;
        let at_walls = 0.5 * largest_rate_at_walls(&self.core.pddo);
        Stability {
            laplacian: within.laplacian.max(at_walls),
            ..within
        }
    }

    fn set_viscosity(&mut self, medium: &Medium) {
        self.core.set_viscosity(medium);
    }

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        self.core.set_velocity(velocity, density, terms);
        let mut work = std::mem::take(&mut self.core.work);
        let core = &self.core;
        let mut operator = Operator {
            pddo: &core.pddo,
            work: &mut work,
        };
        let flow = CarriedFields { velocity, density };
        let diffusion = |i: usize| core.diffusion_rate(terms, i);
        self.carried
            .set_mass(&mut operator, flow, terms.dt, diffusion);
        let dimension = velocity.len();
        let laplacian = |i: usize, axis: usize| core.velocity_row(axis, i)[dimension];
        self.carried
            .set_short_waves(&mut operator, flow, terms, laplacian);
        self.core.work = work;
    }

    fn set_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        self.core.set_pressure(pressure, force, None);
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) -> Result<(), SolverError> {
        let carried = |i, _| self.carried.mass.divergence[i];
        self.core.advance_density(terms, density, pressure, carried);
        Ok(())
    }

    fn advance_velocity(
        &mut self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let dimension = self.core.dimension();
        match dimension {
            2 => self.find_middle::<2>(terms, time, velocity, density),
            _ => self.find_middle::<3>(terms, time, velocity, density),
        }
        let mut operator = Operator {
            pddo: &self.core.pddo,
            work: &mut self.core.work,
        };
        self.carried
            .set_momentum(&mut operator, &self.middle_velocity, terms.rules);
        let time = time * terms.acceleration_fraction;
        let points = velocity.par_iter_mut().enumerate();
        points.with_min_len(POINTS_PER_TASK).for_all(|(i, v)| {
            let others = self.acceleration[i];
            for a in 0..dimension {
                let carried = self.carried.force(i, a, v[a]) / density[i];
                v[a] += time * (others[a] + carried);
            }
        });
    }

    fn friction(&self, medium: &Medium, friction: &mut Vec<f64>) {
        self.core.friction(medium, friction);
    }
}
