//! Force states of the points, forces of the bonds, and the excess of bonds over their critical stretch.

use nalgebra::Matrix3;
use perimelt_core::family::ByImage;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, Image, SlotField};
use rayon::prelude::*;

use super::Correspondence;
use super::kernels::{DISPLACEMENT, Force};
use crate::mechanical::base::{Bonds, SolidBase, flat, unflatten};
use crate::mechanical::classical::{
    Point, diagonal, eigenstrain_of_image, image_of, signs_of_image,
};
use crate::mechanical::fracture::Fracture;
use crate::mechanical::gradient::without;
use crate::mechanical::layer_forces::Summed;
use crate::mechanical::points::{At, LawPoints};
use crate::mechanical::solid::StrainKind;
use crate::mechanical::specialise::specialise;
use crate::mechanical::stretch::{EXCESS_INPUTS, Excess};

/// A point or its image with its displacement gradient.
struct Strained<'a> {
    /// The point whose springs it has.
    point: usize,
    /// Signs of the axes of an image; ones for a point.
    mirror: [f64; 3],
    /// Signs of the axes of its material.
    signs: [f64; 3],
    gradient: &'a Matrix3<f64>,
    /// The gradient about which a law of points is linearised, for changes; empty otherwise.
    about: Option<Matrix3<f64>>,
    /// What prescribed strains do to the gradient; `None` where they are uniform.
    correction: Option<Matrix3<f64>>,
    /// `K^-1`.
    inverse: &'a Matrix3<f64>,
}

impl Correspondence {
    /// Evaluates H of the displacement that was set.
    pub(super) fn load_gradient(&mut self) {
        let axes = std::array::from_fn(|axis| self.inputs.along(axis));
        let family = &self.base.family;
        if self.gradient.evaluate(family, axes, self.base.broken()) {
            self.load_stabilisation();
        }
        let (bonds, elastic) = (self.base.bonds(), &self.base.elastic);
        let continuation = &self.base.continuation;
        let changed = self.gradient.follow_strains(bonds, continuation, elastic);
        if changed && !elastic.finite {
            let stiffness = &self.inputs.stabilisation[..];
            let stress_free = &self.gradient.stress_free;
            stress_free.spring_forces(bonds, stiffness, &mut self.spring_forces);
        }
    }

    pub(super) fn has_spring_forces(&self) -> bool {
        !self.spring_forces.is_empty()
    }

    /// Adds what prescribed strains that are not uniform give the springs against modes without strain. In finite kinematics
    /// springs turn with the body, and keep these.
    pub(super) fn add_spring_forces(&self, out: &mut [f64]) {
        let (forces, _) = out.as_chunks_mut::<3>();
        let points = forces.par_iter_mut().zip(&self.spring_forces);
        points.with_min_len(4096).for_all(|(force, springs)| {
            (0..self.base.dimension).for_each(|axis| force[axis] += springs[axis]);
        });
    }

    /// `P K^-1 - g H` of a point or its image with a linear law.
    fn force_state_of(&self, strained: &Strained<'_>, law: &Point, finite: bool) -> Matrix3<f64> {
        let elastic = without(strained.gradient, strained.correction.as_ref(), finite);
        self.force_state_with(strained, law.piola(&elastic, finite), elastic, finite)
    }

    /// `P K^-1 - g H` of a stress.
    fn force_state_with(
        &self,
        strained: &Strained<'_>,
        stress: Matrix3<f64>,
        elastic: Matrix3<f64>,
        finite: bool,
    ) -> Matrix3<f64> {
        let Strained {
            point,
            gradient,
            correction,
            inverse,
            ..
        } = strained;
        match correction {
            // the stress conjugate to F, where F (1 - D) has an energy
            Some(correction) if finite => {
                (stress - stress * correction.transpose()) * *inverse
                    - self.spring(*point) * *gradient
            }
            _ => stress * *inverse - self.spring(*point) * elastic,
        }
    }

    /// `P K^-1 - g H` of a point or its image with a law of points, or its change.
    fn force_state_by(&self, points: &LawPoints, strained: &Strained<'_>) -> Matrix3<f64> {
        let (base, finite) = (&self.base, self.base.elastic.finite);
        let correction = strained.correction.as_ref();
        let at = |gradient| At {
            point: strained.point,
            mirror: strained.mirror,
            signs: strained.signs,
            gradient,
        };
        let Some(about) = &strained.about else {
            let elastic = without(strained.gradient, correction, finite);
            let stress = points.piola(&base.elastic, at(&elastic));
            return self.force_state_with(strained, stress, elastic, finite);
        };
        let change = match correction {
            Some(correction) if finite => strained.gradient - strained.gradient * correction,
            _ => *strained.gradient,
        };
        let about = without(about, correction, finite);
        let stress = points.tangent(&base.elastic, at(&about), &change);
        self.force_state_with(strained, stress, change, finite)
    }

    /// Inelastic strain of an image. Its eigenstrain continues otherwise than the rest where the image is not symmetric.
    fn inelastic_of_image(
        &self,
        image: &Image,
        inelastic: &[f64; 6],
        strain: StrainKind,
    ) -> [f64; 6] {
        let (scale, mirror) = (diagonal(image.scale), diagonal(image.mirror));
        let eigenstrain = self.base.elastic.prescribed.get(image.point);
        match eigenstrain.filter(|_| strain == StrainKind::Elastic && !image.is_symmetric()) {
            None => image_of(&scale, inelastic, &mirror),
            Some(own) => {
                let rest = std::array::from_fn(|c| inelastic[c] - own[c]);
                let rest = image_of(&scale, &rest, &mirror);
                let own = eigenstrain_of_image(image.scale, own);
                std::array::from_fn(|c| rest[c] + own[c])
            }
        }
    }

