"""Make the MAVLink telemetry messages of a state snapshot, and define their rates."""

import math
import struct
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.mission.items import Home
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import LocalMap
from flight.simulation.track import THROTTLE, TRACK_ROW
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo
from world.kernels import Record

# ----------------------------------------------------------------------
# State snapshot of a flight for ground stations, packed to pass between processes.


@dataclass(frozen=True, slots=True)
class Snapshot:
    """State of the aircraft at one time; SI and radians, north and east true, altitudes AMSL.

    height: height above ground, NaN if unknown.
    v_north, v_east, v_down: velocity over the ground.
    p, q, r: body rates.
    throttle: 0..1.
    wind_north, wind_east: velocity of the air.
    current: A.
    energy: Wh used.
    leg: the active leg, -1 before the start.
    """

    time: float
    lat_deg: float
    lon_deg: float
    amsl: float
    height: float
    v_north: float = 0.0
    v_east: float = 0.0
    v_down: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    p: float = 0.0
    q: float = 0.0
    r: float = 0.0
    airspeed: float = 0.0
    throttle: float = 0.0
    wind_north: float = 0.0
    wind_east: float = 0.0
    current: float = 0.0
    energy: float = 0.0
    leg: float = -1.0

    def pack(self) -> bytes:
        """Return the snapshot as a fixed number of bytes.

        >>> parked = Snapshot(time=0.0, lat_deg=46.0, lon_deg=8.0, amsl=500.0, height=100.0)
        >>> Snapshot.unpack(parked.pack()) == parked
        True
        """
        return _SNAPSHOT_FORMAT.pack(*astuple(self))

    @staticmethod
    def unpack(data: bytes) -> "Snapshot":
        """Return the snapshot that is packed in some bytes, as `pack` made them.

        Raises struct.error if the number of bytes is wrong.
        """
        return Snapshot(*_SNAPSHOT_FORMAT.unpack(data))

    @property
    def is_finite(self) -> bool:
        """True if all values are finite, so that they may be sent to stations.

        A flight may end with values that are not finite.
        """
        return all(math.isfinite(value) for value in astuple(replace(self, height=0.0)))


_SNAPSHOT_FORMAT = struct.Struct(f"<{len(fields(Snapshot))}d")


class SnapshotMaker:
    """Maker of snapshots from the rows of one flight.

    Positions are converted to latitude and longitude, and map vectors and courses to true ones.

    local_map: local map of the flight.
    """

    def __init__(self, setup: FlightSetup, local_map: LocalMap) -> None:
        self._origin: GeoOrigin = setup.scenario.origin
        self._map = local_map

    def start_snapshot(self, setup: FlightSetup) -> Snapshot:
        """Return the snapshot of an aircraft at rest at the route's start, on the course of its first leg."""
        points = setup.route.positions
        first_leg = points[1] - points[0]
        terrain = setup.scenario.terrain
        ground = math.nan if terrain is None else float(terrain.height(points[0, 0], points[0, 1]))
        row: Record = np.zeros(1, TRACK_ROW)[0]
        row.position = points[0]
        row.attitude[2] = math.atan2(first_leg[0], first_leg[1])
        row.clearance = points[0, 2] - ground
        row.leg = -1.0
        return self.snapshot(row)

    def snapshot(self, row: Record) -> Snapshot:
        """Return the snapshot of one row of the track, a record of `flight.simulation.track.TRACK_ROW`."""
        east, north, amsl = (float(value) for value in row.position)
        lat, lon = (float(value) for value in to_geo(self._origin, east, north))
        # A map course is the true course plus the convergence.
        convergence = self._map.convergence(lat, lon) if math.isfinite(lat) and math.isfinite(lon) else 0.0
        v_east, v_north, v_up = _rotate_to_true_north(row.velocity, convergence)
        wind_east, wind_north, _ = _rotate_to_true_north(row.wind, convergence)
        roll, pitch, yaw = (float(value) for value in row.attitude)
        p, q, r = (float(value) for value in row.rates)
        return Snapshot(
            time=float(row.time),
            lat_deg=lat,
            lon_deg=lon,
            amsl=amsl,
            height=float(row.clearance),
            v_north=v_north,
            v_east=v_east,
            v_down=-v_up,
            roll=roll,
            pitch=pitch,
            yaw=math.remainder(yaw - convergence, 2.0 * math.pi),
            p=p,
            q=q,
            r=r,
            airspeed=float(row.airspeed),
            throttle=float(row.controls[THROTTLE]),
            wind_north=wind_north,
            wind_east=wind_east,
            current=float(row.current),
            energy=float(row.energy),
            leg=float(row.leg),
        )


