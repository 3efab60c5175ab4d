//! `perimelt run` and `perimelt resume`.

use std::io::Write;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use perimelt_core::instructions::{InstructionSet, limit_instructions};
use perimelt_core::transport::Processes;

use super::{Done, processes};
use crate::argument::{self, positive};
use crate::case::Case;
use crate::case::change::Change;
use crate::interrupt;
use crate::run::{self, End, Options, Summary};
use crate::terminal::warn;
use crate::unit::duration;
use crate::unit::time_text;

#[derive(clap::Args, Debug)]
pub struct RunArgs {
    /// The case file
    case: PathBuf,
    /// Another value of a key, as TOML, such as `couplers.goldak.power=2000`; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Change>,
    /// The log to write [default: name of the case with .mcap, in the working directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace a log that exists
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args, Debug)]
pub struct ResumeArgs {
    /// The log
    log: PathBuf,
    /// Go on with this case file, which may have another end, other steps and times of logging
    #[arg(long, value_name = "FILE")]
    case: Option<PathBuf>,
    /// Write a new log instead of replacing the old one
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace the file that `--out` names if it exists
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    common: Common,
}

/// What a command takes of the machine.
#[derive(clap::Args, Debug)]
pub(super) struct Machine {
    /// Number of threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = argument::threads)]
    threads: Option<usize>,
    /// Widest instruction set to use: results of two machines are the same bit by bit if both use it
    /// [default: the widest of the machine]
    #[arg(long, value_name = "SET", value_parser = instruction_set())]
    instructions: Option<InstructionSet>,
    /// Start also where a body will take more memory than is free
    #[arg(long)]
    any_memory: bool,
}

/// Reads an instruction set by its name.
fn instruction_set() -> impl TypedValueParser<Value = InstructionSet> {
    let names = PossibleValuesParser::new(InstructionSet::ALL.map(InstructionSet::name));
    names.map(|name| {
        let mut all = InstructionSet::ALL.into_iter();
        all.find(|set| set.name() == name).expect("a known name")
    })
}

impl Machine {
    /// Takes the threads and the instructions for all that this program computes.
    pub(super) fn take(&self) -> Done {
        if let Some(set) = self.instructions {
            limit_instructions(set).expect("a command takes the machine before it computes");
        }
        take_threads(self.threads)
    }

    /// The case with the limit of memory of this command.
    pub(super) fn limited(&self, mut case: Case) -> Case {
        case.memory = case.memory.filter(|_| !self.any_memory);
        case
    }
}

#[derive(clap::Args, Debug)]
struct Common {
    #[command(flatten)]
    machine: Machine,
    /// Stop at the first logged state at or after this simulated time, s
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = positive)]
    until: Option<f64>,
    /// Show nothing but errors: no progress, warnings or results
    #[arg(long)]
    quiet: bool,
    /// End as at SIGTERM when the input ends: the command that started the run holds it open
    #[arg(long, hide = true)]
    end_with_input: bool,
}

/// Why a command cannot start.
#[derive(Debug, thiserror::Error)]
enum ArgumentError {
    #[error("{path} is a log, not a case file; use `perimelt resume` to continue its run", path = .0.display())]
    IsLog(PathBuf),
    #[error("the log would overwrite the case file {path}; give another `--out`", path = .0.display())]
    OverwritesCase(PathBuf),
}

/// A run that a signal ended early: no mistake, and not finished. Its exit status is that of a program that the signal
/// ended.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("interrupted by signal {0}")]
pub struct Interrupted(pub usize);

pub fn run(args: &RunArgs) -> Done {
    if args.case.extension().is_some_and(|e| e == "mcap") {
        return Err(ArgumentError::IsLog(args.case.clone()).into());
    }
    args.common.machine.take()?;
    let case = args
        .common
        .machine
        .limited(Case::read(&args.case)?.changed(&args.set)?);
    let out = args.out.clone().unwrap_or_else(|| run::log_of(&args.case));
    if let (Ok(a), Ok(b)) = (out.canonicalize(), args.case.canonicalize())
        && a == b
    {
        return Err(ArgumentError::OverwritesCase(out).into());
    }
    processes::shared(|processes| {
        let options = args.common.options(out, args.force, processes);
        let summary = run::on_workers(|| run::run(&case, &options))?;
        args.common.tell(&summary, &options)
    })
}

pub fn resume(args: &ResumeArgs) -> Done {
    args.common.machine.take()?;
    let out = args.out.clone().unwrap_or_else(|| args.log.clone());
    let case = args.case.as_deref().map(Case::read).transpose()?;
    let case = case.map(|case| args.common.machine.limited(case));
    processes::shared(|processes| {
        let options = args.common.options(out, args.force, processes);
        let summary = run::on_workers(|| run::resume(&args.log, case.as_ref(), &options))?;
        args.common.tell(&summary, &options)
    })
}

impl Common {
    fn options(&self, out: PathBuf, force: bool, processes: Processes) -> Options {
        // launchers pass their input to the first process
        if self.end_with_input && processes.rank() == 0 {
            std::thread::spawn(|| {
                let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
                interrupt::request_end();
            });
        }
        Options {
            out,
            force,
            until: self.until,
            quiet: self.quiet,
            stop: interrupt::signal(),
            processes,
        }
    }

    /// Prints the result of the run and returns the exit status.
    fn tell(&self, summary: &Summary, options: &Options) -> Done {
        if options.tells() {
            self.print(summary)?;
        }
        match summary.end {
            End::Stopped(signal) => Err(Interrupted(signal).into()),
            End::Finished | End::Until => Ok(()),
        }
    }

    fn print(&self, summary: &Summary) -> std::io::Result<()> {
        let out = &mut crate::terminal::output();
        let log = summary.log.display();
        let how = match summary.end {
            End::Finished => "finished",
            End::Until => "stopped at the requested time",
            End::Stopped(_) => "interrupted",
        };
        writeln!(
            out,
            "{how} at t = {} after {} steps in {}: {log}",
            time_text(summary.time),
            summary.steps,
            duration(summary.wall_seconds)
        )?;
        for fact in &summary.facts {
            writeln!(out, "{fact}")?;
        }
        warn(&summary.warnings);
        if summary.end != End::Finished {
            writeln!(out, "continue with: perimelt resume {log}")?;
        }
        Ok(())
    }
}

fn take_threads(threads: Option<usize>) -> Done {
    match threads.or_else(processes::threads_of_process) {
        None => Ok(()),
        Some(count) => Ok(rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build_global()?),
    }
}
