//! VTK's XML format for points, raw bytes appended, and ParaView's collection of times.
//!
//! Written by hand because it is 80 lines, while `vtkio` is a release candidate and depends on an
//! XML parser and three compressors that are not needed.

use std::io::{self, Write};

use perimelt_core::log::LoggedCloud;

use super::fit_f32;

/// An array of the file.
struct Array<'a> {
    name: &'a str,
    components: usize,
    data: Data<'a>,
}

enum Data<'a> {
    Numbers(std::borrow::Cow<'a, [f64]>),
    /// 0, 1, 2 ... or 1, 2, 3 ...
    Count {
        from: i64,
        length: usize,
    },
    /// the same byte all over
    Bytes {
        byte: u8,
        length: usize,
    },
}

impl Data<'_> {
    fn type_name(&self) -> &'static str {
        match self {
            Self::Numbers(values) if fit_f32(values) => "Float32",
            Self::Numbers(_) => "Float64",
            Self::Count { .. } => "Int64",
            Self::Bytes { .. } => "UInt8",
        }
    }

    fn byte_count(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len() * if fit_f32(values) { 4 } else { 8 },
            Self::Count { length, .. } => length * 8,
            Self::Bytes { length, .. } => *length,
        }
    }

    fn write(&self, file: &mut impl Write) -> io::Result<()> {
        file.write_all(&(self.byte_count() as u64).to_le_bytes())?;
        match self {
            Self::Numbers(values) if fit_f32(values) => values
                .iter()
                .try_for_each(|&x| file.write_all(&(x as f32).to_le_bytes())),
            Self::Numbers(values) => values
                .iter()
                .try_for_each(|x| file.write_all(&x.to_le_bytes())),
            Self::Count { from, length } => (0..*length as i64)
                .try_for_each(|number| file.write_all(&(from + number).to_le_bytes())),
            Self::Bytes { byte, length } => file.write_all(&vec![*byte; *length]),
        }
    }
}

/// A cloud as an unstructured grid of vertices.
pub(super) fn write_cloud(file: &mut impl Write, cloud: &LoggedCloud) -> io::Result<()> {
    let points = cloud.positions.len();
    let numbers = |name, components, values| Array {
        name,
        components,
        data: Data::Numbers(values),
    };
    let fields = cloud.fields.iter().map(|field| {
        let values = match field.components {
            9 => transposed(&field.values).into(),
            _ => field.values.as_slice().into(),
        };
        numbers(&field.name, field.components, values)
    });
    let time = [cloud.time];
    let global = [numbers("TimeValue", 1, time.as_slice().into())];
    let point_data: Vec<Array> = fields.collect();
    let positions = [numbers("Points", 3, cloud.positions.as_flattened().into())];
    let cell = |name, data| Array {
        name,
        components: 1,
        data,
    };
    let cells = [
        cell(
            "connectivity",
            Data::Count {
                from: 0,
                length: points,
            },
        ),
        cell(
            "offsets",
            Data::Count {
                from: 1,
                length: points,
            },
        ),
        // VTK_VERTEX
        cell(
            "types",
            Data::Bytes {
                byte: 1,
                length: points,
            },
        ),
    ];

    writeln!(file, r#"<?xml version="1.0"?>"#)?;
    writeln!(
        file,
        r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#
    )?;
    writeln!(file, "<UnstructuredGrid>")?;
    let mut offset = 0;
    declare(file, "FieldData", &global, &mut offset)?;
    writeln!(
        file,
        r#"<Piece NumberOfPoints="{points}" NumberOfCells="{points}">"#
    )?;
    declare(file, "PointData", &point_data, &mut offset)?;
    declare(file, "Points", &positions, &mut offset)?;
    declare(file, "Cells", &cells, &mut offset)?;
    writeln!(file, "</Piece>\n</UnstructuredGrid>")?;
    write!(file, "<AppendedData encoding=\"raw\">\n_")?;
    for array in global
        .iter()
        .chain(&point_data)
        .chain(&positions)
        .chain(&cells)
    {
        array.data.write(file)?;
    }
    writeln!(file, "\n</AppendedData>\n</VTKFile>")
}

/// The arrays' descriptions; their data will be at `offset` and on.
fn declare(
    file: &mut impl Write,
    section: &str,
    arrays: &[Array],
    offset: &mut usize,
) -> io::Result<()> {
    writeln!(file, "<{section}>")?;
    for array in arrays {
        let (name, kind) = (escaped(array.name), array.data.type_name());
        let components = array.components;
        let tuples = if section == "FieldData" {
            r#" NumberOfTuples="1""#
        } else {
            ""
        };
        writeln!(
            file,
            r#"<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}"{tuples} format="appended" offset="{offset}"/>"#
        )?;
        *offset += 8 + array.data.byte_count();
    }
    writeln!(file, "</{section}>")
}

/// Tensors row by row, as VTK keeps them.
fn transposed(values: &[f64]) -> Vec<f64> {
    values
        .chunks_exact(9)
        .flat_map(|t| [t[0], t[3], t[6], t[1], t[4], t[7], t[2], t[5], t[8]])
        .collect()
}

/// A file of a collection.
pub(super) struct DataSet {
    /// simulated time, s
    pub time: f64,
    /// number of the body
    pub part: usize,
    /// name of the file beside the collection
    pub file: String,
}

/// The files by time, as ParaView opens them.
pub(super) fn write_collection(file: &mut impl Write, data_sets: &[DataSet]) -> io::Result<()> {
    writeln!(file, r#"<?xml version="1.0"?>"#)?;
    writeln!(
        file,
        r#"<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">"#
    )?;
    writeln!(file, "<Collection>")?;
    for DataSet {
        time,
        part,
        file: name,
    } in data_sets
    {
        let name = escaped(name);
        writeln!(
            file,
            r#"<DataSet timestep="{time}" group="" part="{part}" file="{name}"/>"#
        )?;
    }
    writeln!(file, "</Collection>\n</VTKFile>")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
}
