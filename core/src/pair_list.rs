//! Pairs of points of two bodies, or of one, that lie close to each other now: what contact, heat between bodies and other
//! exchanges sum over.
//!
//! The list is made with a skin and serves until a point has moved by half of its skin. What is done with a pair must
//! vanish beyond the reach: then results do not depend on when the list was made.

use nalgebra::Vector3;

use crate::cell_list::CellList;
use crate::neighbours::{self, FoundAt, Reaching};
use crate::world::{BodyIndex, World};

/// Width of the skin as a fraction of the reach.
const SKIN: f64 = 0.2;

/// Pairs of close points. Points are numbered through: those of the first body, then those of the second.
#[derive(Debug)]
pub struct PairList {
    bodies: Vec<BodyIndex>,
    /// Number of points of the first body.
    first: usize,
    /// By point, m.
    reach: Vec<f64>,
    /// By point, now, m.
    position: Vec<Vector3<f64>>,
    cells: CellList,
    found_at: FoundAt,
    start: Vec<u32>,
    other: Vec<u32>,
    version: u64,
}

impl PairList {
    /// Pairs of points of one body that are closer than the mean of their `reach` (m, by point).
    pub fn within(body: BodyIndex, reach: Vec<f64>) -> PairList {
        PairList::new(vec![body], reach.len(), reach)
    }

    /// Pairs of a point of each of two bodies that are closer than the mean of their `reach` (m, by point).
    pub fn between(bodies: [BodyIndex; 2], [first, second]: [Vec<f64>; 2]) -> PairList {
        let points = first.len();
        PairList::new(bodies.to_vec(), points, [first, second].concat())
    }

    fn new(bodies: Vec<BodyIndex>, first: usize, reach: Vec<f64>) -> PairList {
        PairList {
            bodies,
            first,
            position: vec![Vector3::zeros(); reach.len()],
            cells: CellList::default(),
            found_at: FoundAt::default(),
            start: Vec::new(),
            other: Vec::new(),
            version: 0,
            reach,
        }
    }

    /// Number of points of the first body, where the points of the second one begin.
    pub fn first_points(&self) -> usize {
        self.first
    }

    /// Positions of all points at the last update, m.
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.position
    }

    /// Changes whenever the candidates change.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Points that may be within reach of a point, ascending; each pair is seen from both ends.
    pub fn candidates(&self, point: usize) -> &[u32] {
        &self.other[self.range(point)]
    }

    /// Range of the [`candidates`](PairList::candidates) of a point among those of all points.
    pub fn range(&self, point: usize) -> std::ops::Range<usize> {
        self.start[point] as usize..self.start[point + 1] as usize
    }

    /// Number of candidates of all points.
    pub fn len(&self) -> usize {
        self.other.len()
    }

    /// Whether there is no pair.
    pub fn is_empty(&self) -> bool {
        self.other.is_empty()
    }

    /// Updates the positions and, if points have moved far, finds the pairs again.
    pub fn update(&mut self, world: &World) {
        let mut rest = &mut self.position[..];
        for &body in &self.bodies {
            let (own, others) = rest.split_at_mut(world.body(body).points.len());
            own.copy_from_slice(world.configuration(body).positions());
            rest = others;
        }
        let skin = |point: usize| SKIN * self.reach[point];
        if self.found_at.is_outdated(&self.position, skin) {
            self.find();
        }
    }

    fn find(&mut self) {
        let reach: Vec<f64> = self.reach.iter().map(|r| (1.0 + SKIN) * r).collect();
        let points = Reaching {
            positions: &self.position,
            reach: &reach,
        };
        let (several, first) = (self.bodies.len() > 1, self.first);
        let within = |i: usize, j: usize| {
            let meets = match several {
                true => (i < first) != (j < first),
                false => i != j,
            };
            // the skin of either may be used up
            meets.then(|| 0.5 * (reach[i] + reach[j]))
        };
        let rows = neighbours::find(&mut self.cells, points, points, within);
        self.found_at.set(&self.position);
        self.start.clear();
        self.other.clear();
        self.start.push(0);
        for row in rows {
            self.other.extend(row);
            self.start.push(self.other.len() as u32);
        }
        self.version += 1;
    }
}
