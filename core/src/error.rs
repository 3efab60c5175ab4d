//! What can go wrong at set-up and during a run.

use crate::body::{BodyError, HorizonError};
use crate::family::FamilyError;
use crate::text::{number, position};

/// Boxed cause of an error, for plugins with errors of their own.
pub type Cause = Box<dyn std::error::Error + Send + Sync>;

/// A mistake found while a plugin is prepared. `key` is the key of the plugin's table in
/// the case file that the user has to look at (dots for nested keys), empty for the table.
#[derive(Debug, thiserror::Error)]
#[error("{problem}")]
pub struct SetupError {
    /// Key in the plugin's table, such as `region` or `toolpath.speed`.
    pub key: String,
    /// What is wrong.
    pub problem: Problem,
}

/// What is wrong at set-up.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// A name that nothing has.
    #[error("no {what} is called `{name}`{}", suggestion(name, known))]
    UnknownName {
        /// What was looked for: body, region, material ...
        what: &'static str,
        /// The name.
        name: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// `body` was left out although there are several.
    #[error("`body` is needed, because the case has several bodies: {}", .0.join(", "))]
    WhichBody(Vec<String>),
    /// A region that selects no point.
    #[error(
        "region `{region}` holds no point of body `{body}`: the body spans {} to {} m with points every {} m",
        position(*from), position(*to), number(*spacing, 5)
    )]
    EmptyRegion {
        /// The region.
        region: String,
        /// The body.
        body: String,
        /// Lower corner, m.
        from: [f64; 3],
        /// Upper corner, m.
        to: [f64; 3],
        /// Spacing, m.
        spacing: f64,
    },
    /// A material lacks a property.
    #[error(
        "material `{material}` of body `{body}` has no `{property}`; give it under `[materials.{material}]`"
    )]
    MissingProperty {
        /// The material.
        material: String,
        /// The body.
        body: String,
        /// The property.
        property: String,
    },
    /// A field that is read but never written.
    #[error(
        "field `{field}` of body `{body}` is read by `{plugin}`, but nobody provides it{}",
        providers(provided)
    )]
    NobodyProvides {
        /// The field.
        field: String,
        /// The body.
        body: String,
        /// The reader.
        plugin: String,
        /// Fields that are provided on that body.
        provided: Vec<String>,
    },
    /// A field that is added to but never consumed.
    #[error("`{plugin}` adds to field `{field}` of body `{body}`, but no physics consumes it")]
    NobodyConsumes {
        /// The field.
        field: String,
        /// The body.
        body: String,
        /// The adder.
        plugin: String,
    },
    /// Two plugins own or write a field.
    #[error(
        "field `{field}` of body `{body}` is already written by `{first}`: remove one of the two"
    )]
    TwoWriters {
        /// The field.
        field: String,
        /// The body.
        body: String,
        /// The plugin that came first.
        first: String,
    },
    /// A field known with another type.
    #[error("field `{field}` is used with {asked} components here and {present} elsewhere")]
    FieldType {
        /// The field.
        field: String,
        /// Components asked for.
        asked: usize,
        /// Components it has.
        present: usize,
    },
    /// Couplers that wait for each other.
    #[error("these couplers wait for each other: {}", .0.join(" -> "))]
    Cycle(Vec<String>),
    /// A fixed step above the stable one.
    #[error(
        "the step {} s of `{physics}` is above its largest stable step {} s; use `step = \"auto\"` or a smaller value",
        number(*fixed, 5), number(*stable, 5)
    )]
    UnstableStep {
        /// The physics.
        physics: String,
        /// As asked for, s.
        fixed: f64,
        /// Largest stable one, s.
        stable: f64,
    },
    /// A fixed step above the stable one of a coupler.
    #[error(
        "the step {} s of `{physics}` is above the largest stable step {} s of `{coupler}`; use `step = \"auto\"` or a smaller value",
        number(*fixed, 5), number(*stable, 5)
    )]
    UnstableExchange {
        /// The physics.
        physics: String,
        /// As asked for, s.
        fixed: f64,
        /// The coupler.
        coupler: String,
        /// Its largest stable step, s.
        stable: f64,
    },
    /// A value that does not make sense.
    #[error("{message}; expected {expected}")]
    Value {
        /// What is wrong.
        message: String,
        /// What was expected.
        expected: String,
    },
    /// A family that cannot be built.
    #[error(transparent)]
    Family(#[from] FamilyError),
    /// A body that cannot be built.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// A plugin's own reason.
    #[error(transparent)]
    Other(Cause),
}

