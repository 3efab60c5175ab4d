//! The sweep over all bonds, which must be fast.
//!
//! On a lattice neighbouring points advance together through the shared stencil ([`lattice`]), on a cloud the bonds of a
//! point ([`cloud`]). The compiler vectorises the loops over lanes for AVX2 and AVX-512, one of which is chosen at run
//! time; x86 machines with neither evaluate bond by bond. Fused multiply-adds are used only where bonds are visited once
//! ([`pairs`]), as they give other bits than machines without them.

use std::ops::Range;

use rayon::prelude::*;

use super::blocks::BLOCK;
use super::broken::Bits;
use super::growing::GrowingBonds;
use super::{BrokenBonds, Chunk, CloudRows, Family, StencilBonds, Store};
use crate::arithmetic::Number;
#[cfg(target_arch = "x86_64")]
use crate::instructions::InstructionSet;
use crate::parallel::ParallelLoop;

mod cloud;
mod lattice;
mod one_by_one;
mod pairs;
mod sums;
#[cfg(test)]
mod tests;

#[cfg(not(target_arch = "x86_64"))]
use cloud::sweep_cloud;
#[cfg(target_arch = "x86_64")]
use cloud::sweep_cloud_avx2;
pub(super) use cloud::{ROW_LANES, RowOwner, Weighing};
use lattice::LaneBonds;
#[cfg(not(target_arch = "x86_64"))]
use lattice::sweep_lattice;
#[cfg(target_arch = "x86_64")]
use lattice::{LatticeSweep, sweep_avx2};
pub(super) use pairs::Pairs;
use sums::Output;

/// A bond of the reference configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond<N = f64> {
    /// Reference vector to the neighbour, m.
    pub xi: [N; 3],
    /// Length of `xi`, m.
    pub length: N,
    /// One over the length, 1/m.
    pub inverse_length: N,
    /// Weight of the neighbour in the family of the point, 1/m: its volume times influence,
    /// partial volume and correction, over the moment of the family ([`moment`](super::FamilySpec::moment)).
    /// Calibrated families have `sum_j weight |xi| = dimension`.
    pub weight: N,
    /// Weight of the point in the family of the neighbour, for the force that the neighbour's state exerts along the bond:
    /// computed like `weight` with the horizon and the moment of the neighbour. Equal to `weight` where horizons are uniform; zero when the point
    /// lies beyond the neighbour's horizon (dual horizon, Wang (2025), eq. 5.13).
    pub dual: N,
}

impl Bond {
    /// A bond along a vector of this length (m) that is not zero, with its weights at both ends: `weight` and `dual`.
    #[inline(always)]
    pub fn new(xi: [f64; 3], length: f64, [weight, dual]: [f64; 2]) -> Self {
        Bond {
            xi,
            length,
            inverse_length: 1.0 / length,
            weight,
            dual,
        }
    }
}

impl<N: Number> Bond<N> {
    /// Mean of both weights, for pair forces and flows, which are opposite at the two ends.
    #[inline(always)]
    pub fn mean(&self) -> N {
        (self.weight + self.dual) * 0.5
    }
}

/// Contributions of a bond to `O` sums of its point, from `I` inputs at its two ends.
///
/// Write plain scalar code and mark `bond` `#[inline(always)]`: the sweep vectorises it.
pub trait BondKernel<const I: usize, const O: usize>: Sync {
    /// Evaluated rarely: of sweeps in lanes, only that of blocks of a lattice with AVX2 is compiled.
    const RARE: bool = false;

    /// How many of the sums, from the first, the bond adds to at both of its ends ([`BondKernel::ends`]). If any, and the
    /// machine has fused multiply-adds, the bonds of a lattice are visited from one end only, to which the remaining sums
    /// are added.
    const PAIRED: usize = 0;

    /// The contributions of one bond.
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O];

    /// The contributions of one bond to its own and its other end, which are opposite unless said otherwise.
    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [[f64; O]; 2] {
        let part = self.bond(bond, own, other);
        let mut opposite = part;
        for part in &mut opposite {
            *part = -*part;
        }
        [part, opposite]
    }

    /// Adds what [`BondKernel::ends`] gives to the sums of both ends. Called only where the machine has fused
    /// multiply-adds: a kernel that uses them has fewer instructions, and other last bits than without.
    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; I],
        other: [f64; I],
        [here, there]: [&mut [f64; O]; 2],
    ) {
        let parts = self.ends(bond, own, other);
        for o in 0..O {
            here[o] += parts[0][o];
            there[o] += parts[1][o];
        }
    }
}

