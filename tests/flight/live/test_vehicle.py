"""The numbers that stations have for what is flown: as they sent the items, with or without a home among them."""

import gc
import itertools
import os
import socket
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.flight_process import EndFlight, JudgeMission, StartFlight
from flight.live.link import Peer
from flight.live.station_requests import PARAMETERS_PER_SECOND, Parameter, Parameters
from flight.live.telemetry import ACTIVE, WARNING, Snapshot, Status
from flight.live.vehicle import Downlink
from flight.mission.items import Command, Frame, Home, MissionItem
from tests.flight.live.fake_vehicle import HEARTBEAT, Clock, FakeVehicle, command, packed
from tests.flight.live.fuzzed_datagrams import fuzzed
from tests.soak import note, scaled
from tests.stations import item, many_items

PLACES = [item(k, 460_000_000, 80_000_000 + 50_000 * k, 100.0) for k in range(4)]


def reached(fake: FakeVehicle) -> list[tuple[str, int]]:
    """What stations hear of three waypoints, items 1 and 2 of the judged mission."""
    out: list[object] = []
    fake.link.send = lambda message, peer: out.append(message)
    fake.vehicle.arming.mission_state = ACTIVE
    progress = fake.vehicle._progress
    progress.start_flight()
    for leg in (0, 0, 1):
        progress.report_leg(leg)
    return [(m.get_type(), m.seq) for m in out if m.get_type() in ("MISSION_CURRENT", "MISSION_ITEM_REACHED")]


def test_items_are_reached_once_and_the_next_is_current(fake: FakeVehicle) -> None:
    fake.upload(PLACES)
    said = [("MISSION_ITEM_REACHED", 1), ("MISSION_CURRENT", 2), ("MISSION_ITEM_REACHED", 2), ("MISSION_CURRENT", 2)]
    assert reached(fake) == said


def test_without_a_home_numbers_are_one_less(fake: FakeVehicle) -> None:
    """MAVSDK's mission plugin sends none: its item 0 is flown."""
    relative = [
        mavlink.MAVLink_mission_item_int_message(
            1, 1, k, 6, 16, 0, 1, 0, 9, 0, 0, 460_000_000, 80_000_000 + 50_000 * k, 100.0, 0
        )
        for k in range(4)
    ]
    fake.upload(relative)
    assert [seq for _, seq in reached(fake)] == [0, 1, 1, 1]


# ----------------------------------------------------------------------
# What is due is sent once, late messages are not made up for, and texts and parameters reach every station.

NAME = "ATTITUDE"
PAUSE = 0.01


class FakeLink:
    """A link that keeps what it was to send."""

    def __init__(self) -> None:
        self.peers: dict[tuple[str, int], Peer] = {}
        self.sent: list[tuple[str, int]] = []
        self.messages: list[Any] = []
        self.heartbeats = 0
        self.forgotten = 0

    def send(self, message: Any, peer: Peer) -> None:
        self.sent.append((message.get_type(), peer.address[1]))
        self.messages.append(message)

    def send_heartbeat(self, message: Any) -> None:
        assert message.get_type() == "HEARTBEAT"
        self.heartbeats += 1

    def remove_silent_peers(self) -> None:
        self.forgotten += 1


class Sending:
    """A downlink to stations on ports 1 and 2, each of which wants one kind of message, every 0.1 s from now on."""

    def __init__(self, clock: Clock, stations: int = 2, parameters: int = 5) -> None:
        self.link: Any = FakeLink()
        self.link.clock = clock
        for port in range(1, stations + 1):
            peer = Peer(("127.0.0.1", port), 255, 190, 0.0, mavlink.MAVLink(None, 1, 1), {NAME: 0.1}, {NAME: clock.now})
            self.link.peers[peer.address] = peer
        self.shown: list[str] = []
        self.entries = [Parameter(f"P{k}", float(k)) for k in range(parameters)]
        status = Status(Snapshot(time=0.0, lat_deg=46.0, lon_deg=8.0, amsl=500.0, height=100.0), Home(46.0, 8.0, 400.0))
        self.downlink = Downlink(self.link, status, Parameters(self.entries), self.shown.append, PAUSE)

    @property
    def first(self) -> Peer:
        peer: Peer = next(iter(self.link.peers.values()))
        return peer


@pytest.fixture
def clock() -> Clock:
    made = Clock()
    made.now = 1000.0
    return made


def test_the_first_heartbeat_goes_at_once_and_then_one_a_second(clock: Clock) -> None:
    sending = Sending(clock)
    sent = []
    for tenths in range(25):
        sending.downlink.tick(1000.0 + 0.1 * tenths)
        sent.append(sending.link.heartbeats)
    assert (sent[0], sent[9], sent[11], sent[19], sent[21]) == (1, 1, 2, 2, 3)
    assert sending.link.forgotten == 3


