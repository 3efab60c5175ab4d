//! Viscous stress of the layer between two fluids, which is a laminate of both.
//!
//! Shear along the interface deforms the fluids in series, elongation deforms them side by side:
//!
//! ```text
//! 1/mu_s = c/mu_1 + (1 - c)/mu_2,   mu_p = c mu_1 + (1 - c) mu_2
//! stress = 2 mu_s D + E,   E = 2 (mu_p - mu_s) (D - n g^T - g n^T),   g = (I - n n^T) D n
//! F_i    = sum_j b (E_i + E_j) . xi
//! ```
//!
//! with the strain rate D and the normal n. The part of `mu_s` is computed along bonds
//! ([`JumpingViscosity`](super::kernels::JumpingViscosity)). Without E the layer resists elongation too little, by
//! `eps |mu_1 - mu_2| |ln(mu_1/mu_2)|` per length: an error of the first order of its width eps. `mu_p` over the density of the mixture is at
//! most the larger kinematic viscosity of both fluids, so that E does not limit the step.

use perimelt_core::family::Mirrored;
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use super::Projection;
use super::kernels::JumpSums;
use crate::fluid::rates::POINTS_PER_TASK;
use crate::shape_tensor::{COMPONENTS, CompleteFamily, components};

/// Families with less than this part of the content of a complete one lack neighbours.
const COMPLETE: f64 = 1.0 - 1e-9;

/// `sum_j b (E_i + E_j) . xi`, from the components of E.
struct Divergence {
    /// `1 / a`, 1/m.
    inverse: f64,
}

impl<const D: usize, const C: usize> BondKernel<C, D> for Divergence {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; C], other: [f64; C]) -> [f64; D] {
        let weight = bond.weight * self.inverse;
        let mut sums = [0.0; D];
        for (n, &(a, b)) in COMPONENTS[..C].iter().enumerate() {
            let stress = weight * (own[n] + other[n]);
            sums[a] += stress * bond.xi[b];
            if a != b {
                sums[b] += stress * bond.xi[a];
            }
        }
        sums
    }
}

/// `D - n g^T - g n^T` for a symmetric strain rate D: what deforms the layers side by side.
fn side_by_side<const D: usize>(rate: [[f64; D]; D], normal: [f64; D]) -> [[f64; D]; D] {
    let pull: [f64; D] = std::array::from_fn(|a| (0..D).map(|b| rate[a][b] * normal[b]).sum());
    let across: f64 = (0..D).map(|a| pull[a] * normal[a]).sum();
    let along: [f64; D] = std::array::from_fn(|a| pull[a] - across * normal[a]);
    std::array::from_fn(|a| {
        std::array::from_fn(|b| rate[a][b] - normal[a] * along[b] - along[a] * normal[b])
    })
}

/// The stress E of the points.
#[derive(Debug)]
pub(super) struct Laminate {
    /// Whether a point has no neighbour that is a body: no stress passes to walls that are bodies.
    is_complete: Vec<bool>,
    /// Components by point, and by slot, Pa.
    stress: Vec<f64>,
    slots: Vec<SlotField>,
    /// Rows of points, N/m³.
    force: Vec<f64>,
}

impl Laminate {
    pub(super) fn new(family: &Family, complete: &CompleteFamily, dimension: usize) -> Self {
        let is_complete = (0..family.points()).map(|point| {
            let mut content = 0.0;
            family.for_each_bond(point, |_, bond, _| content += bond.weight);
            content > COMPLETE * complete.content
        });
        let is_complete: Vec<bool> = is_complete.collect();
        let points = is_complete.len();
        Laminate {
            is_complete,
            stress: vec![0.0; points * components(dimension)],
            slots: vec![SlotField::default(); components(dimension)],
            force: vec![0.0; points * dimension],
        }
    }

    /// Finds the force of the stress at the points.
    fn find_force<const D: usize, const C: usize>(
        &mut self,
        family: &Family,
        inverse: f64,
        stress_at: impl Fn(usize) -> [f64; C] + Sync,
    ) {
        let (stress, _) = self.stress.as_chunks_mut::<C>();
        let points = stress.par_iter_mut().zip(&self.is_complete).enumerate();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_each(|(i, (stress, is_complete))| {
            *stress = match is_complete {
                true => stress_at(i),
                false => [0.0; C],
            };
        });
        let stress = &*stress;
        let fields = self.slots.iter_mut().zip(COMPONENTS).enumerate();
        for (n, (slots, (a, b))) in fields {
            slots.load(family, |i: usize| stress[i][n], Mirrored::Tensor(a, b));
        }
        let inputs: [&[f64]; C] = std::array::from_fn(|n| &self.slots[n][..]);
        let (force, _) = self.force.as_chunks_mut::<D>();
        family.sum(&Divergence { inverse }, inputs, force);
    }
}

