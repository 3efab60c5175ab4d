//! Rates by derivatives of second order at points that carry their mass.

use nalgebra::Vector3;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::SolverError;
use perimelt_core::{Family, PddoError, SlotField};
use rayon::prelude::*;

use super::FollowedFamily;
use super::surface_force::SurfaceForce;
use crate::advection::Flux;
use crate::fluid::differences::Differences;
use crate::fluid::medium::Medium;
use crate::fluid::rates::{POINTS_PER_TASK, Rates, Stability, Terms};

/// Rates at points that carry their mass.
#[derive(Debug)]
pub(super) struct LagrangianDifferences {
    core: Differences,
    /// The velocity, mirrored by walls, m/s.
    flux: Flux,
    /// Between two fluids.
    pub(super) surface: Option<Box<SurfaceForce>>,
}

impl LagrangianDifferences {
    pub(super) fn new(core: Differences, surface: Option<SurfaceForce>) -> Self {
        LagrangianDifferences {
            flux: Flux::new(core.dimension()),
            core,
            surface: surface.map(Box::new),
        }
    }

    /// Takes the family and operators of the points at their current positions.
    pub(super) fn follow(&mut self, family: FollowedFamily<'_>) -> Result<(), PddoError> {
        self.core.rebuild(family.positions, family.take)?;
        if let Some(surface) = &mut self.surface {
            surface.follow(&self.core.pddo, &mut self.core.work);
        }
        Ok(())
    }

    /// Finds the force between two fluids at points at these positions (m), with these temperatures (K) where the tension depends on them.
    pub(super) fn find_surface_force(
        &mut self,
        position: &[Vector3<f64>],
        temperature: Option<&[f64]>,
    ) {
        if let Some(surface) = &mut self.surface {
            let Differences { pddo, work, .. } = &mut self.core;
            surface.find(pddo, work, position, temperature);
        }
    }

    fn accelerate<const D: usize>(
        &self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let time = time * terms.acceleration_fraction;
        let points = velocity.par_iter_mut().enumerate();
        points.with_min_len(POINTS_PER_TASK).for_all(|(i, v)| {
            *v += time * self.core.acceleration::<D>(terms, i, density[i], None);
            if let Some(surface) = &self.surface {
                *v += time * surface.acceleration[i];
            }
        });
    }
}

impl Rates for LagrangianDifferences {
    fn family(&self) -> &Family {
        self.core.family()
    }

    fn stability(&self) -> Stability {
        self.core.stability
    }

    fn set_viscosity(&mut self, medium: &Medium) {
        self.core.set_viscosity(medium);
    }

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        self.core.set_velocity(velocity, density, terms);
        let Differences { pddo, work, .. } = &mut self.core;
        self.flux.find(pddo, work, velocity, None);
    }

    fn set_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        let volume = self.surface.as_ref().map(|s| &s.specific_volume);
        self.core.set_pressure(pressure, force, volume);
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) -> Result<(), SolverError> {
        let carried = |i, rho| rho * self.flux.divergence[i];
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
        match self.core.dimension() {
            2 => self.accelerate::<2>(terms, time, velocity, density),
            _ => self.accelerate::<3>(terms, time, velocity, density),
        }
    }

    fn friction(&self, medium: &Medium, friction: &mut Vec<f64>) {
        self.core.friction(medium, friction);
    }
}
