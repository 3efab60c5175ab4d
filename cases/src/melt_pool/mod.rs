//! Size of the melt pool: extents of the region above an isotherm, and its volume.
//!
//! The length lies along the direction of travel of the heat source that made the pool, the depth along its beam, counted from
//! the surface of the material before the hottest point, and the width along the direction normal to both ([`Directions`]).
//!
//! The extent of the region `T >= isotherm` along an axis is that of the profile
//! `P(s) = max over the other axes of T`, which needs no contour. The maximum between lattice
//! points is that of the parabola through the hottest point and its two neighbours. Where the
//! hottest point is the last one before a face, the parabola is mirrored at the face (insulated
//! surface or plane of symmetry, zero gradient), which gives the surface value
//! `(9 T1 - T2) / 8` from the two outermost points (spec 02, `ref/goldak_pd.py`). The profile
//! crosses the isotherm by linear interpolation, with an error of `dx^2 T'' / (8 T')`.
//!
//! Along a direction that is not that of an axis, the extent is that of the points where the region around the hottest point
//! ends on the lines between the centres of cells, by linear interpolation (`cells`). Between these lines it may reach
//! `dx^2 / (8 R)` farther, R its radius of curvature.
//!
//! A pool that reaches a plane of symmetry of the body (coupler `symmetry`) goes on behind it: its width is that of both
//! halves, and its volume counts the mirror images. Where half of a body is simulated without that coupler, whose face is
//! insulated, nothing says so and half of the width is measured.
//!
//! Not for several pools at a time: the pool is the one around the hottest point, but a second pool
//! is included where the two overlap in a profile.

use perimelt_core::activity::is_active;
use perimelt_core::{Body, Face, SetupError, World};

use crate::cell_grid::CellGrid;
use cells::CellValues;
pub(crate) use directions::LoggedSources;
pub use directions::{Aim, Directions, SourceState, sources_of};
pub(crate) use steady::steady;
pub(crate) use zone::Zone;

mod cells;
mod directions;
mod steady;
mod zone;

/// Cosine of the angle between a direction and the axis along which it counts.
const ALONG_AXIS: f64 = 1.0 - 1e-9;

/// Direction in which the heat source travels, where there is no source that moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Travel {
    /// along x
    #[default]
    X,
    /// along y
    Y,
}

/// The region above an isotherm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeltPool {
    /// direction of travel, a unit vector
    pub travel: [f64; 3],
    /// smallest coordinate along the direction of travel, m
    pub rear: f64,
    /// largest coordinate along the direction of travel, m
    pub front: f64,
    /// extent across travel and beam, m, with its mirror image behind a plane of symmetry; `None` if the body does
    /// not have that direction
    pub width: Option<f64>,
    /// smallest and largest coordinate across travel and beam within the body, m; `None` as for the width
    pub sides: Option<[f64; 2]>,
    /// extent along the beam from the surface of the material before the hottest point, m; `None` if the body does not have
    /// that direction
    pub depth: Option<f64>,
    /// volume, m³, with its mirror images: fractions of the cells above the isotherm, of all pools of the body
    pub volume: f64,
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
    isotherm: f64,
    /// extent along the axes that the body does not have, m, or m² for two
    thickness: f64,
    symmetry: Vec<Face>,
}

