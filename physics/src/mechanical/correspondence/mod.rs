//! Correspondence solids (non-ordinary state-based): force states from a classical stress.
//!
//! ```text
//! F = 1 + H,  H = [sum_j w (u_j - u_i) (x) xi] K^-1,  K = sum_j w xi (x) xi      Wang (2025), eqs. 3.15, 3.19
//! P = sigma(H)                 linear kinematics: linear elasticity
//! P = F S,  S = C : (E - e),  E = (F^T F - 1)/2      finite: Saint Venant-Kirchhoff, eqs. 3.16 to 3.18
//! T_ij = w_ij { P K^-1 xi + g z },  z = u_j - u_i - H xi,  g = G 2 d bulk / horizon
//!                                                     eqs. 3.14, 3.20; see docs/theory/mechanics.md
//! f_i = sum_j T_ij - T_ji
//! ```
//!
//! `w` is the weight of the bond in the family of the owner. The term `g z` stabilises the zero-energy modes
//! (Silling 2017) and vanishes in every affine deformation. Any uniform strain is exact on any cloud, also at
//! surfaces, and needs no calibration.
//!
//! Bonds break at their critical stretch ([`fracture`](super::fracture)). All sums, that of K included, run over
//! unbroken bonds, so that a uniform strain stays exact beside cracks. A *loose* point, whose bonds no longer span
//! the dimensions, has no strain, no stress and no `g z` of its own; only the force states of its neighbours act
//! on it. The energy criterion of fracture is not available: stress belongs to points, and no bond has an energy
//! of its own.

mod forces;
mod inputs;
mod kernels;

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::family::{AxisPlane, ByImage, Continuation, LayerRule, Mirrored};
use perimelt_core::{Body, Bond, Family, Image, SlotField};
use rayon::prelude::*;

use super::classical::{COMPONENTS, Point, symmetric};
use super::elastic::ElasticPoints;
use super::fracture::{BondLoads, Fracture, FractureState, NewBreaks};
use super::gradient::{FlatFamily, Gradient, RISE};
use super::layer_forces::LayerForces;
use super::moduli::Moduli;
use super::plasticity::Plasticity;
use super::solid::{Constitution, LayeredDisplacement, Solid, StrainKind, continue_displacement};
use super::stretch::{find_overstretched, relative_displacement_beyond};
use inputs::Inputs;
use kernels::{Block, Force, SquaredExtension};

/// A correspondence solid.
#[derive(Debug)]
pub struct Correspondence {
    family: Arc<Family>,
    dimension: usize,
    /// The horizon of each point, m.
    horizon: Vec<f64>,
    /// G.
    stabilisation: f64,
    elastic: ElasticPoints,
    plasticity: Option<Plasticity>,
    fracture: Option<Fracture>,
    continuation: Continuation,
    layer_forces: LayerForces,
    inputs: Inputs,
    /// H of each point.
    gradient: Gradient,
    /// What prescribed strains that are not uniform add to the forces of the springs, N/m³; empty if nothing.
    spring_forces: Vec<[f64; 3]>,
    /// `P K^-1 - g H` of each point.
    force_state: Vec<Matrix3<f64>>,
    /// Sums with as many components as the dimension, in 2D.
    padded: Vec<f64>,
    energy: Vec<[f64; 2]>,
    tensors: Vec<[f64; 6]>,
}

impl Correspondence {
    /// The solid of `body` with the given family; `stabilisation` is G.
    ///
    /// # Errors
    /// A point whose bonds do not span the dimensions.
    pub fn new(
        body: &Body,
        family: Arc<Family>,
        constitution: Constitution,
        stabilisation: f64,
    ) -> Result<Self, FlatFamily> {
        let (points, dimension) = (body.points.len(), body.dimension);
        let Constitution {
            elasticity,
            finite,
            plasticity,
            fracture,
            in_motion,
        } = constitution;
        let horizon = body.points.horizons(family.spec().horizon);
        let mut this = Correspondence {
            dimension,
            horizon,
            stabilisation,
            elastic: ElasticPoints::new(body, elasticity, finite),
            plasticity,
            continuation: Continuation::default(),
            layer_forces: LayerForces::new(dimension, &body.points.volume, in_motion),
            inputs: Inputs::new(&family, dimension, fracture.is_some()),
            fracture,
            gradient: Gradient::new(body, &family)?,
            spring_forces: Vec::new(),
            force_state: vec![Matrix3::zeros(); points],
            padded: vec![0.0; if dimension == 2 { 2 * points } else { 0 }],
            energy: vec![[0.0; 2]; points],
            tensors: vec![[0.0; 6]; points],
            family,
        };
        this.load_stabilisation();
        this.load_limits(body, None);
        Ok(this)
    }

