//! The points nearest to a position.

use std::ops::Range;

use nalgebra::Vector3;

/// Points of a part of the tree that is searched one by one.
const LEAF: usize = 8;

/// A k-d tree: each range of points is split at its median along its longest extent.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    /// In the order of the tree.
    positions: Vec<Vector3<f64>>,
    /// Number of each point in the list that was given.
    number: Vec<u32>,
    /// Axis along which the range whose median this point is was split.
    axis: Vec<u8>,
}

/// A point with the square of its distance (m²).
pub(super) type Near = (f64, u32);

impl Tree {
    pub(super) fn new(positions: &[Vector3<f64>]) -> Self {
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        let mut axis = vec![0; order.len()];
        split(positions, &mut order, &mut axis);
        Tree {
            positions: order.iter().map(|&p| positions[p as usize]).collect(),
            number: order,
            axis,
        }
    }

    /// Up to `count` points nearest to a position (m), the nearest first.
    pub(super) fn nearest(&self, at: &Vector3<f64>, count: usize) -> Vec<Near> {
        let mut found = Vec::with_capacity(count + 1);
        self.search(0..self.positions.len(), at, count, &mut found);
        found
    }

    fn search(&self, range: Range<usize>, at: &Vector3<f64>, count: usize, found: &mut Vec<Near>) {
        if range.len() <= LEAF {
            range.for_each(|place| self.take(place, at, count, found));
            return;
        }
        let middle = range.start + range.len() / 2;
        let axis = self.axis[middle] as usize;
        let beyond = at[axis] - self.positions[middle][axis];
        let (below, above) = (range.start..middle, middle + 1..range.end);
        let (near, far) = if beyond < 0.0 {
            (below, above)
        } else {
            (above, below)
        };
        self.search(near, at, count, found);
        self.take(middle, at, count, found);
        let is_far =
            found.len() == count && found.last().is_some_and(|(d, _)| beyond * beyond > *d);
        if !is_far {
            self.search(far, at, count, found);
        }
    }

    fn take(&self, place: usize, at: &Vector3<f64>, count: usize, found: &mut Vec<Near>) {
        let point = (
            (self.positions[place] - at).norm_squared(),
            self.number[place],
        );
        let rank = found.partition_point(|other| (other.0, other.1) < point);
        if rank < count {
            found.truncate(count.saturating_sub(1).max(rank));
            found.insert(rank, point);
        }
    }
}

fn split(positions: &[Vector3<f64>], order: &mut [u32], axes: &mut [u8]) {
    if order.len() <= LEAF {
        return;
    }
    let mut extents = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    for &point in order.iter() {
        for (extent, x) in extents.iter_mut().zip(positions[point as usize].iter()) {
            *extent = [extent[0].min(*x), extent[1].max(*x)];
        }
    }
    let length = |axis: &usize| extents[*axis][1] - extents[*axis][0];
    let axis = (0..3).max_by(|a, b| length(a).total_cmp(&length(b)));
    let axis = axis.expect("there are three axes");
    let middle = order.len() / 2;
    let along = |point: &u32| positions[*point as usize][axis];
    order.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
    axes[middle] = axis as u8;
    let (below, above) = order.split_at_mut(middle);
    let (axes_below, axes_above) = axes.split_at_mut(middle);
    split(positions, below, axes_below);
    split(positions, &mut above[1..], &mut axes_above[1..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_points_are_those_of_a_full_search(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0), 1..200),
            at in prop::array::uniform3(-2.0..2.0),
            count in 1_usize..30,
        ) {
            // a third of the points lies in a plane, with ties
            let positions: Vec<Vector3<f64>> = points.iter().enumerate()
                .map(|(i, p)| Vector3::new(p[0], p[1], if i % 3 == 0 { 0.5 } else { p[2] })).collect();
            let at = Vector3::from(at);
            let mut expected: Vec<Near> = positions.iter().zip(0..).map(|(p, i)| ((p - at).norm_squared(), i)).collect();
            expected.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            expected.truncate(count);
            prop_assert_eq!(Tree::new(&positions).nearest(&at, count), expected);
        }
    }
}
