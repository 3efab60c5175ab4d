//! The file of a log, read record by record.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek},
    path::{Path, PathBuf},
};

use mcap::{
    McapError,
    records::{Record, op},
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use super::LogError;

/// Most bytes to which a record may be unpacked: a few bytes that were made to unpack to gigabytes must not take all memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Limit {
    /// Time series, of which a writer puts about a megabyte into a chunk; all of them count together, see
    /// [`SERIES_RATIO`].
    Series,
    /// A point cloud: positions do not shrink by the ratio that zeros do.
    Points,
    /// A checkpoint, which may consist of zeros: the limit is that of a message.
    Checkpoint,
}

/// Bytes of the largest chunk of time series.
pub(super) const SERIES_BYTES: u64 = 1 << 26;

/// All time series of a log may be unpacked to this many bytes, or to [`SERIES_RATIO`] times the file.
const ALL_SERIES_BYTES: u64 = 1 << 28;

/// Rows of JSON are packed by a factor below one hundred.
const SERIES_RATIO: u64 = 1000;

/// A point cloud of any ratio.
const POINTS_BYTES: u64 = 1 << 28;

/// Uniform fields on a regular grid are packed by a factor of some hundred.
const POINTS_RATIO: u64 = 1000;

/// A message of 2 GiB, with its head and what else its chunk has.
const MESSAGE_BYTES: u64 = (1 << 31) + (1 << 16);

/// Bytes of the opcode and the length before each record.
const RECORD_HEAD: u64 = 9;

/// The place of a record in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordPlace {
    pub(super) offset: u64,
    pub(super) length: u64,
}

impl RecordPlace {
    /// Where the next record starts.
    pub(super) fn end(&self) -> u64 {
        self.offset + self.length
    }
}

/// The file and the position of the reader.
pub(super) struct RecordReader {
    path: PathBuf,
    reader: BufReader<File>,
    position: u64,
    length: u64,
    /// Bytes to which time series were unpacked so far.
    series: u64,
}

