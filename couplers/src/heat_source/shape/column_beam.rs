//! A beam that is absorbed column by column along its direction, where an [`Absorber`] says: at the interface of two fluids, or on the wall
//! of a keyhole.
//!
//! **Interface.** The first fluid absorbs in proportion to the rise of the square of its fraction c from the side of the beam,
//! `max(0, c_k^2 - max c^2 above)`, whose sum in a column is 1. All power of a column enters its metal,
//! wherever the interface lies and whatever its inclination. A column without metal loses its power.
//! The square moves the heat to the metal's side of the layer: each cell of the layer gets heat in proportion to the metal in it times
//! the gradient of c, so that cells that are mostly gas do not overheat.
//!
//! **Keyhole.** The power of a column heats its first cell, but to boiling at most, and the rest goes on to the next one:
//!
//! ```text
//! q_k = min((h_b - h_k)/dt, P_k/V),   P_{k+1} = P_k - V q_k           h_b enthalpy at the boiling temperature
//! ```
//!
//! A cavity deepens until conduction from its wall takes the power, as in the models of
//! a keyhole whose wall boils (\[Swifthook1973\], \[Lankalapalli1996\]). What conduction takes from a cell during a step is replaced in the
//! next one, and what it gives makes the cell as much hotter: wall temperatures differ from boiling by that much. (Taking the excess away as well would be unstable: it
//! doubles the operator of conduction in boiling cells.) Not modelled: the depth at which capillary pressure closes the cavity, the heat that the vapour carries away, and
//! the flow around the cavity; metal in the cavity stays, at the boiling temperature.

use std::ops::Range;

use perimelt_core::{Face, SetupError};

use super::beam::{MOST_CELLS, PlacedFootprint, Scratch, Span, inside};
use super::profile::Footprint;
use super::{CellGrid, CellSampling, Deposit, Depression, HeatedBody, check_cells};
use crate::toolpath::Pose;

/// Largest fraction in a column from which on it counts as one with metal.
const METAL: f64 = 0.5;

/// Most iterations for the absorptivity of a keyhole, whose depth depends on it.
const ITERATIONS: usize = 50;

/// Relative change of the absorptivity at which they end.
const CONVERGED: f64 = 1e-6;

/// Where the columns of a body absorb a beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Absorber {
    /// At the interface of two fluids, in the first one.
    Interface,
    /// In cells that do not boil yet.
    Keyhole,
}

/// A footprint that is absorbed column by column.
#[derive(Debug, Clone)]
pub struct ColumnBeam {
    pub(super) footprint: Footprint,
    pub(super) sampled: CellSampling,
    pub(super) absorber: Absorber,
    /// Absorptivity of the flat surface, where a depression absorbs what its walls reflect.
    pub(super) reflecting: Option<f64>,
    /// Key of the greatest lateral length.
    pub(super) widest_key: &'static str,
}

/// The columns of a body along a beam.
struct Columns<'a, B: ?Sized> {
    body: &'a B,
    absorber: Absorber,
    face: Face,
    /// The heated surface, in layers from the side of the beam.
    level: f64,
    /// Lateral axes.
    axes: [usize; 2],
    spans: [Span; 2],
}

/// What a column absorbs of its power.
struct Absorbed {
    /// Of its power, W.
    power: f64,
    /// Depth of its surface below the side of the beam, in layers: the mean over what an interface absorbs, or the end of the cells
    /// that boil.
    depth: f64,
}

