//! Every bond visited once: the sweep of lattices by kernels that give both ends of a bond their part.
//!
//! A bond under finite displacements costs a square root and a division, so it is evaluated once, from the end
//! in the lower slot: *ahead*. Eight points advance together, with their own sums in registers and those of
//! the other ends in memory. They are gathered in boxes of rows; boxes of one colour write to rows of their own,
//! so all of them may run at once. Boxes and colours know nothing of threads: neither do the bits.
//!
//! Layer points do not look ahead: bonds with those *behind* a point are evaluated from the point.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::{Bits, Bond, BondKernel, Inputs, Output, bits, for_each, lanes, sum_lanes};
#[cfg(target_arch = "x86_64")]
use super::{Instructions, instructions};
use crate::family::blocks::{BLOCK, Blocks, Builder, Head, Weights};
use crate::family::{Family, StencilBond};

/// Blocks whose sums a thread hands over at a time.
const CHUNK: usize = 64;

/// Rows of a box, side by side, about: more of them read less twice, fewer keep more threads busy.
const ROWS: usize = 12;

/// The bonds of a lattice, each once.
#[derive(Debug)]
pub(in crate::family) struct Pairs {
    ahead: Half,
    /// The weights of blocks whose bonds are those of the stencil.
    complete: Option<u32>,
    /// Of points and layer points.
    behind: Half,
    /// By colour.
    boxes: [Vec<Section>; 4],
    /// By slot.
    holds_point: Vec<bool>,
    /// Sums by slot, in planes: zero for points, between sweeps.
    work: Mutex<Vec<f64>>,
}

/// The blocks of a box.
#[derive(Debug)]
struct Section {
    ahead: Range<usize>,
    behind: Range<usize>,
}

/// Bonds to one side of their points.
#[derive(Debug)]
struct Half {
    stencil: Vec<StencilBond>,
    blocks: Blocks,
}

/// Sums by slot, shared by the threads of a sweep.
struct Planes {
    first: *mut f64,
    slots: usize,
}

// SAFETY: threads that run at the same time sweep boxes of one colour, which write to rows of their own (checked by
// `Pairs::check`); nobody takes before they have joined.
unsafe impl Sync for Planes {}

impl Planes {
    #[inline(always)]
    fn at<const N: usize>(&self, plane: usize, slot: usize) -> *mut [f64; N] {
        assert!(slot + N <= self.slots, "within the plane");
        // SAFETY: `Family::sum_pairs` made a plane for each sum.
        unsafe { self.first.add(plane * self.slots + slot).cast() }
    }

    #[inline(always)]
    fn get<const N: usize>(&self, plane: usize, slot: usize) -> [f64; N] {
        // SAFETY: no other thread writes there, see above.
        unsafe { *self.at(plane, slot) }
    }

    #[inline(always)]
    fn set<const N: usize>(&self, plane: usize, slot: usize, sums: [f64; N]) {
        // SAFETY: as in `get`.
        unsafe { *self.at(plane, slot) = sums }
    }

    #[inline(always)]
    fn add<const N: usize>(&self, plane: usize, slot: usize, parts: [f64; N]) {
        let sums: [f64; N] = self.get(plane, slot);
        let sums = std::array::from_fn(|lane| sums[lane] + parts[lane]);
        self.set::<N>(plane, slot, sums);
    }

    /// The sum of a point, which leaves zero behind. After the sweep: each point is taken by one thread.
    #[inline(always)]
    fn take(&self, plane: usize, slot: usize) -> f64 {
        let [sum] = self.get(plane, slot);
        self.set(plane, slot, [0.0]);
        sum
    }
}

/// The bonds of a stencil, column by column of x: those to one row follow each other at a distance. What a bond reads
/// that the one before wrote in part has to wait until it is written, for longer than the bond takes.
fn order_of(ahead: &[StencilBond]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..ahead.len()).collect();
    order.sort_by(|&a, &b| ahead[a].bond.xi[0].total_cmp(&ahead[b].bond.xi[0]));
    order
}

