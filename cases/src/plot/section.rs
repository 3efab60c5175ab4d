//! Plane views of a body for pictures of its points.

use crate::cell_grid::CellGrid;

/// Values on a raster of square cells.
#[derive(Clone, Debug)]
pub(crate) struct Raster {
    /// centre of cell (0, 0), m
    pub origin: [f64; 2],
    /// edge of a cell, m
    pub spacing: f64,
    /// number of cells
    pub cells: [usize; 2],
    /// value of each cell, the first axis fastest; NaN where there is no point
    pub values: Vec<f64>,
    /// point of each cell
    pub points: Vec<Option<usize>>,
}

impl Raster {
    pub(crate) fn value(&self, i: usize, j: usize) -> f64 {
        self.values[j * self.cells[0] + i]
    }

    pub(crate) fn centre(&self, (i, j): (usize, usize)) -> [f64; 2] {
        let centre = |axis: usize, index: usize| self.origin[axis] + index as f64 * self.spacing;
        [centre(0, i), centre(1, j)]
    }
}

/// A view of a body along an axis.
#[derive(Clone, Debug)]
pub(crate) struct View {
    /// the two axes that it shows (0, 1, 2 for x, y, z)
    pub axes: [usize; 2],
    /// what it is, empty for a plane body
    pub caption: String,
    /// what it shows
    pub raster: Raster,
}

/// Views of a body: itself in one and two dimensions; in three, its surface from above, and the
/// section y = const through the point where `heat` (one value per point) is largest.
pub(crate) fn views(grid: &CellGrid, dimension: usize, values: &[f64], heat: &[f64]) -> Vec<View> {
    if dimension < 3 {
        let everything = view(grid, [0, 1], values, |_| true);
        return vec![View {
            axes: [0, 1],
            caption: String::new(),
            raster: everything,
        }];
    }
    let hottest = (0..heat.len())
        .filter(|&point| !heat[point].is_nan())
        .max_by(|&a, &b| heat[a].total_cmp(&heat[b]))
        .unwrap_or(0);
    let row = grid.cell_of_point[hottest][1];
    let y = grid.centre(1, row);
    let unit = super::unit::length(grid.cells[1] as f64 * grid.spacing);
    let y_text = super::unit::number(y * unit.factor, 4);
    vec![
        View {
            axes: [0, 1],
            caption: "surface from above".into(),
            raster: view(grid, [0, 1], values, |_| true),
        },
        View {
            axes: [0, 2],
            caption: format!("section y = {y_text} {}", unit.unit),
            raster: view(grid, [0, 2], values, |cell| cell[1] == row),
        },
    ]
}

/// Among the chosen cells, those with the largest coordinate along the axis that is not shown.
fn view(
    grid: &CellGrid,
    axes: [usize; 2],
    values: &[f64],
    chosen: impl Fn([usize; 3]) -> bool,
) -> Raster {
    let hidden = 3 - axes[0] - axes[1];
    let cells = axes.map(|axis| grid.cells[axis]);
    let mut points: Vec<Option<usize>> = vec![None; cells[0] * cells[1]];
    let mut height = vec![0; points.len()];
    for (point, cell) in grid.covered().filter(|(_, cell)| chosen(*cell)) {
        let column = cell[axes[1]] * cells[0] + cell[axes[0]];
        if points[column].is_none() || height[column] < cell[hidden] {
            points[column] = Some(point);
            height[column] = cell[hidden];
        }
    }
    let value = |point: &Option<usize>| point.map_or(f64::NAN, |point| values[point]);
    Raster {
        origin: axes.map(|axis| grid.origin[axis]),
        spacing: grid.spacing,
        cells,
        values: points.iter().map(value).collect(),
        points,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_show_the_topmost_points_and_the_hottest_row() {
        // a stair: the column at x = 1 is one cell lower
        let positions = [
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 1.0, 1.0],
            [1.0, 1.0, 0.0],
        ];
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let grid = CellGrid::new(&positions, 1.0).expect("a lattice");
        let views = views(&grid, 3, &values, &[0.0, 9.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(views[0].raster.values, [2.0, 3.0, 5.0, 6.0]);
        let section = &views[1].raster;
        assert_eq!(section.values[..3], [1.0, 3.0, 2.0]);
        assert!(section.values[3].is_nan());
        assert_eq!(views[1].caption, "section y = 0 m");
    }
}
