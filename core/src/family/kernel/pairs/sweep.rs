//! The sweep over [`Pairs`], box by box.

use std::cell::Cell;
use std::sync::PoisonError;

use super::{BoxBlocks, HalfStencil, Pairs};
use crate::family::blocks::{BLOCK, BlockHead, MIXED, Weights};
use crate::family::broken::Bits;
use crate::family::kernel::lattice::{LaneBonds, lane_of, lanes, of_length, sum_lanes};
use crate::family::kernel::sums::{Output, Planes};
use crate::family::kernel::{BondKernel, SweepInputs, for_each};
use crate::family::{BrokenBonds, Family, StencilBond};
#[cfg(target_arch = "x86_64")]
use crate::instructions::{self, InstructionSet};

/// Blocks whose sums a thread copies to the output at a time.
const CHUNK: usize = 64;

thread_local! {
    /// Memory of [`PairSweep::unbroken_weights`].
    static UNBROKEN: Cell<Vec<Weights>> = const { Cell::new(Vec::new()) };
}

/// A sweep over the pairs of a family.
struct PairSweep<'a, const I: usize, const O: usize> {
    family: &'a Family,
    pairs: &'a Pairs,
    inputs: SweepInputs<'a, I>,
    planes: Planes<'a, O>,
}

impl Family {
    /// [`Family::sum_unbroken`], every bond visited once.
    pub(in crate::family::kernel) fn sum_pairs<
        const I: usize,
        const O: usize,
        K: BondKernel<I, O>,
    >(
        &self,
        kernel: &K,
        pairs: &Pairs,
        inputs: SweepInputs<'_, I>,
        output: &Output<'_, O>,
    ) {
        let lock = || pairs.work.lock().unwrap_or_else(PoisonError::into_inner);
        // a second sweep at the same time finds no memory and allocates its own
        let mut work = std::mem::take(&mut *lock());
        let sweep = PairSweep {
            family: self,
            pairs,
            inputs,
            planes: Planes::new(&mut work, self.slots.len),
        };
        for boxes in &pairs.boxes {
            for_each(boxes, &|blocks| sweep.sweep_box(kernel, blocks));
        }
        let parts: Vec<&[BlockHead]> = pairs.ahead.blocks.head.chunks(CHUNK).collect();
        for_each(&parts, &|heads| {
            for head in *heads {
                let (slot, point, len) =
                    (head.slot as usize, head.point as usize, head.len as usize);
                let mut sums = [[0.0; BLOCK]; O];
                for (o, sums) in sums.iter_mut().enumerate() {
                    if len == BLOCK {
                        // SAFETY: every point is in one block, whose sums one thread takes after the sweep of all boxes.
                        *sums = unsafe { sweep.planes.take(o, slot) };
                        continue;
                    }
                    // the other lanes belong to other blocks
                    for (lane, sum) in sums.iter_mut().enumerate().take(len) {
                        // SAFETY: as above.
                        [*sum] = unsafe { sweep.planes.take(o, slot + lane) };
                    }
                }
                for lane in 0..len {
                    let owned = match head.point == MIXED {
                        true => self.point_in(slot + lane),
                        false => Some(point + lane).filter(|&point| point < self.points),
                    };
                    if let Some(point) = owned {
                        // SAFETY: `output` has sums for each point of the family, and one thread sets them.
                        unsafe { output.set(point, lane_of(&sums, lane)) }
                    }
                }
            }
        });
        *lock() = work;
    }
}

impl<const I: usize, const O: usize> PairSweep<'_, I, O> {
    fn sweep_box<K: BondKernel<I, O>>(&self, kernel: &K, blocks: &BoxBlocks) {
        #[cfg(target_arch = "x86_64")]
        match instructions::used() {
            InstructionSet::Baseline => unreachable!("bonds are visited once where `can_fuse`"),
            #[cfg(any(test, not(debug_assertions)))]
            InstructionSet::Avx512 => {
                // SAFETY: the instruction set was detected.
                unsafe { sweep_box_avx512(kernel, self, blocks) }
            }
            _ => {
                // SAFETY: the instruction set was detected, or one that includes it.
                unsafe { sweep_box_avx2(kernel, self, blocks) }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        sweep_box(kernel, self, blocks);
    }

    /// Adds to the sums of consecutive slots.
    #[inline(always)]
    fn add<const N: usize>(&self, plane: usize, slot: usize, parts: [f64; N]) {
        // SAFETY: threads sweep boxes of one colour at the same time, which write to different rows (`Pairs::check`).
        unsafe { self.planes.add(plane, slot, parts) }
    }

    /// The broken bonds, if points of a block have some.
    fn broken_in(&self, head: BlockHead) -> Option<&BrokenBonds> {
        self.inputs.broken.filter(|broken| match head.point {
            MIXED => (head.slots()).any(|slot| self.bits(broken, slot).any()),
            _ => !broken.is_whole(head.points()),
        })
    }

    /// The weights of a block near a crack, without those of broken bonds. A block is swept in the same order whether bonds
    /// of it are broken or not, so that a part of a body needs to know the broken bonds of its own points only.
    #[inline(never)]
    fn unbroken_weights<'w>(
        &self,
        broken: &BrokenBonds,
        half: &HalfStencil,
        block: usize,
        unbroken: &'w mut Vec<Weights>,
    ) -> &'w [Weights] {
        unbroken.clear();
        unbroken.extend_from_slice(half.blocks.weights(block));
        for (lane, slot) in half.blocks.head[block].slots().enumerate() {
            let bits = self.bits(broken, slot);
            if !bits.any() {
                continue;
            }
            for (weights, &number) in unbroken.iter_mut().zip(&half.numbers) {
                if bits.is_broken(number) {
                    weights.iter_mut().for_each(|lanes| lanes[lane] = 0.0);
                }
            }
        }
        unbroken
    }

    /// The broken bonds of the point in a slot.
    fn bits<'b>(&self, broken: &'b BrokenBonds, slot: usize) -> Bits<'b> {
        let point = self.family.any_point_in(slot);
        point.map_or(Bits::NONE, |point| broken.bits(point))
    }

    /// Adds to the sums of a slot, from the first.
    #[inline(always)]
    fn add_parts(&self, slot: usize, parts: &[f64]) {
        for (o, &part) in parts.iter().enumerate() {
            self.add(o, slot, [part]);
        }
    }
}

