//! A window of finer points that moves over a body with coarser ones.
//!
//! Two bodies on lattices: the *plate* and, inside of it, the *window*, whose spacing is that of the plate divided by a whole
//! number. The coupler that moves the window names a conserved field, an amount per volume, and one that follows from it. Cells of
//! the plate below the window are *covered*: their amount is the mean of the points of the window in them, and balances count
//! these points instead. The window moves by whole cells of the plate. Its points keep
//! their places in memory; their fields are shifted, and points that enter get the amount of the cells of the
//! plate there, with slopes whose mean over a cell is zero. Points that leave have been averaged into the cells of the plate
//! before. Moves therefore keep the amount in both bodies together to rounding.
//!
//! The [`World`] owns the position of the window. A coupler declares the two bodies ([`Setup::refine`](crate::Setup::refine)) and moves the window
//! between steps ([`World::move_window`]); the physics of both bodies follow it ([`World::refinement`]). Plugins that act on
//! the window support that ([`Change::Window`](crate::Change)); others are refused.

mod fit;

use std::cell::Cell;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::body::Sizes;
use crate::error::SetupError;
use crate::field::{Key, Read, Write};
use crate::world::{BodyIndex, World};
use fit::{Fit, full_lattice};

/// The two bodies of a refinement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The body with the coarser points.
    Plate,
    /// The body with the finer points.
    Window,
}

/// A plate and the window that moves over it.
#[derive(Debug)]
pub struct Refinement {
    plate: BodyIndex,
    window: BodyIndex,
    dimension: usize,
    /// Points of the window along an edge of a cell of the plate.
    ratio: usize,
    /// Spacing of the plate, m.
    spacing: f64,
    /// Cells of the plate along each axis.
    plate_cells: [usize; 3],
    /// Cells of the plate that the window covers along each axis.
    cells: [usize; 3],
    /// Lowest cell of the plate below the window where the case places it.
    first: [i64; 3],
    /// Amount per volume of the plate, then of the window.
    conserved: [Write<f64>; 2],
    /// What follows from it.
    derived: [Write<f64>; 2],
    position: Cell<WindowPosition>,
}

/// The fields that move with a window.
#[derive(Clone, Copy, Debug)]
pub struct Transfer<'a> {
    /// An amount per volume, such as the enthalpy.
    pub conserved: &'a Key<f64>,
    /// What follows from the amount, such as the temperature.
    pub derived: &'a Key<f64>,
}

/// Where a window is, and the amount that its moves took along.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WindowPosition {
    /// Lowest cell of the plate below the window.
    pub low: [i64; 3],
    /// Amount that the window took over from the plate by its moves since the start, less what it left behind.
    pub carried: f64,
}

/// Permission of a coupler to move a window.
#[derive(Clone, Copy, Debug)]
pub struct WindowMover {
    pub(crate) refinement: usize,
}

impl Refinement {
    pub(crate) fn new(
        world: &World,
        plate: BodyIndex,
        window: BodyIndex,
        conserved: [Read<f64>; 2],
        derived: [Read<f64>; 2],
    ) -> Result<Refinement, SetupError> {
        let coarse = full_lattice(&world.bodies[plate], "body")?;
        let fine = full_lattice(&world.bodies[window], "fine")?;
        let Fit {
            ratio,
            cells,
            first,
        } = Fit::new(coarse, fine)?;
        let handles = |of: [Read<f64>; 2]| of.map(|handle| Write::new(handle.field));
        let position = WindowPosition {
            low: first,
            carried: 0.0,
        };
        Ok(Refinement {
            plate,
            window,
            dimension: coarse.body.dimension,
            ratio,
            spacing: coarse.lattice.spacing,
            plate_cells: coarse.lattice.cells,
            cells,
            first,
            conserved: handles(conserved),
            derived: handles(derived),
            position: Cell::new(position),
        })
    }

    /// The body with the coarser points.
    pub fn plate(&self) -> BodyIndex {
        self.plate
    }

