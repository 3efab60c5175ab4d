//! Running a case: steps, log, progress, and resuming from a checkpoint.
//!
//! A log gets its final name once it contains the initial state and a checkpoint, so that every log
//! can be replayed and resumed, even if the run was killed.

pub mod display;
pub mod estimate;
pub mod inputs;
pub mod log_size;
pub mod outcome;
pub mod record;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use perimelt_core::log::{Log, LogError, RunHeader, Writer};
use perimelt_core::transport::Processes;
use perimelt_core::{RunError, Simulation};

use crate::case::of_log::case_of;
use crate::case::{Case, CaseError, SECTIONS, StartError};
use crate::interrupt;
use crate::log_file::open_log;
use crate::output::{Existing, LogPlace, NamedLog, PlaceError};
use crate::terminal::warn;
use display::Display;
use log_size::LogSize;
use outcome::RunOutcome;
use record::Recorder;

/// Options of a run.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The log.
    pub out: PathBuf,
    /// Replace a file that is there.
    pub force: bool,
    /// Stop at the first logged state at or after this time, s.
    pub until: Option<f64>,
    /// Show nothing but errors.
    pub quiet: bool,
    /// Number of the signal that requests an early end; zero without one.
    pub stop: Arc<AtomicUsize>,
    /// The processes that share the run. The first one writes the log.
    pub processes: Processes,
}

impl Options {
    /// Whether this process writes the log.
    fn writes(&self) -> bool {
        self.processes.rank() == 0
    }

    /// Whether this process shows progress, warnings and results.
    pub fn tells(&self) -> bool {
        self.writes() && !self.quiet
    }

    /// Shows what all processes found together.
    fn warn(&self, warnings: &[String]) {
        if self.tells() {
            warn(warnings);
        }
    }
}

/// The default log of a case: its name with `.mcap`, in the working directory.
#[must_use]
pub fn log_of(case: &Path) -> PathBuf {
    // appended, because a name such as `tension-0.5` contains dots
    let mut name = case.file_stem().unwrap_or_default().to_os_string();
    name.push(".mcap");
    PathBuf::from(name)
}

/// Why a run ended without a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The end time of the case.
    Finished,
    /// The requested time.
    Until,
    /// A signal of this number.
    Stopped(usize),
}

/// Result of a run.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Why it ended.
    pub end: End,
    /// Simulated time, s.
    pub time: f64,
    /// Macro steps.
    pub steps: u64,
    /// Wall time of this part of the run, s.
    pub wall_seconds: f64,
    /// The log.
    pub log: PathBuf,
    /// Sentences about the result.
    pub facts: Vec<String>,
    /// Sentences about possible mistakes.
    pub warnings: Vec<String>,
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// A mistake in the case file.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// A step failed; the log contains all states before it.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The log could not be written or read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The log cannot be written there.
    #[error(transparent)]
    Place(#[from] PlaceError),
    /// A resumed run would end before it starts.
    #[error(
        "`--until` is {until} s, and the run in {path} has reached t = {time} s already; give a later time",
        path = path.display()
    )]
    UntilIsPast {
        /// The log.
        path: PathBuf,
        /// The requested end, s.
        until: f64,
        /// Time of the checkpoint, s.
        time: f64,
    },
    /// The run is finished already.
    #[error(
        "the run in {path} has reached its end at t = {time} s; there is nothing to resume (a case file with a later `time.end` can be given by `--case`)",
        path = path.display()
    )]
    AlreadyFinished {
        /// The log.
        path: PathBuf,
        /// End, s.
        time: f64,
    },
    /// A file that the case names has changed.
    #[error(
        "{file}, which the case names, has changed since the run in {path} began; restore it, or start a new run",
        path = path.display()
    )]
    ChangedInput {
        /// The log.
        path: PathBuf,
        /// The file.
        file: String,
    },
    /// The case in the log is damaged, and no other one is given.
    #[error(
        "the case file in {path} is damaged; give the case of the run by `--case`",
        path = path.display()
    )]
    DamagedCase {
        /// The log.
        path: PathBuf,
    },
    /// A case that is given to a resumed run is another one.
    #[error(
        "`{section}` of {file} differs from that of the run; a resumed run takes other {} only",
        MAY_CHANGE.map(|s| format!("`{s}`")).join(", ")
    )]
    OtherCase {
        /// The case file.
        file: String,
        /// The first section that differs.
        section: &'static str,
    },
}

