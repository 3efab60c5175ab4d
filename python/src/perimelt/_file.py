"""The MCAP file of a log: where its messages are, and their bytes.

A finished log ends with a summary that says where the chunks are. Without one, in an unfinished
log, the records are walked one after the other, up to the first that is incomplete. In both cases
the message indexes behind a chunk tell which topics and times it has, so that chunks of point
clouds and checkpoints are not read until their message is asked for. Time series are read at once.
"""

from __future__ import annotations

import json
import struct
import sys
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Metadata,
    MetadataIndex,
    Schema,
)
from mcap.stream_reader import StreamReader

from ._unpack import (
    ALL_SERIES_BYTES,
    MAX_RATIO,
    MESSAGE_BYTES,
    POINTS_BYTES,
    SERIES_BYTES,
    decompressed,
)
from .errors import DamagedError, LogError

if sys.platform != "win32":
    import fcntl

MAGIC = b"\x89MCAP0\r\n"
# opcode and length before each record
HEAD = struct.Struct("<BQ")
# start of the summary, start of its index, checksum
FOOTER = struct.Struct("<QQI")
# first and last log time, uncompressed size, checksum, length of the name of the compression
CHUNK = struct.Struct("<QQQII")
# channel, sequence, log time, publish time
MESSAGE = struct.Struct("<HIQQ")
# channel, bytes of the entries
MESSAGE_INDEX = struct.Struct("<HI")
# largest record outside of chunks: case file, description of the run
MAX_RECORD_BYTES = 1 << 28

CHECKPOINT = "/checkpoint"
INDEX = "/index"


def is_locked(stream: BinaryIO) -> bool:
    """Whether a run writes the file of a stream; False where the system does not tell."""
    if sys.platform == "win32":
        return False
    try:
        fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        # some file systems have no locks
        return False
    fcntl.flock(stream, fcntl.LOCK_UN)
    return False


def points_topic(body: str) -> str:
    """Topic of the point clouds of a body."""
    return f"/{body}/points"


def is_large(topic: str) -> bool:
    """Whether messages of a topic stay in the file until they are asked for."""
    first, _, number = topic.rpartition("/")
    if number.isdecimal() and is_large(first):
        return True
    return topic == CHECKPOINT or (topic.endswith("/points") and not topic.startswith("/probes/"))


@dataclass(frozen=True)
class Damage:
    """A part of a log that is missing or damaged.

    Attributes:
        offset: start of the damaged record in the file, bytes
        reason: what is wrong with it
        lost: what was in it, as far as it is known
    """

    offset: int
    reason: str
    lost: str

    def __str__(self) -> str:
        return f"{self.lost}: damaged at byte {self.offset}, {self.reason}"


@dataclass(frozen=True)
class Place:
    """A message in a chunk."""

    chunk: int
    channel: int
    log_time: int


@dataclass
class _Chunk:
    """A chunk record and the message indexes behind it."""

    offset: int
    indexes: list[bytes] = field(default_factory=list)


