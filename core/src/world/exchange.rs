//! Flux that a surface exchanges with its surroundings, such as heat, as a function of the value of a field there, such as
//! the temperature.
//!
//! A boundary such as convection declares a law ([`Setup::exchange`](crate::Setup::exchange)): the flux into the body at a
//! value on the surface. The physics that owns the field evaluates all laws of its body
//! ([`World::facts`]) wherever it evaluates its rates, also within a step and in the search for a
//! steady state, so that the exchange is that of the result and not that of the state before.
//!
//! The surface consists of the cell faces that the surroundings can reach: not of planes of symmetry, of faces with a layer
//! that sets or mirrors the field, nor of faces that another body covers ([`FreeFaces`]). Units are those of heat.

use std::cell::{Cell, Ref, RefCell};
use std::fmt;
use std::rc::Rc;
use std::sync::Arc;

use nalgebra::Vector3;

use super::facts::{Fact, FactRule};
use super::surrounding_body::{NewSurroundingBody, SurroundingBody};
use super::{BodyIndex, World};
use crate::body::{Body, Face, SurfaceCell, SurfacePoints};
use crate::cell_list::CellList;
use crate::field::FieldIndex;

/// A flux into a body, and its derivative by the temperature of the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceFlux {
    /// W/m².
    pub flux: f64,
    /// W/(m² K), below zero where the exchange draws the surface to a temperature.
    pub slope: f64,
}

/// How much heat enters a body through its surface.
pub trait SurfaceLaw: fmt::Debug + Send + Sync {
    /// The flux through a cell face, by its place in [`Exchange::cells`], at a temperature of the surface (K).
    fn flux(&self, cell: usize, temperature: f64) -> SurfaceFlux;

    /// Bound of `-slope` at all places while no temperature exceeds `hottest` (K), W/(m² K): stable steps depend on it.
    fn stiffness(&self, hottest: f64) -> f64;

    /// Temperature of the surroundings (K) that `stiffness` does not know yet: a surface may become as warm.
    fn surroundings(&self) -> f64 {
        0.0
    }

    /// Whether the flux is linear in the temperature.
    fn is_linear(&self) -> bool {
        false
    }

    /// Whether a fluid that runs over the surface takes the heat: a face has one such fluid.
    fn is_film(&self) -> bool {
        false
    }
}

/// Where the temperature is that a law asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceDepth {
    /// At the cell face, half a cell away from the point.
    Face,
    /// At the point itself: through the plane of a 2D body, which is as warm at its surface as inside.
    Plane,
}

/// A law with the surface on which it acts.
#[derive(Debug)]
pub struct Exchange {
    /// Name of the coupler, for messages.
    pub label: String,
    /// The body.
    pub body: BodyIndex,
    /// The field whose value on the surface the law takes.
    pub(crate) field: FieldIndex,
    /// Where that value is.
    pub depth: SurfaceDepth,
    /// The body with which heat is exchanged, where the surroundings are one.
    pub around: Option<SurroundingBody>,
    pub(crate) law: Rc<RefCell<dyn SurfaceLaw>>,
    pub(crate) cells: RefCell<Vec<SurfaceCell>>,
    pub(crate) version: Cell<u64>,
    pub(crate) power: Cell<f64>,
    /// Value of the field at each cell face when last observed; empty before.
    pub(crate) values: RefCell<Vec<f64>>,
    /// See [`NewExchange`].
    pub(crate) unread: FactRule,
}

impl Fact for Rc<Exchange> {
    fn unread(&self) -> Option<FactRule> {
        Some(self.unread)
    }
}

/// An exchange that a boundary declares.
#[derive(Debug)]
pub struct NewExchange {
    /// Where the value is that the law takes.
    pub depth: SurfaceDepth,
    /// The law.
    pub law: Rc<RefCell<dyn SurfaceLaw>>,
    /// The cell faces on which it acts.
    pub cells: Vec<SurfaceCell>,
    /// The body with which heat is exchanged, where the surroundings are one.
    pub around: Option<NewSurroundingBody>,
    /// The mistake where no physics evaluates it.
    pub unread: FactRule,
}

