//! Triangles of STL files, text or binary.
//!
//! The kind follows from what fits, because headers of binary files may begin with `solid`, too. A binary file has 84 bytes
//! and 50 for each of the triangles that it announces, and perhaps some more. Programs that write while they compute
//! announce 0 or 2^32 - 1 triangles. Everything else that begins with `solid`, after white space and in capitals or small
//! letters, is text; its words are separated by white space, and line ends end only the name of a solid. Normals are not
//! used. Source: 3D Systems (1989), StereoLithography Interface Specification, and what CAD programs make of it.

use std::borrow::Cow;
use std::fmt;

use super::mesh::Mesh;
use crate::input;

/// Kind of an STL file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Words.
    Text,
    /// 50 bytes for each triangle.
    Binary,
}

impl Format {
    /// Name of the place in a file where a triangle is.
    pub(super) fn place(self, number: u32) -> String {
        match self {
            Format::Text => format!("at line {number}"),
            Format::Binary => format!("number {number}"),
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Format::Text => "text STL",
            Format::Binary => "binary STL",
        })
    }
}

/// Why the bytes of a file are no triangles.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FormatError {
    /// Neither text nor binary.
    #[error(
        "it is no STL file: text STL begins with `solid`, binary STL has a header of 80 bytes and the number of triangles"
    )]
    Unknown,
    /// A word that is not expected.
    #[error("text STL, line {line}: `{found}` where {expected} is expected")]
    Word {
        /// From 1.
        line: u32,
        /// The word.
        found: String,
        /// What belongs there.
        expected: &'static str,
    },
    /// The end of the file within a triangle.
    #[error("text STL, line {line}: the file ends where {expected} is expected")]
    End {
        /// From 1.
        line: u32,
        /// What belongs there.
        expected: &'static str,
    },
    /// A comma in a coordinate.
    #[error(
        "text STL, line {line}: the coordinate `{found}` has a comma; decimal points and blanks between the coordinates are expected: \
         export the file with the number format of English, or as binary STL"
    )]
    Comma {
        /// From 1.
        line: u32,
        /// The word.
        found: String,
    },
    /// A binary file that is cut off.
    #[error("binary STL: {announced} triangles announced, {present} in the file")]
    Short {
        /// By the header.
        announced: u32,
        /// Complete triangles.
        present: u64,
    },
    /// A coordinate that is infinite or not a number.
    #[error("{format}, triangle {}: the coordinate {coordinate} is not finite", .format.place(*.triangle))]
    NotFinite {
        /// Kind of the file.
        format: Format,
        /// Line or number of the triangle.
        triangle: u32,
        /// The coordinate.
        coordinate: f64,
    },
    /// No triangle.
    #[error("{0} without triangles")]
    Empty(Format),
}

/// Bytes before the first triangle of a binary file.
const HEADER: usize = 84;

/// Bytes of a triangle: normal, corners, attribute.
const TRIANGLE: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Result<(Mesh, Format), FormatError> {
    let transcoded = input::transcoded(bytes).map(String::into_bytes);
    if transcoded.is_none()
        && let Some(triangles) = binary_triangles(bytes)
    {
        return Ok((binary(triangles)?, Format::Binary));
    }
    let text = transcoded.map_or(Cow::Borrowed(bytes), Cow::Owned);
    let mut words = Words::new(&text);
    if words.next().is_some_and(|word| word.is("solid")) && !has_zeros(&text) {
        return Ok((solids(words)?, Format::Text));
    }
    let announced = announced(bytes).filter(|_| has_zeros(bytes));
    Err(announced.map_or(FormatError::Unknown, |announced| {
        let present = ((bytes.len() - HEADER) / TRIANGLE) as u64;
        match announced {
            0 => FormatError::Empty(Format::Binary),
            _ => FormatError::Short { announced, present },
        }
    }))
}

/// Whether one of the first bytes is zero, as in binary files but not in text.
fn has_zeros(bytes: &[u8]) -> bool {
    bytes[..bytes.len().min(HEADER + TRIANGLE)].contains(&0)
}

fn announced(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER - 4..)?.first_chunk()?;
    Some(u32::from_le_bytes(*count))
}

/// The triangles of a file that is binary.
fn binary_triangles(bytes: &[u8]) -> Option<&[[u8; TRIANGLE]]> {
    let announced = announced(bytes)?;
    let (triangles, _) = bytes[HEADER..].as_chunks::<TRIANGLE>();
    match announced {
        0 | u32::MAX => Some(triangles).filter(|t| !t.is_empty()),
        _ => triangles.get(..announced as usize),
    }
}

fn binary(triangles: &[[u8; TRIANGLE]]) -> Result<Mesh, FormatError> {
    let mut mesh = Mesh::default();
    for (number, bytes) in (1..).zip(triangles) {
        let (words, _) = bytes.as_chunks::<4>();
        let coordinate = |index: usize| f64::from(f32::from_le_bytes(words[index]));
        let corners = [3, 6, 9].map(|first| [0, 1, 2].map(|axis| coordinate(first + axis)));
        add(&mut mesh, corners, Format::Binary, number)?;
    }
    Ok(mesh)
}

fn add(
    mesh: &mut Mesh,
    corners: [[f64; 3]; 3],
    format: Format,
    triangle: u32,
) -> Result<(), FormatError> {
    let mut coordinates = corners.as_flattened().iter();
    if let Some(&coordinate) = coordinates.find(|c| !c.is_finite()) {
        return Err(FormatError::NotFinite {
            format,
            triangle,
            coordinate,
        });
    }
    mesh.add(corners, triangle);
    Ok(())
}

