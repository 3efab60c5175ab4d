//! Bond-based and ordinary state-based solids: the kernels of [`stretch`](super::stretch) over a body of any
//! dimension.

mod dilatation;
mod forces;
mod inputs;

use std::sync::Arc;

use perimelt_core::family::{AxisPlane, LayerRule, Mirrored};
use perimelt_core::{Body, Family, SlotField};

use super::base::{ElasticProperties, Properties, SolidBase};
use super::classical::symmetric;
use super::deformation::Deformation;
use super::fracture::{BondEnergy, Fracture, FractureState, NewBreaks};
use super::gradient::{FlatFamily, Gradient};
use super::solid::{
    Constitution, EnergyKind, Evaluated, PointModuli, PointStates, Solid, Stiffness, StrainKind,
    StressFreeStrain, StressKind, Wanted,
};
use super::specialise::specialise;
use super::stretch::{
    Block, BondForce, BondLaw, CRITICAL, ConjugateStress, EIGENSTRAIN, ElasticEnergy, Energy,
    Force, INPUTS, STIFFNESS, Stress, WeightOverLength, WithStrain,
};
use dilatation::Dilatation;
use forces::Sum;
use inputs::{Inputs, Needs};

/// A solid whose bonds carry forces along themselves: bond-based, or ordinary state-based where Poisson's ratio
/// is that of the material.
#[derive(Debug)]
pub struct Ordinary<L> {
    base: SolidBase,
    /// The forces of the bonds.
    law: L,
    horizons_differ: bool,
    /// `None` for a bond-based solid.
    dilatation: Option<Dilatation>,
    /// The displacement gradients from which plastic flow follows; `None` for an elastic solid.
    gradient: Option<Gradient>,
    inputs: Inputs,
    /// Factors of the layers for which the eigenstrain that differs by direction was loaded; `None` where it has changed.
    tensor_scales: Option<Vec<[f64; 3]>>,
}

impl<L: BondForce> Ordinary<L> {
    /// The solid of `body` with the given family and forces of its bonds.
    ///
    /// # Errors
    /// A plastic body with a point whose bonds do not span the dimensions.
    pub fn new(
        body: &Body,
        family: Arc<Family>,
        constitution: Constitution,
        law: L,
    ) -> Result<Self, FlatFamily> {
        let needs = Needs {
            pressure: L::HAS_PRESSURE,
            limits: constitution.fracture.is_some(),
            inelastic: constitution.plasticity.is_some(),
            tangent: !L::Law::IS_LINEAR,
        };
        let gradient = match needs.inelastic {
            true => Some(Gradient::new(body, &family, constitution.points.clone())?),
            false => None,
        };
        let properties = Properties {
            bonds_shear: false,
            // bonds carry forces along themselves, but flow follows the strain of whole families
            has_finite_tangent: false,
            has_symmetric_plastic_tangent: false,
        };
        let mut base = SolidBase::new(body, family, constitution, properties);
        base.elastic_law = ElasticProperties {
            is_linear: L::Law::IS_LINEAR,
            steepest: law.law().steepest(),
        };
        let mut this = Ordinary {
            law,
            horizons_differ: base.horizons.differ(),
            dilatation: L::HAS_PRESSURE.then(|| Dilatation::new(&base.family, body)),
            gradient,
            inputs: Inputs::new(base.family.clone(), body.dimension, needs),
            tensor_scales: None,
            base,
        };
        this.load_stiffness();
        this.load_limits(body, None, true);
        this.find_uniform_inputs();
        Ok(this)
    }

    fn load_stiffness(&mut self) {
        let stiffness = |i: usize| {
            self.base
                .elastic
                .moduli(i)
                .bond_stiffness(self.base.dimension)
        };
        self.inputs.load(STIFFNESS, stiffness);
    }

