//! Every bond visited once: the sweep of lattices by kernels that give both ends of a bond their part.
//!
//! A bond under finite displacements costs a square root and a division, so it is evaluated once, from the end
//! in the lower slot: *ahead*. Eight points advance together, with their own sums in registers and those of
//! the other ends in memory, in blocks that begin at every eighth cell along x. They are gathered in boxes of rows ([`RowBoxes`]); boxes of one colour write to different
//! rows, so that threads may sweep them at the same time. Neither boxes nor colours depend on the number of threads, so
//! that sums are bit-identical for any number.
//!
//! Layer points have no bonds ahead: bonds with layer points *behind* a point are evaluated from the point.

mod sweep;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::Mutex;

use rayon::prelude::*;

use crate::family::blocks::{BLOCK, BlockBuilder, Blocks, Weights};
use crate::family::{Family, StencilBond, StencilBonds, Store};

/// Rows of a box, about: with more of them fewer inputs are read twice, with fewer more threads are busy.
const ROWS: usize = 12;

/// Boxes whose pairs are gathered by one thread.
const PART_BOXES: usize = 4;

/// The bonds of a lattice, each once.
#[derive(Debug)]
pub(in crate::family) struct Pairs {
    ahead: HalfStencil,
    /// Pattern of blocks of complete families.
    complete: Option<u32>,
    /// Bonds between points and layer points.
    behind: HalfStencil,
    /// By colour.
    boxes: [Vec<BoxBlocks>; 4],
    /// By slot.
    holds_point: Vec<bool>,
    /// Memory of sums by slot, in planes; zero in the slots of points between sweeps.
    work: Mutex<Vec<f64>>,
}

/// The blocks of a box.
#[derive(Debug)]
struct BoxBlocks {
    ahead: Range<usize>,
    behind: Range<usize>,
}

/// Bonds to one side of their points.
#[derive(Debug)]
struct HalfStencil {
    stencil: Vec<StencilBond>,
    /// Number of each bond in the whole stencil.
    numbers: Vec<usize>,
    blocks: Blocks,
}

/// Boxes of rows of a lattice, a row being the cells along x. Boxes next to each other differ in colour: on a plane lattice
/// there are two colours along y, on a lattice of several planes four:
///
/// ```text
/// z
/// ^  | 2 | 3 | 2 | 3 |     height of a box: the planes that a bond reaches, and one
/// |  | 0 | 1 | 0 | 1 |     width of a box: about `ROWS`
/// +--------------------> y
/// ```
///
/// A box writes to its own rows, to those that its bonds reach, and, as a block may run beyond the end of a row, to the
/// one after these. The row after the last one of a plane is the first of the next plane, so that the number across is even.
struct RowBoxes {
    cells: [usize; 3],
    /// The lowest slot along each axis, in those of the whole body, and the number of these.
    in_whole: [[usize; 3]; 2],
    /// How many rows of a plane lattice, or planes of others, a bond reaches.
    reach: usize,
    /// Boxes across a plane of a lattice of several planes.
    across: usize,
}

impl RowBoxes {
    /// Boxes of slots of a lattice; `farthest` is the largest offset of a bond in slots. Boxes are those of the whole body.
    fn new(cells: [usize; 3], in_whole: [[usize; 3]; 2], farthest: usize) -> Self {
        let [_, whole] = in_whole;
        let reach = match whole[2] {
            1 => (farthest + cells[0] / 2) / cells[0],
            _ => (farthest / cells[0] + cells[1] / 2) / cells[1],
        };
        let across = match whole[1] / ROWS.max(2 * reach + 1) {
            0 | 1 => 1,
            boxes => boxes / 2 * 2,
        };
        RowBoxes {
            cells,
            in_whole,
            reach,
            across,
        }
    }

    /// The box of a slot, by its place along y and z.
    fn place_of(&self, slot: usize) -> [usize; 2] {
        let [first, whole] = self.in_whole;
        let row = slot / self.cells[0];
        let (y, z) = (
            row % self.cells[1] + first[1],
            row / self.cells[1] + first[2],
        );
        match whole[2] {
            1 => [y / (self.reach + 1), 0],
            _ => [y * self.across / whole[1], z / (self.reach + 1)],
        }
    }
}

/// A point and its box, in the order in which boxes are swept.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct BoxedPoint {
    colour: usize,
    place: [usize; 2],
    slot: u32,
    point: u32,
}

/// The points of all boxes, remote ones included.
fn boxed_points(family: &Family, boxes: &RowBoxes) -> Vec<BoxedPoint> {
    let spans = family.slots.points.spans().iter();
    let owned = spans.flat_map(|s| (s.slot..).zip(s.point..s.point + s.len));
    let remote = family.slots.remote.iter().copied();
    let boxed = |(slot, point): (u32, u32)| {
        let place = boxes.place_of(slot as usize);
        BoxedPoint {
            colour: place[0] % 2 + 2 * (place[1] % 2),
            place,
            slot,
            point,
        }
    };
    let mut points: Vec<BoxedPoint> = owned.chain(remote).map(boxed).collect();
    points.sort_unstable();
    points
}

