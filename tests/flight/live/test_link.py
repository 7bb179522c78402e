"""Frames in datagrams; who may talk to the vehicle, and how long it remembers them."""

import os
import socket
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.link import (
    MAX_DATAGRAM_BYTES,
    MAX_PEERS,
    PEER_TIMEOUT_S,
    SIGNING_EPOCH_S,
    Access,
    DropCounts,
    Link,
    RefusalReason,
    Signing,
    read_key,
    split_frames,
)
from tests.flight.live.fake_vehicle import HEARTBEAT, KEY, LOCAL, WALL, Clock, packed
from world.errors import FlightError
from world.running_clock import RunningClock

# ----------------------------------------------------------------------
# Frames in datagrams: whole ones are found, damaged ones skipped.


@pytest.mark.parametrize("cut", range(1, 21))
def test_damaged_frames_are_skipped_to_the_next_whole_one(cut: int) -> None:
    frame = packed(HEARTBEAT)
    assert [one.raw for one in split_frames(frame[:-cut] + frame)] == [frame]
    turned = bytearray(frame)
    turned[cut % len(frame)] ^= 0x10
    assert split_frames(bytes(turned)) == [] or cut % len(frame) == 0


def test_frames_of_both_versions_are_read() -> None:
    mav = mavlink.MAVLink(None, 255, 190)
    old = HEARTBEAT.pack(mav, force_mavlink1=True)
    assert old[0] == 0xFE
    assert [one.number for one in split_frames(old + packed(HEARTBEAT))] == [0, 0]
    assert split_frames(bytes([0xFD]) * MAX_DATAGRAM_BYTES) == []


# ----------------------------------------------------------------------
# Signing: pymavlink accepts our signatures, and neither a forged frame nor a replayed one is accepted.


def test_pymavlink_accepts_our_signatures_and_we_its() -> None:
    """An independent implementation accepts ours, and ours accepts its."""
    ours, theirs = Signing(KEY, 3), mavlink.MAVLink(None, 255, 190)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.link_id, theirs.signing.timestamp = 1, int((WALL - SIGNING_EPOCH_S) * 1e5)
    receiver = mavlink.MAVLink(None)
    receiver.signing.secret_key, receiver.signing.timestamp = KEY, int((WALL - SIGNING_EPOCH_S) * 1e5)
    message = receiver.decode(bytearray(ours.sign(packed(HEARTBEAT, 1), WALL)))
    assert message.get_type() == "HEARTBEAT"
    assert message.get_signed()
    (frame,) = split_frames(HEARTBEAT.pack(theirs))
    assert ours.find_refusal(frame, WALL) is None
    assert ours.find_refusal(frame, WALL), "a replayed frame"
    assert ours.find_refusal(split_frames(packed(HEARTBEAT))[0], WALL), "an unsigned frame"


def test_a_vehicle_started_anew_after_its_clock_was_set_back_is_heard() -> None:
    """pymavlink, which ran on, drops its first frame as old; then it goes on from the station's time."""
    theirs = mavlink.MAVLink(None, 255, 190)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.link_id, theirs.signing.timestamp = 1, int((WALL - SIGNING_EPOCH_S) * 1e5)
    assert theirs.decode(bytearray(Signing(KEY).sign(packed(HEARTBEAT, 1), WALL + 10.0))).get_signed()
    anew, back = Signing(KEY), WALL - 3600.0
    with pytest.raises(mavlink.MAVError, match="signature"):
        theirs.decode(bytearray(anew.sign(packed(HEARTBEAT, 1), back)))
    (heard,) = split_frames(HEARTBEAT.pack(theirs))
    assert anew.find_refusal(heard, back) is None
    assert theirs.decode(bytearray(anew.sign(packed(HEARTBEAT, 1), back))).get_signed()
    # What is forged moves nothing.
    (forged,) = split_frames(Signing(bytes(32)).sign(packed(HEARTBEAT), WALL + 1e8))
    before = anew.newest
    assert anew.find_refusal(forged, back) is RefusalReason.FORGED
    assert anew.newest == before


