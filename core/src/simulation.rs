//! A simulation: a world, its plugins, and the clock that steps them.
//!
//! 1. [`Simulation::prepare`] lets every plugin declare and obtain, and derives the order.
//! 2. Initial fields are set, then [`Simulation::start`] completes the initial state, or
//!    [`Simulation::load`] restores one.
//! 3. [`Simulation::step`] takes macro steps: each physics in case order advances by
//!    sub-steps of its own, before each of which its couplers are applied. Macro steps land
//!    exactly on log times and on events of couplers.
//!
//! Weak coupling is one pass in case order (Gauss-Seidel). With [`Iteration`] the pass is
//! repeated until the state at the end of the macro step stands still, relaxed by Aitken's
//! rule.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Problem, RunError, SetupError};
use crate::family::Horizon;
use crate::field::FieldIndex;
use crate::plugin::{Balance, Coupler, Physics, Report, Step, StepSize, Update};
use crate::schedule::Plan;
use crate::setup::Setup;
use crate::solver::reduce::{dot, max_abs};
use crate::world::World;

/// A plugin with the name that messages use.
pub struct Named<P: ?Sized> {
    /// Such as `thermal` or `goldak on plate`.
    pub label: String,
    /// The plugin.
    pub plugin: Box<P>,
}

/// Repetition of the staggered pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Iteration {
    /// Largest relative change of any state field between passes.
    pub tolerance: f64,
    /// Largest number of passes.
    pub passes: usize,
}

/// When to step, log and stop.
#[derive(Clone, Debug)]
pub struct TimeOptions {
    /// End, s.
    pub end: f64,
    /// Macro step.
    pub step: StepSize,
    /// Automatic steps are this share of the largest stable one.
    pub safety: f64,
    /// Simulated time between logged states, s.
    pub log_interval: f64,
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

/// A world, its plugins and the clock that steps them.
pub struct Simulation {
    world: World,
    couplers: Vec<Named<dyn Coupler>>,
    physics: Vec<Named<dyn Physics>>,
    plan: Plan,
    options: TimeOptions,
    clock: ClockState,
    sub_step: Vec<f64>,
    stable_step: Vec<Option<f64>>,
    plausible: Vec<Vec<(FieldIndex, f64)>>,
    family_sizes: Vec<FamilySize>,
}

/// Size of a family, for `check`.
#[derive(Clone, Debug)]
pub struct FamilySize {
    /// The body.
    pub body: usize,
    /// Horizon, m.
    pub horizon: Horizon,
    /// Directed bonds.
    pub bonds: usize,
    /// Bytes held.
    pub memory: usize,
}

/// A plugin at fault, by its kind and position in the case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Culprit {
    /// The n-th physics.
    Physics(usize),
    /// The n-th coupler.
    Coupler(usize),
}

/// Values of the owned fields of a physics, and its packed internal state.
type SavedPhysics = (Vec<Vec<f64>>, Vec<u8>);

#[derive(Serialize, Deserialize)]
struct SavedField {
    body: usize,
    name: String,
    #[serde(with = "serde_bytes")]
    values: Vec<u8>,
}

#[derive(Serialize, Deserialize)]
struct Checkpoint {
    clock: ClockState,
    fields: Vec<SavedField>,
    physics: Vec<serde_bytes::ByteBuf>,
    couplers: Vec<serde_bytes::ByteBuf>,
    /// Where the rows of moving families were found, m.
    rows_found_at: Vec<Vec<nalgebra::Vector3<f64>>>,
}

