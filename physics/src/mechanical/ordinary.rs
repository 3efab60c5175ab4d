//! Bond-based and ordinary state-based solids: the kernels of [`stretch`](super::stretch) over a
//! body, for any dimension.

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::{Body, BondKernel, Family};
use rayon::prelude::*;

use super::classical::{Point, diagonal, image_of, symmetric};
use super::gradient::{FlatFamily, Gradient};
use super::moduli::{Elasticity, Moduli};
use super::plasticity::{Plasticity, StressState};
use super::solid::Solid;
use super::stretch::{
    Block, Directions, EIGENSTRAIN, Energy, Expansion, Force, INPUTS, PLASTIC_INPUTS, PRESSURE,
    Plastic, STIFFNESS, Stiffness, Stress, TotalWeight, WeightOverLength,
};

/// Family, moduli and work arrays of a body.
#[derive(Debug)]
pub struct Ordinary {
    family: Arc<Family>,
    dimension: usize,
    finite: bool,
    /// Largest, m.
    horizon: f64,
    elasticity: Elasticity,
    /// Whether Poisson's ratio is free: an ordinary state-based solid.
    dilatation: bool,
    /// The moduli where they never vary; else those of each point are in `moduli`.
    uniform: Option<Moduli>,
    moduli: Vec<Moduli>,
    /// In-plane stress-free strain of each point.
    eigenstrain: Vec<f64>,
    plasticity: Option<Plasticity>,
    /// Of plastic solids.
    gradient: Option<Gradient>,
    /// Components of the inelastic strain in slot space; empty without plasticity.
    inelastic: [Vec<f64>; 6],
    /// `N = d / sum_j w_ij` of each point.
    normaliser: Vec<f64>,
    continuation: Continuation,
    /// `sum_j w n (x) n` of each point, once a layer is bent.
    directions: Vec<[f64; 6]>,
    slots: [Vec<f64>; INPUTS],
    /// Stands for inputs that there are not.
    zeros: Vec<f64>,
    /// `sum_j w s` of each point in parts along the axes.
    expansion: Vec<[f64; 3]>,
    pressure: Vec<f64>,
    padded: Vec<f64>,
    energy: Vec<[f64; 2]>,
    tensors: Vec<[f64; 6]>,
}

impl Ordinary {
    /// The operator of `body` with the given family; Poisson's ratio is free where `elasticity`
    /// has one.
    pub fn new(
        body: &Body,
        family: Arc<Family>,
        elasticity: Elasticity,
        finite: bool,
        plasticity: Option<Plasticity>,
    ) -> Result<Self, FlatFamily> {
        let (points, dimension) = (body.points.len(), body.dimension);
        let uniform = elasticity.uniform();
        let dilatation = elasticity.has_free_poissons_ratio();
        let needed = |input| match input {
            EIGENSTRAIN => true,
            STIFFNESS => true,
            PRESSURE => dilatation,
            axis => axis < dimension,
        };
        let slots = family.slots();
        let mut this = Ordinary {
            dimension,
            finite,
            horizon: family.spec().horizon.of(body.coarsest_spacing()),
            dilatation,
            moduli: vec![elasticity.at(0, 0.0); if uniform.is_some() { 0 } else { points }],
            eigenstrain: vec![0.0; points],
            inelastic: std::array::from_fn(|_| {
                vec![0.0; if plasticity.is_some() { slots } else { 0 }]
            }),
            gradient: match plasticity {
                Some(_) => Some(Gradient::new(body, family.clone())?),
                None => None,
            },
            plasticity,
            normaliser: vec![0.0; if dilatation { points } else { 0 }],
            continuation: Continuation::default(),
            directions: Vec::new(),
            slots: std::array::from_fn(|i| vec![0.0; if needed(i) { slots } else { 0 }]),
            zeros: vec![0.0; slots],
            expansion: vec![[0.0; 3]; if dilatation { points } else { 0 }],
            pressure: vec![0.0; points],
            padded: vec![0.0; if dimension == 2 { 2 * points } else { 0 }],
            energy: vec![[0.0; 2]; points],
            tensors: vec![[0.0; 6]; points],
            elasticity,
            uniform,
            family,
        };
        this.load_moduli();
        if dilatation {
            let mut total = vec![[0.0]; points];
            this.run(&TotalWeight, &mut total);
            let normalisers = this.normaliser.iter_mut().zip(total);
            normalisers.for_each(|(n, [total])| *n = dimension as f64 / total);
        }
        Ok(this)
    }