def test_a_forged_timestamp_locks_nobody_out() -> None:
    vehicle, station, thief = Signing(KEY), Signing(KEY), Signing(bytes(32))
    future = WALL + 1e8
    for link_id in range(256):
        thief.link = link_id
        (forged,) = split_frames(thief.sign(packed(HEARTBEAT), future))
        assert vehicle.find_refusal(forged, WALL)
    (good,) = split_frames(station.sign(packed(HEARTBEAT), WALL))
    flipped = bytearray(good.raw)
    flipped[-7] ^= 0x40  # a later time under a signature that was good
    assert vehicle.find_refusal(split_frames(bytes(flipped))[0], WALL)
    assert vehicle.find_refusal(good, WALL) is None
    (old,) = split_frames(Signing(KEY, 9).sign(packed(HEARTBEAT), WALL - 120.0))
    assert vehicle.find_refusal(old, WALL), "a recording from two minutes ago, on a new link"


def test_each_frame_that_is_not_believed_says_why() -> None:
    vehicle, station = Signing(KEY), Signing(KEY, 4)

    def refused(raw: bytes, wall: float = WALL) -> RefusalReason | None:
        return vehicle.find_refusal(split_frames(raw)[0], wall)

    first, second = (station.sign(packed(HEARTBEAT), WALL) for _ in range(2))
    assert refused(packed(HEARTBEAT)) is RefusalReason.UNSIGNED
    assert refused(Signing(bytes(32), 4).sign(packed(HEARTBEAT), WALL)) is RefusalReason.FORGED
    # Its own frame under another link's id: the signature covers the id.
    moved = bytearray(second)
    moved[-13] = 5
    assert refused(bytes(moved)) is RefusalReason.FORGED
    assert refused(second) is None
    assert refused(second) is RefusalReason.REPLAYED
    assert refused(first) is RefusalReason.REPLAYED, "a later frame has been there"
    # A recording of another link, played when its minute is over, and just before.
    other = Signing(KEY, 6).sign(packed(HEARTBEAT), WALL)
    assert refused(other, WALL + 60.001) is RefusalReason.OLD
    assert refused(other, WALL + 59.999) is None
    for link in range(10, 10 + 62):
        assert refused(Signing(KEY, link).sign(packed(HEARTBEAT), WALL)) is None
    assert refused(Signing(KEY, 100).sign(packed(HEARTBEAT), WALL)) is RefusalReason.STREAMS


# Timestamps as the standard counts them: 10 us since 2015-01-01.  3e8 s after it, and a day.
NOW, DAY = 30_000_000_000_000, 8_640_000_000


def signed_at(stamp: int, link_id: int = 1, system: int = 255) -> bytes:
    """A HEARTBEAT that pymavlink signs with the key and a timestamp."""
    mav = mavlink.MAVLink(None, system, 190)
    mav.signing.secret_key, mav.signing.sign_outgoing = KEY, True
    mav.signing.link_id, mav.signing.timestamp = link_id, stamp
    return HEARTBEAT.pack(mav)


