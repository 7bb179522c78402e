"""The messages of a telemetry log (`.tlog`): each a time of eight bytes, and a MAVLink packet as it was received.

MAVLink 1 packets begin with 0xFE, those of MAVLink 2 with 0xFD (mavlink.io, "Packet Serialization"); pymavlink decodes
them and checks their checksums.  The time is in microseconds since 1970, big-endian (QGroundControl, MAVProxy).
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from flight.simulation.field_source import Damage
from logs.field_logs.readers.mapped_file import PIECE

_STAMP = struct.Struct(">Q")
_V1, _V2 = 0xFE, 0xFD
# Bytes beside the payload, the checksum included; those of a signature.
_V1_FRAME, _V2_FRAME, _SIGNATURE = 8, 12, 13
_SIGNED = 0x01
# Times that a telemetry log may hold: from 2000 to 2100, us since 1970.
_FIRST, _LAST = 946_684_800_000_000, 4_102_444_800_000_000


@dataclass
class TelemetryReader:
    """Decodes the wanted messages of a log and counts what could not be read.

    wanted: their numbers.
    let_go: called now and then, to give back the memory of what was read.
    """

    data: memoryview
    wanted: frozenset[int]
    let_go: Callable[[], None] = lambda: None
    places: int = 0
    size: int = 0
    cut: bool = False
    unreadable: int = 0
    _decoder: Any = field(default_factory=lambda: dialect.MAVLink(None))

    def messages(self) -> Iterator[tuple[float, Any]]:
        """Time received (s since 1970) and message, in the order of the file."""
        at, end, reading, piece = 0, len(self.data), True, PIECE
        while at + _STAMP.size + _V1_FRAME <= end:
            if at >= piece:
                self.let_go()
                piece = at + PIECE
            length = self._length(at)
            if length == 0:
                self.places += reading
                self.size += 1
                at += 1
                reading = False
                continue
            if at + length > end:
                self.cut = True
                break
            reading = True
            if self._number(at) in self.wanted:
                stamp = _STAMP.unpack_from(self.data, at)[0] * 1e-6
                message = self._decode(bytes(self.data[at + _STAMP.size : at + length]))
                if message is None:
                    self.unreadable += 1
                else:
                    yield stamp, message
            at += length

    def damage(self) -> Damage:
        """What could not be read."""
        return Damage(self.places, self.size, self.cut, self.unreadable)

    def _length(self, at: int) -> int:
        """Bytes of the record at a place, its time included; 0 where none begins there."""
        stamp = _STAMP.unpack_from(self.data, at)[0]
        if not _FIRST <= stamp <= _LAST:
            return 0
        packet = at + _STAMP.size
        magic, payload = self.data[packet], self.data[packet + 1]
        if magic == _V1:
            return _STAMP.size + _V1_FRAME + payload
        if magic == _V2:
            signature = _SIGNATURE if self.data[packet + 2] & _SIGNED else 0
            return _STAMP.size + _V2_FRAME + payload + signature
        return 0

    def _number(self, at: int) -> int:
        packet = at + _STAMP.size
        if self.data[packet] == _V1:
            return self.data[packet + 5]
        return self.data[packet + 7] | self.data[packet + 8] << 8 | self.data[packet + 9] << 16

    def _decode(self, packet: bytes) -> Any:
        try:
            return self._decoder.decode(bytearray(packet))
        except Exception:  # of whatever kind: the library raises struct's, its own and plain ones
            return None


def looks_like_telemetry(head: bytes) -> bool:
    """Whether a file's first bytes are a time and a packet's beginning.

    >>> looks_like_telemetry(_STAMP.pack(1_700_000_000_000_000) + bytes([0xFD, 9]))
    True
    """
    if len(head) < _STAMP.size + 2:
        return False
    return _FIRST <= _STAMP.unpack_from(head)[0] <= _LAST and head[_STAMP.size] in (_V1, _V2)
