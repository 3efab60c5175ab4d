//! Threads of one program as processes: what tests divide a body with.

use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

use super::{Message, Transport};

/// Time after which a process that waits gives up: another one has ended, or made other calls.
const PATIENCE: Duration = Duration::from_secs(300);

/// A process that is a thread, and communicates with the other ones through memory.
#[derive(Debug)]
pub struct Memory {
    rank: usize,
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    round: Mutex<Round>,
    changed: Condvar,
}

/// A call to which each process contributes.
#[derive(Debug, Default)]
struct Round {
    /// Contributions; all are there while processes take them.
    given: Vec<Option<Arc<Contribution>>>,
    taken: usize,
    failed: bool,
}

/// What a process contributes to a call.
#[derive(Debug)]
enum Contribution {
    Messages(Vec<(usize, Vec<f64>)>),
    Integers(Vec<i64>),
    Numbers(Vec<f64>),
    Bytes(Vec<u8>),
}

impl Memory {
    /// Processes of this number, the first one first.
    pub fn processes(size: usize) -> Vec<Memory> {
        let round = Round {
            given: (0..size).map(|_| None).collect(),
            ..Round::default()
        };
        let shared = Arc::new(Shared {
            round: Mutex::new(round),
            changed: Condvar::new(),
        });
        let process = |rank| Memory {
            rank,
            shared: shared.clone(),
        };
        (0..size).map(process).collect()
    }

    /// The contributions of all processes to a call.
    ///
    /// # Panics
    /// When another process has panicked, or does not make the call.
    fn share(&self, own: Contribution) -> Vec<Arc<Contribution>> {
        // the call before has ended when all have taken its contributions
        let mut round =
            self.wait_until(|round| round.taken == 0 && round.given[self.rank].is_none());
        round.given[self.rank] = Some(Arc::new(own));
        drop(round);
        self.shared.changed.notify_all();
        let mut round = self.wait_until(|round| round.given.iter().all(Option::is_some));
        let all = round.given.iter().flatten().cloned().collect();
        round.taken += 1;
        if round.taken == round.given.len() {
            round.taken = 0;
            round.given.fill(None);
        }
        drop(round);
        self.shared.changed.notify_all();
        all
    }

    fn wait_until(&self, is_so: impl Fn(&Round) -> bool) -> MutexGuard<'_, Round> {
        let round = self.shared.round.lock().expect("no panic with the lock");
        let (round, timeout) = self
            .shared
            .changed
            .wait_timeout_while(round, PATIENCE, |round| !round.failed && !is_so(round))
            .expect("no panic with the lock");
        if round.failed || timeout.timed_out() {
            drop(round);
            panic!("process {} waits for another one that has ended", self.rank);
        }
        round
    }
}

impl Drop for Memory {
    /// Ends the others where this one panics.
    fn drop(&mut self) {
        if std::thread::panicking()
            && let Ok(mut round) = self.shared.round.lock()
        {
            round.failed = true;
            self.shared.changed.notify_all();
        }
    }
}

