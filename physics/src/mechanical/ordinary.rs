//! Bond-based and ordinary state-based solids: the kernels of [`stretch`](super::stretch) over a
//! body, for any dimension.

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::{Body, BondKernel, Family};
use rayon::prelude::*;

use super::moduli::{Elasticity, Moduli};
use super::solid::Solid;
use super::stretch::{
    Block, Directions, EIGENSTRAIN, Energy, Expansion, Force, INPUTS, Law, PRESSURE, STIFFNESS,
    Stiffness, Stress, TotalWeight, WeightOverLength,
};

/// Family, moduli and work arrays of a body.
#[derive(Debug)]
pub struct Ordinary {
    family: Arc<Family>,
    dimension: usize,
    finite: bool,
    elasticity: Elasticity,
    /// Whether Poisson's ratio is free: an ordinary state-based solid.
    dilatation: bool,
    /// The moduli where they never vary; else those of each point are in `moduli`.
    uniform: Option<Moduli>,
    moduli: Vec<Moduli>,
    /// In-plane stress-free strain of each point.
    eigenstrain: Vec<f64>,
    /// `N = d / sum_j w_ij` of each point.
    normaliser: Vec<f64>,
    continuation: Continuation,
    /// `sum_j w n (x) n` of each point, once a layer is bent.
    directions: Vec<[f64; 6]>,
    slots: [Vec<f64>; INPUTS],
    /// `sum_j w s` of each point in parts along the axes.
    expansion: Vec<[f64; 3]>,
    pressure: Vec<f64>,
    padded: Vec<f64>,
    energy: Vec<[f64; 2]>,
    tensors: Vec<[f64; 6]>,
}

/// Runs `$run` with constants for (finite kinematics, varying moduli).
macro_rules! choose {
    ($self:ident, $finite:ident, $varying:ident => $run:expr) => {
        match ($self.finite, $self.uniform.is_none()) {
            (false, false) => choose!(false, false, $finite, $varying => $run),
            (false, true) => choose!(false, true, $finite, $varying => $run),
            (true, false) => choose!(true, false, $finite, $varying => $run),
            (true, true) => choose!(true, true, $finite, $varying => $run),
        }
    };
    ($f:literal, $v:literal, $finite:ident, $varying:ident => $run:expr) => {{
        const $finite: bool = $f;
        const $varying: bool = $v;
        $run
    }};
}

impl Ordinary {
    /// The operator of `body` with the given family; Poisson's ratio is free where `elasticity`
    /// has one.
    pub fn new(body: &Body, family: Arc<Family>, elasticity: Elasticity, finite: bool) -> Self {
        let (points, dimension) = (body.points.len(), body.dimension);
        let uniform = elasticity.uniform();
        let dilatation = elasticity.has_free_poissons_ratio();
        let needed = |input| match input {
            EIGENSTRAIN => true,
            STIFFNESS => uniform.is_none(),
            PRESSURE => dilatation,
            axis => axis < dimension,
        };
        let slots = family.slots();
        let mut this = Ordinary {
            dimension,
            finite,
            dilatation,
            moduli: vec![elasticity.at(0, 0.0); if uniform.is_some() { 0 } else { points }],
            eigenstrain: vec![0.0; points],
            normaliser: vec![0.0; if dilatation { points } else { 0 }],
            continuation: Continuation::default(),
            directions: Vec::new(),
            slots: std::array::from_fn(|i| vec![0.0; if needed(i) { slots } else { 0 }]),
            expansion: vec![[0.0; 3]; if dilatation { points } else { 0 }],
            pressure: vec![0.0; points],
            padded: vec![
                0.0;
                if dimension == 3 {
                    0
                } else {
                    points * dimension
                }
            ],
            energy: vec![[0.0; 2]; points],
            tensors: vec![[0.0; 6]; points],
            elasticity,
            uniform,
            family,
        };
        if dilatation {
            let mut total = vec![[0.0]; points];
            this.run(&TotalWeight, &mut total);
            let normalisers = this.normaliser.iter_mut().zip(total);
            normalisers.for_each(|(n, [total])| *n = dimension as f64 / total);
        }
        this
    }

    fn moduli(&self, point: usize) -> Moduli {
        self.uniform.unwrap_or_else(|| self.moduli[point])
    }

