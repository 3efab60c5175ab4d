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
//! Material comes with the enthalpy of the `temperature` at which it is deposited, such as that of the droplets, or of the
//! preheated powder. The balance of heat counts it as supplied, and `thermal` reports it. A source heats
//! points with material only. What is exposed at the moment radiates and convects: surfaces are covered and born with the
//! material.
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

use perimelt_core::programme::DoneFraction;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, Face, Programme, Report, RunError, Setup, SetupError, Step, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use births::{Bead, Layers};

use births::{Birth, Part};
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
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<DepositState>,
    /// Whether the heat of the material was taken out of that of the source.
    #[serde(skip)]
    #[schemars(skip)]
    has_taken: bool,
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

#[derive(Debug)]
struct DepositState {
    body: BodyIndex,
    active: Write<f64>,
    birth_temperature: Write<f64>,
    /// The path whose clock the times of the births follow; else they are times of the run.
    path: Option<Rc<TimedPath>>,
    /// In the order of time.
    births: Vec<Birth>,
    /// Times at which births begin after a pause, s, as those of the births.
    starts: Vec<f64>,
    /// Longest step while a toolpath deposits, s.
    step_limit: Option<f64>,
    /// Mass of each point, kg.
    mass: Vec<f64>,
    /// Number of births so far.
    born: usize,
    /// Volume (m³) and mass (kg) of these.
    deposited: [f64; 2],
}

impl Deposit {
    fn births(&self, setup: &mut Setup<'_>, part: &Placed) -> Result<Births, SetupError> {
        let path = self.path(setup)?;
        match (path, &self.bead, &self.layers) {
            (Some(path), Some(bead), None) => {
                check_bead(bead)?;
                let track = path.track();
                for warning in track.warnings() {
                    setup.warn(warning);
                }
                let births = part.of(setup).by_bead(track, bead, path.torch());
                let speed = track.fastest();
                let spacing = setup.body(part.body).finest_spacing();
                let step_limit = (speed > 0.0).then(|| STEP_FRACTION * spacing / speed);
                self.check_coverage(setup, (part, track), births.len())?;
                Ok(Births {
                    path: Some(path),
                    births,
                    step_limit,
                })
            }
            (None, None, Some(layers)) => {
                check_layers(layers, setup.body(part.body).finest_spacing())?;
                Ok(Births {
                    path: None,
                    births: part.of(setup).by_layers(layers),
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
                "it is not given when material is deposited",
                "`source` or `toolpath`, with `bead`; or `layers`",
            )),
        }
    }

    /// Takes the heat of all material out of that of the source, with the mirror images of the material that the source deposits
    /// from planes of symmetry.
    fn take_heat(&self, world: &World) {
        let Some((p, path)) = self
            .prepared
            .as_ref()
            .and_then(|p| Some((p, p.path.as_ref()?)))
        else {
            return;
        };
        // `thermal` has found the same ones at set-up
        let curves = world.enthalpy_curves(p.body).unwrap_or_default();
        let body = world.body(p.body);
        let feed = self.feed_temperature.unwrap_or(FEED_TEMPERATURE);
        let (grid, symmetry) = (grid(body), world.symmetry(p.body));
        let heat = |birth: &Birth| {
            let copies = mirror_copies(&grid, &symmetry, &path.track().pose(birth.time));
            let point = birth.point as usize;
            let curve = curves.get(usize::from(body.material_of_point[point]))?;
            let temperature = self.temperature.at(birth.time);
            let enthalpy = curve.enthalpy(temperature) - curve.enthalpy(feed);
            Some((birth.time, copies * body.points.volume[point] * enthalpy))
        };
        path.take(p.births.iter().filter_map(heat));
    }

    /// The path of the nozzle, if there is one: that of a heat source or an own one.
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
        // without a power of its own the toolpath deposits throughout
        let track = toolpath.track(Some(1.0), &setup.path(""));
        let kind = toolpath.kind();
        let track =
            track.map_err(|e| SetupError::other(format!("toolpath.{kind}.{}", e.key()), e))?;
        let path = TimedPath::new(track);
        if path.waits() {
            let message = "a toolpath that waits belongs to a heat source";
            let expected = "`source`, the name of that heat source";
            return Err(SetupError::value("toolpath", message, expected));
        }
        Ok(Some(Rc::new(path)))
    }

    /// Refuses a bead that covers no point, and tells of points that it never covers.
    fn check_coverage(
        &self,
        setup: &mut Setup<'_>,
        (part, track): (&Placed, &Track),
        covered: usize,
    ) -> Result<(), SetupError> {
        let left = part.points.len() - covered;
        if covered == 0 {
            let start = track.pose(track.start()).position;
            let (x, y, z) = (start.x, start.y, start.z);
            let message = format!(
                "the bead along the toolpath, which starts at ({x}, {y}, {z}) m, covers no point of region `{}`",
                self.region
            );
            let expected =
                "a toolpath at the level of the top of the bead, within half a width of the region";
            return Err(SetupError::value("toolpath", message, expected));
        }
        if left > 0 {
            setup.warn(format!(
                "{left} of {} points of region `{}` are never deposited: the bead does not reach them",
                part.points.len(),
                self.region
            ));
        }
        Ok(())
    }
}

/// A region of a body that is built up in a direction.
struct Placed {
    body: BodyIndex,
    points: Vec<u32>,
    up: Face,
}

impl Placed {
    fn of<'a>(&'a self, setup: &'a Setup<'_>) -> Part<'a> {
        Part {
            body: setup.body(self.body),
            points: &self.points,
            up: self.up,
        }
    }
}

