"""Logs as other programs write them, of the example's flight: byte by byte, or by those programs' own libraries."""

import math
import struct
from collections.abc import Collection, Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import gpxpy.gpx
import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from flight.mission.items import Mission
from logs.importers.raw_log import RawLog, example_raw_log

BEGAN = datetime(2024, 3, 2, 10, 0, 0, tzinfo=UTC)
_SIZES = {"Q": 8, "i": 4, "L": 4, "f": 4, "B": 1, "H": 2, "I": 4, "h": 2, "c": 2, "N": 16, "Z": 64, "n": 4, "d": 8}
_CODES = {"L": "i", "c": "h", "N": "16s", "Z": "64s", "n": "4s"}


class DataflashWriter:
    """Writes messages as ArduPilot does: each format before its first message."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._types: dict[str, tuple[int, str]] = {}

    def message(self, name: str, letters: str, columns: str, *values: Any) -> None:
        if name not in self._types:
            number = 129 + len(self._types)
            self._types[name] = number, letters
            length = 3 + sum(_SIZES[letter] for letter in letters)
            body = struct.pack("<BB4s16s64s", number, length, name.encode(), letters.encode(), columns.encode())
            self.data += b"\xa3\x95\x80" + body
        number, known = self._types[name]
        packed = [value.encode() if isinstance(value, str) else value for value in values]
        packed = [
            round(value * 1e7) if letter == "L" else round(value * 100) if letter == "c" else value
            for letter, value in zip(known, packed, strict=True)
        ]
        code = "<" + "".join(_CODES.get(letter, letter) for letter in known)
        self.data += b"\xa3\x95" + bytes([number]) + struct.pack(code, *packed)


def dataflash(
    path: Path,
    log: RawLog | None = None,
    *,
    leave_out: Iterable[str] = (),
    program: str = "ArduPlane V4.5.0 (abcdef)",
    old: bool = False,
    modes: Sequence[tuple[float, int]] = ((20.0, 10),),
    with_frames: bool = True,
    without_items: Collection[int] = (),
) -> Path:
    """Write a log as a `.BIN`; old: with the names of messages and parameters of before 2016.

    without_items: numbers of items that are announced and not written.
    """
    raw = example_raw_log() if log is None else log
    out, left = DataflashWriter(), frozenset(leave_out)

    def put(name: str, letters: str, columns: str, *values: Any) -> None:
        if name not in left:
            out.message(name, letters, columns, *values)

    def us(seconds: float) -> int:
        return round(seconds * 1e6)

    put("MSG", "QZ", "TimeUS,Message", us(19.0), program)
    for name, value in raw.parameters.items():
        named = {"AIRSPEED_CRUISE": "TRIM_ARSPD_CM", "ROLL_LIMIT_DEG": "LIM_ROLL_CD"}.get(name, name) if old else name
        factor = 100.0 if named != name else 1.0
        put("PARM", "QNf", "TimeUS,Name,Value", us(19.0), named, value * factor)
    home = raw.missions[0].mission.home
    assert home is not None
    for row in _command_rows(raw, without_items):
        letters, columns = "QHHHffffLLf", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt"
        put("CMD", *((letters + "B", columns + ",Frame", *row) if with_frames else (letters, columns, *row[:-1])))
    ahead = [*modes]
    one, two = ("EKF1", "EKF2") if old else ("XKF1", "XKF2")
    series = {name: found.values for name, found in raw.series.items()}
    for k, time in enumerate(raw.series["position"].time.tolist()):
        while ahead and ahead[0][0] <= time:
            at, number = ahead.pop(0)
            put("MODE", "QBBB", "TimeUS,Mode,ModeNum,Rsn", us(at), number, number, 2)
        lat, lon, up = series["position"][k]
        east, north, rise = series["velocity"][k]
        roll, pitch, yaw = np.degrees(series["attitude"][k])
        put("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", us(time), lat, lon, up, up - home.alt)
        speed, course = math.hypot(east, north), math.degrees(math.atan2(east, north)) % 360.0
        gps = ("QBIHLLffff", "TimeUS,Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs,VZ")
        put("GPS", *gps, us(time), 3, 36_000_000 + round(time * 1e3), 2300, lat, lon, up + 0.5, speed, course, -rise)
        put("ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw", us(time), roll, pitch, 327.0 if yaw > 327.0 else yaw)
        put(one, "QBfff", "TimeUS,C,VN,VE,VD", us(time), 0, north, east, -rise)
        put(two, "QBff", "TimeUS,C,VWN,VWE", us(time), 0, -3.0, 0.0)
        put("ARSP", "QBfB", "TimeUS,I,Airspeed,U", us(time), 0, 24.4, 1)
        put("BAT", "Qffff", "TimeUS,Volt,Curr,CurrTot,EnrgTot", us(time), 24.0, 10.0, 10.0 * k, 0.2 * k)
        put("CTUN", "Qff", "TimeUS,ThO,E2T", us(time), 60.0, 1.0246)
    path.write_bytes(bytes(out.data))
    return path


def _command_rows(raw: RawLog, without: Collection[int]) -> list[tuple[Any, ...]]:
    """The values of CMD, the frame last: home, and the items of a mission."""
    mission = raw.missions[0].mission
    home = mission.home
    assert home is not None
    total = len(mission.items) + 1
    rows: list[tuple[Any, ...]] = [(0, 16, *(0.0,) * 4, home.lat_deg, home.lon_deg, home.alt, 0)]
    rows += [(it.seq, it.command, *it.params, it.lat_deg, it.lon_deg, it.alt, it.frame) for it in mission.items]
    return [(19_500_000, total, *row) for row in rows if row[0] not in without]


class _Sink:
    """What pymavlink writes to: packets as they come, with the time before each."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.stamp = 0.0

    def write(self, packet: bytes) -> None:
        self.data += struct.pack(">Q", round((BEGAN.timestamp() + self.stamp) * 1e6)) + packet