impl Exchange {
    /// The law.
    pub fn law(&self) -> Ref<'_, dyn SurfaceLaw> {
        self.law.borrow()
    }

    /// The cell faces through which heat flows, in the order of their points.
    pub fn cells(&self) -> Ref<'_, [SurfaceCell]> {
        Ref::map(self.cells.borrow(), Vec::as_slice)
    }

    /// Replaces the cell faces, and finds the points of the body around them.
    pub fn set_cells(&self, world: &World, cells: Vec<SurfaceCell>) {
        if let Some(around) = &self.around {
            around.find_points(world, self.body, &cells);
        }
        *self.cells.borrow_mut() = cells;
        self.version.set(self.version.get() + 1);
    }

    /// Counts how often the cell faces were replaced.
    pub fn version(&self) -> u64 {
        self.version.get()
    }

    /// Heat that entered the body when last observed, W.
    pub fn power(&self) -> f64 {
        self.power.get()
    }

    /// Value of the field on the surface in front of a point in this direction when last observed.
    pub fn surface_value(&self, point: u32, face: Face) -> Option<f64> {
        let cells = self.cells.borrow();
        let first = cells.partition_point(|c| c.point < point);
        let of_point = cells[first..].iter().take_while(|c| c.point == point);
        let place = of_point.into_iter().position(|c| c.face == face)?;
        self.values.borrow().get(first + place).copied()
    }

    /// Tells the heat that enters the body, W, and the value of the field at each cell face; called by the physics before a
    /// state is logged.
    pub fn set_observed(&self, power: f64, values: Vec<f64>) {
        self.power.set(power);
        *self.values.borrow_mut() = values;
    }
}

/// Why the surroundings do not reach a cell face.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Covered {
    /// A plane of symmetry.
    Symmetry(Face),
    /// A layer that another boundary sets for a field.
    Layer {
        /// Its name.
        field: String,
        /// The face with the layer.
        face: Face,
    },
    /// Cells of another body lie against it.
    Body(String),
}

impl fmt::Display for Covered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Covered::Symmetry(face) => write!(f, "face `{}` is a plane of symmetry", face.name()),
            Covered::Layer { field, face } => {
                let face = face.name();
                write!(f, "another boundary sets the {field} at face `{face}`")
            }
            Covered::Body(body) => write!(f, "body `{body}` covers it"),
        }
    }
}

/// The cell faces of a body through which its surroundings can exchange a field.
#[derive(Debug, Default)]
pub struct FreeFaces {
    field: String,
    symmetry: Vec<Face>,
    layers: Vec<Face>,
    covers: Vec<Cover>,
}

/// Another body that lies against the body.
#[derive(Debug)]
struct Cover {
    body: BodyIndex,
    name: String,
    points: Arc<SurfacePoints>,
    cells: CellList,
    /// Largest edge of a cell, m.
    reach: f64,
}

impl FreeFaces {
    /// What covers faces of a body at the start of the run, where the field called `field` is exchanged.
    pub fn new(world: &World, body: BodyIndex, field: &str) -> FreeFaces {
        let this = world.body(body);
        let symmetry = world.symmetry(body);
        let layers = world.layers.iter();
        let layers = layers.filter(|l| l.body == body && l.field == field);
        let layers =
            layers.flat_map(|l| l.rules.borrow().iter().map(|r| r.face).collect::<Vec<_>>());
        let layers = layers.filter(|face| !symmetry.contains(face)).collect();
        let others = (0..world.bodies().len()).filter(|other| *other != body);
        // a window of finer points lies inside its plate
        let others = others.filter(|other| !world.are_refined(body, *other));
        let covers = others.filter_map(|other| Cover::new(this, other, world));
        FreeFaces {
            field: field.into(),
            symmetry,
            layers,
            covers: covers.collect(),
        }
    }

    /// Lets a body that is the surroundings cover nothing.
    #[must_use]
    pub fn reached_from(mut self, around: Option<&SurroundingBody>) -> FreeFaces {
        self.covers
            .retain(|cover| around.is_none_or(|around| around.body != cover.body));
        self
    }

