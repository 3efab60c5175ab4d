//! A power density that is sampled at points of the cells of a lattice, in the frame of the source.
//!
//! The frame has its origin at the position of the source: xi along the direction of travel normal to the axis, eta across it, and the
//! depth zeta along the axis. Cells that the density reaches receive the mean of their samples, two Gauss points in each panel.

use nalgebra::Vector3;
use perimelt_core::solver::ExactSum;

use super::{CellGrid, Deposit, HeatedBody};

/// Gauss-Legendre nodes on [-1, 1], with weights 1.
const NODES: [f64; 2] = [-0.577_350_269_189_625_8, 0.577_350_269_189_625_8];

/// Length of a panel over the shortest length of the density.
const PANEL: f64 = 1.0;

/// Most panels along an axis of a cell, and along the thickness of a plate or the edge of a larger box.
const MOST_PANELS: [f64; 2] = [6.0, 48.0];

/// A smaller fraction of the power that no material covers is an error of the sampling at the surface of the lattice.
const UNCOVERED: f64 = 0.02;

/// The frame of a source.
pub(super) struct SourceFrame {
    pub origin: Vector3<f64>,
    pub along: Vector3<f64>,
    pub across: Vector3<f64>,
    pub axis: Vector3<f64>,
}

impl SourceFrame {
    pub fn new(origin: Vector3<f64>, axis: Vector3<f64>, travel: Vector3<f64>) -> Self {
        let normal = |v: Vector3<f64>| (v - axis * v.dot(&axis)).try_normalize(1e-9);
        let along = normal(travel).or_else(|| normal(Vector3::x()));
        let along = along
            .or_else(|| normal(Vector3::y()))
            .unwrap_or_else(Vector3::z);
        SourceFrame {
            origin,
            along,
            across: axis.cross(&along),
            axis,
        }
    }
}

/// A density in a frame.
pub(super) struct Sampled<'a> {
    pub frame: SourceFrame,
    /// Extent along, across and in depth, m.
    pub reach: [f64; 3],
    /// Shortest length over which it changes, m.
    pub finest: f64,
    /// Whether a cell receives the value at its centre instead of a mean.
    pub at_centres: bool,
    /// Whether the density continues evenly to negative depths, as for an inclined torch; otherwise it is zero there.
    pub is_even: bool,
    /// Whether the samples are scaled to the power; otherwise the density has the integral 1 (1/m³).
    pub normalise: bool,
    /// Density at xi, eta and zeta >= 0.
    pub density: Box<dyn Fn(f64, f64, f64) -> f64 + 'a>,
}

