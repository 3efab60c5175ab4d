//! Cells of several sizes: what sources heat on a body without a lattice.
//!
//! Each point has a cell, a cube around the centre of the cell from which it may be displaced. It receives the integral
//! of the density over its cell. The cells of zones touch, so that the parts of all cells add up to that of the body;
//! those of a table leave gaps and overlap, and are scaled so that together they receive the part of the box of the body.

use nalgebra::Vector3;
use perimelt_core::Body;
use perimelt_core::body::Discretisation;

use super::{CellGrid, Deposit};

/// A source of which a body receives all but this fraction lies inside: the rest is the error of numerical integration and
/// the part beyond the cut-off of the density.
const INSIDE: f64 = 1e-4;

/// The cells of a body.
#[derive(Debug, Clone, Copy)]
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
    /// Whether cells touch without gaps.
    pub is_tiled: bool,
}

impl<'a> Cells<'a> {
    /// The cells of a body; `None` for one with a lattice.
    pub fn of(body: &'a Body, grid: CellGrid) -> Option<Cells<'a>> {
        let Discretisation::Cloud(cloud) = &body.discretisation else {
            return None;
        };
        let (low, high) = body.bounds();
        Some(Cells {
            centre: cloud.centres(),
            size: &body.points.spacing,
            volume: &body.points.volume,
            grid,
            dimension: body.dimension,
            bounds: [low, high],
            is_tiled: cloud.is_tiled(),
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

    /// Points whose cells may meet a box, m.
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
        cells.filter(move |(_, cell)| meets(*cell)).map(|(p, _)| p)
    }

    /// The point in whose cell a position (m) lies, the lowest if several do.
    pub(super) fn point_at(&self, at: &Vector3<f64>) -> Option<usize> {
        self.near(*at, *at).next()
    }

    /// Adds power densities (W/m³): the parts of the power that cells receive, of which `in_box` would fall into the box
    /// of the body.
    pub(super) fn deposit(
        &self,
        parts: &[(usize, f64)],
        (asked, in_box, normalise): (f64, f64, bool),
        values: &mut [f64],
    ) -> Deposit {
        let hit: f64 = parts.iter().map(|(_, part)| part).sum();
        let wanted = match self.is_tiled {
            true => hit,
            false => in_box,
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
        let lost = match is_inside {
            true => 0.0,
            false => asked - deposited,
        };
        Deposit {
            asked,
            deposited,
            lost,
        }
    }
}
