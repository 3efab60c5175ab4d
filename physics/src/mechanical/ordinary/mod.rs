//! Bond-based and ordinary state-based solids: the kernels of [`stretch`](super::stretch) over a body of any
//! dimension.

mod dilatation;
mod forces;
mod inputs;

use std::sync::Arc;

use perimelt_core::family::{AxisPlane, Continuation, LayerRule, Mirrored};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Body, Family, SlotField};

use super::classical::symmetric;
use super::elastic::ElasticPoints;
use super::fracture::{Fracture, FractureState, NewBreaks};
use super::gradient::{FlatFamily, Gradient};
use super::layer_forces::LayerForces;
use super::moduli::Moduli;
use super::plasticity::Plasticity;
use super::solid::{Constitution, LayeredDisplacement, Solid, StrainKind, continue_displacement};
use super::specialise::specialise;
use super::stretch::{
    Block, CRITICAL, EIGENSTRAIN, ElasticEnergy, Energy, Force, INPUTS, Plastic, STIFFNESS, Stress,
    WeightOverLength, find_overstretched, relative_displacement_beyond,
};
use dilatation::Dilatation;
use forces::Sum;
use inputs::{Inputs, Needs};

/// A solid whose bonds carry forces along themselves: bond-based, or ordinary state-based where Poisson's ratio
/// is that of the material.
#[derive(Debug)]
pub struct Ordinary {
    family: Arc<Family>,
    dimension: usize,
    /// The largest horizon, m.
    horizon: f64,
    horizons_differ: bool,
    elastic: ElasticPoints,
    /// Of an ordinary state-based solid.
    dilatation: Option<Dilatation>,
    plastic: Option<PlasticPoints>,
    fracture: Option<Fracture>,
    continuation: Continuation,
    layer_forces: LayerForces,
    inputs: Inputs,
    /// Sums with as many components as the dimension, in 2D.
    padded: Vec<f64>,
    energy: Vec<[f64; 2]>,
    tensors: Vec<[f64; 6]>,
}

/// Plastic state, and the displacement gradients from which it follows.
#[derive(Debug)]
struct PlasticPoints {
    state: Plasticity,
    gradient: Gradient,
}

impl Ordinary {
    /// The solid of `body` with the given family; ordinary state-based if the elasticity has a Poisson's ratio of
    /// its own.
    ///
    /// # Errors
    /// A plastic body with a point whose bonds do not span the dimensions.
    pub fn new(
        body: &Body,
        family: Arc<Family>,
        constitution: Constitution,
    ) -> Result<Self, FlatFamily> {
        let (points, dimension) = (body.points.len(), body.dimension);
        let Constitution {
            elasticity,
            finite,
            plasticity,
            fracture,
            in_motion,
        } = constitution;
        let is_ordinary = elasticity.has_free_poissons_ratio();
        let needs = Needs {
            pressure: is_ordinary,
            limits: fracture.is_some(),
            inelastic: plasticity.is_some(),
        };
        let plastic = match plasticity {
            Some(state) => Some(PlasticPoints {
                state,
                gradient: Gradient::new(body, &family)?,
            }),
            None => None,
        };
        let horizons = body.points.horizons(family.spec().horizon);
        let mut this = Ordinary {
            dimension,
            horizon: max_abs(&horizons),
            horizons_differ: horizons.windows(2).any(|h| h[0] != h[1]),
            elastic: ElasticPoints::new(body, elasticity, finite),
            dilatation: is_ordinary.then(|| Dilatation::new(&family, body)),
            plastic,
            fracture,
            continuation: Continuation::default(),
            layer_forces: LayerForces::new(dimension, &body.points.volume, in_motion),
            inputs: Inputs::new(family.clone(), dimension, needs),
            padded: vec![0.0; if dimension == 2 { 2 * points } else { 0 }],
            energy: vec![[0.0; 2]; points],
            tensors: vec![[0.0; 6]; points],
            family,
        };
        this.load_stiffness();
        this.load_limits(body, None);
        this.find_uniform_inputs();
        Ok(this)
    }

