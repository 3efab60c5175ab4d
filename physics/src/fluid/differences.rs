//! Rates by derivatives of second order on complete families, as published (Gao (2020), eqs. 5.80 to 5.101), with two
//! differences:
//!
//! - The flux through space is mirrored by walls, also where the fluid sticks to them, so that nothing flows through a
//!   wall. With the velocity that a no-slip wall prescribes, a lid makes a spurious divergence at its corners, and the
//!   divergence is no longer the adjoint of the gradient of the mirrored pressure.
//! - An Eulerian fluid carries density by `div(rho v)`, velocity and temperature `f` by
//!   `(f div(rho v) - div(rho v f)) / rho` ([`CarriedFlow`]): mass and momentum are kept to rounding, and uniform fields
//!   stay uniform.
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
use perimelt_core::family::{Mirrored, Rising};
use perimelt_core::{Derivatives, Family, Pddo, PddoError, SlotField};
use rayon::prelude::*;

use crate::advection::Flux;

use super::convection::{CarriedFlow, largest_rate_at_walls};
use super::medium::{Coefficient, Medium};
use super::rates::{POINTS_PER_TASK, Rates, Stability, Terms};

/// A field in slot space, and some of its derivatives.
#[derive(Debug, Default)]
struct Differentiated {
    slots: SlotField,
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
    reduced: SlotField,
}

/// Coordinates and hydrostatic slopes along an axis.
#[derive(Debug, Default)]
struct Along {
    /// Coordinate by slot, m, and its Laplacian at points, 1/m, which is empty before they are needed.
    coordinate: SlotField,
    coordinate_laplacian: Vec<f64>,
    /// Slope by point and by slot, kg/m⁴, and its Laplacian at points, kg/m⁶.
    slope: Vec<f64>,
    slope_slots: SlotField,
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
        self.reduced.load(family, density, Mirrored::Scalar);
        let mut loaded = [false; 3];
        for (axis, along) in self.axes.iter_mut().enumerate().take(pddo.dimension()) {
            if terms.force.is_none() {
                continue;
            }
            let points = (0..density.len()).into_par_iter();
            let points = points.with_min_len(POINTS_PER_TASK);
            let slopes = points.map(|i| terms.density_slope(i, axis));
            slopes.collect_into_vec(&mut along.slope);
            loaded[axis] = along.slope.iter().any(|s| *s != 0.0);
            if loaded[axis] {
                if along.coordinate_laplacian.is_empty() {
                    along.coordinate.load_coordinate(family, axis);
                    pddo.laplacian(&along.coordinate, work, &mut along.coordinate_laplacian);
                }
                let slots = &mut along.slope_slots;
                slots.load(family, &along.slope[..], Mirrored::Scalar);
                let hydrostatic = along.slope_slots.par_iter().zip(&*along.coordinate);
                let slots = self.reduced.par_iter_mut().zip(hydrostatic);
                let slots = slots.with_min_len(POINTS_PER_TASK);
                slots.for_each(|(rho, (s, x))| *rho -= 0.5 * s * x);
                pddo.laplacian(&along.slope_slots, work, &mut along.slope_laplacian);
            }
        }
        pddo.laplacian(&self.reduced, work, &mut self.laplacian);
        for (along, _) in self.axes.iter().zip(loaded).filter(|(_, loaded)| *loaded) {
            let points = self.laplacian.par_iter_mut().enumerate();
            let points = points.with_min_len(POINTS_PER_TASK);
            points.for_each(|(i, laplacian)| {
                let x = along.coordinate[family.slot_of(i)];
                *laplacian += 0.5
                    * (x * along.slope_laplacian[i]
                        - along.slope[i] * along.coordinate_laplacian[i]);
            });
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
    /// The velocity of points that move, m/s.
    flux: Flux,
    /// In an Eulerian fluid.
    carried: Option<CarriedFlow>,
    /// Of an Eulerian fluid: but for convection, m/s².
    acceleration: Vec<Vector3<f64>>,
    /// Of an Eulerian fluid: in the middle of the step, m/s.
    middle_velocity: Vec<Vector3<f64>>,
    diffusion: DensityDiffusion,
    work: Derivatives,
    pressure: Differentiated,
    viscosity: Differentiated,
}

impl Differences {
    pub(super) fn new(pddo: Pddo, is_eulerian: bool) -> Self {
        Differences {
            velocity: vec![Vec::new(); pddo.dimension()],
            slope_of_divergence: Vec::new(),
            flux: Flux::new(pddo.dimension()),
            carried: is_eulerian.then(|| CarriedFlow::new(&pddo)),
            acceleration: Vec::new(),
            middle_velocity: Vec::new(),
            diffusion: DensityDiffusion::default(),
            work: Derivatives::default(),
            pressure: Differentiated::default(),
            viscosity: Differentiated::default(),
            pddo,
        }
    }

    /// Acceleration of a point of this density (kg/m³) but for convection, m/s².
    #[inline(always)]
    fn acceleration<const D: usize>(
        &self,
        terms: &Terms<'_>,
        (i, density): (usize, f64),
    ) -> Vector3<f64> {
        let viscosity = &terms.medium.viscosity;
        let of: [&[f64]; D] = std::array::from_fn(|b| row(&self.velocity[b], D + 1, i));
        let pressure = row(&self.pressure.rows, D, i);
        let slope = viscosity.varies.then(|| row(&self.viscosity.rows, D, i));
        let viscosity = viscosity.value[i];
        let mut acceleration = Vector3::zeros();
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
            if let Some(carried) = &self.carried {
                force += carried.short_waves(i, a);
            }
            acceleration[a] = force / density + terms.body_acceleration(i, a);
        }
        acceleration
    }

