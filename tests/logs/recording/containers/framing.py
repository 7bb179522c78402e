"""The records of an MCAP file, taken apart by the format's own rule: opcode, length, content."""

import struct
from collections.abc import Iterator

MAGIC = b"\x89MCAP0\r\n"
FRAME = struct.Struct("<BQ")


def framed(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of each record between the magics."""
    at = len(MAGIC)
    while at < len(data) - len(MAGIC):
        opcode, length = FRAME.unpack_from(data, at)
        at += FRAME.size
        yield opcode, data[at : at + length]
        at += length
