//! Rates by differences, as published: derivatives of second order on complete families (Gao (2020), eqs. 5.80
//! to 5.101).

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::pddo::second;
use perimelt_core::{Derivatives, Family, Pddo, PddoError};
use rayon::prelude::*;

use super::{Coefficient, Heating, Medium, Rates, SHARE, Stability, Terms, load, load_weighted};

/// A field in slot space with its derivatives.
#[derive(Debug, Default)]
struct Differentiated {
    slots: Vec<f64>,
    derivatives: Derivatives,
}

impl Differentiated {
    fn differentiate(&mut self, pddo: &Pddo) {
        pddo.differentiate(&self.slots, &mut self.derivatives);
    }

    /// Of a coefficient; nothing where it is uniform.
    fn differentiate_coefficient(&mut self, coefficient: &Coefficient, pddo: &Pddo) {
        if coefficient.varies {
            coefficient.load(pddo.family(), &mut self.slots);
            self.differentiate(pddo);
        }
    }
}

/// Fields of the flow with their derivatives.
#[derive(Debug)]
pub(super) struct Differences {
    pddo: Pddo,
    velocity: Vec<Derivatives>,
    density: Differentiated,
    pressure: Differentiated,
    temperature: Differentiated,
    viscosity: Differentiated,
    conductivity: Differentiated,
}

impl Differences {
    pub(super) fn new(pddo: Pddo) -> Self {
        Differences {
            velocity: vec![Derivatives::default(); pddo.dimension()],
            density: Differentiated::default(),
            pressure: Differentiated::default(),
            temperature: Differentiated::default(),
            viscosity: Differentiated::default(),
            conductivity: Differentiated::default(),
            pddo,
        }
    }

    fn advance_density<const D: usize>(
        &self,
        terms: &Terms<'_>,
        dt: f64,
        (density, pressure): (&mut [f64], &mut [f64]),
        velocity: &[Vector3<f64>],
    ) {
        let medium = terms.medium;
        let gradients: [&Derivatives; D] = std::array::from_fn(|a| &self.velocity[a]);
        let points = density.par_iter_mut().zip(pressure).enumerate();
        points.with_min_len(SHARE).for_each(|(i, (rho, p))| {
            let divergence: f64 = (0..D).map(|a| gradients[a].at(i)[a]).sum();
            let mut rate = -*rho * divergence;
            if terms.convection.is_some() {
                let gradient = self.density.derivatives.at(i);
                rate -= (0..D).map(|a| velocity[i][a] * gradient[a]).sum::<f64>();
            }
            if terms.density_diffusion > 0.0 {
                let laplacian = self.density.derivatives.laplacian(i);
                rate += terms.density_diffusivity(i) * laplacian;
            }
            let before = *rho;
            *rho += dt * rate;
            *p = medium.pressure(i, (before, *rho), *p);
        });
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
        points.with_min_len(SHARE).for_each(|(i, v)| {
            let of: [&[f64]; D] = std::array::from_fn(|b| self.velocity[b].at(i));
            let pressure = self.pressure.derivatives.at(i);
            let slope = viscosity.varies.then(|| self.viscosity.derivatives.at(i));
            let before = *v;
            let least = terms
                .convection
                .map_or(0.0, |c| medium.least_diffusivity(c, i, before.norm()));
            let viscosity = viscosity.value[i].max(least * density[i]);
            for a in 0..D {
                let laplacian: f64 = (0..D).map(|b| of[a][second(D, b, b)]).sum();
                let mut force = viscosity * laplacian - pressure[a];
                if terms.compressible {
                    let slope: f64 = (0..D).map(|b| of[b][second(D, a, b)]).sum();
                    force += viscosity / 3.0 * slope;
                }
                if let Some(slope) = slope {
                    force += (0..D)
                        .map(|b| (of[a][b] + of[b][a]) * slope[b])
                        .sum::<f64>();
                }
                let mut acceleration = force / density[i] + terms.body_acceleration(i, a);
                if terms.convection.is_some() {
                    acceleration -= (0..D).map(|b| before[b] * of[a][b]).sum::<f64>();
                }
                v[a] += dt * terms.share * acceleration;
            }
        });
    }

