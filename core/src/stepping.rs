//! Steps in time: their sizes, what limits them, and what they cost.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::programme::Programme;
use crate::solver::NewtonReport;

/// A step in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Start, s.
    pub start: f64,
    /// Size, s; zero when couplers are applied for the initial state.
    pub size: f64,
    /// Nothing that couplers write has changed since the sub-step before: its couplers were
    /// not applied again, and sinks are as they were.
    pub repeated: bool,
}

impl Step {
    /// A step from `start` (s) of `size` (s).
    pub fn new(start: f64, size: f64) -> Step {
        Step {
            start,
            size,
            repeated: false,
        }
    }

    /// Middle of the step, s: where sources are evaluated, so that power which is linear in
    /// time is deposited exactly.
    pub fn middle(&self) -> f64 {
        self.start + 0.5 * self.size
    }

    /// End of the step, s: where prescribed values are evaluated.
    pub fn end(&self) -> f64 {
        self.start + self.size
    }
}

/// Step size of a physics: `"auto"` (the largest stable one with a safety factor) or seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StepSize {
    /// The largest stable step times the safety factor.
    #[default]
    Auto,
    /// A fixed step, s.
    Fixed(f64),
}

impl Serialize for StepSize {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            StepSize::Auto => serializer.serialize_str("auto"),
            StepSize::Fixed(step) => serializer.serialize_f64(*step),
        }
    }
}

/// By hand, because an untagged enum cannot say what it expected.
impl<'de> Deserialize<'de> for StepSize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct StepVisitor;
        impl de::Visitor<'_> for StepVisitor {
            type Value = StepSize;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"auto\" or a step above 0 s")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<StepSize, E> {
                match text {
                    "auto" => Ok(StepSize::Auto),
                    other => Err(E::invalid_value(de::Unexpected::Str(other), &self)),
                }
            }

            fn visit_f64<E: de::Error>(self, step: f64) -> Result<StepSize, E> {
                if step > 0.0 {
                    Ok(StepSize::Fixed(step))
                } else {
                    Err(E::invalid_value(de::Unexpected::Float(step), &self))
                }
            }

            fn visit_i64<E: de::Error>(self, step: i64) -> Result<StepSize, E> {
                self.visit_f64(step as f64)
            }

            fn visit_u64<E: de::Error>(self, step: u64) -> Result<StepSize, E> {
                self.visit_f64(step as f64)
            }
        }
        deserializer.deserialize_any(StepVisitor)
    }
}

impl JsonSchema for StepSize {
    fn schema_name() -> Cow<'static, str> {
        "StepSize".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schemars::json_schema!({ "oneOf": [{ "const": "auto" }, { "type": "number", "exclusiveMinimum": 0 }] })
    }
}

/// When a physics is advanced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// In every macro step.
    #[default]
    Step,
    /// Once for each log interval, just before the state is logged.
    Log,
}

/// How a plugin is stepped, declared at set-up ([`Setup::stepping`](crate::Setup::stepping)).
#[derive(Default)]
pub struct Stepping {
    /// Size of the (sub-)steps of a physics.
    pub step: StepSize,
    /// When a physics is advanced.
    pub update: Update,
    /// Whether the state of a physics after a step does not depend on that before, as that of a steady state; physics that exchange
    /// something and are all steady are advanced until their states agree. Of a coupler: its action depends on nothing but
    /// the fields that it reads, and need not be applied again while they stay as they are.
    pub is_steady: bool,
    /// Whether a coupler acts by the rate of a state, which a steady state does not have.
    pub acts_by_rate: bool,
    /// What the plugin does up to a certain time, such as its toolpath, as known at a time (s): a run that ends earlier warns.
    /// The events after that time are the programme of a plugin that states none.
    pub programme: Option<ProgrammeAt>,
}

impl Stepping {
    /// The programme as known at a time (s), of a plugin with these limits.
    pub fn programme_at(&self, time: f64, limits: impl Fn(f64) -> StepLimits) -> Option<Programme> {
        match &self.programme {
            Some(programme) => programme(time),
            None => Programme::of_events(time, |after| limits(after).next_event),
        }
    }
}

/// The programme of a plugin as known at a time (s).
pub type ProgrammeAt = Box<dyn Fn(f64) -> Option<Programme>>;

/// What limits the steps from a time on, beside stability.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepLimits {
    /// The next time at which the action of the plugin has a kink or a jump, s: macro steps end on it.
    pub next_event: Option<f64>,
    /// Largest macro step (s) that resolves the action of a coupler, such as a source that crosses a cell, or in which what
    /// others read from a physics is current enough; automatic macro steps respect it.
    pub longest: Option<f64>,
}

/// What one advance cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Solver iterations or stages.
    pub iterations: usize,
    /// Evaluations of rates or forces and products with their tangent: what solvers compare by.
    pub evaluations: usize,
}

impl Work {
    /// Stages of an explicit step, each with one evaluation.
    pub fn of_stages(stages: usize) -> Self {
        Work {
            iterations: stages,
            evaluations: stages,
        }
    }
}

impl std::ops::Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Work {
            iterations: self.iterations + other.iterations,
            evaluations: self.evaluations + other.evaluations,
        }
    }
}

impl From<NewtonReport> for Work {
    fn from(report: NewtonReport) -> Self {
        Work {
            iterations: report.krylov_iterations,
            evaluations: report.evaluations,
        }
    }
}