struct Births {
    path: Option<Rc<TimedPath>>,
    births: Vec<Birth>,
    /// s.
    step_limit: Option<f64>,
}

impl DepositState {
    /// Time of the births at a time of the run, s.
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

    /// Counts the births so far from the first one on.
    fn count_again(&mut self, world: &World) {
        (self.born, self.deposited) = (0, [0.0; 2]);
        // by their temperature: points that were born may have been cut off since
        let birth_temperature = world.read(self.birth_temperature.into());
        let births = self.births.iter();
        let born = births
            .take_while(|b| birth_temperature[b.point as usize] > 0.0)
            .count();
        self.count(world, born);
    }

    fn count(&mut self, world: &World, born: usize) {
        let volume = &world.body(self.body).points.volume;
        for birth in &self.births[self.born..born] {
            let point = birth.point as usize;
            self.deposited[0] += volume[point];
            self.deposited[1] += self.mass[point];
        }
        self.born = born;
    }
}

#[typetag::serialize(name = "deposit")]
impl Coupler for Deposit {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let temperatures = self.temperature.values();
        if let Some(value) = temperatures.iter().find(|t| !(**t > 0.0)) {
            let message = format!("material is deposited at {value} K");
            let expected = "a temperature above 0 K";
            return Err(SetupError::value("temperature", message, expected));
        }
        let part = Placed {
            body,
            points: setup.region(body, "region", &self.region)?.points,
            up: direction(self.up, setup.body(body).dimension)?,
        };
        let active = setup.deposit(body, &part.points)?;
        let Births {
            path,
            births,
            step_limit,
        } = self.births(setup, &part)?;
        self.check_heat(path.as_deref())?;
        let volume = &setup.body(body).points.volume;
        let density = setup.density_at_points(body)?;
        let mass = density.iter().zip(volume).map(|(d, v)| d * v).collect();
        // births one after the other along a toolpath are no events
        let pause = PAUSE * step_limit.unwrap_or(0.0);
        let mut starts: Vec<f64> = Vec::new();
        let mut last = f64::NEG_INFINITY;
        for birth in &births {
            if birth.time - last > pause {
                starts.push(birth.time);
            }
            last = birth.time;
        }
        self.prepared = Some(DepositState {
            body,
            active,
            birth_temperature: setup.write(body, &keys::BIRTH_TEMPERATURE)?,
            path,
            births,
            starts,
            step_limit,
            mass,
            born: 0,
            deposited: [0.0; 2],
        });
        Ok(())
    }

    fn begin_step(&mut self, world: &World, _time: f64) {
        if self.heat == DepositHeat::FromSource && !self.has_taken {
            self.has_taken = true;
            self.take_heat(world);
        }
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let p = self.prepared.as_mut().expect("prepared before the run");
        // nothing is deposited before the first step
        if step.size == 0.0 {
            return Ok(());
        }
        if p.born == 0 {
            p.count_again(world);
        }
        let until = p.at(step.middle());
        let due = p.births.partition_point(|b| until.has_passed(b.time));
        if due > p.born {
            let mut active = world.write(p.active);
            let mut birth_temperature = world.write(p.birth_temperature);
            for birth in &p.births[p.born..due] {
                let point = birth.point as usize;
                active[point] = 1.0;
                birth_temperature[point] = self.temperature.at(p.time_of(birth.time));
            }
            drop((active, birth_temperature));
            p.count(world, due);
        }
        Ok(())
    }

    fn next_event(&self, after: f64) -> Option<f64> {
        let p = self.prepared.as_ref()?;
        let next = |after: f64| {
            let starts = &p.starts;
            starts.get(starts.partition_point(|t| *t <= after)).copied()
        };
        match &p.path {
            Some(path) => path.next_of(after, next),
            None => next(after),
        }
    }

    fn programme(&self, run_end: f64) -> Option<Programme> {
        let p = self.prepared.as_ref()?;
        let end = p.time_of(p.births.last()?.time);
        let until = p.at(run_end);
        let done = p.births.partition_point(|b| until.has_passed(b.time));
        Some(Programme {
            done: Some(DoneFraction {
                fraction: done as f64 / p.births.len() as f64,
                of: "the points",
            }),
            ..Programme::new("the last material is deposited", end)
        })
    }

    /// While a toolpath deposits.
    fn step_limit(&self, time: f64) -> Option<f64> {
        let p = self.prepared.as_ref()?;
        let limit = p.step_limit?;
        let path = p.path.as_ref()?;
        let TrackTime::Running(now) = path.foreseen(time) else {
            return None;
        };
        let next = p.births.partition_point(|b| b.time <= now);
        let next = p.births.get(next)?;
        (next.time - now <= PAUSE * limit).then_some(limit)
    }

    fn report(&self) -> Vec<Report> {
        let Some(p) = &self.prepared else {
            return Vec::new();
        };
        let report = |name: &str, unit: &str, value: f64| Report {
            name: name.into(),
            unit: unit.into(),
            value,
        };
        vec![
            report("points", "1", p.born as f64),
            report("volume", "m3", p.deposited[0]),
            report("mass", "kg", p.deposited[1]),
        ]
    }

    /// Births are counted again in the next step, from the restored temperatures.
    fn restored(&mut self, _world: &World) {
        if let Some(p) = &mut self.prepared {
            (p.born, p.deposited) = (0, [0.0; 2]);
        }
    }
}

perimelt_core::register_coupler!("deposit", Deposit, supports: [Births, Cuts]);
