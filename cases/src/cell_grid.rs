//! Uniform grid of cells through the points of a body or of a logged cloud.

/// Cells beyond this many per point mean that the points are not on a lattice (a single
/// remote point would otherwise need any amount of memory).
const MAX_CELLS_PER_POINT: usize = 64;

/// Uniform grid of cells through the points of a cloud.
#[derive(Clone, Debug)]
pub(crate) struct CellGrid {
    /// centre of cell (0, 0, 0), m
    pub origin: [f64; 3],
    /// edge of a cell, m
    pub spacing: f64,
    /// number of cells along x, y, z
    pub cells: [usize; 3],
    /// cell of each point
    pub cell_of_point: Vec<[usize; 3]>,
    /// points and the cells that they cover, where points cover several
    covered: Option<Vec<(usize, [usize; 3])>>,
}

/// Number of cells of a grid; `None` if they are too many for the points.
fn number_of_cells(cells: [usize; 3], points: usize) -> Option<usize> {
    let total = cells
        .iter()
        .fold(1_usize, |total, &n| total.saturating_mul(n));
    let limit = points
        .saturating_mul(MAX_CELLS_PER_POINT)
        .saturating_add(1 << 20);
    (total <= limit).then_some(total)
}

impl CellGrid {
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
        let cell =
            |axis: usize, coordinate: f64| ((coordinate - origin[axis]) / spacing).round() as usize;
        let cells = [0, 1, 2].map(|axis| cell(axis, end[axis]).saturating_add(1));
        number_of_cells(cells, positions.len())?;
        let cell_of_point = positions
            .iter()
            .map(|p| [0, 1, 2].map(|axis| cell(axis, p[axis])))
            .collect();
        Some(Self {
            origin,
            spacing,
            cells,
            cell_of_point,
            covered: None,
        })
    }

    /// Grid with cells of the smallest of the `spacings` (m). A cell belongs to the point that is nearest in
    /// spacings of that point, so that displaced points and points of several spacings leave no gaps; `None` as in
    /// [`CellGrid::new`].
    pub(crate) fn of_spacings(positions: &[[f64; 3]], spacings: &[f64]) -> Option<Self> {
        let finest = spacings.iter().copied().fold(f64::INFINITY, f64::min);
        let points = || positions.iter().zip(spacings);
        if !(finest > 0.0 && finest.is_finite())
            || points().any(|(x, _)| !x.iter().all(|x| x.is_finite()))
        {
            return None;
        }
        let mut origin = [0.0; 3];
        let mut cells = [1; 3];
        for axis in 0..3 {
            let flat = positions.iter().all(|x| x[axis] == positions[0][axis]);
            let half = |spacing: f64| if flat { 0.5 * finest } else { 0.5 * spacing };
            let low = points()
                .map(|(x, s)| x[axis] - half(*s))
                .fold(f64::INFINITY, f64::min);
            let high = points()
                .map(|(x, s)| x[axis] + half(*s))
                .fold(f64::NEG_INFINITY, f64::max);
            origin[axis] = low + 0.5 * finest;
            cells[axis] = (((high - low) / finest).round() as usize).max(1);
        }
        let own = |x: &[f64; 3]| {
            [0, 1, 2].map(|a| {
                (((x[a] - origin[a]) / finest).round().max(0.0) as usize).min(cells[a] - 1)
            })
        };
        number_of_cells(cells, positions.len())?;
        let mut grid = Self {
            origin,
            spacing: finest,
            cells,
            cell_of_point: positions.iter().map(own).collect(),
            covered: None,
        };
        grid.covered = Some(grid.nearest_points(positions, spacings));
        Some(grid)
    }

    /// The cells that a point covers, each with the point that is nearest in spacings of that point.
    fn nearest_points(&self, positions: &[[f64; 3]], spacings: &[f64]) -> Vec<(usize, [usize; 3])> {
        /// cells of displaced points can be incomplete by this length, in spacings
        const SLACK: f64 = 0.25;
        let (origin, cells, finest) = (self.origin, self.cells, self.spacing);
        let mut nearest = vec![(f64::INFINITY, 0); cells.iter().product()];
        for (point, (x, spacing)) in positions.iter().zip(spacings).enumerate() {
            let reach = (0.5 + SLACK) * spacing;
            let cell = |axis: usize, at: f64| ((at - origin[axis]) / finest).max(0.0);
            let range = |axis: usize| {
                let first = cell(axis, x[axis] - reach - 1e-6 * finest).ceil() as usize;
                first..(cell(axis, x[axis] + reach + 1e-6 * finest) as usize + 1).min(cells[axis])
            };
            for k in range(2) {
                for j in range(1) {
                    for i in range(0) {
                        let away = |axis: usize, index: usize| {
                            (origin[axis] + index as f64 * finest - x[axis]).abs() / spacing
                        };
                        let away = away(0, i).max(away(1, j)).max(away(2, k));
                        let best = &mut nearest[(k * cells[1] + j) * cells[0] + i];
                        // a millionth: the choice between two points at equal distance must not depend on rounding
                        if away < best.0 - 1e-6 {
                            *best = (away, point);
                        }
                    }
                }
            }
        }
        let cell_of = |index: usize| {
            [
                index % cells[0],
                index / cells[0] % cells[1],
                index / (cells[0] * cells[1]),
            ]
        };
        let cells = nearest.into_iter().enumerate();
        cells
            .filter(|(_, (away, _))| away.is_finite())
            .map(|(index, (_, point))| (point, cell_of(index)))
            .collect()
    }

    /// Points with the cells that they cover.
    pub(crate) fn covered(&self) -> Box<dyn Iterator<Item = (usize, [usize; 3])> + '_> {
        match &self.covered {
            Some(covered) => Box::new(covered.iter().copied()),
            None => Box::new(self.cell_of_point.iter().copied().enumerate()),
        }
    }

    /// Values of the points by cell, x fastest; NaN where there is no point, and the largest where
    /// points have moved into one cell.
    pub(crate) fn by_cell(&self, values: &[f64]) -> Vec<f64> {
        let [nx, ny, nz] = self.cells;
        let mut by_cell = vec![f64::NAN; nx * ny * nz];
        for (point, [i, j, k]) in self.covered() {
            let cell = &mut by_cell[(k * ny + j) * nx + i];
            *cell = cell.max(values[point]);
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
        let grid = CellGrid::new(&positions, 0.1).expect("a lattice");
        assert_eq!(grid.cells, [4, 2, 1]);
        assert_eq!(grid.cell_of_point, [[0, 0, 0], [1, 0, 0], [3, 1, 0]]);
        let values = grid.by_cell(&[1.0, 2.0, 3.0]);
        assert_eq!(values[0], 1.0);
        assert_eq!(values[7], 3.0);
        assert!(values[2].is_nan());
    }

    #[test]
    fn points_cover_the_cells_of_their_own_size_even_when_displaced() {
        // two fine points beside a coarse one
        let positions = [[0.05, 0.06, 0.0], [0.04, 0.15, 0.0], [0.2, 0.1, 0.0]];
        let grid = CellGrid::of_spacings(&positions, &[0.1, 0.1, 0.2]).expect("near each other");
        assert_eq!(grid.cells, [3, 2, 1]);
        assert_eq!(
            grid.by_cell(&[1.0, 2.0, 3.0]),
            [1.0, 3.0, 3.0, 2.0, 3.0, 3.0]
        );
        assert!(CellGrid::of_spacings(&[[0.0; 3], [1e30, 0.0, 0.0]], &[0.1; 2]).is_none());
    }

    #[test]
    fn a_runaway_point_is_refused_and_not_allocated_for() {
        assert!(CellGrid::new(&[[0.0; 3], [1e30, 0.0, 0.0]], 0.1).is_none());
        assert!(CellGrid::new(&[[0.0; 3], [f64::NAN, 0.0, 0.0]], 0.1).is_none());
        assert!(CellGrid::new(&[], 0.1).is_none());
    }
}
