//! Rates by derivatives of second order on complete families, as published (Gao (2020), eqs. 5.80 to 5.101), with two
//! differences:
//!
//! - The flux through space is mirrored by walls, also where the fluid sticks to them, so that nothing flows through a
//!   wall. With the velocity that a no-slip wall prescribes, a lid makes a spurious divergence at its corners, and the
//!   divergence is no longer the adjoint of the gradient of the mirrored pressure.
//! - An Eulerian fluid carries density by `div(rho v)`, velocity and temperature `f` by
//!   `(div(rho v f) - f div(rho v)) / rho`: mass and momentum are kept to rounding, and uniform fields stay uniform.
//!
//! Only the part of the density that is not hydrostatic diffuses, pair by pair and with nothing through walls, so that
//! mass is kept to rounding where all families are equal:
//!
//! ```text
//! sum_j g2 [rho_j - rho_i - (s_i + s_j)/2 . (x_j - x_i)],   s = f / c^2
//! ```
//!
//! with the force density f; behind a wall rho, s and x are those of the mirror point.

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::{Derivatives, Family, Pddo, PddoError};
use rayon::prelude::*;

use crate::advection::Flux;

use super::medium::{Coefficient, Medium};
use super::rates::{POINTS_PER_TASK, Rates, Stability, Terms, load_weighted};

/// A field in slot space, and some of its derivatives.
#[derive(Debug, Default)]
struct Differentiated {
    slots: Vec<f64>,
    /// One row for each point: the first derivatives, and after them the Laplacian where it is needed.
    rows: Vec<f64>,
}

impl Differentiated {
    /// Sets a coefficient; nothing is done where it is uniform.
    fn set_coefficient(&mut self, coefficient: &Coefficient, pddo: &Pddo, work: &mut Derivatives) {
        if coefficient.varies {
            coefficient.load(pddo.family(), &mut self.slots);
            pddo.gradient(&self.slots, work, &mut self.rows);
        }
    }
}

/// Laplacian of the part of the density that is not hydrostatic, with its work arrays.
#[derive(Debug, Default)]
struct DensityDiffusion {
    /// kg/m⁵.
    laplacian: Vec<f64>,
    axes: [Along; 3],
    /// `rho - s . x / 2` by slot, kg/m³.
    reduced: Vec<f64>,
}

/// Coordinates and hydrostatic slopes along an axis.
#[derive(Debug, Default)]
struct Along {
    /// Coordinate by slot, m, and its Laplacian at points, 1/m; empty before they are needed.
    coordinate: Vec<f64>,
    coordinate_laplacian: Vec<f64>,
    /// Slope by point and by slot, kg/m⁴, and its Laplacian at points, kg/m⁶.
    slope: Vec<f64>,
    slope_slots: Vec<f64>,
    slope_laplacian: Vec<f64>,
}

impl DensityDiffusion {
    fn find(
        &mut self,
        (pddo, work): (&Pddo, &mut Derivatives),
        density: &[f64],
        terms: &Terms<'_>,
    ) {
        let family = pddo.family();
        family.load((density, 1), 0, &[], &mut self.reduced);
        let mut loaded = [false; 3];
        for (axis, along) in self.axes.iter_mut().enumerate().take(pddo.dimension()) {
            along.slope.clear();
            let slopes = (0..density.len()).map(|i| terms.density_slope(i, axis));
            along.slope.extend(slopes);
            loaded[axis] = along.slope.iter().any(|s| *s != 0.0);
            if loaded[axis] {
                if along.coordinate.is_empty() {
                    family.mirrored_coordinates(axis, &mut along.coordinate);
                    pddo.laplacian(&along.coordinate, work, &mut along.coordinate_laplacian);
                }
                family.load((&along.slope, 1), 0, &[], &mut along.slope_slots);
                let hydrostatic = along.slope_slots.iter().zip(&along.coordinate);
                let slots = self.reduced.iter_mut().zip(hydrostatic);
                slots.for_each(|(rho, (s, x))| *rho -= 0.5 * s * x);
                pddo.laplacian(&along.slope_slots, work, &mut along.slope_laplacian);
            }
        }
        pddo.laplacian(&self.reduced, work, &mut self.laplacian);
        for (along, _) in self.axes.iter().zip(loaded).filter(|(_, loaded)| *loaded) {
            for (i, laplacian) in self.laplacian.iter_mut().enumerate() {
                let x = along.coordinate[family.slot_of(i)];
                *laplacian += 0.5
                    * (x * along.slope_laplacian[i]
                        - along.slope[i] * along.coordinate_laplacian[i]);
            }
        }
    }
}

