//! `foxglove.PointCloud` messages: a body's points, packed point by point.
//!
//! A point is `x, y, z` and then every field: scalars under their name, vectors as `name.x
//! name.y name.z`, tensors as `name.xx name.yx name.zx name.xy ...` (column by column). Frame
//! `world`, identity pose, all numbers little-endian f32 or f64.

use std::ops::Range;

use prost::{
    DecodeError, Message,
    encoding::{WireType, encode_key, encode_varint},
};
use prost_types::Timestamp;

use super::{CloudField, CloudView, LogError, LoggedCloud, Precision};

#[derive(Clone, PartialEq, Message)]
struct PointCloud {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    frame_id: String,
    #[prost(message, optional, tag = "3")]
    pose: Option<Pose>,
    #[prost(fixed32, tag = "4")]
    point_stride: u32,
    #[prost(message, repeated, tag = "5")]
    fields: Vec<PackedElementField>,
    #[prost(bytes = "vec", tag = "6")]
    data: Vec<u8>,
}

const DATA_TAG: u32 = 6;

#[derive(Clone, PartialEq, Message)]
struct Pose {
    #[prost(message, optional, tag = "1")]
    position: Option<Vector3>,
    #[prost(message, optional, tag = "2")]
    orientation: Option<Quaternion>,
}

#[derive(Clone, PartialEq, Message)]
struct Vector3 {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

#[derive(Clone, PartialEq, Message)]
struct Quaternion {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
    #[prost(double, tag = "4")]
    w: f64,
}

#[derive(Clone, PartialEq, Message)]
struct PackedElementField {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(fixed32, tag = "2")]
    offset: u32,
    #[prost(enumeration = "NumericType", tag = "3")]
    r#type: i32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, prost::Enumeration)]
#[repr(i32)]
enum NumericType {
    Unknown = 0,
    Float32 = 7,
    Float64 = 8,
}

const VECTOR: [&str; 3] = ["x", "y", "z"];
const TENSOR: [&str; 9] = ["xx", "yx", "zx", "xy", "yy", "zy", "xz", "yz", "zz"];

/// Names of the packed elements of a field; `None` for a number of components that has none.
fn element_names(name: &str, components: usize) -> Option<Vec<String>> {
    let suffixed = |suffixes: &[&str]| suffixes.iter().map(|s| format!("{name}.{s}")).collect();
    match components {
        1 => Some(vec![name.into()]),
        3 => Some(suffixed(&VECTOR)),
        9 => Some(suffixed(&TENSOR)),
        _ => None,
    }
}

/// Why a field cannot be packed, or `None` if it can.
pub(super) fn objection(name: &str, components: usize) -> Option<&'static str> {
    if name.is_empty() || VECTOR.contains(&name) {
        Some("its name is empty or that of a coordinate")
    } else if element_names(name, components).is_none() {
        Some("it is not a scalar (1 component), vector (3) or tensor (9)")
    } else {
        None
    }
}

/// Bytes of one point.
pub(super) fn point_stride(cloud: &CloudView, precision: Precision) -> usize {
    (3 + cloud
        .fields
        .iter()
        .map(|field| field.components)
        .sum::<usize>())
        * width(precision)
}

fn width(precision: Precision) -> usize {
    match precision {
        Precision::F32 => 4,
        Precision::F64 => 8,
    }
}