def telemetry(
    path: Path,
    log: RawLog | None = None,
    *,
    kind: int = 1,
    autopilot: int = 3,
    mode: int = 10,
    without_items: Collection[int] = (),
) -> Path:
    """Write a log as a `.tlog`, by pymavlink; without_items: numbers of items that are announced and not sent."""
    raw = example_raw_log() if log is None else log
    sink = _Sink()
    vehicle, station = dialect.MAVLink(sink, 1, 1), dialect.MAVLink(sink, 255, 190)
    mission = raw.missions[0].mission
    station.heartbeat_send(6, 8, 0, 0, 4)
    station.mission_count_send(1, 1, len(mission.items) + 1)
    home = mission.home
    assert home is not None
    place = round(home.lat_deg * 1e7), round(home.lon_deg * 1e7)
    if 0 not in without_items:
        station.mission_item_int_send(1, 1, 0, 0, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, *place, home.alt)
    for it in (one for one in mission.items if one.seq not in without_items):
        station.mission_item_int_send(1, 1, it.seq, it.frame, it.command, 0, 1, *it.params, it.x, it.y, it.alt)
    for name, value in raw.parameters.items():
        vehicle.param_value_send(name.encode(), value, 9, len(raw.parameters), 0)
    vehicle.statustext_send(6, b"ArduPlane V4.5.0 (abcdef)")
    for k, time in enumerate(raw.series["position"].time.tolist()):
        sink.stamp = time - 20.0
        millis = round(time * 1e3)
        lat, lon, up = raw.series["position"].values[k]
        east, north, rise = raw.series["velocity"].values[k]
        roll, pitch, yaw = raw.series["attitude"].values[k]
        speeds = [round(100.0 * value) for value in (north, east, -rise)]
        whole = round(lat * 1e7), round(lon * 1e7)
        vehicle.global_position_int_send(millis, *whole, round(up * 1e3), 100_000, *speeds, 0)
        vehicle.attitude_send(millis, roll, pitch, yaw, 0.0, 0.0, 0.0)
        if k % 5 == 0:
            vehicle.heartbeat_send(kind, autopilot, 81, mode, 4)
            vehicle.vfr_hud_send(24.4, 25.0, 0, 60, up, 0.0)
            vehicle.wind_send(0.0, 3.0, 0.0)
            vehicle.sys_status_send(0, 0, 0, 0, 24_000, 1000, 80, 0, 0, 0, 0, 0, 0)
    path.write_bytes(bytes(sink.data))
    return path


# The topics of a `.ulg`, and their fields.
_TOPICS = {
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
    "vehicle_local_position": "uint64_t timestamp;float vx;float vy;float vz;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "airspeed_validated": "uint64_t timestamp;float true_airspeed_m_s;",
    "wind": "uint64_t timestamp;float windspeed_north;float windspeed_east;",
    "vehicle_status": "uint64_t timestamp;uint8_t nav_state;uint8_t vehicle_type;",
    "navigator_mission_item": "uint64_t timestamp;uint16_t sequence_current;uint16_t nav_cmd;"
    "float acceptance_radius;double latitude;double longitude;float altitude;uint8_t altitude_is_relative;",
    "mission_result": "uint64_t timestamp;uint16_t seq_current;uint16_t seq_total;",
}
# Those of the mission, with numbers of 64 bits.
_WIDE_TOPICS = {
    name: _TOPICS[name].replace("uint16_t seq", "double seq") for name in ("navigator_mission_item", "mission_result")
}


