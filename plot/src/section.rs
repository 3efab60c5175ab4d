//! Plane views of a body for pictures of its points.

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// A plane on which one coordinate is constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// 0, 1, 2 for x, y, z
    pub axis: usize,
    /// the coordinate, m
    pub at: f64,
}

/// A body as cubic cells.
#[derive(Clone, Debug)]
pub struct Cells {
    /// centre of cell (0, 0, 0), m
    pub origin: [f64; 3],
    /// edge of a cell, m
    pub spacing: f64,
    /// number of cells along x, y, z
    pub counts: [usize; 3],
    /// points with the cells that they cover
    pub covered: Vec<(usize, [usize; 3])>,
}

/// Values on a raster of square cells.
#[derive(Clone, Debug)]
pub struct Raster {
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
    pub(crate) fn value(&self, [i, j]: [usize; 2]) -> f64 {
        self.values[j * self.cells[0] + i]
    }

    pub(crate) fn centre(&self, cell: [usize; 2]) -> [f64; 2] {
        [0, 1].map(|axis| self.origin[axis] + cell[axis] as f64 * self.spacing)
    }

    /// For tests: `n` by `n` cells of 0.1 m around the origin, one point each.
    #[cfg(test)]
    pub(crate) fn of(n: usize, value: impl Fn([f64; 2]) -> f64) -> Self {
        let mut raster = Self {
            origin: [-0.05 * (n as f64 - 1.0); 2],
            spacing: 0.1,
            cells: [n, n],
            values: Vec::new(),
            points: (0..n * n).map(Some).collect(),
            heights: vec![0; n * n],
        };
        let place = |cell: usize| raster.centre([cell % n, cell / n]);
        raster.values = (0..n * n).map(place).map(value).collect();
        raster
    }
}

/// A view of a body along an axis.
#[derive(Clone, Debug)]
pub struct View {
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
pub struct Outside {
    /// the section
    pub cut: Cut,
    /// first and last coordinate of the body, m
    pub extent: [f64; 2],
}

/// Views of the values of the points: the body itself in one and two dimensions; in three, its surface from above, and the sections,
/// each through the middles of a row of cells and with a `caption` of this plane.
///
/// # Errors
/// A section beside the body.
pub fn views(
    cells: &Cells,
    dimension: usize,
    values: &[f64],
    cuts: &[Cut],
    caption: impl Fn(Cut, char) -> String,
) -> Result<Vec<View>, Outside> {
    let whole = |caption: &str| View {
        axes: [0, 1],
        caption: caption.into(),
        cut: None,
        raster: raster(cells, [0, 1], values, |_| true),
    };
    if dimension < 3 {
        return Ok(vec![whole("")]);
    }
    let mut views = vec![whole("surface from above")];
    for (cut, letter) in cuts.iter().zip('A'..='Z') {
        let (row, cut) = row_of(cells, *cut)?;
        let axes = [[1, 2], [0, 2], [0, 1]][cut.axis];
        views.push(View {
            axes,
            caption: caption(cut, letter),
            cut: Some((cut, letter)),
            raster: raster(cells, axes, values, |cell| cell[cut.axis] == row),
        });
    }
    Ok(views)
}

/// The row of cells in which a plane lies, and the plane through the middles of these cells.
fn row_of(cells: &Cells, cut: Cut) -> Result<(usize, Cut), Outside> {
    let Cut { axis, at } = cut;
    let last_row = cells.counts[axis] - 1;
    let centre = |row: usize| cells.origin[axis] + row as f64 * cells.spacing;
    let half = 0.5 * cells.spacing;
    let (first, last) = (centre(0) - half, centre(last_row) + half);
    // faces are not exact in single precision
    let slack = 1e-3 * cells.spacing;
    if !(first - slack <= at && at <= last + slack) {
        // without the rounding of single precision
        let grain = 1e-6 * (last - first);
        let extent = [first, last].map(|x| (x / grain).round() * grain);
        return Err(Outside { cut, extent });
    }
    let row = (((at - first) / cells.spacing).max(0.0) as usize).min(last_row);
    let at = centre(row);
    Ok((row, Cut { axis, at }))
}

/// Among the chosen cells, those with the largest coordinate along the axis that is not shown.
fn raster(
    cells: &Cells,
    axes: [usize; 2],
    values: &[f64],
    chosen: impl Fn([usize; 3]) -> bool,
) -> Raster {
    let hidden = 3 - axes[0] - axes[1];
    let counts = axes.map(|axis| cells.counts[axis]);
    let mut points: Vec<Option<usize>> = vec![None; counts[0] * counts[1]];
    let mut heights = vec![0; points.len()];
    for &(point, cell) in cells.covered.iter().filter(|(_, cell)| chosen(*cell)) {
        let column = cell[axes[1]] * counts[0] + cell[axes[0]];
        if points[column].is_none() || heights[column] < cell[hidden] {
            points[column] = Some(point);
            heights[column] = cell[hidden];
        }
    }
    let value = |point: &Option<usize>| point.map_or(f64::NAN, |point| values[point]);
    Raster {
        origin: axes.map(|axis| cells.origin[axis]),
        spacing: cells.spacing,
        cells: counts,
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
        let stair = [
            [0, 0, 0],
            [0, 0, 1],
            [1, 0, 0],
            [0, 1, 0],
            [0, 1, 1],
            [1, 1, 0],
        ];
        let cells = Cells {
            origin: [0.0; 3],
            spacing: 1.0,
            counts: [2, 2, 2],
            covered: stair.into_iter().enumerate().collect(),
        };
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let views = |dimension, cuts: &[(usize, f64)]| {
            let cuts: Vec<Cut> = cuts.iter().map(|&(axis, at)| Cut { axis, at }).collect();
            let caption = |cut: Cut, letter| format!("{letter}: {} = {}", AXES[cut.axis], cut.at);
            super::views(&cells, dimension, &values, &cuts, caption)
        };
        let all = views(3, &[(1, 0.2), (0, 1.5), (2, -0.5)]).expect("inside");
        assert_eq!(all[0].raster.values, [2.0, 3.0, 5.0, 6.0]);
        let along = &all[1].raster;
        assert_eq!(along.values[..3], [1.0, 3.0, 2.0]);
        assert!(along.values[3].is_nan());
        assert_eq!(all[1].caption, "A: y = 0");
        assert_eq!((all[2].axes, &*all[2].caption), ([1, 2], "B: x = 1"));
        assert_eq!(all[2].raster.values[..2], [3.0, 6.0]);
        assert!(all[2].raster.values[2].is_nan());
        assert_eq!(all[3].raster.values, [1.0, 3.0, 4.0, 6.0]);
        assert_eq!(views(2, &[(1, 0.2)]).expect("plane").len(), 1);
        let [first, last] = views(3, &[(0, 1.6)]).expect_err("outside").extent;
        assert!((first + 0.5).abs() < 1e-9 && (last - 1.5).abs() < 1e-9);
    }
}
