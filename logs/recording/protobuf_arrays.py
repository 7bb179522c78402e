"""Many protobuf messages of doubles at once, as numpy structured arrays of their encoding.

Message objects of the protobuf library cost some microseconds each: ten thousand of them as much as minutes of flight.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Encoded = NDArray[np.void]

_FIXED64, _LENGTH_DELIMITED = 1, 2  # wire types


def tagged_doubles(names: Sequence[str]) -> list[tuple[str, str]]:
    """Give the numpy fields of doubles, each behind its one-byte tag ``tag_<name>``."""
    return [field for name in names for field in ((f"tag_{name}", "u1"), (name, "<f8"))]


def submessage(names: Sequence[str]) -> np.dtype[np.void]:
    """Make the type of a message of doubles as a field of another: its tag, its size, and the tagged doubles."""
    return np.dtype([("tag", "u1"), ("size", "u1"), *tagged_doubles(names)])


def fill_doubles(out: Encoded, names: Sequence[str], values: Floats) -> None:
    """Write the doubles (n, m) and their tags into ``out`` (n,); the names are those of the fields 1 to m."""
    for number, (name, column) in enumerate(zip(names, values.T, strict=True), 1):
        out[f"tag_{name}"], out[name] = number << 3 | _FIXED64, column


def fill_submessage(out: Encoded, number: int, names: Sequence[str], values: Floats) -> None:
    """Write messages of doubles into ``out``, (n,) of `submessage`, as the field ``number`` of others."""
    out["tag"], out["size"] = number << 3 | _LENGTH_DELIMITED, out.dtype.itemsize - 2
    fill_doubles(out, names, values)


def repeated_submessages(number: int, names: Sequence[str], values: Floats) -> bytes:
    """Encode rows (n, m) as a repeated field of messages of m doubles each."""
    out: Encoded = np.zeros(len(values), dtype=submessage(names))
    fill_submessage(out, number, names, values)
    return out.tobytes()


def length_delimited(number: int, data: bytes) -> bytes:
    """Encode a message's bytes as the field ``number`` of another."""
    size, head = len(data), bytearray([number << 3 | _LENGTH_DELIMITED])
    while size > 127:
        head.append(size & 127 | 128)
        size >>= 7
    head.append(size)
    return bytes(head) + data


def as_bytes(messages: NDArray[Any]) -> NDArray[np.uint8]:
    """View a structured array (n,) as (n, size) bytes."""
    return np.ascontiguousarray(messages).view(np.uint8).reshape(len(messages), messages.dtype.itemsize)
