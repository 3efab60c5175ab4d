//! The world: bodies, their fields, and how fields continue behind faces.

pub mod activity;
pub mod changes;
pub mod configuration;
mod division;
pub mod exchange;
pub mod facts;
pub mod families;
mod materials;
pub mod refinement;
mod surface_depths;
pub mod surrounding_body;

use std::cell::{Ref, RefCell, RefMut};
use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;

use crate::body::{Body, Face, Horizon, Region, SurfacePoints};
use crate::error::{Problem, SetupError};
use crate::family::{LayerRule, Traction};
use crate::field::{FieldIndex, Fields, Read, ReadIfProvided, Value, Write};
use crate::solver::reduce::weighted_sum;
use crate::surface_tension::SurfaceTension;
use crate::transport::Processes;

use changes::Changes;
use configuration::Configurations;
use division::Division;
use exchange::{Exchange, SurfaceDepth};
use facts::{Fact, FactRule, Facts};
use families::WorldFamily;
pub use materials::PhaseChange;
use refinement::Refinement;
pub use surface_depths::SurfaceDepths;

/// Index of a body.
pub type BodyIndex = usize;

/// Mirrored layers of one field of one body.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    pub(crate) body: BodyIndex,
    pub(crate) field: String,
    pub(crate) prescribed: Vec<Face>,
    pub(crate) rules: RefCell<Vec<LayerRule>>,
}

/// Permission of a boundary to set the values of one layer.
#[derive(Clone, Copy, Debug)]
pub struct LayerHandle {
    pub(crate) layers: usize,
    pub(crate) face: Face,
}

/// Permission of a physics to read the layers of a field that it owns.
#[derive(Clone, Copy, Debug)]
pub struct LayersHandle(pub(crate) usize);

/// The points of a body move together.
#[derive(Clone, Copy, Debug)]
pub struct Rigid;

impl Fact for Rigid {}

/// The longest horizon of the families of a physics: processes that share a body need points around their own as far as these reach.
#[derive(Clone, Copy, Debug)]
pub struct FamilyReach(pub Horizon);

impl Fact for FamilyReach {}

/// Loads of the surface of a body act on the faces of its cells: the force per volume of a point comes with its first moment
/// about the point ([`BODY_FORCE_MOMENT`](crate::keys::BODY_FORCE_MOMENT)).
#[derive(Clone, Copy, Debug)]
pub struct LoadedFaces;

impl Fact for LoadedFaces {}

/// A body continues as its mirror image behind a face, so that measurements count both halves.
#[derive(Clone, Copy, Debug)]
pub struct SymmetryPlane(pub Face);

impl Fact for SymmetryPlane {}

/// Where a wall of a body is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallPlace {
    /// At a face of its box.
    Face(Face),
    /// At the surface of another body.
    Body(BodyIndex),
}

/// The angle at which the interface of two fluids of a body meets a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactAngle {
    /// The wall.
    pub wall: WallPlace,
    /// In the first fluid, degrees.
    pub angle: f64,
}

impl Fact for ContactAngle {
    fn unread(&self) -> Option<FactRule> {
        Some(FactRule {
            key: "contact_angle",
            message: "no interface with a tension meets the walls of body `{body}`",
            expected: "two fluids with a surface tension (`fluids` of the physics `fluid`), or no `contact_angle`",
        })
    }
}

/// Two fluids flow through the points of a body.
#[derive(Clone, Debug)]
pub struct TwoFluids {
    /// Names of their materials.
    pub materials: Vec<String>,
}

impl Fact for TwoFluids {}

impl TwoFluids {
    /// Indices of their materials; `None` where the names are a mistake, which the fluid reports.
    pub fn indices(&self, body: &Body) -> Option<[u16; 2]> {
        let index = |name: &String| body.materials.iter().position(|m| m.name() == name);
        match &self.materials[..] {
            [first, second] => Some([index(first)? as u16, index(second)? as u16]),
            _ => None,
        }
    }
}

/// The fluids of the layer between two fluids of a body conduct heat side by side: something heats the interface or takes heat from it, such as a beam
/// or evaporation, so that the heat must reach them from inside of the layer, or the first one is metal that melts, which conducts along its surface much better
/// than the gas.
#[derive(Clone, Copy, Debug)]
pub struct LayerSideBySide;

