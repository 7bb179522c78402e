"""What is due is sent once, late messages are not made up for, and texts and parameters reach every station."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.downlink import Downlink
from flight.live.link import Peer
from flight.live.parameters import PARAMETERS_PER_SECOND, Parameter, Parameters
from flight.live.snapshot import Snapshot
from flight.live.status_text import WARNING
from flight.live.telemetry import Status
from flight.mission.items import Home
from tests.flight.live.fake_vehicle import Clock

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

    def forget_silent(self) -> None:
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
    sending.downlink.heartbeat_now()
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
    assert sending.downlink.wait(1000.0, 5.0) == pytest.approx(0.1)
    assert sending.downlink.wait(1000.0, 0.04) == pytest.approx(0.04)
    assert sending.downlink.wait(1000.4, 5.0) == 0.0
    alone = Sending(clock, stations=0)
    alone.downlink.tick(1000.0)
    # Then only the heartbeat is.
    assert alone.downlink.wait(1000.3, 5.0) == pytest.approx(0.7)


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
    sending.first.parameter = 0.0
    rounds = 0
    while sending.first.parameter is not None:
        sending.downlink.tick(1000.0)
        rounds += 1
    streamed = [one for one in sending.link.messages if one.get_type() == "PARAM_VALUE"]
    assert [one.param_index for one in streamed] == list(range(5))
    assert {port for name, port in sending.link.sent if name == "PARAM_VALUE"} == {1}
    # Two in each pause of 0.01 s at 200 a second.
    assert rounds == 3
    assert PARAMETERS_PER_SECOND * PAUSE == 2.0
