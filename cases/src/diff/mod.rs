//! Comparison of two logs: fields, probes and balances by time.
//!
//! The difference of a quantity at one time is given by its largest absolute value, by its root mean square over all
//! points and components, and by the largest value relative to the largest absolute value of the quantity in both logs at all
//! times. Positions are relative to the extent of the body; the parts of a balance to the largest of them, so that an error of
//! rounding size does not count as a difference of a hundred percent; the positions of a line probe to the largest value
//! along the line.

mod series;
mod table;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use perimelt_core::log::{Log, LogError, LoggedCloud};

use crate::argument::suggestion;
use crate::log_file::open_log;
use crate::log_file::skip_damaged;
use series::compare_series;
pub use table::print;

/// What to compare.
#[derive(Clone, Debug, clap::Args)]
pub struct DiffArgs {
    /// First log
    pub first: PathBuf,
    /// Second log
    pub second: PathBuf,
    /// Largest relative difference of quantities that count as equal
    #[arg(
        long,
        value_name = "R",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub tolerance: f64,
    /// Bodies whose fields are compared [default: all]
    #[arg(long)]
    pub body: Vec<String>,
    /// Fields that are compared, `position` among them [default: all]
    #[arg(long)]
    pub field: Vec<String>,
    /// Print every time instead of the one with the largest difference
    #[arg(long)]
    pub times: bool,
}

/// Why logs cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum DiffError {
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The argument is not a tolerance.
    #[error("`--tolerance` is {0}, expected a number of 0 or more, such as 1e-6")]
    Tolerance(f64),
    /// A requested body or field that neither log has.
    #[error("neither log has a {what} `{name}`; they have: {}{}", known.join(", "), suggestion(name, known))]
    Unknown {
        /// body or field
        what: &'static str,
        /// the requested name
        name: String,
        /// the known names
        known: Vec<String>,
    },
    /// Logs of different bodies.
    #[error("the logs have no body in common: {} has {first}, {} has {second}", paths[0].display(), paths[1].display())]
    NoCommonBody {
        /// the logs
        paths: [PathBuf; 2],
        /// names of the bodies
        first: String,
        /// names of the bodies
        second: String,
    },
    /// Logs of different times.
    #[error(
        "the logs have no time in common: {} has {first}, {} has {second}; `log.interval` of both cases should be equal",
        paths[0].display(), paths[1].display()
    )]
    NoCommonTime {
        /// the logs
        paths: [PathBuf; 2],
        /// a description of the times
        first: String,
        /// a description of the times
        second: String,
    },
}

/// Difference of a quantity at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// simulated time, s
    pub time: f64,
    /// largest absolute difference, in the unit of the quantity
    pub largest: f64,
    /// root mean square of the difference, in the unit of the quantity
    pub rms: f64,
}

/// A quantity that both logs have.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// body, probe, or `balance`
    pub of: String,
    /// name
    pub name: String,
    /// SI unit
    pub unit: String,
    /// reference of relative differences, in the unit
    pub scale: f64,
    /// differences by time
    pub differences: Vec<Difference>,
}

impl Compared {
    /// Adds the difference of the values at a time (s).
    fn add(&mut self, time: f64, values: [&[f64]; 2], scale: f64) {
        let (largest, rms) = norms(values);
        self.scale = self.scale.max(scale);
        self.differences.push(Difference { time, largest, rms });
    }

    /// The difference at the time where it is largest.
    #[must_use]
    pub fn worst(&self) -> Option<Difference> {
        let by_size = |a: &&Difference, b: &&Difference| a.largest.total_cmp(&b.largest);
        // the first of equal ones
        self.differences.iter().rev().max_by(by_size).copied()
    }

    /// A difference relative to the scale.
    #[must_use]
    pub fn relative(&self, difference: f64) -> f64 {
        if difference == 0.0 {
            0.0
        } else {
            difference / self.scale
        }
    }

    /// The largest relative difference.
    #[must_use]
    pub fn worst_relative(&self) -> f64 {
        self.worst()
            .map_or(0.0, |worst| self.relative(worst.largest))
    }
}

/// Result of a comparison.
#[derive(Clone, Debug, Default)]
pub struct LogComparison {
    /// quantities that both logs have
    pub compared: Vec<Compared>,
    /// sentences about contents of only one of them
    pub unmatched: Vec<String>,
}

impl LogComparison {
    /// Quantities that differ by more than a relative tolerance.
    #[must_use]
    pub fn beyond(&self, tolerance: f64) -> usize {
        let differs = |c: &&Compared| !(c.worst_relative() <= tolerance);
        self.compared.iter().filter(differs).count()
    }

    /// Whether both logs contain the same within a relative tolerance.
    #[must_use]
    pub fn is_equal(&self, tolerance: f64) -> bool {
        self.unmatched.is_empty() && self.beyond(tolerance) == 0
    }
}

