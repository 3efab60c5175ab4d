//! Files that the program writes: complete under their names, or not there at all.
//!
//! One mechanism decides for all commands. A file is written under a temporary name in the folder of its place. That name is
//! created exclusively, so that neither a file of the user nor a link is written to. The file and its folder are
//! handed to the disk before and after the rename that gives the file its name: after a power cut either the old or the new file
//! is there. [`write_whole`] does this for exports, pictures and the files of a sweep.
//!
//! A log is written for hours, so its [`LogPlace`] is claimed before the case is composed: an empty lock file beside it,
//! `.<name>.lock`, is locked until the run has ended. Every command that would replace the log finds it locked. [`NamedLog`]
//! checks whether the name still leads to the log that the run writes.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use perimelt_core::log::{Destination, LogError, check_unused, leads_to, try_lock};
use tempfile::NamedTempFile;

use crate::interrupt::Unfinished;

/// Why a log cannot be written to a place.
#[derive(Debug, thiserror::Error)]
pub enum PlaceError {
    /// A folder, a pipe or a device.
    #[error("{path} is {what}, and a log is a regular file; give another `--out`", path = path.display())]
    NotAFile {
        /// The path as given.
        path: PathBuf,
        /// Kind of the file.
        what: &'static str,
    },
    /// It exists, and the command may not replace it.
    #[error(
        "{path} exists: `--force` replaces it, {}",
        if *is_log {
            format!("`perimelt resume {}` continues its run, `--out` names another log", path.display())
        } else {
            "`--out` names another file".into()
        },
        path = path.display()
    )]
    Exists {
        /// The path as given.
        path: PathBuf,
        /// Whether it is the log of a run.
        is_log: bool,
    },
    /// Another run writes there.
    #[error(transparent)]
    InUse(#[from] LogError),
    /// The name of the log leads to no file or to another one.
    #[error(
        "the log {path} was removed or replaced during the run, and what the run wrote is lost; start the run again",
        path = path.display()
    )]
    Lost {
        /// The log.
        path: PathBuf,
    },
    /// The operating system refuses.
    #[error("could not create the log {path}: {source}", path = path.display())]
    Io {
        /// The log.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// Treatment of an existing file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Keep it; the command fails.
    Keep,
    /// Keep it; the command fails with a message that the run of a log can be continued.
    KeepRun,
    /// Replace it: on request, or because the new log contains the old one.
    Replace,
}

impl Existing {
    /// Replaces with the option `--force` only.
    #[must_use]
    pub fn unless(self, force: bool) -> Self {
        if force { Self::Replace } else { self }
    }
}

/// The place of a log, claimed until this is dropped. Links lead to the file that is replaced.
#[derive(Debug)]
pub struct LogPlace {
    given: PathBuf,
    /// Without links.
    file: PathBuf,
    /// Removed when the place is released.
    _lock: LockFile,
}

impl LogPlace {
    /// Claims the place called `given`.
    ///
    /// # Errors
    /// It exists and is no regular file or not to be replaced, its symbolic links form a cycle, another run writes there, or
    /// the folder takes no files.
    pub fn claim(given: &Path, existing: Existing) -> Result<Self, PlaceError> {
        let failed = |source| PlaceError::Io {
            path: given.into(),
            source,
        };
        let file = behind_links(given).map_err(failed)?;
        let guard = || {
            if let Some(what) = irregular(&file) {
                let path = given.into();
                return Err(PlaceError::NotAFile { path, what });
            }
            if existing != Existing::Replace && file.exists() {
                return Err(PlaceError::Exists {
                    path: given.into(),
                    is_log: existing == Existing::KeepRun
                        && given.extension().is_some_and(|e| e == "mcap"),
                });
            }
            check_unused(&file).map_err(|_| in_use(given))
        };
        guard()?;
        let lock = LockFile::take(&file).map_err(failed)?;
        let lock = lock.ok_or_else(|| in_use(given))?;
        // another run may have put its log there before it released the lock
        guard()?;
        remove_leftovers(&file);
        Ok(Self {
            given: given.into(),
            file,
            _lock: lock,
        })
    }

