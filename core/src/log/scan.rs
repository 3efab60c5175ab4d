//! One pass over a log: finds its end, keeps the small messages and the places of the large ones.
//!
//! Chunks with large messages only are not unpacked; the message indexes behind them are
//! sufficient. The summary at the end of the file is not needed, so an unfinished log is read
//! like any other, up to the first incomplete record. Damaged parts are left out, see [`Damage`].

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashMap},
};

use mcap::records::{MessageHeader, MessageIndex, Record, op};
use serde::Deserialize;

use super::{
    CheckpointInfo, LogError, Progress, Series,
    channels::Channels,
    series,
    source::{Limit, RecordPlace, RecordReader, SERIES_BYTES},
    topic::{self, Topic},
};

const WRONG_LENGTH: &str = "the length of the record is wrong";

/// Profile of the MCAP files that Perimelt writes.
pub(super) const PROFILE: &str = "perimelt";

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

/// A part of a log that cannot be read, with readable parts behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// what it is, such as `a chunk`
    pub part: Cow<'static, str>,
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
    pub(super) place: RecordPlace,
    pub(super) channel: u16,
    pub(super) ordinal: usize,
    pub(super) log_time: u64,
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

/// Contents of a log, by one pass over the file.
#[derive(Default)]
pub(super) struct Contents {
    pub(super) run: Option<BTreeMap<String, String>>,
    pub(super) case_text: Option<String>,
    pub(super) channels: Channels,
    /// whether the header says that Perimelt wrote it
    pub(super) is_ours: bool,
    /// chunks (and messages outside chunks), in file order, with what they may have
    pub(super) chunks: Vec<(RecordPlace, Limit)>,
    /// by topic
    pub(super) large: BTreeMap<String, Vec<MessagePlace>>,
    pub(super) probes: BTreeMap<String, Series>,
    pub(super) balance: Series,
    pub(super) progress: Vec<Progress>,
    /// parts that are lost
    pub(super) damage: Vec<Damage>,
    /// exact time and step of large messages, by topic and log time
    exact: HashMap<(String, u64), CheckpointInfo>,
    /// starts of chunks by the summary of a finished log, in order
    known_chunks: Vec<u64>,
}

impl Contents {
    /// Reads the whole log; the error is only for what is not a log at all or cannot be read.
    pub(super) fn scan(source: &mut RecordReader) -> Result<(Self, Ending), LogError> {
        let mut contents = Self::default();
        contents.summary(source)?;
        contents.known_chunks.sort_unstable();
        let mut offset = mcap::MAGIC.len() as u64;
        let mut pending: Option<(RecordPlace, Vec<MessageIndex>)> = None;
        let ending = loop {
            let Some((opcode, place)) = source.record(offset)? else {
                let what = WRONG_LENGTH.to_owned();
                if let Some(next) = contents.chunk_after(source, offset)? {
                    contents.lose("a record", offset, what);
                    offset = next;
                    continue;
                }
                break match source.is_closed_after(offset)? {
                    true => Ending::Damaged { at: offset, what },
                    false => Ending::Unfinished { at: offset },
                };
            };
            // a record does not reach into a chunk that the summary names
            if let Some(next) = contents.known_chunk_after(offset)
                && next < place.end()
            {
                contents.lose("a record", offset, WRONG_LENGTH.into());
                offset = next;
                continue;
            }
            if opcode != op::MESSAGE_INDEX
                && let Some((chunk, indexes)) = pending.take()
            {
                contents.sound_chunk(source, chunk, &indexes)?;
            }
            if opcode == op::DATA_END && source.ends_with_magic()? {
                break Ending::Finished;
            }
            match contents.take(source, opcode, place, &mut pending) {
                Err(LogError::Damaged {
                    offset: at,
                    source: what,
                    ..
                }) => {
                    let what = what.to_string();
                    let Some(next) = contents.after_damage(source, place, at)? else {
                        break Ending::Damaged { at, what };
                    };
                    contents.lose(part_name(opcode), at, what);
                    offset = next;
                }
                taken => {
                    taken?;
                    offset = place.end();
                    // the library does not check what is behind the entries of metadata
                    if opcode == op::METADATA
                        && !source.goes_on_at(offset)?
                        && let Some(next) = contents.chunk_after(source, place.offset)?
                    {
                        contents.lose(part_name(opcode), place.offset, WRONG_LENGTH.into());
                        offset = next;
                    }
                }
            }
        };
        // The indexes behind the last chunk of an unfinished log may be incomplete. A chunk that is larger than those of time
        // series has one state, and one index.
        if let Some((chunk, indexes)) = pending {
            let size = source.unpacked_size(chunk).ok().flatten();
            let is_large = size.is_some_and(|size| size > SERIES_BYTES);
            let indexes = if is_large { &indexes[..] } else { &[] };
            contents.sound_chunk(source, chunk, indexes)?;
        }
        Ok((contents, ending))
    }

    /// Adds a record; `pending` is a chunk whose message indexes follow.
    fn take(
        &mut self,
        source: &mut RecordReader,
        opcode: u8,
        place: RecordPlace,
        pending: &mut Option<(RecordPlace, Vec<MessageIndex>)>,
    ) -> Result<(), LogError> {
        match opcode {
            op::CHUNK => {
                *pending = Some((place, Vec::new()));
                Ok(())
            }
            op::MESSAGE => {
                self.chunks.push((place, Limit::Series));
                self.unpack(source, place)
            }
            _ => source.visit(place, Limit::Series, |record| {
                if let (Record::MessageIndex(index), Some((_, indexes))) = (&record, &mut *pending)
                {
                    indexes.push(index.clone());
                }
                self.record(record)
            }),
        }
    }

