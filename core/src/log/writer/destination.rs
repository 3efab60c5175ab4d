//! The file of a log that is written.

use std::{
    fs::{File, TryLockError},
    path::{Path, PathBuf},
    thread::sleep,
    time::Duration,
};

use crate::log::LogError;

/// Locks a file as long as it is open; false where another process has locked it. A process that starts another one shares its
/// locks with it for a moment: a few attempts are made.
pub fn try_lock(file: &File) -> bool {
    const ATTEMPTS: usize = 10;
    const WAIT: Duration = Duration::from_millis(10);
    for _ in 0..ATTEMPTS {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => sleep(WAIT),
            // some file systems have no locks
            Ok(()) | Err(TryLockError::Error(_)) => return true,
        }
    }
    false
}

/// Locks a log for the run that writes it, as long as the file is open. Readers need no lock.
pub(super) fn lock(file: &File, path: &Path) -> Result<(), LogError> {
    match try_lock(file) {
        true => Ok(()),
        false => Err(LogError::InUse { path: path.into() }),
    }
}

/// Refuses a log that a run is writing.
///
/// # Errors
/// [`LogError::InUse`].
pub fn check_unused(path: &Path) -> Result<(), LogError> {
    // opening a pipe would block until a reader opens it
    if !path.is_file() {
        return Ok(());
    }
    match File::options().write(true).open(path) {
        Ok(file) => lock(&file, path),
        Err(_) => Ok(()),
    }
}

/// A file for a log, and the name that messages use for it.
#[derive(Debug)]
pub struct Destination {
    pub(super) path: PathBuf,
    pub(super) file: File,
}

impl Destination {
    /// An open file that will be called `path`.
    pub fn new(file: File, path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            file,
        }
    }

    /// The file at `path`, which is made if there is none; nothing is cut off yet.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, LogError> {
        let path = path.as_ref();
        let mut options = File::options();
        let file = options.create(true).write(true).truncate(false).open(path);
        let file = file.map_err(|source| LogError::Io {
            action: "create",
            path: path.into(),
            source,
        })?;
        Ok(Self::new(file, path))
    }
}

/// Whether a name leads to an open file.
#[cfg(unix)]
#[must_use]
pub fn leads_to(path: &Path, file: &File) -> bool {
    use std::os::unix::fs::MetadataExt;
    let is_same = |named: std::fs::Metadata, open: std::fs::Metadata| {
        (named.dev(), named.ino()) == (open.dev(), open.ino())
    };
    match (std::fs::metadata(path), file.metadata()) {
        (Ok(named), Ok(open)) => is_same(named, open),
        _ => false,
    }
}

/// Whether a name leads to an open file; without numbers of files as far as its length tells.
#[cfg(not(unix))]
#[must_use]
pub fn leads_to(path: &Path, file: &File) -> bool {
    match (std::fs::metadata(path), file.metadata()) {
        (Ok(named), Ok(open)) => named.len() == open.len(),
        _ => false,
    }
}
