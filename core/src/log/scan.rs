//! One pass over a log: finds its end, keeps the small messages and notes where the large are.
//!
//! Chunks that hold nothing but large messages are not unpacked; the message indexes behind them
//! tell enough. The summary at the end of the file is not needed, so an unfinished log is read
//! like any other, up to the first record that is incomplete or damaged.

use std::{
    collections::{BTreeMap, HashMap},
    fs::File,
    io::{BufReader, Read, Seek},
    path::{Path, PathBuf},
};

use mcap::{
    McapError,
    records::{MessageHeader, MessageIndex, Record, op},
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};
use serde::Deserialize;

use super::{
    CheckpointInfo, LogError, Progress, Series, series,
    topic::{self, Topic},
};

/// No chunk is unpacked to more bytes than this: a damaged size must not take all memory.
const MAX_RECORD_BYTES: usize = 1 << 33;

/// Bytes of the opcode and the length before each record.
const RECORD_HEAD: u64 = 9;

/// How a log ends.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// closed by its writer
    Finished,
    /// at this byte, at the end of a record or within one: the run was killed or is still going
    Unfinished {
        /// where the last complete record ends
        at: u64,
    },
    /// a damaged record at this byte; what comes after is not read
    Damaged {
        /// where the damaged record starts
        at: u64,
        /// what is wrong with it
        what: String,
    },
}

/// A record, or rather where it is in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    offset: u64,
    length: u64,
}

/// A message: the `ordinal`-th of its channel in the chunk at `place`.
#[derive(Clone, Copy, Debug)]
pub(super) struct MessagePlace {
    pub(super) place: Place,
    pub(super) channel: u16,
    pub(super) ordinal: usize,
    pub(super) log_time: u64,
}

/// A channel with the data of its schema.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) schema: Vec<u8>,
}

/// A message of topic `/index`.
#[derive(Deserialize)]
pub(super) struct IndexLine {
    pub(super) time: f64,
    pub(super) topic: String,
    pub(super) step: Option<u64>,
}

impl IndexLine {
    pub(super) fn parse(message: &[u8]) -> Result<Self, LogError> {
        serde_json::from_slice(message).map_err(|source| LogError::Json {
            topic: topic::INDEX.into(),
            source,
        })
    }
}

/// The file, and where in it we are.
pub(super) struct Source {
    pub(super) path: PathBuf,
    reader: BufReader<File>,
    position: u64,
    length: u64,
}

impl Source {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let error = |source| LogError::Io {
            action: "read",
            path: path.into(),
            source,
        };
        let file = File::open(path).map_err(error)?;
        let length = file.metadata().map_err(error)?.len();
        let mut source = Self {
            path: path.into(),
            reader: BufReader::new(file),
            position: 0,
            length,
        };
        let mut magic = [0; mcap::MAGIC.len()];
        if length < magic.len() as u64 {
            return Err(LogError::NotMcap { path: path.into() });
        }
        source.read(0, &mut magic)?;
        if magic != mcap::MAGIC {
            return Err(LogError::NotMcap { path: path.into() });
        }
        Ok(source)
    }

    fn read(&mut self, offset: u64, buffer: &mut [u8]) -> Result<(), LogError> {
        let mut read = || {
            // keeps what is buffered, which `seek` would not
            self.reader
                .seek_relative(offset as i64 - self.position as i64)?;
            self.position = offset;
            self.reader.read_exact(buffer)?;
            self.position += buffer.len() as u64;
            Ok(())
        };
        let result = read();
        if result.is_err() {
            self.position = self.reader.stream_position().unwrap_or_default();
        }
        result.map_err(|source| LogError::Io {
            action: "read",
            path: self.path.clone(),
            source,
        })
    }

    /// Opcode and place of the record at `offset`, `None` if it is incomplete.
    fn record(&mut self, offset: u64) -> Result<Option<(u8, Place)>, LogError> {
        let left = self.length.saturating_sub(offset);
        if left < RECORD_HEAD {
            return Ok(None);
        }
        let mut head = [0; RECORD_HEAD as usize];
        self.read(offset, &mut head)?;
        let [opcode, length @ ..] = head;
        let body = u64::from_le_bytes(length);
        Ok((body <= left - RECORD_HEAD).then_some((
            opcode,
            Place {
                offset,
                length: RECORD_HEAD + body,
            },
        )))
    }

    /// Visits the record at `place`, or if it is a chunk the records in it, after its checksum.
    pub(super) fn visit(
        &mut self,
        place: Place,
        mut visit: impl FnMut(Record) -> Result<(), LogError>,
    ) -> Result<(), LogError> {
        let path = self.path.clone();
        let damaged = |source| LogError::Damaged {
            path: path.clone(),
            offset: place.offset,
            source,
        };
        let mut reader = LinearReader::new_with_options(
            LinearReaderOptions::default()
                .with_skip_start_magic(true)
                .with_skip_end_magic(true)
                .with_prevalidate_chunk_crcs(true)
                .with_record_length_limit(MAX_RECORD_BYTES),
        );
        let mut done = 0;
        while let Some(event) = reader.next_event() {
            match event.map_err(damaged)? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let bytes = (wanted as u64).min(place.length - done) as usize;
                    self.read(place.offset + done, reader.insert(bytes))?;
                    reader.notify_read(bytes);
                    done += bytes as u64;
                }
                LinearReadEvent::Record { data, opcode } => {
                    if opcode == op::ATTACHMENT && !attachment_fits(data) {
                        return Err(damaged(McapError::UnexpectedEof));
                    }
                    visit(mcap::parse_record(opcode, data).map_err(damaged)?)?;
                }
            }
        }
        Ok(())
    }

    fn ends_with_magic(&mut self) -> Result<bool, LogError> {
        let mut magic = [0; mcap::MAGIC.len()];
        self.read(self.length - magic.len() as u64, &mut magic)?;
        Ok(magic == mcap::MAGIC)
    }
}

