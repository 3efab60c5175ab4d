//! Where a log is written: in a file beside it with `.part` in its name, until it contains what every log needs.

use std::io;
use std::path::{Path, PathBuf};

use perimelt_core::log::check_unused;

/// Why a log cannot be written to a place.
#[derive(Debug, thiserror::Error)]
pub enum PlaceError {
    /// A folder, a pipe or a device.
    #[error("{path} is {what}, and a log is a regular file; give another `--out`", path = path.display())]
    NotAFile {
        /// As given, or with `.part`.
        path: PathBuf,
        /// What it is.
        what: &'static str,
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

/// The place of a log. Links lead to the file that is replaced.
#[derive(Clone, Debug)]
pub struct Place {
    given: PathBuf,
    /// Without links.
    file: PathBuf,
    part: PathBuf,
}

impl Place {
    /// The place called `given`.
    ///
    /// # Errors
    /// It exists and is no regular file, or its links lead in a circle.
    pub fn new(given: &Path) -> Result<Self, PlaceError> {
        let file = behind_links(given).map_err(|source| PlaceError::Io {
            path: given.into(),
            source,
        })?;
        check_kind(given, &file)?;
        let mut part = file.clone().into_os_string();
        part.push(".part");
        let part = PathBuf::from(part);
        check_kind(&part, &part)?;
        Ok(Self {
            given: given.into(),
            file,
            part,
        })
    }

    /// The file to write at first. Unless it is put in place it is removed when the guard is dropped.
    pub fn begin(&self) -> Part<'_> {
        Part {
            place: self,
            is_put: false,
        }
    }
}

/// A log that is not in its place yet. Declare it before the writer of the log, which has to be dropped first.
#[derive(Debug)]
pub struct Part<'a> {
    place: &'a Place,
    is_put: bool,
}

impl Part<'_> {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.place.part
    }

    /// Gives the file the name of the log, which it replaces.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn put_in_place(mut self) -> Result<(), PlaceError> {
        let Place { given, file, part } = self.place;
        std::fs::rename(part, file).map_err(|source| PlaceError::Io {
            path: given.clone(),
            source,
        })?;
        self.is_put = true;
        Ok(())
    }
}

impl Drop for Part<'_> {
    fn drop(&mut self) {
        // another run may be writing it
        if !self.is_put && check_unused(self.path()).is_ok() {
            let _ = std::fs::remove_file(self.path());
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
    Err(io::Error::other("its links lead in a circle"))
}

fn check_kind(shown: &Path, file: &Path) -> Result<(), PlaceError> {
    let refuse = |what| {
        let path = shown.into();
        Err(PlaceError::NotAFile { path, what })
    };
    match std::fs::metadata(file) {
        Ok(data) if data.is_dir() => refuse("a folder"),
        Ok(data) if !data.is_file() => refuse("a device or a pipe"),
        // what has no name yet or cannot be looked at is refused when it is opened
        _ => Ok(()),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn links_lead_to_the_file_that_is_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("data")).expect("a folder");
        // the second link leads to a file that does not exist yet
        symlink("second", at("first")).expect("a link");
        symlink("data/log", at("second")).expect("a link");
        let place = Place::new(&at("first")).expect("a place");
        let part = place.begin();
        std::fs::write(part.path(), "log").expect("writable");
        assert_eq!(part.path(), at("data/log.part"));
        part.put_in_place().expect("renamed");
        assert_eq!(std::fs::read(at("first")).expect("readable"), b"log");
        assert!(at("second").is_symlink() && !at("data/log.part").exists());
        symlink("circle", at("circle")).expect("a link");
        let refused = Place::new(&at("circle")).expect_err("a circle").to_string();
        assert!(refused.contains("lead in a circle"), "{refused}");
    }

    #[test]
    fn what_was_begun_and_failed_is_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let place = Place::new(&folder.path().join("log")).expect("a place");
        let part = place.begin();
        let path = part.path().to_path_buf();
        std::fs::write(&path, "beginning").expect("writable");
        drop(part);
        assert!(!path.exists());
        let refused = Place::new(folder.path()).expect_err("a folder").to_string();
        assert!(
            refused.contains("is a folder, and a log is a regular file"),
            "{refused}"
        );
    }
}
