"""ArduPilot's JSON physics interface: the packets that pass between an autopilot and the physics it flies in.

The autopilot sends the state of its servo outputs as a binary datagram, and waits for one JSON object about the
aircraft a step later; so both keep step.  Published by ArduPilot as "JSON interface" for software in the loop
(https://github.com/ArduPilot/ardupilot/tree/master/libraries/SITL/examples/JSON).
"""

import math
import struct
from typing import NamedTuple

from world.errors import FlightError

# The first number of a packet, by how many outputs it carries.
MAGIC = {18458: 16, 29569: 32}
_HEAD = struct.Struct("<HHI")
_OUTPUTS = {magic: struct.Struct(f"<HHI{count}H") for magic, count in MAGIC.items()}

# Metres that ArduPilot counts for a degree of latitude: it knows the Earth as a sphere.
METRES_A_DEGREE = 111318.845
_METRES_A_RADIAN = math.degrees(METRES_A_DEGREE)

# The parser looks for each key as it stands here: no blanks.
_ANSWER = (
    b'\n{"timestamp":%.6f,"imu":{"gyro":[%.7f,%.7f,%.7f],"accel_body":[%.6f,%.6f,%.6f]},'
    b'"position":[%.4f,%.4f,%.4f],"attitude":[%.7f,%.7f,%.7f],"velocity":[%.5f,%.5f,%.5f],"airspeed":%.5f}\n'
)


class ServoPacket(NamedTuple):
    """What the autopilot asks for: the number of its frame, and the pulse of each output, microseconds."""

    frame: int
    pulses: tuple[int, ...]


class BodyMotion(NamedTuple):
    """The aircraft as the autopilot's sensors are to measure it.

    time: s.  roll_rate..yaw_rate: rad/s about the body's axes.
    force_x..force_z: specific force along the body's axes, m/s^2; at rest 0, 0, -9.81.
    north, east, down: m from the place that ArduPilot calls home, on its sphere.
    roll, pitch, yaw: rad, from true north.  velocity_*: m/s over the ground.
    airspeed: m/s, true.
    """

    time: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    force_x: float
    force_y: float
    force_z: float
    north: float
    east: float
    down: float
    roll: float
    pitch: float
    yaw: float
    velocity_north: float
    velocity_east: float
    velocity_down: float
    airspeed: float


def parse_servo_packet(data: bytes) -> ServoPacket:
    """The servo outputs in a datagram.  Raises FlightError for one of another version of the interface.

    >>> packet = parse_servo_packet(struct.pack("<HHI16H", 18458, 120, 7, *range(1500, 1516)))
    >>> packet.frame, packet.pulses[:2], len(packet.pulses)
    (7, (1500, 1501), 16)
    """
    magic = int.from_bytes(data[:2], "little")
    form = _OUTPUTS.get(magic)
    if form is None or len(data) != form.size:
        allowed = " or ".join(f"{known} with {count} outputs" for known, count in MAGIC.items())
        raise FlightError(
            f"speaks another version of the physics interface: a packet of {len(data)} bytes that begins with {magic};"
            f" allowed: {allowed}",
            field="packet", value=magic, allowed=allowed,
        )  # fmt: skip
    numbers = form.unpack(data)
    return ServoPacket(numbers[2], numbers[3:])


def encode_motion(motion: BodyMotion | tuple[float, ...]) -> bytes:
    r"""The datagram that tells the autopilot how the aircraft moves.

    >>> encode_motion(BodyMotion(0.5, *[0.0] * 5, -9.81, *[0.0] * 9, 25.0))[:44]
    b'\n{"timestamp":0.500000,"imu":{"gyro":[0.0000'
    """
    return _ANSWER % motion


def offset_on_sphere(lat: float, lon: float, from_lat: float, from_lon: float) -> tuple[float, float]:
    """North and east (m) of a position from another, all in rad, as ArduPilot takes it back to degrees.

    >>> north, east = offset_on_sphere(math.radians(36.01), -1.5, math.radians(36.0), -1.5)
    >>> round(north, 3), east
    (1113.188, 0.0)
    """
    east = math.remainder(lon - from_lon, 2.0 * math.pi) * math.cos(0.5 * (lat + from_lat))
    return (lat - from_lat) * _METRES_A_RADIAN, east * _METRES_A_RADIAN
