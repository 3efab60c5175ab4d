//! Bond-based and ordinary state-based solids: the kernels of [`stretch`](super::stretch) over a
//! body, for any dimension.

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::{Body, Bond, BondKernel, BrokenBonds, Family, Horizon};
use rayon::prelude::*;

use super::classical::{Point, diagonal, image_of, symmetric};
use super::fracture::Fracture;
use super::gradient::{FlatFamily, Gradient};
use super::moduli::{Elasticity, Moduli};
use super::plasticity::{Plasticity, Strains};
use super::solid::{Of, Solid, continue_displacement};
use super::stretch::{
    Block, Breaking, CRITICAL, Dilation, Directions, EIGENSTRAIN, Energy, Expansion, Force, INPUTS,
    Load, PLASTIC_INPUTS, PRESSURE, Plastic, STIFFNESS, Stiffness, Stress, TotalWeight, Uniform,
    WeightOverLength,
};

/// Family, moduli and work arrays of a body.
#[derive(Debug)]
pub struct Ordinary {
    family: Arc<Family>,
    dimension: usize,
    finite: bool,
    /// Largest, m.
    horizon: f64,
    horizons_differ: bool,
    elasticity: Elasticity,
    /// Whether Poisson's ratio is free: an ordinary state-based solid.
    dilatation: bool,
    /// The moduli where they never vary; else those of each point are in `moduli`.
    uniform: Option<Moduli>,
    /// Eigenstrain, stiffness and limit where they are the same for all points; the rest is not filled.
    same: Option<[f64; INPUTS]>,
    moduli: Vec<Moduli>,
    /// In-plane stress-free strain of each point.
    eigenstrain: Vec<f64>,
    plasticity: Option<Plasticity>,
    fracture: Option<Fracture>,
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
    /// `sum_j w s` of each point.
    dilation: Vec<[f64; 1]>,
    /// Its parts along the axes, of which images of points need each; empty without layers.
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
        fracture: Option<Fracture>,
    ) -> Result<Self, FlatFamily> {
        let (points, dimension) = (body.points.len(), body.dimension);
        let uniform = elasticity.uniform();
        let dilatation = elasticity.has_free_poissons_ratio();
        let breaks = fracture.is_some();
        let needed = |input| match input {
            EIGENSTRAIN | STIFFNESS => true,
            PRESSURE => dilatation,
            CRITICAL => breaks,
            axis => axis < dimension,
        };
        let slots = family.slots();
        let mut this = Ordinary {
            dimension,
            finite,
            horizon: family.spec().horizon.of(body.coarsest_spacing()),
            horizons_differ: matches!(family.spec().horizon, Horizon::Spacings(_))
                && body.points.spacing.windows(2).any(|s| s[0] != s[1]),
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
            fracture,
            normaliser: vec![0.0; if dilatation { points } else { 0 }],
            continuation: Continuation::default(),
            directions: Vec::new(),
            slots: std::array::from_fn(|i| vec![0.0; if needed(i) { slots } else { 0 }]),
            zeros: vec![0.0; slots],
            dilation: vec![[0.0]; if dilatation { points } else { 0 }],
            expansion: vec![
                [0.0; 3];
                if dilatation && family.has_layers() {
                    points
                } else {
                    0
                }
            ],
            pressure: vec![0.0; points],
            padded: Vec::new(),
            energy: vec![[0.0; 2]; points],
            tensors: vec![[0.0; 6]; points],
            elasticity,
            uniform,
            same: None,
            family,
        };
        this.padded = vec![0.0; if dimension == 2 { 2 * points } else { 0 }];
        this.load_moduli();
        this.load_strength(body, None);
        this.compare_points();
        if dilatation {
            let mut total = vec![[0.0]; points];
            this.family.sum(&TotalWeight, [], &mut total);
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

    fn evaluate_moduli(&mut self, body: &Body, temperature: Option<&[f64]>) {
        let elasticity = &self.elasticity;
        let points = self.moduli.par_iter_mut().zip(&body.material_of_point);
        points.enumerate().for_each(|(i, (moduli, &m))| {
            *moduli = elasticity.at(m as usize, temperature.map_or(0.0, |t| t[i]));
        });
        self.load_moduli();
    }

    fn load_strength(&mut self, body: &Body, temperature: Option<&[f64]>) {
        let Some(mut fracture) = self.fracture.take() else {
            return;
        };
        fracture.load(body, temperature, |i| self.moduli(i));
        let slots = &mut self.slots[CRITICAL];
        self.family.scatter(&fracture.critical, 1, 0, slots);
        self.family.fill_layers(&[], 0, slots);
        self.fracture = Some(fracture);
    }

    /// Notes whether points differ in more than what moves them.
    fn compare_points(&mut self) {
        let same = |values: &[f64]| {
            let first = values.first().copied().unwrap_or_default();
            values.iter().all(|v| *v == first).then_some(first)
        };
        let limit = self
            .fracture
            .as_ref()
            .map_or(Some(0.0), |f| same(&f.critical));
        let inputs = (self.uniform, same(&self.eigenstrain), limit);
        self.same = if let (Some(moduli), Some(eigenstrain), Some(limit)) = inputs {
            let mut point = [0.0; INPUTS];
            point[EIGENSTRAIN] = eigenstrain;
            point[STIFFNESS] = moduli.bond_stiffness(self.dimension);
            point[CRITICAL] = limit;
            Some(point)
        } else {
            None
        };
    }

    fn broken(&self) -> Option<&BrokenBonds> {
        self.fracture.as_ref().map(|f| &f.state.broken)
    }

    /// Loads the pressure from dilatation of the displacement that was set.
    fn load_pressure(&mut self, of: Of) {
        if !self.dilatation {
            return;
        }
        self.expand();
        let mut pressure = std::mem::take(&mut self.pressure);
        let pressures = pressure.par_iter_mut().enumerate();
        pressures.for_each(|(i, p)| {
            *p = self.pressure_of(i, self.dilation[i], self.inelastic_of(i, of), of);
        });
        self.pressure = pressure;
        let mut slots = std::mem::take(&mut self.slots[PRESSURE]);
        self.family.scatter(&self.pressure, 1, 0, &mut slots);
        if self.continuation.is_bent() && self.directions.is_empty() {
            let mut directions = vec![[0.0; 6]; self.dilation.len()];
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
            let inelastic = self.inelastic_of(image.point, of).map(|strain| {
                let [scale, mirror] = [image.scale, image.mirror].map(diagonal);
                image_of(&scale, &strain, &mirror)
            });
            slots[image.slot] = self.pressure_of(image.point, [sums.iter().sum()], inelastic, of);
        }
        self.slots[PRESSURE] = slots;
    }

    /// `p = 2 a N theta`, Pa. Inelastic strains make a stress of `lame tr + 2 mu strain`; bonds make
    /// `mu` of the trace in its place, and the difference is made up here.
    fn pressure_of(
        &self,
        point: usize,
        [dilation]: [f64; 1],
        inelastic: Option<[f64; 6]>,
        of: Of,
    ) -> f64 {
        let moduli = self.moduli(point);
        let d = self.dimension as f64;
        let normaliser = self.normaliser[point];
        let dilatation = normaliser * dilation;
        let pressure = 2.0 * moduli.dilatation_stiffness(self.dimension);
        let eigenstrain = match of {
            Of::Elastic => self.eigenstrain[point],
            Of::Total | Of::Change => 0.0,
        };
        let relieved = inelastic
            .zip(self.plasticity.as_ref())
            .map_or(0.0, |(strain, p)| {
                let in_plane: f64 = strain[..self.dimension].iter().sum();
                moduli.lame * p.stress_state.trace(&strain) - moduli.shear * in_plane
            });
        normaliser * (pressure * (dilatation - d * eigenstrain) - relieved)
    }

    /// Inelastic strain of a point, where there is any.
    fn inelastic_of(&self, point: usize, of: Of) -> Option<[f64; 6]> {
        let plasticity = self.plasticity.as_ref()?;
        match of {
            Of::Elastic => Some(plasticity.tried[point].strain),
            Of::Change => Some(plasticity.change[point]),
            Of::Total => None,
        }
    }

    /// Loads the inelastic strain that was tried last, or its change.
    fn load_inelastic(&mut self, of: Of) {
        let Some(plasticity) = &self.plasticity else {
            return;
        };
        let strain = |i: usize| match of {
            Of::Change => &plasticity.change[i],
            Of::Elastic | Of::Total => &plasticity.tried[i].strain,
        };
        let mut slots = std::mem::take(&mut self.inelastic);
        let mut component = vec![0.0; plasticity.tried.len()];
        for (c, slots) in slots.iter_mut().enumerate() {
            let values = component.iter_mut().enumerate();
            values.for_each(|(i, value)| *value = strain(i)[c]);
            self.family.scatter(&component, 1, 0, slots);
        }
        for image in self.family.images(&self.continuation) {
            let [scale, mirror] = [image.scale, image.mirror].map(diagonal);
            let strain = image_of(&scale, strain(image.point), &mirror);
            slots
                .iter_mut()
                .zip(strain)
                .for_each(|(slots, e)| slots[image.slot] = e);
        }
        self.inelastic = slots;
    }

    /// The elastic law by which a point flows; a loose one does not.
    fn law(&self, gradient: &Gradient, i: usize) -> Point {
        match gradient.is_loose(i) {
            true => Point::loose(self.moduli(i), self.dimension),
            false => Point::new(self.moduli(i), self.eigenstrain[i], self.dimension),
        }
    }

    fn strains<'a>(&self, gradient: &'a Gradient) -> Strains<'a> {
        Strains {
            gradients: &gradient.values,
            finite: self.finite,
            plane_strain: self.elasticity.is_plane_strain(),
        }
    }

    /// Returns the stress of the displacement that was set to the flow stress.
    fn flow(&mut self) {
        let (Some(mut plasticity), Some(mut gradient)) =
            (self.plasticity.take(), self.gradient.take())
        else {
            return;
        };
        let axes = std::array::from_fn(|axis| &self.slots[axis][..]);
        gradient.evaluate(axes, self.broken());
        plasticity.try_strains(self.strains(&gradient), |i| self.law(&gradient, i));
        (self.plasticity, self.gradient) = (Some(plasticity), Some(gradient));
    }

    fn evaluate_stress(&mut self) {
        self.load_inelastic(Of::Elastic);
        self.load_pressure(Of::Elastic);
        self.sum_stress();
        if self.elasticity.is_plane_strain() {
            for i in 0..self.tensors.len() {
                let across = self
                    .inelastic_of(i, Of::Elastic)
                    .map_or(0.0, |strain| strain[2]);
                let (moduli, eigenstrain) = (self.moduli(i), self.eigenstrain[i]);
                self.tensors[i][2] = moduli.stress_across(&self.tensors[i], eigenstrain, across);
            }
        }
    }

    fn expand(&mut self) {
        let mut dilation = std::mem::take(&mut self.dilation);
        let mut expansion = std::mem::take(&mut self.expansion);
        match (self.finite, expansion.is_empty()) {
            (false, true) => self.run_first(&Dilation::<false>, &mut dilation),
            (true, true) => self.run_first(&Dilation::<true>, &mut dilation),
            (false, false) => self.run_first(&Expansion::<false>, &mut expansion),
            (true, false) => self.run_first(&Expansion::<true>, &mut expansion),
        }
        let sums = dilation.par_iter_mut().zip(&expansion).with_min_len(4096);
        sums.for_each(|(sum, parts)| *sum = [parts.iter().sum()]);
        (self.dilation, self.expansion) = (dilation, expansion);
    }

    fn sum_forces(&mut self, out: &mut [f64], stiffness: bool) {
        match (self.dimension, &self.fracture) {
            (2, Some(_)) if !stiffness => self.sum_breaking::<2>(out),
            (_, Some(_)) if !stiffness => self.sum_breaking::<3>(out),
            (2, _) => self.sum_forces_in::<2>(out, stiffness),
            _ => self.sum_forces_in::<3>(out, stiffness),
        }
    }

    fn sum_forces_in<const D: usize>(&mut self, out: &mut [f64], stiffness: bool) {
        let mut padded = std::mem::take(&mut self.padded);
        let sums = flat::<D>(&mut padded, bytemuck::cast_slice_mut(out));
        match (stiffness, self.finite, self.dilatation) {
            (true, _, false) => self.run_forces(&Stiffness::<false>, sums),
            (true, _, true) => self.run_forces(&Stiffness::<true>, sums),
            (false, false, _) if self.plasticity.is_some() => {
                self.run_plastic(Force::<false, true>, sums);
            }
            (false, true, _) if self.plasticity.is_some() => {
                self.run_plastic(Force::<true, true>, sums);
            }
            (false, false, false) => self.run_forces(&Force::<false, false>, sums),
            (false, false, true) => self.run_forces(&Force::<false, true>, sums),
            (false, true, false) => self.run_forces(&Force::<true, false>, sums),
            (false, true, true) => self.run_forces(&Force::<true, true>, sums),
        }
        unflatten::<D>(&padded, out);
        self.padded = padded;
    }

    /// Minus the forces of a change of the displacement and of the inelastic strain.
    fn sum_changes<const D: usize>(&mut self, out: &mut [f64]) {
        let mut padded = std::mem::take(&mut self.padded);
        let sums = flat::<D>(&mut padded, bytemuck::cast_slice_mut(out));
        let mut inputs = self.plastic_inputs();
        inputs[EIGENSTRAIN] = &self.zeros;
        let kernel = Plastic(Force::<false, true>);
        self.family
            .sum_unbroken(&kernel, inputs, self.broken(), sums);
        unflatten::<D>(&padded, out);
        self.padded = padded;
        out.par_iter_mut().for_each(|f| *f = -*f);
    }

    /// Forces and, in the same sweep, the excess of bonds over their limit.
    fn sum_breaking<const D: usize>(&mut self, out: &mut [f64]) {
        let Some(fracture) = &self.fracture else {
            return;
        };
        let energy = fracture.compares_energy();
        if self.plasticity.is_some() {
            self.sum_forces_in::<D>(out, false);
            let mut loads = std::mem::take(&mut self.energy);
            self.run_plastic(self.load_kernel(energy), &mut loads);
            let fracture = self.fracture.as_mut().expect("there are bonds to watch");
            let excess = fracture.excess.iter_mut().zip(&loads);
            excess.for_each(|(excess, [_, load])| *excess = *load);
            self.energy = loads;
            return;
        }
        let fracture = self.fracture.as_mut().expect("there are bonds to watch");
        let mut excess = std::mem::take(&mut fracture.excess);
        let (vectors, _) = out.as_chunks_mut::<3>();
        let sums = (vectors, &mut excess[..]);
        match (energy, self.finite, self.dilatation) {
            (false, false, false) => self.run_apart(&Breaking::<D, false, false, false>, sums),
            (false, false, true) => self.run_apart(&Breaking::<D, false, true, false>, sums),
            (false, true, false) => self.run_apart(&Breaking::<D, true, false, false>, sums),
            (false, true, true) => self.run_apart(&Breaking::<D, true, true, false>, sums),
            (true, false, false) => self.run_apart(&Breaking::<D, false, false, true>, sums),
            (true, false, true) => self.run_apart(&Breaking::<D, false, true, true>, sums),
            (true, true, false) => self.run_apart(&Breaking::<D, true, false, true>, sums),
            (true, true, true) => self.run_apart(&Breaking::<D, true, true, true>, sums),
        }
        let fracture = self.fracture.as_mut().expect("there are bonds to watch");
        fracture.excess = excess;
    }

    /// Stress conjugate to the eigenstrain by the dilatation of this `sum_j w s`, Pa.
    fn conjugate_pressure(&self, point: usize, [dilation]: [f64; 1]) -> f64 {
        let a = self.moduli(point).dilatation_stiffness(self.dimension);
        let theta = self.normaliser[point] * dilation;
        2.0 * a * theta * self.dimension as f64
    }

    fn load_kernel(&self, energy: bool) -> Load {
        Load {
            finite: self.finite,
            energy,
            pairs: !self.dilatation,
        }
    }

    fn sum_stress(&mut self) {
        let mut stress = std::mem::take(&mut self.tensors);
        let kernel = Stress {
            finite: self.finite,
            symmetric: self.horizons_differ,
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
        let inputs = self.plastic_inputs();
        self.family
            .sum_unbroken(&Plastic(kernel), inputs, self.broken(), sums);
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

    fn first_inputs<const I: usize>(&self) -> [&[f64]; I] {
        std::array::from_fn(|i| self.input(i))
    }

    /// Runs a kernel of forces, with the inputs in which points differ.
    fn run_forces<const O: usize>(
        &self,
        kernel: &impl BondKernel<INPUTS, O>,
        sums: &mut [[f64; O]],
    ) {
        match self.same {
            Some(point) if self.dilatation => {
                self.run_first::<{ PRESSURE + 1 }, O>(&Uniform(kernel, point), sums);
            }
            Some(point) => self.run_first::<PRESSURE, O>(&Uniform(kernel, point), sums),
            None => self.run(kernel, sums),
        }
    }

    /// As [`Ordinary::run_forces`], with forces and the excess of bonds apart.
    fn run_apart(&self, kernel: &impl BondKernel<INPUTS, 4>, sums: (&mut [[f64; 3]], &mut [f64])) {
        let (family, broken) = (&self.family, self.broken());
        match self.same {
            Some(point) if self.dilatation => {
                let inputs = self.first_inputs::<{ PRESSURE + 1 }>();
                family.sum_apart(&Uniform(kernel, point), inputs, broken, sums);
            }
            Some(point) => {
                let inputs = self.first_inputs::<PRESSURE>();
                family.sum_apart(&Uniform(kernel, point), inputs, broken, sums);
            }
            None => family.sum_apart(kernel, self.first_inputs(), broken, sums),
        }
    }

    /// Runs a kernel of the first `I` inputs.
    fn run_first<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        sums: &mut [[f64; O]],
    ) {
        self.family
            .sum_unbroken(kernel, self.first_inputs(), self.broken(), sums);
    }

    fn run<const O: usize>(&self, kernel: &impl BondKernel<INPUTS, O>, sums: &mut [[f64; O]]) {
        self.family
            .sum_unbroken(kernel, self.first_inputs(), self.broken(), sums);
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
        let constant = self.uniform.is_some();
        if !constant {
            self.evaluate_moduli(body, temperature);
        }
        if !(constant && self.fracture.as_ref().is_some_and(Fracture::is_constant)) {
            self.load_strength(body, temperature);
            self.compare_points();
        }
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
        let mut own = std::mem::take(&mut self.eigenstrain);
        let in_plane = |i: usize| eigenstrain[i] * self.moduli(i).swelling;
        let points = own.par_iter().enumerate().with_min_len(4096);
        let unchanged = points.all(|(i, own)| *own == in_plane(i));
        if !unchanged {
            let points = own.par_iter_mut().enumerate().with_min_len(4096);
            points.for_each(|(i, own)| *own = in_plane(i));
        }
        self.eigenstrain = own;
        if unchanged {
            return;
        }
        let slots = &mut self.slots[EIGENSTRAIN];
        self.family.scatter(&self.eigenstrain, 1, 0, slots);
        self.family.fill_layers(&[], 0, slots);
        self.compare_points();
    }

    fn set_displacement(&mut self, displacement: &[f64], rules: &[LayerRule]) {
        let mut slots = std::mem::take(&mut self.slots);
        let mut continuation = std::mem::take(&mut self.continuation);
        let vector = &mut slots[..self.dimension];
        continue_displacement(
            &self.family,
            (displacement, rules),
            (vector, &mut continuation),
            |i| (self.moduli(i), self.eigenstrain[i]),
        );
        (self.slots, self.continuation) = (slots, continuation);
    }

    fn horizon(&self) -> f64 {
        self.horizon
    }

    fn plasticity(&mut self) -> Option<&mut Plasticity> {
        self.plasticity.as_mut()
    }

    fn fracture(&self) -> Option<&Fracture> {
        self.fracture.as_ref()
    }

    fn fracture_mut(&mut self) -> Option<&mut Fracture> {
        if let Some(gradient) = &mut self.gradient {
            gradient.forget();
        }
        self.fracture.as_mut()
    }

    fn break_bonds(&mut self, share: f64, damage: &mut [f64]) -> (Vec<[u32; 2]>, bool) {
        let Some(mut fracture) = self.fracture.take() else {
            return (Vec::new(), false);
        };
        let load = self.load_kernel(fracture.compares_energy());
        let pairs = !self.dilatation;
        let inputs = self.first_inputs();
        let ends = |own, other| [own, other].map(|slot: usize| inputs.map(|i| i[slot]));
        let conjugate = |point: usize, bond: &Bond, other: usize| {
            let [own, other] = ends(self.family.slot_of(point), other);
            let [_, stress] = match self.finite {
                true => Energy::<true> { pairs }.bond(bond, own, other),
                false => Energy::<false> { pairs }.bond(bond, own, other),
            };
            if pairs {
                return stress;
            }
            let [own, other] = [own, other].map(|[x, y, z, ..]| [x, y, z]);
            let dilation = match self.finite {
                true => Dilation::<true>.bond(bond, own, other),
                false => Dilation::<false>.bond(bond, own, other),
            };
            stress + self.conjugate_pressure(point, dilation)
        };
        let family = &self.family;
        let broken = if self.plasticity.is_some() {
            let (kernel, inputs) = (Plastic(load), self.plastic_inputs());
            let ratio = |bond: &Bond, own: usize, other: usize| {
                let [own, other] = [own, other].map(|slot| inputs.map(|i| i[slot]));
                kernel.bond(bond, own, other)[0]
            };
            fracture.break_bonds(family, share, damage, ratio, conjugate)
        } else {
            let ratio = |bond: &Bond, own, other| {
                let [own, other] = ends(own, other);
                load.bond(bond, own, other)[0]
            };
            fracture.break_bonds(family, share, damage, ratio, conjugate)
        };
        self.fracture = Some(fracture);
        broken
    }

    fn family(&self) -> &Family {
        &self.family
    }

    fn material_stress(&mut self) -> Vec<[f64; 6]> {
        let (Some(plasticity), Some(gradient)) = (&self.plasticity, &self.gradient) else {
            return Vec::new();
        };
        plasticity.tried_stress(self.strains(gradient), |i| self.law(gradient, i))
    }

    fn moduli_of(&self, point: usize) -> Moduli {
        self.moduli(point)
    }

    fn force(&mut self, out: &mut [f64]) {
        self.flow();
        self.load_inelastic(Of::Elastic);
        self.load_pressure(Of::Elastic);
        self.sum_forces(out, false);
    }

    fn stiffness(&mut self, out: &mut [f64]) {
        let finite = std::mem::replace(&mut self.finite, false);
        self.load_pressure(Of::Total);
        self.sum_forces(out, true);
        self.finite = finite;
    }

    fn flows_by_its_own_strain(&self) -> bool {
        false
    }

    fn linearise(&mut self) {
        let (Some(mut plasticity), Some(gradient)) = (self.plasticity.take(), &self.gradient)
        else {
            return;
        };
        plasticity.linearise(self.strains(gradient), |i| self.law(gradient, i));
        self.plasticity = Some(plasticity);
    }

    fn tangent(&mut self, out: &mut [f64]) {
        let (Some(plasticity), Some(gradient)) = (&mut self.plasticity, &mut self.gradient) else {
            return self.stiffness(out);
        };
        let broken = self.fracture.as_ref().map(|f| &f.state.broken);
        let axes = std::array::from_fn(|axis| &self.slots[axis][..]);
        gradient.evaluate(axes, broken);
        plasticity.follow(&gradient.values);
        let finite = std::mem::replace(&mut self.finite, false);
        self.load_inelastic(Of::Change);
        self.load_pressure(Of::Change);
        match self.dimension {
            2 => self.sum_changes::<2>(out),
            _ => self.sum_changes::<3>(out),
        }
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
        let pairs = !self.dilatation;
        match self.finite {
            true => self.run(&Energy::<true> { pairs }, &mut energy),
            false => self.run(&Energy::<false> { pairs }, &mut energy),
        }
        if self.dilatation {
            self.expand();
            for (i, [density, conjugate]) in energy.iter_mut().enumerate() {
                let a = self.moduli(i).dilatation_stiffness(self.dimension);
                let theta = self.normaliser[i] * self.dilation[i][0];
                *density += a * theta * theta;
                *conjugate += self.conjugate_pressure(i, self.dilation[i]);
            }
        }
        for (i, [_, conjugate]) in energy.iter_mut().enumerate() {
            let frozen = self.fracture.as_ref().map_or(0.0, |f| f.state.frozen[i]);
            *conjugate = (*conjugate + frozen) * self.moduli(i).swelling;
        }
        self.energy = energy;
        &self.energy
    }

    fn stress(&mut self) -> &[[f64; 6]] {
        self.evaluate_stress();
        &self.tensors
    }

    fn force_across(&mut self, plane: (usize, f64), receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_inelastic(Of::Elastic);
        self.load_pressure(Of::Elastic);
        let family = &self.family;
        let broken = self.broken();
        match (self.plasticity.is_some(), self.finite, self.dilatation) {
            (true, false, _) => {
                let kernel = Plastic(Force::<false, true>);
                family.sum_across(&kernel, (self.plastic_inputs(), broken), plane, receive);
            }
            (true, true, _) => {
                let kernel = Plastic(Force::<true, true>);
                family.sum_across(&kernel, (self.plastic_inputs(), broken), plane, receive);
            }
            (false, false, false) => {
                family.sum_across(
                    &Force::<false, false>,
                    (self.first_inputs(), broken),
                    plane,
                    receive,
                );
            }
            (false, false, true) => {
                family.sum_across(
                    &Force::<false, true>,
                    (self.first_inputs(), broken),
                    plane,
                    receive,
                );
            }
            (false, true, false) => {
                family.sum_across(
                    &Force::<true, false>,
                    (self.first_inputs(), broken),
                    plane,
                    receive,
                );
            }
            (false, true, true) => {
                family.sum_across(
                    &Force::<true, true>,
                    (self.first_inputs(), broken),
                    plane,
                    receive,
                );
            }
        }
    }
}