/// The row of a point, in rows of this width.
#[inline(always)]
fn row(rows: &[f64], width: usize, point: usize) -> &[f64] {
    &rows[point * width..][..width]
}

/// Fields of the flow with their derivatives.
#[derive(Debug)]
pub(super) struct Differences {
    pddo: Pddo,
    /// Rows of each component: the first derivatives, then the Laplacian.
    velocity: Vec<Vec<f64>>,
    /// Of the divergence of the velocity.
    slope_of_divergence: Vec<f64>,
    /// The velocity of a fluid that moves, m/s; the flux of mass of one that does not, kg/(m² s).
    flux: Flux,
    /// Momentum along each axis, kg/(m s²).
    carried_momentum: Vec<Flux>,
    /// By slot.
    density: Vec<f64>,
    diffusion: DensityDiffusion,
    work: Derivatives,
    pressure: Differentiated,
    viscosity: Differentiated,
}

impl Differences {
    pub(super) fn new(pddo: Pddo) -> Self {
        Differences {
            velocity: vec![Vec::new(); pddo.dimension()],
            slope_of_divergence: Vec::new(),
            flux: Flux::new(pddo.dimension()),
            carried_momentum: vec![Flux::new(pddo.dimension()); pddo.dimension()],
            density: Vec::new(),
            diffusion: DensityDiffusion::default(),
            work: Derivatives::default(),
            pressure: Differentiated::default(),
            viscosity: Differentiated::default(),
            pddo,
        }
    }

    fn accelerate<const D: usize>(
        &self,
        terms: &Terms<'_>,
        dt: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let medium = terms.medium;
        let viscosity = &medium.viscosity;
        let points = velocity.par_iter_mut().enumerate();
        points.with_min_len(POINTS_PER_TASK).for_each(|(i, v)| {
            let of: [&[f64]; D] = std::array::from_fn(|b| row(&self.velocity[b], D + 1, i));
            let pressure = row(&self.pressure.rows, D, i);
            let slope = viscosity.varies.then(|| row(&self.viscosity.rows, D, i));
            let before = *v;
            let least = terms
                .convection
                .map_or(0.0, |c| medium.least_diffusivity(c, i, before.norm()));
            let viscosity = viscosity.value[i].max(least * density[i]);
            for a in 0..D {
                let mut force = viscosity * of[a][D] - pressure[a];
                if terms.compressible {
                    force += viscosity / 3.0 * row(&self.slope_of_divergence, D, i)[a];
                }
                if let Some(slope) = slope {
                    force += (0..D)
                        .map(|b| (of[a][b] + of[b][a]) * slope[b])
                        .sum::<f64>();
                }
                let mut acceleration = force / density[i] + terms.body_acceleration(i, a);
                if terms.convection.is_some() {
                    acceleration +=
                        self.carried_momentum[a].net(&self.flux, i, before[a]) / density[i];
                }
                v[a] += dt * terms.acceleration_fraction * acceleration;
            }
        });
    }

    /// Heat of viscous friction over the viscosity, 1/s² (Gao (2020), eq. 5.65).
    fn dissipation(&self, point: usize) -> f64 {
        let dimension = self.velocity.len();
        let of = |a: usize, b: usize| row(&self.velocity[a], dimension + 1, point)[b];
        let mut sum = 0.0;
        for a in 0..dimension {
            sum += 2.0 * of(a, a).powi(2);
            sum += (0..a).map(|b| (of(a, b) + of(b, a)).powi(2)).sum::<f64>();
        }
        sum
    }
}

