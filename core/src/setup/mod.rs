//! Set-up: where plugins declare what they touch and obtain what they need.
//!
//! A physics *owns* its state fields and *consumes* sink fields; a coupler *writes* derived
//! fields and *adds* into sink fields; anybody *reads*. [`Setup::finish`] checks that what is
//! read is provided and what is added is consumed.

mod activity;
mod exchanges;
mod families;
mod layers;
mod refinement;
#[cfg(test)]
mod tests;

use std::any::Any;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use nalgebra::Vector3;

use crate::body::Cut;
use crate::body::Face;
use crate::body::{Body, Region};
use crate::error::{Problem, SetupError};
use crate::field::{FieldIndex, Key, Read, ReadIfProvided, Value, Write, keys};
use crate::in_space::InSpace;
use crate::in_space::Placed;
use crate::material::{EnthalpyCurve, Expansion, Material, MaterialError, Property};
use crate::world::{BodyIndex, PhaseChange, World};

use exchanges::DeclaredExchange;
use families::ObtainedFamily;

/// How a plugin touches a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// State that it advances.
    Own,
    /// Sums that it takes up; zeroed before each round of additions.
    Consume,
    /// Amounts that it takes up once, at the start of a step; zeroed before each round of additions and before a
    /// further sub-step.
    Take,
    /// Derived values that it computes.
    Write,
    /// Adds into a sink.
    Add,
    /// Adds amounts to another body, of a physics that advances before the one that takes them up.
    Give,
    /// As `Give`, summed over the sub-steps of the physics, so that the other body may take longer steps.
    GiveSum,
    /// Reads.
    Read,
    /// Reads if provided.
    ReadIfProvided,
    /// Sets the layer behind a face.
    Layer,
    /// Sets the layer behind a face if somebody owns the field.
    LayerIfProvided,
}

impl Access {
    fn provides(self) -> bool {
        matches!(self, Access::Own | Access::Write)
    }

    pub(crate) fn reads(self) -> bool {
        matches!(
            self,
            Access::Read | Access::ReadIfProvided | Access::Consume | Access::Take
        )
    }

    pub(crate) fn gives(self) -> bool {
        matches!(self, Access::Give | Access::GiveSum)
    }

    pub(crate) fn consumes(self) -> bool {
        matches!(self, Access::Consume | Access::Take)
    }

    pub(crate) fn writes(self) -> bool {
        matches!(
            self,
            Access::Write | Access::Add | Access::Layer | Access::LayerIfProvided
        )
    }
}

/// A body whose points are walls for the material of another body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// The body that is the wall.
    pub other: BodyIndex,
    /// Whether the material slips along the wall; else it sticks.
    pub slip: bool,
}

/// Something that can be run and may be a mistake.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Name of the plugin that noticed it.
    pub plugin: String,
    /// A sentence without a full stop.
    pub message: String,
}

/// A declared access.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// The plugin, by its position in [`Setup`]'s order: couplers first, then physics.
    pub plugin: usize,
    /// How.
    pub access: Access,
    /// What.
    pub field: FieldIndex,
}

/// Handed to each plugin in turn.
pub struct Setup<'w> {
    pub(crate) world: &'w mut World,
    folder: PathBuf,
    pub(crate) plugins: Vec<String>,
    pub(crate) declarations: Vec<Declaration>,
    /// Plugins that follow the activity of the points of a body.
    pub(crate) followers: Vec<(usize, BodyIndex)>,
    /// Plugins that know that the points of a body may be a window that moves.
    pub(crate) window_followers: Vec<(usize, BodyIndex)>,
    /// Plugins that need points which stay, with what to say where a physics moves them.
    need_points_at_rest: Vec<(usize, BodyIndex, SetupError)>,
    families: Vec<ObtainedFamily>,
    /// Bodies that are walls for others.
    walls: Vec<DeclaredWall>,
    /// Exchanges of heat through surfaces.
    exchanges: Vec<DeclaredExchange>,
    warnings: Vec<Warning>,
    /// What the user may want to know, and is no mistake.
    notes: Vec<Warning>,
    /// What couplers share, with their names.
    shared: Vec<(String, Rc<dyn Any>)>,
    /// Number of plugins before the first physics, once there is one.
    first_physics: Option<usize>,
}