    /// Evaluates the limits of bonds; whether they can have changed.
    fn load_limits(
        &mut self,
        body: &Body,
        temperature: Option<&[f64]>,
        moduli_changed: bool,
    ) -> bool {
        let law = self.law.law();
        let energy = |stretch: f64| law.mean_force(stretch) * stretch;
        let energy: Option<BondEnergy<'_>> = match L::Law::IS_LINEAR {
            true => None,
            false => Some(&energy),
        };
        let changed = self
            .base
            .load_limits(body, temperature, moduli_changed, energy);
        if let (true, Some(fracture)) = (changed, &self.base.fracture) {
            self.inputs.load(CRITICAL, &fracture.critical[..]);
        }
        changed
    }

    /// Finds out whether all points have the same eigenstrain, stiffness and limit.
    fn find_uniform_inputs(&mut self) {
        let same = |values: &[f64]| {
            let first = values.first().copied().unwrap_or_default();
            values.iter().all(|v| *v == first).then_some(first)
        };
        let limit = (self.base.fracture.as_ref()).map_or(Some(0.0), |f| same(&f.critical));
        let eigenstrain = same(&self.base.elastic.eigenstrain);
        self.inputs.uniform = match (self.base.elastic.uniform(), eigenstrain, limit) {
            (Some(moduli), Some(eigenstrain), Some(limit)) => {
                let mut point = [0.0; INPUTS];
                point[EIGENSTRAIN] = eigenstrain;
                point[STIFFNESS] = moduli.bond_stiffness(self.base.dimension);
                point[CRITICAL] = limit;
                Some(point)
            }
            _ => None,
        };
    }

    fn sum_stress(&mut self) {
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        let (law, symmetric) = (self.law, self.horizons_differ);
        let (sums, finite) = (&mut self.base.tensors, self.base.elastic.finite);
        specialise!(FINITE = finite => {
            let kernel = Stress::<FINITE, L> { law, symmetric };
            match self.inputs.has_strain() {
                true => self.inputs.sum_with_strain(kernel, broken, sums),
                false => self.inputs.sum(&kernel, broken, sums),
            }
        });
    }
}

impl<L: BondForce> Ordinary<L> {
    fn set_moduli(&mut self, moduli: PointModuli<'_>) {
        let changed = self.base.set_moduli(moduli);
        if changed {
            self.load_stiffness();
        }
        if let PointModuli::At(body, temperature) = moduli
            && (self.load_limits(body, temperature, changed) || changed)
        {
            self.find_uniform_inputs();
        }
    }

    fn set_eigenstrain(&mut self, eigenstrain: &[f64]) {
        if self.base.elastic.set_eigenstrain(eigenstrain) {
            (self.inputs).load(EIGENSTRAIN, &self.base.elastic.eigenstrain[..]);
            self.find_uniform_inputs();
            if let Some(gradient) = &mut self.gradient {
                gradient.forget_strains();
            }
        }
    }

    fn set_stress_free(&mut self, stress_free: StressFreeStrain<'_>) {
        let changed = self.base.elastic.set_stress_free(stress_free);
        // in plane strain the strain in the plane depends on the moduli
        if !changed && !self.base.elastic.is_plane_strain() {
            return;
        }
        self.tensor_scales = None;
        if let Some(gradient) = &mut self.gradient {
            gradient.forget_strains();
        }
    }

    /// Loads the eigenstrain that differs by direction where it or the factors of the layers changed.
    fn load_tensor(&mut self, rules: &[LayerRule]) {
        let scales = || rules.iter().map(|rule| rule.scale);
        let known = self.tensor_scales.as_ref();
        let is_current = known.is_some_and(|known| known.iter().copied().eq(scales()));
        if is_current || self.base.elastic.prescribed.is_empty() {
            return;
        }
        let SolidBase {
            elastic,
            continuation,
            ..
        } = &self.base;
        let strain = |i: usize| elastic.in_plane_tensor(i, 0.0);
        self.inputs.load_tensor(continuation, strain);
        self.tensor_scales = Some(scales().collect());
    }

    /// Evaluates the forces, and with them the trial state of the flow and the loads of bonds.
    fn evaluate_force(&mut self, out: &mut [f64]) {
        self.load_gradient();
        if let Some(gradient) = &self.gradient {
            self.base.try_gradients(gradient);
        }
        self.load_inelastic(StrainKind::Elastic);
        self.load_pressure(StrainKind::Elastic, self.base.elastic.finite);
        self.sum_forces_and_excess(out);
    }

    fn evaluate_stress(&mut self) {
        self.load_inelastic(StrainKind::Elastic);
        self.load_pressure(StrainKind::Elastic, self.base.elastic.finite);
        self.sum_stress();
        let SolidBase {
            elastic,
            plasticity,
            tensors,
            ..
        } = &mut self.base;
        if elastic.is_plane_strain() {
            for (i, tensor) in tensors.iter_mut().enumerate() {
                let tried = plasticity.as_ref().map(|p| &p.states.tried()[i].strain);
                let prescribed = elastic.prescribed.get(i).map_or(0.0, |strain| strain[2]);
                let across = tried.map_or(0.0, |strain| strain[2]) + prescribed;
                let (moduli, eigenstrain) = (elastic.moduli(i), elastic.eigenstrain[i]);
                tensor[2] = moduli.stress_across(tensor, eigenstrain, across);
            }
        }
    }

