//! Rates of the flow: what a step needs of the fields, their derivatives, and how it uses them.

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Bond, BondKernel, Derivatives, Family, Pddo, PddoError, pddo::second};
use rayon::prelude::*;

use super::{Drift, Kick, State, Warming};

/// Points that a thread takes at once.
const SHARE: usize = 1024;

/// Properties of the fluid.
#[derive(Debug)]
pub(super) struct Properties {
    /// By point, kg/m³.
    pub reference_density: Vec<f64>,
    /// By material, Pa s.
    pub viscosity: Vec<Property>,
    /// By material, W/(m K); none without an energy equation.
    pub conductivity: Vec<Property>,
}

/// A field in slot space with its derivatives.
#[derive(Debug)]
struct Differentiated {
    slots: Vec<f64>,
    derivatives: Derivatives,
}

impl Differentiated {
    fn new(family: &Family) -> Self {
        Differentiated {
            slots: vec![0.0; family.slots()],
            derivatives: Derivatives::default(),
        }
    }

    fn load(
        &mut self,
        family: &Family,
        (field, components): (&[f64], usize),
        component: usize,
        rules: &[LayerRule],
    ) {
        self.slots.resize(family.slots(), 0.0);
        family.scatter(field, components, component, &mut self.slots);
        family.fill_layers(rules, component, &mut self.slots);
    }

    fn differentiate(&mut self, pddo: &Pddo) {
        pddo.differentiate(&self.slots, &mut self.derivatives);
    }
}

/// A property of the material with its derivatives, where it varies.
#[derive(Debug)]
struct Coefficient {
    value: Vec<f64>,
    /// Only where the property varies.
    field: Option<Differentiated>,
}

impl Coefficient {
    fn new(family: &Family, properties: &[Property], points: usize) -> Self {
        let uniform = Property::common(properties);
        Coefficient {
            value: vec![uniform.unwrap_or(0.0); points],
            field: (uniform.is_none() && !properties.is_empty())
                .then(|| Differentiated::new(family)),
        }
    }

    fn evaluate(
        &mut self,
        properties: &[Property],
        temperature: &[f64],
        (material, curves): (&[u16], &[EnthalpyCurve]),
    ) {
        if self.field.is_none() {
            return;
        }
        let points = self.value.par_iter_mut().zip(temperature).zip(material);
        points.with_min_len(SHARE).for_each(|((value, &t), &m)| {
            *value = properties[m as usize].at(t, curves[m as usize].liquid_fraction(t));
        });
    }

    fn differentiate(&mut self, pddo: &Pddo) {
        let Some(field) = &mut self.field else {
            return;
        };
        field.load(pddo.family(), (&self.value, 1), 0, &[]);
        field.differentiate(pddo);
    }

    fn gradient(&self, point: usize) -> Option<Vector3<f64>> {
        self.field.as_ref().map(|f| f.derivatives.gradient(point))
    }
}

/// Fields of the flow with their derivatives.
#[derive(Debug)]
pub(super) struct Flow {
    pub properties: Properties,
    pub kinetic_energy: f64,
    /// Largest `|rho/rho0 - 1|`.
    pub density_deviation: f64,
    pddo: Pddo,
    spacing: Vec<f64>,
    velocity: Vec<Differentiated>,
    density: Differentiated,
    pressure: Differentiated,
    temperature: Option<Differentiated>,
    viscosity: Coefficient,
    conductivity: Coefficient,
    crowding: Vec<[f64; 5]>,
}

/// Sum of the distances of the neighbours (m), their number, and `sum_j xi / |xi|^3`, 1/m².
struct Crowding;

impl BondKernel<1, 5> for Crowding {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 1], _: [f64; 1]) -> [f64; 5] {
        // members in the skin have no weight
        let counts = if bond.weight > 0.0 { 1.0 } else { 0.0 };
        let cube = counts / (bond.length * bond.length * bond.length);
        let [x, y, z] = bond.xi;
        [counts * bond.length, counts, cube * x, cube * y, cube * z]
    }
}

