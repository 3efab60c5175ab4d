//! Size of the melt pool: extents of the region above an isotherm along each axis.
//!
//! The extent of the region `T >= isotherm` along an axis is that of the profile
//! `P(s) = max over the other axes of T`, which needs no contour. The maximum between lattice
//! points is that of the parabola through the hottest point and its two neighbours. Where the
//! hottest point is the last one before a face, the parabola is mirrored at the face (insulated
//! surface or plane of symmetry, zero gradient), which gives the surface value
//! `(9 T1 - T2) / 8` from the two outermost points (spec 02, `ref/goldak_pd.py`). The profile
//! crosses the isotherm by linear interpolation, with an error of `dx^2 T'' / (8 T')`.
//!
//! A pool that reaches a plane of symmetry of the body (coupler `symmetry`) goes on behind it: its width is that of both
//! halves, and its volume counts the mirror images. Where half of a body is simulated without that coupler, whose face is
//! insulated, nothing says so and half of the width is measured.
//!
//! Not for several pools at a time: the pool is the one around the hottest point, but a second pool
//! is included where the two overlap in a profile.

use perimelt_core::activity::is_active;
use perimelt_core::{Axis, Body, Face, SetupError, World};

use crate::cell_grid::CellGrid;

/// Direction in which the heat source travels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Travel {
    /// along x
    #[default]
    X,
    /// along y
    Y,
}

/// Axes of the extents of a melt pool; the width lies along the third axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoolAxes {
    /// axis of the length
    pub along: Axis,
    /// axis of the depth, which counts from the surface of the material above the hottest point; not `along`
    pub down: Axis,
}

impl PoolAxes {
    /// Axis of the width, counted from 0.
    fn across(self) -> usize {
        3 - self.along.index() - self.down.index()
    }
}

impl From<Travel> for PoolAxes {
    fn from(travel: Travel) -> Self {
        let along = match travel {
            Travel::X => Axis::X,
            Travel::Y => Axis::Y,
        };
        let down = Axis::Z;
        Self { along, down }
    }
}

/// The region above an isotherm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeltPool {
    /// smallest coordinate along the axis of the length, m
    pub rear: f64,
    /// largest coordinate along the axis of the length, m
    pub front: f64,
    /// extent along the axis of the width, m, with its mirror image behind a plane of symmetry; `None` if the body does
    /// not have that axis
    pub width: Option<f64>,
    /// extent below the surface of the material above the hottest point, m; `None` if the body does not have that axis
    pub depth: Option<f64>,
    /// highest temperature, K
    pub peak: f64,
    /// number of equal parts of the pool, which planes of symmetry cut: 1 without
    pub copies: f64,
}

impl MeltPool {
    /// `front - rear`, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.front - self.rear
    }
}

/// Measures the melt pool of one body, see the [module](self): the only such measurement, used by
/// probes, plots and checks.
#[derive(Clone, Debug)]
pub struct MeltPoolGauge {
    grid: CellGrid,
    dimension: usize,
    axes: PoolAxes,
    isotherm: f64,
    symmetry: Vec<Face>,
}

impl MeltPoolGauge {
    /// A gauge for a body in its reference configuration and an isotherm (K); `None` if the points
    /// are scattered too widely for a grid.
    #[must_use]
    pub fn of_body(world: &World, body: usize, axes: PoolAxes, isotherm: f64) -> Option<Self> {
        let symmetry = world.symmetry(body);
        let body = world.body(body);
        let positions: Vec<[f64; 3]> = body.points.position.iter().map(|&p| p.into()).collect();
        let grid = match body.lattice() {
            Some(lattice) => CellGrid::new(&positions, lattice.spacing),
            None => CellGrid::of_spacings(&positions, &body.points.spacing),
        };
        Some(Self::on(grid?, body.dimension, axes, isotherm).with_symmetry(symmetry))
    }

    /// The mistake of a body that [`of_body`](Self::of_body) refuses, at `key`.
    pub(crate) fn scattered(body: &Body, key: &str) -> SetupError {
        let message = format!(
            "the points of body `{}` are too far apart for cells of one spacing",
            body.name
        );
        let expected = "a body whose points lie about one spacing apart";
        SetupError::value(key, message, expected)
    }

    /// A gauge for points on a grid, of a body of this dimension.
    pub(crate) fn on(grid: CellGrid, dimension: usize, axes: PoolAxes, isotherm: f64) -> Self {
        Self {
            grid,
            dimension,
            axes,
            isotherm,
            symmetry: Vec::new(),
        }
    }

    /// The same gauge for a body with these planes of symmetry.
    pub(crate) fn with_symmetry(mut self, faces: &[Face]) -> Self {
        self.symmetry = faces.to_vec();
        self
    }

