//! A heat source that moves along a toolpath, generic over its shape.

use std::borrow::Cow;

use nalgebra::Vector3;
use perimelt_core::{Body, Coupler, Report, RunError, Setup, SetupError, Step, World, Write, keys};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::account::Account;
use super::keys::{Keys, read, schema};
use super::lattice::{LatticeBody, grid};
use crate::source::{self, CellGrid, Cells, Depositor, HeatedSurface, Source};
use crate::toolpath::{Toolpath, Track};

/// Fraction of the shortest length that the source may move in a step.
const STEP_FRACTION: f64 = 0.25;

/// Powers of welding sources are below this, W.
const STRONGEST: f64 = 2e5;

/// The power density of a [`MovingSource`].
pub trait SourceShape: Clone {
    /// As a variant of [`Source`].
    fn source(&self) -> Source;
    /// Its shortest length on the heated face, m; zero for a point.
    fn length(&self) -> f64;
    /// The face that it heats.
    fn surface(&self) -> HeatedSurface;
}

macro_rules! shape {
    ($name:ident, |$shape:ident| $length:expr) => {
        impl SourceShape for source::$name {
            fn source(&self) -> Source {
                Source::$name(self.clone())
            }
            fn length(&self) -> f64 {
                let $shape = self;
                $length
            }
            fn surface(&self) -> HeatedSurface {
                self.heated_surface
            }
        }
    };
}

shape!(Goldak, |s| s
    .front_length
    .min(s.rear_length)
    .min(s.half_width));
shape!(SemiEllipsoid, |s| s.half_length.min(s.half_width));
shape!(Gaussian, |s| s.sigma);
shape!(SuperGaussian, |s| s.radius);
shape!(Point, |_s| 0.0);

/// A heat source of shape `S` on a toolpath.
pub struct MovingSource<S> {
    /// Body; may be left out when there is one only.
    pub body: Option<String>,
    /// Where the source is, which way it travels and how strong it is.
    pub toolpath: Toolpath,
    /// Its power density.
    pub shape: S,
    prepared: Option<MovingSourceState>,
    account: Account,
}

/// Handles, the lattice and the toolpath in time.
struct MovingSourceState {
    body: usize,
    grid: CellGrid,
    track: Track,
    depositor: Depositor,
    heat_source: Write<f64>,
    /// Longest step while the source is on, s.
    step_limit: Option<f64>,
    /// At the end of the last step, m.
    position: Vector3<f64>,
}

impl<S: SourceShape> MovingSource<S> {
    fn track(&self, setup: &Setup<'_>) -> Result<Track, SetupError> {
        let kind = self.toolpath.kind();
        let power = self.shape.source().power();
        if let Some(power) = power.filter(|p| !(p.is_finite() && *p >= 0.0)) {
            let message = format!("`power` of the heat source is {power}");
            return Err(SetupError::value(
                "power",
                message,
                "a finite number, zero or greater, W",
            ));
        }
        self.toolpath
            .track(power, &setup.path(""))
            .map_err(|e| SetupError::other(format!("toolpath.{kind}.{}", e.key()), e))
    }

    fn prepare_source(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let index = setup.find_body(self.body.as_deref())?;
        let track = self.track(setup)?;
        let body = setup.body(index);
        if body.dimension == 1 {
            let message = "a moving source cannot heat a 1D body";
            return Err(SetupError::value("body", message, "a 2D or 3D body"));
        }
        let grid = grid(body);
        let fault = |e: source::SourceError| SetupError::other(e.key(), e);
        let depositor = Depositor::new(&self.shape.source(), &grid).map_err(fault)?;
        if body.lattice().is_none() {
            depositor.check_cells().map_err(fault)?;
        }
        let length = self.shape.length().max(body.finest_spacing());
        self.check_path(body, &track, 2.0 * length)?;
        let speed = track.fastest();
        self.warn_of_size(setup, index);
        setup.follow_activity(index);
        self.prepared = Some(MovingSourceState {
            body: index,
            grid,
            depositor,
            heat_source: setup.add(index, &keys::HEAT_SOURCE)?,
            step_limit: (speed > 0.0).then(|| STEP_FRACTION * length / speed),
            position: track.pose(track.start()).position,
            track,
        });
        Ok(())
    }

    /// Tells of a source that is finer than the points that it heats, and of a power in other units.
    fn warn_of_size(&self, setup: &mut Setup<'_>, body: usize) {
        let (length, spacing) = (self.shape.length(), setup.body(body).finest_spacing());
        if length > 0.0 && length < spacing {
            setup.warn(format!(
                "the shortest length of the source is {length:.2e} m, finer than the spacing {spacing:.2e} m: it heats \
                 single cells"
            ));
        }
        let power = self.shape.source().power();
        if let Some(power) = power.filter(|power| *power > STRONGEST) {
            setup.warn(format!(
                "a power of {power:.3e} W is unusual; powers are in watts"
            ));
        }
    }

