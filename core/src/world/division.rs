//! Bodies whose points are divided among processes: who owns which points, what is exchanged, and how fields of whole bodies are gathered.
//!
//! A process has the points that it owns, the first ones of a body, and those of others around them. All loops over points may include the latter:
//! sources and material laws act there, too. Sums over bonds exist at owned points only, so that the fields that a physics owns are
//! wrong at the other ones after a step: [`World::exchange`] brings the values of their owners. Sums over points go through
//! [`World::reducer`].

use std::borrow::Cow;
use std::sync::Arc;

use serde::Serialize;
use serde::de::{DeserializeOwned, Error};

use super::{BodyIndex, World};
use crate::body::{Discretisation, Horizon, Part, SurfacePoints, partition};
use crate::error::SetupError;
use crate::field::{FieldIndex, Write};
use crate::point_rows::PointRows;
use crate::solver::{Reducer, Shared};
use crate::transport::Processes;
use crate::transport::exchange::{Owners, SharedExchange, gather_to_all, lock, to_values};

/// The points of a body that this process has.
#[derive(Debug)]
pub(crate) struct Division {
    /// Number in the whole body of each point; owned ones first, each part ascending.
    pub(crate) numbers: Arc<[u32]>,
    pub(crate) owned: usize,
    /// Number of points of the whole body.
    points: usize,
    /// The process that owns each of the points around the owned ones.
    owners: Arc<[u32]>,
    exchange: SharedExchange,
    /// Points of other processes that plugins read besides those in reach of families.
    read: Vec<u32>,
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
            owners: division.owners.clone(),
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
        if let Discretisation::Layers(_) = whole.discretisation {
            let name = &whole.name;
            let message = format!("several processes do not share the layers of body `{name}`");
            let expected = "a body without `layup`, or one process";
            return Err(SetupError::value("", message, expected));
        }
        let Some(owner) = partition::owners(whole, processes) else {
            let name = &whole.name;
            let message = format!("body `{name}` is too small for {processes} processes");
            return Err(SetupError::value("", message, "fewer processes"));
        };
        let owned_by = |process: u32| -> Vec<u32> {
            let points = 0..owner.len() as u32;
            points.filter(|p| owner[*p as usize] == process).collect()
        };
        // all processes find the same
        let cut = (0..processes as u32)
            .find_map(|process| Part::cut_axis(whole, &owned_by(process), horizon));
        if let Some(axis) = cut {
            let (name, axis) = (&whole.name, ["x", "y", "z"][axis]);
            let message = format!(
                "body `{name}` is periodic along {axis}, and {processes} processes cannot divide it across that axis"
            );
            return Err(SetupError::value("", message, "fewer processes"));
        }
        if self.bodies.len() > 1 {
            self.surfaces[body] = Some(Arc::new(SurfacePoints::of(whole, false)));
        }
        let owned = owned_by(self.processes.rank() as u32);
        let (part, numbers) = Part::new(whole, &owned, horizon).into_points();
        let others = &numbers[owned.len()..];
        self.divisions[body] = Some(Division {
            owned: owned.len(),
            points: owner.len(),
            owners: others.iter().map(|p| owner[*p as usize]).collect(),
            numbers: numbers.into(),
            exchange: Arc::default(),
            read: Vec::new(),
        });
        self.bodies[body] = part;
        Ok(())
    }

    /// The points at the surface of a whole body; all points of one that grows.
    pub fn surface_points(&self, body: BodyIndex) -> Arc<SurfacePoints> {
        let of_body = || SurfacePoints::of(&self.bodies[body], self.is_growing(body));
        let known = self.surfaces[body].clone();
        known.unwrap_or_else(|| Arc::new(of_body()))
    }

    /// Lets the values of these points be exchanged where other processes own them.
    pub(crate) fn read_points(&mut self, body: BodyIndex, points: impl Iterator<Item = u32>) {
        if let Some(division) = &mut self.divisions[body] {
            let owned = division.owned as u32;
            division.read.extend(points.filter(|p| *p >= owned));
        }
    }

    /// Finds what is exchanged: the values of all points that families reach or plugins read.
    pub(crate) fn plan_exchanges(&mut self) {
        if let Some(whole) = &mut self.whole {
            let bodies = &whole.bodies;
            whole.fields = self.fields.of_size(|body| bodies[body].points.len());
            whole.provided.clone_from(&self.provided);
            whole.changes.clone_from(&self.changes);
            whole.facts = self.facts.clone();
        }
        for body in 0..self.bodies.len() {
            let Some(division) = &self.divisions[body] else {
                continue;
            };
            let mut is_needed = vec![false; division.numbers.len()];
            division
                .read
                .iter()
                .for_each(|p| is_needed[*p as usize] = true);
            for (of, family) in self.families() {
                if of.body == body {
                    family
                        .remote()
                        .iter()
                        .for_each(|(_, p)| is_needed[*p as usize] = true);
                }
            }
            let owners = Owners {
                numbers: &division.numbers,
                owned: division.owned,
                of_others: &division.owners,
            };
            let exchange = owners.plan(&self.processes, &is_needed);
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

    /// Values by point of the whole body, in all processes, from those of owned points, for checkpoints; nothing where no process has any.
    /// Collective.
    pub fn whole_of<'a, T>(&self, body: BodyIndex, values: &'a [T]) -> Cow<'a, [T]>
    where
        T: Clone + Serialize + DeserializeOwned,
    {
        self.reducer(body).whole_of(values)
    }

    /// Reads what a plugin has saved by [`World::whole_of`].
    ///
    /// # Errors
    /// When the state cannot be read, or is that of another number of points.
    pub fn load_points<T: Clone + DeserializeOwned>(
        &self,
        body: BodyIndex,
        state: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<Vec<T>, erased_serde::Error> {
        self.part_of(body, erased_serde::deserialize(state)?)
    }

    /// Values of the points that this process has, from those that [`World::whole_of`] gave. Collective.
    pub(crate) fn part_of<T: Clone>(
        &self,
        body: BodyIndex,
        whole: Vec<T>,
    ) -> Result<Vec<T>, erased_serde::Error> {
        let (found, points) = (whole.len(), self.points_of_whole(body));
        if found == points {
            return Ok(self.reducer(body).part_of(whole));
        }
        let message = format!("values of {found} points for a body of {points} points");
        Err(erased_serde::Error::custom(message))
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