    fn moduli(&self, point: usize) -> Moduli {
        self.uniform.unwrap_or_else(|| self.moduli[point])
    }

    fn load_moduli(&mut self) {
        let dimension = self.dimension;
        let stiffness: Vec<f64> = (0..self.energy.len())
            .map(|i| self.moduli(i).bond_stiffness(dimension))
            .collect();
        self.family
            .scatter(&stiffness, 1, 0, &mut self.slots[STIFFNESS]);
        self.family.fill_layers(&[], 0, &mut self.slots[STIFFNESS]);
    }

    /// Loads the pressure from dilatation of the displacement that was set, of the total strain or
    /// without the eigenstrain.
    fn load_pressure(&mut self, total: bool) {
        if !self.dilatation {
            return;
        }
        self.expand();
        let mut pressure = std::mem::take(&mut self.pressure);
        let pressures = pressure.par_iter_mut().enumerate();
        pressures.for_each(|(i, p)| {
            *p = self.pressure_of(i, self.expansion[i], self.tried(i), total);
        });
        self.pressure = pressure;
        let mut slots = std::mem::take(&mut self.slots[PRESSURE]);
        self.family.scatter(&self.pressure, 1, 0, &mut slots);
        if self.continuation.is_bent() && self.directions.is_empty() {
            let mut directions = vec![[0.0; 6]; self.expansion.len()];
            self.run(&Directions, &mut directions);
            self.directions = directions;
        }
        for image in self.family.images(&self.continuation) {
            let sums = self.expansion[image.point];
            let mut sums: [f64; 3] =
                std::array::from_fn(|a| image.scale[a] * image.mirror[a] * sums[a]);
            if self.continuation.is_bent() {
                let mirror = Matrix3::from_diagonal(&image.mirror.into());
                let directions = mirror * symmetric(&self.directions[image.point]) * mirror;
                sums[0] += image.bend.dot(&directions);
            }
            let inelastic = self.plasticity.as_ref().map(|p| {
                let [scale, mirror] = [image.scale, image.mirror].map(diagonal);
                image_of(&scale, &p.tried[image.point].strain, &mirror)
            });
            slots[image.slot] = self.pressure_of(image.point, sums, inelastic, total);
        }
        self.slots[PRESSURE] = slots;
    }

    /// `p = 2 a N theta`, Pa. Inelastic strains make a stress of `lame tr + 2 mu strain`; bonds make
    /// `mu` of the trace in its place, and the difference is made up here.
    fn pressure_of(
        &self,
        point: usize,
        expansion: [f64; 3],
        inelastic: Option<[f64; 6]>,
        total: bool,
    ) -> f64 {
        let moduli = self.moduli(point);
        let d = self.dimension as f64;
        let normaliser = self.normaliser[point];
        let dilatation = normaliser * expansion.iter().sum::<f64>();
        let pressure = 2.0 * moduli.dilatation_stiffness(self.dimension);
        if total {
            return normaliser * pressure * dilatation;
        }
        let relieved = inelastic
            .zip(self.plasticity.as_ref())
            .map_or(0.0, |(strain, p)| {
                let in_plane: f64 = strain[..self.dimension].iter().sum();
                moduli.lame * p.stress_state.trace(&strain) - moduli.shear * in_plane
            });
        normaliser * (pressure * (dilatation - d * self.eigenstrain[point]) - relieved)
    }

    fn tried(&self, point: usize) -> Option<[f64; 6]> {
        self.plasticity.as_ref().map(|p| p.tried[point].strain)
    }

    /// Loads the inelastic strain that was tried last.
    fn load_inelastic(&mut self) {
        let Some(plasticity) = &self.plasticity else {
            return;
        };
        let mut slots = std::mem::take(&mut self.inelastic);
        let mut component = vec![0.0; plasticity.tried.len()];
        for (c, slots) in slots.iter_mut().enumerate() {
            let tried = component.iter_mut().zip(&plasticity.tried);
            tried.for_each(|(value, tried)| *value = tried.strain[c]);
            self.family.scatter(&component, 1, 0, slots);
        }
        for image in self.family.images(&self.continuation) {
            let [scale, mirror] = [image.scale, image.mirror].map(diagonal);
            let strain = image_of(&scale, &plasticity.tried[image.point].strain, &mirror);
            slots
                .iter_mut()
                .zip(strain)
                .for_each(|(slots, e)| slots[image.slot] = e);
        }
        self.inelastic = slots;
    }

