//! Decay of the short waves of the velocity, by sums over bonds; the same in all directions, as
//! [`crate::fluid::eulerian::carried_flow`] has it.

use perimelt_core::family::{ByRules, LayerRule};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Family, SlotField};
use rayon::prelude::*;

use super::FlowNow;
use crate::advection::{Convection, Laplacian};
use crate::fluid::rates::POINTS_PER_TASK;
use crate::shape_tensor::CompleteFamily;

/// Points of a lattice over whose bonds a flow is summed.
#[derive(Clone, Copy)]
pub(in crate::fluid::eulerian) struct FlowBonds<'a> {
    pub(in crate::fluid::eulerian) family: &'a Family,
    pub(in crate::fluid::eulerian) complete: &'a CompleteFamily,
    /// Slot of each point.
    pub(in crate::fluid::eulerian) slot: &'a [u32],
}

/// The decay with its work arrays.
#[derive(Debug)]
pub(in crate::fluid::eulerian) struct DecayingWaves {
    convection: Convection,
    /// By point, kg m/s: diffusivity that short waves lack, times density over the sum of the weights of the Laplacian.
    missing: Vec<f64>,
    /// Rows of points, one for each component, and the same by slot: momentum of the short waves.
    rows: Vec<f64>,
    slots: Vec<SlotField>,
    rules: Vec<LayerRule>,
    /// Rows of points: decay, N/m³; empty where nothing decays.
    decay: Vec<f64>,
}

impl DecayingWaves {
    pub(in crate::fluid::eulerian) fn new(convection: Convection, dimension: usize) -> Self {
        DecayingWaves {
            convection,
            missing: Vec::new(),
            rows: Vec::new(),
            slots: vec![SlotField::default(); dimension],
            rules: Vec::new(),
            decay: Vec::new(),
        }
    }

    /// Rate at which the momentum of short waves along an axis decays at a point, N/m³.
    pub(in crate::fluid::eulerian) fn rate(&self, point: usize, axis: usize) -> f64 {
        let place = point * self.slots.len() + axis;
        self.decay.get(place).copied().unwrap_or(0.0)
    }

    /// Finds the decay; `viscosity` is that of each point, Pa s.
    pub(in crate::fluid::eulerian) fn find<const D: usize>(
        &mut self,
        bonds: FlowBonds<'_>,
        flow: &FlowNow<'_>,
        viscosity: &[f64],
    ) {
        let FlowNow {
            terms,
            velocity,
            density,
        } = *flow;
        let FlowBonds {
            family,
            complete,
            slot,
        } = bonds;
        self.decay.clear();
        let (convection, medium) = (self.convection, terms.medium);
        let laplacian = 2.0 / complete.moment;
        let sum = laplacian * complete.content;
        let missing = |i: usize| {
            let slot = slot[i] as usize;
            let square: f64 = velocity.iter().map(|v| v[slot] * v[slot]).sum();
            let diffusivity = viscosity[i] / density[i];
            let (speed, spacing) = (square.sqrt(), medium.spacing[i]);
            density[i] * convection.missing_diffusivity(speed, spacing, sum, diffusivity) / sum
        };
        let points = (0..slot.len()).into_par_iter();
        let points = points.with_min_len(POINTS_PER_TASK).map(missing);
        points.fill(&mut self.missing);
        if self.missing.iter().all(|m| *m == 0.0) {
            return;
        }
        let kernel = Laplacian { laplacian };
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &velocity[a][..]);
        self.rows.resize(slot.len() * D, 0.0);
        let (sums, _) = self.rows.as_chunks_mut::<D>();
        family.sum(&kernel, inputs, sums);
        self.rules.clear();
        self.rules
            .extend(terms.rules.iter().map(LayerRule::homogeneous));
        for (axis, slots) in self.slots.iter_mut().enumerate() {
            let along = |point: usize| -self.missing[point] * sums[point][axis];
            slots.load(family, along, ByRules(&self.rules, axis));
        }
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &self.slots[a][..]);
        self.decay.resize(slot.len() * D, 0.0);
        let (sums, _) = self.decay.as_chunks_mut::<D>();
        family.sum(&kernel, inputs, sums);
    }
}
