//! Broken bonds: one bit for each bond, beside a family that stays as it was built.

use super::store::BondReceiver;
use super::{Bond, CloudRows, Family, Store};
use crate::point_rows::PointRows;

/// Which bonds of a family are broken; they never heal. Both directions of a bond break together. In the family of a part, remote
/// points have bits, too, for their bonds with the points of the part.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BrokenBonds {
    /// Number of points that the family owns.
    owned: usize,
    /// Words of a point.
    stride: usize,
    /// A bit for each bond in the order of the point's family.
    words: Vec<u64>,
    /// Broken bonds of each point.
    count: Vec<u32>,
}

impl BrokenBonds {
    /// None of `bonds` bonds of each of `points` points.
    #[must_use]
    pub fn none(points: usize, bonds: usize) -> Self {
        BrokenBonds::of_part([points; 2], bonds)
    }

    /// As [`BrokenBonds::none`], of a number of points that are owned, and of all points.
    fn of_part([owned, all]: [usize; 2], bonds: usize) -> Self {
        let stride = bonds.div_ceil(64);
        BrokenBonds {
            owned,
            stride,
            words: vec![0; all * stride],
            count: vec![0; all],
        }
    }

    /// None of the same bonds.
    #[must_use]
    pub fn unbroken(&self) -> Self {
        BrokenBonds {
            words: vec![0; self.words.len()],
            count: vec![0; self.count.len()],
            ..*self
        }
    }

    /// Number of broken bonds of a point.
    pub fn of(&self, point: usize) -> usize {
        self.count[point] as usize
    }

    /// Number of broken bonds of the points that the family owns, each end counted.
    pub fn total(&self) -> usize {
        self.count[..self.owned].iter().map(|c| *c as usize).sum()
    }

    /// The bits of the points that the family owns and that have broken bonds.
    pub fn rows(&self) -> PointRows {
        let points = (0..self.owned).filter(|point| self.count[*point] > 0);
        let mut rows = PointRows::default();
        points
            .for_each(|point| rows.push(point, &self.words[point * self.stride..][..self.stride]));
        rows
    }

    /// Breaks the bonds of rows that [`BrokenBonds::rows`] gave; `false` where they are not of this family.
    #[must_use]
    pub fn break_rows(&mut self, rows: &PointRows) -> bool {
        if !rows.is_valid(self.count.len(), self.stride) {
            return false;
        }
        for (point, words) in rows.iter(self.stride) {
            let own = &mut self.words[point * self.stride..][..self.stride];
            own.iter_mut().zip(words).for_each(|(own, new)| *own |= new);
            self.count[point] = own.iter().map(|word| word.count_ones()).sum();
        }
        true
    }

    /// The bits of a point; empty where no bond is broken.
    #[inline(always)]
    pub(super) fn bits(&self, point: usize) -> Bits<'_> {
        match self.count[point] {
            0 => Bits(&[]),
            _ => Bits(&self.words[point * self.stride..][..self.stride]),
        }
    }

    #[inline(always)]
    pub(super) fn is_whole(&self, points: std::ops::Range<usize>) -> bool {
        self.count[points].iter().all(|c| *c == 0)
    }

    /// Whether a bond of a point is broken; `bond` counts as [`Family::for_each_bond`] does.
    pub fn is_broken(&self, point: usize, bond: usize) -> bool {
        self.bits(point).is_broken(bond)
    }

    /// Breaks one direction of a bond: the caller breaks the other.
    pub fn break_bond(&mut self, point: usize, bond: usize) {
        let word = &mut self.words[point * self.stride + bond / 64];
        self.count[point] += u32::from(*word >> (bond % 64) & 1 == 0);
        *word |= 1 << (bond % 64);
    }
}

/// The bits of one point.
#[derive(Clone, Copy)]
pub(super) struct Bits<'a>(&'a [u64]);

impl Bits<'_> {
    pub(super) const NONE: Bits<'static> = Bits(&[]);

    #[inline(always)]
    pub(super) fn is_broken(self, bond: usize) -> bool {
        self.0
            .get(bond / 64)
            .is_some_and(|word| word >> (bond % 64) & 1 == 1)
    }

    #[inline(always)]
    pub(super) fn any(self) -> bool {
        !self.0.is_empty()
    }
}

impl Family {
    /// No bond broken.
    pub fn unbroken(&self) -> BrokenBonds {
        self.unbroken_of(self.most_bonds())
    }

