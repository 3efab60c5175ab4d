//! The sweep of lattices: consecutive points advance together through the shared stencil, with their sums in registers;
//! each bond costs one load of each input per point.

use super::{Bond, BondKernel, Output, SweepInputs};
use crate::family::blocks::{BLOCK, Weights};
use crate::family::{Chunk, Family, Stencil, StencilBond, StencilBonds};
#[cfg(target_arch = "x86_64")]
use crate::instructions::{self, InstructionSet};

/// Points that advance together: two AVX-512 or four AVX2 registers.
const LANES: usize = 16;

/// Points for which all lanes take less time than bond by bond.
const WORTH_LANES: usize = 4;

/// A family on a lattice, and its bonds.
#[derive(Clone, Copy)]
pub(super) struct LatticeSweep<'a> {
    pub(super) family: &'a Family,
    pub(super) bonds: &'a StencilBonds,
}

#[cfg(all(target_arch = "x86_64", any(test, not(debug_assertions))))]
#[target_feature(enable = "avx512f,avx512vl")]
pub(super) fn sweep_avx512<const I: usize, const O: usize>(
    sweep: LatticeSweep<'_>,
    kernel: &impl BondKernel<I, O>,
    inputs: SweepInputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    sweep_lattice(sweep, kernel, inputs, output, chunk);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
pub(super) fn sweep_avx2<const I: usize, const O: usize>(
    sweep: LatticeSweep<'_>,
    kernel: &impl BondKernel<I, O>,
    inputs: SweepInputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    sweep_lattice(sweep, kernel, inputs, output, chunk);
}

#[inline(always)]
pub(super) fn sweep_lattice<const I: usize, const O: usize>(
    sweep: LatticeSweep<'_>,
    kernel: &impl BondKernel<I, O>,
    inputs: SweepInputs<'_, I>,
    output: &Output<'_, O>,
    chunk: &Chunk,
) {
    let LatticeSweep { family, bonds } = sweep;
    let values = &of_length(inputs.values, family.slots.len);
    // SAFETY: points of a chunk are points of the family, for each of which `output` has sums, and no other chunk
    // contains them.
    let set = |point: usize, sum: [f64; O]| unsafe { output.set(point, sum) };
    let stencil = &bonds.stencil.bonds[..];
    // lanes beyond the end of a run compute with what is there
    let last_slot = bonds.stencil.last_slot(family.slots.len);
    for run in &bonds.runs[chunk.runs.clone()] {
        let (slot, point, len) = (run.slot as usize, run.point as usize, run.len as usize);
        let mut done = 0;
        while done < len {
            // the last block overlaps the one before it: the same sums are written twice
            let first = done.min(len.saturating_sub(LANES));
            let points = point + first..point + (first + LANES).min(len);
            let is_in_lanes = points.len() >= WORTH_LANES && Some(slot + first) <= last_slot;
            if is_in_lanes && inputs.is_whole(points.clone()) {
                let bonds = LaneBonds::<LANES> {
                    stencil,
                    weights: None,
                };
                let sums = sum_lanes(kernel, bonds, values, slot + first);
                for (point, sum) in points.zip(sums) {
                    set(point, sum);
                }
            } else {
                for (point, slot) in points.zip(slot + first..) {
                    let bits = inputs.bits(point);
                    set(
                        point,
                        bonds.stencil.sum_complete(kernel, values, slot, bits),
                    );
                }
            }
            done = first + LANES;
        }
    }
    for block in chunk.blocks.clone() {
        let head = bonds.blocks.head[block];
        let points = head.points();
        if inputs.is_whole(points.clone()) {
            let bonds = LaneBonds {
                stencil,
                weights: Some(bonds.blocks.weights(block)),
            };
            let sums = sum_lanes(kernel, bonds, values, head.slot as usize);
            for (point, sum) in points.zip(sums) {
                set(point, sum);
            }
        } else {
            for point in points {
                let bits = inputs.bits(point);
                set(point, family.sum_bonds(kernel, values, point, bits));
            }
        }
    }
}

/// Sums of the points of a block, or of as many with the bonds of the stencil, for a kernel that is evaluated rarely; `None` on a
/// machine of which each point takes less time alone.
pub(super) fn sum_block<const I: usize, const O: usize>(
    kernel: &impl BondKernel<I, O>,
    bonds: LaneBonds<'_, BLOCK>,
    inputs: &[&[f64]; I],
    slot: usize,
) -> Option<[[f64; O]; BLOCK]> {
    #[cfg(target_arch = "x86_64")]
    return (instructions::used() > InstructionSet::Baseline).then(|| {
        // SAFETY: the instruction set was detected.
        unsafe { sum_block_avx2(kernel, bonds, inputs, slot) }
    });
    #[cfg(not(target_arch = "x86_64"))]
    Some(sum_lanes(kernel, bonds, inputs, slot))
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sum_block_avx2<const I: usize, const O: usize>(
    kernel: &impl BondKernel<I, O>,
    bonds: LaneBonds<'_, BLOCK>,
    inputs: &[&[f64]; I],
    slot: usize,
) -> [[f64; O]; BLOCK] {
    // compiled for either case: with a branch in the loop the lanes are computed one after the other
    match bonds.weights {
        None => {
            let weights = None;
            sum_lanes(kernel, LaneBonds { weights, ..bonds }, inputs, slot)
        }
        Some(_) => sum_lanes(kernel, bonds, inputs, slot),
    }
}

impl Stencil {
    /// The last slot from which the bonds of [`LANES`] points stay within so many slots.
    fn last_slot(&self, slots: usize) -> Option<usize> {
        let reach = self.bonds.iter().map(|bond| bond.offset).max();
        slots.checked_sub(LANES + reach.map_or(0, |reach| reach.max(0) as usize))
    }
}

/// Bonds of `N` consecutive points: those of the stencil, or with weights by bond and lane.
#[derive(Clone, Copy)]
pub(super) struct LaneBonds<'a, const N: usize> {
    pub(super) stencil: &'a [StencilBond],
    pub(super) weights: Option<&'a [Weights<N>]>,
}

impl<const N: usize> LaneBonds<'_, N> {
    /// The bond of one lane; `bond` is that of the stencil.
    #[inline(always)]
    pub(super) fn of_lane(self, number: usize, bond: Bond, lane: usize) -> Bond {
        self.weights.map_or(bond, |weights| Bond {
            weight: weights[number][0][lane],
            dual: weights[number][1][lane],
            ..bond
        })
    }

    /// Whether no lane has the bond. Comparisons number by number would be branches.
    #[inline(always)]
    pub(super) fn are_absent(self, number: usize) -> bool {
        let bits = |weights: &[f64; N]| weights.iter().fold(0, |bits, w| bits | w.to_bits());
        let all = |[weights, duals]: &Weights<N>| bits(weights) | bits(duals);
        self.weights
            .is_some_and(|weights| all(&weights[number]) == 0)
    }

    /// Whether a bond counts: the inputs of slots without a point may be any number or NaN.
    #[inline(always)]
    pub(super) fn counts(self, bond: &Bond) -> bool {
        self.weights.is_none() || bond.weight + bond.dual != 0.0
    }
}