    /// The melt pool at these temperatures (K), one per point. A pool that reaches a face of the
    /// body ends there. `None` if no point reaches the isotherm; all extents are NaN if a temperature
    /// is NaN.
    #[must_use]
    pub fn measure(&self, temperature: &[f64]) -> Option<MeltPool> {
        self.measure_present(temperature, None)
    }

    /// As [`MeltPoolGauge::measure`], of a body whose points have material where `activity` says so.
    #[must_use]
    pub fn measure_present(
        &self,
        temperature: &[f64],
        activity: Option<&[f64]>,
    ) -> Option<MeltPool> {
        let grid = &self.grid;
        let has_axis = |axis: usize| axis < self.dimension;
        let is_there = |point: usize| activity.is_none_or(|a| is_active(a[point]));
        let there = || {
            let points = temperature.iter().enumerate();
            points.filter(|(p, _)| is_there(*p)).map(|(_, t)| *t)
        };
        if there().any(f64::is_nan) {
            return Some(MeltPool {
                rear: f64::NAN,
                front: f64::NAN,
                width: has_axis(self.axes.across()).then_some(f64::NAN),
                depth: has_axis(self.axes.down.index()).then_some(f64::NAN),
                peak: f64::NAN,
                copies: 1.0,
            });
        }
        let values = match activity {
            None => grid.by_cell(temperature),
            Some(_) => {
                let points = temperature.iter().enumerate();
                let absent = |(p, t): (usize, &f64)| if is_there(p) { *t } else { f64::NAN };
                grid.by_cell(&points.map(absent).collect::<Vec<_>>())
            }
        };
        let in_cells = |axis: usize| {
            let profile = profile(&values, grid.cells, axis, self.dimension);
            extent(&profile, self.isotherm)
        };
        let in_space = |axis: usize| {
            let (from, to) = in_cells(axis)?;
            let coordinate = |cells: f64| grid.origin[axis] + cells * grid.spacing;
            Some((coordinate(from), coordinate(to)))
        };
        let is_cut = |face: Face| {
            let axis = face.axis();
            let ends = has_axis(axis).then(|| in_cells(axis)).flatten();
            ends.is_some_and(|(from, to)| match face.is_upper() {
                true => to == grid.cells[axis] as f64 - 0.5,
                false => from == -0.5,
            })
        };
        let mut halves = [1.0; 3];
        for &face in self.symmetry.iter().filter(|face| is_cut(**face)) {
            halves[face.axis()] = 2.0;
        }

        let (rear, front) = in_space(self.axes.along.index())?;
        let across = Some(self.axes.across()).filter(|&axis| has_axis(axis));
        let width = across.and_then(|axis| {
            let (from, to) = in_space(axis)?;
            Some(halves[axis] * (to - from))
        });
        let down = Some(self.axes.down.index()).filter(|&axis| has_axis(axis));
        let depth = down.and_then(|axis| {
            // in a fillet, the body goes on above the pool beside it
            let present = (0..values.len()).filter(|&cell| !values[cell].is_nan());
            let hottest = present.max_by(|&a, &b| values[a].total_cmp(&values[b]))?;
            let stride: usize = grid.cells[..axis].iter().product();
            let from = hottest / stride % grid.cells[axis];
            let is_material = |up: &usize| !values[hottest + up * stride].is_nan();
            let above = (1..grid.cells[axis] - from).take_while(is_material);
            let top = grid.centre(axis, from + above.count()) + 0.5 * grid.spacing;
            in_space(axis).map(|(bottom, _)| top - bottom)
        });
        Some(MeltPool {
            rear,
            front,
            width,
            depth,
            peak: there().fold(f64::NEG_INFINITY, f64::max),
            copies: halves.iter().product(),
        })
    }
}

/// `max over the other axes` of the cells' values at each cell of `axis`.
fn profile(values: &[f64], cells: [usize; 3], axis: usize, dimension: usize) -> Vec<f64> {
    let mut values = values.to_vec();
    let mut cells = cells;
    for other in (0..dimension.min(3)).filter(|&other| other != axis) {
        values = project(&values, cells, other);
        cells[other] = 1;
    }
    // axes beyond the dimension have one cell
    values.truncate(cells[axis]);
    values
}

/// Maximum along one axis: the cells along it become one.
fn project(values: &[f64], cells: [usize; 3], axis: usize) -> Vec<f64> {
    let stride: usize = cells[..axis].iter().product();
    let count = cells[axis];
    let mut projected = Vec::with_capacity(values.len() / count);
    for block in values.chunks_exact(stride * count) {
        for first in 0..stride {
            projected.push(line_maximum(count, |index| block[index * stride + first]));
        }
    }
    projected
}

