"""The link: who is let in, which stations are kept, and what each of them is sent."""

import socket

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.link import MOST_PEERS, SILENCE, Access, Link
from flight.live.signing import Signing
from tests.flight.live.fake_vehicle import HEARTBEAT, KEY, LOCAL, WALL, Clock, packed
from world.errors import FlightError


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


def test_a_station_gets_one_count_of_frames(link: Link) -> None:
    """A ground station takes a jump in it for lost packets."""
    ours = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ours.bind(("127.0.0.1", 0))
    ours.settimeout(1.0)
    access = Access(("127.0.0.1", 0), (ours.getsockname(),))
    made = Link(access)
    try:
        for _ in range(3):
            made.send_heartbeat(HEARTBEAT)
        made.take(packed(HEARTBEAT), ours.getsockname())
        made.send_heartbeat(HEARTBEAT)
        made.send(HEARTBEAT, made.peers[ours.getsockname()])
        assert [ours.recv(300)[4] for _ in range(5)] == [0, 1, 2, 3, 4]
    finally:
        made.close()
        ours.close()


def test_a_key_lets_only_its_owner_in() -> None:
    made = Link(Access(("127.0.0.1", 0), (("127.0.0.1", 9),), key=KEY), Clock(), lambda: WALL)
    try:
        assert made.take(packed(HEARTBEAT), ("127.0.0.1", 5)) == []
        assert made.peers == {}
        assert len(made.take(Signing(KEY).sign(packed(HEARTBEAT), WALL), ("127.0.0.1", 5))) == 1
    finally:
        made.close()


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


def test_only_addresses_on_the_list_are_let_in() -> None:
    made = Link(Access(("127.0.0.1", 0), (), frozenset({"192.0.2.7"})))
    try:
        assert made.take(packed(HEARTBEAT), ("192.0.2.8", 5)) == []
        assert len(made.take(packed(HEARTBEAT), ("192.0.2.7", 5))) == 1
    finally:
        made.close()
