//! A beam on a lattice: the part of the power of each cell, and its power density.
//!
//! The density is footprint × depth profile. The part of the power of a cell is therefore a lateral part
//! times a depth part, and the sum over the unbounded lattice is the product of the two sums. Depth parts
//! are exact. Lateral parts are products of error functions if the travel direction lies along an axis of
//! the lattice (or has no effect), otherwise sums over Gauss points. The distance of the Gauss points
//! follows the lengths of the source, not the cells, so that coarse lattices integrate the whole source.
//!
//! Cost: one lateral table per step, a few thousand exponentials when it needs Gauss points, and
//! one multiplication per heated cell.

use super::heated_body::depth_range;
use super::profile::{DepthProfile, Footprint};
use super::{CellGrid, CellSampling, Cells, Deposit, HeatedBody, Sampling, check_cells};
use crate::toolpath::Pose;
use nalgebra::Vector3;
use perimelt_core::SetupError;
use perimelt_core::solver::ExactSum;

/// Most cells in a cross-section of the source: 1 GB of work space.
pub(super) const MOST_CELLS: f64 = 1e8;

/// Gauss-Legendre nodes on [-1, 1] and weights.
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
];

/// Length of a Gauss panel over the finest length of the source; unnormalised powers are then
/// right to 1e-5.
const PANEL: f64 = 0.5;

/// A footprint times a depth profile, and how it is sampled on the lattice.
#[derive(Debug, Clone)]
pub struct Beam {
    pub(super) footprint: Footprint,
    pub(super) depth: DepthProfile,
    /// A plate heated through its thickness H takes power × H / `plate_depth`; `None`: the power.
    pub(super) plate_depth: Option<f64>,
    pub(super) sampled: CellSampling,
    /// Key of the greatest lateral length.
    pub(super) widest_key: &'static str,
}

/// Work arrays of a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    pub(super) lateral: Vec<f64>,
    pub(super) depth: Vec<f64>,
    /// Depths of columns, in layers.
    pub(super) depths: Vec<f64>,
    along: [Vec<f64>; 2],
    /// Cells of a body without a lattice, and their parts of the power.
    pub(super) parts: Vec<(usize, f64)>,
}

/// The cells of one lateral axis that the source reaches.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub(super) first: i64,
    pub(super) count: usize,
    /// Low end of the first cell, seen from the source (m).
    low: f64,
    width: f64,
    reach: f64,
    /// Thickness of a plate: one cell takes the whole reach.
    thickness: bool,
}

impl Span {
    /// The cells on a body with so many along the axis.
    pub(super) fn cells(&self, dim: usize) -> std::ops::Range<usize> {
        let inside = inside(self.first, self.count, dim);
        let cell = |index: usize| (self.first + index as i64) as usize;
        cell(inside.start)..cell(inside.end)
    }

    fn new(grid: &CellGrid, axis: usize, position: f64, reach: f64) -> Self {
        if grid.is_thickness(axis) {
            let width = 2.0 * reach;
            return Self {
                first: 0,
                count: 1,
                low: -reach,
                width,
                reach,
                thickness: true,
            };
        }
        let width = grid.spacing[axis];
        let at = grid.in_cells(axis, position);
        let first = (at - reach / width).floor();
        let count = (at + reach / width).ceil() - first;
        Self {
            first: first as i64,
            count: count as usize,
            low: (first - at) * width,
            width,
            reach,
            thickness: false,
        }
    }

    /// One cell between `low` and `high` (m).
    fn of_cell(
        grid: &CellGrid,
        axis: usize,
        position: f64,
        [low, high]: [f64; 2],
        reach: f64,
    ) -> Self {
        if grid.is_thickness(axis) {
            return Self::new(grid, axis, position, reach);
        }
        Self {
            first: 0,
            count: 1,
            low: low - position,
            width: high - low,
            reach,
            thickness: false,
        }
    }

    /// Ends of a cell, seen from the source (m).
    fn cell(&self, index: usize) -> (f64, f64) {
        let low = self.low + index as f64 * self.width;
        (low, low + self.width)
    }

