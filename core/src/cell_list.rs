//! Cell list: which of many points may lie near a position.
//!
//! Points are sorted into a grid of bins by a counting sort; [`CellList::update`] keeps its
//! memory, so that moving points cost no allocation. Every point carries a reach (m), so that
//! points with horizons of their own find each other from either side. Points without a finite position, as of a
//! run that has blown up, are in no bin and near nothing.

use nalgebra::Vector3;

/// Bins per point at most: beyond, empty bins cost more than they save.
const BINS_PER_POINT: f64 = 4.0;

/// Rounding of distances, relative.
const NEAR: f64 = 1e-8;

/// Coordinates beyond this (m) count as infinite, so that squares of distances stay finite.
const FARTHEST: f64 = 1e100;

/// Bin of a point without a finite position.
const NO_BIN: u32 = u32::MAX;

fn is_somewhere(position: &Vector3<f64>) -> bool {
    position.iter().all(|x| x.abs() < FARTHEST)
}

/// Points by bins.
#[derive(Clone, Debug, Default)]
pub struct CellList {
    origin: Vector3<f64>,
    edge: f64,
    bins: [usize; 3],
    /// First member of each bin, and the number of points.
    start: Vec<u32>,
    /// Points by bin, ascending within one.
    member: Vec<u32>,
    bin_of_point: Vec<u32>,
    /// Largest reach of the points of each bin, m; negative in an empty one.
    reach: Vec<f64>,
    largest_reach: f64,
}

impl CellList {
    /// A list of `positions` (m), each with the distance from which it must be found (m).
    pub fn new(positions: &[Vector3<f64>], reach: &[f64]) -> Self {
        let mut list = CellList::default();
        list.update(positions, reach);
        list
    }

    /// Sorts the points again.
    ///
    /// # Panics
    /// When there is not one reach for each position.
    pub fn update(&mut self, positions: &[Vector3<f64>], reach: &[f64]) {
        assert_eq!(positions.len(), reach.len(), "one reach for each point");
        let placed = || positions.iter().filter(|x| is_somewhere(x));
        if placed().next().is_none() {
            *self = CellList::default();
            return;
        }
        let low = placed().fold(Vector3::repeat(f64::INFINITY), |low, x| low.inf(x));
        let high = placed().fold(Vector3::repeat(f64::NEG_INFINITY), |high, x| high.sup(x));
        let extent = high - low;
        // bins of half the shortest reach: a ball is covered closely
        let shortest = reach.iter().copied().fold(f64::INFINITY, f64::min);
        let mut edge = (0.5 * shortest)
            .max(1e-9 * extent.norm())
            .max(f64::MIN_POSITIVE);
        let count = |edge: f64| extent.map(|x| (x / edge).floor() + 1.0);
        while count(edge).product() > BINS_PER_POINT * positions.len() as f64 + 64.0 {
            edge *= 1.25;
        }
        (self.origin, self.edge) = (low, edge);
        self.bins = count(edge).map(|n| n as usize).into();
        let bins: usize = self.bins.iter().product();

        self.bin_of_point.clear();
        for x in positions {
            let bin = match is_somewhere(x) {
                true => self.index(self.bin(x)) as u32,
                false => NO_BIN,
            };
            self.bin_of_point.push(bin);
        }
        self.start.clear();
        self.start.resize(bins + 1, 0);
        self.reach.clear();
        self.reach.resize(bins, -1.0);
        let reaches = self.bin_of_point.iter().zip(reach);
        for (&bin, &reach) in reaches.filter(|(bin, _)| **bin != NO_BIN) {
            self.start[bin as usize + 1] += 1;
            let largest = &mut self.reach[bin as usize];
            *largest = largest.max(reach);
        }
        for bin in 0..bins {
            self.start[bin + 1] += self.start[bin];
        }
        self.member.clear();
        let members = self.start[bins];
        self.member.resize(members as usize, 0);
        // filled from the back: `start` ends as the first member of each bin
        let points = self.bin_of_point.iter().enumerate().rev();
        for (point, &bin) in points.filter(|(_, bin)| **bin != NO_BIN) {
            let end = &mut self.start[bin as usize + 1];
            *end -= 1;
            self.member[*end as usize] = point as u32;
        }
        self.start.rotate_left(1);
        self.start[bins] = members;
        self.largest_reach = self.reach.iter().copied().fold(0.0, f64::max);
    }