    /// The part of a cell face that is free, from 0 to 1, and what covers the rest.
    fn free(&self, world: &World, body: &Body, cell: &SurfaceCell) -> (f64, Option<Covered>) {
        let point = cell.point as usize;
        let face = cell.face;
        let lies_in = |faces: &[Face]| faces.contains(&face) && body.lies_in_face(point, face);
        if lies_in(&self.symmetry) {
            return (0.0, Some(Covered::Symmetry(face)));
        }
        if lies_in(&self.layers) {
            let field = self.field.clone();
            return (0.0, Some(Covered::Layer { field, face }));
        }
        let centre = body.face_centre(point, face);
        let mut free = 1.0;
        let mut by = None;
        for cover in &self.covers {
            let covered = cover.fraction(world, body, cell, centre);
            if covered > 0.0 {
                free -= covered;
                by = Some(Covered::Body(cover.name.clone()));
            }
        }
        // rounding of overlaps
        let free = if free < 1e-9 { 0.0 } else { free };
        (free, by)
    }

    /// The free part of a cell face, if any, and what covers the rest.
    pub fn free_cell(
        &self,
        world: &World,
        body: &Body,
        cell: &SurfaceCell,
    ) -> (Option<SurfaceCell>, Option<Covered>) {
        let (fraction, by) = self.free(world, body, cell);
        let free = (fraction > 0.0).then_some(SurfaceCell {
            area: fraction * cell.area,
            face_area: fraction * cell.face_area,
            ..*cell
        });
        (free, by)
    }
}

impl Cover {
    fn new(this: &Body, body: BodyIndex, world: &World) -> Option<Cover> {
        let other = world.body(body);
        let ((low, high), (other_low, other_high)) = (this.bounds(), other.bounds());
        let gap = 0.5 * this.finest_spacing().min(other.finest_spacing());
        let touches = |a: usize| low[a] <= other_high[a] + gap && other_low[a] <= high[a] + gap;
        if other.dimension != this.dimension || !(0..this.dimension).all(touches) {
            return None;
        }
        let points = world.surface_points(body);
        let edge = |widths: &[f64; 3]| {
            widths[..other.dimension]
                .iter()
                .copied()
                .fold(0.0, f64::max)
        };
        let reaches: Vec<f64> = points.width.iter().map(edge).collect();
        Some(Cover {
            body,
            name: other.name.clone(),
            cells: CellList::new(&points.position, &reaches),
            reach: reaches.iter().copied().fold(0.0, f64::max),
            points,
        })
    }

    /// The fraction of a cell face that cells of the other body with material cover.
    fn fraction(&self, world: &World, body: &Body, cell: &SurfaceCell, at: Vector3<f64>) -> f64 {
        let other = &self.points;
        let own = cell.point as usize;
        let spacing = body.width(own, cell.face.axis());
        let (axis, outward) = (cell.face.axis(), cell.face.normal()[cell.face.axis()]);
        let opposite = cell.face.opposite();
        let mut covered = 0.0;
        let farthest = cell.contact_distance([spacing, self.reach], true);
        let edges = (0..body.dimension).map(|a| body.width(own, a));
        let reach = self.reach + edges.fold(farthest, f64::max);
        self.cells.visit_near(&at, reach, |point| {
            let place = &other.position[point];
            let distance_of = |face: Face| other.distance[point][face as usize];
            // from the face to that of the other cell
            let gap = (place - at)[axis] * outward - distance_of(opposite);
            let spacings = [spacing, other.width[point][axis]];
            let distance = |is_step| cell.contact_distance(spacings, is_step);
            let is_beside = gap.abs() <= distance(false)
                || gap.abs() <= distance(true) && other.is_step[point][opposite as usize];
            // where others grow, the run has one process
            let number = other.number[point] as usize;
            if !is_beside || !world.has_material(self.body, number) {
                return;
            }
            let along = (0..body.dimension).filter(|a| *a != axis).map(|a| {
                let [lower, upper] = [Face::ALL[2 * a], Face::ALL[2 * a + 1]];
                let high =
                    (at[a] + body.face_distance(own, upper)).min(place[a] + distance_of(upper));
                let low =
                    (at[a] - body.face_distance(own, lower)).max(place[a] - distance_of(lower));
                (high - low).max(0.0) / body.width(own, a)
            });
            covered += along.product::<f64>();
        });
        covered.min(1.0)
    }
}
