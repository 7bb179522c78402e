"""Export a flight to formats of other programs: a table (`.csv`, `.parquet`) and a PX4 log (`.ulg`)."""

import csv
import io
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import OVER_HOME, MissionItem
from flight.simulation.track import PITCH, ROLL, THROTTLE, YAW
from logs.recording.reader import FlightLog
from logs.recording.state_channel import FIELDS
from world.arrays import Floats
from world.extras import require_extra
from world.frames import to_geo

Columns = NDArray[Any]


# ----------------------------------------------------------------------
# The flown rows as a table for spreadsheets and data frames: `.csv`, and `.parquet` if pyarrow is installed.


def make_flight_columns(log: FlightLog) -> dict[str, NDArray[Any]]:
    """Return the recorded quantities of a flight, each as a column (t,) keyed by its name.

    They are the fields of the channel `/state`, and latitude and longitude.  Names end with the unit.  East, north and
    courses refer to the map projection centred on the scenario's origin.

    >>> from logs.recording.example_log import example_log
    >>> columns = make_flight_columns(example_log())
    >>> list(columns)[:6], len(columns["time_s"])
    (['time_s', 'latitude_deg', 'longitude_deg', 'east_m', 'north_m', 'up_amsl_m'], 366)
    """
    track = log.track
    lat, lon = to_geo(log.setup.scenario.origin, track.position[:, 0], track.position[:, 1])
    columns: dict[str, NDArray[Any]] = {}
    for field in FIELDS:
        columns[field.name] = field.select(getattr(track, field.source))
        if field.name == "time_s":
            columns["latitude_deg"], columns["longitude_deg"] = np.asarray(lat), np.asarray(lon)
    return columns


def csv_text(log: FlightLog) -> str:
    """Return the columns of `make_flight_columns` as CSV text: a line of names, then one line per row.

    Numbers have the fewest digits from which the same value can be read back.

    >>> from logs.recording.example_log import example_log
    >>> csv_text(example_log()).splitlines()[1].split(",")[:6]
    ['0.0', '45.99999981773182', '7.993545330437746', '-500.0', '0.0', '200.0']
    """
    columns = make_flight_columns(log)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    # Write the shortest digits of a float32: as a double it would have sixteen.
    writer.writerows(zip(*(column.astype(np.str_).tolist() for column in columns.values()), strict=True))
    return out.getvalue()


def parquet_bytes(log: FlightLog) -> bytes:
    """Encode the columns of `make_flight_columns` as a Parquet file.

    Its metadata are the scenario's name and origin, and how the flight ended.  Raises MissingExtraError if the extra
    ``tables`` is not installed.

    >>> from logs.recording.example_log import example_log
    >>> parquet_bytes(example_log())[:4]
    b'PAR1'
    """
    require_extra("tables", ".parquet needs")
    import pyarrow as pa
    from pyarrow import parquet

    scenario = log.setup.scenario
    metadata = {
        "planfly.scenario": scenario.name,
        "planfly.origin_lat_deg": repr(scenario.origin.lat_deg),
        "planfly.origin_lon_deg": repr(scenario.origin.lon_deg),
        "planfly.ended": log.ended or "",
    }
    table = pa.table(make_flight_columns(log)).replace_schema_metadata(metadata)
    buffer = io.BytesIO()
    parquet.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


def battery_voltage(log: FlightLog) -> float:
    """Return the battery voltage of a flight, which is constant in the model, V.

    If the aircraft does not define it, return the mean voltage: logged energy divided by logged charge.  NaN if no
    charge was drawn.

    >>> from logs.recording.example_log import example_log
    >>> round(battery_voltage(example_log()), 3)  # 5 A and 180 W
    36.0
    """
    if log.setup.envelope.volts > 0.0:
        return log.setup.envelope.volts
    track = log.track
    charge = float(np.sum(np.diff(track.time) * track.current[1:].astype(np.float64)))  # As
    return float(track.energy[-1] - track.energy[0]) * 3600.0 / charge if charge > 0.0 else np.nan


# ----------------------------------------------------------------------
# A flight as a PX4 log (`.ulg`): topics and fields as in PX4's "ULog File Format", which pyulog cannot write from
# scratch.
#
# Local positions are north, east and down from the scenario's origin (in PX4 from its own origin); the attitude rotates
# from these axes to forward, right and down.  Timestamps are microseconds since the start of the flight.


