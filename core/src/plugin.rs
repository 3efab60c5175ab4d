//! The plugin contract: [`Physics`] and [`Coupler`], and how a plugin makes itself known.
//!
//! A plugin is a struct whose fields are the keys of its table in the case file. It
//! 1. derives `Serialize`, `Deserialize` (with `deny_unknown_fields`) and `JsonSchema`; doc
//!    comments of the fields, with units, become the help text of `perimelt explain`;
//! 2. implements [`Physics`] or [`Coupler`] under `#[typetag::serialize(name = "...")]`;
//! 3. registers with [`crate::register_physics!`] or [`crate::register_coupler!`].
//!
//! What it obtains at set-up (handles, families, work arrays) sits in a
//! `#[serde(skip)]` field. What must survive a restart and is not a field goes through
//! [`Physics::save`] and [`Physics::load`].

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::error::{RunError, SetupError};
use crate::programme::Programme;
use crate::setup::Setup;
use crate::solver::NewtonReport;
use crate::world::World;
use crate::world::changes::Changes;

/// A step in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Start, s.
    pub start: f64,
    /// Size, s; zero when couplers are applied for the initial state.
    pub size: f64,
    /// Nothing that couplers write has changed since the sub-step before: its couplers were
    /// not applied again, and sinks are as they were.
    pub repeated: bool,
}

impl Step {
    /// A step from `start` (s) of `size` (s).
    pub fn new(start: f64, size: f64) -> Step {
        Step {
            start,
            size,
            repeated: false,
        }
    }

    /// Middle of the step, s: where sources are evaluated, so that power which is linear in
    /// time is deposited exactly.
    pub fn middle(&self) -> f64 {
        self.start + 0.5 * self.size
    }

    /// End of the step, s: where prescribed values are evaluated.
    pub fn end(&self) -> f64 {
        self.start + self.size
    }
}

/// Step size of a physics: `"auto"` (the largest stable one with a safety factor) or seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StepSize {
    /// The largest stable step times the safety factor.
    #[default]
    Auto,
    /// A fixed step, s.
    Fixed(f64),
}

impl Serialize for StepSize {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            StepSize::Auto => serializer.serialize_str("auto"),
            StepSize::Fixed(step) => serializer.serialize_f64(*step),
        }
    }
}

/// By hand, because an untagged enum cannot say what it expected.
impl<'de> Deserialize<'de> for StepSize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct StepVisitor;
        impl de::Visitor<'_> for StepVisitor {
            type Value = StepSize;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"auto\" or a step above 0 s")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<StepSize, E> {
                match text {
                    "auto" => Ok(StepSize::Auto),
                    other => Err(E::invalid_value(de::Unexpected::Str(other), &self)),
                }
            }

            fn visit_f64<E: de::Error>(self, step: f64) -> Result<StepSize, E> {
                if step > 0.0 {
                    Ok(StepSize::Fixed(step))
                } else {
                    Err(E::invalid_value(de::Unexpected::Float(step), &self))
                }
            }

            fn visit_i64<E: de::Error>(self, step: i64) -> Result<StepSize, E> {
                self.visit_f64(step as f64)
            }

            fn visit_u64<E: de::Error>(self, step: u64) -> Result<StepSize, E> {
                self.visit_f64(step as f64)
            }
        }
        deserializer.deserialize_any(StepVisitor)
    }
}

impl JsonSchema for StepSize {
    fn schema_name() -> Cow<'static, str> {
        "StepSize".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schemars::json_schema!({ "oneOf": [{ "const": "auto" }, { "type": "number", "exclusiveMinimum": 0 }] })
    }
}

/// When a physics is advanced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// In every macro step.
    #[default]
    Step,
    /// Once for each log interval, just before the state is logged.
    Log,
}

/// How a physics wants to be stepped.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    /// Size of its (sub-)steps.
    pub step: StepSize,
    /// When it is advanced.
    pub update: Update,
}

/// What one advance cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Solver iterations or stages.
    pub iterations: usize,
    /// Evaluations of rates or forces and products with their tangent: what solvers compare by.
    pub evaluations: usize,
}

impl Work {
    /// Stages of an explicit step, each with one evaluation.
    pub fn of_stages(stages: usize) -> Self {
        Work {
            iterations: stages,
            evaluations: stages,
        }
    }
}

impl std::ops::Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Work {
            iterations: self.iterations + other.iterations,
            evaluations: self.evaluations + other.evaluations,
        }
    }
}