/// Bonds ahead of a remote point with points of the family: number in the stencil, weights.
fn ahead_of_remote<'a>(
    family: &'a Family,
    bonds: &'a StencilBonds,
    &BoxedPoint { slot, point, .. }: &BoxedPoint,
) -> impl Iterator<Item = (usize, [f64; 2])> + use<'a> {
    let stencil = bonds.stencil.bonds.iter().enumerate();
    let ahead = stencil.skip(bonds.stencil.bonds.len() / 2);
    let is_owned =
        move |offset: isize| family.point_in((slot as usize).wrapping_add_signed(offset));
    let ahead = ahead.filter(move |(_, bond)| is_owned(bond.offset).is_some());
    ahead.map(move |(number, _)| (number, bonds.weights_of_remote(point, number)))
}

/// By slot, whether it belongs to a point, owned or remote.
fn slots_of_points(family: &Family) -> Vec<bool> {
    let mut holds_point = vec![false; family.slots.len];
    for span in family.slots.points.spans() {
        holds_point[span.slot as usize..][..span.len as usize].fill(true);
    }
    for &(slot, _) in &family.slots.remote {
        holds_point[slot as usize] = true;
    }
    holds_point
}

/// By point of the family, whether its bonds are those of the stencil.
fn even_points(family: &Family, bonds: &StencilBonds) -> Vec<bool> {
    let mut is_even = vec![false; family.points];
    for run in &bonds.runs {
        is_even[run.points()].fill(true);
    }
    is_even
}

/// The first points, if they fill a block and their bonds are those of the stencil.
fn whole_block<'a>(points: &'a [BoxedPoint], is_even: &[bool]) -> Option<&'a [BoxedPoint; BLOCK]> {
    let block: &[BoxedPoint; BLOCK] = points.first_chunk()?;
    let follows = |[a, b]: &[BoxedPoint; 2]| a.slot + 1 == b.slot && a.point + 1 == b.point;
    let is_whole = block.array_windows().all(follows)
        && (block.iter()).all(|b| is_even.get(b.point as usize).is_some_and(|even| *even));
    is_whole.then_some(block)
}

/// Numbers of the bonds ahead, ordered by x, so that consecutive bonds lead to different rows. A load of sums that the
/// bond before it stored in part stalls for longer than a bond takes.
fn order_of(ahead: &[StencilBond]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..ahead.len()).collect();
    order.sort_by(|&a, &b| ahead[a].bond.xi[0].total_cmp(&ahead[b].bond.xi[0]));
    order
}

/// What the pairs of a family follow from.
struct Gathering<'a> {
    family: &'a Family,
    bonds: &'a StencilBonds,
    /// Place of each bond ahead in the order of blocks.
    rank: Vec<usize>,
    /// Weights ahead of a block of complete families.
    whole: Vec<Weights>,
    /// By point, whether its bonds are those of the stencil.
    is_even: Vec<bool>,
    /// By slot.
    holds_point: Vec<bool>,
}

/// The pairs of some boxes.
struct Gathered {
    ahead: BlockBuilder,
    behind: BlockBuilder,
    /// Colours and blocks.
    boxes: Vec<(usize, BoxBlocks)>,
}

impl Gathering<'_> {
    /// The pairs of boxes, by their points.
    fn gather(&self, boxes: &[&[BoxedPoint]]) -> Gathered {
        let mut found = Gathered::new(self.rank.len());
        for points in boxes {
            let first = [found.ahead.len(), found.behind.len()];
            self.add_box(points, &mut found);
            let blocks = BoxBlocks {
                ahead: first[0]..found.ahead.len(),
                behind: first[1]..found.behind.len(),
            };
            found.boxes.push((points[0].colour, blocks));
        }
        found
    }

    fn add_box(&self, mut points: &[BoxedPoint], found: &mut Gathered) {
        let grid = &self.bonds.stencil.grid;
        while let [point, others @ ..] = points {
            // blocks of a part are those of the whole body
            let begins_block = grid.cell_of_row(point.slot as usize).is_multiple_of(BLOCK);
            if begins_block {
                found.ahead.end_block();
                found.behind.end_block();
            }
            match whole_block(points, &self.is_even).filter(|_| begins_block) {
                Some(block) => {
                    self.add_whole_block(block, found);
                    points = &points[BLOCK..];
                }
                None => {
                    self.add_point(point, found);
                    points = others;
                }
            }
        }
    }

    /// Adds a block of points whose bonds are those of the stencil.
    fn add_whole_block(&self, block: &[BoxedPoint; BLOCK], found: &mut Gathered) {
        let BoxedPoint { slot, point, .. } = block[0];
        found.ahead.push_whole(point, slot, &self.whole);
        let (behind, _) = self.bonds.stencil.bonds.split_at(self.rank.len());
        for &BoxedPoint { slot, point, .. } in block {
            let to_layer = |bond: &StencilBond| {
                !self.holds_point[(slot as usize).wrapping_add_signed(bond.offset)]
            };
            let back = behind.iter().enumerate().filter(|(_, b)| to_layer(b));
            let mut back = back.map(|(number, b)| (number, [b.bond.weight, b.bond.dual]));
            if let Some(first) = back.next() {
                (found.behind).push(point, slot, std::iter::once(first).chain(back));
            }
        }
    }

    fn add_point(&self, boxed: &BoxedPoint, found: &mut Gathered) {
        let (family, half) = (self.family, self.rank.len());
        let BoxedPoint { slot, point, .. } = *boxed;
        let (mut back, mut forth) = (Vec::new(), Vec::new());
        if point as usize >= family.points {
            let ahead = ahead_of_remote(family, self.bonds, boxed);
            forth.extend(ahead.map(|(n, weights)| (self.rank[n - half], weights)));
        } else {
            family.for_each_bond(point as usize, |number, bond, other| {
                let weights = [bond.weight, bond.dual];
                if number >= half {
                    forth.push((self.rank[number - half], weights));
                } else if !self.holds_point[other] {
                    back.push((number, weights));
                }
            });
        }
        if !back.is_empty() {
            found.behind.push(point, slot, back.into_iter());
        }
        found.ahead.push(point, slot, forth.into_iter());
    }
}