# Magic and version at the start of a ULog file.
_MAGIC = b"ULog\x01\x12\x35\x01"
# Size of the message with the flags, bytes.
_FLAG_BITS_SIZE_BYTES = 40
# ULog type by numpy type.
_TYPES = {"<u8": "uint64_t", "<f8": "double", "<f4": "float", "u1": "uint8_t", "<u2": "uint16_t", "?": "bool"}
# Letters of log levels, as in syslog.
_LEVELS = {"debug": b"7", "info": b"6", "warning": b"4", "error": b"3", "fatal": b"2"}
# vehicle_status: armed.
_ARMED = 2
# vehicle_status: flying a mission.
_MISSION = 3
# vehicle_status: fixed wing.
_FIXED_WING = 2
# Interval of topics with a message for every row, s.
_EVERY_ROW_INTERVAL_S = 0.0
# Interval of slower topics, s.
_SLOW_INTERVAL_S = 0.1
# Interval of topics with one message a second, s.
_LONG_INTERVAL_S = 1.0
# Standard atmosphere: the ratio of air density to density at sea level is (1 - lapse h) ** power; 1/m.
_DENSITY_LAPSE_PER_M = 2.25577e-5
# The exponent, power, in the formula above.
_DENSITY_EXPONENT = 4.2559


class _Topic(NamedTuple):
    """A ULog topic.

    name: name of the topic.
    period: interval of its messages, s; 0 for a message for each row.
    fields: each field after the timestamp: its name, its numpy type and, for an array, its length.
    values: values of the timestamp and of each field in all rows, keyed by field name.
    """

    name: str
    period: float
    fields: list[tuple[Any, ...]]
    values: dict[str, Columns]


def px4_log_bytes(log: FlightLog) -> bytes:
    r"""Encode a flight as a PX4 log file (`.ulg`); rows without a position or an attitude are omitted.

    >>> from logs.recording.example_log import example_log
    >>> px4_log_bytes(example_log())[:7]
    b'ULog\x01\x125'
    """
    is_finite = np.isfinite(log.track.position).all(axis=1) & np.isfinite(log.track.attitude).all(axis=1)
    topics = [topic for topic in _make_topics(log, np.flatnonzero(is_finite)) if len(topic.values["timestamp"])]
    head = bytearray(_MAGIC + struct.pack("<Q", 0) + _encode_message(b"B", bytes(_FLAG_BITS_SIZE_BYTES)))
    for topic in topics:
        fields = "".join(
            f"{_TYPES[kind]}{f'[{shape[0]}]' if shape else ''} {name};"
            for name, kind, *shape in [("timestamp", "<u8"), *topic.fields]
        )
        head += _encode_message(b"F", f"{topic.name}:{fields}".encode())
    for key, value in (("sys_name", "planfly"), ("ver_hw", "SITL"), ("sys_uuid", "planfly")):
        name = f"char[{len(value)}] {key}".encode()
        head += _encode_message(b"I", bytes([len(name)]) + name + value.encode())
    parameters = log.setup.autopilot.parameters
    for parameter in () if parameters is None else parameters.values:
        name = f"float {parameter.name}".encode()
        head += _encode_message(b"P", bytes([len(name)]) + name + struct.pack("<f", parameter.value))
    for number, topic in enumerate(topics):
        # Instance 0 of the topic, and its number in the data messages.
        head += _encode_message(b"A", struct.pack("<BH", 0, number) + topic.name.encode())
    stamps, messages = [], []
    for number, topic in enumerate(topics):
        # Data messages of the topic, at the topic's interval.
        topic_stamps = topic.values["timestamp"]
        recorded_rows = np.arange(len(topic_stamps))
        if topic.period:
            slots = np.floor(topic_stamps * 1e-6 / topic.period + 1e-9)
            recorded_rows = np.flatnonzero(np.diff(slots, prepend=-1.0) > 0.0)
        shapes = [(name, kind, *([(shape[0],)] if shape else [])) for name, kind, *shape in topic.fields]
        body_type = np.dtype([("timestamp", "<u8"), *shapes])
        message_type = np.dtype([("size", "<u2"), ("letter", "S1"), ("number", "<u2"), ("body", body_type)])
        records = np.zeros(len(recorded_rows), message_type)
        records["size"], records["letter"], records["number"] = body_type.itemsize + 2, b"D", number
        for field in body_type.names or ():
            records["body"][field] = topic.values[field][recorded_rows]
        data, size = records.tobytes(), message_type.itemsize
        stamps += topic_stamps[recorded_rows].tolist()
        messages += [data[start : start + size] for start in range(0, len(data), size)]
    for event in log.events:
        stamp = round(event.time * 1e6)
        body = _LEVELS.get(event.level, b"6") + struct.pack("<Q", stamp) + event.text.encode()
        stamps.append(stamp)
        messages.append(_encode_message(b"L", body))
    order = np.argsort(np.array(stamps, dtype=np.int64), kind="stable")
    return bytes(head) + b"".join(messages[k] for k in order.tolist())