    /// Nodes and weights that integrate over a cell; its centre alone for point sampling.
    fn nodes(
        &self,
        index: usize,
        sampling: Sampling,
        finest: f64,
    ) -> impl Iterator<Item = (f64, f64)> + Clone + use<> {
        let (low, high) = self.cell(index);
        let centre = (sampling == Sampling::Point && !self.thickness)
            .then_some((0.5 * (low + high), self.width));
        let (low, high) = (low.max(-self.reach), high.min(self.reach));
        let panels = match centre {
            Some(_) => 0,
            None => ((high - low) / (PANEL * finest)).ceil().max(0.0) as usize,
        };
        let half = 0.5 * (high - low) / panels as f64;
        let gauss = (0..panels).flat_map(move |panel| {
            let middle = low + half * (2 * panel + 1) as f64;
            GAUSS.map(|(node, weight)| (middle + half * node, half * weight))
        });
        centre.into_iter().chain(gauss)
    }
}

impl Beam {
    /// Refuses a source that covers more cells than can be held.
    pub(super) fn check_size(&self, grid: &CellGrid) -> Result<(), SetupError> {
        let axis = self.sampled.heated_surface.face.axis();
        let lateral = self.footprint.columns(grid, axis);
        let layers = self.depth.reach() / grid.spacing[axis];
        for (key, cells) in [(self.widest_key, lateral), ("depth", layers)] {
            check_cells(key, cells, MOST_CELLS)?;
        }
        Ok(())
    }

    /// Adds the density of `power` (W) to `values` (W/m³).
    pub(super) fn add(
        &self,
        body: &(impl HeatedBody + ?Sized),
        pose: &Pose,
        power: f64,
        values: &mut [f64],
        scratch: &mut Scratch,
    ) -> Deposit {
        let grid = *body.grid();
        let depth_axis = self.sampled.heated_surface.face.axis();
        let asked = self.asked(&grid, power);
        let placed = self.footprint.placed(depth_axis, pose);
        let spans = placed.spans(&grid, pose);
        let PlacedFootprint { axes, travel, .. } = placed;
        let level = self.sampled.heated_surface.level_at(pose);
        let first_layer = self.fill_depth(&grid, level, self.sampled.sampling, &mut scratch.depth);
        self.footprint
            .fill_parts(&spans, travel, self.sampled.sampling, scratch);
        let sum = |parts: &[f64]| parts.iter().sum::<f64>();
        let mut all = sum(&scratch.lateral) * sum(&scratch.depth);
        let mut layer = first_layer;
        if all == 0.0 && self.sampled.normalise {
            // the source lies between the cell centres
            layer = self.fill_depth(&grid, level, Sampling::CellAverage, &mut scratch.depth);
            self.footprint
                .fill_parts(&spans, travel, Sampling::CellAverage, scratch);
            all = sum(&scratch.lateral) * sum(&scratch.depth);
        }
        let scale = if self.sampled.normalise {
            asked / all
        } else {
            asked
        };

        let rows = inside(spans[1].first, spans[1].count, grid.dims[axes[1]]);
        let columns = inside(spans[0].first, spans[0].count, grid.dims[axes[0]]);
        let layers = inside(layer, scratch.depth.len(), grid.dims[depth_axis]);
        let mut hit = ExactSum::default();
        for k in layers {
            for j in rows.clone() {
                for i in columns.clone() {
                    let part = scratch.depth[k] * scratch.lateral[j * spans[0].count + i];
                    let mut cell = [0; 3];
                    cell[depth_axis] = (layer + k as i64) as usize;
                    cell[axes[0]] = (spans[0].first + i as i64) as usize;
                    cell[axes[1]] = (spans[1].first + j as i64) as usize;
                    if let Some(point) = body.point(cell) {
                        values[point] += scale * part / body.volume(point);
                        hit.add(part);
                    }
                }
            }
        }
        Deposit::of_parts(asked, scale, body.total(hit), all)
    }

