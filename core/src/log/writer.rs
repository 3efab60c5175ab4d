//! Writing the log of a run.

mod channels;
mod checkpoint_parts;
mod destination;
mod resume;

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufWriter, Write},
    ops::Range,
    path::{Path, PathBuf},
};

use mcap::{Compression, McapError, WriteOptions, records::MessageHeader};
use serde_json::{Value, json};

use checkpoint_parts::CheckpointParts;
pub use checkpoint_parts::memory_of_writing;
use destination::lock;
pub use destination::{Destination, check_unused, leads_to, try_lock};

use super::{
    CloudView, Entry, LogError, Precision, Progress, RunInfo, point_cloud,
    scan::PROFILE,
    series,
    topic::{self, Topic},
};

/// Small messages are gathered into chunks of this many bytes, or until the next flush.
const CHUNK_BYTES: u64 = 1 << 20;

/// A message of this size or larger is written to a separate chunk.
const LARGE_BYTES: usize = 1 << 18;

/// The largest payload of a message, which stands in memory as a whole. Protobuf libraries refuse messages of 2 GiB.
const MAX_PART_BYTES: usize = 1 << 28;

/// The log of a run being written. Dropping it closes the file as [`finish`](Self::finish)
/// does, but ignores its error.
pub struct Writer {
    path: PathBuf,
    /// a run can be resumed from what was written
    is_resumable: bool,
    mcap: mcap::Writer<BufWriter<File>>,
    channels: BTreeMap<String, Channel>,
    clock: LogClock,
    /// the message being encoded; kept because point clouds are large
    buffer: Vec<u8>,
    /// a larger state is split into messages of at most this many bytes of payload
    pub(super) part_bytes: usize,
}

/// Description of a run and its case at the start of a log.
#[derive(Clone, Copy, Debug)]
pub struct RunHeader<'a> {
    /// the run
    pub run: &'a RunInfo,
    /// name of the case file
    pub case_name: &'a str,
    /// text of the case file
    pub case_text: &'a str,
}

struct Channel {
    id: u16,
    next_sequence: u32,
    schema: u16,
    /// encoding of the messages
    encoding: &'static str,
    /// names and units, of a time series
    columns: Vec<(String, String)>,
}

/// Turns simulated time into `log_time`, see the [module](super).
#[derive(Default)]
struct LogClock {
    last: Option<(f64, u64)>,
}

impl LogClock {
    fn log_time(&mut self, time: f64) -> u64 {
        let nanoseconds = (time * 1e9).round() as u64;
        let log_time = match self.last {
            Some((last, log_time)) if last == time => log_time,
            Some((_, log_time)) => nanoseconds.max(log_time.saturating_add(1)),
            None => nanoseconds,
        };
        self.last = Some((time, log_time));
        log_time
    }
}

fn check_names(run: &RunInfo) -> Result<(), LogError> {
    let mut names = run.bodies.iter().map(|body| &body.name);
    match names.find(|name| !topic::is_body_name(name)) {
        Some(name) => Err(LogError::BodyName { name: name.clone() }),
        None => Ok(()),
    }
}

impl Writer {
    /// Creates the log of a run (an existing file is overwritten), see [`begin`](Self::begin).
    ///
    /// # Errors
    /// The file cannot be written, or a body's name cannot be part of a topic.
    pub fn create(
        path: impl AsRef<Path>,
        run: &RunInfo,
        case_file_name: &str,
        case_text: &str,
    ) -> Result<Self, LogError> {
        check_names(run)?;
        Self::begin(Destination::create(path)?, run, case_file_name, case_text)
    }

    /// Writes what a reader of an unfinished log needs: case, run, and the channels of every body.
    ///
    /// # Errors
    /// The file cannot be written, or a body's name cannot be part of a topic.
    pub fn begin(
        Destination { path, file }: Destination,
        run: &RunInfo,
        case_file_name: &str,
        case_text: &str,
    ) -> Result<Self, LogError> {
        check_names(run)?;
        // a file that another run writes must not be truncated
        lock(&file, &path)?;
        file.set_len(0).map_err(|source| LogError::Io {
            action: "create",
            path: path.clone(),
            source,
        })?;
        let mcap = WriteOptions::new()
            .profile(PROFILE)
            .library(concat!("perimelt/", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK_BYTES))
            // whole chunks are appended: a killed run never leaves half a header behind
            .disable_seeking(true)
            .compression(Some(Compression::Zstd))
            // the solver uses all cores: fast compression, no additional threads
            .compression_level(1)
            .compression_threads(0)
            .create(BufWriter::new(file))
            .map_err(|source| write_error(&path, false, source))?;
        let mut writer = Self {
            path,
            is_resumable: false,
            mcap,
            channels: BTreeMap::new(),
            clock: LogClock::default(),
            buffer: Vec::new(),
            part_bytes: MAX_PART_BYTES,
        };
        writer.describe(RunHeader {
            run,
            case_name: case_file_name,
            case_text,
        })?;
        Ok(writer)
    }

