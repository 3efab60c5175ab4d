//! Corners of the cells of a lattice: their numbers, and what reaches them from the points around.

use std::borrow::Cow;

use nalgebra::Vector3;
use perimelt_core::body::{Lattice, NO_POINT, Positions, Same, Sizes};
use perimelt_core::family::LayerRule;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::{Reducer, SharedNodes};
use perimelt_core::{Body, Face};
use rayon::prelude::*;

use crate::mechanical::nodes::{Held, HeldCorners, PointLoads};

/// Corners of a cell in three dimensions.
pub(in crate::mechanical) const CORNERS: usize = 8;

/// Side of a corner of a cell along an axis: bit `axis` of its number is set at the upper side.
#[inline(always)]
pub(in crate::mechanical) fn sign(corner: usize, axis: usize) -> f64 {
    if corner >> axis & 1 == 1 { 1.0 } else { -1.0 }
}

/// The corners of the cells of a body on a lattice.
#[derive(Debug)]
pub struct Corners {
    dimension: usize,
    /// m.
    pub(super) spacing: f64,
    /// The corners of the cell of each point.
    pub(super) of_point: Vec<[u32; CORNERS]>,
    /// The point of whose cell a corner is the one with each number; [`NO_POINT`] where there is none.
    pub(super) points: Vec<[u32; CORNERS]>,
    /// m.
    pub(in crate::mechanical) position: Positions,
    /// Volume of a cell, m³, for each corner.
    pub(in crate::mechanical) volume: Sizes,
    /// Corners on the faces of the box.
    on_face: [Vec<u32>; 6],
    /// The corners, which processes may share.
    reducer: Reducer,
    /// What a process knows of points of others; nothing in a run of one.
    shared: SharedPoints,
}

/// Points of a body that several processes share, as a staggered solid sees them.
#[derive(Debug, Default)]
struct SharedPoints {
    /// The points in the order of the whole body.
    in_order: Vec<u32>,
    /// Whether the corners of a point have their values: of those that share a corner with an owned one, and those behind the faces of these.
    is_known: Vec<bool>,
}

impl Corners {
    /// Numbers the corners of the cells of `body` in the order of the first points around them. Points around a corner that are joined by no faces have a corner each:
    /// those on both sides of a crack, and those that touch along an edge only. A periodic body has the same corners on opposite faces.
    ///
    /// Of processes that share the `points`, the owner of the first point around a corner owns it. Collective.
    pub(super) fn new(body: &Body, lattice: &Lattice, points: &Reducer) -> Self {
        let dimension = body.dimension;
        let size: [usize; 3] = std::array::from_fn(|a| {
            lattice.cells[a] + usize::from(a < dimension && !body.periodic[a])
        });
        let place = |cell: &[u32; 3], corner: usize| {
            let at: [usize; 3] =
                std::array::from_fn(|a| (cell[a] as usize + (corner >> a & 1)) % size[a]);
            (at[2] * size[1] + at[1]) * size[0] + at[0]
        };
        let mut around = vec![[NO_POINT; CORNERS]; size.iter().product()];
        for (point, cell) in lattice.cells_of_points().enumerate() {
            (0..1 << dimension)
                .for_each(|corner| around[place(&cell, corner)][corner] = point as u32);
        }
        let mut this = Corners {
            dimension,
            spacing: lattice.spacing,
            of_point: vec![[0; CORNERS]; body.points.len()],
            points: Vec::new(),
            position: Positions::default(),
            volume: Sizes::default(),
            on_face: Default::default(),
            reducer: Reducer::default(),
            shared: SharedPoints::default(),
        };
        let mut position = Vec::new();
        for (index, around) in around.iter().enumerate() {
            let at = [
                index % size[0],
                index / size[0] % size[1],
                index / (size[0] * size[1]),
            ];
            let mut x = lattice.origin + Vector3::from(at.map(|n| n as f64 * lattice.spacing));
            (dimension..3).for_each(|a| x[a] += 0.5 * lattice.spacing);
            for group in joined_groups(body, around) {
                let number = position.len() as u32;
                position.push(x);
                for face in Face::ALL.into_iter().filter(|f| f.axis() < dimension) {
                    let last = if face.is_upper() {
                        size[face.axis()] - 1
                    } else {
                        0
                    };
                    if at[face.axis()] == last && !body.periodic[face.axis()] {
                        this.on_face[face as usize].push(number);
                    }
                }
                for (corner, &point) in group.iter().enumerate() {
                    if point != NO_POINT {
                        this.of_point[point as usize][corner] = number;
                    }
                }
                this.points.push(group);
            }
        }
        this.volume = Sizes::by(Same {
            value: body.points.volume[0],
            count: position.len(),
        });
        this.position = position.into();
        if points.processes().size() > 1 {
            this.shared = this.share(body, points);
        }
        this.order(points);
        this
    }

