//! Runs of one case with several values of some of its keys, and a table and a picture of the results.

mod picture;
mod table;
mod variants;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::str::FromStr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use perimelt_core::log::Log;

use crate::case::of_log::early_end;
use crate::case::{Case, CaseError};
use crate::melt_pool::Travel;
use crate::output::{LogPlace, create_folder, write_whole};
use crate::plot::{PictureFormat, PlotError, write_picture};
use crate::summary::{SummaryOptions, read_off};
use crate::terminal::tell;
use crate::unit::duration;
use picture::{Choice, FormulaComparison};
use table::{SweepTable, VariantResult};
use variants::{Variant, variants};

/// Width of the picture, pixels.
const WIDTH: u32 = 1000;

/// Arguments of `perimelt sweep`.
#[derive(clap::Args, Debug)]
pub struct SweepArgs {
    /// The case file
    case: PathBuf,
    /// A key and its values, such as `couplers.goldak.power=[1500, 2000]`; several of them give all combinations
    #[arg(long, required = true, value_name = "KEY=[VALUES]")]
    set: Vec<String>,
    /// Vary all keys together, the first values in the first run, instead of in all combinations
    #[arg(long)]
    together: bool,
    /// Draw a number read off with a formula in x, the value that varies, such as `cooling time=4e-4 * x`; SI units
    #[arg(long, value_name = "NUMBER=FORMULA")]
    compare: Vec<String>,
    /// Draw only the numbers whose names contain this, such as `width of the fusion zone`; may be given several times
    #[arg(long, value_name = "NUMBER")]
    only: Vec<String>,
    /// Folder of cases, logs, table and picture [default: name of the case with -sweep, in the working directory]
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Runs at a time [default: all cores, and one with `--launcher`]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Command that starts the processes of each run, such as `srun -n 8`
    #[arg(long, value_name = "COMMAND", value_parser = launcher)]
    launcher: Option<Launcher>,
    /// Only the runs K, K + N, K + 2 N ...: that of one task of a job array, whose tasks share the folder
    #[arg(long, value_name = "K/N")]
    part: Option<SweepPart>,
    /// Axis along which the heat source travels, for the length of the melt pool
    #[arg(long, value_enum, default_value_t)]
    travel: Travel,
}

/// A command that starts a program several times, and its arguments.
#[derive(Clone, Debug)]
struct Launcher(Vec<String>);

/// Reads a command with its arguments.
fn launcher(given: &str) -> Result<Launcher, String> {
    let words: Vec<String> = given.split_whitespace().map(String::from).collect();
    match words.is_empty() {
        true => Err("expected a command, such as `srun -n 8`".into()),
        false => Ok(Launcher(words)),
    }
}

/// One of the tasks among which the runs of a sweep are divided.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SweepPart {
    /// From 1.
    number: usize,
    count: usize,
}

impl FromStr for SweepPart {
    type Err = String;

    fn from_str(given: &str) -> Result<Self, String> {
        let numbers = given.split_once('/').and_then(|(number, count)| {
            let (number, count) = (number.parse().ok()?, count.parse().ok()?);
            (1..=count)
                .contains(&number)
                .then_some(SweepPart { number, count })
        });
        numbers
            .ok_or_else(|| "expected a number from 1 and how many there are, such as `2/8`".into())
    }
}

impl SweepPart {
    fn contains(self, variant: &Variant) -> bool {
        (variant.number - 1) % self.count == self.number - 1
    }
}

/// Why a sweep cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// A mistake in the case file, or in one with other values.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// A `--set` that is no list.
    #[error(
        "`--set {given}`: {message}; expected a key and a list of values, such as `couplers.goldak.power=[1500, 2000]`"
    )]
    Set {
        /// The argument.
        given: String,
        /// The mistake.
        message: String,
    },
    /// A `--compare` that cannot be drawn.
    #[error(
        "`--compare {given}`: {message}; expected a number and a formula in x, such as `cooling time=4e-4 * x`"
    )]
    Compare {
        /// The argument.
        given: String,
        /// The mistake.
        message: String,
    },
    /// An `--only` that no number has.
    #[error("`--only {0}`: the table has no number with this name")]
    Only(String),
    /// The picture.
    #[error(transparent)]
    Picture(#[from] PlotError),
    /// Lists of different lengths, with `--together`.
    #[error("with `--together` all lists need as many values, and they have {0} and {1}")]
    Lengths(usize, usize),
    /// `--jobs` is zero.
    #[error("`--jobs` must be at least 1")]
    NoJobs,
    /// A file of another sweep.
    #[error("{path} belongs to a sweep of other cases; give another `--out`", path = .0.display())]
    OtherSweep(PathBuf),
    /// A file cannot be written.
    #[error("cannot write {path}: {source}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Some of the runs failed or were interrupted.
    #[error("{}; the messages of runs that failed are in the `.txt` files of {path}", count_text(*failed, *interrupted, *all), path = path.display())]
    Failed {
        /// Number of failed runs.
        failed: usize,
        /// Number of runs interrupted by a signal.
        interrupted: usize,
        /// Number of all runs.
        all: usize,
        /// Folder of the sweep.
        path: PathBuf,
    },
}

