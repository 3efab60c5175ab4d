"""Logs that are cut off, damaged, split or written by other tools.

The logs are written by the public MCAP writer with the published schema of point clouds.
"""

from __future__ import annotations

import json
import random
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import perimelt
from perimelt._components import Array

RUN = {
    "version": "0.1.0",
    "threads": 1,
    "started": 1_700_000_000,
    "plugins": {"physics": [], "couplers": []},
    "case_file": "made.toml",
}
FIELDS = {"temperature": 1, "displacement": 3, "stress": 9}
TENSOR = ["xx", "yx", "zx", "xy", "yy", "zy", "xz", "yz", "zz"]


def cloud(values: dict[str, Array]) -> bytes:
    """A message with columns as Perimelt names them; tensors have rows and columns."""
    message = PointCloud(frame_id="world")
    columns: list[Array] = []
    for name, array in values.items():
        flat = array.reshape(len(array), -1)
        if array.ndim == 3:
            names = [f"{name}.{component}" for component in TENSOR]
            flat = array.swapaxes(1, 2).reshape(len(array), 9)
        elif array.ndim == 2:
            names = list("xyz") if name == "position" else [f"{name}.{axis}" for axis in "xyz"]
        else:
            names = [name]
        for title, column in zip(names, flat.T, strict=True):
            message.fields.add(name=title, offset=4 * len(columns), type=7)
            columns.append(column)
    message.point_stride = 4 * len(columns)
    message.data = np.column_stack(columns).astype("<f4").tobytes()
    encoded: bytes = message.SerializeToString()
    return encoded


class Maker:
    """Writes a log state by state, as Perimelt lays it out."""

    def __init__(self, path: Path, **options: Any) -> None:
        self.writer = Writer(str(path), chunk_size=1 << 20, **options)
        self.writer.start(profile="perimelt")
        self.writer.add_attachment(0, 0, "case.toml", "text/plain", b'case.title = "made"\n')
        fields = [{"name": n, "unit": "?", "components": c} for n, c in FIELDS.items()]
        body = {"name": "body", "dimension": 3, "spacing": 1.0, "thickness": 1.0, "points": 4}
        run = {**RUN, "bodies": [{**body, "fields": fields}]}
        self.writer.add_metadata("run", {key: json.dumps(value) for key, value in run.items()})
        self.channels: dict[str, int] = {}
        for topic in ("/body/points", "/index", "/balance", "/checkpoint"):
            self.channel(topic)

    def channel(self, topic: str) -> int:
        if topic not in self.channels:
            columns = {"properties": {"heat": {"unit": "J"}}, "required": ["time", "heat"]}
            data = json.dumps(columns).encode()
            schema = self.writer.register_schema(topic, "jsonschema", data)
            self.channels[topic] = self.writer.register_channel(topic, "json", schema)
        return self.channels[topic]

    def message(self, topic: str, log_time: int, data: bytes) -> None:
        self.writer.add_message(self.channel(topic), log_time, data, log_time)

    def state(self, time: float, log_time: int, parts: list[dict[str, Array]]) -> None:
        line = {"time": time, "topic": "/body/points", "step": None}
        self.message("/index", log_time, json.dumps(line).encode())
        self.alone()
        for number, part in reversed(list(enumerate(parts, 1))):
            topic = "/body/points" if number == 1 else f"/body/points/{number}"
            self.message(topic, log_time, cloud(part))
            self.alone()
        row = {"time": time, "heat": None if time == 0 else 2 * time}
        self.message("/balance", log_time, json.dumps(row).encode())
        self.alone()

    def alone(self) -> None:
        """Ends the chunk, as Perimelt does around large messages."""
        finish: Callable[[], None] = self.writer._Writer__finalize_chunk  # type: ignore[attr-defined]
        finish()