def test_after_a_long_pause_one_heartbeat_is_sent_and_not_many(clock: Clock) -> None:
    sending = Sending(clock)
    sending.downlink.tick(1000.0)
    for k in range(5):
        sending.downlink.tick(1010.0 + 0.1 * k)
    assert sending.link.heartbeats == 2


def test_a_change_is_told_at_once(clock: Clock) -> None:
    sending = Sending(clock)
    sending.downlink.tick(1000.0)
    clock.now = 1000.3
    sending.downlink.request_heartbeat()
    sending.downlink.tick(1000.3)
    assert sending.link.heartbeats == 2


def test_each_station_gets_what_is_due_and_no_more(clock: Clock) -> None:
    sending = Sending(clock)
    sending.downlink.tick(1000.0)
    assert sending.link.sent == [(NAME, 1), (NAME, 2)]
    sending.downlink.tick(1000.05)
    assert len(sending.link.sent) == 2
    # A little late: the next is due as if it had not been.
    sending.downlink.tick(1000.15)
    assert len(sending.link.sent) == 4
    assert sending.first.due[NAME] == pytest.approx(1000.2)
    # Much too late: what was missed is not made up for.
    sending.downlink.tick(1005.0)
    assert len(sending.link.sent) == 6
    assert sending.first.due[NAME] == pytest.approx(1005.1)


def test_a_message_that_is_switched_off_is_not_sent(clock: Clock) -> None:
    sending = Sending(clock, stations=1)
    sending.first.periods[NAME] = None
    for tenths in range(30):
        sending.downlink.tick(1000.0 + 0.1 * tenths)
    assert sending.link.sent == []


def test_the_caller_sleeps_until_something_is_due_and_no_longer_than_it_may(clock: Clock) -> None:
    sending = Sending(clock)
    sending.downlink.tick(1000.0)
    assert sending.downlink.wait_time(1000.0, 5.0) == pytest.approx(0.1)
    assert sending.downlink.wait_time(1000.0, 0.04) == pytest.approx(0.04)
    assert sending.downlink.wait_time(1000.4, 5.0) == 0.0
    alone = Sending(clock, stations=0)
    alone.downlink.tick(1000.0)
    # Then only the heartbeat is.
    assert alone.downlink.wait_time(1000.3, 5.0) == pytest.approx(0.7)


def test_texts_go_to_every_station_and_to_the_terminal(clock: Clock) -> None:
    sending = Sending(clock)
    sending.downlink.send_text("x" * 60, WARNING)
    sending.downlink.send_text("y" * 60)
    assert sending.shown == ["x" * 60, "y" * 60]
    assert sending.link.sent == 2 * (2 * [("STATUSTEXT", 1)] + 2 * [("STATUSTEXT", 2)])
    assert [message.severity for message in sending.link.messages] == [4] * 4 + [6] * 4
    # Pieces of one text share a number, and no other text has it.
    numbers = [message.id for message in sending.link.messages]
    assert len(set(numbers[:4])) == len(set(numbers[4:])) == 1
    assert numbers[0] != numbers[4]


def test_the_number_of_a_text_stays_within_16_bits_and_is_never_0(clock: Clock) -> None:
    # 0 marks a text that is not in pieces.
    sending = Sending(clock, stations=1)
    for _ in range(65536):
        sending.link.messages.clear()
        sending.downlink.send_text("x" * 60)
    assert sending.link.messages[0].id == 1


def test_all_parameters_are_streamed_once_in_order_to_who_asked(clock: Clock) -> None:
    sending = Sending(clock)
    sending.first.periods[NAME] = None
    sending.first.next_parameter = 0.0
    rounds = 0
    while sending.first.next_parameter is not None:
        sending.downlink.tick(1000.0)
        rounds += 1
    streamed = [one for one in sending.link.messages if one.get_type() == "PARAM_VALUE"]
    assert [one.param_index for one in streamed] == list(range(5))
    assert {port for name, port in sending.link.sent if name == "PARAM_VALUE"} == {1}
    # Two in each pause of 0.01 s at 200 a second.
    assert rounds == 3
    assert PARAMETERS_PER_SECOND * PAUSE == 2.0


# ----------------------------------------------------------------------
# The vehicle: commands and missions become orders to the flying process, whatever the datagrams are.


def test_armed_and_auto_start_the_flight(fake: FakeVehicle) -> None:
    fake.upload(many_items(3))
    assert isinstance(fake.orders[0], JudgeMission)
    fake.send(command(400, 1.0), command(176, 1.0, 10.0))
    assert isinstance(fake.orders[-1], StartFlight)
    assert fake.vehicle.status.flying
    fake.send(command(400, 0.0))
    assert fake.vehicle.status.armed
    fake.send(command(400, 0.0, 21196.0))
    assert isinstance(fake.orders[-1], EndFlight)


