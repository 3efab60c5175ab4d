//! Heat of a plate and of a window of finer points that moves over it ([`perimelt_core::world::refinement`]).
//!
//! Both bodies conduct with their own families. Layer points of the window that lie in the plate have the temperature of
//! the plate there, interpolated between its cells by the parabola with the same means:
//!
//! ```text
//! T(x) = T_0 + (T_+ - T_-) x / 2 + (T_+ - 2 T_0 + T_-) (x^2 - 1/12 + d^2/3) / 2    x, half width d: in cells of the plate
//! ```
//!
//! along each axis, with the temperatures at the start of the step of the plate. The heat that the bonds with these layer
//! points carry into the window, summed over its sub-steps, is taken from the cell of the plate beside the window that is
//! nearest to the layer point. In return, the heat that the bonds of the plate carry across the same faces is taken
//! back, in the same cells. Heat of the window and of the cells of the plate that it does not cover is thereby
//! conserved to rounding, and fluxes are those of the fine points. Covered cells take the mean enthalpy
//! of the points of the window in them at the end of each step.
//!
//! Bonds of the window with layer points that mirror it at a face of the plate are those of any body. First order in the step of the
//! plate, because the temperatures behind the faces of the window stay during that step.

use std::collections::BTreeMap;
use std::sync::Arc;

use perimelt_core::field::Key;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::refinement::{Level, Refinement, mean};
use perimelt_core::{
    Access, Body, Description, Face, Family, Read, Setup, SetupError, World, Write, keys,
};
use rayon::prelude::*;

use super::conduction::{Conduction, coefficient};
use super::keys::{Form, Surfaces, Thermal, ThermalSolver};

/// Fraction of its stable step that the plate takes: layer points of the window are closer to cells of the plate than their
/// neighbours are.
const STEP_FRACTION: f64 = 0.5;

/// Layer points that a thread takes at a time.
const GHOSTS_PER_TASK: usize = 1024;

/// Heat that the window gives to cells of the plate in a step of the plate.
const HEAT_OF_WINDOW: Key<f64> = Key::new(
    "heat_of_window",
    "J",
    "heat given by the points of a window of finer points",
);

/// What the heat of a plate or a window has, beyond that of another body.
#[derive(Debug)]
pub(super) enum Refined {
    Window(Box<Window>),
    Plate(Box<Plate>),
}

/// The side of the window.
#[derive(Debug)]
pub(super) struct Window {
    body: BodyIndex,
    plate_temperature: Read<f64>,
    given: Write<f64>,
    /// Layers of the window beyond its faces.
    margin: i64,
    /// All layer points with their cells.
    layers: Vec<(u32, [i64; 3])>,
    /// By axis and cell, from the outermost layer on.
    places: [Vec<Place>; 3],
    /// Layer points in the plate, with their places along each axis.
    ghosts: Vec<(u32, [u32; 3])>,
    /// Cells beside the window, counted from its lowest cell.
    receivers: Vec<[i64; 3]>,
    exchange: Exchange,
    /// W.
    powers: Vec<f64>,
    /// Position of the window and its faces that lie on faces of the plate, as known.
    at: Option<([i64; 3], [bool; 6])>,
    /// Time level of the plate that the layer points have, s.
    seen: Option<f64>,
}

/// A layer of cells of the window along an axis, mirrored at the faces of the plate.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Cells of the plate between which to interpolate.
    cells: [u32; 3],
    weights: [f64; 3],
    /// The nearest cell of the plate beside the window or below it, counted from the lowest cell of the window.
    beside: i64,
    /// Whether the window covers it.
    is_covered: bool,
}

/// The side of the plate.
#[derive(Debug)]
pub(super) struct Plate {
    body: BodyIndex,
    taken: Read<f64>,
    /// Of the cells that are not covered, else 0, m³.
    volume: Arc<[f64]>,
    /// Points beside the window.
    receivers: Vec<u32>,
    exchange: Exchange,
    at: Option<[i64; 3]>,
}