    /// [`Beam::add`] for a body without a lattice.
    pub(super) fn add_to_cells(
        &self,
        cells: &Cells<'_>,
        pose: &Pose,
        power: f64,
        values: &mut [f64],
        scratch: &mut Scratch,
    ) -> Deposit {
        let depth_axis = self.sampled.heated_surface.face.axis();
        let PlacedFootprint {
            axes,
            travel,
            reach,
        } = self.footprint.placed(depth_axis, pose);
        let level = self.sampled.heated_surface.level_at(pose);
        let depth = self.depth.reach();
        let (shallow, deep) = match self.sampled.heated_surface.face.is_upper() {
            true => (level - depth, level),
            false => (level, level + depth),
        };
        let (mut low, mut high) = (pose.position, pose.position);
        (low[depth_axis], high[depth_axis]) = (shallow, deep);
        for (axis, reach) in axes.into_iter().zip(reach) {
            low[axis] -= reach;
            high[axis] += reach;
        }
        let mut parts = std::mem::take(&mut scratch.parts);
        let mut part = |[low, high]: [Vector3<f64>; 2]| {
            let spans = [0, 1].map(|i| {
                let ends = [low[axes[i]], high[axes[i]]];
                Span::of_cell(&cells.grid, axes[i], pose.position[axes[i]], ends, reach[i])
            });
            self.footprint
                .fill_parts(&spans, travel, Sampling::CellAverage, scratch);
            let lateral: f64 = scratch.lateral.iter().sum();
            let (near, far) = match self.sampled.heated_surface.face.is_upper() {
                true => (level - high[depth_axis], level - low[depth_axis]),
                false => (low[depth_axis] - level, high[depth_axis] - level),
            };
            match cells.grid.is_thickness(depth_axis) {
                true => lateral,
                false => lateral * (self.depth.down_to(far) - self.depth.down_to(near)),
            }
        };
        let of_cell = |point: usize| (point, part(cells.corners(point)));
        parts.clear();
        parts.extend(cells.near(low, high).map(of_cell));
        let in_box = part(cells.bounds);
        let asked = self.asked(&cells.grid, power);
        let deposit = cells.deposit(&parts, asked, in_box, self.sampled.normalise, values);
        scratch.parts = parts;
        deposit
    }

    /// The power asked for, W, when the toolpath gives `power`.
    fn asked(&self, grid: &CellGrid, power: f64) -> f64 {
        let axis = self.sampled.heated_surface.face.axis();
        match self.plate_depth {
            Some(depth) if grid.is_thickness(axis) => power * grid.spacing[axis] / depth,
            _ => power,
        }
    }

    /// Parts of the power in the layers of cells below the heated face; returns the first layer.
    fn fill_depth(
        &self,
        grid: &CellGrid,
        level: f64,
        sampling: Sampling,
        parts: &mut Vec<f64>,
    ) -> i64 {
        let face = self.sampled.heated_surface.face;
        let axis = face.axis();
        parts.clear();
        if grid.is_thickness(axis) {
            parts.push(1.0);
            return 0;
        }
        let width = grid.spacing[axis];
        let level = grid.in_cells(axis, level);
        let reach = self.depth.reach() / width;
        let (low, high) = if face.is_upper() {
            (level - reach, level)
        } else {
            (level, level + reach)
        };
        let first = low.floor() as i64;
        parts.extend((first..high.ceil() as i64).map(|index| {
            let (near, far) = depth_range(face, index, level);
            match sampling {
                Sampling::CellAverage => {
                    self.depth.down_to(far * width) - self.depth.down_to(near * width)
                }
                Sampling::Point => self.depth.density(0.5 * (near + far) * width) * width,
            }
        }));
        first
    }
}

/// A footprint on the heated face at a pose of its toolpath.
pub(super) struct PlacedFootprint {
    /// Lateral axes.
    pub(super) axes: [usize; 2],
    /// Unit vector of travel along them.
    pub(super) travel: [f64; 2],
    /// Half lengths of the box around the footprint, m.
    pub(super) reach: [f64; 2],
}