class LogFile:
    """The messages of a log.

    Attributes:
        path: the file
        finished: whether the writer closed the file
        end: where an unfinished log ends, bytes
        case_text: attachment `case.toml`
        run: metadata `run`, one JSON text per key
        small: messages of time series by topic
        large: places of point clouds and checkpoints by topic, in the order of time
        exact: simulated time (s) by topic and log time
        damage: what could not be read
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.finished = False
        self.case_text: str | None = None
        self.run: dict[str, str] | None = None
        self.small: dict[str, list[bytes]] = {}
        self.large: dict[str, list[Place]] = {}
        self.exact: dict[tuple[str, int], float] = {}
        self.damage: list[Damage] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._lock = Lock()
        self._series_bytes = 0
        if path.exists() and not path.is_file():
            # to open a pipe would wait for its writer
            raise LogError(f"{path} is no regular file, which a log must be")
        try:
            self._stream: BinaryIO = path.open("rb")
        except OSError as error:
            raise LogError(f"cannot read the log {path}: {error.strerror}") from error
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def is_being_written(self) -> bool:
        """Whether a run is writing the file."""
        return not self.finished and is_locked(self._stream)

    def close(self) -> None:
        """Closes the file; messages can no longer be read."""
        self._stream.close()

    def _open(self) -> None:
        self._size = self._stream.seek(0, 2)
        if self._read(0, len(MAGIC)) != MAGIC:
            raise LogError(
                f"{self.path} is not an MCAP file; give the log of a run, "
                "as written by `perimelt run`"
            )
        self.end = self._size
        chunks = self._summarised_chunks()
        if chunks is None:
            chunks = self._scanned_chunks()
        for chunk in chunks:
            try:
                self._take(chunk)
            except DamagedError as error:
                self.damage.append(Damage(error.offset, error.reason, self._content(chunk)))
            except (
                ValueError,
                KeyError,
                TypeError,
                struct.error,
                McapError,
                RecursionError,
            ) as error:
                # a message that is not of the form of its topic
                self.damage.append(Damage(chunk.offset, str(error), self._content(chunk)))
        for places in self.large.values():
            places.sort(key=lambda place: place.log_time)

    def columns(self, topic: str) -> list[tuple[str, str]]:
        """Names and units of the quantities of a time series."""
        for channel in self._channels.values():
            if channel.topic == topic and channel.schema_id in self._schemas:
                schema = json.loads(self._schemas[channel.schema_id].data)
                properties = schema.get("properties", {})
                required = (name for name in schema.get("required", ()) if name != "time")
                return [(name, properties.get(name, {}).get("unit", "")) for name in required]
        return []

    def parts(self, topic: str, number: int) -> list[Place]:
        """Places of message `number` of a topic and of the further parts of the same state.

        A large state is split: the next points are on the topics with `/2`, `/3` and so on.
        """
        places = [self.large[topic][number]]
        while True:
            further = self.large.get(f"{topic}/{len(places) + 1}", ())
            same = [place for place in further if place.log_time == places[0].log_time]
            if not same:
                return places
            places.append(same[0])

    def message(self, place: Place) -> memoryview:
        """The bytes of a message.

        Raises:
            DamagedError: the chunk with this message is damaged
        """
        for opcode, record in self._records(place.chunk, POINTS_BYTES):
            if opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE.unpack_from(record)
                if (channel, log_time) == (place.channel, place.log_time):
                    return record[MESSAGE.size :]
        raise DamagedError(place.chunk, "a message that its index names is missing")

    def _read(self, offset: int, count: int) -> bytes:
        with self._lock:
            self._stream.seek(offset)
            return self._stream.read(count)

    def _head(self, offset: int) -> tuple[int, int] | None:
        """Opcode and length of a record, None if it is incomplete."""
        head = self._read(offset, HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        return None if length > self._size - offset - HEAD.size else (opcode, length)

    def _content(self, chunk: _Chunk) -> str:
        """What a chunk has, by its message indexes."""
        try:
            times = _log_times(chunk.indexes)
        except (struct.error, ValueError):
            times = {}
        channels = [self._channels[channel] for channel in times if channel in self._channels]
        if not channels:
            return "some messages"
        # lines of the index are of no interest beside the messages that they announce
        topics = sorted({channel.topic for channel in channels} - {INDEX}) or [INDEX]
        log_times = [time for entries in times.values() for time in entries]
        span = f"{min(log_times) * 1e-9:.6g}"
        if max(log_times) > min(log_times):
            span += f" to {max(log_times) * 1e-9:.6g}"
        return f"{', '.join(topics)} at {span} s"

    # Where the chunks are

    def _summarised_chunks(self) -> list[_Chunk] | None:
        """The chunks by the summary of a finished log; None without a sound one."""
        length = HEAD.size + FOOTER.size + len(MAGIC)
        tail = self._read(max(0, self._size - length), length)
        if len(tail) < length or not tail.endswith(MAGIC):
            return None
        opcode, _ = HEAD.unpack_from(tail)
        start, _, checksum = FOOTER.unpack_from(tail, HEAD.size)
        if opcode != Opcode.FOOTER or not 0 < start < self._size:
            return None
        summary = self._read(start, self._size - start)
        covered = len(summary) - len(MAGIC) - 4
        if checksum != 0 and zlib.crc32(memoryview(summary)[:covered]) != checksum:
            return None
        chunks = []
        try:
            for record in StreamReader(BytesIO(summary), skip_magic=True).records:
                if isinstance(record, (Schema, Channel)):
                    self._declare(record)
                elif isinstance(record, ChunkIndex):
                    behind = record.chunk_start_offset + record.chunk_length
                    indexes = _split(self._read(behind, record.message_index_length))
                    chunks.append(_Chunk(record.chunk_start_offset, indexes))
                elif isinstance(record, (AttachmentIndex, MetadataIndex)):
                    self._describe(record.offset)
        except (McapError, struct.error, UnicodeDecodeError):
            return None
        self.finished = True
        return sorted(chunks, key=lambda chunk: chunk.offset)

    def _scanned_chunks(self) -> list[_Chunk]:
        """The chunks record by record, up to the first that is incomplete."""
        self.damage.clear()
        chunks: list[_Chunk] = []
        offset = len(MAGIC)
        while (head := self._head(offset)) is not None:
            opcode, length = head
            body = offset + HEAD.size
            if opcode == Opcode.DATA_END:
                self.finished = self._read(self._size - len(MAGIC), len(MAGIC)) == MAGIC
                break
            if opcode == Opcode.CHUNK:
                chunks.append(_Chunk(offset))
            elif opcode == Opcode.MESSAGE_INDEX and chunks:
                chunks[-1].indexes.append(self._read(body, length))
            elif opcode in (Opcode.ATTACHMENT, Opcode.METADATA):
                self._describe(offset)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                try:
                    self._declare(_parse(opcode, self._read(body, length)))
                except (McapError, struct.error, UnicodeDecodeError):
                    break
            elif opcode == 0:
                # no record: the length of the one before is damaged
                break
            offset = body + length
        else:
            # the last chunk may lack some of its indexes; that of a large state has one
            if chunks and self._declared_size(chunks[-1].offset) <= SERIES_BYTES:
                chunks[-1].indexes.clear()
        self.end = offset
        return chunks

    def _declare(self, record: Schema | Channel) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        else:
            self._channels[record.id] = record

    def _describe(self, offset: int) -> None:
        """Takes the case from its attachment, or the description of the run from its metadata."""
        head = self._head(offset)
        if head is None:
            return
        if head[1] > MAX_RECORD_BYTES:
            self.damage.append(
                Damage(offset, f"it has {head[1]} bytes", "an attachment or metadata")
            )
            return
        content = self._read(offset + HEAD.size, head[1])
        try:
            if head[0] == Opcode.ATTACHMENT:
                (checksum,) = struct.unpack("<I", content[-4:])
                if checksum not in (0, zlib.crc32(content[:-4])):
                    self.damage.append(Damage(offset, "its checksum is wrong", "an attachment"))
                attachment = Attachment.read(ReadDataStream(BytesIO(content)))
                if attachment.name == "case.toml":
                    self.case_text = attachment.data.decode("utf-8", "replace")
            elif head[0] == Opcode.METADATA:
                metadata = Metadata.read(ReadDataStream(BytesIO(content)))
                if metadata.name == "run":
                    self.run = metadata.metadata
        except (McapError, struct.error, UnicodeDecodeError) as error:
            self.damage.append(Damage(offset, str(error), "an attachment or metadata"))

    # What is in the chunks

    def _take(self, chunk: _Chunk) -> None:
        """Notes where the large messages of a chunk are, and keeps the small ones."""
        try:
            log_times = _log_times(chunk.indexes)
        except (struct.error, ValueError):
            log_times = {}
        places = [
            Place(chunk.offset, channel, log_time)
            for channel, times in log_times.items()
            for log_time in times
        ]
        if places and all(map(self._is_announced, places)):
            for place in places:
                self._note(place)
            return
        for opcode, record in self._records(chunk.offset, SERIES_BYTES):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(_parse(opcode, bytes(record)))
            elif opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE.unpack_from(record)
                known = self._channels.get(channel)
                if known is None:
                    continue
                if is_large(known.topic):
                    self._note(Place(chunk.offset, channel, log_time))
                elif known.topic == INDEX:
                    line: dict[str, Any] = json.loads(bytes(record[MESSAGE.size :]))
                    self.exact[line["topic"], log_time] = line["time"]
                else:
                    message = bytes(record[MESSAGE.size :])
                    self.small.setdefault(known.topic, []).append(message)

    def _is_announced(self, place: Place) -> bool:
        """Whether an earlier line of `/index` names a message; message indexes have no checksum."""
        channel = self._channels.get(place.channel)
        if channel is None or not is_large(channel.topic):
            return False
        first, _, number = channel.topic.rpartition("/")
        topic = first if number.isdecimal() else channel.topic
        return (topic, place.log_time) in self.exact

    def _note(self, place: Place) -> None:
        self.large.setdefault(self._channels[place.channel].topic, []).append(place)

    def _records(self, offset: int, limit: int) -> Iterator[tuple[int, memoryview]]:
        """Opcode and content of the records in the chunk at `offset`."""
        data = memoryview(self._unpacked(offset, limit))
        at = 0
        while at < len(data):
            if len(data) - at < HEAD.size:
                raise DamagedError(offset, "a record in the chunk is cut off")
            opcode, length = HEAD.unpack_from(data, at)
            at += HEAD.size
            if length > len(data) - at or (opcode == Opcode.MESSAGE and length < MESSAGE.size):
                raise DamagedError(offset, "a record in the chunk is cut off")
            yield opcode, data[at : at + length]
            at += length

    def _declared_size(self, offset: int) -> int:
        """Bytes of the records of the chunk at `offset`, as it says; 0 without a complete head."""
        head = self._read(offset + HEAD.size, CHUNK.size)
        return int(CHUNK.unpack(head)[2]) if len(head) == CHUNK.size else 0

    def _unpacked(self, offset: int, limit: int) -> bytes:
        """The records of a chunk, decompressed and compared with their size and checksum.

        A chunk of states may have more bytes than `limit` as far as its packed size allows.
        """
        head = self._head(offset)
        if head is None or head[0] != Opcode.CHUNK or head[1] < CHUNK.size:
            raise DamagedError(offset, "there is no complete chunk")
        record = memoryview(self._read(offset + HEAD.size, head[1]))
        _, _, size, checksum, name_length = CHUNK.unpack_from(record)
        compression = bytes(record[CHUNK.size : CHUNK.size + name_length])
        # the length of the data, 8 bytes, is that of the remaining record
        packed = record[CHUNK.size + name_length + 8 :]
        if limit != SERIES_BYTES:
            limit = min(max(limit, MAX_RATIO * len(packed)), MESSAGE_BYTES)
        if size > limit:
            raise DamagedError(offset, f"a chunk of {size} bytes, expected at most {limit}")
        if limit == SERIES_BYTES:
            self._series_bytes += size
            if self._series_bytes > max(ALL_SERIES_BYTES, MAX_RATIO * self._size):
                raise DamagedError(offset, "the time series of the log are too large")
        data = decompressed(packed, compression, size, offset)
        if len(data) != size:
            raise DamagedError(offset, f"it does not unpack to the {size} bytes that it names")
        if checksum not in (0, zlib.crc32(data)):
            raise DamagedError(offset, "its checksum is wrong")
        return data


def _parse(opcode: int, content: bytes) -> Schema | Channel:
    stream = ReadDataStream(BytesIO(content))
    record: Schema | Channel
    record = Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)
    return record


def _split(records: bytes) -> list[bytes]:
    """The contents of consecutive message index records; none if their form is wrong."""
    contents = []
    at = 0
    while at < len(records):
        if len(records) - at < HEAD.size:
            return []
        opcode, length = HEAD.unpack_from(records, at)
        at += HEAD.size
        if opcode != Opcode.MESSAGE_INDEX or length > len(records) - at:
            return []
        contents.append(records[at : at + length])
        at += length
    return contents


def _log_times(indexes: list[bytes]) -> dict[int, list[int]]:
    """Log times of the messages of each channel, by the message indexes."""
    times = {}
    for content in indexes:
        channel, length = MESSAGE_INDEX.unpack_from(content)
        if length != len(content) - MESSAGE_INDEX.size or length % 16 != 0:
            raise ValueError("a message index has a wrong length")
        times[channel] = [
            log_time for log_time, _ in struct.iter_unpack("<QQ", content[MESSAGE_INDEX.size :])
        ]
    return times