    fn evaluate_conjugate_stress(&mut self) {
        let SolidBase {
            elastic,
            fracture,
            tensors,
            points,
            ..
        } = &mut self.base;
        let broken = fracture.as_ref().map(Fracture::broken);
        let (finite, law, inputs) = (elastic.finite, self.law, &self.inputs);
        specialise!(FINITE = finite =>
            inputs.sum::<INPUTS, 6>(&ConjugateStress::<FINITE, L>(law), broken, tensors));
        if let Some(dilatation) = &mut self.dilatation {
            dilatation.sum(StrainKind::Total, finite, inputs, broken);
            dilatation.sum_directions(inputs, broken, points);
            for (i, tensor) in tensors.iter_mut().enumerate() {
                let of_pressure = dilatation.conjugate_stress_tensor(elastic, i);
                (0..6).for_each(|c| tensor[c] += of_pressure[c]);
            }
        }
        if let Some(fracture) = fracture {
            for (tensor, frozen) in tensors.iter_mut().zip(&fracture.state.frozen) {
                (0..6).for_each(|c| tensor[c] += frozen[c]);
            }
        }
        if elastic.is_plane_strain() {
            for (i, tensor) in tensors.iter_mut().enumerate() {
                tensor[2] = elastic.moduli(i).stress_across(tensor, 0.0, 0.0);
            }
        }
    }

    fn evaluate_total_energy(&mut self) {
        let SolidBase {
            elastic,
            fracture,
            energy,
            ..
        } = &mut self.base;
        let broken = fracture.as_ref().map(Fracture::broken);
        let (finite, law, inputs) = (elastic.finite, self.law, &self.inputs);
        specialise!(FINITE = finite =>
            inputs.sum::<INPUTS, 2>(&Energy::<FINITE, L>(law), broken, energy));
        if let Some(dilatation) = &mut self.dilatation {
            dilatation.sum(StrainKind::Total, finite, inputs, broken);
            for (i, [density, conjugate]) in energy.iter_mut().enumerate() {
                *density += dilatation.energy(elastic, None, i);
                *conjugate += dilatation.conjugate_stress(elastic, i, dilatation.sums[i][0]);
            }
        }
        for (i, [_, conjugate]) in energy.iter_mut().enumerate() {
            let frozen = fracture.as_ref().map_or(0.0, |f| f.state.trace(i));
            *conjugate = (*conjugate + frozen) * elastic.moduli(i).swelling;
        }
    }

    fn evaluate_elastic_energy(&mut self) {
        self.load_inelastic(StrainKind::Elastic);
        let SolidBase {
            elastic,
            plasticity,
            fracture,
            energy,
            ..
        } = &mut self.base;
        let broken = fracture.as_ref().map(Fracture::broken);
        let (finite, law, inputs) = (elastic.finite, self.law, &self.inputs);
        match inputs.has_strain() {
            true => specialise!(FINITE = finite =>
                inputs.sum_with_strain(ElasticEnergy::<FINITE, L>(law), broken, energy)),
            false => specialise!(FINITE = finite =>
                inputs.sum::<INPUTS, 2>(&ElasticEnergy::<FINITE, L>(law), broken, energy)),
        }
        if let Some(dilatation) = &mut self.dilatation {
            dilatation.sum(StrainKind::Elastic, finite, inputs, broken);
            for (i, [density, _]) in energy.iter_mut().enumerate() {
                *density += dilatation.energy(elastic, plasticity.as_ref(), i);
            }
        }
    }
}

