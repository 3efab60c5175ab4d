//! Size of the melt pool: extents of the region above an isotherm, and its volume.
//!
//! The length lies along the direction of travel of the heat source that made the pool, the depth along its beam, counted from
//! the molten surface of the material (`depth`), and the width along the direction normal to both ([`Directions`]).
//!
//! The extent of the region `T >= isotherm` along an axis is that of the profile
//! `P(s) = max over the other axes of T`, which needs no contour. The maximum between lattice
//! points is that of the parabola through the hottest point and its two neighbours. Where the
//! hottest point is the last one before a face, the parabola is mirrored at the face (insulated
//! surface or plane of symmetry, zero gradient), which gives the surface value
//! `(9 T1 - T2) / 8` from the two outermost points (`cases/references/goldak_fv.py`). The profile
//! crosses the isotherm by linear interpolation, with an error of `dx^2 T'' / (8 T')`.
//!
//! Along a direction that is not that of an axis, the extent is that of the points where the region around the hottest point
//! ends on the lines between the centres of cells, by linear interpolation (`cells`). Between these lines it may reach
//! `dx^2 / (8 R)` farther, R its radius of curvature.
//!
//! A pool that reaches a plane of symmetry of the body (coupler `symmetry`) continues behind it: its width and length are those of both
//! halves, and its volume counts the mirror images. Where half of a body is simulated without that coupler, whose face is
//! insulated, the symmetry is unknown and half of the width is measured.
//!
//! Where there are several pools, it is the one around the hottest point; the volume is that of all.

use std::cell::Ref;

use perimelt_core::log::{CloudField, LoggedCloud};
use perimelt_core::world::activity::is_active;
use perimelt_core::{Body, Face, SetupError, World, keys};

use crate::cell_grid::CellGrid;
use cells::CellValues;
use depth::Region;
pub(crate) use directions::LoggedSources;
pub use directions::{Aim, Directions, SourceState, sources_of};
pub(crate) use steady::steady;
pub(crate) use zone::{Root, Zone};

mod cells;
mod depth;
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
    /// smallest coordinate along the direction of travel, m; with its mirror image, as for the width
    pub rear: f64,
    /// largest coordinate along the direction of travel, m
    pub front: f64,
    /// extent across travel and beam, m, with its mirror image behind a plane of symmetry; `None` if the body does
    /// not have that direction
    pub width: Option<f64>,
    /// smallest and largest coordinate across travel and beam within the body, m; `None` as for the width
    pub sides: Option<[f64; 2]>,
    /// largest extent along the beam from the molten surface of the material, m; `None` if the body does not have that
    /// direction
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