/// A word of a text and its line, from 1.
#[derive(Clone, Copy)]
struct Word<'t> {
    bytes: &'t [u8],
    line: u32,
}

impl Word<'_> {
    fn is(&self, keyword: &str) -> bool {
        self.bytes.eq_ignore_ascii_case(keyword.as_bytes())
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(self.bytes)
            .chars()
            .take(40)
            .collect()
    }

    /// A number, with the exponents of Fortran, too.
    fn number(&self) -> Option<f64> {
        let text = std::str::from_utf8(self.bytes).ok()?;
        text.parse()
            .or_else(|_| text.replace(['d', 'D'], "e").parse())
            .ok()
    }
}

/// The words of a text.
#[derive(Clone)]
struct Words<'t> {
    rest: &'t [u8],
    line: u32,
}

impl<'t> Iterator for Words<'t> {
    type Item = Word<'t>;

    fn next(&mut self) -> Option<Word<'t>> {
        while let Some((&first, rest)) = self.rest.split_first() {
            if !is_blank(first) {
                break;
            }
            self.line += u32::from(is_line_end(first, rest));
            self.rest = rest;
        }
        let length = self.rest.iter().position(|b| is_blank(*b));
        let (bytes, rest) = self.rest.split_at(length.unwrap_or(self.rest.len()));
        self.rest = rest;
        let line = self.line;
        (!bytes.is_empty()).then_some(Word { bytes, line })
    }
}

/// White space, and what fills the last block of a file on some systems.
fn is_blank(byte: u8) -> bool {
    byte.is_ascii_whitespace() || matches!(byte, 0 | 0x0b | 0x1a)
}

/// Whether a byte ends a line; the first of the two bytes of Windows does not.
fn is_line_end(byte: u8, rest: &[u8]) -> bool {
    byte == b'\n' || byte == b'\r' && rest.first() != Some(&b'\n')
}

impl<'t> Words<'t> {
    fn new(text: &'t [u8]) -> Self {
        let rest = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        Words { rest, line: 1 }
    }

    fn required(&mut self, expected: &'static str) -> Result<Word<'t>, FormatError> {
        let line = self.line;
        self.next().ok_or(FormatError::End { line, expected })
    }

    fn keyword(&mut self, keyword: &str, expected: &'static str) -> Result<Word<'t>, FormatError> {
        let word = self.required(expected)?;
        match word.is(keyword) {
            true => Ok(word),
            false => Err(unexpected(word, expected)),
        }
    }

    /// Skips the name of a solid: the rest of the line, or what is in front of a triangle on the same line.
    fn skip_name(&mut self) {
        let mut ahead = self.clone();
        loop {
            let before = ahead.clone();
            match ahead.next() {
                Some(word) if word.line == self.line => {
                    if word.is("facet") && ahead.clone().is_normal() {
                        *self = before;
                        return;
                    }
                }
                _ => {
                    *self = before;
                    return;
                }
            }
        }
    }

    /// Whether `normal` and a number follow.
    fn is_normal(&mut self) -> bool {
        self.next().is_some_and(|word| word.is("normal"))
            && self.next().is_some_and(|word| word.number().is_some())
    }

    fn coordinate(&mut self) -> Result<f64, FormatError> {
        let word = self.required("a coordinate")?;
        word.number().ok_or_else(|| {
            if word.bytes.contains(&b',') {
                let (line, found) = (word.line, word.text());
                return FormatError::Comma { line, found };
            }
            unexpected(word, "a coordinate")
        })
    }

    fn corner(&mut self) -> Result<[f64; 3], FormatError> {
        self.keyword("vertex", "`vertex`")?;
        Ok([self.coordinate()?, self.coordinate()?, self.coordinate()?])
    }

    /// The corners after `facet`; the normal may be anything.
    fn corners(&mut self) -> Result<[[f64; 3]; 3], FormatError> {
        const KEYWORDS: [&str; 6] = [
            "vertex", "endloop", "endfacet", "facet", "endsolid", "solid",
        ];
        let expected = "`outer loop`";
        loop {
            let word = self.required(expected)?;
            if word.is("outer") {
                break;
            }
            if KEYWORDS.iter().any(|keyword| word.is(keyword)) {
                return Err(unexpected(word, expected));
            }
        }
        self.keyword("loop", expected)?;
        let corners = [self.corner()?, self.corner()?, self.corner()?];
        self.keyword("endloop", "`endloop` after three corners")?;
        self.keyword("endfacet", "`endfacet`")?;
        Ok(corners)
    }
}

fn unexpected(word: Word<'_>, expected: &'static str) -> FormatError {
    FormatError::Word {
        line: word.line,
        found: word.text(),
        expected,
    }
}

/// All solids of a text whose first word has been read; the last `endsolid` may be missing.
fn solids(mut words: Words<'_>) -> Result<Mesh, FormatError> {
    let mut mesh = Mesh::default();
    words.skip_name();
    let mut in_solid = true;
    while let Some(word) = words.next() {
        if word.is("facet") {
            let corners = words.corners()?;
            add(&mut mesh, corners, Format::Text, word.line)?;
            in_solid = true;
        } else if word.is("solid") || in_solid && word.is("endsolid") {
            words.skip_name();
            in_solid = word.is("solid");
        } else if in_solid {
            return Err(unexpected(word, "`facet` or `endsolid`"));
        } else {
            return Err(unexpected(word, "`solid` or the end of the file"));
        }
    }
    match mesh.triangles.is_empty() {
        true => Err(FormatError::Empty(Format::Text)),
        false => Ok(mesh),
    }
}