    fn load_stiffness(&mut self) {
        let stiffness = |i: usize| self.elastic.moduli(i).bond_stiffness(self.dimension);
        self.inputs.load(STIFFNESS, stiffness);
    }

    fn load_limits(&mut self, body: &Body, temperature: Option<&[f64]>) {
        if let Some(fracture) = &mut self.fracture {
            fracture.load(body, temperature, |i| self.elastic.moduli(i));
            self.inputs.load(CRITICAL, &fracture.critical[..]);
        }
    }

    /// Finds out whether all points have the same eigenstrain, stiffness and limit.
    fn find_uniform_inputs(&mut self) {
        let same = |values: &[f64]| {
            let first = values.first().copied().unwrap_or_default();
            values.iter().all(|v| *v == first).then_some(first)
        };
        let limit = (self.fracture.as_ref()).map_or(Some(0.0), |f| same(&f.critical));
        let eigenstrain = same(&self.elastic.eigenstrain);
        self.inputs.uniform = match (self.elastic.uniform(), eigenstrain, limit) {
            (Some(moduli), Some(eigenstrain), Some(limit)) => {
                let mut point = [0.0; INPUTS];
                point[EIGENSTRAIN] = eigenstrain;
                point[STIFFNESS] = moduli.bond_stiffness(self.dimension);
                point[CRITICAL] = limit;
                Some(point)
            }
            _ => None,
        };
    }

    fn sum_stress(&mut self) {
        let broken = self.fracture.as_ref().map(Fracture::broken);
        let kernel = Stress {
            finite: self.elastic.finite,
            symmetric: self.horizons_differ,
        };
        match self.plastic {
            Some(_) => self.inputs.sum_plastic(kernel, broken, &mut self.tensors),
            None => self.inputs.sum(&kernel, broken, &mut self.tensors),
        }
    }
}

impl Solid for Ordinary {
    fn set_moduli(&mut self, body: &Body, temperature: Option<&[f64]>) {
        let changed = self.elastic.set_moduli(body, temperature);
        if changed {
            self.load_stiffness();
        }
        if changed || !self.fracture.as_ref().is_none_or(Fracture::is_constant) {
            self.load_limits(body, temperature);
            self.find_uniform_inputs();
        }
    }

    fn set_stiffest_moduli(&mut self, body: &Body) {
        if self.elastic.set_stiffest_moduli(body) {
            self.load_stiffness();
        }
    }

    fn set_eigenstrain(&mut self, eigenstrain: &[f64]) {
        if self.elastic.set_eigenstrain(eigenstrain) {
            self.inputs.load(EIGENSTRAIN, &self.elastic.eigenstrain[..]);
            self.find_uniform_inputs();
            if let Some(plastic) = &mut self.plastic {
                plastic.gradient.forget_strains();
            }
        }
    }

    fn set_displacement(&mut self, values: &[f64], rules: &[LayerRule]) {
        continue_displacement(
            &self.family,
            LayeredDisplacement { values, rules },
            &self.elastic,
            &mut self.inputs.slots[..self.dimension],
            &mut self.continuation,
        );
        self.layer_forces.follow(&self.family, &self.continuation);
    }

    fn find_overstretched(&self, limit: f64) -> Option<usize> {
        let (displacement, finite) = (self.inputs.displacement(), self.elastic.finite);
        find_overstretched(&self.family, (displacement, self.broken()), (finite, limit))
    }

    fn relative_displacement_beyond(&self, limit: f64) -> Option<f64> {
        let bonds = (&*self.family, self.broken());
        relative_displacement_beyond(bonds, self.inputs.displacement(), limit)
    }

    fn horizon(&self) -> f64 {
        self.horizon
    }

    fn force(&mut self, out: &mut [f64]) {
        self.return_to_flow_stress();
        self.load_inelastic(StrainKind::Elastic);
        self.load_pressure(StrainKind::Elastic, self.elastic.finite);
        self.sum_forces_and_excess(out);
    }