    fn load_moduli(&mut self) {
        let dimension = self.dimension;
        let stiffness: Vec<f64> = self
            .moduli
            .iter()
            .map(|m| m.bond_stiffness(dimension))
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
        pressures.for_each(|(i, p)| *p = self.pressure_of(i, self.expansion[i], total));
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
            slots[image.slot] = self.pressure_of(image.point, sums, total);
        }
        self.slots[PRESSURE] = slots;
    }

    /// `p = 2 a N theta`, Pa.
    fn pressure_of(&self, point: usize, expansion: [f64; 3], total: bool) -> f64 {
        let swelling = if total { 0.0 } else { self.eigenstrain[point] };
        let normaliser = self.normaliser[point];
        let dilatation =
            normaliser * expansion.iter().sum::<f64>() - self.dimension as f64 * swelling;
        2.0 * self.moduli(point).dilatation_stiffness(self.dimension) * normaliser * dilatation
    }

    fn expand(&mut self) {
        match self.dimension {
            1 => self.expand_in::<1>(),
            2 => self.expand_in::<2>(),
            _ => self.expand_in::<3>(),
        }
    }

    fn expand_in<const D: usize>(&mut self) {
        let mut expansion = std::mem::take(&mut self.expansion);
        let mut padded = std::mem::take(&mut self.padded);
        let sums = flat::<D>(&mut padded, &mut expansion);
        choose!(self, F, _V => self.run(&Expansion::<F>, sums));
        unflatten::<D>(&padded, bytemuck::cast_slice_mut(&mut expansion));
        (self.expansion, self.padded) = (expansion, padded);
    }

    fn sum_forces(&mut self, out: &mut [f64], stiffness: bool) {
        match self.dimension {
            1 => self.sum_forces_in::<1>(out, stiffness),
            2 => self.sum_forces_in::<2>(out, stiffness),
            _ => self.sum_forces_in::<3>(out, stiffness),
        }
    }

    fn sum_forces_in<const D: usize>(&mut self, out: &mut [f64], stiffness: bool) {
        let mut padded = std::mem::take(&mut self.padded);
        let sums = flat::<D>(&mut padded, bytemuck::cast_slice_mut(out));
        choose!(self, F, V => match (stiffness, self.dilatation) {
            (false, false) => self.run(&Force::<F, V, false>(self.law()), sums),
            (false, true) => self.run(&Force::<F, V, true>(self.law()), sums),
            (true, false) => self.run(&Stiffness::<V, false>(self.law()), sums),
            (true, true) => self.run(&Stiffness::<V, true>(self.law()), sums),
        });
        unflatten::<D>(&padded, out);
        self.padded = padded;
    }

    fn sum_energy<const D: usize>(&mut self) {
        let mut energy = std::mem::take(&mut self.energy);
        choose!(self, F, V => self.run(&Energy::<F, V, D>(self.law()), &mut energy));
        self.energy = energy;
    }

    fn sum_stress<const D: usize>(&mut self) {
        let mut stress = std::mem::take(&mut self.tensors);
        choose!(self, F, V => self.run(&Stress::<F, V, D>(self.law()), &mut stress));
        self.tensors = stress;
    }

    fn law<const VARYING: bool>(&self) -> Law<VARYING> {
        let stiffness = self
            .uniform
            .map_or(0.0, |m| m.bond_stiffness(self.dimension));
        Law { stiffness }
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
        choose!(self, F, V => match self.dilatation {
            false => self.family.sum_across(&Force::<F, V, false>(self.law()), self.inputs(), plane, spread),
            true => self.family.sum_across(&Force::<F, V, true>(self.law()), self.inputs(), plane, spread),
        });
    }

    /// The slots; inputs that a kernel does not use are any array of the right length.
    fn inputs(&self) -> [&[f64]; INPUTS] {
        self.slots.each_ref().map(|s| match s.is_empty() {
            true => &self.slots[EIGENSTRAIN][..],
            false => s,
        })
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

/// A symmetric tensor from xx, yy, zz, xy, yz, zx.
pub(super) fn symmetric(&[xx, yy, zz, xy, yz, zx]: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
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

    fn force(&mut self, out: &mut [f64]) {
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
        match self.uniform {
            Some(_) => self.run(&Block::<false>(self.law()), &mut blocks),
            None => self.run(&Block::<true>(self.law()), &mut blocks),
        }
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
        let kernel = Block::<true>(Law { stiffness: 0.0 });
        self.family.sum(&kernel, [&slots[..]; INPUTS], &mut blocks);
        let largest = |block| 2.0 * symmetric(block).symmetric_eigenvalues().max();
        let squares = blocks.iter().zip(density).map(|(b, rho)| largest(b) / rho);
        Some(squares.fold(0.0, f64::max).sqrt())
    }

    fn energy(&mut self) -> &[[f64; 2]] {
        match self.dimension {
            1 => self.sum_energy::<1>(),
            2 => self.sum_energy::<2>(),
            _ => self.sum_energy::<3>(),
        }
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
        self.load_pressure(false);
        match self.dimension {
            1 => self.sum_stress::<1>(),
            2 => self.sum_stress::<2>(),
            _ => self.sum_stress::<3>(),
        }
        if self.elasticity.is_plane_strain() {
            for i in 0..self.tensors.len() {
                let (moduli, eigenstrain) = (self.moduli(i), self.eigenstrain[i]);
                self.tensors[i][2] = moduli.stress_across(&self.tensors[i], eigenstrain);
            }
        }
        &self.tensors
    }

    fn force_across(&mut self, plane: (usize, f64), receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_pressure(false);
        match self.dimension {
            1 => self.across::<1>(plane, receive),
            2 => self.across::<2>(plane, receive),
            _ => self.across::<3>(plane, receive),
        }
    }
}
