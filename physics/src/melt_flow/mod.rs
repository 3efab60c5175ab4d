//! Flow of the melt through the points of a solid body: weld pools, melting blocks.
//!
//! The points stay where they are. Those with enough liquid form a list of cells, on which the incompressible flow is computed
//! (docs/theory/melt_flow.md):
//!
//! ```text
//! rho (dv/dt + v.grad v) = -grad p + div(mu grad v) - rho beta (T - T_ref) g + F - D(f) v,     div v = 0
//! ```
//!
//! with the force F of couplers (`melt_force`), and sums over the 8 (plane) or 26 (space) neighbours of a cell. Solid cells are
//! walls. The melt moves the enthalpy of the liquid; the heat that a cell got during a step is the amount `carried_heat`, which
//! `thermal` takes up. Both alternate in each step of `thermal`, within which the flow takes sub-steps of its own. Where nothing
//! is liquid nothing is computed.
//!
//! Of processes that share the body each computes the whole flow, from the state of the liquid cells of all: these are few.
//!
//! Of one density and with the viscosity of each cell, by its mean over bonds. Not for: surfaces that deform, shrinkage by freezing,
//! grains that move.

mod flow;
mod heat;
mod keys;
mod melt;
mod momentum;
mod points;
mod pool;
mod pressure;
mod stencil;
mod surface;
#[cfg(test)]
mod tests;

pub use keys::{Buoyancy, FreeSurface, MeltFlow};

use std::mem;

use nalgebra::Vector3;
use perimelt_core::body::NO_POINT;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::refinement::Level;
use perimelt_core::{
    Access, ExpectedGift, Face, LoadError, Physics, PhysicsReport, PointRows, Prepared, Read,
    Report, RunError, RunningPhysics, SavedState, Setup, SetupError, Step, StepLimits, Work, World,
    Write, keys as core_keys,
};
use serde::{Deserialize, Serialize};

use crate::dependent_keys::need;
use crate::momentum::AXES;
use flow::{Cost, Flow, Scheme};
use melt::Melt;
use points::MeltPoint;
use pool::Pool;
use surface::Surface;

/// Fields of the flow.
#[derive(Clone, Copy, Debug)]
struct Fields {
    enthalpy: Read<f64>,
    force: Option<Read<Vector3<f64>>>,
    velocity: Write<Vector3<f64>>,
    pressure: Write<f64>,
    carried: Write<f64>,
}

/// Melt flow that is ready to run.
#[derive(Debug)]
struct RunningMeltFlow {
    body: BodyIndex,
    fields: Fields,
    melt: Melt,
    /// Enthalpy above which a point flows, J/m³.
    least_enthalpy: f64,
    largest_lag: f64,
    pool: Pool,
    /// By cell, the point of this process; [`NO_POINT`] where it has none.
    local: Vec<u32>,
    surface: Surface,
    flow: Flow,
    saved: Saved,
    /// Points that are liquid or were in the last step, as of the start of a step.
    rows: PointRows,
    /// Points across the layer under the surface, as last observed.
    layer: Option<f64>,
    /// Cost of the last step.
    cost: Cost,
}

/// State besides the fields.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Saved {
    /// Points of the cells, by their numbers in the whole body.
    points: Vec<u32>,
    /// Largest speed, m/s.
    speed: f64,
    /// Momentum of cells when they froze, N s.
    to_solid: [f64; 3],
    /// Thickness of the layer under the surface in points, least of the observed ones.
    thinnest: Option<f64>,
    /// Where the body is as a window of finer points.
    window: Option<[i64; 3]>,
    /// Longest step in times in which the fastest melt flows over the spacing.
    #[serde(default)]
    longest_lag: f64,
}

#[typetag::serialize(name = "melt_flow")]
impl Physics for MeltFlow {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.publish(body, ExpectedGift::of(&core_keys::CARRIED_HEAT))
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        let body = setup.find_body(self.body.as_deref())?;
        self.check(setup.body(body))?;
        let is_plate = matches!(setup.world().refinement(body), Some((_, Level::Plate)));
        need(
            !is_plate,
            "body",
            "a window of finer points moves over the body, and the melt is in it",
            "the body of the window",
        )?;
        let melt = Melt::prepare(&self, setup, body)?;
        let least_enthalpy = melt.curve.enthalpy_at_liquid_fraction(self.least_liquid());
        let fields = Fields {
            enthalpy: setup.read(body, &core_keys::ENTHALPY)?,
            force: setup.consume_if_added(body, &core_keys::MELT_FORCE)?,
            velocity: setup.own(body, &core_keys::MELT_VELOCITY)?,
            pressure: setup.own(body, &core_keys::MELT_PRESSURE)?,
            carried: setup.give(body, &core_keys::CARRIED_HEAT, Access::Give)?,
        };
        let faces = self.surface.map_or(Vec::new(), |surface| surface.faces);
        let mut slips = [false; 6];
        let symmetry = setup.world().symmetry(body);
        if let Some(face) = faces.iter().find(|face| symmetry.contains(face)) {
            let message = format!(
                "face `{}` is a plane of symmetry, where the melt has no surface",
                face.name()
            );
            return Err(SetupError::value("surface.faces", message, "other faces"));
        }
        for face in faces.iter().chain(&symmetry) {
            slips[*face as usize] = true;
        }
        let this = setup.body(body);
        let Some(lattice) = this.lattice() else {
            let message = format!("body `{}` has no lattice, on which melt flows", this.name);
            let expected = "a body with `spacing`, without `zones`, `jitter` or `points`";
            return Err(SetupError::value("body", message, expected));
        };
        Ok(Box::new(RunningMeltFlow {
            body,
            fields,
            least_enthalpy: least_enthalpy.unwrap_or(f64::INFINITY),
            largest_lag: self.largest_lag,
            pool: Pool::new(this, lattice, slips),
            local: Vec::new(),
            surface: Surface::new(this, faces),
            melt,
            flow: Flow::new(Scheme {
                convection: self.convection,
                tolerance: self.tolerance,
            }),
            saved: Saved::default(),
            rows: PointRows::default(),
            layer: None,
            cost: Cost::default(),
        }))
    }
}