    /// g; zero for loose points.
    fn spring(&self, point: usize) -> f64 {
        if self.gradient.is_loose(point) {
            return 0.0;
        }
        let bond_stiffness = 2.0 * self.dimension as f64 * self.elastic.moduli(point).bulk;
        self.stabilisation * bond_stiffness / self.horizon[point]
    }

    fn load_stabilisation(&mut self) {
        let mut slots = std::mem::take(&mut self.inputs.stabilisation);
        let spring = |point: usize| self.spring(point);
        slots.load(&self.family, spring, Mirrored::Scalar);
        self.inputs.stabilisation = slots;
        self.gradient.forget_strains();
    }

    fn load_limits(&mut self, body: &Body, temperature: Option<&[f64]>) {
        if let Some(fracture) = &mut self.fracture {
            fracture.load(body, temperature, |i| self.elastic.moduli(i));
            let [_, limits] = &mut self.inputs.strength;
            limits.load(&self.family, &fracture.critical[..], Mirrored::Scalar);
        }
    }

    /// `sum_j w |u_j - u_i|^2` of each point, m².
    fn squared_extension(&self) -> Vec<[f64; 1]> {
        let mut extension = vec![[0.0]; self.horizon.len()];
        let inputs = std::array::from_fn(|axis| self.inputs.along(axis));
        self.family
            .sum_unbroken(&SquaredExtension, inputs, self.broken(), &mut extension);
        extension
    }

    /// As [`Correspondence::squared_extension`], without the displacement of prescribed strains that are not uniform.
    fn squared_elastic_extension(&self) -> Vec<[f64; 1]> {
        let mut extension = vec![[0.0]; self.horizon.len()];
        let displacement = std::array::from_fn(|axis| self.inputs.along(axis));
        let bonds = (&*self.family, self.broken());
        self.gradient
            .stress_free
            .squared_extension(bonds, displacement, &mut extension);
        extension
    }

    /// Energy density of the stabilisation, J/m³: `sum_j w |z|^2 = sum_j w |u_j - u_i|^2 - H : H K`, with K the inverse
    /// of its inverse.
    fn energy_of_modes(&self, i: usize, gradient: &Matrix3<f64>, extension: &[[f64; 1]]) -> f64 {
        let mut shape = self.gradient.inverse_shape[i];
        (self.dimension..3).for_each(|a| shape[(a, a)] = 1.0);
        // a loose point has no shape tensor; it has no springs either
        let affine = shape
            .try_inverse()
            .map_or(0.0, |shape| gradient.dot(&(gradient * shape)));
        0.5 * self.spring(i) * (extension[i][0] - affine).max(0.0)
    }

    /// The law of a point for the given kind of strain.
    fn point(&self, i: usize, strain: StrainKind) -> Point {
        let law = self.elastic.strained(&self.gradient).law(i);
        let law = match strain {
            StrainKind::Elastic => law,
            StrainKind::Total | StrainKind::Change => law.of_change(),
        };
        match (&self.plasticity, strain) {
            (None, _) | (_, StrainKind::Total) => law,
            (Some(p), StrainKind::Elastic) => law.with_inelastic(p.stress_state, p.tried[i].strain),
            (Some(p), StrainKind::Change) => law.with_inelastic(p.stress_state, p.change[i]),
        }
    }
}

impl Solid for Correspondence {
    fn set_moduli(&mut self, body: &Body, temperature: Option<&[f64]>) {
        let changed = self.elastic.set_moduli(body, temperature);
        if changed {
            self.load_stabilisation();
        }
        if changed || !self.fracture.as_ref().is_none_or(Fracture::is_constant) {
            self.load_limits(body, temperature);
        }
    }

    fn set_stiffest_moduli(&mut self, body: &Body) {
        if self.elastic.set_stiffest_moduli(body) {
            self.load_stabilisation();
        }
    }

    fn set_eigenstrain(&mut self, eigenstrain: &[f64]) {
        if !self.elastic.set_eigenstrain(eigenstrain) {
            return;
        }
        self.gradient.forget_strains();
        if self.fracture.is_some() {
            let [eigenstrain, _] = &mut self.inputs.strength;
            let values = &self.elastic.eigenstrain[..];
            eigenstrain.load(&self.family, values, Mirrored::Scalar);
        }
    }