    /// Logs the points of a body on `/<body>/points`, and on the topics of its parts if they take
    /// more than 256 MiB, see the [module](super).
    ///
    /// # Errors
    /// Unknown body, a field without as many values as its points need, or the file cannot be
    /// written.
    pub fn points(
        &mut self,
        body: &str,
        precision: Precision,
        cloud: &CloudView,
    ) -> Result<(), LogError> {
        let topic = topic::points(body);
        if !self.channels.contains_key(&topic) {
            return Err(self.unknown_body(body));
        }
        check_fields(body, cloud)?;
        let points_per_part = self.part_bytes / point_cloud::point_stride(cloud, precision);
        let log_time = self.log_time(&topic, cloud.time)?;
        self.index(&topic, cloud.time, None)?;
        let mut buffer = std::mem::take(&mut self.buffer);
        let mut written = Ok(());
        for (part, range) in parts(cloud.positions.count(), points_per_part) {
            buffer.clear();
            point_cloud::encode(&mut buffer, cloud, range, precision, log_time);
            written = self.write_part(&topic, part, log_time, &buffer);
            if written.is_err() {
                break;
            }
        }
        self.buffer = buffer;
        written
    }

    /// Logs a row of the time series `/probes/<name>`.
    ///
    /// # Errors
    /// The columns are not those of the first row, or the file cannot be written.
    pub fn probe(&mut self, name: &str, time: f64, values: &[Entry<'_>]) -> Result<(), LogError> {
        self.series(&topic::probe(name), time, values)
    }

    /// Logs a row of `/balance`.
    ///
    /// # Errors
    /// The columns are not those of the first row, or the file cannot be written.
    pub fn balance(&mut self, time: f64, values: &[Entry<'_>]) -> Result<(), LogError> {
        self.series(topic::BALANCE, time, values)
    }

    fn series(&mut self, topic: &str, time: f64, values: &[Entry<'_>]) -> Result<(), LogError> {
        match self.channels.get(topic) {
            Some(channel) => {
                let same = channel.columns.len() == values.len()
                    && channel
                        .columns
                        .iter()
                        .zip(values)
                        .all(|(began, now)| began.0 == now.name);
                if !same {
                    return Err(LogError::Columns {
                        topic: topic.into(),
                        began: channel
                            .columns
                            .iter()
                            .map(|(name, _)| name.clone())
                            .collect(),
                        now: values.iter().map(|entry| entry.name.into()).collect(),
                    });
                }
            }
            None => {
                let columns = values
                    .iter()
                    .map(|entry| (entry.name.into(), entry.unit.into()));
                self.declare_series(topic, columns.collect())?;
            }
        }
        self.json(topic, time, &series::message(time, values))
    }

    /// Logs the progress of the run.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn progress(&mut self, progress: &Progress) -> Result<(), LogError> {
        let message = serde_json::to_value(progress).map_err(|source| LogError::Json {
            topic: topic::PROGRESS.into(),
            source,
        })?;
        self.json(topic::PROGRESS, progress.time, &message)
    }

    /// Logs all data needed to resume after `step` macro steps, which `save` writes.
    ///
    /// # Errors
    /// Those of `save`, or the file cannot be written.
    pub fn checkpoint<E: From<LogError>>(
        &mut self,
        time: f64,
        step: u64,
        save: impl FnOnce(&mut dyn Write) -> Result<(), E>,
    ) -> Result<(), E> {
        let log_time = self.log_time(topic::CHECKPOINT, time)?;
        self.index(topic::CHECKPOINT, time, Some(step))?;
        let mut parts = CheckpointParts::new(self, log_time);
        let saved = save(&mut parts);
        parts.finish(saved)
    }

    /// Ends the chunk and hands everything to the operating system: what was logged up to here
    /// survives if the run is killed.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), LogError> {
        let flushed = self.mcap.flush();
        flushed.map_err(|source| self.failed(source))
    }

    /// Writes the summary and closes the file.
    ///
    /// # Errors
    /// The file cannot be written; what was flushed before can still be read.
    pub fn finish(mut self) -> Result<(), LogError> {
        let finished = self.mcap.finish();
        finished.map_err(|source| self.failed(source))?;
        let mut file = self.mcap.into_inner();
        let closed = file.flush().and_then(|()| file.get_ref().sync_all());
        let (path, is_resumable) = (&self.path, self.is_resumable);
        closed.map_err(|source| write_error(path, is_resumable, McapError::Io(source)))
    }

    /// Tells the writer that its file has its name and a checkpoint to resume from.
    pub fn placed(&mut self) {
        self.is_resumable = true;
    }

    fn failed(&self, source: McapError) -> LogError {
        write_error(&self.path, self.is_resumable, source)
    }

    /// Announces a point cloud or checkpoint with its exact time.
    fn index(&mut self, topic: &str, time: f64, step: Option<u64>) -> Result<(), LogError> {
        self.json(
            topic::INDEX,
            time,
            &json!({"time": time, "topic": topic, "step": step}),
        )
    }

    fn json(&mut self, topic: &str, time: f64, message: &Value) -> Result<(), LogError> {
        let log_time = self.log_time(topic, time)?;
        self.write(topic, log_time, message.to_string().as_bytes())
    }

    fn log_time(&mut self, topic: &str, time: f64) -> Result<u64, LogError> {
        if time.is_finite() {
            Ok(self.clock.log_time(time))
        } else {
            Err(LogError::Time {
                topic: topic.into(),
                time,
            })
        }
    }

    /// Writes part number `part` (from 1) of a state whose first part belongs to `topic`.
    fn write_part(
        &mut self,
        topic: &str,
        part: usize,
        log_time: u64,
        data: &[u8],
    ) -> Result<(), LogError> {
        if part == 1 {
            return self.write(topic, log_time, data);
        }
        let part_topic = topic::part(topic, part);
        self.declare_part(&part_topic, topic)?;
        self.write(&part_topic, log_time, data)
    }

    /// Writes a message to a declared channel.
    fn write(&mut self, topic: &str, log_time: u64, data: &[u8]) -> Result<(), LogError> {
        let channel = self
            .channels
            .get_mut(topic)
            .expect("every topic is declared before");
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.next_sequence,
            log_time,
            publish_time: log_time,
        };
        channel.next_sequence += 1;
        let alone = data.len() >= LARGE_BYTES;
        let mut write = || -> Result<(), McapError> {
            if alone {
                self.mcap.flush()?;
            }
            self.mcap.write_to_known_channel(&header, data)?;
            if alone {
                self.mcap.flush()?;
            }
            Ok(())
        };
        write().map_err(|source| self.failed(source))
    }

