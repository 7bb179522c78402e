"""MAVLink frames in datagrams: found, checked and decoded, whatever the bytes are."""

import struct
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.generator.mavcrc import x25crc

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
SIGNED = 0x01
SIGNATURE = 13
_CRC = struct.Struct("<H")
# Largest datagram that is looked at, and most frames in it.
LARGEST = 4096
MOST_FRAMES = 64


@dataclass(frozen=True, slots=True)
class MavlinkFrame:
    """One frame with a good checksum.  raw: all of it.  signed: whether a signature is attached, good or not."""

    raw: bytes
    number: int
    system: int
    component: int
    signed: bool


class Decoder:
    """Decodes frames of the dialect.  Bytes that are no frame, or a damaged one, give nothing."""

    def __init__(self) -> None:
        self._mav = mavlink.MAVLink(None)

    def message(self, frame: MavlinkFrame) -> Any | None:
        """Message of a frame, None where it cannot be read."""
        try:
            return self._mav.decode(bytearray(frame.raw))
        except (mavlink.MAVError, struct.error, ValueError, IndexError, TypeError, OverflowError):
            return None


def split_frames(data: bytes) -> list[MavlinkFrame]:
    """Whole frames in a datagram, in order; a damaged one is skipped to the next that is whole."""
    found: list[MavlinkFrame] = []
    data = data[:LARGEST]
    at = 0
    while at < len(data) and len(found) < MOST_FRAMES:
        frame = _frame_at(data, at) if data[at] in (MAGIC_V1, MAGIC_V2) else None
        if frame is None:
            at += 1
        else:
            found.append(frame)
            at += len(frame.raw)
    return found


def _frame_at(data: bytes, at: int) -> MavlinkFrame | None:
    """Frame that starts at an offset, None where none does."""
    modern = data[at] == MAGIC_V2
    head = 10 if modern else 6
    if len(data) - at < head + 2:
        return None
    flags = data[at + 2] if modern else 0
    # Any flag but "signed" changes the frame in a way that is not known here, and the standard says to drop it.
    if flags & ~SIGNED:
        return None
    end = at + head + data[at + 1] + 2
    size = end + (SIGNATURE if flags else 0)
    if size > len(data):
        return None
    if modern:
        system, component = data[at + 5], data[at + 6]
        number = data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16
    else:
        system, component, number = data[at + 3], data[at + 4], data[at + 5]
    kind = mavlink.mavlink_map.get(number)
    if kind is None:
        return None
    crc = x25crc(data[at + 1 : end - 2])
    crc.accumulate(bytes([kind.crc_extra]))
    if crc.crc != _CRC.unpack_from(data, end - 2)[0]:
        return None
    return MavlinkFrame(data[at:size], number, system, component, bool(flags))
