//! Cells between the points of a lattice, so that other tools can contour and clip.
//!
//! The corners of a cell are points of the body: fields belong to points, and are interpolated between them. A body reaches half
//! a spacing beyond its outermost points, which the cells do not show.

use perimelt_core::log::BodyInfo;

use crate::cell_grid::CellGrid;
use crate::log_names::SPACING;
use perimelt_core::log::LoggedCloud;

/// Cells of VTK.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mesh {
    /// points of all cells
    pub connectivity: Vec<i32>,
    /// end of each cell in `connectivity`
    pub offsets: Vec<i32>,
    /// VTK's number of the type of each cell
    pub types: Vec<u8>,
}

/// Types of cells by the number of axes along which they extend: vertex, line, quadrilateral, hexahedron.
const TYPES: [u8; 4] = [1, 3, 9, 12];

impl Mesh {
    /// Hexahedra, quadrilaterals or lines between the points of a lattice, whose reference positions (m) are given. Points without
    /// a cell are vertices, and so are all points that are on no lattice: those of several spacings, and of a fluid that has moved.
    pub(super) fn new(body: &BodyInfo, cloud: &LoggedCloud, positions: &[[f64; 3]]) -> Self {
        let mut mesh = Self::default();
        let has_spacings = cloud.fields.iter().any(|field| field.name == SPACING);
        let lattice = (!has_spacings)
            .then(|| Lattice::new(body.spacing, positions))
            .flatten();
        let mut is_free = vec![true; positions.len()];
        if let Some(lattice) = lattice {
            lattice.visit(|points| {
                mesh.add(points);
                points.iter().for_each(|&point| is_free[point] = false);
            });
        }
        for point in (0..positions.len()).filter(|&point| is_free[point]) {
            mesh.add(&[point]);
        }
        mesh
    }

    fn add(&mut self, points: &[usize]) {
        // a file of more points would have 50 GB
        let points_of_cell = points.iter().map(|&p| i32::try_from(p).unwrap_or(i32::MAX));
        self.connectivity.extend(points_of_cell);
        self.offsets
            .push(i32::try_from(self.connectivity.len()).unwrap_or(i32::MAX));
        self.types.push(TYPES[points.len().ilog2() as usize]);
    }
}

/// Points by cell of a grid.
struct Lattice {
    cells: [usize; 3],
    points: Vec<Option<usize>>,
}

impl Lattice {
    /// `None` if the points are not on a lattice of this spacing (m).
    fn new(spacing: f64, positions: &[[f64; 3]]) -> Option<Self> {
        /// deviation of positions in single precision, in spacings
        const ROUNDING: f64 = 0.01;
        let grid = CellGrid::new(positions, spacing)?;
        let [nx, ny, nz] = grid.cells;
        let mut points = vec![None; nx * ny * nz];
        for (point, cell) in grid.cell_of_point.iter().enumerate() {
            let deviation = |axis: usize| positions[point][axis] - grid.centre(axis, cell[axis]);
            if (0..3).any(|axis| deviation(axis).abs() > ROUNDING * spacing) {
                return None;
            }
            let [i, j, k] = *cell;
            if points[(k * ny + j) * nx + i].replace(point).is_some() {
                return None;
            }
        }
        Some(Self {
            cells: grid.cells,
            points,
        })
    }

    fn point(&self, [i, j, k]: [usize; 3]) -> Option<usize> {
        self.points[(k * self.cells[1] + j) * self.cells[0] + i]
    }

    /// Passes the points of each cell to `receive`, in VTK's order: around the lower face, then around the upper one.
    fn visit(&self, mut receive: impl FnMut(&[usize])) {
        let axes: Vec<usize> = (0..3).filter(|&axis| self.cells[axis] > 1).collect();
        if axes.is_empty() {
            return;
        }
        let corners: Vec<[usize; 3]> = (0..1 << axes.len())
            .map(|corner: usize| {
                let (first, second, third) = (corner & 1, corner >> 1 & 1, corner >> 2);
                // around, not row by row
                let steps = [first ^ second, second, third];
                let mut offset = [0; 3];
                for (&axis, step) in axes.iter().zip(steps) {
                    offset[axis] = step;
                }
                offset
            })
            .collect();
        let last = self
            .cells
            .map(|count| if count > 1 { count - 1 } else { 1 });
        let mut points = Vec::with_capacity(8);
        for k in 0..last[2] {
            for j in 0..last[1] {
                for i in 0..last[0] {
                    points.clear();
                    let all = corners
                        .iter()
                        .map(|[x, y, z]| self.point([i + x, j + y, k + z]));
                    points.extend(all.flatten());
                    if points.len() == corners.len() {
                        receive(&points);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(spacing: f64, positions: &[[f64; 3]]) -> Mesh {
        let body = BodyInfo {
            spacing,
            ..BodyInfo::default()
        };
        let cloud = LoggedCloud {
            time: 0.0,
            positions: positions.to_vec(),
            fields: Vec::new(),
        };
        Mesh::new(&body, &cloud, positions)
    }

    fn lattice(cells: [usize; 3]) -> Vec<[f64; 3]> {
        let [nx, ny, nz] = cells;
        let cell = |n: usize| [n % nx, n / nx % ny, n / (nx * ny)];
        (0..nx * ny * nz)
            .map(|n| cell(n).map(|i| 0.1 * i as f64))
            .collect()
    }

    #[test]
    fn a_lattice_has_cells_of_its_dimension() {
        let block = mesh(0.1, &lattice([2, 2, 2]));
        assert_eq!(block.connectivity, [0, 1, 3, 2, 4, 5, 7, 6]);
        assert_eq!(
            (&block.offsets[..], &block.types[..]),
            (&[8][..], &[12][..])
        );
        let plate = mesh(0.1, &lattice([3, 2, 1]));
        assert_eq!(plate.connectivity, [0, 1, 4, 3, 1, 2, 5, 4]);
        assert_eq!(plate.types, [9, 9]);
        assert_eq!(mesh(0.1, &lattice([4, 1, 1])).types, [3, 3, 3]);
        assert_eq!(mesh(0.1, &lattice([1, 1, 1])).types, [1]);
        // upright
        let wall = mesh(0.1, &lattice([2, 1, 2]));
        assert_eq!(wall.connectivity, [0, 1, 3, 2]);
    }

    #[test]
    fn points_without_a_cell_are_vertices() {
        let mut positions = lattice([2, 2, 2]);
        positions.push([0.2, 0.0, 0.0]);
        let with_nose = mesh(0.1, &positions);
        assert_eq!(with_nose.types, [12, 1]);
        assert_eq!(with_nose.offsets, [8, 9]);
        // not on a lattice
        positions[0][0] += 0.03;
        assert_eq!(mesh(0.1, &positions).types, [1; 9]);
    }
}