impl Fact for LayerSideBySide {}

/// The surface tension of a fluid along a flat face, which drives it where the temperature changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceTension {
    /// The face, along which the fluid slips.
    pub face: Face,
    /// How it depends on the temperature.
    pub tension: SurfaceTension,
}

impl Fact for FaceTension {
    fn unread(&self) -> Option<FactRule> {
        Some(FactRule {
            key: "tension",
            message: "nothing that flows along the walls of body `{body}` has a surface tension that depends on its temperature",
            expected: "one fluid with `state.incompressible` and a `thermal` on the body, or no `tension`",
        })
    }
}

/// A body whose points are walls for the material of the body of which this is a fact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// The body that is the wall.
    pub other: BodyIndex,
    /// Whether the material slips along the wall; else it sticks.
    pub slip: bool,
    /// The mistake where no physics takes it into account.
    pub unread: FactRule,
}

impl Fact for Wall {
    fn unread(&self) -> Option<FactRule> {
        Some(self.unread)
    }
}

/// Pairs of points of a body whose bond broke, for whoever else has bonds between them.
#[derive(Debug, Default)]
pub struct BrokenPairs {
    /// In the order in which they broke.
    pub pairs: Vec<[u32; 2]>,
    /// How often the list was replaced, because a state was restored: start again with it then.
    pub replaced: usize,
    breaker: Option<Breaker>,
}

/// A plugin that breaks bonds of a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Breaker {
    /// Its position in the set-up.
    pub plugin: usize,
    /// Whether it only adds to the list, so that others may do so, too.
    pub is_shared: bool,
}

/// Permission of a plugin to break the bonds of a body.
#[derive(Debug)]
pub struct BondBreaker {
    body: BodyIndex,
}

/// Bodies, fields, layers: everything that plugins act on.
#[derive(Debug, Default)]
pub struct World {
    pub(crate) bodies: Vec<Body>,
    pub(crate) fields: Fields,
    pub(crate) layers: Vec<Layers>,
    pub(crate) provided: Vec<bool>,
    /// Fields that plugins find from others when the run starts.
    pub(crate) derived: BTreeSet<FieldIndex>,
    /// By field: the time to which its owner has advanced it, s.
    times: Vec<f64>,
    pub(crate) facts: Facts,
    pub(crate) configurations: Configurations,
    pub(crate) families: Vec<WorldFamily>,
    /// By body: what happens to its points.
    pub(crate) changes: Vec<Changes>,
    broken: Vec<RefCell<BrokenPairs>>,
    /// Bodies with a window of finer points that moves.
    pub(crate) refinements: Vec<Refinement>,
    /// Sinks that the physics to be advanced takes; `None` for all.
    pub(crate) taken: Option<Vec<FieldIndex>>,
    processes: Processes,
    /// By body: the part that this process has, where several processes share the run.
    pub(crate) divisions: Vec<Option<Division>>,
    /// By body: the surface of the whole body, where several processes share a run with several bodies.
    surfaces: Vec<Option<Arc<SurfacePoints>>>,
    /// The world of whole bodies, in the first of several processes.
    whole: Option<Box<World>>,
}

impl World {
    /// A world of the given bodies, without fields.
    pub fn new(bodies: Vec<Body>) -> World {
        World {
            configurations: Configurations::new(bodies.len()),
            changes: vec![Changes::NONE; bodies.len()],
            broken: bodies.iter().map(|_| RefCell::default()).collect(),
            divisions: bodies.iter().map(|_| None).collect(),
            surfaces: vec![None; bodies.len()],
            bodies,
            ..World::default()
        }
    }

    /// The world of a run that these processes share.
    #[must_use]
    pub fn shared_by(self, processes: Processes) -> World {
        World { processes, ..self }
    }

    /// All bodies.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// One body.
    pub fn body(&self, index: BodyIndex) -> &Body {
        &self.bodies[index]
    }

    /// The body called `name`, or the only one.
    ///
    /// # Errors
    /// When there is none of that name, or several and no name; blamed on `body`.
    pub fn find_body(&self, name: Option<&str>) -> Result<BodyIndex, SetupError> {
        let names = self.bodies.iter().map(|b| &b.name);
        match name {
            Some(name) => names
                .clone()
                .position(|n| n == name)
                .ok_or_else(|| SetupError::unknown("body", "body", name, names)),
            None if self.bodies.len() == 1 => Ok(0),
            None => {
                let problem = Problem::WhichBody(names.cloned().collect());
                Err(SetupError::new("body", problem))
            }
        }
    }