    /// The body with the finer points.
    pub fn window(&self) -> BodyIndex {
        self.window
    }

    /// Points of the window along an edge of a cell of the plate, by axis: 1 along axes that the bodies do not have.
    pub fn ratio(&self) -> [usize; 3] {
        std::array::from_fn(|a| if a < self.dimension { self.ratio } else { 1 })
    }

    /// Cells of the plate along each axis.
    pub fn plate_cells(&self) -> [usize; 3] {
        self.plate_cells
    }

    /// Cells of the plate that the window covers along each axis.
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// Where the window is.
    pub fn position(&self) -> WindowPosition {
        self.position.get()
    }

    /// Amount per volume of the window: for the physics of the plate, which advances after that of the window.
    pub fn window_amount(&self) -> Read<f64> {
        self.conserved[1].into()
    }

    /// Where the window may be nearest to a position (cells of the plate), so that it stays on the plate.
    pub fn nearest(&self, low: [i64; 3]) -> [i64; 3] {
        std::array::from_fn(|a| {
            let last = self.plate_cells[a] as i64 - self.cells[a] as i64;
            low[a].clamp(0, last)
        })
    }

    /// Where the window is when it has moved by `way` (m) along x and y from where the case places it.
    pub fn moved_by(&self, way: Vector3<f64>) -> [i64; 3] {
        let along = self.dimension.min(2);
        let cells = |a: usize| match a < along {
            true => (way[a] / self.spacing).round() as i64,
            false => 0,
        };
        self.nearest(std::array::from_fn(|a| self.first[a] + cells(a)))
    }

    /// Point of the plate in a cell.
    pub fn plate_point(&self, cell: [usize; 3]) -> usize {
        let [nx, ny, _] = self.plate_cells;
        (cell[2] * ny + cell[1]) * nx + cell[0]
    }

    /// Cell of a point of the plate.
    pub fn plate_cell(&self, point: usize) -> [usize; 3] {
        let [nx, ny, _] = self.plate_cells;
        [point % nx, point / nx % ny, point / (nx * ny)]
    }

    /// Points of the window along each axis.
    pub fn window_points(&self) -> [usize; 3] {
        let ratio = self.ratio();
        std::array::from_fn(|a| self.cells[a] * ratio[a])
    }

    /// Cells that the window covers at a position (its lowest cell), by row along x: the first one and their number.
    fn rows(&self, low: [i64; 3]) -> impl Iterator<Item = ([usize; 3], usize)> + use<> {
        let (low, cells) = (low.map(|c| c as usize), self.cells);
        let layers = low[2]..low[2] + cells[2];
        layers.flat_map(move |z| {
            let rows = low[1]..low[1] + cells[1];
            rows.map(move |y| ([low[0], y, z], cells[0]))
        })
    }

    /// Passes each covered point of the plate and the points of the window in its cell to `receive`.
    pub fn for_each_covered(&self, mut receive: impl FnMut(usize, &[usize])) {
        let mut inside = Vec::new();
        let low = self.position().low;
        for (first, count) in self.rows(low) {
            for x in 0..count {
                let cell = [first[0] + x, first[1], first[2]];
                self.window_points_in(low, cell, &mut inside);
                receive(self.plate_point(cell), &inside);
            }
        }
    }

    /// The points of a window at `low` that lie in a cell of the plate below it.
    fn window_points_in(&self, low: [i64; 3], cell: [usize; 3], inside: &mut Vec<usize>) {
        let (ratio, [nx, ny, _]) = (self.ratio(), self.window_points());
        let from: [usize; 3] = std::array::from_fn(|a| (cell[a] - low[a] as usize) * ratio[a]);
        inside.clear();
        for z in from[2]..from[2] + ratio[2] {
            for y in from[1]..from[1] + ratio[1] {
                let row = (z * ny + y) * nx + from[0];
                inside.extend(row..row + ratio[0]);
            }
        }
    }