/// Compares two logs.
///
/// # Errors
/// A log cannot be read, an argument makes no sense, or the logs have nothing in common.
pub fn diff(args: &DiffArgs) -> Result<LogComparison, DiffError> {
    if !(args.tolerance >= 0.0 && args.tolerance.is_finite()) {
        return Err(DiffError::Tolerance(args.tolerance));
    }
    let logs = [open_log(&args.first)?, open_log(&args.second)?];
    let mut comparison = LogComparison::default();
    let bodies = common_bodies(&logs, args, &mut comparison)?;
    for body in &bodies {
        compare_body(&logs, body, args, &mut comparison)?;
    }
    if !bodies.is_empty() && bodies.iter().all(|body| pairs(&logs, body).is_empty()) {
        let described = |log: &Log| span(log.times(&bodies[0]));
        return Err(DiffError::NoCommonTime {
            paths: [args.first.clone(), args.second.clone()],
            first: described(&logs[0]),
            second: described(&logs[1]),
        });
    }
    // a comparison of named bodies or fields excludes the series
    if args.body.is_empty() && args.field.is_empty() {
        let [first, second] = [&logs[0], &logs[1]];
        for (name, series) in first.probes() {
            let of = format!("probe {name}");
            match second.probes().get(name) {
                Some(other) => compare_series(&of, [series, other], &mut comparison),
                None => comparison
                    .unmatched
                    .push(format!("only the first log has the {of}")),
            }
        }
        let others = second
            .probes()
            .keys()
            .filter(|n| !first.probes().contains_key(*n));
        comparison
            .unmatched
            .extend(others.map(|name| format!("only the second log has the probe {name}")));
        compare_series(
            "balance",
            [first.balance(), second.balance()],
            &mut comparison,
        );
    }
    check_fields(&logs, &bodies, &args.field, &comparison)?;
    Ok(comparison)
}

/// Requested bodies that are in both logs.
fn common_bodies(
    logs: &[Log; 2],
    args: &DiffArgs,
    comparison: &mut LogComparison,
) -> Result<Vec<String>, DiffError> {
    let names = logs
        .each_ref()
        .map(|log| log.bodies().map(String::from).collect::<Vec<_>>());
    let mut known = names.concat();
    known.sort();
    known.dedup();
    if let Some(name) = args.body.iter().find(|name| !known.contains(name)) {
        return Err(DiffError::Unknown {
            what: "body",
            name: name.clone(),
            known,
        });
    }
    let is_asked = |name: &String| args.body.is_empty() || args.body.contains(name);
    for (log, [own, other]) in ["first", "second"].iter().zip([[0, 1], [1, 0]]) {
        let alone = names[own]
            .iter()
            .filter(|n| is_asked(n) && !names[other].contains(n));
        comparison
            .unmatched
            .extend(alone.map(|name| format!("only the {log} log has the body {name}")));
    }
    let common: Vec<String> = names[0]
        .iter()
        .filter(|n| is_asked(n) && names[1].contains(n))
        .cloned()
        .collect();
    if common.is_empty() {
        return Err(DiffError::NoCommonBody {
            paths: [args.first.clone(), args.second.clone()],
            first: names[0].join(", "),
            second: names[1].join(", "),
        });
    }
    Ok(common)
}

/// Every requested field must have been compared.
fn check_fields(
    logs: &[Log; 2],
    bodies: &[String],
    asked: &[String],
    comparison: &LogComparison,
) -> Result<(), DiffError> {
    let is_known = |name: &&String| comparison.compared.iter().any(|c| c.name == **name);
    let Some(name) = asked.iter().find(|name| !is_known(name)) else {
        return Ok(());
    };
    let mut known = vec!["position".to_string()];
    for (log, body) in logs
        .iter()
        .flat_map(|log| bodies.iter().map(move |b| (log, b)))
    {
        known.extend(log.first_cloud(body)?.fields.into_iter().map(|f| f.name));
    }
    known.sort();
    known.dedup();
    Err(DiffError::Unknown {
        what: "field",
        name: name.clone(),
        known,
    })
}

/// Numbers of the states of a body with the same time in both logs.
fn pairs(logs: &[Log; 2], body: &str) -> Vec<[usize; 2]> {
    common_times(logs[0].times(body), logs[1].times(body))
}

/// Indices of equal times of two ascending lists, equal up to rounding.
fn common_times(first: &[f64], second: &[f64]) -> Vec<[usize; 2]> {
    let size = first
        .iter()
        .chain(second)
        .fold(0.0_f64, |s, t| s.max(t.abs()));
    let slack = 1e-9 * size;
    let (mut i, mut j) = (0, 0);
    let mut pairs = Vec::new();
    while let (Some(a), Some(b)) = (first.get(i), second.get(j)) {
        if (a - b).abs() <= slack {
            pairs.push([i, j]);
            (i, j) = (i + 1, j + 1);
        } else if a < b {
            i += 1;
        } else {
            j += 1;
        }
    }
    pairs
}

/// Notes times that only one of two lists has; once for bodies and series of equal times.
fn note_times(
    comparison: &mut LogComparison,
    of: &str,
    first: &[f64],
    second: &[f64],
    common: usize,
) {
    let alone = [first.len() - common, second.len() - common];
    if alone == [0, 0] {
        return;
    }
    let sentence = format!(
        "{common} times are in both logs, {} only in the first ({}), {} only in the second ({})",
        alone[0],
        span(first),
        alone[1],
        span(second)
    );
    let known = comparison.unmatched.iter_mut();
    match known.into_iter().find(|known| known.ends_with(&sentence)) {
        Some(known) => *known = known.replacen(": ", &format!(", {of}: "), 1),
        None => comparison.unmatched.push(format!("{of}: {sentence}")),
    }
}