def _rotate_to_true_north(vector: Floats, convergence: float) -> tuple[float, float, float]:
    """Rotate a vector from the map's east, north and up to true east, north and up.

    convergence: grid convergence, the map course of true north, rad.
    """
    east, north, up = (float(value) for value in vector)
    cos, sin = math.cos(convergence), math.sin(convergence)
    return east * cos - north * sin, north * cos + east * sin, up


# ----------------------------------------------------------------------
# Texts for ground stations: one line with a MAV_SEVERITY, and the STATUSTEXT messages that carry it.

# MAV_SEVERITY of information.
INFO = 6
# MAV_SEVERITY of a notice.
NOTICE = 5
# MAV_SEVERITY of a warning.
WARNING = 4
# MAV_SEVERITY of a critical condition.
CRITICAL = 2
# Bytes of one STATUSTEXT.
_CHUNK_BYTES = 50
# Maximum bytes of a whole text.
_MAX_TEXT_BYTES = 400


class StatusText(NamedTuple):
    """A line of text for every station, with its MAV_SEVERITY."""

    text: str
    severity: int = INFO


def status_texts(text: str, severity: int, number: int) -> list[Any]:
    """Return the STATUSTEXT messages of a text, in pieces of 50 bytes that stations join again.

    severity: MAV_SEVERITY.
    number: 1..65535, new for each text.

    Ground stations show ASCII: a degree sign becomes " deg", and any other character "?". Bytes beyond 400 are omitted.

    >>> [message.text for message in status_texts("climb of 9° at leg 3", 4, 1)]
    ['climb of 9 deg at leg 3']
    >>> [(message.id, message.chunk_seq, len(message.text)) for message in status_texts("x" * 120, 6, 7)]
    [(7, 0, 50), (7, 1, 50), (7, 2, 20)]
    """
    data = text.replace("°", " deg").encode("ascii", "replace")[:_MAX_TEXT_BYTES]
    pieces = [data[start : start + _CHUNK_BYTES] for start in range(0, len(data), _CHUNK_BYTES)]
    if len(pieces) <= 1:
        return [mavlink.MAVLink_statustext_message(severity, data)]
    # A text ends with the first piece that is not full.
    if len(pieces[-1]) == _CHUNK_BYTES:
        pieces.append(b"")
    return [mavlink.MAVLink_statustext_message(severity, piece, number, index) for index, piece in enumerate(pieces)]


# ArduPlane's number for MANUAL (custom_mode of HEARTBEAT).
MANUAL = 0
# ArduPlane's number for AUTO.
AUTO = 10
# ArduPlane's number for RTL.
RTL = 11
# ArduPlane's number for LOITER.
LOITER = 12
# ArduPlane's number for GUIDED.
GUIDED = 15
MODE_NAMES = {MANUAL: "MANUAL", AUTO: "AUTO", RTL: "RTL", LOITER: "LOITER", GUIDED: "GUIDED"}

# MISSION_STATE of MISSION_CURRENT: no mission.
NO_MISSION = 1
# MISSION_STATE: a mission that was not started.
NOT_STARTED = 2
# MISSION_STATE: the mission is flown.
ACTIVE = 3
# MISSION_STATE: the mission is interrupted.
PAUSED = 4
# MISSION_STATE: the mission was completed.
COMPLETE = 5

_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_GEOFENCE
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
)
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
# Voltage of SYS_STATUS if no battery is measured, mV.
_NOT_MEASURED_MV = 65535
# Current of SYS_STATUS if no battery is measured, 0.01 A.
_NOT_MEASURED_CA = -1
_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
)
# ArduPlane version for ground stations: the vehicle follows ArduPlane's conventions (modes, home as item 0).
_VERSION = (4 << 24) | (5 << 16) | (0 << 8) | 255

