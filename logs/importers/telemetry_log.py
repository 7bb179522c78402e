"""Read telemetry logs (`.tlog`) of ground stations, of ArduPlane or PX4, into a `RawLog`.

The packets are found and decoded, grouped by the sending system, and then converted.  The clock is the vehicle's
(`time_boot_ms`); messages without this time are placed by their time of reception.
"""

import math
import struct
from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.mission.items import Home, Mission, MissionItem, round_to_grid
from flight.simulation.setup import Damage
from logs.importers.clean_positions import remove_clock_jumps
from logs.importers.dataflash_frames import PIECE_BYTES, MappedFile
from logs.importers.logged_missions import (
    LoggedItem,
    combine_items,
    describe_plane_mode,
    describe_px4_mode,
    make_logged_mission,
    renumber_px4_items,
    without_gaps,
)
from logs.importers.raw_log import (
    HeightSource,
    LoggedMission,
    LogSeries,
    ModeChange,
    RawLog,
    VehicleKind,
    with_used_energy,
)
from world.arrays import Floats
from world.errors import LogError

# ----------------------------------------------------------------------
# Records of a telemetry log (`.tlog`): each is a time of eight bytes, and a MAVLink packet as it was received.
#
# MAVLink 1 packets begin with 0xFE, MAVLink 2 packets with 0xFD (mavlink.io, "Packet Serialization"); pymavlink
# decodes them and checks their checksums.  The time is in microseconds since 1970, big-endian (QGroundControl,
# MAVProxy).

_STAMP = struct.Struct(">Q")
# First byte of a MAVLink 1 packet.
_V1 = 0xFE
# First byte of a MAVLink 2 packet.
_V2 = 0xFD
# Bytes of a MAVLink 1 packet without its payload, including the checksum.
_V1_FRAME = 8
# Bytes of a MAVLink 2 packet without its payload, including the checksum.
_V2_FRAME = 12
# Bytes of the signature of a MAVLink 2 packet.
_SIGNATURE = 13
_SIGNED = 0x01
# Earliest valid time in a telemetry log: 2000, us since 1970.
_EARLIEST_US = 946_684_800_000_000
# Latest valid time in a telemetry log: 2100, us since 1970.
_LATEST_US = 4_102_444_800_000_000


@dataclass
class TelemetryReader:
    """The decoder of a log's messages; it decodes only wanted messages, and counts unreadable places.

    data: bytes of the log.
    wanted: numbers of the messages to decode.
    release_memory: function that releases the memory of the bytes read so far; called regularly.
    places, size: number of unreadable places, and their total size in bytes.
    cut: True if the log ends within a record.
    unreadable: number of wanted messages that could not be decoded.
    """

    data: memoryview
    wanted: frozenset[int]
    release_memory: Callable[[], None] = lambda: None
    places: int = 0
    size: int = 0
    cut: bool = False
    unreadable: int = 0
    _decoder: Any = field(default_factory=lambda: dialect.MAVLink(None))

    def messages(self) -> Iterator[tuple[float, Any]]:
        """Yield each wanted message with its time of reception, s since 1970, in the file's order."""
        position, end, is_in_record, piece_end = 0, len(self.data), True, PIECE_BYTES
        while position + _STAMP.size + _V1_FRAME <= end:
            if position >= piece_end:
                self.release_memory()
                piece_end = position + PIECE_BYTES
            # Length of the record, including its time, bytes; 0 if no record begins here.
            length, packet = 0, position + _STAMP.size
            stamp = _STAMP.unpack_from(self.data, position)[0]
            if _EARLIEST_US <= stamp <= _LATEST_US and self.data[packet] == _V1:
                length = _STAMP.size + _V1_FRAME + self.data[packet + 1]
            elif _EARLIEST_US <= stamp <= _LATEST_US and self.data[packet] == _V2:
                signature_size = _SIGNATURE if self.data[packet + 2] & _SIGNED else 0
                length = _STAMP.size + _V2_FRAME + self.data[packet + 1] + signature_size
            if length == 0:
                self.places += is_in_record
                self.size += 1
                position += 1
                is_in_record = False
                continue
            if position + length > end:
                self.cut = True
                break
            is_in_record = True
            # MAVLink 1 has the number in byte 5, MAVLink 2 in bytes 7 to 9.
            message_number = (
                self.data[packet + 5]
                if self.data[packet] == _V1
                else self.data[packet + 7] | self.data[packet + 8] << 8 | self.data[packet + 9] << 16
            )
            if message_number in self.wanted:
                payload = bytes(self.data[position + _STAMP.size : position + length])
                try:
                    message = self._decoder.decode(bytearray(payload))
                except Exception:  # of any kind: the library raises errors of struct, its own and plain ones
                    message = None
                if message is None:
                    self.unreadable += 1
                else:
                    yield stamp * 1e-6, message
            position += length

    def damage(self) -> Damage:
        """Return the damage found so far; all damage once `messages` has ended."""
        return Damage(self.places, self.size, self.cut, self.unreadable)