    /// Heat of viscous friction over the viscosity, 1/s² (Gao (2020), eq. 5.65).
    fn dissipation(&self, point: usize) -> f64 {
        let of = |a: usize, b: usize| self.velocity[a].at(point)[b];
        let mut sum = 0.0;
        for a in 0..self.velocity.len() {
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

    fn follow(&mut self, positions: &[Vector3<f64>], volumes: &[f64]) -> Result<(), PddoError> {
        self.pddo.follow(positions, volumes)
    }

    fn look_from(&mut self, positions: &[Vector3<f64>]) {
        self.pddo.look_from(positions);
    }

    fn stability(&self) -> Stability {
        // all families are complete
        Stability {
            wave_number: self.pddo.largest_wave_number(0),
            laplacian: self.pddo.laplacian_sum(0),
        }
    }

    fn see_temperature(&mut self, temperature: &[f64], rules: &[LayerRule], medium: &Medium) {
        let pddo = &self.pddo;
        let slots = &mut self.temperature.slots;
        load(pddo.family(), (temperature, 1), 0, rules, slots);
        self.temperature.differentiate(pddo);
        self.viscosity
            .differentiate_coefficient(&medium.viscosity, pddo);
        self.conductivity
            .differentiate_coefficient(&medium.conductivity, pddo);
    }

    fn see_velocity(&mut self, velocity: &[Vec<f64>], _density: &[f64], _terms: &Terms<'_>) {
        for (slots, derivatives) in velocity.iter().zip(&mut self.velocity) {
            self.pddo.differentiate(slots, derivatives);
        }
    }

    fn see_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        let slots = &mut self.pressure.slots;
        load_weighted(
            self.pddo.family(),
            pressure,
            slots,
            |axis, point, distance| force.map_or(0.0, |f| f[point][axis] * distance),
        );
        self.pressure.differentiate(&self.pddo);
    }

    fn drift(
        &mut self,
        terms: &Terms<'_>,
        dt: f64,
        (density, pressure): (&mut [f64], &mut [f64]),
        velocity: &[Vector3<f64>],
    ) {
        if terms.convection.is_some() || terms.density_diffusion > 0.0 {
            // the density that goes with the pressure behind the faces
            let slots = &mut self.density.slots;
            load_weighted(
                self.pddo.family(),
                density,
                slots,
                |axis, point, distance| terms.density_slope(point, axis) * distance,
            );
            self.density.differentiate(&self.pddo);
        }
        match self.velocity.len() {
            2 => self.advance_density::<2>(terms, dt, (density, pressure), velocity),
            _ => self.advance_density::<3>(terms, dt, (density, pressure), velocity),
        }
    }

    fn kick(&self, terms: &Terms<'_>, dt: f64, velocity: &mut [Vector3<f64>], density: &[f64]) {
        match self.velocity.len() {
            2 => self.accelerate::<2>(terms, dt, velocity, density),
            _ => self.accelerate::<3>(terms, dt, velocity, density),
        }
    }

    fn heat(&self, heating: &Heating<'_>, medium: &Medium, dt: f64, enthalpy: &mut [f64]) {
        let dimension = self.velocity.len();
        let points = enthalpy.par_iter_mut().enumerate();
        points.with_min_len(SHARE).for_each(|(i, h)| {
            let derivatives = &self.temperature.derivatives;
            let of = derivatives.at(i);
            let carried = heating.carried_by.map(|(convection, velocity)| {
                let curve = &heating.curves[heating.material[i] as usize];
                let capacity = curve.capacity(heating.temperature[i]);
                let least = medium.least_diffusivity(convection, i, velocity[i].norm());
                let along = (0..dimension).map(|a| velocity[i][a] * of[a]).sum::<f64>();
                (capacity * least, capacity * along)
            });
            let (least, carried) = carried.unwrap_or_default();
            let conductivity = medium.conductivity.value[i].max(least);
            let mut rate = conductivity * derivatives.laplacian(i) - carried;
            if medium.conductivity.varies {
                let slope = self.conductivity.derivatives.at(i);
                rate += (0..dimension).map(|a| slope[a] * of[a]).sum::<f64>();
            }
            if heating.dissipates {
                rate += medium.viscosity.value[i] * self.dissipation(i);
            }
            rate += heating.source.map_or(0.0, |q| q[i]);
            *h += dt * rate;
        });
    }
}
