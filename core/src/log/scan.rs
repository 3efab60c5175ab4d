//! One pass over a log: finds its end, keeps the small messages and notes where the large are.
//!
//! Chunks with large messages only are not unpacked; the message indexes behind them are
//! sufficient. The summary at the end of the file is not needed, so an unfinished log is read
//! like any other, up to the first record that is incomplete or damaged. A damaged chunk of small messages is left out.

use std::collections::{BTreeMap, HashMap};

use mcap::records::{MessageHeader, MessageIndex, Record, op};
use serde::Deserialize;

use super::{
    CheckpointInfo, LogError, Progress, Series, series,
    source::{Place, Source},
    topic::{self, Topic},
};

/// How a log ends.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// closed by its writer
    Finished,
    /// at this byte, at the end of a record or within one: the run was killed or is still running
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

/// A chunk that cannot be read; the log goes on behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// where it starts, bytes
    pub at: u64,
    /// what is wrong with it
    pub what: String,
    /// states of a body that it contains
    pub states: usize,
}

/// A message: the `ordinal`-th of its channel in the chunk at `place`.
#[derive(Clone, Copy, Debug)]
pub(super) struct MessagePlace {
    pub(super) place: Place,
    pub(super) channel: u16,
    pub(super) ordinal: usize,
    pub(super) log_time: u64,
}

/// What the messages of a topic are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Channel {
    /// topic
    pub topic: String,
    /// encoding of its messages: `json`, `protobuf`
    pub encoding: String,
    /// form of its messages; empty for bytes of no form
    pub schema: Schema,
}

/// A schema of messages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Schema {
    /// name, such as `foxglove.PointCloud`
    pub name: String,
    /// language of the schema: `jsonschema`, `protobuf`
    pub encoding: String,
    /// the schema
    pub data: Vec<u8>,
}

/// The channels and schemas that were met so far, by number.
#[derive(Default)]
pub(super) struct Channels {
    channels: HashMap<u16, Channel>,
    schemas: HashMap<u16, Schema>,
}

impl Channels {
    /// The channel of a number.
    pub(super) fn get(&self, number: u16) -> Option<&Channel> {
        self.channels.get(&number)
    }