# ----------------------------------------------------------------------
# Messages of one system in a telemetry log: frequent numeric messages are kept as rows, so that a long log stays small.


# Messages that are sent many times a second, with those of their fields that are kept.
NUMBERS = {
    "GLOBAL_POSITION_INT": ("lat", "lon", "alt", "vx", "vy", "vz"),
    "ATTITUDE": ("roll", "pitch", "yaw"),
    "RAW_IMU": ("time_usec", "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"),
    "SERVO_OUTPUT_RAW": ("time_usec", "port", *(f"servo{k}_raw" for k in range(1, 15))),
    "VFR_HUD": ("airspeed", "groundspeed", "alt", "throttle"),
    "WIND": ("direction", "speed"),
    "WIND_COV": ("wind_x", "wind_y"),
    "GPS_RAW_INT": ("lat", "lon", "alt", "fix_type"),
    "SYS_STATUS": ("current_battery", "voltage_battery"),
    "BATTERY_STATUS": ("current_battery", "energy_consumed"),
}
# Value that marks a battery field as not measured (MAVLink, common.xml), by field.
NOT_MEASURED = {"voltage_battery": 65535.0, "current_battery": -1.0, "energy_consumed": -1.0}
# Largest number of messages that are kept of each name that is not in `NUMBERS`.
_MAX_MESSAGES = 200_000


class BootClock(NamedTuple):
    """The clock that starts when the vehicle is switched on.

    offset: UTC time at time 0 of this clock, s since 1970.
    jumps: times on this clock at which the vehicle was switched on again, s.
    time: time of each message on this clock, s, (n,).
    """

    offset: float
    jumps: tuple[float, ...]
    time: Floats


class SystemMessages:
    """The messages that one system sent, in the order of their reception."""

    def __init__(self) -> None:
        """Start without messages."""
        # Time of reception (s since 1970) and the vehicle's own time (s; NaN if not stated) of each message.
        self._stamps, self._boots = array("d"), array("d")
        self._rows: dict[str, array[float]] = {}
        self._named: dict[str, list[tuple[int, Any]]] = {}

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self._stamps)

    def add(self, stamp: float, message: Any) -> None:
        """Add a message; stamp: its time of reception, s since 1970.

        Of a name that is not in `NUMBERS`, only the first `_MAX_MESSAGES` are kept.
        """
        name, number = message.get_type(), len(self._stamps)
        boot = getattr(message, "time_boot_ms", None)
        self._stamps.append(stamp)
        self._boots.append(math.nan if boot is None else boot * 1e-3)
        fields = NUMBERS.get(name)
        if fields is None:
            messages = self._named.setdefault(name, [])
            if len(messages) < _MAX_MESSAGES:
                messages.append((number, message))
            return
        rows = self._rows.setdefault(name, array("d"))
        rows.append(number)
        rows.extend(float(getattr(message, field)) for field in fields)

    def table(self, name: str) -> Floats:
        """Return all messages with a name in `NUMBERS` as rows, (n, 1 + k).

        A row is the index among all messages, then the k fields.
        """
        rows = self._rows.get(name)
        return np.array(rows if rows is not None else [], dtype=np.float64).reshape(-1, 1 + len(NUMBERS[name]))

    def named(self, name: str) -> list[tuple[int, Any]]:
        """Return all messages with a name that is not in `NUMBERS`, each with its index among all messages."""
        return self._named.get(name, [])

    def boot_clock(self) -> BootClock:
        """Compute the vehicle's clock, and the time of each message on it.

        A message that does not state the vehicle's time gets the time of the nearest earlier message that does (or else
        of the first), plus the time between their receptions.  If no message states it, the clock starts at the first
        reception.
        """
        stamps, time = np.array(self._stamps), np.array(self._boots)
        known_rows = np.flatnonzero(np.isfinite(time))
        if not known_rows.size:
            offset = float(stamps[0]) if stamps.size else math.nan
            return BootClock(offset, (), stamps - offset)
        offset = float(stamps[known_rows[0]] - time[known_rows[0]])
        steady = remove_clock_jumps(time[known_rows])
        time[known_rows] = steady.time
        known_rows_before = known_rows[
            np.clip(np.searchsorted(known_rows, np.arange(time.size), side="right") - 1, 0, None)
        ]
        is_unknown = ~np.isfinite(time)
        time[is_unknown] = time[known_rows_before[is_unknown]] + (stamps - stamps[known_rows_before])[is_unknown]
        return BootClock(offset, steady.jumps, time)


