//! The elastic operator of a body: forces, stiffness and energy, for any dimension.

use std::sync::Arc;

use perimelt_core::family::LayerRule;
use perimelt_core::material::Property;
use perimelt_core::{Body, BondKernel, Family};
use rayon::prelude::*;

use super::bond::{
    Block, EIGENSTRAIN, Energy, Force, INPUTS, Law, MODULUS, Stiffness, Stress, bulk_modulus,
};

/// Family, constants and work arrays of an elastic body. Vectors have three components per
/// point whatever the dimension; those that the dimension leaves out stay zero.
#[derive(Debug)]
pub struct Elastic {
    family: Arc<Family>,
    dimension: usize,
    finite: bool,
    /// Bond constant times the moment of the family over Young's modulus: `2 d K / E`.
    unit_constant: f64,
    youngs_modulus: Vec<Property>,
    uniform: Option<f64>,
    modulus: Vec<f64>,
    slots: [Vec<f64>; INPUTS],
    sums: Vec<f64>,
    energy: Vec<[f64; 2]>,
    tensors: Vec<[f64; 6]>,
}

#[derive(Clone, Copy)]
enum Sum {
    Force,
    Stiffness,
}

impl Elastic {
    /// The operator of `body` with the given family and Young's moduli of its materials.
    pub fn new(
        body: &Body,
        family: Arc<Family>,
        youngs_modulus: Vec<Property>,
        finite: bool,
    ) -> Self {
        let bond_constant = 2.0 * body.dimension as f64 * bulk_modulus(body.dimension);
        let first = youngs_modulus[0].constant();
        let uniform = first.filter(|_| youngs_modulus.iter().all(|e| e.constant() == first));
        let (points, slots) = (body.points.len(), family.slots());
        let needed = |input| {
            input == EIGENSTRAIN || input < body.dimension || input == MODULUS && uniform.is_none()
        };
        Elastic {
            dimension: body.dimension,
            finite,
            unit_constant: bond_constant,
            modulus: vec![0.0; if uniform.is_some() { 0 } else { points }],
            slots: std::array::from_fn(|i| vec![0.0; if needed(i) { slots } else { 0 }]),
            sums: vec![
                0.0;
                if body.dimension == 3 {
                    0
                } else {
                    points * body.dimension
                }
            ],
            energy: vec![[0.0; 2]; points],
            tensors: Vec::new(),
            youngs_modulus,
            uniform,
            family,
        }
    }

    /// Whether Young's modulus depends on temperature.
    pub fn needs_temperature(&self) -> bool {
        self.youngs_modulus.iter().any(|e| !e.is_constant())
    }

    /// Evaluates Young's modulus at the temperature of each point, K.
    pub fn set_modulus(&mut self, body: &Body, temperature: Option<&[f64]>) {
        if self.uniform.is_some() {
            return;
        }
        let properties = &self.youngs_modulus;
        let points = self
            .modulus
            .par_iter_mut()
            .zip(&body.material_of_point)
            .enumerate();
        points.for_each(|(i, (e, &m))| {
            *e = properties[m as usize].at(temperature.map_or(0.0, |t| t[i]), 0.0);
        });
        self.load_modulus();
    }

    /// Takes the largest modulus of each material: that of the stable step.
    pub fn set_largest_modulus(&mut self, body: &Body) {
        if self.uniform.is_some() {
            return;
        }
        let largest = |e: &Property| e.values().into_iter().fold(0.0, f64::max);
        let largest: Vec<f64> = self.youngs_modulus.iter().map(largest).collect();
        for (e, &m) in self.modulus.iter_mut().zip(&body.material_of_point) {
            *e = largest[m as usize];
        }
        self.load_modulus();
    }

    fn load_modulus(&mut self) {
        self.family
            .scatter(&self.modulus, 1, 0, &mut self.slots[MODULUS]);
        self.family.fill_layers(&[], 0, &mut self.slots[MODULUS]);
    }

    /// Takes the stress-free strain of each point; layers mirror it.
    pub fn set_eigenstrain(&mut self, eigenstrain: &[f64]) {
        self.family
            .scatter(eigenstrain, 1, 0, &mut self.slots[EIGENSTRAIN]);
        self.family
            .fill_layers(&[], 0, &mut self.slots[EIGENSTRAIN]);
    }

    /// Takes displacements, m, and fills the layers by `rules`.
    pub fn set_displacement(&mut self, displacement: &[f64], rules: &[LayerRule]) {
        for axis in 0..self.dimension {
            self.family
                .scatter(displacement, 3, axis, &mut self.slots[axis]);
            self.family.fill_layers(rules, axis, &mut self.slots[axis]);
        }
    }

    /// Force density of the bonds, N/m³.
    pub fn force(&mut self, out: &mut [f64]) {
        self.sum(Sum::Force, out);
    }

    /// Stiffness times the displacement that was set, N/m³: the linear part of minus
    /// [`Elastic::force`], whatever the kinematics.
    pub fn stiffness(&mut self, out: &mut [f64]) {
        self.sum(Sum::Stiffness, out);
    }

