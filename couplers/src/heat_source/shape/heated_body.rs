//! The body that a source heats, as a lattice of cells with or without a material point.

use std::ops::Range;

use nalgebra::Vector3;
use perimelt_core::solver::ExactSum;
use perimelt_core::transport::Processes;
use perimelt_core::{Face, SetupError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::no_direction;
use crate::toolpath::Pose;

/// A lattice of box-shaped cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellGrid {
    /// Low corner of cell (0, 0, 0) (m); half a spacing below its centre.
    pub origin: Vector3<f64>,
    /// Size of a cell (m). The z size of a plate is its thickness.
    pub spacing: Vector3<f64>,
    /// Number of cells along x, y, z; one along the z of a plate.
    pub dims: [usize; 3],
    /// Whether the body is a plate, a 2D body: the position of a source along z has no effect then.
    pub plate: bool,
}

impl CellGrid {
    /// Whether an axis is the thickness of a plate.
    pub(super) fn is_thickness(&self, axis: usize) -> bool {
        self.plate && axis == 2
    }

    /// A coordinate in spacings from the origin, moved onto a plane between two cells within rounding, so that rounding does
    /// not add a cell above the surface.
    pub(super) fn in_cells(&self, axis: usize, coordinate: f64) -> f64 {
        let cells = (coordinate - self.origin[axis]) / self.spacing[axis];
        if (cells - cells.round()).abs() < 1e-9 {
            cells.round()
        } else {
            cells
        }
    }
}

/// A body on a lattice.
pub trait HeatedBody {
    /// The lattice.
    fn grid(&self) -> &CellGrid;

    /// The point in a cell inside `dims`, or `None` where there is no material.
    fn point(&self, cell: [usize; 3]) -> Option<usize>;

    /// Volume of a point (m³).
    fn volume(&self, point: usize) -> f64;

    /// The total of what each process has summed over its cells.
    fn total(&self, own: ExactSum) -> f64 {
        own.value()
    }

    /// The cells of a box, ranges along the axes, which processes share; `None` where this process has all. Collective.
    fn gathered(&self, _cells: [Range<usize>; 3]) -> Option<GatheredCells> {
        None
    }

    /// Fraction of the first of two fluids at a point, where there are two.
    fn first_fluid(&self, _point: usize) -> Option<f64> {
        None
    }

    /// Power density (W/m³) with which a point boils at the end of the step, zero where it boils; infinite where it never boils.
    fn boiling_power(&self, _point: usize) -> f64 {
        f64::INFINITY
    }
}

/// Cells of a box, whichever process owns their points. A point is the number of its cell in the box.
#[derive(Debug)]
pub struct GatheredCells {
    grid: CellGrid,
    cells: [Range<usize>; 3],
    /// m³.
    volume: f64,
    /// See [`HeatedBody::first_fluid`] and [`HeatedBody::boiling_power`]; infinite where there is no point.
    fraction: Vec<f64>,
    boiling: Vec<f64>,
    is_there: Vec<bool>,
    /// The points that this process owns.
    pub(super) own: Vec<(usize, usize)>,
}

impl GatheredCells {
    /// Those of a body of which each process has its own points. Collective.
    pub(in crate::heat_source) fn of(
        body: &impl HeatedBody,
        processes: &Processes,
        cells: [Range<usize>; 3],
    ) -> GatheredCells {
        let count: usize = cells.iter().map(Range::len).product();
        let mut gathered = GatheredCells {
            grid: *body.grid(),
            cells,
            volume: f64::INFINITY,
            fraction: vec![f64::INFINITY; count],
            boiling: vec![f64::INFINITY; count],
            is_there: Vec::new(),
            own: Vec::new(),
        };
        let mut absent = vec![1.0; count];
        let [across, rows, layers] = gathered.cells.clone();
        let rows = || {
            layers
                .clone()
                .flat_map(|k| rows.clone().map(move |j| (j, k)))
        };
        let all = rows().flat_map(|(j, k)| across.clone().map(move |i| [i, j, k]));
        for (number, cell) in all.enumerate() {
            if let Some(point) = body.point(cell) {
                absent[number] = 0.0;
                gathered.boiling[number] = body.boiling_power(point);
                if let Some(fraction) = body.first_fluid(point) {
                    gathered.fraction[number] = fraction;
                }
                gathered.own.push((number, point));
            }
        }
        let own = gathered.own.first();
        let mut volume = [own.map_or(f64::INFINITY, |(_, point)| body.volume(*point))];
        let GatheredCells {
            boiling, fraction, ..
        } = &mut gathered;
        for values in [&mut volume[..], &mut absent, boiling, fraction] {
            processes.min_each(values);
        }
        gathered.volume = volume[0];
        gathered.is_there = absent.into_iter().map(|absent| absent == 0.0).collect();
        gathered
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.is_there.len()
    }
}