    /// Whether a window at `low` covers a cell of the plate.
    fn covers_at(&self, low: [i64; 3], cell: [usize; 3]) -> bool {
        (0..3).all(|a| {
            let from = low[a] as usize;
            (from..from + self.cells[a]).contains(&cell[a])
        })
    }

    /// Whether the window covers a cell of the plate.
    pub fn covers(&self, cell: [usize; 3]) -> bool {
        self.covers_at(self.position().low, cell)
    }

    /// Volumes of the points of the plate that the window does not cover, else 0, m³.
    pub fn uncovered(&self, volume: &Sizes) -> Sizes {
        let mut uncovered: Vec<f64> = volume.each().collect();
        for (first, count) in self.rows(self.position().low) {
            let point = self.plate_point(first);
            uncovered[point..point + count].fill(0.0);
        }
        uncovered.into()
    }

    /// How far the points of the window are from where the case places them, m.
    fn shift(&self) -> Vector3<f64> {
        let low = self.position().low;
        Vector3::from_fn(|a, _| (low[a] - self.first[a]) as f64 * self.spacing)
    }

    /// Slopes of the amount of the plate along each axis, per point of the window: those of the limiter of van Leer
    /// (monotonised central differences), so that the values of points that enter lie between those of the cells around them.
    fn slopes(&self, amount: &[f64], cell: [usize; 3]) -> [f64; 3] {
        let here = amount[self.plate_point(cell)];
        std::array::from_fn(|a| {
            if a >= self.dimension || cell[a] == 0 || cell[a] + 1 == self.plate_cells[a] {
                return 0.0;
            }
            let at = |c: usize| {
                let mut other = cell;
                other[a] = c;
                amount[self.plate_point(other)]
            };
            let (below, above) = (here - at(cell[a] - 1), at(cell[a] + 1) - here);
            if below * above <= 0.0 {
                return 0.0;
            }
            let least = 2.0 * below.abs().min(above.abs());
            let central = 0.5 * (below + above);
            central.signum() * central.abs().min(least) / self.ratio as f64
        })
    }

    /// Moves the fields of the window; what enters gets the amount of the plate and what follows from it by `derive`.
    fn move_to(&self, world: &World, low: [i64; 3], derive: &dyn Fn(f64) -> f64) {
        let before = self.position();
        let volume = &world.bodies[self.plate].points.volume;
        let [nx, ny, nz] = self.window_points();
        let mut carried = -self.leave_behind(world, low, derive);
        let plate = world.read::<f64>(self.conserved[0].into());
        let ratio = self.ratio();
        let step: [i64; 3] = std::array::from_fn(|a| (low[a] - before.low[a]) * ratio[a] as i64);
        for field in [self.conserved[1], self.derived[1]] {
            shift(&mut world.write(field), [nx, ny, nz], step);
        }
        let mut amounts = world.write(self.conserved[1]);
        let mut derived = world.write(self.derived[1]);
        let mut inside = Vec::new();
        for (first, count) in self.rows(low) {
            for x in 0..count {
                let cell = [first[0] + x, first[1], first[2]];
                if self.covers_at(before.low, cell) {
                    continue;
                }
                let point = self.plate_point(cell);
                carried += plate[point] * volume[point];
                let slopes = self.slopes(&plate, cell);
                self.window_points_in(low, cell, &mut inside);
                for (n, &entering) in inside.iter().enumerate() {
                    let place = [
                        n % ratio[0],
                        n / ratio[0] % ratio[1],
                        n / (ratio[0] * ratio[1]),
                    ];
                    let rise = |a: usize| {
                        let from_centre = place[a] as f64 - 0.5 * (ratio[a] as f64 - 1.0);
                        slopes[a] * from_centre
                    };
                    let amount = plate[point] + (0..3).map(rise).sum::<f64>();
                    amounts[entering] = amount;
                    derived[entering] = derive(amount);
                }
            }
        }
        let carried = before.carried + carried;
        self.position.set(WindowPosition { low, carried });
    }