#[cfg(all(target_arch = "x86_64", any(test, not(debug_assertions))))]
#[target_feature(enable = "avx512f,avx512vl,fma")]
fn sweep_box_avx512<const I: usize, const O: usize, K: BondKernel<I, O>>(
    kernel: &K,
    sweep: &PairSweep<'_, I, O>,
    blocks: &BoxBlocks,
) {
    sweep_box(kernel, sweep, blocks);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn sweep_box_avx2<const I: usize, const O: usize, K: BondKernel<I, O>>(
    kernel: &K,
    sweep: &PairSweep<'_, I, O>,
    blocks: &BoxBlocks,
) {
    sweep_box(kernel, sweep, blocks);
}

#[inline(always)]
fn sweep_box<const I: usize, const O: usize, K: BondKernel<I, O>>(
    kernel: &K,
    sweep: &PairSweep<'_, I, O>,
    of_box: &BoxBlocks,
) {
    let PairSweep { family, pairs, .. } = sweep;
    let inputs = &of_length(sweep.inputs.values, family.slots.len);
    let mut unbroken = UNBROKEN.take();
    let HalfStencil {
        stencil, blocks, ..
    } = &pairs.ahead;
    for block in of_box.ahead.clone() {
        let head = blocks.head[block];
        let weights = match sweep.broken_in(head) {
            Some(broken) => {
                Some(sweep.unbroken_weights(broken, &pairs.ahead, block, &mut unbroken))
            }
            None if Some(head.pattern) == pairs.complete => None,
            None => Some(blocks.weights(block)),
        };
        // compiled for either case
        if weights.is_none() {
            let weights = None;
            add_block(kernel, sweep, inputs, LaneBonds { stencil, weights }, head);
        } else {
            add_block(kernel, sweep, inputs, LaneBonds { stencil, weights }, head);
        }
    }
    let HalfStencil {
        stencil, blocks, ..
    } = &pairs.behind;
    for block in of_box.behind.clone() {
        let head = blocks.head[block];
        let weights = match sweep.broken_in(head) {
            Some(broken) => sweep.unbroken_weights(broken, &pairs.behind, block, &mut unbroken),
            None => blocks.weights(block),
        };
        let weights = Some(weights);
        let bonds = LaneBonds::<BLOCK> { stencil, weights };
        let sums = sum_lanes(kernel, bonds, inputs, head.slot as usize);
        for (lane, sums) in sums.iter().enumerate().take(head.len as usize) {
            sweep.add_parts(head.slot as usize + lane, sums);
        }
    }
    UNBROKEN.set(unbroken);
}

/// Adds the contributions of the bonds ahead of a block to both of their ends. Bonds without weight, and lanes that are no
/// points, contribute nothing.
#[inline(always)]
fn add_block<const I: usize, const O: usize, K: BondKernel<I, O>>(
    kernel: &K,
    sweep: &PairSweep<'_, I, O>,
    inputs: &[&[f64]; I],
    bonds: LaneBonds<'_, BLOCK>,
    head: BlockHead,
) {
    let slot = head.slot as usize;
    let own: [[f64; BLOCK]; I] = lanes(inputs, slot);
    let mut sums = [[0.0; BLOCK]; O];
    for (number, &StencilBond { offset, bond }) in bonds.stencil.iter().enumerate() {
        if bonds.are_absent(number) {
            continue;
        }
        let at = slot.wrapping_add_signed(offset);
        let other: [[f64; BLOCK]; I] = lanes(inputs, at);
        let mut others = [[0.0; BLOCK]; O];
        for (o, others) in others.iter_mut().enumerate().take(K::PAIRED) {
            // SAFETY: see `PairSweep::add`.
            *others = unsafe { sweep.planes.get(o, at) };
        }
        // fresh arrays: conditional stores to those that are read would be masked, which takes AMD processors without AVX-512
        // longer than the bond
        let (mut next, mut next_others) = ([[0.0; BLOCK]; O], [[0.0; BLOCK]; O]);
        for lane in 0..BLOCK {
            let bond = bonds.of_lane(number, bond, lane);
            let mut here = lane_of(&sums, lane);
            here[K::PAIRED..].fill(0.0);
            let mut there = lane_of(&others, lane);
            let both = [&mut here, &mut there];
            kernel.add_ends(&bond, lane_of(&own, lane), lane_of(&other, lane), both);
            let counts = bonds.counts(&bond);
            for o in 0..K::PAIRED {
                next[o][lane] = if counts { here[o] } else { sums[o][lane] };
                next_others[o][lane] = if counts { there[o] } else { others[o][lane] };
            }
            for o in K::PAIRED..O {
                next[o][lane] = sums[o][lane] + if counts { here[o] } else { 0.0 };
            }
        }
        sums = next;
        for (o, others) in next_others.into_iter().enumerate().take(K::PAIRED) {
            // SAFETY: see `PairSweep::add`.
            unsafe { sweep.planes.set(o, at, others) }
        }
    }
    for (o, &sums) in sums.iter().enumerate() {
        sweep.add(o, slot, sums);
    }
}
