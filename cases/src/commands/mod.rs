//! The command line.

mod bench;
mod check;
mod diff;
mod explain;
mod info;
mod list;
mod new;
mod processes;
mod replay;
mod run;
mod schema;
mod summary;
mod synonyms;
mod trim;
mod version;

use std::error::Error;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::case::CaseError;
use crate::run::Failure;
use crate::sweep::SweepError;
use crate::terminal::tell;
use crate::{export, interrupt, plot, sweep, verify, view};

/// Simulates welding and additive manufacturing with peridynamics.
#[derive(Parser, Debug)]
#[command(name = "perimelt", about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Write a case file to start from, or list those that there are
    New(new::NewArgs),
    /// Run a case and write its log
    Run(run::RunArgs),
    /// Check a case without running it: points, bonds, memory, steps, duration
    Check(check::CheckArgs),
    /// List physics, couplers, fields, material properties and library materials
    List(list::ListArgs),
    /// Explain a plugin, a section of the case file, a key, a field, a material or its properties
    Explain(explain::ExplainArgs),
    /// Print the JSON schema of case files, for editors
    Schema,
    /// Print a script that completes commands and options in a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Show the contents of a log
    Info(info::InfoArgs),
    /// Print what a process engineer reads off a log: melt pool, fusion and heat-affected zone, cooling times, distortion, stress, energies
    Summary(summary::SummaryArgs),
    /// Step through a log: time, probes, balance
    Replay(replay::ReplayArgs),
    /// Cut a time window out of a log
    Trim(trim::TrimArgs),
    /// Compare fields, probes and balances of two logs; exit status 0: equal, 1: different, 2: error
    Diff(crate::diff::DiffArgs),
    /// Resume a run from the last checkpoint of its log
    Resume(run::ResumeArgs),
    /// Run a case with several values of some of its keys, and compare what is read off
    Sweep(sweep::SweepArgs),
    /// Export a log to ParaView or CSV
    Export(export::ExportArgs),
    /// Draw pictures of a log
    Plot(plot::PlotArgs),
    /// Show a log in the browser, also while the run goes on
    View(view::ViewArgs),
    /// Run benchmark cases and compare them with their references
    Verify(verify::VerifyArgs),
    /// Measure the speed of sweeps on this machine and what limits it, or that of messages among processes
    Bench(crate::bench::BenchArgs),
}

type Done = Result<(), Box<dyn Error>>;

/// The program: parses its arguments, runs the command, and reports errors.
pub fn main() -> ExitCode {
    let command = version::command(Arguments::command());
    let arguments = Arguments::from_arg_matches(&command.get_matches());
    let arguments = arguments.unwrap_or_else(|error| error.exit());
    if let Err(error) = interrupt::watch() {
        tell(&format!(
            "warning: signals will end the program at once: {error}"
        ));
    }
    let failed = match arguments.command {
        Command::Diff(_) => ExitCode::from(diff::ERROR),
        _ => ExitCode::FAILURE,
    };
    let result = match arguments.command {
        Command::New(args) => new::run(&args),
        Command::Run(args) => run::run(&args),
        Command::Check(args) => check::run(&args),
        Command::List(args) => list::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::Schema => print_schema(),
        Command::Completions { shell } => print_completions(shell),
        Command::Info(args) => info::run(&args),
        Command::Summary(args) => summary::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Resume(args) => run::resume(&args),
        Command::Trim(args) => trim::run(&args),
        Command::Diff(args) => diff::run(&args),
        Command::Sweep(args) => sweep::sweep(&args, &mut crate::terminal::output()),
        Command::Export(args) => export(&args),
        Command::Plot(args) => plot(&args),
        Command::View(args) => {
            view::view(&args, &mut crate::terminal::output()).map_err(Into::into)
        }
        Command::Verify(args) => verify::run(&args),
        Command::Bench(args) => bench::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if is_closed_pipe(&*error) => ExitCode::SUCCESS,
        Err(error) if error.is::<diff::Different>() => ExitCode::from(diff::DIFFERENT),
        Err(error) => match error.downcast_ref() {
            Some(run::Interrupted(signal)) => ExitCode::from(128 + *signal as u8),
            None => {
                report(&*error);
                failed
            }
        },
    }
}

/// Shows an error; mistakes in a case file with their line.
fn report(error: &(dyn Error + 'static)) {
    let failure = error.downcast_ref::<Failure>();
    let in_case = match failure {
        Some(Failure::Case(e)) => Some(e),
        _ => match error.downcast_ref::<SweepError>() {
            Some(SweepError::Case(e)) => Some(e),
            _ => error.downcast_ref::<CaseError>(),
        },
    };
    match in_case {
        // colours are control characters; the library that sets them shows those of the text
        Some(mistakes) if std::io::stderr().is_terminal() => {
            let _ = writeln!(std::io::stderr(), "{}", mistakes.render(true));
        }
        Some(mistakes) => tell(&mistakes.render(false)),
        None => tell(&format!("error: {error}")),
    }
}

/// A number of threads in words.
fn threads(count: usize) -> String {
    match count {
        1 => "1 thread".into(),
        count => format!("{count} threads"),
    }
}

/// Whether the reader of the output has closed it, as `head` does.
fn is_closed_pipe(error: &(dyn Error + 'static)) -> bool {
    let io = error.downcast_ref::<std::io::Error>();
    io.is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Writes files and prints how many, and which one to open.
fn export(args: &export::ExportArgs) -> Done {
    let export::Exported {
        files,
        is_displaced,
    } = export::export(args)?;
    let Some(last) = files.last() else {
        return Ok(());
    };
    let out = &mut crate::terminal::output();
    let (count, last) = (files.len(), last.display());
    writeln!(out, "{count} files, the last is {last}")?;
    if is_displaced {
        let undeformed = match args.format {
            export::ExportFormat::Vtk => "`reference_position` has those of the undeformed body",
            export::ExportFormat::Csv | export::ExportFormat::Exaca => {
                "less `displacement`, they are those of the undeformed body"
            }
        };
        writeln!(out, "points are at their displaced positions; {undeformed}")?;
    }
    Ok(())
}

/// Draws pictures and prints their paths.
fn plot(args: &plot::PlotArgs) -> Done {
    let mut out = crate::terminal::output();
    let plotted = plot::plot(args)?;
    for plot::Plotted { path, .. } in &plotted {
        writeln!(out, "{}", path.display())?;
    }
    let unchanged = plotted.iter().filter(|plotted| plotted.unchanged).count();
    if unchanged > 0 {
        let all = plotted.len();
        tell(&format!(
            "note: {unchanged} of {all} files had their picture already and were not written again"
        ));
    }
    Ok(())
}

fn print_completions(shell: clap_complete::Shell) -> Done {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "perimelt", &mut script);
    Ok(std::io::stdout().write_all(&script)?)
}

fn print_schema() -> Done {
    let text = serde_json::to_string_pretty(&schema::whole_schema())?;
    Ok(writeln!(std::io::stdout(), "{text}")?)
}