    /// The classical law of a point with the given inelastic strain.
    fn point(&self, i: usize, state: StressState, inelastic: [f64; 6]) -> Point {
        let (moduli, eigenstrain) = (self.moduli(i), self.eigenstrain[i]);
        Point::new(moduli, eigenstrain, self.dimension).with_inelastic(state, inelastic)
    }

    /// Returns the stress of the displacement that was set to the flow stress.
    fn flow(&mut self) {
        let (Some(mut plasticity), Some(mut gradient)) =
            (self.plasticity.take(), self.gradient.take())
        else {
            return;
        };
        gradient.evaluate(std::array::from_fn(|axis| &self.slots[axis][..]));
        let (state, settled) = (
            plasticity.stress_state,
            std::mem::take(&mut plasticity.settled),
        );
        let plane_strain = self.elasticity.is_plane_strain();
        let trial = |i: usize| {
            let point = self.point(i, state, settled[i].strain);
            let stress = point.material_stress(&gradient.values[i], self.finite);
            point.components(&stress, plane_strain)
        };
        plasticity.try_stress(&settled, trial, |i| self.moduli(i));
        plasticity.settled = settled;
        (self.plasticity, self.gradient) = (Some(plasticity), Some(gradient));
    }

    fn evaluate_stress(&mut self) {
        self.load_inelastic();
        self.load_pressure(false);
        self.sum_stress();
        if self.elasticity.is_plane_strain() {
            for i in 0..self.tensors.len() {
                let across = self.tried(i).map_or(0.0, |strain| strain[2]);
                let (moduli, eigenstrain) = (self.moduli(i), self.eigenstrain[i]);
                self.tensors[i][2] = moduli.stress_across(&self.tensors[i], eigenstrain, across);
            }
        }
    }

    fn expand(&mut self) {
        let mut expansion = std::mem::take(&mut self.expansion);
        match self.finite {
            false => self.run(&Expansion::<false>, &mut expansion),
            true => self.run(&Expansion::<true>, &mut expansion),
        }
        self.expansion = expansion;
    }

    fn sum_forces(&mut self, out: &mut [f64], stiffness: bool) {
        match self.dimension {
            2 => self.sum_forces_in::<2>(out, stiffness),
            _ => self.sum_forces_in::<3>(out, stiffness),
        }
    }

    fn sum_forces_in<const D: usize>(&mut self, out: &mut [f64], stiffness: bool) {
        let mut padded = std::mem::take(&mut self.padded);
        let sums = flat::<D>(&mut padded, bytemuck::cast_slice_mut(out));
        match (stiffness, self.finite, self.dilatation) {
            (true, _, false) => self.run(&Stiffness::<false>, sums),
            (true, _, true) => self.run(&Stiffness::<true>, sums),
            (false, false, _) if self.plasticity.is_some() => {
                self.run_plastic(Force::<false, true>, sums);
            }
            (false, true, _) if self.plasticity.is_some() => {
                self.run_plastic(Force::<true, true>, sums);
            }
            (false, false, false) => self.run(&Force::<false, false>, sums),
            (false, false, true) => self.run(&Force::<false, true>, sums),
            (false, true, false) => self.run(&Force::<true, false>, sums),
            (false, true, true) => self.run(&Force::<true, true>, sums),
        }
        unflatten::<D>(&padded, out);
        self.padded = padded;
    }

    fn sum_stress(&mut self) {
        let mut stress = std::mem::take(&mut self.tensors);
        let kernel = Stress {
            finite: self.finite,
        };
        match self.plasticity {
            Some(_) => self.run_plastic(kernel, &mut stress),
            None => self.run(&kernel, &mut stress),
        }
        self.tensors = stress;
    }

    /// Runs a kernel with the inelastic strain.
    fn run_plastic<const O: usize>(
        &self,
        kernel: impl BondKernel<INPUTS, O>,
        sums: &mut [[f64; O]],
    ) {
        self.family
            .sum(&Plastic(kernel), self.plastic_inputs(), sums);
    }

    fn plastic_inputs(&self) -> [&[f64]; PLASTIC_INPUTS] {
        std::array::from_fn(|i| match i.checked_sub(INPUTS) {
            Some(component) => &self.inelastic[component][..],
            None => self.input(i),
        })
    }

    /// An input, zero where there is none.
    fn input(&self, i: usize) -> &[f64] {
        match self.slots[i].is_empty() {
            true => &self.zeros,
            false => &self.slots[i],
        }
    }

