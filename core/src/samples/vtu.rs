//! VTK's XML format for unstructured grids (VTU) and polygons (VTP), and ParaView's collection of times (PVD).
//!
//! Arrays are text, base64 or appended bytes, compressed by zlib or not: what ParaView, meshio and `perimelt export` write. See
//! the VTK file formats, <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>.

use std::io::Read;

use nalgebra::Vector3;
use roxmltree::{Document, Node};

/// Why a file of VTK cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum VtkError {
    /// No XML.
    #[error("it is not valid XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// Another kind of file.
    #[error(
        "its type is `{0}`; expected a file of type `UnstructuredGrid`, `PolyData` or `Collection`"
    )]
    Kind(String),
    /// A part that every file has.
    #[error("it has no `{0}`")]
    Missing(&'static str),
    /// Numbers that are not there.
    #[error("the array `{array}` cannot be read: {reason}")]
    Array {
        /// Name of the array.
        array: String,
        /// Why.
        reason: &'static str,
    },
}

/// A field of a file.
#[derive(Clone, Debug)]
pub(super) struct VtkField {
    pub(super) name: String,
    /// Numbers of a point or cell.
    pub(super) components: usize,
    pub(super) values: Vec<f64>,
    /// Whether it belongs to the cells.
    pub(super) of_cells: bool,
}

/// Points, centres of cells and fields of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct VtkGrid {
    pub(super) points: Vec<Vector3<f64>>,
    pub(super) cells: Vec<Vector3<f64>>,
    pub(super) fields: Vec<VtkField>,
}

/// Name of the array of reference positions in exports of bodies that deform.
const REFERENCE: &str = "reference_position";

/// The file without appended bytes, which are not XML, and these bytes.
fn without_appended(bytes: &[u8]) -> (Vec<u8>, &[u8]) {
    let find = |from: usize, text: &[u8]| {
        let place = bytes
            .get(from..)?
            .windows(text.len())
            .position(|w| w == text);
        place.map(|p| from + p)
    };
    let appended = find(0, b"<AppendedData").and_then(|tag| {
        let start = find(tag, b">")? + 1;
        let data = find(start, b"_")? + 1;
        let end_tag = b"</AppendedData>";
        let end = bytes.windows(end_tag.len()).rposition(|w| w == end_tag)?;
        (data <= end).then_some((start, data, end))
    });
    match appended {
        Some((start, data, end)) => ([&bytes[..start], &bytes[end..]].concat(), &bytes[data..end]),
        None => (bytes.to_vec(), &[]),
    }
}

/// Reads a VTU or VTP file.
pub(super) fn read(bytes: &[u8]) -> Result<VtkGrid, VtkError> {
    let (xml, appended) = without_appended(bytes);
    let text = String::from_utf8_lossy(&xml);
    let document = Document::parse(&text)?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or(root.tag_name().name());
    if !["UnstructuredGrid", "PolyData"].contains(&kind) {
        return Err(VtkError::Kind(kind.into()));
    }
    let is_base64 = |n: &Node<'_, '_>| n.attribute("encoding") == Some("base64");
    let reader = ArrayReader {
        appended,
        appended_as_base64: root
            .children()
            .any(|n| n.has_tag_name("AppendedData") && is_base64(&n)),
        long_headers: root.attribute("header_type") == Some("UInt64"),
        big_endian: root.attribute("byte_order") == Some("BigEndian"),
        compressed: root.attribute("compressor"),
    };
    let mut grid = VtkGrid::default();
    for piece in root.descendants().filter(|n| n.has_tag_name("Piece")) {
        reader.add_piece(piece, &mut grid)?;
    }
    match grid.points.is_empty() {
        true => Err(VtkError::Missing("Points")),
        false => Ok(grid),
    }
}

/// Times (s) and files of a collection.
pub(super) fn collection(text: &str) -> Result<Vec<(f64, String)>, VtkError> {
    let document = Document::parse(text)?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or(root.tag_name().name());
    if kind != "Collection" {
        return Err(VtkError::Kind(kind.into()));
    }
    let sets = document.descendants().filter(|n| n.has_tag_name("DataSet"));
    let set = |n: Node<'_, '_>| {
        let time = n
            .attribute("timestep")?
            .parse()
            .ok()
            .filter(|t: &f64| t.is_finite())?;
        Some((time, n.attribute("file")?.to_string()))
    };
    sets.map(|n| set(n).ok_or(VtkError::Missing("timestep and file of a DataSet")))
        .collect()
}

/// How the arrays of a file are written.
struct ArrayReader<'a> {
    appended: &'a [u8],
    appended_as_base64: bool,
    long_headers: bool,
    big_endian: bool,
    compressed: Option<&'a str>,
}

