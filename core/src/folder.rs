//! The folder from which the relative paths of a case start, while its text is read.
//!
//! Values that a case gives by a file ([`crate::InTime`]) are read together with the keys, so that a mistake in the file is shown at
//! its key. A deserialiser has no arguments, so that the folder is kept by the thread for that time.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

thread_local! {
    static FOLDER: RefCell<PathBuf> = const { RefCell::new(PathBuf::new()) };
}

/// Calls `read`, in which relative paths start at `folder`.
pub fn within<T>(folder: &Path, read: impl FnOnce() -> T) -> T {
    /// Sets the former folder back, also if `read` panics.
    struct Former(PathBuf);
    impl Drop for Former {
        fn drop(&mut self) {
            FOLDER.set(std::mem::take(&mut self.0));
        }
    }
    let _former = Former(FOLDER.replace(folder.to_path_buf()));
    read()
}

/// A path as it is meant now; the working directory where no folder is set.
pub fn path(path: &Path) -> PathBuf {
    FOLDER.with_borrow(|folder| folder.join(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_start_at_the_innermost_folder() {
        let file = Path::new("a.csv");
        within(Path::new("outer"), || {
            within(Path::new("inner"), || {
                assert_eq!(path(file), Path::new("inner/a.csv"))
            });
            assert_eq!(path(file), Path::new("outer/a.csv"));
        });
        assert_eq!(path(file), file);
    }
}