impl Rates for Differences {
    fn family(&self) -> &Family {
        self.pddo.family()
    }

    fn follow(
        &mut self,
        positions: &[Vector3<f64>],
        family: &dyn Fn() -> Arc<Family>,
    ) -> Result<(), PddoError> {
        let axes = self.diffusion.axes.iter_mut();
        axes.for_each(|along| along.coordinate.clear());
        self.pddo.rebuild(positions, family)
    }

    fn stability(&self) -> Stability {
        // all families are complete
        Stability {
            wave_number: self.pddo.largest_wave_number(0),
            laplacian: self.pddo.laplacian_sum(0),
        }
    }

    fn set_viscosity(&mut self, medium: &Medium) {
        let (pddo, work) = (&self.pddo, &mut self.work);
        self.viscosity
            .set_coefficient(&medium.viscosity, pddo, work);
    }

    fn set_velocity(&mut self, velocity: &[Vec<f64>], density: &[f64], terms: &Terms<'_>) {
        let is_eulerian = terms.convection.is_some();
        let (pddo, work) = (&self.pddo, &mut self.work);
        for (slots, rows) in velocity.iter().zip(&mut self.velocity) {
            pddo.gradient_and_laplacian(slots, work, rows);
        }
        if terms.compressible {
            pddo.gradient_of_divergence(velocity, work, &mut self.slope_of_divergence);
        }
        if is_eulerian {
            // the density of the hydrostatic pressure behind the faces
            load_weighted(
                pddo.family(),
                density,
                &mut self.density,
                |axis, point, distance| terms.density_slope(point, axis) * distance,
            );
        }
        if terms.density_diffusion > 0.0 {
            self.diffusion.find((pddo, work), density, terms);
        }
        let density = is_eulerian.then_some(&self.density[..]);
        self.flux.find((pddo, work), velocity, density);
        if is_eulerian {
            for (carried, velocity) in self.carried_momentum.iter_mut().zip(velocity) {
                carried.carry((pddo, work), &self.flux, velocity);
            }
        }
    }

    fn set_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        let slots = &mut self.pressure.slots;
        load_weighted(
            self.pddo.family(),
            pressure,
            slots,
            |axis, point, distance| force.map_or(0.0, |f| f[point][axis] * distance),
        );
        self.pddo
            .gradient(slots, &mut self.work, &mut self.pressure.rows);
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        dt: f64,
        (density, pressure): (&mut [f64], &mut [f64]),
    ) {
        let medium = terms.medium;
        let points = density.par_iter_mut().zip(pressure).enumerate();
        points
            .with_min_len(POINTS_PER_TASK)
            .for_each(|(i, (rho, p))| {
                let before = *rho;
                let mut rate = match terms.convection {
                    Some(_) => -self.flux.divergence[i],
                    None => -before * self.flux.divergence[i],
                };
                if terms.density_diffusion > 0.0 {
                    rate += terms.density_diffusivity(i) * self.diffusion.laplacian[i];
                }
                *rho += dt * rate;
                *p = medium.pressure(i, (before, *rho), *p);
            });
    }

    fn advance_velocity(
        &self,
        terms: &Terms<'_>,
        dt: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        match self.velocity.len() {
            2 => self.accelerate::<2>(terms, dt, velocity, density),
            _ => self.accelerate::<3>(terms, dt, velocity, density),
        }
    }

    fn friction(&self, medium: &Medium, friction: &mut Vec<f64>) {
        let viscosity = medium.viscosity.value.par_iter().enumerate();
        let of_point = |(i, mu): (usize, &f64)| mu * self.dissipation(i);
        let viscosity = viscosity.with_min_len(POINTS_PER_TASK);
        viscosity.map(of_point).collect_into_vec(friction);
    }
}