/// By point, whether there is metal that may melt ([`is_active`]): material that has been deposited, or the first of two fluids. `None` where
/// there is everywhere.
pub(crate) fn metal(world: &World, body: usize) -> Option<Ref<'_, [f64]>> {
    let fraction = || {
        let fields = world.fields();
        let index = fields.find(body, &keys::FLUID_FRACTION.name)?;
        Some(Ref::map(fields.field(index).data(), |data| data.flat()))
    };
    world.activity(body).or_else(fraction)
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
        let symmetry = &world.symmetry(body);
        let body = world.body(body);
        let positions: Vec<[f64; 3]> = body.points.position.iter().map(|&p| p.into()).collect();
        let grid = match body.lattice() {
            Some(lattice) => CellGrid::new(&positions, lattice.spacing),
            None => CellGrid::of_spacings(&positions, &body.points.spacing),
        };
        let gauge = Self::on(grid?, body.dimension, body.thickness, isotherm);
        Some(gauge.with_symmetry(symmetry))
    }

    /// The mistake of a body that [`of_body`](Self::of_body) refuses, at `key`.
    pub(crate) fn scattered(body: &Body, key: &str) -> SetupError {
        let message = format!(
            "the points of body `{}` are too far apart for cells of one spacing",
            body.name
        );
        let expected = "a body with points about one spacing apart";
        SetupError::value(key, message, expected)
    }

    /// A gauge for points on a grid, of a body of this dimension and thickness (m; m² in 1D).
    pub(crate) fn on(grid: CellGrid, dimension: usize, thickness: f64, isotherm: f64) -> Self {
        Self {
            grid,
            dimension,
            isotherm,
            thickness,
            symmetry: Vec::new(),
        }
    }

    /// Sets the planes of symmetry of the body.
    pub(crate) fn with_symmetry(mut self, faces: &[Face]) -> Self {
        self.symmetry = faces.to_vec();
        self
    }

    /// The melt pool at these temperatures (K), one per point. A pool that reaches a face of the
    /// body ends there. `None` if no point reaches the isotherm; all extents are NaN if a temperature
    /// is NaN.
    #[must_use]
    pub fn measure(&self, temperature: &[f64], aim: Aim<'_>) -> Option<MeltPool> {
        self.measure_present(temperature, None, aim)
    }

    /// [`MeltPoolGauge::measure`] for a logged state, without the second of two fluids where the log has their fractions.
    pub(crate) fn measure_logged(
        &self,
        cloud: &LoggedCloud,
        temperature: &[f64],
        aim: Aim<'_>,
    ) -> Option<MeltPool> {
        let fraction = |field: &&CloudField| field.name == keys::FLUID_FRACTION.name;
        let fraction = cloud.fields.iter().find(fraction);
        self.measure_present(temperature, fraction.map(|field| &field.values[..]), aim)
    }

    /// [`MeltPoolGauge::measure`] for a body whose points have metal where `metal` says so: that is deposited, or the first of two fluids.
    #[must_use]
    pub fn measure_present(
        &self,
        temperature: &[f64],
        metal: Option<&[f64]>,
        aim: Aim<'_>,
    ) -> Option<MeltPool> {
        let grid = &self.grid;
        let is_there = |point: usize| metal.is_none_or(|a| is_active(a[point]));
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
        let values = match metal {
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
        let region = Region::around(&cells, hottest, self.isotherm, |_| true);
        let alone = region.alone();
        let along = |direction: [f64; 3]| {
            let Some(axis) = axis_of(direction) else {
                return cells.extent(hottest, self.isotherm, direction, |_| true);
            };
            let (from, to) = self.in_cells(&alone, axis)?;
            let coordinate = |cells: f64| grid.origin[axis] + cells * grid.spacing;
            Some(match direction[axis] > 0.0 {
                true => (coordinate(from), coordinate(to)),
                false => (-coordinate(to), -coordinate(from)),
            })
        };
        let halves = self.halves(&alone);
        let ends = along(directions.travel)?;
        let (rear, front) = self.with_images(ends, directions.travel, (&halves, &alone));
        let across = Some(directions.across()).filter(|d| self.has(*d));
        let sides = across.and_then(along).map(|(from, to)| [from, to]);
        let mirrored = across.and_then(axis_of).map_or(1.0, |axis| halves[axis]);
        let down = Some(directions.beam).filter(|d| self.has(*d));
        let penetration = down.and_then(|beam| region.penetration(hottest, beam));
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
            depth: penetration.map(|p| p.depth),
            volume: copies * cell * cells.cells_above(self.isotherm),
            peak: there().fold(f64::NEG_INFINITY, f64::max),
            copies,
        })
    }

    /// Ends of the region above the isotherm along an axis, in cells from the first centre.
    fn in_cells(&self, values: &[f64], axis: usize) -> Option<(f64, f64)> {
        let profile = profile(values, self.grid.cells, axis, self.dimension);
        extent(&profile, self.isotherm)
    }

    /// Coordinate of a face of the body along its axis, in cells from the first centre.
    fn face_in_cells(&self, face: Face) -> f64 {
        match face.is_upper() {
            true => self.grid.cells[face.axis()] as f64 - 0.5,
            false => -0.5,
        }
    }

    /// The ends of a pool along a direction (m), with its mirror image behind a plane of symmetry that cuts it there.
    fn with_images(
        &self,
        (low, high): (f64, f64),
        along: [f64; 3],
        (halves, values): (&[f64; 3], &[f64]),
    ) -> (f64, f64) {
        let Some(axis) = axis_of(along).filter(|&axis| halves[axis] > 1.0) else {
            return (low, high);
        };
        let cut = |face: &&Face| face.axis() == axis && self.is_cut(**face, values);
        let Some(face) = self.symmetry.iter().find(cut) else {
            return (low, high);
        };
        let plane = self.grid.origin[axis] + self.face_in_cells(*face) * self.grid.spacing;
        let plane = along[axis] * plane;
        match (along[axis] > 0.0) == face.is_upper() {
            true => (low, 2.0 * plane - low),
            false => (2.0 * plane - high, high),
        }
    }

    /// Whether the region above the isotherm reaches a face.
    fn is_cut(&self, face: Face, values: &[f64]) -> bool {
        let axis = face.axis();
        let ends = (axis < self.dimension).then(|| self.in_cells(values, axis));
        ends.flatten().is_some_and(|(from, to)| {
            let end = if face.is_upper() { to } else { from };
            end == self.face_in_cells(face)
        })
    }

    /// 2 for each axis whose normal plane of symmetry cuts the region above the isotherm, else 1.
    fn halves(&self, values: &[f64]) -> [f64; 3] {
        let mut halves = [1.0; 3];
        let cut = |face: &&Face| self.is_cut(**face, values);
        for &face in self.symmetry.iter().filter(cut) {
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

/// Ends of the interval around the maximum of a profile that is above a level, in cells from the first
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
mod tests;