# Default intervals between two messages of a kind, s; a station may set others, except for HEARTBEAT.
PERIODS: dict[str, float] = {
    "ATTITUDE": 1 / 30,
    "GLOBAL_POSITION_INT": 0.1,
    "VFR_HUD": 0.1,
    "MISSION_CURRENT": 0.5,
    "SYS_STATUS": 1.0,
    "GPS_RAW_INT": 0.5,
    "WIND": 1.0,
    "WIND_COV": 1.0,
    "EXTENDED_SYS_STATE": 1.0,
    "HOME_POSITION": 2.0,
}
# Messages of each MAV_DATA_STREAM of REQUEST_DATA_STREAM (as in ArduPilot).
STREAMS: dict[int, tuple[str, ...]] = {
    mavlink.MAV_DATA_STREAM_ALL: tuple(PERIODS),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: ("SYS_STATUS", "MISSION_CURRENT", "GPS_RAW_INT"),
    mavlink.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT",),
    mavlink.MAV_DATA_STREAM_EXTRA1: ("ATTITUDE",),
    mavlink.MAV_DATA_STREAM_EXTRA2: ("VFR_HUD",),
    mavlink.MAV_DATA_STREAM_EXTRA3: ("WIND", "WIND_COV", "EXTENDED_SYS_STATE", "HOME_POSITION"),
}


@dataclass(slots=True)
class Status:
    """State of the vehicle for `telemetry_message`.

    snapshot: state of the aircraft.
    home: reference of heights above home.
    boot, wall: s since the vehicle started, and since 1970.
    mode: ArduPlane's number.
    ready: True if the vehicle is armed, or if arming would be accepted.
    battery: energy of the full battery, Wh.
    volts: battery voltage, V; 0 or NaN if the aircraft has no battery or its voltage is unknown.
    load: busy fraction of the event loop's time.
    current: number of the current mission item.
    total: number of mission items without home.
    mission_state: MISSION_STATE of MISSION_CURRENT.
    """

    snapshot: Snapshot
    home: Home
    boot: float = 0.0
    wall: float = 0.0
    mode: int = MANUAL
    armed: bool = False
    flying: bool = False
    ready: bool = True
    battery: float = 1.0
    volts: float = 0.0
    load: float = 0.0
    current: int = 0
    total: int = 0
    mission_state: int = NO_MISSION


def heartbeat(status: Status) -> Any:
    """Return the HEARTBEAT of a fixed-wing aircraft, in ArduPilot's conventions.

    >>> parked = Snapshot(time=0.0, lat_deg=46.0, lon_deg=8.0, amsl=500.0, height=100.0)
    >>> message = heartbeat(Status(parked, Home(46.0, 8.0, 400.0), mode=AUTO, armed=True))
    >>> message.custom_mode, message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    (10, 128)
    """
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if status.mode == AUTO:
        base |= (
            mavlink.MAV_MODE_FLAG_AUTO_ENABLED
            | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
            | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        )
    elif status.flying:
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    if status.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    state = mavlink.MAV_STATE_ACTIVE if status.flying else mavlink.MAV_STATE_STANDBY
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, base, status.mode, state, 3
    )


def telemetry_message(name: str, status: Status) -> Any:
    """Return the MAVLink message of this name for a status, or None if the vehicle does not send it.

    name: one of `PERIODS`, HEARTBEAT, AUTOPILOT_VERSION or SYSTEM_TIME.

    >>> parked = Snapshot(time=0.0, lat_deg=46.0, lon_deg=8.0, amsl=500.0, height=100.0)
    >>> message = telemetry_message("GLOBAL_POSITION_INT", Status(parked, Home(46.0, 8.0, 400.0)))
    >>> message.lat, message.alt, message.relative_alt
    (460000000, 500000, 100000)
    """
    maker = _MESSAGE_MAKERS.get(name)
    return maker(status, status.snapshot) if maker else None


def _boot_ms(status: Status) -> int:
    """Return the time since the vehicle started, ms, as MAVLink carries it."""
    return int(status.boot * 1e3) & 0xFFFFFFFF


def _to_int16(value: float) -> int:
    """Return a rounded number, limited to the range of an int16."""
    return max(-32767, min(32767, round(value)))


def _to_degrees(angle: float) -> float:
    """Return an angle in rad as 0..360 degrees."""
    return math.degrees(angle) % 360.0


