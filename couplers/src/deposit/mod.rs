//! Deposition: points of a body get their material during the run, along a toolpath or layer by layer.
//!
//! Points of `region` have no material at first: no bonds, no mass, no heat, no surface. The others are there from the
//! start.
//!
//! - With `toolpath` and `bead` (wire and arc, blown powder) a point gets its material when the bead first covers it
//!   while the toolpath has power: the points within half a `width` of the toolpath, and within `height` below its level.
//!   `source` names the heat source whose toolpath this is: one path with one clock, waits included. A toolpath of its own
//!   needs no power.
//! - With `layers` (powder bed) all points of a layer get their material at once, and several layers where `at_once` says
//!   so, as for parts whose layers are thinner than the spacing.
//!
//! Material has the enthalpy at its deposition `temperature`, such as the temperature of droplets or of preheated powder.
//! The heat balance counts this enthalpy as supplied, and `thermal` reports it. A source heats points with material only.
//! Radiation and convection act on the surface of the material that is present.
//!
//! Steps end where a layer or a bead begins, and a toolpath moves by at most half a spacing in a step.
//!
//! With `mechanical` (correspondence) material is free of stress in the shape of the body at its birth.
//!
//! Not for: momentum of droplets.

mod births;
mod checks;
#[cfg(test)]
mod tests;

use std::rc::Rc;

use perimelt_core::numbers::check_positive;
use perimelt_core::programme::DoneFraction;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Change, Coupler, Face, LoadError, Prepared, Programme, Report, RunError, RunningCoupler,
    SavedState, Setup, SetupError, Step, StepLimits, Stepping, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use births::{Bead, Layers};

use births::{Birth, Births, BuildRegion};
use checks::{check_bead, check_layers, direction};

use crate::InTime;
use crate::heat_source::{grid, mirror_copies};
use crate::toolpath::{TimedPath, Toolpath, Track, TrackTime};

/// Fraction of a spacing that a toolpath may move in a step.
const STEP_FRACTION: f64 = 0.5;

/// Temperature of a wire before it melts, K.
const FEED_TEMPERATURE: f64 = 293.15;

/// Births that are farther apart than this number of such steps are separated by a pause.
const PAUSE: f64 = 4.0;

/// Material that is deposited along a toolpath or layer by layer.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deposit {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Region of the points that have no material at first.
    pub region: String,
    /// Temperature at which material is deposited (K): a number, or `{ time = [...], value = [...] }`, times in s.
    pub temperature: InTime,
    /// Name of the heat source whose toolpath deposits the material, the `name` of its table; with `bead`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Where the heat of the material comes from; default `added`.
    #[serde(default)]
    pub heat: DepositHeat,
    /// Temperature of the wire or powder before (K), above which `heat = "from_source"` counts its heat; default 293.15.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub feed_temperature: Option<f64>,
    /// Path of the nozzle, where no heat source has it; with `bead`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toolpath: Option<Toolpath>,
    /// Cross-section of the bead that the toolpath leaves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bead: Option<Bead>,
    /// Whole layers at fixed intervals, instead of `toolpath` and `bead`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layers: Option<Layers>,
    /// Direction in which the body is built up; default `"z+"` in 3D, `"y+"` in 2D, `"x+"` in 1D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Face>,
}

/// Where the heat of deposited material comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepositHeat {
    /// It comes on top of that of the heat source.
    #[default]
    Added,
    /// It is a part of that of the heat source `source`, whose power is lower by one fraction in each pass: source and material
    /// together bring the energy of the source.
    FromSource,
}

/// A deposit that is ready to act.
struct RunningDeposit {
    body: BodyIndex,
    active: Write<f64>,
    birth_temperature: Write<f64>,
    schedule: Rc<Schedule>,
    /// Times at which births begin after a pause, s, on the clock of the births.
    starts: Vec<f64>,
    /// Temperature of the material, K.
    temperature: InTime,
    /// Number of births so far.
    born: usize,
    /// Volume (m³) and mass (kg) deposited so far.
    deposited: [f64; 2],
    /// Feed temperature (K); the heat of the material above it is taken out of the source at the first step.
    takes_heat_above: Option<f64>,
}