impl From<NewtonReport> for Work {
    fn from(report: NewtonReport) -> Self {
        Work {
            iterations: report.krylov_iterations,
            evaluations: report.evaluations,
        }
    }
}

/// A conserved total of a physics, all since the start of the run.
///
/// `stored - initial = supplied + error`
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Balance {
    /// What is conserved, such as `heat` or `momentum.x`.
    pub quantity: String,
    /// SI unit.
    pub unit: String,
    /// Total now.
    pub stored: f64,
    /// Total at the start.
    pub initial: f64,
    /// What came in through sources and boundaries, negative when it left.
    pub supplied: f64,
    /// How much there is of it and was exchanged: the sum of the absolute values of what points have, such as momenta,
    /// and of what sources and boundaries gave and took in each step. An error counts against it also where both
    /// changes and supplies cancel, as at the end of a cycle.
    #[serde(default)]
    pub size: f64,
    /// What came in with deposited material, a part of `supplied`; `None` where none is deposited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deposited: Option<f64>,
}

impl Balance {
    /// What is `stored` now and was at the start, and what came in since.
    pub fn new(quantity: &str, unit: &str, stored: f64, initial: f64, supplied: f64) -> Self {
        Balance {
            quantity: quantity.into(),
            unit: unit.into(),
            stored,
            initial,
            supplied,
            size: 0.0,
            deposited: None,
        }
    }

    /// The same, with the part of `supplied` that came in with deposited material.
    pub fn with_deposited(self, deposited: f64) -> Self {
        Balance {
            deposited: Some(deposited),
            ..self
        }
    }

    /// The same, with the [`Balance::size`] of the quantity.
    pub fn of_size(self, size: f64) -> Self {
        Balance { size, ..self }
    }

    /// `stored - initial - supplied`, in the unit of the quantity.
    pub fn error(&self) -> f64 {
        self.stored - self.initial - self.supplied
    }

    /// The error as a share of the largest of what is stored in excess, what was supplied, and the size.
    pub fn relative_error(&self) -> f64 {
        let excess = (self.stored - self.initial).abs();
        let scale = excess.max(self.supplied.abs()).max(self.size);
        if scale == 0.0 {
            self.error().abs()
        } else {
            self.error().abs() / scale
        }
    }
}

/// A number that a plugin reports for the progress log, such as deposited power.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Report {
    /// Name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value now.
    pub value: f64,
}

/// Something with a state that the scheduler steps.
#[typetag::serialize(tag = "type")]
pub trait Physics {
    /// Publishes facts about bodies that others need when they are prepared, whatever the order of the case, such as that
    /// it moves the points ([`Setup::publish`]).
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    fn publish(&mut self, _setup: &mut Setup<'_>) -> Result<(), SetupError> {
        Ok(())
    }

    /// Declares fields, obtains families and handles, checks the case.
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError>;

    /// Completes the initial state from the initial fields (not called on resume).
    ///
    /// # Errors
    /// [`RunError`] when the initial state cannot be completed.
    fn start(&mut self, _world: &World) -> Result<(), RunError> {
        Ok(())
    }

    /// How it wants to be stepped.
    fn clock(&self) -> Clock {
        Clock::default()
    }

