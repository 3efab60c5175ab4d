//! Heat that an Eulerian fluid carries through the points.
//!
//! ```text
//! dh/dt = (h div(rho v) - div(rho v h)) / rho        Gao (2020), eq. 5.101; corrected, see spec 05, E7
//! ```
//!
//! with the flux of mass of the fluid, so that the integral of `rho h` is kept to rounding. Behind faces the enthalpy is
//! that of the temperature there.

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::{Body, Derivatives, Pddo, Read};
use rayon::prelude::*;

use crate::advection::{Convection, Flux};

/// Least number of points that a thread takes at once.
const POINTS_PER_TASK: usize = 1024;

/// Convection of heat with its work arrays.
#[derive(Debug)]
pub(super) struct CarriedHeat {
    pddo: Arc<Pddo>,
    pub(super) convection: Convection,
    pub(super) velocity: Read<Vector3<f64>>,
    pub(super) density: Read<f64>,
    /// Slots behind faces, with the material of the point that they mirror.
    ghosts: Vec<(u32, u16)>,
    mass: Flux,
    heat: Flux,
    velocity_slots: Vec<Vec<f64>>,
    density_slots: Vec<f64>,
    enthalpy_slots: Vec<f64>,
    temperature_slots: Vec<f64>,
    work: Derivatives,
    /// W/m³.
    pub(super) rate: Vec<f64>,
    /// Conductivity that keeps the convective terms stable, W/(m K).
    pub(super) least_conductivity: Vec<f64>,
}

/// State that is carried: fields by point.
pub(super) struct Carried<'a> {
    /// m/s.
    pub(super) velocity: &'a [Vector3<f64>],
    /// kg/m³.
    pub(super) density: &'a [f64],
    /// K.
    pub(super) temperature: &'a [f64],
    /// J/m³.
    pub(super) enthalpy: &'a [f64],
    /// How the temperature continues behind faces.
    pub(super) rules: &'a [LayerRule],
    pub(super) curves: &'a [EnthalpyCurve],
}

impl CarriedHeat {
    pub(super) fn new(
        (body, pddo): (&Body, Arc<Pddo>),
        convection: Convection,
        velocity: Read<Vector3<f64>>,
        density: Read<f64>,
    ) -> Self {
        let family = pddo.family();
        let mut is_own = vec![false; family.slots()];
        (0..body.points.len()).for_each(|point| is_own[family.slot_of(point)] = true);
        let points = family.points_of_slots();
        let ghosts = (0..).zip(&points).zip(&is_own);
        let ghosts = ghosts.filter(|((_, point), is_own)| !**is_own && **point != u32::MAX);
        let ghosts = ghosts.map(|((slot, &point), _)| {
            let material = body.material_of_point[point as usize];
            (slot, material)
        });
        let slots = || vec![0.0; family.slots()];
        CarriedHeat {
            ghosts: ghosts.collect(),
            convection,
            velocity,
            density,
            mass: Flux::new(body.dimension),
            heat: Flux::new(body.dimension),
            velocity_slots: (0..body.dimension).map(|_| slots()).collect(),
            density_slots: slots(),
            enthalpy_slots: slots(),
            temperature_slots: slots(),
            work: Derivatives::default(),
            rate: Vec::new(),
            least_conductivity: Vec::new(),
            pddo,
        }
    }

    /// Finds the rate of the enthalpy and the least conductivity.
    pub(super) fn find(&mut self, body: &Body, carried: &Carried<'_>) {
        self.load(carried);
        let operator = (&*self.pddo, &mut self.work);
        let density = Some(&self.density_slots[..]);
        self.mass.find(operator, &self.velocity_slots, density);
        let operator = (&*self.pddo, &mut self.work);
        self.heat.carry(operator, &self.mass, &self.enthalpy_slots);
        let (mass, heat) = (&self.mass, &self.heat);
        let rate = |i: usize| heat.net(mass, i, carried.enthalpy[i]) / carried.density[i];
        let points = (0..carried.density.len()).into_par_iter();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.clone().map(rate).collect_into_vec(&mut self.rate);
        let convection = self.convection;
        let least = |i: usize| {
            let curve = &carried.curves[body.material_of_point[i] as usize];
            let (speed, spacing) = (carried.velocity[i].norm(), body.points.spacing[i]);
            curve.capacity(carried.temperature[i]) * convection.least_diffusivity(speed, spacing)
        };
        points
            .map(least)
            .collect_into_vec(&mut self.least_conductivity);
    }

    /// Copies the fields to slots. What the flux of mass is behind faces follows from the flux before them.
    fn load(&mut self, carried: &Carried<'_>) {
        let family = self.pddo.family();
        let velocity: &[f64] = bytemuck::cast_slice(carried.velocity);
        for (axis, slots) in self.velocity_slots.iter_mut().enumerate() {
            family.scatter(velocity, 3, axis, slots);
        }
        family.scatter(carried.density, 1, 0, &mut self.density_slots);
        family.scatter(carried.enthalpy, 1, 0, &mut self.enthalpy_slots);
        family.scatter(carried.temperature, 1, 0, &mut self.temperature_slots);
        family.fill_layers(carried.rules, 0, &mut self.temperature_slots);
        for &(slot, material) in &self.ghosts {
            let temperature = self.temperature_slots[slot as usize];
            self.enthalpy_slots[slot as usize] =
                carried.curves[material as usize].enthalpy(temperature);
        }
    }

    /// Largest stable explicit step (s) at a point of this spacing (m), for the largest speed (m/s), the conductivity
    /// (W/(m K)) there, the sum of the coefficients of its bonds at this conductivity (W/(m³ K)) and its heat
    /// capacity (J/(m³ K)): diffusion is monotone, and forward Euler, which subtracts `v^2 dt / 2` from the
    /// diffusivity, takes less than a tenth of it.
    pub(super) fn stable_step(&self, at: Diffusion, speed: f64, spacing: f64) -> f64 {
        let given = at.conductivity / at.capacity;
        let diffusivity = given.max(self.convection.least_diffusivity(speed, spacing));
        let per_diffusivity = match given > 0.0 {
            true => at.row_sum / at.conductivity,
            false => 0.0,
        };
        let carried = match diffusivity > 0.0 {
            true => 5.0 * speed * speed / diffusivity,
            false => 5.0 * speed / spacing,
        };
        1.0 / (per_diffusivity * diffusivity + carried)
    }
}

/// Conduction at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diffusion {
    /// W/(m K).
    pub(super) conductivity: f64,
    /// W/(m³ K).
    pub(super) row_sum: f64,
    /// J/(m³ K).
    pub(super) capacity: f64,
}
