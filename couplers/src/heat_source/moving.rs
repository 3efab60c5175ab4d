//! A heat source that moves along a toolpath, generic over its shape.

mod checks;

use std::borrow::Cow;
use std::path::Path;
use std::rc::Rc;

use nalgebra::Vector3;
use perimelt_core::numbers::check_at_least;
use perimelt_core::world::{BodyIndex, LayerSideBySide};
use perimelt_core::{
    Change, LoadError, Prepared, Read, Report, RunError, RunningCoupler, SavedState, Setup,
    SetupError, Step, StepLimits, Stepping, World, Write, flattened, keys, shared_keys,
};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize};

use super::account::{Account, mirror_copies};
use super::heading::Heading;
use super::lattice::{AbsorbingState, LatticeBody, grid};
use super::shape::{Absorber, CellGrid, Cells, Depositor, Depression, SourceShape};
use super::step_positions::StepPositions;
use crate::surface::OnBody;
use crate::toolpath::{ClockState, Pulse, TimedPath, Toolpath, Track};

/// Fraction of the shortest length that the source may move in a step.
const STEP_FRACTION: f64 = 0.25;

shared_keys! {
    /// Keys that every moving source has besides those of its shape.
    #[derive(Clone, Debug, PartialEq)]
    struct Supply {
        /// Where the source is, which way it travels and how strong it is.
        pub toolpath: Toolpath,
        /// Voltage (V) of an arc or a beam; times `current` it is the power, instead of `power`.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub voltage: Option<f64>,
        /// Current (A) of an arc or a beam; times `voltage` it is the power, instead of `power`.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub current: Option<f64>,
        /// Pulses of the power; default none.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub pulse: Option<Pulse>,
    }
}

impl Supply {
    /// The power where the toolpath gives none (W), before efficiency: that of the shape, or voltage times current.
    ///
    /// # Errors
    /// A number out of its range, one of both alone, or two powers.
    fn power(&self, of_shape: Option<f64>) -> Result<Option<f64>, SetupError> {
        for (key, value, unit) in [
            ("power", of_shape, "W"),
            ("voltage", self.voltage, "V"),
            ("current", self.current, "A"),
        ] {
            check_at_least(key, value, 0.0, unit)?;
        }
        match (of_shape, self.voltage, self.current) {
            (power, None, None) => Ok(power),
            (None, Some(voltage), Some(current)) => Ok(Some(voltage * current)),
            (None, Some(_), None) => Err(SetupError::value(
                "voltage",
                "`voltage` of the heat source is given without `current`",
                "both `voltage` and `current`, or `power`",
            )),
            (None, None, Some(_)) => Err(SetupError::value(
                "current",
                "`current` of the heat source is given without `voltage`",
                "both `voltage` and `current`, or `power`",
            )),
            (Some(_), ..) => Err(SetupError::value(
                "power",
                "`power` of the heat source is given besides its voltage or current",
                "`power` alone, or `voltage` and `current`",
            )),
        }
    }

    /// The pulses, if they are given.
    ///
    /// # Errors
    /// A number out of its range.
    fn pulse(&self) -> Result<Option<Pulse>, SetupError> {
        self.pulse.map_or(Ok(()), |pulse| pulse.check())?;
        Ok(self.pulse)
    }
}

/// A heat source of shape `S` on a toolpath.
#[derive(Serialize)]
pub struct MovingSource<S> {
    #[serde(flatten)]
    target: OnBody,
    #[serde(flatten)]
    supply: Supply,
    /// Power density.
    #[serde(flatten)]
    pub shape: S,
    /// The toolpath in time, shared with couplers that follow this source, once it is published.
    #[serde(skip)]
    path: Option<Rc<TimedPath>>,
}

impl<S: SourceShape> MovingSource<S> {
    /// The toolpath in time.
    fn timed_path(&mut self, folder: &Path) -> Result<Rc<TimedPath>, SetupError> {
        if let Some(path) = &self.path {
            return Ok(path.clone());
        }
        let pulse = self.supply.pulse()?;
        let surface = self.shape.surface();
        let direction = surface.direction.map(Vector3::from);
        let torch = direction.and_then(|d| d.try_normalize(0.0));
        let path = TimedPath::new(self.track(folder)?).pulsed(pulse);
        let path = Rc::new(path.over((surface.face, surface.level), torch));
        Ok(self.path.insert(path).clone())
    }

    /// Power where the toolpath gives none, W.
    fn power(&self) -> Result<Option<f64>, SetupError> {
        self.supply.power(self.shape.power())
    }