# Function that makes each message, from a status and its snapshot.
_MESSAGE_MAKERS: dict[str, Callable[[Status, Snapshot], Any]] = {
    "HEARTBEAT": lambda status, _: heartbeat(status),
    "ATTITUDE": lambda status, snapshot: mavlink.MAVLink_attitude_message(
        _boot_ms(status), snapshot.roll, snapshot.pitch, snapshot.yaw, snapshot.p, snapshot.q, snapshot.r
    ),
    "GLOBAL_POSITION_INT": lambda status, snapshot: mavlink.MAVLink_global_position_int_message(
        _boot_ms(status),
        round(snapshot.lat_deg * 1e7),
        round(snapshot.lon_deg * 1e7),
        round(snapshot.amsl * 1e3),
        round((snapshot.amsl - status.home.alt) * 1e3),
        _to_int16(snapshot.v_north * 100),
        _to_int16(snapshot.v_east * 100),
        _to_int16(snapshot.v_down * 100),
        round(_to_degrees(snapshot.yaw) * 100) % 36000,
    ),
    "VFR_HUD": lambda _, snapshot: mavlink.MAVLink_vfr_hud_message(
        snapshot.airspeed,
        math.hypot(snapshot.v_north, snapshot.v_east),
        int(_to_degrees(snapshot.yaw)),
        max(0, min(100, round(snapshot.throttle * 100))),
        snapshot.amsl,
        -snapshot.v_down,
    ),
    "MISSION_CURRENT": lambda status, _: mavlink.MAVLink_mission_current_message(
        status.current, status.total, status.mission_state, 0
    ),
    # The battery is measured if its voltage is known.
    "SYS_STATUS": lambda status, snapshot: mavlink.MAVLink_sys_status_message(
        _SENSORS | _PREARM,
        _SENSORS | _PREARM,
        _SENSORS | (_PREARM if status.ready else 0),
        min(1000, round(status.load * 1000)),
        min(round(status.volts * 1e3), _NOT_MEASURED_MV - 1) if status.volts > 0.0 else _NOT_MEASURED_MV,
        _to_int16(snapshot.current * 100) if status.volts > 0.0 else _NOT_MEASURED_CA,
        round(max(0.0, 1.0 - snapshot.energy / status.battery) * 100),
        0,
        0,
        0,
        0,
        0,
        0,
    ),
    "GPS_RAW_INT": lambda status, snapshot: mavlink.MAVLink_gps_raw_int_message(
        int(status.boot * 1e6),
        mavlink.GPS_FIX_TYPE_RTK_FIXED,
        round(snapshot.lat_deg * 1e7),
        round(snapshot.lon_deg * 1e7),
        round(snapshot.amsl * 1e3),
        50,
        80,
        min(65534, round(math.hypot(snapshot.v_north, snapshot.v_east) * 100)),
        round(_to_degrees(math.atan2(snapshot.v_east, snapshot.v_north)) * 100) % 36000,
        16,
    ),
    # The direction is that from which the wind blows.
    "WIND": lambda _, snapshot: mavlink.MAVLink_wind_message(
        math.degrees(math.atan2(-snapshot.wind_east, -snapshot.wind_north)),
        math.hypot(snapshot.wind_east, snapshot.wind_north),
        0.0,
    ),
    # The variabilities and the accuracies are not known.
    "WIND_COV": lambda status, snapshot: mavlink.MAVLink_wind_cov_message(
        int(status.boot * 1e6),
        snapshot.wind_north,
        snapshot.wind_east,
        0.0,
        math.nan,
        math.nan,
        snapshot.amsl,
        math.nan,
        math.nan,
    ),
    "EXTENDED_SYS_STATE": lambda status, _: mavlink.MAVLink_extended_sys_state_message(
        mavlink.MAV_VTOL_STATE_UNDEFINED,
        mavlink.MAV_LANDED_STATE_IN_AIR if status.flying else mavlink.MAV_LANDED_STATE_ON_GROUND,
    ),
    "HOME_POSITION": lambda status, _: mavlink.MAVLink_home_position_message(
        round(status.home.lat_deg * 1e7),
        round(status.home.lon_deg * 1e7),
        round(status.home.alt * 1e3),
        0.0,
        0.0,
        0.0,
        [1.0, 0.0, 0.0, 0.0],
        0.0,
        0.0,
        0.0,
        int(status.boot * 1e6),
    ),
    "AUTOPILOT_VERSION": lambda *_: mavlink.MAVLink_autopilot_version_message(
        _CAPABILITIES, _VERSION, 0, 0, 0, list(b"planfly\0"), [0] * 8, [0] * 8, 0, 0, 0x706C616E
    ),
    "SYSTEM_TIME": lambda status, _: mavlink.MAVLink_system_time_message(int(status.wall * 1e6), _boot_ms(status)),
}
