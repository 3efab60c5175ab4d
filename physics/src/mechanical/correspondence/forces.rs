//! Force states of the points, forces of the bonds, and the excess of bonds over their critical stretch.

use nalgebra::Matrix3;
use perimelt_core::family::ByImage;
use perimelt_core::{BrokenBonds, Image, SlotField};
use rayon::prelude::*;

use super::Correspondence;
use super::kernels::{DISPLACEMENT, Force};
use crate::mechanical::classical::{Point, diagonal, image_of};
use crate::mechanical::fracture::Fracture;
use crate::mechanical::solid::{StrainKind, flat, unflatten};
use crate::mechanical::specialise::specialise;
use crate::mechanical::stretch::Excess;

impl Correspondence {
    pub(super) fn broken(&self) -> Option<&BrokenBonds> {
        self.fracture.as_ref().map(Fracture::broken)
    }

    /// Evaluates H of the displacement that was set.
    pub(super) fn load_gradient(&mut self) {
        let axes = std::array::from_fn(|axis| self.inputs.along(axis));
        let broken = self.fracture.as_ref().map(Fracture::broken);
        if self.gradient.evaluate(&self.family, axes, broken) {
            self.load_stabilisation();
        }
    }

    /// `P K^-1 - g H` of a point with the law `point`, whose g is that of the point number `i`.
    fn force_state_of(
        &self,
        (i, point): (usize, Point),
        finite: bool,
        gradient: &Matrix3<f64>,
        inverse: &Matrix3<f64>,
    ) -> Matrix3<f64> {
        point.piola(gradient, finite) * inverse - self.spring(i) * gradient
    }

    /// Evaluates the stress and loads the force states.
    pub(super) fn load_force_state(&mut self, strain: StrainKind, finite: bool) {
        let dimension = self.dimension;
        // by rows; only those in the dimensions of the body are loaded
        let entry = |n: usize| (n / dimension % 3, n % dimension);
        let mut states = std::mem::take(&mut self.force_state);
        let mut slots = std::mem::take(&mut self.inputs.force_state);
        let (values, inverse) = (&self.gradient.values, &self.gradient.inverse_shape);
        states.par_iter_mut().enumerate().for_each(|(i, state)| {
            let point = self.point(i, strain);
            *state = self.force_state_of((i, point), finite, &values[i], &inverse[i]);
        });
        let of_image = |image: &Image| {
            let (scale, mirror) = (diagonal(image.scale), diagonal(image.mirror));
            // a state that gives way to other forces keeps the stress of no strain where the layer is constant
            let gradient = match self.layer_forces.replace(image) {
                true => Matrix3::zeros(),
                false => scale * values[image.point] * mirror + image.bend,
            };
            let inverse = mirror * inverse[image.point] * mirror;
            let mut point = self.point(image.point, strain);
            if self.plasticity.is_some() || !self.elastic.stress_free.is_empty() {
                let inelastic = image_of(&scale, &point.inelastic, &mirror);
                point = point.replace_inelastic(self.elastic.stress_state(), inelastic);
            }
            let state = self.force_state_of((image.point, point), finite, &gradient, &inverse);
            std::array::from_fn::<_, 9, _>(|n| state[entry(n)])
        };
        let by_point = &states[..];
        let component = |n: usize| {
            let at = entry(n);
            move |point: usize| by_point[point][at]
        };
        let ghosts = ByImage(&self.continuation, of_image);
        SlotField::load_all(&mut slots, &self.family, component, ghosts);
        (self.force_state, self.inputs.force_state) = (states, slots);
    }

    pub(super) fn sum_forces(&mut self, out: &mut [f64]) {
        match self.dimension {
            2 => self.sum_forces_in::<2>(out),
            _ => self.sum_forces_in::<3>(out),
        }
    }

    fn sum_forces_in<const D: usize>(&mut self, out: &mut [f64]) {
        let inputs = self.inputs.of_forces();
        let broken = self.fracture.as_ref().map(Fracture::broken);
        let sums = flat::<D>(&mut self.padded, bytemuck::cast_slice_mut(out));
        self.family.sum_unbroken(&Force, inputs, broken, sums);
        unflatten::<D>(&self.padded, out);
        let continued = (&*self.family, &self.continuation);
        let layers = &mut self.layer_forces;
        layers.complete::<_, D>((&Force, DISPLACEMENT), continued, (inputs, broken), out);
    }

    /// Sums the excess of bonds over their critical stretch.
    pub(super) fn sum_excess(&mut self) {
        let Some(fracture) = &mut self.fracture else {
            return;
        };
        let inputs = self.inputs.of_excess();
        let (finite, broken) = (self.elastic.finite, Some(&fracture.state.broken));
        let (family, sums) = (&self.family, bytemuck::cast_slice_mut(&mut fracture.excess));
        specialise!(FINITE = finite =>
            family.sum_unbroken(&Excess::<FINITE>, inputs, broken, sums));
    }
}