    fn track(&self, folder: &Path) -> Result<Track, SetupError> {
        let kind = self.supply.toolpath.kind();
        let power = self.power()?;
        self.supply
            .toolpath
            .track(power, folder)
            .map_err(|e| e.below(&format!("toolpath.{kind}")))
    }

    /// [`Coupler::publish`](perimelt_core::Coupler::publish).
    #[doc(hidden)]
    pub fn publish_path(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let path = self.timed_path(&setup.path(""))?;
        setup.share(path);
        if self.shape.absorber() == Some(Absorber::Interface) {
            let body = setup.find_body(self.target.body.as_deref())?;
            setup.publish(body, LayerSideBySide)?;
        }
        Ok(())
    }

    /// Declares the field on which the absorption depends.
    fn absorption(&self, setup: &mut Setup<'_>, body: BodyIndex) -> Result<Absorption, SetupError> {
        Ok(match self.shape.absorber() {
            None => Absorption::Fixed,
            Some(Absorber::Interface) => {
                Absorption::AtInterface(setup.read(body, &keys::FLUID_FRACTION)?)
            }
            Some(Absorber::Keyhole) => {
                let curves = setup.world().enthalpy_curves(body)?;
                let materials = setup.body(body).materials.iter().zip(&curves);
                let limits = materials.map(|(material, curve)| {
                    let boiling = material.constant("boiling_temperature");
                    let boiling = boiling.map_err(|e| SetupError::other("penetration", e))?;
                    Ok(curve.enthalpy(boiling))
                });
                Absorption::UntilBoiling {
                    limits: limits.collect::<Result<_, SetupError>>()?,
                    enthalpy: setup.read(body, &keys::ENTHALPY)?,
                }
            }
        })
    }

    /// [`Coupler::prepare`](perimelt_core::Coupler::prepare).
    #[doc(hidden)]
    pub fn prepare_source(mut self, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let index = setup.find_body(self.target.body.as_deref())?;
        let path = self.timed_path(&setup.path(""))?;
        self.shape.complete(setup, index)?;
        let body = setup.body(index);
        if body.dimension == 1 {
            let message = "a moving source cannot heat a 1D body";
            return Err(SetupError::value("body", message, "a 2D or 3D body"));
        }
        let grid = grid(body);
        let mut depositor = Depositor::new(&self.shape, &grid)?;
        match depositor.check_cells() {
            Err(e) if body.lattice().is_none() => return Err(e),
            Err(e) => setup.refuse(index, Change::Motion, e)?,
            Ok(()) => {}
        }
        let body = setup.body(index);
        let length = self.shape.length().max(body.finest_spacing());
        let reducer = setup.world().reducer(index);
        self.check_path(body, &reducer, path.track(), 2.0 * length, &mut depositor)?;
        // the wall of a keyhole moves through single cells
        let finest = match self.shape.absorber() {
            Some(Absorber::Keyhole) => body.finest_spacing(),
            _ => length,
        };
        let speed = path.track().fastest();
        self.warn_of_size(setup, index);
        path.prepare(setup, index)?;
        let first = path.track().pose(path.track().start());
        let heading = Heading::new(&path, &first, speed > 0.0);
        let known = path.clone();
        setup.stepping(Stepping {
            programme: Some(Box::new(move |time| known.programme(time))),
            ..Stepping::default()
        });
        Ok(Box::new(RunningSource {
            body: index,
            grid,
            depositor,
            heat_source: setup.add(index, &keys::HEAT_SOURCE)?,
            absorption: self.absorption(setup, index)?,
            longest_way: STEP_FRACTION * finest,
            speed,
            position: path.first_position(),
            heading,
            path,
            account: Account::default(),
            positions: StepPositions::default(),
        }))
    }
}

impl<'de, S: Deserialize<'de>> Deserialize<'de> for MovingSource<S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let ((target, supply), shape) = flattened::read(deserializer)?;
        Ok(MovingSource {
            target,
            supply,
            shape,
            path: None,
        })
    }
}

impl<S: JsonSchema> JsonSchema for MovingSource<S> {
    fn schema_name() -> Cow<'static, str> {
        S::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = S::json_schema(generator);
        flattened::add_schema::<OnBody>(&mut schema, generator);
        flattened::add_schema::<Supply>(&mut schema, generator);
        schema
    }
}

/// The field on which the absorption of a source depends.
enum Absorption {
    Fixed,
    /// Fraction of the first of two fluids.
    AtInterface(Read<f64>),
    /// Enthalpies (J/m³) at which materials boil.
    UntilBoiling {
        enthalpy: Read<f64>,
        limits: Vec<f64>,
    },
}