    /// Where the log continues after the record at `place`, which is damaged `at` this byte.
    fn after_damage(
        &self,
        source: &mut RecordReader,
        place: RecordPlace,
        at: u64,
    ) -> Result<Option<u64>, LogError> {
        // if its length is right, only this record is left out
        match source.goes_on_at(place.end())? {
            true => Ok(Some(place.end())),
            false => self.chunk_after(source, at),
        }
    }

    /// Reads schemas and channels from the summary behind the data of a finished log, which repeats them: those in a
    /// damaged chunk are needed to read all others. Without a summary only the chunks provide them.
    fn summary(&mut self, source: &mut RecordReader) -> Result<(), LogError> {
        let Some(mut offset) = source.summary_start()? else {
            return Ok(());
        };
        while let Some((opcode, place)) = source.record(offset)? {
            if matches!(opcode, op::SCHEMA | op::CHANNEL | op::CHUNK_INDEX) {
                match source.visit(place, Limit::Series, |record| self.record(record)) {
                    Err(LogError::Damaged { .. }) => return Ok(()),
                    done => done?,
                }
            }
            offset = place.end();
        }
        Ok(())
    }

    /// [`Contents::chunk`]; a damaged chunk is listed and left out.
    fn sound_chunk(
        &mut self,
        source: &mut RecordReader,
        place: RecordPlace,
        indexes: &[MessageIndex],
    ) -> Result<(), LogError> {
        match self.chunk(source, place, indexes) {
            Err(LogError::Damaged { offset, source, .. }) => {
                let states = self.states(indexes);
                self.lose("a chunk", offset, source.to_string());
                if let Some(lost) = self.damage.last_mut() {
                    lost.states = states;
                }
                Ok(())
            }
            done => done,
        }
    }

    /// Lists a part that cannot be read.
    pub(super) fn lose(&mut self, part: impl Into<Cow<'static, str>>, at: u64, what: String) {
        self.damage.push(Damage {
            part: part.into(),
            at,
            what,
            states: 0,
        });
    }

    fn known_chunk_after(&self, offset: u64) -> Option<u64> {
        let later = self.known_chunks.partition_point(|start| *start <= offset);
        self.known_chunks.get(later).copied()
    }

    /// Start of the first chunk after `offset` by the summary. Without a summary the file is searched before the first
    /// chunk only, where the case and the description of the run are.
    fn chunk_after(&self, source: &mut RecordReader, offset: u64) -> Result<Option<u64>, LogError> {
        match self.known_chunk_after(offset) {
            Some(start) => Ok(Some(start)),
            None if self.chunks.is_empty() => source.find_chunk(offset),
            None => Ok(None),
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
        source: &mut RecordReader,
        place: RecordPlace,
        indexes: &[MessageIndex],
    ) -> Result<(), LogError> {
        let large = |index: &MessageIndex| {
            self.channels
                .get(index.channel_id)
                .is_some_and(|c| Topic::of(&c.topic).is_large())
        };
        let mut limit = Limit::Series;
        if indexes.is_empty() || !indexes.iter().all(large) {
            self.unpack(source, place)?;
        } else {
            limit = Limit::Points;
            for index in indexes {
                let mut entries = index.records.clone();
                entries.sort_by_key(|entry| entry.offset);
                let Some(channel) = self.channels.get(index.channel_id) else {
                    continue;
                };
                if is_of_checkpoint(&channel.topic) {
                    limit = Limit::Checkpoint;
                }
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
        self.chunks.push((place, limit));
        Ok(())
    }

    fn unpack(&mut self, source: &mut RecordReader, place: RecordPlace) -> Result<(), LogError> {
        let mut counts = HashMap::new();
        source.visit(place, Limit::Series, |record| match record {
            Record::Message { header, data } => {
                let ordinal = counts.entry(header.channel_id).or_insert(0);
                let message = MessagePlace {
                    place,
                    channel: header.channel_id,
                    ordinal: *ordinal,
                    log_time: header.log_time,
                };
                *ordinal += 1;
                match self.message(message, &header, &data) {
                    Err(error @ LogError::Json { .. }) => {
                        // one line for all messages of a chunk
                        if self
                            .damage
                            .last()
                            .is_none_or(|lost| lost.at != place.offset)
                        {
                            self.lose("a message", place.offset, error.to_string());
                        }
                        Ok(())
                    }
                    done => done,
                }
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
            Record::Header(header) => self.is_ours = header.profile == PROFILE,
            Record::ChunkIndex(index) => self.known_chunks.push(index.chunk_start_offset),
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

/// Name of a record in messages.
fn part_name(opcode: u8) -> &'static str {
    match opcode {
        op::ATTACHMENT => "an attachment",
        op::METADATA => "a record of metadata",
        _ => "a record",
    }
}

/// Whether a topic has checkpoints or parts of them.
pub(super) fn is_of_checkpoint(name: &str) -> bool {
    matches!(
        Topic::of(name),
        Topic::Checkpoint | Topic::Part(topic::CHECKPOINT)
    )
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
