//! Bodies whose points are divided among processes: who owns which points, what is exchanged, and how fields of whole bodies are gathered.
//!
//! A process has the points that it owns, the first ones of a body, and those of others around them. All loops over points may include the latter:
//! sources and material laws act there, too. Sums over bonds exist at owned points only, so that the fields that a physics owns are
//! wrong at the other ones after a step: [`World::exchange`] brings the values of their owners. Sums over points go through
//! [`World::reducer`].

use std::sync::Arc;

use super::{BodyIndex, World};
use crate::body::{Horizon, Part, partition};
use crate::error::SetupError;
use crate::field::{FieldIndex, Write};
use crate::point_rows::PointRows;
use crate::solver::{Reducer, Shared};
use crate::transport::exchange::{Exchange, Neighbour, SharedExchange, lock};
use crate::transport::{Processes, Transport};

/// The points of a body that this process has.
#[derive(Debug)]
pub(crate) struct Division {
    /// Number in the whole body of each point; owned ones first, each part ascending.
    pub(crate) numbers: Arc<[u32]>,
    pub(crate) owned: usize,
    /// Number of points of the whole body.
    points: usize,
    /// The process that owns each of the points around the owned ones.
    owners: Vec<u32>,
    exchange: SharedExchange,
}

impl World {
    /// The processes that share the run.
    pub fn processes(&self) -> &Processes {
        &self.processes
    }

    /// Sums and extremes over the points of a body, and the values of those that other processes own.
    pub fn reducer(&self, body: BodyIndex) -> Reducer {
        let points = self.bodies[body].points.len();
        let owned = self.divisions[body].as_ref().map_or(points, |d| d.owned);
        let shared = self.divisions[body].as_ref().map(|division| Shared {
            processes: self.processes.clone(),
            exchange: division.exchange.clone(),
            numbers: division.numbers.clone(),
        });
        Reducer::new(points, owned, shared.unwrap_or_default())
    }

    /// Number of points of the whole body.
    pub fn points_of_whole(&self, body: BodyIndex) -> usize {
        let here = self.bodies[body].points.len();
        self.divisions[body].as_ref().map_or(here, |d| d.points)
    }

    /// The world of whole bodies as of the last logged state, in the first of several processes; this world in a run of one, and in other processes,
    /// where nobody looks at it.
    pub fn observed(&self) -> &World {
        self.whole.as_deref().unwrap_or(self)
    }

    /// Keeps whole bodies for [`World::observed`], before they are divided.
    pub(crate) fn keep_whole_bodies(&mut self) {
        if self.processes.size() > 1 && self.processes.rank() == 0 {
            self.whole = Some(Box::new(World::new(self.bodies.clone())));
        }
    }

    /// Brings [`World::observed`] the values of fields, and the layers. Collective.
    pub(crate) fn assemble(&mut self, fields: &[FieldIndex]) {
        if self.processes.size() == 1 {
            return;
        }
        let mut whole = self.whole.take();
        for &index in fields {
            let field = self.fields.field(index);
            let values = self.gather(field.body, field.data().flat());
            if let (Some(whole), Some(values)) = (&mut whole, values) {
                whole.fields.values_mut(index).copy_from_slice(&values);
            }
        }
        if let Some(whole) = &mut whole {
            whole.layers.clone_from(&self.layers);
            whole.times.clone_from(&self.times);
        }
        self.whole = whole;
    }

    /// Number of a point in the whole body.
    pub(crate) fn number_in_whole(&self, body: BodyIndex, point: usize) -> usize {
        let division = self.divisions[body].as_ref();
        division.map_or(point, |d| d.numbers[point] as usize)
    }

    /// Keeps the part of a body that this process owns, with the points around it that families of `horizon` need.
    ///
    /// # Errors
    /// When the body has too few points.
    pub(crate) fn divide(&mut self, body: BodyIndex, horizon: Horizon) -> Result<(), SetupError> {
        let processes = self.processes.size();
        if processes == 1 {
            return Ok(());
        }
        let whole = &self.bodies[body];
        if whole.lattice().is_none() {
            let name = &whole.name;
            let message =
                format!("body `{name}` has no lattice, which several processes could share");
            let expected =
                "a body with `spacing`, without `zones`, `jitter` or `points`, or one process";
            return Err(SetupError::value("", message, expected));
        }
        let Some(owner) = partition::owners(whole, processes) else {
            let name = &whole.name;
            let message = format!("body `{name}` is too small for {processes} processes");
            return Err(SetupError::value("", message, "fewer processes"));
        };
        let rank = self.processes.rank() as u32;
        let points = 0..owner.len() as u32;
        let owned: Vec<u32> = points.filter(|p| owner[*p as usize] == rank).collect();
        let (part, numbers) = Part::new(whole, &owned, horizon).into_points();
        let others = &numbers[owned.len()..];
        self.divisions[body] = Some(Division {
            owned: owned.len(),
            points: owner.len(),
            owners: others.iter().map(|p| owner[*p as usize]).collect(),
            numbers: numbers.into(),
            exchange: Arc::default(),
        });
        self.bodies[body] = part;
        Ok(())
    }