    /// The region called `name` of a body.
    ///
    /// # Errors
    /// When there is none of that name; blamed on `key`.
    pub fn region(&self, body: BodyIndex, key: &str, name: &str) -> Result<&Region, SetupError> {
        let regions = &self.bodies[body].regions;
        let unknown = || SetupError::unknown(key, "region", name, regions.keys());
        regions.get(name).ok_or_else(unknown)
    }

    /// Whether a physics takes what is now added to a sink. A coupler that adds to sinks of several physics is applied before each of them, and
    /// what it adds to those of others is dropped.
    pub fn is_taken<T>(&self, sink: Write<T>) -> bool {
        let taken = self.taken.as_ref();
        taken.is_none_or(|taken| taken.contains(&sink.field))
    }

    /// Facts of a type about a body, in the order in which they were published.
    pub fn facts<T: Fact>(&self, body: BodyIndex) -> impl Iterator<Item = &T> {
        self.facts.of(body).map(|(_, fact)| fact)
    }

    /// The fact of a type about a body.
    pub fn fact<T: Fact>(&self, body: BodyIndex) -> Option<&T> {
        self.facts(body).next()
    }

    /// What happens to the points of a body during the run.
    pub fn changes(&self, body: BodyIndex) -> Changes {
        self.changes[body]
    }

    /// Whether the points of a body move together, so that a single one has the inertia of the whole body.
    pub fn is_rigid(&self, body: BodyIndex) -> bool {
        self.fact::<Rigid>(body).is_some()
    }

    /// Distance of the surface of a body from its outermost points: over it an exchanged field changes from its value at a
    /// point to that of the surface before it.
    pub fn surface_depths(&self, body: BodyIndex) -> SurfaceDepths {
        self.fact::<SurfaceDepths>(body)
            .copied()
            .unwrap_or_default()
    }

    /// Faces of a body that are planes of symmetry.
    pub fn symmetry(&self, body: BodyIndex) -> Vec<Face> {
        let planes = self.facts::<SymmetryPlane>(body);
        planes.map(|plane| plane.0).collect()
    }

    /// All fields, whatever their type: for logs, plots and checkpoints.
    pub fn fields(&self) -> &Fields {
        &self.fields
    }

