//! A log that may still be written, reopened when its file has changed.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use perimelt_core::log::{Log, LogError};

/// A log as it was last opened.
pub(crate) struct GrowingLog {
    path: PathBuf,
    log: Arc<Log>,
    seen: Seen,
}

/// Change of a log since it was last opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LogChange {
    /// None, or the file cannot be read at the moment.
    Unchanged,
    /// The run has written more.
    Grown,
    /// The log of another run.
    Replaced,
}

/// Properties of a file by which a change is detected.
#[derive(Clone, Copy, PartialEq)]
struct Seen {
    length: u64,
    modified: SystemTime,
}

impl Seen {
    fn of(path: &Path) -> Option<Seen> {
        let data = std::fs::metadata(path).ok()?;
        Some(Seen {
            length: data.len(),
            modified: data.modified().ok()?,
        })
    }
}

impl GrowingLog {
    /// Opens a log.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        // before the log, so that what is written meanwhile is not missed
        let seen = Seen::of(path).unwrap_or(Seen {
            length: 0,
            modified: SystemTime::UNIX_EPOCH,
        });
        Ok(Self {
            path: path.into(),
            log: Arc::new(Log::open(path)?),
            seen,
        })
    }

    /// The log as it was last opened.
    pub(crate) fn log(&self) -> &Arc<Log> {
        &self.log
    }

    /// Reopens the log if its file has changed.
    pub(crate) fn refresh(&mut self) -> LogChange {
        let Some(seen) = Seen::of(&self.path).filter(|seen| *seen != self.seen) else {
            return LogChange::Unchanged;
        };
        let Ok(log) = Log::open(&self.path) else {
            return LogChange::Unchanged;
        };
        let growth = if continues(&self.log, &log) {
            LogChange::Grown
        } else {
            LogChange::Replaced
        };
        (self.log, self.seen) = (Arc::new(log), seen);
        growth
    }

    /// Time since the file last changed.
    pub(crate) fn age(&self) -> Option<Duration> {
        self.seen.modified.elapsed().ok()
    }
}

fn continues(before: &Log, now: &Log) -> bool {
    let is_same =
        before.run().started == now.run().started && before.run().bodies == now.run().bodies;
    is_same
        && before
            .bodies()
            .all(|body| now.times(body).starts_with(before.times(body)))
}
