//! Inputs of the bond kernels in slot space, and sums of kernels over them.

use std::sync::Arc;

use perimelt_core::family::{ByImage, Continuation, Mirrored, PointValues};
use perimelt_core::{BondKernel, BrokenBonds, Family, Image, SlotField};
use rayon::prelude::*;

use crate::mechanical::classical::{diagonal, eigenstrain_of_image, image_of};
use crate::mechanical::stretch::{
    BondForce, CRITICAL, EIGENSTRAIN, INPUTS, PRESSURE, STIFFNESS, STRAIN_INPUTS, TANGENT_INPUTS,
    Uniform, WithStrain,
};

/// What the kernels of a body need besides displacement, eigenstrain and stiffness.
#[derive(Clone, Copy)]
pub(super) struct Needs {
    /// The pressure from dilatation.
    pub(super) pressure: bool,
    /// The limits of bonds.
    pub(super) limits: bool,
    /// The inelastic strain.
    pub(super) inelastic: bool,
    /// The displacement about which forces are linearised.
    pub(super) tangent: bool,
}

/// Inputs of the bond kernels of a body.
#[derive(Debug)]
pub(super) struct Inputs {
    family: Arc<Family>,
    pub(super) slots: [SlotField; INPUTS],
    /// Components of the eigenstrain that differs by direction, in the plane of a plane body; empty if there is none.
    tensor: [SlotField; 6],
    /// Components of the inelastic strain and that eigenstrain; empty without plasticity.
    inelastic: [SlotField; 6],
    /// The displacement about which forces are linearised; empty where they are linear.
    about: [SlotField; 3],
    /// Takes the place of inputs that the body does not have.
    zeros: SlotField,
    /// Eigenstrain, stiffness and limit where they are the same for all points; the other entries are zero.
    pub(super) uniform: Option<[f64; INPUTS]>,
}

impl Inputs {
    pub(super) fn new(family: Arc<Family>, dimension: usize, needs: Needs) -> Self {
        let needed = |input| match input {
            EIGENSTRAIN | STIFFNESS => true,
            PRESSURE => needs.pressure,
            CRITICAL => needs.limits,
            axis => axis < dimension,
        };
        let zeros = SlotField::zeros(&family);
        let field = |is_needed: bool| match is_needed {
            true => zeros.clone(),
            false => SlotField::default(),
        };
        Inputs {
            slots: std::array::from_fn(|i| field(needed(i))),
            tensor: Default::default(),
            inelastic: std::array::from_fn(|_| field(needs.inelastic)),
            about: std::array::from_fn(|axis| field(needs.tangent && axis < dimension)),
            zeros,
            uniform: None,
            family,
        }
    }

    /// Takes a value of each point; mirrored layers take those of their points.
    pub(super) fn load(&mut self, input: usize, values: impl PointValues) {
        self.slots[input].load(&self.family, values, Mirrored::Scalar);
    }

    /// Takes the eigenstrain that differs by direction; layers continue it by the factors of the displacement.
    pub(super) fn load_tensor(
        &mut self,
        continuation: &Continuation,
        strain: impl Fn(usize) -> [f64; 6] + Sync,
    ) {
        let strain = &strain;
        let of_image = |image: &Image| eigenstrain_of_image(image.scale, &strain(image.point));
        let component = |c: usize| move |point: usize| strain(point)[c];
        let ghosts = ByImage(continuation, of_image);
        SlotField::load_all(&mut self.tensor, &self.family, component, ghosts);
    }

    /// Takes the inelastic strain of each point, to which an eigenstrain that differs by direction is added. Layers continue the
    /// one as they do the strain, the other by the factors of the displacement.
    pub(super) fn load_inelastic(
        &mut self,
        continuation: &Continuation,
        strain: impl Fn(usize) -> [f64; 6] + Sync,
        eigenstrain: Option<impl Fn(usize) -> [f64; 6] + Sync>,
    ) {
        let (strain, eigenstrain) = (&strain, &eigenstrain);
        let sum = |first: [f64; 6], second: [f64; 6]| -> [f64; 6] {
            std::array::from_fn(|c| first[c] + second[c])
        };
        let of_image = |image: &Image| {
            let [scale, mirror] = [image.scale, image.mirror].map(diagonal);
            let inelastic = image_of(&scale, &strain(image.point), &mirror);
            match eigenstrain {
                None => inelastic,
                Some(own) => {
                    let own = eigenstrain_of_image(image.scale, &own(image.point));
                    sum(inelastic, own)
                }
            }
        };
        let component = |c: usize| {
            move |point: usize| {
                let own = eigenstrain.as_ref().map_or(0.0, |own| own(point)[c]);
                strain(point)[c] + own
            }
        };
        let ghosts = ByImage(continuation, of_image);
        SlotField::load_all(&mut self.inelastic, &self.family, component, ghosts);
    }

    /// Whether there is an eigenstrain that differs by direction.
    pub(super) fn has_tensor(&self) -> bool {
        !self.tensor[0].is_empty()
    }

    /// Whether there is a strain that differs by direction: such an eigenstrain, or an inelastic strain.
    pub(super) fn has_strain(&self) -> bool {
        self.has_tensor() || !self.inelastic[0].is_empty()
    }

