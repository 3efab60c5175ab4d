//! What an Eulerian fluid carries through its points: mass and momentum, and the stabilisation of the convective terms.
//!
//! ```text
//! rho' = rho - dt div m,       m = rho* v,   rho* = rho - dt/2 div(rho v)
//! v'   = v + dt (a + (v div m - div(m v*)) / rho),   v* = v + dt/2 (a - v . grad v)
//! ```
//!
//! with the acceleration `a` by pressure, viscosity and forces. Carried values in the middle of the step neither let
//! sound grow, which values at its start do by `kappa^2 c |v| dt^2 / 2` in a step, nor take `v^2 dt / 2` from the
//! diffusivity; in a steady flow they are those at the start. What enters through one point leaves another: mass and momentum are
//! kept to rounding.

use nalgebra::Vector3;
use perimelt_core::family::{ByRules, LayerRule, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::pddo::second;
use perimelt_core::{Derivatives, Pddo, SlotField};
use rayon::prelude::*;

use crate::advection::{Convection, Flux, ShortWaves};

use crate::fluid::rates::{POINTS_PER_TASK, Terms};

/// Derivatives with their work arrays.
pub(super) struct Operator<'a> {
    pub(super) pddo: &'a Pddo,
    pub(super) work: &'a mut Derivatives,
}

/// The flow at the start of a step.
#[derive(Clone, Copy)]
pub(super) struct CarriedFields<'a> {
    /// Components by slot, m/s.
    pub(super) velocity: &'a [SlotField],
    /// By point, kg/m³.
    pub(super) density: &'a [f64],
}

/// Convection with its work arrays.
#[derive(Debug)]
pub(crate) struct CarriedFlow {
    convection: Convection,
    /// Flux of mass, kg/(m² s).
    pub(super) mass: Flux,
    /// Fluxes of momentum along each axis, kg/(m s²).
    momentum: Vec<Flux>,
    /// Decay of short waves of each component of the momentum, N/m³.
    short_waves: Vec<ShortWaves>,
    /// By slot.
    density: SlotField,
    velocity: SlotField,
    /// In the middle of the step, by point.
    middle_density: Vec<f64>,
    /// Slot of each point.
    slot: Vec<u32>,
    /// Diffusivity that short waves lack, times density over the sum of the weights of the Laplacian, kg/(m s) m².
    missing: Vec<f64>,
    /// Sum of the weights of the Laplacian times the squared spacing.
    laplacian: f64,
}

impl CarriedFlow {
    pub(super) fn new(pddo: &Pddo, convection: Convection) -> Self {
        let (dimension, family) = (pddo.dimension(), pddo.family());
        let slot = |point: usize| family.slot_of(point) as u32;
        CarriedFlow {
            convection,
            mass: Flux::new(dimension),
            momentum: vec![Flux::new(dimension); dimension],
            short_waves: vec![ShortWaves::default(); dimension],
            density: SlotField::default(),
            velocity: SlotField::default(),
            middle_density: Vec::new(),
            slot: (0..pddo.points()).map(slot).collect(),
            missing: Vec::new(),
            laplacian: 0.0,
        }
    }