impl Pairs {
    /// The pairs of a family; none of a cloud, of rows, and on a line, whose points are few.
    pub fn new(family: &Family) -> Option<Pairs> {
        let cells = family.grid.as_ref()?.cells();
        let half = family.stencil.len() / 2;
        let (behind, ahead) = family.stencil.split_at(half);
        let order = order_of(ahead);
        let is_plane = cells[2] == 1;
        if !family.rows.point.is_empty() || cells[0] < BLOCK || (is_plane && cells[1] == 1) {
            return None;
        }
        let row_of = |slot: usize| (slot / cells[0] % cells[1], slot / cells[0] / cells[1]);
        // how many rows and planes of rows the other ends of bonds are away, at most
        let far = ahead[ahead.len() - 1].offset as usize;
        let reach = match is_plane {
            true => (far + cells[0] / 2) / cells[0],
            false => (far / cells[0] + cells[1] / 2) / cells[1],
        };
        // rows that a bond reaches, and the one after, into which a block may run. That after the last row is the
        // first of the next plane: the first and the last box of a plane must differ in colour, too
        let across = match cells[1] / ROWS.max(2 * reach + 1) {
            0 | 1 => 1,
            boxes => boxes & !1,
        };
        let box_of = |slot: usize| match (is_plane, row_of(slot)) {
            (true, (y, _)) => [y / (reach + 1), 0],
            (false, (y, z)) => [y * across / cells[1], z / (reach + 1)],
        };
        let mut place_of = vec![0; half];
        for (place, &number) in order.iter().enumerate() {
            place_of[number] = place;
        }
        let mut points: Vec<(usize, [usize; 2], u32, u32)> = Vec::with_capacity(family.points);
        let mut holds_point = vec![false; family.slots];
        for span in &family.spans {
            for (slot, point) in (span.slot..).zip(span.point..span.point + span.len) {
                let place = box_of(slot as usize);
                let colour = place[0] % 2 + 2 * (place[1] % 2);
                points.push((colour, place, slot, point));
                holds_point[slot as usize] = true;
            }
        }
        points.sort_unstable();
        let mut blocks = [Builder::new(half), Builder::new(half)];
        let mut boxes: [Vec<Section>; 4] = Default::default();
        for of_box in points.chunk_by(|a, b| a.1 == b.1) {
            let first = blocks.each_ref().map(Builder::len);
            for &(_, _, slot, point) in of_box {
                let mut bonds = [Vec::new(), Vec::new()];
                family.for_each_bond(point as usize, |number, bond, other| {
                    let weights = [bond.weight, bond.dual];
                    if number >= half {
                        bonds[1].push((place_of[number - half], weights));
                    } else if !holds_point[other] {
                        bonds[0].push((number, weights));
                    }
                });
                let [back, forth] = bonds;
                if !back.is_empty() {
                    blocks[0].push((point, slot), back.into_iter());
                }
                blocks[1].push((point, slot), forth.into_iter());
            }
            boxes[of_box[0].0].push(Section {
                ahead: first[1]..blocks[1].len(),
                behind: first[0]..blocks[0].len(),
            });
        }
        let [back, forth] = blocks.map(Builder::finish);
        let ahead: Vec<StencilBond> = order.iter().map(|&number| ahead[number]).collect();
        let pairs = Pairs {
            complete: forth.pattern_of(ahead.iter().map(|b| [b.bond.weight, b.bond.dual])),
            ahead: Half {
                stencil: ahead,
                blocks: forth,
            },
            behind: Half {
                stencil: behind.to_vec(),
                blocks: back,
            },
            boxes,
            holds_point,
            work: Mutex::default(),
        };
        pairs.check(cells[0]);
        Some(pairs)
    }

    /// Boxes of one colour write to different rows.
    fn check(&self, row: usize) {
        let rows = self.holds_point.len().div_ceil(row);
        for boxes in &self.boxes {
            let mut writer = vec![None; rows];
            for (number, section) in boxes.iter().enumerate() {
                // blocks behind hold points of these
                for head in &self.ahead.blocks.head[section.ahead.clone()] {
                    let ends = self.ahead.stencil.iter().map(|bond| bond.offset as usize);
                    for first in ends.chain([0]).map(|offset| head.slot as usize + offset) {
                        for row in first / row..=(first + BLOCK - 1) / row {
                            let writer = writer[row].get_or_insert(number);
                            assert_eq!(*writer, number, "rows of boxes of one colour");
                        }
                    }
                }
            }
        }
    }

    pub fn memory(&self) -> usize {
        self.ahead.blocks.memory() + self.behind.blocks.memory() + self.holds_point.len()
    }
}

