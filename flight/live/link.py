"""Serve the vehicle's stations on one UDP socket.

A station gets more than heartbeats only after it has sent a valid HEARTBEAT or, on this machine, any message addressed
to the vehicle. The message must come from an allowed address, and be signed if a key is set. The table of stations is
bounded; a silent station is removed from it.
"""

import hashlib
import hmac
import ipaddress
import os
import re
import socket
import stat
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.generator.mavcrc import x25crc

from flight.live.mission_server import Station
from flight.live.telemetry import PERIODS
from world.errors import FlightError
from world.running_clock import RunningClock

# ----------------------------------------------------------------------
# MAVLink frames in datagrams of arbitrary bytes: find, check and decode them.

# First byte of a MAVLink 1 frame.
MAGIC_V1 = 0xFE
# First byte of a MAVLink 2 frame.
MAGIC_V2 = 0xFD
SIGNED_FLAG = 0x01
SIGNATURE_BYTES = 13
_CRC_FORMAT = struct.Struct("<H")
# Maximum number of bytes read from a datagram.
MAX_DATAGRAM_BYTES = 4096
MAX_FRAMES = 64


@dataclass(frozen=True, slots=True)
class MavlinkFrame:
    """One frame with a valid checksum.

    raw: bytes of the whole frame.
    number: MAVLink number of the message.
    system, component: MAVLink ids of the sender.
    signed: True if a signature is attached, valid or not.
    """

    raw: bytes
    number: int
    system: int
    component: int
    signed: bool


class Decoder:
    """Decoder of the frames of MAVLink's ardupilotmega dialect."""

    def __init__(self) -> None:
        self._mav = mavlink.MAVLink(None)

    def decode(self, frame: MavlinkFrame) -> Any | None:
        """Return the message of a frame, or None if pymavlink cannot decode the frame."""
        try:
            return self._mav.decode(bytearray(frame.raw))
        except (mavlink.MAVError, struct.error, ValueError, IndexError, TypeError, OverflowError):
            return None


def split_frames(data: bytes) -> list[MavlinkFrame]:
    """Return the complete MAVLink frames in a datagram, in order; damaged frames are skipped.

    At most `MAX_FRAMES` frames and `MAX_DATAGRAM_BYTES` bytes are read.
    """
    frames: list[MavlinkFrame] = []
    data = data[:MAX_DATAGRAM_BYTES]
    offset = 0
    while offset < len(data) and len(frames) < MAX_FRAMES:
        frame = _parse_frame(data, offset) if data[offset] in (MAGIC_V1, MAGIC_V2) else None
        if frame is None:
            offset += 1
        else:
            frames.append(frame)
            offset += len(frame.raw)
    return frames


def _parse_frame(data: bytes, offset: int) -> MavlinkFrame | None:
    """Return the frame that starts at an offset, or None if no complete and valid frame starts there.

    A frame is valid if its message is known, its checksum is right, and its only flag is the signature's.
    """
    is_v2 = data[offset] == MAGIC_V2
    header_size = 10 if is_v2 else 6
    if len(data) - offset < header_size + 2:
        return None
    flags = data[offset + 2] if is_v2 else 0
    # Any other flag changes the frame in an unknown way, and the standard says to drop such a frame.
    if flags & ~SIGNED_FLAG:
        return None
    end = offset + header_size + data[offset + 1] + 2
    frame_end = end + (SIGNATURE_BYTES if flags else 0)
    if frame_end > len(data):
        return None
    if is_v2:
        system, component = data[offset + 5], data[offset + 6]
        number = data[offset + 7] | data[offset + 8] << 8 | data[offset + 9] << 16
    else:
        system, component, number = data[offset + 3], data[offset + 4], data[offset + 5]
    message_class = mavlink.mavlink_map.get(number)
    if message_class is None:
        return None
    crc = x25crc(data[offset + 1 : end - 2])
    crc.accumulate(bytes([message_class.crc_extra]))
    if crc.crc != _CRC_FORMAT.unpack_from(data, end - 2)[0]:
        return None
    return MavlinkFrame(data[offset:frame_end], number, system, component, bool(flags))


# ----------------------------------------------------------------------
# MAVLink 2 message signing: verify a signature before anything in its packet is trusted or stored.
#
# (mavlink.io, "Message Signing".)  pymavlink stores a packet's timestamp before it checks the signature: a forged
# packet from the future then locks the real station out.

