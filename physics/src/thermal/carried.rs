//! Convection of heat through the points of an Eulerian fluid.
//!
//! ```text
//! dh/dt = sum_j (h_i N_ij - H_ij) V_j / rho,   N_ij = w (q_i + q_j) . xi,   H_ij = w (q_i h_i* + q_j h_j*) . xi
//! q     = A^-1 m,   A = sum_j w xi xi^T V_j
//! ```
//!
//! over a family of the body and its bonds to walls, with the flux m of mass by which the fluid advanced its density and the enthalpy h*
//! in the middle of the step: `(h div m - div(m h*)) / rho` of Gao (2020), eq. 5.101, as a sum over bonds, opposite at the two ends of
//! each, so that the integral of `rho h` is kept to rounding where the density follows the same sums. The gradient of h is exact for
//! linear fields. Behind a wall, that is a body in the flow, `N_ij = w (q_i . xi - <q . xi>_j)` with the mean over the fluid around the
//! wall point j: what enters a wall point leaves it with the mean enthalpy `<h>_j`. Behind faces the enthalpy is that of the
//! temperature there. The heat of short waves spreads by the diffusivity that they lack ([`Convection`]).

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::{
    ByImage, ByRules, Continuation, ForeignBond, ForeignBonds, LayerRule, Mirrored, Places,
};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::pddo::largest_wave_number;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Body, Bond, BondKernel, Family, Image, Read, Setup, SetupError, SlotField, Wall, World, keys,
};
use rayon::prelude::*;

use crate::advection::{Convection, Laplacian};
use crate::shape_tensor::{self, CompleteFamily, Completion};

use super::conduction::{Conduction, Matter};
use super::growth::HeatState;
use super::points::ConductingPoints;

/// Least number of points per parallel task.
const POINTS_PER_TASK: usize = 1024;

/// Mass, and heat, that flow out of a point: `sum_j N_ij V_j` and `sum_j H_ij V_j`, from q and h.
struct Outflow<const D: usize>;

impl<const D: usize, const I: usize> BondKernel<I, 2> for Outflow<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; 2] {
        let along = |q: &[f64; I]| bond.weight * (0..D).map(|a| q[a] * bond.xi[a]).sum::<f64>();
        let (own_mass, other_mass) = (along(&own), along(&other));
        [
            own_mass + other_mass,
            own_mass * own[D] + other_mass * other[D],
        ]
    }
}

/// A body in the flow.
#[derive(Debug)]
pub(super) struct WallInFlow {
    velocity: Read<Vector3<f64>>,
    bonds: ForeignBonds,
    /// `N_ij V_j` by bond, kg/(m³ s).
    flux: Vec<f64>,
    /// Sums of weights and weighted values over the fluid around each point of the wall.
    means: Vec<[f64; 2]>,
    /// Mass and heat that flow out of each fluid point at the wall.
    outflow: Vec<[f64; 2]>,
}

impl WallInFlow {
    /// A wall for the flow through a body that is summed over `family`; its bonds are those of the reference positions.
    pub(super) fn new(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        family: &Family,
        wall: Wall,
    ) -> Result<WallInFlow, SetupError> {
        let velocity = setup.read(wall.other, &keys::VELOCITY)?;
        let [own, other] = [body, wall.other].map(|b| setup.body(b));
        let mut bonds = ForeignBonds::new(own, family.spec());
        bonds.follow(Places::reference(own), Places::reference(other));
        Ok(WallInFlow {
            velocity,
            bonds,
            flux: Vec::new(),
            means: Vec::new(),
            outflow: Vec::new(),
        })
    }

    /// Finds the flux of mass of the bonds; `towards(point, v, xi)` is `q . xi` of a fluid point relative to a wall of velocity v.
    fn find_flux(
        &mut self,
        velocity: &[Vector3<f64>],
        towards: impl Fn(usize, Vector3<f64>, &[f64; 3]) -> f64 + Sync,
    ) {
        let bonds = &self.bonds;
        let of_bond = |n: usize| {
            let ForeignBond { bond, point, ghost } = bonds.bond(n);
            towards(point, ghost.reflect(velocity[ghost.point]), &bond.xi)
        };
        self.flux.clear();
        self.flux.extend((0..bonds.len()).map(of_bond));
        let weighted = |n: usize| {
            let bond = bonds.bond(n).bond;
            [bond.dual, bond.dual * self.flux[n]]
        };
        bonds.sum_by_foreign(weighted, &mut self.means);
        for (n, flux) in self.flux.iter_mut().enumerate() {
            let ForeignBond { bond, ghost, .. } = bonds.bond(n);
            *flux = bond.weight * (*flux - mean(&self.means[ghost.point]));
        }
    }