    /// What a process knows of points of others.
    fn share(&self, body: &Body, points: &Reducer) -> SharedPoints {
        let owned = points.owned();
        let mut is_near = vec![false; body.points.len()];
        for corner in 0..self.points.len() {
            let around = || self.around(corner, &[]).map(|(_, point)| point);
            if around().any(|point| point < owned) {
                around().for_each(|point| is_near[point] = true);
            }
        }
        let mut is_known = is_near.clone();
        for point in (0..is_near.len()).filter(|point| is_near[*point]) {
            let behind = Face::ALL.map(|face| body.neighbour(point, face));
            (behind.into_iter().flatten()).for_each(|other| is_known[other] = true);
        }
        let mut in_order: Vec<u32> = (0..body.points.len() as u32).collect();
        in_order.sort_by_key(|point| points.number(*point as usize));
        SharedPoints { in_order, is_known }
    }

    /// Numbers the corners anew, in the order of the first points around them, those first that this process owns.
    fn order(&mut self, points: &Reducer) {
        let first = |corner: usize| {
            let around = self.around(corner, &[]);
            let first = around.min_by_key(|(_, point)| points.number(*point));
            first.expect("a corner has a cell")
        };
        // the first point, and which of the corners of its cell it is
        let of_corner: Vec<(usize, usize)> = (0..self.points.len()).map(first).collect();
        let number = |corner: usize| {
            let (q, point) = of_corner[corner];
            points.number(point) * CORNERS as u32 + q as u32
        };
        let rank = points.processes().rank();
        let is_other = |corner: usize| points.owner(of_corner[corner].1) != rank;
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        order.sort_by_cached_key(|corner| (is_other(*corner), number(*corner)));
        let is_known = &self.shared.is_known;
        let is_needed = |corner: &usize| {
            let mut around = self.around(*corner, &[]);
            around.any(|(_, point)| is_known.get(point).is_some_and(|known| *known))
        };
        self.reducer = points.of_nodes(SharedNodes {
            numbers: order.iter().map(|corner| number(*corner)).collect(),
            point: order.iter().map(|c| of_corner[*c].1 as u32).collect(),
            is_needed: order.iter().map(is_needed).collect(),
        });
        let mut place = vec![0; order.len()];
        for (new, old) in (0..).zip(&order) {
            place[*old] = new;
        }
        let lists = self.of_point.as_flattened_mut().iter_mut();
        let lists = lists.chain(self.on_face.iter_mut().flatten());
        lists.for_each(|corner| *corner = place[*corner as usize]);
        self.points = order.iter().map(|corner| self.points[*corner]).collect();
        let position = order.iter().map(|corner| self.position.at(*corner));
        self.position = position.collect::<Vec<_>>().into();
    }

    /// Sums over the corners.
    pub(in crate::mechanical) fn reducer(&self) -> &Reducer {
        &self.reducer
    }

    /// Whether the corners of each point have their values; empty in a run of one process, where all have.
    pub(in crate::mechanical) fn known_points(&self) -> &[bool] {
        &self.shared.is_known
    }

