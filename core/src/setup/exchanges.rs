//! Exchanges through surfaces: which boundary declares them, and which physics evaluates them.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use crate::body::{Face, SurfaceCell};
use crate::error::SetupError;
use crate::field::Key;
use crate::text::{number, position};
use crate::world::BodyIndex;
use crate::world::exchange::{Covered, Exchange, FreeFaces, NewExchange, SurfaceDepth};
use crate::world::surrounding_body::SurroundingBody;

use super::{Access, Setup, Warning};

impl Setup<'_> {
    /// Declares that cells of a body have a flux by a law of the value of a field, which the calling coupler keeps up to date.
    /// The physics that owns the field evaluates it. What the surroundings cannot reach is taken away from the cells before
    /// the first step ([`FreeFaces`]).
    ///
    /// # Errors
    /// When the field is known with another type.
    pub fn exchange(
        &mut self,
        body: BodyIndex,
        key: &Key<f64>,
        new: NewExchange,
    ) -> Result<Rc<Exchange>, SetupError> {
        let field = self.declare(body, key, Access::Layer)?;
        let NewExchange {
            depth,
            law,
            cells,
            around,
            unread,
        } = new;
        let exchange = Rc::new(Exchange {
            label: self.label(self.current).to_string(),
            body,
            field,
            depth,
            around: around.map(SurroundingBody::new),
            law,
            cells: RefCell::new(cells),
            version: Cell::default(),
            power: Cell::default(),
            values: RefCell::default(),
            unread,
        });
        self.publish(body, exchange.clone())?;
        Ok(exchange)
    }

    /// Restricts exchanges to what the surroundings can reach, and tells of faces that are left out and of faces on which
    /// one kind of boundary acts twice.
    pub(super) fn free_exchanges(&mut self) -> Vec<(usize, SetupError)> {
        let mut mistakes = Vec::new();
        let mut by_kind: BTreeMap<(String, BodyIndex), BTreeSet<(u32, Face)>> = BTreeMap::new();
        let mut twice = BTreeSet::new();
        let declared = self.world.facts.all::<Rc<Exchange>>();
        let declared: Vec<(usize, Rc<Exchange>)> = declared
            .map(|(plugin, exchange)| (plugin, exchange.clone()))
            .collect();
        for (plugin, exchange) in declared {
            if exchange.depth == SurfaceDepth::Plane {
                continue;
            }
            let (cells, covered) = self.free_cells(&exchange);
            let reducer = self.world.reducer(exchange.body);
            let is_free = cells
                .iter()
                .any(|cell| (cell.point as usize) < reducer.owned());
            if !reducer.any(is_free) {
                let reasons: Vec<String> = covered.keys().map(ToString::to_string).collect();
                let message = format!("the boundary has no free surface: {}", reasons.join("; "));
                let expected = "faces that the surroundings can reach";
                mistakes.push((plugin, SetupError::value("faces", message, expected)));
                continue;
            }
            let kind = match exchange.law().is_film() {
                true => "film",
                false => exchange.label.split(' ').next().unwrap_or_default(),
            };
            let known = by_kind
                .entry((kind.to_string(), exchange.body))
                .or_default();
            for cell in &cells {
                if !known.insert((cell.point, cell.face)) {
                    twice.insert(plugin);
                }
            }
            if !covered.is_empty() {
                let left_out: Vec<String> = covered
                    .iter()
                    .map(|(reason, area)| format!("{} m² because {reason}", number(*area, 3)))
                    .collect();
                self.note(plugin, format!("leaves out {}", left_out.join("; ")));
            }
            exchange.set_cells(self.world, cells);
            if let Some(error) = self.without_surroundings(&exchange) {
                mistakes.push((plugin, error));
            }
        }
        for plugin in twice {
            let message = "acts on faces on which another boundary of its kind acts (`convection` and `water_jet` are of one kind): \
                           both exchange heat there";
            let plugin = self.label(plugin).to_string();
            self.warnings.push(Warning {
                plugin,
                message: message.into(),
            });
        }
        mistakes
    }

    /// The mistake of a surface with a part that is far from the body with which it exchanges.
    fn without_surroundings(&self, exchange: &Exchange) -> Option<SetupError> {
        let around = exchange.around.as_ref()?;
        let cells = exchange.cells();
        let lonely = (0..cells.len()).find(|&cell| around.near().of(cell).0.is_empty())?;
        let at = self
            .body(exchange.body)
            .points
            .position
            .at(cells[lonely].point as usize);
        let message = format!(
            "no point of body `{}` lies within {} m of the point at {} m, which has a free face `{}`",
            self.body(around.body).name,
            number(around.radius, 4),
            position(at),
            cells[lonely].face.name()
        );
        let expected = "`faces` or a `region` that the body surrounds, or a longer `horizon`";
        Some(SetupError::value("ambient", message, expected))
    }

    /// The free cell faces of an exchange, and the areas that are covered.
    fn free_cells(&self, exchange: &Exchange) -> (Vec<SurfaceCell>, BTreeMap<Covered, f64>) {
        let body = self.body(exchange.body);
        let field = &self.world.fields.field(exchange.field).name;
        let free = FreeFaces::new(self.world, exchange.body, field);
        let free = free.reached_from(exchange.around.as_ref());
        let mut covered: BTreeMap<Covered, f64> = BTreeMap::new();
        let mut cells = Vec::new();
        for cell in exchange.cells().iter() {
            let (part, by) = free.free_cell(self.world, body, cell);
            if let Some(by) = by {
                *covered.entry(by).or_default() += cell.area - part.map_or(0.0, |p| p.area);
            }
            cells.extend(part);
        }
        (cells, covered)
    }
}