impl Family {
    /// [`Family::sum_unbroken`], every bond visited once.
    pub(super) fn sum_pairs<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        (kernel, pairs): (&K, &Pairs),
        inputs: Inputs<'_, I>,
        output: &Output<'_, O>,
    ) {
        let lock = || pairs.work.lock().unwrap_or_else(PoisonError::into_inner);
        // a second sweep at the same time finds none, and takes its own
        let mut work = std::mem::take(&mut *lock());
        work.resize(O * self.slots, 0.0);
        let planes = Planes {
            first: work.as_mut_ptr(),
            slots: self.slots,
        };
        for boxes in &pairs.boxes {
            for_each(boxes, &|section| {
                self.sweep_box((kernel, pairs), inputs, (&planes, section));
            });
        }
        let parts: Vec<&[Head]> = pairs.ahead.blocks.head.chunks(CHUNK).collect();
        for_each(&parts, &|heads| {
            for head in *heads {
                for lane in 0..head.len as usize {
                    let slot = head.slot as usize + lane;
                    let sum = std::array::from_fn(|o| planes.take(o, slot));
                    output.set(head.point as usize + lane, sum);
                }
            }
        });
        *lock() = work;
    }

    fn sweep_box<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        kernel: (&K, &Pairs),
        inputs: Inputs<'_, I>,
        target: (&Planes, &Section),
    ) {
        #[cfg(target_arch = "x86_64")]
        match instructions() {
            Instructions::Avx512 => {
                // SAFETY: the instruction set was detected.
                unsafe { sweep_box_avx512(self, kernel, inputs, target) }
            }
            Instructions::Avx2 => {
                // SAFETY: the instruction set was detected.
                unsafe { sweep_box_avx2(self, kernel, inputs, target) }
            }
            Instructions::Baseline => unreachable!("bonds are visited once where `can_fuse`"),
        }
        #[cfg(not(target_arch = "x86_64"))]
        sweep_box(self, kernel, inputs, target);
    }

    /// Adds what the bonds of a point give, bond by bond, for points beside cracks: those ahead to both of their ends,
    /// or those with layer points behind.
    #[inline(never)]
    fn add_unbroken<const I: usize, const O: usize, K: BondKernel<I, O>>(
        &self,
        (kernel, pairs): (&K, &Pairs),
        inputs: &[&[f64]; I],
        (point, broken, is_ahead): (usize, Bits<'_>, bool),
        planes: &Planes,
    ) {
        let half = pairs.ahead.stencil.len();
        let slot = self.slot_of(point);
        let own = std::array::from_fn(|i| inputs[i][slot]);
        self.for_each_bond(point, |number, bond, at| {
            if (number >= half) != is_ahead || broken.is_broken(number) {
                return;
            }
            let other = std::array::from_fn(|i| inputs[i][at]);
            if is_ahead {
                let [here, there] = kernel.ends(bond, own, other);
                (0..O).for_each(|o| planes.add(o, slot, [here[o]]));
                (0..K::PAIRED).for_each(|o| planes.add(o, at, [there[o]]));
            } else if !pairs.holds_point[at] {
                let part = kernel.bond(bond, own, other);
                (0..O).for_each(|o| planes.add(o, slot, [part[o]]));
            }
        });
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,fma")]
fn sweep_box_avx512<const I: usize, const O: usize, K: BondKernel<I, O>>(
    family: &Family,
    kernel: (&K, &Pairs),
    inputs: Inputs<'_, I>,
    target: (&Planes, &Section),
) {
    sweep_box(family, kernel, inputs, target);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn sweep_box_avx2<const I: usize, const O: usize, K: BondKernel<I, O>>(
    family: &Family,
    kernel: (&K, &Pairs),
    inputs: Inputs<'_, I>,
    target: (&Planes, &Section),
) {
    sweep_box(family, kernel, inputs, target);
}

#[inline(always)]
fn sweep_box<const I: usize, const O: usize, K: BondKernel<I, O>>(
    family: &Family,
    (kernel, pairs): (&K, &Pairs),
    (values, broken): Inputs<'_, I>,
    (planes, section): (&Planes, &Section),
) {
    // of one length, for all the compiler knows: one check of bounds for all
    let inputs = &values.map(|input| &input[..family.slots]);
    let is_whole = |points: Range<usize>| broken.is_none_or(|b| b.is_whole(points));
    let add_points = |points: Range<usize>, is_ahead: bool| {
        for point in points {
            let point = (point, bits(broken, point), is_ahead);
            family.add_unbroken((kernel, pairs), inputs, point, planes);
        }
    };
    let Half { stencil, blocks } = &pairs.ahead;
    for block in section.ahead.clone() {
        let head = blocks.head[block];
        if !is_whole(head.points()) {
            add_points(head.points(), true);
        } else if Some(head.pattern) == pairs.complete {
            add_block(kernel, (stencil, None), inputs, (planes, head));
        } else {
            let bonds = (&stencil[..], Some(blocks.weights(block)));
            add_block(kernel, bonds, inputs, (planes, head));
        }
    }
    let Half { stencil, blocks } = &pairs.behind;
    for block in section.behind.clone() {
        let head = blocks.head[block];
        if !is_whole(head.points()) {
            add_points(head.points(), false);
            continue;
        }
        let bonds = (&stencil[..], Some(blocks.weights(block)));
        let sums = sum_lanes::<I, O, BLOCK>(kernel, bonds, inputs, head.slot as usize);
        for (lane, sums) in sums.iter().enumerate().take(head.len as usize) {
            (0..O).for_each(|o| planes.add(o, head.slot as usize + lane, [sums[o]]));
        }
    }
}

/// Adds what the bonds ahead of a block give both of their ends. Bonds without weight, and lanes that are no points,
/// give nothing, whatever the kernel computes there.
#[inline(always)]
fn add_block<const I: usize, const O: usize, K: BondKernel<I, O>>(
    kernel: &K,
    (stencil, weights): (&[StencilBond], Option<&[Weights]>),
    inputs: &[&[f64]; I],
    (planes, head): (&Planes, Head),
) {
    let slot = head.slot as usize;
    let own: [[f64; BLOCK]; I] = std::array::from_fn(|i| lanes(inputs[i], slot));
    let mut sums = [[0.0; BLOCK]; O];
    for (number, &StencilBond { offset, bond }) in stencil.iter().enumerate() {
        let at = slot.wrapping_add_signed(offset);
        let other: [[f64; BLOCK]; I] = std::array::from_fn(|i| lanes(inputs[i], at));
        let mut others: [[f64; BLOCK]; O] = std::array::from_fn(|o| match o < K::PAIRED {
            true => planes.get(o, at),
            false => [0.0; BLOCK],
        });
        for lane in 0..BLOCK {
            let bond = weights.map_or(bond, |weights| Bond {
                weight: weights[number][0][lane],
                dual: weights[number][1][lane],
                ..bond
            });
            let mut here: [f64; O] =
                std::array::from_fn(|o| if o < K::PAIRED { sums[o][lane] } else { 0.0 });
            let mut there: [f64; O] = std::array::from_fn(|o| others[o][lane]);
            let own = std::array::from_fn(|i| own[i][lane]);
            let other = std::array::from_fn(|i| other[i][lane]);
            let both = [&mut here, &mut there];
            kernel.add_ends(&bond, own, other, both);
            // the inputs of a slot without a point may give anything, not a number included
            let counts = weights.is_none() || bond.weight + bond.dual != 0.0;
            for o in 0..K::PAIRED {
                sums[o][lane] = if counts { here[o] } else { sums[o][lane] };
                others[o][lane] = if counts { there[o] } else { others[o][lane] };
            }
            for o in K::PAIRED..O {
                sums[o][lane] += if counts { here[o] } else { 0.0 };
            }
        }
        for (o, others) in others.into_iter().enumerate().take(K::PAIRED) {
            planes.set(o, at, others);
        }
    }
    for (o, &sums) in sums.iter().enumerate() {
        planes.add(o, slot, sums);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, Face, Store};
    use crate::family::{BrokenBonds, Correction, FamilySpec, Mirrored, SlotField};
    use crate::shape::{BoxShape, Shape};

    /// Something that pulls ends together, of finite length, and a sum for one end only.
    struct Pull;

    impl BondKernel<3, 4> for Pull {
        const PAIRED: usize = 3;

        #[inline(always)]
        fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 4] {
            let y: [f64; 3] = std::array::from_fn(|a| bond.xi[a] + other[a] - own[a]);
            let length = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt();
            let pull = bond.mean() * (1.0 / bond.length - 1.0 / length);
            [pull * y[0], pull * y[1], pull * y[2], bond.length]
        }
    }

    /// Each end gets its own weight.
    struct Weigh;

    impl BondKernel<0, 1> for Weigh {
        const PAIRED: usize = 1;

        #[inline(always)]
        fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 1] {
            [bond.weight]
        }

        #[inline(always)]
        fn ends(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [[f64; 1]; 2] {
            [[bond.weight], [bond.dual]]
        }
    }

    fn families(dimension: usize, layers: &[Face]) -> [Family; 2] {
        let max = [19.0, 23.0, if dimension == 3 { 17.0 } else { 1.0 }];
        let min = [0.0; 3];
        let shape = Shape::Box(BoxShape { min, max });
        let mut body = Body::fill("block", &shape, dimension, 1.0, 1.0).expect("valid");
        let spec = FamilySpec {
            correction: Correction::Point,
            layers: layers.to_vec(),
            ..FamilySpec::new(3.0)
        };
        [Store::Lattice, Store::List].map(|store| {
            body.store = store;
            Family::build(&body, &spec).expect("valid")
        })
    }

    /// Displacements that differ from slot to slot of points, and go on behind the faces.
    fn displacement(family: &Family) -> [SlotField; 3] {
        std::array::from_fn(|axis| {
            let value = |point: usize| 0.05 * ((point * (axis + 3)) as f64).sin();
            let mut slots = SlotField::default();
            slots.load(family, value, Mirrored::Scalar);
            slots
        })
    }

    fn forces(family: &Family, broken: Option<&BrokenBonds>) -> Vec<[f64; 4]> {
        let slots = displacement(family);
        let mut sums = vec![[0.0; 4]; family.points];
        let inputs = slots.each_ref().map(|s| &s[..]);
        family.sum_unbroken(&Pull, inputs, broken, &mut sums);
        sums
    }

    #[test]
    fn ends_get_what_each_gets_from_its_own_bonds() {
        for dimension in [2, 3] {
            for layers in [&[][..], &[Face::XMin, Face::YMax], &Face::ALL[..4]] {
                let [lattice, list] = families(dimension, layers);
                assert!(Pairs::new(&lattice).is_some() && Pairs::new(&list).is_none());
                let mut broken = [lattice.unbroken(), list.unbroken()];
                for crack in [false, true] {
                    if crack {
                        for (family, broken) in [&lattice, &list].into_iter().zip(&mut broken) {
                            let point_in = family.points_of_slots();
                            for point in (40..200).step_by(7) {
                                for other in [point + 1, point + 2, point + 19, point + 37] {
                                    family.break_pair([point, other], &point_in, broken);
                                }
                            }
                        }
                    }
                    let [ours, rows] = [(&lattice, &broken[0]), (&list, &broken[1])]
                        .map(|(family, broken)| forces(family, Some(broken)));
                    for (point, (a, b)) in ours.iter().zip(&rows).enumerate() {
                        for axis in 0..3 {
                            assert!((a[axis] - b[axis]).abs() < 1e-14, "{point}: {a:?} {b:?}");
                        }
                    }
                    if layers.is_empty() {
                        let total =
                            |sums: &[[f64; 4]], o: usize| sums.iter().map(|s| s[o]).sum::<f64>();
                        (0..3).for_each(|axis| assert!(total(&ours, axis).abs() < 1e-12));
                        let lengths = [total(&ours, 3), total(&rows, 3) / 2.0];
                        assert!((lengths[0] / lengths[1] - 1.0).abs() < 1e-12, "{lengths:?}");
                    }
                }
                let weights = [&lattice, &list].map(|family| {
                    let mut sums = vec![[0.0]; family.points];
                    family.sum(&Weigh, [], &mut sums);
                    sums
                });
                let differ = weights[0].iter().zip(&weights[1]);
                assert!(differ.clone().all(|([a], [b])| (a - b).abs() < 1e-14));
            }
        }
    }

    #[test]
    fn boxes_of_one_colour_keep_apart_in_bodies_of_all_sizes() {
        for dimension in [2, 3] {
            for horizon in [1.0, 2.0, 3.0, 4.0] {
                for rows in (1..75).step_by(if dimension == 2 { 1 } else { 3 }) {
                    let max = [
                        9.0,
                        f64::from(rows),
                        if dimension == 3 { 13.0 } else { 1.0 },
                    ];
                    let min = [0.0; 3];
                    let shape = Shape::Box(BoxShape { min, max });
                    let body = Body::fill("block", &shape, dimension, 1.0, 1.0).expect("valid");
                    let spec = FamilySpec {
                        correction: Correction::Lattice,
                        ..FamilySpec::new(horizon)
                    };
                    let family = Family::build(&body, &spec).expect("valid");
                    // checked there
                    assert!(Pairs::new(&family).is_some());
                }
            }
        }
    }

    #[test]
    fn sums_do_not_depend_on_the_number_of_threads() {
        let [family, _] = families(3, &[Face::ZMin]);
        let sums = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| forces(&family, None))
        });
        assert!(sums[0] == sums[1] && sums[0] == sums[2]);
    }
}