/// Whether programs have sweeps of clouds in lanes. Those that tests run have none: they would be a quarter of the code of each kernel.
/// That results are the same is a unit test.
#[cfg(target_arch = "x86_64")]
const ROWS_IN_LANES: bool = cfg!(any(test, not(debug_assertions)));

/// Sums of a rare kernel that are computed for the points of a block together: with more of them the code grows, not the speed.
const LANED_SUMS: usize = 6;

/// A plane normal to an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisPlane {
    /// The axis.
    pub axis: usize,
    /// Position along the axis, m.
    pub at: f64,
}

/// Inputs of a kernel by slot, and the bonds that do not count.
#[derive(Clone, Copy)]
struct SweepInputs<'a, const I: usize> {
    values: &'a [&'a [f64]; I],
    broken: Option<&'a BrokenBonds>,
}

impl<'a, const I: usize> SweepInputs<'a, I> {
    /// The broken bonds of a point.
    #[inline(always)]
    fn bits(self, point: usize) -> Bits<'a> {
        self.broken.map_or(Bits::NONE, |b| b.bits(point))
    }

    /// Whether no bond of these points is broken.
    #[inline(always)]
    fn is_whole(self, points: Range<usize>) -> bool {
        self.broken.is_none_or(|b| b.is_whole(points))
    }
}

/// The inputs of a slot; a loop for the reason of [`lattice::lanes`].
#[inline(always)]
fn inputs_at<const I: usize>(inputs: &[&[f64]; I], slot: usize) -> [f64; I] {
    let mut values = [0.0; I];
    for (value, input) in values.iter_mut().zip(inputs) {
        *value = input[slot];
    }
    values
}

/// Adds a contribution to sums.
#[inline(always)]
fn add<const O: usize>(sums: &mut [f64; O], part: [f64; O]) {
    for (sum, part) in sums.iter_mut().zip(part) {
        *sum += part;
    }
}

/// Calls `sweep` with each of `parts` on all threads. The call is dynamic, so that the distribution is compiled once and
/// not for every kernel; it costs nothing compared with a part.
fn for_each<T: Sync>(parts: &[T], sweep: &(dyn Fn(&T) + Sync)) {
    parts.par_iter().for_all(sweep);
}

