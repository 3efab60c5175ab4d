//! The official `foxglove.PointCloud` schema as a protobuf `FileDescriptorSet`.
//!
//! Code instead of a binary file, so that it can be read; `tests/python/read_log.py`
//! compares it with the published one.

use prost::Message;
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};

pub(super) const NAME: &str = "foxglove.PointCloud";

/// The encoded `FileDescriptorSet`: `PointCloud.proto` and all it imports.
pub(super) fn file_descriptor_set() -> Vec<u8> {
    let doubles = |name: &str, components: &[&str]| {
        let components = (1..).zip(components);
        let fields = components.map(|(number, name)| field(name, number, Type::Double));
        let path = format!("foxglove/{name}.proto");
        file(&path, &[], message(name, fields.collect()))
    };
    let files = vec![
        file(
            "google/protobuf/timestamp.proto",
            &[],
            message(
                "Timestamp",
                vec![
                    field("seconds", 1, Type::Int64),
                    field("nanos", 2, Type::Int32),
                ],
            ),
        ),
        doubles("Vector3", &["x", "y", "z"]),
        doubles("Quaternion", &["x", "y", "z", "w"]),
        file(
            "foxglove/Pose.proto",
            &["foxglove/Quaternion.proto", "foxglove/Vector3.proto"],
            message(
                "Pose",
                vec![
                    of_type("position", 1, Type::Message, ".foxglove.Vector3"),
                    of_type("orientation", 2, Type::Message, ".foxglove.Quaternion"),
                ],
            ),
        ),
        file(
            "foxglove/PackedElementField.proto",
            &[],
            DescriptorProto {
                enum_type: vec![numeric_type()],
                ..message(
                    "PackedElementField",
                    vec![
                        field("name", 1, Type::String),
                        field("offset", 2, Type::Fixed32),
                        of_type(
                            "type",
                            3,
                            Type::Enum,
                            ".foxglove.PackedElementField.NumericType",
                        ),
                    ],
                )
            },
        ),
        file(
            "foxglove/PointCloud.proto",
            &[
                "foxglove/PackedElementField.proto",
                "foxglove/Pose.proto",
                "google/protobuf/timestamp.proto",
            ],
            message(
                "PointCloud",
                vec![
                    of_type("timestamp", 1, Type::Message, ".google.protobuf.Timestamp"),
                    field("frame_id", 2, Type::String),
                    of_type("pose", 3, Type::Message, ".foxglove.Pose"),
                    field("point_stride", 4, Type::Fixed32),
                    FieldDescriptorProto {
                        label: Some(Label::Repeated as i32),
                        ..of_type("fields", 5, Type::Message, ".foxglove.PackedElementField")
                    },
                    field("data", 6, Type::Bytes),
                ],
            ),
        ),
    ];
    FileDescriptorSet { file: files }.encode_to_vec()
}

/// A file with one message; its package is its folder.
fn file(name: &str, dependencies: &[&str], message: DescriptorProto) -> FileDescriptorProto {
    let folder = name.rsplit_once('/').map_or("", |(folder, _)| folder);
    FileDescriptorProto {
        name: Some(name.into()),
        package: Some(folder.replace('/', ".")),
        dependency: dependencies.iter().map(|name| (*name).into()).collect(),
        message_type: vec![message],
        syntax: Some("proto3".into()),
        ..Default::default()
    }
}

fn message(name: &str, field: Vec<FieldDescriptorProto>) -> DescriptorProto {
    DescriptorProto {
        name: Some(name.into()),
        field,
        ..Default::default()
    }
}

fn field(name: &str, number: i32, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.into()),
        number: Some(number),
        label: Some(Label::Optional as i32),
        r#type: Some(kind as i32),
        ..Default::default()
    }
}

fn of_type(name: &str, number: i32, kind: Type, type_name: &str) -> FieldDescriptorProto {
    FieldDescriptorProto {
        type_name: Some(type_name.into()),
        ..field(name, number, kind)
    }
}

fn numeric_type() -> EnumDescriptorProto {
    let names = [
        "UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64",
    ];
    EnumDescriptorProto {
        name: Some("NumericType".into()),
        value: (0..)
            .zip(names)
            .map(|(number, name)| EnumValueDescriptorProto {
                name: Some(name.into()),
                number: Some(number),
                ..Default::default()
            })
            .collect(),
        ..Default::default()
    }
}
