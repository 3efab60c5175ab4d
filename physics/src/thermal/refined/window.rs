//! Coupling of a refined window to the coarse body around it.

use std::collections::BTreeMap;

use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::refinement::Refinement;
use perimelt_core::{Access, Body, Family, Read, Setup, SetupError, World, Write, keys};
use rayon::prelude::*;

use super::{Crossing, Exchange, HEAT_OF_WINDOW};
use crate::thermal::conduction::{Conduction, coefficient};

/// Layer points per parallel task.
const GHOSTS_PER_TASK: usize = 1024;

/// Coupling of the window to the plate.
#[derive(Debug)]
pub(in crate::thermal) struct Window {
    body: BodyIndex,
    plate_temperature: Read<f64>,
    given: Write<f64>,
    /// Number of layers of the window beyond its faces.
    pub(super) margin: i64,
    /// All layer points with their cells.
    layers: Vec<(u32, [i64; 3])>,
    /// Stencils by axis and cell, from the outermost layer on.
    stencils: [Vec<AxisStencil>; 3],
    /// Layer points in the plate, with the indices of their stencils along each axis.
    ghosts: Vec<(u32, [u32; 3])>,
    /// Cells beside the window, counted from its lowest cell.
    receivers: Vec<[i64; 3]>,
    exchange: Exchange,
    /// Power of the bonds of each receiver, W.
    powers: Vec<f64>,
    /// Position of the window for which the stencils were found, and its faces that lie on faces of the plate.
    at: Option<([i64; 3], [bool; 6])>,
    /// Time of the temperatures of the layer points, s.
    time: Option<f64>,
}

/// Interpolation stencil of a layer of cells of the window along an axis, mirrored at the faces of the plate.
#[derive(Clone, Copy, Debug)]
struct AxisStencil {
    /// Cells of the plate between which to interpolate.
    cells: [u32; 3],
    weights: [f64; 3],
    /// The nearest cell of the plate beside the window or below it, counted from the lowest cell of the window.
    beside: i64,
    /// Whether the window covers it.
    is_covered: bool,
}

/// Stencil of a cell of the window along an axis where the plate has `cells` cells of `ratio` fine cells each. `at` is the index
/// of the fine cell, which may lie beyond the plate; the window covers the cells `low..low + covered`.
fn stencil(at: i64, cells: usize, ratio: usize, low: i64, covered: usize) -> AxisStencil {
    let fine = (cells * ratio) as i64;
    let mirrored = |x: i64, n: i64| {
        if x < 0 {
            -1 - x
        } else if x >= n {
            2 * n - 1 - x
        } else {
            x
        }
    };
    let at = mirrored(at, fine);
    let ratio = ratio as i64;
    let cell = at / ratio;
    let half = 0.5 / ratio as f64;
    let x = (at % ratio) as f64 / ratio as f64 + half - 0.5;
    let curved = 0.5 * (x * x - 1.0 / 12.0 + half * half / 3.0);
    let weights = match cells {
        1 => [0.0, 1.0, 0.0],
        _ => [curved - 0.5 * x, 1.0 - 2.0 * curved, curved + 0.5 * x],
    };
    let relative = cell - low;
    AxisStencil {
        cells: [-1, 0, 1].map(|step| mirrored(cell + step, cells as i64) as u32),
        weights,
        beside: relative.clamp(-1, covered as i64),
        is_covered: (0..covered as i64).contains(&relative),
    }
}

impl Window {
    pub(super) fn new(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        plate: BodyIndex,
        family: &Family,
    ) -> Result<Window, SetupError> {
        let layers = family.layer_cells();
        let outermost = layers
            .iter()
            .flat_map(|(_, cell)| cell.iter().map(|c| -c))
            .max();
        Ok(Window {
            body,
            plate_temperature: setup.read(plate, &keys::TEMPERATURE)?,
            given: setup.give(plate, &HEAT_OF_WINDOW, Access::GiveSum)?,
            margin: outermost.unwrap_or(0),
            layers,
            stencils: Default::default(),
            ghosts: Vec::new(),
            receivers: Vec::new(),
            exchange: Exchange::default(),
            powers: Vec::new(),
            at: None,
            time: None,
        })
    }

