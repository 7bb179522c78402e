"""The packets of ArduPilot's JSON physics interface: what is read, what is written, and positions on its sphere."""

import json
import math
import re
import struct

import pytest

from flight.real_autopilot.json_physics import (
    METRES_A_DEGREE,
    BodyMotion,
    encode_motion,
    offset_on_sphere,
    parse_servo_packet,
)
from world.errors import FlightError

MOTION = BodyMotion(
    12.5, 0.01, -0.02, 0.03, 0.5, -0.25, -9.8, 100.25, -200.5, -30.125, 0.1, -0.05, 1.5, 24.0, -3.5, 0.75, 25.5
)


@pytest.mark.parametrize(("magic", "count"), [(18458, 16), (29569, 32)])
def test_a_packet_holds_its_frame_and_its_outputs(magic: int, count: int) -> None:
    data = magic.to_bytes(2, "little") + (120).to_bytes(2, "little") + (70_000).to_bytes(4, "little")
    data += b"".join((1000 + k).to_bytes(2, "little") for k in range(count))
    packet = parse_servo_packet(data)
    assert (packet.frame, packet.pulses) == (70_000, tuple(range(1000, 1000 + count)))


@pytest.mark.parametrize(
    "data",
    [b"", b"\x1a", struct.pack("<HHI16H", 4711, 120, 1, *[0] * 16), struct.pack("<HHI15H", 18458, 120, 1, *[0] * 15)],
)
def test_any_other_packet_is_of_another_version(data: bytes) -> None:
    with pytest.raises(
        FlightError, match=r"speaks another version of the physics interface: a packet of .* allowed: 18458"
    ):
        parse_servo_packet(data)


def test_an_answer_is_one_json_object_between_line_ends() -> None:
    data = encode_motion(MOTION)
    assert data[:1] + data[-1:] == b"\n\n"
    assert data.count(b"\n") == 2
    # The autopilot looks for keys and brackets as text.
    assert b" " not in data
    assert json.loads(data) == {
        "timestamp": 12.5,
        "imu": {"gyro": [0.01, -0.02, 0.03], "accel_body": [0.5, -0.25, -9.8]},
        "position": [100.25, -200.5, -30.125],
        "attitude": [0.1, -0.05, 1.5],
        "velocity": [24.0, -3.5, 0.75],
        "airspeed": 25.5,
    }


def test_small_numbers_keep_their_form() -> None:
    assert re.search(rb"\de", encode_motion(BodyMotion(*[1e-9] * 17))) is None


def test_a_degree_is_as_long_as_on_ardupilots_sphere() -> None:
    lat, lon = math.radians(36.5), math.radians(-84.0)
    north, east = offset_on_sphere(lat + math.radians(1.0), lon, lat, lon)
    assert (north, east) == pytest.approx((METRES_A_DEGREE, 0.0))
    # East at the latitude half way.
    north, east = offset_on_sphere(lat + math.radians(1.0), lon + math.radians(1.0), lat, lon)
    assert (north, east) == pytest.approx((111318.845, 111318.845 * math.cos(math.radians(37.0))))


def test_an_offset_crosses_the_180th_meridian() -> None:
    _, east = offset_on_sphere(0.0, math.radians(-179.9), 0.0, math.radians(179.9))
    assert east == pytest.approx(0.2 * METRES_A_DEGREE)