    /// No bond broken, with room for this number of bonds of each point: the largest one of all processes has rows of the same length in each of them.
    pub fn unbroken_of(&self, bonds: usize) -> BrokenBonds {
        BrokenBonds::of_part([self.points, self.of_body], bonds)
    }

    /// The number of bonds of a point at most.
    pub fn most_bonds(&self) -> usize {
        let stencil = self.store.stencil_bonds().map(|b| b.stencil.bonds.len());
        let rows = self.store.rows().map_or(&[][..], |rows| &rows.start);
        let longest = rows.windows(2).map(|s| s[1] - s[0]).max();
        // blocks count as the stencil does
        stencil.or(longest).unwrap_or(0)
    }

    /// Breaks the bonds that `points` have with each other and with each other's images; `point_in`
    /// is [`Family::points_of_slots`]. Nothing happens where there are none.
    pub fn break_pair(&self, points: [u32; 2], point_in: &[u32], broken: &mut BrokenBonds) {
        for [point, other] in [points, [points[1], points[0]]] {
            if point as usize >= self.points {
                self.break_remote(point as usize, self.slot_of(other as usize), broken);
                continue;
            }
            self.for_each_bond(point as usize, |number, _, slot| {
                if point_in[slot] == other {
                    broken.break_bond(point as usize, number);
                }
            });
        }
    }

    /// Breaks the bond of a remote point with the point of the family in a slot, if there is one. Sums that visit the bonds of a lattice from one end need
    /// it; in a cloud remote points have no bonds.
    pub fn break_remote(&self, remote: usize, slot: usize, broken: &mut BrokenBonds) {
        let (Some(bonds), Some(at)) = (self.store.stencil_bonds(), self.slot_of_remote(remote))
        else {
            return;
        };
        let stencil = bonds.stencil.bonds.iter();
        let mut others = stencil.map(|bond| at.wrapping_add_signed(bond.offset));
        if let Some(number) = others.position(|other| other == slot) {
            broken.break_bond(remote, number);
        }
    }

    /// The points of the family that have bonds with remote ones.
    pub fn points_beside_remote(&self) -> Vec<u32> {
        let mut is_remote = vec![false; self.slots.len];
        for (slot, _) in &self.slots.remote {
            is_remote[*slot as usize] = true;
        }
        let reaches = |point: &u32| {
            let mut any = false;
            self.for_each_bond(*point as usize, |_, _, slot| any |= is_remote[slot]);
            any
        };
        match self.slots.remote.is_empty() {
            true => Vec::new(),
            false => (0..self.points as u32).filter(reaches).collect(),
        }
    }

    /// The point in a slot, owned or remote; `None` for layer points and empty slots.
    pub fn any_point_in(&self, slot: usize) -> Option<usize> {
        self.point_in(slot).or_else(|| {
            let remote = &self.slots.remote;
            let place = remote.binary_search_by_key(&slot, |(slot, _)| *slot as usize);
            place.ok().map(|place| remote[place].1 as usize)
        })
    }

    /// The slot of a remote point, if bonds reach it.
    fn slot_of_remote(&self, point: usize) -> Option<usize> {
        let remote = &self.slots.remote;
        let place = remote.binary_search_by_key(&point, |(_, point)| *point as usize);
        place.ok().map(|place| remote[place].0 as usize)
    }

    /// All bonds of a point: number in its family, bond, slot of the other end.
    #[inline]
    pub fn for_each_bond(&self, point: usize, mut receive: impl FnMut(usize, &Bond, usize)) {
        self.pass_bonds(point, &mut receive);
    }

    /// The call is dynamic, so that the loop is compiled once.
    pub(super) fn pass_bonds(&self, point: usize, receive: BondReceiver<'_>) {
        if self.store.growth().is_some_and(|g| g.is_unborn(point)) {
            return;
        }
        let here = self.slot_of(point);
        match &self.store {
            Store::Lattice(bonds, _) | Store::Growing(bonds, _) => {
                bonds.for_each_bond(point, here, receive);
            }
            // each point has a row
            Store::List(stencil, rows) => stencil.for_each_bond(rows, point, receive),
            // rows are in the order of slots
            Store::Cloud(CloudRows { places, rows })
            | Store::Moving(CloudRows { places, rows }, _) => {
                places.for_each_bond(rows, here, receive);
            }
        }
    }