/// Bonds across the faces of the window, by the cell of the plate to which their heat belongs.
#[derive(Debug, Default)]
struct Exchange {
    /// Where the bonds of each cell start, and their number at the end.
    start: Vec<usize>,
    bonds: Vec<Crossing>,
}

/// A bond across a face of the window, by the slots of its ends.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    own: u32,
    other: u32,
    /// Heat that enters the point in the slot `own`, over conductivity and difference of temperatures, m.
    coefficient: f64,
}

impl Exchange {
    fn collect<K: Ord>(by_cell: BTreeMap<K, Vec<Crossing>>) -> (Vec<K>, Exchange) {
        let mut exchange = Exchange {
            start: vec![0],
            bonds: Vec::new(),
        };
        let mut cells = Vec::new();
        for (cell, bonds) in by_cell {
            cells.push(cell);
            exchange.bonds.extend(bonds);
            exchange.start.push(exchange.bonds.len());
        }
        (cells, exchange)
    }

    /// Heat that the bonds of a cell carry to their own points, W; `field` and `factor` as of
    /// [`Conduction::linear_input`].
    fn power(&self, cell: usize, (field, factor): (&[f64], f64)) -> f64 {
        let bonds = self.bonds[self.start[cell]..self.start[cell + 1]].iter();
        let heat = |b: &Crossing| b.coefficient * (field[b.other as usize] - field[b.own as usize]);
        factor * bonds.map(heat).sum::<f64>()
    }
}

/// Cells of the plate and their weights for a cell of the window along an axis with a plate of `cells` cells of `ratio` points; `at`:
/// its number on the plate, which may lie beyond it.
fn place(at: i64, (cells, ratio): (usize, usize), (low, covered): (i64, usize)) -> Place {
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
    Place {
        cells: [-1, 0, 1].map(|step| mirrored(cell + step, cells as i64) as u32),
        weights,
        beside: relative.clamp(-1, covered as i64),
        is_covered: (0..covered as i64).contains(&relative),
    }
}

