//! What the solvers ask of a laminate.

use nalgebra::Matrix3;
use perimelt_core::Body;
use perimelt_core::body::Sizes;
use perimelt_core::family::{AxisPlane, LayerRule, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::Laminate;
use super::failure::Failure;
use super::force::{Strained, broken_in};
use super::kernels::{PlaneGradient, STRAIN};
use crate::mechanical::base::SolidBase;
use crate::mechanical::deformation::Deformation;
use crate::mechanical::fracture::{FractureState, NewBreaks};
use crate::mechanical::solid::{
    EnergyKind, Evaluated, FailureMode, PointModuli, PointStates, Solid, Stiffness, StressKind,
    Wanted,
};

impl Laminate {
    pub(super) fn strained(&self) -> Strained {
        Strained {
            finite: self.base.is_finite(),
            elastic: true,
        }
    }

    /// Evaluates constants and limits at the temperature of each point, K.
    fn set_temperature(&mut self, body: &Body, temperature: Option<&[f64]>) {
        let rise = self.plies.set(body, temperature);
        if let Some(rise) = rise {
            self.base.elastic.note_stiffening(rise);
            self.load_constants();
        }
        let varies = |failure: &Failure| !failure.limits.has_constant_strength();
        if rise.is_some() || self.failure.as_ref().is_some_and(varies) {
            self.load_limits(body, temperature);
        }
    }

    /// Loads the stress-free strain of all layers.
    fn load_strain(&mut self) {
        let points = self.points_of_layer();
        let elastic = &self.base.elastic;
        self.strain.resize(self.displacement.len(), [0.0; 6]);
        let strains = self.strain.par_iter_mut().enumerate();
        strains.for_all(|(point, strain)| {
            *strain = elastic.prescribed.get(point).copied().unwrap_or_default();
            let isotropic = elastic.eigenstrain[point];
            strain[..3].iter_mut().for_each(|e| *e += isotropic);
        });
        for (layer, strain) in self.layers.iter_mut().zip(self.strain.chunks(points)) {
            for (input, component) in (STRAIN..).zip([0, 1, 3]) {
                let values = |point: usize| strain[point][component];
                layer.slots[input].load(&self.plane, values, Mirrored::Scalar);
            }
        }
    }

    fn load_gradients(&mut self) {
        let points = self.points_of_layer();
        for (number, layer) in self.layers.iter().enumerate() {
            let inputs = layer.inputs(true, &self.zeros);
            let broken = broken_in(self.failure.as_ref(), number).map(|[matrix, _]| matrix);
            let sums = &mut self.work.pairs;
            self.plane
                .sum_unbroken(&PlaneGradient, inputs, broken, sums);
            let gradients = self.gradients[number * points..].iter_mut();
            for (gradient, sums) in gradients.zip(&self.work.pairs) {
                *gradient = Matrix3::zeros();
                (0..6).for_each(|c| gradient[(c % 3, c / 3)] = sums[c]);
            }
        }
    }
}

impl Solid for Laminate {
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
            "set-up refuses births of points in layers"
        );
        if let Some(moduli) = moduli {
            self.base.set_moduli(moduli);
        }
        // the bound of the frequency is one of all states
        if let Some(PointModuli::At(body, temperature)) = moduli {
            self.set_temperature(body, temperature);
        }
        let changed = eigenstrain.is_some_and(|e| self.base.elastic.set_eigenstrain(e));
        let turned = stress_free.is_some_and(|e| self.base.elastic.set_stress_free(e));
        if changed || turned {
            self.load_strain();
        }
    }

    fn set_displacement(&mut self, displacement: &[f64], _rules: &[LayerRule]) {
        let (nodes, _) = displacement.as_chunks::<3>();
        let points = self.points_of_layer();
        for (layer, nodes) in self.layers.iter_mut().zip(nodes.chunks(points)) {
            for (axis, slots) in layer.slots[..3].iter_mut().enumerate() {
                let values = |point: usize| nodes[point][axis];
                slots.load(&self.plane, values, Mirrored::Scalar);
            }
        }
        let nodes = nodes.par_iter().copied().with_min_len(4096);
        nodes.fill(&mut self.displacement);
    }

    fn deformation(&mut self) -> Deformation<'_> {
        self.load_gradients();
        Deformation::Gradients(&self.base, &self.gradients)
    }

    fn evaluate(&mut self, wanted: Wanted<'_>) -> Evaluated<'_> {
        let Wanted {
            force,
            stress,
            energy,
            gradient,
        } = wanted;
        let strained = self.strained();
        if let Some(out) = force {
            self.sum_forces(strained, out);
        }
        match energy {
            Some(EnergyKind::Elastic) => self.sum_energy(strained),
            Some(EnergyKind::Total) => {
                self.sum_energy(Strained {
                    elastic: false,
                    ..strained
                });
                self.sum_conjugate_stress(strained.finite);
                let SolidBase {
                    energy, tensors, ..
                } = &mut self.base;
                for ([_, conjugate], [xx, yy, zz, ..]) in energy.iter_mut().zip(tensors) {
                    *conjugate = *xx + *yy + *zz;
                }
            }
            None => {}
        }
        match stress {
            Some(StressKind::Spatial) => self.sum_stress(strained),
            Some(StressKind::Conjugate) => self.sum_conjugate_stress(strained.finite),
            Some(StressKind::Material) | None => {}
        }
        if gradient {
            self.load_gradients();
        }
        Evaluated {
            stress: self.base.stress_of(stress),
            energy: self.base.energy_of(energy),
            gradient: if gradient { &self.gradients } else { &[] },
            smoothing: &[],
        }
    }

    fn linearise(&mut self, _damping: f64) {}

    /// The law is linear: both kinds are the same.
    fn stiffness(&mut self, _kind: Stiffness, out: &mut [f64]) {
        let strained = Strained {
            finite: false,
            elastic: false,
        };
        self.sum_forces(strained, out);
        out.iter_mut().for_each(|force| *force = -*force);
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        if self.blocks.is_empty() {
            self.load_blocks();
        }
        &self.blocks
    }

    fn largest_frequency(&mut self, density: &[f64], _rules: &[LayerRule]) -> f64 {
        self.largest_square(density).sqrt()
    }

    fn set_largest_step(&mut self, step: f64) {
        self.added_inertia.set_step(step);
    }

    fn added_kinetic_energy(&self, velocity: &[f64], volume: &Sizes) -> f64 {
        self.added_inertia.kinetic_energy(velocity, volume)
    }

    fn subtract_added_inertia(&mut self, inverse_density: &[f64], force: &mut [f64]) {
        self.added_inertia.subtract(inverse_density, force);
    }

    fn fracture_state(&self) -> Option<&FractureState> {
        self.failure.as_ref().map(|failure| &failure.state)
    }

    fn broken_pairs(&self) -> Vec<[u32; 2]> {
        let pairs = self.failure.as_ref().map(|f| f.broken_pairs(&self.plane));
        pairs.unwrap_or_default()
    }

    fn has_lost_bonds(&self, point: usize) -> bool {
        self.failure.as_ref().is_some_and(|f| f.has_damage(point))
    }

    fn failure_modes(&self) -> Vec<FailureMode<'_>> {
        self.failure
            .as_ref()
            .map(Failure::modes)
            .unwrap_or_default()
    }

    fn replace_fracture_state(&mut self, state: FractureState) -> Option<FractureState> {
        let failure = self.failure.as_mut()?;
        self.blocks.clear();
        Some(failure.replace(&self.plane, state))
    }

    fn break_bonds(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks {
        self.break_exceeding(fraction, damage)
    }

    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.sum_across(self.strained(), plane, receive);
    }
}