    /// Those of some points whose corners have their values.
    pub(in crate::mechanical) fn known_among<'a>(&self, points: &'a [bool]) -> Cow<'a, [bool]> {
        let known = self.known_points();
        match known.is_empty() {
            true => Cow::Borrowed(points),
            false => points.iter().zip(known).map(|(p, k)| *p && *k).collect(),
        }
    }

    /// Number of corners of a cell.
    fn of_cell(&self) -> usize {
        1 << self.dimension
    }

    /// The points around a corner that have material, with its number in their cells; an empty `present` means all.
    pub(in crate::mechanical) fn around<'a>(
        &'a self,
        corner: usize,
        present: &'a [bool],
    ) -> impl Iterator<Item = (usize, usize)> + 'a {
        let points = self.points[corner].iter().enumerate();
        let points = points.map(|(number, &point)| (number, point as usize));
        points.filter(|(_, point)| {
            *point != NO_POINT as usize && (present.is_empty() || present[*point])
        })
    }

    /// The corners of the cell of a point.
    pub(in crate::mechanical) fn of(&self, point: usize) -> &[u32] {
        &self.of_point[point][..self.of_cell()]
    }

    /// Whether each corner has material around it; empty if all points have.
    pub(in crate::mechanical) fn present(&self, present: &[bool]) -> Vec<bool> {
        match present.is_empty() {
            true => Vec::new(),
            false => {
                let corners = (0..self.points.len()).into_par_iter();
                let has_material = |corner| self.around(corner, present).next().is_some();
                corners.map(has_material).collect()
            }
        }
    }

    /// Displacement (m) of each point: the mean of its corners.
    pub(in crate::mechanical) fn mean(&self, corners: &[f64], points: &mut [Vector3<f64>]) {
        let (corners, _) = corners.as_chunks::<3>();
        let factor = 1.0 / self.of_cell() as f64;
        let all = points.par_iter_mut().enumerate().with_min_len(1024);
        all.for_all(|(point, mean)| {
            *mean = Vector3::zeros();
            for &corner in self.of(point) {
                *mean += Vector3::from(corners[corner as usize]);
            }
            *mean *= factor;
        });
    }

    /// Values of the corners from those of points, exact where they are linear: the mean of what the points around continue to it.
    pub(in crate::mechanical) fn around_points(
        &self,
        body: &Body,
        symmetry: &[Face],
        points: &[Vector3<f64>],
    ) -> Vec<f64> {
        let slope = |point: usize, axis: usize| {
            let at = |face: Face| match behind(body, symmetry, point, face)? {
                Behind::Point(other) => Some(points[other]),
                Behind::Image => {
                    let mut image = points[point];
                    image[axis] = -image[axis];
                    Some(image)
                }
            };
            let own = points[point];
            let (below, above) = (at(Face::ALL[2 * axis]), at(Face::ALL[2 * axis + 1]));
            match (below, above) {
                (Some(below), Some(above)) => 0.5 * (above - below),
                (Some(below), None) => own - below,
                (None, Some(above)) => above - own,
                (None, None) => Vector3::zeros(),
            }
        };
        let continued = |(number, point): (usize, usize)| {
            let along = |axis: usize| 0.5 * sign(number, axis) * slope(point, axis);
            points[point] + (0..self.dimension).map(along).sum::<Vector3<f64>>()
        };
        let mean = |corner: usize| {
            let around = || self.around(corner, &[]);
            let sum: Vector3<f64> = around().map(continued).sum();
            <[f64; 3]>::from(sum / around().count() as f64)
        };
        (0..self.points.len()).flat_map(mean).collect()
    }

    /// Density (kg/m³) of each corner: its part of the mass of the points around, per volume of a cell.
    pub(in crate::mechanical) fn densities(&self, points: &[f64], present: &[bool]) -> Vec<f64> {
        let part = 1.0 / self.of_cell() as f64;
        let of_corner = |corner: usize| {
            let around = self.around(corner, present);
            around.map(|(_, point)| part * points[point]).sum()
        };
        (0..self.points.len()).map(of_corner).collect()
    }

    /// Force per volume of a point (N/m³) on each corner. A force that acts at a face of a cell goes to its corners, and so does a
    /// traction on a face of the box.
    pub(in crate::mechanical) fn loads(
        &self,
        loads: PointLoads<'_>,
        present: &[bool],
        out: &mut Vec<f64>,
    ) {
        let PointLoads {
            force,
            moment,
            faces,
        } = loads;
        let (share, arm) = (1.0 / self.of_cell() as f64, 2.0 / self.spacing);
        out.resize(3 * self.points.len(), 0.0);
        let (corners, _) = out.as_chunks_mut::<3>();
        let all = corners.par_iter_mut().enumerate().with_min_len(1024);
        all.for_all(|(corner, sum)| {
            *sum = [0.0; 3];
            for (number, point) in self.around(corner, present) {
                for (axis, sum) in sum.iter_mut().enumerate() {
                    *sum += share * force.get(point).map_or(0.0, |force| force[axis]);
                    if let Some(moment) = moment.get(point) {
                        let towards = |a: usize| moment[(axis, a)] * sign(number, a);
                        *sum += share * arm * (0..self.dimension).map(towards).sum::<f64>();
                    }
                }
            }
        });
        for (rule, traction) in faces.iter().filter_map(|f| f.traction.map(|t| (f, t))) {
            for &corner in &self.on_face[rule.face as usize] {
                let cells = self.around(corner as usize, present).count() as f64;
                let sum = &mut corners[corner as usize];
                let stress = traction.stress;
                (0..self.dimension).for_each(|a| sum[a] += share * arm * cells * stress[a]);
            }
        }
    }

    /// The corners that are held.
    ///
    /// A face holds its corners. A corner is held along with the points around it if all of them are; a point that has no such
    /// corner holds one, that with the fewest points around: supports at three points hold a body without straining it.
    pub(in crate::mechanical) fn held(
        &self,
        held: Held<'_>,
        rules: &[LayerRule],
        present: &[bool],
    ) -> HeldCorners {
        let [mut count, mut sum] = [(); 2].map(|()| vec![0.0; 3 * self.points.len()]);
        let mut hold = |corner: u32, axis: usize, [by, at]: [f64; 2]| {
            count[3 * corner as usize + axis] += by;
            sum[3 * corner as usize + axis] += at;
        };
        for axis in 0..self.dimension {
            for rule in rules {
                if let Some(value) = rule.prescribed(axis, 0) {
                    let corners = self.on_face[rule.face as usize].iter();
                    corners.for_each(|&corner| hold(corner, axis, [1.0, value]));
                }
            }
            for place in 0..held.count.len() {
                let point = (self.shared.in_order.get(place)).map_or(place, |p| *p as usize);
                let by = held.count[point][axis];
                if by > 0.0 && (present.is_empty() || present[point]) {
                    let at = [by, held.sum[point][axis]];
                    let held_by = self.held_by(point, axis, held.count, present);
                    held_by.for_each(|corner| hold(corner, axis, at));
                }
            }
        }
        HeldCorners::new(count, sum)
    }

    /// The corners that a held point holds.
    fn held_by<'a>(
        &'a self,
        point: usize,
        axis: usize,
        count: &'a [Vector3<f64>],
        present: &'a [bool],
    ) -> impl Iterator<Item = u32> + 'a {
        let is_held = move |point: usize| count[point][axis] > 0.0;
        let follows = move |corner: &u32| {
            let mut around = self.around(*corner as usize, present);
            around.all(|(_, point)| is_held(point))
        };
        let corners = self.of(point).iter().copied();
        let around = |corner: &u32| self.around(*corner as usize, present).count();
        let lone = match corners.clone().any(|corner| follows(&corner)) {
            true => None,
            false => corners.clone().min_by_key(around),
        };
        corners.filter(follows).chain(lone)
    }
}