def _mission_rows(
    mission: Mission, without_items: Collection[int], numbers_off: tuple[float, float]
) -> Iterator[tuple[Any, ...]]:
    """The name of a topic and its values behind the time, of a mission's length and of its items."""
    # Zero as a whole number, which alone fits a field of 16 bits.
    length, first = (off or 0 for off in numbers_off)
    yield "mission_result", 0, len(mission.items) + length
    for k, it in enumerate(one for one in mission.items if one.seq not in without_items):
        number = it.seq - 1 + (0 if k else first)
        yield "navigator_mission_item", number, 16, 0.0, it.lat_deg, it.lon_deg, it.alt, 0


def px4(
    path: Path,
    log: RawLog | None = None,
    *,
    vehicle_type: int = 2,
    nav_state: int = 3,
    without_items: Collection[int] = (),
    numbers_off: tuple[float, float] = (0.0, 0.0),
) -> Path:
    """Write a log as a `.ulg` (PX4, "ULog File Format"), byte by byte.

    without_items: numbers of items, from 1, that the mission has and the log does not hold.
    numbers_off: added to the mission's length and to its first item's number, whose fields are then of 64 bits.
    """
    raw = example_raw_log() if log is None else log
    topics = _TOPICS if numbers_off == (0.0, 0.0) else _TOPICS | _WIDE_TOPICS
    codes = {"uint64_t": "Q", "double": "d", "float": "f", "uint8_t": "B", "uint16_t": "H", "float[4]": "4f"}
    packers = {
        name: "<" + "".join(codes[field.split()[0]] for field in fields.rstrip(";").split(";"))
        for name, fields in topics.items()
    }
    numbers = {name: number for number, name in enumerate(topics)}
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 20_000_000))

    def record(letter: bytes, body: bytes) -> None:
        out.extend(struct.pack("<Hc", len(body), letter) + body)

    record(b"B", bytes(40))
    for name, fields in topics.items():
        record(b"F", f"{name}:{fields}".encode())
    key = b"char[3] sys_name"
    record(b"I", bytes([len(key)]) + key + b"PX4")
    for name, number in numbers.items():
        record(b"A", struct.pack("<BH", 0, number) + name.encode())

    def row(name: str, *values: Any) -> None:
        record(b"D", struct.pack("<H", numbers[name]) + struct.pack(packers[name], *values))

    for k, time in enumerate(raw.series["position"].time.tolist()):
        stamp = round(time * 1e6)
        lat, lon, up = raw.series["position"].values[k]
        east, north, rise = raw.series["velocity"].values[k]
        _, pitch, yaw = raw.series["attitude"].values[k]
        row("vehicle_global_position", stamp, lat, lon, up)
        row("vehicle_local_position", stamp, north, east, -rise)
        cp, sp, cy, sy = (f(0.5 * a) for a in (pitch, yaw) for f in (math.cos, math.sin))
        row("vehicle_attitude", stamp, cp * cy, -sp * sy, sp * cy, cp * sy)
        row("airspeed_validated", stamp, 25.0)
        row("wind", stamp, -3.0, 0.0)
        if k == 0:
            row("vehicle_status", stamp, nav_state, vehicle_type)
            for name, *values in _mission_rows(raw.missions[0].mission, without_items, numbers_off):
                row(name, stamp, *values)
    path.write_bytes(bytes(out))
    return path


def gpx(path: Path, log: RawLog | None = None, *, route: bool = True) -> Path:
    """Write a track as a `.gpx`, by gpxpy, at one point a second."""
    raw = example_raw_log() if log is None else log
    out = gpxpy.gpx.GPX()
    segment = gpxpy.gpx.GPXTrackSegment()
    for (lat, lon, up), time in _each_second(raw):
        segment.points.append(gpxpy.gpx.GPXTrackPoint(lat, lon, elevation=up, time=BEGAN + timedelta(seconds=time)))
    track = gpxpy.gpx.GPXTrack(name="example")
    track.segments.append(segment)
    out.tracks.append(track)
    if route:
        planned = gpxpy.gpx.GPXRoute(name="plan")
        for it in raw.missions[0].mission.items:
            planned.points.append(gpxpy.gpx.GPXRoutePoint(it.lat_deg, it.lon_deg, elevation=it.alt))
        out.routes.append(planned)
    path.write_text(out.to_xml(), encoding="utf-8")
    return path


