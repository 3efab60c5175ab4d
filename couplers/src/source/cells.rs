//! Cells of several sizes: what sources heat on a body without a lattice.
//!
//! Each point has a cell, a cube around the centre of the cell from which it may be displaced. It receives the integral
//! of the density over its cell. The cells of zones touch, so that the parts of all cells add up to that of the body;
//! those of a table leave gaps and overlap, and are scaled so that together they receive the part of the box of the body.
//!
//! Points that move have cells around their current positions, of the size of their spacing. They leave gaps and overlap,
//! too; where they cover less than [`LEAST_COVER`] of the source, the body has a free surface there, and power is lost
//! in proportion.

use nalgebra::Vector3;
use perimelt_core::World;
use perimelt_core::body::Discretisation;
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
    /// How they cover the space between the points.
    pub cover: Cover,
}

impl<'a> Cells<'a> {
    /// The cells of a body, around the positions `now` (m) where its points move; `None` for a lattice at rest.
    pub fn of(
        world: &'a World,
        body: BodyIndex,
        now: Option<&'a [Vector3<f64>]>,
        grid: CellGrid,
    ) -> Option<Cells<'a>> {
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

    /// As [`Cells::point_at`]; where cells leave gaps and the body is not full, the nearest point within `reach` (m).
    pub(super) fn point_for(&self, at: &Vector3<f64>, reach: f64) -> Option<usize> {
        if self.cover != Cover::PartlyFull {
            return self.point_at(at);
        }
        let to = |point: usize| {
            let away = self.centre[point] - at;
            let there = away.iter().take(self.dimension);
            there.map(|d| d * d).sum::<f64>()
        };
        let reach = Vector3::repeat(0.5 * reach);
        self.near(at - reach, at + reach)
            .min_by(|&a, &b| to(a).total_cmp(&to(b)))
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