impl HeatedBody for GatheredCells {
    fn grid(&self) -> &CellGrid {
        &self.grid
    }

    fn point(&self, cell: [usize; 3]) -> Option<usize> {
        let is_inside = (cell.iter().zip(&self.cells)).all(|(at, range)| range.contains(at));
        let [i, j, k] = [0, 1, 2].map(|a| cell[a].wrapping_sub(self.cells[a].start));
        let [nx, ny, _] = [0, 1, 2].map(|a| self.cells[a].len());
        let number = (k * ny + j) * nx + i;
        (is_inside && self.is_there[number]).then_some(number)
    }

    fn volume(&self, _: usize) -> f64 {
        self.volume
    }

    fn first_fluid(&self, point: usize) -> Option<f64> {
        Some(self.fraction[point])
    }

    fn boiling_power(&self, point: usize) -> f64 {
        self.boiling[point]
    }
}

/// Depth range of cell `index`, in spacings, below a face at `level`, in spacings.
pub(super) fn depth_range(face: Face, index: i64, level: f64) -> (f64, f64) {
    let (low, high) = (index as f64, (index + 1) as f64);
    if face.is_upper() {
        (level - high, level - low)
    } else {
        (low - level, high - level)
    }
}

/// The heated face and its position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeatedSurface {
    /// The face, from which depth counts into the body; default `"z+"`.
    #[serde(default = "top")]
    pub face: Face,
    /// Its coordinate along the depth axis (m). Default: that of the toolpath, or of the face of
    /// the body for a source without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level: Option<f64>,
    /// Direction of the torch's axis, into the material, of any length: a torch in a fillet, `[0, -1, -1]`. Depth counts
    /// along it from the position of the toolpath, in 3D bodies. Default normal to `face`, or that of the toolpath.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
}

impl HeatedSurface {
    /// Coordinate of the face along the depth axis for a source at a pose, m.
    pub(super) fn level_at(&self, pose: &Pose) -> f64 {
        self.level.unwrap_or(pose.position[self.face.axis()])
    }

    /// Unit vector along the axis of the torch, where it is given.
    pub(super) fn axis(&self, body: &CellGrid) -> Result<Option<Vector3<f64>>, SetupError> {
        let Some(direction) = self.direction else {
            return Ok(None);
        };
        let axis = Vector3::from(direction).try_normalize(0.0);
        match axis.filter(|a| a.iter().all(|c| c.is_finite())) {
            Some(_) if body.plate => Err(no_direction("a plate (2D)")),
            Some(axis) => Ok(Some(axis)),
            None => Err(no_direction("a direction of length zero")),
        }
    }
}

fn top() -> Face {
    Face::ZMax
}

impl Default for HeatedSurface {
    fn default() -> Self {
        HeatedSurface {
            face: top(),
            level: None,
            direction: None,
        }
    }
}

#[cfg(test)]
pub(super) mod lattice {
    use super::*;

    /// A lattice whose points are numbered cell by cell, with holes.
    pub struct TestLattice {
        pub grid: CellGrid,
        pub material: fn([usize; 3]) -> bool,
    }

    impl TestLattice {
        pub fn full(origin: [f64; 3], spacing: [f64; 3], dims: [usize; 3]) -> Self {
            let grid = CellGrid {
                origin: origin.into(),
                spacing: spacing.into(),
                dims,
                plate: false,
            };
            Self {
                grid,
                material: |_| true,
            }
        }

        /// `size` × `size` cells of `spacing`, centred on x = y = 0.
        pub fn plate(spacing: f64, thickness: f64, size: usize) -> Self {
            let low = -0.5 * spacing * size as f64;
            let mut plate = Self::full(
                [low, low, -0.5 * thickness],
                [spacing, spacing, thickness],
                [size, size, 1],
            );
            plate.grid.plate = true;
            plate
        }

        pub fn zeros(&self) -> Vec<f64> {
            vec![0.0; self.grid.dims.iter().product()]
        }

        /// Sum of density times volume (W).
        pub fn power(&self, values: &[f64]) -> f64 {
            values
                .iter()
                .enumerate()
                .map(|(point, value)| value * self.volume(point))
                .sum()
        }
    }

    impl HeatedBody for TestLattice {
        fn grid(&self) -> &CellGrid {
            &self.grid
        }

        fn point(&self, cell: [usize; 3]) -> Option<usize> {
            let [nx, ny, _] = self.grid.dims;
            (self.material)(cell).then_some(cell[0] + nx * (cell[1] + ny * cell[2]))
        }

        fn volume(&self, _: usize) -> f64 {
            self.grid.spacing.product()
        }
    }
}