impl RunningMeltFlow {
    /// Moves the cells to other points where the body is a window that moved.
    fn follow_window(&mut self, world: &World) {
        let Some((refinement, Level::Window)) = world.refinement(self.body) else {
            return;
        };
        let low = refinement.position().low;
        let before = self.saved.window.replace(low).unwrap_or(low);
        if before == low {
            return;
        }
        let (ratio, [nx, ny, nz]) = (refinement.ratio(), refinement.window_points());
        let moved = |point: u32| {
            let point = point as usize;
            let at = [point % nx, point / nx % ny, point / (nx * ny)];
            let to = [0, 1, 2].map(|a| at[a] as i64 - (low[a] - before[a]) * ratio[a] as i64);
            let is_inside = |(to, n): (i64, usize)| (0..n as i64).contains(&to);
            let is_kept = to.into_iter().zip([nx, ny, nz]).all(is_inside);
            let [x, y, z] = to.map(|to| to as usize);
            is_kept.then(|| (z * ny + y) * nx + x)
        };
        let mut velocity = world.write(self.fields.velocity);
        let mut pressure = world.write(self.fields.pressure);
        let mut kept = Vec::new();
        for &point in &self.pool.points {
            let at = point as usize;
            let values = (mem::take(&mut velocity[at]), mem::take(&mut pressure[at]));
            kept.extend(moved(point).map(|to| (to, values)));
        }
        for &(to, values) in &kept {
            (velocity[to], pressure[to]) = values;
        }
        let points = kept.into_iter().map(|(to, _)| to as u32).collect();
        self.pool.restore(world.body(self.body), points);
        self.follow_list(world);
    }

    /// Updates the list of cells, and reads their state.
    fn follow(&mut self, world: &World) {
        self.follow_window(world);
        self.gather(world);
        let points = MeltPoint::all(&self.rows);
        let liquid = points.filter(|(_, state)| state.is_liquid);
        let has_changed = (self.pool).update(world.body(self.body), liquid.map(|(point, _)| point));
        if has_changed {
            self.freeze(world);
            self.follow_list(world);
        }
        self.load_cells();
        if has_changed {
            self.continue_pressure();
        }
    }

    /// Adapts what depends on the list of cells.
    fn follow_list(&mut self, world: &World) {
        let body = world.body(self.body);
        self.surface.follow(body, &self.pool);
        let has_force = self.fields.force.is_some() || self.melt.has_lift();
        self.flow.resize(&self.melt, &self.pool, has_force);
        let reducer = world.reducer(self.body);
        if reducer.processes().size() == 1 {
            self.local.clone_from(&self.pool.points);
            return;
        }
        self.local.clear();
        self.local.resize(self.pool.len(), NO_POINT);
        for point in 0..body.points.len() {
            if let Some(cell) = self.pool.cell(reducer.number(point) as usize) {
                self.local[cell] = point as u32;
            }
        }
    }

    /// Points across the layer under a surface that stress drives, `sqrt(nu L/v)` for a pool of the length L, of which a body may
    /// have only a half; the least of all pools.
    fn layer_points(&self, world: &World) -> Option<f64> {
        if !(self.melt.has_tension() && self.surface.is_reached() && self.saved.speed > 0.0) {
            return None;
        }
        let body = world.body(self.body);
        let lattice = body.lattice()?;
        let spacing = self.pool.stencil.spacing;
        let viscosity = self.flow.momentum.largest_viscosity();
        let symmetry = world.symmetry(self.body);
        let points = self.surface.pools(&self.pool).into_iter().map(|pool| {
            let cells = || pool.iter().copied();
            let along = |axis: usize| {
                let at = cells().map(|c| lattice.centre(self.pool.place(lattice, c))[axis]);
                let (low, high) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                    (low.min(x), high.max(x))
                });
                let faces = symmetry.iter().filter(|f| f.axis() == axis);
                let is_half = |f: &Face| cells().any(|c| self.pool.is_at(body, c, *f));
                let halves = faces.copied().filter(is_half).count() as i32;
                2.0_f64.powi(halves) * (high - low + spacing)
            };
            let length = (0..body.dimension).map(along).fold(0.0, f64::max);
            let velocity = &self.flow.momentum.velocity;
            let speeds = cells().map(|c| Vector3::from(velocity[c]).norm());
            let speed = speeds.fold(0.0, f64::max);
            (viscosity * length / speed).sqrt() / spacing
        });
        let least = points.fold(f64::INFINITY, f64::min);
        least.is_finite().then_some(least)
    }
}

