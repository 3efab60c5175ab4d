//! Toolpaths: position, travel direction and power of a heat source in time.
//!
//! A case file describes a [`Toolpath`] (one struct per kind, each in its own file). Reading it
//! yields a [`Track`]: contiguous moves in time, from which [`Track::pose`] gives position, travel
//! direction and power at any time, and [`Track::next_event`] the next time at which velocity or
//! power has a kink or a jump. Between events the power is linear in time, so a step that ends at every
//! event and samples the track at its middle delivers the exact energy.
//!
//! ```toml
//! toolpath.line = { start = [0.0, 0.0, 0.005], direction = [1.0, 0.0, 0.0], speed = 0.005 }
//! ```
//!
//! A plugin of another crate takes a [`Toolpath`] as a key of its table:
//!
//! ```
//! use perimelt_couplers::toolpath::Toolpath;
//!
//! let toolpath: Toolpath = serde_json::from_value(serde_json::json!({
//!     "line": { "start": [0, 0, 0], "end": [0.1, 0, 0], "speed": 0.01 }
//! }))?;
//! // W where the toolpath gives no power of its own; files are relative to the folder
//! let track = toolpath.track(Some(200.0), std::path::Path::new("."))?;
//! assert_eq!(track.pose(4.0).position.x, 0.04);
//! assert_eq!(track.next_event(0.0), Some(10.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! and a plugin that follows the torch of the case requests its [`TimedPath`] by name, `setup.shared("source", "heat source", name)`.
//!
//! SI units throughout; angles in radian, counted from +x towards +y. Weaves and hatches lie in planes normal to z.
//!
//! A path may wait before a pass until a temperature has fallen below a value ([`WaitUntil`]); a [`TimedPath`] is a track
//! with its clock, whose state is part of a checkpoint.

mod circle;
mod clock;
mod gcode;
mod hatch;
mod line;
mod polyline;
mod pulse;
mod sequence;
mod table;
#[cfg(test)]
mod tests;
mod track;
mod wait;
mod weave;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

pub use circle::{Circle, CircleTorch};
pub use clock::TimedPath;
pub(crate) use clock::{ClockState, TrackTime};
pub use gcode::{DwellUnit, Gcode, GcodeError};
pub use hatch::Hatch;
pub use line::Line;
pub use polyline::{Polyline, Segment};
pub use pulse::Pulse;
pub use sequence::{Sequence, SequencePass};
pub use table::{PowerAs, Table, TableFormat};
pub use track::{Pose, Track};
pub use wait::{Side, WaitUntil};
pub use weave::{Weave, WeaveShape};

use nalgebra::Vector3;
use perimelt_core::input::InputError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The path of a moving heat source, as written in a case file: `toolpath.line = { ... }`.
///
/// The kind is the key and not a `type` entry, so that a mistake inside the table is reported at its own
/// line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Toolpath {
    /// One straight pass.
    Line(Line),
    /// Straight segments, each with its own speed, power and dwell.
    Polyline(Polyline),
    /// Part of a circle, one circle or several turns.
    Circle(Circle),
    /// A straight seam with a sideways oscillation.
    Weave(Weave),
    /// Parallel scan lines that fill a rectangle, layer by layer.
    Hatch(Hatch),
    /// Times, positions and powers from a file.
    Table(Table),
    /// A program in G-code.
    Gcode(Gcode),
    /// Passes one after the other, with waits for the interpass temperature.
    Sequence(Sequence),
}

impl Toolpath {
    /// The key of the kind of path.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Line(_) => "line",
            Self::Polyline(_) => "polyline",
            Self::Circle(_) => "circle",
            Self::Weave(_) => "weave",
            Self::Hatch(_) => "hatch",
            Self::Table(_) => "table",
            Self::Gcode(_) => "gcode",
            Self::Sequence(_) => "sequence",
        }
    }

    /// Checks the path and lays it out in time.
    ///
    /// `default_power` (W) is used wherever the toolpath gives no power of its own; file names
    /// are taken relative to `base_dir`.
    ///
    /// # Errors
    /// [`ToolpathError`], naming the key or the row at fault.
    pub fn track(
        &self,
        default_power: Option<f64>,
        base_dir: &Path,
    ) -> Result<Track, ToolpathError> {
        if let Some(power) = default_power {
            not_negative("power", power)?;
        }
        match self {
            Self::Line(path) => path.track(default_power),
            Self::Polyline(path) => path.track(default_power),
            Self::Circle(path) => path.track(default_power),
            Self::Weave(path) => path.track(default_power),
            Self::Hatch(path) => path.track(default_power),
            Self::Table(path) => path.track(default_power, base_dir),
            Self::Gcode(path) => path.track(default_power, base_dir),
            Self::Sequence(path) => path.track(default_power, base_dir),
        }
    }
}