    fn across<const D: usize>(
        &self,
        plane: (usize, f64),
        receive: &mut dyn FnMut(usize, [f64; 3]),
    ) {
        let spread = |point, force: [f64; D]| {
            receive(
                point,
                std::array::from_fn(|a| if a < D { force[a] } else { 0.0 }),
            );
        };
        let family = &self.family;
        match (self.plasticity.is_some(), self.finite, self.dilatation) {
            (true, false, _) => {
                let kernel = Plastic(Force::<false, true>);
                family.sum_across(&kernel, self.plastic_inputs(), plane, spread);
            }
            (true, true, _) => {
                let kernel = Plastic(Force::<true, true>);
                family.sum_across(&kernel, self.plastic_inputs(), plane, spread);
            }
            (false, false, false) => {
                family.sum_across(&Force::<false, false>, self.inputs(), plane, spread);
            }
            (false, false, true) => {
                family.sum_across(&Force::<false, true>, self.inputs(), plane, spread);
            }
            (false, true, false) => {
                family.sum_across(&Force::<true, false>, self.inputs(), plane, spread);
            }
            (false, true, true) => {
                family.sum_across(&Force::<true, true>, self.inputs(), plane, spread);
            }
        }
    }

    fn inputs(&self) -> [&[f64]; INPUTS] {
        std::array::from_fn(|i| self.input(i))
    }

    fn run<const O: usize>(&self, kernel: &impl BondKernel<INPUTS, O>, sums: &mut [[f64; O]]) {
        self.family.sum(kernel, self.inputs(), sums);
    }
}

/// Where sums of `D` components go: to the output itself in 3D, else to the work array.
pub(super) fn flat<'a, const D: usize>(
    padded: &'a mut [f64],
    out: &'a mut [[f64; 3]],
) -> &'a mut [[f64; D]] {
    match D {
        3 => bytemuck::cast_slice_mut::<f64, [f64; D]>(bytemuck::cast_slice_mut(out)),
        _ => bytemuck::cast_slice_mut(padded),
    }
}

/// Spreads sums of `D` components to vectors of three.
pub(super) fn unflatten<const D: usize>(padded: &[f64], out: &mut [f64]) {
    if D < 3 {
        let (vectors, _) = out.as_chunks_mut::<3>();
        for (out, sum) in vectors.iter_mut().zip(padded.as_chunks::<D>().0) {
            *out = std::array::from_fn(|axis| if axis < D { sum[axis] } else { 0.0 });
        }
    }
}

impl Solid for Ordinary {
    fn set_moduli(&mut self, body: &Body, temperature: Option<&[f64]>) {
        if self.uniform.is_some() {
            return;
        }
        let elasticity = &self.elasticity;
        let points = self.moduli.par_iter_mut().zip(&body.material_of_point);
        points.enumerate().for_each(|(i, (moduli, &m))| {
            *moduli = elasticity.at(m as usize, temperature.map_or(0.0, |t| t[i]));
        });
        self.load_moduli();
    }

    fn set_stiffest_moduli(&mut self, body: &Body) {
        if self.uniform.is_some() {
            return;
        }
        for (moduli, &m) in self.moduli.iter_mut().zip(&body.material_of_point) {
            *moduli = self.elasticity.stiffest(m as usize);
        }
        self.load_moduli();
    }

    fn set_eigenstrain(&mut self, eigenstrain: &[f64]) {
        for (i, e) in eigenstrain.iter().enumerate() {
            self.eigenstrain[i] = e * self.moduli(i).swelling;
        }
        let slots = &mut self.slots[EIGENSTRAIN];
        self.family.scatter(&self.eigenstrain, 1, 0, slots);
        self.family.fill_layers(&[], 0, slots);
    }

    fn set_displacement(&mut self, displacement: &[f64], rules: &[LayerRule]) {
        let mut slots = std::mem::take(&mut self.slots);
        let mut continuation = std::mem::take(&mut self.continuation);
        for (axis, slots) in slots[..self.dimension].iter_mut().enumerate() {
            self.family.scatter(displacement, 3, axis, slots);
        }
        let (vector, dimension) = (&mut slots[..self.dimension], self.dimension);
        self.family.continue_vector(
            rules,
            vector,
            &mut continuation,
            |face, traction, i, lateral| {
                let at = (face, traction);
                let moduli = self.moduli(i);
                moduli.slope_under_traction(at, lateral, self.eigenstrain[i], dimension)
            },
        );
        (self.slots, self.continuation) = (slots, continuation);
    }