/// Maximum of a line of values by the parabola around the largest; NaN if there is none.
fn line_maximum(count: usize, value: impl Fn(usize) -> f64) -> f64 {
    let mut hottest: Option<usize> = None;
    for index in 0..count {
        if !value(index).is_nan() && hottest.is_none_or(|best| value(index) > value(best)) {
            hottest = Some(index);
        }
    }
    let Some(hottest) = hottest else {
        return f64::NAN;
    };
    let middle = value(hottest);
    let neighbour = |index: Option<usize>| {
        index
            .filter(|&index| index < count)
            .map_or(f64::NAN, &value)
    };
    // the mirror image beyond a face
    let mirrored = |value: f64| if value.is_nan() { middle } else { value };
    let before = mirrored(neighbour(hottest.checked_sub(1)));
    let after = mirrored(neighbour(Some(hottest + 1)));
    let curvature = before - 2.0 * middle + after;
    if curvature < 0.0 {
        middle - (after - before).powi(2) / (8.0 * curvature)
    } else {
        middle
    }
}

/// Where the interval around the maximum of a profile lies above a level, in cells from the first
/// centre; it ends half a cell beyond the last centre at most.
fn extent(profile: &[f64], level: f64) -> Option<(f64, f64)> {
    let above = |index: &usize| profile[*index] >= level;
    let hottest = (0..profile.len())
        .filter(above)
        .max_by(|&a, &b| profile[a].total_cmp(&profile[b]))?;
    let last = (hottest..profile.len())
        .take_while(above)
        .last()
        .unwrap_or(hottest);
    let first = (0..=hottest)
        .rev()
        .take_while(above)
        .last()
        .unwrap_or(hottest);
    let crossing = |inside: usize, outside: Option<f64>| match outside {
        Some(outside) if !outside.is_nan() => {
            (profile[inside] - level) / (profile[inside] - outside)
        }
        _ => 0.5,
    };
    let before = first.checked_sub(1).map(|index| profile[index]);
    let from = first as f64 - crossing(first, before);
    let to = last as f64 + crossing(last, profile.get(last + 1).copied());
    Some((from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACING: f64 = 1e-4;

    /// Cell centres of a box whose corner is at `from`, in cells.
    fn lattice(from: [f64; 3], cells: [usize; 3]) -> Vec<[f64; 3]> {
        let mut positions = Vec::new();
        for k in 0..cells[2] {
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    let cell = [i, j, k];
                    positions.push([0, 1, 2].map(|a| (from[a] + cell[a] as f64 + 0.5) * SPACING));
                }
            }
        }
        positions
    }

    /// `T = 2000 - 500 r^2`, r = 1 on the ellipsoid with these half axes (m).
    fn ellipsoid(positions: &[[f64; 3]], centre: [f64; 3], half_axes: [f64; 3]) -> Vec<f64> {
        let term = |p: &[f64; 3], a: usize| ((p[a] - centre[a]) / half_axes[a]).powi(2);
        let temperature = |p| 2000.0 - 500.0 * (term(p, 0) + term(p, 1) + term(p, 2));
        positions.iter().map(temperature).collect()
    }

    fn gauge(positions: &[[f64; 3]], dimension: usize, travel: Travel) -> MeltPoolGauge {
        let grid = CellGrid::new(positions, SPACING).expect("a lattice");
        MeltPoolGauge::on(grid, dimension, travel.into(), 1500.0)
    }

    fn measured(
        positions: &[[f64; 3]],
        dimension: usize,
        travel: Travel,
        temperature: &[f64],
    ) -> Option<MeltPool> {
        gauge(positions, dimension, travel).measure(temperature)
    }

    fn close(found: f64, expected: f64) {
        // linear interpolation on a parabola: dx^2 T'' / (8 T') = dx^2 / (8 a), a >= 5 dx here
        let tolerance = SPACING / 40.0 * 1.01;
        assert!(
            (found - expected).abs() < tolerance,
            "{found} instead of {expected}"
        );
    }

    /// Half a block, cut at the plane of symmetry y = 0, its surface at z = 0.
    #[test]
    fn isotherm_of_a_half_ellipsoid_is_found_within_a_fortieth_of_the_spacing() {
        let positions = lattice([-30.0, 0.0, -10.0], [60, 12, 10]);
        let (centre, half) = (3.3e-4, [17.2e-4, 8.1e-4, 5.4e-4]);
        let temperature = ellipsoid(&positions, [centre, 0.0, 0.0], half);
        let pool = measured(&positions, 3, Travel::X, &temperature);
        let pool = pool.expect("a pool");
        close(pool.front, centre + half[0]);
        close(pool.rear, centre - half[0]);
        close(pool.width.expect("3D"), half[1]);
        close(pool.depth.expect("3D"), half[2]);
        close(pool.length() / 2.0, half[0]);
        assert_eq!(pool.copies, 1.0);

        let symmetry = [Face::YMin, Face::XMin];
        let gauge = gauge(&positions, 3, Travel::X).with_symmetry(&symmetry);
        let whole = gauge.measure(&temperature).expect("a pool");
        close(0.5 * whole.width.expect("3D"), half[1]);
        // the pool does not reach the other plane of symmetry
        assert_eq!(whole.copies, 2.0);
        assert_eq!((whole.rear, whole.depth), (pool.rear, pool.depth));
    }

    /// The centre line lies between the points, as it does in every block of even width.
    #[test]
    fn pool_between_lattice_lines_along_y_has_its_whole_width() {
        let positions = lattice([-10.3, -20.0, -8.0], [21, 40, 8]);
        let half = [7.2e-4, 13.7e-4, 5.1e-4];
        let temperature = ellipsoid(&positions, [0.0; 3], half);
        let pool = measured(&positions, 3, Travel::Y, &temperature);
        let pool = pool.expect("a pool");
        close(pool.front, half[1]);
        close(pool.rear, -half[1]);
        close(pool.width.expect("3D") / 2.0, half[0]);
        close(pool.depth.expect("3D"), half[2]);
    }

    #[test]
    fn plane_body_has_no_depth_and_a_bar_no_width() {
        let positions = lattice([-20.0, -10.0, -0.5], [40, 20, 1]);
        let temperature = ellipsoid(&positions, [0.0; 3], [12e-4, 6.3e-4, 1.0]);
        let pool = measured(&positions, 2, Travel::X, &temperature);
        let pool = pool.expect("a pool");
        close(pool.width.expect("2D") / 2.0, 6.3e-4);
        assert_eq!(pool.depth, None);

        let positions = lattice([-20.0, -0.5, -0.5], [40, 1, 1]);
        let temperature = ellipsoid(&positions, [0.0; 3], [12e-4, 1.0, 1.0]);
        let pool = measured(&positions, 1, Travel::X, &temperature);
        let pool = pool.expect("a pool");
        close(pool.front, 12e-4);
        assert_eq!((pool.width, pool.depth), (None, None));
    }

    #[test]
    fn pool_ends_at_the_faces_of_the_body() {
        let positions = lattice([0.0, 0.0, -4.0], [10, 6, 4]);
        let temperature = vec![1800.0; positions.len()];
        let pool = measured(&positions, 3, Travel::X, &temperature);
        let pool = pool.expect("a pool");
        // rounding only
        assert!((pool.length() - 10.0 * SPACING).abs() < 1e-15);
        assert!((pool.width.expect("3D") - 6.0 * SPACING).abs() < 1e-15);
        assert!((pool.depth.expect("3D") - 4.0 * SPACING).abs() < 1e-15);
        assert_eq!(pool.peak, 1800.0);
    }

    #[test]
    fn depth_counts_from_the_surface_above_the_pool() {
        // a base of four layers, and a web on one of its sides
        let mut positions = lattice([0.0, 0.0, -4.0], [10, 12, 4]);
        positions.extend(lattice([0.0, 0.0, 0.0], [10, 3, 8]));
        let hot = |p: &[f64; 3]| p[1] > 6.0 * SPACING && p[2] > -2.0 * SPACING;
        let temperature: Vec<f64> = positions
            .iter()
            .map(|p| if hot(p) { 1800.0 } else { 1200.0 })
            .collect();
        let pool = measured(&positions, 3, Travel::X, &temperature).expect("a pool");
        // the parabola around the largest temperature overshoots at a step
        assert!((pool.depth.expect("3D") - 2.0 * SPACING).abs() < 0.2 * SPACING);
    }

    #[test]
    fn temperature_that_is_not_a_number_shows_in_every_extent() {
        let positions = lattice([0.0; 3], [4, 4, 4]);
        let mut temperature = vec![1800.0; positions.len()];
        temperature[7] = f64::NAN;
        let pool = measured(&positions, 3, Travel::X, &temperature).expect("not cold");
        assert!(pool.length().is_nan() && pool.depth.is_some_and(f64::is_nan));
    }

    #[test]
    fn cold_body_has_no_pool() {
        let positions = lattice([0.0; 3], [4, 4, 4]);
        let cold = vec![300.0; positions.len()];
        assert_eq!(measured(&positions, 3, Travel::X, &cold), None);
    }
}