fn span(times: &[f64]) -> String {
    match (times.first(), times.last()) {
        (Some(first), Some(last)) => format!("{} times from {first} to {last} s", times.len()),
        _ => "no times".into(),
    }
}

fn compare_body(
    logs: &[Log; 2],
    body: &str,
    args: &DiffArgs,
    comparison: &mut LogComparison,
) -> Result<(), DiffError> {
    let pairs = pairs(logs, body);
    let [first, second] = logs.each_ref().map(|log| log.times(body));
    note_times(comparison, body, first, second, pairs.len());
    let is_asked = |name: &str| args.field.is_empty() || args.field.iter().any(|f| f == name);
    let mut compared: Vec<Compared> = Vec::new();
    let mut alone: Vec<String> = Vec::new();
    let mut other_points = Vec::new();
    for [i, j] in pairs {
        let (Some(a), Some(b)) = (
            skip_damaged(logs[0].cloud(body, i))?,
            skip_damaged(logs[1].cloud(body, j))?,
        ) else {
            alone.push(format!(
                "{body}: the state at {} s is damaged in one of the logs",
                logs[0].times(body)[i]
            ));
            continue;
        };
        if a.positions.len() != b.positions.len() {
            other_points.push((a.time, a.positions.len(), b.positions.len()));
            continue;
        }
        if is_asked("position") {
            let values = [&a, &b].map(|cloud| cloud.positions.as_flattened());
            let scale = extent(&a).max(extent(&b));
            entry(&mut compared, body, "position", "m").add(a.time, values, scale);
        }
        for field in a.fields.iter().filter(|f| is_asked(&f.name)) {
            let same = |f: &&perimelt_core::log::CloudField| {
                f.name == field.name && f.components == field.components
            };
            match b.fields.iter().find(same) {
                Some(other) => {
                    let values = [&field.values[..], &other.values[..]];
                    let entry = entry(&mut compared, body, &field.name, &field.unit);
                    entry.add(a.time, values, size(values));
                }
                None => alone.push(format!(
                    "only the first log has the field {} of {body}",
                    field.name
                )),
            }
        }
        let others = b.fields.iter().filter(|f| is_asked(&f.name));
        for field in others.filter(|f| !a.fields.iter().any(|own| own.name == f.name)) {
            alone.push(format!(
                "only the second log has the field {} of {body}",
                field.name
            ));
        }
    }
    if let Some((time, first, second)) = other_points.first() {
        alone.push(format!(
            "{body}: at {} times the numbers of points differ, first at {time} s with {first} and {second} points; their fields are not compared",
            other_points.len()
        ));
    }
    alone.sort();
    alone.dedup();
    comparison.unmatched.extend(alone);
    comparison.compared.extend(compared);
    Ok(())
}

/// Diagonal of the box around the points of a cloud, m.
fn extent(cloud: &LoggedCloud) -> f64 {
    let along = |axis: usize| {
        let values = || {
            cloud
                .positions
                .iter()
                .map(|p| p[axis])
                .filter(|x| x.is_finite())
        };
        let low = values().fold(f64::INFINITY, f64::min);
        (values().fold(f64::NEG_INFINITY, f64::max) - low).max(0.0)
    };
    along(0).hypot(along(1)).hypot(along(2))
}

/// Largest finite absolute value.
fn size(values: [&[f64]; 2]) -> f64 {
    let all = values.into_iter().flatten().filter(|x| x.is_finite());
    all.fold(0.0_f64, |size, x| size.max(x.abs()))
}

/// Largest absolute value and root mean square of the difference of two lists of equal length. Two values that are not numbers
/// are equal; one of them alone differs without bound.
fn norms(values: [&[f64]; 2]) -> (f64, f64) {
    let mut largest = 0.0_f64;
    let mut sum = 0.0;
    for (a, b) in values[0].iter().zip(values[1]) {
        let difference = if a == b || (a.is_nan() && b.is_nan()) {
            0.0
        } else {
            let difference = (a - b).abs();
            if difference.is_nan() {
                f64::INFINITY
            } else {
                difference
            }
        };
        largest = largest.max(difference);
        sum += difference * difference;
    }
    (largest, (sum / values[0].len().max(1) as f64).sqrt())
}

/// The differences of a quantity, by its body, name and unit.
fn entry<'a>(
    compared: &'a mut Vec<Compared>,
    of: &str,
    name: &str,
    unit: &str,
) -> &'a mut Compared {
    let known = compared.iter().position(|c| c.name == name && c.of == of);
    let index = known.unwrap_or_else(|| {
        compared.push(Compared {
            of: of.into(),
            name: name.into(),
            unit: unit.into(),
            scale: 0.0,
            differences: Vec::new(),
        });
        compared.len() - 1
    });
    &mut compared[index]
}
