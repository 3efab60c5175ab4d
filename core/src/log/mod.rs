//! The log of a run: one MCAP file that any MCAP tool can read.
//!
//! | topic | content |
//! |---|---|
//! | `/<body>/points` | `foxglove.PointCloud` (protobuf): positions and fields of a body |
//! | `/probes/<name>` | scalar time series, JSON with schema |
//! | `/balance` | energy, mass, momentum; JSON with schema |
//! | `/progress` | [`Progress`], JSON with schema |
//! | `/checkpoint` | all data needed to resume, opaque bytes (MessagePack) |
//! | `/index` | one line before each point cloud and checkpoint: topic, exact time, step |
//! | attachment `case.toml` | the case file as run |
//! | metadata `run` | [`RunInfo`], one JSON text per key, and `case_file`, the name of the case file |
//!
//! [`Writer`] writes it, [`Log`] reads it back, also when the run was killed, [`Follow`] reads on while it is written, and
//! [`Writer::continue_from`] starts the log of a resumed run from an older one.
//!
//! **Time.** MCAP counts time in whole nanoseconds, too coarse for femtosecond heating. The
//! exact time is therefore the `time` (s, f64) in every JSON message, and in `/index` for
//! point clouds and checkpoints. The MCAP `log_time` is that time rounded to nanoseconds, or one
//! more than the last one where rounding would not let it grow: messages of one simulated time
//! share a `log_time`, later times have larger ones at any time scale.
//!
//! **Layout.** Attachment and metadata come first, so that an unfinished file has them. A large
//! message has a chunk of its own: time series are read without unpacking point clouds, and one
//! point cloud without unpacking its neighbours.
//!
//! **Size.** A message holds at most 256 MiB, since it stands in memory as a whole. A larger state is split:
//! the first points are on `/<body>/points`, the next ones on `/<body>/points/2`, `/<body>/points/3`
//! and so on, all with one `log_time`, so that a viewer shows them together when all of these topics
//! are switched on. Checkpoints are split likewise into parts of 64 MiB, byte by byte, and written while they are made. The part on the topic without a
//! number is written last: where it is present, the state is complete. [`Log`] joins the parts.

mod channels;
mod error;
mod follow;
mod foxglove_schema;
mod point_cloud;
mod reader;
mod rescue;
mod scan;
mod series;
mod source;
mod topic;
mod writer;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::body::Face;

pub use channels::{Channel, Schema};
pub use error::LogError;
pub use follow::{Follow, RawMessage};
pub use reader::Log;
pub use scan::{Damage, Ending};
pub use series::{Column, Entry, Series};
pub use writer::{
    Destination, RunHeader, Writer, check_unused, leads_to, memory_of_writing, try_lock,
};

/// One body at one time, as read back from a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedCloud {
    /// simulated time, s
    pub time: f64,
    /// current positions of all points, m
    pub positions: Vec<[f64; 3]>,
    /// logged fields, in the order they were written
    pub fields: Vec<CloudField>,
}

/// One field of a [`LoggedCloud`].
#[derive(Clone, Debug, PartialEq)]
pub struct CloudField {
    /// name, as in the field's key
    pub name: String,
    /// SI unit, empty if the log does not contain it
    pub unit: String,
    /// 1 (scalar), 3 (vector) or 9 (tensor)
    pub components: usize,
    /// `points * components` values, those of one point together; tensors column by column
    /// (xx, yx, zx, xy, ...), which is how nalgebra keeps them
    pub values: Vec<f64>,
}

/// Positions of points, m.
#[derive(Clone, Copy)]
pub enum Coordinates<'a> {
    /// A list.
    Listed(&'a [[f64; 3]]),
    /// Those that a function gives, of the points from zero on up to a number.
    Computed(usize, &'a dyn Fn(usize) -> [f64; 3]),
}

impl Coordinates<'_> {
    /// Number of points.
    pub fn count(&self) -> usize {
        match self {
            Coordinates::Listed(list) => list.len(),
            Coordinates::Computed(count, _) => *count,
        }
    }

    fn at(&self, point: usize) -> [f64; 3] {
        match self {
            Coordinates::Listed(list) => list[point],
            Coordinates::Computed(_, at) => at(point),
        }
    }
}

