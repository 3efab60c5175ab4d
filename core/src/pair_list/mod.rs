//! Pairs of points of two bodies, or of one, that lie close to each other now: what contact, heat between bodies and other
//! exchanges sum over.
//!
//! The list is made with a skin and serves until a point has moved by half of its skin. What is done with a pair must
//! vanish beyond the reach: then results do not depend on when the list was made.
//!
//! Where several processes share the bodies, each has the pairs of the points that it owns, with those of other processes that are near
//! them; candidates have the same order in all of them.

mod visitors;

use nalgebra::Vector3;

use crate::cell_list::CellList;
use crate::neighbours::{self, FoundAt, Reaching};
use crate::world::{BodyIndex, World};
use visitors::Visitors;

/// Width of the skin as a fraction of the reach.
const SKIN: f64 = 0.2;

/// Pairs of close points. Points are numbered through: those of the first body, those of the second, and those of other processes near
/// them, which change with the candidates.
#[derive(Debug)]
pub struct PairList {
    bodies: Vec<BodyIndex>,
    /// Where the points of each body begin, and where the last of them end.
    begins: Vec<usize>,
    /// By point, m.
    reach: Vec<f64>,
    /// By point, now, m.
    position: Vec<Vector3<f64>>,
    /// By point: its number among those of the whole bodies, numbered through.
    number: Vec<u32>,
    visitors: Visitors,
    cells: CellList,
    found_at: FoundAt,
    start: Vec<u32>,
    other: Vec<u32>,
    version: u64,
}

impl PairList {
    /// Pairs of points of one body that are closer than the mean of their `reach` (m, by point).
    pub fn within(world: &World, body: BodyIndex, reach: &[f64]) -> PairList {
        PairList::new(world, vec![body], &[reach])
    }

    /// Pairs of a point of each of two bodies that are closer than the mean of their `reach` (m, by point).
    pub fn between(world: &World, bodies: [BodyIndex; 2], reach: [&[f64]; 2]) -> PairList {
        PairList::new(world, bodies.to_vec(), &reach)
    }

    fn new(world: &World, bodies: Vec<BodyIndex>, reach_of_body: &[&[f64]]) -> PairList {
        let (mut begins, mut reach, mut number) = (vec![0], Vec::new(), Vec::new());
        let mut points_before = 0;
        for (&body, reach_of_points) in bodies.iter().zip(reach_of_body) {
            let reducer = world.reducer(body);
            let owned = reducer.owned();
            reach.extend_from_slice(&reach_of_points[..owned]);
            number.extend((0..owned).map(|point| points_before + reducer.number(point)));
            points_before += world.points_of_whole(body) as u32;
            begins.push(reach.len());
        }
        PairList {
            bodies,
            begins,
            position: vec![Vector3::zeros(); reach.len()],
            number,
            visitors: Visitors::default(),
            cells: CellList::default(),
            found_at: FoundAt::default(),
            start: Vec::new(),
            other: Vec::new(),
            version: 0,
            reach,
        }
    }

    /// Number of points of the first body, where the points of the second one begin; of those that this process owns.
    pub fn first_points(&self) -> usize {
        self.begins[1]
    }

    /// Number of points that this process owns, the first ones, which have candidates.
    pub fn owned(&self) -> usize {
        self.begins[self.begins.len() - 1]
    }

    /// Where the points of each body lie among those that this process owns.
    pub fn of_bodies(&self) -> impl Iterator<Item = (BodyIndex, std::ops::Range<usize>)> {
        let ranges = self.begins.windows(2).map(|ends| ends[0]..ends[1]);
        self.bodies.iter().copied().zip(ranges)
    }

    /// Number of a point among those of the whole bodies, numbered through.
    pub fn number(&self, point: usize) -> u32 {
        self.number[point]
    }

    /// Positions of all points at the last update, m.
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.position
    }

    /// Makes values by point as long as there are points, and gives those of other processes the values of their owners. Collective.
    pub fn bring<const N: usize>(&mut self, world: &World, values: &mut Vec<[f64; N]>) {
        values.resize(self.position.len(), [0.0; N]);
        self.visitors.bring(world, values.as_flattened_mut(), N);
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

    /// Updates the positions and, if points have moved far, finds the pairs again. Collective.
    pub fn update(&mut self, world: &World) {
        for (body, range) in self.bodies.iter().zip(self.begins.windows(2)) {
            let own = &mut self.position[range[0]..range[1]];
            own.copy_from_slice(&world.configuration(*body).positions()[..own.len()]);
        }
        let owned = &self.position[..self.owned()];
        let skin = |point: usize| SKIN * self.reach[point];
        if world
            .processes()
            .any(self.found_at.is_outdated(owned, skin))
        {
            self.find(world);
        } else {
            let positions = bytemuck::cast_slice_mut(&mut self.position);
            self.visitors.bring(world, positions, 3);
        }
    }

    fn find(&mut self, world: &World) {
        let (owned, several, first) = (self.owned(), self.bodies.len() > 1, self.first_points());
        self.reach.truncate(owned);
        self.position.truncate(owned);
        self.number.truncate(owned);
        self.found_at.set(&self.position);
        let visited = self.visit(world);
        let reach: Vec<f64> = self.reach.iter().map(|r| (1.0 + SKIN) * r).collect();
        let points = Reaching {
            positions: &self.position,
            reach: &reach,
        };
        let owners = Reaching {
            positions: &self.position[..owned],
            reach: &reach[..owned],
        };
        let is_of_first = |point: usize| match point.checked_sub(owned) {
            None => point < first,
            Some(visitor) => visited[visitor] == 0,
        };
        let within = |i: usize, j: usize| {
            let meets = match several {
                true => is_of_first(i) != is_of_first(j),
                false => i != j,
            };
            // the skin of either may be used up
            meets.then(|| 0.5 * (reach[i] + reach[j]))
        };
        let rows = neighbours::find(&mut self.cells, owners, points, within);
        self.start.clear();
        self.other.clear();
        self.start.push(0);
        for mut row in rows {
            row.sort_unstable_by_key(|point| self.number[*point as usize]);
            self.other.extend(row);
            self.start.push(self.other.len() as u32);
        }
        self.version += 1;
    }

    /// Adds points of other processes that may be in reach of those of this one, and tells the body of each.
    fn visit(&mut self, world: &World) -> Vec<usize> {
        let Some(transport) = world.processes().transport() else {
            return Vec::new();
        };
        let skin = |point: usize| (1.0 + SKIN) * self.reach[point];
        let farthest = (0..self.reach.len()).map(skin).fold(0.0, f64::max);
        let farthest = world.processes().max(farthest);
        let of_bodies = self.begins.windows(2).map(|ends| ends[0]..ends[1]);
        let (visitors, found) =
            Visitors::find(transport, of_bodies, &self.position, farthest, |point| {
                let [x, y, z] = self.position[point].into();
                [x, y, z, self.reach[point], f64::from(self.number[point])]
            });
        self.visitors = visitors;
        for (_, [x, y, z, reach, number]) in &found {
            self.position.push(Vector3::new(*x, *y, *z));
            self.reach.push(*reach);
            self.number.push(*number as u32);
        }
        found.into_iter().map(|(body, _)| body).collect()
    }
}
