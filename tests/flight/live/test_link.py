"""The link: what is let in, what is signed, what a stranger can do, and what is told to whom."""

import gc
import multiprocessing
import os
import random
import socket
import struct
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.flight_process import Fly, Judge, Ready, Stop, answer
from flight.live.link import MOST_PEERS, SILENCE, Access, Link
from flight.live.mavlink_frames import LARGEST, split_frames
from flight.live.parameters import vehicle_parameters
from flight.live.signing import EPOCH, Signing, read_key
from flight.live.snapshot import Moment
from flight.live.vehicle import Vehicle
from flight.mission.items import Home
from tests.stations import item, many_items
from world.errors import FlightError

SOAK = bool(os.environ.get("PLANFLY_SOAK"))
LOCAL = Access(("127.0.0.1", 0), (("127.0.0.1", 9),))
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
KEY = bytes(range(32))
WALL = EPOCH + 3e8


def packed(message: object, system: int = 255, seq: int = 0) -> bytes:
    mav = mavlink.MAVLink(None, system, 190)
    mav.seq = seq
    return message.pack(mav)


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def link():
    made = Link(LOCAL, Clock(), lambda: WALL)
    yield made
    made.close()


def test_nothing_is_believed_before_a_heartbeat(link: Link) -> None:
    ask = packed(mavlink.MAVLink_param_request_list_message(1, 1))
    assert link.take(ask, ("127.0.0.1", 5)) == []
    assert link.peers == {}
    assert len(link.take(packed(HEARTBEAT) + ask, ("127.0.0.1", 5))) == 2
    assert link.take(ask, ("127.0.0.1", 6)) == []
    other = packed(mavlink.MAVLink_param_request_list_message(7, 1))
    assert link.take(other, ("127.0.0.1", 5)) == []


def test_the_table_of_stations_is_bounded_and_forgets(link: Link) -> None:
    for port in range(1000):
        link.take(packed(HEARTBEAT), ("127.0.0.1", port))
    assert len(link.peers) == MOST_PEERS
    link._clock.now += SILENCE + 1.0
    link.take(packed(HEARTBEAT), ("127.0.0.1", 5000))
    assert list(link.peers) == [("127.0.0.1", 5000)]


def test_one_count_of_frames_a_station(link: Link) -> None:
    """A ground station takes a jump in it for lost packets."""
    ours = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ours.bind(("127.0.0.1", 0))
    ours.settimeout(1.0)
    access = Access(("127.0.0.1", 0), (ours.getsockname(),))
    made = Link(access)
    try:
        for _ in range(3):
            made.hello(HEARTBEAT)
        made.take(packed(HEARTBEAT), ours.getsockname())
        made.hello(HEARTBEAT)
        made.send(HEARTBEAT, made.peers[ours.getsockname()])
        assert [ours.recv(300)[4] for _ in range(5)] == [0, 1, 2, 3, 4]
    finally:
        made.close()
        ours.close()


@pytest.mark.parametrize("cut", range(1, 21))
def test_damaged_frames_are_skipped_to_the_next_whole_one(cut: int) -> None:
    frame = packed(HEARTBEAT)
    assert [one.raw for one in split_frames(frame[:-cut] + frame)] == [frame]
    turned = bytearray(frame)
    turned[cut % len(frame)] ^= 0x10
    assert split_frames(bytes(turned)) == [] or cut % len(frame) == 0


def test_both_versions_are_read() -> None:
    mav = mavlink.MAVLink(None, 255, 190)
    old = HEARTBEAT.pack(mav, force_mavlink1=True)
    assert old[0] == 0xFE
    assert [one.number for one in split_frames(old + packed(HEARTBEAT))] == [0, 0]
    assert split_frames(bytes([0xFD]) * LARGEST) == []


def test_signed_frames_are_pymavlinks() -> None:
    """An independent implementation accepts ours, and ours accepts its."""
    ours, theirs = Signing(KEY, 3), mavlink.MAVLink(None, 255, 190)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.link_id, theirs.signing.timestamp = 1, int((WALL - EPOCH) * 1e5)
    receiver = mavlink.MAVLink(None)
    receiver.signing.secret_key, receiver.signing.timestamp = KEY, int((WALL - EPOCH) * 1e5)
    message = receiver.decode(bytearray(ours.sign(packed(HEARTBEAT, 1), WALL)))
    assert message.get_type() == "HEARTBEAT"
    assert message.get_signed()
    (frame,) = split_frames(HEARTBEAT.pack(theirs))
    assert ours.accepts(frame, WALL)
    assert not ours.accepts(frame, WALL), "a replayed frame"
    assert not ours.accepts(split_frames(packed(HEARTBEAT))[0], WALL), "an unsigned frame"