    /// Finds what is exchanged: the values of all points that families reach.
    pub(crate) fn plan_exchanges(&mut self) {
        if let Some(whole) = &mut self.whole {
            let bodies = &whole.bodies;
            whole.fields = self.fields.of_size(|body| bodies[body].points.len());
            whole.provided.clone_from(&self.provided);
            whole.facts = self.facts.clone();
        }
        for body in 0..self.bodies.len() {
            let Some(division) = &self.divisions[body] else {
                continue;
            };
            let mut is_needed = vec![false; division.numbers.len()];
            for (of, family) in self.families() {
                if of.body == body {
                    family
                        .remote()
                        .iter()
                        .for_each(|(_, p)| is_needed[*p as usize] = true);
                }
            }
            let exchange = division.find_exchange(&self.processes, &is_needed);
            *lock(&division.exchange) = exchange;
        }
    }

    /// Brings a field that the calling physics owns or keeps, at the points of other processes, the values of their owners. Collective. Needed
    /// within a step only: afterwards it is done for all fields.
    pub fn bring_remote<T>(&self, field: Write<T>) {
        self.exchange(&[field.field]);
    }

    /// Brings fields at the points of other processes the values of their owners.
    pub(crate) fn exchange(&self, fields: &[FieldIndex]) {
        let Some(transport) = self.processes.transport() else {
            return;
        };
        for (body, division) in self.divisions.iter().enumerate() {
            let Some(division) = division else { continue };
            let of_body = || {
                let fields = fields.iter().map(|f| self.fields.field(*f));
                fields.filter(|field| field.body == body)
            };
            if of_body().next().is_none() {
                continue;
            }
            let mut exchange = lock(&division.exchange);
            exchange.send(transport, |to, message| {
                for field in of_body() {
                    let data = field.data();
                    to.pack(data.flat(), data.components(), message);
                }
            });
            exchange.receive(|from, rest| {
                for field in of_body() {
                    let mut data = field.data_mut();
                    let components = data.components();
                    from.unpack(rest, components, data.flat_mut());
                }
            });
        }
    }

    /// Rows of owned points of a body as those of the whole body, in all processes. Collective.
    pub fn rows_of_whole(&self, body: BodyIndex, rows: PointRows) -> PointRows {
        let (Some(division), Some(transport)) = (&self.divisions[body], self.processes.transport())
        else {
            return rows;
        };
        let own = rows.renumbered(|point| division.numbers.get(point as usize).copied());
        let all = PointRows {
            points: gather_to_all(transport, &own.points),
            values: gather_to_all(transport, &own.values),
        };
        all.renumbered(Some)
    }

    /// Those of the rows of points of the whole body whose points this process has.
    pub fn rows_of_part(&self, body: BodyIndex, rows: PointRows) -> PointRows {
        let Some(division) = &self.divisions[body] else {
            return rows;
        };
        let (owned, others) = division.numbers.split_at(division.owned);
        rows.renumbered(|point| {
            let place = owned.binary_search(&point).ok();
            let of_other = || Some(others.binary_search(&point).ok()? + owned.len());
            place.or_else(of_other).map(|place| place as u32)
        })
    }

    /// The entries of a field by point of the whole body, in the first process; `None` in others. Collective.
    pub fn gather(&self, body: BodyIndex, values: &[f64]) -> Option<Vec<f64>> {
        let (Some(division), Some(transport)) = (&self.divisions[body], self.processes.transport())
        else {
            return Some(values.to_vec());
        };
        let components = values.len() / division.numbers.len().max(1);
        let own = &values[..division.owned * components];
        let numbers: &[u8] = bytemuck::must_cast_slice(&division.numbers[..division.owned]);
        let mut of_process = Vec::new();
        transport.gather(numbers, &mut |_, bytes| {
            of_process.push(to_values::<u32>(bytes));
        });
        let mut whole = vec![0.0; division.points * components];
        transport.gather(bytemuck::must_cast_slice(own), &mut |rank, bytes| {
            let values: Vec<f64> = to_values(bytes);
            for (number, value) in of_process[rank].iter().zip(values.chunks(components)) {
                let first = *number as usize * components;
                whole[first..first + components].copy_from_slice(value);
            }
        });
        (transport.rank() == 0).then_some(whole)
    }
}

/// The numbers of all processes, one after the other, in each of them.
fn gather_to_all<T: bytemuck::Pod>(transport: &dyn Transport, own: &[T]) -> Vec<T> {
    let mut all = Vec::new();
    transport.gather(bytemuck::must_cast_slice(own), &mut |_, bytes| {
        all.extend_from_slice(bytes);
    });
    transport.broadcast(&mut all);
    to_values(&all)
}

/// Numbers that were sent as bytes.
fn to_values<T: bytemuck::Pod>(bytes: &[u8]) -> Vec<T> {
    let mut values = vec![T::zeroed(); bytes.len() / size_of::<T>()];
    bytemuck::must_cast_slice_mut(&mut values).copy_from_slice(bytes);
    values
}

impl Division {
    /// Tells all processes which points this one needs of them, and learns what they need.
    fn find_exchange(&self, processes: &Processes, is_needed: &[bool]) -> Exchange {
        let Some(transport) = processes.transport() else {
            return Exchange::default();
        };
        let rank = transport.rank() as u32;
        let others = self.owned..self.numbers.len();
        let needed = others.filter(|p| is_needed[*p]);
        let received = |process: u32| {
            let points = needed
                .clone()
                .filter(|p| self.owners[p - self.owned] == process);
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
