//! Forces of the bonds, and the breaking of bonds.

use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel};
use rayon::prelude::*;

use super::Ordinary;
use super::dilatation::PressureLaw;
use super::inputs::Inputs;
use crate::mechanical::base::{flat, unflatten};
use crate::mechanical::fracture::{BondLoads, Fracture, NewBreaks};
use crate::mechanical::solid::StrainKind;
use crate::mechanical::specialise::specialise;
use crate::mechanical::stretch::{
    BondForce, Breaking, Dilation, Energy, Force, INPUTS, Load, STRAIN_INPUTS, Stiffness, Tangent,
    WithStrain,
};

/// Which forces are summed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sum {
    /// Forces of the displacement.
    Force,
    /// Minus the forces of the linear elastic body.
    Stiffness,
    /// Minus the change of the forces about the displacement that was linearised.
    Tangent,
    /// Forces of a change of displacement and inelastic strain.
    Change,
}

impl<L: BondForce> Ordinary<L> {
    /// Evaluates the pressure of the displacement that was set.
    pub(super) fn load_pressure(&mut self, strain: StrainKind, finite: bool) {
        let Some(dilatation) = &mut self.dilatation else {
            return;
        };
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        dilatation.sum(strain, finite, &self.inputs, broken);
        dilatation.bring_sums(&self.base.points);
        if self.base.continuation.is_bent() {
            dilatation.sum_directions(&self.inputs, broken, &self.base.points);
        }
        let law = PressureLaw {
            elastic: &self.base.elastic,
            plasticity: self.base.plasticity.as_ref(),
            layers: &self.base.layer_forces,
            strain,
        };
        dilatation.load_pressure(
            &law,
            &self.base.family,
            &mut self.inputs,
            &self.base.continuation,
        );
    }

    /// Loads the inelastic strain of the trial state, or its change.
    pub(super) fn load_inelastic(&mut self, strain: StrainKind) {
        let Some(state) = &self.base.plasticity else {
            return;
        };
        let strain_of = |i: usize| match strain {
            StrainKind::Change => state.change[i],
            StrainKind::Elastic | StrainKind::Total => state.states.tried()[i].strain,
        };
        let elastic = &self.base.elastic;
        let tensor = |i: usize| elastic.in_plane_tensor(i, 0.0);
        let has_tensor = strain != StrainKind::Change && self.inputs.has_tensor();
        self.inputs.load_inelastic(
            &self.base.continuation,
            strain_of,
            has_tensor.then_some(tensor),
        );
    }

    /// Evaluates the displacement gradients of a body that flows.
    pub(super) fn load_gradient(&mut self) {
        let Some(gradient) = &mut self.gradient else {
            return;
        };
        let base = &self.base;
        gradient.evaluate(&base.family, self.inputs.displacement(), base.broken());
        gradient.follow_strains(base.bonds(), &base.continuation, &base.elastic);
    }

    /// Sums forces and, if bonds break, the excess of bonds over their limit.
    pub(super) fn sum_forces_and_excess(&mut self, out: &mut [f64]) {
        let has_strain = self.inputs.has_strain();
        match (&self.base.fracture, has_strain, self.base.dimension) {
            (None, ..) => self.sum_forces(Sum::Force, out),
            (Some(_), true, _) => {
                self.sum_forces(Sum::Force, out);
                self.sum_excess_with_strain();
            }
            (Some(_), false, 2) => self.sum_breaking::<2>(out),
            (Some(_), false, _) => self.sum_breaking::<3>(out),
        }
        let load = self.load_kernel();
        let Some(fracture) = &mut self.base.fracture else {
            return;
        };
        match has_strain {
            true => {
                let ratio = ratio_with_strain(load, &self.inputs);
                fracture.add_excess_of_crossings(&self.base.family, ratio);
            }
            false => {
                let ratio = elastic_ratio(load, &self.inputs);
                fracture.add_excess_of_crossings(&self.base.family, ratio);
            }
        }
    }

    pub(super) fn sum_forces(&mut self, sum: Sum, out: &mut [f64]) {
        match self.base.dimension {
            2 => self.sum_forces_in::<2>(sum, out),
            _ => self.sum_forces_in::<3>(sum, out),
        }
    }

    fn sum_forces_in<const D: usize>(&mut self, sum: Sum, out: &mut [f64]) {
        let finite = self.base.elastic.finite;
        match sum {
            Sum::Change => {
                self.sum_kernel_with_strain::<D>(
                    Force::<false, _>(L::OF_LINEAR),
                    Inputs::with_change,
                    out,
                );
                out.par_iter_mut().for_all(|f| *f = -*f);
            }
            Sum::Stiffness => self.sum_kernel::<D>(&Stiffness(self.law), out),
            Sum::Tangent => {
                self.sum_kernel_of::<_, D>(&Tangent(self.law), Inputs::tangent, out);
            }
            Sum::Force if self.inputs.has_strain() => specialise!(FINITE = finite =>
                self.sum_kernel_with_strain::<D>(Force::<FINITE, _>(L::OF_LINEAR), Inputs::with_strain, out)),
            Sum::Force => specialise!(FINITE = finite =>
                self.sum_kernel::<D>(&Force::<FINITE, _>(self.law), out)),
        }
    }

    /// Sums a kernel of forces, layers included.
    fn sum_kernel<const D: usize>(&mut self, kernel: &impl BondKernel<INPUTS, D>, out: &mut [f64]) {
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        let sums = flat::<D>(&mut self.base.padded, bytemuck::cast_slice_mut(out));
        self.inputs.sum_forces::<L, D>(kernel, broken, sums);
        unflatten::<D>(&self.base.padded, out);
        self.base.complete(kernel, self.inputs.first(), out);
    }

