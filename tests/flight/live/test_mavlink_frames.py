"""Frames in datagrams: whole ones are found, damaged ones skipped."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.mavlink_frames import LARGEST, split_frames
from tests.flight.live.fake_vehicle import HEARTBEAT, packed


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
    assert split_frames(bytes([0xFD]) * LARGEST) == []
