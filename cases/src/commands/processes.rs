//! The processes that share a run, which a launcher such as `mpiexec` starts.

use perimelt_core::transport::Processes;

use super::Done;

/// Variables by which launchers tell a process how many there are.
const SIZES: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"];

/// Variables by which launchers tell a process how many run on its machine.
const LOCAL_SIZES: [&str; 2] = ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS"];

/// A program without MPI that is started as several processes, which would all write the same log.
#[cfg(not(feature = "mpi"))]
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error(
    "a launcher has started {0} processes, and this program was built without MPI: build it with `--features mpi`, or start it once"
)]
struct WithoutMpi(usize);

/// The first of these variables that is a number.
fn number(variables: &[&str]) -> Option<usize> {
    let mut values = variables.iter().filter_map(|name| std::env::var(name).ok());
    values.find_map(|value| value.parse().ok())
}

/// Number of threads of each process where several share a machine.
pub(super) fn threads_of_process() -> Option<usize> {
    let processes = number(&LOCAL_SIZES).filter(|count| *count > 1)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    Some((cores / processes).max(1))
}

/// Runs as one of the processes that a launcher has started.
#[cfg(not(feature = "mpi"))]
pub(super) fn shared(run: impl FnOnce(Processes) -> Done) -> Done {
    match number(&SIZES).filter(|count| *count > 1) {
        Some(count) => Err(WithoutMpi(count).into()),
        None => run(Processes::ALONE),
    }
}

/// Runs as one of the processes that a launcher has started. The mistake of one ends all.
#[cfg(feature = "mpi")]
pub(super) fn shared(run: impl FnOnce(Processes) -> Done) -> Done {
    use super::run::Interrupted;
    use perimelt_core::transport::Mpi;
    use std::sync::Arc;
    use std::time::Duration;

    /// Time after which another process than the first one tells its mistake: most mistakes are those of all.
    const PATIENCE: Duration = Duration::from_secs(5);

    if number(&SIZES).is_none_or(|count| count == 1) {
        return run(Processes::ALONE);
    }
    let (_universe, process) = Mpi::start()?;
    let processes = Processes::new(Arc::new(process));
    let result = run(processes.clone());
    if let (Err(error), Some(transport)) = (&result, processes.transport())
        && !error.is::<Interrupted>()
    {
        if transport.rank() > 0 {
            std::thread::sleep(PATIENCE);
        }
        super::report(&**error);
        transport.end_all(1);
    }
    result
}
