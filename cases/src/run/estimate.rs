//! Estimated duration and memory of a run, from its first steps.
//!
//! The duration is a sum over the kinds of work: the sub-steps of each physics, which take up most of the time and of which
//! `update = "log"` needs few, what else a macro step does, logged states, and checkpoints. Each kind has its measured time
//! and its number of steps that are left ([`Remaining`]). The time of a step grows while a body heats up and yields: that of the
//! last third of the measured time counts.

use std::path::PathBuf;
use std::time::Instant;

use perimelt_core::Simulation;
use perimelt_core::log::Writer;
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

/// Largest log (bytes) that is written for the measurement.
const LARGEST_LOG: f64 = 5e8;

/// Measured times of one kind of work.
#[derive(Clone, Debug, Default, PartialEq)]
struct Work {
    /// Number of steps so far and their wall time, s; both grow.
    samples: Vec<(f64, f64)>,
}

impl Work {
    fn add(&mut self, steps: f64, wall: f64) {
        if self.samples.last().is_none_or(|(s, _)| steps > *s) {
            self.samples.push((steps, wall));
        }
    }

    /// Wall time of one step in the last third of the measured time, s; zero without any.
    fn per_step(&self) -> f64 {
        let Some((&(steps, wall), before)) = self.samples.split_last() else {
            return 0.0;
        };
        // one step may take longer than all others
        let early = before.iter().find(|(_, w)| *w >= 2.0 / 3.0 * wall);
        match early.or(before.last()) {
            Some((early_steps, early_wall)) => (wall - early_wall) / (steps - early_steps),
            None => 0.0,
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
        let recorder = Recorder::new(case, simulation, writer, 0.0).ok();
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

/// What the first steps of a run tell about the whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Wall time of the whole run, s.
    pub duration: f64,
    /// Simulated time up to which steps were measured, s.
    pub measured_until: f64,
    /// Names of physics that were not updated in the measured time: the duration is without them.
    pub unmeasured: Vec<String>,
    /// Whether the time of writing the log is included.
    pub with_log: bool,
    /// Largest memory of the program so far, bytes; `None` where the operating system does not tell.
    pub memory: Option<f64>,
}

/// Runs the case for some seconds, or to its end, and discards the results.
///
/// # Errors
/// A step that fails.
pub fn estimate(
    case: &Case,
    simulation: &mut Simulation,
    size: &LogSize,
) -> Result<Estimate, Failure> {
    let started = Instant::now();
    let elapsed = || started.elapsed().as_secs_f64();
    let mut log = TrialLog::new(case, simulation, size);
    let mut physics = vec![Work::default(); simulation.wall_seconds().len()];
    let mut steps = Work::default();
    let mut states = Work::default();
    let mut checkpoint_seconds = 0.0;
    let (mut logged, mut log_seconds) = (0.0, 0.0);
    let note = |simulation: &Simulation, physics: &mut [Work]| {
        let counts = &simulation.progress().sub_steps;
        let done = counts.iter().zip(simulation.wall_seconds());
        for (work, (count, wall)) in physics.iter_mut().zip(done) {
            work.add(*count as f64, *wall);
        }
    };
    note(&*simulation, &mut physics[..]);
    steps.add(0.0, 0.0);
    states.add(0.0, 0.0);
    if let Some(recorder) = log.as_mut().and_then(|log| log.recorder.as_mut()) {
        let begun = Instant::now();
        recorder.checkpoint(simulation)?;
        checkpoint_seconds = begun.elapsed().as_secs_f64();
    }
    while !simulation.is_finished() {
        let counts = &simulation.progress().sub_steps;
        let are_measured = counts.iter().all(|count| *count >= FEWEST_UPDATES);
        let seconds = if are_measured {
            MEASURED_SECONDS
        } else {
            MOST_SECONDS
        };
        if elapsed() > seconds {
            break;
        }
        let logging = simulation.step()?;
        note(&*simulation, &mut physics[..]);
        if logging && let Some(recorder) = log.as_mut().and_then(|log| log.recorder.as_mut()) {
            let begun = Instant::now();
            recorder.record(simulation)?;
            logged += 1.0;
            log_seconds += begun.elapsed().as_secs_f64();
            states.add(logged, log_seconds);
        }
        let of_physics: f64 = simulation.wall_seconds().iter().sum();
        let rest = elapsed() - checkpoint_seconds - log_seconds - of_physics;
        steps.add(simulation.progress().macro_steps as f64, rest);
    }
    let left = simulation.remaining();
    let labels = simulation.physics_labels().map(String::from);
    let is_missing = |(work, left): &(&Work, &f64)| work.samples.len() < 2 && **left > 0.0;
    let missing = physics.iter().zip(&left.sub_steps);
    let unmeasured = labels.zip(missing).filter(|(_, work)| is_missing(work));
    Ok(Estimate {
        unmeasured: unmeasured.map(|(label, _)| label).collect(),
        duration: elapsed()
            + seconds_left(&left, (&physics, &steps, &states))
            + checkpoint_seconds * (size.checkpoints - 1.0),
        measured_until: simulation.time(),
        with_log: log.as_ref().is_some_and(|log| log.recorder.is_some()),
        memory: peak_memory(),
    })
}

/// Wall time of the steps that are left, by the kinds of work: physics, macro steps and logged states.
fn seconds_left(left: &Remaining, (physics, steps, states): (&[Work], &Work, &Work)) -> f64 {
    let of_physics = physics.iter().zip(&left.sub_steps);
    let of_physics: f64 = of_physics.map(|(work, left)| work.per_step() * left).sum();
    of_physics + steps.per_step() * left.macro_steps + states.per_step() * left.logs
}

/// Largest memory (bytes) that this program had so far.
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
        let none = work(&[]);
        let total = seconds_left(&left, (&[steps.clone(), rare], &none, &steps));
        assert!((total - (50.0 + 90.0 + 5.0)).abs() < 1e-9, "{total}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn memory_is_at_least_what_is_held() {
        let held = vec![1_u8; 64 << 20];
        let peak = peak_memory().expect("the system tells");
        assert!(peak > std::hint::black_box(&held).len() as f64);
    }
}
