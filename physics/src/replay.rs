//! A state that is read from the log of an earlier run, or from files of another program.
//!
//! Between two logged states every field is interpolated linearly in time; before the first and after the
//! last state it is constant. Steps end on the logged times, so that the logged states are reproduced
//! exactly. One thermal run can thus drive many mechanical runs; log it with `precision = "f64"` if seven
//! digits are not enough.
//!
//! The body must have the same points as the logged body.
//!
//! `values` gives scalar fields in place of a log: by formulas, or by files of other programs and of measurements, a single file or one for
//! each of several times; values are interpolated between the points of a file. Steps end on these times.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use perimelt_core::in_time::earlier;
use perimelt_core::log::{CloudField, Log, LogError, LoggedCloud};
use perimelt_core::{
    Body, GivenValue, InSpace, Key, Physics, Placed, Prepared, RunError, RunningPhysics, Setup,
    SetupError, Step, StepLimits, Stepping, Work, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fields read from the log of an earlier run or from files of another program, interpolated in time.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Replay {
    /// Log of the earlier run; a relative path starts at the case file's folder. Or give `values`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log: Option<PathBuf>,
    /// Body that receives the fields; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Body in the log; the same name when left out.
    #[serde(default)]
    pub logged_body: Option<String>,
    /// Fields to read from the log, such as `["temperature"]`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<String>,
    /// Scalar fields without a log, such as `values.temperature = { time = [0, 5], file = ["a.csv", "b.vtu"] }`,
    /// `values.temperature = { file = "run.pvd" }` or `values.temperature = "300 + 200 * x * t"`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, InSpace>,
}

/// A field without a log.
#[derive(Debug)]
struct PlacedField {
    field: Write<f64>,
    values: Placed,
}

/// Fields that are read from a log.
struct ReplayedLog {
    log: Log,
    body: String,
    fields: Vec<ReplayedField>,
    interval: Option<LoggedInterval>,
}

/// States that are replayed.
enum RunningReplay {
    Log(Box<ReplayedLog>),
    Values(Vec<PlacedField>),
}

/// The two logged states around the current time.
struct LoggedInterval {
    /// Index of the older state in the log.
    first: usize,
    older: LoggedCloud,
    newer: LoggedCloud,
}

/// A field of the body that is read from the log, with its name.
enum ReplayedField {
    Scalar(String, Write<f64>),
    Vector(String, Write<Vector3<f64>>),
    Tensor(String, Write<Matrix3<f64>>),
}

impl ReplayedField {
    fn name(&self) -> &str {
        let (Self::Scalar(name, _) | Self::Vector(name, _) | Self::Tensor(name, _)) = self;
        name
    }
}

/// Differences between a logged body and the body that receives its fields.
#[derive(Debug, thiserror::Error)]
enum Misfit {
    #[error("body `{body}` of the log has no states")]
    Empty { body: String },
    #[error(
        "the logged body has {logged} points, this one {here}: use the shape and spacing of the logged run"
    )]
    Points { logged: usize, here: usize },
    #[error(
        "point {point} lies at {logged:?} m in the log and at {here:?} m here: use the shape and spacing of the logged run"
    )]
    Position {
        point: usize,
        logged: [f64; 3],
        here: [f64; 3],
    },
}

impl ReplayedLog {
    /// Reads the states around `time` (s).
    fn load(&mut self, time: f64) -> Result<(), LogError> {
        let times = self.log.times(&self.body);
        let after = times
            .partition_point(|t| *t < time)
            .clamp(1, times.len().max(2) - 1);
        let (first, second) = (after - 1, after.min(times.len() - 1));
        if self
            .interval
            .as_ref()
            .is_none_or(|interval| interval.first != first)
        {
            let older = match self.interval.take() {
                Some(interval) if interval.first + 1 == first => interval.newer,
                _ => self.log.cloud(&self.body, first)?,
            };
            let newer = self.log.cloud(&self.body, second)?;
            self.interval = Some(LoggedInterval {
                first,
                older,
                newer,
            });
        }
        Ok(())
    }

    /// Writes the fields at `time` (s).
    fn write(&mut self, world: &World, time: f64) -> Result<(), LogError> {
        self.load(time)?;
        let LoggedInterval { older, newer, .. } = self.interval.as_ref().expect("loaded above");
        let span = newer.time - older.time;
        let fraction = if span > 0.0 {
            ((time - older.time) / span).clamp(0.0, 1.0)
        } else {
            0.0
        };
        for field in &self.fields {
            let name = field.name();
            let (a, b) = (values(older, name), values(newer, name));
            let mix = |out: &mut [f64]| {
                for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
                    // exact at the newer state, where a + (b - a) may differ by rounding
                    *out = if fraction == 1.0 {
                        *b
                    } else {
                        a + fraction * (b - a)
                    };
                }
            };
            match field {
                ReplayedField::Scalar(_, handle) => mix(&mut world.write(*handle)),
                ReplayedField::Vector(_, handle) => {
                    mix(bytemuck::cast_slice_mut(&mut world.write(*handle)))
                }
                ReplayedField::Tensor(_, handle) => {
                    mix(bytemuck::cast_slice_mut(&mut world.write(*handle)))
                }
            }
        }
        Ok(())
    }
}

/// Compares the points of the first logged state with those of the body.
fn check_points(first: &LoggedCloud, body: &Body) -> Result<(), Misfit> {
    let positions = &body.points.position;
    if first.positions.len() != positions.len() {
        return Err(Misfit::Points {
            logged: first.positions.len(),
            here: positions.len(),
        });
    }
    // rounding to single precision and the displacement of the first state are far below a quarter of a cell
    let spacings = &body.points.spacing;
    let pairs = first.positions.iter().zip(positions).zip(spacings);
    for (point, ((logged, here), spacing)) in pairs.enumerate() {
        if (Vector3::from(*logged) - here).norm() > 0.25 * spacing {
            return Err(Misfit::Position {
                point,
                logged: *logged,
                here: (*here).into(),
            });
        }
    }
    Ok(())
}

