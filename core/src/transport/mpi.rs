//! Processes of an MPI program.
//!
//! MPI is initialised for calls of one thread at a time (`Serialized`): the run executes on a thread of the pool. A lock makes sure of it.

use std::sync::Mutex;

use ::mpi::Threading;
use ::mpi::collective::SystemOperation;
use ::mpi::environment::Universe;
use ::mpi::topology::SimpleCommunicator;
use ::mpi::traits::{Communicator, CommunicatorCollectives, Destination, Root, Source};

use super::{Message, Transport};

/// Most bytes of a message that gathers data: rounds bound the memory of the first process.
const ROUND: usize = 64 << 20;

/// Why MPI cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MpiError {
    /// A second initialisation.
    #[error("MPI is initialised already")]
    Twice,
    /// A library without threads.
    #[error(
        "this MPI library serves the main thread only (level of thread support below MPI_THREAD_SERIALIZED)"
    )]
    Threads,
}

/// A process of an MPI program.
#[derive(Debug)]
pub struct Mpi {
    rank: usize,
    size: usize,
    call: Mutex<()>,
}

impl Mpi {
    /// Initialises MPI, which ends when the universe is dropped.
    ///
    /// # Errors
    /// When MPI runs already, or without support of threads.
    pub fn start() -> Result<(Universe, Mpi), MpiError> {
        let started = ::mpi::initialize_with_threading(Threading::Serialized);
        let (universe, threading) = started.ok_or(MpiError::Twice)?;
        if threading < Threading::Serialized {
            return Err(MpiError::Threads);
        }
        let world = universe.world();
        let process = Mpi {
            rank: world.rank() as usize,
            size: world.size() as usize,
            call: Mutex::new(()),
        };
        Ok((universe, process))
    }

    /// Calls MPI.
    fn call<T>(&self, call: impl FnOnce(SimpleCommunicator) -> T) -> T {
        let _only = self.call.lock().expect("no panic during a call of MPI");
        call(SimpleCommunicator::world())
    }
}

impl Transport for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn exchange(&self, messages: &mut [Message]) {
        self.call(|world| {
            ::mpi::request::multiple_scope(2 * messages.len(), |scope, requests| {
                for message in &mut *messages {
                    let other = world.process_at_rank(message.process as i32);
                    requests.add(other.immediate_receive_into(scope, &mut message.received[..]));
                    requests.add(other.immediate_send(scope, &message.sent[..]));
                }
                let mut done = Vec::with_capacity(requests.incomplete());
                requests.wait_all(&mut done);
            });
        });
    }

    fn sum(&self, values: &mut [i64]) {
        let own = values.to_vec();
        self.call(|world| world.all_reduce_into(&own[..], values, SystemOperation::sum()));
    }

    fn max(&self, values: &mut [f64]) {
        let without_nan = |v: &f64| if v.is_nan() { f64::NEG_INFINITY } else { *v };
        let is_nan = |v: &f64| f64::from(u8::from(v.is_nan()));
        let own: Vec<f64> = values
            .iter()
            .map(without_nan)
            .chain(values.iter().map(is_nan))
            .collect();
        let mut all = own.clone();
        self.call(|world| world.all_reduce_into(&own[..], &mut all[..], SystemOperation::max()));
        let (largest, is_nan) = all.split_at(values.len());
        for (value, (largest, is_nan)) in values.iter_mut().zip(largest.iter().zip(is_nan)) {
            *value = if *is_nan > 0.0 { f64::NAN } else { *largest };
        }
    }

    fn gather(&self, bytes: &[u8], receive: &mut dyn FnMut(usize, &[u8])) {
        self.call(|world| {
            if self.rank > 0 {
                let first = world.process_at_rank(0);
                first.send(&(bytes.len() as u64));
                bytes.chunks(ROUND).for_each(|round| first.send(round));
                return;
            }
            receive(0, bytes);
            let mut buffer = Vec::new();
            for rank in 1..self.size {
                let other = world.process_at_rank(rank as i32);
                let (length, _) = other.receive::<u64>();
                buffer.resize(length as usize, 0);
                buffer.chunks_mut(ROUND).for_each(|round| {
                    other.receive_into(round);
                });
                receive(rank, &buffer);
            }
        });
    }

    fn broadcast(&self, bytes: &mut Vec<u8>) {
        self.call(|world| {
            let first = world.process_at_rank(0);
            let mut length = bytes.len() as u64;
            first.broadcast_into(&mut length);
            bytes.resize(length as usize, 0);
            bytes
                .chunks_mut(ROUND)
                .for_each(|round| first.broadcast_into(round));
        });
    }

    fn end_all(&self, code: i32) -> ! {
        SimpleCommunicator::world().abort(code)
    }
}
