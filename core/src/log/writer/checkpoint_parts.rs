//! A checkpoint that is written to the log while it is made, so that it never stands in memory as a whole.

use std::io;

use super::{MAX_PART_BYTES, Writer};
use crate::log::{LogError, topic};

/// Bytes of a part of a checkpoint.
const PART_BYTES: usize = 1 << 26;

/// Memory for writing a state and a checkpoint of these sizes, bytes: the message of a state stays; its chunk, or the first part of a
/// checkpoint, another one and its chunk, are released.
pub fn memory_of_writing(state: usize, checkpoint: usize) -> usize {
    let state = state.min(MAX_PART_BYTES);
    state + state.max(checkpoint.min(3 * PART_BYTES))
}

/// The parts of a checkpoint. The first one is kept and written last, so that a checkpoint whose first part has been written is complete,
/// also in a log that was cut off.
pub(super) struct CheckpointParts<'a> {
    writer: &'a mut Writer,
    log_time: u64,
    /// The first part, once it is full.
    first: Vec<u8>,
    /// Number of the part that is being gathered, from one.
    number: usize,
    part: Vec<u8>,
    part_bytes: usize,
    failure: Option<LogError>,
}

impl<'a> CheckpointParts<'a> {
    pub(super) fn new(writer: &'a mut Writer, log_time: u64) -> Self {
        CheckpointParts {
            part_bytes: writer.part_bytes.min(PART_BYTES),
            writer,
            log_time,
            first: Vec::new(),
            number: 1,
            part: Vec::new(),
            failure: None,
        }
    }

    /// Keeps the first part, and writes every other one.
    fn end_part(&mut self) -> Result<(), LogError> {
        match self.number {
            1 => self.first = std::mem::take(&mut self.part),
            number => {
                let (time, part) = (self.log_time, &self.part);
                self.writer
                    .write_part(topic::CHECKPOINT, number, time, part)?;
                self.part.clear();
            }
        }
        self.number += 1;
        Ok(())
    }

    /// Writes the last part and the first one, if the checkpoint was `saved`.
    pub(super) fn finish<E: From<LogError>>(mut self, saved: Result<(), E>) -> Result<(), E> {
        if let Some(failure) = self.failure {
            return Err(failure.into());
        }
        saved?;
        if self.number == 1 || !self.part.is_empty() {
            self.end_part()?;
        }
        let (time, first) = (self.log_time, &self.first);
        Ok(self.writer.write_part(topic::CHECKPOINT, 1, time, first)?)
    }
}

impl io::Write for CheckpointParts<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let room = self.part_bytes - self.part.len();
        let taken = &bytes[..room.min(bytes.len())];
        self.part.extend_from_slice(taken);
        if self.part.len() == self.part_bytes {
            self.end_part().map_err(|failure| {
                let message = failure.to_string();
                self.failure = Some(failure);
                io::Error::other(message)
            })?;
        }
        Ok(taken.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