FORMAT = "MAVLink telemetry log"
_KEPT_MESSAGES = ("HEARTBEAT", "PARAM_VALUE", "STATUSTEXT", "HOME_POSITION")
_MISSION_MESSAGES = ("MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_COUNT")
_WANTED_MESSAGES = frozenset((*_KEPT_MESSAGES, *_MISSION_MESSAGES, *NUMBERS))
_NUMBERS = frozenset(number for number, kind in dialect.mavlink_map.items() if kind.msgname in _WANTED_MESSAGES)
# Largest number of messages on missions that are kept: far more than a station sends.
_MAX_ITEMS = 200_000
# Kind of vehicle by MAV_TYPE; a type that is not listed is unknown.
_TYPES: dict[int, VehicleKind] = {
    1: "plane",
    16: "plane",
    19: "plane",
    20: "plane",
    21: "plane",
    22: "plane",
    23: "plane",
    24: "plane",
    25: "plane",
    2: "copter",
    3: "copter",
    4: "copter",
    13: "copter",
    14: "copter",
    15: "copter",
    29: "copter",
    35: "copter",
    5: "tracker",
    7: "blimp",
    10: "rover",
    11: "boat",
    12: "submarine",
}
# Values of MAV_TYPE of ground stations, onboard computers, gimbals, and receivers for other traffic.
_NO_VEHICLES = (6, 18, 26, 27)
_NOT_AUTOPILOTS = (8, 18)
_PX4 = 12
_NAMES = {3: "ArduPilot", _PX4: "PX4"}
_MISSION_TYPE = 0


def read_telemetry(path: Path) -> RawLog:
    """Read a telemetry log into a `RawLog`.

    Raises LogError for a log without a vehicle or without positions.
    """
    messages, damage = read_vehicle_messages(path)
    return messages.to_raw_log(damage)


def read_vehicle_messages(path: Path) -> tuple["VehicleMessages", Damage]:
    """Read the messages of the vehicle that sent the most messages.

    Return them and the damage of the file.

    Raises LogError for a log without a vehicle.
    """
    file = MappedFile(path)
    reader = TelemetryReader(memoryview(file.data), _NUMBERS, file.release_memory)  # type: ignore[arg-type]  # a buffer
    systems: dict[int, SystemMessages] = {}
    items: list[tuple[float, Any]] = []
    for stamp, message in reader.messages():
        systems.setdefault(message.get_srcSystem(), SystemMessages()).add(stamp, message)
        if message.get_type() in _MISSION_MESSAGES and len(items) < _MAX_ITEMS:
            items.append((stamp, message))
    vehicles = [
        messages
        for messages in systems.values()
        if any(_is_vehicle(heartbeat) for _, heartbeat in messages.named("HEARTBEAT"))
    ]
    if not vehicles:
        raise LogError(f"{path}: no HEARTBEAT of a vehicle: the kind of vehicle is unknown", file=path)
    # Of several vehicles take the one with the most messages.
    return VehicleMessages(max(vehicles, key=len), items, str(path)), reader.damage()