impl Simulation {
    /// Prepares every plugin and derives the order. `folder` is where relative paths start.
    ///
    /// # Errors
    /// The plugin at fault and its mistake.
    pub fn prepare(
        mut world: World,
        mut couplers: Vec<Named<dyn Coupler>>,
        mut physics: Vec<Named<dyn Physics>>,
        options: TimeOptions,
        folder: &Path,
    ) -> Result<Simulation, (Culprit, SetupError)> {
        let culprit = |plugin: usize, couplers: usize| match plugin.checked_sub(couplers) {
            Some(physics) => Culprit::Physics(physics),
            None => Culprit::Coupler(plugin),
        };
        let mut setup = Setup::new(&mut world, folder);
        for (i, c) in couplers.iter_mut().enumerate() {
            setup.next_plugin(&c.label);
            c.plugin
                .prepare(&mut setup)
                .map_err(|e| (Culprit::Coupler(i), e))?;
        }
        for (i, p) in physics.iter_mut().enumerate() {
            setup.next_plugin(&p.label);
            p.plugin
                .prepare(&mut setup)
                .map_err(|e| (Culprit::Physics(i), e))?;
        }
        let size = |(body, f): (usize, std::sync::Arc<crate::family::Family>)| FamilySize {
            body,
            horizon: f.spec().horizon,
            bonds: f.bonds(),
            memory: f.memory(),
        };
        let family_sizes = setup.families().map(size).collect();
        let declarations = setup
            .finish()
            .map_err(|(plugin, e)| (culprit(plugin, couplers.len()), e))?;
        let labels: Vec<String> = couplers
            .iter()
            .map(|c| &c.label)
            .chain(physics.iter().map(|p| &p.label))
            .cloned()
            .collect();
        let plan = Plan::derive(couplers.len(), physics.len(), &declarations, &labels).map_err(
            |problem| {
                let first = match &problem {
                    Problem::Cycle(names) => labels.iter().position(|l| Some(l) == names.first()),
                    _ => None,
                };
                (
                    culprit(first.unwrap_or(0), couplers.len()),
                    SetupError::new("", problem),
                )
            },
        )?;
        let progress = Progress {
            sub_steps: vec![0; physics.len()],
            iterations: vec![0; physics.len()],
            evaluations: vec![0; physics.len()],
            ..Progress::default()
        };
        let clock = ClockState {
            time: 0.0,
            logs: 0,
            advanced_to: vec![0.0; physics.len()],
            progress,
        };
        let count = physics.len();
        Ok(Simulation {
            world,
            couplers,
            physics,
            plan,
            options,
            clock,
            sub_step: vec![f64::INFINITY; count],
            stable_step: vec![None; count],
            plausible: vec![Vec::new(); count],
            family_sizes,
        })
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

    /// Families by size.
    pub fn family_sizes(&self) -> &[FamilySize] {
        &self.family_sizes
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
        for p in &mut self.physics {
            p.plugin.start(&self.world)?;
        }
        self.find_steps();
        let now = Step::new(0.0, 0.0);
        for p in 0..self.physics.len() {
            self.apply(p, now)?;
        }
        self.apply_rest(now)?;
        self.observe();
        Ok(())
    }

    fn observe(&mut self) {
        for p in &mut self.physics {
            p.plugin.observe(&self.world);
        }
    }

    fn find_steps(&mut self) {
        for (i, p) in self.physics.iter_mut().enumerate() {
            let stable = p.plugin.stable_step(&self.world);
            self.stable_step[i] = stable;
            self.sub_step[i] = match p.plugin.clock().step {
                StepSize::Fixed(step) => step,
                StepSize::Auto => stable.map_or(f64::INFINITY, |s| self.options.safety * s),
            };
            let find = |(name, limit): (&str, f64)| {
                let owned = self.plan.owned[i].iter().copied();
                let named = owned.filter(|&f| self.world.fields.field(f).name == name);
                named.map(|f| (f, limit)).collect::<Vec<_>>()
            };
            self.plausible[i] = p
                .plugin
                .plausible(&self.world)
                .into_iter()
                .flat_map(find)
                .collect();
        }
    }

    /// Takes up a stable step that changes during the run.
    fn limit_step(&mut self, p: usize) {
        let plugin = &self.physics[p].plugin;
        if let Some(stable) = plugin.changed_stable_step() {
            self.stable_step[p] = Some(stable);
            if plugin.clock().step == StepSize::Auto {
                self.sub_step[p] = self.options.safety * stable;
            }
        }
    }

    /// Refuses fixed steps above the stable ones.
    ///
    /// # Errors
    /// The physics at fault, with both numbers.
    pub fn check_steps(&self) -> Result<(), (Culprit, SetupError)> {
        for (i, p) in self.physics.iter().enumerate() {
            let (StepSize::Fixed(fixed), Some(stable)) =
                (p.plugin.clock().step, self.stable_step[i])
            else {
                continue;
            };
            if fixed > stable * (1.0 + 1e-9) {
                let problem = Problem::UnstableStep {
                    physics: p.label.clone(),
                    fixed,
                    stable,
                };
                return Err((Culprit::Physics(i), SetupError::new("step", problem)));
            }
        }
        Ok(())
    }

    /// Largest macro step, s: as asked for, or the longest sub-step that the couplers allow.
    pub fn macro_step(&self) -> f64 {
        if let StepSize::Fixed(step) = self.options.step {
            return step;
        }
        let longest = self
            .sub_step
            .iter()
            .copied()
            .filter(|s| s.is_finite())
            .fold(0.0, f64::max);
        let longest = if longest > 0.0 {
            longest
        } else {
            self.options.log_interval
        };
        self.couplers
            .iter()
            .filter_map(|c| c.plugin.step_limit())
            .fold(longest, f64::min)
    }

    /// The next time at which the state is to be logged, s.
    pub fn next_log(&self) -> f64 {
        ((self.clock.logs + 1) as f64 * self.options.log_interval).min(self.options.end)
    }

    /// Takes a macro step. Returns whether the state is now to be logged.
    ///
    /// # Errors
    /// What stops the run.
    pub fn step(&mut self) -> Result<bool, RunError> {
        (0..self.physics.len()).for_each(|p| self.limit_step(p));
        let time = self.clock.time;
        let log = self.next_log();
        let limit = self.macro_step();
        // an event within rounding of now, or of the log, is as good as reached
        let tolerance = 1e-9 * limit.min(log - time);
        let after = time + tolerance;
        let couplers = self
            .couplers
            .iter()
            .filter_map(|c| c.plugin.next_event(after));
        let physics = self
            .physics
            .iter()
            .filter_map(|p| p.plugin.next_event(after));
        let event = couplers.chain(physics).fold(log, f64::min);
        let target = if log - event <= tolerance { log } else { event };
        let steps = ((target - time) / limit * (1.0 - 1e-9)).ceil().max(1.0);
        let end = if steps == 1.0 {
            target
        } else {
            time + (target - time) / steps
        };
        let logging = steps == 1.0 && target == log;
        if end <= time {
            let count = (self.options.end - time) / limit;
            let physics = "the schedule".to_string();
            return Err(RunError::StepTooSmall {
                physics,
                step: end - time,
                time,
                count,
            });
        }

        match self.options.iteration {
            None => self.pass(end, logging)?,
            Some(iteration) => self.iterate(end, logging, iteration)?,
        }
        self.apply_rest(Step::new(time, end - time))?;
        self.clock.time = end;
        self.clock.progress.macro_steps += 1;
        self.clock.progress.last_step = end - time;
        if logging {
            self.observe();
            self.clock.logs += 1;
        }
        Ok(logging)
    }

    /// Whether the end is reached.
    pub fn is_finished(&self) -> bool {
        self.clock.time >= self.options.end
    }

    fn pass(&mut self, end: f64, logging: bool) -> Result<(), RunError> {
        self.clock.progress.passes += 1;
        for p in 0..self.physics.len() {
            if self.is_due(p, logging) {
                self.advance(p, end, logging)?;
                self.clock.advanced_to[p] = end;
            }
        }
        Ok(())
    }

    fn is_due(&self, physics: usize, logging: bool) -> bool {
        logging || self.physics[physics].plugin.clock().update == Update::Step
    }

    fn advance(&mut self, p: usize, end: f64, logging: bool) -> Result<(), RunError> {
        let start = self.clock.advanced_to[p];
        let count = ((end - start) / self.sub_step[p] * (1.0 - 1e-9))
            .ceil()
            .max(1.0);
        if count > 1e12 {
            let physics = self.physics[p].label.clone();
            return Err(RunError::StepTooSmall {
                physics,
                step: self.sub_step[p],
                time: start,
                count,
            });
        }
        let size = (end - start) / count;
        let count = count as u64;
        /// Between checks for blow-up: rare enough to cost nothing, often enough to name the time. What others see
        /// is always checked: the culprit is to be named, not its victim.
        const CHECK: u64 = 64;
        let steady = |&c: &usize| self.couplers[c].plugin.is_steady();
        let repeatable = self.plan.one_way[p] && self.plan.before[p].iter().all(steady);
        for s in 0..count {
            let step = Step {
                start: start + s as f64 * size,
                size,
                repeated: s > 0 && repeatable,
            };
            if !step.repeated {
                self.apply(p, step)?;
            }
            let advanced = self.physics[p].plugin.advance(&self.world, step);
            if advanced.is_err() {
                // a state that is not finite is the cause of whatever failed
                self.check_state(p, step)?;
            }
            let work = advanced?;
            self.clock.progress.sub_steps[p] += 1;
            self.clock.progress.iterations[p] += work.iterations as u64;
            self.clock.progress.evaluations[p] += work.evaluations as u64;
            let is_single = count == 1 && work.evaluations <= 1 && !logging;
            let is_last = s + 1 == count && !(is_single && self.physics.len() == 1);
            if is_last || self.clock.progress.sub_steps[p].is_multiple_of(CHECK) {
                self.check_state(p, step)?;
            }
        }
        Ok(())
    }

    fn apply(&mut self, p: usize, step: Step) -> Result<(), RunError> {
        for &sink in &self.plan.sinks[p] {
            self.world
                .fields
                .field(sink)
                .data_mut()
                .flat_mut()
                .fill(0.0);
        }
        for &c in &self.plan.before[p] {
            self.couplers[c].plugin.apply(&self.world, step)?;
        }
        Ok(())
    }

    fn apply_rest(&mut self, step: Step) -> Result<(), RunError> {
        for &c in &self.plan.after {
            self.couplers[c].plugin.apply(&self.world, step)?;
        }
        Ok(())
    }

    fn check_state(&self, p: usize, step: Step) -> Result<(), RunError> {
        for &index in &self.plan.owned[p] {
            let field = self.world.fields.field(index);
            let limit = self.plausible[p]
                .iter()
                .find(|(f, _)| *f == index)
                .map_or(f64::MAX, |(_, l)| *l);
            let data = field.data();
            if max_abs(data.flat()) <= limit {
                continue;
            }
            let components = data.components();
            let body = &self.world.bodies[field.body];
            let at = data
                .flat()
                .iter()
                .position(|v| !(v.abs() <= limit))
                .unwrap_or(0);
            return Err(RunError::BlowUp {
                physics: self.physics[p].label.clone(),
                field: field.name.clone(),
                body: body.name.clone(),
                point: at / components,
                position: body.points.position[at / components].into(),
                value: data.flat()[at],
                time: step.end(),
                step: step.size,
                stable: self.stable_step[p],
            });
        }
        Ok(())
    }

    /// Repeats the pass from the same start until the end state stands still. The state that
    /// a physics sees of later ones is that of the pass before, relaxed by Aitken's rule; the
    /// last pass is not relaxed, so that balances hold.
    fn iterate(&mut self, end: f64, logging: bool, iteration: Iteration) -> Result<(), RunError> {
        let before = self.save_physics()?;
        let couplers_before = self.save_couplers()?;
        let advanced_to = self.clock.advanced_to.clone();
        let mut guess: Option<Vec<Vec<f64>>> = None;
        let mut last_residual: Vec<f64> = Vec::new();
        let mut relaxation = 1.0;
        for pass in 1..=iteration.passes {
            if pass > 1 {
                self.restore_couplers(&couplers_before)?;
            }
            for p in 0..self.physics.len() {
                if !self.is_due(p, logging) {
                    continue;
                }
                if pass > 1 {
                    self.restore_physics(p, &before[p])?;
                    self.clock.advanced_to[p] = advanced_to[p];
                }
                self.advance(p, end, logging)?;
                self.clock.advanced_to[p] = end;
            }
            self.clock.progress.passes += 1;
            let result: Vec<Vec<f64>> = self
                .plan
                .owned
                .iter()
                .flatten()
                .map(|&f| self.world.fields.field(f).data().flat().to_vec())
                .collect();
            let Some(old) = guess else {
                guess = Some(result);
                continue;
            };
            let change = |(new, old): (&Vec<f64>, &Vec<f64>)| {
                let worst = new
                    .iter()
                    .zip(old)
                    .map(|(n, o)| (n - o).abs())
                    .fold(0.0, f64::max);
                worst / max_abs(new).max(f64::MIN_POSITIVE)
            };
            let changed = result.iter().zip(&old).map(change).fold(0.0, f64::max);
            if changed <= iteration.tolerance || pass == iteration.passes {
                return Ok(());
            }
            let residual: Vec<f64> = result
                .iter()
                .zip(&old)
                .flat_map(|(n, o)| {
                    // fields of all units count alike
                    let scale = max_abs(n).max(f64::MIN_POSITIVE);
                    n.iter().zip(o).map(move |(n, o)| (n - o) / scale)
                })
                .collect();
            if !last_residual.is_empty() {
                let difference: Vec<f64> = residual
                    .iter()
                    .zip(&last_residual)
                    .map(|(r, l)| r - l)
                    .collect();
                let curvature = dot(&difference, &difference);
                if curvature > 0.0 {
                    relaxation *= -dot(&last_residual, &difference) / curvature;
                    relaxation = relaxation.clamp(0.05, 1.5);
                }
            }
            let relaxed: Vec<Vec<f64>> = result
                .iter()
                .zip(&old)
                .map(|(n, o)| {
                    n.iter()
                        .zip(o)
                        .map(|(n, o)| o + relaxation * (n - o))
                        .collect()
                })
                .collect();
            for (&f, values) in self.plan.owned.iter().flatten().zip(&relaxed) {
                self.world
                    .fields
                    .field(f)
                    .data_mut()
                    .flat_mut()
                    .copy_from_slice(values);
            }
            last_residual = residual;
            guess = Some(relaxed);
        }
        Ok(())
    }

    fn save_physics(&self) -> Result<Vec<SavedPhysics>, RunError> {
        let save = |(p, owned): (&Named<dyn Physics>, &Vec<FieldIndex>)| {
            let fields = owned
                .iter()
                .map(|&f| self.world.fields.field(f).data().flat().to_vec())
                .collect();
            Ok((fields, pack(&*p.plugin.save())?))
        };
        self.physics
            .iter()
            .zip(&self.plan.owned)
            .map(save)
            .collect()
    }

    fn restore_physics(&mut self, p: usize, saved: &SavedPhysics) -> Result<(), RunError> {
        for (&f, values) in self.plan.owned[p].iter().zip(&saved.0) {
            self.world
                .fields
                .field(f)
                .data_mut()
                .flat_mut()
                .copy_from_slice(values);
        }
        let label = self.physics[p].label.clone();
        let mut source = rmp_serde::Deserializer::from_read_ref(&saved.1);
        let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut source);
        let broken =
            |e: erased_serde::Error| RunError::Checkpoint(format!("state of {label}: {e}"));
        let physics = &mut self.physics[p].plugin;
        physics.load(&mut erased).map_err(broken)?;
        physics.restored(&self.world)
    }