    fn stiffness(&mut self, out: &mut [f64]) {
        self.load_pressure(StrainKind::Total, false);
        self.sum_forces(Sum::Stiffness, out);
    }

    fn linearise(&mut self) {
        if let Some(plastic) = &mut self.plastic {
            let points = self.elastic.strained(&plastic.gradient);
            plastic.state.linearise(points);
        }
    }

    fn tangent(&mut self, out: &mut [f64]) {
        let Some(plastic) = &mut self.plastic else {
            return self.stiffness(out);
        };
        let broken = self.fracture.as_ref().map(Fracture::broken);
        let displacement = self.inputs.displacement();
        plastic
            .gradient
            .evaluate(&self.family, displacement, broken);
        plastic.state.follow(&plastic.gradient.values);
        self.load_inelastic(StrainKind::Change);
        self.load_pressure(StrainKind::Change, false);
        self.sum_forces(Sum::Change, out);
    }

    /// Bonds carry forces along themselves, but flow follows the strain of whole families.
    fn has_symmetric_plastic_tangent(&self) -> bool {
        false
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        let broken = self.fracture.as_ref().map(Fracture::broken);
        let (inputs, tensors) = (&self.inputs, &mut self.tensors);
        inputs.sum::<INPUTS, 6>(&Block, broken, tensors);
        let layers = &self.layer_forces;
        layers.complete_blocks::<INPUTS>(&Block, inputs.first(), broken, tensors);
        tensors
    }

    /// Twice the largest eigenvalue of the diagonal block, which bounds the eigenvalues of a network of springs
    /// because `(n . (u_j - u_i))^2 <= 2 (n . u_i)^2 + 2 (n . u_j)^2`. A positive dilatation stiffness adds at
    /// most the springs `c = 4 a N^2 sum_j w/|xi|`, by `(sum_j w s)^2 <= (sum_j w/|xi|) sum_j w |xi| s^2`.
    fn frequency_bound(&mut self, density: &[f64]) -> Option<f64> {
        let points = self.energy.len();
        let mut sums = vec![[0.0]; points];
        let broken = self.broken();
        let inputs = &self.inputs;
        inputs.sum::<INPUTS, 1>(&WeightOverLength, broken, &mut sums);
        let stiffness = |i: usize| {
            let moduli = self.elastic.moduli(i);
            let a = moduli.dilatation_stiffness(self.dimension).max(0.0);
            let added = match &self.dilatation {
                Some(dilatation) => 4.0 * a * dilatation.normaliser[i].powi(2) * sums[i][0],
                None => 0.0,
            };
            moduli.bond_stiffness(self.dimension) + added
        };
        let mut slots = SlotField::default();
        slots.load(&self.family, stiffness, Mirrored::Scalar);
        let mut blocks = vec![[0.0; 6]; points];
        let inputs = [&slots[..]; INPUTS];
        self.family.sum(&Block, inputs, &mut blocks);
        let layers = &self.layer_forces;
        layers.complete_blocks(&Block, inputs, None, &mut blocks);
        let largest = |block| 2.0 * symmetric(block).symmetric_eigenvalues().max();
        let squares = blocks.iter().zip(density).map(|(b, rho)| largest(b) / rho);
        Some(squares.fold(0.0, f64::max).sqrt())
    }

    fn plasticity(&mut self) -> Option<&mut Plasticity> {
        self.plastic.as_mut().map(|p| &mut p.state)
    }

    fn fracture(&self) -> Option<&Fracture> {
        self.fracture.as_ref()
    }

    fn replace_fracture_state(&mut self, state: FractureState) -> Option<FractureState> {
        let fracture = self.fracture.as_mut()?;
        if let Some(plastic) = &mut self.plastic {
            plastic.gradient.invalidate();
        }
        Some(std::mem::replace(&mut fracture.state, state))
    }