/// `2 of 9 runs failed, 1 was interrupted`.
fn count_text(failed: usize, interrupted: usize, all: usize) -> String {
    let were = if interrupted == 1 { "was" } else { "were" };
    match (failed, interrupted) {
        (failed, 0) => format!("{failed} of {all} runs failed"),
        (0, interrupted) => format!(
            "{interrupted} of {all} runs {were} interrupted; the same command continues them"
        ),
        _ => format!("{failed} of {all} runs failed, {interrupted} {were} interrupted"),
    }
}

/// Runs all variants that are not at their end yet, prints the table and writes it beside the logs, with a picture where a
/// number varies. An interrupted sweep continues where it stopped.
///
/// # Errors
/// A mistake before the first run, or runs that failed, once the others are done.
pub fn sweep(args: &SweepArgs, out: &mut dyn io::Write) -> Result<(), Box<dyn std::error::Error>> {
    let case = Case::read(&args.case)?;
    let variants = variants(&case, &args.set, args.together)?;
    let compared: Vec<FormulaComparison> = args
        .compare
        .iter()
        .map(|given| FormulaComparison::new(given))
        .collect::<Result<_, _>>()?;
    let folder = args.out.clone().unwrap_or_else(|| {
        let mut name = args.case.file_stem().unwrap_or_default().to_os_string();
        name.push("-sweep");
        name.into()
    });
    if args.jobs == Some(0) {
        return Err(SweepError::NoJobs.into());
    }
    write_cases(&folder, &variants)?;
    let own = variants
        .iter()
        .filter(|v| args.part.is_none_or(|part| part.contains(v)));
    let own: Vec<&Variant> = own.collect();
    let (failed, interrupted) =
        run_all(&folder, &own, variants.len(), &Runner::new(args, own.len()));
    let result = |v: &Variant| {
        let log = Log::open(v.log(&folder)).ok();
        let options = SummaryOptions {
            travel: args.travel,
            ..SummaryOptions::default()
        };
        let numbers = |log: &Log| read_off(log, &options).ok();
        VariantResult {
            numbers: log.as_ref().and_then(numbers),
            is_at_end: log.is_some_and(|log| early_end(&log).is_none()),
        }
    };
    let results: Vec<VariantResult> = variants.iter().map(result).collect();
    let table = SweepTable::new(&variants, &results);
    write!(out, "{table}")?;
    let path = folder.join("sweep.csv");
    let written = table.write_csv(&path);
    written.map_err(|source| SweepError::Write {
        path: path.clone(),
        source,
    })?;
    writeln!(out, "{}", path.display())?;
    let title = &case.case.title;
    let choice = Choice {
        compared,
        only: args.only.clone(),
    };
    let chart = picture::chart(&table, "numbers read off the runs", &choice)?;
    if let Some(drawn) = chart.and_then(|chart| chart.draw(title, WIDTH)) {
        let path = folder.join("sweep.svg");
        write_picture(&drawn, &path, PictureFormat::Svg).map_err(SweepError::from)?;
        writeln!(out, "{}", path.display())?;
    }
    if failed + interrupted > 0 {
        let all = variants.len();
        return Err(SweepError::Failed {
            failed,
            interrupted,
            all,
            path: folder,
        }
        .into());
    }
    Ok(())
}

/// Writes the case files; those of the same sweep may be there.
fn write_cases(folder: &Path, variants: &[Variant]) -> Result<(), SweepError> {
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        |source| SweepError::Write { path, source }
    };
    create_folder(folder).map_err(failed(folder))?;
    for variant in variants {
        let path = variant.case(folder);
        let text = &variant.text;
        match std::fs::read_to_string(&path) {
            Ok(present) if present == *text => {}
            // a file that contains only the beginning was cut off by a full disk
            Ok(present) if !text.starts_with(&present) => {
                return Err(SweepError::OtherSweep(path));
            }
            _ => write_text(&path, text.as_bytes()).map_err(failed(&path))?,
        }
    }
    Ok(())
}

fn write_text(path: &Path, text: &[u8]) -> io::Result<()> {
    write_whole(path, |file| file.write_all(text))
}