impl Projection {
    /// Adds force and work of the stress E to those of viscosities in series, from the gradients of the velocity that these found.
    pub(super) fn add_laminate<const D: usize, const C: usize>(&mut self) {
        let Some(mut laminate) = self.laminate.take() else {
            return;
        };
        if let Some(phase) = &self.phase {
            let columns = JumpSums::<D>::COUNT;
            let (jumps, slot, frozen) = (&self.jumps, &self.slot, &self.state.frozen);
            let rate = |i: usize| -> [[f64; D]; D] {
                let row = &jumps[i * columns + JumpSums::<D>::SLOPES..][..D * D];
                std::array::from_fn(|a| {
                    std::array::from_fn(|b| 0.5 * (row[D * a + b] + row[D * b + a]))
                })
            };
            let stress_at = |i: usize| -> [f64; C] {
                let excess = phase.pair.excess_viscosity(phase.fraction[i]);
                if excess == 0.0 || frozen.get(i) == Some(&true) {
                    return [0.0; C];
                }
                let part = side_by_side(rate(i), phase.normal_in(slot[i]));
                std::array::from_fn(|n| {
                    let (a, b) = COMPONENTS[n];
                    2.0 * excess * part[a][b]
                })
            };
            laminate.find_force::<D, C>(&self.family, self.inverse(), stress_at);
            let (stress, _) = laminate.stress.as_chunks::<C>();
            let (force, _) = laminate.force.as_chunks::<D>();
            let rows = self.diffusion.par_chunks_exact_mut(D + 1).zip(force);
            let rows = rows.zip(stress).enumerate();
            rows.with_min_len(POINTS_PER_TASK)
                .for_each(|(i, ((row, force), stress))| {
                    for a in 0..D {
                        row[a] += force[a];
                    }
                    let rate = rate(i);
                    for (stress, &(a, b)) in stress.iter().zip(&COMPONENTS) {
                        let times = if a == b { 1.0 } else { 2.0 };
                        row[D] += times * stress * rate[a][b];
                    }
                });
        }
        self.laminate = Some(laminate);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::tests::{STEEL_AND_GAS, Tank};
    use super::*;

    /// Shear along a plane layer has no excess, as its fluids are in series; elongation along it has that of fluids side by side.
    #[test]
    fn layers_shear_in_series_and_stretch_side_by_side() {
        let normal = [0.6, 0.8];
        let along = [-0.8, 0.6];
        let dyad = |a: [f64; 2], b: [f64; 2]| a.map(|a| b.map(|b| a * b));
        let sum = |x: [[f64; 2]; 2], y: [[f64; 2]; 2], sign: f64| -> [[f64; 2]; 2] {
            std::array::from_fn(|a| std::array::from_fn(|b| x[a][b] + sign * y[a][b]))
        };
        let shear = sum(dyad(normal, along), dyad(along, normal), 1.0);
        let stretch = sum(dyad(along, along), dyad(normal, normal), -1.0);
        let [of_shear, of_stretch] = [shear, stretch].map(|rate| side_by_side(rate, normal));
        for a in 0..2 {
            for b in 0..2 {
                assert!(of_shear[a][b].abs() < 1e-15);
                assert!((of_stretch[a][b] - stretch[a][b]).abs() < 1e-15);
            }
        }
    }

    /// A drop in a fluid that is stretched: the excess is `2 (mu_p - mu_s)` times the rate where the layer lies along it, its work
    /// that of the stress, and it moves nothing as a whole.
    #[test]
    fn a_stretched_layer_keeps_momentum() {
        for dimension in [2, 3] {
            let (n, rate) = (16, 0.7);
            let mut tank = Tank::with(dimension, n, &[], 2.015, Some(STEEL_AND_GAS));
            let spacing = 1.0 / n as f64;
            let distance = |x: &Vector3<f64>| {
                let mut from = x - Vector3::new(0.52, 0.46875, 0.5);
                if dimension == 2 {
                    from.z = 0.0;
                }
                0.25 - from.norm()
            };
            let width = STEEL_AND_GAS.width * spacing;
            let places = tank.body.points.position.clone();
            let fraction = places
                .iter()
                .map(|x| 1.0 / (1.0 + (-distance(x) / width).exp()));
            let fraction: Vec<f64> = fraction.collect();
            tank.rates.set_fraction(&fraction);
            for (v, x) in tank.velocity.iter_mut().zip(&places) {
                *v = rate * Vector3::new(x.x - 0.5, 0.5 - x.y, 0.0);
            }
            tank.step(1e-6, None);
            let laminate = tank.rates.laminate.as_ref().expect("two viscosities");
            let (mut total, mut size) = (vec![0.0; dimension], 0.0);
            for (point, force) in laminate.force.chunks(dimension).enumerate() {
                for (a, force) in force.iter().enumerate() {
                    total[a] += force;
                    size += force.abs();
                }
                let stress = &laminate.stress[point * components(dimension)..];
                let excess = STEEL_AND_GAS.excess_viscosity(fraction[point]);
                // on the axis through the middle of the drop the layer is normal to the stretch; the periodic sides are not near
                let is_on_axis = (places[point].y - 0.46875).abs() < 1e-12;
                if dimension == 2 && is_on_axis && (places[point].x - 0.5).abs() < 0.4 {
                    let expected = 2.0 * excess * rate;
                    assert!(
                        (stress[0] - expected).abs() < 1e-6 * rate,
                        "{stress:?} {expected}"
                    );
                }
            }
            assert!(size > 1.0, "{size}");
            for total in total {
                assert!(total.abs() < 1e-10 * size, "{total} {size}");
            }
        }
    }
}