impl PlacedFootprint {
    /// The cells of a lattice that it reaches at a pose, along both lateral axes.
    pub(super) fn spans(&self, grid: &CellGrid, pose: &Pose) -> [Span; 2] {
        [0, 1].map(|i| {
            let axis = self.axes[i];
            Span::new(grid, axis, pose.position[axis], self.reach[i])
        })
    }
}

impl Footprint {
    /// The footprint on a face across `axis`.
    pub(super) fn placed(&self, axis: usize, pose: &Pose) -> PlacedFootprint {
        let axes = [(axis + 1) % 3, (axis + 2) % 3];
        let travel = self.travel(axes.map(|axis| pose.direction[axis]));
        PlacedFootprint {
            axes,
            travel,
            reach: self.half_lengths(travel),
        }
    }

    /// Largest number of columns of cells across a face that it covers.
    pub(super) fn columns(&self, grid: &CellGrid, axis: usize) -> f64 {
        let [along, across] = self.reach();
        (0..3)
            .filter(|&other| other != axis && !grid.is_thickness(other))
            .map(|other| 2.0 * along.max(across) / grid.spacing[other] + 2.0)
            .product()
    }

    /// Half lengths of the box around the turned footprint, m.
    fn half_lengths(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [along, across] = self.reach();
        let (cos, sin) = (u.abs(), v.abs());
        [cos * along + sin * across, sin * along + cos * across]
    }

    /// Unit vector of travel on the heated face; exactly along an axis if it is so within rounding.
    fn travel(&self, direction: [f64; 2]) -> [f64; 2] {
        let length = direction[0].hypot(direction[1]);
        if self.is_round() || length < 1e-12 {
            return [1.0, 0.0];
        }
        let [u, v] = direction.map(|component| component / length);
        match (u.abs() < 1e-12, v.abs() < 1e-12) {
            (_, true) => [u.signum(), 0.0],
            (true, _) => [0.0, v.signum()],
            _ => [u, v],
        }
    }

    /// Parts of the power in the columns of cells, first span fastest.
    pub(super) fn fill_parts(
        &self,
        spans: &[Span; 2],
        travel: [f64; 2],
        sampling: Sampling,
        scratch: &mut Scratch,
    ) {
        let shape = self;
        let table = &mut scratch.lateral;
        table.clear();
        let [u, v] = travel;
        if let Some(ellipse) = shape.ellipse().filter(|_| u == 0.0 || v == 0.0) {
            for ((span, facing), parts) in spans.iter().zip(travel).zip(&mut scratch.along) {
                parts.clear();
                parts.extend((0..span.count).map(|cell| {
                    let (low, high) = span.cell(cell);
                    if sampling == Sampling::Point && !span.thickness {
                        let centre = 0.5 * (low + high);
                        let density = match facing {
                            0.0 => ellipse.across(centre),
                            _ => ellipse.along(facing * centre),
                        };
                        return density * span.width;
                    }
                    let within = |x: f64| match facing {
                        0.0 => ellipse.across_from_centre(x),
                        _ => facing * ellipse.along_from_centre(facing * x),
                    };
                    within(high) - within(low)
                }));
            }
            let [first, second] = &scratch.along;
            table.extend(second.iter().flat_map(|b| first.iter().map(move |a| a * b)));
            return;
        }
        let finest = shape.finest();
        for j in 0..spans[1].count {
            for i in 0..spans[0].count {
                let rows = spans[1].nodes(j, sampling, finest);
                let columns = spans[0].nodes(i, sampling, finest);
                let part: f64 = rows
                    .map(|(y, weight_y)| {
                        let row = columns.clone().map(|(x, weight_x)| {
                            weight_x * shape.density(x * u + y * v, y * u - x * v)
                        });
                        weight_y * row.sum::<f64>()
                    })
                    .sum();
                table.push(part);
            }
        }
    }
}

/// The offsets from `first` that lie on the body.
pub(super) fn inside(first: i64, count: usize, dim: usize) -> std::ops::Range<usize> {
    let end = (dim as i64 - first).clamp(0, count as i64);
    let start = (-first).clamp(0, end);
    start as usize..end as usize
}
