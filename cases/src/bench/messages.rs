//! Times of messages among processes, and of the work between them.

use std::error::Error;

use perimelt_core::transport::{Message, Transport};

use super::shortest;
use super::sweeps::{Force, Heat, Points, Timed};

/// Calls of which the fastest counts, and repetitions in each.
const CALLS: usize = 20;
const REPEATED: usize = 50;

/// Numbers in a short and in a long message.
const SHORT: usize = 1;
const LONG: usize = 1 << 17;

/// Numbers of an exact sum.
const LIMBS: usize = 68;

/// Points along an edge of the block that each process sweeps.
const EDGE: usize = 64;

/// What processes measure together: times of the slowest one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// Number of processes.
    pub(super) processes: usize,
    /// Time of a short message both ways between pairs, s.
    pub(super) latency: f64,
    /// Numbers per second of a long message, in each direction.
    pub(super) bandwidth: f64,
    /// Time of an exact sum, s.
    pub(super) sum: f64,
    /// Time of a maximum, s.
    pub(super) max: f64,
    /// Time of a sweep of heat, and of force, per point, s.
    pub(super) heat: f64,
    pub(super) force: f64,
}

/// Measures with all processes at work. Each exchanges with the process half of their number away: on several machines through the network, of which each has its share.
pub(super) fn measure(transport: &dyn Transport) -> Result<Measured, Box<dyn Error>> {
    let size = transport.size();
    let slowest = |seconds: f64| {
        let mut slowest = [seconds];
        transport.max(&mut slowest);
        slowest[0]
    };
    let half = size / 2;
    let rank = transport.rank();
    // the last of an odd number is left out
    let other = match rank {
        rank if rank < half => Some(rank + half),
        rank if rank < 2 * half => Some(rank - half),
        _ => None,
    };
    let exchange = |numbers: usize| {
        let message = |process| Message {
            process,
            sent: vec![1.0; numbers],
            received: vec![0.0; numbers],
        };
        let mut messages: Vec<Message> = other.map(message).into_iter().collect();
        let seconds = shortest(CALLS, || {
            (0..REPEATED).for_each(|_| transport.exchange(&mut messages));
        });
        slowest(seconds / REPEATED as f64)
    };
    let latency = exchange(SHORT);
    let bandwidth = LONG as f64 / (exchange(LONG) - latency).max(f64::MIN_POSITIVE);
    let mut limbs = [0; LIMBS];
    let sum = shortest(CALLS, || {
        (0..REPEATED).for_each(|_| transport.sum(&mut limbs));
    });
    let sum = slowest(sum / REPEATED as f64);
    let mut largest = [0.0];
    let max = shortest(CALLS, || {
        (0..REPEATED).for_each(|_| transport.max(&mut largest));
    });
    let max = slowest(max / REPEATED as f64);

    let block = Points::Bare.block(EDGE)?;
    let family = Points::Bare.family(&block)?;
    let points = block.points.len();
    let timed = Timed::new(&family, points);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut per_point = |sweep: &(dyn Fn() -> f64 + Sync)| {
        transport.max(&mut largest);
        slowest(pool.install(sweep) / points as f64)
    };
    Ok(Measured {
        processes: size,
        latency,
        bandwidth,
        sum,
        max,
        heat: per_point(&|| timed.seconds(&Heat)),
        force: per_point(&|| timed.seconds(&Force)),
    })
}
