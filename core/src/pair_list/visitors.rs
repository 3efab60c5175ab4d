//! Points of other processes that may be in reach of those of this one.
//!
//! Each process tells the others the boxes around its points of each body. Points of a body in the box of another process visit it, once the box is
//! as much larger as points reach.

use std::ops::Range;

use nalgebra::Vector3;

use crate::transport::exchange::{Exchange, Neighbour, gather_to_all};
use crate::transport::{Message, Transport};
use crate::world::World;

/// What a visitor brings when it is found: position (m), reach (m) and number.
pub(super) const BROUGHT: usize = 5;

/// Points of other processes, behind the own ones, and the exchange of their values.
#[derive(Debug, Default)]
pub(super) struct Visitors(Exchange);

/// The box around points, m.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Bounds {
    fn of(points: &[Vector3<f64>]) -> Bounds {
        let none = Bounds {
            low: Vector3::repeat(f64::INFINITY),
            high: Vector3::repeat(f64::NEG_INFINITY),
        };
        points.iter().fold(none, |bounds, x| Bounds {
            low: bounds.low.inf(x),
            high: bounds.high.sup(x),
        })
    }

    fn numbers(&self) -> [f64; 6] {
        let ([a, b, c], [d, e, f]) = (self.low.into(), self.high.into());
        [a, b, c, d, e, f]
    }

    fn read([a, b, c, d, e, f]: [f64; 6]) -> Bounds {
        Bounds {
            low: Vector3::new(a, b, c),
            high: Vector3::new(d, e, f),
        }
    }

    fn is_near(&self, point: &Vector3<f64>, reach: f64) -> bool {
        (0..3).all(|axis| {
            point[axis] >= self.low[axis] - reach && point[axis] <= self.high[axis] + reach
        })
    }
}

impl Visitors {
    /// Finds who visits whom, for own points at `position` (m), those of one body or of each of two, which reach as far as `reach` (m). Returns the
    /// visitors of this process with their bodies, 0 or 1, and what they bring. Collective.
    pub(super) fn find(
        transport: &dyn Transport,
        of_bodies: impl Iterator<Item = Range<usize>>,
        position: &[Vector3<f64>],
        reach: f64,
        brings: impl Fn(usize) -> [f64; BROUGHT],
    ) -> (Visitors, Vec<(usize, [f64; BROUGHT])>) {
        let of_bodies: Vec<Range<usize>> = of_bodies.collect();
        let bodies = of_bodies.len();
        let own: Vec<[f64; 6]> = of_bodies
            .iter()
            .map(|points| Bounds::of(&position[points.clone()]).numbers())
            .collect();
        let bounds: Vec<[f64; 6]> = gather_to_all(transport, &own);
        let others = (0..transport.size()).filter(|process| *process != transport.rank());
        // by process and body: the own points that visit it, because they meet those of the other body
        let visiting = |process: usize, body: usize| {
            let met = Bounds::read(bounds[process * bodies + bodies - 1 - body]);
            let points = of_bodies[body].clone();
            let near = points.filter(move |point| met.is_near(&position[*point], reach));
            near.map(|point| point as u32).collect::<Vec<u32>>()
        };
        let sent: Vec<(usize, Vec<Vec<u32>>)> = others
            .map(|process| {
                (
                    process,
                    (0..bodies).map(|body| visiting(process, body)).collect(),
                )
            })
            .collect();
        let counts = exchange(
            transport,
            sent.iter().map(|(process, points)| Message {
                process: *process,
                sent: points.iter().map(|points| points.len() as f64).collect(),
                received: vec![0.0; bodies],
            }),
        );
        let messages = sent
            .iter()
            .zip(&counts)
            .map(|((process, points), counts)| Message {
                process: *process,
                sent: points
                    .iter()
                    .flatten()
                    .flat_map(|point| brings(*point as usize))
                    .collect(),
                received: vec![0.0; counts.received.iter().sum::<f64>() as usize * BROUGHT],
            });
        let is_empty = |message: &Message| message.sent.is_empty() && message.received.is_empty();
        let messages = exchange(transport, messages.filter(|message| !is_empty(message)));
        let (mut found, mut neighbours) = (Vec::new(), Vec::new());
        for ((process, points), counts) in sent.into_iter().zip(counts) {
            let message = messages.iter().find(|message| message.process == process);
            let Some(message) = message else { continue };
            let first = position.len() + found.len();
            let of_body = counts.received.iter().enumerate();
            let body = of_body.flat_map(|(body, count)| std::iter::repeat_n(body, *count as usize));
            let (brought, _) = message.received.as_chunks::<BROUGHT>();
            found.extend(body.zip(brought.iter().copied()));
            let behind = position.len() + found.len();
            neighbours.push(Neighbour {
                process,
                sent: points.into_iter().flatten().collect(),
                received: (first as u32..behind as u32).collect(),
            });
        }
        (Visitors(Exchange::new(neighbours, Vec::new())), found)
    }

    /// Gives the visitors the values of their owners.
    pub(super) fn bring(&mut self, world: &World, values: &mut [f64], components: usize) {
        if let Some(transport) = world.processes().transport() {
            self.0.bring(transport, values, components);
        }
    }
}

fn exchange(transport: &dyn Transport, messages: impl Iterator<Item = Message>) -> Vec<Message> {
    let mut messages: Vec<Message> = messages.collect();
    transport.exchange(&mut messages);
    messages
}
