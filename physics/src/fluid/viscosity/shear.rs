//! The shear rate of points, from the velocity around them.
//!
//! The velocity gradient is that of first order, exact for linear velocities on any family:
//! `L = sum w (v_j - v_i) xi^T V_j A^-1`, `A = sum w xi xi^T V_j`. Behind faces the velocity continues as viscous forces take it.
//! Bodies that are walls do not take part: beside them it is that of the points of the fluid.

use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use crate::fluid::rates::POINTS_PER_TASK;
use crate::shape_tensor::{COMPONENTS, components, inverted, is_diagonal};

/// `2 D : D`, 1/s², D the symmetric part of the velocity gradient, from `gradient(a, b)`, the derivative of component a along
/// axis b (Gao (2020), eq. 5.65).
#[inline(always)]
pub(in crate::fluid) fn squared_shear_rate(
    dimension: usize,
    gradient: impl Fn(usize, usize) -> f64,
) -> f64 {
    let mut sum = 0.0;
    for a in 0..dimension {
        sum += 2.0 * gradient(a, a).powi(2);
        sum += (0..a)
            .map(|b| (gradient(a, b) + gradient(b, a)).powi(2))
            .sum::<f64>();
    }
    sum
}

/// `A` and `sum w (v_j - v_i) xi^T`, from the velocity.
struct VelocityGradient<const D: usize>;

impl<const D: usize, const O: usize> BondKernel<D, O> for VelocityGradient<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; D], other: [f64; D]) -> [f64; O] {
        let (mut sums, mut at) = ([0.0; O], 0);
        for &(a, b) in &COMPONENTS[..components(D)] {
            sums[at] = bond.weight * bond.xi[a] * bond.xi[b];
            at += 1;
        }
        for a in 0..D {
            for b in 0..D {
                sums[at] = bond.weight * (other[a] - own[a]) * bond.xi[b];
                at += 1;
            }
        }
        sums
    }
}

const SUMS_2D: usize = components(2) + 4;
const SUMS_3D: usize = components(3) + 9;

/// Shear rates of points, with the sums from which they follow.
#[derive(Debug, Default)]
pub(super) struct ShearRates {
    /// By point, 1/s.
    pub(super) value: Vec<f64>,
    sums: Vec<f64>,
}

impl ShearRates {
    /// For the points of a family, with the components of the velocity by slot.
    pub(super) fn find(&mut self, family: &Family, velocity: &[SlotField], points: usize) {
        self.value.resize(points, 0.0);
        match velocity.len() {
            2 => self.find_in::<2, SUMS_2D>(family, velocity),
            _ => self.find_in::<3, SUMS_3D>(family, velocity),
        }
    }

    fn find_in<const D: usize, const O: usize>(&mut self, family: &Family, velocity: &[SlotField]) {
        self.sums.resize(self.value.len() * O, 0.0);
        let (sums, _) = self.sums.as_chunks_mut::<O>();
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &velocity[a][..]);
        family.sum(&VelocityGradient::<D>, inputs, sums);
        let points = self.value.par_iter_mut().zip(&*sums);
        points
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(value, sums)| *value = shear_rate::<D>(sums));
    }
}

/// The shear rate (1/s) from the sums of [`VelocityGradient`]; zero for a point without neighbours.
fn shear_rate<const D: usize>(sums: &[f64]) -> f64 {
    let (shape, slopes) = sums.split_at(components(D));
    let trace: f64 = (0..components(D))
        .filter(|n| is_diagonal(*n))
        .map(|n| shape[n])
        .sum();
    if trace == 0.0 {
        return 0.0;
    }
    let (inverse, _) = inverted::<D>(shape, trace / D as f64);
    let gradient = |a: usize, b: usize| {
        (0..D)
            .map(|c| slopes[a * D + c] * inverse[(c, b)])
            .sum::<f64>()
    };
    squared_shear_rate(D, gradient).sqrt()
}