/// What is behind a face of the cell of a point.
pub(super) enum Behind {
    Point(usize),
    /// The mirror image of the point itself.
    Image,
}

/// What is behind a face of the cell of a point in a body with these planes of `symmetry`; `None` at surfaces and cracks.
pub(super) fn behind(body: &Body, symmetry: &[Face], point: usize, face: Face) -> Option<Behind> {
    if let Some(other) = joined(body, point, face) {
        return Some(Behind::Point(other));
    }
    let lattice = body.lattice().filter(|_| symmetry.contains(&face))?;
    let last = match face.is_upper() {
        true => lattice.cells[face.axis()] - 1,
        false => 0,
    };
    let cell = lattice.cell(point)[face.axis()] as usize;
    (cell == last).then_some(Behind::Image)
}

/// The point behind a face of the cell of a point, unless a crack is between them.
fn joined(body: &Body, point: usize, face: Face) -> Option<usize> {
    let other = body.neighbour(point, face)?;
    let from = body.points.position.at(point);
    let to = from + body.points.spacing[point] * face.normal();
    let is_cut = body.cuts.iter().any(|cut| cut.crosses(&from, &to));
    (!is_cut).then_some(other)
}

/// The points around a place that are joined by faces with each other, by the number of the corner that it is of their cells.
fn joined_groups(body: &Body, around: &[u32; CORNERS]) -> impl Iterator<Item = [u32; CORNERS]> {
    let are_joined = |corner: usize, axis: usize| {
        // the cell whose upper corner along the axis this is lies below
        let [below, above] = [corner | 1 << axis, corner & !(1 << axis)].map(|q| around[q]);
        let both = below != NO_POINT && above != NO_POINT;
        let face = Face::ALL[2 * axis + 1];
        both && (body.cuts.is_empty() || joined(body, below as usize, face).is_some())
    };
    let mut group_of: [usize; CORNERS] = std::array::from_fn(|corner| corner);
    let mut is_done = false;
    while !is_done {
        is_done = true;
        for corner in 0..CORNERS {
            for axis in (0..body.dimension).filter(|axis| are_joined(corner, *axis)) {
                let other = corner ^ 1 << axis;
                is_done &= group_of[corner] == group_of[other];
                let least = group_of[corner].min(group_of[other]);
                (group_of[corner], group_of[other]) = (least, least);
            }
        }
    }
    let around = *around;
    (0..CORNERS).filter_map(move |group| {
        let members = std::array::from_fn(|corner| match group_of[corner] == group {
            true => around[corner],
            false => NO_POINT,
        });
        members
            .iter()
            .any(|point| *point != NO_POINT)
            .then_some(members)
    })
}