    /// Whether no run has claimed or writes a place.
    #[must_use]
    pub fn is_free(given: &Path) -> bool {
        let file = behind_links(given).unwrap_or_else(|_| given.into());
        check_unused(&file).is_ok() && check_unused(&lock_path(&file)).is_ok()
    }

    /// The file to write at first. Unless it is put in place it is removed when it is dropped.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn begin(&self) -> Result<PendingLog<'_>, PlaceError> {
        let made = temporary(&self.file).and_then(|file| {
            let writable = file.as_file().try_clone()?;
            Ok(PendingLog {
                place: self,
                _unfinished: Unfinished::new(file.path()),
                writable: Some(writable),
                file,
            })
        });
        made.map_err(|source| self.failed(source))
    }

    fn failed(&self, source: io::Error) -> PlaceError {
        PlaceError::Io {
            path: self.given.clone(),
            source,
        }
    }
}

fn in_use(given: &Path) -> PlaceError {
    PlaceError::InUse(LogError::InUse { path: given.into() })
}

/// A log that is not in its place yet.
#[derive(Debug)]
pub struct PendingLog<'a> {
    place: &'a LogPlace,
    file: NamedTempFile,
    writable: Option<File>,
    _unfinished: Unfinished,
}

impl<'a> PendingLog<'a> {
    /// Destination for a writer of logs, whose messages name the place.
    ///
    /// # Panics
    /// The second call.
    pub fn destination(&mut self) -> Destination {
        let file = self.writable.take();
        Destination::new(
            file.expect("a log has one writer"),
            self.place.given.clone(),
        )
    }

    /// Gives the file the name of the log, which it replaces, once all that was written is on the disk.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn put_in_place(self) -> Result<NamedLog<'a>, PlaceError> {
        let place = self.place;
        let file = put(self.file, &place.file).map_err(|source| place.failed(source))?;
        Ok(NamedLog { place, file })
    }
}

/// A log that has its name.
#[derive(Debug)]
pub struct NamedLog<'a> {
    place: &'a LogPlace,
    file: File,
}

impl NamedLog<'_> {
    /// Whether the name leads to this log.
    ///
    /// # Errors
    /// It was removed or replaced.
    pub fn check(&self) -> Result<(), PlaceError> {
        if leads_to(&self.place.file, &self.file) {
            return Ok(());
        }
        Err(PlaceError::Lost {
            path: self.place.given.clone(),
        })
    }
}

/// Writes a file that takes its name when it is complete. A regular file or a link of that name is replaced.
///
/// # Errors
/// The name belongs to something else than a regular file, or an error of the operating system.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> io::Result<()> {
    // what a link leads to is not written to: the link is replaced
    if std::fs::symlink_metadata(path).is_ok_and(|data| !data.is_symlink())
        && let Some(what) = irregular(path)
    {
        return Err(io::Error::other(format!(
            "this is {what}, expected a regular file"
        )));
    }
    let file = temporary(path)?;
    let _unfinished = Unfinished::new(file.path());
    let mut writer = BufWriter::new(file.as_file());
    write(&mut writer)?;
    writer.flush()?;
    drop(writer);
    put(file, path).map(drop)
}

/// Renames a file to `path` between handing its data and its name to the disk.
fn put(file: NamedTempFile, path: &Path) -> io::Result<File> {
    file.as_file().sync_all()?;
    let file = file.persist(path)?;
    sync_folder(path)?;
    Ok(file)
}

#[cfg(unix)]
fn sync_folder(path: &Path) -> io::Result<()> {
    match File::open(folder_of(path))?.sync_all() {
        // some file systems cannot do this with folders
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        done => done,
    }
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) -> io::Result<()> {
    Ok(())
}

fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().unwrap_or(Path::new(""));
    match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    }
}

/// A new file beside `path` with a unique name: `.<name>.<six characters>.part`.
fn temporary(path: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    let prefix = hidden(path) + ".";
    builder.prefix(&prefix).suffix(PART);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // the mode of any new file, before the mask of the user
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(path))
}