def test_a_timestamp_more_than_a_day_ahead_is_refused_and_leaves_no_trace() -> None:
    vehicle = Signing(KEY)

    def refused(stamp: int, link_id: int = 1) -> RefusalReason | None:
        return vehicle.find_refusal(split_frames(signed_at(stamp, link_id))[0], WALL)

    assert refused(NOW) is None
    for ahead in (2**48 - 1, 2**48 - 2, NOW + DAY + 1):
        for link_id in (1, 2):
            assert refused(ahead, link_id) is RefusalReason.FUTURE
    assert vehicle.newest == NOW
    assert refused(NOW + 1) is None, "its own stream goes on"
    assert refused(NOW + DAY) is None
    # Half a day at a time leads no further than one frame does.
    assert refused(NOW + DAY + DAY // 2) is RefusalReason.FUTURE
    sent = split_frames(vehicle.sign(packed(HEARTBEAT, 1), WALL))[0].raw
    assert int.from_bytes(sent[-12:-6], "little") == NOW + DAY + 1


def test_a_clock_set_back_by_years_keeps_the_streams_that_it_had() -> None:
    vehicle = Signing(KEY)
    assert vehicle.find_refusal(split_frames(signed_at(NOW))[0], WALL) is None
    assert vehicle.find_refusal(split_frames(signed_at(NOW + 1))[0], 0.0) is None


def test_our_timestamps_never_overflow_their_six_bytes() -> None:
    """In the year 2104 and long after it frames are still signed, so that pymavlink can check them."""
    ours, receiver = Signing(KEY), mavlink.MAVLink(None)
    receiver.signing.secret_key = KEY
    last = SIGNING_EPOCH_S + 2**48 / 1e5
    assert receiver.decode(bytearray(ours.sign(packed(HEARTBEAT, 1), last - 1.0))).get_signed()
    for wall in (last, last + 1.0, 1e11, 1e18):
        assert ours.sign(packed(HEARTBEAT, 1), wall)[-12:-6] == bytes([0xFF] * 6)


def test_keys_that_others_could_read_are_refused(tmp_path: Path) -> None:
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
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FlightError, match="not a plain file"):
        read_key(tmp_path / "pipe")


def test_where_users_have_no_numbers_a_key_is_read_whatever_its_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key = tmp_path / "key"
    key.write_bytes(b"correct horse battery")
    key.chmod(0o644)
    with pytest.raises(FlightError, match="mode 644"):
        read_key(key)
    monkeypatch.delattr("os.getuid")
    assert len(read_key(key)) == 32


# ----------------------------------------------------------------------
# The link: who is let in, which stations are kept, and what each of them is sent.


@pytest.fixture
def link():
    made = Link(LOCAL, Clock(), lambda: WALL)
    yield made
    made.close()


FAR = Access(("127.0.0.1", 0), (("127.0.0.1", 9),), frozenset({"192.0.2.1"}))


def test_nobody_beyond_this_machine_is_believed_before_a_heartbeat() -> None:
    link = Link(FAR, Clock(), lambda: WALL)
    try:
        ask = packed(mavlink.MAVLink_param_request_list_message(1, 1))
        assert link.decode_datagram(ask, ("192.0.2.1", 5)) == []
        assert link.peers == {}
        assert link.pop_notices() == ["192.0.2.1 sends PARAM_REQUEST_LIST and no HEARTBEAT: it is not answered"]
        assert link.decode_datagram(ask, ("192.0.2.1", 6)) == []
        assert link.pop_notices() == [], "said once"
        assert len(link.decode_datagram(packed(HEARTBEAT) + ask, ("192.0.2.1", 5))) == 2
        assert link.decode_datagram(ask, ("192.0.2.1", 6)) == []
        other = packed(mavlink.MAVLink_param_request_list_message(7, 1))
        assert link.decode_datagram(other, ("192.0.2.1", 5)) == []
    finally:
        link.close()


def test_who_asks_the_vehicle_on_this_machine_needs_no_heartbeat(link: Link) -> None:
    """Whatever is addressed to it makes a station known, and keeps it so; what is for all or for others does not."""
    for_all = packed(mavlink.MAVLink_param_request_list_message(0, 0))
    for_others = packed(mavlink.MAVLink_param_request_list_message(7, 1))
    assert link.decode_datagram(for_all, ("127.0.0.1", 5)) + link.decode_datagram(for_others, ("127.0.0.1", 5)) == []
    assert link.peers == {}
    ask = packed(mavlink.MAVLink_mission_request_list_message(1, 1))
    for _ in range(3):
        assert [message.get_type() for message, _ in link.decode_datagram(ask, ("127.0.0.1", 6))] == [
            "MISSION_REQUEST_LIST"
        ]
        link.clock.now += 0.6 * PEER_TIMEOUT_S
    assert list(link.peers) == [("127.0.0.1", 6)]