    fn save_couplers(&self) -> Result<Vec<serde_bytes::ByteBuf>, RunError> {
        let save = |c: &Named<dyn Coupler>| Ok(pack(&*c.plugin.save())?.into());
        self.couplers.iter().map(save).collect()
    }

    fn restore_couplers(&mut self, saved: &[serde_bytes::ByteBuf]) -> Result<(), RunError> {
        for (c, state) in self.couplers.iter_mut().zip(saved) {
            let mut source = rmp_serde::Deserializer::from_read_ref(state);
            let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut source);
            let broken = |e| RunError::Checkpoint(format!("state of {}: {e}", c.label));
            c.plugin.load(&mut erased).map_err(broken)?;
        }
        Ok(())
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
            .chain(physics.map(|p| (p.label.as_str(), p.plugin.report())))
            .collect()
    }

    /// Fields that somebody provides: state or derived values, not sums that are rebuilt in
    /// every step.
    pub fn lasting(&self) -> impl Iterator<Item = &crate::field::Field> {
        let is_sink = |i: &usize| self.plan.sinks.iter().any(|s| s.contains(i));
        let fields = self.world.fields.iter().enumerate();
        fields
            .filter(move |(i, _)| self.world.provided[*i] && !is_sink(i))
            .map(|(_, f)| f)
    }

    /// Everything needed to go on, bit by bit.
    ///
    /// # Errors
    /// When a plugin's state cannot be serialised.
    pub fn save(&self) -> Result<Vec<u8>, RunError> {
        let fields = self.lasting().map(|f| SavedField {
            body: f.body,
            name: f.name.clone(),
            values: f
                .data()
                .flat()
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        });
        let checkpoint = Checkpoint {
            clock: self.clock.clone(),
            fields: fields.collect(),
            physics: self
                .physics
                .iter()
                .map(|p| Ok(pack(&*p.plugin.save())?.into()))
                .collect::<Result<_, RunError>>()?,
            couplers: self.save_couplers()?,
            rows_found_at: self.world.rows_found_at(),
        };
        rmp_serde::to_vec(&checkpoint).map_err(|e| RunError::Checkpoint(e.to_string()))
    }

    /// Restores what [`Simulation::save`] gave, instead of [`Simulation::start`].
    ///
    /// # Errors
    /// When the data are damaged or belong to another case.
    pub fn load(&mut self, checkpoint: &[u8]) -> Result<(), RunError> {
        let misfit = |what: String| RunError::Checkpoint(what);
        let saved: Checkpoint =
            rmp_serde::from_slice(checkpoint).map_err(|e| misfit(e.to_string()))?;
        if saved.physics.len() != self.physics.len() || saved.couplers.len() != self.couplers.len()
        {
            return Err(misfit("it has other plugins".into()));
        }
        for f in &saved.fields {
            let index = self.world.fields.find(f.body, &f.name);
            let field = index.map(|i| self.world.fields.field(i));
            let field = field.ok_or_else(|| misfit(format!("it has a field `{}`", f.name)))?;
            let mut data = field.data_mut();
            let values = data.flat_mut();
            if values.len() * 8 != f.values.len() {
                return Err(misfit(format!(
                    "field `{}` has another number of points",
                    f.name
                )));
            }
            for (v, bytes) in values.iter_mut().zip(f.values.chunks_exact(8)) {
                *v = f64::from_le_bytes(bytes.try_into().expect("chunks of eight"));
            }
        }
        if !self.world.find_rows_at(saved.rows_found_at) {
            return Err(misfit("it has other families of moving points".into()));
        }
        for (p, state) in self.physics.iter_mut().zip(&saved.physics) {
            let mut source = rmp_serde::Deserializer::from_read_ref(state);
            let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut source);
            p.plugin
                .load(&mut erased)
                .map_err(|e| misfit(format!("state of {}: {e}", p.label)))?;
            p.plugin.restored(&self.world)?;
        }
        self.restore_couplers(&saved.couplers)?;
        self.clock = saved.clock;
        self.find_steps();
        Ok(())
    }

    /// The plugins as composed, all defaults filled in: `{"physics": [...], "couplers": [...]}`.
    pub fn composition(&self) -> serde_json::Value {
        let physics: Vec<_> = self
            .physics
            .iter()
            .map(|p| serde_json::to_value(&p.plugin).unwrap_or_default())
            .collect();
        let couplers: Vec<_> = self
            .couplers
            .iter()
            .map(|c| serde_json::to_value(&c.plugin).unwrap_or_default())
            .collect();
        serde_json::json!({ "physics": physics, "couplers": couplers })
    }
}

fn pack(state: &dyn erased_serde::Serialize) -> Result<Vec<u8>, RunError> {
    let mut bytes = Vec::new();
    let mut target = rmp_serde::Serializer::new(&mut bytes);
    let mut erased = <dyn erased_serde::Serializer>::erase(&mut target);
    state
        .erased_serialize(&mut erased)
        .map_err(|e| RunError::Checkpoint(e.to_string()))?;
    Ok(bytes)
}
