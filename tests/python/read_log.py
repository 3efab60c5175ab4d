"""Reads the log of a run with public MCAP tools only, as somebody without our code would.

    pip install mcap mcap-protobuf-support foxglove-schemas-protobuf
    python read_log.py run.mcap

Checks that the summary is readable, that the channels, the attachment `case.toml` and the
metadata `run` are there, that the point-cloud schema equals the published foxglove.PointCloud,
and that point clouds decode to finite numbers that are packed as their fields say. Prints one
line; exits with 1 and a sentence if something is wrong.
"""

import json
import math
import struct
import sys

from foxglove_schemas_protobuf import PointCloud_pb2
from google.protobuf import descriptor_pb2
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

NUMBERS = {
    PointCloud_pb2.foxglove_dot_PackedElementField__pb2.PackedElementField.FLOAT32: ("<f", 4),
    PointCloud_pb2.foxglove_dot_PackedElementField__pb2.PackedElementField.FLOAT64: ("<d", 8),
}


class Wrong(Exception):
    """What is wrong with the log."""


def require(condition, sentence):
    if not condition:
        raise Wrong(sentence)


def official_files(descriptor, files=None):
    """The published schema: a FileDescriptorProto of the file and of each that it imports."""
    files = {} if files is None else files
    if descriptor.name not in files:
        proto = descriptor_pb2.FileDescriptorProto()
        descriptor.CopyToProto(proto)
        files[descriptor.name] = proto
        for dependency in descriptor.dependencies:
            official_files(dependency, files)
    return files


def shape(file):
    """All of a file that decides how messages look on the wire and what they are called."""
    return {
        "package": file.package,
        "syntax": file.syntax,
        "imports": sorted(file.dependency),
        "messages": sorted(message_shape(message) for message in file.message_type),
        "enums": sorted(enum_shape(enum) for enum in file.enum_type),
    }


def message_shape(message):
    fields = [(f.number, f.name, f.type, f.label, f.type_name) for f in message.field]
    nested = sorted(message_shape(inner) for inner in message.nested_type)
    return (message.name, sorted(fields), nested, sorted(map(enum_shape, message.enum_type)))


def enum_shape(enum):
    return (enum.name, sorted((value.number, value.name) for value in enum.value))


def check_schema(schema):
    require(schema.name == "foxglove.PointCloud", f"schema is {schema.name}")
    require(schema.encoding == "protobuf", f"schema encoding is {schema.encoding}")
    ours = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    ours = {file.name: shape(file) for file in ours.file}
    official = {name: shape(f) for name, f in official_files(PointCloud_pb2.DESCRIPTOR).items()}
    require(ours.keys() == official.keys(), f"files {sorted(ours)}, not {sorted(official)}")
    for name, expected in official.items():
        require(ours[name] == expected, f"{name} is\n{ours[name]}\nand should be\n{expected}")


def check_cloud(topic, cloud):
    """Number of points; every field must be one of the packed numbers of a point."""
    require(cloud.frame_id == "world", f"{topic}: frame {cloud.frame_id}")
    require(cloud.pose.orientation.w == 1.0, f"{topic}: pose is not the identity")
    require(cloud.point_stride > 0, f"{topic}: point stride is 0")
    require(len(cloud.data) % cloud.point_stride == 0, f"{topic}: a part of a point is left over")
    names = [field.name for field in cloud.fields]
    require(names[:3] == ["x", "y", "z"], f"{topic}: fields begin with {names[:3]}")
    require(len(set(names)) == len(names), f"{topic}: a field comes twice: {names}")
    end = 0
    for field in cloud.fields:
        require(field.type in NUMBERS, f"{topic}: {field.name} is of type {field.type}")
        form, width = NUMBERS[field.type]
        require(field.offset == end, f"{topic}: {field.name} starts at byte {field.offset}")
        end += width
        if field.name in ("x", "y", "z", "temperature"):
            for start in range(field.offset, len(cloud.data), cloud.point_stride):
                (value,) = struct.unpack_from(form, cloud.data, start)
                require(math.isfinite(value), f"{topic}: {field.name} is {value}")
                above_zero = field.name != "temperature" or value > 0.0
                require(above_zero, f"{topic}: a temperature of {value} K")
    require(end == cloud.point_stride, f"{topic}: fields end at {end}, not {cloud.point_stride}")
    return len(cloud.data) // cloud.point_stride


def check_index_and_series(topic, messages):
    """Times in JSON must not go back, and are the rounded log times or finer."""
    last = -math.inf
    for schema, message in messages:
        require(schema is not None and schema.encoding == "jsonschema", f"{topic}: no JSON schema")
        content = json.loads(message.data)
        for name in json.loads(schema.data)["required"]:
            require(name in content, f"{topic}: {name} is missing in {content}")
        require(content["time"] >= last, f"{topic}: time goes back to {content['time']} s")
        last = content["time"]


def check(path):
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        require(reader.get_header().profile == "perimelt", "profile is not `perimelt`")
        summary = reader.get_summary()
        require(summary is not None and summary.statistics is not None, "no summary")
        topics = {channel.topic: channel for channel in summary.channels.values()}

        attachments = {a.name: a.data.decode() for a in reader.iter_attachments()}
        require(attachments.get("case.toml", "").strip(), "attachment `case.toml` is missing")
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
        require("run" in metadata, "metadata `run` is missing")
        run = {key: json.loads(text) for key, text in metadata["run"].items()}
        for key in ("version", "threads", "started", "bodies", "plugins", "case_file"):
            require(key in run, f"metadata `run` has no {key}")

        clouds = 0
        for body in run["bodies"]:
            topic = f"/{body['name']}/points"
            require(topic in topics, f"no channel {topic}")
            require(topics[topic].message_encoding == "protobuf", f"{topic} is not protobuf")
            check_schema(summary.schemas[topics[topic].schema_id])
            # a large state has further parts on numbered topics, with the same log time
            parts = [name for name in topics if name == topic or name.startswith(topic + "/")]
            points = {}
            for _, channel, message, cloud in reader.iter_decoded_messages(topics=parts):
                count = check_cloud(channel.topic, cloud)
                points[message.log_time] = points.get(message.log_time, 0) + count
            for time, count in points.items():
                require(count == body["points"], f"{topic}: {count} points at {time} ns")
            clouds += len(points)
        require(clouds > 0, "no point cloud in the log")

        for topic, channel in topics.items():
            if channel.message_encoding == "json":
                messages = reader.iter_messages(topics=[topic])
                check_index_and_series(topic, ((schema, message) for schema, _, message in messages))
        for topic in ("/checkpoint", "/index", "/progress"):
            require(topic in topics, f"no channel {topic}")

    count = summary.statistics.message_count
    end = summary.statistics.message_end_time * 1e-9
    print(f"{path}: {len(topics)} topics, {count} messages, {clouds} point clouds, ends at {end} s")


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: read_log.py run.mcap")
    try:
        check(sys.argv[1])
    except (Wrong, McapError, OSError, ValueError) as error:
        sys.exit(f"{sys.argv[1]}: {error}")


if __name__ == "__main__":
    main()
