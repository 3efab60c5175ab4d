//! Cells of a body without a lattice, on which sources deposit their power.
//!
//! Each point has a cell, a cube around the centre of the cell from which it may be displaced. It receives the integral
//! of the density over its cell. The cells of zones touch, so that the parts of all cells add up to that of the body;
//! those of a table leave gaps and overlap, and are scaled so that together they receive the part of the box of the body.
//!
//! Points that move have cells around their current positions, of the size of their spacing. They leave gaps and overlap;
//! where they cover less than [`LEAST_COVER`] of the source, the body has a free surface there, and power is lost
//! in proportion.

use nalgebra::Vector3;
use perimelt_core::World;
use perimelt_core::body::Discretisation;
use perimelt_core::solver::{ExactSum, Reducer};
use perimelt_core::world::BodyIndex;

use super::{CellGrid, Deposit};

/// A source of which a body receives all but this fraction lies inside: the rest is the error of numerical integration and
/// the part beyond the cut-off of the density.
const INSIDE: f64 = 1e-4;

/// Least fraction of a source inside of a fluid that the cells of its points cover. Cells around random positions cover
/// 1 - 1/e of the space; points of a fluid keep distances.
const LEAST_COVER: f64 = 0.7;

/// How the cells of a body cover the space between its points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cover {
    /// Without gaps.
    Tiled,
    /// With gaps and overlaps; the box of the body is full of material.
    FullBox,
    /// With gaps and overlaps; the box of the body has parts without material.
    PartlyFull,
}

/// The cells of a body, of which this process owns the first ones.
#[derive(Debug, Clone)]
pub struct Cells<'a> {
    /// Centre of the cell of each point, m.
    pub centre: &'a [Vector3<f64>],
    /// Edge of each cell along the axes that the body has, m.
    pub size: &'a [f64],
    /// Volume of each point, m³.
    pub volume: &'a [f64],
    /// A lattice that covers the box of the body; the spacing along missing axes is the extent of the body there.
    pub grid: CellGrid,
    /// Number of axes of the body.
    pub dimension: usize,
    /// Corners of the box of the body, m.
    pub bounds: [Vector3<f64>; 2],
    /// How they cover the space between the points.
    pub cover: Cover,
    /// Sums over the cells of all processes.
    pub reducer: Reducer,
}

/// A cell of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    /// Its point, where this process owns it.
    pub point: Option<usize>,
    /// Its edge, m.
    pub size: f64,
}

