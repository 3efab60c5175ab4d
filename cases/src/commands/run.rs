//! `perimelt run` and `perimelt resume`.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Done;
use crate::case::Case;
use crate::run::display::{duration, warn};
use crate::run::{self, End, Options, Summary};

#[derive(clap::Args, Debug)]
pub struct RunArgs {
    /// The case file
    case: PathBuf,
    /// The log to write [default: name of the case with .mcap, in the working directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args, Debug)]
pub struct ResumeArgs {
    /// The log
    log: PathBuf,
    /// Write a new log instead of replacing the old one
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args, Debug)]
struct Common {
    /// Number of threads [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Stop at the first logged state at or after this simulated time, s
    #[arg(long, value_name = "T")]
    until: Option<f64>,
    /// Show no progress
    #[arg(long)]
    quiet: bool,
}

/// Why a command cannot start.
#[derive(Debug, thiserror::Error)]
enum ArgumentError {
    #[error("`--threads` must be at least 1")]
    NoThreads,
    #[error("{path} is a log, not a case file; use `perimelt resume` to continue its run", path = .0.display())]
    IsLog(PathBuf),
    #[error("the log would overwrite the case file {path}; give another `--out`", path = .0.display())]
    OverwritesCase(PathBuf),
}

pub fn run(args: &RunArgs) -> Done {
    if args.case.extension().is_some_and(|e| e == "mcap") {
        return Err(ArgumentError::IsLog(args.case.clone()).into());
    }
    set_threads(args.common.threads)?;
    let case = Case::read(&args.case)?;
    let stem = args.case.file_stem().unwrap_or_default();
    let out = args.out.clone().unwrap_or_else(|| {
        // appended, because a name such as `tension-0.5` contains dots
        let mut name = stem.to_os_string();
        name.push(".mcap");
        PathBuf::from(name)
    });
    if let (Ok(a), Ok(b)) = (out.canonicalize(), args.case.canonicalize())
        && a == b
    {
        return Err(ArgumentError::OverwritesCase(out).into());
    }
    let options = args.common.options(out);
    let summary = run::on_workers(|| run::run(&case, &options))?;
    args.common.tell(&summary);
    Ok(())
}

pub fn resume(args: &ResumeArgs) -> Done {
    set_threads(args.common.threads)?;
    let out = args.out.clone().unwrap_or_else(|| args.log.clone());
    let options = args.common.options(out);
    let summary = run::on_workers(|| run::resume(&args.log, &options))?;
    args.common.tell(&summary);
    Ok(())
}

impl Common {
    fn options(&self, out: PathBuf) -> Options {
        let stop = Arc::new(AtomicBool::new(false));
        let asked = stop.clone();
        // a second request does not wait for the step to end
        let handler = move || {
            if asked.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        };
        // without a handler the run is killed, and the log is still good
        if let Err(error) = ctrlc::set_handler(handler) {
            eprintln!("warning: Ctrl-C will end the run at once: {error}");
        }
        Options {
            out,
            until: self.until,
            quiet: self.quiet,
            stop,
        }
    }

    fn tell(&self, summary: &Summary) {
        if self.quiet {
            return;
        }
        let log = summary.log.display();
        let how = match summary.end {
            End::Finished => "finished",
            End::Until => "stopped at the requested time",
            End::Stopped => "interrupted",
        };
        println!(
            "{how} at t = {:.6e} s after {} steps in {}: {log}",
            summary.time,
            summary.steps,
            duration(summary.wall_seconds)
        );
        for fact in &summary.facts {
            println!("{fact}");
        }
        warn(&summary.warnings);
        if summary.end != End::Finished {
            println!("continue with: perimelt resume {log}");
        }
    }
}

fn set_threads(threads: Option<usize>) -> Done {
    match threads {
        None => Ok(()),
        Some(0) => Err(ArgumentError::NoThreads.into()),
        Some(count) => Ok(rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build_global()?),
    }
}