# Unix time of 2015-01-01, from which timestamps are measured, s.
SIGNING_EPOCH_S = 1_420_070_400.0
# Timestamp units per second: 10 us each.
_UNITS_PER_S = 100_000
# Maximum timestamp: six bytes.
_MAX_TIMESTAMP = 2**48 - 1
# Maximum lag of a new stream's timestamp: a minute.
_MAX_LAG_UNITS = 60 * _UNITS_PER_S
# Maximum lead of any stream's timestamp: a day.
_MAX_LEAD_UNITS = 86_400 * _UNITS_PER_S
# Number of streams that are stored.
_MAX_STREAMS = 64
# Maximum length of a key, bytes.
_MAX_KEY_BYTES = 1024


def read_key(path: Path) -> bytes:
    """Read a signing key of 32 bytes from a file.

    The file contains 64 hexadecimal digits, or a passphrase that is hashed with SHA-256. MAVProxy's "signing setup" and
    Mission Planner hash a passphrase in the same way. Raises FlightError if the file cannot be read, if another user
    could read it, or if it holds fewer than 8 or more than 1024 bytes.

    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile() as file:  # made for its owner alone
    ...     _ = file.write(b"correct horse battery")
    ...     file.flush()
    ...     key = read_key(Path(file.name))
    >>> key.hex()[:16], len(key)
    ('9028ea0d15decaa3', 32)
    """
    try:
        # Do not wait for a named pipe without a writer.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise FlightError(f"{path}: not a plain file; expected a signing key", file=path)
            own_user_id = getattr(os, "getuid", None)
            # Where users have no numbers, modes do not show who can read a file.
            if own_user_id is not None and (status.st_uid != own_user_id() or stat.S_IMODE(status.st_mode) & 0o077):
                mode = stat.S_IMODE(status.st_mode)
                allowed = "only its owner may read a signing key (chmod 600)"
                message = f"{path}: mode {mode:03o}: {allowed}"
                raise FlightError(message, file=path, field="mode", value=f"{mode:03o}", allowed=allowed)
            data = file.read(_MAX_KEY_BYTES + 1).strip()
    except OSError as error:
        raise FlightError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    if not 8 <= len(data) <= _MAX_KEY_BYTES:
        allowed = "a key of 64 hexadecimal digits or a passphrase of 8..1024"
        raise FlightError(f"{path}: {len(data)} bytes: {allowed}", file=path, value=len(data), allowed=allowed)
    if re.fullmatch(rb"[0-9a-fA-F]{64}", data):
        return bytes.fromhex(data.decode())
    return hashlib.sha256(data).digest()


class RefusalReason(Enum):
    """Reason to distrust a frame; `DropCounts` counts the frames by reason."""

    UNSIGNED = auto()
    FORGED = auto()
    REPLAYED = auto()
    OLD = auto()
    FUTURE = auto()
    STREAMS = auto()


@dataclass(slots=True)
class Signing:
    """Signer of outgoing frames and checker of incoming frames.

    key: 32 bytes.
    link: link id of this end.
    newest: maximum timestamp of all frames sent and all trusted frames.
    clock: maximum timestamp of this machine's clock, which does not decrease if the clock is set back.
    """

    key: bytes
    link: int = 0
    newest: int = 0
    clock: int = 0
    _streams: dict[tuple[int, int, int], int] = field(default_factory=dict)

    def find_refusal(self, frame: MavlinkFrame, wall: float) -> RefusalReason | None:
        """Return the reason to distrust a frame; None if it is signed with the key and newer than its stream.

        wall: time since 1970, s.

        The frames with the same system, component and link id form a stream. Its last timestamp is stored. A frame with
        a bad signature changes nothing.
        """
        if not frame.signed:
            return RefusalReason.UNSIGNED
        body, signature = frame.raw[:-6], frame.raw[-6:]
        if not hmac.compare_digest(hashlib.sha256(self.key + body).digest()[:6], signature):
            return RefusalReason.FORGED
        link = frame.raw[-SIGNATURE_BYTES]
        timestamp = int.from_bytes(frame.raw[-12:-6], "little")
        stream = (frame.system, frame.component, link)
        last_timestamp = self._streams.get(stream)
        # Compare with this machine's clock, not with trusted timestamps, so that a series of frames cannot move the
        # limit into the future.
        self.clock = max(self.clock, _signing_timestamp(wall))
        if timestamp > self.clock + _MAX_LEAD_UNITS:
            return RefusalReason.FUTURE
        if last_timestamp is None:
            # Compare with this machine's clock, not with timestamps of other stations, so that a station whose clock is
            # ahead does not lock out other stations.
            if timestamp + _MAX_LAG_UNITS < _signing_timestamp(wall):
                return RefusalReason.OLD
            if len(self._streams) >= _MAX_STREAMS:
                return RefusalReason.STREAMS
        elif timestamp <= last_timestamp:
            return RefusalReason.REPLAYED
        self._streams[stream] = timestamp
        # If the clock was set back before the start, running stations still expect later timestamps than before.
        self.newest = max(self.newest, timestamp)
        return None

    def sign(self, packed: bytes, wall: float) -> bytes:
        """Return a packed MAVLink 2 frame with a signature.

        packed: bytes of the frame without a signature.
        wall: time since 1970, s.

        After the year 2104 timestamps stay at the maximum of six bytes, so stations drop the frames as repeated.
        """
        self.clock = max(self.clock, _signing_timestamp(wall))
        self.newest = min(max(self.newest + 1, _signing_timestamp(wall)), _MAX_TIMESTAMP)
        number = packed[7] | packed[8] << 8 | packed[9] << 16
        body = bytearray(packed[:-2])
        body[2] |= SIGNED_FLAG
        crc = x25crc(bytes(body[1:]))
        crc.accumulate(bytes([mavlink.mavlink_map[number].crc_extra]))
        signed = bytes(body) + struct.pack("<H", crc.crc) + bytes([self.link]) + self.newest.to_bytes(6, "little")
        return signed + hashlib.sha256(self.key + signed).digest()[:6]


