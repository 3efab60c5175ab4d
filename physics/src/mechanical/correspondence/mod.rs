//! Correspondence solids (non-ordinary state-based): force states from a classical stress.
//!
//! ```text
//! F = 1 + H,  H = [sum_j w (u_j - u_i) (x) xi] K^-1,  K = sum_j w xi (x) xi      Wang (2025), eqs. 3.15, 3.19
//! P = sigma(H)                 linear kinematics: linear elasticity
//! P = F S,  S = C : (E - e),  E = (F^T F - 1)/2      finite: Saint Venant-Kirchhoff, eqs. 3.16 to 3.18
//! T_ij = w_ij { P K^-1 xi + g z },  z = u_j - u_i - H xi,  g = G 2 d m / horizon
//!                                                     eqs. 3.14, 3.20; see docs/theory/mechanics.md
//! f_i = sum_j T_ij - T_ji
//! ```
//!
//! `w` is the weight of the bond in the family of the owner. The term `g z` stabilises the zero-energy modes
//! (Silling 2017) and vanishes in every affine deformation; m is the bulk modulus, or the shear modulus of a nearly incompressible
//! body. Any uniform strain is exact on any cloud, also at surfaces, and needs no calibration.
//!
//! Bonds break at their critical stretch ([`fracture`](super::fracture)). All sums, that of K included, run over
//! unbroken bonds, so that a uniform strain stays exact beside cracks. A *loose* point, whose bonds no longer span
//! the dimensions, has no strain, no stress and no `g z` of its own; only the force states of its neighbours act
//! on it. The energy criterion of fracture is not available: stress belongs to points, and no bond has an energy
//! of its own.