/// Sums of `N` points in consecutive slots; lanes of a block that are no points have zero sums.
#[inline(always)]
pub(super) fn sum_lanes<const I: usize, const O: usize, const N: usize>(
    kernel: &impl BondKernel<I, O>,
    bonds: LaneBonds<'_, N>,
    inputs: &[&[f64]; I],
    slot: usize,
) -> [[f64; O]; N] {
    let own: [[f64; N]; I] = lanes(inputs, slot);
    let mut sums = [[0.0; N]; O];
    // each bond is copied: the compiler would gather the fields of a reference lane by lane
    for (number, &StencilBond { offset, bond }) in bonds.stencil.iter().enumerate() {
        if bonds.are_absent(number) {
            continue;
        }
        let at = slot.wrapping_add_signed(offset);
        let other: [[f64; N]; I] = lanes(inputs, at);
        if bonds.weights.is_none() {
            for lane in 0..N {
                let part = kernel.bond(&bond, lane_of(&own, lane), lane_of(&other, lane));
                for (sums, part) in sums.iter_mut().zip(&part) {
                    sums[lane] += part;
                }
            }
            continue;
        }
        // all lanes first: divisions of bonds that may not count would be computed one by one
        let mut parts = [[0.0; N]; O];
        for lane in 0..N {
            let bond = bonds.of_lane(number, bond, lane);
            let part = kernel.bond(&bond, lane_of(&own, lane), lane_of(&other, lane));
            for (parts, part) in parts.iter_mut().zip(&part) {
                parts[lane] = *part;
            }
        }
        for lane in 0..N {
            let counts = bonds.counts(&bonds.of_lane(number, bond, lane));
            for (sums, parts) in sums.iter_mut().zip(&parts) {
                sums[lane] += if counts { parts[lane] } else { 0.0 };
            }
        }
    }
    let mut of_points = [[0.0; O]; N];
    for (lane, of_point) in of_points.iter_mut().enumerate() {
        *of_point = lane_of(&sums, lane);
    }
    of_points
}

/// The inputs of `N` consecutive slots. A loop, as the compiler does not inline `array::from_fn` into the sweeps of large
/// kernels; nor are there closures in the sweeps, each of which would be compiled for every kernel.
#[inline(always)]
pub(super) fn lanes<const I: usize, const N: usize>(
    inputs: &[&[f64]; I],
    at: usize,
) -> [[f64; N]; I] {
    let mut values = [[0.0; N]; I];
    for (values, input) in values.iter_mut().zip(inputs) {
        values.copy_from_slice(&input[at..at + N]);
    }
    values
}

/// One lane of each value.
#[inline(always)]
pub(super) fn lane_of<const I: usize, const N: usize>(
    values: &[[f64; N]; I],
    lane: usize,
) -> [f64; I] {
    let mut of_lane = [0.0; I];
    for (value, lanes) in of_lane.iter_mut().zip(values) {
        *value = lanes[lane];
    }
    of_lane
}

/// The first elements of all inputs: slices of one length need one check of bounds for all.
#[inline(always)]
pub(super) fn of_length<'a, const I: usize>(
    inputs: &[&'a [f64]; I],
    length: usize,
) -> [&'a [f64]; I] {
    let mut all = [&[][..]; I];
    for (slice, input) in all.iter_mut().zip(inputs) {
        *slice = &input[..length];
    }
    all
}
