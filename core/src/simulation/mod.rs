//! A simulation: a world, its plugins, and the clock that steps them.
//!
//! 1. [`Simulation::prepare`] lets every plugin declare and obtain, and derives the order.
//! 2. Initial fields are set, then [`Simulation::start`] completes the initial state, or
//!    [`Simulation::load`] restores one.
//! 3. [`Simulation::step`] takes macro steps: each physics in case order advances by
//!    sub-steps of its own, before each of which its couplers are applied; physics that exchange something advance
//!    together, in the steps of their group ([`crate::schedule`]). Macro steps land exactly on log times and on
//!    events of couplers.
//!
//! Weak coupling is one pass in case order (Gauss-Seidel). With [`Iteration`] the pass is
//! repeated until the state at the end of the macro step stands still, relaxed by Aitken's
//! rule.

mod advance;
mod checkpoint;
mod iteration;
mod log_times;
mod prepare;
mod remaining;
mod steps;

#[cfg(test)]
mod tests;

pub use checkpoint::ByteCount;
pub use iteration::{Iteration, Unconverged};
pub use log_times::{LogStage, LogTimes};
pub use prepare::{Culprit, Faults};
pub use remaining::Remaining;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Problem, RunError};
use crate::family;
use crate::plugin::{Balance, Report, RunningCoupler, RunningPhysics};
use crate::programme::Programme;
use crate::schedule::Plan;
use crate::setup::{FamilyRequest, Warning};
use crate::stepping::{Step, StepSize, Stepping};
use crate::world::World;
use crate::world::families::FamilySize;

/// A plugin with the name that messages use.
pub struct Named<P: ?Sized> {
    /// Such as `thermal` or `goldak on plate`.
    pub label: String,
    /// The plugin.
    pub plugin: Box<P>,
}

/// A plugin that is ready to run.
struct Ready<P: ?Sized> {
    label: String,
    plugin: Box<P>,
    stepping: Stepping,
}

/// A part of the run with a macro step of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Start, s.
    pub from: f64,
    /// Macro step from then on, s, or "auto".
    pub step: StepSize,
}

/// When to step, log and stop.
#[derive(Clone, Debug)]
pub struct TimeOptions {
    /// End, s.
    pub end: f64,
    /// Macro step.
    pub step: StepSize,
    /// Macro steps from later times on, in the order of time.
    pub stages: Vec<Stage>,
    /// Automatic steps are this share of the largest stable one.
    pub safety: f64,
    /// Times of logged states.
    pub log: LogTimes,
    /// Repetition of passes, if any.
    pub iteration: Option<Iteration>,
}

/// Counters of the work done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Macro steps so far.
    pub macro_steps: u64,
    /// Sub-steps so far, by physics.
    pub sub_steps: Vec<u64>,
    /// Solver iterations so far, by physics.
    pub iterations: Vec<u64>,
    /// Evaluations of rates or forces so far, by physics.
    pub evaluations: Vec<u64>,
    /// Passes so far.
    pub passes: u64,
    /// Macro steps so far whose repeated passes did not meet their tolerance.
    #[serde(default)]
    pub unconverged: u64,
    /// Last macro step, s.
    pub last_step: f64,
}

/// State of the clock, saved with every checkpoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct ClockState {
    time: f64,
    logs: u64,
    advanced_to: Vec<f64>,
    progress: Progress,
}

impl ClockState {
    fn at_start(physics: usize) -> Self {
        ClockState {
            time: 0.0,
            logs: 0,
            advanced_to: vec![0.0; physics],
            progress: Progress {
                sub_steps: vec![0; physics],
                iterations: vec![0; physics],
                evaluations: vec![0; physics],
                ..Progress::default()
            },
        }
    }
}

/// A world, its plugins and the clock that steps them.
pub struct Simulation {
    world: World,
    couplers: Vec<Ready<dyn RunningCoupler>>,
    physics: Vec<Ready<dyn RunningPhysics>>,
    /// The plugins as composed.
    composition: serde_json::Value,
    plan: Plan,
    options: TimeOptions,
    clock: ClockState,
    sub_step: Vec<f64>,
    stable_step: Vec<Option<f64>>,
    /// By coupler, s.
    stable_exchange: Vec<Option<f64>>,
    /// By group, s.
    group_steps: Vec<f64>,
    /// What the exchanges of each group added in its present step, by sink.
    rates: Vec<Vec<Vec<f64>>>,
    family_sizes: Vec<FamilySize>,
    /// Families of points that stay.
    requests: Vec<FamilyRequest>,
    warnings: Vec<Warning>,
    notes: Vec<Warning>,
    /// Wall time of the sub-steps of each physics so far, with their couplers, s; not a part of the state.
    wall: Vec<f64>,
}

