"""The vehicle's link: one UDP socket, and the stations that it talks to.

A station gets more than heartbeats only after it has sent a valid HEARTBEAT, or on this machine whatever is addressed
to the vehicle, from an address that is allowed, and signed where a key is set.  The table of stations is bounded; one
that falls silent leaves it.
"""

import ipaddress
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.mavlink_frames import LARGEST, Decoder, split_frames
from flight.live.mission_server import Station
from flight.live.running_clock import RunningClock
from flight.live.signing import Refused, Signing
from flight.live.telemetry import PERIODS
from world.errors import FlightError

Address = tuple[str, int]

SYSTEM, COMPONENT = 1, mavlink.MAV_COMP_ID_AUTOPILOT1
MOST_PEERS = 16
# A station that has sent no heartbeat for so long is gone, s.
SILENCE = 15.0
# Strangers that the log names.
_MOST_NAMED = 16
# Datagrams handled before telemetry has its turn again.
_MOST_AT_ONCE = 200


@dataclass(slots=True)
class Peer:
    """A station that has made itself known.

    periods: s between messages, None for none at all.  due: when each is to be sent next.  parameter: the next one to
    send of all that it asked for.
    """

    address: Address
    system: int
    component: int
    heard: float
    mav: Any
    periods: dict[str, float | None] = field(default_factory=lambda: dict(PERIODS))
    due: dict[str, float] = field(default_factory=dict)
    parameter: float | None = None

    @property
    def station(self) -> Station:
        """The station for the mission protocol."""
        return Station(self.address, self.system, self.component)


@dataclass(slots=True)
class Dropped:
    """Frames that were not taken, by the reason.

    address: from an address that is not allowed, datagrams.  unsigned, forged: without a signature, and with one that
    the key did not make.  replayed: signed by the key, and no newer than one before it in its stream.  old: the first
    of a stream, and from more than a minute ago.  streams: of more streams than are kept.  stranger: from another
    machine, and nobody that has sent a HEARTBEAT.  others: to another system, or from ours.
    """

    address: int = 0
    unsigned: int = 0
    forged: int = 0
    replayed: int = 0
    old: int = 0
    streams: int = 0
    stranger: int = 0
    others: int = 0


@dataclass(frozen=True, slots=True)
class Access:
    """Who may talk to the vehicle: anyone on this machine; beyond it a key, or addresses, must be given."""

    bind: Address
    to: tuple[Address, ...]
    allowed: frozenset[str] = frozenset()
    key: bytes | None = None


def check_access(access: Access) -> None:
    """Check that whoever can reach the vehicle from another machine is protected against.

    Beyond loopback, an address to listen at needs a key or a list of allowed addresses, and one to send to needs a key
    or must be on that list.  Raises FlightError, which names the option to give.

    >>> check_access(Access(("127.0.0.1", 14551), (("127.0.0.1", 14550),)))
    >>> check_access(Access(("0.0.0.0", 14551), ()))
    Traceback (most recent call last):
    world.errors.FlightError: --bind 0.0.0.0:14551: beyond this machine: give --sign-key FILE or --allow IP,IP, ...
    """
    for name, (host, port) in (("--bind", access.bind), *(("--to", address) for address in access.to)):
        if is_loopback(host) or access.key is not None:
            continue
        if name == "--bind" and not access.allowed:
            allowed = "beyond this machine: give --sign-key FILE or --allow IP,IP, or bind to 127.0.0.1"
            raise FlightError.of_option(name, f"{host}:{port}", allowed)
        if name == "--to" and host not in access.allowed:
            allowed = f"beyond this machine: give --sign-key FILE or --allow {host}"
            raise FlightError.of_option(name, f"{host}:{port}", allowed)
    far = [f"{host}:{port}" for host, port in access.to if not is_loopback(host)]
    if far and is_loopback(access.bind[0]):
        allowed = f"cannot reach {far[0]} from there; bind to an address of this machine's network, or 0.0.0.0"
        raise FlightError.of_option("--bind", f"{access.bind[0]}:{access.bind[1]}", allowed)


def is_loopback(host: str) -> bool:
    """Whether an IP address is this machine's own."""
    return ipaddress.ip_address(host).is_loopback