impl Flow {
    pub(super) fn new(pddo: Pddo, properties: Properties, spacing: Vec<f64>) -> Self {
        let points = spacing.len();
        let family = pddo.family().clone();
        let field = || Differentiated::new(&family);
        let coefficient = |p: &[Property]| Coefficient::new(&family, p, points);
        Flow {
            velocity: (0..pddo.dimension()).map(|_| field()).collect(),
            density: field(),
            pressure: field(),
            temperature: (!properties.conductivity.is_empty()).then(field),
            viscosity: coefficient(&properties.viscosity),
            conductivity: coefficient(&properties.conductivity),
            crowding: Vec::new(),
            kinetic_energy: 0.0,
            density_deviation: 0.0,
            properties,
            spacing,
            pddo,
        }
    }

    /// Largest stable step, s (spec 05, 1.10): with the frequency `w = kappa (c + |v|)` of sound and the rate
    /// `r = 2 S nu` of viscosity, a symplectic step is stable for `dt^2 w^2 + 2 dt r < 4`. `capacity` is the
    /// smallest of each material, J/(m³ K).
    pub(super) fn stable_step(
        &self,
        state: &State,
        (material, capacity): (&[u16], &[f64]),
        eulerian: bool,
    ) -> f64 {
        // all families are complete
        let (wave_number, sum) = (self.pddo.largest_wave_number(0), self.pddo.laplacian_sum(0));
        let largest = |properties: &[Property], m: u16| {
            properties
                .get(m as usize)
                .map_or(0.0, |p| max_abs(&p.values()))
        };
        let limit = |(&m, &density): (&u16, &f64)| {
            let sound = state.sound_speed(density);
            // an Eulerian fluid carries waves along
            let frequency = wave_number * sound * if eulerian { 1.1 } else { 1.0 };
            let rate = 2.0 * sum * largest(&self.properties.viscosity, m) / density;
            let mechanical = 4.0 / (rate + (rate * rate + 4.0 * frequency * frequency).sqrt());
            let heat = match capacity.get(m as usize) {
                Some(capacity) => capacity / (sum * largest(&self.properties.conductivity, m)),
                None => f64::INFINITY,
            };
            mechanical.min(heat)
        };
        let points = material.iter().zip(&self.properties.reference_density);
        points.map(limit).fold(f64::INFINITY, f64::min)
    }

    /// Finds families and operators of points at these positions (m) with these volumes (m³).
    pub(super) fn follow(
        &mut self,
        positions: &[Vector3<f64>],
        volumes: &[f64],
    ) -> Result<(), PddoError> {
        self.pddo.follow(positions, volumes)
    }

    /// Where neighbours were last looked for, m.
    pub(super) fn looked_from(&self) -> &[Vector3<f64>] {
        self.pddo.family().looked_from()
    }

    pub(super) fn look_from(&mut self, positions: &[Vector3<f64>]) {
        self.pddo.look_from(positions);
    }

    /// Moves points away from where they crowd: by `-C |v|max dt U` with `U = sum_j (r / |xi|)^2 n` and the mean
    /// distance r of the neighbours, at most a fifth of a spacing; `share` is `C dt` (s).
    pub(super) fn shift(
        &mut self,
        share: f64,
        velocity: &[Vector3<f64>],
        displacement: &mut [Vector3<f64>],
    ) {
        let fastest = velocity
            .iter()
            .map(Vector3::norm_squared)
            .fold(0.0, f64::max)
            .sqrt();
        self.crowding.resize(velocity.len(), [0.0; 5]);
        let slots = &self.velocity[0].slots;
        self.pddo
            .family()
            .sum(&Crowding, [slots], &mut self.crowding);
        let points = displacement
            .par_iter_mut()
            .zip(&self.crowding)
            .zip(&self.spacing);
        points
            .with_min_len(SHARE)
            .for_each(|((u, [sum, number, x, y, z]), spacing)| {
                let mean = sum / number;
                let shift = Vector3::new(*x, *y, *z) * (-share * fastest * mean * mean);
                let most = 0.2 * spacing;
                *u += shift * (most / shift.norm().max(most));
            });
    }

