//! A state that is read from the log of an earlier run.
//!
//! Between two logged states every field is interpolated linearly in time; before the first and after the
//! last state it is constant. Steps end on the logged times, so that the logged states are reproduced
//! exactly. One thermal run can so drive many mechanical runs; log it with `precision = "f64"` if seven
//! digits are not enough.
//!
//! The body must have the same points as the logged body.

use std::path::PathBuf;

use nalgebra::{Matrix3, Vector3};
use perimelt_core::log::{CloudField, Log, LogError, LoggedCloud};
use perimelt_core::{Key, Physics, Problem, RunError, Setup, SetupError, Step, Work, World, Write};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fields read from the log of an earlier run, interpolated in time.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Replay {
    /// Log of the earlier run; a relative path starts at the case file's folder.
    pub log: PathBuf,
    /// Body that receives the fields; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Body in the log; the same name when left out.
    #[serde(default)]
    pub logged_body: Option<String>,
    /// Fields to read, such as `["temperature"]`.
    pub fields: Vec<String>,
    #[serde(skip)]
    #[schemars(skip)]
    run: Option<Run>,
}

struct Run {
    log: Log,
    body: String,
    fields: Vec<ReplayedField>,
    window: Option<Window>,
}

impl std::fmt::Debug for Run {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Run")
            .field("log", &self.log.path())
            .finish_non_exhaustive()
    }
}

/// The two logged states around the current time.
struct Window {
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
    #[error("body `{body}` of the log holds no state")]
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

impl Run {
    /// Reads the states around `time` (s).
    fn load(&mut self, time: f64) -> Result<(), LogError> {
        let times = self.log.times(&self.body);
        let after = times
            .partition_point(|t| *t < time)
            .clamp(1, times.len().max(2) - 1);
        let (first, second) = (after - 1, after.min(times.len() - 1));
        if self
            .window
            .as_ref()
            .is_none_or(|window| window.first != first)
        {
            let older = match self.window.take() {
                Some(window) if window.first + 1 == first => window.newer,
                _ => self.log.cloud(&self.body, first)?,
            };
            let newer = self.log.cloud(&self.body, second)?;
            self.window = Some(Window {
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
        let Window { older, newer, .. } = self.window.as_ref().expect("loaded above");
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

fn find<'a>(cloud: &'a LoggedCloud, name: &str) -> Option<&'a CloudField> {
    cloud.fields.iter().find(|f| f.name == name)
}

fn values<'a>(cloud: &'a LoggedCloud, name: &str) -> &'a [f64] {
    find(cloud, name).map_or(&[], |f| &f.values)
}

#[typetag::serialize(name = "replay")]
impl Physics for Replay {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let path = setup.path(&self.log.to_string_lossy());
        let log = Log::open(path).map_err(|e| SetupError::other("log", e))?;
        let here = setup.body(body);
        let name = self
            .logged_body
            .clone()
            .unwrap_or_else(|| here.name.clone());
        if !log.bodies().any(|b| b == name) {
            let known = log.bodies().map(str::to_string).collect();
            let key = if self.logged_body.is_some() {
                "logged_body"
            } else {
                "log"
            };
            return Err(SetupError::new(
                key,
                Problem::UnknownName {
                    what: "logged body",
                    name,
                    known,
                },
            ));
        }
        if log.times(&name).is_empty() {
            return Err(SetupError::other("log", Misfit::Empty { body: name }));
        }
        let first = log
            .cloud(&name, 0)
            .map_err(|e| SetupError::other("log", e))?;
        let positions = &here.points.position;
        if first.positions.len() != positions.len() {
            let misfit = Misfit::Points {
                logged: first.positions.len(),
                here: positions.len(),
            };
            return Err(SetupError::other("log", misfit));
        }
        // rounding to single precision and the displacement of the first state are far below a quarter of a cell
        let spacings = &here.points.spacing;
        let pairs = first.positions.iter().zip(positions).zip(spacings);
        for (point, ((logged, here), spacing)) in pairs.enumerate() {
            if (Vector3::from(*logged) - here).norm() > 0.25 * spacing {
                let misfit = Misfit::Position {
                    point,
                    logged: *logged,
                    here: (*here).into(),
                };
                return Err(SetupError::other("log", misfit));
            }
        }
        let mut fields = Vec::new();
        for field in &self.fields {
            let Some(logged) = find(&first, field) else {
                let known = first.fields.iter().map(|f| f.name.clone()).collect();
                let problem = Problem::UnknownName {
                    what: "logged field",
                    name: field.clone(),
                    known,
                };
                return Err(SetupError::new("fields", problem));
            };
            let (name, unit) = (field.clone(), logged.unit.clone());
            fields.push(match logged.components {
                1 => ReplayedField::Scalar(name.clone(), setup.own(body, &Key::named(name, unit))?),
                3 => ReplayedField::Vector(name.clone(), setup.own(body, &Key::named(name, unit))?),
                _ => ReplayedField::Tensor(name.clone(), setup.own(body, &Key::named(name, unit))?),
            });
        }
        self.run = Some(Run {
            log,
            body: name,
            fields,
            window: None,
        });
        Ok(())
    }

    fn start(&mut self, world: &World) -> Result<(), RunError> {
        self.write(world, 0.0)
    }

    fn next_event(&self, after: f64) -> Option<f64> {
        let run = self.run.as_ref()?;
        run.log
            .times(&run.body)
            .iter()
            .copied()
            .find(|t| *t > after)
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        self.write(world, step.end())?;
        Ok(Work::default())
    }
}

impl Replay {
    fn write(&mut self, world: &World, time: f64) -> Result<(), RunError> {
        let run = self.run.as_mut().expect("prepared before the start");
        run.write(world, time).map_err(|cause| RunError::Plugin {
            plugin: "replay".into(),
            time,
            cause: cause.into(),
        })
    }
}

perimelt_core::register_physics!("replay", Replay);

#[cfg(test)]
mod tests;