def _is_vehicle(message: Any) -> bool:
    """Return True if a HEARTBEAT message was sent by the autopilot of a vehicle."""
    return message.type not in _NO_VEHICLES and message.autopilot not in _NOT_AUTOPILOTS


class VehicleMessages:
    """The messages of one vehicle, with times on the vehicle's clock."""

    def __init__(self, messages: SystemMessages, items: list[tuple[float, Any]], source: str) -> None:
        """Convert the times of all messages to the vehicle's clock.

        messages: messages that the vehicle sent.
        items: messages on missions from all senders, each with its time of reception, s since 1970.
        source: path of the log.
        """
        self._source, self._messages = source, messages
        clock = messages.boot_clock()
        self._offset, self.jumps, self._times = clock.offset, clock.jumps, clock.time
        # Missions are sent to the vehicle: their messages come from the station.
        self._items = [(stamp - self._offset, message) for stamp, message in items]
        self._named_messages = {
            name: [(float(self._times[k]), message) for k, message in messages.named(name)] for name in _KEPT_MESSAGES
        }

    def to_raw_log(self, damage: Damage) -> RawLog:
        """Return the log with all data that a verdict needs.

        Raises LogError for a log without positions.
        """
        series = {name: log_series for name, log_series in self._read_series() if log_series is not None}
        heartbeats = [message for _, message in self._named_messages.get("HEARTBEAT", []) if _is_vehicle(message)]
        if "position" not in series:
            raise LogError(
                f"{self._source}: no GLOBAL_POSITION_INT or GPS_RAW_INT with a fix: the flown position is unknown",
                file=self._source,
            )
        parameters: dict[str, float] = {}
        for _, message in self._named_messages.get("PARAM_VALUE", []):
            name = _decode_text(message.param_id)
            if name and math.isfinite(message.param_value):
                parameters[name] = float(message.param_value)
        # Altitudes in the log other than the altitude of the position.
        heights = []
        gps = self._read_gps_position()
        if gps is not None and len(self._messages.table("GLOBAL_POSITION_INT")):
            gps_altitudes = LogSeries(gps.source, gps.time, gps.values[:, 2:])
            heights.append(HeightSource("GPS_RAW_INT.alt", "amsl", gps_altitudes))
        hud = self.table("VFR_HUD", ("alt",))
        if hud is not None:
            heights.append(HeightSource("VFR_HUD.alt", "amsl", hud))
        # Changes of the vehicle's mode, the first mode included.
        modes, last_mode = [], None
        for time, heartbeat in self._named_messages.get("HEARTBEAT", []):
            if _is_vehicle(heartbeat):
                describe_mode = describe_px4_mode if heartbeat.autopilot == _PX4 else describe_plane_mode
                mode = describe_mode(heartbeat.custom_mode)
                if mode != last_mode:
                    modes.append(ModeChange(time, *mode))
                    last_mode = mode
        # ArduPilot's start message names its version; other programs are named by their autopilot.
        texts = (_decode_text(message.text) for _, message in self._named_messages.get("STATUSTEXT", []))
        autopilot = _NAMES.get(heartbeats[0].autopilot, "")
        return RawLog(
            source=self._source,
            format=FORMAT,
            program=next((text for text in texts if "Ardu" in text and " V" in text), autopilot),
            vehicle=_TYPES.get(heartbeats[0].type, "unknown"),
            series=series,
            heights=tuple(heights),
            datum="amsl",
            modes=tuple(modes),
            missions=tuple(self._read_missions()),
            parameters=parameters,
            events=tuple(
                (time, _decode_text(message.text)) for time, message in self._named_messages.get("STATUSTEXT", [])
            ),
            utc_start=self._offset,
            clock_jumps=self.jumps,
            damage=damage,
        )

    def table(self, name: str, columns: Iterable[str]) -> LogSeries | None:
        """Return fields of a message as the columns of a series, in the units of the message.

        Return None if the message was never sent.

        name: name of the message, a key of `NUMBERS`.
        columns: names of the fields.
        """
        rows = self._messages.table(name)
        if not len(rows):
            return None
        column_numbers = [1 + NUMBERS[name].index(column) for column in columns]
        return LogSeries(name, self._times[rows[:, 0].astype(np.int64)], rows[:, column_numbers])

    def _read_series(self) -> Iterable[tuple[str, LogSeries | None]]:
        """Yield the name and the data of each series of a `RawLog`.

        A series that the log lacks is None, or is not yielded.
        """
        positions = self.table("GLOBAL_POSITION_INT", ("lat", "lon", "alt", "vy", "vx", "vz"))
        if positions is not None:
            is_known = (positions.values[:, :2] != 0.0).any(axis=1)
            positions = (
                LogSeries(positions.source, positions.time[is_known], positions.values[is_known])
                if is_known.any()
                else None
            )
        if positions is not None:
            # Sent in 1e-7 degrees, mm and cm/s.  Round to 1e-7 degrees, the resolution of the message.
            scaled = positions.values * np.array([1e-7, 1e-7, 1e-3, 0.01, 0.01, -0.01])
            scaled[:, :2] = np.round(scaled[:, :2], 7)
            yield "position", LogSeries(positions.source, positions.time, scaled[:, :3])
            yield "velocity", LogSeries(positions.source, positions.time, scaled[:, 3:])
        else:
            yield "position", self._read_gps_position()
        yield "attitude", self.table("ATTITUDE", ("roll", "pitch", "yaw"))
        wind = self.table("WIND", ("direction", "speed"))
        if wind is not None and np.any(wind.values[:, 1]):
            # The direction is the direction from which the wind blows.
            course, speed = np.radians(wind.values[:, 0]), wind.values[:, 1]
            velocity = np.stack([-speed * np.sin(course), -speed * np.cos(course)], axis=1)
            yield "wind", LogSeries("WIND", wind.time, velocity)
        else:
            wind = self.table("WIND_COV", ("wind_y", "wind_x"))
            yield "wind", wind if wind is not None and np.any(wind.values) else None
        hud = self.table("VFR_HUD", ("airspeed", "alt", "throttle", "groundspeed"))
        if hud is not None:
            # Some vehicles without an airspeed sensor send the ground speed instead.
            sensed = np.any(hud.values[:, 0] > 0.0) and not np.array_equal(hud.values[:, 0], hud.values[:, 3])
            if sensed:
                up = np.clip(hud.values[:, 1], -500.0, 20_000.0)
                ratio = np.array([eas_to_tas_ratio(float(height)) for height in up])
                yield "airspeed", LogSeries("VFR_HUD", hud.time, hud.values[:, :1] * ratio[:, None])
            yield "throttle", LogSeries("VFR_HUD", hud.time, hud.values[:, 2:3] * 0.01)
        table = self._read_measured_table("BATTERY_STATUS", ("current_battery", "energy_consumed"))
        if table is not None and np.any(table.values[:, 1] > 0.0):
            # The current is sent in units of 10 mA, and the energy in hectojoules, of which 36 are 1 Wh.
            current = np.maximum(table.values[:, 0] * 0.01, 0.0)
            values = np.stack([current, table.values[:, 1] / 36.0], axis=1)
            yield "battery", LogSeries(table.source, table.time, values)
        else:
            battery = self.battery()
            yield "battery", None if battery is None else with_used_energy(battery)

    def _read_gps_position(self) -> LogSeries | None:
        """Return the GPS positions with a 3-D fix: latitude and longitude (degrees) and altitude (m), (n, 3).

        Return None if the receiver never had a fix.
        """
        table = self.table("GPS_RAW_INT", ("lat", "lon", "alt", "fix_type"))
        if table is None:
            return None
        has_fix = table.values[:, 3] >= 3
        if not has_fix.any():
            return None
        scaled = np.round(table.values[has_fix, :3] * np.array([1e-7, 1e-7, 1e-3]), 7)
        return LogSeries("GPS_RAW_INT", table.time[has_fix], scaled)

    def battery(self) -> LogSeries | None:
        """Return the battery's voltage (V) and current (A), (n, 2); None if the current was not measured."""
        table = self._read_measured_table("SYS_STATUS", ("voltage_battery", "current_battery"))
        if table is None or not np.any(table.values[:, 1] > 0.0):
            return None
        return LogSeries(table.source, table.time, table.values * np.array([1e-3, 0.01]))

    def _read_measured_table(self, name: str, columns: tuple[str, ...]) -> LogSeries | None:
        """Return fields of a battery message in those rows in which all were measured; None if there are none."""
        table = self.table(name, columns)
        if table is None:
            return None
        is_measured = np.all([table.values[:, k] != NOT_MEASURED[column] for k, column in enumerate(columns)], axis=0)
        return LogSeries(name, table.time[is_measured], table.values[is_measured]) if is_measured.any() else None

    def _read_missions(self) -> Iterable[LoggedMission]:
        """Yield the missions that were uploaded or downloaded, in the order of time.

        The last home that the vehicle reported replaces the home of a mission.
        """
        rows: list[LoggedItem] = []
        total, begins_mission = 0, False
        for time, message in self._items:
            kind = message.get_type()
            if getattr(message, "mission_type", _MISSION_TYPE) != _MISSION_TYPE:
                continue
            if kind == "MISSION_COUNT":
                total, begins_mission = message.count, True
            elif kind in ("MISSION_ITEM", "MISSION_ITEM_INT"):
                # In a MISSION_ITEM_INT, latitude and longitude are integers of 1e-7 degrees.
                degrees = 1e-7 if kind == "MISSION_ITEM_INT" else 1.0
                params = (float(message.param1), float(message.param2), float(message.param3), float(message.param4))
                position = round_to_grid(message.x * degrees), round_to_grid(message.y * degrees), round(message.z, 6)
                item = MissionItem(int(message.seq), int(message.command), int(message.frame), params, *position)
                rows.append(LoggedItem(time, total, item, begins_mission))
                begins_mission = False
        for logged in combine_items(rows):
            if self.is_px4:
                # Items of PX4 are numbered from 0 and contain no home.
                items = renumber_px4_items(logged.items)
                px4_mission = Mission(home=None, items=items, source=f"{self._source}: mission items")
                end = max(logged.total, items[-1].seq)
                mission = without_gaps(LoggedMission(logged.time, px4_mission, "mission items"), logged.total, end)
            else:
                mission = make_logged_mission(logged, self._source, "mission items")
            if mission is not None:
                # The home in an uploaded mission is only an assumption of the ground station; the last home that the
                # vehicle reported replaces it.
                reports = [
                    message
                    for _, message in self._named_messages["HOME_POSITION"]
                    if message.latitude or message.longitude
                ]
                mission_with_home = mission.mission
                if reports:
                    report = reports[-1]
                    home = Home(report.latitude * 1e-7, report.longitude * 1e-7, report.altitude * 1e-3)
                    mission_with_home = Mission(
                        home, mission.mission.items, warnings=mission.mission.warnings, source=mission.mission.source
                    )
                yield replace(mission, mission=mission_with_home)

    def mode_numbers(self) -> Iterator[tuple[float, int]]:
        """Yield the time (s) and the autopilot's mode number of each heartbeat of the vehicle."""
        for time, heartbeat in self._named_messages.get("HEARTBEAT", []):
            if _is_vehicle(heartbeat):
                yield time, int(heartbeat.custom_mode)

    @property
    def is_px4(self) -> bool:
        """True if the vehicle's autopilot is PX4."""
        return any(
            heartbeat.autopilot == _PX4 for _, heartbeat in self._named_messages["HEARTBEAT"] if _is_vehicle(heartbeat)
        )


def _decode_text(value: str | bytes) -> str:
    """Decode a text field up to its first zero byte, without surrounding spaces."""
    text = value.decode("latin-1") if isinstance(value, bytes) else value
    return text.partition("\0")[0].strip()