impl Sampled<'_> {
    /// Corners of the box that the density reaches, m.
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        let frame = &self.frame;
        let [along, across, depth] = self.reach;
        let lateral = frame.along.abs() * along + frame.across.abs() * across;
        let deep = frame.axis * depth;
        let (up, down) = match self.is_even {
            true => (deep.abs(), deep.abs()),
            false => (deep.map(|d| d.max(0.0)), deep.map(|d| (-d).max(0.0))),
        };
        [frame.origin - lateral - down, frame.origin + lateral + up]
    }

    /// The density at a position.
    fn value(&self, at: Vector3<f64>) -> f64 {
        let from = at - self.frame.origin;
        let zeta = from.dot(&self.frame.axis);
        if zeta.abs() > self.reach[2] || (zeta < 0.0 && !self.is_even) {
            return 0.0;
        }
        let [xi, eta] = [from.dot(&self.frame.along), from.dot(&self.frame.across)];
        if xi.abs() > self.reach[0] || eta.abs() > self.reach[1] {
            return 0.0;
        }
        (self.density)(xi, eta, zeta.abs())
    }

    /// Mean over a box of the samples at `offsets` from its centre.
    fn mean(&self, centre: &Vector3<f64>, offsets: &[Vec<f64>; 3]) -> f64 {
        let mut sum = 0.0;
        for z in &offsets[2] {
            for y in &offsets[1] {
                for x in &offsets[0] {
                    sum += self.value(centre + Vector3::new(*x, *y, *z));
                }
            }
        }
        sum / offsets.iter().map(Vec::len).product::<usize>() as f64
    }

    /// Positions of the samples along an edge of a cell, from its centre (m).
    fn offsets(&self, width: f64, most: f64) -> Vec<f64> {
        if self.at_centres {
            return vec![0.0];
        }
        let panels = (width / (PANEL * self.finest)).ceil().clamp(1.0, most);
        let half = 0.5 * width / panels;
        let middle = |panel: usize| -0.5 * width + half * (2 * panel + 1) as f64;
        (0..panels as usize)
            .flat_map(|panel| NODES.map(|node| middle(panel) + half * node))
            .collect()
    }

    /// The integral over the part of a box that the density reaches, and over the whole thickness of a plate.
    pub fn integral(&self, grid: &CellGrid, [low, high]: [Vector3<f64>; 2]) -> f64 {
        let [least, most] = self.bounds();
        let mut clipped = [low.sup(&least), high.inf(&most)];
        for a in (0..3).filter(|a| grid.is_thickness(*a)) {
            (clipped[0][a], clipped[1][a]) = (least[a], most[a]);
        }
        let extent = clipped[1] - clipped[0];
        if extent.min() <= 0.0 {
            return 0.0;
        }
        let offsets = [0, 1, 2].map(|a| self.offsets(extent[a], MOST_PANELS[1]));
        self.mean(&(0.5 * (clipped[0] + clipped[1])), &offsets) * extent.product()
    }

    /// Adds the density of `power` (W) to the points of a lattice.
    pub fn add(
        &self,
        body: &(impl HeatedBody + ?Sized),
        power: f64,
        values: &mut [f64],
        parts: &mut Vec<f64>,
    ) -> Deposit {
        let grid = *body.grid();
        let [low, high] = self.bounds();
        let mut first = [0_i64; 3];
        let mut count = [1_i64; 3];
        let mut offsets: [Vec<f64>; 3] = Default::default();
        for a in 0..3 {
            if grid.is_thickness(a) {
                offsets[a] = self.offsets(high[a] - low[a], MOST_PANELS[1]);
                continue;
            }
            first[a] = grid.in_cells(a, low[a]).floor() as i64;
            count[a] = (grid.in_cells(a, high[a]).ceil() as i64 - first[a]).max(1);
            offsets[a] = self.offsets(grid.spacing[a], MOST_PANELS[0]);
        }
        let cells = || {
            let [x, y, z] = [0, 1, 2].map(|a| first[a]..first[a] + count[a]);
            z.flat_map(move |k| {
                let x = x.clone();
                let row = move |j| x.clone().map(move |i| [i, j, k]);
                y.clone().flat_map(row)
            })
        };
        let point_in = |cell: [i64; 3]| {
            let inside = (0..3).all(|a| cell[a] >= 0 && cell[a] < grid.dims[a] as i64);
            let cell = inside.then(|| cell.map(|c| c as usize));
            cell.and_then(|cell| body.point(cell))
        };
        let centre = |cell: [i64; 3]| {
            Vector3::from_fn(|a, _| match grid.is_thickness(a) {
                true => 0.5 * (low[a] + high[a]),
                false => grid.origin[a] + (cell[a] as f64 + 0.5) * grid.spacing[a],
            })
        };
        parts.clear();
        let (mut all, mut hit) = (0.0, ExactSum::default());
        for cell in cells() {
            let part = self.mean(&centre(cell), &offsets);
            all += part;
            if point_in(cell).is_some() {
                hit.add(part);
            }
            parts.push(part);
        }
        let hit = body.total(hit);
        if all == 0.0 {
            return Deposit {
                asked: power,
                deposited: 0.0,
                lost: power,
                ..Deposit::default()
            };
        }
        let deposited = power * self.deposited_fraction(&grid, all, hit);
        let scale = if hit > 0.0 { deposited / hit } else { 0.0 };
        for (cell, part) in cells().zip(&*parts) {
            if let Some(point) = point_in(cell).filter(|_| *part > 0.0) {
                values[point] += scale * part / body.volume(point);
            }
        }
        // a difference of rounding size is not lost power
        let lost = power - deposited;
        Deposit {
            asked: power,
            deposited,
            lost: if lost > 1e-12 * power { lost } else { 0.0 },
            ..Deposit::default()
        }
    }

    /// Fraction of the power that is deposited where all cells have the sum `all` of the density and those with material `hit`.
    fn deposited_fraction(&self, grid: &CellGrid, all: f64, hit: f64) -> f64 {
        // a plane cuts an even density into halves
        let whole = match (self.normalise, self.is_even) {
            (true, true) => 0.5 * all,
            (true, false) => all,
            (false, _) => 1.0 / grid.spacing.product(),
        };
        match hit / whole {
            covered if self.is_even && covered > 1.0 - UNCOVERED => 1.0,
            covered => covered,
        }
    }
}