mod energies;
mod forces;
mod inputs;
mod kernels;

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::family::{AxisPlane, ByImage, LayerRule, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::largest_eigenvalue;
use perimelt_core::{Body, Bond, Family, Image, SlotField};
use rayon::prelude::*;

use super::base::{Properties, SolidBase};
use super::classical::{COMPONENTS, Point};
use super::deformation::Deformation;
use super::fracture::{BondLoads, Fracture, FractureState, NewBreaks};
use super::gradient::{FlatFamily, Gradient, RISE};
use super::moduli::Moduli;
use super::points::LawPoints;
use super::solid::{
    Constitution, EnergyKind, Evaluated, PointModuli, PointStates, Solid, Stiffness, StrainKind,
    StressFreeStrain, StressKind, Wanted,
};
use inputs::Inputs;
use kernels::{Block, Force};

/// Poisson's ratio above which a bulk modulus much larger than the shear modulus would make springs that followed it lock the body; see
/// docs/theory/mechanics.md, "Zero-energy modes".
const COMPRESSIBLE: f64 = 0.4;

/// A correspondence solid.
#[derive(Debug)]
pub struct Correspondence {
    base: SolidBase,
    /// G.
    stabilisation: f64,
    /// m of a point.
    spring_modulus: fn(&Moduli) -> f64,
    inputs: Inputs,
    /// H of each point.
    gradient: Gradient,
    /// H of each point without what prescribed strains do to it, where it was wanted.
    elastic_gradient: Vec<Matrix3<f64>>,
    /// What prescribed strains that are not uniform add to the forces of the springs, N/m³; empty if nothing.
    spring_forces: Vec<[f64; 3]>,
    /// `P K^-1 - g H` of each point.
    force_state: Vec<Matrix3<f64>>,
}

/// What a correspondence solid needs besides bonds and constitution.
#[derive(Debug)]
pub(super) struct Settings {
    /// G.
    pub(super) stabilisation: f64,
    /// The law of the points, if it is not linear.
    pub(super) law: Option<LawPoints>,
}

impl Correspondence {
    /// The solid of `body` with the given family.
    ///
    /// # Errors
    /// A point whose bonds do not span the dimensions.
    pub(super) fn new(
        body: &Body,
        family: Arc<Family>,
        constitution: Constitution,
        settings: Settings,
    ) -> Result<Self, FlatFamily> {
        let properties = Properties {
            bonds_shear: true,
            // forces and flow follow the same strain, that of points
            has_symmetric_plastic_tangent: true,
            has_finite_tangent: false,
        };
        let gradient = Gradient::new(body, &family, constitution.points.clone())?;
        let gradient = match constitution.plasticity {
            Some(_) => gradient.with_smoothing(body),
            None => gradient,
        };
        let poissons_ratio = constitution.elasticity.least_poissons_ratio();
        let spring_modulus: fn(&Moduli) -> f64 = match poissons_ratio > COMPRESSIBLE {
            true => |moduli| moduli.shear,
            false => |moduli| moduli.bulk,
        };
        let mut base = SolidBase::new(body, family, constitution, properties);
        base.set_law(settings.law);
        let mut this = Correspondence {
            stabilisation: settings.stabilisation,
            spring_modulus,
            inputs: Inputs::new(&base.family, body.dimension, base.fracture.is_some()),
            gradient,
            elastic_gradient: Vec::new(),
            spring_forces: Vec::new(),
            force_state: vec![Matrix3::zeros(); body.points.len()],
            base,
        };
        this.load_stabilisation();
        this.load_limits(body, None, true);
        Ok(this)
    }

    /// g; zero for loose points.
    fn spring(&self, point: usize) -> f64 {
        if self.gradient.is_loose(point) {
            return 0.0;
        }
        let modulus = (self.spring_modulus)(&self.base.elastic.moduli(point));
        let bond_stiffness = 2.0 * self.base.dimension as f64 * modulus;
        self.stabilisation * bond_stiffness / self.base.horizons[point]
    }

    fn load_stabilisation(&mut self) {
        let mut slots = std::mem::take(&mut self.inputs.stabilisation);
        let spring = |point: usize| self.spring(point);
        slots.load(&self.base.family, spring, Mirrored::Scalar);
        self.inputs.stabilisation = slots;
        self.gradient.forget_strains();
    }

    fn load_limits(&mut self, body: &Body, temperature: Option<&[f64]>, moduli_changed: bool) {
        let changed = self
            .base
            .load_limits(body, temperature, moduli_changed, None);
        if let (true, Some(fracture)) = (changed, &self.base.fracture) {
            let [_, limits] = &mut self.inputs.strength;
            limits.load(&self.base.family, &fracture.critical[..], Mirrored::Scalar);
        }
    }

    /// The linear law of a point for the given kind of strain.
    fn point(&self, i: usize, strain: StrainKind) -> Point {
        self.base.law_of(&self.gradient, i, strain)
    }
}

impl Correspondence {
    fn set_moduli(&mut self, moduli: PointModuli<'_>) {
        let changed = self.base.set_moduli(moduli);
        if changed {
            self.load_stabilisation();
        }
        if let PointModuli::At(body, temperature) = moduli {
            self.load_limits(body, temperature, changed);
        }
    }

    fn set_eigenstrain(&mut self, eigenstrain: &[f64]) {
        if !self.base.elastic.set_eigenstrain(eigenstrain) {
            return;
        }
        self.gradient.forget_strains();
        if self.base.fracture.is_some() {
            let [eigenstrain, _] = &mut self.inputs.strength;
            let values = &self.base.elastic.eigenstrain[..];
            eigenstrain.load(&self.base.family, values, Mirrored::Scalar);
        }
    }

    fn set_stress_free(&mut self, stress_free: StressFreeStrain<'_>) {
        if self.base.elastic.set_stress_free(stress_free) {
            self.gradient.forget_strains();
        }
    }

    fn set_present(&mut self, present: &[bool]) {
        let family = Arc::get_mut(&mut self.base.family);
        family
            .expect("a family that grows has one owner")
            .set_active(present);
        self.gradient.follow_growth(&self.base.family);
        self.base.layer_forces.forget();
        self.load_stabilisation();
    }

    fn evaluate_force(&mut self, out: &mut [f64]) {
        self.base.try_gradients(&self.gradient);
        self.load_force_state(StrainKind::Elastic, self.base.elastic.finite);
        self.sum_forces(out);
        self.add_spring_forces(out);
        self.sum_excess();
    }
}

impl Solid for Correspondence {
    fn base(&self) -> &SolidBase {
        &self.base
    }

    fn base_mut(&mut self) -> &mut SolidBase {
        &mut self.base
    }

    fn set_points(&mut self, states: PointStates<'_>) {
        let PointStates {
            moduli,
            eigenstrain,
            stress_free,
            present,
        } = states;
        if let Some(moduli) = moduli {
            self.set_moduli(moduli);
        }
        if let Some(eigenstrain) = eigenstrain {
            self.set_eigenstrain(eigenstrain);
        }
        if let Some(stress_free) = stress_free {
            self.set_stress_free(stress_free);
        }
        if let Some(present) = present {
            self.set_present(present);
        }
    }

    fn set_displacement(&mut self, values: &[f64], rules: &[LayerRule]) {
        let vector = &mut self.inputs.displacement;
        self.base.continue_displacement(values, rules, vector);
    }

    fn deformation(&mut self) -> Deformation<'_> {
        let displacement = std::array::from_fn(|axis| self.inputs.along(axis));
        Deformation::Bonds(&self.base, displacement)
    }

    fn evaluate(&mut self, wanted: Wanted<'_>) -> Evaluated<'_> {
        let Wanted {
            force,
            stress,
            energy,
            gradient,
        } = wanted;
        self.load_gradient();
        if let Some(out) = force {
            self.evaluate_force(out);
        }
        match stress {
            Some(StressKind::Spatial) => self.evaluate_stress(),
            Some(StressKind::Material) => self.base.evaluate_tried_stress(Some(&self.gradient)),
            Some(StressKind::Conjugate) => self.base.evaluate_conjugate_stress(&self.gradient),
            None => {}
        }
        match energy {
            Some(EnergyKind::Total) => self.evaluate_total_energy(),
            Some(EnergyKind::Elastic) => self.evaluate_elastic_energy(),
            None => {}
        }
        if gradient {
            self.evaluate_elastic_gradient();
        }
        Evaluated {
            stress: self.base.stress_of(stress),
            energy: self.base.energy_of(energy),
            gradient: if gradient {
                &self.elastic_gradient
            } else {
                &[]
            },
            smoothing: self.gradient.smoothing(),
        }
    }

    fn linearise(&mut self, damping: f64) {
        self.load_gradient();
        self.base.linearise(Some(&self.gradient), damping);
    }

    fn stiffness(&mut self, kind: Stiffness, out: &mut [f64]) {
        self.load_gradient();
        let strain = match (kind, &mut self.base.plasticity) {
            (Stiffness::Tangent, Some(plasticity)) => {
                let values = &self.gradient.values;
                plasticity.follow(|i| values[i]);
                StrainKind::Change
            }
            (Stiffness::Tangent, None) if self.base.law_points.is_some() => StrainKind::Change,
            _ => StrainKind::Total,
        };
        self.load_force_state(strain, false);
        self.sum_forces(out);
        out.par_iter_mut().for_all(|f| *f = -*f);
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        if self.gradient.update_shapes(&self.base.family, broken) {
            self.load_stabilisation();
        }
        let mut slots: [SlotField; 8] = Default::default();
        let inverse = &self.gradient.inverse_shape;
        for (slots, at) in slots.iter_mut().zip(COMPONENTS) {
            let of_image = |image: &Image| {
                let sign = image.mirror[at.0] * image.mirror[at.1];
                [sign * inverse[image.point][at]]
            };
            let ghosts = ByImage(&self.base.continuation, of_image);
            slots.load(&self.base.family, |i: usize| inverse[i][at], ghosts);
        }
        let constants: [fn(Moduli) -> f64; 2] = [|m| m.lame, |m| m.shear];
        for (slots, constant) in slots[6..].iter_mut().zip(constants) {
            let value = |i: usize| constant(self.base.elastic.moduli(i));
            slots.load(&self.base.family, value, Mirrored::Scalar);
        }
        let inputs: [&[f64]; 9] = std::array::from_fn(|i| match slots.get(i) {
            Some(slots) => &slots[..],
            None => &self.inputs.stabilisation,
        });
        let tensors = &mut self.base.tensors;
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        self.base
            .family
            .sum_unbroken(&Block, inputs, broken, tensors);
        &self.base.tensors
    }

    /// Largest frequency by a power iteration; broken bonds and births may raise its square by the factor `RISE`.
    fn largest_frequency(&mut self, density: &[f64], rules: &[LayerRule]) -> f64 {
        let dimension = self.base.dimension;
        let components = 0..3 * density.len();
        let inverse_density = components.map(|i| match i % 3 < dimension {
            true => 1.0 / density[i / 3],
            false => 0.0,
        });
        let inverse_density: Vec<f64> = inverse_density.collect();
        let points = self.base.points.clone();
        let square = largest_eigenvalue(&inverse_density, &points, |u, out| {
            self.set_displacement(u, rules);
            self.stiffness(Stiffness::Elastic, out);
        });
        let square = square * self.base.elastic_law.steepest;
        match self.base.fracture.is_some() || self.base.family.grows() {
            true => square.sqrt() * RISE.sqrt(),
            false => square.sqrt(),
        }
    }

    fn replace_fracture_state(&mut self, state: FractureState) -> Option<FractureState> {
        let fracture = self.base.fracture.as_mut()?;
        self.gradient.invalidate();
        Some(std::mem::replace(&mut fracture.state, state))
    }

    /// Broken bonds leave no frozen stress: the conjugate stress is that of points.
    fn break_bonds(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks {
        let ratio = forces::stretch_ratio(self.base.elastic.finite, self.inputs.of_excess());
        let Some(fracture) = &mut self.base.fracture else {
            return NewBreaks::default();
        };
        let conjugate = |_: usize, _: &Bond, _: usize| 0.0;
        let loads = BondLoads { ratio, conjugate };
        fracture.break_bonds(
            &self.base.family,
            &self.base.points,
            fraction,
            damage,
            loads,
        )
    }

    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_gradient();
        self.load_force_state(StrainKind::Elastic, self.base.elastic.finite);
        self.base.family.sum_across(
            &Force,
            self.inputs.of_forces(),
            self.base.broken(),
            plane,
            receive,
        );
    }
}
