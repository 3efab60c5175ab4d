//! `perimelt bench`: how fast this machine sweeps over bonds and what limits it, or how fast processes exchange messages and what follows for many of them.
//!
//! Both print a page in Markdown: `docs/kernels.md` and `docs/scaling.md`.

mod messages;
mod model;
mod sweeps;

use std::error::Error;
use std::hint::black_box;
use std::io::Write;
use std::time::Instant;

use perimelt_core::transport::Processes;

use crate::argument;
use crate::verify::results::machine;

#[derive(clap::Args, Debug)]
pub struct BenchArgs {
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

/// Prints the page of a machine.
///
/// # Errors
/// When threads cannot be started, or the output cannot be written.
pub fn bench(args: &BenchArgs, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
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