    /// Largest step that is stable in every state that the run can reach, s; `None` when
    /// there is no limit. Asked once, before the first step, also on resume.
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        None
    }

    /// Largest macro step (s) from a time (s) on at which what others read from it is current enough, asked before each macro step
    /// and, for an estimate, of times to come; automatic macro steps respect it. Sub-steps follow from stability, which may allow
    /// longer steps than an accurate exchange.
    fn step_limit(&self, _time: f64) -> Option<f64> {
        None
    }

    /// Largest stable step (s) of a physics where it changes with the state, such as with the arrangement of moving
    /// points; asked before each macro step. It must follow from what [`Physics::save`] keeps, so that a resumed run
    /// takes the same steps.
    fn changed_stable_step(&self) -> Option<f64> {
        None
    }

    /// The next time after `after` (s) that a macro step must end on.
    fn next_event(&self, _after: f64) -> Option<f64> {
        None
    }

    /// Whether its state after a step does not depend on that before, as that of a steady state. Physics that exchange
    /// something and are all steady are advanced until their states agree.
    fn is_steady_state(&self) -> bool {
        false
    }

    /// What it does up to a certain time, as known for a run that ends at `_run_end` (s).
    fn programme(&self, _run_end: f64) -> Option<Programme> {
        None
    }

    /// Magnitudes of owned fields (by name) beyond which the run may have blown up: [`Physics::find_blow_up`] decides.
    fn plausible(&self, _world: &World) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// The point at which the run has blown up, asked when the value of an owned field (by name) at the point `first` is
    /// beyond its plausible magnitude; `None` where large values are no sign of it, such as the displacement of a body
    /// that flies. Values that are not finite always end a run.
    fn find_blow_up(&mut self, _world: &World, _field: &str, first: usize) -> Option<usize> {
        Some(first)
    }

    /// Advances its state fields over `step`.
    ///
    /// # Errors
    /// [`RunError`] when a solver fails.
    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError>;

    /// Examines its state at `time` (s) before that is logged, and at the end of the run.
    ///
    /// # Errors
    /// A state that cannot be right, such as an energy without source.
    fn examine(&mut self, _world: &World, _time: f64) -> Result<(), RunError> {
        Ok(())
    }

    /// Fills owned fields that nobody computes with, before a state is logged.
    fn observe(&mut self, _world: &World) {}

    /// Conserved totals.
    fn balance(&self, _world: &World) -> Vec<Balance> {
        Vec::new()
    }

    /// Numbers for the progress log, of the last state that was observed.
    fn report(&self) -> Vec<Report> {
        Vec::new()
    }

    /// States outside the validity of its model among those that were logged, as sentences without a full stop, asked at the
    /// end of the run.
    fn remarks(&self, _world: &World) -> Vec<String> {
        Vec::new()
    }

    /// Internal state that is not a field.
    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(())
    }

    /// Restores what [`Physics::save`] gave.
    ///
    /// # Errors
    /// When the data do not have the form of the state.
    fn load(
        &mut self,
        _state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        Ok(())
    }

    /// Called once a state was restored by [`Physics::load`], to publish what others read besides
    /// the fields.
    ///
    /// # Errors
    /// [`RunError`] when the state that was restored cannot be completed.
    fn restored(&mut self, _world: &World) -> Result<(), RunError> {
        Ok(())
    }
}

/// Something that carries what fields do to others, on one body or between two.
#[typetag::serialize(tag = "type")]
pub trait Coupler {
    /// Publishes what others need when they are prepared, whatever the order of the case: facts about bodies
    /// ([`Setup::publish`]) and what the coupler shares by its name, such as the path of a torch ([`Setup::share`]).
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    fn publish(&mut self, _setup: &mut Setup<'_>) -> Result<(), SetupError> {
        Ok(())
    }

    /// Declares fields, checks the case. Couplers are prepared before physics.
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError>;

    /// Writes or adds what it declared, for `step`.
    ///
    /// # Errors
    /// [`RunError`] when it cannot.
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError>;

    /// Takes decisions that depend on the state, such as the end of a wait; called before each macro step with the state
    /// at its start, `time` (s). Events and limits of the step follow. For the same state it must decide the same, since a
    /// resumed run calls it again.
    fn begin_step(&mut self, _world: &World, _time: f64) {}

    /// What its action still waited for at the end of the run, as a sentence without a full stop.
    fn unfinished(&self, _time: f64) -> Option<String> {
        None
    }

    /// The next time after `after` (s) at which its action has a kink or a jump; steps land on it.
    fn next_event(&self, _after: f64) -> Option<f64> {
        None
    }

    /// What it does up to a certain time, such as its toolpath, as known for a run that ends at `run_end` (s): a run that ends
    /// earlier warns. By default the events after the end of the run are its programme.
    fn programme(&self, run_end: f64) -> Option<Programme> {
        Programme::of_events(run_end, |after| self.next_event(after))
    }

    /// Whether its action depends on nothing but the fields that it reads: then it need not be
    /// applied again while they stay as they are.
    fn is_steady(&self) -> bool {
        false
    }

    /// Largest step from a time (s) on that still resolves its action, s, such as a source crossing a cell, asked before each macro
    /// step and, for an estimate, of times to come; automatic macro steps respect it. It must follow from the time and what
    /// [`Coupler::save`] keeps.
    fn step_limit(&self, _time: f64) -> Option<f64> {
        None
    }

    /// Largest stable step of its action, s, such as an exchange of heat or a contact: steps of the physics that take up
    /// what it adds are not longer, and a fixed one that is longer is refused. Asked once, before the first step, also
    /// on resume.
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        None
    }

    /// Numbers for the progress log.
    fn report(&self) -> Vec<Report> {
        Vec::new()
    }

    /// Internal state that is not a field.
    fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(())
    }

    /// Restores what [`Coupler::save`] gave.
    ///
    /// # Errors
    /// When the data do not have the form of the state.
    fn load(
        &mut self,
        _state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        Ok(())
    }

    /// Called once a state was restored by [`Coupler::load`], to publish what others read besides the fields.
    fn restored(&mut self, _world: &World) {}
}