/// A wall that a plugin declared, and whether a physics takes it into account.
struct DeclaredWall {
    plugin: usize,
    body: BodyIndex,
    wall: Wall,
    taken: bool,
}

impl<'w> Setup<'w> {
    /// Starts the set-up of `world`; relative paths in the case start from `folder`.
    pub fn new(world: &'w mut World, folder: &Path) -> Self {
        Setup {
            world,
            folder: folder.to_path_buf(),
            plugins: Vec::new(),
            declarations: Vec::new(),
            followers: Vec::new(),
            window_followers: Vec::new(),
            need_points_at_rest: Vec::new(),
            families: Vec::new(),
            walls: Vec::new(),
            exchanges: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            shared: Vec::new(),
            first_physics: None,
        }
    }

    /// The next plugin, by the name that messages use; declarations are its own from here on.
    pub fn next_plugin(&mut self, label: &str) {
        self.plugins.push(label.to_string());
    }

    /// As [`Setup::next_plugin`], for a physics; couplers come before all of them.
    pub fn next_physics(&mut self, label: &str) {
        self.first_physics.get_or_insert(self.plugins.len());
        self.next_plugin(label);
    }

    /// Tells the user about something that can be run and may be a mistake: a sentence without a full stop.
    pub fn warn(&mut self, message: impl Into<String>) {
        let warning = Warning {
            plugin: self.plugins.last().cloned().unwrap_or_default(),
            message: message.into(),
        };
        if !self.warnings.iter().any(|w| w.message == warning.message) {
            self.warnings.push(warning);
        }
    }

    /// Notes for `perimelt check`: a sentence without a full stop, from a plugin by its position.
    fn note(&mut self, plugin: usize, message: String) {
        let plugin = self.plugins[plugin].clone();
        self.notes.push(Warning { plugin, message });
    }