impl Deposit {
    fn schedule(
        &self,
        setup: &mut Setup<'_>,
        part: &DepositRegion,
    ) -> Result<Schedule, SetupError> {
        let path = self.path(setup)?;
        let density = setup.world().density_at_points(part.body)?;
        let of_whole = |setup: &Setup<'_>, births| {
            Births::of_whole(setup.world(), part.body, &density, births)
        };
        match (path, &self.bead, &self.layers) {
            (Some(path), Some(bead), None) => {
                check_bead(bead)?;
                let track = path.track();
                for warning in track.warnings() {
                    setup.warn(warning);
                }
                let births = part.of(setup).by_bead(track, bead, path.torch());
                let births = of_whole(setup, births);
                let speed = track.fastest();
                let spacing = setup.body(part.body).finest_spacing();
                let step_limit = (speed > 0.0).then(|| STEP_FRACTION * spacing / speed);
                self.check_coverage(setup, part, track, births.all.len())?;
                Ok(Schedule {
                    path: Some(path),
                    births,
                    step_limit,
                })
            }
            (None, None, Some(layers)) => {
                check_layers(layers, setup.body(part.body).finest_spacing())?;
                Ok(Schedule {
                    path: None,
                    births: of_whole(setup, part.of(setup).by_layers(layers)),
                    step_limit: None,
                })
            }
            (Some(_), None, None) => Err(SetupError::value(
                "toolpath",
                "`bead`, the cross-section that the toolpath leaves, is missing",
                "`bead = { width = ..., height = ... }` in m",
            )),
            (_, _, Some(_)) => Err(SetupError::value(
                "layers",
                "both `layers` and a toolpath or a bead are given",
                "`layers`, or `toolpath` with `bead`",
            )),
            (None, _, None) => Err(SetupError::value(
                "",
                "nothing says when material is deposited",
                "`source` or `toolpath`, with `bead`; or `layers`",
            )),
        }
    }

    /// The path of the nozzle, if there is one: the path of a heat source or a separate one.
    fn path(&self, setup: &Setup<'_>) -> Result<Option<Rc<TimedPath>>, SetupError> {
        let toolpath = match (&self.source, &self.toolpath) {
            (None, None) => return Ok(None),
            (Some(_), Some(_)) => {
                let message = "both `source` and a toolpath are given";
                let expected = "the name of the heat source that has the toolpath, or a toolpath";
                return Err(SetupError::value("source", message, expected));
            }
            (Some(source), None) => {
                return setup.shared("source", "heat source", source).map(Some);
            }
            (None, Some(toolpath)) => toolpath,
        };
        // a toolpath without a power deposits throughout
        let track = toolpath.track(Some(1.0), &setup.path(""));
        let kind = toolpath.kind();
        let track = track.map_err(|e| e.below(&format!("toolpath.{kind}")))?;
        let path = TimedPath::new(track);
        if path.waits() {
            let message = "a toolpath that waits belongs to a heat source";
            let expected = "`source`, the name of that heat source";
            return Err(SetupError::value("toolpath", message, expected));
        }
        Ok(Some(Rc::new(path)))
    }

    /// Refuses a bead that covers no point, and warns of points that it never covers.
    fn check_coverage(
        &self,
        setup: &mut Setup<'_>,
        part: &DepositRegion,
        track: &Track,
        covered: usize,
    ) -> Result<(), SetupError> {
        let reducer = setup.world().reducer(part.body);
        let own = part
            .points
            .iter()
            .filter(|p| (**p as usize) < reducer.owned());
        let points = reducer.total_of(own.count() as f64) as usize;
        let left = points - covered;
        if covered == 0 {
            let start = track.pose(track.start()).position;
            let (x, y, z) = (start.x, start.y, start.z);
            let message = format!(
                "the bead along the toolpath, which starts at ({x}, {y}, {z}) m, covers no point of region `{}`",
                self.region
            );
            let expected = "a toolpath at the height of the top of the bead, within half a bead width of the region";
            return Err(SetupError::value("toolpath", message, expected));
        }
        if left > 0 {
            setup.warn(format!(
                "the bead does not cover {left} of {points} points of region `{}`, which are never deposited",
                self.region
            ));
        }
        Ok(())
    }
}