def values(seed: int, points: int = 4) -> dict[str, Array]:
    generator = np.random.default_rng(seed)
    shapes = {"position": (3,), "temperature": (), "displacement": (3,), "stress": (3, 3)}
    return {
        name: generator.random((points, *shape)).astype(np.float32)
        for name, shape in shapes.items()
    }


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A log of six states."""
    path = tmp_path / "made.mcap"
    maker = Maker(path)
    for number in range(6):
        maker.state(0.5 * number, 500_000_000 * number, [values(number)])
    maker.writer.finish()
    return path


def chunk_of(path: Path, topic: str, number: int) -> tuple[int, int]:
    """Start and length of the chunk with a message."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    (channel,) = [c.id for c in summary.channels.values() if c.topic == topic]
    chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
    chunks = [chunk for chunk in chunks if channel in chunk.message_index_offsets]
    return chunks[number].chunk_start_offset, chunks[number].chunk_length


def flip(path: Path, offset: int) -> None:
    data = bytearray(path.read_bytes())
    data[offset] ^= 0x55
    path.write_bytes(data)


def check_state(state: perimelt.State) -> None:
    """A state that is read is that which was written."""
    for name, expected in values(round(2 * state.time)).items():
        found = state.positions if name == "position" else state[name]
        npt.assert_array_equal(found, expected, err_msg=name)


def test_what_other_tools_write_is_read(made: Path) -> None:
    log = perimelt.open(made)
    npt.assert_array_equal(log.times, [0, 0.5, 1, 1.5, 2, 2.5])
    for state in log.body().states():
        check_state(state)
    stress = values(5)["stress"]
    npt.assert_array_equal(log.body().field("stress.xy"), stress[:, 0, 1])
    npt.assert_array_equal(log.body().field("stress.yx"), stress[:, 1, 0])
    npt.assert_array_equal(log.balance["heat"], [np.nan, 1, 2, 3, 4, 5])
    assert log.balance.attrs["units"] == {"time": "s", "heat": "J"}


@pytest.mark.parametrize("compression", list(CompressionType))
def test_every_compression_of_mcap_is_read(tmp_path: Path, compression: CompressionType) -> None:
    maker = Maker(tmp_path / "a.mcap", compression=compression)
    maker.state(0.5, 500_000_000, [values(1)])
    maker.writer.finish()
    check_state(perimelt.open(tmp_path / "a.mcap").body().state())


def test_the_parts_of_a_split_state_are_joined(tmp_path: Path) -> None:
    maker = Maker(tmp_path / "a.mcap")
    parts = [values(1, 4), values(2, 4), values(3, 1)]
    maker.state(0.0, 0, [values(0)])
    maker.state(0.5, 500_000_000, parts)
    maker.writer.finish()
    body = perimelt.open(tmp_path / "a.mcap").body()
    npt.assert_array_equal(body.times, [0, 0.5])
    check_state(body.state(0.0))
    state = body.state(0.5)
    assert state.points == 9
    for name in FIELDS:
        npt.assert_array_equal(state[name], np.concatenate([part[name] for part in parts]))


def test_times_are_exact_below_a_nanosecond(tmp_path: Path) -> None:
    maker = Maker(tmp_path / "a.mcap")
    times = [0.0, 1e-15, 2.5e-15]
    for number, time in enumerate(times):
        maker.state(time, number, [values(number)])
    maker.writer.finish()
    log = perimelt.open(tmp_path / "a.mcap")
    npt.assert_array_equal(log.times, times)
    assert log.body().state(1e-15).number == 1
    assert list(log.balance.index) == times


def test_a_log_that_is_cut_off_is_read_up_to_there(made: Path) -> None:
    whole = made.read_bytes()
    start, length = chunk_of(made, "/body/points", 3)
    made.write_bytes(whole[: start + length])
    with pytest.warns(perimelt.DamageWarning, match=r"unfinished.*last state is at 1\.5 s"):
        log = perimelt.open(made)
    assert not log.finished
    npt.assert_array_equal(log.times, [0, 0.5, 1, 1.5])
    check_state(log.body().state())
    made.write_bytes(whole[: start + length - 1])
    with pytest.warns(perimelt.DamageWarning, match="last state is at 1 s"):
        log = perimelt.open(made)
    assert list(log.balance.index) == [0, 0.5, 1]


