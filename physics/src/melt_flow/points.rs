//! What the cells of a pool have from the fields of the points, and give them.
//!
//! A cell belongs to a point of the whole body, which any process may own: the state of the cells is gathered from the owners.

use std::mem;

use nalgebra::Vector3;
use perimelt_core::body::NO_POINT;
use perimelt_core::world::activity::is_active;
use perimelt_core::{PointRows, World};

use super::RunningMeltFlow;
use super::flow::Flow;

/// State of a point that is liquid, or was in the last step.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeltPoint {
    pub(super) is_liquid: bool,
    /// J/m³.
    enthalpy: f64,
    /// m/s.
    velocity: [f64; 3],
    /// Pa.
    pressure: f64,
    /// N/m³.
    force: [f64; 3],
}

impl MeltPoint {
    /// Numbers in a row of a point.
    const ROW: usize = 9;

    fn row(&self) -> [u64; MeltPoint::ROW] {
        let [[x, y, z], [fx, fy, fz]] = [self.velocity, self.force];
        let numbers = [self.enthalpy, x, y, z, self.pressure, fx, fy, fz];
        let mut row = [u64::from(self.is_liquid); MeltPoint::ROW];
        row[1..].copy_from_slice(&numbers.map(f64::to_bits));
        row
    }

    /// The points of rows, by their numbers.
    pub(super) fn all(rows: &PointRows) -> impl Iterator<Item = (usize, MeltPoint)> {
        rows.iter(MeltPoint::ROW).map(|(point, row)| {
            let number = |at: usize| f64::from_bits(row[at]);
            let vector = |at: usize| [number(at), number(at + 1), number(at + 2)];
            let state = MeltPoint {
                is_liquid: row[0] != 0,
                enthalpy: number(1),
                velocity: vector(2),
                pressure: number(5),
                force: vector(6),
            };
            (point, state)
        })
    }
}

impl RunningMeltFlow {
    /// Gathers the points of all processes that are liquid now or were in the last step. Collective.
    pub(super) fn gather(&mut self, world: &World) {
        let body = world.body(self.body);
        let reducer = world.reducer(self.body);
        let enthalpy = world.read(self.fields.enthalpy);
        let velocity = world.read::<Vector3<f64>>(self.fields.velocity.into());
        let pressure = world.read::<f64>(self.fields.pressure.into());
        let force = self.fields.force.map(|force| world.read(force));
        let activity = world.activity(self.body);
        let mut rows = mem::take(&mut self.rows);
        rows.clear();
        for point in 0..reducer.owned() {
            let is_liquid = enthalpy[point] > self.least_enthalpy
                && body.material_of_point[point] == self.melt.material
                && activity.as_ref().is_none_or(|a| is_active(a[point]));
            if is_liquid || self.pool.cell(reducer.number(point) as usize).is_some() {
                let force = force.as_ref().map_or([0.0; 3], |force| force[point].into());
                let state = MeltPoint {
                    is_liquid,
                    enthalpy: enthalpy[point],
                    velocity: velocity[point].into(),
                    pressure: pressure[point],
                    force,
                };
                rows.push(point, &state.row());
            }
        }
        self.rows = world.rows_of_whole(self.body, rows);
    }

    /// Brings points that froze to rest.
    pub(super) fn freeze(&mut self, world: &World) {
        let mass = self.melt.density * world.body(self.body).points.volume[0];
        for (_, state) in MeltPoint::all(&self.rows).filter(|(_, state)| !state.is_liquid) {
            for (sum, v) in self.saved.to_solid.iter_mut().zip(state.velocity) {
                *sum += mass * v;
            }
        }
        let mut velocity = world.write(self.fields.velocity);
        let mut pressure = world.write(self.fields.pressure);
        for (point, local) in self.pool.before().iter().zip(&self.local) {
            if self.pool.cell(*point as usize).is_none() && *local != NO_POINT {
                let point = *local as usize;
                (velocity[point], pressure[point]) = (Vector3::zeros(), 0.0);
            }
        }
    }

    /// Reads the state of the cells.
    pub(super) fn load_cells(&mut self) {
        let Flow {
            momentum,
            pressure,
            heat,
            ..
        } = &mut self.flow;
        momentum.given.clear();
        let liquid = MeltPoint::all(&self.rows).filter(|(_, state)| state.is_liquid);
        for (cell, (_, state)) in liquid.enumerate() {
            momentum.velocity[cell] = state.velocity;
            pressure.values[cell] = state.pressure;
            heat.start[cell] = state.enthalpy;
            if self.fields.force.is_some() {
                momentum.given.push(state.force);
            }
        }
        heat.start(&self.melt);
    }

    /// Gives points that melted the mean pressure of the neighbours that were liquid before.
    pub(super) fn continue_pressure(&mut self) {
        let pressure = &mut self.flow.pressure.values;
        let before = self.pool.before();
        let was_liquid = |cell: usize| before.binary_search(&self.pool.points[cell]).is_ok();
        for cell in (0..self.pool.len()).filter(|cell| !was_liquid(*cell)) {
            let neighbours = self.pool.neighbours(cell).iter().filter(|n| n.is_open);
            let neighbours = neighbours.map(|n| n.cell as usize);
            let (mut sum, mut count) = (0.0, 0.0);
            for other in neighbours.filter(|other| was_liquid(*other)) {
                sum += pressure[other];
                count += 1.0;
            }
            pressure[cell] = if count > 0.0 { sum / count } else { 0.0 };
        }
    }

    /// Writes the state of the cells to the fields, and gives away the heat that was carried.
    pub(super) fn store_cells(&self, world: &World) {
        let mut velocity = world.write(self.fields.velocity);
        let mut pressure = world.write(self.fields.pressure);
        let mut carried = world.write(self.fields.carried);
        let here = self.local.iter().enumerate();
        for (cell, point) in here.filter(|(_, point)| **point != NO_POINT) {
            let point = *point as usize;
            velocity[point] = self.flow.momentum.velocity[cell].into();
            pressure[point] = self.flow.pressure.values[cell];
            carried[point] = self.flow.heat.carried[cell];
        }
    }
}