    fn accelerate<const D: usize>(
        &self,
        terms: &Terms<'_>,
        dt: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let time = dt * terms.acceleration_fraction;
        let points = velocity.par_iter_mut().enumerate();
        points
            .with_min_len(POINTS_PER_TASK)
            .for_each(|(i, v)| match &self.carried {
                Some(carried) => {
                    let others = self.acceleration[i];
                    for a in 0..D {
                        let carried = carried.force(i, a, v[a]) / density[i];
                        v[a] += time * (others[a] + carried);
                    }
                }
                None => *v += time * self.acceleration::<D>(terms, (i, density[i])),
            });
    }

    /// Finds the acceleration but for convection, and the velocity after half a step of this size (s).
    fn find_middle<const D: usize>(
        &mut self,
        (terms, dt): (&Terms<'_>, f64),
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) {
        let mut found = (
            std::mem::take(&mut self.acceleration),
            std::mem::take(&mut self.middle_velocity),
        );
        let time = 0.5 * dt * terms.acceleration_fraction;
        let of_point = |(i, velocity): (usize, &Vector3<f64>)| {
            let acceleration = self.acceleration::<D>(terms, (i, density[i]));
            let mut middle = *velocity;
            for a in 0..D {
                let slope = row(&self.velocity[a], D + 1, i);
                let carried: f64 = (0..D).map(|b| velocity[b] * slope[b]).sum();
                middle[a] += time * (acceleration[a] - carried);
            }
            (acceleration, middle)
        };
        let points = velocity.par_iter().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK);
        points
            .map(of_point)
            .unzip_into_vecs(&mut found.0, &mut found.1);
        (self.acceleration, self.middle_velocity) = found;
    }

    /// Rate of the density by diffusion, kg/(m³ s).
    fn diffusion_rate(&self, terms: &Terms<'_>, point: usize) -> f64 {
        match terms.density_diffusion > 0.0 {
            true => terms.density_diffusivity(point) * self.diffusion.laplacian[point],
            false => 0.0,
        }
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
        axes.for_each(|along| along.coordinate_laplacian.clear());
        self.pddo.rebuild(positions, family)
    }

    fn stability(&self) -> Stability {
        // all families are complete
        let mut laplacian = self.pddo.laplacian_sum(0);
        if self.carried.is_some() {
            laplacian = laplacian.max(0.5 * largest_rate_at_walls(&self.pddo));
        }
        Stability {
            wave_number: self.pddo.largest_wave_number(0),
            laplacian,
        }
    }

    fn set_viscosity(&mut self, medium: &Medium) {
        let (pddo, work) = (&self.pddo, &mut self.work);
        self.viscosity
            .set_coefficient(&medium.viscosity, pddo, work);
    }

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        let (pddo, work) = (&self.pddo, &mut self.work);
        for (slots, rows) in velocity.iter().zip(&mut self.velocity) {
            pddo.gradient_and_laplacian(slots, work, rows);
        }
        if terms.compressible {
            pddo.gradient_of_divergence(velocity, work, &mut self.slope_of_divergence);
        }
        if terms.density_diffusion > 0.0 {
            self.diffusion.find((pddo, work), density, terms);
        }
        let Some(mut carried) = self.carried.take() else {
            return self.flux.find(pddo, work, velocity, None);
        };
        let mut work = std::mem::take(&mut self.work);
        let rate = |i: usize| self.diffusion_rate(terms, i);
        let operator = (&self.pddo, &mut work);
        carried.set_mass(operator, velocity, density, (terms.dt, rate));
        let dimension = velocity.len();
        let laplacian =
            |i: usize, axis: usize| row(&self.velocity[axis], dimension + 1, i)[dimension];
        let operator = (&self.pddo, &mut work);
        carried.set_short_waves(operator, velocity, density, (terms, laplacian));
        (self.work, self.carried) = (work, Some(carried));
    }

    fn carry(&mut self, terms: &Terms<'_>, dt: f64, velocity: &[Vector3<f64>], density: &[f64]) {
        if self.carried.is_none() {
            return;
        }
        match self.velocity.len() {
            2 => self.find_middle::<2>((terms, dt), velocity, density),
            _ => self.find_middle::<3>((terms, dt), velocity, density),
        }
        if let Some(carried) = &mut self.carried {
            let (operator, middle) = ((&self.pddo, &mut self.work), &self.middle_velocity);
            carried.set_momentum(operator, middle, terms.rules);
        }
    }

    fn mass_flux(&self, flux: &mut [Vector3<f64>]) {
        if let Some(carried) = &self.carried {
            carried.copy_mass_flux(flux);
        }
    }

    fn set_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        let slots = &mut self.pressure.slots;
        let hydrostatic =
            Rising(|axis, point, distance| force.map_or(0.0, |f| f[point][axis] * distance));
        slots.load(self.pddo.family(), pressure, hydrostatic);
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
                let carried = match &self.carried {
                    Some(carried) => carried.mass.divergence[i],
                    None => before * self.flux.divergence[i],
                };
                *rho += dt * (self.diffusion_rate(terms, i) - carried);
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