    /// Whether there is no eigenstrain.
    pub(super) fn is_free_of_eigenstrain(&self) -> bool {
        self.uniform.is_some_and(|point| point[EIGENSTRAIN] == 0.0)
    }

    /// The displacement along each axis.
    pub(super) fn displacement(&self) -> [&[f64]; 3] {
        self.first()
    }

    /// An input; zeros if the body does not have it.
    fn get(&self, i: usize) -> &[f64] {
        match self.slots[i].is_empty() {
            true => &self.zeros,
            false => &self.slots[i],
        }
    }

    /// The first `I` inputs.
    pub(super) fn first<const I: usize>(&self) -> [&[f64]; I] {
        std::array::from_fn(|i| self.get(i))
    }

    /// The inputs of [`WithStrain`] kernels with these strains.
    fn with<'a>(&'a self, strain: &'a [SlotField; 6]) -> [&'a [f64]; STRAIN_INPUTS] {
        std::array::from_fn(|i| match i.checked_sub(INPUTS) {
            Some(component) => &strain[component][..],
            None => self.get(i),
        })
    }

    /// The inputs of [`WithStrain`] kernels, with all strains that differ by direction.
    pub(super) fn with_strain(&self) -> [&[f64]; STRAIN_INPUTS] {
        self.with(match self.inelastic[0].is_empty() {
            true => &self.tensor,
            false => &self.inelastic,
        })
    }

    /// Keeps the displacement for [`Inputs::tangent`].
    pub(super) fn keep_displacement(&mut self) {
        let kept = self.about.iter_mut().zip(&self.slots);
        for (kept, now) in kept.filter(|(kept, _)| !kept.is_empty()) {
            kept.set(now.par_iter().copied());
        }
    }

    /// The inputs of [`Tangent`](crate::mechanical::stretch::Tangent).
    pub(super) fn tangent(&self) -> [&[f64]; TANGENT_INPUTS] {
        std::array::from_fn(|i| match i.checked_sub(INPUTS) {
            Some(axis) if self.about[axis].is_empty() => &self.zeros,
            Some(axis) => &self.about[axis],
            None => self.get(i),
        })
    }

    /// Sums a kernel of the first `I` inputs over unbroken bonds.
    pub(super) fn sum<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        broken: Option<&BrokenBonds>,
        sums: &mut [[f64; O]],
    ) {
        self.family.sum_unbroken(kernel, self.first(), broken, sums);
    }

    /// Sums a kernel of forces of a formulation, loading only those inputs in which points differ.
    pub(super) fn sum_forces<L: BondForce, const O: usize>(
        &self,
        kernel: &impl BondKernel<INPUTS, O>,
        broken: Option<&BrokenBonds>,
        sums: &mut [[f64; O]],
    ) {
        const WITH_PRESSURE: usize = PRESSURE + 1;
        match self.uniform {
            Some(point) if const { L::HAS_PRESSURE } => {
                self.sum::<WITH_PRESSURE, O>(&Uniform(kernel, point), broken, sums);
            }
            Some(point) => self.sum::<PRESSURE, O>(&Uniform(kernel, point), broken, sums),
            None => self.sum(kernel, broken, sums),
        }
    }

    /// Sums a kernel of forces and of the excess of bonds of a formulation into arrays of their own.
    pub(super) fn sum_forces_and_excess<L: BondForce>(
        &self,
        kernel: &impl BondKernel<INPUTS, 4>,
        broken: Option<&BrokenBonds>,
        sums: (&mut [[f64; 3]], &mut [f64]),
    ) {
        const WITH_PRESSURE: usize = PRESSURE + 1;
        let family = &self.family;
        let (vectors, last) = sums;
        match self.uniform {
            Some(point) if const { L::HAS_PRESSURE } => {
                let inputs = self.first::<WITH_PRESSURE>();
                family.sum_apart(&Uniform(kernel, point), inputs, broken, vectors, last);
            }
            Some(point) => {
                let inputs = self.first::<PRESSURE>();
                family.sum_apart(&Uniform(kernel, point), inputs, broken, vectors, last);
            }
            None => family.sum_apart(kernel, self.first(), broken, vectors, last),
        }
    }

    /// Sums a kernel with all strains that differ by direction.
    pub(super) fn sum_with_strain<const O: usize>(
        &self,
        kernel: impl BondKernel<INPUTS, O>,
        broken: Option<&BrokenBonds>,
        sums: &mut [[f64; O]],
    ) {
        let (kernel, inputs) = (WithStrain(kernel), self.with_strain());
        self.family.sum_unbroken(&kernel, inputs, broken, sums);
    }

    /// Sums a kernel with the eigenstrain that differs by direction.
    pub(super) fn sum_with_tensor<const O: usize>(
        &self,
        kernel: impl BondKernel<INPUTS, O>,
        broken: Option<&BrokenBonds>,
        sums: &mut [[f64; O]],
    ) {
        let (kernel, inputs) = (WithStrain(kernel), self.with(&self.tensor));
        self.family.sum_unbroken(&kernel, inputs, broken, sums);
    }

    /// The inputs of [`WithStrain`] kernels for changes of the displacement, without the eigenstrain.
    pub(super) fn with_change(&self) -> [&[f64]; STRAIN_INPUTS] {
        let mut inputs = self.with_strain();
        inputs[EIGENSTRAIN] = &self.zeros;
        inputs
    }
}