impl Window {
    fn new(
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
            places: Default::default(),
            ghosts: Vec::new(),
            receivers: Vec::new(),
            exchange: Exchange::default(),
            powers: Vec::new(),
            at: None,
            seen: None,
        })
    }

    /// Takes the position of the window and the temperatures of the plate around it.
    fn follow(&mut self, world: &World, family: &Family, conduction: &mut Conduction) {
        let Some((refinement, _)) = world.refinement(self.body) else {
            return;
        };
        let low = refinement.position().low;
        if self.at.is_none_or(|(at, _)| at != low) {
            self.take_position(refinement, low);
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
                self.find_bonds((world.body(self.body), refinement), family);
            }
            (self.at, self.seen) = (Some((low, touches)), None);
        }
        let time = world.time_of(self.plate_temperature);
        if self.seen != Some(time) {
            self.seen = Some(time);
            let temperature: &[f64] = &world.read(self.plate_temperature);
            let [nx, ny, _] = refinement.plate_cells();
            let places = &self.places;
            let at = |&(slot, place): &(u32, [u32; 3])| {
                let [x, y, z]: [&Place; 3] = std::array::from_fn(|a| &places[a][place[a] as usize]);
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
            ghosts.map(at).collect_into_vec(conduction.layers_mut());
        }
    }

    fn take_position(&mut self, refinement: &Refinement, low: [i64; 3]) {
        let (ratio, points) = (refinement.ratio(), refinement.window_points());
        for axis in 0..3 {
            let plate = (refinement.plate_cells()[axis], ratio[axis]);
            let window = (low[axis], refinement.cells()[axis]);
            let first = low[axis] * ratio[axis] as i64;
            let cells = -self.margin..points[axis] as i64 + self.margin;
            let places = &mut self.places[axis];
            places.clear();
            places.extend(cells.map(|cell| place(first + cell, plate, window)));
        }
    }

    fn find_ghosts(&mut self) {
        self.ghosts.clear();
        for (slot, cell) in &self.layers {
            let place = cell.map(|c| (c + self.margin) as u32);
            let is_covered = |a: usize| self.places[a][place[a] as usize].is_covered;
            if !(0..3).all(is_covered) {
                self.ghosts.push((*slot, place));
            }
        }
    }

    fn find_bonds(&mut self, (body, refinement): (&Body, &Refinement), family: &Family) {
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
                let Some((_, place)) = self.ghosts.get(ghost_in[other] as usize) else {
                    return;
                };
                let beside = |a: usize| self.places[a][place[a] as usize].beside;
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

    /// Gives the plate the heat that leaves the window in a sub-step `dt` (s); the heat that enters, J.
    fn give(&mut self, world: &World, dt: f64, conduction: &Conduction) -> f64 {
        let Some((refinement, _)) = world.refinement(self.body) else {
            return 0.0;
        };
        let input = conduction.linear_input();
        let cells = (0..self.receivers.len()).into_par_iter().with_min_len(16);
        let powers = cells.map(|cell| self.exchange.power(cell, input));
        powers.collect_into_vec(&mut self.powers);
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

impl Plate {
    /// Takes the position of the window.
    fn follow(&mut self, world: &World, family: &Family) {
        let Some((refinement, _)) = world.refinement(self.body) else {
            return;
        };
        let low = refinement.position().low;
        if self.at == Some(low) {
            return;
        }
        self.at = Some(low);
        let body = world.body(self.body);
        self.volume = refinement.uncovered(&body.points.volume).into();
        let spacing = body.finest_spacing();
        let reach = (family.spec().horizon.of(spacing) / spacing).ceil() as i64 + 1;
        let covered = refinement.cells();
        let near = |a: usize| {
            let to = low[a] + covered[a] as i64 + reach;
            (low[a] - reach).max(0) as usize..to.min(refinement.plate_cells()[a] as i64) as usize
        };
        let point_in = family.points_of_slots();
        let mut by_cell: BTreeMap<u32, Vec<Crossing>> = BTreeMap::new();
        for z in near(2) {
            for y in near(1) {
                for x in near(0) {
                    let cell = [x, y, z];
                    if refinement.covers(cell) {
                        continue;
                    }
                    let point = refinement.plate_point(cell);
                    let beside = std::array::from_fn(|a| {
                        (cell[a] as i64).clamp(low[a] - 1, low[a] + covered[a] as i64) as usize
                    });
                    let receiver = refinement.plate_point(beside) as u32;
                    let own = family.slot_of(point) as u32;
                    family.for_each_bond(point, |_, bond, other| {
                        let end = point_in[other] as usize;
                        if refinement.covers(refinement.plate_cell(end)) {
                            by_cell.entry(receiver).or_default().push(Crossing {
                                own,
                                other: other as u32,
                                coefficient: body.points.volume[point] * coefficient(bond),
                            });
                        }
                    });
                }
            }
        }
        (self.receivers, self.exchange) = Exchange::collect(by_cell);
    }

    /// Takes back the heat of bonds with covered cells, and takes up that of the window in a step `dt` (s), which is
    /// returned, J.
    fn take(&self, world: &World, dt: f64, conduction: &mut Conduction) -> f64 {
        let volume = &world.body(self.body).points.volume;
        for (cell, &point) in self.receivers.iter().enumerate() {
            let power = self.exchange.power(cell, conduction.linear_input());
            conduction.rate[point as usize][0] -= power / volume[point as usize];
        }
        let mut heat = 0.0;
        let taken = world.read(self.taken);
        for (point, &amount) in taken.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            conduction.rate[point][0] += amount / (dt * volume[point]);
            heat += amount;
        }
        heat
    }
}

impl Refined {
    pub(super) fn prepare(
        thermal: &Thermal,
        setup: &mut Setup<'_>,
        (body, description): (BodyIndex, Description),
        (family, heated): (&Family, &[Face]),
    ) -> Result<Option<Refined>, SetupError> {
        let Some((refinement, level)) = setup.world().refinement(body) else {
            return Ok(None);
        };
        let (plate, ratio) = (refinement.plate(), refinement.ratio()[0]);
        thermal.check_refined(description)?;
        if setup.world().is_growing(body) {
            let message = "material is deposited on a body with a window of finer points";
            return Err(SetupError::value(
                "body",
                message,
                "a body without `deposit` and `cut`",
            ));
        }
        if level == Level::Plate {
            return Ok(Some(Refined::Plate(Box::new(Plate {
                body,
                taken: setup.take(body, &HEAT_OF_WINDOW)?,
                volume: Arc::new([]),
                receivers: Vec::new(),
                exchange: Exchange::default(),
                at: None,
            }))));
        }
        if let Some(face) = heated.first() {
            let message = format!(
                "a boundary prescribes the temperature of face `{}` of a window that moves",
                face.name()
            );
            let expected = "the boundary on the body with the coarser points, away from the window";
            return Err(SetupError::value("body", message, expected));
        }
        if thermal.surfaces == Surfaces::Bare {
            let message = "a window goes on behind its faces";
            return Err(SetupError::value(
                "surfaces",
                message,
                "`surfaces = \"auto\"`",
            ));
        }
        let window = Window::new(setup, body, plate, family)?;
        if window.margin > 2 * ratio as i64 {
            let message = format!(
                "the horizon reaches {} points beyond the window, more than two cells of the body around it",
                window.margin
            );
            return Err(SetupError::value("horizon", message, "a smaller horizon"));
        }
        Ok(Some(Refined::Window(Box::new(window))))
    }

    /// Takes up where the window is and, for the window, the temperatures around it.
    pub(super) fn follow(&mut self, world: &World, family: &Family, conduction: &mut Conduction) {
        match self {
            Refined::Window(window) => window.follow(world, family, conduction),
            Refined::Plate(plate) => plate.follow(world, family),
        }
    }

    /// Exchanges the heat of a step `dt` (s) after the flow was found; the heat that enters the body, J.
    pub(super) fn exchange(&mut self, world: &World, dt: f64, conduction: &mut Conduction) -> f64 {
        match self {
            Refined::Window(window) => window.give(world, dt, conduction),
            Refined::Plate(plate) => plate.take(world, dt, conduction),
        }
    }

    /// Volumes of the points whose heat counts, where not all do, m³.
    pub(super) fn uncovered(&self) -> Option<Arc<[f64]>> {
        match self {
            Refined::Window(_) => None,
            Refined::Plate(plate) => Some(plate.volume.clone()),
        }
    }

    /// Fraction of its stable step that the body takes.
    pub(super) fn step_fraction(&self) -> f64 {
        match self {
            Refined::Window(_) => 1.0,
            Refined::Plate(_) => STEP_FRACTION,
        }
    }

    /// Gives covered points of the plate the mean enthalpy (J/m³) of the window, and its temperature (K).
    pub(super) fn cover(
        &self,
        world: &World,
        (temperature, enthalpy): (Write<f64>, Write<f64>),
        curves: &[EnthalpyCurve],
    ) {
        let Refined::Plate(plate) = self else {
            return;
        };
        let Some((refinement, _)) = world.refinement(plate.body) else {
            return;
        };
        let window = world.read(refinement.window_enthalpy());
        let mut temperature = world.write(temperature);
        let mut enthalpy = world.write(enthalpy);
        refinement.for_each_covered(|point, inside| {
            enthalpy[point] = mean(&window, inside);
            temperature[point] = curves[0].temperature(enthalpy[point]);
        });
    }
}

impl Thermal {
    /// Refuses keys that do not fit a body that has a window or is one.
    fn check_refined(&self, description: Description) -> Result<(), SetupError> {
        let refuse = |key: &str, message: &str, expected: &str| {
            Err(SetupError::value(key, message, expected))
        };
        if self.solver != ThermalSolver::Explicit {
            let message = "a window of finer points and the body around it are advanced by explicit steps only";
            return refuse("solver", message, "`solver = \"explicit\"`");
        }
        if self.form != Form::Bonds {
            let message = "heat crosses the faces of a window of finer points by bonds only";
            return refuse("form", message, "`form = \"bonds\"`");
        }
        if description != Description::TotalLagrangian {
            let message = "a window of finer points needs a body of matter at rest";
            return refuse("body", message, "a body without `fluid`");
        }
        Ok(())
    }
}
