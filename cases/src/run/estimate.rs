//! Estimated duration and memory of a run, from its first steps.
//!
//! The duration is a sum over the kinds of work: the sub-steps of each physics, which take up most of the time and of which
//! `update = "log"` needs few, the rest of a macro step, logged states, and checkpoints. Each kind has its measured time
//! and its number of steps that are left ([`Remaining`]). The time of a step grows while a body heats up and yields: that of the
//! last third of the measured time counts. A part that cools takes less work in a step than one that is welded: the clock then
//! skips to the middle of each later phase of the run ([`Simulation::phases`]), and some steps are measured there, with the
//! state that the first steps have left.

use std::path::PathBuf;
use std::time::Instant;

use perimelt_core::Simulation;
use perimelt_core::log::{Writer, memory_of_writing};
use perimelt_core::simulation::Remaining;

use super::Failure;
use super::log_size::LogSize;
use super::record::{Recorder, run_info};
use crate::case::Case;

/// Wall time in which steps are measured, s.
const MEASURED_SECONDS: f64 = 4.0;

/// Wall time in which steps are measured where a physics has not yet been updated often enough, s.
const MOST_SECONDS: f64 = 20.0;

/// Fewest updates of each physics that are measured. The first ones of a cold body take less time than later ones.
const FEWEST_UPDATES: u64 = 4;

/// Wall time in which steps of each later phase are measured, s.
const PHASE_SECONDS: f64 = 1.0;

/// Fewest updates of each physics in a later phase that are measured: in the first one the metal of the melt pool, whose source is
/// suddenly elsewhere or off, freezes.
const FEWEST_PHASE_UPDATES: u64 = 3;

/// Wall time after which no later phase is measured, s.
const LAST_PHASE_SECONDS: f64 = 10.0;

/// Largest log (bytes) that is written for the measurement.
const LARGEST_LOG: f64 = 5e8;

/// Measured times of one kind of work.
#[derive(Clone, Debug, Default, PartialEq)]
struct Work {
    /// Number of steps and their wall time, s; both ascend.
    samples: Vec<(f64, f64)>,
    /// Wall time of a step before these, s.
    before: f64,
}

impl Work {
    fn add(&mut self, steps: f64, wall: f64) {
        if self.samples.last().is_none_or(|(s, _)| steps > *s) {
            self.samples.push((steps, wall));
        }
    }

    /// Starts the measurement of the steps that follow.
    fn next(&self) -> Work {
        Work {
            samples: self.samples.last().copied().into_iter().collect(),
            before: self.per_step(),
        }
    }

    /// Wall time of one step in the last third of the measured time, s; zero without any.
    fn per_step(&self) -> f64 {
        let Some((&(steps, wall), before)) = self.samples.split_last() else {
            return self.before;
        };
        // one step may take longer than all others
        let begun = self.samples[0].1;
        let late = begun + 2.0 / 3.0 * (wall - begun);
        let early = before.iter().find(|(_, w)| *w >= late);
        match early.or(before.last()) {
            Some((early_steps, early_wall)) => (wall - early_wall) / (steps - early_steps),
            None => self.before,
        }
    }
}

/// A log that is written for the measurement only.
struct TrialLog {
    recorder: Option<Recorder>,
    path: PathBuf,
}

impl TrialLog {
    /// `None` if it would be large, or where it cannot be written.
    fn new(case: &Case, simulation: &Simulation, size: &LogSize) -> Option<TrialLog> {
        if (size.state + size.checkpoint) as f64 * FEWEST_UPDATES as f64 > LARGEST_LOG {
            return None;
        }
        let name = format!("perimelt-check-{}.mcap", std::process::id());
        let path = std::env::temp_dir().join(name);
        let info = run_info(case, simulation);
        let writer = Writer::create(&path, &info, &case.file_name(), &case.file.text).ok()?;
        let recorder = Recorder::new(case, simulation, Some(writer), 0.0).ok();
        Some(TrialLog { recorder, path })
    }
}