/// Values by point from a checkpoint ([`Physics::load`], [`Coupler::load`]) of a body with this number of points.
///
/// # Errors
/// When the state cannot be read, or is that of another number of points.
pub fn load_points<T: serde::de::DeserializeOwned>(
    state: &mut dyn erased_serde::Deserializer<'_>,
    points: usize,
) -> Result<Vec<T>, erased_serde::Error> {
    let values: Vec<T> = erased_serde::deserialize(state)?;
    if values.len() == points {
        return Ok(values);
    }
    let found = values.len();
    let message = format!("values of {found} points for a body of {points} points");
    Err(serde::de::Error::custom(message))
}

/// Whether a list from a checkpoint has the length that the case gives it.
///
/// # Errors
/// It has another length.
pub fn check_length(what: &str, found: usize, expected: usize) -> Result<(), erased_serde::Error> {
    if found == expected {
        return Ok(());
    }
    let message = format!("{what}: {found} values, expected {expected}");
    Err(serde::de::Error::custom(message))
}

/// Builds a plugin of one kind from its table in a case file, keeping exact error positions.
pub type FromToml<P> = fn(toml::de::ValueDeserializer<'_>) -> Result<Box<P>, toml::de::Error>;

/// A registered kind of plugin.
pub struct Registration<P: ?Sized + 'static> {
    /// The `type` in case files.
    pub name: &'static str,
    /// Keys, types, defaults, documentation.
    pub schema: fn() -> Schema,
    /// Constructor.
    pub from_toml: FromToml<P>,
    /// What may happen to the points of the bodies on which it acts.
    pub supports: Changes,
}

inventory::collect!(Registration<dyn Physics>);
inventory::collect!(Registration<dyn Coupler>);

/// All registered plugins of one kind (`dyn Physics` or `dyn Coupler`), by name.
pub fn registered<P: ?Sized + 'static>() -> Vec<&'static Registration<P>>
where
    Registration<P>: inventory::Collect,
{
    let mut all: Vec<_> = inventory::iter::<Registration<P>>.into_iter().collect();
    all.sort_by_key(|r| r.name);
    all
}

/// What a plugin of this type supports; nothing where the type is not registered.
pub(crate) fn supported<P: ?Sized + 'static>(name: &str) -> Changes
where
    Registration<P>: inventory::Collect,
{
    let mut all = inventory::iter::<Registration<P>>.into_iter();
    all.find(|r| r.name == name)
        .map_or(Changes::NONE, |r| r.supports)
}

/// Makes a physics known under the name of its `typetag` attribute, with what may happen to the points of the bodies on
/// which it acts ([`Change`](crate::Change)); without a list, points have to rest and keep their material.
///
/// ```text
/// register_physics!("diffusion", Diffusion, supports: [Births, Cuts]);
/// ```
#[macro_export]
macro_rules! register_physics {
    ($name:literal, $physics:ty $(, supports: [$($change:ident),*])?) => {
        $crate::register!(dyn $crate::Physics, $name, $physics, [$($($change),*)?]);
    };
}

/// Makes a coupler known, as [`register_physics!`] does a physics.
#[macro_export]
macro_rules! register_coupler {
    ($name:literal, $coupler:ty $(, supports: [$($change:ident),*])?) => {
        $crate::register!(dyn $crate::Coupler, $name, $coupler, [$($($change),*)?]);
    };
}

/// Makes a material property known: its name, SI unit, meaning, and
/// [`ValueRange`](crate::material::ValueRange).
#[macro_export]
macro_rules! register_property {
    ($name:literal, $unit:literal, $meaning:literal, $range:expr) => {
        $crate::inventory::submit! {
            $crate::material::PropertyKey {
                name: $name,
                unit: $unit,
                meaning: $meaning,
                range: $range,
            }
        }
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! register {
    ($kind:ty, $name:literal, $plugin:ty, [$($change:ident),*]) => {
        $crate::inventory::submit! {
            $crate::plugin::Registration::<$kind> {
                name: $name,
                schema: || $crate::schemars::schema_for!($plugin),
                from_toml: |value| {
                    let plugin = <$plugin as $crate::serde::Deserialize>::deserialize(value)?;
                    Ok(Box::new(plugin))
                },
                supports: $crate::Changes::of(&[$($crate::Change::$change),*]),
            }
        }
    };
}