def _signing_timestamp(wall: float) -> int:
    """Return the timestamp of a time (s since 1970) in units of 10 us since 2015."""
    return min(max(0, int((wall - SIGNING_EPOCH_S) * _UNITS_PER_S)), _MAX_TIMESTAMP)


Address = tuple[str, int]

# MAVLink system id of the vehicle.
SYSTEM = 1
# MAVLink component id of the vehicle.
COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
# Maximum number of stations.
MAX_PEERS = 16
# Time without a heartbeat after which a station is removed, s.
PEER_TIMEOUT_S = 15.0
# Maximum number of unknown senders that notices name.
_MAX_NAMED_STRANGERS = 16
# Maximum number of datagrams handled before telemetry is sent again.
_MAX_DATAGRAMS_PER_POLL = 200


@dataclass(slots=True)
class Peer:
    """A station that the vehicle answers.

    periods: intervals between messages, s; None for a message that is off.
    due: next time of each message.
    last_heard_time: time at which the station was last heard, s of the link's clock.
    next_parameter: number of the next parameter to send, if the station requested all parameters; otherwise None.
    """

    address: Address
    system: int
    component: int
    last_heard_time: float
    mav: Any
    periods: dict[str, float | None] = field(default_factory=lambda: dict(PERIODS))
    due: dict[str, float] = field(default_factory=dict)
    next_parameter: float | None = None

    @property
    def station(self) -> Station:
        """Station of the mission protocol that sends from this address."""
        return Station(self.address, self.system, self.component)


@dataclass(slots=True)
class DropCounts:
    """Number of dropped frames by reason.

    address: datagrams from an address that is not allowed.
    unsigned, forged: frames without a signature, and with a signature that does not match the key.
    replayed: frames signed by the key, but no newer than an earlier frame of their stream.
    old: first frames of a stream that are older than a minute.
    future: frames signed by the key, but more than a day ahead of this machine's clock.
    streams: frames of a stream beyond the number of stored streams.
    stranger: frames from another machine that has sent no HEARTBEAT.
    others: frames to another system, or from the vehicle itself.
    """

    address: int = 0
    unsigned: int = 0
    forged: int = 0
    replayed: int = 0
    old: int = 0
    future: int = 0
    streams: int = 0
    stranger: int = 0
    others: int = 0


@dataclass(frozen=True, slots=True)
class Access:
    """Access to the vehicle: open on this machine; from other machines a key or addresses are required.

    bind: address at which the vehicle listens.
    to: addresses to which the vehicle sends heartbeats before a station has been heard.
    allowed: IP addresses from which messages are accepted; empty for all.
    key: key of 32 bytes with which messages are signed; None without signing.
    """

    bind: Address
    to: tuple[Address, ...]
    allowed: frozenset[str] = frozenset()
    key: bytes | None = None