    fn set_stress_free(&mut self, strain: Vec<[f64; 6]>, prescribed: &[[f64; 6]]) {
        self.elastic.stress_free = strain;
        if self.elastic.prescribed != prescribed {
            self.elastic.prescribed = prescribed.to_vec();
            self.gradient.forget_strains();
        }
    }

    fn set_present(&mut self, present: &[bool]) {
        let family = Arc::get_mut(&mut self.family);
        family
            .expect("a family that grows has one owner")
            .set_active(present);
        self.gradient.follow_growth(&self.family);
        self.layer_forces.forget();
        self.load_stabilisation();
    }

    fn gradients(&mut self) -> Vec<Matrix3<f64>> {
        self.load_gradient();
        let points = (0..self.force_state.len()).into_par_iter();
        let gradient = |i| self.gradient.elastic(i, self.elastic.finite);
        points.map(gradient).collect()
    }

    fn set_displacement(&mut self, values: &[f64], rules: &[LayerRule]) {
        continue_displacement(
            &self.family,
            LayeredDisplacement { values, rules },
            &self.elastic,
            &mut self.inputs.displacement,
            &mut self.continuation,
        );
        self.layer_forces.follow(&self.family, &self.continuation);
    }

    fn force(&mut self, out: &mut [f64]) {
        self.load_gradient();
        if let Some(plasticity) = &mut self.plasticity {
            plasticity.try_strains(self.elastic.strained(&self.gradient));
        }
        self.load_force_state(StrainKind::Elastic, self.elastic.finite);
        self.sum_forces(out);
        self.add_spring_forces(out);
        self.sum_excess();
    }

    fn stiffness(&mut self, out: &mut [f64]) {
        self.load_gradient();
        self.load_force_state(StrainKind::Total, false);
        self.sum_forces(out);
        out.par_iter_mut().for_each(|f| *f = -*f);
    }

    /// Forces and flow follow the same strain, that of points.
    fn has_symmetric_plastic_tangent(&self) -> bool {
        true
    }

    fn bonds_shear(&self) -> bool {
        true
    }

    fn linearise(&mut self) {
        if let Some(plasticity) = &mut self.plasticity {
            plasticity.linearise(self.elastic.strained(&self.gradient));
        }
    }

    fn tangent(&mut self, out: &mut [f64]) {
        self.load_gradient();
        if let Some(plasticity) = &mut self.plasticity {
            plasticity.follow(&self.gradient.values);
        }
        self.load_force_state(StrainKind::Change, false);
        self.sum_forces(out);
        out.par_iter_mut().for_each(|f| *f = -*f);
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        let broken = self.fracture.as_ref().map(Fracture::broken);
        if self.gradient.update_shapes(&self.family, broken) {
            self.load_stabilisation();
        }
        let mut slots: [SlotField; 8] = Default::default();
        let inverse = &self.gradient.inverse_shape;
        for (slots, at) in slots.iter_mut().zip(COMPONENTS) {
            let of_image = |image: &Image| {
                let sign = image.mirror[at.0] * image.mirror[at.1];
                [sign * inverse[image.point][at]]
            };
            let ghosts = ByImage(&self.continuation, of_image);
            slots.load(&self.family, |i: usize| inverse[i][at], ghosts);
        }
        let constants: [fn(Moduli) -> f64; 2] = [|m| m.lame, |m| m.shear];
        for (slots, constant) in slots[6..].iter_mut().zip(constants) {
            let value = |i: usize| constant(self.elastic.moduli(i));
            slots.load(&self.family, value, Mirrored::Scalar);
        }
        let inputs: [&[f64]; 9] = std::array::from_fn(|i| match slots.get(i) {
            Some(slots) => &slots[..],
            None => &self.inputs.stabilisation,
        });
        let tensors = &mut self.tensors;
        let broken = self.fracture.as_ref().map(Fracture::broken);
        self.family.sum_unbroken(&Block, inputs, broken, tensors);
        &self.tensors
    }

    fn rise_by_damage(&self) -> f64 {
        match self.fracture.is_some() || self.family.grows() {
            true => RISE,
            false => 1.0,
        }
    }

