//! Plane views of a body for pictures of its points.

use super::args::{AXES, Cut};
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
    /// number of the cell's layer along the axis that is not shown
    pub heights: Vec<usize>,
}

impl Raster {
    pub(crate) fn value(&self, i: usize, j: usize) -> f64 {
        self.values[j * self.cells[0] + i]
    }

    pub(crate) fn centre(&self, [i, j]: [usize; 2]) -> [f64; 2] {
        let centre = |axis: usize, index: usize| self.origin[axis] + index as f64 * self.spacing;
        [centre(0, i), centre(1, j)]
    }
}

/// A view of a body along an axis.
#[derive(Clone, Debug)]
pub(crate) struct View {
    /// the two axes that it shows (0, 1, 2 for x, y, z)
    pub axes: [usize; 2],
    /// caption, empty for a plane body
    pub caption: String,
    /// the plane of a section, with its letter
    pub cut: Option<(Cut, char)>,
    /// the values shown
    pub raster: Raster,
}

/// A section beside a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Outside {
    pub cut: Cut,
    /// first and last coordinate of the body, m
    pub extent: [f64; 2],
}

/// Views of a body: itself in one and two dimensions; in three, its surface from above, and the sections.
///
/// # Errors
/// A section beside the body.
pub(crate) fn views(
    grid: &CellGrid,
    dimension: usize,
    values: &[f64],
    cuts: &[Cut],
) -> Result<Vec<View>, Outside> {
    let whole = |caption: &str| View {
        axes: [0, 1],
        caption: caption.into(),
        cut: None,
        raster: view(grid, [0, 1], values, |_| true),
    };
    if dimension < 3 {
        return Ok(vec![whole("")]);
    }
    let mut views = vec![whole("surface from above")];
    for (cut, letter) in cuts.iter().zip('A'..='Z') {
        views.push(section(grid, values, *cut, letter)?);
    }
    Ok(views)
}

/// The cells in whose row a plane lies.
fn section(grid: &CellGrid, values: &[f64], cut: Cut, letter: char) -> Result<View, Outside> {
    let Cut { axis, at } = cut;
    let half = 0.5 * grid.spacing;
    let (first, last) = (
        grid.centre(axis, 0) - half,
        grid.centre(axis, grid.cells[axis] - 1) + half,
    );
    // faces are not exact in single precision
    let slack = 1e-3 * grid.spacing;
    if !(first - slack <= at && at <= last + slack) {
        // without the rounding of single precision
        let grain = 1e-6 * (last - first);
        let extent = [first, last].map(|x| (x / grain).round() * grain);
        return Err(Outside { cut, extent });
    }
    let row = (((at - first) / grid.spacing).max(0.0) as usize).min(grid.cells[axis] - 1);
    let centre = grid.centre(axis, row);
    let unit = crate::unit::length((last - first).max(centre.abs()));
    let axes = [[1, 2], [0, 2], [0, 1]][axis];
    Ok(View {
        axes,
        caption: format!(
            "section {letter}, {} = {} {}",
            AXES[axis],
            crate::unit::signed_number(centre * unit.factor, 4),
            unit.unit
        ),
        cut: Some((Cut { axis, at: centre }, letter)),
        raster: view(grid, axes, values, |cell| cell[axis] == row),
    })
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
    let mut heights = vec![0; points.len()];
    for (point, cell) in grid.covered().filter(|(_, cell)| chosen(*cell)) {
        let column = cell[axes[1]] * cells[0] + cell[axes[0]];
        if points[column].is_none() || heights[column] < cell[hidden] {
            points[column] = Some(point);
            heights[column] = cell[hidden];
        }
    }
    let value = |point: &Option<usize>| point.map_or(f64::NAN, |point| values[point]);
    Raster {
        origin: axes.map(|axis| grid.origin[axis]),
        spacing: grid.spacing,
        cells,
        values: points.iter().map(value).collect(),
        points,
        heights,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_show_the_topmost_points_and_the_rows_of_the_sections() {
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
        let cut = |axis, at| Cut { axis, at };
        let cuts = [cut(1, 0.2), cut(0, 1.5), cut(2, -0.5)];
        let views = views(&grid, 3, &values, &cuts).expect("inside");
        assert_eq!(views[0].raster.values, [2.0, 3.0, 5.0, 6.0]);
        let along = &views[1].raster;
        assert_eq!(along.values[..3], [1.0, 3.0, 2.0]);
        assert!(along.values[3].is_nan());
        assert_eq!(views[1].caption, "section A, y = 0 m");
        assert_eq!(
            (views[2].axes, &*views[2].caption),
            ([1, 2], "section B, x = 1 m")
        );
        assert_eq!(views[2].raster.values[..2], [3.0, 6.0]);
        assert_eq!(views[3].raster.values, [1.0, 3.0, 4.0, 6.0]);
        let beside = super::views(&grid, 3, &values, &[cut(0, 1.6)]).expect_err("outside");
        let extent = beside.extent;
        assert!((extent[0] + 0.5).abs() < 1e-9 && (extent[1] - 1.5).abs() < 1e-9);
    }
}
