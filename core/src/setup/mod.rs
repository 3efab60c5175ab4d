//! Set-up: where plugins publish what is true of bodies, declare what they touch, and obtain what they need.
//!
//! All plugins first publish ([`Physics::publish`](crate::Physics::publish), [`Coupler::publish`](crate::Coupler::publish)),
//! so that the order of tables in a case file does not matter; then couplers are prepared, then physics, those first that
//! decide where points are.
//!
//! A physics *owns* its state fields and *consumes* sink fields; a coupler *writes* derived
//! fields and *adds* into sink fields; anybody *reads*. [`Setup::finish`] checks that what is
//! read is provided, that what is added is consumed, and that plugins support what happens to the points of the bodies on
//! which they act.

mod access;
mod bodies;
mod exchanges;
mod families;
mod layers;
mod points;
#[cfg(test)]
mod tests;

use std::any::Any;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::error::{Problem, SetupError};
use crate::family::FamilySpec;
use crate::stepping::Stepping;
use crate::world::changes::{Change, Changes};
use crate::world::facts::{Fact, FactRule, Once};
use crate::world::families::FamilySize;
use crate::world::{BodyIndex, World};

pub use access::{Access, Declaration, ExpectedGift};
pub use bodies::GivenValue;
pub use layers::{ClaimedLayers, LayerRole};

/// Something that can be run and may be a mistake.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Name of the plugin that noticed it.
    pub plugin: String,
    /// A sentence without a full stop.
    pub message: String,
}

/// A plugin in the order of the case: couplers first, then physics.
struct Plugin {
    label: String,
    is_physics: bool,
    /// What may happen to the points of the bodies on which it acts.
    supports: Changes,
    stepping: Stepping,
}

/// Something that happens to the points of a body, and the plugin that does it.
#[derive(Clone, Copy, Debug)]
struct Happening {
    body: BodyIndex,
    change: Change,
    /// The plugin by which it happens; `None` where the case says so.
    plugin: Option<usize>,
}

/// The mistake of a plugin, should something happen to the points of a body.
#[derive(Debug)]
struct RefusedChange {
    plugin: usize,
    body: BodyIndex,
    change: Change,
    error: SetupError,
}

/// A family that a plugin asked for.
#[derive(Debug)]
pub(crate) struct FamilyRequest {
    /// The plugin that asked first.
    pub(crate) plugin: String,
    pub(crate) body: BodyIndex,
    pub(crate) spec: FamilySpec,
}

/// What the set-up found.
pub struct Declared {
    /// How plugins are stepped.
    pub stepping: Vec<Stepping>,
    /// What plugins touch.
    pub declarations: Vec<Declaration>,
    /// What may be a mistake.
    pub warnings: Vec<Warning>,
    /// What the user may want to know, and is no mistake.
    pub(crate) notes: Vec<Warning>,
    /// Families of points that stay.
    pub(crate) requests: Vec<FamilyRequest>,
    /// Sizes of families that plugins keep for themselves.
    pub(crate) kept_families: Vec<FamilySize>,
}

/// Handed to each plugin in turn.
pub struct Setup<'w> {
    pub(crate) world: &'w mut World,
    folder: PathBuf,
    plugins: Vec<Plugin>,
    /// The plugin that declares, by its position.
    current: usize,
    declarations: Vec<Declaration>,
    happenings: Vec<Happening>,
    refused: Vec<RefusedChange>,
    warnings: Vec<Warning>,
    /// What the user may want to know, and is no mistake.
    notes: Vec<Warning>,
    /// Sizes of families that plugins keep for themselves.
    kept_families: Vec<FamilySize>,
    /// What couplers share, with their names.
    shared: Vec<(String, Rc<dyn Any>)>,
}

impl<'w> Setup<'w> {
    /// Starts the set-up of `world`; relative paths in the case start from `folder`.
    pub fn new(world: &'w mut World, folder: &Path) -> Self {
        let bodies = world.bodies.iter().enumerate();
        let layered = bodies.filter(|(_, body)| body.layers().is_some());
        let happenings = layered.map(|(body, _)| Happening {
            body,
            change: Change::Layers,
            plugin: None,
        });
        Setup {
            happenings: happenings.collect(),
            world,
            folder: folder.to_path_buf(),
            plugins: Vec::new(),
            current: 0,
            declarations: Vec::new(),
            refused: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            kept_families: Vec::new(),
            shared: Vec::new(),
        }
    }

    /// Adds a plugin, by the name that messages use; declarations are its own from here on. It supports all that happens
    /// to points.
    pub fn next_plugin(&mut self, label: &str) {
        self.current = self.add_plugin(label, false, Changes::ALL);
    }