/// What one pass over the file finds.
#[derive(Default)]
pub(super) struct Contents {
    pub(super) run: Option<BTreeMap<String, String>>,
    pub(super) case_text: Option<String>,
    pub(super) channels: HashMap<u16, Channel>,
    /// chunks (and messages outside chunks), in file order
    pub(super) chunks: Vec<Place>,
    /// by topic
    pub(super) large: BTreeMap<String, Vec<MessagePlace>>,
    pub(super) probes: BTreeMap<String, Series>,
    pub(super) balance: Series,
    pub(super) progress: Vec<Progress>,
    /// exact time and step of large messages, by topic and log time
    exact: HashMap<(String, u64), CheckpointInfo>,
    schemas: HashMap<u16, Vec<u8>>,
}

impl Contents {
    /// Reads the whole log; the error is only for what is not a log at all or cannot be read.
    pub(super) fn scan(source: &mut Source) -> Result<(Self, Ending), LogError> {
        let mut contents = Self::default();
        let mut offset = mcap::MAGIC.len() as u64;
        let mut pending: Option<(Place, Vec<MessageIndex>)> = None;
        let ending = loop {
            let Some((opcode, place)) = source.record(offset)? else {
                break Ending::Unfinished { at: offset };
            };
            if opcode != op::MESSAGE_INDEX
                && let Some((chunk, indexes)) = pending.take()
                && let Err(error) = contents.chunk(source, chunk, &indexes)
            {
                break damage(error)?;
            }
            let taken = match opcode {
                op::CHUNK => {
                    pending = Some((place, Vec::new()));
                    Ok(())
                }
                op::DATA_END if source.ends_with_magic()? => break Ending::Finished,
                op::MESSAGE => {
                    contents.chunks.push(place);
                    contents.unpack(source, place)
                }
                _ => source.visit(place, |record| {
                    if let (Record::MessageIndex(index), Some((_, indexes))) =
                        (&record, &mut pending)
                    {
                        indexes.push(index.clone());
                    }
                    contents.record(record)
                }),
            };
            if let Err(error) = taken {
                break damage(error)?;
            }
            offset += place.length;
        };
        // the indexes behind the last chunk of an unfinished log may not be complete
        if let Some((chunk, _)) = pending
            && let Err(error) = contents.chunk(source, chunk, &[])
        {
            return Ok((contents, damage(error)?));
        }
        Ok((contents, ending))
    }

    /// A chunk with the message indexes that follow it.
    fn chunk(
        &mut self,
        source: &mut Source,
        place: Place,
        indexes: &[MessageIndex],
    ) -> Result<(), LogError> {
        let large = |index: &MessageIndex| {
            self.channels
                .get(&index.channel_id)
                .is_some_and(|c| Topic::of(&c.topic).is_large())
        };
        if indexes.is_empty() || !indexes.iter().all(large) {
            self.unpack(source, place)?;
        } else {
            for index in indexes {
                let mut entries = index.records.clone();
                entries.sort_by_key(|entry| entry.offset);
                let topic = &self.channels[&index.channel_id].topic;
                let messages = self.large.entry(topic.clone()).or_default();
                messages.extend(
                    entries
                        .iter()
                        .enumerate()
                        .map(|(ordinal, entry)| MessagePlace {
                            place,
                            channel: index.channel_id,
                            ordinal,
                            log_time: entry.log_time,
                        }),
                );
            }
        }
        self.chunks.push(place);
        Ok(())
    }