    /// Whether the bonds of a point have the weights of the stencil.
    pub fn shares_stencil(&self, point: usize) -> bool {
        let runs = self.store.stencil_bonds().map_or(&[][..], |b| &b.runs);
        let after = runs.partition_point(|r| r.point as usize <= point);
        let run = after.checked_sub(1).map(|run| runs[run]);
        run.is_some_and(|r| point < (r.point + r.len) as usize)
    }

    /// The slot of a point.
    pub fn slot_of(&self, point: usize) -> usize {
        self.slots.points.of(point)
    }

    /// The point in a slot; `None` for layer points and empty slots.
    pub fn point_in(&self, slot: usize) -> Option<usize> {
        self.slots.points.point_in(slot)
    }

    /// By slot, the point that it carries or is the image of; [`u32::MAX`] where there is neither.
    pub fn points_of_slots(&self) -> Vec<u32> {
        let mut points = vec![u32::MAX; self.slots.len];
        (0..self.points as u32).for_each(|p| points[self.slot_of(p as usize)] = p);
        for &(slot, point) in &self.slots.remote {
            points[slot as usize] = point;
        }
        for ghost in &self.slots.ghosts {
            points[ghost.slot as usize] = ghost.point;
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, Store};
    use crate::family::{BondKernel, FamilySpec, Mirrored, SlotField};
    use crate::shape::{BoxShape, Shape};

    struct Count;
    impl BondKernel<1, 1> for Count {
        #[inline(always)]
        fn bond(&self, bond: &Bond, _: [f64; 1], _: [f64; 1]) -> [f64; 1] {
            [bond.weight]
        }
    }

    fn block(dimension: usize) -> Body {
        let size = [40.0, 12.0, if dimension == 3 { 8.0 } else { 1.0 }];
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: size,
        });
        Body::fill("block", &shape, dimension, 1.0, 1.0).expect("valid")
    }

    #[test]
    fn a_bond_that_breaks_again_counts_once() {
        let family = Family::build(&block(2), &FamilySpec::new(3.0)).expect("valid");
        let mut broken = family.unbroken();
        for bond in [0, 3, 17, 3, 0] {
            broken.break_bond(100, bond);
        }
        assert_eq!((broken.of(100), broken.of(99)), (3, 0));
        assert!(broken.is_broken(100, 17) && !broken.is_broken(100, 16));
    }

    #[test]
    fn sums_skip_broken_bonds_in_every_store() {
        for dimension in [1, 2, 3] {
            let mut body = block(dimension);
            let mut sums = Vec::new();
            for store in [Store::Lattice, Store::List] {
                body.store = store;
                let family = Family::build(&body, &FamilySpec::new(3.0)).expect("valid");
                let value = |x: &nalgebra::Vector3<f64>| if x.x < 20.0 { -1.0 } else { 1.0 };
                let values: Vec<f64> = body.points.position.iter().map(value).collect();
                let mut slots = SlotField::default();
                slots.load(&family, &values[..], Mirrored::Scalar);
                let mut broken = family.unbroken();
                let mut lost = vec![0.0; values.len()];
                for (point, lost) in lost.iter_mut().enumerate() {
                    family.for_each_bond(point, |number, bond, other| {
                        if slots[other] * values[point] < 0.0 {
                            broken.break_bond(point, number);
                            *lost += bond.weight;
                        }
                    });
                }
                let (mut all, mut left) = (vec![[0.0]; lost.len()], vec![[0.0]; lost.len()]);
                family.sum(&Count, [&slots], &mut all);
                family.sum_unbroken(&Count, [&slots], Some(&broken), &mut left);
                for point in 0..lost.len() {
                    let expected = all[point][0] - lost[point];
                    assert!((left[point][0] - expected).abs() < 1e-12 * all[point][0]);
                    let near = (body.points.position.at(point).x - 20.0).abs() < 3.0;
                    assert_eq!(broken.of(point) > 0, near, "at {point}");
                }
                sums.push(left);

                // the same bonds, pair by pair
                let mut again = family.unbroken();
                let point_in = family.points_of_slots();
                for point in 0..values.len() as u32 {
                    for other in 0..point {
                        if values[point as usize] * values[other as usize] < 0.0 {
                            family.break_pair([point, other], &point_in, &mut again);
                        }
                    }
                }
                assert_eq!(again, broken);
            }
            let differ = sums[0].iter().zip(&sums[1]);
            assert!(differ.clone().all(|([a], [b])| (a - b).abs() < 1e-12));
        }
    }
}