impl<L: BondForce> Solid for Ordinary<L> {
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
        assert!(
            present.is_none(),
            "set-up refuses births of bonds along themselves"
        );
        if let Some(moduli) = moduli {
            self.set_moduli(moduli);
        }
        if let Some(eigenstrain) = eigenstrain {
            self.set_eigenstrain(eigenstrain);
        }
        if let Some(stress_free) = stress_free {
            self.set_stress_free(stress_free);
        }
    }

    fn set_displacement(&mut self, values: &[f64], rules: &[LayerRule]) {
        let vector = &mut self.inputs.slots[..self.base.dimension];
        self.base.continue_displacement(values, rules, vector);
        self.load_tensor(rules);
    }

    fn deformation(&mut self) -> Deformation<'_> {
        Deformation::Bonds(&self.base, self.inputs.displacement())
    }

    fn evaluate(&mut self, wanted: Wanted<'_>) -> Evaluated<'_> {
        let Wanted {
            force,
            stress,
            energy,
            ..
        } = wanted;
        if let Some(out) = force {
            self.evaluate_force(out);
        }
        match stress {
            Some(StressKind::Spatial) => self.evaluate_stress(),
            Some(StressKind::Material) => {
                self.load_gradient();
                self.base.evaluate_tried_stress(self.gradient.as_ref());
            }
            Some(StressKind::Conjugate) => self.evaluate_conjugate_stress(),
            None => {}
        }
        match energy {
            Some(EnergyKind::Total) => self.evaluate_total_energy(),
            Some(EnergyKind::Elastic) => self.evaluate_elastic_energy(),
            None => {}
        }
        Evaluated {
            stress: self.base.stress_of(stress),
            energy: self.base.energy_of(energy),
            ..Evaluated::default()
        }
    }

    fn linearise(&mut self, damping: f64) {
        self.inputs.keep_displacement();
        self.load_gradient();
        self.base.linearise(self.gradient.as_ref(), damping);
    }

    fn stiffness(&mut self, kind: Stiffness, out: &mut [f64]) {
        let (Stiffness::Tangent, Some(plasticity), Some(gradient)) =
            (kind, &mut self.base.plasticity, &mut self.gradient)
        else {
            self.load_pressure(StrainKind::Total, false);
            let sum = match kind == Stiffness::Tangent && !L::Law::IS_LINEAR {
                true => Sum::Tangent,
                false => Sum::Stiffness,
            };
            return self.sum_forces(sum, out);
        };
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        gradient.evaluate(&self.base.family, self.inputs.displacement(), broken);
        plasticity.follow(|i| gradient.values[i]);
        self.load_inelastic(StrainKind::Change);
        self.load_pressure(StrainKind::Change, false);
        self.sum_forces(Sum::Change, out);
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        let (inputs, tensors) = (&self.inputs, &mut self.base.tensors);
        inputs.sum::<INPUTS, 6>(&Block, broken, tensors);
        let layers = &self.base.layer_forces;
        layers.complete_blocks::<INPUTS>(&Block, inputs.first(), broken, tensors);
        tensors
    }

    /// Twice the largest eigenvalue of the diagonal block, which bounds the eigenvalues of a network of springs
    /// because `(n . (u_j - u_i))^2 <= 2 (n . u_i)^2 + 2 (n . u_j)^2`. A positive dilatation stiffness adds at
    /// most the springs `c = 4 a N^2 sum_j w/|xi|`, by `(sum_j w s)^2 <= (sum_j w/|xi|) sum_j w |xi| s^2`.
    fn largest_frequency(&mut self, density: &[f64], rules: &[LayerRule]) -> f64 {
        let points = density.len();
        self.set_displacement(&vec![0.0; 3 * points], rules);
        let base = &self.base;
        let mut sums = vec![[0.0]; points];
        (self.inputs).sum::<INPUTS, 1>(&WeightOverLength, base.broken(), &mut sums);
        if let Some(dilatation) = &mut self.dilatation {
            dilatation.bring_normalisers(&base.points);
            base.points.bring(sums.as_flattened_mut());
        }
        let stiffness = |i: usize| {
            let moduli = base.elastic.moduli(i);
            let a = moduli.dilatation_stiffness(base.dimension).max(0.0);
            let added = match &self.dilatation {
                Some(dilatation) => 4.0 * a * dilatation.normaliser[i].powi(2) * sums[i][0],
                None => 0.0,
            };
            moduli.bond_stiffness(base.dimension) * base.elastic_law.steepest + added
        };
        let mut slots = SlotField::default();
        slots.load(&base.family, stiffness, Mirrored::Scalar);
        let mut blocks = vec![[0.0; 6]; points];
        let inputs = [&slots[..]; INPUTS];
        base.family.sum(&Block, inputs, &mut blocks);
        let layers = &base.layer_forces;
        layers.complete_blocks(&Block, inputs, None, &mut blocks);
        // most points have the block of the one before
        let mut last = ([f64::NAN; 6], 0.0);
        let mut largest = |block: &[f64; 6]| {
            if last.0 != *block {
                last = (*block, 2.0 * symmetric(block).symmetric_eigenvalues().max());
            }
            last.1
        };
        // sums exist at the points of the family
        let blocks = &blocks[..base.family.points()];
        let squares = blocks.iter().zip(density).map(|(b, rho)| largest(b) / rho);
        squares.fold(0.0, f64::max).sqrt()
    }

    fn replace_fracture_state(&mut self, state: FractureState) -> Option<FractureState> {
        let fracture = self.base.fracture.as_mut()?;
        if let Some(gradient) = &mut self.gradient {
            gradient.invalidate();
        }
        Some(std::mem::replace(&mut fracture.state, state))
    }

    fn break_bonds(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks {
        self.break_exceeding_bonds(fraction, damage)
    }

    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_inelastic(StrainKind::Elastic);
        self.load_pressure(StrainKind::Elastic, self.base.elastic.finite);
        let (family, inputs, broken) = (&self.base.family, &self.inputs, self.base.broken());
        let finite = self.base.elastic.finite;
        if inputs.has_strain() {
            let inputs = inputs.with_strain();
            specialise!(FINITE = finite =>
                family.sum_across(&WithStrain(Force::<FINITE, _>(L::OF_LINEAR)), inputs, broken, plane, receive));
        } else {
            let inputs = inputs.first::<INPUTS>();
            specialise!(FINITE = finite =>
                family.sum_across(&Force::<FINITE, _>(self.law), inputs, broken, plane, receive));
        }
    }
}
