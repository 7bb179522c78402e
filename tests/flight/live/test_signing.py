"""Signing: pymavlink accepts our signatures, and neither a forged frame nor a replayed one is accepted."""

import os
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.mavlink_frames import split_frames
from flight.live.signing import EPOCH, Refused, Signing, read_key
from tests.flight.live.fake_vehicle import HEARTBEAT, KEY, WALL, packed
from world.errors import FlightError


def test_pymavlink_accepts_our_signatures_and_we_its() -> None:
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
    assert ours.refuses(frame, WALL) is None
    assert ours.refuses(frame, WALL), "a replayed frame"
    assert ours.refuses(split_frames(packed(HEARTBEAT))[0], WALL), "an unsigned frame"


def test_a_vehicle_started_anew_after_its_clock_was_set_back_is_heard() -> None:
    """pymavlink, which ran on, drops its first frame as old; then it goes on from the station's time."""
    theirs = mavlink.MAVLink(None, 255, 190)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.link_id, theirs.signing.timestamp = 1, int((WALL - EPOCH) * 1e5)
    assert theirs.decode(bytearray(Signing(KEY).sign(packed(HEARTBEAT, 1), WALL + 10.0))).get_signed()
    anew, back = Signing(KEY), WALL - 3600.0
    with pytest.raises(mavlink.MAVError, match="signature"):
        theirs.decode(bytearray(anew.sign(packed(HEARTBEAT, 1), back)))
    (heard,) = split_frames(HEARTBEAT.pack(theirs))
    assert anew.refuses(heard, back) is None
    assert theirs.decode(bytearray(anew.sign(packed(HEARTBEAT, 1), back))).get_signed()
    # What is forged moves nothing.
    (forged,) = split_frames(Signing(bytes(32)).sign(packed(HEARTBEAT), WALL + 1e8))
    before = anew.newest
    assert anew.refuses(forged, back) is Refused.FORGED
    assert anew.newest == before


def test_a_forged_timestamp_locks_nobody_out() -> None:
    vehicle, station, thief = Signing(KEY), Signing(KEY), Signing(bytes(32))
    future = WALL + 1e8
    for link_id in range(256):
        thief.link = link_id
        (forged,) = split_frames(thief.sign(packed(HEARTBEAT), future))
        assert vehicle.refuses(forged, WALL)
    (good,) = split_frames(station.sign(packed(HEARTBEAT), WALL))
    flipped = bytearray(good.raw)
    flipped[-7] ^= 0x40  # a later time under a signature that was good
    assert vehicle.refuses(split_frames(bytes(flipped))[0], WALL)
    assert vehicle.refuses(good, WALL) is None
    (old,) = split_frames(Signing(KEY, 9).sign(packed(HEARTBEAT), WALL - 120.0))
    assert vehicle.refuses(old, WALL), "a recording from two minutes ago, on a new link"


def test_each_frame_that_is_not_believed_says_why() -> None:
    vehicle, station = Signing(KEY), Signing(KEY, 4)

    def refused(raw: bytes, wall: float = WALL) -> Refused | None:
        return vehicle.refuses(split_frames(raw)[0], wall)

    first, second = (station.sign(packed(HEARTBEAT), WALL) for _ in range(2))
    assert refused(packed(HEARTBEAT)) is Refused.UNSIGNED
    assert refused(Signing(bytes(32), 4).sign(packed(HEARTBEAT), WALL)) is Refused.FORGED
    # Its own frame under another link's id: the signature covers the id.
    moved = bytearray(second)
    moved[-13] = 5
    assert refused(bytes(moved)) is Refused.FORGED
    assert refused(second) is None
    assert refused(second) is Refused.REPLAYED
    assert refused(first) is Refused.REPLAYED, "a later frame has been there"
    # A recording of another link, played when its minute is over, and just before.
    other = Signing(KEY, 6).sign(packed(HEARTBEAT), WALL)
    assert refused(other, WALL + 60.001) is Refused.OLD
    assert refused(other, WALL + 59.999) is None
    for link in range(10, 10 + 62):
        assert refused(Signing(KEY, link).sign(packed(HEARTBEAT), WALL)) is None
    assert refused(Signing(KEY, 100).sign(packed(HEARTBEAT), WALL)) is Refused.STREAMS


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