def test_what_is_not_flyable_is_not_armed_unless_forced(fake: FakeVehicle) -> None:
    fake.flyable = False
    fake.upload(many_items(3))
    fake.send(command(400, 1.0))
    assert not fake.vehicle.status.armed
    assert "PFLY_FORCE" in fake.shown[-1]
    fake.send(mavlink.MAVLink_param_set_message(1, 1, b"PFLY_FORCE", 1.0, 9), command(400, 1.0))
    assert fake.vehicle.status.armed


def test_a_mission_taken_back_while_it_is_judged_is_not_flown(fake: FakeVehicle) -> None:
    fake.send(HEARTBEAT, mavlink.MAVLink_mission_count_message(1, 1, 3, 0), *many_items(3)[:2])
    fake.link.decode_datagram(b"", ("127.0.0.1", 5))
    for message in (many_items(3)[2], command(400, 1.0), mavlink.MAVLink_mission_clear_all_message(1, 1, 0)):
        ((found, peer),) = fake.link.decode_datagram(packed(message), ("127.0.0.1", 5))
        fake.vehicle._handle_message(found, peer, 0.0)
    fake.turn()
    fake.turn()
    fake.send(command(176, 1.0, 10.0))
    assert not fake.vehicle.status.flying
    assert not any(isinstance(order, StartFlight) for order in fake.orders)


def test_a_fence_from_a_file_belongs_to_the_mission_that_is_uploaded_next(fake: FakeVehicle) -> None:
    circle = MissionItem(0, Command.NAV_FENCE_CIRCLE_EXCLUSION, Frame.GLOBAL, (200.0, 0.0, 0.0, 0.0), 46.0, 8.0, 0.0)
    fake.vehicle.load_fence_and_rally([circle])
    fake.turn()
    assert fake.orders == []
    fake.upload(many_items(3))
    assert isinstance(fake.orders[0], JudgeMission)
    assert fake.orders[0].mission.fences == (circle,)


def resident() -> int:
    """Memory of this process, bytes."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_any_datagram_is_survived_through_a_socket(fake: FakeVehicle) -> None:
    """1,000 datagrams from two addresses, a million in the soak: none is lost on the way, and memory stays."""
    count, batch = scaled(1_000_000, 1_000), 100
    senders = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    try:
        for host, sender in zip(("127.0.0.1", "127.0.0.2"), senders, strict=True):
            sender.bind((host, 0))
        before = begun = 0
        for k in itertools.count():
            # Which messages there are, and so what chance sends, is pymavlink's.
            if k >= count // batch and (begun or k >= 10 * count // batch):
                break
            for n, data in enumerate((packed(HEARTBEAT), packed(HEARTBEAT), *fuzzed(batch, k))):
                senders[n % 2].sendto(data, fake.link.address)
            fake.turn()
            if k == min(9, count // batch // 3):
                gc.collect()
                before = resident()
            begun += any(isinstance(order, JudgeMission) for order in fake.orders)
        gc.collect()
        grown = resident() - before
        assert grown <= 10 * 2**20
        assert begun > 0, "the fuzz is to reach the missions"
        port = f":{fake.link.address[1]:04X} "
        (line,) = [line for line in Path("/proc/net/udp").read_text("ascii").splitlines() if port in line[:30]]
        lost = int(line.split()[-1])
        assert lost == 0
        note("datagrams through a socket", count=count, lost=lost, memory_grown_kib=grown // 1024)
    finally:
        for sender in senders:
            sender.close()


def test_any_datagram_is_survived(fake: FakeVehicle) -> None:
    """10,000 datagrams, a million in the soak: alive, no more memory, and a real upload works afterwards."""
    count, batch = scaled(1_000_000, 10_000), 1000
    before = judged = 0
    for k in range(count // batch):
        for port in (5, 6):
            fake.send(HEARTBEAT, port=port)
        data = fuzzed(batch, k)
        fake.feed(data[::2], 5)
        fake.feed(data[1::2], 6)
        judged += any(isinstance(order, JudgeMission) for order in fake.orders)
        if k == min(9, count // batch // 3):
            gc.collect()
            before = resident()
    gc.collect()
    note("datagrams to the vehicle", count=count, memory_grown_kib=(resident() - before) // 1024)
    assert resident() - before <= 10 * 2**20
    assert judged > 0, "the fuzz is to reach the missions"
    # Whatever it left behind: the flight is over, and both stations silent for a while.
    fake.vehicle.arming.on_flight_ended(False)
    fake.link.peers.clear()
    fake.vehicle.server.tick(fake.vehicle._clock() + 100.0)
    fake.orders.clear()
    items = many_items(50)
    fake.upload(items, port=7)
    fake.turn()
    lists = fake.vehicle.server.lists
    assert [(one.x, one.y) for one in next(iter(lists.values()))] == [(one.x, one.y) for one in items]
    assert any(isinstance(order, JudgeMission) for order in fake.orders)
