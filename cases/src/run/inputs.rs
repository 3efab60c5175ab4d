//! The files that a case names, such as toolpaths, tables and shapes: a run that is resumed must have the same.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use perimelt_core::log::InputFile;
use toml::{Table, Value};

use super::MAY_CHANGE;
use crate::case::Case;

/// Largest file (bytes) that is read completely; larger ones, such as logs, are read at the beginning and the end.
const WHOLE: u64 = 1 << 28;

/// Bytes of the beginning and of the end.
const PART: u64 = 1 << 20;

/// Regular files whose paths are values of a case, in the sections that describe the process.
pub fn of(case: &Case) -> Vec<InputFile> {
    let table: Table = case.file.text.parse().unwrap_or_default();
    let mut names = Vec::new();
    for (section, value) in &table {
        if !MAY_CHANGE.contains(&section.as_str()) {
            texts(value, &mut names);
        }
    }
    names.sort_unstable();
    names.dedup();
    let file = |name: &&str| file(name, &case.folder);
    names.iter().filter_map(file).collect()
}

/// The first of these files that is there with another content.
pub fn changed<'f>(before: &'f [InputFile], folder: &Path) -> Option<&'f InputFile> {
    let mut files = before.iter();
    files.find(|before| file(&before.path, folder).is_some_and(|now| now != **before))
}

fn texts<'v>(value: &'v Value, found: &mut Vec<&'v str>) {
    match value {
        Value::String(text) => found.push(text),
        Value::Array(list) => list.iter().for_each(|value| texts(value, found)),
        Value::Table(table) => table.values().for_each(|value| texts(value, found)),
        _ => {}
    }
}

/// A file that a case names; `None` for a text that is no name of a regular file.
fn file(name: &str, folder: &Path) -> Option<InputFile> {
    let path = folder.join(name);
    // opening a pipe would block until it has a writer
    let bytes = std::fs::metadata(&path).ok().filter(|d| d.is_file())?.len();
    let mut file = File::open(&path).ok()?;
    let mut parts = vec![(0, bytes)];
    if bytes > WHOLE {
        parts = vec![(0, PART), (bytes - PART, PART)];
    }
    let mut hash = FNV;
    for (start, length) in parts {
        file.seek(SeekFrom::Start(start)).ok()?;
        let mut left = length;
        let mut buffer = vec![0; length.min(1 << 16) as usize];
        while left > 0 {
            let most = left.min(buffer.len() as u64) as usize;
            match file.read(&mut buffer[..most]).ok()? {
                0 => break,
                read => {
                    hash = fnv(hash, &buffer[..read]);
                    left -= read as u64;
                }
            }
        }
    }
    Some(InputFile {
        path: name.into(),
        bytes,
        hash: format!("{hash:016x}"),
    })
}

/// FNV-1a: offset basis of 64 bits (Fowler, Noll, Vo).
const FNV: u64 = 0xcbf2_9ce4_8422_2325;

fn fnv(start: u64, bytes: &[u8]) -> u64 {
    let add = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(start, add)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published values of FNV-1a.
    #[test]
    fn fingerprints_are_those_of_fnv() {
        assert_eq!(fnv(FNV, b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv(FNV, b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv(FNV, b"foobar"), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn files_that_change_are_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |text: &str| {
            std::fs::write(folder.path().join("path.csv"), text).expect("writable");
        };
        write("1,2");
        let before: Vec<InputFile> = ["path.csv", "steel", "."]
            .iter()
            .filter_map(|name| file(name, folder.path()))
            .collect();
        assert_eq!(before.len(), 1);
        assert_eq!(changed(&before, folder.path()), None);
        write("1,3");
        assert_eq!(changed(&before, folder.path()), Some(&before[0]));
        // the reader of the file reports that it is missing
        std::fs::remove_file(folder.path().join("path.csv")).expect("removable");
        assert_eq!(changed(&before, folder.path()), None);
    }
}
