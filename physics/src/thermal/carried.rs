//! Heat that an Eulerian fluid carries through the points.
//!
//! ```text
//! dh/dt = (h div m - div(m h*)) / rho,   h* = h + dt/2 dh/dt        Gao (2020), eq. 5.101; corrected, see spec 05, E7
//! ```
//!
//! with the flux m of mass by which the fluid advanced its density, so that the integral of `rho h` is kept to rounding,
//! and the enthalpy h* in the middle of the step. Behind faces the enthalpy is that of the temperature there. The heat of
//! short waves spreads by the diffusivity that they lack ([`Convection`]).

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::{ByImage, ByRules, Continuation};
use perimelt_core::{Body, Derivatives, Image, Pddo, Read, SlotField};
use rayon::prelude::*;

use crate::advection::{Convection, Flux, ShortWaves};

use super::conduction::Matter;

/// Least number of points that a thread takes at once.
const POINTS_PER_TASK: usize = 1024;

/// Convection of heat with its work arrays.
#[derive(Debug)]
pub(super) struct CarriedHeat {
    pddo: Arc<Pddo>,
    convection: Convection,
    pub(super) velocity: Read<Vector3<f64>>,
    pub(super) density: Read<f64>,
    pub(super) mass_flux: Read<Vector3<f64>>,
    mass: Flux,
    heat: Flux,
    /// Of the heat, W/m³.
    short_waves: ShortWaves,
    /// At the start of the step, kg/m³ and J/m³.
    start_density: Vec<f64>,
    start_enthalpy: Vec<f64>,
    enthalpy_slots: SlotField,
    temperature_slots: SlotField,
    temperature_laplacian: Vec<f64>,
    middle_temperature: Vec<f64>,
    middle_enthalpy: Vec<f64>,
    work: Derivatives,
    /// W/m³.
    rate: Vec<f64>,
    /// Sum of the weights of the Laplacian times the squared spacing.
    laplacian: f64,
    /// Largest wave number of the gradient times the spacing.
    wave_number: f64,
}

/// State that is carried: fields by point.
pub(super) struct Carried<'a> {
    /// m/s.
    pub(super) velocity: &'a [Vector3<f64>],
    /// kg/m³.
    pub(super) density: &'a [f64],
    /// kg/(m² s).
    pub(super) mass_flux: &'a [Vector3<f64>],
    /// K.
    pub(super) temperature: &'a [f64],
    /// J/m³.
    pub(super) enthalpy: &'a [f64],
}

/// Fields that the heat flow reads from a fluid.
pub(super) struct FlowFields {
    pub(super) velocity: Read<Vector3<f64>>,
    pub(super) density: Read<f64>,
    pub(super) mass_flux: Read<Vector3<f64>>,
}

impl CarriedHeat {
    pub(super) fn new(
        (body, pddo): (&Body, Arc<Pddo>),
        convection: Convection,
        fields: FlowFields,
    ) -> Self {
        let spacing = body.points.spacing[0];
        CarriedHeat {
            convection,
            velocity: fields.velocity,
            density: fields.density,
            mass_flux: fields.mass_flux,
            mass: Flux::new(body.dimension),
            heat: Flux::new(body.dimension),
            short_waves: ShortWaves::default(),
            start_density: Vec::new(),
            start_enthalpy: Vec::new(),
            enthalpy_slots: SlotField::default(),
            temperature_slots: SlotField::default(),
            temperature_laplacian: Vec::new(),
            middle_temperature: Vec::new(),
            middle_enthalpy: Vec::new(),
            work: Derivatives::default(),
            rate: Vec::new(),
            laplacian: pddo.laplacian_sum(0) * spacing * spacing,
            wave_number: pddo.largest_wave_number(0) * spacing,
            pddo,
        }
    }

