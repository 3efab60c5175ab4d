"""`foxglove.PointCloud` messages: the points of a body, packed point by point.

The message is protobuf. It is walked here, not by a protobuf library, so that the packed points
are used in place: they are nearly all of a message that can have 2 GiB.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import LogError

# numbers of the fields of foxglove.PointCloud and foxglove.PackedElementField
STRIDE, FIELDS, DATA = 4, 5, 6
NAME, OFFSET, TYPE = 1, 2, 3
# foxglove.PackedElementField.NumericType
NUMBERS = {7: "<f4", 8: "<f8"}

VECTOR = ("x", "y", "z")
# column by column
TENSOR = ("xx", "yx", "zx", "xy", "yy", "zy", "xz", "yz", "zz")
# key of the positions; no field is called like this
POSITIONS = "x, y, z"

Element = tuple[str, int, str]


def decode(message: memoryview) -> npt.NDArray[np.void]:
    """The points of a message, one record for each.

    Key `POSITIONS` has the current positions. A field is a scalar, a vector of 3, or a tensor of
    (3, 3) with the column first, as packed. Nothing is copied.
    """
    stride = 0
    elements: list[Element] = []
    data = memoryview(b"")
    for number, value in _fields(message):
        if number == STRIDE and isinstance(value, int):
            stride = value
        elif number == FIELDS and isinstance(value, memoryview):
            elements.append(_element(value))
        elif number == DATA and isinstance(value, memoryview):
            data = value
    if [name for name, _, _ in elements[:3]] != list(VECTOR):
        raise LogError("the first fields of a point cloud are not x, y and z")
    if stride == 0 or len(data) % stride != 0:
        raise LogError("the data of a point cloud is no whole number of points")
    names: list[str] = []
    formats: list[tuple[str, tuple[int, ...]]] = []
    offsets: list[int] = []
    while elements:
        name, shape = (POSITIONS, (3,)) if not names else _group(elements)
        count = int(np.prod(shape))
        _, offset, kind = elements[0]
        width = np.dtype(kind).itemsize
        for index, (element, at, other) in enumerate(elements[:count]):
            if at != offset + index * width or other != kind or at + width > stride:
                raise LogError(f"element {element} of a point cloud is not where it should be")
        names.append(name)
        formats.append((kind, shape))
        offsets.append(offset)
        del elements[:count]
    layout: Any = {"names": names, "formats": formats, "offsets": offsets, "itemsize": stride}
    return np.frombuffer(data, np.dtype(layout))


def _group(elements: list[Element]) -> tuple[str, tuple[int, ...]]:
    """Name and shape of the field that the elements begin with."""
    first = elements[0][0]
    for components, shape in ((TENSOR, (3, 3)), (VECTOR, (3,))):
        base, dot, component = first.rpartition(".")
        if dot and component == components[0]:
            found = [name for name, _, _ in elements[: len(components)]]
            if found == [f"{base}.{component}" for component in components]:
                return base, shape
    return first, ()


def _element(message: memoryview) -> Element:
    name, offset, kind = "", 0, 0
    for number, value in _fields(message):
        if number == NAME and isinstance(value, memoryview):
            name = bytes(value).decode()
        elif number == OFFSET and isinstance(value, int):
            offset = value
        elif number == TYPE and isinstance(value, int):
            kind = value
    if kind not in NUMBERS:
        raise LogError(f"element {name} of a point cloud is neither FLOAT32 nor FLOAT64")
    return name, offset, NUMBERS[kind]


def _fields(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Numbers and values of the fields of a protobuf message."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        wire_type = key & 7
        if wire_type == 0:
            value, at = _varint(message, at)
            yield key >> 3, value
            continue
        if wire_type == 2:
            length, at = _varint(message, at)
        elif wire_type in (1, 5):
            length = 8 if wire_type == 1 else 4
        else:
            raise LogError(f"a point cloud is not protobuf: wire type {wire_type}")
        if at + length > len(message):
            raise LogError("a point cloud is not protobuf: it is cut off")
        content = message[at : at + length]
        at += length
        yield key >> 3, content if wire_type == 2 else int.from_bytes(content, "little")


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """An integer of seven bits a byte, and where it ends."""
    value = shift = 0
    # 64 bits are ten bytes; a longer number has no end
    while at < len(message) and shift < 70:
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            return value, at
        shift += 7
    raise LogError("a point cloud is not protobuf: a number is cut off or has no end")