    fn elastic_energy(&mut self) -> &[[f64; 2]] {
        self.load_gradient();
        let finite = self.elastic.finite;
        let extension = match self.has_spring_forces() {
            true => self.squared_elastic_extension(),
            false => self.squared_extension(),
        };
        let mut energy = std::mem::take(&mut self.energy);
        for (i, energy) in energy.iter_mut().enumerate() {
            let point = self.point(i, StrainKind::Elastic);
            let gradient = self.gradient.elastic(i, finite);
            let stress = point.material_stress(&gradient, finite);
            let of_modes = match finite {
                true => &self.gradient.values[i],
                false => &gradient,
            };
            let modes = self.energy_of_modes(i, of_modes, &extension);
            *energy = [point.energy_of(&stress) + modes, 0.0];
        }
        self.energy = energy;
        &self.energy
    }

    fn take_stiffening(&mut self) -> f64 {
        self.elastic.take_stiffening()
    }

    fn energy(&mut self) -> &[[f64; 2]] {
        self.load_gradient();
        let extension = self.squared_extension();
        let mut energy = std::mem::take(&mut self.energy);
        for (i, energy) in energy.iter_mut().enumerate() {
            let (gradient, point) = (&self.gradient.values[i], self.point(i, StrainKind::Total));
            let mut strain = Point::strain(gradient, self.elastic.finite);
            if let Some(stress_free) = self.elastic.stress_free.get(i) {
                strain -= symmetric(stress_free);
            }
            let stress = point.stress(&strain);
            let modes = self.energy_of_modes(i, gradient, &extension);
            let conjugate = (0..self.dimension).map(|a| stress[(a, a)]).sum::<f64>();
            *energy = [
                0.5 * stress.dot(&strain) + modes,
                conjugate * point.moduli.swelling,
            ];
        }
        self.energy = energy;
        &self.energy
    }

    fn find_overstretched(&self, limit: f64) -> Option<usize> {
        let displacement = std::array::from_fn(|axis| self.inputs.along(axis));
        let finite = self.elastic.finite;
        find_overstretched(&self.family, (displacement, self.broken()), (finite, limit))
    }

    fn relative_displacement_beyond(&self, limit: f64) -> Option<f64> {
        let displacement = std::array::from_fn(|axis| self.inputs.along(axis));
        let bonds = (&*self.family, self.broken());
        relative_displacement_beyond(bonds, displacement, limit)
    }

    fn horizon(&self) -> f64 {
        self.horizon.iter().copied().fold(0.0, f64::max)
    }

    fn plasticity(&mut self) -> Option<&mut Plasticity> {
        self.plasticity.as_mut()
    }

    fn fracture(&self) -> Option<&Fracture> {
        self.fracture.as_ref()
    }

    fn replace_fracture_state(&mut self, state: FractureState) -> Option<FractureState> {
        let fracture = self.fracture.as_mut()?;
        self.gradient.invalidate();
        Some(std::mem::replace(&mut fracture.state, state))
    }

    /// Broken bonds leave no frozen stress: the conjugate stress is that of points.
    fn break_bonds(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks {
        let ratio = forces::stretch_ratio(self.elastic.finite, self.inputs.of_excess());
        let Some(fracture) = &mut self.fracture else {
            return NewBreaks::default();
        };
        let conjugate = |_: usize, _: &Bond, _: usize| 0.0;
        let loads = BondLoads { ratio, conjugate };
        fracture.break_bonds(&self.family, fraction, damage, loads)
    }

    fn family(&self) -> &Family {
        &self.family
    }

    fn material_stress(&mut self) -> Vec<[f64; 6]> {
        let plasticity = self.plasticity.as_ref();
        plasticity.map_or_else(Vec::new, |p| {
            p.tried_stress(self.elastic.strained(&self.gradient))
        })
    }

    fn moduli_of(&self, point: usize) -> Moduli {
        self.elastic.moduli(point)
    }

    /// Cauchy stress under finite kinematics.
    fn stress(&mut self) -> &[[f64; 6]] {
        self.load_gradient();
        let finite = self.elastic.finite;
        let mut tensors = std::mem::take(&mut self.tensors);
        for (i, tensor) in tensors.iter_mut().enumerate() {
            let gradient = self.gradient.elastic(i, finite);
            let point = self.point(i, StrainKind::Elastic);
            let mut stress = point.piola(&gradient, finite);
            if finite {
                let deformation = Matrix3::identity() + gradient;
                stress = stress * deformation.transpose() / deformation.determinant();
            }
            *tensor = point.components(&stress, self.elastic.is_plane_strain());
        }
        self.tensors = tensors;
        &self.tensors
    }

    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_gradient();
        self.load_force_state(StrainKind::Elastic, self.elastic.finite);
        self.family.sum_across(
            &Force,
            self.inputs.of_forces(),
            self.broken(),
            plane,
            receive,
        );
    }
}