/// A region of a body that is built up in a direction.
struct DepositRegion {
    body: BodyIndex,
    points: Vec<u32>,
    up: Face,
}

impl DepositRegion {
    fn of<'a>(&'a self, setup: &'a Setup<'_>) -> BuildRegion<'a> {
        BuildRegion {
            body: setup.body(self.body),
            points: &self.points,
            up: self.up,
            reducer: setup.world().reducer(self.body),
        }
    }
}

/// When material is deposited.
struct Schedule {
    /// The path whose clock the births follow; without it, their times are times of the run.
    path: Option<Rc<TimedPath>>,
    births: Births,
    /// Longest step while a toolpath deposits, s.
    step_limit: Option<f64>,
}

impl Schedule {
    /// Time on the clock of the births at a time of the run, s.
    fn at(&self, time: f64) -> TrackTime {
        match &self.path {
            Some(path) => path.at(time),
            None => TrackTime::Running(time),
        }
    }

    /// Time of the run (s) of a birth that has just happened.
    fn time_of(&self, birth: f64) -> f64 {
        self.path.as_ref().map_or(birth, |path| path.time_of(birth))
    }

    /// Number of births up to a time on their clock.
    fn until(&self, time: TrackTime) -> usize {
        (self.births.all).partition_point(|b| time.has_passed(b.time))
    }

    /// Times at which births begin after a pause, s.
    fn starts(&self) -> Vec<f64> {
        // successive births along a toolpath are no events
        let pause = PAUSE * self.step_limit.unwrap_or(0.0);
        let mut last = f64::NEG_INFINITY;
        let begins = |birth: &Birth| birth.time - std::mem::replace(&mut last, birth.time) > pause;
        let times = self.births.all.iter().copied().filter(begins);
        times.map(|birth| birth.time).collect()
    }

    fn programme(&self, time: f64) -> Option<Programme> {
        let births = &self.births.all;
        let end = self.time_of(births.last()?.time);
        let done = self.until(self.at(time));
        Some(Programme {
            done: Some(DoneFraction {
                fraction: done as f64 / births.len() as f64,
                of: "the points",
            }),
            ..Programme::new("the last material is deposited", end)
        })
    }

    /// Longest step at a time of the run (s) while a toolpath deposits, s.
    fn longest_step(&self, time: f64) -> Option<f64> {
        let limit = self.step_limit?;
        let TrackTime::Running(now) = self.path.as_ref()?.foreseen(time) else {
            return None;
        };
        let births = &self.births.all;
        let next = births.get(births.partition_point(|b| b.time <= now))?;
        (next.time - now <= PAUSE * limit).then_some(limit)
    }
}

impl RunningDeposit {
    /// Subtracts the heat of all material above the temperature `feed` (K), mirror images at planes of symmetry included, from
    /// the energy of the source.
    fn take_heat(&self, world: &World, feed: f64) {
        let Schedule { path, births, .. } = &*self.schedule;
        let Some(path) = path else {
            return;
        };
        // `thermal` has checked the curves at set-up
        let curves = world.enthalpy_curves(self.body).unwrap_or_default();
        let body = world.body(self.body);
        let (grid, symmetry) = (grid(body), world.symmetry(self.body));
        let heat = |birth: &Birth| {
            let copies = mirror_copies(&grid, &symmetry, &path.track().pose(birth.time));
            let curve = curves.get(usize::from(birth.material))?;
            let temperature = self.temperature.at(birth.time);
            let enthalpy = curve.enthalpy(temperature) - curve.enthalpy(feed);
            Some((birth.time, copies * birth.volume * enthalpy))
        };
        path.take(births.all.iter().filter_map(heat));
    }