def _encode_message(letter: bytes, body: bytes) -> bytes:
    """Encode one message of a ULog file: length of the content, letter of the type, and content."""
    return struct.pack("<H", len(body)) + letter + body


# Flags of vehicle_local_position.
_VALIDITY_FIELDS = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid", "xy_global", "z_global", "dist_bottom_valid")


def _make_topics(log: FlightLog, rows: NDArray[np.int64]) -> list[_Topic]:
    """Make all ULog topics of a flight from the given rows of its track, in PX4's axes and units."""
    track, origin = log.track, log.setup.scenario.origin
    stamp = np.rint(track.time[rows] * 1e6).astype(np.uint64)
    (east, north, up), (v_east, v_north, v_up) = track.position[rows].T, track.velocity[rows].T
    lat, lon = (np.asarray(values) for values in to_geo(origin, east, north))
    all_valid, ground_altitude = np.ones(len(rows), dtype=bool), up[0] if len(rows) else 0.0
    true_airspeed, height_above_ground = track.airspeed[rows].astype(np.float64), track.clearance[rows]
    calibrated_airspeed = true_airspeed * np.sqrt(np.maximum(1.0 - _DENSITY_LAPSE_PER_M * up, 0.0) ** _DENSITY_EXPONENT)
    wind, battery = track.wind[rows], _make_battery_values(log, rows)
    quaternions = compute_attitude_quaternion(track.attitude[rows])

    def make_topic(name: str, period: float, fields: list[tuple[Any, ...]], **values: Any) -> _Topic:
        """Make a topic with a value of each field, and the timestamp, for each row."""
        return _Topic(name, period, fields, {"timestamp": stamp, **values})

    topics = [
        make_topic("vehicle_attitude", _EVERY_ROW_INTERVAL_S, [("q", "<f4", 4)], q=quaternions),
        make_topic("vehicle_angular_velocity", _EVERY_ROW_INTERVAL_S, [("xyz", "<f4", 3)], xyz=track.rates[rows]),
        make_topic(
            "vehicle_local_position",
            _SLOW_INTERVAL_S,
            [
                *((name, "<f4") for name in ("x", "y", "z", "vx", "vy", "vz", "heading", "ref_alt", "dist_bottom")),
                ("ref_lat", "<f8"),
                ("ref_lon", "<f8"),
                ("ref_timestamp", "<u8"),
                *((name, "?") for name in _VALIDITY_FIELDS),
            ],
            x=north,
            y=east,
            z=ground_altitude - up,
            vx=v_north,
            vy=v_east,
            vz=-v_up,
            heading=track.attitude[rows, YAW],
            ref_alt=np.full(len(rows), ground_altitude),
            dist_bottom=height_above_ground,
            ref_lat=np.full(len(rows), origin.lat_deg),
            ref_lon=np.full(len(rows), origin.lon_deg),
            ref_timestamp=np.zeros(len(rows)),
            xy_valid=all_valid,
            z_valid=all_valid,
            v_xy_valid=all_valid,
            v_z_valid=all_valid,
            xy_global=all_valid,
            z_global=all_valid,
            dist_bottom_valid=np.isfinite(height_above_ground),
        ),
        make_topic(
            "vehicle_global_position",
            _SLOW_INTERVAL_S,
            [("lat", "<f8"), ("lon", "<f8"), ("alt", "<f4"), ("terrain_alt", "<f4"), ("terrain_alt_valid", "?")],
            lat=lat,
            lon=lon,
            alt=up,
            terrain_alt=up - height_above_ground,
            terrain_alt_valid=np.isfinite(height_above_ground),
        ),
        make_topic(
            "airspeed_validated",
            _SLOW_INTERVAL_S,
            [(f"{name}_airspeed_m_s", "<f4") for name in ("indicated", "calibrated", "true")],
            indicated_airspeed_m_s=calibrated_airspeed,
            calibrated_airspeed_m_s=calibrated_airspeed,
            true_airspeed_m_s=true_airspeed,
        ),
        make_topic(
            "wind",
            _SLOW_INTERVAL_S,
            [("windspeed_north", "<f4"), ("windspeed_east", "<f4")],
            windspeed_north=wind[:, 1],
            windspeed_east=wind[:, 0],
        ),
        make_topic(
            "vehicle_thrust_setpoint",
            _SLOW_INTERVAL_S,
            [("xyz", "<f4", 3)],
            xyz=track.commands[rows][:, [THROTTLE]] * np.array([1.0, 0.0, 0.0]),
        ),
        make_topic("battery_status", _SLOW_INTERVAL_S, [(name, "<f4") for name in battery], **battery),
        make_topic(
            "vehicle_status",
            _LONG_INTERVAL_S,
            [(name, "u1") for name in ("arming_state", "nav_state", "vehicle_type")],
            arming_state=_ARMED * all_valid,
            nav_state=_MISSION * all_valid,
            vehicle_type=_FIXED_WING * all_valid,
        ),
    ]
    return [*topics, _make_mission_item_topic(log, rows)]