def test_a_damaged_state_is_left_out_and_told(made: Path) -> None:
    start, length = chunk_of(made, "/body/points", 2)
    flip(made, start + length // 2)
    log = perimelt.open(made)
    body = log.body()
    with pytest.raises(perimelt.DamagedError, match=f"`body` at 1 s is damaged at byte {start}"):
        body.state(1.0)
    with pytest.warns(perimelt.DamageWarning, match="a state is left out.*at 1 s"):
        history = body.history("temperature", 0)
    assert list(history.index) == [0, 0.5, 1.5, 2, 2.5]
    check_state(body.state(1.5))


def test_damaged_rows_are_left_out_and_told(made: Path) -> None:
    start, length = chunk_of(made, "/balance", 2)
    flip(made, start + length - 4)
    with pytest.warns(perimelt.DamageWarning, match="/balance at 1 s: damaged at byte"):
        log = perimelt.open(made)
    assert [damage.offset for damage in log.damage] == [start]
    assert list(log.balance.index) == [0, 0.5, 1.5, 2, 2.5]
    for state in log.body().states():
        check_state(state)


def test_a_damaged_length_costs_nothing_in_a_finished_log(made: Path) -> None:
    start, _ = chunk_of(made, "/body/points", 2)
    # the length of the message index before this chunk: a walk over the records would end there
    flip(made, start - 30)
    log = perimelt.open(made)
    assert [state.number for state in log.body().states()] == list(range(6))


def test_a_damaged_message_index_does_not_change_a_time(made: Path) -> None:
    start, length = chunk_of(made, "/body/points", 2)
    # behind the chunk: head of the message index (9), channel (2), length (4), log time
    flip(made, start + length + 9 + 2 + 4)
    log = perimelt.open(made)
    npt.assert_array_equal(log.times, [0, 0.5, 1, 1.5, 2, 2.5])
    check_state(log.body().state(1.0))


@pytest.mark.filterwarnings("ignore::perimelt.DamageWarning")
def test_no_damage_gives_wrong_numbers_or_another_error(made: Path) -> None:
    whole = made.read_bytes()
    generator = random.Random(1)
    # before this are attachment and metadata, which have no checksum
    first, _ = chunk_of(made, "/balance", 0)
    states = 0
    for attempt in range(400):
        data = bytearray(whole)
        if attempt % 4 == 0:
            del data[generator.randrange(first, len(data)) :]
        else:
            data[generator.randrange(first, len(data))] ^= 1 << generator.randrange(8)
        made.write_bytes(data)
        try:
            log = perimelt.open(made)
            for state in log.body().states():
                check_state(state)
                states += 1
            for time, heat in log.balance["heat"].items():
                assert heat == 2 * float(str(time)) or time == 0
            log.close()
        except perimelt.LogError:
            pass
    # most of each log is sound
    assert states > 400 * 3


def test_what_is_no_log_is_named(tmp_path: Path, made: Path) -> None:
    path = tmp_path / "a.mcap"
    with pytest.raises(perimelt.LogError, match=r"cannot read the log .*a\.mcap: No such file"):
        perimelt.open(path)
    path.write_bytes(b"[case]\ntitle = 'no log'")
    with pytest.raises(perimelt.LogError, match="is not an MCAP file"):
        perimelt.open(path)
    for length in (8, 40):
        path.write_bytes(made.read_bytes()[:length])
        with pytest.raises(perimelt.LogError, match=r"no attachment `case\.toml`"):
            perimelt.open(path)
    writer = Writer(str(path))
    writer.start()
    writer.finish()
    with pytest.raises(perimelt.LogError, match="not the log of a Perimelt run"):
        perimelt.open(path)


def test_a_log_without_states_can_be_opened(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Maker(path).writer.finish()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = perimelt.open(path)
    assert len(log.times) == 0
    assert log.probes.empty
    assert log.balance.empty
    assert log.progress.empty
    assert "no states" in repr(log)
    assert not log.body().fields["temperature"].logged
    with pytest.raises(perimelt.NoStateError, match="no state of `body`"):
        log.body().state()