impl RecordReader {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let error = |source| LogError::Io {
            action: "read",
            path: path.into(),
            source,
        };
        // opening a pipe would block until a writer opens it
        if !std::fs::metadata(path).map_err(error)?.is_file() {
            return Err(LogError::NotAFile { path: path.into() });
        }
        let file = File::open(path).map_err(error)?;
        let length = file.metadata().map_err(error)?.len();
        let mut source = Self {
            path: path.into(),
            reader: BufReader::new(file),
            position: 0,
            length,
            series: 0,
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

    /// Updates the length of a file that grows.
    pub(super) fn update_length(&mut self) -> Result<(), LogError> {
        self.length = self.length_now().map_err(|source| LogError::Io {
            action: "read",
            path: self.path.clone(),
            source,
        })?;
        Ok(())
    }

    fn length_now(&self) -> io::Result<u64> {
        Ok(self.reader.get_ref().metadata()?.len())
    }

    /// Whether another file has the name of this one now. A file that only grows is never shorter than before.
    pub(super) fn is_replaced(&self) -> bool {
        let of_name = || std::fs::metadata(&self.path).map(|data| data.len());
        match (self.length_now(), of_name(), self.length_now()) {
            (Ok(before), Ok(named), Ok(after)) => named < before || named > after,
            _ => false,
        }
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
    pub(super) fn record(&mut self, offset: u64) -> Result<Option<(u8, RecordPlace)>, LogError> {
        let left = self.length.saturating_sub(offset);
        if left < RECORD_HEAD {
            return Ok(None);
        }
        let mut head = [0; RECORD_HEAD as usize];
        self.read(offset, &mut head)?;
        let [opcode, length @ ..] = head;
        let body = u64::from_le_bytes(length);
        Ok((body <= left - RECORD_HEAD).then(|| {
            let length = RECORD_HEAD + body;
            (opcode, RecordPlace { offset, length })
        }))
    }

    /// Visits the record at `place`, or if it is a chunk the records in it, after its checksum.
    pub(super) fn visit(
        &mut self,
        place: RecordPlace,
        limit: Limit,
        mut visit: impl FnMut(Record) -> Result<(), LogError>,
    ) -> Result<(), LogError> {
        let path = self.path.clone();
        let damaged = |source| LogError::Damaged {
            path: path.clone(),
            offset: place.offset,
            source,
        };
        let unpacked = self.unpacked_size(place)?.unwrap_or(place.length);
        let most = match limit {
            Limit::Series => {
                let all = ALL_SERIES_BYTES.max(self.length.saturating_mul(SERIES_RATIO));
                SERIES_BYTES.min(all.saturating_sub(self.series))
            }
            Limit::Points => POINTS_BYTES
                .max(place.length.saturating_mul(POINTS_RATIO))
                .min(MESSAGE_BYTES),
            Limit::Checkpoint => MESSAGE_BYTES,
        };
        if unpacked > most {
            return Err(damaged(McapError::ChunkTooLarge(unpacked)));
        }
        if limit == Limit::Series {
            self.series += unpacked;
        }
        let mut reader = LinearReader::new_with_options(
            LinearReaderOptions::default()
                .with_skip_start_magic(true)
                .with_skip_end_magic(true)
                .with_prevalidate_chunk_crcs(true)
                .with_record_length_limit(most.max(place.length) as usize),
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

    /// Bytes of the records of a chunk, `None` for another record. Refuses a chunk whose records end elsewhere than the chunk;
    /// the library counts below zero there.
    pub(super) fn unpacked_size(&mut self, place: RecordPlace) -> Result<Option<u64>, LogError> {
        // two times, size of the records when unpacked, checksum, length of the name of the compression
        const FIXED: usize = RECORD_HEAD as usize + 8 + 8 + 8 + 4 + 4;
        let mut head = [0; FIXED];
        if place.length < FIXED as u64 {
            return Ok(None); // too short for a chunk: the library says so
        }
        self.read(place.offset, &mut head)?;
        if head[0] != op::CHUNK {
            return Ok(None);
        }
        // after the two times
        let unpacked = head[RECORD_HEAD as usize + 16..].first_chunk();
        let unpacked = unpacked.map_or(u64::MAX, |bytes| u64::from_le_bytes(*bytes));
        let name = head
            .last_chunk()
            .map_or(0, |name| u32::from_le_bytes(*name));
        let size_at = FIXED as u64 + u64::from(name);
        let available = place.length.saturating_sub(size_at + 8);
        let mut size = [0; 8];
        if size_at + 8 <= place.length {
            self.read(place.offset + size_at, &mut size)?;
        }
        let header = u64::from_le_bytes(size);
        if header == available {
            return Ok(Some(unpacked));
        }
        Err(LogError::Damaged {
            path: self.path.clone(),
            offset: place.offset,
            source: McapError::BadChunkLength { header, available },
        })
    }

    /// Start of the first complete chunk after `offset`, by the name of its compression.
    pub(super) fn find_chunk(&mut self, offset: u64) -> Result<Option<u64>, LogError> {
        /// Bytes that are looked through: case and description of a run take far less.
        const MOST: u64 = 1 << 24;
        /// Length and name.
        const ZSTD: &[u8] = b"\x04\0\0\0zstd";
        // two times, size of the records when unpacked, checksum
        const BEFORE: u64 = RECORD_HEAD + 8 + 8 + 8 + 4;
        let mut bytes = vec![0; self.length.saturating_sub(offset).min(MOST) as usize];
        self.read(offset, &mut bytes)?;
        for (at, name) in (0..).zip(bytes.windows(ZSTD.len())) {
            if name == ZSTD && at > BEFORE {
                let start = offset + at - BEFORE;
                if matches!(self.record(start)?, Some((op::CHUNK, _))) {
                    return Ok(Some(start));
                }
            }
        }
        Ok(None)
    }

    /// Whether a record that is complete, or the end of the file, follows at `offset`.
    pub(super) fn goes_on_at(&mut self, offset: u64) -> Result<bool, LogError> {
        let follows = self.record(offset)?;
        Ok(follows.is_some_and(|(opcode, _)| (op::HEADER..=op::DATA_END).contains(&opcode)))
    }

    /// Where the summary of a finished file starts, by its footer; `None` without one.
    pub(super) fn summary_start(&mut self) -> Result<Option<u64>, LogError> {
        // the footer: start of the summary, start of its index, checksum
        const FOOTER: u64 = RECORD_HEAD + 8 + 8 + 4;
        let end = self.length.checked_sub(mcap::MAGIC.len() as u64);
        let Some(at) = end.and_then(|end| end.checked_sub(FOOTER)) else {
            return Ok(None);
        };
        if !self.ends_with_magic()? {
            return Ok(None);
        }
        let mut footer = [0; FOOTER as usize];
        self.read(at, &mut footer)?;
        let start = footer[RECORD_HEAD as usize..].first_chunk();
        let start = start.map_or(0, |bytes| u64::from_le_bytes(*bytes));
        Ok((footer[0] == op::FOOTER && start > 0 && start < at).then_some(start))
    }

    /// Whether the file continues after `offset` and was closed by its writer.
    pub(super) fn is_closed_after(&mut self, offset: u64) -> Result<bool, LogError> {
        Ok(offset + (mcap::MAGIC.len() as u64) < self.length && self.ends_with_magic()?)
    }

    pub(super) fn ends_with_magic(&mut self) -> Result<bool, LogError> {
        let mut magic = [0; mcap::MAGIC.len()];
        self.read(self.length - magic.len() as u64, &mut magic)?;
        Ok(magic == mcap::MAGIC)
    }
}

/// Whether an attachment is long enough for its header and checksum; the library does not
/// check it.
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