impl ArrayReader<'_> {
    fn add_piece(&self, piece: Node<'_, '_>, grid: &mut VtkGrid) -> Result<(), VtkError> {
        let section = |name: &'static str| piece.children().find(|n| n.has_tag_name(name));
        let points =
            section("Points").and_then(|n| n.children().find(|n| n.has_tag_name("DataArray")));
        let mut points = self.positions(points.ok_or(VtkError::Missing("Points"))?)?;
        let mut fields = Vec::new();
        for (name, of_cells) in [("PointData", false), ("CellData", true)] {
            let data = section(name).into_iter().flat_map(|n| n.children());
            for array in data
                .filter(|n| n.has_tag_name("DataArray") && n.attribute("type") != Some("String"))
            {
                let name = array.attribute("Name").unwrap_or("");
                if name == REFERENCE && !of_cells {
                    points = self.positions(array)?;
                    continue;
                }
                let components = array
                    .attribute("NumberOfComponents")
                    .and_then(|n| n.parse().ok());
                fields.push(VtkField {
                    name: name.into(),
                    components: components.unwrap_or(1).max(1),
                    values: self.numbers(array)?,
                    of_cells,
                });
            }
        }
        let cells = match section("Cells").filter(|_| fields.iter().any(|f| f.of_cells)) {
            Some(cells) => self.centres(cells, &points)?,
            None => Vec::new(),
        };
        // polygons are read for their points
        fields.retain(|f: &VtkField| !f.of_cells || !cells.is_empty());
        for field in &fields {
            let places = if field.of_cells {
                cells.len()
            } else {
                points.len()
            };
            if field.values.len() != places * field.components {
                let (array, reason) = (
                    field.name.clone(),
                    "it needs one value for each point or for each cell",
                );
                return Err(VtkError::Array { array, reason });
            }
        }
        if grid.points.is_empty() {
            grid.fields = fields;
        } else {
            // the pieces of a file have the same arrays
            for (own, field) in grid.fields.iter_mut().zip(fields) {
                own.values.extend(field.values);
            }
        }
        grid.points.extend(points);
        grid.cells.extend(cells);
        Ok(())
    }

    fn positions(&self, array: Node<'_, '_>) -> Result<Vec<Vector3<f64>>, VtkError> {
        let numbers = self.numbers(array)?;
        Ok(numbers
            .chunks_exact(3)
            .map(Vector3::from_column_slice)
            .collect())
    }

    /// Means of the corners of each cell.
    fn centres(
        &self,
        cells: Node<'_, '_>,
        points: &[Vector3<f64>],
    ) -> Result<Vec<Vector3<f64>>, VtkError> {
        let array = |name: &'static str| {
            let found = cells.children().find(|n| n.attribute("Name") == Some(name));
            self.numbers(found.ok_or(VtkError::Missing(name))?)
        };
        let (corners, ends) = (array("connectivity")?, array("offsets")?);
        let mut start = 0;
        let mut centre = |end: &f64| {
            let range = start..*end as usize;
            start = range.end;
            let corners = corners.get(range).filter(|c| !c.is_empty())?;
            let positions: Option<Vec<_>> =
                corners.iter().map(|c| points.get(*c as usize)).collect();
            Some(positions?.into_iter().sum::<Vector3<f64>>() / corners.len() as f64)
        };
        let centres: Option<Vec<_>> = ends.iter().map(&mut centre).collect();
        centres.ok_or(VtkError::Array {
            array: "connectivity".into(),
            reason: "a cell has no points, or refers to points that do not exist",
        })
    }

    /// The numbers of an array.
    fn numbers(&self, array: Node<'_, '_>) -> Result<Vec<f64>, VtkError> {
        let fault = |reason| VtkError::Array {
            array: array.attribute("Name").unwrap_or("Points").into(),
            reason,
        };
        let text = || array.text().unwrap_or("");
        let mut bytes = match array.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let numbers = text().split_whitespace().map(str::parse::<f64>);
                return numbers
                    .collect::<Result<_, _>>()
                    .map_err(|_| fault("it contains text that is not a number"));
            }
            "binary" => Bytes::base64(text().as_bytes()),
            "appended" => {
                let offset = array
                    .attribute("offset")
                    .and_then(|o| o.parse::<usize>().ok());
                let rest = offset
                    .and_then(|o| self.appended.get(o..))
                    .ok_or_else(|| fault("its offset lies outside of the appended data"))?;
                match self.appended_as_base64 {
                    true => Bytes::base64(rest),
                    false => Bytes::Raw(rest),
                }
            }
            _ => {
                return Err(fault(
                    "its format is none of `ascii`, `binary` and `appended`",
                ));
            }
        };
        let data = match self.compressed {
            None => self.count(&mut bytes).and_then(|n| bytes.take(n)),
            Some("vtkZLibDataCompressor") => self.inflated(&mut bytes),
            Some(_) => {
                return Err(fault(
                    "it is compressed; write the file without compression or with zlib",
                ));
            }
        };
        let data = data.ok_or_else(|| {
            fault("the file ends before the end of the array, or the array is damaged")
        })?;
        let kind = array.attribute("type").unwrap_or("");
        decoded(kind, &data, self.big_endian)
            .ok_or_else(|| fault("the type of its numbers is unknown"))
    }

    /// A number of a header.
    fn count(&self, bytes: &mut Bytes<'_>) -> Option<usize> {
        let kind = if self.long_headers {
            "UInt64"
        } else {
            "UInt32"
        };
        let raw = bytes.take(if self.long_headers { 8 } else { 4 })?;
        Some(*decoded(kind, &raw, self.big_endian)?.first()? as usize)
    }

    /// The blocks of a compressed array.
    fn inflated(&self, bytes: &mut Bytes<'_>) -> Option<Vec<u8>> {
        let [blocks, size, last] = [self.count(bytes)?, self.count(bytes)?, self.count(bytes)?];
        // a block takes a byte at least
        if blocks > bytes.most() {
            return None;
        }
        let sizes: Option<Vec<usize>> = (0..blocks).map(|_| self.count(bytes)).collect();
        let mut data = Vec::new();
        for (block, packed) in sizes?.into_iter().enumerate() {
            let is_last = block + 1 == blocks;
            let size = if is_last && last > 0 { last } else { size };
            let packed = bytes.take(packed)?;
            let start = data.len();
            let decoder = flate2::read::ZlibDecoder::new(&packed[..]);
            decoder.take(size as u64).read_to_end(&mut data).ok()?;
            (data.len() - start == size).then_some(())?;
        }
        Some(data)
    }
}