    /// Sets the flux of mass for a velocity by slot; `diffusion` (kg/(m³ s)) is what else changes the density.
    pub(super) fn set_mass(
        &mut self,
        operator: &mut Operator<'_>,
        flow: CarriedFields<'_>,
        dt: f64,
        diffusion: impl Fn(usize) -> f64 + Sync,
    ) {
        let Operator { pddo, work } = operator;
        let CarriedFields { velocity, density } = flow;
        let family = pddo.family();
        self.density.load(family, density, Mirrored::Scalar);
        self.mass.find(pddo, work, velocity, Some(&self.density));
        let divergence = &self.mass.divergence;
        let middle = |(i, rho): (usize, &f64)| rho + 0.5 * dt * (diffusion(i) - divergence[i]);
        let points = density.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK).map(middle);
        points.fill(&mut self.middle_density);
        let middle = &self.middle_density[..];
        self.density.load(family, middle, Mirrored::Scalar);
        self.mass.find(pddo, work, velocity, Some(&self.density));
    }

    /// Finds the decay of short waves; `laplacian(point, axis)` is that of the velocity, 1/(m s).
    pub(super) fn set_short_waves(
        &mut self,
        operator: &mut Operator<'_>,
        flow: CarriedFields<'_>,
        terms: &Terms<'_>,
        laplacian: impl Fn(usize, usize) -> f64 + Sync,
    ) {
        let Operator { pddo, work } = operator;
        let CarriedFields { velocity, density } = flow;
        let (convection, medium) = (self.convection, terms.medium);
        if self.laplacian == 0.0 {
            self.laplacian = pddo.laplacian_sum(0) * medium.spacing[0].powi(2);
        }
        let missing = |(i, slot): (usize, &u32)| {
            let square: f64 = velocity.iter().map(|v| v[*slot as usize].powi(2)).sum();
            let spacing = medium.spacing[i];
            let sum = self.laplacian / (spacing * spacing);
            let diffusivity = medium.viscosity.value[i] / density[i];
            let missing = convection.missing_diffusivity(square.sqrt(), spacing, sum, diffusivity);
            density[i] * missing / sum
        };
        let points = self.slot.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK).map(missing);
        points.fill(&mut self.missing);
        if self.missing.iter().all(|missing| *missing == 0.0) {
            return self.short_waves.iter_mut().for_each(ShortWaves::vanish);
        }
        for (axis, short_waves) in self.short_waves.iter_mut().enumerate() {
            let difference = |i: usize| -self.missing[i] * laplacian(i, axis);
            short_waves.find(pddo, work, terms.rules, axis, difference);
        }
    }

    /// Copies the flux of mass to points, kg/(m² s).
    pub(super) fn copy_mass_flux(&self, flux: &mut [Vector3<f64>]) {
        let points = flux.par_iter_mut().zip(&self.slot);
        points
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(flux, slot)| *flux = self.mass.at(*slot as usize));
    }

    /// Rate at which the momentum of short waves along an axis decays, N/m³.
    pub(crate) fn short_waves(&self, point: usize, axis: usize) -> f64 {
        self.short_waves[axis].rate(point)
    }

    /// Sets the flux of momentum for the velocity in the middle of the step (m/s).
    pub(super) fn set_momentum(
        &mut self,
        operator: &mut Operator<'_>,
        velocity: &[Vector3<f64>],
        rules: &[LayerRule],
    ) {
        let Operator { pddo, work } = operator;
        for (axis, carried) in self.momentum.iter_mut().enumerate() {
            let along = |point: usize| velocity[point][axis];
            let ghosts = ByRules(rules, axis);
            self.velocity.load(pddo.family(), along, ghosts);
            carried.carry(pddo, work, &self.mass, &self.velocity);
        }
    }

    /// What convection gives to the momentum along an axis at a point with this velocity at the start of the step,
    /// N/m³.
    pub(super) fn force(&self, point: usize, axis: usize, velocity: f64) -> f64 {
        self.momentum[axis].net(&self.mass, point, velocity)
    }
}

/// Largest rate at which the Laplacian changes a field between two walls behind which layers are curved
/// ([`Curved`](perimelt_core::family::Curved)), 1/m²: layers that reach far behind the wall weigh
/// more than the points before it.
pub(super) fn largest_rate_at_walls(pddo: &Pddo) -> f64 {
    let mut bonds: Vec<(f64, f64)> = Vec::new();
    let mut spacing = f64::INFINITY;
    let dimension = pddo.dimension();
    pddo.for_each_bond(0, |bond, _, g| {
        let weight = (0..dimension).map(|a| g[second(dimension, a, a)]).sum();
        bonds.push((bond.xi[0], weight));
        spacing = bond.length.min(spacing);
    });
    // weights of rows of points across the wall
    let row = |(x, weight): (f64, f64)| ((x / spacing).round() as i64, weight);
    let rows: Vec<(i64, f64)> = bonds.into_iter().map(row).collect();
    let reach = rows.iter().map(|(row, _)| row.abs()).max().unwrap_or(1);
    let points = 4 * reach + 8;
    let value = |field: &[f64], at: i64| {
        let from_wall = |at: i64| field[(if at < 0 { -1 - at } else { at }) as usize];
        let behind = |field: &dyn Fn(i64) -> f64, layer: i64| {
            let distance = layer as f64 - 0.5;
            4.0 / 3.0 * (field(1) - 3.0 * field(0)) * distance * distance - field(layer - 1)
        };
        match at {
            at if at < 0 => behind(&from_wall, -at),
            at if at >= points => {
                behind(&|k: i64| field[(points - 1 - k) as usize], at - points + 1)
            }
            at => field[at as usize],
        }
    };
    let mut field: Vec<f64> = (0..points)
        .map(|i| if i % 2 == 0 { 1.0 } else { -1.0 })
        .collect();
    let mut largest = 0.0_f64;
    for _ in 0..200 {
        let rate = |i: i64| -> f64 {
            let own = field[i as usize];
            rows.iter()
                .map(|(row, w)| w * (own - value(&field, i + row)))
                .sum()
        };
        let rates: Vec<f64> = (0..points).map(rate).collect();
        largest = rates.iter().fold(0.0, |a, r| r.abs().max(a));
        field = rates.into_iter().map(|r| r / largest).collect();
    }
    largest
}