/// Appends a message with the points of a `range` to `buffer`; they are packed straight into it.
/// Fields must have passed [`objection`] and have `points * components` values.
pub(super) fn encode(
    buffer: &mut Vec<u8>,
    cloud: &CloudView,
    range: Range<usize>,
    precision: Precision,
    log_time: u64,
) {
    let stride = point_stride(cloud, precision);
    let mut names: Vec<String> = VECTOR.map(String::from).into();
    for field in cloud.fields {
        names.extend(element_names(field.name, field.components).unwrap_or_default());
    }
    let numeric_type = match precision {
        Precision::F32 => NumericType::Float32,
        Precision::F64 => NumericType::Float64,
    };
    let element = |(index, name)| PackedElementField {
        name,
        offset: (index * width(precision)) as u32,
        r#type: numeric_type as i32,
    };
    let without_data = PointCloud {
        timestamp: Some(Timestamp {
            seconds: (log_time / 1_000_000_000) as i64,
            nanos: (log_time % 1_000_000_000) as i32,
        }),
        frame_id: "world".into(),
        pose: Some(Pose {
            position: Some(Vector3::default()),
            orientation: Some(Quaternion {
                w: 1.0,
                ..Default::default()
            }),
        }),
        point_stride: stride as u32,
        fields: names.into_iter().enumerate().map(element).collect(),
        data: Vec::new(),
    };
    without_data.encode(buffer).expect("a Vec grows");

    let bytes = range.len() * stride;
    encode_key(DATA_TAG, WireType::LengthDelimited, buffer);
    encode_varint(bytes as u64, buffer);
    let start = buffer.len();
    buffer.resize(start + bytes, 0);
    let data = &mut buffer[start..];
    match precision {
        Precision::F32 => pack(data, cloud, range, |value| (value as f32).to_le_bytes()),
        Precision::F64 => pack(data, cloud, range, f64::to_le_bytes),
    }
}

fn pack<const WIDTH: usize>(
    data: &mut [u8],
    cloud: &CloudView,
    range: Range<usize>,
    to_bytes: impl Fn(f64) -> [u8; WIDTH],
) {
    let stride = data.len().checked_div(range.len()).unwrap_or(1);
    let put = |place: &mut [u8], values: &[f64]| {
        for (bytes, value) in place.chunks_exact_mut(WIDTH).zip(values) {
            bytes.copy_from_slice(&to_bytes(*value));
        }
    };
    let points = data.chunks_exact_mut(stride).zip(range.clone());
    points.for_each(|(place, point)| put(&mut place[..3 * WIDTH], &cloud.positions.at(point)));
    let mut offset = 3 * WIDTH;
    for field in cloud.fields {
        let (components, end) = (field.components, offset + field.components * WIDTH);
        let values =
            field.values[components * range.start..components * range.end].chunks_exact(components);
        let points = data.chunks_exact_mut(stride).zip(values);
        points.for_each(|(place, values)| put(&mut place[offset..end], values));
        offset = end;
    }
}