impl<'a> Cells<'a> {
    /// The cells of a body, around the positions `now` (m) where its points move; `None` for a lattice at rest.
    pub fn of(
        world: &'a World,
        body: BodyIndex,
        now: Option<&'a [Vector3<f64>]>,
        grid: CellGrid,
    ) -> Option<Cells<'a>> {
        let reducer = world.reducer(body);
        let body = world.body(body);
        let (centre, cover, bounds) = match (now, &body.discretisation) {
            (Some(centre), _) => {
                let bounds = bounds(centre, &body.points.spacing);
                (centre, Cover::PartlyFull, bounds)
            }
            (None, Discretisation::Cloud(cloud)) => {
                let cover = match cloud.is_tiled() {
                    true => Cover::Tiled,
                    false => Cover::FullBox,
                };
                (cloud.centres(), cover, body.bounds().into())
            }
            (None, Discretisation::Layers(_)) => (
                &body.points.position[..],
                Cover::FullBox,
                body.bounds().into(),
            ),
            (None, Discretisation::Lattice(_)) => return None,
        };
        Some(Cells {
            centre,
            size: &body.points.spacing,
            volume: &body.points.volume,
            grid,
            dimension: body.dimension,
            bounds,
            cover,
            reducer,
        })
    }

    /// Extents of the cell of a point, m.
    pub(super) fn extent(&self, point: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| match axis < self.dimension {
            true => self.size[point],
            false => self.grid.spacing[axis],
        })
    }

    /// Lower and upper corner of the cell of a point, m.
    pub(super) fn corners(&self, point: usize) -> [Vector3<f64>; 2] {
        let half = 0.5 * self.extent(point);
        [self.centre[point] - half, self.centre[point] + half]
    }

    /// Owned points whose cells may meet a box, m.
    pub(super) fn near(
        &self,
        low: Vector3<f64>,
        high: Vector3<f64>,
    ) -> impl Iterator<Item = usize> {
        let meets = move |(centre, size): (&Vector3<f64>, &f64)| {
            let half = 0.5 * size;
            (0..self.dimension).all(|a| centre[a] + half >= low[a] && centre[a] - half <= high[a])
        };
        let cells = self.centre.iter().zip(self.size).enumerate();
        let cells = cells.take(self.reducer.owned());
        cells.filter(move |(_, cell)| meets(*cell)).map(|(p, _)| p)
    }

    /// The cell in which a position (m) lies, that of the lowest point if several do. All processes make the same calls.
    pub(super) fn cell_at(&self, at: &Vector3<f64>) -> Option<Cell> {
        self.lowest(self.near(*at, *at).next())
    }

    /// The cell of the lowest of the points that processes have found, each one of its own.
    fn lowest(&self, own: Option<usize>) -> Option<Cell> {
        let number = |point: usize| f64::from(self.reducer.number(point));
        let lowest = self.reducer.min(own.map_or(f64::INFINITY, number));
        let point = own.filter(|point| number(*point) == lowest);
        let size = self
            .reducer
            .max(point.map_or(0.0, |point| self.size[point]));
        lowest.is_finite().then_some(Cell { point, size })
    }

    /// [`Cells::cell_at`]; where cells leave gaps and the body is not full, that of the nearest point within `reach` (m).
    pub(super) fn cell_for(&self, at: &Vector3<f64>, reach: f64) -> Option<Cell> {
        if self.cover != Cover::PartlyFull {
            return self.cell_at(at);
        }
        let to = |point: usize| {
            let away = self.centre[point] - at;
            let there = away.iter().take(self.dimension);
            there.map(|d| d * d).sum::<f64>()
        };
        let reach = Vector3::repeat(0.5 * reach);
        let near = self.near(at - reach, at + reach);
        // no process shares points that move
        self.lowest(near.min_by(|&a, &b| to(a).total_cmp(&to(b))))
    }

    /// The sum of the parts of the cells of all processes.
    pub(super) fn total(&self, parts: &[(usize, f64)]) -> f64 {
        let mut sum = ExactSum::default();
        parts.iter().for_each(|(_, part)| sum.add(*part));
        self.reducer.total(sum)
    }

    /// Adds to `values` (W/m³) the `parts` of the power `asked` (W) that cells receive; `in_box` is the fraction of the
    /// source inside the box of the body.
    pub(super) fn deposit(
        &self,
        parts: &[(usize, f64)],
        asked: f64,
        in_box: f64,
        normalise: bool,
        values: &mut [f64],
    ) -> Deposit {
        let hit = self.total(parts);
        let wanted = match self.cover {
            Cover::Tiled => hit,
            Cover::FullBox => in_box,
            Cover::PartlyFull => in_box.min(hit / LEAST_COVER),
        };
        let is_inside = 1.0 - wanted < INSIDE;
        let fraction = match (normalise, is_inside) {
            (true, true) => 1.0,
            (true, false) => wanted,
            (false, _) => hit,
        };
        let scale = match hit > 0.0 {
            true => asked * fraction / hit,
            false => 0.0,
        };
        for &(point, part) in parts {
            values[point] += scale * part / self.volume[point];
        }
        let deposited = scale * hit;
        let lost = match is_inside && hit > 0.0 {
            true => 0.0,
            false => asked - deposited,
        };
        Deposit {
            asked,
            deposited,
            lost,
            ..Deposit::default()
        }
    }
}