def check_access(access: Access) -> None:
    """Raise FlightError if other machines have unprotected access to the vehicle, or cannot be reached.

    Loopback addresses need no protection. To listen at any other address, the vehicle needs a key or a list of allowed
    addresses. To send to any other address, it needs a key, or the address must be on that list; the vehicle must then
    not listen at a loopback address. The error names the argument at fault.

    >>> check_access(Access(("127.0.0.1", 14551), (("127.0.0.1", 14550),)))
    >>> check_access(Access(("0.0.0.0", 14551), ()))
    Traceback (most recent call last):
    world.errors.FlightError: bind 0.0.0.0:14551: other machines can reach this address; give `sign_key` or ...
    """
    for name, (host, port) in (("bind", access.bind), *(("to", address) for address in access.to)):
        if is_loopback(host) or access.key is not None:
            continue
        if name == "bind" and not access.allowed:
            allowed = "other machines can reach this address; give `sign_key` or `allow`, or bind to 127.0.0.1"
            raise FlightError.of_argument(name, f"{host}:{port}", allowed)
        if name == "to" and host not in access.allowed:
            allowed = f"is on another machine; give `sign_key`, or `allow` {host}"
            raise FlightError.of_argument(name, f"{host}:{port}", allowed)
    remote_addresses = [f"{host}:{port}" for host, port in access.to if not is_loopback(host)]
    if remote_addresses and is_loopback(access.bind[0]):
        allowed = (
            f"cannot reach {remote_addresses[0]} from there; bind to an address of this machine's network, or 0.0.0.0"
        )
        raise FlightError.of_argument("bind", f"{access.bind[0]}:{access.bind[1]}", allowed)


def is_loopback(host: str) -> bool:
    """Return True if an IP address is a loopback address, which only this machine can reach."""
    return ipaddress.ip_address(host).is_loopback