    /// Sums a kernel of forces with inelastic strains, layers included.
    fn sum_kernel_with_strain<const D: usize>(
        &mut self,
        kernel: impl BondKernel<INPUTS, D>,
        inputs: fn(&Inputs) -> [&[f64]; STRAIN_INPUTS],
        out: &mut [f64],
    ) {
        self.sum_kernel_of::<STRAIN_INPUTS, D>(&WithStrain(kernel), inputs, out);
    }

    /// Sums a kernel of forces with further inputs, layers included.
    fn sum_kernel_of<const I: usize, const D: usize>(
        &mut self,
        kernel: &impl BondKernel<I, D>,
        inputs: fn(&Inputs) -> [&[f64]; I],
        out: &mut [f64],
    ) {
        let inputs = inputs(&self.inputs);
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        let sums = flat::<D>(&mut self.base.padded, bytemuck::cast_slice_mut(out));
        (self.base.family).sum_unbroken(kernel, inputs, broken, sums);
        unflatten::<D>(&self.base.padded, out);
        self.base.complete(kernel, inputs, out);
    }

    /// Forces and, in the same sweep, the excess of bonds over their limit.
    fn sum_breaking<const D: usize>(&mut self, out: &mut [f64]) {
        let Some(fracture) = &mut self.base.fracture else {
            return;
        };
        let energy = fracture.compares_energy();
        let (inputs, finite) = (&self.inputs, self.base.elastic.finite);
        let (vectors, _) = out.as_chunks_mut::<3>();
        let sums = (vectors, &mut fracture.excess[..]);
        let broken = Some(&fracture.state.broken[0]);
        let law = self.law;
        specialise!(FINITE = finite, ENERGY = energy => {
            let kernel = Breaking::<D, FINITE, _, ENERGY>(law);
            inputs.sum_forces_and_excess::<L>(&kernel, broken, sums);
            let kernel = Force::<FINITE, _>(law);
            self.base.complete::<_, D>(&kernel, inputs.first(), out);
        });
    }

    /// The excess of the bonds of a body with strains that differ by direction.
    fn sum_excess_with_strain(&mut self) {
        let kernel = self.load_kernel();
        let Some(fracture) = &mut self.base.fracture else {
            return;
        };
        let broken = Some(&fracture.state.broken[0]);
        self.inputs
            .sum_with_strain(kernel, broken, &mut self.base.energy);
        let excess = fracture.excess.iter_mut().zip(&self.base.energy);
        excess.for_each(|(excess, [_, load])| *excess = *load);
    }

    fn load_kernel(&self) -> Load<L> {
        Load {
            finite: self.base.elastic.finite,
            energy: (self.base.fracture.as_ref()).is_some_and(Fracture::compares_energy),
            law: self.law,
        }
    }

    pub(super) fn break_exceeding_bonds(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks {
        let load = self.load_kernel();
        let Some(fracture) = &mut self.base.fracture else {
            return NewBreaks::default();
        };
        let (family, points) = (&self.base.family, &self.base.points);
        let elastic = &self.base.elastic;
        let (finite, dilatation) = (elastic.finite, self.dilatation.as_ref());
        let (inputs, law) = (self.inputs.first::<INPUTS>(), self.law);
        let ends = |own, other| [own, other].map(|slot: usize| inputs.map(|i| i[slot]));
        let conjugate = |point: usize, bond: &Bond, other: usize| {
            let [own, other] = ends(family.slot_of(point), other);
            let [_, stress] = specialise!(FINITE = finite =>
                Energy::<FINITE, L>(law).bond(bond, own, other));
            let Some(dilatation) = dilatation else {
                return stress;
            };
            let [own, other] = [own, other].map(|[x, y, z, ..]| [x, y, z]);
            let [dilation] = specialise!(FINITE = finite =>
                Dilation::<FINITE>.bond(bond, own, other));
            stress + dilatation.conjugate_stress(elastic, point, dilation)
        };
        if self.inputs.has_strain() {
            let ratio = ratio_with_strain(load, &self.inputs);
            let loads = BondLoads { ratio, conjugate };
            return fracture.break_bonds(family, points, fraction, damage, loads);
        }
        let ratio = elastic_ratio(load, &self.inputs);
        fracture.break_bonds(
            family,
            points,
            fraction,
            damage,
            BondLoads { ratio, conjugate },
        )
    }
}

/// Load of a bond over the mean limit of its ends, from the slots of both.
fn elastic_ratio<L: BondForce>(
    load: Load<L>,
    inputs: &Inputs,
) -> impl Fn(&Bond, usize, usize) -> f64 + Sync {
    let inputs = inputs.first::<INPUTS>();
    move |bond: &Bond, own: usize, other: usize| {
        let [own, other] = [own, other].map(|slot| inputs.map(|i| i[slot]));
        load.bond(bond, own, other)[0]
    }
}

/// Load of a bond over the mean limit of its ends, with strains that differ by direction.
fn ratio_with_strain<L: BondForce>(
    load: Load<L>,
    inputs: &Inputs,
) -> impl Fn(&Bond, usize, usize) -> f64 + Sync {
    let (kernel, inputs) = (WithStrain(load), inputs.with_strain());
    move |bond: &Bond, own: usize, other: usize| {
        let [own, other] = [own, other].map(|slot| inputs.map(|i| i[slot]));
        kernel.bond(bond, own, other)[0]
    }
}