impl Absorption {
    /// The state of the points at the start of a step of the size `step` (s).
    fn state<'a>(&'a self, world: &'a World, step: f64) -> AbsorbingState<'a> {
        match self {
            Self::Fixed => AbsorbingState::None,
            Self::AtInterface(fraction) => AbsorbingState::Fraction(world.read(*fraction)),
            Self::UntilBoiling { enthalpy, limits } => AbsorbingState::Boiling {
                enthalpy: world.read(*enthalpy),
                limits,
                step,
            },
        }
    }
}

/// A heat source on a toolpath that is ready to heat.
struct RunningSource {
    body: BodyIndex,
    grid: CellGrid,
    path: Rc<TimedPath>,
    depositor: Depositor,
    heat_source: Write<f64>,
    absorption: Absorption,
    /// Longest distance that the source may move over the points in a step while it is on, m.
    longest_way: f64,
    /// Largest speed on the path, m/s.
    speed: f64,
    /// Position at the end of the last step, m.
    position: Vector3<f64>,
    /// Directions in the middle of the last step.
    heading: Heading,
    account: Account,
    positions: StepPositions,
}

/// State for a checkpoint.
#[derive(Serialize, Deserialize)]
struct Saved {
    account: Account,
    clock: Option<ClockState>,
    /// Speed of the fastest point of a fluid, m/s.
    point_speed: f64,
}

impl RunningCoupler for RunningSource {
    /// Stores the positions, and begins the passes whose wait has ended.
    fn begin_step(&mut self, world: &World, time: f64) {
        self.positions.begin_step(world, self.body, time);
        if !self.path.track().passes().is_empty() {
            self.path.begin_step(world, time);
        }
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let body = world.body(self.body);
        let mut pose = self.path.pose(step.middle());
        let left = self.path.left(step.middle(), self.depositor.efficiency());
        if left < 0.0 {
            return Err(RunError::Plugin {
                plugin: "deposit".into(),
                time: step.start,
                cause: format!(
                    "the droplets take {:.3} times the heat of the source in this pass; expected less than 1",
                    1.0 - left
                )
                .into(),
            });
        }
        pose.power *= left;
        // points of a window are stored at their positions at set-up
        pose.position -= world.window_shift(self.body);
        let mut heat_source = world.write(self.heat_source);
        let now = self.positions.at(world, self.body, step.middle());
        let deposit = match Cells::of(world, self.body, now, self.grid) {
            Some(cells) => (self.depositor).add_to_cells(&cells, &pose, &mut heat_source),
            None => {
                let body = LatticeBody {
                    body,
                    grid: self.grid,
                    activity: world.activity(self.body),
                    state: self.absorption.state(world, step.size),
                    reducer: world.reducer(self.body),
                };
                self.depositor.add(&body, &pose, &mut heat_source)
            }
        };
        let copies = mirror_copies(&self.grid, &world.symmetry(self.body), &pose);
        // between two pulses the source counts as on
        let is_on = self.path.is_on_after(step.middle());
        let speed = is_on.then_some(pose.speed);
        self.account.book(&deposit, copies, step.size, speed);
        self.position = self.path.pose(step.end()).position;
        let moves = self.speed > 0.0;
        // a jump without power does not turn the melt pool
        let pose = self.path.last_pose_with_power(step.middle());
        self.heading = Heading::new(&self.path, &pose, moves);
        Ok(())
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let speed = self.speed + self.positions.speed;
        let is_limited = speed > 0.0 && self.path.will_be_on(time);
        StepLimits {
            next_event: self.path.next_event(time),
            longest: is_limited.then(|| self.longest_way / speed),
        }
    }

    fn report(&self) -> Vec<Report> {
        let mut reports = self.account.report();
        let axes = ["x", "y", "z"].into_iter().enumerate();
        reports.extend(
            axes.map(|(axis, name)| {
                Report::new(format!("position.{name}"), "m", self.position[axis])
            }),
        );
        if !matches!(self.absorption, Absorption::Fixed) {
            let Depression { depth, gain } = self.account.depression();
            reports.push(Report::new("depth", "m", depth));
            let absorptivity = gain * self.depositor.efficiency();
            reports.push(Report::new("absorptivity", "1", absorptivity));
        }
        reports.extend(self.heading.report());
        reports.extend(self.path.report());
        reports
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(Saved {
            account: self.account,
            clock: Some(self.path.save()),
            point_speed: self.positions.speed,
        })
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        let saved = Saved::deserialize(state)?;
        self.account = saved.account;
        self.positions.speed = saved.point_speed;
        if let Some(clock) = saved.clock {
            self.path.load(clock);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