    /// Evaluates the stress and loads the force states.
    pub(super) fn load_force_state(&mut self, strain: StrainKind, finite: bool) {
        let dimension = self.base.dimension;
        // by rows; only those in the dimensions of the body are loaded
        let entry = |n: usize| (n / dimension % 3, n % dimension);
        let mut states = std::mem::take(&mut self.force_state);
        let mut slots = std::mem::take(&mut self.inputs.force_state);
        let (values, inverse) = (&self.gradient.values, &self.gradient.inverse_shape);
        // the elastic stiffness is that of the linear law
        let law = |i: usize| match strain {
            StrainKind::Total => None,
            StrainKind::Elastic | StrainKind::Change => self.base.law_points_of(&self.gradient, i),
        };
        let correction = |i: usize| match strain {
            StrainKind::Elastic => self.gradient.stress_free.of(i),
            StrainKind::Change if law(i).is_some() => self.gradient.stress_free.of(i),
            StrainKind::Total | StrainKind::Change => None,
        };
        let about = |i: usize| match strain {
            StrainKind::Change => law(i).map(|points| points.about[i]),
            StrainKind::Elastic | StrainKind::Total => None,
        };
        states.par_iter_mut().enumerate().for_all(|(i, state)| {
            let strained = Strained {
                point: i,
                mirror: [1.0; 3],
                signs: [1.0; 3],
                gradient: &values[i],
                about: about(i),
                correction: correction(i).copied(),
                inverse: &inverse[i],
            };
            *state = match law(i) {
                Some(points) => self.force_state_by(points, &strained),
                None => self.force_state_of(&strained, &self.point(i, strain), finite),
            };
        });
        let of_image = |image: &Image| {
            let (scale, mirror) = (diagonal(image.scale), diagonal(image.mirror));
            // a state that gives way to other forces keeps the stress of no strain where the layer is constant
            let gradient = match self.base.layer_forces.replace(image) {
                true => Matrix3::zeros(),
                false => scale * values[image.point] * mirror + image.bend,
            };
            let inverse = mirror * inverse[image.point] * mirror;
            let correction = correction(image.point).map(|c| scale * c * mirror);
            let strained = Strained {
                point: image.point,
                mirror: image.mirror,
                signs: signs_of_image(image.scale),
                gradient: &gradient,
                about: about(image.point).map(|about| scale * about * mirror),
                correction,
                inverse: &inverse,
            };
            if let Some(points) = law(image.point) {
                let state = self.force_state_by(points, &strained);
                return std::array::from_fn(|n| state[entry(n)]);
            }
            let mut point = self.point(image.point, strain);
            if self.base.plasticity.is_some() || !self.base.elastic.stress_free.is_empty() {
                let inelastic = self.inelastic_of_image(image, &point.inelastic, strain);
                point = point.replace_inelastic(self.base.elastic.stress_state(), inelastic);
            }
            let state = self.force_state_of(&strained, &point, finite);
            std::array::from_fn::<_, 9, _>(|n| state[entry(n)])
        };
        let by_point = &states[..];
        let component = |n: usize| {
            let at = entry(n);
            move |point: usize| by_point[point][at]
        };
        let ghosts = ByImage(&self.base.continuation, of_image);
        SlotField::load_all(&mut slots, &self.base.family, component, ghosts);
        (self.force_state, self.inputs.force_state) = (states, slots);
    }

    pub(super) fn sum_forces(&mut self, out: &mut [f64]) {
        match self.base.dimension {
            2 => self.sum_forces_in::<2>(out),
            _ => self.sum_forces_in::<3>(out),
        }
    }

    fn sum_forces_in<const D: usize>(&mut self, out: &mut [f64]) {
        let inputs = self.inputs.of_forces();
        let broken = self.base.fracture.as_ref().map(Fracture::broken);
        let sums = flat::<D>(&mut self.base.padded, bytemuck::cast_slice_mut(out));
        self.base.family.sum_unbroken(&Force, inputs, broken, sums);
        unflatten::<D>(&self.base.padded, out);
        let summed = Summed {
            kernel: &Force,
            displacement: DISPLACEMENT,
            inputs,
        };
        let SolidBase {
            family,
            fracture,
            continuation,
            layer_forces,
            ..
        } = &mut self.base;
        let bonds = Bonds::unbroken(family, fracture.as_ref());
        layer_forces.complete::<_, D>(summed, bonds, continuation, out);
    }

    /// Sums the excess of bonds over their critical stretch.
    pub(super) fn sum_excess(&mut self) {
        let Some(fracture) = &mut self.base.fracture else {
            return;
        };
        let inputs = self.inputs.of_excess();
        let (finite, broken) = (self.base.elastic.finite, Some(&fracture.state.broken[0]));
        let (family, sums) = (
            &self.base.family,
            bytemuck::cast_slice_mut(&mut fracture.excess),
        );
        specialise!(FINITE = finite =>
            family.sum_unbroken(&Excess::<FINITE>, inputs, broken, sums));
        fracture.add_excess_of_crossings(family, stretch_ratio(finite, inputs));
    }
}

/// Stretch of a bond over the mean critical one of its ends, from the slots of both.
pub(super) fn stretch_ratio(
    finite: bool,
    inputs: [&[f64]; EXCESS_INPUTS],
) -> impl Fn(&Bond, usize, usize) -> f64 + Sync {
    move |bond: &Bond, own: usize, other: usize| {
        let [own, other] = [own, other].map(|slot| inputs.map(|i| i[slot]));
        let (stretch, limit) = specialise!(FINITE = finite =>
            Excess::<FINITE>::stretch_and_limit(bond, own, other));
        stretch / limit
    }
}
