//! VTK's XML format for unstructured grids, raw bytes appended, and ParaView's collection of times.
//!
//! Written by hand because it is 100 lines, while `vtkio` is a release candidate and depends on an
//! XML parser and three compressors that are not needed.

use std::io::{self, Write};

use perimelt_core::log::LoggedCloud;

use super::mesh::Mesh;
use crate::log_file::fit_f32;

/// An array of the file.
struct Array<'a> {
    name: &'a str,
    components: usize,
    data: Data<'a>,
}

enum Data<'a> {
    Numbers(std::borrow::Cow<'a, [f64]>),
    Indices(&'a [i32]),
    Bytes(&'a [u8]),
}

impl Data<'_> {
    fn type_name(&self) -> &'static str {
        match self {
            Self::Numbers(values) if fit_f32(values) => "Float32",
            Self::Numbers(_) => "Float64",
            Self::Indices(_) => "Int32",
            Self::Bytes(_) => "UInt8",
        }
    }

    fn byte_count(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len() * if fit_f32(values) { 4 } else { 8 },
            Self::Indices(indices) => indices.len() * 4,
            Self::Bytes(bytes) => bytes.len(),
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
            Self::Indices(indices) => indices
                .iter()
                .try_for_each(|index| file.write_all(&index.to_le_bytes())),
            Self::Bytes(bytes) => file.write_all(bytes),
        }
    }
}

/// Name of the array of reference positions.
pub(super) const REFERENCE: &str = "reference_position";

/// A cloud as an unstructured grid; of a body that deforms with its reference positions (m).
pub(super) fn write_cloud(
    file: &mut impl Write,
    cloud: &LoggedCloud,
    mesh: &Mesh,
    reference: Option<&[[f64; 3]]>,
) -> io::Result<()> {
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
    let reference =
        reference.map(|reference| numbers(REFERENCE, 3, reference.as_flattened().into()));
    let is_displaced = reference.is_some();
    let point_data: Vec<Array> = fields.chain(reference).collect();
    let positions = [numbers("Points", 3, cloud.positions.as_flattened().into())];
    let cell = |name, data| Array {
        name,
        components: 1,
        data,
    };
    let cells = [
        cell("connectivity", Data::Indices(&mesh.connectivity)),
        cell("offsets", Data::Indices(&mesh.offsets)),
        cell("types", Data::Bytes(&mesh.types)),
    ];

    writeln!(file, r#"<?xml version="1.0"?>"#)?;
    writeln!(
        file,
        r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#
    )?;
    if is_displaced {
        writeln!(
            file,
            "<!-- Points are at their displaced positions; {REFERENCE} has those of the undeformed body. -->"
        )?;
    }
    writeln!(file, "<UnstructuredGrid>")?;
    let mut offset = 0;
    declare(file, "FieldData", &global, &mut offset)?;
    writeln!(
        file,
        r#"<Piece NumberOfPoints="{points}" NumberOfCells="{}">"#,
        mesh.types.len()
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
        let parts = component_names(array.components);
        writeln!(
            file,
            r#"<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}"{parts}{tuples} format="appended" offset="{offset}"/>"#
        )?;
        *offset += 8 + array.data.byte_count();
    }
    writeln!(file, "</{section}>")
}

/// Attributes that name the components of tensors; VTK itself names those of vectors.
fn component_names(components: usize) -> String {
    if components != 9 {
        return String::new();
    }
    let name = |(index, name): (usize, &str)| format!(r#" ComponentName{index}="{name}""#);
    ROWS.into_iter().enumerate().map(name).collect()
}

/// Components of a tensor in the order of VTK.
const ROWS: [&str; 9] = ["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"];

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
