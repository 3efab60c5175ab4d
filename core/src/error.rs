//! What can go wrong at set-up and during a run.

use std::fmt;

use crate::body::{BodyError, HorizonError};
pub use crate::explanation::{Explanation, nearest};
use crate::family::FamilyError;
use crate::in_time::WrongValue;
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
#[derive(Debug)]
pub enum Problem {
    /// A name that nothing has.
    UnknownName {
        /// What was looked for: body, region, material ...
        what: &'static str,
        /// The name.
        name: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// `body` was left out although there are several.
    WhichBody(Vec<String>),
    /// A region that selects no point.
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
    MissingProperty {
        /// The material.
        material: String,
        /// The body.
        body: String,
        /// The property.
        property: String,
    },
    /// A material lacks a constant of a law.
    MissingConstant {
        /// The law, such as `flow.j2`.
        law: String,
        /// The material.
        material: String,
        /// The body.
        body: String,
        /// The property.
        property: String,
    },
    /// A field that is read but never written.
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
    NobodyConsumes {
        /// The field.
        field: String,
        /// The body.
        body: String,
        /// The adder.
        plugin: String,
    },
    /// Two plugins own or write a field.
    TwoWriters {
        /// The field.
        field: String,
        /// The body.
        body: String,
        /// The plugin that came first.
        first: String,
    },
    /// A field known with another type.
    FieldType {
        /// The field.
        field: String,
        /// Components asked for.
        asked: usize,
        /// Components it has.
        present: usize,
    },
    /// Couplers that wait for each other.
    Cycle(Vec<String>),
    /// A fixed step above the stable one.
    UnstableStep {
        /// The physics.
        physics: String,
        /// The value in the case, s.
        fixed: f64,
        /// Largest stable one, s.
        stable: f64,
    },
    /// A fixed step above the stable one of a coupler.
    UnstableExchange {
        /// The physics.
        physics: String,
        /// The value in the case, s.
        fixed: f64,
        /// The coupler.
        coupler: String,
        /// Its largest stable step, s.
        stable: f64,
    },
    /// A value that does not make sense.
    Value {
        /// What is wrong.
        message: String,
        /// What was expected.
        expected: String,
    },
    /// A family that cannot be built.
    Family(FamilyError),
    /// A body that cannot be built.
    Body(BodyError),
    /// A plugin's own reason.
    Other(Cause),
}

impl Problem {
    /// The problem in words.
    pub fn explain(&self) -> Explanation {
        match self {
            Problem::UnknownName { what, name, known } => {
                Explanation::new(format!("no {what} is called `{name}`")).suggest(name, known)
            }
            Problem::WhichBody(bodies) => Explanation::new(format!(
                "`body` is needed, because the case has several bodies: {}",
                bodies.join(", ")
            )),
            Problem::EmptyRegion {
                region,
                body,
                from,
                to,
                spacing,
            } => empty_region(region, body, [*from, *to], *spacing),
            Problem::MissingProperty {
                material,
                body,
                property,
            } => missing(material, body, property, ""),
            Problem::MissingConstant {
                law,
                material,
                body,
                property,
            } => missing(material, body, property, &format!(", which `{law}` needs")),
            Problem::NobodyProvides {
                field,
                body,
                plugin,
                provided,
            } => not_provided(plugin, field, body, provided),
            Problem::NobodyConsumes {
                field,
                body,
                plugin,
            } => Explanation::new(format!(
                "`{plugin}` adds to field `{field}` of body `{body}`, but no physics consumes it"
            )),
            Problem::TwoWriters { field, body, first } => Explanation::new(format!(
                "field `{field}` of body `{body}` is already written by `{first}`: remove one of the two"
            )),
            Problem::FieldType {
                field,
                asked,
                present,
            } => Explanation::new(format!(
                "field `{field}` is used with {asked} components here and {present} elsewhere"
            )),
            Problem::Cycle(couplers) => Explanation::new(format!(
                "cyclic dependency between couplers: {}",
                couplers.join(" -> ")
            )),
            Problem::UnstableStep {
                physics,
                fixed,
                stable,
            } => unstable(physics, *fixed, *stable, None),
            Problem::UnstableExchange {
                physics,
                fixed,
                coupler,
                stable,
            } => unstable(physics, *fixed, *stable, Some(coupler)),
            Problem::Value { message, expected } => {
                Explanation::new(message.as_str()).expected(expected)
            }
            Problem::Family(error) => error.explain(),
            Problem::Body(error) => Explanation::new(error.to_string()),
            Problem::Other(cause) => Explanation::new(cause.to_string()),
        }
    }
}

/// A region without a point of a body with these corners (m) and this spacing (m).
fn empty_region(region: &str, body: &str, [from, to]: [[f64; 3]; 2], spacing: f64) -> Explanation {
    Explanation::new(format!(
        "region `{region}` holds no point of body `{body}`: the body spans {} to {} m with points every {} m",
        position(from),
        position(to),
        number(spacing, 5)
    ))
}

/// A property that a material does not have, and what it is for.
fn missing(material: &str, body: &str, property: &str, purpose: &str) -> Explanation {
    Explanation::new(format!(
        "material `{material}` of body `{body}` has no `{property}`{purpose}"
    ))
    .help(format!("give it under `[materials.{material}]`"))
}

/// A fixed step (s) of a physics that is above its own stable step (s) or that of a coupler.
fn unstable(physics: &str, fixed: f64, stable: f64, coupler: Option<&str>) -> Explanation {
    let [fixed, stable] = [fixed, stable].map(|step| number(step, 5));
    let limit = match coupler {
        None => format!("its largest stable step {stable} s"),
        Some(coupler) => format!("the largest stable step {stable} s of `{coupler}`"),
    };
    Explanation::new(format!(
        "the step {fixed} s of `{physics}` is above {limit}"
    ))
    .help("use `step = \"auto\"` or a smaller value")
}

/// A field that `plugin` reads and that is not among those that are provided.
fn not_provided(plugin: &str, field: &str, body: &str, provided: &[String]) -> Explanation {
    let explanation = Explanation::new(format!(
        "`{plugin}` reads field `{field}` of body `{body}`, which no physics or coupler provides"
    ));
    match provided.is_empty() {
        true => explanation,
        false => explanation.help(format!("provided are: {}", provided.join(", "))),
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.explain().fmt(f)
    }
}

impl std::error::Error for Problem {}

impl From<FamilyError> for Problem {
    fn from(error: FamilyError) -> Self {
        Problem::Family(error)
    }
}

impl From<BodyError> for Problem {
    fn from(error: BodyError) -> Self {
        Problem::Body(error)
    }
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

