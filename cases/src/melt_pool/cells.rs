//! The pool on the cells of a grid: extents in directions that are not along an axis, its surface, and its volume.

use super::directions::dot;
use crate::cell_grid::CellGrid;

/// Values of the cells of a grid, NaN where there is no material.
pub(super) struct CellValues<'a> {
    pub grid: &'a CellGrid,
    pub values: &'a [f64],
}

impl CellValues<'_> {
    pub fn cell(&self, index: usize) -> [i64; 3] {
        let [nx, ny, _] = self.grid.cells;
        [index % nx, index / nx % ny, index / (nx * ny)].map(|c| c as i64)
    }

    /// Number of a cell inside the grid.
    pub fn index(&self, cell: [i64; 3]) -> Option<usize> {
        let cells = self.grid.cells;
        let is_inside = (0..3).all(|a| cell[a] >= 0 && cell[a] < cells[a] as i64);
        let [i, j, k] = cell.map(|c| c as usize);
        is_inside.then(|| (k * cells[1] + j) * cells[0] + i)
    }

    /// Value of a cell; `None` where there is no material.
    pub fn value(&self, cell: [i64; 3]) -> Option<f64> {
        let value = self.values[self.index(cell)?];
        (!value.is_nan()).then_some(value)
    }

    pub fn centre(&self, cell: [i64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|a| self.grid.origin[a] + cell[a] as f64 * self.grid.spacing)
    }

    /// Smallest and largest coordinate (m) along a unit vector of the region at or above a level that is connected with a
    /// cell, by linear interpolation on the lines between centres of cells, and at faces. Only the cells `within` count.
    pub fn extent(
        &self,
        from: usize,
        level: f64,
        direction: [f64; 3],
        within: impl Fn([i64; 3]) -> bool,
    ) -> Option<(f64, f64)> {
        if self.values[from].is_nan() || self.values[from] < level {
            return None;
        }
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut is_known = vec![false; self.values.len()];
        is_known[from] = true;
        let mut open = vec![from];
        while let Some(index) = open.pop() {
            let (cell, value) = (self.cell(index), self.values[index]);
            let at = dot(self.centre(cell), direction);
            for axis in (0..3).filter(|&a| self.grid.cells[a] > 1) {
                for side in [-1, 1] {
                    let mut beside = cell;
                    beside[axis] += side;
                    let part = match self.value(beside) {
                        Some(next) if next >= level => {
                            let next = self.index(beside).filter(|_| within(beside));
                            let next = next.filter(|&next| !is_known[next]);
                            if let Some(next) = next {
                                is_known[next] = true;
                                open.push(next);
                            }
                            continue;
                        }
                        Some(next) => (value - level) / (value - next),
                        None => 0.5,
                    };
                    let end = at + side as f64 * part * self.grid.spacing * direction[axis];
                    (low, high) = (low.min(end), high.max(end));
                }
            }
        }
        (low <= high).then_some((low, high))
    }

    /// The last cell that a ray from the centre of a cell along a unit vector meets before it leaves the material, and the
    /// distance to the place where it leaves, in cells.
    pub fn ray(&self, from: usize, direction: [f64; 3]) -> (usize, f64) {
        let mut cell = self.cell(from);
        let mut last = from;
        // distance to the next plane between cells along each axis, and between two such planes, in cells
        let step = direction.map(|d| if d > 0.0 { 1 } else { -1 });
        let between = direction.map(|d| match d.abs() {
            d if d > 1e-9 => 1.0 / d,
            _ => f64::INFINITY,
        });
        let mut next = between.map(|between| 0.5 * between);
        loop {
            let nearest = |a: usize, b: usize| if next[b] < next[a] { b } else { a };
            let axis = nearest(nearest(0, 1), 2);
            let away = next[axis];
            if !away.is_finite() {
                return (last, 0.0);
            }
            cell[axis] += step[axis];
            next[axis] += between[axis];
            match self.index(cell).filter(|&i| !self.values[i].is_nan()) {
                Some(index) => last = index,
                None => return (last, away),
            }
        }
    }

    /// The cells that have a face in common with a cell, along the axes that the grid has.
    pub fn neighbours(&self, cell: [i64; 3]) -> impl Iterator<Item = [i64; 3]> + use<> {
        let counts = self.grid.cells;
        let axes = (0..3).filter(move |&axis| counts[axis] > 1);
        axes.flat_map(move |axis| {
            [-1, 1].map(|side| {
                let mut beside = cell;
                beside[axis] += side;
                beside
            })
        })
    }

    /// Number of the cell around a place (m).
    pub fn index_at(&self, place: [f64; 3]) -> Option<usize> {
        let cell = |a: usize| ((place[a] - self.grid.origin[a]) / self.grid.spacing).round() as i64;
        self.index([0, 1, 2].map(cell))
    }

    /// Volume at or above a level, in cells.
    pub fn cells_above(&self, level: f64) -> f64 {
        self.fractions_above(level)
            .map(|(_, fraction)| fraction)
            .sum()
    }

    /// Cells with the fraction in which their value, linear with the differences to their neighbours, is above a level. At
    /// faces the value is mirrored, as for the extents.
    pub fn fractions_above(&self, level: f64) -> impl Iterator<Item = (usize, f64)> {
        let fraction = move |index: usize| {
            let (cell, value) = (self.cell(index), self.values[index]);
            let slope = [0, 1, 2].map(|axis| {
                let beside = |side: i64| {
                    let mut beside = cell;
                    beside[axis] += side;
                    self.value(beside).unwrap_or(value)
                };
                0.5 * (beside(1) - beside(-1))
            });
            (index, fraction_above(value - level, slope))
        };
        let there = (0..self.values.len()).filter(|&index| !self.values[index].is_nan());
        there.map(fraction)
    }
}