impl Simulation {
    /// What the user may want to know about the set-up and is no mistake, such as faces that a boundary leaves out.
    pub fn notes(&self) -> &[Warning] {
        &self.notes
    }

    /// The world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Simulated time, s.
    pub fn time(&self) -> f64 {
        self.clock.time
    }

    /// When to step, log and stop.
    pub fn options(&self) -> &TimeOptions {
        &self.options
    }

    /// Counters of the work done.
    pub fn progress(&self) -> &Progress {
        &self.clock.progress
    }

    /// Wall time of the sub-steps of each physics since this simulation was prepared, with the couplers before them, s.
    pub fn wall_seconds(&self) -> &[f64] {
        &self.wall
    }

    /// The order of couplers.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Names of physics in case order.
    pub fn physics_labels(&self) -> impl Iterator<Item = &str> {
        self.physics.iter().map(|p| p.label.as_str())
    }

    /// Names of couplers in case order.
    pub fn coupler_labels(&self) -> impl Iterator<Item = &str> {
        self.couplers.iter().map(|c| c.label.as_str())
    }

    /// Sizes of the families of all bodies, also of those that plugins keep for themselves.
    pub fn family_sizes(&self) -> &[FamilySize] {
        &self.family_sizes
    }

    /// Adds what the composer of the simulation noticed.
    pub fn warn(&mut self, warning: Warning) {
        self.warnings.push(warning);
    }

