//! Input files: regular files of limited size.
//!
//! A case file may name any path. A pipe without a writer would block the program in `open`, and a device may have no end,
//! so that neither is opened. Whatever reads a file that a case names does so by these functions.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest size of an input file, bytes: some twenty million triangles, or ten million lines.
pub const LIMIT: u64 = 1 << 30;

/// Why an input file cannot be read; the caller adds the path.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// An error of the system.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A folder, device, pipe or socket.
    #[error("it is {0}; a regular file is expected")]
    NotAFile(&'static str),
    /// More than the limit.
    #[error("it has more than {} MB, the limit of such a file", .0 >> 20)]
    TooLarge(u64),
    /// Bytes that are in no text.
    #[error("it is binary; text is expected")]
    Binary,
    /// Bytes that are no UTF-8.
    #[error("line {0} is not UTF-8 text")]
    NotUtf8(usize),
}

/// The bytes of a regular file of at most `limit` bytes.
///
/// # Errors
/// [`InputError`]; nothing is opened that is no regular file.
pub fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, InputError> {
    refuse_special(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    // the metadata of the open file, in case the path has changed
    let metadata = file.metadata()?;
    refuse_special(&metadata)?;
    if metadata.len() > limit {
        return Err(InputError::TooLarge(limit));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize + 1);
    // files of the system tell no length, and a file may grow
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(InputError::TooLarge(limit));
    }
    Ok(bytes)
}

/// The text of a regular file of at most `limit` bytes: UTF-8, or UTF-16 with a byte order mark. The mark is removed. Bytes
/// of other encodings, as in comments, become replacement characters, so that they fail where a number is expected.
///
/// # Errors
/// [`InputError`].
pub fn read_text(path: &Path, limit: u64) -> Result<String, InputError> {
    decode(read_bytes(path, limit)?).ok_or(InputError::Binary)
}

/// The text of a regular file of at most `limit` bytes, unchanged.
///
/// # Errors
/// [`InputError`], also for text that is not UTF-8.
pub fn read_utf8(path: &Path, limit: u64) -> Result<String, InputError> {
    String::from_utf8(read_bytes(path, limit)?).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        InputError::NotUtf8(1 + valid.iter().filter(|byte| **byte == b'\n').count())
    })
}

/// Text of bytes; `None` if there are zeros in it.
fn decode(bytes: Vec<u8>) -> Option<String> {
    let text = match transcoded(&bytes) {
        Some(text) => text,
        None => match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
        },
    };
    if text.contains('\0') {
        return None;
    }
    match text.strip_prefix('\u{feff}') {
        Some(rest) => Some(rest.into()),
        None => Some(text),
    }
}

/// UTF-16 with a byte order mark as text that begins with the mark; `None` for other bytes.
pub(crate) fn transcoded(bytes: &[u8]) -> Option<String> {
    let unit: fn([u8; 2]) -> u16 = match bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return None,
    };
    let (pairs, _) = bytes.as_chunks::<2>();
    let units: Vec<u16> = pairs.iter().map(|pair| unit(*pair)).collect();
    Some(String::from_utf16_lossy(&units))
}

fn refuse_special(metadata: &std::fs::Metadata) -> Result<(), InputError> {
    if metadata.is_file() {
        return Ok(());
    }
    Err(InputError::NotAFile(kind(metadata.file_type())))
}

fn kind(file: std::fs::FileType) -> &'static str {
    if file.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if file.is_fifo() {
            return "a pipe";
        }
        if file.is_socket() {
            return "a socket";
        }
    }
    "a device"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(path: &Path, limit: u64) -> String {
        let refused = read_text(path, limit).expect_err("no input");
        refused.to_string()
    }

    #[test]
    fn only_regular_files_up_to_the_limit_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("table.csv");
        std::fs::write(&path, "x,y\n1,2\n").expect("writable");
        assert_eq!(read_text(&path, 8).expect("text"), "x,y\n1,2\n");
        assert!(told(&path, 7).contains("more than"));
        assert!(told(folder.path(), LIMIT).contains("a folder"));
        assert!(read_bytes(&folder.path().join("none"), LIMIT).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_are_refused_without_opening_them() {
        assert!(told(Path::new("/dev/zero"), LIMIT).contains("a device"));
        let folder = tempfile::tempdir().expect("a folder");
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a socket");
        assert!(told(&socket, LIMIT).contains("a socket"));
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        // without a writer `open` would block
        if made.is_ok_and(|status| status.success()) {
            assert!(told(&pipe, LIMIT).contains("a pipe"));
        }
    }

    #[test]
    fn the_line_that_is_no_utf8_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("case.toml");
        std::fs::write(&path, b"[case]\ntitle = 'Schwei\xdfen'\n").expect("writable");
        let refused = read_utf8(&path, LIMIT).expect_err("no UTF-8");
        assert_eq!(refused.to_string(), "line 2 is not UTF-8 text");
    }

    #[test]
    fn text_is_read_in_the_encodings_in_which_programs_write_it() {
        let utf16 = |unit: fn(u16) -> [u8; 2]| {
            let text = "\u{feff}x,y\n";
            text.encode_utf16().flat_map(unit).collect::<Vec<u8>>()
        };
        for (bytes, text) in [
            (b"x,y\n".to_vec(), Some("x,y\n")),
            (b"\xef\xbb\xbfx,y\n".to_vec(), Some("x,y\n")),
            (utf16(u16::to_le_bytes), Some("x,y\n")),
            (utf16(u16::to_be_bytes), Some("x,y\n")),
            (b"; Schwei\xdfen\n".to_vec(), Some("; Schwei\u{fffd}en\n")),
            (b"PK\x03\x04\0\0".to_vec(), None),
        ] {
            assert_eq!(decode(bytes.clone()).as_deref(), text, "{bytes:?}");
        }
    }
}