    /// Refuses a toolpath on which the source is never on within `margin` (m) of the body's box.
    fn check_path(&self, body: &Body, track: &Track, margin: f64) -> Result<(), SetupError> {
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
        let Some(first) = first else {
            let message = "the power of the source is zero at all times";
            return Err(SetupError::value("toolpath", message, "a power above 0"));
        };
        let message = format!(
            "the source never heats the body: it is switched on at {:?} m, \
             but body `{}` spans {:?} to {:?} m",
            <[f64; 3]>::from(first),
            body.name,
            <[f64; 3]>::from(min),
            <[f64; 3]>::from(max),
        );
        Err(SetupError::value(
            "toolpath",
            message,
            "a path over the body",
        ))
    }

    fn apply_source(&mut self, world: &World, step: Step) {
        let p = self.prepared.as_mut().expect("prepared before the run");
        let body = world.body(p.body);
        let pose = p.track.pose(step.middle());
        let mut heat_source = world.write(p.heat_source);
        let deposit = match Cells::of(body, p.grid) {
            Some(cells) => (p.depositor).add_to_cells(&cells, &pose, &mut heat_source),
            None => {
                let body = LatticeBody {
                    body,
                    grid: p.grid,
                    activity: world.activity(p.body),
                };
                p.depositor.add(&body, &pose, &mut heat_source)
            }
        };
        self.account.book(&deposit, step.size, pose.speed);
        // the next step is limited if the next move has power
        let until = p.track.next_event(step.end()).unwrap_or(f64::INFINITY);
        self.account.is_on = p.track.energy(step.end(), until) > 0.0;
        p.position = p.track.pose(step.end()).position;
    }

    fn report_source(&self) -> Vec<Report> {
        let position = self.prepared.as_ref().map(|p| p.position);
        let component = |(axis, name): (usize, &str)| Report {
            name: format!("position.{name}"),
            unit: "m".into(),
            value: position.map_or(0.0, |p| p[axis]),
        };
        let mut reports = self.account.report();
        reports.extend(["x", "y", "z"].into_iter().enumerate().map(component));
        reports
    }
}

impl<S: Serialize + Clone> Serialize for MovingSource<S> {
    fn serialize<T: Serializer>(&self, serializer: T) -> Result<T::Ok, T::Error> {
        let keys = Keys {
            body: self.body.clone(),
            toolpath: Some(self.toolpath.clone()),
            shape: self.shape.clone(),
        };
        keys.serialize(serializer)
    }
}

impl<'de, S: Deserialize<'de>> Deserialize<'de> for MovingSource<S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let keys = read(deserializer, true)?;
        Ok(MovingSource {
            body: keys.body,
            toolpath: keys.toolpath.expect("the reader asks for it"),
            shape: keys.shape,
            prepared: None,
            account: Account::default(),
        })
    }
}

impl<S: JsonSchema> JsonSchema for MovingSource<S> {
    fn schema_name() -> Cow<'static, str> {
        S::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        schema::<S>(generator, true)
    }
}

macro_rules! moving_source {
    ($name:literal, $shape:ident) => {
        #[typetag::serde(name = $name)]
        impl Coupler for MovingSource<source::$shape> {
            fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
                self.prepare_source(setup)
            }

            fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
                self.apply_source(world, step);
                Ok(())
            }

            fn next_event(&self, after: f64) -> Option<f64> {
                self.prepared.as_ref()?.track.next_event(after)
            }

            fn step_limit(&self) -> Option<f64> {
                let limit = self.prepared.as_ref()?.step_limit;
                limit.filter(|_| self.account.is_on)
            }

            fn report(&self) -> Vec<Report> {
                self.report_source()
            }

            fn save(&self) -> Box<dyn erased_serde::Serialize + '_> {
                Box::new(self.account)
            }

            fn load(
                &mut self,
                state: &mut dyn erased_serde::Deserializer<'_>,
            ) -> Result<(), erased_serde::Error> {
                self.account = Account::deserialize(state)?;
                Ok(())
            }
        }

        perimelt_core::register_coupler!($name, MovingSource<source::$shape>);
    };
}

moving_source!("goldak", Goldak);
moving_source!("ellipsoid", SemiEllipsoid);
moving_source!("gaussian_source", Gaussian);
moving_source!("point_source", Point);
moving_source!("super_gaussian", SuperGaussian);

#[cfg(test)]
mod tests;