def _make_battery_values(log: FlightLog, rows: NDArray[np.int64]) -> dict[str, Columns]:
    """Return the fields of PX4's topic battery_status, each as its values in the given rows of the track."""
    time, current = log.track.time[rows], log.track.current[rows].astype(np.float64)
    energy = log.track.energy[rows].astype(np.float64)
    charge = np.concatenate([[0.0], np.cumsum(np.diff(time) * current[1:])])[: len(rows)]  # As
    return {
        "voltage_v": np.full(len(rows), battery_voltage(log)),
        "current_a": current,
        "discharged_mah": charge / 3.6,
        "remaining": np.clip(1.0 - energy / log.setup.battery, 0.0, 1.0),
    }


def _make_mission_item_topic(log: FlightLog, rows: NDArray[np.int64]) -> _Topic:
    """Make the topic navigator_mission_item, with a message when each item becomes active.

    Items without a position get the time of the next item with a position, and the position 0, 0.  They are not
    omitted, because a gap in the numbers would look like lost items.

    rows: indices of the track's rows to include.
    """
    track, items = log.track, {item.seq: item for item in log.setup.mission.items}
    legs, first_rows = np.unique(track.leg[rows], return_index=True)
    targets = [(0.0, int(log.setup.route.items[0]))]
    targets += [
        (float(track.time[rows[first]]), int(log.setup.route.items[leg + 1]))
        for leg, first in zip(legs.tolist(), first_rows.tolist(), strict=True)
        if 0 <= leg < len(log.setup.route.items) - 1
    ]
    reached_targets = targets if len(rows) else []
    active_items: list[tuple[float, MissionItem]] = []
    for time, seq in reached_targets:
        if seq in items and items[seq].has_position:
            previous_seq = active_items[-1][1].seq if active_items else 0
            active_items += [(time, items[k]) for k in range(previous_seq + 1, seq) if k in items] + [
                (time, items[seq])
            ]
    radii = [item.params[1] for _, item in active_items]
    field_types = {
        "sequence_current": "<u2",
        "nav_cmd": "<u2",
        "acceptance_radius": "<f4",
        "latitude": "<f8",
        "longitude": "<f8",
        "altitude": "<f4",
        "altitude_is_relative": "u1",
    }
    values = {
        "timestamp": np.array([round(time * 1e6) for time, _ in active_items], dtype=np.uint64),
        # PX4 numbers mission items from 0.
        "sequence_current": np.array([item.seq - 1 for _, item in active_items]),
        "nav_cmd": np.array([item.command for _, item in active_items]),
        "acceptance_radius": np.nan_to_num(np.array(radii)),
        "latitude": np.nan_to_num(np.array([item.lat_deg for _, item in active_items])),
        "longitude": np.nan_to_num(np.array([item.lon_deg for _, item in active_items])),
        "altitude": np.nan_to_num(np.array([item.alt for _, item in active_items])),
        "altitude_is_relative": np.array([item.frame in OVER_HOME for _, item in active_items]),
    }
    return _Topic("navigator_mission_item", _EVERY_ROW_INTERVAL_S, list(field_types.items()), values)


def compute_attitude_quaternion(attitude: Any) -> Floats:
    """Convert roll, pitch and yaw to quaternions w, x, y, z, (n, 4).

    They rotate from the axes forward, right, down to the axes north, east, down.

    attitude: roll, pitch and yaw, rad, (n, 3).

    >>> compute_attitude_quaternion(np.array([[0.0, 0.0, np.pi]])).round(6).tolist()
    [[0.0, 0.0, 0.0, 1.0]]
    """
    half = 0.5 * np.asarray(attitude, dtype=np.float64)
    (cr, cp, cy), (sr, sp, sy) = ((f(half[:, ROLL]), f(half[:, PITCH]), f(half[:, YAW])) for f in (np.cos, np.sin))
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )
