//! The lattice that a logged cloud of points sits on.

/// Cells beyond this many per point mean that the points are not on a lattice (a single runaway
/// point would otherwise ask for any amount of memory).
const MAX_CELLS_PER_POINT: usize = 64;

/// Uniform grid of cells through the points of a cloud.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    /// centre of cell (0, 0, 0), m
    pub origin: [f64; 3],
    /// edge of a cell, m
    pub spacing: f64,
    /// number of cells along x, y, z
    pub cells: [usize; 3],
    /// cell of each point
    pub cell_of_point: Vec<[usize; 3]>,
}

impl Grid {
    /// Sorts points (m) into cells of `spacing` (m); `None` if there are no points, if one is not
    /// finite, or if they are scattered too widely for a grid.
    pub(crate) fn new(positions: &[[f64; 3]], spacing: f64) -> Option<Self> {
        if positions.is_empty() || !(spacing > 0.0 && spacing.is_finite()) {
            return None;
        }
        let mut origin = [f64::INFINITY; 3];
        let mut end = [f64::NEG_INFINITY; 3];
        for position in positions {
            for axis in 0..3 {
                if !position[axis].is_finite() {
                    return None;
                }
                origin[axis] = origin[axis].min(position[axis]);
                end[axis] = end[axis].max(position[axis]);
            }
        }
        let limit = positions
            .len()
            .saturating_mul(MAX_CELLS_PER_POINT)
            .saturating_add(1 << 20);
        let cell =
            |axis: usize, coordinate: f64| ((coordinate - origin[axis]) / spacing).round() as usize;
        let cells = [0, 1, 2].map(|axis| cell(axis, end[axis]).saturating_add(1));
        let total = cells
            .iter()
            .fold(1_usize, |total, &n| total.saturating_mul(n));
        if total > limit {
            return None;
        }
        let cell_of_point = positions
            .iter()
            .map(|p| [0, 1, 2].map(|axis| cell(axis, p[axis])))
            .collect();
        Some(Self {
            origin,
            spacing,
            cells,
            cell_of_point,
        })
    }

    /// Values of the points by cell, x fastest; NaN where there is no point, and the largest where
    /// points have moved into one cell.
    pub(crate) fn by_cell(&self, values: &[f64]) -> Vec<f64> {
        let [nx, ny, nz] = self.cells;
        let mut by_cell = vec![f64::NAN; nx * ny * nz];
        for (&[i, j, k], &value) in self.cell_of_point.iter().zip(values) {
            let cell = &mut by_cell[(k * ny + j) * nx + i];
            *cell = cell.max(value);
        }
        by_cell
    }

    /// Coordinate (m) of the centre of cell number `index` along an axis.
    pub(crate) fn centre(&self, axis: usize, index: usize) -> f64 {
        self.origin[axis] + index as f64 * self.spacing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_fall_into_their_cells_despite_rounding() {
        let positions = [[0.05, 0.0, 0.0], [0.15 + 1e-9, 0.0, 0.0], [0.35, 0.1, 0.0]];
        let grid = Grid::new(&positions, 0.1).expect("a lattice");
        assert_eq!(grid.cells, [4, 2, 1]);
        assert_eq!(grid.cell_of_point, [[0, 0, 0], [1, 0, 0], [3, 1, 0]]);
        let values = grid.by_cell(&[1.0, 2.0, 3.0]);
        assert_eq!(values[0], 1.0);
        assert_eq!(values[7], 3.0);
        assert!(values[2].is_nan());
    }

    #[test]
    fn a_runaway_point_is_refused_and_not_allocated_for() {
        assert!(Grid::new(&[[0.0; 3], [1e30, 0.0, 0.0]], 0.1).is_none());
        assert!(Grid::new(&[[0.0; 3], [f64::NAN, 0.0, 0.0]], 0.1).is_none());
        assert!(Grid::new(&[], 0.1).is_none());
    }
}