    /// Takes a record if it is a schema or a channel.
    pub(super) fn add(&mut self, record: Record) {
        match record {
            Record::Schema { header, data } => {
                let schema = Schema {
                    name: header.name,
                    encoding: header.encoding,
                    data: data.into_owned(),
                };
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned();
                let known = Channel {
                    topic: channel.topic,
                    encoding: channel.message_encoding,
                    schema: schema.unwrap_or_default(),
                };
                self.channels.insert(channel.id, known);
            }
            _ => {}
        }
    }
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

/// What one pass over the file finds.
#[derive(Default)]
pub(super) struct Contents {
    pub(super) run: Option<BTreeMap<String, String>>,
    pub(super) case_text: Option<String>,
    pub(super) channels: Channels,
    /// chunks (and messages outside chunks), in file order
    pub(super) chunks: Vec<Place>,
    /// by topic
    pub(super) large: BTreeMap<String, Vec<MessagePlace>>,
    pub(super) probes: BTreeMap<String, Series>,
    pub(super) balance: Series,
    pub(super) progress: Vec<Progress>,
    /// chunks of small messages that are lost
    pub(super) damage: Vec<Damage>,
    /// exact time and step of large messages, by topic and log time
    exact: HashMap<(String, u64), CheckpointInfo>,
}

impl Contents {
    /// Reads the whole log; the error is only for what is not a log at all or cannot be read.
    pub(super) fn scan(source: &mut Source) -> Result<(Self, Ending), LogError> {
        let mut contents = Self::default();
        contents.summary(source)?;
        let mut offset = mcap::MAGIC.len() as u64;
        let mut pending: Option<(Place, Vec<MessageIndex>)> = None;
        let ending = loop {
            let Some((opcode, place)) = source.record(offset)? else {
                break match source.is_closed_after(offset)? {
                    false => Ending::Unfinished { at: offset },
                    true => Ending::Damaged {
                        at: offset,
                        what: "the length of the record is wrong".into(),
                    },
                };
            };
            if opcode != op::MESSAGE_INDEX
                && let Some((chunk, indexes)) = pending.take()
            {
                contents.sound_chunk(source, chunk, &indexes)?;
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
            offset = place.end();
        };
        // the indexes behind the last chunk of an unfinished log may not be complete
        if let Some((chunk, _)) = pending {
            contents.sound_chunk(source, chunk, &[])?;
        }
        Ok((contents, ending))
    }

    /// Takes schemas and channels from the summary behind the data of a finished log, which repeats them: those in a
    /// damaged chunk are needed to read all others. Without a summary those of the chunks are left.
    fn summary(&mut self, source: &mut Source) -> Result<(), LogError> {
        let Some(mut offset) = source.summary_start()? else {
            return Ok(());
        };
        while let Some((opcode, place)) = source.record(offset)? {
            if matches!(opcode, op::SCHEMA | op::CHANNEL) {
                match source.visit(place, |record| self.record(record)) {
                    Err(LogError::Damaged { .. }) => return Ok(()),
                    done => done?,
                }
            }
            offset = place.end();
        }
        Ok(())
    }

    /// As [`Contents::chunk`]; a damaged one is noted and left out.
    fn sound_chunk(
        &mut self,
        source: &mut Source,
        place: Place,
        indexes: &[MessageIndex],
    ) -> Result<(), LogError> {
        match self.chunk(source, place, indexes) {
            Err(LogError::Damaged { offset, source, .. }) => {
                self.damage.push(Damage {
                    at: offset,
                    what: source.to_string(),
                    states: self.states(indexes),
                });
                Ok(())
            }
            done => done,
        }
    }

    /// States in the chunk that these message indexes follow, of the body that has the most.
    fn states(&self, indexes: &[MessageIndex]) -> usize {
        let of_a_body = indexes.iter().filter(|index| {
            let channel = self.channels.get(index.channel_id);
            channel.is_some_and(|c| matches!(Topic::of(&c.topic), Topic::Points(_)))
        });
        let counts = of_a_body.map(|index| index.records.len());
        counts.max().unwrap_or_default()
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
                .get(index.channel_id)
                .is_some_and(|c| Topic::of(&c.topic).is_large())
        };
        if indexes.is_empty() || !indexes.iter().all(large) {
            self.unpack(source, place)?;
        } else {
            for index in indexes {
                let mut entries = index.records.clone();
                entries.sort_by_key(|entry| entry.offset);
                let Some(channel) = self.channels.get(index.channel_id) else {
                    continue;
                };
                let messages = self.large.entry(channel.topic.clone()).or_default();
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
            Record::Attachment { header, data, .. } if header.name == "case.toml" => {
                self.case_text = Some(String::from_utf8_lossy(&data).into_owned());
            }
            Record::Metadata(metadata) if metadata.name == "run" => {
                self.run = Some(metadata.metadata);
            }
            record => self.channels.add(record),
        }
        Ok(())
    }

    fn message(
        &mut self,
        place: MessagePlace,
        header: &MessageHeader,
        data: &[u8],
    ) -> Result<(), LogError> {
        let Some(channel) = self.channels.get(header.channel_id) else {
            return Ok(());
        };
        let json = |source| LogError::Json {
            topic: channel.topic.clone(),
            source,
        };
        match Topic::of(&channel.topic) {
            Topic::Points(_) | Topic::Part(_) | Topic::Checkpoint => {
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
                    self.balance =
                        Series::new(series::columns(&channel.schema.data).map_err(json)?);
                }
                self.balance.push(data).map_err(json)?;
            }
            Topic::Probe(name) => {
                if !self.probes.contains_key(name) {
                    let columns = series::columns(&channel.schema.data).map_err(json)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Messages have their exact time in the index; of one whose index line is lost the time is that of the record, ns.
    #[test]
    fn a_message_without_an_index_line_has_the_time_of_its_record() {
        let mut contents = Contents::default();
        let exact = CheckpointInfo {
            time: 2.5 + 1e-12,
            step: 7,
        };
        let key = ("/checkpoint".to_owned(), 2_500_000_000);
        contents.exact.insert(key, exact);
        let found = contents.exact("/checkpoint", 2_500_000_000);
        assert_eq!((found.time, found.step), (2.5 + 1e-12, 7));
        for (topic, log_time, time) in [
            ("/checkpoint", 3_000_000_000, 3.0),
            ("/points", 2_500_000_000, 2.5),
        ] {
            let found = contents.exact(topic, log_time);
            // rounding of one product
            assert!((found.time - time).abs() < 1e-15 * time, "{}", found.time);
            assert_eq!(found.step, 0);
        }
    }
}