impl Gathered {
    /// No pairs; `half` is the number of bonds of a complete family to one side.
    fn new(half: usize) -> Self {
        Gathered {
            ahead: BlockBuilder::of_slots(half),
            behind: BlockBuilder::of_slots(half),
            boxes: Vec::new(),
        }
    }

    /// Adds the pairs of the boxes that follow.
    fn append(&mut self, next: Gathered) {
        let [ahead, behind] = [self.ahead.len(), self.behind.len()];
        let behind_own = |blocks: Range<usize>, by: usize| blocks.start + by..blocks.end + by;
        self.boxes
            .extend(next.boxes.into_iter().map(|(colour, blocks)| {
                let blocks = BoxBlocks {
                    ahead: behind_own(blocks.ahead, ahead),
                    behind: behind_own(blocks.behind, behind),
                };
                (colour, blocks)
            }));
        self.ahead.append(next.ahead);
        self.behind.append(next.behind);
    }
}

impl Pairs {
    /// The pairs of a family; `None` on a cloud, for rows, and on a line, whose points are few.
    pub fn new(family: &Family) -> Option<Pairs> {
        let Store::Lattice(bonds, _) = &family.store else {
            return None;
        };
        let (grid, stencil) = (&bonds.stencil.grid, &bonds.stencil.bonds);
        let cells = grid.cells();
        let is_line = cells[1] == 1 && cells[2] == 1;
        if cells[0] < BLOCK || is_line {
            return None;
        }
        let half = stencil.len() / 2;
        let (behind, ahead) = stencil.split_at(half);
        let order = order_of(ahead);
        let mut rank = vec![0; half];
        for (place, &number) in order.iter().enumerate() {
            rank[number] = place;
        }
        let gathering = Gathering {
            family,
            bonds,
            rank,
            whole: (order.iter().map(|&number| ahead[number].bond))
                .map(|bond| [[bond.weight; BLOCK], [bond.dual; BLOCK]])
                .collect(),
            is_even: even_points(family, bonds),
            holds_point: slots_of_points(family),
        };
        let farthest = ahead[half - 1].offset as usize;
        let rows = RowBoxes::new(cells, grid.in_whole(), farthest);
        let points = boxed_points(family, &rows);
        let by_box: Vec<&[BoxedPoint]> = points.chunk_by(|a, b| a.place == b.place).collect();
        let parts = by_box.par_chunks(PART_BOXES);
        let parts: Vec<Gathered> = parts.map(|boxes| gathering.gather(boxes)).collect();
        let mut all = Gathered::new(half);
        parts.into_iter().for_each(|part| all.append(part));
        let mut boxes: [Vec<BoxBlocks>; 4] = Default::default();
        for (colour, blocks) in all.boxes {
            boxes[colour].push(blocks);
        }
        let stencil: Vec<StencilBond> = order.iter().map(|&number| ahead[number]).collect();
        let ahead = HalfStencil {
            stencil,
            numbers: order.iter().map(|number| number + half).collect(),
            blocks: all.ahead.finish(),
        };
        let weights = ahead.stencil.iter().map(|b| [b.bond.weight, b.bond.dual]);
        let pairs = Pairs {
            complete: ahead.blocks.pattern_of(weights),
            ahead,
            behind: HalfStencil {
                stencil: behind.to_vec(),
                numbers: (0..half).collect(),
                blocks: all.behind.finish(),
            },
            boxes,
            holds_point: gathering.holds_point,
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
            for (number, blocks) in boxes.iter().enumerate() {
                // blocks behind contain points of these
                for head in &self.ahead.blocks.head[blocks.ahead.clone()] {
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
