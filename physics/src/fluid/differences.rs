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
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Body, Derivatives, Family, Pddo, PddoError, SetupError, SlotField};
use rayon::prelude::*;

use super::eulerian::CarriedFlow;
use super::kinds::DifferencesKeys;
use super::medium::Medium;
use super::rates::{POINTS_PER_TASK, Stability, Terms};
use super::surface_waves;
use super::viscosity::{Viscosity, squared_shear_rate};
use crate::shape_tensor::CompleteFamily;

/// A field in slot space, and some of its derivatives.
#[derive(Debug, Default)]
struct Differentiated {
    slots: SlotField,
    /// One row for each point: the first derivatives, and after them the Laplacian where it is needed.
    rows: Vec<f64>,
}

impl Differentiated {
    /// Sets the viscosity; nothing is done where it is uniform.
    fn set_viscosity(&mut self, viscosity: &Viscosity, pddo: &Pddo, work: &mut Derivatives) {
        if viscosity.varies {
            viscosity.load(pddo.family(), &mut self.slots);
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
    fn find(&mut self, pddo: &Pddo, work: &mut Derivatives, density: &[f64], terms: &Terms<'_>) {
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
            slopes.fill(&mut along.slope);
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
                slots.for_all(|(rho, (s, x))| *rho -= 0.5 * s * x);
                pddo.laplacian(&along.slope_slots, work, &mut along.slope_laplacian);
            }
        }
        pddo.laplacian(&self.reduced, work, &mut self.laplacian);
        for (along, _) in self.axes.iter().zip(loaded).filter(|(_, loaded)| *loaded) {
            let points = self.laplacian.par_iter_mut().enumerate();
            let points = points.with_min_len(POINTS_PER_TASK);
            points.for_all(|(i, laplacian)| {
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

/// Fields of the flow with their derivatives: what points that carry their mass and points through which the fluid flows have in
/// common.
#[derive(Debug)]
pub(super) struct Differences {
    pub(super) pddo: Pddo,
    pub(super) work: Derivatives,
    /// At the reference positions.
    pub(super) stability: Stability,
    /// Whether the viscous stress has the term of the divergence.
    is_compressible: bool,
    /// Rows of each component: the first derivatives, then the Laplacian.
    velocity: Vec<Vec<f64>>,
    /// Of each component, `sum_j mu_ij (v_j - v_i) g2` with the mean of both viscosities in series, N/m³; empty where the
    /// viscosity is uniform.
    friction: Vec<Vec<f64>>,
    slope_of_divergence: Vec<f64>,
    diffusion: DensityDiffusion,
    pressure: Differentiated,
    /// Whether rows of the pressure are forces per mass, m/s².
    is_per_mass: bool,
    viscosity: Differentiated,
}

impl Differences {
    pub(super) fn prepare(
        keys: DifferencesKeys,
        body: &Body,
        family: Arc<Family>,
        complete: &CompleteFamily,
    ) -> Result<Self, SetupError> {
        let pddo = Pddo::build(body, family, 2);
        let pddo = pddo.map_err(|e| SetupError::other("horizon", e))?;
        let mut work = Derivatives::default();
        let mut stability = Stability {
            wave_number: pddo.largest_wave_number(complete.point),
            laplacian: pddo.laplacian_sum(complete.point),
        };
        if let Some(wave_number) = surface_waves::largest_wave_number(&pddo, complete, &mut work) {
            stability.wave_number = stability.wave_number.max(wave_number);
        }
        Ok(Differences {
            is_compressible: keys.is_compressible,
            velocity: vec![Vec::new(); pddo.dimension()],
            friction: vec![Vec::new(); pddo.dimension()],
            slope_of_divergence: Vec::new(),
            diffusion: DensityDiffusion::default(),
            work,
            stability,
            pressure: Differentiated::default(),
            is_per_mass: false,
            viscosity: Differentiated::default(),
            pddo,
        })
    }

    pub(super) fn dimension(&self) -> usize {
        self.velocity.len()
    }

    pub(super) fn family(&self) -> &Family {
        self.pddo.family()
    }

    /// First derivatives and Laplacian of a component of the velocity at a point.
    #[inline(always)]
    pub(super) fn velocity_row(&self, component: usize, point: usize) -> &[f64] {
        row(&self.velocity[component], self.dimension() + 1, point)
    }

    /// Takes the family and operators of the points at their current positions (m).
    pub(super) fn rebuild(
        &mut self,
        positions: &[Vector3<f64>],
        family: &dyn Fn() -> Arc<Family>,
    ) -> Result<(), PddoError> {
        let axes = self.diffusion.axes.iter_mut();
        axes.for_each(|along| along.coordinate_laplacian.clear());
        self.pddo.rebuild(positions, family)
    }

    pub(super) fn set_viscosity(&mut self, medium: &Medium) {
        let (pddo, work) = (&self.pddo, &mut self.work);
        self.viscosity.set_viscosity(&medium.viscosity, pddo, work);
    }

    pub(super) fn set_velocity(
        &mut self,
        velocity: &[SlotField],
        density: &[f64],
        terms: &Terms<'_>,
    ) {
        let (pddo, work) = (&self.pddo, &mut self.work);
        for (slots, rows) in velocity.iter().zip(&mut self.velocity) {
            pddo.gradient_and_laplacian(slots, work, rows);
        }
        if terms.medium.viscosity.varies {
            let viscosity = &self.viscosity.slots;
            for (slots, friction) in velocity.iter().zip(&mut self.friction) {
                pddo.laplacian_in_series(slots, viscosity, work, friction);
            }
        }
        if self.is_compressible {
            pddo.gradient_of_divergence(velocity, work, &mut self.slope_of_divergence);
        }
        if terms.density_diffusion > 0.0 {
            self.diffusion.find(pddo, work, density, terms);
        }
    }

    /// Sets the pressure. With the specific volumes (m³/kg) of two fluids by slot, differences count with their mean in series, so that
    /// the pressure may jump where the density does.
    pub(super) fn set_pressure(
        &mut self,
        pressure: &[f64],
        force: Option<&[Vector3<f64>]>,
        specific_volume: Option<&SlotField>,
    ) {
        let (pddo, work) = (&self.pddo, &mut self.work);
        let Differentiated { slots, rows } = &mut self.pressure;
        let hydrostatic =
            Rising(|axis, point, distance| force.map_or(0.0, |f| f[point][axis] * distance));
        slots.load(pddo.family(), pressure, hydrostatic);
        self.is_per_mass = specific_volume.is_some();
        match specific_volume {
            Some(volume) => pddo.gradient_in_series(slots, volume, work, rows),
            None => pddo.gradient(slots, work, rows),
        }
    }

    /// Acceleration of a point of this density (kg/m³) but for convection, with the decay of short waves of a flow that is
    /// carried, m/s².
    #[inline(always)]
    pub(super) fn acceleration<const D: usize>(
        &self,
        terms: &Terms<'_>,
        i: usize,
        density: f64,
        carried: Option<&CarriedFlow>,
    ) -> Vector3<f64> {
        let viscosity = &terms.medium.viscosity;
        let of: [&[f64]; D] = std::array::from_fn(|b| row(&self.velocity[b], D + 1, i));
        let pressure = row(&self.pressure.rows, D, i);
        let weight = match self.is_per_mass {
            true => density,
            false => 1.0,
        };
        let slope = viscosity.varies.then(|| row(&self.viscosity.rows, D, i));
        let viscosity = viscosity.value[i];
        let mut acceleration = Vector3::zeros();
        for a in 0..D {
            let friction = match slope {
                Some(_) => self.friction[a][i],
                None => viscosity * of[a][D],
            };
            let mut force = friction - weight * pressure[a];
            if self.is_compressible {
                force += viscosity / 3.0 * row(&self.slope_of_divergence, D, i)[a];
            }
            if let Some(slope) = slope {
                force += (0..D).map(|b| of[b][a] * slope[b]).sum::<f64>();
            }
            if let Some(carried) = carried {
                force += carried.short_waves(i, a);
            }
            acceleration[a] = force / density + terms.body_acceleration(i, a);
        }
        acceleration
    }

    /// Rate of the density by diffusion, kg/(m³ s).
    pub(super) fn diffusion_rate(&self, terms: &Terms<'_>, point: usize) -> f64 {
        match terms.density_diffusion > 0.0 {
            true => terms.density_diffusivity(point) * self.diffusion.laplacian[point],
            false => 0.0,
        }
    }

    /// Advances density and pressure; `carried(point, density)` is what flows out of a point, kg/(m³ s).
    pub(super) fn advance_density(
        &self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
        carried: impl Fn(usize, f64) -> f64 + Sync,
    ) {
        let points = density.par_iter_mut().zip(pressure).enumerate();
        points
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(i, (rho, p))| {
                let rate = self.diffusion_rate(terms, i) - carried(i, *rho);
                let after = *rho + terms.dt * rate;
                terms.medium.change_density(i, after, rho, p);
            });
    }

    /// Heat of viscous friction per current volume, W/m³.
    pub(super) fn friction(&self, medium: &Medium, friction: &mut Vec<f64>) {
        let viscosity = medium.viscosity.value.par_iter().enumerate();
        let at_point = |(i, mu): (usize, &f64)| mu * self.dissipation(i);
        let viscosity = viscosity.with_min_len(POINTS_PER_TASK);
        viscosity.map(at_point).fill(friction);
    }

    /// Heat of viscous friction over the viscosity, 1/s² (Gao (2020), eq. 5.65).
    fn dissipation(&self, point: usize) -> f64 {
        squared_shear_rate(self.dimension(), |a, b| self.velocity_row(a, point)[b])
    }
}
