"""Decompression within limits."""

from __future__ import annotations

import lz4.frame
import zstandard

from .errors import DamagedError

# Most bytes to which a chunk is unpacked: a few bytes that were made to unpack to gigabytes must
# not take all memory. Perimelt puts about a megabyte of time series into a chunk, and a state of at
# most 2 GiB. Rows of JSON are packed by a factor below one hundred, positions by some hundred.
SERIES_BYTES = 1 << 26
ALL_SERIES_BYTES = 1 << 28
POINTS_BYTES = 1 << 28
MESSAGE_BYTES = (1 << 31) + (1 << 16)
MAX_RATIO = 1000


def decompressed(packed: memoryview, compression: bytes, size: int, offset: int) -> bytes:
    """The data of the chunk at `offset`; at most one byte more than the chunk declares.

    Raises:
        DamagedError: the data cannot be decompressed
    """
    try:
        if compression == b"zstd":
            return _read_up_to(zstandard.ZstdDecompressor().stream_reader(packed), size)
        if compression == b"lz4":
            # the size that the frame declares is not trusted either
            unpacked = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
            return bytes(unpacked)
        if compression == b"":
            return bytes(packed)
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise DamagedError(offset, f"it cannot be decompressed: {error}") from error
    raise DamagedError(offset, f"unknown compression {compression!r}")


def _read_up_to(stream: zstandard.ZstdDecompressionReader, size: int) -> bytes:
    """At most one byte more than expected."""
    parts = []
    left = size + 1
    while left > 0 and (part := stream.read(min(left, 1 << 20))):
        parts.append(part)
        left -= len(part)
    return b"".join(parts)