    /// Adds the mass and the heat of this enthalpy that flow out through the wall.
    fn add_outflow(&mut self, enthalpy: &[f64], outflow: &mut [[f64; 2]]) {
        let bonds = &self.bonds;
        let weighted = |n: usize| {
            let ForeignBond { bond, point, .. } = bonds.bond(n);
            [bond.dual, bond.dual * enthalpy[point]]
        };
        bonds.sum_by_foreign(weighted, &mut self.means);
        let part = |n: usize| {
            let ghost = bonds.bond(n).ghost;
            [self.flux[n], self.flux[n] * mean(&self.means[ghost.point])]
        };
        bonds.sum_by_owner(part, &mut self.outflow);
        bonds.add_to_owners(&self.outflow, outflow);
    }
}

/// Mean from a sum of weights and a weighted sum.
fn mean([weights, sum]: &[f64; 2]) -> f64 {
    match *weights > 0.0 {
        true => sum / weights,
        false => 0.0,
    }
}

/// Convection of heat with its work arrays.
#[derive(Debug)]
pub(super) struct CarriedHeat {
    family: Arc<Family>,
    walls: Vec<WallInFlow>,
    /// `A^-1` of each point, 1/m.
    inverse_shape: Vec<Matrix3<f64>>,
    /// `2 / a` of a complete family, 1/m.
    laplacian_factor: f64,
    convection: Convection,
    pub(super) velocity: Read<Vector3<f64>>,
    density: Read<f64>,
    mass_flux: Read<Vector3<f64>>,
    /// Density at the start of the step, kg/m³.
    start_density: Vec<f64>,
    /// Enthalpy at the start of the step, J/m³.
    start_enthalpy: Vec<f64>,
    /// `A^-1 m` by slot, one array for each axis.
    flux: Vec<SlotField>,
    temperature: SlotField,
    enthalpy: SlotField,
    /// Laplacian of `d (T - mean T)` at each point, W/m³.
    short_waves: Vec<[f64; 1]>,
    /// `d (T - mean T)` by slot.
    excess: SlotField,
    rules: Vec<LayerRule>,
    middle_temperature: Vec<f64>,
    middle_enthalpy: Vec<f64>,
    outflow: Vec<[f64; 2]>,
    /// Rate of the enthalpy by convection, W/m³.
    rate: Vec<f64>,
    /// Sum of the weights of the Laplacian times the squared spacing.
    laplacian: f64,
    /// Largest wave number of the gradient times the spacing.
    wave_number: f64,
}

/// Fields that the heat flow reads from a fluid.
pub(super) struct FlowFields {
    pub(super) velocity: Read<Vector3<f64>>,
    pub(super) density: Read<f64>,
    pub(super) mass_flux: Read<Vector3<f64>>,
}

/// `A^-1` of the families of all points with their bonds to walls, 1/m.
fn inverse_shapes<const D: usize>(
    points: usize,
    family: &Family,
    walls: &[WallInFlow],
    moment: f64,
) -> Vec<Matrix3<f64>> {
    let components = &shape_tensor::COMPONENTS[..shape_tensor::components(D)];
    let add = |sums: &mut [f64; 6], bond: &Bond| {
        for (sum, &(a, b)) in sums.iter_mut().zip(components) {
            *sum += bond.weight * bond.xi[a] * bond.xi[b];
        }
    };
    let mut shapes = vec![[0.0; 6]; points];
    for (point, sums) in shapes.iter_mut().enumerate() {
        family.for_each_bond(point, |_, bond, _| add(sums, bond));
    }
    for wall in walls {
        for n in 0..wall.bonds.len() {
            let ForeignBond { bond, point, .. } = wall.bonds.bond(n);
            add(&mut shapes[point], bond);
        }
    }
    let inverse = |sums: &[f64; 6]| shape_tensor::inverted::<D>(sums, moment).0;
    shapes.iter().map(inverse).collect()
}