impl Family {
    /// For every point that the family owns, the sum of `kernel` over its bonds; `inputs` in slot space, `sums`
    /// by point; those of remote points are zero. Bit-identical for any number of threads.
    ///
    /// # Panics
    /// When an input is not [`Family::slots`] long or `sums` less than one element per point.
    pub fn sum<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: [&[f64]; I],
        sums: &mut [[f64; O]],
    ) {
        self.sum_unbroken(kernel, inputs, None, sums);
    }

    /// [`Family::sum`] over the bonds that are not broken.
    ///
    /// # Panics
    /// See [`Family::sum`]; also when `broken` belongs to another family.
    pub fn sum_unbroken<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        sums: &mut [[f64; O]],
    ) {
        self.sum_to(kernel, inputs, broken, Output::new(sums));
    }

    /// [`Family::sum_unbroken`] with the first three sums in `vectors` and the fourth in `last`.
    ///
    /// # Panics
    /// See [`Family::sum_unbroken`].
    pub fn sum_apart<const I: usize>(
        &self,
        kernel: &impl BondKernel<I, 4>,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        vectors: &mut [[f64; 3]],
        last: &mut [f64],
    ) {
        self.sum_to(kernel, inputs, broken, Output::apart(vectors, last));
    }

    fn sum_to<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        output: Output<'_, O>,
    ) {
        self.check_inputs(&inputs);
        assert!(output.len >= self.points, "one sum per point");
        for point in self.points..output.len {
            // SAFETY: it is a point of the output, which nobody else sets.
            unsafe { output.set(point, [0.0; O]) }
        }
        let inputs = SweepInputs {
            values: &inputs,
            broken,
        };
        if const { K::PAIRED > 0 }
            && crate::instructions::can_fuse()
            && let Store::Lattice(_, pairs) = &self.store
            && let Some(pairs) = pairs.get_or_init(|| Pairs::new(self).map(Box::new))
        {
            return self.sum_pairs(kernel, pairs, inputs, &output);
        }
        let common = match const { K::RARE } {
            true => self.sums_of_complete(kernel, inputs.values),
            false => None,
        };
        for_each(&self.chunks, &|chunk| {
            self.sweep(kernel, inputs, &output, chunk, common);
        });
        for unborn in self.store.growth().map_or(&[][..], GrowingBonds::unborn) {
            for point in unborn.points() {
                // SAFETY: it is a point of the family, and the threads of the sweep have ended.
                unsafe { output.set(point, [0.0; O]) }
            }
        }
    }

    fn check_inputs<const I: usize>(&self, inputs: &[&[f64]; I]) {
        let slots = |input: &&[f64]| input.len() == self.slots.len;
        assert!(inputs.iter().all(slots), "inputs are slot arrays");
    }

    /// For every point near an audited layer, passes the point and the sum of `kernel` over
    /// its bonds with layer points to `receive`, in order.
    pub fn sum_from_layers<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: [&[f64]; I],
        mut receive: impl FnMut(usize, [f64; O]),
    ) {
        self.check_inputs(&inputs);
        let mut sums = [[0.0; O]; 1024];
        for (block, points) in self.layer_rows.point.chunks(sums.len()).enumerate() {
            let first = block * sums.len();
            let rows = sums.par_iter_mut().zip(first..first + points.len());
            rows.with_min_len(128).for_all(|(sums, row)| {
                *sums = self.sum_row(kernel, &inputs, &self.layer_rows, row, Bits::NONE);
            });
            let points = points.iter().zip(&sums);
            points.for_each(|(&point, sums)| receive(point as usize, *sums));
        }
    }

    /// For every point below a plane, passes the point and the sum of `kernel` over its unbroken bonds with points and
    /// layer points above to `receive`, in order.
    pub fn sum_across<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        plane: AxisPlane,
        mut receive: impl FnMut(usize, [f64; O]),
    ) {
        let above = |slot: usize| self.place(slot, plane.axis) > plane.at;
        for point in 0..self.points {
            let slot = self.slot_of(point);
            if above(slot) {
                continue;
            }
            let mut sums = [0.0; O];
            let bits = broken.map_or(Bits::NONE, |b| b.bits(point));
            self.for_each_bond(point, |number, bond, other| {
                if above(other) && !bits.is_broken(number) {
                    let (own, other) = (inputs_at(&inputs, slot), inputs_at(&inputs, other));
                    add(&mut sums, kernel.bond(bond, own, other));
                }
            });
            receive(point, sums);
        }
    }

    /// Centre of a slot along an axis, m.
    pub(super) fn place(&self, slot: usize, axis: usize) -> f64 {
        match &self.store {
            Store::Cloud(cloud) | Store::Moving(cloud, _) => cloud.places.at[axis][slot],
            Store::Lattice(StencilBonds { stencil, .. }, _)
            | Store::Growing(StencilBonds { stencil, .. }, _)
            | Store::List(stencil, _) => stencil.grid.position(slot, axis),
        }
    }

    /// The sums that all complete families of a lattice have where the inputs are the same at all points and ghosts.
    fn sums_of_complete<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        inputs: &[&[f64]; I],
    ) -> Option<[f64; O]> {
        let StencilBonds { stencil, runs, .. } = self.store.stencil_bonds()?;
        let slot = runs.first()?.slot as usize;
        self.are_uniform(inputs, slot)
            .then(|| stencil.sum_complete(kernel, inputs, slot, Bits::NONE))
    }

    /// Whether each input is at all points and ghosts what it is in slot `first`. Compiled once and not for every kernel.
    fn are_uniform(&self, inputs: &[&[f64]], first: usize) -> bool {
        let is_own = |slots: Range<usize>| {
            let mut inputs = inputs.iter();
            inputs.all(|input| input[slots.clone()].iter().all(|v| *v == input[first]))
        };
        let one = |slot: u32| is_own(slot as usize..slot as usize + 1);
        let points = self.slots.points.spans().par_iter();
        points.all(|s| is_own(s.slot as usize..(s.slot + s.len) as usize))
            && self.slots.ghosts.par_iter().all(|ghost| one(ghost.slot))
            && self.slots.remote.par_iter().all(|&(slot, _)| one(slot))
    }

    /// `common` are the sums of complete families, where these are all the same.
    fn sweep_plainly<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: SweepInputs<'_, I>,
        output: &Output<'_, O>,
        chunk: &Chunk,
        common: Option<[f64; O]>,
    ) {
        // SAFETY: points of a chunk are points of the family, for each of which `output` has sums, and no other chunk
        // contains them.
        let set = |point: usize, sum: [f64; O]| unsafe { output.set(point, sum) };
        let alone = |point: usize| {
            let bits = inputs.bits(point);
            set(point, self.sum_bonds(kernel, inputs.values, point, bits));
        };
        match &self.store {
            Store::Cloud(CloudRows { rows, .. }) | Store::Moving(CloudRows { rows, .. }, _) => {
                for row in chunk.rows.clone() {
                    let point = rows.point[row] as usize;
                    let bits = inputs.bits(point);
                    set(point, self.sum_row(kernel, inputs.values, rows, row, bits));
                }
            }
            Store::Lattice(bonds, _) | Store::Growing(bonds, _) => {
                let in_lanes = |points: Range<usize>, slot: usize, weights| {
                    if const { !K::RARE || O > LANED_SUMS } || !inputs.is_whole(points.clone()) {
                        return None;
                    }
                    let bonds = LaneBonds {
                        stencil: &bonds.stencil.bonds,
                        weights,
                    };
                    let sums = lattice::sum_block(kernel, bonds, inputs.values, slot)?;
                    points.zip(sums).for_each(|(point, sum)| set(point, sum));
                    Some(())
                };
                for block in chunk.blocks.clone() {
                    let head = bonds.blocks.head[block];
                    let weights = Some(bonds.blocks.weights(block));
                    if in_lanes(head.points(), head.slot as usize, weights).is_none() {
                        head.points().for_each(alone);
                    }
                }
                for run in &bonds.runs[chunk.runs.clone()] {
                    for first in run.points().step_by(BLOCK) {
                        let points = first..(first + BLOCK).min(run.points().end);
                        let slot = run.slot as usize + first - run.point as usize;
                        if common.is_none()
                            && points.len() == BLOCK
                            && in_lanes(points.clone(), slot, None).is_some()
                        {
                            continue;
                        }
                        for (point, slot) in points.zip(slot..) {
                            let bits = inputs.bits(point);
                            let sum = match common {
                                Some(sums) if !bits.any() => sums,
                                _ => {
                                    let stencil = &bonds.stencil;
                                    stencil.sum_complete(kernel, inputs.values, slot, bits)
                                }
                            };
                            set(point, sum);
                        }
                    }
                }
            }
            // each point has a row
            Store::List(..) => {
                for row in chunk.rows.clone() {
                    alone(row);
                }
            }
        }
    }

    fn sweep<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: &K,
        inputs: SweepInputs<'_, I>,
        output: &Output<'_, O>,
        chunk: &Chunk,
        common: Option<[f64; O]>,
    ) {
        if const { K::RARE } {
            return self.sweep_plainly(kernel, inputs, output, chunk, common);
        }
        match &self.store {
            Store::Cloud(cloud) | Store::Moving(cloud, _) => {
                #[cfg(target_arch = "x86_64")]
                match crate::instructions::used() {
                    // the gather instructions of AVX-512 are slower than single loads
                    InstructionSet::Avx512 | InstructionSet::Avx2 if const { ROWS_IN_LANES } => {
                        // SAFETY: the instruction set was detected.
                        unsafe { sweep_cloud_avx2(cloud, kernel, inputs, output, chunk) }
                    }
                    _ => self.sweep_plainly(kernel, inputs, output, chunk, None),
                }
                #[cfg(not(target_arch = "x86_64"))]
                sweep_cloud(cloud, kernel, inputs, output, chunk);
            }
            Store::List(..) => self.sweep_plainly(kernel, inputs, output, chunk, None),
            Store::Lattice(bonds, _) | Store::Growing(bonds, _) => {
                let family = self;
                let sweep = LatticeSweep { family, bonds };
                #[cfg(target_arch = "x86_64")]
                match crate::instructions::used() {
                    InstructionSet::Baseline => {
                        self.sweep_plainly(kernel, inputs, output, chunk, None)
                    }
                    // paired kernels use AVX2: only bodies that are too narrow for pairs are swept here
                    #[cfg(any(test, not(debug_assertions)))]
                    InstructionSet::Avx512 if const { K::PAIRED == 0 } => {
                        // SAFETY: the instruction set was detected.
                        unsafe { lattice::sweep_avx512(sweep, kernel, inputs, output, chunk) }
                    }
                    InstructionSet::Avx512 | InstructionSet::Avx2 => {
                        // SAFETY: the instruction set was detected, or one that includes it.
                        unsafe { sweep_avx2(sweep, kernel, inputs, output, chunk) }
                    }
                }
                #[cfg(not(target_arch = "x86_64"))]
                sweep_lattice(sweep, kernel, inputs, output, chunk);
            }
        }
    }
}
