//! `perimelt bench`: how fast this machine sweeps over bonds and what limits it, or how fast processes exchange messages and what follows for many of them.
//!
//! or the memory and set-up of cases. Each prints a page in Markdown: `docs/kernels.md`, `docs/scaling.md` and `docs/memory.md`.

mod footprint;
mod messages;
mod model;
mod sweeps;

use std::error::Error;
use std::hint::black_box;
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use perimelt_core::transport::Processes;

use crate::argument;
use crate::case::change::Change;
use crate::verify::results::machine;

#[derive(clap::Args, Debug)]
pub struct BenchArgs {
    /// Cases whose set-up and memory are measured, instead of sweeps
    #[arg(value_name = "CASE", conflicts_with_all = ["threads", "mpi"])]
    pub cases: Vec<PathBuf>,
    /// Numbers of points that the cases get by other spacings, such as 1e6,8e6 [default: those of the cases]
    #[arg(long, value_delimiter = ',', value_name = "N", requires = "cases", value_parser = points)]
    pub points: Vec<f64>,
    /// Measure one case in this program, for another one that prints the table
    #[arg(long, hide = true, requires = "cases")]
    pub alone: bool,
    /// Another value of a key of that case
    #[arg(long, value_name = "KEY=VALUE", hide = true, requires = "alone")]
    pub set: Vec<Change>,
    /// Numbers of threads [default: 1 and those of the machine]
    #[arg(long, value_delimiter = ',', value_parser = argument::threads, conflicts_with = "mpi")]
    pub threads: Vec<usize>,
    /// Measure the messages of the processes that a launcher has started, instead of sweeps, and estimate the speed of many processes
    #[arg(long)]
    pub mpi: bool,
}

/// Messages of a program that was started once.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error(
    "one process exchanges no messages: start several, as by `mpiexec -n 2 perimelt bench --mpi`, of a program built with `--features mpi`"
)]
struct Single;

/// A number of points.
fn points(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .ok()
        .filter(|n: &f64| *n >= 1.0 && n.is_finite());
    number.ok_or_else(|| "expected a number of points, such as 1e6".into())
}

/// Prints the page of a machine, or that of cases.
///
/// # Errors
/// When threads cannot be started, or the output cannot be written.
pub fn bench(args: &BenchArgs, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    if let ([case], true) = (&args.cases[..], args.alone) {
        return footprint::measure(case, &args.set, out);
    }
    if !args.cases.is_empty() {
        writeln!(out, "# Memory and set-up\n\nMachine: {}.\n", machine())?;
        return footprint::write(&args.cases, &args.points, out);
    }
    writeln!(
        out,
        "# Kernels\n\nWritten by `perimelt bench`. Machine: {}.\n",
        machine()
    )?;
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = match &args.threads[..] {
        [] if all > 1 => vec![1, all],
        [] => vec![1],
        given => given.to_vec(),
    };
    sweeps::write(&threads, out)
}

/// Prints the page of processes; the first one does.
///
/// # Errors
/// For a single process, and when the output cannot be written.
pub fn bench_messages(processes: &Processes, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    let transport = processes.transport().ok_or(Single)?;
    let measured = messages::measure(transport)?;
    if transport.rank() == 0 {
        model::write(&measured, out)?;
    }
    Ok(())
}

/// Shortest time of a call among some, s.
fn shortest(calls: usize, mut call: impl FnMut()) -> f64 {
    let times = (0..calls).map(|_| {
        let start = Instant::now();
        call();
        start.elapsed().as_secs_f64()
    });
    black_box(times.fold(f64::INFINITY, f64::min))
}
