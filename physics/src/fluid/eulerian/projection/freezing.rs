//! The first of two fluids where it has frozen, such as the metal of a plate below its melt.
//!
//! A point is frozen where the first fluid has the larger part of its volume and less than half of it is liquid: `c > 1/2`, `f(T) < 1/2`. Its bonds
//! carry neither volume nor momentum nor heat by the flow, so that it keeps its fraction; the divergence of its neighbours lacks these
//! bonds, and so does the gradient of their pressure, which is the exact adjoint. The fluid beside it sticks half way to it. What
//! flows with solid in it flows as a slurry, with the heat of both.
//!
//! Tension and pressure of an interface act where the first fluid is liquid: they are multiplied by the liquid part of the first fluid
//! among the neighbours,
//!
//! ```text
//! sum_j w c_j o_j / sum_j w c_j,    o = 1 where points are open, 0 where they are frozen
//! ```
//!
//! since the gas beside steps of a frozen surface would be driven by them. See docs/theory/fluids.md, "Metal and gas".

use perimelt_core::family::Mirrored;
use perimelt_core::material::LatentHeat;
use perimelt_core::{Bond, BondKernel, SlotField};
use rayon::prelude::*;

use super::Projection;
use crate::fluid::rates::POINTS_PER_TASK;

/// Sums over the bonds below which there is none of the first fluid, over that of a complete family.
const NONE: f64 = 1e-9;

/// `sum_j w c_j o_j` and `sum_j w c_j`, from the fraction and whether points are open.
struct LiquidPart;

impl BondKernel<2, 2> for LiquidPart {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 2], [fraction, open]: [f64; 2]) -> [f64; 2] {
        let part = bond.weight * fraction;
        [part * open, part]
    }
}

/// Freezing of the first of two fluids.
#[derive(Debug)]
pub(super) struct Freezing {
    /// Temperature at which half of it is liquid, K.
    temperature: f64,
    /// Liquid part of the first fluid around each point, 0 to 1.
    pub(super) liquid_part: Vec<[f64; 1]>,
    /// By slot, kg/m³; infinite where points are frozen.
    pub(super) inertia: SlotField,
    sums: Vec<[f64; 2]>,
}

impl Freezing {
    /// Freezing of a fluid that melts in a range of temperatures.
    pub(super) fn new(melting: &LatentHeat, points: usize) -> Self {
        Freezing {
            temperature: 0.5 * (melting.solidus + melting.liquidus),
            liquid_part: vec![[1.0]; points],
            inertia: SlotField::default(),
            sums: vec![[0.0; 2]; points],
        }
    }
}

impl Projection {
    /// Finds which points are frozen, from their fraction now and their temperature at the start of the step.
    pub(super) fn find_frozen(&mut self) {
        let (Some(freezing), Some(phase), Some(heat)) = (&self.freezing, &self.phase, &self.heat)
        else {
            return;
        };
        let points = phase.fraction.par_iter().zip(heat.temperature());
        let points = points.with_min_len(POINTS_PER_TASK);
        let is_frozen = |(c, t): (&f64, &f64)| *c > 0.5 && *t < freezing.temperature;
        let frozen = points.map(is_frozen);
        frozen.collect_into_vec(&mut self.state.frozen);
    }

    /// Copies which points are frozen to slots, with the densities of the others (kg/m³), and finds the liquid part around each point.
    pub(super) fn load_frozen(&mut self, density: &[f64]) {
        let Some(freezing) = &mut self.freezing else {
            return;
        };
        let (family, frozen) = (&*self.family, &self.state.frozen);
        let open = |i: usize| f64::from(u8::from(!frozen[i]));
        self.slots.open.load(family, open, Mirrored::Scalar);
        let inertia = |i: usize| match frozen[i] {
            true => f64::INFINITY,
            false => density[i],
        };
        freezing.inertia.load(family, inertia, Mirrored::Scalar);
        let inputs: [&[f64]; 2] = [&self.slots.fraction, &self.slots.open];
        family.sum(&LiquidPart, inputs, &mut freezing.sums);
        let least = NONE * self.complete.content;
        let points = freezing.liquid_part.par_iter_mut().zip(&freezing.sums);
        points
            .with_min_len(POINTS_PER_TASK)
            .for_each(|([part], [liquid, all])| {
                *part = match *all > least {
                    true => (liquid / all).clamp(0.0, 1.0),
                    false => 0.0,
                };
            });
    }
}
