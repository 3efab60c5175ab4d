//! The plugin contract: [`Physics`] and [`Coupler`], and how a plugin makes itself known.
//!
//! A plugin is a struct whose fields are the keys of its table in the case file. It
//! 1. derives `Serialize`, `Deserialize` (with `deny_unknown_fields`) and `JsonSchema`; doc
//!    comments of the fields, with units, become the help text of `perimelt explain`;
//! 2. implements [`Physics`] or [`Coupler`] under `#[typetag::serialize(name = "...")]`;
//! 3. registers with [`crate::register_physics!`] or [`crate::register_coupler!`].
//!
//! At set-up [`Physics::prepare`] and [`Coupler::prepare`] turn the keys into the object that runs, with the handles,
//! families and work arrays that it needs. What must survive a restart and is not a field goes through `save` and `load`.

mod balance;
mod registry;

pub use balance::{Balance, PhysicsReport, Report};
pub(crate) use registry::supported;
pub use registry::{FromToml, Registration, registered};

use crate::error::{RunError, SetupError};
use crate::setup::Setup;
use crate::stepping::{Step, StepLimits, Work};
use crate::world::World;

/// A plugin that is ready to run, or the mistake in its keys.
pub type Prepared<T> = Result<Box<T>, SetupError>;

/// State that a plugin saved.
pub type SavedState<'a, 'de> = &'a mut dyn erased_serde::Deserializer<'de>;

/// Why a saved state cannot be read.
pub use erased_serde::Error as LoadError;

/// The keys of something with a state that the scheduler steps.
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

    /// Declares fields, obtains families and handles, checks the case; the physics that runs.
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics>;
}

/// A physics that is ready to run.
pub trait RunningPhysics {
    /// Completes the initial state from the initial fields (not called on resume).
    ///
    /// # Errors
    /// [`RunError`] when the initial state cannot be completed.
    fn start(&mut self, _world: &World) -> Result<(), RunError> {
        Ok(())
    }

    /// Largest stable step, s; `None` when there is no limit. Asked before each macro step: what is expensive to find is
    /// kept. It must follow from the fields and what [`RunningPhysics::save`] keeps, so that a resumed run takes the same
    /// steps.
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        None
    }

    /// What else limits steps from a time (s) on, asked before each macro step and, for an estimate, of times to come.
    fn step_limits(&self, _time: f64) -> StepLimits {
        StepLimits::default()
    }

    /// Advances its state fields over `step`.
    ///
    /// # Errors
    /// [`RunError`] when a solver fails.
    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError>;

    /// The point at which the run has blown up, by the `largest` finite magnitude of a component of an owned field (by
    /// name); `None` where the value is plausible. Values that are not finite always end a run.
    fn find_blow_up(&mut self, _world: &World, _field: &str, _largest: f64) -> Option<usize> {
        None
    }

    /// Examines its state at a time (s) before that is logged, and fills owned fields with which nobody computes.
    ///
    /// # Errors
    /// A state that cannot be right, such as an energy without source.
    fn observe(&mut self, _world: &World, _time: f64) -> Result<(), RunError> {
        Ok(())
    }

    /// Conserved totals.
    fn balance(&self, _world: &World) -> Vec<Balance> {
        Vec::new()
    }

    /// Numbers for the progress log and remarks for the end of the run.
    fn report(&self, _world: &World) -> PhysicsReport {
        PhysicsReport::default()
    }

    /// Internal state that is not a field, of the whole body ([`World::whole_of`], [`World::rows_of_whole`]).
    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(())
    }

    /// Restores what [`RunningPhysics::save`] gave, with the fields restored already, and publishes what others read
    /// besides them.
    ///
    /// # Errors
    /// When the data do not have the form of the state.
    fn load(&mut self, _world: &World, _state: SavedState<'_, '_>) -> Result<(), LoadError> {
        Ok(())
    }
}

/// The keys of something that carries what fields do to others, on one body or between two.
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

    /// Declares fields, checks the case; the coupler that runs. Couplers are prepared before physics.
    ///
    /// # Errors
    /// [`SetupError`] with the key to blame.
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler>;
}

/// A coupler that is ready to run.
pub trait RunningCoupler {
    /// Takes decisions that depend on the state, such as the end of a wait; called before each macro step with the state
    /// at its start, `time` (s). Events and limits of the step follow. For the same state it must decide the same, since a
    /// resumed run calls it again.
    fn begin_step(&mut self, _world: &World, _time: f64) {}

    /// Writes or adds what it declared, for `step`.
    ///
    /// # Errors
    /// [`RunError`] when it cannot.
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError>;

    /// Largest stable step of its action, s, such as an exchange of heat or a contact: steps of the physics that take up
    /// what it adds are not longer, and a fixed one that is longer is refused. Asked once, before the first step, also
    /// on resume.
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        None
    }

    /// What limits steps from a time (s) on, asked before each macro step and, for an estimate, of times to come. It must
    /// follow from the time and what [`RunningCoupler::save`] keeps.
    fn step_limits(&self, _time: f64) -> StepLimits {
        StepLimits::default()
    }

    /// Numbers for the progress log.
    fn report(&self) -> Vec<Report> {
        Vec::new()
    }

    /// Internal state that is not a field, of the whole body ([`World::whole_of`]).
    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(())
    }

    /// Restores what [`RunningCoupler::save`] gave, with the fields restored already, and publishes what others read
    /// besides them.
    ///
    /// # Errors
    /// When the data do not have the form of the state.
    fn load(&mut self, _world: &World, _state: SavedState<'_, '_>) -> Result<(), LoadError> {
        Ok(())
    }
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