    /// Takes the notes.
    pub(crate) fn take_notes(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.notes)
    }

    /// Takes the warnings so far.
    pub(crate) fn take_warnings(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.warnings)
    }

    /// Makes known what the coupler called `name` shares, before any is prepared.
    pub fn share(&mut self, name: &str, value: Rc<dyn Any>) {
        self.shared.push((name.into(), value));
    }

    /// What the coupler called `name` shares ([`Coupler::share`](crate::Coupler::share)).
    ///
    /// # Errors
    /// When no coupler of that name shares a `T`, with the names of those that do; blamed on `key`.
    pub fn shared<T: 'static>(
        &self,
        key: &str,
        what: &'static str,
        name: &str,
    ) -> Result<Rc<T>, SetupError> {
        let all = self.shared.iter();
        let mut all = all.filter_map(|(n, value)| Some((n, value.clone().downcast::<T>().ok()?)));
        let found = all.clone().find(|(n, _)| *n == name);
        found.map(|(_, value)| value).ok_or_else(|| {
            let problem = Problem::UnknownName {
                what,
                name: name.into(),
                known: all.by_ref().map(|(n, _)| n.clone()).collect(),
            };
            SetupError::new(key, problem)
        })
    }

    /// A path of the case file, relative to the file's folder.
    pub fn path(&self, path: &str) -> PathBuf {
        self.folder.join(path)
    }

    /// The values of the key `key` at positions (m) of a body, those at the start computed. A file has a column with the name of
    /// the `field`, or only one.
    ///
    /// # Errors
    /// A file that cannot be read or whose points lie elsewhere, or a value that is not finite.
    pub fn placed(
        &mut self,
        (body, field): (BodyIndex, &str),
        key: &str,
        value: &InSpace,
        positions: Vec<Vector3<f64>>,
    ) -> Result<Placed, SetupError> {
        let dimension = self.body(body).dimension;
        let placed = value.at((field, &self.folder), positions, dimension);
        let mut placed = placed.map_err(|e| SetupError::other(key, e))?;
        placed.at(0.0).map_err(|e| SetupError::other(key, e))?;
        if let Some(warning) = placed.warning() {
            self.warn(format!("`{key}`: {warning}"));
        }
        Ok(placed)
    }

    /// The body called `name`, or the only one.
    ///
    /// # Errors
    /// When there is none of that name, or several and no name.
    pub fn find_body(&self, name: Option<&str>) -> Result<BodyIndex, SetupError> {
        let names = || {
            self.world
                .bodies
                .iter()
                .map(|b| b.name.clone())
                .collect::<Vec<_>>()
        };
        match name {
            Some(name) => self
                .world
                .bodies
                .iter()
                .position(|b| b.name == name)
                .ok_or_else(|| {
                    let problem = Problem::UnknownName {
                        what: "body",
                        name: name.into(),
                        known: names(),
                    };
                    SetupError::new("body", problem)
                }),
            None if self.world.bodies.len() == 1 => Ok(0),
            None => Err(SetupError::new("body", Problem::WhichBody(names()))),
        }
    }

    /// A body.
    pub fn body(&self, index: BodyIndex) -> &Body {
        &self.world.bodies[index]
    }

    /// The region called `name` of a body.
    ///
    /// # Errors
    /// When there is none of that name, or it holds no point; blamed on `key`.
    pub fn region(&self, body: BodyIndex, key: &str, name: &str) -> Result<Region, SetupError> {
        let body = self.body(body);
        let region = body.regions.get(name).ok_or_else(|| {
            let known = body.regions.keys().cloned().collect();
            SetupError::new(
                key,
                Problem::UnknownName {
                    what: "region",
                    name: name.into(),
                    known,
                },
            )
        })?;
        if region.points.is_empty() {
            let (from, to) = body.bounds();
            let problem = Problem::EmptyRegion {
                region: name.into(),
                body: body.name.clone(),
                from: from.into(),
                to: to.into(),
                spacing: body.finest_spacing(),
            };
            return Err(SetupError::new(key, problem));
        }
        Ok(region.clone())
    }

    /// The property `name` of each material of a body.
    ///
    /// # Errors
    /// When a material lacks it.
    pub fn property(&self, body: BodyIndex, name: &str) -> Result<Vec<Property>, SetupError> {
        self.of_materials(body, name, |m| Ok(m.get(name).cloned()))
    }

    /// The thermal expansion of each material of a body.
    ///
    /// # Errors
    /// When a material states none.
    pub fn expansions(&self, body: BodyIndex) -> Result<Vec<Expansion>, SetupError> {
        self.of_materials(body, "thermal_expansion", Expansion::of)
    }

    /// What each material of a body has; `property` names what is missing where it has none.
    fn of_materials<T>(
        &self,
        body: BodyIndex,
        property: &str,
        of: impl Fn(&Material) -> Result<Option<T>, MaterialError>,
    ) -> Result<Vec<T>, SetupError> {
        let body = self.body(body);
        let missing = |material: &Material| {
            let problem = Problem::MissingProperty {
                material: material.name().into(),
                body: body.name.clone(),
                property: property.into(),
            };
            SetupError::new("", problem)
        };
        let materials = body.materials.iter().map(|material| {
            let found = of(material).map_err(|e| SetupError::other("", e))?;
            found.ok_or_else(|| missing(material))
        });
        materials.collect()
    }

    /// The property `name` of each material of a body, as a number.
    ///
    /// # Errors
    /// When a material lacks it or it is not constant.
    pub fn constant_property(&self, body: BodyIndex, name: &str) -> Result<Vec<f64>, SetupError> {
        let properties = self.property(body, name)?;
        properties
            .iter()
            .map(|p| {
                p.constant().ok_or_else(|| {
                    SetupError::value(
                        "",
                        format!("`{name}` is a table"),
                        format!("one number for `{name}`"),
                    )
                })
            })
            .collect()
    }

    /// As [`Setup::constant_property`], for each point of the body.
    ///
    /// # Errors
    /// As [`Setup::constant_property`].
    pub fn constant_at_points(&self, body: BodyIndex, name: &str) -> Result<Vec<f64>, SetupError> {
        let by_material = self.constant_property(body, name)?;
        let materials = self.body(body).material_of_point.iter();
        Ok(materials.map(|&m| by_material[m as usize]).collect())
    }

    /// Density that fixes the mass of the points of each material of a body, kg/m³
    /// ([`Material::reference_density`]).
    ///
    /// # Errors
    /// When a material lacks it.
    pub fn reference_densities(&self, body: BodyIndex) -> Result<Vec<f64>, SetupError> {
        let materials = self.body(body).materials.iter();
        let densities = materials.map(Material::reference_density);
        let densities: Result<_, MaterialError> = densities.collect();
        densities.map_err(|e| SetupError::other("", e))
    }

    /// [`Setup::reference_densities`] for each point of the body, kg/m³.
    ///
    /// # Errors
    /// As [`Setup::reference_densities`].
    pub fn density_at_points(&self, body: BodyIndex) -> Result<Vec<f64>, SetupError> {
        let by_material = self.reference_densities(body)?;
        let materials = self.body(body).material_of_point.iter();
        Ok(materials.map(|&m| by_material[m as usize]).collect())
    }

    /// Cuts a body: no family obtained from now on has bonds across `cut`. Called by crack
    /// couplers, which are prepared before all physics.
    pub fn cut(&mut self, body: BodyIndex, cut: Cut) {
        self.world.bodies[body].cuts.push(cut);
    }

    /// Lets a body melt and freeze; called by the phase-change coupler.
    pub fn set_phase_change(&mut self, body: BodyIndex, change: PhaseChange) {
        self.world.phase_change[body] = Some(change);
    }

    /// Enthalpy against temperature of each material of a body, with latent heat where the
    /// body has a phase change and the material all of solidus, liquidus and latent heat.
    ///
    /// # Errors
    /// When density or specific heat are missing, or the curve cannot be.
    pub fn enthalpy_curves(&self, body: BodyIndex) -> Result<Vec<EnthalpyCurve>, SetupError> {
        self.world.enthalpy_curves(body)
    }

    fn declare<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
        access: Access,
    ) -> Result<FieldIndex, SetupError> {
        let points = self.body(body).points.len();
        let field = self
            .world
            .fields
            .intern(body, points, key)
            .map_err(|present| {
                let problem = Problem::FieldType {
                    field: key.name.to_string(),
                    asked: T::COMPONENTS,
                    present,
                };
                SetupError::new("", problem)
            })?;
        let plugin = self.plugins.len() - 1;
        let rival = |d: &&Declaration| {
            d.field == field
                && (d.access.provides() && access.provides()
                    || d.access.consumes() && access.consumes())
        };
        if let Some(first) = self.declarations.iter().find(rival) {
            let problem = Problem::TwoWriters {
                field: key.name.to_string(),
                body: self.body(body).name.clone(),
                first: self.plugins[first.plugin].clone(),
            };
            return Err(SetupError::new("", problem));
        }
        self.declarations.push(Declaration {
            plugin,
            access,
            field,
        });
        Ok(field)
    }

    /// A state field that the calling physics owns and advances.
    ///
    /// # Errors
    /// When somebody else writes it, or it is known with another type.
    pub fn own<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Write<T>, SetupError> {
        self.declare(body, key, Access::Own).map(Write::new)
    }

    /// A sink field that the calling physics takes up.
    ///
    /// # Errors
    /// As [`Setup::own`].
    pub fn consume<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Read<T>, SetupError> {
        self.declare(body, key, Access::Consume).map(Read::new)
    }

    /// As [`Setup::consume`], but only where a coupler adds into the sink: what nobody adds
    /// to need not be zeroed and read in every step.
    ///
    /// # Errors
    /// As [`Setup::own`].
    pub fn consume_if_added<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Option<Read<T>>, SetupError> {
        match self.is_added(body, key) {
            true => self.consume(body, key).map(Some),
            false => Ok(None),
        }
    }

    /// A sink field of amounts, such as [`keys::IMPULSE`], that the calling physics takes up
    /// once at the start of a step, where a coupler adds into it. When the physics takes several sub-steps while its
    /// couplers are applied once, the sink is zero from the second sub-step on.
    ///
    /// # Errors
    /// As [`Setup::own`].
    pub fn take_if_added<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Option<Read<T>>, SetupError> {
        match self.is_added(body, key) {
            true => self
                .declare(body, key, Access::Take)
                .map(Read::new)
                .map(Some),
            false => Ok(None),
        }
    }

    /// Whether a coupler adds into the sink of `key`; for physics, which are prepared after couplers.
    pub fn is_added<T: Value>(&self, body: BodyIndex, key: &Key<T>) -> bool {
        let field = self.world.fields.find(body, &key.name);
        let added = |d: &Declaration| Some(d.field) == field && d.access == Access::Add;
        let is_impulse = key.name == keys::IMPULSE.name;
        self.declarations.iter().any(added)
            || is_impulse && self.walls.iter().any(|w| w.wall.other == body)
    }

    /// A derived field that the calling plugin computes.
    ///
    /// # Errors
    /// As [`Setup::own`].
    pub fn write<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Write<T>, SetupError> {
        self.declare(body, key, Access::Write).map(Write::new)
    }

    /// A sink field that the calling coupler adds into.
    ///
    /// # Errors
    /// As [`Setup::own`], and when a physics asks: sinks are zeroed before couplers add, not before physics do.
    pub fn add<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Write<T>, SetupError> {
        if self.first_physics.is_some() {
            let message = format!(
                "a physics adds to `{}`, but only couplers add into sinks, which are zeroed before them",
                key.name
            );
            let expected = "a derived field of the physics and a coupler that adds it";
            return Err(SetupError::value("", message, expected));
        }
        self.declare(body, key, Access::Add).map(Write::new)
    }

    /// Lets the points of `wall.other` be walls for the material of `body` ([`Wall`]); called by couplers. The
    /// physics of `body` then gives impulses to the other body.
    pub fn set_wall(&mut self, body: BodyIndex, wall: Wall) {
        let plugin = self.plugins.len() - 1;
        self.walls.push(DeclaredWall {
            plugin,
            body,
            wall,
            taken: false,
        });
    }

    /// The bodies that are walls for `body`, for the physics of the body.
    pub fn walls(&mut self, body: BodyIndex) -> Vec<Wall> {
        let own = self.walls.iter_mut().filter(|w| w.body == body);
        let take = |w: &mut DeclaredWall| {
            w.taken = true;
            w.wall
        };
        own.map(take).collect()
    }

    /// Declares that the points of a body move together; called by the physics of a rigid body.
    pub fn set_rigid(&mut self, body: BodyIndex) {
        self.world.rigid[body] = true;
    }

    /// Tells the distances of the surface of a body from its outermost points by direction, in spacings, which the sums of a physics
    /// of heat make other than a half.
    pub fn set_surface_depth(&mut self, body: BodyIndex, depth: [f64; 6]) {
        self.world.surface_depth[body] = depth;
    }

    /// Declares that a body goes on as its mirror image behind a face, so that measurements count both halves; called by
    /// the boundary that mirrors the fields.
    pub fn set_symmetry(&mut self, body: BodyIndex, face: Face) {
        self.world.symmetry[body].push(face);
    }

    /// The impulses that the calling physics gives to the points of a wall, as momentum per reference volume of the
    /// other body (N s/m³).
    ///
    /// # Errors
    /// As [`Setup::own`].
    pub fn give_impulses(&mut self, wall: &Wall) -> Result<Write<Vector3<f64>>, SetupError> {
        self.declare(wall.other, &keys::IMPULSE, Access::Give)
            .map(Write::new)
    }

    /// Amounts that the calling physics gives to the points of another body, whose physics takes them up
    /// ([`Setup::take`]): the sum over its sub-steps since both bodies were at one time.
    ///
    /// # Errors
    /// As [`Setup::own`].
    pub fn give_sum<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Write<T>, SetupError> {
        self.declare(body, key, Access::GiveSum).map(Write::new)
    }

    /// Amounts that the calling physics takes up once, at the start of a step, from the physics of another body.
    ///
    /// # Errors
    /// As [`Setup::own`].
    pub fn take<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Read<T>, SetupError> {
        self.declare(body, key, Access::Take).map(Read::new)
    }

    /// A field that the calling plugin reads.
    ///
    /// # Errors
    /// When it is known with another type; [`Setup::finish`] reports one that nobody provides.
    pub fn read<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Read<T>, SetupError> {
        self.declare(body, key, Access::Read).map(Read::new)
    }

    /// Sets the values of a derived field before the first step, by point.
    pub fn set_first(&mut self, field: Write<f64>, value: impl Fn(usize) -> f64) {
        let values = self.world.fields.values_mut(field.field).iter_mut();
        values.enumerate().for_each(|(point, v)| *v = value(point));
    }

    /// Whether a coupler computes the field of `key`; for physics, which are prepared after couplers.
    pub fn is_written<T: Value>(&self, body: BodyIndex, key: &Key<T>) -> bool {
        let field = self.world.fields.find(body, &key.name);
        let writes = |d: &Declaration| Some(d.field) == field && d.access == Access::Write;
        self.declarations.iter().any(writes)
    }

    /// Whether a plugin prepared before the calling one reads the field of `key`: a derived
    /// field that nobody reads need not be computed.
    pub fn is_read<T: Value>(&self, body: BodyIndex, key: &Key<T>) -> bool {
        let field = self.world.fields.find(body, &key.name);
        self.declarations
            .iter()
            .any(|d| Some(d.field) == field && d.access.reads())
    }

    /// A field that the calling plugin reads where it exists.
    ///
    /// # Errors
    /// When it is known with another type.
    pub fn read_if_provided<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<ReadIfProvided<T>, SetupError> {
        self.declare(body, key, Access::ReadIfProvided)
            .map(ReadIfProvided::new)
    }

    /// Checks that what is read is provided and what is added is consumed, and hands over
    /// the declarations. Each error comes with the plugin at fault.
    ///
    /// # Errors
    /// A body whose points cannot do what plugins ask for, else every access without its counterpart.
    pub fn finish(mut self) -> Result<Vec<Declaration>, Vec<(usize, SetupError)>> {
        let points = self.check_points_at_rest();
        let points = points.and_then(|()| self.check_growth());
        let points = points.and_then(|()| self.check_refinements());
        points.map_err(|mistake| vec![mistake])?;
        let mut mistakes = Vec::new();
        let fields = self.world.fields.iter().count();
        let with = |test: fn(Access) -> bool| {
            let mut found = vec![false; fields];
            self.declarations
                .iter()
                .filter(|d| test(d.access))
                .for_each(|d| found[d.field] = true);
            found
        };
        let provided = with(Access::provides);
        let consumed = with(Access::consumes);
        for d in &self.declarations {
            let field = self.world.fields.field(d.field);
            let (name, body) = (
                field.name.clone(),
                self.world.bodies[field.body].name.clone(),
            );
            let plugin = self.plugins[d.plugin].clone();
            let problem = match d.access {
                Access::Read | Access::Layer if !provided[d.field] => {
                    let same_body = |(i, f): &(usize, &crate::field::Field)| {
                        f.body == field.body && provided[*i]
                    };
                    let provided = self
                        .world
                        .fields
                        .iter()
                        .enumerate()
                        .filter(same_body)
                        .map(|(_, f)| f.name.clone());
                    Problem::NobodyProvides {
                        field: name,
                        body,
                        plugin,
                        provided: provided.collect(),
                    }
                }
                Access::Add | Access::Give | Access::GiveSum if !consumed[d.field] => {
                    Problem::NobodyConsumes {
                        field: name,
                        body,
                        plugin,
                    }
                }
                _ => continue,
            };
            mistakes.push((d.plugin, SetupError::new("", problem)));
        }
        for wall in self.walls.iter().filter(|w| !w.taken) {
            let name = &self.world.bodies[wall.body].name;
            let message = format!("no physics of body `{name}` has walls");
            let expected = "a `fluid` of that body with `form = \"conservative\"`";
            mistakes.push((wall.plugin, SetupError::value("fluid", message, expected)));
        }
        mistakes.extend(self.free_exchanges());
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        self.world.provided = provided;
        Ok(self.declarations)
    }
}