def test_a_forged_timestamp_locks_nobody_out() -> None:
    vehicle, station, thief = Signing(KEY), Signing(KEY), Signing(bytes(32))
    future = WALL + 1e8
    for link_id in range(256):
        thief.link = link_id
        (forged,) = split_frames(thief.sign(packed(HEARTBEAT), future))
        assert not vehicle.accepts(forged, WALL)
    (good,) = split_frames(station.sign(packed(HEARTBEAT), WALL))
    flipped = bytearray(good.raw)
    flipped[-7] ^= 0x40  # a later time under a signature that was good
    assert not vehicle.accepts(split_frames(bytes(flipped))[0], WALL)
    assert vehicle.accepts(good, WALL)
    (old,) = split_frames(Signing(KEY, 9).sign(packed(HEARTBEAT), WALL - 120.0))
    assert not vehicle.accepts(old, WALL), "a recording from two minutes ago, on a new link"


def test_a_key_lets_only_its_owner_in() -> None:
    made = Link(Access(("127.0.0.1", 0), (("127.0.0.1", 9),), key=KEY), Clock(), lambda: WALL)
    try:
        assert made.take(packed(HEARTBEAT), ("127.0.0.1", 5)) == []
        assert made.peers == {}
        assert len(made.take(Signing(KEY).sign(packed(HEARTBEAT), WALL), ("127.0.0.1", 5))) == 1
    finally:
        made.close()


def test_key_files(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text(KEY.hex() + "\n", encoding="ascii")
    path.chmod(0o644)
    with pytest.raises(FlightError, match="644"):
        read_key(path)
    path.chmod(0o600)
    assert read_key(path) == KEY
    path.write_text("correct horse battery", encoding="ascii")
    assert len(read_key(path)) == 32
    path.write_text("short", encoding="ascii")
    with pytest.raises(FlightError, match="5 bytes"):
        read_key(path)
    with pytest.raises(FlightError, match="cannot be read"):
        read_key(tmp_path / "none")


@pytest.mark.parametrize(
    ("access", "word"),
    [
        (Access(("0.0.0.0", 0), ()), "--bind 0.0.0.0"),
        (Access(("127.0.0.1", 0), (("192.0.2.1", 14550),)), "--to 192.0.2.1"),
        (Access(("0.0.0.0", 0), (("192.0.2.1", 14550),), frozenset({"192.0.2.2"})), "--allow 192.0.2.1"),
        (Access(("127.0.0.1", 0), (("192.0.2.1", 14550),), frozenset({"192.0.2.1"})), "--bind 127.0.0.1"),
        (Access(("127.0.0.1", 0), (("192.0.2.1", 14550),), key=KEY), "--bind 127.0.0.1"),
    ],
)
def test_beyond_this_machine_only_with_protection(access: Access, word: str) -> None:
    with pytest.raises(FlightError, match=word):
        Link(access)


def test_the_allow_list() -> None:
    made = Link(Access(("127.0.0.1", 0), (), frozenset({"192.0.2.7"})))
    try:
        assert made.take(packed(HEARTBEAT), ("192.0.2.8", 5)) == []
        assert len(made.take(packed(HEARTBEAT), ("192.0.2.7", 5))) == 1
    finally:
        made.close()


class Fake:
    """A vehicle whose datagrams and flying process are the test's."""

    def __init__(self) -> None:
        self.link = Link(LOCAL)
        ours, self.flight = multiprocessing.Pipe()
        home = Home(46.0, 8.0, 400.0)
        moment = Moment(0.0, 46.0, 8.0, 500.0, 100.0, *[0.0] * 15, -1.0)
        parameters = vehicle_parameters(
            airspeed=25.0, slowest=18.0, fastest=30.0, max_bank_deg=30.0, system=1, speed=1.0
        )
        self.told: list[str] = []
        self.flyable = True
        self.vehicle = Vehicle(self.link, lambda: ours, parameters, (moment, home), 200.0, self.tell)
        self.orders: list[object] = []

    def tell(self, text: str) -> None:
        self.told = [*self.told[-99:], text]

    def send(self, *messages: object, port: int = 5, system: int = 255) -> None:
        self.feed([packed(message, system) for message in messages], port)

    def feed(self, datagrams: list[bytes], port: int = 5) -> None:
        found = [one for data in datagrams for one in self.link.take(data, ("127.0.0.1", port))]
        self.link.receive = lambda: found  # the one place where bytes come in
        for message, peer in found:
            self.vehicle._from_station(message, peer, self.vehicle._clock())
        del self.link.receive
        self.turn()

    def turn(self) -> None:
        """Answer the vehicle's orders as a flying process would, and give it its turn."""
        while self.flight.poll():
            order = self.flight.recv()
            self.orders = [*self.orders[-99:], order]
            if isinstance(order, Judge):
                moment = self.vehicle.status.moment
                home = order.mission.home
                answer(self.flight, Ready(order.number, True, self.flyable, (), home, (1, 2), moment))
        self.vehicle.step(0.0)

    def upload(self, items: list[object], port: int = 5) -> None:
        self.send(HEARTBEAT, mavlink.MAVLink_mission_count_message(1, 1, len(items), 0), *items, port=port)
        self.turn()

    def close(self) -> None:
        self.link.close()
        self.flight.close()


@pytest.fixture
def fake():
    made = Fake()
    yield made
    made.close()


def command(number: int, *values: float) -> object:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *values, *[0.0] * (7 - len(values)))