def test_the_table_of_stations_is_bounded_and_forgets(link: Link) -> None:
    for port in range(1000):
        link.decode_datagram(packed(HEARTBEAT), ("127.0.0.1", port))
    assert len(link.peers) == MAX_PEERS
    link.clock.now += PEER_TIMEOUT_S + 1.0
    link.decode_datagram(packed(HEARTBEAT), ("127.0.0.1", 5000))
    assert list(link.peers) == [("127.0.0.1", 5000)]


def test_a_sleeping_laptop_loses_no_station_and_none_of_its_wishes() -> None:
    """Asleep for an hour, as one that runs on the same laptop was: what it had asked for still holds."""
    real = Clock()
    made = Link(LOCAL, RunningClock(real))
    try:
        made.decode_datagram(packed(HEARTBEAT), ("127.0.0.1", 5))
        made.peers["127.0.0.1", 5].periods["ATTITUDE"] = 0.02
        real.now += 3600.0
        made.remove_silent_peers()
        assert made.peers["127.0.0.1", 5].periods["ATTITUDE"] == 0.02
        # Awake and silent it is forgotten as ever.
        for _ in range(int(PEER_TIMEOUT_S)):
            real.now += 1.0
            made.remove_silent_peers()
        assert made.peers == {}
    finally:
        made.close()


def test_a_clock_set_back_cuts_no_signed_link() -> None:
    """An hour back and a day on: pymavlink takes each of our frames, and we each of its."""
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.bind(("127.0.0.1", 0))
    station.settimeout(1.0)
    theirs = mavlink.MAVLink(None, 255, 190)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.link_id, theirs.signing.timestamp = 1, int((WALL - SIGNING_EPOCH_S) * 1e5)
    wall = Clock()
    made = Link(Access(("127.0.0.1", 0), (station.getsockname(),), key=KEY), Clock(), wall)
    try:
        for n, change in enumerate((0.0, 0.02, -3600.0, -3599.0, 86_400.0, 0.0)):
            wall.now = WALL + change
            assert len(made.decode_datagram(HEARTBEAT.pack(theirs), station.getsockname())) == 1
            made.send_heartbeat(HEARTBEAT)
            message = theirs.decode(bytearray(station.recv(300)))
            assert (message.get_type(), message.get_signed(), message.get_seq()) == ("HEARTBEAT", True, n)
        assert made.dropped == DropCounts()
    finally:
        made.close()
        station.close()


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
        made.decode_datagram(packed(HEARTBEAT), ours.getsockname())
        made.send_heartbeat(HEARTBEAT)
        made.send(HEARTBEAT, made.peers[ours.getsockname()])
        assert [ours.recv(300)[4] for _ in range(5)] == [0, 1, 2, 3, 4]
    finally:
        made.close()
        ours.close()


def test_a_key_lets_only_its_owner_in() -> None:
    made = Link(Access(("127.0.0.1", 0), (("127.0.0.1", 9),), key=KEY), Clock(), lambda: WALL)
    try:
        assert made.decode_datagram(packed(HEARTBEAT), ("127.0.0.1", 5)) == []
        assert made.peers == {}
        assert len(made.decode_datagram(Signing(KEY).sign(packed(HEARTBEAT), WALL), ("127.0.0.1", 5))) == 1
    finally:
        made.close()


def test_an_address_whose_clock_is_far_ahead_is_named_once() -> None:
    made = Link(Access(("127.0.0.1", 0), (("127.0.0.1", 9),), key=KEY), Clock(), lambda: WALL)
    try:
        for stamp in (2**48 - 1, 2**48 - 1, NOW + 2 * DAY):
            assert made.decode_datagram(signed_at(stamp), ("127.0.0.1", 5)) == []
        assert (made.dropped.future, made.peers) == (3, {})
        (notice,) = made.pop_notices()
        assert notice.startswith("127.0.0.1 signs with timestamps more than a day ahead")
        made.decode_datagram(signed_at(NOW + 2 * DAY), ("127.0.0.1", 6))
        assert made.pop_notices() == []
        # Addresses that are named are bounded, and the vehicle still signs.
        for host in range(1000):
            made.decode_datagram(signed_at(2**48 - 1), (f"127.0.{host // 250}.{2 + host % 250}", 5))
        assert len(made.pop_notices()) < 20
        made.send_heartbeat(HEARTBEAT)
        assert len(made.decode_datagram(signed_at(NOW), ("127.0.0.1", 5))) == 1
    finally:
        made.close()