    /// Updates the layer points for the position of the window and the temperatures of the plate around it.
    pub(super) fn follow(&mut self, world: &World, family: &Family, conduction: &mut Conduction) {
        let Some((refinement, _)) = world.refinement(self.body) else {
            return;
        };
        let low = refinement.position().low;
        if self.at.is_none_or(|(at, _)| at != low) {
            self.find_stencils(refinement, low);
            let touches: [bool; 6] = std::array::from_fn(|face| {
                let axis = face / 2;
                match face % 2 {
                    0 => low[axis] == 0,
                    _ => {
                        low[axis] as usize + refinement.cells()[axis]
                            == refinement.plate_cells()[axis]
                    }
                }
            });
            if self.at.is_none_or(|(_, known)| known != touches) {
                self.find_ghosts();
                self.find_bonds(world.body(self.body), refinement, family);
            }
            (self.at, self.time) = (Some((low, touches)), None);
        }
        let time = world.time_of(self.plate_temperature);
        if self.time != Some(time) {
            self.time = Some(time);
            let temperature: &[f64] = &world.read(self.plate_temperature);
            let [nx, ny, _] = refinement.plate_cells();
            let stencils = &self.stencils;
            let at = |&(slot, index): &(u32, [u32; 3])| {
                let [x, y, z]: [&AxisStencil; 3] =
                    std::array::from_fn(|a| &stencils[a][index[a] as usize]);
                let mut sum = 0.0;
                for (cz, wz) in z.cells.iter().zip(z.weights) {
                    for (cy, wy) in y.cells.iter().zip(y.weights) {
                        let row = (*cz as usize * ny + *cy as usize) * nx;
                        let along = x.cells.iter().zip(x.weights);
                        let along = along.map(|(cx, wx)| wx * temperature[row + *cx as usize]);
                        sum += wz * wy * along.sum::<f64>();
                    }
                }
                (slot, sum)
            };
            let ghosts = self.ghosts.par_iter().with_min_len(GHOSTS_PER_TASK);
            ghosts.map(at).fill(conduction.layers_mut());
        }
    }

    /// Finds the stencils for a position of the window.
    fn find_stencils(&mut self, refinement: &Refinement, low: [i64; 3]) {
        let (ratio, points) = (refinement.ratio(), refinement.window_points());
        for axis in 0..3 {
            let (plate, covered) = (refinement.plate_cells()[axis], refinement.cells()[axis]);
            let first = low[axis] * ratio[axis] as i64;
            let cells = -self.margin..points[axis] as i64 + self.margin;
            let of_cell = |cell| stencil(first + cell, plate, ratio[axis], low[axis], covered);
            let stencils = &mut self.stencils[axis];
            stencils.clear();
            stencils.extend(cells.map(of_cell));
        }
    }

    fn find_ghosts(&mut self) {
        self.ghosts.clear();
        for (slot, cell) in &self.layers {
            let index = cell.map(|c| (c + self.margin) as u32);
            let is_covered = |a: usize| self.stencils[a][index[a] as usize].is_covered;
            if !(0..3).all(is_covered) {
                self.ghosts.push((*slot, index));
            }
        }
    }

    fn find_bonds(&mut self, body: &Body, refinement: &Refinement, family: &Family) {
        let mut ghost_in = vec![u32::MAX; family.slots()];
        for (number, (slot, _)) in (0..).zip(&self.ghosts) {
            ghost_in[*slot as usize] = number;
        }
        let size = refinement.window_points().map(|n| n as i64);
        let margin = self.margin;
        let mut by_cell: BTreeMap<[i64; 3], Vec<Crossing>> = BTreeMap::new();
        for point in 0..body.points.len() {
            let [nx, ny, _] = size.map(|n| n as usize);
            let cell = [point % nx, point / nx % ny, point / (nx * ny)].map(|c| c as i64);
            let is_near = |a: usize| cell[a] < margin || cell[a] >= size[a] - margin;
            if !(0..body.dimension).any(is_near) {
                continue;
            }
            let own = family.slot_of(point) as u32;
            let volume = body.points.volume[point];
            family.for_each_bond(point, |_, bond, other| {
                let Some((_, index)) = self.ghosts.get(ghost_in[other] as usize) else {
                    return;
                };
                let beside = |a: usize| self.stencils[a][index[a] as usize].beside;
                let bonds = by_cell.entry(std::array::from_fn(beside)).or_default();
                bonds.push(Crossing {
                    own,
                    other: other as u32,
                    coefficient: volume * coefficient(bond),
                });
            });
        }
        (self.receivers, self.exchange) = Exchange::collect(by_cell);
    }

    /// Adds the heat that leaves the window in a sub-step `dt` (s) to the plate; returns the heat that enters the window, J.
    pub(super) fn give(&mut self, world: &World, dt: f64, conduction: &Conduction) -> f64 {
        let Some((refinement, _)) = world.refinement(self.body) else {
            return 0.0;
        };
        let (field, factor) = conduction.linear_input();
        let cells = (0..self.receivers.len()).into_par_iter().with_min_len(16);
        let powers = cells.map(|cell| self.exchange.power(cell, field, factor));
        powers.fill(&mut self.powers);
        let mut given = world.write(self.given);
        let low = refinement.position().low;
        let mut heat = 0.0;
        for (cell, power) in self.receivers.iter().zip(&self.powers) {
            let at = std::array::from_fn(|a| (low[a] + cell[a]) as usize);
            given[refinement.plate_point(at)] -= dt * power;
            heat += dt * power;
        }
        heat
    }
}