class Link:
    """The socket and its peers.

    clock: by which peers fall silent and messages are due, also for whoever uses the link; it never goes back, and
    stands still while the process does.  wall: s since 1970, of signatures.
    """

    def __init__(
        self, access: Access, clock: Callable[[], float] | None = None, wall: Callable[[], float] = time.time
    ) -> None:
        """Open the socket.  Raises FlightError where that is not possible."""
        check_access(access)
        self.access = access
        self.peers: dict[Address, Peer] = {}
        self.dropped = Dropped()
        self.clock, self._wall = clock or RunningClock(), wall
        self._signing = Signing(access.key) if access.key is not None else None
        self._decoder = Decoder()
        self._strangers: set[str] = set()
        self._notices: list[str] = []
        self._hello = {address: mavlink.MAVLink(None, SYSTEM, COMPONENT) for address in access.to}
        family = socket.AF_INET6 if ":" in access.bind[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.bind(access.bind)
        except OSError as error:
            self._socket.close()
            host, port = access.bind
            message = f"--bind {host}:{port}: {error.strerror}"
            raise FlightError(message, field="--bind", value=f"{host}:{port}") from error
        self._socket.setblocking(False)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def fileno(self) -> int:
        """For `multiprocessing.connection.wait`, which waits for sockets and pipes on any system."""
        return self._socket.fileno()

    @property
    def address(self) -> Address:
        """Where the vehicle listens."""
        host, port = self._socket.getsockname()[:2]
        return str(host), int(port)

    def receive(self) -> list[tuple[Any, Peer]]:
        """Messages that have come from stations, each with its sender; everything else has vanished."""
        found: list[tuple[Any, Peer]] = []
        for _ in range(_MOST_AT_ONCE):
            try:
                data, source = self._socket.recvfrom(LARGEST)
            except BlockingIOError:
                break
            except OSError:
                # A station's port is closed: its ICMP answer comes up here.
                continue
            found += self.take(data, (str(source[0]), int(source[1])))
        return found

    def take(self, data: bytes, source: Address) -> list[tuple[Any, Peer]]:
        """Messages of one datagram; makes the sender a peer if there is a HEARTBEAT among them."""
        if self.access.allowed and not is_loopback(source[0]) and source[0] not in self.access.allowed:
            self.dropped.address += 1
            return []
        found = []
        for frame in split_frames(data):
            if frame.system == SYSTEM or frame.system == 0:
                self.dropped.others += 1
                continue
            if self._signing is not None and (reason := self._signing.refuses(frame, self._wall())):
                self._count(reason)
                continue
            message = self._decoder.message(frame)
            if message is None:
                continue
            peer = self.peers.get(source)
            if frame.number == mavlink.MAVLINK_MSG_ID_HEARTBEAT or self._is_asked_here(message, source):
                peer = self._heard(source, frame.system, frame.component)
            if peer is None:
                self.dropped.stranger += 1
                self._name_stranger(message, source[0])
            elif not self._for_us(message):
                self.dropped.others += 1
            else:
                peer.system, peer.component = frame.system, frame.component
                found.append((message, peer))
        return found

    def _is_asked_here(self, message: Any, source: Address) -> bool:
        """Whether somebody on this machine, who need not send heartbeats, addresses the vehicle."""
        return is_loopback(source[0]) and getattr(message, "target_system", 0) == SYSTEM and self._for_us(message)

    def _name_stranger(self, message: Any, host: str) -> None:
        """Have it said once that an address is not answered, and why."""
        if host in self._strangers or len(self._strangers) >= _MOST_NAMED or not self._for_us(message):
            return
        self._strangers.add(host)
        full = "" if len(self.peers) < MOST_PEERS else f", and {MOST_PEERS} stations are served already"
        self._notices.append(f"{host} sends {message.get_type()} and no HEARTBEAT{full}: it is not answered")

    def notices(self) -> list[str]:
        """What is to be said, since the last call, of who is not answered."""
        found, self._notices = self._notices, []
        return found

    def _count(self, reason: Refused) -> None:
        dropped = self.dropped
        dropped.unsigned += reason is Refused.UNSIGNED
        dropped.forged += reason is Refused.FORGED
        dropped.replayed += reason is Refused.REPLAYED
        dropped.old += reason is Refused.OLD
        dropped.streams += reason is Refused.STREAMS

    def _heard(self, source: Address, system: int, component: int) -> Peer | None:
        now = self.clock()
        self.peers = {key: peer for key, peer in self.peers.items() if now - peer.heard < SILENCE}
        peer = self.peers.get(source)
        if peer is None:
            if len(self.peers) >= MOST_PEERS:
                return None
            # One count of frames a station: a second one reads as lost packets there.
            peer = Peer(source, system, component, now, self._counter(source))
            # Spread over the first tenth of a second, so that not all is sent at once.
            peer.due = {name: now + 0.1 * k / len(PERIODS) for k, name in enumerate(PERIODS)}
            self.peers[source] = peer
        peer.heard = now
        return peer

    def _counter(self, address: Address) -> Any:
        return self._hello.get(address) or mavlink.MAVLink(None, SYSTEM, COMPONENT)

    @staticmethod
    def _for_us(message: Any) -> bool:
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, SYSTEM) and component in (0, COMPONENT)

    def forget_silent(self) -> None:
        """Drop the peers that have been silent for `SILENCE`."""
        now = self.clock()
        for key in [key for key, peer in self.peers.items() if now - peer.heard >= SILENCE]:
            del self.peers[key]

    def send(self, message: Any, peer: Peer) -> None:
        """Send a message to a peer.  What the network does not take is lost, as on any radio."""
        self._transmit(message.pack(peer.mav), peer.mav, peer.address)

    def send_heartbeat(self, message: Any) -> None:
        """Send a HEARTBEAT to where stations are expected, and to every peer."""
        for address, mav in self._hello.items():
            if address not in self.peers:
                self._transmit(message.pack(mav), mav, address)
        for peer in self.peers.values():
            self.send(message, peer)

    def _transmit(self, packed: bytes, mav: Any, address: Address) -> None:
        mav.seq = (mav.seq + 1) % 256
        if self._signing is not None:
            packed = self._signing.sign(packed, self._wall())
        try:
            self._socket.sendto(packed, address)
        except OSError:
            # Nobody listens there, or a buffer is full.
            return
