//! The benchmark cases, built into the program: `cases/verification/*.toml`, and the cases of the other folders, which
//! show the use of the program.

use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::VerifyError;
use super::results::file_error;
use crate::case::Case;

#[cfg(test)]
mod tests;

/// A case file in the program.
#[derive(Clone, Copy, Debug)]
pub struct BuiltIn {
    /// Folder in `cases`.
    pub folder: &'static str,
    /// Name.
    pub name: &'static str,
    /// Text.
    pub text: &'static str,
    /// Name and contents of the files that it reads from its folder.
    pub files: &'static [(&'static str, &'static [u8])],
}

impl BuiltIn {
    /// Writes the files that the case reads into a folder. A file with other contents is not replaced.
    ///
    /// # Errors
    /// The path of a file that has other contents or cannot be written.
    pub fn write_files(&self, folder: &Path) -> Result<(), (PathBuf, std::io::Error)> {
        for (name, contents) in self.files {
            let path = folder.join(name);
            if std::fs::read(&path).is_ok_and(|present| present == *contents) {
                continue;
            }
            let created = std::fs::File::create_new(&path);
            let written = created.and_then(|mut file| file.write_all(contents));
            written.map_err(|source| (path, source))?;
        }
        Ok(())
    }
}

/// The benchmark cases, by folder and name.
pub const BENCHMARKS: &[BuiltIn] = include!(concat!(env!("OUT_DIR"), "/benchmarks.rs"));

/// Cases with their names.
#[derive(Debug)]
pub struct Benchmarks {
    /// The cases.
    pub cases: Vec<(String, Case)>,
    /// Files that built-in cases read, deleted when this is dropped.
    _files: Option<TempDir>,
}

/// The benchmark cases of the program, or those of a folder. The files that built-in cases read are written into a
/// temporary folder.
///
/// # Errors
/// The folder cannot be read, the temporary folder cannot be written, or the first mistake in a case.
pub fn load(folder: Option<&Path>) -> Result<Benchmarks, VerifyError> {
    match folder {
        None => built_in(),
        Some(folder) => Ok(Benchmarks {
            cases: of_folder(folder)?,
            _files: None,
        }),
    }
}

fn built_in() -> Result<Benchmarks, VerifyError> {
    let unwritable =
        |path: &Path, source: std::io::Error| file_error(path, "cannot be written", source.into());
    let files = TempDir::with_prefix("perimelt-verify-")
        .map_err(|source| unwritable(&std::env::temp_dir(), source))?;
    let parse = |built_in: &BuiltIn| {
        let BuiltIn {
            folder, name, text, ..
        } = built_in;
        let file = format!("cases/{folder}/{name}.toml");
        let written = built_in.write_files(files.path());
        written.map_err(|(path, source)| unwritable(&path, source))?;
        let case = Case::parse(&file, text.to_string(), files.path())?;
        Ok((name.to_string(), case))
    };
    let cases: Result<_, VerifyError> = BENCHMARKS.iter().map(parse).collect();
    Ok(Benchmarks {
        cases: cases?,
        _files: Some(files),
    })
}

fn of_folder(folder: &Path) -> Result<Vec<(String, Case)>, VerifyError> {
    let unreadable = |source| VerifyError::Folder {
        folder: folder.into(),
        source,
    };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        paths.push(entry.map_err(unreadable)?.path());
    }
    paths.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    paths.sort();
    let read = |path: std::path::PathBuf| {
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Ok((name, Case::read(&path)?))
    };
    paths.into_iter().map(read).collect()
}