    /// Takes the velocity to slots; behind faces it goes on by their rules.
    pub(super) fn load_velocity(&mut self, velocity: &[Vector3<f64>], rules: &[LayerRule]) {
        let flat: &[f64] = bytemuck::cast_slice(velocity);
        for (axis, component) in self.velocity.iter_mut().enumerate() {
            component.load(self.pddo.family(), (flat, 3), axis, rules);
        }
    }

    pub(super) fn derive_velocity(&mut self) {
        let components = self.velocity.iter_mut();
        components.for_each(|c| c.differentiate(&self.pddo));
    }

    pub(super) fn derive_temperature(
        &mut self,
        temperature: &[f64],
        rules: &[LayerRule],
        material: &[u16],
        curves: &[EnthalpyCurve],
    ) {
        let Some(field) = &mut self.temperature else {
            return;
        };
        field.load(self.pddo.family(), (temperature, 1), 0, rules);
        field.differentiate(&self.pddo);
        let Properties {
            viscosity,
            conductivity,
            ..
        } = &self.properties;
        for (coefficient, properties) in [
            (&mut self.viscosity, viscosity),
            (&mut self.conductivity, conductivity),
        ] {
            coefficient.evaluate(properties, temperature, (material, curves));
            coefficient.differentiate(&self.pddo);
        }
    }

    /// Conductivity by point at a temperature, W/(m K).
    pub(super) fn conductivity(
        &mut self,
        temperature: &[f64],
        material: &[u16],
        curves: &[EnthalpyCurve],
    ) -> &[f64] {
        let properties = &self.properties.conductivity;
        self.conductivity
            .evaluate(properties, temperature, (material, curves));
        &self.conductivity.value
    }

