//! The messages of a log as they are written, undecoded: for programs that show a run elsewhere.

use mcap::records::{Record, op};

use super::{
    LogError,
    channels::{Channel, Channels},
    source::{Limit, RecordReader},
    topic::Topic,
};

/// A message as it stands in the log.
#[derive(Debug)]
pub struct RawMessage<'a> {
    /// its channel
    pub channel: &'a Channel,
    /// time as MCAP counts it, ns
    pub log_time: u64,
    /// the message, in the encoding of the channel
    pub data: &'a [u8],
}

/// A log that may still grow, read message by message.
pub struct Follow {
    source: RecordReader,
    offset: u64,
    channels: Channels,
    is_finished: bool,
}

impl Follow {
    /// From the record at `offset` on, with the channels that are known.
    pub(super) fn new(source: RecordReader, offset: u64, channels: Channels) -> Self {
        Self {
            source,
            offset,
            channels,
            is_finished: false,
        }
    }

    /// Visits the messages that were completed since the last call, but for checkpoints and index lines. Damaged chunks
    /// are left out.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn visit(&mut self, mut visit: impl FnMut(RawMessage)) -> Result<(), LogError> {
        self.source.update_length()?;
        while !self.is_finished
            && let Some((opcode, place)) = self.source.record(self.offset)?
        {
            self.is_finished = opcode == op::DATA_END;
            let read = self.source.visit(place, Limit::Points, |record| {
                match record {
                    Record::Message { header, data } => {
                        if let Some(channel) = self.channels.get(header.channel_id)
                            && !Topic::of(&channel.topic).is_for_resuming()
                        {
                            visit(RawMessage {
                                channel,
                                log_time: header.log_time,
                                data: &data,
                            });
                        }
                    }
                    record => self.channels.add(record),
                }
                Ok(())
            });
            if !matches!(read, Err(LogError::Damaged { .. })) {
                read?;
            }
            self.offset = place.end();
        }
        Ok(())
    }

    /// Whether another file has taken the place of the one that is read: a run was started or resumed with the same name.
    #[must_use]
    pub fn is_replaced(&self) -> bool {
        self.source.is_replaced()
    }
}