class Link:
    """UDP socket of the vehicle, and its stations (peers).

    clock: function that returns the time for the silence of peers and the times of messages, s, also for users of the
        link; the time never decreases, and stops while the process is stopped.
    wall: function that returns the time since 1970, s, for signatures.
    """

    def __init__(
        self, access: Access, clock: Callable[[], float] | None = None, wall: Callable[[], float] = time.time
    ) -> None:
        """Open the socket.

        Raises FlightError if the access is not protected, or if the socket cannot be bound.
        """
        check_access(access)
        self.access = access
        self.peers: dict[Address, Peer] = {}
        self.dropped = DropCounts()
        self.clock, self._wall = clock or RunningClock(), wall
        self._signing = Signing(access.key) if access.key is not None else None
        self._decoder = Decoder()
        # Addresses already named in a notice: unknown senders, and senders whose clock is ahead.
        self._named_strangers: set[str] = set()
        self._named_ahead: set[str] = set()
        self._notices: list[str] = []
        self._expected_stations = {address: mavlink.MAVLink(None, SYSTEM, COMPONENT) for address in access.to}
        family = socket.AF_INET6 if ":" in access.bind[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.bind(access.bind)
        except OSError as error:
            self._socket.close()
            host, port = access.bind
            raise FlightError.of_argument("bind", f"{host}:{port}", str(error.strerror)) from error
        self._socket.setblocking(False)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def fileno(self) -> int:
        """Return the socket's file descriptor, by which `multiprocessing.connection.wait` waits for the link."""
        return self._socket.fileno()

    @property
    def address(self) -> Address:
        """Address at which the vehicle listens."""
        host, port = self._socket.getsockname()[:2]
        return str(host), int(port)

    def receive(self) -> list[tuple[Any, Peer]]:
        """Return the messages received from stations, each with its sender; drop everything else."""
        messages: list[tuple[Any, Peer]] = []
        for _ in range(_MAX_DATAGRAMS_PER_POLL):
            try:
                data, source = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except OSError:
                # A station's port is closed: its ICMP answer is reported here.
                continue
            messages += self.decode_datagram(data, (str(source[0]), int(source[1])))
        return messages

    def decode_datagram(self, data: bytes, source: Address) -> list[tuple[Any, Peer]]:
        """Return the messages of one datagram; register the sender as a peer if it sent a HEARTBEAT."""
        if self.access.allowed and not is_loopback(source[0]) and source[0] not in self.access.allowed:
            self.dropped.address += 1
            return []
        messages = []
        for frame in split_frames(data):
            if frame.system == SYSTEM or frame.system == 0:
                self.dropped.others += 1
                continue
            if self._signing is not None and (reason := self._signing.find_refusal(frame, self._wall())):
                dropped = self.dropped
                dropped.unsigned += reason is RefusalReason.UNSIGNED
                dropped.forged += reason is RefusalReason.FORGED
                dropped.replayed += reason is RefusalReason.REPLAYED
                dropped.old += reason is RefusalReason.OLD
                dropped.future += reason is RefusalReason.FUTURE
                dropped.streams += reason is RefusalReason.STREAMS
                if reason is RefusalReason.FUTURE:
                    text = (
                        "signs with timestamps more than a day ahead of this machine's clock: such frames are dropped"
                    )
                    self._notice_once(source[0], self._named_ahead, text)
                continue
            message = self._decoder.decode(frame)
            if message is None:
                continue
            peer = self.peers.get(source)
            # A message from this machine is accepted even if its sender sends no heartbeats.
            if frame.number == mavlink.MAVLINK_MSG_ID_HEARTBEAT or (
                is_loopback(source[0])
                and getattr(message, "target_system", 0) == SYSTEM
                and self._is_for_vehicle(message)
            ):
                peer = self._register_peer(source, frame.system, frame.component)
            if peer is None:
                self.dropped.stranger += 1
                if self._is_for_vehicle(message):
                    full_text = "" if len(self.peers) < MAX_PEERS else f", and {MAX_PEERS} stations are served already"
                    text = f"sends {message.get_type()} and no HEARTBEAT{full_text}: it is not answered"
                    self._notice_once(source[0], self._named_strangers, text)
            elif not self._is_for_vehicle(message):
                self.dropped.others += 1
            else:
                peer.system, peer.component = frame.system, frame.component
                messages.append((message, peer))
        return messages

    def _notice_once(self, host: str, named_hosts: set[str], text: str) -> None:
        """Add a notice about an address, only once for each address.

        named_hosts: addresses with a notice, to which the address is added. No notice is added if there are already
            `_MAX_NAMED_STRANGERS` of them.
        """
        if host not in named_hosts and len(named_hosts) < _MAX_NAMED_STRANGERS:
            named_hosts.add(host)
            self._notices.append(f"{host} {text}")

    def pop_notices(self) -> list[str]:
        """Return and clear the notices about senders whose messages are ignored."""
        notices, self._notices = self._notices, []
        return notices

    def _register_peer(self, source: Address, system: int, component: int) -> Peer | None:
        """Return the station at an address, which may be new; None if the table of stations is full.

        source: address of the station.
        system, component: MAVLink ids of the station.
        """
        now = self.clock()
        self.peers = {key: peer for key, peer in self.peers.items() if now - peer.last_heard_time < PEER_TIMEOUT_S}
        peer = self.peers.get(source)
        if peer is None:
            if len(self.peers) >= MAX_PEERS:
                return None
            # Each station gets one sequence of frames: it would treat gaps between two sequences as lost packets.
            peer = Peer(
                source,
                system,
                component,
                now,
                self._expected_stations.get(source) or mavlink.MAVLink(None, SYSTEM, COMPONENT),
            )
            # Spread over the first tenth of a second, so that not everything is sent at once.
            peer.due = {name: now + 0.1 * index / len(PERIODS) for index, name in enumerate(PERIODS)}
            self.peers[source] = peer
        peer.last_heard_time = now
        return peer

    @staticmethod
    def _is_for_vehicle(message: Any) -> bool:
        """Return True if a message is addressed to the vehicle or to every vehicle."""
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, SYSTEM) and component in (0, COMPONENT)

    def remove_silent_peers(self) -> None:
        """Remove the peers that have been silent for `PEER_TIMEOUT_S`."""
        now = self.clock()
        for key in [key for key, peer in self.peers.items() if now - peer.last_heard_time >= PEER_TIMEOUT_S]:
            del self.peers[key]

    def send(self, message: Any, peer: Peer) -> None:
        """Send a message to a peer; it is lost if the network does not accept it, as on a radio."""
        self._send_frame(message.pack(peer.mav), peer.mav, peer.address)

    def send_heartbeat(self, message: Any) -> None:
        """Send a HEARTBEAT to the expected addresses of stations, and to every peer."""
        for address, mav in self._expected_stations.items():
            if address not in self.peers:
                self._send_frame(message.pack(mav), mav, address)
        for peer in self.peers.values():
            self.send(message, peer)

    def _send_frame(self, packed: bytes, mav: Any, address: Address) -> None:
        """Send a frame, signed if there is a key; ignore network errors."""
        mav.seq = (mav.seq + 1) % 256
        if self._signing is not None:
            packed = self._signing.sign(packed, self._wall())
        try:
            self._socket.sendto(packed, address)
        except OSError:
            # No socket listens there, or a buffer is full.
            return
