//! The cells around the points of a fluid: which of them walls fill, and which lie beside each other.

use std::f64::consts::PI;

use nalgebra::Vector3;
use perimelt_core::body::{BodyError, Lattice};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Axis, Body, Face, Family};

/// Least fraction of a cell that makes it part of a wall.
const LEAST_FRACTION: f64 = 1e-6;

/// All cells around a fluid, also those that walls fill.
#[derive(Debug)]
pub(super) struct Cells {
    pub(super) body: Body,
}

/// A cell that walls fill.
#[derive(Debug)]
pub(super) struct WallCell {
    pub(super) cell: u32,
    pub(super) parts: Vec<WallPart>,
}

/// The fraction of a cell that a point of a wall fills.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallPart {
    /// Number of the wall.
    pub(super) wall: u32,
    pub(super) point: u32,
    pub(super) fraction: f64,
}

impl Cells {
    /// The cells around a body of which the faces that its family does not mirror lie within it.
    pub(super) fn around(body: &Body, family: &Family) -> Result<Cells, BodyError> {
        let (mut min, mut max) = body.bounds();
        let spacing = body.finest_spacing();
        let spec = family.spec();
        // derivatives of derivatives
        let margin = 2.0 * (spec.horizon.of(spacing) / spacing).ceil() * spacing;
        for face in Face::ALL {
            let axis = face.axis();
            let ends = spec.layers.contains(&face) || body.periodic[axis];
            if axis < body.dimension && !ends {
                match face.is_upper() {
                    true => max[axis] += margin,
                    false => min[axis] -= margin,
                }
            }
        }
        let shape = Shape::Box(BoxShape {
            min: min.into(),
            max: max.into(),
        });
        let mut cells = Body::fill(&body.name, &shape, body.dimension, spacing, body.thickness)?;
        let periodic = Axis::ALL.into_iter();
        let periodic: Vec<Axis> = periodic.filter(|a| body.periodic[a.index()]).collect();
        cells.repeat(&periodic)?;
        Ok(Cells { body: cells })
    }

    fn grid(&self) -> &Lattice {
        self.body.lattice().expect("filled with cells")
    }

    /// Place of a position (m) in cells from the centre of the first one.
    fn place(&self, x: &Vector3<f64>) -> [f64; 3] {
        let grid = self.grid();
        std::array::from_fn(|a| (x[a] - grid.origin[a]) / grid.spacing - 0.5)
    }

    /// Number of a cell, behind periodic faces that of its copy.
    fn number(&self, cell: [i64; 3]) -> Option<u32> {
        let grid = self.grid();
        let wrapped = std::array::from_fn(|a| match self.body.periodic[a] {
            true => cell[a].rem_euclid(grid.cells[a] as i64),
            false => cell[a],
        });
        grid.point(wrapped).map(|n| n as u32)
    }

    /// The cell of each point of a fluid.
    pub(super) fn of_points(&self, points: &[Vector3<f64>]) -> Vec<u32> {
        let cell = |x| self.number(self.place(x).map(|c| c.round() as i64));
        points.iter().map(|x| cell(x).expect("a cell")).collect()
    }

    /// What points of walls at these positions (m) fill of each cell but those of the fluid.
    pub(super) fn filled(&self, walls: &[&[Vector3<f64>]], fluid: &[u32]) -> Vec<Vec<WallPart>> {
        let mut filled = vec![Vec::new(); self.body.points.len()];
        for (wall, positions) in (0..).zip(walls) {
            for (point, x) in (0..).zip(*positions) {
                self.for_each_corner(x, |cell, fraction| {
                    if let Some(cell) = self.number(cell).filter(|_| fraction > LEAST_FRACTION) {
                        filled[cell as usize].push(WallPart {
                            wall,
                            point,
                            fraction,
                        });
                    }
                });
            }
        }
        fluid.iter().for_each(|c| filled[*c as usize].clear());
        filled
    }

    /// Passes the cells whose centres lie around a position (m), with their fractions in a linear interpolation, to `receive`.
    fn for_each_corner(&self, x: &Vector3<f64>, mut receive: impl FnMut([i64; 3], f64)) {
        let at = self.place(x);
        for corner in 0..1_usize << self.body.dimension {
            let (mut cell, mut fraction) = ([0; 3], 1.0);
            for a in 0..self.body.dimension {
                cell[a] = at[a].floor() as i64 + (corner >> a & 1) as i64;
                fraction *= 1.0 - (at[a] - cell[a] as f64).abs();
            }
            receive(cell, fraction);
        }
    }

    /// A field of the cells at a position, m.
    pub(super) fn interpolate(&self, field: &[Vector3<f64>], x: &Vector3<f64>) -> Vector3<f64> {
        let grid = self.grid();
        let (mut sum, mut fractions) = (Vector3::zeros(), 0.0);
        self.for_each_corner(x, |mut cell, fraction| {
            for (a, cell) in cell.iter_mut().enumerate().take(self.body.dimension) {
                let size = grid.cells[a] as i64;
                *cell = match self.body.periodic[a] {
                    true => cell.rem_euclid(size),
                    false => (*cell).clamp(0, size - 1),
                };
            }
            if let Some(cell) = grid.point(cell) {
                sum += fraction * field[cell];
                fractions += fraction;
            }
        });
        sum / fractions
    }

    /// The cells beside each one, below and above along each axis; itself behind a face.
    pub(super) fn beside(&self) -> Vec<[[u32; 2]; 3]> {
        let beside = |cell: &[u32; 3], axis: usize, step: i64| {
            let mut to = cell.map(i64::from);
            to[axis] += step;
            let itself = || self.number(cell.map(i64::from)).expect("itself");
            self.number(to).unwrap_or_else(itself)
        };
        let cells = self.grid().cells_of_points();
        let cells = cells.map(|cell| [0, 1, 2].map(|a| [-1, 1].map(|s| beside(&cell, a, s))));
        cells.collect()
    }

    /// Best factor of a successive over-relaxation, from the radius of a Jacobi iteration on a box.
    pub(super) fn over_relaxation(&self) -> f64 {
        let (grid, dimension) = (self.grid(), self.body.dimension);
        let wave = |a: usize| (PI / grid.cells[a] as f64).cos();
        let radius = (0..dimension).map(wave).sum::<f64>() / dimension as f64;
        2.0 / (1.0 + (1.0 - radius * radius).sqrt())
    }
}
