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

use std::path::Path;

pub use circle::{Circle, CircleTorch};
pub use clock::TimedPath;
pub(crate) use clock::{ClockState, TrackTime};
pub use gcode::{DwellUnit, Gcode};
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
use perimelt_core::SetupError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use perimelt_core::numbers::{check_at_least, check_finite};

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
    /// [`SetupError`] with the key to blame.
    pub fn track(&self, default_power: Option<f64>, base_dir: &Path) -> Result<Track, SetupError> {
        if let Some(power) = default_power {
            check_at_least("power", power, 0.0, "W")?;
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

/// Most moves of a pattern, to refuse lengths in the wrong unit instead of filling the memory.
const MOST_MOVES: f64 = 1e7;

/// A move without length.
fn no_length(key: &str) -> SetupError {
    let message = format!("`{key}` of the toolpath gives a move of length zero");
    SetupError::value(key, message, "a length above 0")
}

/// Neither the toolpath nor the source gives a power.
fn no_power(key: &str) -> SetupError {
    let message = format!("no power is given for `{key}`");
    SetupError::value(key, message, "`power` of the source or of the toolpath")
}

/// Refuses a path with more moves than can be held.
fn check_moves(key: &str, moves: f64) -> Result<(), SetupError> {
    if moves <= MOST_MOVES {
        return Ok(());
    }
    let message = format!("the toolpath has {moves} moves, more than {MOST_MOVES}");
    Err(SetupError::value(key, message, format!("a larger `{key}`")))
}

fn place(key: &str, value: [f64; 3]) -> Result<Vector3<f64>, SetupError> {
    for component in value {
        check_finite(key, component)?;
    }
    Ok(Vector3::from(value))
}

/// Own power of a move, or that of the toolpath, or that of the source (W).
fn power_of(key: &str, own: Option<f64>, default: Option<f64>) -> Result<f64, SetupError> {
    match own.or(default) {
        Some(power) => check_at_least(key, power, 0.0, "W"),
        None => Err(no_power(key)),
    }
}