impl<B: HeatedBody + ?Sized> Columns<'_, B> {
    /// Ranges of the columns that lie on the body.
    fn ranges(&self) -> [Range<usize>; 2] {
        let dims = self.body.grid().dims;
        [0, 1].map(|a| {
            let Span { first, count, .. } = self.spans[a];
            inside(first, count, dims[self.axes[a]])
        })
    }

    fn layers(&self) -> usize {
        self.body.grid().dims[self.face.axis()]
    }

    /// The point in a layer of a column; layers count from the side of the beam.
    fn point(&self, [i, j]: [usize; 2], layer: usize) -> Option<usize> {
        let mut cell = [0; 3];
        cell[self.face.axis()] = match self.face.is_upper() {
            true => self.layers() - 1 - layer,
            false => layer,
        };
        cell[self.axes[0]] = (self.spans[0].first + i as i64) as usize;
        cell[self.axes[1]] = (self.spans[1].first + j as i64) as usize;
        self.body.point(cell)
    }

    /// Distributes `power` (W) over a column: calls `heat` with each point that absorbs and its power (W).
    fn absorb(
        &self,
        column: [usize; 2],
        power: f64,
        squares: &mut Vec<f64>,
        heat: impl FnMut(usize, f64),
    ) -> Absorbed {
        match self.absorber {
            Absorber::Interface => self.absorb_at_interface(column, power, squares, heat),
            Absorber::Keyhole => self.absorb_until_boiling(column, power, heat),
        }
    }

    fn absorb_at_interface(
        &self,
        column: [usize; 2],
        power: f64,
        squares: &mut Vec<f64>,
        mut heat: impl FnMut(usize, f64),
    ) -> Absorbed {
        squares.clear();
        squares.extend((0..self.layers()).map(|layer| {
            let point = self.point(column, layer);
            let fraction = point.and_then(|point| self.body.first_fluid(point));
            fraction.map_or(0.0, |c| c.clamp(0.0, 1.0).powi(2))
        }));
        let largest = squares.iter().copied().fold(0.0, f64::max);
        if largest < METAL * METAL {
            return Absorbed {
                power: 0.0,
                depth: self.layers() as f64,
            };
        }
        let (mut above, mut depth) = (0.0, 0.0);
        for (layer, &square) in squares.iter().enumerate() {
            let rise = square - above;
            let point = self.point(column, layer);
            if let Some(point) = point.filter(|_| rise > 0.0) {
                heat(point, power * rise / largest);
                // between the centres of the layer and of the one before it
                depth += rise / largest * layer as f64;
                above = square;
            }
        }
        Absorbed { power, depth }
    }

    fn absorb_until_boiling(
        &self,
        column: [usize; 2],
        power: f64,
        mut heat: impl FnMut(usize, f64),
    ) -> Absorbed {
        let mut left = power;
        // cells whose centres are below the surface
        let first = (self.level - 0.5).ceil().max(0.0) as usize;
        for layer in first..self.layers() {
            let Some(point) = self.point(column, layer) else {
                continue;
            };
            let most = self.body.boiling_power(point) * self.body.volume(point);
            if left <= most {
                heat(point, left);
                let part = if most > 0.0 { left / most } else { 0.0 };
                return Absorbed {
                    power,
                    depth: layer as f64 + part,
                };
            }
            heat(point, most);
            left -= most;
        }
        Absorbed {
            power: power - left,
            depth: self.layers() as f64,
        }
    }
}

impl ColumnBeam {
    /// Refuses a beam that covers more columns than can be held.
    pub(super) fn check_size(&self, grid: &CellGrid) -> Result<(), SetupError> {
        let axis = self.sampled.heated_surface.face.axis();
        check_cells(
            self.widest_key,
            self.footprint.columns(grid, axis),
            MOST_CELLS,
        )
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
        let dims = body.grid().dims;
        let axis = self.sampled.heated_surface.face.axis();
        let placed = self.footprint.placed(axis, pose);
        let spans = placed.spans(body.grid(), pose);
        let cells = [0, 1, 2].map(|a| match placed.axes.iter().position(|axis| *axis == a) {
            Some(lateral) => spans[lateral].cells(dims[a]),
            None => 0..dims[a],
        });
        let Some(gathered) = body.gathered(cells) else {
            return self.add_to(body, (placed, spans), pose, power, values, scratch);
        };
        let mut of_cells = vec![0.0; gathered.len()];
        let placed = (placed, spans);
        let deposit = self.add_to(&gathered, placed, pose, power, &mut of_cells, scratch);
        for (number, point) in &gathered.own {
            values[*point] += of_cells[*number];
        }
        deposit
    }