/// Smallest slope over the largest one: smaller slopes are replaced, because the quotients of polynomials divide by them.
const LEAST: f64 = 1e-3;

/// Area of the plane `normal . x = height` (unit normal) within the unit cube around the origin.
pub(super) fn area_within_cell(height: f64, normal: [f64; 3]) -> f64 {
    let steepest = normal.iter().fold(0.0, |m: f64, n| m.max(n.abs()));
    let m = normal.map(|n| n.abs().max(LEAST * steepest));
    let depth = 0.5 * m.iter().sum::<f64>() - height.abs();
    // derivative of the volume of `fraction_above` by the height
    let square = |x: f64| x.max(0.0).powi(2);
    let beyond: f64 = m.iter().map(|m| square(depth - m)).sum();
    let twice =
        square(depth - m[0] - m[1]) + square(depth - m[1] - m[2]) + square(depth - m[2] - m[0]);
    (square(depth) - beyond + twice) / (2.0 * m[0] * m[1] * m[2])
}

/// Fraction of the unit cube around the origin in which `height + slope . x >= 0`.
fn fraction_above(height: f64, slope: [f64; 3]) -> f64 {
    let steepest = slope.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
    if steepest == 0.0 {
        return if height >= 0.0 { 1.0 } else { 0.0 };
    }
    let m = slope.map(|s| s.abs().max(LEAST * steepest));
    let half = 0.5 * m.iter().sum::<f64>();
    if height.abs() >= half {
        return if height > 0.0 { 1.0 } else { 0.0 };
    }
    // the smaller part: the corner tetrahedron less the tetrahedra beyond the other faces
    let depth = half - height.abs();
    let cube = |x: f64| x.max(0.0).powi(3);
    let beyond: f64 = m.iter().map(|m| cube(depth - m)).sum();
    let twice = cube(depth - m[0] - m[1]) + cube(depth - m[1] - m[2]) + cube(depth - m[2] - m[0]);
    let smaller = (cube(depth) - beyond + twice) / (6.0 * m[0] * m[1] * m[2]);
    if height >= 0.0 {
        1.0 - smaller
    } else {
        smaller
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fraction_of_a_cube_above_a_plane_is_that_of_samples() {
        for (height, slope) in [
            (0.2, [1.0, 0.0, 0.0]),
            (-0.3, [0.4, -0.7, 0.2]),
            (0.1, [0.3, 0.3, -0.3]),
            (0.9, [1.0, 1.0, 1.0]),
            (-0.45, [0.0, 1.0, 0.05]),
        ] {
            let n = 60;
            let place = |i: usize| (i as f64 + 0.5) / f64::from(n) - 0.5;
            let mut above = 0;
            for i in 0..n as usize {
                for j in 0..n as usize {
                    for k in 0..n as usize {
                        let x = [place(i), place(j), place(k)];
                        above += usize::from(height + dot(slope, x) >= 0.0);
                    }
                }
            }
            let sampled = above as f64 / f64::from(n).powi(3);
            let found = fraction_above(height, slope);
            // a layer of samples along the plane
            assert!((found - sampled).abs() < 0.01, "{found} for {sampled}");
        }
    }

    #[test]
    fn the_area_of_a_plane_in_a_cube_is_that_of_its_polygon() {
        let half: f64 = 0.5_f64.sqrt();
        let third = (1.0_f64 / 3.0).sqrt();
        for (height, normal, area) in [
            (0.0, [1.0, 0.0, 0.0], 1.0),
            (-0.3, [0.0, -1.0, 0.0], 1.0),
            (0.6, [0.0, 0.0, 1.0], 0.0),
            // a rectangle through two edges, and one half way to the next edges
            (0.0, [half, half, 0.0], 2.0_f64.sqrt()),
            (0.5 * half, [half, -half, 0.0], half),
            // a regular hexagon with edges of sqrt(1/2), and a triangle with edges of sqrt(1/2)
            (0.0, [third; 3], 0.75 * 3.0_f64.sqrt()),
            (third, [third; 3], 0.125 * 3.0_f64.sqrt()),
        ] {
            let found = area_within_cell(height, normal);
            // the least slope takes a thousandth of an edge
            assert!((found - area).abs() < 2e-3, "{found} for {area}");
        }
    }
}