    /// Passes all points that may lie within `reach` (m) of `at`, or `at` within theirs, to
    /// `visit`, and some others: distances are for the caller to check.
    pub fn visit_near(&self, at: &Vector3<f64>, reach: f64, mut visit: impl FnMut(usize)) {
        if self.member.is_empty() || !is_somewhere(at) {
            return;
        }
        let widest = reach.max(self.largest_reach) * (1.0 + NEAR);
        let low = self.bin(&at.map(|x| x - widest));
        let high = self.bin(&at.map(|x| x + widest));
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                for i in low[0]..=high[0] {
                    let bin = self.index([i, j, k]);
                    if self.reach[bin] < 0.0 {
                        continue;
                    }
                    let within = reach.max(self.reach[bin]) * (1.0 + NEAR);
                    if self.distance_squared([i, j, k], at) <= within * within {
                        let members = self.start[bin] as usize..self.start[bin + 1] as usize;
                        self.member[members].iter().for_each(|&p| visit(p as usize));
                    }
                }
            }
        }
    }

    /// Bin at a position, or the nearest one.
    fn bin(&self, at: &Vector3<f64>) -> [usize; 3] {
        std::array::from_fn(|a| {
            let bin = ((at[a] - self.origin[a]) / self.edge).floor().max(0.0);
            (bin as usize).min(self.bins[a] - 1)
        })
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.bins[1] + j) * self.bins[0] + i
    }

    fn distance_squared(&self, bin: [usize; 3], at: &Vector3<f64>) -> f64 {
        (0..3)
            .map(|a| {
                let low = self.origin[a] + bin[a] as f64 * self.edge;
                // rounding puts a point on an edge into either bin
                let slack = NEAR * self.edge;
                let out = (low - slack - at[a]).max(at[a] - low - self.edge - slack);
                out.max(0.0).powi(2)
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_pairs_within_either_reach_are_found(
            points in prop::collection::vec((prop::array::uniform3(0.0..1.0f64), 0.02..0.5f64), 1..80),
            flat in any::<bool>(),
        ) {
            let depth = if flat { 0.0 } else { 1.0 };
            let place = |x: &[f64; 3]| Vector3::new(x[0], x[1], depth * x[2]);
            let positions: Vec<_> = points.iter().map(|(x, _)| place(x)).collect();
            let reach: Vec<f64> = points.iter().map(|(_, r)| *r).collect();
            // what a list held before does not matter
            let mut list = CellList::new(&[Vector3::zeros(), Vector3::repeat(9.0)], &[1.0, 2.0]);
            list.update(&positions, &reach);
            for i in 0..points.len() {
                let near = |j: &usize| (positions[i] - positions[*j]).norm() <= reach[i].max(reach[*j]);
                let mut found = Vec::new();
                list.visit_near(&positions[i], reach[i], |j| found.push(j));
                found.retain(near);
                found.sort_unstable();
                prop_assert_eq!(found, (0..points.len()).filter(near).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn points_without_a_finite_position_are_near_nothing() {
        let far = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e300];
        let mut positions = vec![Vector3::zeros(), Vector3::x()];
        positions.extend(far.map(|x| Vector3::new(0.5, x, 0.0)));
        let list = CellList::new(&positions, &[2.0; 6]);
        for (at, expected) in positions.iter().zip([2, 2, 0, 0, 0, 0]) {
            let mut found = 0;
            list.visit_near(at, 2.0, |point| {
                assert!(point < 2, "{point} lies nowhere");
                found += 1;
            });
            assert_eq!(found, expected);
        }
        let list = CellList::new(&positions[2..], &[2.0; 4]);
        list.visit_near(&Vector3::zeros(), 2.0, |_| panic!("the list is empty"));
    }
}