impl CarriedHeat {
    /// Convection that is summed over this family of the body and its bonds to walls.
    pub(super) fn new(
        body: &Body,
        family: Arc<Family>,
        mut walls: Vec<WallInFlow>,
        convection: Convection,
        fields: FlowFields,
    ) -> Self {
        let (spacing, points) = (body.finest_spacing(), body.points.len());
        if !walls.is_empty() {
            let bonds = walls.iter().map(|wall| &wall.bonds);
            let completion = Completion::of(points, &family, bonds);
            let bonds = walls.iter_mut().map(|wall| &mut wall.bonds);
            bonds.for_each(|bonds| completion.correct(bonds));
        }
        let CompleteFamily {
            point,
            moment,
            content,
            ..
        } = CompleteFamily::of(body, &family);
        let wave_number = largest_wave_number(body.dimension, |receive| {
            family.for_each_bond(point, |_, bond, _| {
                receive(bond, bond.xi.map(|x| bond.weight * x / moment));
            });
        });
        CarriedHeat {
            inverse_shape: match body.dimension {
                2 => inverse_shapes::<2>(points, &family, &walls, moment),
                _ => inverse_shapes::<3>(points, &family, &walls, moment),
            },
            laplacian_factor: 2.0 / moment,
            convection,
            velocity: fields.velocity,
            density: fields.density,
            mass_flux: fields.mass_flux,
            start_density: Vec::new(),
            start_enthalpy: Vec::new(),
            flux: vec![SlotField::default(); body.dimension],
            temperature: SlotField::default(),
            enthalpy: SlotField::default(),
            short_waves: Vec::new(),
            excess: SlotField::default(),
            rules: Vec::new(),
            middle_temperature: Vec::new(),
            middle_enthalpy: Vec::new(),
            outflow: vec![[0.0; 2]; points],
            rate: Vec::new(),
            laplacian: 2.0 / moment * content * spacing * spacing,
            wave_number: wave_number * spacing,
            family,
            walls,
        }
    }

    /// Copies the state at the start of a step and finds the flux of mass and the decay of short waves.
    pub(super) fn start(
        &mut self,
        world: &World,
        body: &Body,
        matter: &Matter<'_>,
        conduction: &Conduction,
        state: &HeatState,
    ) {
        let density: &[f64] = &world.read(self.density);
        let mass_flux: &[Vector3<f64>] = &world.read(self.mass_flux);
        self.start_density.clear();
        self.start_density.extend_from_slice(density);
        self.start_enthalpy.clear();
        let enthalpy = world.read::<f64>(state.enthalpy.into());
        self.start_enthalpy.extend_from_slice(&enthalpy);
        for (axis, slots) in self.flux.iter_mut().enumerate() {
            let along = |i: usize| self.inverse_shape[i].row(axis).tr_dot(&mass_flux[i]);
            slots.load(&self.family, along, Mirrored::Vector(axis));
        }
        let inverse = &self.inverse_shape;
        for wall in &mut self.walls {
            let velocity = world.read(wall.velocity);
            wall.find_flux(&velocity, |i, v, xi| {
                let relative = mass_flux[i] - density[i] * v;
                (inverse[i] * relative).dot(&Vector3::from(*xi))
            });
        }
        let points = ConductingPoints {
            conduction,
            curves: matter.curves,
            material: matter.material,
            temperature: &world.read(state.temperature.into()),
        };
        self.find_short_waves(body, matter, &points, &world.read(self.velocity));
    }

    /// Finds the decay of short waves of the temperature.
    fn find_short_waves(
        &mut self,
        body: &Body,
        matter: &Matter<'_>,
        points: &ConductingPoints<'_>,
        velocity: &[Vector3<f64>],
    ) {
        let (convection, laplacian) = (self.convection, self.laplacian);
        // diffusivity by which short waves decay, (J/(m³ K)) m⁴/s
        let missing = |i: usize| {
            let curve = &matter.curves[matter.material[i] as usize];
            let capacity = curve.capacity(points.temperature[i]);
            let spacing = body.points.spacing[i];
            let speed = velocity[i].norm();
            let sum = laplacian / (spacing * spacing);
            let given = points.conductivity_along(i, 0) / capacity;
            capacity * convection.missing_diffusivity(speed, spacing, sum, given) / sum
        };
        let all = (0..velocity.len()).into_par_iter();
        let all = all.with_min_len(POINTS_PER_TASK);
        all.map(missing).fill(&mut self.rate);
        self.short_waves.clear();
        if self.rate.iter().all(|missing| *missing == 0.0) {
            return;
        }
        self.short_waves.resize(velocity.len(), [0.0]);
        let kernel = Laplacian {
            laplacian: self.laplacian_factor,
        };
        let ghosts = ByRules(matter.rules, 0);
        self.temperature
            .load(&self.family, points.temperature, ghosts);
        self.family
            .sum(&kernel, [&self.temperature], &mut self.short_waves);
        self.rules.clear();
        let rules = matter.rules.iter().map(LayerRule::homogeneous);
        self.rules.extend(rules);
        let excess = |i: usize| -self.rate[i] * self.short_waves[i][0];
        self.excess
            .load(&self.family, excess, ByRules(&self.rules, 0));
        self.family
            .sum(&kernel, [&self.excess], &mut self.short_waves);
    }

