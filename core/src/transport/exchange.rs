//! What processes that share a body exchange at its points.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Message, Processes, Transport};

/// Points whose values go to other processes and come from them, with the messages.
#[derive(Debug, Default)]
pub(crate) struct Exchange {
    neighbours: Vec<Neighbour>,
    messages: Vec<Message>,
    /// Points of other processes that no bond of this one reaches.
    beyond: Vec<u32>,
}

/// An exchange that is planned once and used wherever values are brought.
pub(crate) type SharedExchange = Arc<Mutex<Exchange>>;

/// Takes the lock: an exchange that failed has ended the run.
pub(crate) fn lock(exchange: &Mutex<Exchange>) -> MutexGuard<'_, Exchange> {
    exchange.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Points whose values go to another process and come from it, in the same order on both sides.
#[derive(Debug)]
pub(crate) struct Neighbour {
    pub(crate) process: usize,
    pub(crate) sent: Vec<u32>,
    pub(crate) received: Vec<u32>,
}

/// Who owns points of which a process has some.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Owners<'a> {
    /// Number of each point, the same in all processes; owned ones first, each part ascending.
    pub(crate) numbers: &'a [u32],
    /// How many of them this process owns.
    pub(crate) owned: usize,
    /// The process that owns each of the others.
    pub(crate) of_others: &'a [u32],
}

impl Owners<'_> {
    /// Tells all processes which points this one needs of them, and learns what they need. Collective.
    pub(crate) fn plan(self, processes: &Processes, is_needed: &[bool]) -> Exchange {
        let Some(transport) = processes.transport() else {
            return Exchange::default();
        };
        let rank = transport.rank() as u32;
        let others = self.owned..self.numbers.len();
        let needed = others.filter(|p| is_needed[*p]);
        let received = |process: u32| {
            let points = needed
                .clone()
                .filter(|p| self.of_others[p - self.owned] == process);
            points.map(|p| p as u32).collect::<Vec<u32>>()
        };
        let received: Vec<Vec<u32>> = (0..transport.size() as u32).map(received).collect();
        // asking process, asked process, number of points, points
        let mut asked = Vec::new();
        for (process, points) in (0..)
            .zip(&received)
            .filter(|(_, points)| !points.is_empty())
        {
            asked.extend([rank, process, points.len() as u32]);
            asked.extend(points.iter().map(|p| self.numbers[*p as usize]));
        }
        let all: Vec<u32> = gather_to_all(transport, &asked);
        let mut sent = vec![Vec::new(); transport.size()];
        let mut rest = &all[..];
        while let [by, of, count, points @ ..] = rest {
            let (points, behind) = points.split_at(*count as usize);
            if *of == rank {
                let own = &self.numbers[..self.owned];
                let place =
                    |number: &u32| own.binary_search(number).expect("an owned point") as u32;
                sent[*by as usize] = points.iter().map(place).collect();
            }
            rest = behind;
        }
        let neighbours = sent.into_iter().zip(received).enumerate();
        let neighbours =
            neighbours.filter(|(_, (sent, received))| !(sent.is_empty() && received.is_empty()));
        let neighbours = neighbours.map(|(process, (sent, received))| Neighbour {
            process,
            sent,
            received,
        });
        let others = self.owned..self.numbers.len();
        let beyond = others.filter(|p| !is_needed[*p]).map(|p| p as u32);
        Exchange::new(neighbours.collect(), beyond.collect())
    }
}

/// The numbers of all processes, one after the other, in each of them.
pub(crate) fn gather_to_all<T: bytemuck::Pod>(transport: &dyn Transport, own: &[T]) -> Vec<T> {
    let mut all = Vec::new();
    transport.gather(bytemuck::must_cast_slice(own), &mut |_, bytes| {
        all.extend_from_slice(bytes);
    });
    transport.broadcast(&mut all);
    to_values(&all)
}

/// Numbers that were sent as bytes.
pub(crate) fn to_values<T: bytemuck::Pod>(bytes: &[u8]) -> Vec<T> {
    let mut values = vec![T::zeroed(); bytes.len() / size_of::<T>()];
    bytemuck::must_cast_slice_mut(&mut values).copy_from_slice(bytes);
    values
}

impl Exchange {
    pub(crate) fn new(neighbours: Vec<Neighbour>, beyond: Vec<u32>) -> Self {
        let message = |neighbour: &Neighbour| Message {
            process: neighbour.process,
            ..Message::default()
        };
        Exchange {
            messages: neighbours.iter().map(message).collect(),
            neighbours,
            beyond,
        }
    }

    /// Replaces values by point, of a number of components, by those of the owners of the points, and by zero at points that no bond reaches.
    pub(crate) fn bring(
        &mut self,
        transport: &dyn Transport,
        values: &mut [f64],
        components: usize,
    ) {
        self.send(transport, |to, message| {
            to.pack(values, components, message);
        });
        self.receive(|from, rest| from.unpack(rest, components, values));
        for &point in &self.beyond {
            values[point as usize * components..][..components].fill(0.0);
        }
    }

    /// Sends each neighbour what `pack` adds to its message.
    pub(crate) fn send(
        &mut self,
        transport: &dyn Transport,
        pack: impl Fn(&Neighbour, &mut Message),
    ) {
        for (neighbour, message) in self.neighbours.iter().zip(&mut self.messages) {
            message.sent.clear();
            message.received.clear();
            pack(neighbour, message);
        }
        transport.exchange(&mut self.messages);
    }

    /// Passes what came from each neighbour to `unpack`, in the order in which it was packed.
    pub(crate) fn receive(&self, mut unpack: impl FnMut(&Neighbour, &mut &[f64])) {
        for (neighbour, message) in self.neighbours.iter().zip(&self.messages) {
            unpack(neighbour, &mut &message.received[..]);
        }
    }
}

impl Neighbour {
    /// Adds values by point to a message, and makes room for those of the neighbour.
    pub(crate) fn pack(&self, values: &[f64], components: usize, message: &mut Message) {
        for &point in &self.sent {
            let first = point as usize * components;
            let of_point = &values[first..first + components];
            message.sent.extend_from_slice(of_point);
        }
        let length = message.received.len() + self.received.len() * components;
        message.received.resize(length, 0.0);
    }

    /// Takes values by point from the rest of a message.
    pub(crate) fn unpack(&self, rest: &mut &[f64], components: usize, values: &mut [f64]) {
        for &point in &self.received {
            let (here, behind) = rest.split_at(components);
            values[point as usize * components..][..components].copy_from_slice(here);
            *rest = behind;
        }
    }
}