    /// Gives the cells of the plate that a window at `low` does not cover any more the mean amount of the points of the
    /// window in them; the amount that they have.
    fn leave_behind(&self, world: &World, low: [i64; 3], derive: &dyn Fn(f64) -> f64) -> f64 {
        let volume = &world.bodies[self.plate].points.volume;
        let window = world.read::<f64>(self.conserved[1].into());
        let mut plate = world.write(self.conserved[0]);
        let mut derived = world.write(self.derived[0]);
        let mut left = 0.0;
        self.for_each_covered(|point, inside| {
            if !self.covers_at(low, self.plate_cell(point)) {
                plate[point] = mean(&window, inside);
                derived[point] = derive(plate[point]);
                left += plate[point] * volume[point];
            }
        });
        left
    }
}

/// Mean of the values of some points.
pub fn mean(values: &[f64], points: &[usize]) -> f64 {
    points.iter().map(|&p| values[p]).sum::<f64>() / points.len() as f64
}

/// Moves the values of a grid of points by `step` points against the axes; what is left behind keeps old values.
fn shift(values: &mut [f64], [nx, ny, nz]: [usize; 3], step: [i64; 3]) {
    let range = |n: usize, step: i64| -> Box<dyn Iterator<Item = usize>> {
        let kept = (n as i64 - step.abs()).max(0) as usize;
        // values at `to` come from `to + step`; in the order in which no source has been overwritten
        let from = (-step).max(0) as usize;
        let targets = from..from + kept;
        match step >= 0 {
            true => Box::new(targets),
            false => Box::new(targets.rev()),
        }
    };
    let columns: Vec<usize> = range(nx, step[0]).collect();
    let Some((first, last)) = columns.iter().min().zip(columns.iter().max()) else {
        return;
    };
    let from = |to: usize, step: i64| (to as i64 + step) as usize;
    for z in range(nz, step[2]) {
        for y in range(ny, step[1]) {
            let source = (from(z, step[2]) * ny + from(y, step[1])) * nx;
            let target = (z * ny + y) * nx;
            let start = source + from(*first, step[0]);
            values.copy_within(start..=source + from(*last, step[0]), target + first);
        }
    }
}

impl World {
    /// The refinement of which a body is the plate or the window.
    pub fn refinement(&self, body: BodyIndex) -> Option<(&Refinement, Level)> {
        self.refinements.iter().find_map(|r| match body {
            b if b == r.plate => Some((r, Level::Plate)),
            b if b == r.window => Some((r, Level::Window)),
            _ => None,
        })
    }

    /// Whether one of two bodies is a window of finer points in the other.
    pub(crate) fn are_refined(&self, a: BodyIndex, b: BodyIndex) -> bool {
        let mut pairs = self.refinements.iter().map(|r| [r.plate, r.window]);
        pairs.any(|pair| pair == [a, b] || pair == [b, a])
    }

    /// How far the points of a body are from their reference positions because it is a window that moves, m.
    pub fn window_shift(&self, body: BodyIndex) -> Vector3<f64> {
        match self.refinement(body) {
            Some((refinement, Level::Window)) => refinement.shift(),
            _ => Vector3::zeros(),
        }
    }

    /// The refinement that a coupler moves.
    pub fn moved_refinement(&self, mover: WindowMover) -> &Refinement {
        &self.refinements[mover.refinement]
    }

    /// Moves a window, whose lowest cell is then `low`, with its fields; between steps, when the physics of both bodies have
    /// advanced to one time. `derive` gives what follows from an amount per volume.
    pub fn move_window(&self, mover: WindowMover, low: [i64; 3], derive: impl Fn(f64) -> f64) {
        let refinement = self.moved_refinement(mover);
        let low = refinement.nearest(low);
        if refinement.position().low != low {
            refinement.move_to(self, low, &derive);
        }
    }

    /// Puts a window back where it was, without its fields, which are restored on their own.
    pub fn restore_window(&self, mover: WindowMover, position: WindowPosition) {
        self.moved_refinement(mover).position.set(position);
    }
}

#[cfg(test)]
mod tests;
