//! What processes that share a body exchange at its points.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Message, Transport};

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
