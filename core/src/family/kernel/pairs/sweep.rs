//! The sweep over [`Pairs`], box by box.

use std::ops::Range;
use std::sync::PoisonError;

use super::{BoxBlocks, HalfStencil, Pairs};
use crate::family::blocks::{BLOCK, BlockHead, MIXED};
use crate::family::kernel::lattice::{LaneBonds, lanes, sum_lanes};
use crate::family::kernel::sums::{Output, Planes};
use crate::family::kernel::{BondKernel, SweepInputs, for_each, inputs_at};
use crate::family::{Family, StencilBond};
#[cfg(target_arch = "x86_64")]
use crate::instructions::{self, InstructionSet};

/// Blocks whose sums a thread copies to the output at a time.
const CHUNK: usize = 64;

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
                let set = |lane: usize, point: usize| {
                    let sum = std::array::from_fn(|o| sums[o][lane]);
                    // SAFETY: `output` has sums for each point of the family, and one thread sets them.
                    unsafe { output.set(point, sum) }
                };
                if head.point == MIXED {
                    let owned = |lane: usize| Some((lane, self.point_in(slot + lane)?));
                    let owned = (0..len).filter_map(owned);
                    owned.for_each(|(lane, point)| set(lane, point));
                    continue;
                }
                for (lane, point) in (point..(point + len).min(self.points)).enumerate() {
                    set(lane, point);
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
            InstructionSet::Avx512 => {
                // SAFETY: the instruction set was detected.
                unsafe { sweep_box_avx512(kernel, self, blocks) }
            }
            InstructionSet::Avx2 => {
                // SAFETY: the instruction set was detected.
                unsafe { sweep_box_avx2(kernel, self, blocks) }
            }
            InstructionSet::Baseline => unreachable!("bonds are visited once where `can_fuse`"),
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

    /// Adds the contributions of the bonds of a point near a crack, bond by bond: those of bonds ahead to both of their
    /// ends, or those of bonds with layer points behind.
    #[inline(never)]
    fn add_unbroken<K: BondKernel<I, O>>(&self, kernel: &K, point: usize, is_ahead: bool) {
        let PairSweep { family, pairs, .. } = self;
        let (inputs, broken) = (self.inputs.values, self.inputs.bits(point));
        let half = pairs.ahead.stencil.len();
        let slot = family.slot_of(point);
        let own = inputs_at(inputs, slot);
        family.for_each_bond(point, |number, bond, at| {
            if (number >= half) != is_ahead || broken.is_broken(number) {
                return;
            }
            let other = inputs_at(inputs, at);
            if is_ahead {
                let [here, there] = kernel.ends(bond, own, other);
                (0..O).for_each(|o| self.add(o, slot, [here[o]]));
                (0..K::PAIRED).for_each(|o| self.add(o, at, [there[o]]));
            } else if !pairs.holds_point[at] {
                let part = kernel.bond(bond, own, other);
                (0..O).for_each(|o| self.add(o, slot, [part[o]]));
            }
        });
    }
}

#[cfg(target_arch = "x86_64")]
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
    // slices of one length need one check of bounds for all
    let inputs = &sweep.inputs.values.map(|input| &input[..family.slots.len]);
    let add_points = |points: Range<usize>, is_ahead: bool| {
        points.for_each(|point| sweep.add_unbroken(kernel, point, is_ahead));
    };
    let HalfStencil { stencil, blocks } = &pairs.ahead;
    for block in of_box.ahead.clone() {
        let head = blocks.head[block];
        if !sweep.inputs.is_whole(head.points()) {
            add_points(head.points(), true);
        } else if Some(head.pattern) == pairs.complete {
            let weights = None;
            add_block(kernel, sweep, inputs, LaneBonds { stencil, weights }, head);
        } else {
            let weights = Some(blocks.weights(block));
            add_block(kernel, sweep, inputs, LaneBonds { stencil, weights }, head);
        }
    }
    let HalfStencil { stencil, blocks } = &pairs.behind;
    for block in of_box.behind.clone() {
        let head = blocks.head[block];
        if !sweep.inputs.is_whole(head.points()) {
            add_points(head.points(), false);
            continue;
        }
        let weights = Some(blocks.weights(block));
        let bonds = LaneBonds::<BLOCK> { stencil, weights };
        let sums = sum_lanes(kernel, bonds, inputs, head.slot as usize);
        for (lane, sums) in sums.iter().enumerate().take(head.len as usize) {
            (0..O).for_each(|o| sweep.add(o, head.slot as usize + lane, [sums[o]]));
        }
    }
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
        let at = slot.wrapping_add_signed(offset);
        let other: [[f64; BLOCK]; I] = lanes(inputs, at);
        let mut others = [[0.0; BLOCK]; O];
        for (o, others) in others.iter_mut().enumerate().take(K::PAIRED) {
            // SAFETY: see `PairSweep::add`.
            *others = unsafe { sweep.planes.get(o, at) };
        }
        for lane in 0..BLOCK {
            let bond = bonds.of_lane(number, bond, lane);
            let mut here: [f64; O] =
                std::array::from_fn(|o| if o < K::PAIRED { sums[o][lane] } else { 0.0 });
            let mut there: [f64; O] = std::array::from_fn(|o| others[o][lane]);
            let own = std::array::from_fn(|i| own[i][lane]);
            let other = std::array::from_fn(|i| other[i][lane]);
            let both = [&mut here, &mut there];
            kernel.add_ends(&bond, own, other, both);
            let counts = bonds.counts(&bond);
            for o in 0..K::PAIRED {
                sums[o][lane] = if counts { here[o] } else { sums[o][lane] };
                others[o][lane] = if counts { there[o] } else { others[o][lane] };
            }
            for o in K::PAIRED..O {
                sums[o][lane] += if counts { here[o] } else { 0.0 };
            }
        }
        for (o, others) in others.into_iter().enumerate().take(K::PAIRED) {
            // SAFETY: see `PairSweep::add`.
            unsafe { sweep.planes.set(o, at, others) }
        }
    }
    for (o, &sums) in sums.iter().enumerate() {
        sweep.add(o, slot, sums);
    }
}