    fn unpack(&mut self, source: &mut Source, place: Place) -> Result<(), LogError> {
        let mut counts = HashMap::new();
        source.visit(place, |record| match record {
            Record::Message { header, data } => {
                let ordinal = counts.entry(header.channel_id).or_insert(0);
                let message = MessagePlace {
                    place,
                    channel: header.channel_id,
                    ordinal: *ordinal,
                    log_time: header.log_time,
                };
                *ordinal += 1;
                self.message(message, &header, &data)
            }
            record => self.record(record),
        })
    }

    fn record(&mut self, record: Record) -> Result<(), LogError> {
        match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, data.into_owned());
            }
            Record::Channel(channel) => {
                let schema = self
                    .schemas
                    .get(&channel.schema_id)
                    .cloned()
                    .unwrap_or_default();
                self.channels.insert(
                    channel.id,
                    Channel {
                        topic: channel.topic,
                        schema,
                    },
                );
            }
            Record::Attachment { header, data, .. } if header.name == "case.toml" => {
                self.case_text = Some(String::from_utf8_lossy(&data).into_owned());
            }
            Record::Metadata(metadata) if metadata.name == "run" => {
                self.run = Some(metadata.metadata);
            }
            _ => {}
        }
        Ok(())
    }

    fn message(
        &mut self,
        place: MessagePlace,
        header: &MessageHeader,
        data: &[u8],
    ) -> Result<(), LogError> {
        let Some(channel) = self.channels.get(&header.channel_id) else {
            return Ok(());
        };
        let json = |source| LogError::Json {
            topic: channel.topic.clone(),
            source,
        };
        match Topic::of(&channel.topic) {
            Topic::Points(_) | Topic::Checkpoint => {
                self.large
                    .entry(channel.topic.clone())
                    .or_default()
                    .push(place);
            }
            Topic::Index => {
                let IndexLine { time, topic, step } = IndexLine::parse(data)?;
                let info = CheckpointInfo {
                    time,
                    step: step.unwrap_or_default(),
                };
                self.exact.insert((topic, header.log_time), info);
            }
            Topic::Progress => self
                .progress
                .push(serde_json::from_slice(data).map_err(json)?),
            Topic::Balance => {
                if self.balance.columns.is_empty() {
                    self.balance = Series::new(series::columns(&channel.schema).map_err(json)?);
                }
                self.balance.push(data).map_err(json)?;
            }
            Topic::Probe(name) => {
                if !self.probes.contains_key(name) {
                    let columns = series::columns(&channel.schema).map_err(json)?;
                    self.probes.insert(name.into(), Series::new(columns));
                }
                if let Some(series) = self.probes.get_mut(name) {
                    series.push(data).map_err(json)?;
                }
            }
            Topic::Other => {}
        }
        Ok(())
    }

    /// Exact time and step of a large message.
    pub(super) fn exact(&self, topic: &str, log_time: u64) -> CheckpointInfo {
        let rounded = CheckpointInfo {
            time: log_time as f64 * 1e-9,
            step: 0,
        };
        self.exact
            .get(&(topic.to_owned(), log_time))
            .copied()
            .unwrap_or(rounded)
    }
}

/// Whether an attachment is long enough for its header and checksum; the library takes that for
/// granted.
fn attachment_fits(record: &[u8]) -> bool {
    let text_end = |start: usize| {
        let bytes = record.get(start..start.checked_add(4)?)?;
        let length = u32::from_le_bytes(bytes.try_into().ok()?);
        start.checked_add(4 + length as usize)
    };
    // two times, name, media type, length of the data; then the checksum
    text_end(16)
        .and_then(text_end)
        .is_some_and(|end| end + 8 + 4 <= record.len())
}

/// Damage ends the log there; any other error is one of the reader's.
fn damage(error: LogError) -> Result<Ending, LogError> {
    match error {
        LogError::Damaged { offset, source, .. } => Ok(Ending::Damaged {
            at: offset,
            what: source.to_string(),
        }),
        error => Err(error),
    }
}