    /// A name at `key` that is not among the known ones.
    pub fn unknown(
        key: impl Into<String>,
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = impl Into<String>>,
    ) -> Self {
        let known = known.into_iter().map(Into::into).collect();
        let name = name.into();
        Self::new(key, Problem::UnknownName { what, name, known })
    }

    /// A plugin's own error at `key`.
    pub fn other(key: impl Into<String>, cause: impl Into<Cause>) -> Self {
        Self::new(key, Problem::Other(cause.into()))
    }

    /// The error of a table that stands at `key` of the plugin's table.
    pub fn below(self, key: &str) -> Self {
        SetupError {
            key: format!("{key}.{}", self.key),
            ..self
        }
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
        "the steps of {physics} are {} s at t = {} s: the run would take {} more steps",
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
        /// The value in the case.
        tolerance: f64,
        /// Simulated time, s.
        time: f64,
    },
    /// A checkpoint that does not fit the case.
    #[error("the checkpoint does not fit the case: {0}")]
    Checkpoint(String),
}

impl RunError {
    /// A value by time of a plugin that makes no sense.
    pub fn wrong_value(plugin: &str, wrong: WrongValue) -> Self {
        RunError::Plugin {
            plugin: plugin.into(),
            time: wrong.time,
            cause: Box::new(wrong),
        }
    }
}

fn stable_hint(step: f64, stable: Option<f64>) -> String {
    match stable {
        Some(stable) if step <= stable => format!(
            ", below the largest stable one of {} s: check the loads and the material",
            number(stable, 5)
        ),
        Some(stable) => format!(", the largest stable one {} s", number(stable, 5)),
        None => String::new(),
    }
}