def test_armed_and_auto_start_the_flight(fake: Fake) -> None:
    fake.upload(many_items(3))
    assert isinstance(fake.orders[0], Judge)
    fake.send(command(400, 1.0), command(176, 1.0, 10.0))
    assert isinstance(fake.orders[-1], Fly)
    assert fake.vehicle.status.flying
    fake.send(command(400, 0.0))
    assert fake.vehicle.status.armed
    fake.send(command(400, 0.0, 21196.0))
    assert isinstance(fake.orders[-1], Stop)


def test_what_is_not_flyable_is_not_armed_unless_forced(fake: Fake) -> None:
    fake.flyable = False
    fake.upload(many_items(3))
    fake.send(command(400, 1.0))
    assert not fake.vehicle.status.armed
    assert "PFLY_FORCE" in fake.told[-1]
    fake.send(mavlink.MAVLink_param_set_message(1, 1, b"PFLY_FORCE", 1.0, 9), command(400, 1.0))
    assert fake.vehicle.status.armed


def test_a_mission_taken_back_while_it_is_judged_is_not_flown(fake: Fake) -> None:
    fake.send(HEARTBEAT, mavlink.MAVLink_mission_count_message(1, 1, 3, 0), *many_items(3)[:2])
    fake.link.take(b"", ("127.0.0.1", 5))
    for message in (many_items(3)[2], command(400, 1.0), mavlink.MAVLink_mission_clear_all_message(1, 1, 0)):
        ((found, peer),) = fake.link.take(packed(message), ("127.0.0.1", 5))
        fake.vehicle._from_station(found, peer, 0.0)
    fake.turn()
    fake.turn()
    fake.send(command(176, 1.0, 10.0))
    assert not fake.vehicle.status.flying
    assert not any(isinstance(order, Fly) for order in fake.orders)


def test_rates_that_a_station_asks_for_are_its_own(fake: Fake) -> None:
    fake.send(HEARTBEAT)
    fake.send(HEARTBEAT, port=6)
    fake.send(command(511, 30.0, 1e5), mavlink.MAVLink_request_data_stream_message(1, 1, 11, 2, 1))
    one, two = (fake.link.peers[("127.0.0.1", port)].periods for port in (5, 6))
    assert (one["ATTITUDE"], one["VFR_HUD"]) == (0.1, 0.5)
    assert (two["ATTITUDE"], two["VFR_HUD"]) == (1 / 30, 0.1)
    fake.send(command(511, 30.0, -1.0), command(511, 32.0, float("nan")), command(511, 74.0, 1.0))
    assert (one["ATTITUDE"], one["VFR_HUD"]) == (None, 0.02)


