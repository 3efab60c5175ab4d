//! Runs of cases, each with the measurements of all checks that concern it.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::Instant;

use perimelt_core::{RunError, Simulation};

use super::audit::Audit;
use super::check::{Check, Measure};
use super::measurement::Measurement;
use super::table::Outcome;
use super::{Planned, VerifyError};
use crate::case::Case;
use crate::run::Failure;
use crate::run::display::Display;
use crate::terminal::tell;
use crate::unit::duration;

/// Results of a run.
pub(super) struct MeasuredRun {
    /// Values or the reason why there are none, by planned check; checks of other cases have none.
    measured: Vec<Result<Vec<f64>, String>>,
    /// Why the run did not reach its end.
    stopped: Option<String>,
    audit: Audit,
    /// Wall time, s.
    pub(super) seconds: f64,
}

/// Runs cases in their order, as many at a time as there are threads. One run scales with threads only as far as its
/// size allows, several runs always do, and the results of a run do not depend on its threads. Fewer cases than threads
/// share the threads.
///
/// # Errors
/// Threads that cannot be started.
pub(super) fn run_side_by_side<'c>(
    cases: &[&'c (String, Case)],
    planned: &[Planned],
) -> Result<BTreeMap<&'c str, MeasuredRun>, VerifyError> {
    let threads = rayon::current_num_threads();
    let workers = threads.min(cases.len()).max(1);
    let pools = (0..workers).map(|_| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads / workers);
        pool.build()
    });
    let pools: Vec<rayon::ThreadPool> = pools.collect::<Result<_, _>>()?;
    let is_alone = workers == 1;
    let waiting = Mutex::new(cases.iter());
    let runs = Mutex::new(BTreeMap::new());
    let poisoned = "no thread panics while it holds the lock";
    std::thread::scope(|scope| {
        for pool in &pools {
            scope.spawn(|| {
                loop {
                    let Some((name, case)) = waiting.lock().expect(poisoned).next() else {
                        break;
                    };
                    let run = pool.install(|| MeasuredRun::of(name, case, planned, is_alone));
                    runs.lock().expect(poisoned).insert(name.as_str(), run);
                }
            });
        }
    });
    Ok(runs.into_inner().expect(poisoned))
}

impl MeasuredRun {
    /// Runs a case to its end and takes the measurements that concern it. A bar shows the progress of a run that is
    /// alone.
    fn of(name: &str, case: &Case, planned: &[Planned], is_alone: bool) -> MeasuredRun {
        let started = Instant::now();
        let mut simulation = match case.compose() {
            Ok(simulation) => simulation,
            Err(mistake) => return MeasuredRun::stopped(name, &Failure::Case(mistake)),
        };
        let mut measurements: Vec<Result<Measurement, String>> = planned
            .iter()
            .map(|p| match p.concerns(name) {
                true => Measurement::new(&p.check.measure, &simulation)
                    .map_err(|mistake| mistake.to_string()),
                false => Err(String::new()),
            })
            .collect();
        let mut audit = Audit::default();
        let measured = measurements.iter_mut().flatten().collect();
        let quiet = !is_alone || !std::io::stderr().is_terminal();
        let result = advance(case, &mut simulation, measured, &mut audit, quiet);
        let seconds = started.elapsed().as_secs_f64();
        let progress = simulation.progress();
        let steps = progress.macro_steps;
        let iterations: u64 = progress.iterations.iter().sum();
        let evaluations: u64 = progress.evaluations.iter().sum();
        let wall = duration(seconds);
        let world = simulation.world();
        let points: usize = world.bodies().iter().map(|body| body.points.len()).sum();
        let bonds: usize = simulation.family_sizes().iter().map(|f| f.bonds).sum();
        match result {
            Ok(()) => tell(&format!(
                "{name}: {points} points, {bonds} bonds, {steps} steps, {iterations} iterations, {evaluations} evaluations in {wall}"
            )),
            Err(failure) => {
                let stopped = MeasuredRun::stopped(name, &failure);
                return MeasuredRun { seconds, ..stopped };
            }
        }
        let none = "no logged state at the time of the measurement has what is measured";
        let values = |m: Measurement| m.values().map(<[f64]>::to_vec).ok_or(none.to_string());
        MeasuredRun {
            measured: measurements.into_iter().map(|m| values(m?)).collect(),
            stopped: None,
            audit,
            seconds,
        }
    }

    fn stopped(name: &str, failure: &Failure) -> MeasuredRun {
        let reason = match failure {
            Failure::Case(mistake) => mistake.render(false),
            failure => format!("the run of {name} stopped: {failure}"),
        };
        tell(&format!("{name}: {reason}"));
        MeasuredRun {
            measured: Vec::new(),
            stopped: Some(reason),
            audit: Audit::default(),
            seconds: 0.0,
        }
    }

    /// Outcomes of the audits of the run, without the balances that checks of the case cover at any level. A case
    /// without checks has at least one outcome: whether its run reached the end.
    pub(super) fn audits(&self, case: &str, checks: &[Check]) -> Vec<Outcome> {
        if let Some(reason) = &self.stopped {
            // checks of the case give the reason, if there are any
            let alone = checks.is_empty().then(|| reason.clone());
            return alone.map_or(Vec::new(), |r| vec![Outcome::end(case, Err(r))]);
        }
        let is_checked = |quantity: &str| {
            let mut measures = checks.iter().map(|c| &c.measure);
            measures.any(|m| matches!(m, Measure::Balance(b) if b.quantity == quantity))
        };
        let outcomes = self.audit.outcomes(case, is_checked);
        match outcomes.is_empty() && checks.is_empty() {
            true => vec![Outcome::end(case, Ok(()))],
            false => outcomes,
        }
    }

    /// The values measured for a planned check.
    ///
    /// # Errors
    /// The reason why there are none. The values of a run that stopped do not count, also where they were taken
    /// before.
    pub(super) fn values(&self, check: usize) -> Result<&[f64], String> {
        match &self.stopped {
            Some(reason) => Err(reason.clone()),
            None => self.measured[check].as_deref().map_err(Clone::clone),
        }
    }
}

/// Steps to the end of the case.
fn advance(
    case: &Case,
    simulation: &mut Simulation,
    mut measurements: Vec<&mut Measurement>,
    audit: &mut Audit,
    quiet: bool,
) -> Result<(), Failure> {
    case.start(simulation)?;
    let mut display = Display::new(simulation, f64::INFINITY, quiet);
    let result = loop {
        if simulation.is_finished() {
            break Ok(());
        }
        match simulation.step() {
            Ok(logging) => {
                let measurements = measurements.iter_mut();
                measurements.for_each(|m| m.observe(simulation, logging));
                audit.observe(simulation);
            }
            Err(failure) => break Err::<(), RunError>(failure),
        }
        display.update(simulation);
    };
    display.finish();
    Ok(result?)
}