/// Sections of a case that may change when a run is resumed.
const MAY_CHANGE: [&str; 4] = ["case", "time", "log", "verify"];

impl From<StartError> for Failure {
    fn from(error: StartError) -> Self {
        match error {
            StartError::Case(e) => Failure::Case(e),
            StartError::Run(e) => Failure::Run(e),
        }
    }
}

/// Calls a function on a thread of the pool. From any other thread, each of the dozens of parallel loops of a step
/// would need a handover by the operating system.
pub fn on_workers<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// Runs a case from its start.
///
/// # Errors
/// A mistake in the case (no file is written then), a step that fails, a log that cannot be written.
pub fn run(case: &Case, options: &Options) -> Result<Summary, Failure> {
    let claim = || LogPlace::claim(&options.out, Existing::KeepRun.unless(options.force));
    let place = options.writes().then(claim).transpose()?;
    let mut simulation = case.compose_shared(options.processes.clone())?;
    case.start(&mut simulation)?;
    if !options.quiet {
        let mut warnings = case.warnings(&simulation)?;
        warnings.extend(LogSize::new(case, &simulation)?.warning(&options.out));
        options.warn(&warnings);
    }
    let Some(place) = place else {
        let mut recorder = Recorder::new(case, &simulation, None, 0.0)?;
        recorder.record(&simulation)?;
        recorder.checkpoint(&simulation)?;
        return go_on(simulation, recorder, None, options);
    };
    let mut part = place.begin()?;
    let info = record::run_info(case, &simulation);
    let target = part.destination();
    let writer = Writer::begin(target, &info, &case.file_name(), &case.file.text)?;
    let mut recorder = Recorder::new(case, &simulation, Some(writer), 0.0)?;
    recorder.record(&simulation)?;
    recorder.checkpoint(&simulation)?;
    let placed = part.put_in_place()?;
    recorder.placed();
    go_on(simulation, recorder, Some(&placed), options)
}

/// Resumes from the last checkpoint of the log at `path`; the new log takes its place, or
/// that of `options.out`. A `case` may have another end, other steps and other logging times.
///
/// # Errors
/// The errors of [`run`], or the log has no checkpoint or has reached its end, or the case describes another process.
pub fn resume(path: &Path, case: Option<&Case>, options: &Options) -> Result<Summary, Failure> {
    let in_place = matches!(
        (path.canonicalize(), options.out.canonicalize()),
        (Ok(old), Ok(new)) if old == new
    );
    let existing = Existing::KeepRun.unless(options.force || in_place);
    let claim = || LogPlace::claim(&options.out, existing);
    let place = options.writes().then(claim).transpose()?;
    let log = open_log(path)?;
    let logged = match log.has_case() {
        true => Some(case_of(&log)?),
        false => None,
    };
    let case = match (case, &logged) {
        (Some(case), Some(logged)) => continuing(case, logged)?,
        // the checkpoint is compared with it
        (Some(case), None) => case,
        (None, Some(logged)) => {
            warn(changed_file(&log).as_slice());
            logged
        }
        (None, None) => return Err(Failure::DamagedCase { path: path.into() }),
    };
    let newest = log.last_checkpoint()?;
    let (last, state) = log.last_sound_checkpoint()?;
    if last < newest {
        warn(&[format!(
            "the checkpoint at {} s is damaged; the run goes on from the one at {} s",
            log.checkpoints()[newest].time,
            log.checkpoints()[last].time
        )]);
    }
    let time = log.checkpoints()[last].time;
    check_time_left(path, case, options, time)?;
    if let Some(changed) = inputs::changed(&log.run().inputs, &case.folder) {
        return Err(Failure::ChangedInput {
            path: path.into(),
            file: changed.path.clone(),
        });
    }
    let mut simulation = case.compose_shared(options.processes.clone())?;
    simulation.load(&state)?;
    if !options.quiet {
        let warning = LogSize::new(case, &simulation)?.warning(&options.out);
        options.warn(warning.as_slice());
    }
    let Some(place) = place else {
        let recorder = Recorder::new(case, &simulation, None, 0.0)?;
        return go_on(simulation, recorder, None, options);
    };
    let wall = log
        .progress()
        .iter()
        .rev()
        .find(|p| p.time <= time)
        .map_or(0.0, |p| p.wall_seconds);
    let mut part = place.begin()?;
    let mut info = log.run().clone();
    let now = record::run_info(case, &simulation);
    (info.case_folder, info.inputs) = (now.case_folder, now.inputs);
    let header = RunHeader {
        run: &info,
        case_name: &case.file_name(),
        case_text: &case.file.text,
    };
    let writer = Writer::continue_from(&log, part.destination(), last, header)?;
    let mut recorder =
        Recorder::new(case, &simulation, Some(writer), wall)?.continuing(log.balance());
    drop(log);
    let placed = part.put_in_place()?;
    recorder.placed();
    go_on(simulation, recorder, Some(&placed), options)
}