    /// Values of a field.
    pub fn read<T: Value>(&self, handle: Read<T>) -> Ref<'_, [T]> {
        self.fields.field(handle.field).read()
    }

    /// The time level of a field: that to which its owner has advanced it, s.
    pub fn time_of<T>(&self, handle: Read<T>) -> f64 {
        self.time_of_field(handle.field)
    }

    pub(crate) fn time_of_field(&self, field: usize) -> f64 {
        self.times.get(field).copied().unwrap_or(0.0)
    }

    pub(crate) fn set_times(&mut self, fields: &[usize], time: f64) {
        self.times.resize(self.fields.iter().count(), 0.0);
        fields.iter().for_each(|&f| self.times[f] = time);
    }

    /// Integral of a scalar field over the reference volume of a body.
    pub fn integral(&self, body: BodyIndex, handle: Read<f64>) -> f64 {
        weighted_sum(&self.read(handle), &self.bodies[body].points.volume)
    }

    /// A component of a field on the cell face in front of a point, where a boundary prescribes it or the surface exchanges it:
    /// as of the last observation.
    pub fn value_on_face(
        &self,
        index: FieldIndex,
        component: usize,
        point: u32,
        face: Face,
    ) -> Option<f64> {
        let field = self.fields.field(index);
        let of_field = |l: &&Layers| l.body == field.body && l.field == field.name;
        let prescribed = self.layers.iter().filter(of_field).find_map(|layers| {
            let rules = layers.rules.borrow();
            let mut on_face = rules.iter().filter(|rule| rule.face == face);
            on_face.find_map(|rule| rule.prescribed(component, point))
        });
        let exchanged = || {
            let mut own = self
                .facts::<Rc<Exchange>>(field.body)
                .filter(|e| e.depth == SurfaceDepth::Face && e.field == index);
            own.find_map(|e| e.surface_value(point, face))
        };
        prescribed
            .or_else(exchanged)
            .filter(|value| value.is_finite())
    }

    /// The first point at which the magnitude of a component of a field is above a limit.
    pub fn first_beyond<T>(&self, handle: Read<T>, limit: f64) -> Option<usize> {
        let data = self.fields.field(handle.field).data();
        let first = data.flat().iter().position(|v| v.abs() > limit)?;
        Some(first / data.components())
    }

    /// Values of a field, if anybody provides it.
    pub fn read_if_provided<T: Value>(&self, handle: ReadIfProvided<T>) -> Option<Ref<'_, [T]>> {
        self.provided[handle.field].then(|| self.fields.field(handle.field).read())
    }

    /// Values of a field, to change.
    pub fn write<T: Value>(&self, handle: Write<T>) -> RefMut<'_, [T]> {
        self.fields.field(handle.field).write()
    }

    /// How a field continues behind the faces of its body.
    pub fn layer_rules(&self, handle: LayersHandle) -> Ref<'_, [LayerRule]> {
        Ref::map(self.layers[handle.0].rules.borrow(), Vec::as_slice)
    }

    /// Sets the values behind one face: `scale * mirrored value + offset` by component.
    pub fn set_layer(&self, handle: LayerHandle, scale: [f64; 3], offset: [f64; 3]) {
        self.set_rule(
            handle,
            LayerRule {
                scale,
                offset,
                ..LayerRule::even(handle.face)
            },
        );
    }

    /// Sets the values behind one face of a scalar field by what is prescribed on the face in front of each point of the body:
    /// `scale * mirrored value + (1 - scale) * value`.
    pub fn set_layer_values(&self, handle: LayerHandle, scale: f64, values: Arc<[f64]>) {
        self.set_rule(
            handle,
            LayerRule {
                scale: [scale; 3],
                values: Some(values),
                ..LayerRule::even(handle.face)
            },
        );
    }

    /// Lets the layer behind one face continue the strain under a traction, Pa.
    pub fn set_traction_layer(&self, handle: LayerHandle, stress: [f64; 3]) {
        let traction = Traction {
            stress,
            difference: false,
        };
        self.set_rule(
            handle,
            LayerRule {
                traction: Some(traction),
                ..LayerRule::even(handle.face)
            },
        );
    }

    /// Pairs of points of a body whose bond broke.
    pub fn broken_pairs(&self, body: BodyIndex) -> Ref<'_, BrokenPairs> {
        self.broken[body].borrow()
    }

    /// Adds pairs whose bond broke in this step.
    pub fn break_pairs(&self, breaker: &BondBreaker, pairs: impl IntoIterator<Item = [u32; 2]>) {
        self.broken[breaker.body].borrow_mut().pairs.extend(pairs);
    }

    /// Replaces the list of broken pairs by that of a restored state.
    pub fn replace_broken_pairs(&self, breaker: &BondBreaker, pairs: Vec<[u32; 2]>) {
        let mut broken = self.broken[breaker.body].borrow_mut();
        broken.pairs = pairs;
        broken.replaced += 1;
    }

    /// Declares that a plugin breaks the bonds of a body.
    ///
    /// # Errors
    /// The plugin that does already, unless both share the list.
    pub(crate) fn set_breaker(
        &mut self,
        body: BodyIndex,
        breaker: Breaker,
    ) -> Result<BondBreaker, usize> {
        let present = &mut self.broken[body].get_mut().breaker;
        match present {
            Some(other) if !(other.is_shared && breaker.is_shared) => Err(other.plugin),
            _ => {
                *present = Some(breaker);
                Ok(BondBreaker { body })
            }
        }
    }

    /// All components of a field, for the program that owns the world. Plugins write through handles.
    pub fn values_mut(&mut self, field: usize) -> &mut [f64] {
        self.fields.values_mut(field)
    }

    fn set_rule(&self, handle: LayerHandle, rule: LayerRule) {
        let mut rules = self.layers[handle.layers].rules.borrow_mut();
        let own = rules.iter_mut().find(|r| r.face == handle.face);
        *own.expect("registered at set-up") = rule;
    }
}