    /// Derivatives of the pressure, which goes on behind faces with the weight of the fluid before them.
    pub(super) fn derive_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>) {
        load_weighted(
            self.pddo.family(),
            pressure,
            &mut self.pressure.slots,
            |axis, point, distance| force.map_or(0.0, |f| f[point][axis] * distance),
        );
        self.pressure.differentiate(&self.pddo);
    }

    /// Advances density and pressure by `dt` (s).
    pub(super) fn drift(
        &mut self,
        drift: &Drift<'_>,
        dt: f64,
        (density, pressure): (&mut [f64], &mut [f64]),
        velocity: &[Vector3<f64>],
    ) {
        let reference = &self.properties.reference_density;
        if drift.eulerian || drift.diffusion > 0.0 {
            // the density that goes with the pressure behind the faces
            load_weighted(
                self.pddo.family(),
                density,
                &mut self.density.slots,
                |axis, point, distance| {
                    let sound = drift.state.sound_speed(reference[point]);
                    drift
                        .force
                        .map_or(0.0, |f| f[point][axis] * distance / (sound * sound))
                },
            );
            self.density.differentiate(&self.pddo);
        }
        match self.velocity.len() {
            2 => self.advance_density::<2>(drift, dt, (density, pressure), velocity),
            _ => self.advance_density::<3>(drift, dt, (density, pressure), velocity),
        }
    }

    fn advance_density<const D: usize>(
        &self,
        drift: &Drift<'_>,
        dt: f64,
        (density, pressure): (&mut [f64], &mut [f64]),
        velocity: &[Vector3<f64>],
    ) {
        let reference = &self.properties.reference_density;
        let gradients: [&Derivatives; D] = std::array::from_fn(|a| &self.velocity[a].derivatives);
        let points = density.par_iter_mut().zip(pressure).enumerate();
        points.with_min_len(SHARE).for_each(|(i, (rho, p))| {
            let divergence: f64 = (0..D).map(|a| gradients[a].at(i)[a]).sum();
            let mut rate = -*rho * divergence;
            if drift.eulerian {
                let gradient = self.density.derivatives.at(i);
                rate -= (0..D).map(|a| velocity[i][a] * gradient[a]).sum::<f64>();
            }
            if drift.diffusion > 0.0 {
                let sound = drift.state.sound_speed(reference[i]);
                let laplacian = self.density.derivatives.laplacian(i);
                rate += drift.diffusion * self.spacing[i] * sound * laplacian;
            }
            let before = *rho;
            *rho += dt * rate;
            *p = drift.state.pressure((before, *rho), *p, reference[i]);
        });
    }

    /// Advances the velocity by `dt` (s).
    pub(super) fn kick(
        &self,
        kick: &Kick<'_>,
        dt: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        match self.velocity.len() {
            2 => self.accelerate::<2>(kick, dt, velocity, density),
            _ => self.accelerate::<3>(kick, dt, velocity, density),
        }
    }

    fn accelerate<const D: usize>(
        &self,
        kick: &Kick<'_>,
        dt: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    ) {
        let points = velocity.par_iter_mut().enumerate();
        points.with_min_len(SHARE).for_each(|(i, v)| {
            let of: [&[f64]; D] = std::array::from_fn(|b| self.velocity[b].derivatives.at(i));
            let pressure = self.pressure.derivatives.at(i);
            let viscosity = self.viscosity.value[i];
            let slope = self.viscosity.gradient(i);
            let before = *v;
            for a in 0..D {
                let laplacian: f64 = (0..D).map(|b| of[a][second(D, b, b)]).sum();
                let mut force = viscosity * laplacian - pressure[a];
                if kick.compressible {
                    let slope: f64 = (0..D).map(|b| of[b][second(D, a, b)]).sum();
                    force += viscosity / 3.0 * slope;
                }
                if let Some(slope) = slope {
                    force += (0..D)
                        .map(|b| (of[a][b] + of[b][a]) * slope[b])
                        .sum::<f64>();
                }
                let mut acceleration = force / density[i];
                if let Some(force) = kick.force {
                    acceleration += force[i][a] / self.properties.reference_density[i];
                }
                if kick.eulerian {
                    acceleration -= (0..D).map(|b| before[b] * of[a][b]).sum::<f64>();
                }
                v[a] += dt * kick.share * acceleration;
            }
        });
    }

    /// Advances the enthalpy by `dt` (s).
    pub(super) fn heat(&self, warming: &Warming<'_>, dt: f64, enthalpy: &mut [f64]) {
        let Some(field) = &self.temperature else {
            return;
        };
        let dimension = self.velocity.len();
        let points = enthalpy.par_iter_mut().enumerate();
        points.with_min_len(SHARE).for_each(|(i, h)| {
            let of = field.derivatives.at(i);
            let mut rate = self.conductivity.value[i] * field.derivatives.laplacian(i);
            if let Some(slope) = self.conductivity.gradient(i) {
                rate += (0..dimension).map(|a| slope[a] * of[a]).sum::<f64>();
            }
            if let Some(velocity) = warming.carried_by {
                let curve = &warming.curves[warming.material[i] as usize];
                let along = (0..dimension).map(|a| velocity[i][a] * of[a]).sum::<f64>();
                rate -= curve.capacity(warming.temperature[i]) * along;
            }
            if warming.dissipates {
                rate += self.viscosity.value[i] * self.dissipation(i);
            }
            rate += warming.source.map_or(0.0, |q| q[i]);
            *h += dt * rate;
        });
    }

    /// Heat of viscous friction over the viscosity, 1/s² (Gao (2020), eq. 5.65).
    fn dissipation(&self, point: usize) -> f64 {
        let dimension = self.velocity.len();
        let of = |a: usize, b: usize| self.velocity[a].derivatives.at(point)[b];
        let mut sum = 0.0;
        for a in 0..dimension {
            sum += 2.0 * of(a, a).powi(2);
            sum += (0..a).map(|b| (of(a, b) + of(b, a)).powi(2)).sum::<f64>();
        }
        sum
    }
}

/// Takes a field to slots; behind faces it is mirrored, and `rise(axis, point, distance)` added.
fn load_weighted(
    family: &Family,
    field: &[f64],
    slots: &mut Vec<f64>,
    rise: impl Fn(usize, usize, f64) -> f64,
) {
    slots.resize(family.slots(), 0.0);
    family.scatter(field, 1, 0, slots);
    family.fill_layers_rising(slots, rise);
}