impl Drop for TrialLog {
    fn drop(&mut self) {
        self.recorder = None;
        // a file that cannot be removed from the temporary folder does no harm
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Estimate for a whole run from its first steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Wall time of the whole run, s.
    pub duration: f64,
    /// Simulated time up to which steps were measured one after the other, s.
    pub measured_until: f64,
    /// Whether that is the end of the run.
    pub is_finished: bool,
    /// Names of physics that were not updated in the measured time: the duration is without them.
    pub unmeasured: Vec<String>,
    /// Whether the time of writing the log is included.
    pub with_log: bool,
    /// Largest memory of the program, bytes; `None` where the operating system does not report it.
    pub memory: Option<f64>,
}

/// Runs the case for some seconds, or to its end, and discards the results after `observe` has seen them.
///
/// # Errors
/// A step that fails.
pub fn estimate(
    case: &Case,
    mut simulation: Simulation,
    size: &LogSize,
    observe: impl FnOnce(&Simulation),
) -> Result<Estimate, Failure> {
    let mut measured = Measured::new(case, &simulation, size)?;
    let end = simulation.options().end;
    measured.steps_until(&mut simulation, end, |updates, seconds| {
        let is_enough = updates.iter().all(|count| *count >= FEWEST_UPDATES);
        let limit = if is_enough {
            MEASURED_SECONDS
        } else {
            MOST_SECONDS
        };
        seconds > limit
    })?;
    observe(&simulation);
    let (measured_until, is_finished) = (simulation.time(), simulation.is_finished());
    let mut duration = measured.seconds() + measured.checkpoint_seconds * (size.checkpoints - 1.0);
    let mut left = vec![0.0; measured.physics.len()];
    let mut from = measured_until;
    let phases = if is_finished {
        Vec::new()
    } else {
        simulation.phases()
    };
    for (k, to) in phases.into_iter().enumerate() {
        if k > 0 && measured.seconds() < LAST_PHASE_SECONDS {
            measured.next_phase();
            simulation.skip_to(0.5 * (from + to));
            let begun = measured.seconds();
            let updated = simulation.progress().sub_steps.clone();
            // a state from elsewhere may fail where that of the run does not: what was measured before then counts
            let _ = measured.steps_until(&mut simulation, to, |updates, seconds| {
                let mut since = updates.iter().zip(&updated).map(|(now, then)| now - then);
                let is_enough = since.all(|count| count >= FEWEST_PHASE_UPDATES);
                seconds - begun > PHASE_SECONDS && (is_enough || seconds > LAST_PHASE_SECONDS)
            });
        }
        let steps = simulation.steps_between(from, to);
        duration += measured.seconds_of(&steps);
        for (left, steps) in left.iter_mut().zip(&steps.sub_steps) {
            *left += steps;
        }
        from = to;
    }
    let with_log = measured.recorder().is_some();
    let of_log = match with_log {
        true => 0,
        false => memory_of_writing(size.state, size.checkpoint),
    };
    let labels = simulation.physics_labels().map(String::from);
    let is_missing = |(work, left): &(&Work, &f64)| work.per_step() == 0.0 && **left > 0.0;
    let missing = measured.physics.iter().zip(&left);
    let unmeasured = labels.zip(missing).filter(|(_, work)| is_missing(work));
    Ok(Estimate {
        unmeasured: unmeasured.map(|(label, _)| label).collect(),
        duration,
        measured_until,
        is_finished,
        with_log,
        memory: peak_memory().map(|memory| memory + of_log as f64),
    })
}

/// Wall times of the kinds of work.
struct Measured {
    started: Instant,
    log: Option<TrialLog>,
    physics: Vec<Work>,
    /// The rest of a macro step.
    steps: Work,
    /// Number of logged states and their wall time, s. Few of them are written to the disk at once.
    logged: (f64, f64),
    /// Wall time of a checkpoint, s.
    checkpoint_seconds: f64,
}

impl Measured {
    fn new(case: &Case, simulation: &Simulation, size: &LogSize) -> Result<Measured, Failure> {
        let mut measured = Measured {
            started: Instant::now(),
            log: TrialLog::new(case, simulation, size),
            physics: vec![Work::default(); simulation.wall_seconds().len()],
            steps: Work::default(),
            logged: (0.0, 0.0),
            checkpoint_seconds: 0.0,
        };
        measured.note(simulation);
        let begun = Instant::now();
        if let Some(recorder) = measured.recorder() {
            recorder.checkpoint(simulation)?;
            measured.checkpoint_seconds = begun.elapsed().as_secs_f64();
            measured.record(simulation)?;
        }
        Ok(measured)
    }