def test_a_stranger_at_another_address_reaches_nothing() -> None:
    """Every kind of message, unsigned, from another address: nothing comes back, and all of it is counted."""
    stranger, station = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    stranger.bind(("127.0.0.2", 0))
    station.bind(("127.0.0.1", 0))
    stranger.settimeout(0.05)
    made = Link(Access(("0.0.0.0", 0), (station.getsockname(),), key=KEY), Clock(), lambda: WALL)
    to = ("127.0.0.1", made.address[1])
    try:
        kinds = [kind(*_zeros(kind)) for number, kind in sorted(mavlink.mavlink_map.items()) if number >= 0]
        for number, message in enumerate((HEARTBEAT, *kinds)):
            stranger.sendto(packed(message), to)
            if number % 50 == 49:
                assert made.receive() == []
        assert made.receive() == []
        made.send_heartbeat(HEARTBEAT)
        assert made.peers == {}
        with pytest.raises(TimeoutError):
            stranger.recv(300)
        assert made.dropped.unsigned == 1 + len(kinds)
        good = Signing(KEY).sign(packed(HEARTBEAT), WALL)
        station.sendto(good, to)
        # The stranger plays what it has overheard.
        stranger.sendto(good, to)
        assert len(made.receive()) == 1
        assert list(made.peers) == [station.getsockname()]
        assert made.dropped.replayed == 1
    finally:
        for one in (made, stranger, station):
            one.close()


def _zeros(kind: type) -> list[object]:
    """A value for each field of a message."""
    return [
        b"" if code == "char" else [0] * length if length else 0
        for code, length in zip(kind.fieldtypes, _lengths(kind), strict=True)
    ]


def _lengths(kind: type) -> list[int]:
    """Elements of each field in the order of the arguments, 0 for a number."""
    return [kind.array_lengths[kind.ordered_fieldnames.index(name)] for name in kind.fieldnames]


def test_strangers_and_others_are_counted(link: Link) -> None:
    ask = mavlink.MAVLink_param_request_list_message(0, 0)
    link.decode_datagram(packed(ask), ("127.0.0.1", 5))
    link.decode_datagram(packed(HEARTBEAT, system=1), ("127.0.0.1", 5))
    link.decode_datagram(packed(HEARTBEAT), ("127.0.0.1", 5))
    link.decode_datagram(packed(mavlink.MAVLink_param_request_list_message(7, 1)), ("127.0.0.1", 5))
    assert (link.dropped.stranger, link.dropped.others, link.dropped.unsigned) == (1, 2, 0)


@pytest.mark.parametrize(
    ("access", "word"),
    [
        (Access(("0.0.0.0", 0), ()), "bind 0.0.0.0"),
        (Access(("127.0.0.1", 0), (("192.0.2.1", 14550),)), "to 192.0.2.1"),
        (Access(("0.0.0.0", 0), (("192.0.2.1", 14550),), frozenset({"192.0.2.2"})), "`allow` 192.0.2.1"),
        (Access(("127.0.0.1", 0), (("192.0.2.1", 14550),), frozenset({"192.0.2.1"})), "bind 127.0.0.1"),
        (Access(("127.0.0.1", 0), (("192.0.2.1", 14550),), key=KEY), "bind 127.0.0.1"),
    ],
)
def test_beyond_this_machine_only_with_protection(access: Access, word: str) -> None:
    with pytest.raises(FlightError, match=word):
        Link(access)


def test_only_addresses_on_the_list_are_let_in() -> None:
    made = Link(Access(("127.0.0.1", 0), (), frozenset({"192.0.2.7"})))
    try:
        assert made.decode_datagram(packed(HEARTBEAT), ("192.0.2.8", 5)) == []
        assert made.dropped.address == 1
        assert len(made.decode_datagram(packed(HEARTBEAT), ("192.0.2.7", 5))) == 1
    finally:
        made.close()