    /// Counts all births so far. Collective.
    fn count_again(&mut self, world: &World) {
        (self.born, self.deposited) = (0, [0.0; 2]);
        // the temperature at birth counts: points may have been cut off since
        let birth_temperature = world.read(self.birth_temperature.into());
        let born = (self.schedule.births).count(|point| birth_temperature[point] > 0.0);
        let born = world.reducer(self.body).max(born as f64);
        self.count(born as usize);
    }

    fn count(&mut self, born: usize) {
        for birth in &self.schedule.births.all[self.born..born] {
            self.deposited[0] += birth.volume;
            self.deposited[1] += birth.mass;
        }
        self.born = born;
    }
}

#[typetag::serialize(name = "deposit")]
impl Coupler for Deposit {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        for value in self.temperature.values() {
            check_positive("temperature", *value, "K")?;
        }
        let part = DepositRegion {
            body,
            points: setup.region(body, "region", &self.region)?.points,
            up: direction(self.up, setup.body(body).dimension)?,
        };
        let active = setup.change_material(body, Change::Births, &part.points)?;
        let schedule = Rc::new(self.schedule(setup, &part)?);
        self.check_heat(schedule.path.as_deref())?;
        let known = schedule.clone();
        setup.stepping(Stepping {
            programme: Some(Box::new(move |time| known.programme(time))),
            ..Stepping::default()
        });
        let feed = self.feed_temperature.unwrap_or(FEED_TEMPERATURE);
        Ok(Box::new(RunningDeposit {
            body,
            active,
            birth_temperature: setup.write(body, &keys::BIRTH_TEMPERATURE)?,
            starts: schedule.starts(),
            schedule,
            temperature: self.temperature,
            born: 0,
            deposited: [0.0; 2],
            takes_heat_above: (self.heat == DepositHeat::FromSource).then_some(feed),
        }))
    }
}

impl RunningCoupler for RunningDeposit {
    fn begin_step(&mut self, world: &World, _time: f64) {
        if let Some(feed) = self.takes_heat_above.take() {
            self.take_heat(world, feed);
        }
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        // nothing is deposited before the first step
        if step.size == 0.0 {
            return Ok(());
        }
        if self.born == 0 {
            self.count_again(world);
        }
        let due = self.schedule.until(self.schedule.at(step.middle()));
        if due > self.born {
            let mut active = world.write(self.active);
            let mut birth_temperature = world.write(self.birth_temperature);
            for (birth, point) in self.schedule.births.here(self.born, due) {
                active[point] = 1.0;
                let time = self.schedule.time_of(birth);
                let temperature = self.temperature.value_at("temperature", time);
                birth_temperature[point] =
                    temperature.map_err(|e| RunError::wrong_value("deposit", e))?;
            }
            drop((active, birth_temperature));
            self.count(due);
        }
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let next = |after: f64| {
            let starts = &self.starts;
            starts.get(starts.partition_point(|t| *t <= after)).copied()
        };
        StepLimits {
            next_event: match &self.schedule.path {
                Some(path) => path.next_of(time, next),
                None => next(time),
            },
            longest: self.schedule.longest_step(time),
        }
    }

    fn report(&self) -> Vec<Report> {
        vec![
            Report::new("points", "1", self.born as f64),
            Report::new("volume", "m3", self.deposited[0]),
            Report::new("mass", "kg", self.deposited[1]),
        ]
    }

    /// Births are counted again in the next step, from the restored temperatures.
    fn load(&mut self, _world: &World, _state: SavedState<'_, '_>) -> Result<(), LoadError> {
        (self.born, self.deposited) = (0, [0.0; 2]);
        Ok(())
    }
}

perimelt_core::register_coupler!("deposit", Deposit, supports: [Births, Cuts, Division]);