/// Corners of the box around cells of the given centres and sizes, m.
fn bounds(centre: &[Vector3<f64>], size: &[f64]) -> [Vector3<f64>; 2] {
    let start = Vector3::repeat(f64::INFINITY);
    let cells = centre.iter().zip(size);
    cells.fold([start, -start], |[low, high], (c, s)| {
        [
            low.inf(&c.add_scalar(-0.5 * s)),
            high.sup(&c.add_scalar(0.5 * s)),
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CENTRES: [Vector3<f64>; 3] = [
        Vector3::new(1.0, 1.0, 0.5),
        Vector3::new(3.0, 1.0, 0.5),
        Vector3::new(4.5, 0.5, 0.5),
    ];

    /// Cells of 2, 2 and 1 m in a plane of 1 m.
    fn cells(cover: Cover) -> Cells<'static> {
        Cells {
            centre: &CENTRES,
            size: &[2.0, 2.0, 1.0],
            volume: &[4.0, 4.0, 1.0],
            grid: CellGrid {
                origin: Vector3::zeros(),
                spacing: Vector3::repeat(1.0),
                dims: [5, 2, 1],
                plate: true,
            },
            dimension: 2,
            bounds: [Vector3::zeros(), Vector3::new(5.0, 2.0, 1.0)],
            cover,
            reducer: Reducer::alone(3),
        }
    }

    /// Powers deposited and lost of 100 W, by how much of the source the cells (`hit`) and the box of the body receive.
    #[test]
    fn what_cells_do_not_cover_is_lost_or_spread_over_them() {
        for (cover, hit, in_box, normalise, deposited, lost) in [
            // without gaps: what they receive
            (Cover::Tiled, 0.8, 0.9, true, 80.0, 20.0),
            (Cover::Tiled, 1.0 - 0.5e-4, 1.0, true, 100.0, 0.0),
            (Cover::Tiled, 1.0 - 2e-4, 1.0, true, 99.98, 0.02),
            (Cover::Tiled, 0.8, 0.9, false, 80.0, 20.0),
            // with gaps: what the full box receives
            (Cover::FullBox, 0.8, 0.9, true, 90.0, 10.0),
            (Cover::FullBox, 0.8, 1.0, true, 100.0, 0.0),
            (Cover::FullBox, 0.8, 1.0, false, 80.0, 0.0),
            // of a body with holes: as if they covered 0.7 of it
            (Cover::PartlyFull, 0.35, 0.9, true, 50.0, 50.0),
            (Cover::PartlyFull, 0.8, 0.9, true, 90.0, 10.0),
            (Cover::PartlyFull, 0.75, 1.0, true, 100.0, 0.0),
            // beside the body
            (Cover::FullBox, 0.0, 1.0, true, 0.0, 100.0),
        ] {
            let mut values = [0.0; 3];
            let parts = [(0, 0.75 * hit), (2, 0.25 * hit)];
            let deposit = cells(cover).deposit(&parts, 100.0, in_box, normalise, &mut values);
            let close = |found: f64, expected: f64| (found - expected).abs() < 1e-10;
            assert_eq!(deposit.asked, 100.0);
            assert!(
                close(deposit.deposited, deposited) && close(deposit.lost, lost),
                "{cover:?} {hit} {in_box} {normalise}: {deposit:?}"
            );
            // three quarters in 4 m³, the rest in 1 m³
            assert!(close(values[0], 0.75 * deposited / 4.0) && values[1] == 0.0);
            assert!(close(values[2], 0.25 * deposited));
        }
    }

    #[test]
    fn a_position_lies_in_its_cell_or_near_a_point_of_a_fluid() {
        let full = cells(Cover::FullBox);
        let at = |x: f64, y: f64| Vector3::new(x, y, 7.0);
        for (place, point) in [
            (at(0.5, 1.9), Some(0)),
            (at(2.0, 1.0), Some(0)),
            (at(2.1, 1.0), Some(1)),
            (at(4.9, 0.9), Some(2)),
            (at(4.5, 1.5), None),
            (at(-0.1, 1.0), None),
        ] {
            assert_eq!(full.cell_at(&place).and_then(|c| c.point), point, "{place}");
            assert_eq!(
                full.cell_for(&place, 1.0).and_then(|c| c.point),
                point,
                "{place}"
            );
        }
        let fluid = cells(Cover::PartlyFull);
        let point = |y: f64| fluid.cell_for(&at(4.5, y), 1.0).and_then(|c| c.point);
        // the cell of the last point ends 0.5 m below, within half of the reach; the nearest of two
        assert_eq!(point(1.4), Some(2));
        assert_eq!(point(1.6), Some(1));
        assert_eq!(point(2.6), None);
    }

    #[test]
    fn a_cell_is_a_cube_along_the_axes_of_the_body() {
        let cells = cells(Cover::Tiled);
        assert_eq!(cells.extent(1), Vector3::new(2.0, 2.0, 1.0));
        let corners = [Vector3::new(2.0, 0.0, 0.0), Vector3::new(4.0, 2.0, 1.0)];
        assert_eq!(cells.corners(1), corners);
        let low = Vector3::new(-1.0, 0.5, 0.5);
        let box_of = bounds(&[low, CENTRES[2]], &[0.5, 1.0]);
        let expected = [Vector3::new(-1.25, 0.0, 0.0), Vector3::new(5.0, 1.0, 1.0)];
        assert_eq!(box_of, expected);
    }
}