/// What can be wrong with a toolpath.
#[derive(Debug, thiserror::Error)]
pub enum ToolpathError {
    /// A length, speed or time that must be greater than zero is not.
    #[error("`{key}` of the toolpath must be a finite number greater than zero, but is {value}")]
    NotPositive {
        /// Key in the case file.
        key: String,
        /// Value found.
        value: f64,
    },
    /// A power, time or dwell that must not be negative is.
    #[error("`{key}` of the toolpath must be a finite number, zero or greater, but is {value}")]
    Negative {
        /// Key in the case file.
        key: String,
        /// Value found.
        value: f64,
    },
    /// A coordinate or angle that is not a number.
    #[error("`{key}` of the toolpath must be finite")]
    NotFinite {
        /// Key in the case file.
        key: String,
    },
    /// `end` and `direction` of a line are both given or both missing.
    #[error(
        "a line needs either `end`, or `direction` with an optional `end_time`, and not both; \
         see `{key}`"
    )]
    LineGoal {
        /// Key in the case file.
        key: String,
    },
    /// A move without length.
    #[error("`{key}` of the toolpath gives a move of length zero")]
    NoLength {
        /// Key in the case file.
        key: String,
    },
    /// Neither the toolpath nor the source gives a power.
    #[error("no power is given for `{key}`: set `power` of the source or of the toolpath")]
    NoPower {
        /// Key in the case file.
        key: String,
    },
    /// The path would need more moves than can be held.
    #[error("the toolpath has {moves} moves, more than {limit}; check `{key}`")]
    TooManyMoves {
        /// Key in the case file.
        key: String,
        /// Moves asked for.
        moves: f64,
        /// Most that are allowed.
        limit: f64,
    },
    /// The table cannot be opened.
    #[error("cannot read the toolpath table {}: {source}", path.display())]
    TableOpen {
        /// The file.
        path: PathBuf,
        /// Why.
        source: InputError,
    },
    /// A header or a row of the table cannot be read.
    #[error(
        "line {line} of the toolpath table {} cannot be read: {problem}; expected the columns `{columns}`",
        path.display()
    )]
    TableLine {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: u64,
        /// What is wrong.
        problem: String,
        /// Columns of the format.
        columns: String,
    },
    /// A key that the format of the table does not have.
    #[error("`{key}` of the toolpath table belongs to `format = \"{format}\"`; leave it out")]
    TableKey {
        /// Key in the case file.
        key: &'static str,
        /// The format that has it.
        format: &'static str,
    },
    /// A value in the table is out of range.
    #[error(
        "line {line} of the toolpath table {}: `{column}` is {value}, expected {expected}",
        path.display()
    )]
    TableValue {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: u64,
        /// Column name.
        column: &'static str,
        /// Value found.
        value: f64,
        /// What was expected.
        expected: &'static str,
    },
    /// The times of the table decrease.
    #[error(
        "line {line} of the toolpath table {}: time {time} s comes after {previous} s; \
         times must not decrease", path.display()
    )]
    TableTime {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: u64,
        /// Time of this row (s).
        time: f64,
        /// Time of the row before (s).
        previous: f64,
    },
    /// Fewer than two rows.
    #[error("the toolpath table {} has {rows} rows, at least two are needed", path.display())]
    TableShort {
        /// The file.
        path: PathBuf,
        /// Rows found.
        rows: usize,
    },
    /// A program in G-code.
    #[error(transparent)]
    Gcode(#[from] GcodeError),
    /// A pass of a sequence.
    #[error("pass {} of the sequence: {source}", index + 1)]
    Pass {
        /// Index of the pass, counted from 0.
        index: usize,
        /// Key of the kind of its toolpath.
        kind: &'static str,
        /// What is wrong.
        source: Box<ToolpathError>,
    },
    /// A pass without an end that others follow.
    #[error("`{key}` has no end, but a pass follows it; give `end` or `end_time`")]
    NoEnd {
        /// Key in the case file.
        key: String,
    },
    /// A row of the table waits, but it is not given for what.
    #[error("line {line} of the toolpath table {} has a `wait`, but the toolpath has no `wait_until`", path.display())]
    TableWait {
        /// The file.
        path: PathBuf,
        /// Line in the file, counted from 1.
        line: u64,
    },
}

impl ToolpathError {
    /// The case-file key at fault, for pointing at its line.
    pub fn key(&self) -> Cow<'_, str> {
        let key = match self {
            Self::Pass {
                index,
                kind,
                source,
            } => return format!("passes[{index}].toolpath.{kind}.{}", source.key()).into(),
            Self::NotPositive { key, .. }
            | Self::Negative { key, .. }
            | Self::NotFinite { key }
            | Self::LineGoal { key }
            | Self::NoLength { key }
            | Self::NoPower { key }
            | Self::NoEnd { key }
            | Self::TooManyMoves { key, .. } => key.as_str(),
            Self::TableKey { key, .. } => key,
            Self::TableOpen { .. }
            | Self::TableLine { .. }
            | Self::TableValue { .. }
            | Self::TableTime { .. }
            | Self::TableShort { .. }
            | Self::TableWait { .. } => "file",
            Self::Gcode(e) => e.key(),
        };
        key.into()
    }
}

fn positive(key: &str, value: f64) -> Result<f64, ToolpathError> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(ToolpathError::NotPositive {
        key: key.into(),
        value,
    })
}

fn not_negative(key: &str, value: f64) -> Result<f64, ToolpathError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(value);
    }
    Err(ToolpathError::Negative {
        key: key.into(),
        value,
    })
}

fn finite(key: &str, value: f64) -> Result<f64, ToolpathError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(ToolpathError::NotFinite { key: key.into() })
}

fn place(key: &str, value: [f64; 3]) -> Result<Vector3<f64>, ToolpathError> {
    for component in value {
        finite(key, component)?;
    }
    Ok(Vector3::from(value))
}

/// Own power of a move, or that of the toolpath, or that of the source (W).
fn power_of(key: &str, own: Option<f64>, default: Option<f64>) -> Result<f64, ToolpathError> {
    match own.or(default) {
        Some(power) => not_negative(key, power),
        None => Err(ToolpathError::NoPower { key: key.into() }),
    }
}