    /// What may be a mistake: what plugins noticed at set-up, then gaps and jumps of spacing that families bridge.
    /// Looks through all families.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = self.warnings.clone();
        for request in &self.requests {
            let body = &self.world.bodies[request.body];
            for message in family::warnings(body, &request.spec) {
                if !warnings.iter().any(|w| w.message == message) {
                    let plugin = request.plugin.clone();
                    warnings.push(Warning { plugin, message });
                }
            }
        }
        warnings
    }

    /// Sub-step of each physics, s (infinite: as long as the macro step).
    pub fn sub_steps(&self) -> &[f64] {
        &self.sub_step
    }

    /// Largest stable step of each physics, s.
    pub fn stable_steps(&self) -> &[Option<f64>] {
        &self.stable_step
    }

    /// Sets an initial field, by component, on some points of a body.
    ///
    /// # Errors
    /// When the body has no such field or the number of components differs.
    pub fn set_initial(
        &mut self,
        body: usize,
        field: &str,
        points: impl Iterator<Item = usize>,
        value: &[f64],
    ) -> Result<(), Problem> {
        let fields = &self.world.fields;
        let Some(index) = fields.find(body, field) else {
            let known = fields
                .iter()
                .filter(|f| f.body == body)
                .map(|f| f.name.clone())
                .collect();
            return Err(Problem::UnknownName {
                what: "field",
                name: field.into(),
                known,
            });
        };
        let mut data = fields.field(index).data_mut();
        let components = data.components();
        if components != value.len() {
            return Err(Problem::FieldType {
                field: field.into(),
                asked: value.len(),
                present: components,
            });
        }
        let values = data.flat_mut();
        for point in points {
            values[point * components..][..components].copy_from_slice(value);
        }
        Ok(())
    }

    /// Completes the initial state from the initial fields, and the step sizes.
    ///
    /// # Errors
    /// A physics that cannot start.
    pub fn start(&mut self) -> Result<(), RunError> {
        for (p, physics) in self.physics.iter_mut().enumerate() {
            physics.plugin.start(&self.world)?;
            self.world.exchange(&self.plan.state[p]);
        }
        self.find_steps();
        self.apply_all(Step::new(0.0, 0.0))?;
        self.observe()
    }

    /// Whether the end is reached.
    pub fn is_finished(&self) -> bool {
        self.clock.time >= self.options.end
    }

    /// Lets physics examine and complete the state before it is logged.
    fn observe(&mut self) -> Result<(), RunError> {
        let time = self.clock.time;
        let mut physics = self.physics.iter_mut();
        physics.try_for_each(|p| p.plugin.observe(&self.world, time))?;
        self.assemble();
        Ok(())
    }

    /// Brings [`Simulation::observed`] up to date.
    fn assemble(&mut self) {
        let lasting: Vec<_> = self.lasting_indices().collect();
        self.world.assemble(&lasting);
    }

    /// The world as it is to be looked at: with whole bodies, also where several processes share them. It has then the last logged state, in the first process.
    pub fn observed(&self) -> &World {
        self.world.observed()
    }

    /// Conserved totals of all physics: label and balances.
    pub fn balances(&self) -> Vec<(&str, Vec<Balance>)> {
        self.physics
            .iter()
            .map(|p| (p.label.as_str(), p.plugin.balance(&self.world)))
            .collect()
    }

    /// What plugins report: label and numbers.
    pub fn reports(&self) -> Vec<(&str, Vec<Report>)> {
        let couplers = self.couplers.iter();
        let couplers = couplers.map(|c| (c.label.as_str(), c.plugin.report()));
        let physics = self.physics.iter();
        couplers
            .chain(physics.map(|p| (p.label.as_str(), p.plugin.report(&self.world).numbers)))
            .collect()
    }

    /// Programmes of all plugins with their names, as known at a time (s): those that they state, or their events after that
    /// time.
    fn programmes(&self, time: f64) -> impl Iterator<Item = (&str, Programme)> {
        let couplers = self.couplers.iter().map(move |c| {
            let limits = |after| c.plugin.step_limits(after);
            (c.label.as_str(), c.stepping.programme_at(time, limits))
        });
        let physics = self.physics.iter().map(move |p| {
            let limits = |after| p.plugin.step_limits(after);
            (p.label.as_str(), p.stepping.programme_at(time, limits))
        });
        let all = couplers.chain(physics);
        all.filter_map(|(label, programme)| Some((label, programme?)))
    }

    /// What plugins still wait for: their names and a sentence.
    pub fn unfinished(&self) -> Vec<(&str, String)> {
        let programmes = self.programmes(self.clock.time);
        programmes
            .filter_map(|(label, programme)| Some((label, programme.waits?)))
            .collect()
    }

    /// Programmes of plugins that the run does not reach the end of: names of the plugins and a sentence. Plugins that wait at the end
    /// are left out.
    pub fn unreached(&self) -> Vec<(&str, String)> {
        let end = self.options.end;
        let is_waiting = |p: &Programme| self.is_finished() && p.waits.is_some();
        let programmes = self.programmes(end).filter(|(_, p)| !is_waiting(p));
        programmes
            .filter_map(|(label, programme)| Some((label, programme.unreached(end)?)))
            .collect()
    }

    /// What physics say of states outside the validity of their models: their names and a sentence.
    pub fn remarks(&self) -> Vec<(&str, String)> {
        let remarks = |p: &'_ Ready<dyn RunningPhysics>| p.plugin.report(&self.world).remarks;
        let physics = self.physics.iter();
        physics
            .flat_map(|p| remarks(p).into_iter().map(|r| (p.label.as_str(), r)))
            .collect()
    }

    /// Fields of [`Simulation::observed`] that somebody provides: state or derived values, not sums that are rebuilt in
    /// every step.
    pub fn lasting(&self) -> impl Iterator<Item = &crate::field::Field> {
        self.lasting_indices()
            .map(|i| self.observed().fields.field(i))
    }

    /// Those of [`Simulation::lasting`] to which a case may give initial values.
    pub fn initial(&self) -> impl Iterator<Item = &crate::field::Field> {
        let indices = self.lasting_indices();
        let given = indices.filter(|i| !self.world.derived.contains(i));
        given.map(|i| self.world.fields.field(i))
    }

    /// [`Simulation::lasting`], and what physics keep for themselves.
    fn saved_indices(&self) -> impl Iterator<Item = usize> {
        let state = self
            .plan
            .state
            .iter()
            .zip(&self.plan.owned)
            .flat_map(|(s, owned)| &s[owned.len()..]);
        self.lasting_indices().chain(state.copied())
    }

    fn lasting_indices(&self) -> impl Iterator<Item = usize> {
        let is_sink = |i: &usize| self.plan.sinks.iter().any(|s| s.contains(i));
        let fields = 0..self.world.fields.iter().count();
        fields.filter(move |i| self.world.provided[*i] && !is_sink(i))
    }

    /// The plugins as composed, all defaults filled in: `{"physics": [...], "couplers": [...]}`.
    pub fn composition(&self) -> serde_json::Value {
        self.composition.clone()
    }
}