    /// Starts the declarations of a physics, see [`Setup::next_plugin`]; couplers come before all physics.
    #[cfg(test)]
    pub(crate) fn next_physics(&mut self, label: &str) {
        self.current = self.add_plugin(label, true, Changes::ALL);
    }

    /// Adds a plugin with what may happen to the points on which it acts; its position.
    pub(crate) fn add_plugin(&mut self, label: &str, is_physics: bool, supports: Changes) -> usize {
        self.plugins.push(Plugin {
            label: label.to_string(),
            is_physics,
            supports,
            stepping: Stepping::default(),
        });
        self.plugins.len() - 1
    }

    /// Declarations are those of this plugin from here on.
    pub(crate) fn enter(&mut self, plugin: usize) {
        self.current = plugin;
    }

    fn label(&self, plugin: usize) -> &str {
        self.plugins.get(plugin).map_or("", |p| &p.label)
    }

    /// Tells the user about something that can be run and may be a mistake: a sentence without a full stop.
    pub fn warn(&mut self, message: impl Into<String>) {
        let warning = Warning {
            plugin: self.label(self.current).to_string(),
            message: message.into(),
        };
        if !self.warnings.iter().any(|w| w.message == warning.message) {
            self.warnings.push(warning);
        }
    }

    /// Notes for `perimelt check`: a sentence without a full stop, from a plugin by its position.
    fn note(&mut self, plugin: usize, message: String) {
        let plugin = self.label(plugin).to_string();
        self.notes.push(Warning { plugin, message });
    }

    /// Publishes a fact about a body, for all plugins where the calling one does so in `publish`, and for physics where a
    /// coupler does so in `prepare`.
    ///
    /// # Errors
    /// A second fact of a type of which a body has one ([`Fact::SECOND`]).
    pub fn publish<T: Fact>(&mut self, body: BodyIndex, fact: T) -> Result<(), SetupError> {
        let first = self.world.facts.of::<T>(body).next();
        if let (Some((first, _)), Some(rule)) = (first, T::SECOND) {
            return Err(self.broken_rule(rule, body, first));
        }
        let changes = fact.changes();
        for change in Change::ALL.into_iter().filter(|c| changes.contains(*c)) {
            self.happens(body, change);
        }
        self.world.facts.publish(body, self.current, fact);
        Ok(())
    }

    /// Declares that the calling coupler computes the whole of its effect on a body.
    ///
    /// # Errors
    /// A second coupler of type `C` on the body.
    pub fn once<C: 'static>(&mut self, body: BodyIndex) -> Result<(), SetupError> {
        self.publish(body, Once::<C>(PhantomData))
    }

    fn broken_rule(&self, rule: FactRule, body: BodyIndex, first: usize) -> SetupError {
        let message = rule.message.replace("{body}", &self.body(body).name);
        let message = message.replace("{first}", self.label(first));
        SetupError::value(rule.key, message, rule.expected)
    }

    /// Facts of a type about a body, for a plugin that takes them into account.
    pub fn facts<T: Fact>(&self, body: BodyIndex) -> impl Iterator<Item = &T> {
        self.world.facts.note_reader::<T>(body);
        self.world.facts(body)
    }

    /// Declares how the calling plugin is stepped; the default where it does not.
    pub fn stepping(&mut self, stepping: Stepping) {
        self.plugins[self.current].stepping = stepping;
    }

    /// Makes known what the calling plugin shares with others by its name, such as the path of a torch; in `publish`.
    pub fn share(&mut self, value: Rc<dyn Any>) {
        let name = self.label(self.current).to_string();
        self.shared.push((name, value));
    }

    /// What the coupler called `name` shares ([`Setup::share`]).
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
        found
            .map(|(_, value)| value)
            .ok_or_else(|| SetupError::unknown(key, what, name, all.by_ref().map(|(n, _)| n)))
    }

    /// Checks that what is read is provided, that what is added is consumed and that plugins support what happens to
    /// points. Each error comes with the plugin at fault.
    ///
    /// # Errors
    /// A body whose points cannot do what plugins ask for, else every access without its counterpart.
    pub fn finish(mut self) -> Result<Declared, Vec<(usize, SetupError)>> {
        self.check_changes().map_err(|mistake| vec![mistake])?;
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
            let plugin = self.label(d.plugin).to_string();
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
        for (fact, rule) in self.world.facts.unread() {
            let error = self.broken_rule(rule, fact.body, fact.plugin);
            mistakes.push((fact.plugin, error));
        }
        mistakes.extend(self.free_exchanges());
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        self.world.provided = provided;
        let requests = self.requests();
        Ok(Declared {
            requests,
            stepping: self.plugins.into_iter().map(|p| p.stepping).collect(),
            declarations: self.declarations,
            warnings: self.warnings,
            notes: self.notes,
            kept_families: self.kept_families,
        })
    }
}