def kml(path: Path, log: RawLog | None = None, *, mode: str = "absolute", in_turn: bool = False) -> Path:
    """Write a track as a `.kml` with `gx:Track`: all times before all places, or in turn."""
    raw = example_raw_log() if log is None else log
    whens, coords = [], []
    for (lat, lon, up), time in _each_second(raw):
        whens.append(f"<when>{(BEGAN + timedelta(seconds=time)).isoformat().replace('+00:00', 'Z')}</when>")
        coords.append(f"<gx:coord>{lon:.7f} {lat:.7f} {up:.2f}</gx:coord>")
    both = [text for pair in zip(whens, coords, strict=True) for text in pair] if in_turn else whens + coords
    path.write_text(
        '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">'
        f"<Document><Placemark><gx:Track><altitudeMode>{mode}</altitudeMode>{''.join(both)}</gx:Track>"
        "</Placemark></Document></kml>",
        encoding="utf-8",
    )
    return path


def igc(path: Path, log: RawLog | None = None, *, datum: str = "HFALGALTGPS:GEO", task: bool = True) -> Path:
    """Write a track as an `.igc`, with the mission as its declared task."""
    raw = example_raw_log() if log is None else log
    lines = ["AXXXplanfly", "HFDTE020324", "HFFTYFRTYPE:planfly,test", *([datum] if datum else [])]
    if task:
        places = [(it.lat_deg, it.lon_deg) for it in raw.missions[0].mission.items]
        lines.append("C020324100000000000000003")
        lines += [f"C{_igc_place(lat, lon)}TP" for lat, lon in (places[0], *places, places[-1])]
    for (lat, lon, up), time in _each_second(raw):
        clock = (BEGAN + timedelta(seconds=time)).strftime("%H%M%S")
        lines.append(f"B{clock}{_igc_place(lat, lon)}A{_igc_height(up - 30.0)}{_igc_height(up)}")
    path.write_text("\r\n".join([*lines, "GSIGNATURE"]) + "\r\n", encoding="ascii")
    return path


def _igc_height(up: float) -> str:
    return f"{round(up):05d}" if up >= 0.0 else f"-{round(-up):04d}"


def _igc_place(lat: float, lon: float) -> str:
    def part(value: float, digits: int, sides: str) -> str:
        thousandths = round(abs(value) * 60_000.0)
        side = sides[0] if value >= 0.0 else sides[1]
        return f"{thousandths // 60_000:0{digits}d}{thousandths % 60_000:05d}{side}"

    return part(lat, 2, "NS") + part(lon, 3, "EW")


def _each_second(raw: RawLog) -> list[tuple[tuple[float, float, float], float]]:
    series = raw.series["position"]
    time = series.time - series.time[0]
    rows = np.flatnonzero(np.isclose(time % 1.0, 0.0, atol=1e-6) | np.isclose(time % 1.0, 1.0, atol=1e-6))
    return [
        ((float(lat), float(lon), float(up)), round(float(t)))
        for (lat, lon, up), t in zip(series.values[rows], time[rows], strict=True)
    ]


def columns(path: Path, log: RawLog | None = None) -> Path:
    """Write a log as a CSV file with its table of columns, which is the path.

    Attitude and airspeed have the noise of a sensor, of a thousand-millionth.
    """
    raw = example_raw_log() if log is None else log
    time = raw.series["position"].time
    names = {
        "position": ("latitude", "longitude", "altitude"),
        "velocity": ("velocity_east", "velocity_north", "velocity_down"),
        "attitude": ("roll", "pitch", "yaw"),
        "airspeed": ("airspeed",),
        "wind": ("wind_east", "wind_north"),
        "throttle": ("throttle",),
    }
    units = {"latitude": "deg", "longitude": "deg", "altitude": "m", "throttle": "fraction"}
    units |= dict.fromkeys(("roll", "pitch", "yaw"), "rad")
    frames = {"velocity_down": "ENU", "airspeed": "true"}
    table = {
        name: values
        for series, quantities in names.items()
        for name, values in zip(quantities, raw.series[series].values.T, strict=True)
    }
    draw = np.random.default_rng(1)
    for name in ("roll", "pitch", "yaw", "airspeed"):
        table[name] = table[name] + 1e-9 * draw.standard_normal(len(time))
    file = path.with_name("columns.csv")
    rows = [",".join(("t", *table))]
    rows += [",".join(f"{value!r}" for value in row) for row in np.column_stack([time, *table.values()]).tolist()]
    file.write_text("\n".join(rows) + "\n")
    lines = [f'file = "{file.name}"', f'program = "{raw.program}"', "[clocks.main]", 'column = "t"', "[columns]"]
    for name in table:
        frame = f', frame = "{frames[name]}"' if name in frames else ""
        lines.append(f'{name} = {{ column = "{name}", unit = "{units.get(name, "m/s")}"{frame} }}')
    lines += ["[parameters]", *(f"{name} = {value}" for name, value in raw.parameters.items())]
    path.write_text("\n".join(lines) + "\n")
    return path