const PART: &str = ".part";

/// `.<name>`, cut off where temporary names would become too long for file systems.
fn hidden(path: &Path) -> String {
    const LONGEST: usize = 200;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let end = (0..=name.len().min(LONGEST))
        .rev()
        .find(|at| name.is_char_boundary(*at));
    format!(".{}", &name[..end.unwrap_or(0)])
}

/// Removes temporary files that killed runs of this log left. Its place is claimed, so that no process writes them.
fn remove_leftovers(file: &Path) {
    let prefix = hidden(file) + ".";
    let Ok(entries) = std::fs::read_dir(folder_of(file)) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let middle = name
            .to_str()
            .and_then(|name| name.strip_prefix(&prefix)?.strip_suffix(PART));
        let is_ours =
            middle.is_some_and(|m| m.len() == 6 && m.chars().all(|c| c.is_ascii_alphanumeric()));
        if is_ours && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// An empty file that is locked while a log is written.
#[derive(Debug)]
struct LockFile {
    path: PathBuf,
    /// Has the lock while it is open.
    _file: File,
    /// Removes an empty file; one with content is the user's and stays.
    _unfinished: Option<Unfinished>,
}

fn lock_path(log: &Path) -> PathBuf {
    log.with_file_name(hidden(log) + ".lock")
}

impl LockFile {
    /// Locks the place of a log; `None` if another process has done so.
    fn take(log: &Path) -> io::Result<Option<Self>> {
        let path = lock_path(log);
        loop {
            let file = match File::create_new(&path) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    if !std::fs::symlink_metadata(&path).is_ok_and(|data| data.is_file()) {
                        return Err(io::Error::other(format!(
                            "{} is in the way; remove it",
                            path.display()
                        )));
                    }
                    // the lock of another run, which may have been killed
                    match File::options().write(true).open(&path) {
                        Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                        opened => opened?,
                    }
                }
                created => created?,
            };
            if !try_lock(&file) {
                return Ok(None);
            }
            // the process that held the lock may have removed the file meanwhile
            if leads_to(&path, &file) {
                let is_ours = file.metadata()?.len() == 0;
                let _unfinished = is_ours.then(|| Unfinished::new(&path));
                return Ok(Some(Self {
                    path,
                    _file: file,
                    _unfinished,
                }));
            }
        }
    }
}

impl Drop for LockFile {
    fn drop(&mut self) {
        if self._unfinished.is_some() {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// The file that a name stands for; it need not exist.
fn behind_links(given: &Path) -> io::Result<PathBuf> {
    /// Links that operating systems follow at most.
    const MOST: usize = 40;
    let mut file = given.to_path_buf();
    for _ in 0..MOST {
        match std::fs::read_link(&file) {
            Ok(target) => {
                let folder = file.parent().unwrap_or(Path::new(""));
                file = folder.join(target);
            }
            Err(_) => return Ok(file),
        }
    }
    Err(io::Error::other("its symbolic links form a cycle"))
}

/// Kind of a path that is no regular file; `None` where it does not exist or its metadata cannot be read.
fn irregular(file: &Path) -> Option<&'static str> {
    match std::fs::metadata(file) {
        Ok(data) if data.is_dir() => Some("a folder"),
        Ok(data) if !data.is_file() => Some("a device or a pipe"),
        _ => None,
    }
}

/// Creates a folder for files, unless it exists.
///
/// # Errors
/// A file of that name, or what the operating system says.
pub(crate) fn create_folder(path: &Path) -> std::io::Result<()> {
    match path.is_file() {
        true => Err(std::io::Error::other("this is a file, expected a folder")),
        false => std::fs::create_dir_all(path),
    }
}

/// `run.mcap` with `-plots`: `run-plots`, in the same folder.
pub(crate) fn beside(log: &Path, suffix: &str) -> PathBuf {
    let stem = log.file_stem().unwrap_or_default().to_string_lossy();
    log.with_file_name(format!("{stem}{suffix}"))
}

#[cfg(all(test, unix))]
mod tests;
