//! A body as the surroundings of a surface, such as a gas: which of its points are near each cell face.
//!
//! The surface sees the mean of these points, weighted by their volumes ([`NearPoints::mean`]). In a two-way exchange the physics of
//! the surface takes the heat that enters through a cell face from the same points in the same proportions, so that what one body
//! gains the other one loses to rounding.

use std::cell::{Ref, RefCell};

use super::{BodyIndex, World};
use crate::body::SurfaceCell;
use crate::cell_list::CellList;

/// A body with which a surface exchanges heat.
#[derive(Clone, Copy, Debug)]
pub struct NewSurroundingBody {
    /// The body.
    pub body: BodyIndex,
    /// Greatest distance of its points from those of the surface, m, along the axes that both bodies have.
    pub radius: f64,
    /// Whether it loses what the surface gains.
    pub is_two_way: bool,
}

/// A body with which a surface exchanges heat, and its points near each cell face.
#[derive(Debug)]
pub struct SurroundingBody {
    /// The body.
    pub body: BodyIndex,
    /// Greatest distance of its points from those of the surface, m, along the axes that both bodies have.
    pub radius: f64,
    /// Whether it loses what the surface gains.
    pub is_two_way: bool,
    near: RefCell<NearPoints>,
}

/// Points of a body near each cell face of a surface, with the fraction of the mean that belongs to each.
#[derive(Debug, Default)]
pub struct NearPoints {
    /// Where the points of each cell face start, and their number at the end.
    start: Vec<u32>,
    points: Vec<u32>,
    fractions: Vec<f64>,
}

impl NearPoints {
    /// The points of a cell face, ascending, and their fractions, whose sum is one.
    pub fn of(&self, cell: usize) -> (&[u32], &[f64]) {
        let range = self.start[cell] as usize..self.start[cell + 1] as usize;
        (&self.points[range.clone()], &self.fractions[range])
    }

    /// Number of cell faces.
    pub fn cells(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// Mean of the values of the points near a cell face; zero without any.
    pub fn mean(&self, cell: usize, value: impl Fn(usize) -> f64) -> f64 {
        let (points, fractions) = self.of(cell);
        let values = points.iter().zip(fractions);
        values.map(|(&p, f)| f * value(p as usize)).sum()
    }
}

impl SurroundingBody {
    pub(crate) fn new(new: NewSurroundingBody) -> SurroundingBody {
        SurroundingBody {
            body: new.body,
            radius: new.radius,
            is_two_way: new.is_two_way,
            near: RefCell::default(),
        }
    }

    /// The points near each cell face, by its place in [`Exchange::cells`](super::exchange::Exchange::cells).
    pub fn near(&self) -> Ref<'_, NearPoints> {
        self.near.borrow()
    }

    /// Finds the points near cell faces of a body. Points of both bodies are at rest.
    pub(crate) fn find_points(&self, world: &World, body: BodyIndex, cells: &[SurfaceCell]) {
        let (this, other) = (world.body(body), world.body(self.body));
        let axes = this.dimension.min(other.dimension);
        let flat = |mut x: nalgebra::Vector3<f64>| {
            (axes..3).for_each(|axis| x[axis] = 0.0);
            x
        };
        let places: Vec<_> = other.points.position.iter().map(|x| flat(*x)).collect();
        // points at the distance of the radius belong to it whatever their rounding
        let radius = self.radius * (1.0 + 1e-9);
        let list = CellList::new(&places, &vec![radius; places.len()]);
        let mut near = self.near.borrow_mut();
        near.start.clear();
        near.points.clear();
        near.fractions.clear();
        near.start.push(0);
        for cell in cells {
            let at = flat(this.points.position.at(cell.point as usize));
            let first = near.points.len();
            list.visit_near(&at, radius, |point| {
                if (places[point] - at).norm() <= radius {
                    near.points.push(point as u32);
                }
            });
            near.points[first..].sort_unstable();
            let volume = |point: &u32| other.points.volume[*point as usize];
            let volumes: Vec<f64> = near.points[first..].iter().map(volume).collect();
            let whole: f64 = volumes.iter().sum();
            near.fractions.extend(volumes.iter().map(|v| v / whole));
            let end = near.points.len() as u32;
            near.start.push(end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, Face};
    use crate::shape::{BoxShape, Shape};

    fn filled(name: &str, [min, max]: [[f64; 3]; 2], dimension: usize, spacing: f64) -> Body {
        let shape = Shape::Box(BoxShape { min, max });
        Body::fill(name, &shape, dimension, spacing, max[2] - min[2]).expect("valid")
    }

    /// Three rows of a flat gas above the middle of the edge of a block: 5, 5 and 1 points at the distances of one, two and three spacings.
    #[test]
    fn a_surface_sees_the_points_of_a_flat_gas_within_the_radius() {
        for dimension in [2, 3] {
            let block = filled("block", [[0.0; 3], [9.0, 3.0, 2.0]], dimension, 1.0);
            let gas = filled("gas", [[0.0, 3.0, 0.0], [9.0, 9.0, 2.0]], 2, 1.0);
            let world = World::new(vec![block, gas]);
            let around = SurroundingBody::new(NewSurroundingBody {
                body: 1,
                radius: 3.0,
                is_two_way: false,
            });
            let cells = world.body(0).surface(&[Face::YMax]);
            around.find_points(&world, 0, &cells);
            let positions = &world.body(0).points.position;
            for (i, cell) in cells.iter().enumerate() {
                if positions[cell.point as usize].x != 4.5 {
                    continue;
                }
                let near = around.near();
                let (points, fractions) = near.of(i);
                assert_eq!(points.len(), 5 + 5 + 1);
                assert!((fractions.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                let height = |p: usize| world.body(1).points.position.at(p).y;
                let expected = (5.0 * 3.5 + 5.0 * 4.5 + 5.5) / 11.0;
                assert!((near.mean(i, height) - expected).abs() < 1e-12);
            }
        }
    }

    /// A point of a coarse zone counts as the fine ones in its place.
    #[test]
    fn points_count_by_their_volume() {
        let block = filled("block", [[0.0; 3], [1.0, 1.0, 1.0]], 1, 1.0);
        let mut gas = filled("gas", [[1.0, 0.0, 0.0], [3.0, 1.0, 1.0]], 1, 1.0);
        gas.points.volume = vec![1.0, 3.0].into();
        let world = World::new(vec![block, gas]);
        let around = SurroundingBody::new(NewSurroundingBody {
            body: 1,
            radius: 2.0,
            is_two_way: true,
        });
        let cells = world.body(0).surface(&[Face::XMax]);
        around.find_points(&world, 0, &cells);
        assert_eq!(around.near().of(0), (&[0, 1][..], &[0.25, 0.75][..]));
    }
}