    fn horizon(&self) -> f64 {
        self.horizon
    }

    fn plasticity(&mut self) -> Option<&mut Plasticity> {
        self.plasticity.as_mut()
    }

    fn material_stress(&mut self) -> Vec<[f64; 6]> {
        let (Some(plasticity), Some(gradient)) = (&self.plasticity, &self.gradient) else {
            return Vec::new();
        };
        let stress = |i: usize| {
            let point = self.point(i, plasticity.stress_state, plasticity.tried[i].strain);
            let stress = point.material_stress(&gradient.values[i], self.finite);
            point.components(&stress, self.elasticity.is_plane_strain())
        };
        (0..gradient.values.len()).map(stress).collect()
    }

    fn moduli_of(&self, point: usize) -> Moduli {
        self.moduli(point)
    }

    fn force(&mut self, out: &mut [f64]) {
        self.flow();
        self.load_inelastic();
        self.load_pressure(false);
        self.sum_forces(out, false);
    }

    fn stiffness(&mut self, out: &mut [f64]) {
        let finite = std::mem::replace(&mut self.finite, false);
        self.load_pressure(true);
        self.sum_forces(out, true);
        self.finite = finite;
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        let mut blocks = std::mem::take(&mut self.tensors);
        self.run(&Block, &mut blocks);
        self.tensors = blocks;
        &self.tensors
    }

    /// Twice the largest eigenvalue of the diagonal block: of a network of springs no eigenvalue
    /// exceeds it, because `(n . (u_j - u_i))^2 <= 2 (n . u_i)^2 + 2 (n . u_j)^2`. A positive
    /// dilatation stiffness adds at most the springs `c = 4 a N^2 sum_j w/|xi|`, by `(sum_j w s)^2
    /// <= (sum_j w/|xi|) sum_j w |xi| s^2`.
    fn frequency_bound(&mut self, density: &[f64]) -> Option<f64> {
        let points = self.energy.len();
        let mut sums = vec![[0.0]; points];
        self.run(&WeightOverLength, &mut sums);
        let stiffness = |i: usize| {
            let moduli = self.moduli(i);
            let a = moduli.dilatation_stiffness(self.dimension).max(0.0);
            let added = match self.dilatation {
                true => 4.0 * a * self.normaliser[i].powi(2) * sums[i][0],
                false => 0.0,
            };
            moduli.bond_stiffness(self.dimension) + added
        };
        let stiffness: Vec<f64> = (0..points).map(stiffness).collect();
        let mut slots = vec![0.0; self.family.slots()];
        self.family.scatter(&stiffness, 1, 0, &mut slots);
        self.family.fill_layers(&[], 0, &mut slots);
        let mut blocks = vec![[0.0; 6]; points];
        self.family.sum(&Block, [&slots[..]; INPUTS], &mut blocks);
        let largest = |block| 2.0 * symmetric(block).symmetric_eigenvalues().max();
        let squares = blocks.iter().zip(density).map(|(b, rho)| largest(b) / rho);
        Some(squares.fold(0.0, f64::max).sqrt())
    }

    fn energy(&mut self) -> &[[f64; 2]] {
        let mut energy = std::mem::take(&mut self.energy);
        let kernel = Energy {
            finite: self.finite,
            pairs: !self.dilatation,
        };
        self.run(&kernel, &mut energy);
        self.energy = energy;
        if self.dilatation {
            self.expand();
            for i in 0..self.energy.len() {
                let a = self.moduli(i).dilatation_stiffness(self.dimension);
                let theta = self.normaliser[i] * self.expansion[i].iter().sum::<f64>();
                self.energy[i][0] += a * theta * theta;
                self.energy[i][1] += 2.0 * a * theta * self.dimension as f64;
            }
        }
        for i in 0..self.energy.len() {
            self.energy[i][1] *= self.moduli(i).swelling;
        }
        &self.energy
    }

    fn stress(&mut self) -> &[[f64; 6]] {
        self.evaluate_stress();
        &self.tensors
    }

    fn force_across(&mut self, plane: (usize, f64), receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_inelastic();
        self.load_pressure(false);
        match self.dimension {
            1 => self.across::<1>(plane, receive),
            2 => self.across::<2>(plane, receive),
            _ => self.across::<3>(plane, receive),
        }
    }
}