/// Why a message could not be decoded.
pub(super) enum Undecodable {
    Protobuf(DecodeError),
    Layout(&'static str),
}

impl Undecodable {
    pub(super) fn in_topic(self, topic: &str) -> LogError {
        let topic = topic.into();
        match self {
            Self::Protobuf(source) => LogError::PointCloud { topic, source },
            Self::Layout(what) => LogError::PointCloudLayout { topic, what },
        }
    }
}

/// Appends the points of the next part of a state.
pub(super) fn append(cloud: &mut LoggedCloud, next: LoggedCloud) -> Result<(), Undecodable> {
    let layout = |cloud: &LoggedCloud| -> Vec<(String, usize)> {
        let fields = cloud.fields.iter();
        fields.map(|f| (f.name.clone(), f.components)).collect()
    };
    if layout(cloud) != layout(&next) {
        return Err(Undecodable::Layout(
            "the parts of a state have different fields",
        ));
    }
    cloud.positions.extend(next.positions);
    for (field, next) in cloud.fields.iter_mut().zip(next.fields) {
        field.values.extend(next.values);
    }
    Ok(())
}

/// The cloud in a message; `time` (s) is the exact time, units are left empty.
pub(super) fn decode(message: &[u8], time: f64) -> Result<LoggedCloud, Undecodable> {
    let message = PointCloud::decode(message).map_err(Undecodable::Protobuf)?;
    let stride = message.point_stride as usize;
    if stride == 0 || !message.data.len().is_multiple_of(stride) {
        return Err(Undecodable::Layout(
            "the length of its data is not a multiple of the size of a point",
        ));
    }
    let mut elements = message.fields.as_slice();
    for coordinate in VECTOR {
        match elements.split_first() {
            Some((element, _)) if element.name == coordinate => elements = &elements[1..],
            _ => return Err(Undecodable::Layout("its first fields are not x, y and z")),
        }
    }
    // fields that share bytes would take far more memory than the message
    let elements_bytes: usize = message.fields.iter().map(|e| bytes_of(e.r#type())).sum();
    if elements_bytes > stride {
        return Err(Undecodable::Layout(
            "its fields take more bytes than a point has",
        ));
    }
    let coordinates = unpack(&message.data, stride, &message.fields[..3])?;
    let mut fields = Vec::new();
    while let Some(first) = elements.first() {
        let (name, components) = group(&first.name, elements);
        let (these, rest) = elements.split_at(components);
        let values = unpack(&message.data, stride, these)?;
        fields.push(CloudField {
            name: name.into(),
            unit: String::new(),
            components,
            values,
        });
        elements = rest;
    }
    let positions = coordinates
        .chunks_exact(3)
        .map(|p| [p[0], p[1], p[2]])
        .collect();
    Ok(LoggedCloud {
        time,
        positions,
        fields,
    })
}

/// The field that `elements` begin with, and how many of them are its components.
fn group<'a>(first: &'a str, elements: &[PackedElementField]) -> (&'a str, usize) {
    for (suffix, components) in [(".xx", 9), (".x", 3)] {
        if let Some(name) = first.strip_suffix(suffix)
            && let Some(names) = element_names(name, components)
            && elements.len() >= components
            && elements
                .iter()
                .zip(&names)
                .all(|(element, name)| element.name == *name)
        {
            return (name, components);
        }
    }
    (first, 1)
}

/// Bytes of a number; 0 for one of an unknown type.
fn bytes_of(numeric_type: NumericType) -> usize {
    match numeric_type {
        NumericType::Float32 => 4,
        NumericType::Float64 => 8,
        NumericType::Unknown => 0,
    }
}

/// The values of these elements, those of one point together.
fn unpack(
    data: &[u8],
    stride: usize,
    elements: &[PackedElementField],
) -> Result<Vec<f64>, Undecodable> {
    let wrong = Undecodable::Layout("a field is neither FLOAT32 nor FLOAT64, or outside the point");
    let layout: Option<Vec<_>> = elements
        .iter()
        .map(|element| {
            let start = element.offset as usize;
            let width = bytes_of(element.r#type());
            (width > 0 && start + width <= stride).then_some((start, width))
        })
        .collect();
    let Some(layout) = layout else {
        return Err(wrong);
    };
    let mut values = Vec::with_capacity(data.len() / stride * elements.len());
    for point in data.chunks_exact(stride) {
        for &(start, width) in &layout {
            values.push(number(&point[start..start + width]));
        }
    }
    Ok(values)
}

fn number(bytes: &[u8]) -> f64 {
    match *bytes {
        [a, b, c, d] => f32::from_le_bytes([a, b, c, d]).into(),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => unreachable!("elements are four or eight bytes wide"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Coordinates;
    use crate::log::FieldView;

    #[test]
    fn fields_that_share_bytes_are_refused() {
        let element = |name: &str, offset| PackedElementField {
            name: name.into(),
            offset,
            r#type: NumericType::Float32 as i32,
        };
        let cloud = |others: usize| {
            let mut fields = vec![element("x", 0), element("y", 4), element("z", 8)];
            fields.extend((0..others).map(|n| element(&format!("field{n}"), 12)));
            let message = PointCloud {
                point_stride: 16,
                fields,
                data: vec![0; 32],
                ..Default::default()
            };
            decode(&message.encode_to_vec(), 0.0)
        };
        assert_eq!(cloud(1).ok().map(|cloud| cloud.positions.len()), Some(2));
        assert!(matches!(cloud(2), Err(Undecodable::Layout(_))));
    }

    #[test]
    fn coordinates_come_first_and_in_order() {
        let decoded = |names: [&str; 3]| {
            let fields = names
                .iter()
                .zip([0, 4, 8])
                .map(|(name, offset)| PackedElementField {
                    name: (*name).into(),
                    offset,
                    r#type: NumericType::Float32 as i32,
                });
            let message = PointCloud {
                point_stride: 12,
                fields: fields.collect(),
                data: vec![0; 24],
                ..Default::default()
            };
            decode(&message.encode_to_vec(), 0.0)
        };
        assert!(decoded(VECTOR).is_ok());
        for names in [["x", "z", "y"], ["x", "y", "temperature"]] {
            assert!(matches!(decoded(names), Err(Undecodable::Layout(_))));
        }
    }

    #[test]
    fn times_have_seconds_and_nanoseconds() {
        let cloud = CloudView {
            time: 1.5,
            positions: Coordinates::Listed(&[[0.0; 3]]),
            fields: &[],
        };
        let mut buffer = Vec::new();
        encode(&mut buffer, &cloud, 0..1, Precision::F32, 1_500_000_001);
        let message = PointCloud::decode(buffer.as_slice()).expect("just encoded");
        let time = message.timestamp.expect("it has a time");
        assert_eq!((time.seconds, time.nanos), (1, 500_000_001));
    }

    #[test]
    fn tensor_elements_are_named_by_row_then_column() {
        let stress = nalgebra::Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0);
        let field = FieldView {
            name: "stress",
            components: 9,
            values: stress.as_slice(),
        };
        let cloud = CloudView {
            time: 0.0,
            positions: Coordinates::Listed(&[[0.0; 3]]),
            fields: &[field],
        };
        let mut buffer = Vec::new();
        encode(&mut buffer, &cloud, 0..1, Precision::F64, 0);
        let message = PointCloud::decode(buffer.as_slice()).expect("just encoded");
        for (row, r) in VECTOR.iter().enumerate() {
            for (column, c) in VECTOR.iter().enumerate() {
                let name = format!("stress.{r}{c}");
                let element = message
                    .fields
                    .iter()
                    .find(|f| f.name == name)
                    .expect("is there");
                let start = element.offset as usize;
                assert_eq!(
                    number(&message.data[start..start + 8]),
                    stress[(row, column)]
                );
            }
        }
    }

    #[test]
    fn numbers_of_unknown_type_are_refused() {
        let element = |name: &str, offset, numeric_type| PackedElementField {
            name: name.into(),
            offset,
            r#type: numeric_type as i32,
        };
        let decoded = |numeric_type| {
            let coordinates = VECTOR.iter().zip([0, 4, 8]);
            let fields = coordinates.map(|(name, at)| element(name, at, NumericType::Float32));
            let message = PointCloud {
                point_stride: 16,
                fields: fields.chain([element("heat", 12, numeric_type)]).collect(),
                data: vec![0; 32],
                ..Default::default()
            };
            decode(&message.encode_to_vec(), 0.0)
        };
        assert!(decoded(NumericType::Float32).is_ok());
        assert!(matches!(
            decoded(NumericType::Unknown),
            Err(Undecodable::Layout(_))
        ));
    }

    #[test]
    fn data_that_end_within_a_point_are_refused() {
        let element = |name: &&str, offset| PackedElementField {
            name: (*name).into(),
            offset,
            r#type: NumericType::Float32 as i32,
        };
        let fields = VECTOR.iter().zip([0, 4, 8]).map(|(n, at)| element(n, at));
        let message = PointCloud {
            point_stride: 12,
            fields: fields.collect(),
            data: vec![0; 30],
            ..Default::default()
        };
        let decoded = decode(&message.encode_to_vec(), 0.0);
        assert!(matches!(decoded, Err(Undecodable::Layout(_))));
    }
}