def fuzzed(count: int, seed: int) -> list[bytes]:
    """Datagrams: noise, damaged frames, and sound frames of every message with any content."""
    rng = random.Random(seed)
    kinds = sorted(mavlink.mavlink_map)
    likely = [0, 11, 20, 21, 23, 39, 40, 41, 43, 44, 45, 47, 51, 66, 73, 75, 76, 4, 111]
    found = []
    for _ in range(count):
        kind = mavlink.mavlink_map[rng.choice(likely if rng.random() < 0.6 else kinds)]
        payload = bytearray(rng.randbytes(kind.unpacker.size))
        # Addressed to the vehicle more often than chance would have it.
        names, order = kind.fieldnames, kind.ordered_fieldnames
        if rng.random() < 0.9 and "target_system" in names:
            payload[_offset(kind, order.index("target_system"))] = rng.choice([0, 1])
        if rng.random() < 0.9 and "target_component" in names:
            payload[_offset(kind, order.index("target_component"))] = rng.choice([0, 1])
        if "command" in names and kind.id in (75, 76) and rng.random() < 0.7:
            at = _offset(kind, order.index("command"))
            payload[at : at + 2] = rng.choice([400, 176, 300, 511, 512, 510, 193, 224, 410]).to_bytes(2, "little")
        if "seq" in names and rng.random() < 0.5:
            at = _offset(kind, order.index("seq"))
            payload[at : at + 2] = rng.choice([0, 1, 2]).to_bytes(2, "little")
        if "count" in names and kind.id == 44 and rng.random() < 0.7:
            at = _offset(kind, order.index("count"))
            payload[at : at + 2] = rng.choice([0, 1, 2, 3]).to_bytes(2, "little")
        if "mission_type" in names and rng.random() < 0.8:
            payload[_offset(kind, order.index("mission_type"))] = rng.choice([0, 1, 2, 255])
        data = bytes(payload).rstrip(b"\0") or b"\0"
        head = bytes([0xFD, len(data), 0, 0, rng.randrange(256), rng.choice([255, 255, 255, 254, 1]), 190])
        body = head + kind.id.to_bytes(3, "little") + data
        crc = mavlink.x25crc(body[1:])
        crc.accumulate(bytes([kind.crc_extra]))
        frame = body + crc.crc.to_bytes(2, "little")
        if kind.id == 73 and rng.random() < 0.7:
            frame = packed(item(rng.choice([0, 1, 2]), rng.randrange(2**29), 80_000_000, 100.0))
        chance = rng.random()
        if chance < 0.1:
            frame = rng.randbytes(rng.randrange(300))
        elif chance < 0.2:
            damaged = bytearray(frame)
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
            frame = bytes(damaged[: rng.randrange(len(damaged) + 1)])
        found.append(frame)
    return found


def _offset(kind: object, index: int) -> int:
    """Bytes before a field on the wire."""
    codes = list(kind.native_format.decode().lstrip("<"))
    sizes = [
        struct.calcsize("<" + code) * max(1, length) for code, length in zip(codes, kind.array_lengths, strict=True)
    ]
    return sum(sizes[:index])


def resident() -> int:
    """Memory of this process, bytes."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_any_datagram_is_survived(fake: Fake) -> None:
    """30,000 datagrams, a million in the soak: alive, no more memory, and a real upload works afterwards."""
    count, batch = (1_000_000 if SOAK else 30_000), 1000
    before = judged = 0
    for k in range(count // batch):
        for port in (5, 6):
            fake.send(HEARTBEAT, port=port)
        data = fuzzed(batch, k)
        fake.feed(data[::2], 5)
        fake.feed(data[1::2], 6)
        judged += any(isinstance(order, Judge) for order in fake.orders)
        if k == min(9, count // batch // 3):
            gc.collect()
            before = resident()
    gc.collect()
    assert resident() - before <= 10 * 2**20
    assert judged > 0, "the fuzz is to reach the missions"
    # Whatever it left behind: the flight is over, and both stations silent for a while.
    fake.vehicle.pilot.ended(False)
    fake.link.peers.clear()
    fake.vehicle.server.tick(fake.vehicle._clock() + 100.0)
    fake.orders.clear()
    items = many_items(50)
    fake.upload(items, port=7)
    fake.turn()
    lists = fake.vehicle.server.lists
    assert [(one.x, one.y) for one in next(iter(lists.values()))] == [(one.x, one.y) for one in items]
    assert any(isinstance(order, Judge) for order in fake.orders)