fn find<'a>(cloud: &'a LoggedCloud, name: &str) -> Option<&'a CloudField> {
    cloud.fields.iter().find(|f| f.name == name)
}

fn values<'a>(cloud: &'a LoggedCloud, name: &str) -> &'a [f64] {
    find(cloud, name).map_or(&[], |f| &f.values)
}

#[typetag::serialize(name = "replay")]
impl Physics for Replay {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        let body = setup.find_body(self.body.as_deref())?;
        setup.stepping(Stepping {
            programme: Some(Box::new(|_| None)),
            ..Stepping::default()
        });
        match (&self.log, self.values.is_empty()) {
            (Some(log), true) if !self.fields.is_empty() => {
                Ok(Box::new(self.prepare_log(setup, body, log)?))
            }
            (None, false) if self.fields.is_empty() && self.logged_body.is_none() => {
                Ok(Box::new(self.prepare_values(setup, body)?))
            }
            (Some(_), true) => Err(SetupError::value(
                "fields",
                "no field is read from the log",
                "fields such as `[\"temperature\"]`",
            )),
            _ => {
                let message = "`replay` needs either a log or values";
                let expected = "either `log` with `fields`, or `values`";
                Err(SetupError::value("", message, expected))
            }
        }
    }
}

impl RunningPhysics for RunningReplay {
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        self.write(world, 0.0)
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        let next_event = match self {
            RunningReplay::Log(run) => {
                let mut times = run.log.times(&run.body).iter().copied();
                times.find(|t| *t > time)
            }
            RunningReplay::Values(fields) => {
                let next = fields.iter().map(|p| p.values.next_event(time));
                next.fold(None, earlier)
            }
        };
        StepLimits {
            next_event,
            longest: None,
        }
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        self.write(world, step.end())?;
        Ok(Work::default())
    }
}

impl RunningReplay {
    fn write(&mut self, world: &World, time: f64) -> Result<(), RunError> {
        match self {
            RunningReplay::Log(run) => run.write(world, time).map_err(|cause| RunError::Plugin {
                plugin: "replay".into(),
                time,
                cause: cause.into(),
            }),
            RunningReplay::Values(fields) => {
                for PlacedField { field, values } in fields {
                    let values = values.at(time).map_err(|e| e.during("replay", time))?;
                    world.write(*field).copy_from_slice(values);
                }
                Ok(())
            }
        }
    }
}

impl Replay {
    /// Opens the log and finds its fields.
    fn prepare_log(
        &self,
        setup: &mut Setup<'_>,
        body: usize,
        log: &Path,
    ) -> Result<RunningReplay, SetupError> {
        let path = setup.path(&log.to_string_lossy());
        let log = Log::open(path).map_err(|e| SetupError::other("log", e))?;
        let here = setup.body(body);
        let name = self
            .logged_body
            .clone()
            .unwrap_or_else(|| here.name.clone());
        if !log.bodies().any(|b| b == name) {
            let key = if self.logged_body.is_some() {
                "logged_body"
            } else {
                "log"
            };
            return Err(SetupError::unknown(key, "logged body", &name, log.bodies()));
        }
        if log.times(&name).is_empty() {
            return Err(SetupError::other("log", Misfit::Empty { body: name }));
        }
        let first = log
            .cloud(&name, 0)
            .map_err(|e| SetupError::other("log", e))?;
        check_points(&first, here).map_err(|misfit| SetupError::other("log", misfit))?;
        let mut fields = Vec::new();
        for field in &self.fields {
            let Some(logged) = find(&first, field) else {
                let known = first.fields.iter().map(|f| &f.name);
                return Err(SetupError::unknown("fields", "logged field", field, known));
            };
            let (name, unit) = (field.clone(), logged.unit.clone());
            fields.push(match logged.components {
                1 => ReplayedField::Scalar(
                    name.clone(),
                    setup.own_derived(body, &Key::named(name, unit))?,
                ),
                3 => ReplayedField::Vector(
                    name.clone(),
                    setup.own_derived(body, &Key::named(name, unit))?,
                ),
                _ => ReplayedField::Tensor(
                    name.clone(),
                    setup.own_derived(body, &Key::named(name, unit))?,
                ),
            });
        }
        Ok(RunningReplay::Log(Box::new(ReplayedLog {
            log,
            body: name,
            fields,
            interval: None,
        })))
    }

    /// Prepares the fields that are given by `values`.
    fn prepare_values(
        &self,
        setup: &mut Setup<'_>,
        body: usize,
    ) -> Result<RunningReplay, SetupError> {
        let mut fields = Vec::new();
        for (name, value) in &self.values {
            let key = format!("values.{name}");
            let Some((_, unit, _)) = keys::ALL.iter().find(|(known, ..)| known == name) else {
                let known = keys::ALL.iter().map(|(name, ..)| *name);
                return Err(SetupError::unknown(key, "field", name, known));
            };
            let positions = setup.body(body).points.position.to_vec();
            let values = setup.placed(
                body,
                GivenValue {
                    key: &key,
                    value,
                    column: name,
                },
                positions,
            )?;
            let field = setup.own_derived(body, &Key::named(name.clone(), unit.to_string()))?;
            fields.push(PlacedField { field, values });
        }
        Ok(RunningReplay::Values(fields))
    }
}

perimelt_core::register_physics!("replay", Replay, supports: [Motion, Flow]);

#[cfg(test)]
mod tests;