    fn recorder(&mut self) -> Option<&mut Recorder> {
        self.log.as_mut().and_then(|log| log.recorder.as_mut())
    }

    /// Wall time since the start, s.
    fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Steps up to a time (s), or until there are enough of them: `is_enough(updates of each physics, wall time in s)`.
    fn steps_until(
        &mut self,
        simulation: &mut Simulation,
        time: f64,
        is_enough: impl Fn(&[u64], f64) -> bool,
    ) -> Result<(), Failure> {
        while simulation.time() < time
            && !is_enough(&simulation.progress().sub_steps, self.seconds())
        {
            if simulation.step()? {
                self.record(simulation)?;
            }
            self.note(simulation);
        }
        Ok(())
    }

    /// Logs a state.
    fn record(&mut self, simulation: &Simulation) -> Result<(), Failure> {
        let begun = Instant::now();
        if let Some(recorder) = self.recorder() {
            recorder.record(simulation)?;
            let (states, seconds) = &mut self.logged;
            *states += 1.0;
            *seconds += begun.elapsed().as_secs_f64();
        }
        Ok(())
    }

    fn note(&mut self, simulation: &Simulation) {
        let progress = simulation.progress();
        let done = progress.sub_steps.iter().zip(simulation.wall_seconds());
        for (work, (count, wall)) in self.physics.iter_mut().zip(done) {
            work.add(*count as f64, *wall);
        }
        let of_physics: f64 = simulation.wall_seconds().iter().sum();
        let rest = self.seconds() - self.checkpoint_seconds - self.logged.1 - of_physics;
        self.steps.add(progress.macro_steps as f64, rest);
    }

    /// Restarts all measurements; a measurement without further steps keeps its previous value.
    fn next_phase(&mut self) {
        self.physics.iter_mut().for_each(|work| *work = work.next());
        self.steps = self.steps.next();
    }

    /// Wall time of these steps, by the kinds of work: physics, macro steps and logged states.
    fn seconds_of(&self, left: &Remaining) -> f64 {
        let of_physics = self.physics.iter().zip(&left.sub_steps);
        let of_physics: f64 = of_physics.map(|(work, left)| work.per_step() * left).sum();
        let (states, seconds) = self.logged;
        let of_states = left.logs * seconds / states.max(1.0);
        of_physics + self.steps.per_step() * left.macro_steps + of_states
    }
}

/// Largest memory of this program, bytes.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kibibytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work(samples: &[(f64, f64)]) -> Work {
        let mut work = Work::default();
        samples.iter().for_each(|(s, w)| work.add(*s, *w));
        work
    }

    #[test]
    fn the_last_steps_of_each_kind_tell_the_duration() {
        // steps take 0.1 s, later 0.5 s; a repeated count is no step
        let steps = work(&[
            (0.0, 0.0),
            (1.0, 0.1),
            (2.0, 0.6),
            (2.0, 0.6),
            (3.0, 1.1),
            (4.0, 1.6),
        ]);
        assert!((steps.per_step() - 0.5).abs() < 1e-12);
        // a single step, which takes longer than all others together
        let rare = work(&[(0.0, 0.0), (1.0, 9.0)]);
        assert_eq!(rare.per_step(), 9.0);
        assert_eq!(work(&[(0.0, 0.0)]).per_step(), 0.0);
        let left = Remaining {
            macro_steps: 100.0,
            logs: 10.0,
            sub_steps: vec![100.0, 10.0],
        };
        let mut measured = Measured {
            started: Instant::now(),
            log: None,
            physics: vec![steps.clone(), rare],
            steps: work(&[]),
            logged: (4.0, 2.0),
            checkpoint_seconds: 0.0,
        };
        let total = measured.seconds_of(&left);
        assert!((total - (50.0 + 90.0 + 5.0)).abs() < 1e-9, "{total}");
        // later steps of the first physics take 0.2 s
        measured.next_phase();
        measured.physics[0].add(5.0, 1.8);
        measured.physics[0].add(6.0, 2.0);
        let total = measured.seconds_of(&left);
        assert!((total - (20.0 + 90.0 + 5.0)).abs() < 1e-9, "{total}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn memory_is_at_least_what_is_held() {
        let held = vec![1_u8; 64 << 20];
        let peak = peak_memory().expect("the system tells");
        assert!(peak > std::hint::black_box(&held).len() as f64);
    }
}