/// Refuses a run that has nothing left to simulate after its checkpoint at `time` (s).
fn check_time_left(path: &Path, case: &Case, options: &Options, time: f64) -> Result<(), Failure> {
    if time >= case.time.end {
        return Err(Failure::AlreadyFinished {
            path: path.into(),
            time,
        });
    }
    match options.until.filter(|until| *until <= time) {
        Some(until) => Err(Failure::UntilIsPast {
            path: path.into(),
            until,
            time,
        }),
        None => Ok(()),
    }
}

/// The case, if it describes the same process as the logged one.
fn continuing<'c>(case: &'c Case, logged: &Case) -> Result<&'c Case, Failure> {
    let sections = |case: &Case| -> toml::Table {
        toml::from_str(&case.file.text).expect("a case that was read is TOML")
    };
    let (new, old) = (sections(case), sections(logged));
    let fixed = SECTIONS.iter().filter(|s| !MAY_CHANGE.contains(s));
    let mut different = fixed.filter(|s| new.get(**s) != old.get(**s));
    match different.next() {
        None => Ok(case),
        Some(section) => Err(Failure::OtherCase {
            file: case.file.name.clone(),
            section,
        }),
    }
}

/// A sentence about the case file of a log, where it has changed since. A log may name any path: only a regular file of the
/// length of the case is read.
fn changed_file(log: &Log) -> Option<String> {
    let file = Path::new(&log.run().case_folder).join(log.case_name());
    let data = std::fs::metadata(&file).ok().filter(|d| d.is_file())?;
    let is_same = data.len() == log.case_text().len() as u64
        && std::fs::read(&file).ok()? == log.case_text().as_bytes();
    let file = file.display();
    (!is_same).then(|| {
        format!("{file} differs from the case of the log, with which the run goes on (`--case {file}` takes the file)")
    })
}

fn go_on(
    mut simulation: Simulation,
    mut recorder: Recorder,
    placed: Option<&NamedLog>,
    options: &Options,
) -> Result<Summary, Failure> {
    interrupt::leave_to_run();
    let started = Instant::now();
    let until = options.until.unwrap_or(f64::INFINITY);
    let mut display = Display::new(&simulation, until, !options.tells());
    let mut outcome = RunOutcome::new(&simulation);
    let end = loop {
        if simulation.is_finished() {
            break End::Finished;
        }
        let signal = options.stop.load(Ordering::Relaxed);
        let signal = options.processes.max(signal as f64) as usize;
        if signal != 0 {
            break End::Stopped(signal);
        }
        let logging = match simulation.step() {
            Ok(logging) => logging,
            Err(failure) => {
                display.finish();
                recorder.finish()?;
                return Err(failure.into());
            }
        };
        if logging {
            recorder.record(&simulation)?;
            outcome.observe(&simulation);
            if simulation.time() >= until && !simulation.is_finished() {
                break End::Until;
            }
            if recorder.is_checkpoint_due(&simulation) && !simulation.is_finished() {
                recorder.checkpoint(&simulation)?;
                placed.map_or(Ok(()), NamedLog::check)?;
            }
        }
        display.update(&simulation);
    };
    recorder.checkpoint(&simulation)?;
    recorder.finish()?;
    display.finish();
    placed.map_or(Ok(()), NamedLog::check)?;
    let (facts, warnings) = outcome.sentences(&simulation);
    Ok(Summary {
        end,
        time: simulation.time(),
        steps: simulation.progress().macro_steps,
        wall_seconds: started.elapsed().as_secs_f64(),
        log: options.out.clone(),
        facts,
        warnings,
    })
}