/// Numbers of a type from their bytes.
fn decoded(kind: &str, bytes: &[u8], big_endian: bool) -> Option<Vec<f64>> {
    macro_rules! numbers {
        ($number:ty) => {
            bytes
                .chunks_exact(size_of::<$number>())
                .map(|b| {
                    let b = b.try_into().expect("chunks have the size of a number");
                    (if big_endian {
                        <$number>::from_be_bytes(b)
                    } else {
                        <$number>::from_le_bytes(b)
                    }) as f64
                })
                .collect()
        };
    }
    Some(match kind {
        "Float64" => numbers!(f64),
        "Float32" => numbers!(f32),
        "Int64" => numbers!(i64),
        "UInt64" => numbers!(u64),
        "Int32" => numbers!(i32),
        "UInt32" => numbers!(u32),
        "Int16" => numbers!(i16),
        "UInt16" => numbers!(u16),
        "Int8" => numbers!(i8),
        "UInt8" => numbers!(u8),
        _ => return None,
    })
}

/// Bytes of arrays.
enum Bytes<'a> {
    Raw(&'a [u8]),
    /// Text, and decoded bytes that were not taken yet.
    Base64(&'a [u8], Vec<u8>),
}

impl<'a> Bytes<'a> {
    fn base64(text: &'a [u8]) -> Self {
        Bytes::Base64(text, Vec::new())
    }

    /// More bytes than these are not there.
    fn most(&self) -> usize {
        match self {
            Bytes::Raw(rest) => rest.len(),
            Bytes::Base64(rest, taken) => rest.len() + taken.len(),
        }
    }

    /// The next `count` bytes.
    fn take(&mut self, count: usize) -> Option<Vec<u8>> {
        if count > self.most() {
            return None;
        }
        match self {
            Bytes::Raw(rest) => {
                let (taken, others) = rest.split_at(count);
                *rest = others;
                Some(taken.to_vec())
            }
            Bytes::Base64(rest, taken) => {
                while taken.len() < count {
                    decode_group(rest, taken)?;
                }
                let others = taken.split_off(count);
                Some(std::mem::replace(taken, others))
            }
        }
    }
}

/// Decodes four characters of base64. Headers and data are encoded one after the other, so that padding may be anywhere.
fn decode_group(text: &mut &[u8], bytes: &mut Vec<u8>) -> Option<()> {
    let (mut bits, mut digits, mut characters) = (0_u32, 0, 0);
    while characters < 4 {
        let (&c, rest) = text.split_first()?;
        *text = rest;
        let digit = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                (bits, characters) = (bits << 6, characters + 1);
                continue;
            }
            _ if c.is_ascii_whitespace() => continue,
            _ => return None,
        };
        (bits, digits, characters) = (bits << 6 | u32::from(digit), digits + 1, characters + 1);
    }
    let [_, group @ ..] = bits.to_be_bytes();
    bytes.extend(&group[..digits * 6_usize / 8]);
    Some(())
}
