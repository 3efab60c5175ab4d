//! Communication of the processes that share a run.
//!
//! Each process owns a part of the points of every body ([`Part`](crate::body::Part)). Calls of a [`Transport`] are collective: all
//! processes make the same calls in the same order, and each waits for those from which it needs something. A run of one process has none, and its
//! calls do nothing ([`Processes::ALONE`]).
//!
//! | transport | processes are |
//! |---|---|
//! | [`Memory`] | threads of one program |
//! | `Mpi` | those of an MPI program (feature `mpi`) |

pub(crate) mod exchange;
mod memory;
#[cfg(feature = "mpi")]
mod mpi;

use std::fmt;
use std::sync::Arc;

pub use memory::Memory;
#[cfg(feature = "mpi")]
pub use mpi::{Mpi, MpiError};

/// Consecutive points that one process owns together: sums over points add up such groups in order.
pub const GROUP: usize = 64;

/// Communication of processes, numbered from 0.
pub trait Transport: fmt::Debug + Send + Sync {
    /// Number of this process.
    fn rank(&self) -> usize;

    /// Number of processes.
    fn size(&self) -> usize;

    /// Sends a message to each of some processes and receives one of known length from each. The other process names this one, too.
    fn exchange(&self, messages: &mut [Message]);

    /// Replaces numbers by their sums over all processes.
    fn sum(&self, values: &mut [i64]);

    /// Replaces numbers by the largest ones of all processes. NaN counts as larger than all numbers.
    fn max(&self, values: &mut [f64]);

    /// Passes the bytes of each process in order to `receive` of the first process, with its number.
    fn gather(&self, bytes: &[u8], receive: &mut dyn FnMut(usize, &[u8]));

    /// Replaces the bytes by those of the first process.
    fn broadcast(&self, bytes: &mut Vec<u8>);

    /// Ends all processes, this one with an exit code.
    fn end_all(&self, code: i32) -> !;
}

/// What a process sends to another one and receives from it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Message {
    /// The other process.
    pub process: usize,
    /// Values for it.
    pub sent: Vec<f64>,
    /// Values from it; the length is known before.
    pub received: Vec<f64>,
}

/// The processes that share a run.
#[derive(Clone, Debug, Default)]
pub struct Processes(Option<Arc<dyn Transport>>);

impl Processes {
    /// A run of one process.
    pub const ALONE: Processes = Processes(None);

    /// Processes that communicate by a transport.
    pub fn new(transport: Arc<dyn Transport>) -> Processes {
        Processes(Some(transport).filter(|transport| transport.size() > 1))
    }

    /// The transport; `None` for one process.
    pub fn transport(&self) -> Option<&dyn Transport> {
        self.0.as_deref()
    }

    /// Number of this process.
    pub fn rank(&self) -> usize {
        self.transport().map_or(0, Transport::rank)
    }

    /// Number of processes.
    pub fn size(&self) -> usize {
        self.transport().map_or(1, Transport::size)
    }

    /// The largest number of all processes, NaN if there is one.
    pub fn max(&self, value: f64) -> f64 {
        let mut largest = [value];
        if let Some(transport) = self.transport() {
            transport.max(&mut largest);
        }
        largest[0]
    }

    /// The least number of all processes, NaN if there is one.
    pub fn min(&self, value: f64) -> f64 {
        -self.max(-value)
    }

    /// Replaces numbers by the least ones of all processes.
    pub fn min_each(&self, values: &mut [f64]) {
        if let Some(transport) = self.transport() {
            values.iter_mut().for_each(|value| *value = -*value);
            transport.max(values);
            values.iter_mut().for_each(|value| *value = -*value);
        }
    }

    /// Whether something is true in any process.
    pub fn any(&self, value: bool) -> bool {
        self.max(f64::from(u8::from(value))) > 0.0
    }
}