    fn unknown_body(&self, body: &str) -> LogError {
        let known = self
            .channels
            .keys()
            .filter_map(|topic| match Topic::of(topic) {
                Topic::Points(body) => Some(body.to_owned()),
                _ => None,
            });
        LogError::UnknownBody {
            body: body.into(),
            known: known.collect(),
        }
    }
}

/// Number and range of the parts of at most `size` items that `count` items are split into; at
/// least one part. The first part comes last, so that a state whose first part has been written is
/// complete, also in a log that was cut off.
fn parts(count: usize, size: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
    let size = size.max(1);
    (0..count.div_ceil(size).max(1)).rev().map(move |index| {
        let start = index * size;
        (index + 1, start..count.min(start + size))
    })
}

/// Whether all fields can be packed and have as many values as the points need.
fn check_fields(body: &str, cloud: &CloudView) -> Result<(), LogError> {
    for field in cloud.fields {
        if let Some(what) = point_cloud::objection(field.name, field.components) {
            return Err(LogError::Field {
                body: body.into(),
                field: field.name.into(),
                what,
            });
        }
        let expected = cloud.positions.count() * field.components;
        let found = field.values.len();
        if found != expected {
            return Err(LogError::FieldLength {
                body: body.into(),
                field: field.name.into(),
                expected,
                found,
            });
        }
    }
    Ok(())
}

fn write_error(path: &Path, is_resumable: bool, source: McapError) -> LogError {
    let path = path.into();
    match source {
        McapError::Io(source) if is_resumable => LogError::Interrupted { path, source },
        McapError::Io(source) => LogError::Io {
            action: "write",
            path,
            source,
        },
        source => LogError::Mcap { path, source },
    }
}