    /// [`ColumnBeam::add`] to a body of which this process has all cells below the footprint.
    fn add_to(
        &self,
        body: &(impl HeatedBody + ?Sized),
        (placed, spans): (PlacedFootprint, [Span; 2]),
        pose: &Pose,
        power: f64,
        values: &mut [f64],
        scratch: &mut Scratch,
    ) -> Deposit {
        let grid = *body.grid();
        let face = self.sampled.heated_surface.face;
        let PlacedFootprint { axes, travel, .. } = placed;
        let sampling = self.sampled.sampling;
        self.footprint.fill_parts(&spans, travel, sampling, scratch);
        let level = grid.in_cells(face.axis(), self.sampled.heated_surface.level_at(pose));
        let columns = Columns {
            body,
            absorber: self.absorber,
            face,
            level: match face.is_upper() {
                true => grid.dims[face.axis()] as f64 - level,
                false => level,
            },
            axes,
            spans,
        };
        let all: f64 = scratch.lateral.iter().sum();
        let of_flat = match self.sampled.normalise && all > 0.0 {
            true => power / all,
            false => power,
        };
        let gain = self.gain(&columns, of_flat, scratch);
        let scale = gain * of_flat;
        let [across, rows] = columns.ranges();
        let (mut hit, mut depth) = (0.0, columns.level);
        for j in rows {
            for i in across.clone() {
                let part = scale * scratch.lateral[j * columns.spans[0].count + i];
                let heat = |point, power: f64| values[point] += power / body.volume(point);
                let absorbed = columns.absorb([i, j], part, &mut scratch.depth, heat);
                if absorbed.power > 0.0 {
                    depth = depth.max(absorbed.depth);
                }
                hit += absorbed.power;
            }
        }
        let hit = if scale > 0.0 { hit / scale } else { 0.0 };
        Deposit {
            depression: Some(Depression {
                depth: (depth - columns.level) * grid.spacing[face.axis()],
                gain,
            }),
            ..Deposit::of_parts(gain * power, scale, hit, all)
        }
    }

    /// Absorptivity of the depression over that of the flat surface, where the flat surface absorbs `scale` (W) times the lateral parts. The
    /// depth of a keyhole depends on what it absorbs.
    fn gain<B: HeatedBody + ?Sized>(
        &self,
        columns: &Columns<'_, B>,
        scale: f64,
        scratch: &mut Scratch,
    ) -> f64 {
        let Some(absorptivity) = self.reflecting else {
            return 1.0;
        };
        let mut gain = 1.0;
        for _ in 0..ITERATIONS {
            let before = gain;
            let open = columns.open_fraction(gain * scale, scratch);
            gain = 1.0 / (absorptivity + (1.0 - absorptivity) * open);
            if columns.absorber == Absorber::Interface || (gain - before).abs() < CONVERGED * gain {
                break;
            }
        }
        gain
    }
}

impl<B: HeatedBody + ?Sized> Columns<'_, B> {
    /// Area s of the opening of the depression over the area S of its wall, 1 without a depression. For light that the wall scatters in all
    /// directions the depression absorbs `A / (A + (1 - A) s/S)` ([Gouffe1945]). Columns belong to it whose surface is more than a spacing below the
    /// level of the source.
    fn open_fraction(&self, scale: f64, scratch: &mut Scratch) -> f64 {
        let [across, rows] = self.ranges();
        let width = across.len();
        let depths = &mut scratch.depths;
        depths.clear();
        for j in rows.clone() {
            for i in across.clone() {
                let part = scale * scratch.lateral[j * self.spans[0].count + i];
                let absorbed = self.absorb([i, j], part, &mut scratch.depth, |_, _| ());
                depths.push(absorbed.depth);
            }
        }
        let (mut opening, mut wall) = (0.0, 0.0);
        for (n, depth) in depths.iter().enumerate() {
            if *depth < self.level + 1.0 {
                continue;
            }
            let (i, j) = (n % width, n / width);
            let step = |other: Option<&f64>| other.map_or(0.0, |other| (other - depth).powi(2));
            let mut squares = 0.0;
            // each axis has the mean of the squares of the slopes on both sides
            for (has_low, has_high, stride) in [
                (i > 0, i + 1 < width, 1),
                (j > 0, j + 1 < rows.len(), width),
            ] {
                let low = has_low.then(|| &depths[n - stride]);
                let high = has_high.then(|| &depths[n + stride]);
                squares += 0.5 * (step(low) + step(high));
            }
            opening += 1.0;
            wall += (1.0 + squares).sqrt();
        }
        match wall > 0.0 {
            true => opening / wall,
            false => 1.0,
        }
    }
}

#[cfg(test)]
mod tests;
