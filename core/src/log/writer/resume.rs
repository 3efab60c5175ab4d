//! Starting a log from an older one.

use super::{Destination, RunHeader, Writer, leads_to};
use crate::log::{
    Log, LogError,
    scan::IndexLine,
    series,
    topic::{self, Topic},
};

impl Writer {
    /// Starts the log of a run resumed from checkpoint number `checkpoint` of an older log: describes the run and its case
    /// as [`Writer::begin`] does, copies everything logged up to and including the time of that checkpoint (of the
    /// checkpoints only that one and the one before), and continues from there. A step should therefore log its checkpoint
    /// last.
    ///
    /// # Errors
    /// No such checkpoint, the old log is damaged, the new one cannot be written or is the old.
    pub fn continue_from(
        old: &Log,
        destination: Destination,
        checkpoint: usize,
        header: RunHeader<'_>,
    ) -> Result<Self, LogError> {
        if leads_to(old.path(), &destination.file) {
            let path = destination.path;
            return Err(LogError::SameFile { path });
        }
        let (end, oldest_checkpoint) = old.resume_range(checkpoint)?;
        let RunHeader {
            run,
            case_name,
            case_text,
        } = header;
        let mut writer = Self::begin(destination, run, case_name, case_text)?;
        old.visit_messages(|topic, schema, header, data| {
            let outdated = header.log_time < oldest_checkpoint
                && match Topic::of(topic) {
                    Topic::Checkpoint | Topic::Part(topic::CHECKPOINT) => true,
                    Topic::Index => IndexLine::parse(data)?.topic == topic::CHECKPOINT,
                    _ => false,
                };
            if header.log_time > end || outdated {
                return Ok(());
            }
            if matches!(Topic::of(topic), Topic::Probe(_) | Topic::Balance) {
                let columns = series::columns(schema).map_err(|source| LogError::Json {
                    topic: topic.into(),
                    source,
                })?;
                writer.declare_series(topic, columns)?;
            }
            if let Topic::Part(first) = Topic::of(topic) {
                writer.declare_part(topic, first)?;
            }
            // other topics were added by another tool and do not belong to the run
            if let Some(channel) = writer.channels.get_mut(topic) {
                channel.next_sequence = header.sequence;
                writer.write(topic, header.log_time, data)?;
            }
            Ok(())
        })?;
        writer.clock.last = Some((old.checkpoints()[checkpoint].time, end));
        writer.flush()?;
        Ok(writer)
    }
}