    /// Diagonal block of the stiffness of each point as xx, yy, zz, xy, yz, zx, N/m⁵.
    pub fn blocks(&mut self) -> &[[f64; 6]] {
        let mut blocks = self.take_tensors();
        match self.uniform {
            Some(_) => self.run(&Block::<false>(self.law()), &mut blocks),
            None => self.run(&Block::<true>(self.law()), &mut blocks),
        }
        self.tensors = blocks;
        &self.tensors
    }

    fn take_tensors(&mut self) -> Vec<[f64; 6]> {
        let mut tensors = std::mem::take(&mut self.tensors);
        tensors.resize(self.energy.len(), [0.0; 6]);
        tensors
    }

    /// Stress of each point as xx, yy, zz, xy, yz, zx, Pa.
    pub fn stress(&mut self) -> &[[f64; 6]] {
        match self.dimension {
            1 => self.sum_stress::<1>(),
            2 => self.sum_stress::<2>(),
            _ => self.sum_stress::<3>(),
        }
        &self.tensors
    }

    /// Elastic energy density (J/m³) and eigenstress (Pa) of each point.
    pub fn energy(&mut self) -> &[[f64; 2]] {
        match self.dimension {
            1 => self.sum_energy::<1>(),
            2 => self.sum_energy::<2>(),
            _ => self.sum_energy::<3>(),
        }
        &self.energy
    }

    fn sum(&mut self, what: Sum, out: &mut [f64]) {
        match self.dimension {
            1 => self.sum_padded::<1>(what, out),
            2 => self.sum_padded::<2>(what, out),
            _ => self.sum_into::<3>(what, bytemuck::cast_slice_mut(out)),
        }
    }

    fn sum_padded<const D: usize>(&mut self, what: Sum, out: &mut [f64]) {
        let mut sums = std::mem::take(&mut self.sums);
        self.sum_into::<D>(what, bytemuck::cast_slice_mut(&mut sums));
        let (vectors, _) = out.as_chunks_mut::<3>();
        let (sums_of_points, _) = sums.as_chunks::<D>();
        for (out, sum) in vectors.iter_mut().zip(sums_of_points) {
            *out = std::array::from_fn(|axis| if axis < D { sum[axis] } else { 0.0 });
        }
        self.sums = sums;
    }

    /// The kernels' inputs; those that a kernel does not use are any array of the right length.
    fn inputs(&self) -> [&[f64]; INPUTS] {
        self.slots.each_ref().map(|s| {
            if s.is_empty() {
                &self.slots[EIGENSTRAIN][..]
            } else {
                s
            }
        })
    }

    fn law<const VARYING: bool>(&self) -> Law<VARYING> {
        Law {
            bond_constant: self.unit_constant * self.uniform.unwrap_or(1.0),
        }
    }

    fn sum_into<const D: usize>(&self, what: Sum, sums: &mut [[f64; D]]) {
        match (what, self.finite, self.uniform.is_none()) {
            (Sum::Force, false, false) => self.run(&Force::<false, false>(self.law()), sums),
            (Sum::Force, false, true) => self.run(&Force::<false, true>(self.law()), sums),
            (Sum::Force, true, false) => self.run(&Force::<true, false>(self.law()), sums),
            (Sum::Force, true, true) => self.run(&Force::<true, true>(self.law()), sums),
            (Sum::Stiffness, _, false) => self.run(&Stiffness::<false>(self.law()), sums),
            (Sum::Stiffness, _, true) => self.run(&Stiffness::<true>(self.law()), sums),
        }
    }

    fn sum_energy<const D: usize>(&mut self) {
        let mut energy = std::mem::take(&mut self.energy);
        match (self.finite, self.uniform.is_none()) {
            (false, false) => self.run(&Energy::<false, false, D>(self.law()), &mut energy),
            (false, true) => self.run(&Energy::<false, true, D>(self.law()), &mut energy),
            (true, false) => self.run(&Energy::<true, false, D>(self.law()), &mut energy),
            (true, true) => self.run(&Energy::<true, true, D>(self.law()), &mut energy),
        }
        self.energy = energy;
    }

    fn sum_stress<const D: usize>(&mut self) {
        let mut stress = self.take_tensors();
        match (self.finite, self.uniform.is_none()) {
            (false, false) => self.run(&Stress::<false, false, D>(self.law()), &mut stress),
            (false, true) => self.run(&Stress::<false, true, D>(self.law()), &mut stress),
            (true, false) => self.run(&Stress::<true, false, D>(self.law()), &mut stress),
            (true, true) => self.run(&Stress::<true, true, D>(self.law()), &mut stress),
        }
        self.tensors = stress;
    }

    fn run<const O: usize>(&self, kernel: &impl BondKernel<INPUTS, O>, sums: &mut [[f64; O]]) {
        self.family.sum(kernel, self.inputs(), sums);
    }
}
