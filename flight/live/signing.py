"""MAVLink 2 message signing: a signature is verified before anything about its packet is believed or kept.

(mavlink.io, "Message Signing".)  pymavlink keeps a packet's timestamp before it checks the signature: one forged packet
from the future then locks the real station out.
"""

import hashlib
import hmac
import os
import re
import stat
import struct
from dataclasses import dataclass, field
from enum import Enum, auto
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.generator.mavcrc import x25crc

from flight.live.mavlink_frames import SIGNATURE, SIGNED, MavlinkFrame
from world.errors import FlightError

# Timestamps count 10 us from 2015-01-01; a stream that is new may lag by a minute.
EPOCH = 1_420_070_400.0
_UNITS = 100_000
_MOST_LAG = 60 * _UNITS
_MOST_STREAMS = 64
_LARGEST_KEY = 1024


def read_key(path: Path) -> bytes:
    """Read a signing key of 32 bytes: 64 hexadecimal digits, or a passphrase that is hashed with SHA-256.

    The hash is what MAVProxy's "signing setup" and Mission Planner make of a passphrase.  Raises FlightError for a file
    that another user could read, that cannot be read, or that holds fewer than 8 or more than 1024 bytes.

    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile() as file:  # made for its owner alone
    ...     _ = file.write(b"correct horse battery")
    ...     file.flush()
    ...     key = read_key(Path(file.name))
    >>> key.hex()[:16], len(key)
    ('9028ea0d15decaa3', 32)
    """
    try:
        # A named pipe that nobody writes into is not waited for.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise FlightError(f"{path}: not a plain file: a signing key is expected", file=path)
            own = getattr(os, "getuid", None)
            # Where users have no numbers, modes do not say who reads a file.
            if own is not None and (status.st_uid != own() or stat.S_IMODE(status.st_mode) & 0o077):
                mode = stat.S_IMODE(status.st_mode)
                allowed = "a signing key is its owner's alone to read (chmod 600)"
                message = f"{path}: mode {mode:03o}: {allowed}"
                raise FlightError(message, file=path, field="mode", value=f"{mode:03o}", allowed=allowed)
            data = file.read(_LARGEST_KEY + 1).strip()
    except OSError as error:
        raise FlightError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    if not 8 <= len(data) <= _LARGEST_KEY:
        allowed = "a key of 64 hexadecimal digits or a passphrase of 8..1024"
        raise FlightError(f"{path}: {len(data)} bytes: {allowed}", file=path, value=len(data), allowed=allowed)
    if re.fullmatch(rb"[0-9a-fA-F]{64}", data):
        return bytes.fromhex(data.decode())
    return hashlib.sha256(data).digest()


class Refused(Enum):
    """Why a frame is not believed; see `flight.live.link.Dropped`."""

    UNSIGNED = auto()
    FORGED = auto()
    REPLAYED = auto()
    OLD = auto()
    STREAMS = auto()


@dataclass(slots=True)
class Signing:
    """Signs what goes out and checks what comes in.

    key: 32 bytes.  link: our link id.  newest: the largest timestamp sent or believed.
    """

    key: bytes
    link: int = 0
    newest: int = 0
    _streams: dict[tuple[int, int, int], int] = field(default_factory=dict)

    def refuses(self, frame: MavlinkFrame, wall: float) -> Refused | None:
        """Why a frame is not believed; None for one that is signed with our key and newer than all before it.

        A stream is a system, its component and its link id.  wall: s since 1970.  A frame with a bad signature leaves
        no trace.
        """
        if not frame.signed:
            return Refused.UNSIGNED
        body, tag = frame.raw[:-6], frame.raw[-6:]
        if not hmac.compare_digest(hashlib.sha256(self.key + body).digest()[:6], tag):
            return Refused.FORGED
        link = frame.raw[-SIGNATURE]
        stamp = int.from_bytes(frame.raw[-12:-6], "little")
        stream = (frame.system, frame.component, link)
        last = self._streams.get(stream)
        if last is None:
            # By our clock, not by others' timestamps: a station whose clock runs ahead locks nobody out.
            if stamp + _MOST_LAG < _stamp(wall):
                return Refused.OLD
            if len(self._streams) >= _MOST_STREAMS:
                return Refused.STREAMS
        elif stamp <= last:
            return Refused.REPLAYED
        self._streams[stream] = stamp
        # A clock that was set back before we started: stations that run on expect us to be later than we were.
        self.newest = max(self.newest, stamp)
        return None

    def sign(self, packed: bytes, wall: float) -> bytes:
        """Sign a packed MAVLink 2 frame that is not signed yet."""
        self.newest = max(self.newest + 1, _stamp(wall))
        number = packed[7] | packed[8] << 8 | packed[9] << 16
        body = bytearray(packed[:-2])
        body[2] |= SIGNED
        crc = x25crc(bytes(body[1:]))
        crc.accumulate(bytes([mavlink.mavlink_map[number].crc_extra]))
        signed = bytes(body) + struct.pack("<H", crc.crc) + bytes([self.link]) + self.newest.to_bytes(6, "little")
        return signed + hashlib.sha256(self.key + signed).digest()[:6]


def _stamp(wall: float) -> int:
    return max(0, int((wall - EPOCH) * _UNITS))
