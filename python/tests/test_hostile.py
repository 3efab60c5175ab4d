"""Logs that somebody made to do harm: limits of memory and time."""

from __future__ import annotations

import json
import os
import struct
import time
import warnings
import zlib
from pathlib import Path

import lz4.frame
import pytest
import zstandard

import perimelt
from perimelt._cloud import decode
from perimelt._unpack import SERIES_BYTES

MAGIC = b"\x89MCAP0\r\n"
HEADER, SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, METADATA = 1, 3, 4, 5, 6, 9, 12


def record(opcode: int, content: bytes) -> bytes:
    """A record of MCAP."""
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: str) -> bytes:
    """A string of MCAP."""
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def chunk(packed: bytes, compression: str, size: int) -> bytes:
    """A chunk without a checksum."""
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression)
    return record(CHUNK, head + struct.pack("<Q", len(packed)) + packed)


def message(data: bytes) -> bytes:
    """A message of the only channel."""
    return record(MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0) + data)


def write_log(path: Path, topic: str, *chunks: bytes) -> Path:
    """A log with these chunks, unfinished."""
    case = struct.pack("<QQ", 0, 0) + text("case.toml") + text("application/toml")
    case += struct.pack("<Q", 0)
    case += struct.pack("<I", zlib.crc32(case))
    body = {"name": "plate", "dimension": 3, "spacing": 1.0, "thickness": 1.0, "points": 1}
    run = {
        "version": "0.1.0",
        "threads": 1,
        "started": 0,
        "plugins": {},
        "bodies": [{**body, "fields": []}],
    }
    entries = b"".join(text(key) + text(json.dumps(value)) for key, value in run.items())
    parts = [
        MAGIC,
        record(HEADER, text("perimelt") + text("")),
        record(ATTACHMENT, case),
        record(METADATA, text("run") + struct.pack("<I", len(entries)) + entries),
        record(SCHEMA, struct.pack("<H", 1) + text("s") + text("") + struct.pack("<I", 0)),
        record(CHANNEL, struct.pack("<HH", 1, 1) + text(topic) + text("") + struct.pack("<I", 0)),
        *chunks,
        # a chunk behind them, so that theirs are not the last one
        chunk(b"", "", 0),
    ]
    path.write_bytes(b"".join(parts))
    return path


def open_log(path: Path) -> perimelt.Log:
    """A log, without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return perimelt.Log(path)


@pytest.mark.parametrize("declared", [100, 1 << 40, SERIES_BYTES])
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_is_unpacked_no_further_than_it_declares(
    tmp_path: Path, compression: str, declared: int
) -> None:
    zeros = bytes(300 << 20)
    pack = zstandard.compress if compression == "zstd" else lz4.frame.compress
    bomb = chunk(pack(zeros), compression, declared)
    tracemalloc = pytest.importorskip("tracemalloc")
    path = write_log(tmp_path / "bomb.mcap", "/progress", bomb)
    del zeros, bomb
    tracemalloc.start()
    log = open_log(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(log.damage) == 1
    assert peak < 4 * SERIES_BYTES, peak


def test_time_series_have_a_limit_together(tmp_path: Path) -> None:
    one = message(b" " * (SERIES_BYTES - 64))
    bomb = chunk(zstandard.compress(one), "zstd", len(one))
    started = time.monotonic()
    log = open_log(write_log(tmp_path / "many.mcap", "/other", *[bomb] * 40))
    # four fit into 256 MiB, and the file itself has some kilobytes
    assert 30 < len(log.damage) < 40
    assert time.monotonic() - started < 20


def test_a_number_without_an_end_is_an_error() -> None:
    started = time.monotonic()
    with pytest.raises(perimelt.LogError, match="no end"):
        decode(memoryview(b"\xff" * (1 << 22)))
    assert time.monotonic() - started < 1


def test_a_message_that_is_no_json_is_left_out_alone(tmp_path: Path) -> None:
    parts = [chunk(data, "", len(data)) for data in (message(b"[[["), message(b"\xff"))]
    log = open_log(write_log(tmp_path / "text.mcap", "/index", *parts))
    assert len(log.damage) == 2


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes")
def test_a_pipe_is_no_log(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(perimelt.LogError, match="no regular file"):
        perimelt.Log(tmp_path / "pipe")
