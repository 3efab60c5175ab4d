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
//! Bonds of the window with layer points that mirror it at a face of the plate are those of any body. The coupling is first order
//! in the step of the plate, because the temperatures behind the faces of the window are constant during that step.

mod plate;
mod window;

use std::collections::BTreeMap;
use std::sync::Arc;

use perimelt_core::body::Sizes;
use perimelt_core::field::Key;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::world::refinement::{Level, mean};
use perimelt_core::{Family, FamilyHandle, Setup, SetupError, World, Write};

use super::conduction::Conduction;
use super::prepare::ConductionDomain;
use plate::Plate;
use window::Window;

/// Fraction of its stable step that the plate takes: layer points of the window are closer to cells of the plate than their
/// neighbours are.
const STEP_FRACTION: f64 = 0.5;

/// Heat that the window transfers to cells of the plate in a step of the plate.
const HEAT_OF_WINDOW: Key<f64> = Key::new(
    "heat_of_window",
    "J",
    "heat given by the points of a window of finer points",
);

/// Coupling of a coarse body and its refined window.
#[derive(Debug)]
pub(super) enum Refined {
    Window(Box<Window>),
    Plate(Box<Plate>),
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

    /// Heat that the bonds of a cell carry to their own points, W, with the `field` and `factor` of
    /// [`Conduction::linear_input`].
    fn power(&self, cell: usize, field: &[f64], factor: f64) -> f64 {
        let bonds = self.bonds[self.start[cell]..self.start[cell + 1]].iter();
        let heat = |b: &Crossing| b.coefficient * (field[b.other as usize] - field[b.own as usize]);
        factor * bonds.map(heat).sum::<f64>()
    }
}

impl Refined {
    pub(super) fn prepare(
        setup: &mut Setup<'_>,
        domain: &ConductionDomain,
        family: FamilyHandle,
    ) -> Result<Option<Refined>, SetupError> {
        let body = domain.body;
        let Some((refinement, level)) = setup.world().refinement(body) else {
            return Ok(None);
        };
        let (plate, ratio) = (refinement.plate(), refinement.ratio()[0]);
        if level == Level::Plate {
            return Ok(Some(Refined::Plate(Box::new(Plate {
                body,
                taken: setup.take(body, &HEAT_OF_WINDOW)?,
                volume: Arc::default(),
                receivers: Vec::new(),
                exchange: Exchange::default(),
                at: None,
            }))));
        }
        if let Some(face) = domain.heated.first() {
            let message = format!(
                "a boundary prescribes the temperature of face `{}` of a window that moves",
                face.name()
            );
            let expected = "the boundary on the body with the coarser points, away from the window";
            return Err(SetupError::value("body", message, expected));
        }
        let family = setup.world().family(family);
        let window = Window::new(setup, body, plate, &family)?;
        if window.margin > 2 * ratio as i64 {
            let message = format!(
                "the horizon reaches {} points beyond the window, more than two cells of the body around it",
                window.margin
            );
            return Err(SetupError::value("horizon", message, "a smaller horizon"));
        }
        Ok(Some(Refined::Window(Box::new(window))))
    }

    /// Updates the coupling for the position of the window and the temperatures around it.
    pub(super) fn follow(&mut self, world: &World, family: &Family, conduction: &mut Conduction) {
        match self {
            Refined::Window(window) => window.follow(world, family, conduction),
            Refined::Plate(plate) => plate.follow(world, family),
        }
    }

    /// Exchanges the heat of a step `dt` (s) after the flow was found; returns the heat that enters the body, J.
    pub(super) fn exchange(&mut self, world: &World, dt: f64, conduction: &mut Conduction) -> f64 {
        match self {
            Refined::Window(window) => window.give(world, dt, conduction),
            Refined::Plate(plate) => plate.take(world, dt, conduction),
        }
    }

    /// Volumes of the points, zero where the window covers them, m³; `None` where all points count.
    pub(super) fn uncovered(&self) -> Option<Arc<Sizes>> {
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

    /// Sets covered points of the plate to the mean enthalpy (J/m³) of the window, and the temperature (K) at it.
    pub(super) fn cover(
        &self,
        world: &World,
        temperature: Write<f64>,
        enthalpy: Write<f64>,
        curves: &[EnthalpyCurve],
    ) {
        let Refined::Plate(plate) = self else {
            return;
        };
        let Some((refinement, _)) = world.refinement(plate.body) else {
            return;
        };
        let window = world.read(refinement.window_amount());
        let mut temperature = world.write(temperature);
        let mut enthalpy = world.write(enthalpy);
        refinement.for_each_covered(|point, inside| {
            enthalpy[point] = mean(&window, inside);
            temperature[point] = curves[0].temperature(enthalpy[point]);
        });
    }
}