/// How runs are started.
struct Runner {
    /// Runs at a time.
    jobs: usize,
    /// Threads of each run; processes of a launcher divide the cores among them.
    threads: Option<usize>,
    launcher: Vec<String>,
}

impl Runner {
    fn new(args: &SweepArgs, runs: usize) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let usual = if args.launcher.is_some() { 1 } else { cores };
        let jobs = args.jobs.unwrap_or(usual).min(runs).max(1);
        Runner {
            jobs,
            threads: args.launcher.is_none().then_some((cores / jobs).max(1)),
            launcher: args.launcher.clone().map_or_else(Vec::new, |l| l.0),
        }
    }

    /// The program, to be started by the launcher, if there is one.
    fn command(&self) -> io::Result<Command> {
        let program = std::env::current_exe()?;
        let Some((launcher, arguments)) = self.launcher.split_first() else {
            return Ok(Command::new(program));
        };
        let mut command = Command::new(launcher);
        command.args(arguments).arg(program);
        Ok(command)
    }
}

/// Runs those of the `all` variants that are not complete, several at a time; numbers of failed and of interrupted runs.
fn run_all(folder: &Path, variants: &[&Variant], all: usize, runner: &Runner) -> (usize, usize) {
    let next = AtomicUsize::new(0);
    let (failed, interrupted) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || {
        while let Some(variant) = variants.get(next.fetch_add(1, Ordering::Relaxed)) {
            let started = Instant::now();
            let done = run_one(folder, variant, runner);
            let number = variant.number;
            let values = variant.values();
            match done {
                Ok(()) => {
                    let time = duration(started.elapsed().as_secs_f64());
                    tell(&format!("{number} of {all} ({values}): {time}"));
                }
                Err(RunFailure::Interrupted) => {
                    interrupted.fetch_add(1, Ordering::Relaxed);
                    tell(&format!("{number} of {all} ({values}) was interrupted"));
                }
                Err(RunFailure::Failed(message)) => {
                    failed.fetch_add(1, Ordering::Relaxed);
                    tell(&format!("{number} of {all} ({values}) failed: {message}"));
                }
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..runner.jobs {
            scope.spawn(work);
        }
    });
    (failed.into_inner(), interrupted.into_inner())
}

/// Why a run is not complete.
enum RunFailure {
    /// A signal.
    Interrupted,
    /// Anything else, in words.
    Failed(String),
}

impl From<io::Error> for RunFailure {
    fn from(error: io::Error) -> Self {
        RunFailure::Failed(error.to_string())
    }
}

/// Runs a variant in processes of its own, so that a failure does not end the others.
fn run_one(folder: &Path, variant: &Variant, runner: &Runner) -> Result<(), RunFailure> {
    let log = variant.log(folder);
    wait_for(&log);
    let present = Log::open(&log).ok();
    if present.as_ref().is_some_and(|log| early_end(log).is_none()) {
        return Ok(());
    }
    // without a checkpoint the run starts from the beginning
    let present = present.filter(|log| log.last_sound_checkpoint().is_ok());
    let mut command = runner.command()?;
    match present {
        Some(_) => command.arg("resume").arg(&log),
        None => command
            .arg("run")
            .arg(variant.case(folder))
            .args(["--force", "--out"])
            .arg(&log),
    };
    command.arg("--quiet");
    if let Some(threads) = runner.threads {
        command.args(["--threads", &threads.to_string()]);
    }
    // the run ends with its input, which closes when this process ends
    command.arg("--end-with-input").stdin(Stdio::piped());
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| {
        let program = command.get_program().display();
        RunFailure::Failed(format!("cannot start {program}: {error}"))
    })?;
    let _input = child.stdin.take();
    let output = child.wait_with_output()?;
    let messages = log.with_extension("txt");
    if !output.stderr.is_empty() {
        write_text(&messages, &output.stderr)?;
    }
    match output.status.code() {
        Some(0) => Ok(()),
        // ended by a signal, or at the request of one: SIGINT or SIGTERM
        None | Some(130 | 143) => Err(RunFailure::Interrupted),
        Some(_) => Err(RunFailure::Failed(format!("see {}", messages.display()))),
    }
}

/// Blocks while another run writes a log. A run of a sweep that has just ended writes until the end of its step.
fn wait_for(log: &Path) {
    const INTERVAL: Duration = Duration::from_millis(100);
    let mut is_told = false;
    while !LogPlace::is_free(log) {
        if !is_told {
            tell(&format!(
                "waiting for another run that writes {}",
                log.display()
            ));
            is_told = true;
        }
        std::thread::sleep(INTERVAL);
    }
}