    /// Takes the state at the start of a step and finds the flux of mass and the decay of short waves;
    /// `conductivity` is that of a point, W/(m K).
    pub(super) fn start(
        &mut self,
        body: &Body,
        (matter, carried): (&Matter<'_>, &Carried<'_>),
        conductivity: impl Fn(usize) -> f64 + Sync,
    ) {
        self.start_density.clear();
        self.start_density.extend_from_slice(carried.density);
        self.start_enthalpy.clear();
        self.start_enthalpy.extend_from_slice(carried.enthalpy);
        let operator = (&*self.pddo, &mut self.work);
        self.mass.set(operator, carried.mass_flux);
        let (convection, laplacian) = (self.convection, self.laplacian);
        // (J/(m³ K)) m⁴/s
        let missing = |i: usize| {
            let curve = &matter.curves[matter.material[i] as usize];
            let capacity = curve.capacity(carried.temperature[i]);
            let spacing = body.points.spacing[i];
            let flow = (carried.velocity[i].norm(), spacing);
            let sum = laplacian / (spacing * spacing);
            let given = conductivity(i) / capacity;
            capacity * convection.missing_diffusivity(flow, sum, given) / sum
        };
        let points = (0..carried.density.len()).into_par_iter();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.map(missing).collect_into_vec(&mut self.rate);
        if self.rate.iter().all(|missing| *missing == 0.0) {
            return self.short_waves.vanish();
        }
        self.load(matter, carried.temperature, carried.enthalpy);
        let slots = &self.temperature_slots;
        let laplacian = &mut self.temperature_laplacian;
        self.pddo.laplacian(slots, &mut self.work, laplacian);
        let difference = |i: usize| -self.rate[i] * self.temperature_laplacian[i];
        let operator = (&*self.pddo, &mut self.work);
        self.short_waves
            .find(operator, (matter.rules, 0), difference);
    }

    /// Adds what the flow carries in a step (s) to the rates of the enthalpy by conduction and sources, W/m³.
    pub(super) fn add(&mut self, matter: &Matter<'_>, dt: f64, rates: &mut [[f64; 1]]) {
        let short_waves = &self.short_waves;
        let points = rates.par_iter_mut().enumerate();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_each(|(i, [rate])| *rate += short_waves.rate(i));
        let mut temperature = std::mem::take(&mut self.middle_temperature);
        let mut enthalpy = std::mem::take(&mut self.middle_enthalpy);
        let points = self.start_enthalpy.par_iter().zip(matter.material);
        let points = points.with_min_len(POINTS_PER_TASK);
        let at = |(h, &m): (&f64, &u16)| matter.curves[m as usize].temperature(*h);
        points.map(at).collect_into_vec(&mut temperature);
        enthalpy.clear();
        enthalpy.extend_from_slice(&self.start_enthalpy);
        self.find(matter, &temperature, &enthalpy);
        let points = enthalpy.par_iter_mut().zip(&*rates).zip(&self.rate);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_each(|((h, [others]), carried)| *h += 0.5 * dt * (others + carried));
        let points = enthalpy.par_iter().zip(matter.material);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.map(at).collect_into_vec(&mut temperature);
        self.find(matter, &temperature, &enthalpy);
        let points = rates.par_iter_mut().zip(&self.rate);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_each(|([rate], carried)| *rate += carried);
        (self.middle_temperature, self.middle_enthalpy) = (temperature, enthalpy);
    }

    /// Finds the rate by the flux of this enthalpy.
    fn find(&mut self, matter: &Matter<'_>, temperature: &[f64], enthalpy: &[f64]) {
        self.load(matter, temperature, enthalpy);
        let operator = (&*self.pddo, &mut self.work);
        self.heat.carry(operator, &self.mass, &self.enthalpy_slots);
        let (mass, heat) = (&self.mass, &self.heat);
        let (h, density) = (&self.start_enthalpy, &self.start_density);
        let rate = |i: usize| heat.net(mass, i, h[i]) / density[i];
        let points = (0..h.len()).into_par_iter().with_min_len(POINTS_PER_TASK);
        points.map(rate).collect_into_vec(&mut self.rate);
    }

    /// Copies temperature and enthalpy to slots.
    fn load(&mut self, matter: &Matter<'_>, temperature: &[f64], enthalpy: &[f64]) {
        let family = self.pddo.family();
        let slots = &mut self.temperature_slots;
        slots.load(family, temperature, ByRules(matter.rules, 0));
        let images = Continuation::default();
        let behind = |image: &Image| {
            let material = matter.material[image.point] as usize;
            [matter.curves[material].enthalpy(slots[image.slot])]
        };
        self.enthalpy_slots
            .load(family, enthalpy, ByImage(&images, behind));
    }

    /// Largest stable explicit step (s) at a point of this spacing (m), for the largest speed (m/s): diffusion is
    /// monotone, and a step carries waves by less than half of what makes them grow.
    pub(super) fn stable_step(&self, at: Diffusion, speed: f64, spacing: f64) -> f64 {
        let sum = self.laplacian / (spacing * spacing);
        let given = at.conductivity / at.capacity;
        let missing = self
            .convection
            .missing_diffusivity((speed, spacing), sum, given);
        let wave_number = self.wave_number / spacing;
        1.0 / (at.row_sum / at.capacity + 2.0 * missing * sum + 2.0 * wave_number * speed)
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