impl Transport for Memory {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.shared
            .round
            .lock()
            .map_or(0, |round| round.given.len())
    }

    fn exchange(&self, messages: &mut [Message]) {
        let sent = messages.iter();
        let sent = sent.map(|m| (m.process, m.sent.clone()));
        let all = self.share(Contribution::Messages(sent.collect()));
        let sent = |from: usize, to: usize| match &*all[from] {
            Contribution::Messages(messages) => messages.iter().find(|(process, _)| *process == to),
            other => panic!("process {from} does not exchange: {other:?}"),
        };
        for message in messages {
            let (_, values) = sent(message.process, self.rank).expect("a message for each process");
            message.received.copy_from_slice(values);
        }
    }

    fn sum(&self, values: &mut [i64]) {
        let all = self.share(Contribution::Integers(values.to_vec()));
        values.fill(0);
        for contribution in &all {
            let Contribution::Integers(of_process) = &**contribution else {
                panic!("another process does not sum");
            };
            assert_eq!(of_process.len(), values.len(), "sums of the same number");
            values
                .iter_mut()
                .zip(of_process)
                .for_each(|(sum, v)| *sum += v);
        }
    }

    fn max(&self, values: &mut [f64]) {
        let all = self.share(Contribution::Numbers(values.to_vec()));
        for contribution in &all {
            let Contribution::Numbers(of_process) = &**contribution else {
                panic!("another process does not compare");
            };
            for (largest, value) in values.iter_mut().zip(of_process) {
                if *value > *largest || value.is_nan() {
                    *largest = *value;
                }
            }
        }
    }

    fn gather(&self, bytes: &[u8], receive: &mut dyn FnMut(usize, &[u8])) {
        let all = self.share(Contribution::Bytes(bytes.to_vec()));
        if self.rank == 0 {
            for (rank, contribution) in all.iter().enumerate() {
                let Contribution::Bytes(bytes) = &**contribution else {
                    panic!("process {rank} does not send bytes");
                };
                receive(rank, bytes);
            }
        }
    }

    fn broadcast(&self, bytes: &mut Vec<u8>) {
        let all = self.share(Contribution::Bytes(std::mem::take(bytes)));
        let Contribution::Bytes(first) = &*all[0] else {
            panic!("the first process does not send bytes");
        };
        bytes.extend_from_slice(first);
    }

    fn end_all(&self, code: i32) -> ! {
        panic!("process {} ends all with code {code}", self.rank)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs `of` in processes of this number; what each returns.
    fn run<T: Send>(size: usize, of: impl Fn(&Memory) -> T + Sync) -> Vec<T> {
        std::thread::scope(|scope| {
            let start = |process: Memory| {
                scope.spawn(|| {
                    let process = process;
                    of(&process)
                })
            };
            let threads: Vec<_> = Memory::processes(size).into_iter().map(start).collect();
            threads
                .into_iter()
                .map(|t| t.join().expect("no panic"))
                .collect()
        })
    }

    #[test]
    fn processes_exchange_sum_and_compare() {
        for size in [1, 2, 5] {
            let found = run(size, |process| {
                let rank = process.rank();
                let mut sums = [rank as i64, 1];
                let mut largest = [rank as f64, -(rank as f64)];
                let mut gathered = Vec::new();
                let mut of_first = vec![rank as u8; rank + 1];
                for _ in 0..50 {
                    sums = [rank as i64, 1];
                    process.sum(&mut sums);
                    process.max(&mut largest);
                    let others = (0..size).filter(|other| *other != rank);
                    let message = |process| Message {
                        process,
                        sent: vec![(10 * rank + process) as f64; rank + process],
                        received: vec![0.0; rank + process],
                    };
                    let mut messages: Vec<_> = others.map(message).collect();
                    process.exchange(&mut messages);
                    for Message {
                        process: other,
                        sent,
                        received,
                    } in messages
                    {
                        assert!(received.iter().all(|v| *v == (10 * other + rank) as f64));
                        assert!(sent.iter().all(|v| *v == (10 * rank + other) as f64));
                    }
                    gathered.clear();
                    process.gather(&[rank as u8; 2], &mut |from, bytes| {
                        gathered.push((from, bytes.to_vec()));
                    });
                    process.broadcast(&mut of_first);
                }
                (sums, largest, gathered, of_first)
            });
            let total = (size * (size - 1) / 2) as i64;
            for (rank, (sums, largest, gathered, of_first)) in found.into_iter().enumerate() {
                assert_eq!(sums, [total, size as i64]);
                assert_eq!(largest, [(size - 1) as f64, 0.0]);
                let expected = (0..size).map(|from| (from, vec![from as u8; 2]));
                let expected = expected.filter(|_| rank == 0).collect::<Vec<_>>();
                assert_eq!(gathered, expected);
                assert_eq!(of_first, [0]);
            }
        }
    }

    #[test]
    fn nan_is_larger_than_all_numbers() {
        let found = run(3, |process| {
            let mut largest = [if process.rank() == 1 { f64::NAN } else { 7.0 }];
            process.max(&mut largest);
            largest[0]
        });
        assert!(found.into_iter().all(f64::is_nan));
    }
}
