//! A heat source that moves along a toolpath, generic over its shape.

use std::borrow::Cow;
use std::path::Path;
use std::rc::Rc;

use nalgebra::Vector3;
use perimelt_core::text::{number, position};
use perimelt_core::{Body, Change, RunningCoupler, Setup, SetupError, Stepping, flattened, keys};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize};

use super::account::Account;
use super::heading::Heading;
use super::lattice::{LatticeBody, grid};
use super::running::RunningSource;
use super::shape::{Depositor, SourceError, SourceShape};
use super::step_positions::StepPositions;
use super::supply::Supply;
use crate::surface::OnBody;
use crate::toolpath::{TimedPath, Track};

/// Fraction of the shortest length that the source may move in a step.
const STEP_FRACTION: f64 = 0.25;

/// Least fraction of its power with which a source outside the box of the body heats it.
const LEAST_FRACTION: f64 = 0.01;

/// Most moves whose heat is tried where the path lies outside the box of the body.
const MOST_TRIED: usize = 100;

/// Powers of welding sources are below this, W.
const STRONGEST: f64 = 2e5;

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
        let direction = self.shape.surface().direction.map(Vector3::from);
        let torch = direction.and_then(|d| d.try_normalize(0.0));
        let path = TimedPath::new(self.track(folder)?).pulsed(pulse);
        let path = Rc::new(path.with_torch(torch));
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
            .map_err(|e| SetupError::other(format!("toolpath.{kind}.{}", e.key()), e))
    }

    /// [`Coupler::publish`](perimelt_core::Coupler::publish).
    #[doc(hidden)]
    pub fn publish_path(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let path = self.timed_path(&setup.path(""))?;
        setup.share(path);
        Ok(())
    }

    /// [`Coupler::prepare`](perimelt_core::Coupler::prepare).
    #[doc(hidden)]
    pub fn prepare_source(
        mut self,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let index = setup.find_body(self.target.body.as_deref())?;
        let path = self.timed_path(&setup.path(""))?;
        self.shape.complete(setup, index)?;
        let body = setup.body(index);
        if body.dimension == 1 {
            let message = "a moving source cannot heat a 1D body";
            return Err(SetupError::value("body", message, "a 2D or 3D body"));
        }
        let grid = grid(body);
        let fault = |e: SourceError| SetupError::other(e.key(), e);
        let mut depositor = Depositor::new(&self.shape, &grid).map_err(fault)?;
        match depositor.check_cells() {
            Err(e) if body.lattice().is_none() => return Err(fault(e)),
            Err(e) => setup.refuse(index, Change::Motion, fault(e)),
            Ok(()) => {}
        }
        let body = setup.body(index);
        let length = self.shape.length().max(body.finest_spacing());
        self.check_path(body, path.track(), 2.0 * length, &mut depositor)?;
        let speed = path.track().fastest();
        self.warn_of_size(setup, index);
        path.prepare(setup, index)?;
        let first = path.track().pose(path.track().start());
        let surface = self.shape.surface();
        let heading = Heading::new(&depositor, surface, &first, speed > 0.0);
        let known = path.clone();
        setup.stepping(Stepping {
            programme: Some(Box::new(move |time| known.programme(time))),
            ..Stepping::default()
        });
        Ok(Box::new(RunningSource {
            body: index,
            grid,
            depositor,
            surface,
            heat_source: setup.add(index, &keys::HEAT_SOURCE)?,
            longest_way: STEP_FRACTION * length,
            speed,
            position: path.first_position(),
            heading,
            path,
            account: Account::default(),
            positions: StepPositions::default(),
        }))
    }

    /// Warns of a source finer than the spacing, and of a power that is probably in other units.
    fn warn_of_size(&self, setup: &mut Setup<'_>, body: usize) {
        let (length, spacing) = (self.shape.length(), setup.body(body).finest_spacing());
        if length > 0.0 && length < spacing {
            let [length, spacing] = [length, spacing].map(|x| number(x, 4));
            setup.warn(format!(
                "the shortest length of the source is {length} m, finer than the spacing {spacing} m: it heats \
                 single cells"
            ));
        }
        let power = self.power().ok().flatten();
        if let Some(power) = power.filter(|power| *power > STRONGEST) {
            setup.warn(format!(
                "a power of {} W is unusual; powers are in watts",
                number(power, 5)
            ));
        }
    }

    /// Refuses a toolpath on which the source is never on within `margin` (m) of the box of the body and heats no cell of its
    /// lattice. A beam from outside the box may heat cells.
    fn check_path(
        &self,
        body: &Body,
        track: &Track,
        margin: f64,
        depositor: &mut Depositor,
    ) -> Result<(), SetupError> {
        let (min, max) = body.bounds();
        let surface = self.shape.surface();
        let touches = |position: &Vector3<f64>| {
            (0..body.dimension).all(|axis| {
                let at = match surface.level {
                    Some(level) if axis == surface.face.axis() => level,
                    _ => position[axis],
                };
                at >= min[axis] - margin && at <= max[axis] + margin
            })
        };
        let mut first = None;
        for (start, end) in track.powered_moves() {
            let pose = track.pose(start);
            // beyond this distance a move without an end does not return to the body
            let reach = (pose.position - 0.5 * (min + max)).norm() + (max - min).norm();
            let end = if end.is_finite() {
                end
            } else {
                start + 2.0 * reach / pose.speed
            };
            let samples = (pose.speed * (end - start) / margin).ceil().clamp(1.0, 1e4);
            for sample in 0..=samples as usize {
                let time = start + (end - start) * sample as f64 / samples;
                let position = track.pose(time).position;
                first.get_or_insert(position);
                if touches(&position) {
                    return Ok(());
                }
            }
        }
        let lattice = body.lattice().map(|_| LatticeBody {
            body,
            grid: grid(body),
            activity: None,
        });
        let mut heat = vec![0.0; body.points.len()];
        let heats = |(start, end): (f64, f64)| {
            let end = if end.is_finite() { end } else { start };
            let pose = track.pose(0.5 * (start + end));
            let deposit = lattice
                .as_ref()
                .map(|body| depositor.add(body, &pose, &mut heat));
            deposit.is_some_and(|d| d.deposited > LEAST_FRACTION * d.asked)
        };
        if track.powered_moves().take(MOST_TRIED).any(heats) {
            return Ok(());
        }
        let Some(first) = first else {
            let message = "the power of the source is zero at all times";
            return Err(SetupError::value("toolpath", message, "a power above 0"));
        };
        let message = format!(
            "the source never heats the body: it is switched on at {} m, \
             but body `{}` spans {} to {} m",
            position(first),
            body.name,
            position(min),
            position(max),
        );
        Err(SetupError::value(
            "toolpath",
            message,
            "a path over the body",
        ))
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

#[cfg(test)]
mod tests;