impl SetupError {
    /// A problem at `key` of the plugin's table.
    pub fn new(key: impl Into<String>, problem: impl Into<Problem>) -> Self {
        SetupError {
            key: key.into(),
            problem: problem.into(),
        }
    }

    /// A value at `key` that does not make sense.
    pub fn value(
        key: impl Into<String>,
        message: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::new(
            key,
            Problem::Value {
                message: message.into(),
                expected: expected.into(),
            },
        )
    }

    /// A plugin's own error at `key`.
    pub fn other(key: impl Into<String>, cause: impl Into<Cause>) -> Self {
        Self::new(key, Problem::Other(cause.into()))
    }
}

impl From<HorizonError> for SetupError {
    fn from(error: HorizonError) -> Self {
        SetupError::value("horizon", error.message, error.expected)
    }
}

/// What stops a run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Values that are not finite or grow without bound.
    #[error(
        "{physics} blew up: field `{field}` is {} at point {point} ({}) m of body `{body}` \
         at t = {} s; the step was {} s{}",
        number(*value, 5), position.map(|x| number(x, 5)).join(", "), number(*time, 7), number(*step, 5),
        stable_hint(*step, *stable)
    )]
    BlowUp {
        /// The physics.
        physics: String,
        /// The field.
        field: String,
        /// The body.
        body: String,
        /// The point.
        point: usize,
        /// Its reference position, m.
        position: [f64; 3],
        /// The value found there.
        value: f64,
        /// Simulated time, s.
        time: f64,
        /// Step, s.
        step: f64,
        /// Largest stable step, s, if the physics has one.
        stable: Option<f64>,
    },
    /// A step so small that the run cannot end.
    #[error(
        "{physics} asks for steps of {} s at t = {} s: that would be {} more steps",
        number(*step, 3), number(*time, 7), number(*count, 3)
    )]
    StepTooSmall {
        /// The physics.
        physics: String,
        /// Step, s.
        step: f64,
        /// Simulated time, s.
        time: f64,
        /// Steps left.
        count: f64,
    },
    /// A plugin's own reason.
    #[error("{plugin} failed at t = {} s: {cause}", number(*time, 7))]
    Plugin {
        /// The plugin.
        plugin: String,
        /// Simulated time, s.
        time: f64,
        /// Its reason.
        cause: Cause,
    },
    /// Strong coupling that does not converge.
    #[error(
        "the coupling did not converge at t = {} s: after {passes} passes the state still changed by {change:.3e}, the tolerance is {tolerance:e}; \
         allow more passes, use smaller steps, or set `iteration.unconverged = \"continue\"`",
        number(*time, 7)
    )]
    Unconverged {
        /// Passes taken.
        passes: usize,
        /// Largest relative change in the last pass.
        change: f64,
        /// As asked for.
        tolerance: f64,
        /// Simulated time, s.
        time: f64,
    },
    /// A checkpoint that does not fit the case.
    #[error("the checkpoint does not fit the case: {0}")]
    Checkpoint(String),
}

/// The known name closest to `name`, when it is close enough to be a slip of the finger.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let limit = |length: usize| (length / 3).max(1).min(length - 1);
    known
        .into_iter()
        .map(|k| (strsim::damerau_levenshtein(name, k), k))
        .filter(|(distance, k)| *distance <= limit(k.len().max(name.len()).max(1)))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, k)| k)
}

fn suggestion(name: &str, known: &[String]) -> String {
    match nearest(name, known.iter().map(String::as_str)) {
        Some(close) => format!("; did you mean `{close}`?"),
        None if known.is_empty() => "; there is none".to_string(),
        None => format!("; known: {}", known.join(", ")),
    }
}

fn providers(provided: &[String]) -> String {
    if provided.is_empty() {
        String::new()
    } else {
        format!("; provided are: {}", provided.join(", "))
    }
}

fn stable_hint(step: f64, stable: Option<f64>) -> String {
    match stable {
        Some(stable) if step <= stable => format!(
            ", below the largest stable one of {} s: look at the loads and the material",
            number(stable, 5)
        ),
        Some(stable) => format!(", the largest stable one {} s", number(stable, 5)),
        None => String::new(),
    }
}