impl MeltPoolGauge {
    /// A gauge for a body in its reference configuration and an isotherm (K); `None` if the points
    /// are scattered too widely for a grid.
    #[must_use]
    pub fn of_body(world: &World, body: usize, isotherm: f64) -> Option<Self> {
        let symmetry = world.symmetry(body);
        let body = world.body(body);
        let positions: Vec<[f64; 3]> = body.points.position.iter().map(|&p| p.into()).collect();
        let grid = match body.lattice() {
            Some(lattice) => CellGrid::new(&positions, lattice.spacing),
            None => CellGrid::of_spacings(&positions, &body.points.spacing),
        };
        let gauge = Self::on(grid?, (body.dimension, body.thickness), isotherm);
        Some(gauge.with_symmetry(symmetry))
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

    /// A gauge for points on a grid, of a body of this dimension and thickness (m; m² in 1D).
    pub(crate) fn on(grid: CellGrid, (dimension, thickness): (usize, f64), isotherm: f64) -> Self {
        Self {
            grid,
            dimension,
            isotherm,
            thickness,
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
    pub fn measure(&self, temperature: &[f64], aim: Aim<'_>) -> Option<MeltPool> {
        self.measure_present((temperature, None), aim)
    }

    /// As [`MeltPoolGauge::measure`], of a body whose points have material where `activity` says so.
    #[must_use]
    pub fn measure_present(
        &self,
        (temperature, activity): (&[f64], Option<&[f64]>),
        aim: Aim<'_>,
    ) -> Option<MeltPool> {
        let grid = &self.grid;
        let is_there = |point: usize| activity.is_none_or(|a| is_active(a[point]));
        let there = || {
            let points = temperature.iter().enumerate();
            points.filter(|(p, _)| is_there(*p)).map(|(_, t)| *t)
        };
        if there().any(f64::is_nan) {
            let Directions { beam, .. } = aim.otherwise;
            let unknown = |direction| self.has(direction).then_some(f64::NAN);
            return Some(MeltPool {
                travel: aim.otherwise.travel,
                rear: f64::NAN,
                front: f64::NAN,
                width: unknown(aim.otherwise.across()),
                sides: unknown(aim.otherwise.across()).map(|x| [x; 2]),
                depth: unknown(beam),
                volume: f64::NAN,
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
        let cells = CellValues {
            grid,
            values: &values,
        };
        let present = (0..values.len()).filter(|&cell| !values[cell].is_nan());
        let hottest = present.max_by(|&a, &b| values[a].total_cmp(&values[b]))?;
        let directions = aim.at(cells.centre(cells.cell(hottest)));
        let along = |direction: [f64; 3]| {
            let Some(axis) = axis_of(direction) else {
                return cells.extent(hottest, self.isotherm, direction, |_| true);
            };
            let (from, to) = self.in_cells(&values, axis)?;
            let coordinate = |cells: f64| grid.origin[axis] + cells * grid.spacing;
            Some(match direction[axis] > 0.0 {
                true => (coordinate(from), coordinate(to)),
                false => (-coordinate(to), -coordinate(from)),
            })
        };
        let halves = self.halves(&values);
        let (rear, front) = along(directions.travel)?;
        let across = Some(directions.across()).filter(|d| self.has(*d));
        let sides = across.and_then(along).map(|(from, to)| [from, to]);
        let mirrored = across.and_then(axis_of).map_or(1.0, |axis| halves[axis]);
        let down = Some(directions.beam).filter(|d| self.has(*d));
        // in a fillet, the body goes on beside the pool, before it along the beam
        let depth = down.and_then(|direction| {
            let (_, deepest) = along(direction)?;
            Some(deepest - cells.surface(hottest, direction))
        });
        let cell = match self.dimension {
            3 => grid.spacing.powi(3),
            dimension => self.thickness * grid.spacing.powi(dimension as i32),
        };
        let copies: f64 = halves.iter().product();
        Some(MeltPool {
            travel: directions.travel,
            rear,
            front,
            width: sides.map(|[from, to]| mirrored * (to - from)),
            sides,
            depth,
            volume: copies * cell * cells.cells_above(self.isotherm),
            peak: there().fold(f64::NEG_INFINITY, f64::max),
            copies,
        })
    }

    /// Where the region above the isotherm lies along an axis, in cells from the first centre.
    fn in_cells(&self, values: &[f64], axis: usize) -> Option<(f64, f64)> {
        let profile = profile(values, self.grid.cells, axis, self.dimension);
        extent(&profile, self.isotherm)
    }

    /// Where a face of the body lies along its axis, in cells from the first centre.
    fn face_in_cells(&self, face: Face) -> f64 {
        match face.is_upper() {
            true => self.grid.cells[face.axis()] as f64 - 0.5,
            false => -0.5,
        }
    }

    /// By axis: 2 where a plane of symmetry normal to it cuts the region above the isotherm, 1 otherwise.
    fn halves(&self, values: &[f64]) -> [f64; 3] {
        let is_cut = |face: Face| {
            let axis = face.axis();
            let ends = (axis < self.dimension).then(|| self.in_cells(values, axis));
            ends.flatten().is_some_and(|(from, to)| {
                let end = if face.is_upper() { to } else { from };
                end == self.face_in_cells(face)
            })
        };
        let mut halves = [1.0; 3];
        for &face in self.symmetry.iter().filter(|face| is_cut(**face)) {
            halves[face.axis()] = 2.0;
        }
        halves
    }

    /// Whether the body has a direction.
    fn has(&self, direction: [f64; 3]) -> bool {
        let length = direction.iter().map(|x| x * x).sum::<f64>();
        let missing = self.dimension.min(3)..3;
        length > 0.5 && missing.into_iter().all(|axis| direction[axis].abs() < 1e-6)
    }
}

/// The axis along which a unit vector lies.
fn axis_of(direction: [f64; 3]) -> Option<usize> {
    (0..3).find(|&axis| direction[axis].abs() > ALONG_AXIS)
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
    use std::f64::consts::PI;

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

    fn gauge(positions: &[[f64; 3]], dimension: usize) -> MeltPoolGauge {
        let grid = CellGrid::new(positions, SPACING).expect("a lattice");
        MeltPoolGauge::on(grid, (dimension, 1.0), 1500.0)
    }

    fn measured(
        positions: &[[f64; 3]],
        dimension: usize,
        travel: Travel,
        temperature: &[f64],
    ) -> Option<MeltPool> {
        gauge(positions, dimension).measure(temperature, Aim::fixed(travel))
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
        let gauge = gauge(&positions, 3).with_symmetry(&symmetry);
        let whole = gauge
            .measure(&temperature, Aim::fixed(Travel::X))
            .expect("a pool");
        close(0.5 * whole.width.expect("3D"), half[1]);
        // the pool does not reach the other plane of symmetry
        assert_eq!(whole.copies, 2.0);
        assert_eq!((whole.rear, whole.depth), (pool.rear, pool.depth));
        // a quarter of the ellipsoid; cells with linear values, five in the smallest half axis
        let quarter = PI / 3.0 * half.iter().product::<f64>();
        assert!(
            (pool.volume / quarter - 1.0).abs() < 0.01,
            "{}",
            pool.volume / quarter
        );
        assert_eq!(whole.volume, 2.0 * pool.volume);
    }

    /// A whole block under a beam of any direction; the pool is turned with the source.
    #[test]
    fn extents_lie_along_travel_and_beam_and_not_along_the_axes() {
        let positions = lattice([-30.0, -30.0, -30.0], [60, 60, 60]);
        let half = [17.2e-4, 8.1e-4, 11.4e-4];
        let (cos, sin) = (30_f64.to_radians().cos(), 30_f64.to_radians().sin());
        for (travel, beam, across) in [
            ([cos, sin, 0.0], [0.0, 0.0, -1.0], [-sin, cos, 0.0]),
            ([0.0, 1.0, 0.0], [sin, 0.0, -cos], [cos, 0.0, sin]),
            ([-1.0, 0.0, 0.0], [0.0, -sin, -cos], [0.0, cos, -sin]),
        ] {
            let temperature = |p: &[f64; 3]| {
                let along = |d: [f64; 3]| (0..3).map(|a| p[a] * d[a]).sum::<f64>();
                let parts = [
                    along(travel) / half[0],
                    along(across) / half[1],
                    along(beam) / half[2],
                ];
                2000.0 - 500.0 * parts.iter().map(|x| x * x).sum::<f64>()
            };
            let temperature: Vec<f64> = positions.iter().map(temperature).collect();
            let source = SourceState {
                position: [0.0; 3],
                travel: Some(travel),
                beam,
                power: 1.0,
                path: 0.0,
            };
            let aim = Aim {
                sources: &[source],
                ..Aim::fixed(Travel::X)
            };
            let pool = gauge(&positions, 3)
                .measure(&temperature, aim)
                .expect("a pool");
            // dx^2 / (8 R) on either side, R >= b^2 / a
            let tolerance =
                2.0 * SPACING.powi(2) * half[0] / (8.0 * half[1].powi(2)) + SPACING / 20.0;
            assert!(
                (pool.length() - 2.0 * half[0]).abs() < tolerance,
                "{pool:?}"
            );
            assert!(
                (pool.width.expect("3D") - 2.0 * half[1]).abs() < tolerance,
                "{pool:?}"
            );
            // from the face z = 30 above the hottest point, along the beam
            let surface = 30.0 * SPACING / -beam[2];
            let depth = pool.depth.expect("3D") - surface;
            assert!((depth - half[2]).abs() < tolerance + SPACING, "{pool:?}");
        }
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