/// One body at one time, borrowed for writing.
#[derive(Clone, Copy)]
pub struct CloudView<'a> {
    /// simulated time, s
    pub time: f64,
    /// current positions of all points, m
    pub positions: Coordinates<'a>,
    /// fields to log
    pub fields: &'a [FieldView<'a>],
}

/// One field of a [`CloudView`]; same layout as [`CloudField`].
#[derive(Clone, Copy, Debug)]
pub struct FieldView<'a> {
    /// name, as in the field's key
    pub name: &'a str,
    /// 1 (scalar), 3 (vector) or 9 (tensor)
    pub components: usize,
    /// `points * components` values, those of one point together
    pub values: &'a [f64],
}

/// Precision of logged point clouds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// four bytes a number: sufficient for display, half the file size
    #[default]
    F32,
    /// eight bytes a number: exact, for runs that are replayed into another run
    F64,
}

/// Description of a run: everything that does not change during the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunInfo {
    /// version of the program
    pub version: String,
    /// number of threads
    pub threads: usize,
    /// start of the run, seconds since 1970-01-01 00:00 UTC
    pub started: u64,
    /// folder from which relative paths in the case start
    #[serde(default)]
    pub case_folder: String,
    /// files that the case names
    #[serde(default)]
    pub inputs: Vec<InputFile>,
    /// the bodies, in case-file order
    pub bodies: Vec<BodyInfo>,
    /// physics and couplers as composed, all defaults filled in
    pub plugins: serde_json::Value,
}

/// A file that a case names.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// path as in the case
    pub path: String,
    /// size, bytes
    pub bytes: u64,
    /// fingerprint of the content: FNV-1a of 64 bits, hexadecimal
    pub hash: String,
}

/// A body of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BodyInfo {
    /// name, the first part of its topic
    pub name: String,
    /// 1, 2 or 3
    pub dimension: usize,
    /// (smallest) distance between neighbouring points, m
    pub spacing: f64,
    /// extent across the plane of a two-dimensional body, m
    pub thickness: f64,
    /// number of points
    pub points: usize,
    /// faces that are planes of symmetry: the body is a part of the whole
    #[serde(default)]
    pub symmetry: Vec<Face>,
    /// cells of a body on a regular grid; `None` where points have several spacings or come from a table
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lattice: Option<LatticeInfo>,
    /// plies of a lay-up, from below
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plies: Vec<PlyInfo>,
    /// fields the body has, logged or not
    pub fields: Vec<FieldInfo>,
}

/// A ply of a lay-up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlyInfo {
    /// angle of the fibres from x towards y, degrees
    pub angle: f64,
    /// position of its middle along z, m
    pub middle: f64,
}

/// The regular grid of the cells of a body in its reference configuration. Points that get their material later, and cells
/// that never have any, are part of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatticeInfo {
    /// centre of cell (0, 0, 0), m
    pub origin: [f64; 3],
    /// edge of a cell, m
    pub spacing: f64,
    /// number of cells along x, y, z; 1 along axes that the body does not have
    pub cells: [usize; 3],
}

/// A field of a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FieldInfo {
    /// name, as in the field's key
    pub name: String,
    /// SI unit
    pub unit: String,
    /// 1 (scalar), 3 (vector) or 9 (tensor)
    pub components: usize,
}

/// Progress and cost of a run; one message of topic `/progress`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Progress {
    /// simulated time, s
    pub time: f64,
    /// macro steps done since the start of the run
    pub step: u64,
    /// size of the last macro step, s
    pub step_size: f64,
    /// sub-steps of each physics since the last message
    pub sub_steps: BTreeMap<String, u64>,
    /// solver iterations of each physics since the last message
    pub iterations: BTreeMap<String, u64>,
    /// evaluations of rates or forces, and products with their tangent, of each physics since the last
    /// message
    pub evaluations: BTreeMap<String, u64>,
    /// passes of the strong coupling since the last message (weak coupling: one a macro step)
    pub coupling_passes: u64,
    /// wall time since the start of the run, s
    pub wall_seconds: f64,
}

/// A state from which a run can be resumed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheckpointInfo {
    /// simulated time, s
    pub time: f64,
    /// macro steps done
    pub step: u64,
}