    fn break_bonds(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks {
        self.break_exceeding_bonds(fraction, damage)
    }

    fn family(&self) -> &Family {
        &self.family
    }

    fn material_stress(&mut self) -> Vec<[f64; 6]> {
        let plastic = self.plastic.as_ref();
        plastic.map_or_else(Vec::new, |plastic| {
            let points = self.elastic.strained(&plastic.gradient);
            plastic.state.tried_stress(points)
        })
    }

    fn moduli_of(&self, point: usize) -> Moduli {
        self.elastic.moduli(point)
    }

    fn energy(&mut self) -> &[[f64; 2]] {
        let broken = self.fracture.as_ref().map(Fracture::broken);
        let (inputs, elastic, energy) = (&self.inputs, &self.elastic, &mut self.energy);
        let (finite, pairs) = (elastic.finite, self.dilatation.is_none());
        specialise!(FINITE = finite =>
            inputs.sum::<INPUTS, 2>(&Energy::<FINITE> { pairs }, broken, energy));
        if let Some(dilatation) = &mut self.dilatation {
            dilatation.sum((StrainKind::Total, finite), inputs, broken);
            for (i, [density, conjugate]) in energy.iter_mut().enumerate() {
                *density += dilatation.energy(elastic, None, i);
                *conjugate += dilatation.conjugate_stress(elastic, i, dilatation.sums[i]);
            }
        }
        for (i, [_, conjugate]) in energy.iter_mut().enumerate() {
            let frozen = self.fracture.as_ref().map_or(0.0, |f| f.state.frozen[i]);
            *conjugate = (*conjugate + frozen) * elastic.moduli(i).swelling;
        }
        energy
    }

    fn elastic_energy(&mut self) -> &[[f64; 2]] {
        self.load_inelastic(StrainKind::Elastic);
        let broken = self.fracture.as_ref().map(Fracture::broken);
        let (inputs, elastic, energy) = (&self.inputs, &self.elastic, &mut self.energy);
        let (finite, pairs) = (elastic.finite, self.dilatation.is_none());
        let plastic = self.plastic.as_ref().map(|p| &p.state);
        match plastic {
            Some(_) => specialise!(FINITE = finite =>
                inputs.sum_plastic(ElasticEnergy::<FINITE> { pairs }, broken, energy)),
            None => specialise!(FINITE = finite =>
                inputs.sum::<INPUTS, 2>(&ElasticEnergy::<FINITE> { pairs }, broken, energy)),
        }
        if let Some(dilatation) = &mut self.dilatation {
            dilatation.sum((StrainKind::Elastic, finite), inputs, broken);
            for (i, [density, _]) in energy.iter_mut().enumerate() {
                *density += dilatation.energy(elastic, plastic, i);
            }
        }
        energy
    }

    fn take_stiffening(&mut self) -> f64 {
        self.elastic.take_stiffening()
    }

    fn stress(&mut self) -> &[[f64; 6]] {
        self.load_inelastic(StrainKind::Elastic);
        self.load_pressure(StrainKind::Elastic, self.elastic.finite);
        self.sum_stress();
        if self.elastic.is_plane_strain() {
            for (i, tensor) in self.tensors.iter_mut().enumerate() {
                let tried = self.plastic.as_ref().map(|p| &p.state.tried[i].strain);
                let across = tried.map_or(0.0, |strain| strain[2]);
                let (moduli, eigenstrain) = (self.elastic.moduli(i), self.elastic.eigenstrain[i]);
                tensor[2] = moduli.stress_across(tensor, eigenstrain, across);
            }
        }
        &self.tensors
    }

    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_inelastic(StrainKind::Elastic);
        self.load_pressure(StrainKind::Elastic, self.elastic.finite);
        let (family, inputs, broken) = (&self.family, &self.inputs, self.broken());
        let (finite, dilatation) = (self.elastic.finite, self.dilatation.is_some());
        if self.plastic.is_some() {
            let inputs = inputs.plastic();
            specialise!(FINITE = finite =>
                family.sum_across(&Plastic(Force::<FINITE, true>), inputs, broken, plane, receive));
        } else {
            let inputs = inputs.first::<INPUTS>();
            specialise!(FINITE = finite, DILATATION = dilatation =>
                family.sum_across(&Force::<FINITE, DILATATION>, inputs, broken, plane, receive));
        }
    }
}