    /// Adds convection in a step (s) to the rates of the enthalpy by conduction and sources, W/m³.
    pub(super) fn add(&mut self, matter: &Matter<'_>, dt: f64, rates: &mut [[f64; 1]]) {
        let points = rates.par_iter_mut().zip(&self.short_waves);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|([rate], [short_waves])| *rate += short_waves);
        let mut temperature = std::mem::take(&mut self.middle_temperature);
        let mut enthalpy = std::mem::take(&mut self.middle_enthalpy);
        let points = self.start_enthalpy.par_iter().zip(matter.material);
        let points = points.with_min_len(POINTS_PER_TASK);
        let at = |(h, &m): (&f64, &u16)| matter.curves[m as usize].temperature(*h);
        points.map(at).fill(&mut temperature);
        enthalpy.clear();
        enthalpy.extend_from_slice(&self.start_enthalpy);
        self.find_rate(matter, &temperature, &enthalpy);
        let points = enthalpy.par_iter_mut().zip(&*rates).zip(&self.rate);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|((h, [others]), carried)| *h += 0.5 * dt * (others + carried));
        let points = enthalpy.par_iter().zip(matter.material);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.map(at).fill(&mut temperature);
        self.find_rate(matter, &temperature, &enthalpy);
        let points = rates.par_iter_mut().zip(&self.rate);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|([rate], carried)| *rate += carried);
        (self.middle_temperature, self.middle_enthalpy) = (temperature, enthalpy);
    }

    /// Finds the rate by the flux of this enthalpy.
    fn find_rate(&mut self, matter: &Matter<'_>, temperature: &[f64], enthalpy: &[f64]) {
        self.load(matter, temperature, enthalpy);
        match &self.flux[..] {
            [x, y] => {
                let inputs: [&[f64]; 3] = [x, y, &self.enthalpy];
                self.family.sum(&Outflow::<2>, inputs, &mut self.outflow);
            }
            [x, y, z] => {
                let inputs: [&[f64]; 4] = [x, y, z, &self.enthalpy];
                self.family.sum(&Outflow::<3>, inputs, &mut self.outflow);
            }
            _ => unreachable!("a fluid has two or three dimensions"),
        }
        for wall in &mut self.walls {
            wall.add_outflow(enthalpy, &mut self.outflow);
        }
        let start = self.start_enthalpy.par_iter().zip(&self.start_density);
        let points = self.outflow.par_iter().zip(start);
        let points = points.with_min_len(POINTS_PER_TASK);
        let rate =
            |([mass, heat], (h, density)): (&[f64; 2], (&f64, &f64))| (h * mass - heat) / density;
        points.map(rate).fill(&mut self.rate);
    }

    /// Copies temperature and enthalpy to slots.
    fn load(&mut self, matter: &Matter<'_>, temperature: &[f64], enthalpy: &[f64]) {
        let slots = &mut self.temperature;
        slots.load(&self.family, temperature, ByRules(matter.rules, 0));
        let images = Continuation::default();
        let behind = |image: &Image| {
            let material = matter.material[image.point] as usize;
            [matter.curves[material].enthalpy(slots[image.slot])]
        };
        self.enthalpy
            .load(&self.family, enthalpy, ByImage(&images, behind));
    }

    /// Largest stable explicit step (s) at a point of this spacing (m), for the largest speed (m/s): diffusion is
    /// monotone, and waves travel less than half of the distance per step at which they grow.
    pub(super) fn stable_step(&self, at: Diffusion, speed: f64, spacing: f64) -> f64 {
        let sum = self.laplacian / (spacing * spacing);
        let given = at.conductivity / at.capacity;
        let missing = self
            .convection
            .missing_diffusivity(speed, spacing, sum, given);
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