impl RunningPhysics for RunningMeltFlow {
    /// The time in which the fastest melt flows over a few points: heat is exchanged with conduction that often.
    fn step_limits(&self, _time: f64) -> StepLimits {
        let crossing = self.pool.stencil.spacing / self.saved.speed;
        let longest = (self.saved.speed > 0.0).then_some(self.largest_lag * crossing);
        StepLimits {
            longest,
            next_event: None,
        }
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        self.follow(world);
        self.cost = Cost::default();
        let lag = step.size * self.saved.speed / self.pool.stencil.spacing;
        self.saved.longest_lag = self.saved.longest_lag.max(lag);
        if self.pool.len() > 0 {
            let (melt, pool) = (&self.melt, &self.pool);
            let advanced = self.flow.advance(melt, pool, &self.surface, step.size);
            self.cost = advanced.map_err(|cause| RunError::Plugin {
                plugin: "melt_flow".into(),
                time: step.end(),
                cause: cause.into(),
            })?;
            self.store_cells(world);
        }
        self.saved.speed = self.flow.momentum.largest_speed();
        Ok(Work {
            iterations: self.cost.iterations,
            evaluations: self.cost.sub_steps,
        })
    }

    fn find_blow_up(&mut self, world: &World, field: &str, largest: f64) -> Option<usize> {
        /// m/s
        const IMPLAUSIBLE: f64 = 1e4;
        let is_beyond = field == core_keys::MELT_VELOCITY.name && largest > IMPLAUSIBLE;
        let velocity = Read::from(self.fields.velocity);
        is_beyond.then(|| world.first_beyond(velocity, IMPLAUSIBLE))?
    }

    fn observe(&mut self, world: &World, _time: f64) -> Result<(), RunError> {
        self.layer = self.layer_points(world);
        if let Some(points) = self.layer {
            let least = self.saved.thinnest.unwrap_or(f64::INFINITY);
            self.saved.thinnest = Some(points.min(least));
        }
        Ok(())
    }

    fn report(&self, world: &World) -> PhysicsReport {
        let volume = world.body(self.body).points.volume[0];
        let liquid = self.pool.points.iter().map(|_| volume).sum();
        let mut numbers = vec![
            Report::new("speed.max", "m/s", self.saved.speed),
            Report::new("liquid.volume", "m3", liquid),
            Report::new("sub_steps", "1", self.cost.sub_steps as f64),
        ];
        let frozen = AXES.iter().zip(self.saved.to_solid);
        numbers.extend(
            frozen.map(|(axis, sum)| Report::new(format!("momentum_to_solid.{axis}"), "N s", sum)),
        );
        if self.melt.has_tension() {
            let points = self.layer.unwrap_or(0.0);
            numbers.push(Report::new("boundary_layer.points", "1", points));
        }
        let thin = self.saved.thinnest.filter(|points| *points < 2.0);
        let remark = |points| {
            format!(
                "the layer of melt under the surface was {points:.2} points thick at least, and takes 2 or more: the spacing \
                 decides the speed; use a finer one or a `viscosity_factor`"
            )
        };
        let lag = self.saved.longest_lag;
        let is_late = lag > self.largest_lag * (1.0 + 1e-6);
        let late = is_late.then(|| {
            format!(
                "in a step the melt flowed over {lag:.0} points without an exchange of heat with `thermal`, and `largest_lag` is {}: the \
                 pool is wrong; use `step = \"auto\"` in `time`, or a shorter one",
                self.largest_lag
            )
        });
        PhysicsReport {
            numbers,
            remarks: thin.map(remark).into_iter().chain(late).collect(),
        }
    }

    fn save(&self, _: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(Saved {
            points: self.pool.points.clone(),
            ..self.saved.clone()
        })
    }

    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.saved = erased_serde::deserialize(state)?;
        let points = mem::take(&mut self.saved.points);
        let body = world.body(self.body);
        let count = world.points_of_whole(self.body);
        if let Some(point) = points.iter().find(|p| **p as usize >= count) {
            let message = format!("point {point} of a body of {count} points");
            return Err(serde::de::Error::custom(message));
        }
        self.pool.restore(body, points);
        self.follow_list(world);
        Ok(())
    }
}

perimelt_core::register_physics!("melt_flow", MeltFlow, supports: [Births, Cuts, Window, Division]);
