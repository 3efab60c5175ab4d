//! What can go wrong with a log, in sentences for the user.

use std::{io, path::PathBuf};

use mcap::McapError;

use super::Ending;

/// Why a log could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// Neither a file nor a link to one.
    #[error("{path} is not a regular file; a log must be one", path = path.display())]
    NotAFile {
        /// what was given
        path: PathBuf,
    },
    /// An error of the operating system while a run goes on, with a log that it can be resumed from.
    #[error(
        "could not write the log {path}: {source}; the log is intact up to the last complete state: \
         `perimelt resume {path}` continues it",
        path = path.display()
    )]
    Interrupted {
        /// the log
        path: PathBuf,
        /// error of the operating system
        source: io::Error,
    },
    /// An error of the operating system.
    #[error("could not {action} the log {path}: {source}", path = path.display())]
    Io {
        /// create, write or read
        action: &'static str,
        /// the log
        path: PathBuf,
        /// error of the operating system
        source: io::Error,
    },
    /// Another run writes it.
    #[error("{path} is being written by another run; give another `--out`", path = path.display())]
    InUse {
        /// the log
        path: PathBuf,
    },
    /// An error of the MCAP library.
    #[error("could not write the log {path}: {source}", path = path.display())]
    Mcap {
        /// the log
        path: PathBuf,
        /// error of the library
        source: McapError,
    },
    /// Not an MCAP file at all.
    #[error(
        "{path} is not an MCAP file; give the log of a run, as written by `perimelt run`",
        path = path.display()
    )]
    NotMcap {
        /// the file
        path: PathBuf,
    },
    /// An MCAP file without the case and metadata of a run.
    #[error(
        "{path} is an MCAP file, but not the log of a Perimelt run: it has no {missing}{}",
        early_end(ending),
        path = path.display()
    )]
    NotARun {
        /// the file
        path: PathBuf,
        /// what was looked for
        missing: &'static str,
        /// how the file ends
        ending: Ending,
    },
    /// The metadata `run` is there, but is not what this version writes.
    #[error(
        "the description of the run in {path} cannot be parsed: {source}; \
         was it written by another version?",
        path = path.display()
    )]
    RunInfo {
        /// the log
        path: PathBuf,
        /// what is wrong with it
        source: serde_json::Error,
    },
    /// A record whose checksum or form is wrong.
    #[error("the log {path} is damaged at byte {offset}: {source}", path = path.display())]
    Damaged {
        /// the log
        path: PathBuf,
        /// start of the record in the file
        offset: u64,
        /// error of the library
        source: McapError,
    },
    /// A message that is not of the form that its topic promises.
    #[error("a message of topic {topic} cannot be parsed: {source}")]
    Json {
        /// topic of the message
        topic: String,
        /// what is wrong with it
        source: serde_json::Error,
    },
    /// A point cloud that is not a `foxglove.PointCloud`.
    #[error("a point cloud of topic {topic} cannot be decoded: {source}")]
    PointCloud {
        /// topic of the message
        topic: String,
        /// what is wrong with it
        source: prost::DecodeError,
    },
    /// A point cloud with a layout that Perimelt does not write.
    #[error("a point cloud of topic {topic} does not have the format of Perimelt: {what}")]
    PointCloudLayout {
        /// topic of the message
        topic: String,
        /// the difference
        what: &'static str,
    },
    /// A body that the run does not have.
    #[error("the log has no body `{body}`; it has {}", list(.known))]
    UnknownBody {
        /// the name asked for
        body: String,
        /// the names there are
        known: Vec<String>,
    },
    /// A message number beyond the last one.
    #[error(
        "topic {topic} has {count} messages; number {index} (counted from 0) is not among them"
    )]
    NoSuchMessage {
        /// the topic
        topic: String,
        /// the number asked for
        index: usize,
        /// how many there are
        count: usize,
    },
    /// No way to resume.
    #[error(
        "the log {path} has no checkpoint; a run can only be resumed from a checkpoint",
        path = path.display()
    )]
    NoCheckpoint {
        /// the log
        path: PathBuf,
    },
    /// A body name that cannot be part of a topic.
    #[error(
        "a body cannot be named `{name}`: its name is part of a topic of the log; \
         choose one that is not empty, not `probes`, and has no `/`"
    )]
    BodyName {
        /// the name
        name: String,
    },
    /// A field that cannot be logged.
    #[error("field `{field}` of body `{body}` cannot be logged: {what}")]
    Field {
        /// the body
        body: String,
        /// the field
        field: String,
        /// what is wrong with it
        what: &'static str,
    },
    /// A field with too few or too many values.
    #[error("field `{field}` of body `{body}` has {found} values, but its points need {expected}")]
    FieldLength {
        /// the body
        body: String,
        /// the field
        field: String,
        /// points times components
        expected: usize,
        /// length of the slice
        found: usize,
    },
    /// A time series whose columns change on the way.
    #[error(
        "topic {topic} began with the columns {}, and now has {}; columns cannot change during \
         a run",
        list(.began), list(.now)
    )]
    Columns {
        /// the topic
        topic: String,
        /// columns of the first message
        began: Vec<String>,
        /// columns of this message
        now: Vec<String>,
    },
    /// A time that is infinite or not a number.
    #[error("topic {topic} cannot be logged at time {time} s")]
    Time {
        /// the topic
        topic: String,
        /// the time, s
        time: f64,
    },
    /// A resumed run must not overwrite what it reads.
    #[error(
        "{path} is the log to resume from; write the resumed run to another file",
        path = path.display()
    )]
    SameFile {
        /// the log
        path: PathBuf,
    },
}

fn early_end(ending: &Ending) -> String {
    match ending {
        Ending::Finished => String::new(),
        Ending::Unfinished { at } => {
            format!(" (the file was cut off at byte {at}, before that; it cannot be read)")
        }
        Ending::Damaged { at, what } => {
            format!(" (the file is damaged at byte {at}, before that: {what}; it cannot be read)")
        }
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        "none".into()
    } else {
        format!("`{}`", names.join("`, `"))
    }
}
