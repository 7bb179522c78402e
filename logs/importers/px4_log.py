"""Read PX4's logs (`.ulg`) into a `RawLog`.

pyulog reads the topics.  Damage is counted in this module, because pyulog only reports that there is some.  Names of
topics and fields follow PX4's message documentation of the current release and of older releases.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pyulog import ULog

from flight.mission.items import Home, Mission, MissionItem, item_problem, round_to_grid
from flight.simulation.setup import Damage
from logs.importers.dataflash_frames import MappedFile, iterate_piece_ends
from logs.importers.logged_missions import describe_px4_state, renumber_px4_items, without_gaps
from logs.importers.px4_formats import MessageFormats
from logs.importers.raw_log import (
    HeightSource,
    LoggedMission,
    LogSeries,
    ModeChange,
    RawLog,
    VehicleKind,
    with_used_energy,
)
from world.address_space import AddressSpaceError
from world.arrays import Bytes, Ints
from world.errors import LogError
from world.kernels import compiled, read_only
from world.silent_output import silence

FORMAT = "PX4 log"
# Bytes before the first record.
_HEADER = 16
# Letters of all types of records (PX4, "ULog File Format").
_LETTERS = b"BFIMPQARDLCSO"
# Topics with the wind, of which the first with rows is read: of the state estimator, of the airspeed selector (the only
# one in logs of PX4 1.12 and 1.13), and of releases before 1.12.
WIND_TOPICS = ("wind", "airspeed_wind", "wind_estimate")
# Current that marks a sample without a measurement, A (battery_status.msg).
CURRENT_NOT_MEASURED_A = -1.0
_TOPICS = [
    "vehicle_global_position",
    "vehicle_local_position",
    "vehicle_attitude",
    "airspeed_validated",
    "airspeed",
    *WIND_TOPICS,
    "battery_status",
    "vehicle_status",
    "navigator_mission_item",
    "vehicle_gps_position",
    "sensor_gps",
    "vehicle_air_data",
    "actuator_controls_0",
    "vehicle_thrust_setpoint",
    "home_position",
    "mission_result",
]
# Kind of vehicle by vehicle_status.vehicle_type.
_TYPES: dict[int, VehicleKind] = {1: "copter", 2: "plane", 3: "rover", 4: "blimp"}
_AMSL = 0
_OVER_HOME = 3
# Largest absolute latitude and longitude (degrees) and altitude (m) of a valid home.
_HOME_LIMITS = np.array([90.0, 180.0, 10_000.0])
# Largest number of an item, which has 16 bits.
_MAX_ITEMS = 65_535


def read_px4(path: Path) -> RawLog:
    """Read a PX4 log into a `RawLog`.

    Raises LogError for a log that pyulog cannot read, and for a log without positions.
    """
    return open_topics(path, _TOPICS).to_raw_log()


def open_topics(path: Path, names: list[str]) -> "Topics":
    """Read the topics of a log that have one of the given names.

    Raises LogError for a file that pyulog cannot read.
    """
    try:
        # pyulog prints errors on the terminal.
        with silence(), path.open("rb") as file:
            log = ULog(_FormatCheckingFile(file, str(path)), names, disable_str_exceptions=True)
    except (AddressSpaceError, LogError):
        raise
    except MemoryError:
        raise LogError(f"{path}: the size stated in the file does not fit into memory", file=path) from None
    except Exception as error:  # of any kind: the library raises errors of struct, its own and plain ones
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise LogError(f"{path}: not a readable PX4 log: {reason}", file=path) from error
    mapped_file = MappedFile(path)
    return Topics(log, str(path), find_damage(mapped_file.data, mapped_file.release_memory))


class _FormatCheckingFile:
    """A file from which pyulog reads.

    It checks the formats, and corrects pyulog's backward seeks after short reads.  pyulog steps back by the stated
    length of a record even if fewer bytes were read, and would read the end of a damaged file again and again.  This
    file steps back only by the bytes that were read.

    pyulog first reads the three bytes of a record's length and letter, and then its content.
    """

    def __init__(self, file: BinaryIO, source: str) -> None:
        """Read from an open file; source: its path, for messages."""
        self._file, self._missing, self._letter = file, 0, b""
        self._formats = MessageFormats(source)

    def read(self, size: int) -> bytes:
        """Read up to `size` bytes, and check the content of records with formats and topics.

        Raises LogError if the topics have too many fields.
        """
        data = self._file.read(size)
        self._missing = size - len(data)
        if self._letter == b"F":
            self._formats.add_format(data.decode("utf-8", "replace"))
        elif self._letter == b"A":
            # The name follows the topic's instance and number.
            self._formats.add_topic(data[3:].decode("utf-8", "replace"))
        self._letter = data[2:] if size == 3 and not self._letter else b""
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        """Change the position and return it.

        A relative seek is corrected by the bytes missing from the last read.
        """
        missing = self._missing if whence == 1 else 0
        self._missing = 0
        return self._file.seek(offset + missing, whence)

    def tell(self) -> int:
        """Return the position in the file, bytes."""
        return self._file.tell()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def find_damage(data: Bytes, release_memory: Callable[[], None] = lambda: None) -> Damage:
    """Count the damaged places and the lost bytes of a PX4 log.

    A log is a sequence of records, each with its length, the letter of its type, and its content.  Bytes that belong to
    no record with a known letter are damaged.  The last record may be cut.

    data: bytes of the log, (n,).
    release_memory: function that releases the memory of the bytes read so far; called regularly.

    >>> find_damage(np.zeros(20, np.uint8)).places
    1
    """
    state = np.zeros(5, np.int64)
    state[_NEXT_BYTE], state[_IS_READING] = _HEADER, 1
    for end in iterate_piece_ends(data.size, release_memory):
        _walk_records(read_only(data), end, state, np.frombuffer(_LETTERS, np.uint8))
    cut = bool(state[_IS_CUT]) or int(state[_NEXT_BYTE]) < data.size
    return Damage(int(state[_DAMAGED_PLACES]), int(state[_LOST_BYTES]), cut)


# Indices of the state of a walk over records.
# Number of the next byte.
_NEXT_BYTE = 0
# Number of damaged places, where no record begins.
_DAMAGED_PLACES = 1
# Number of bytes in damaged places.
_LOST_BYTES = 2
# 1 while records follow each other, 0 in a damaged place.
_IS_READING = 3
# 1 if the last record is cut.
_IS_CUT = 4


@compiled
def _walk_records(data: Bytes, stop: int, state: Ints, letters: Bytes) -> None:
    """Walk over the records that begin before byte `stop`, and count the damage in `state`.

    The walk goes from record to record by their lengths.  In a damaged place, where no valid record begins, it
    continues byte by byte to the next valid record.

    state: progress of the walk, indexed by `_NEXT_BYTE` and so on; the walk continues from it and updates it.
    letters: the known record types, one letter each.
    """
    is_known_letter = np.zeros(256, np.bool_)
    for letter in letters:
        is_known_letter[letter] = True
    k, damaged_places, lost_bytes, is_reading, is_cut = (
        state[_NEXT_BYTE],
        state[_DAMAGED_PLACES],
        state[_LOST_BYTES],
        state[_IS_READING],
        state[_IS_CUT],
    )
    while k + 3 <= data.size and k < stop and not is_cut:
        length = data[k] + 256 * data[k + 1]
        record_end = k + 3 + length
        if is_known_letter[data[k + 2]] and record_end > data.size:
            # Nothing can follow a cut record.
            is_cut = 1
            break
        is_followed = record_end + 3 > data.size or is_known_letter[data[record_end + 2]]
        if is_known_letter[data[k + 2]] and is_followed:
            k = record_end
            is_reading = 1
        else:
            damaged_places += is_reading
            is_reading = 0
            lost_bytes += 1
            k += 1
    state[_NEXT_BYTE], state[_DAMAGED_PLACES], state[_LOST_BYTES], state[_IS_READING], state[_IS_CUT] = (
        k,
        damaged_places,
        lost_bytes,
        is_reading,
        is_cut,
    )


def _read_instance_table(topic: str, data: dict[str, Any], choices: Iterable[tuple[str, ...]]) -> LogSeries | None:
    """Return fields of one instance of a topic as the columns of a series.

    Return None if the instance lacks them.

    topic: name of the topic, which becomes the source of the series.
    data: values of each field of the instance, keyed by field name; empty for a topic that the log lacks.
    choices: alternative groups of fields; the first group that the instance has in full is returned.
    """
    for columns in choices:
        if data and all(column in data for column in columns):
            values = np.stack([np.asarray(data[column], dtype=np.float64) for column in columns], axis=1)
            return LogSeries(topic, np.asarray(data["timestamp"], dtype=np.float64) * 1e-6, values)
    return None


class Topics:
    """The topics of one log: its messages, grouped by their name.

    A topic may have several instances, one for each sensor or battery.  Only the first instance is used, except for
    batteries, whose currents are added up.
    """

    def __init__(self, log: ULog, source: str, damage: Damage) -> None:
        """Collect the instances of each topic that have rows, in the order of their numbers.

        source: path of the log.
        damage: damage of the log's file.
        """
        self._log, self._source, self._damage = log, source, damage
        self._instances: dict[str, list[dict[str, Any]]] = {}
        for data in sorted(log.data_list, key=lambda data: int(data.multi_id)):
            if "timestamp" in data.data and len(data.data["timestamp"]):
                self._instances.setdefault(data.name, []).append(data.data)
        self._data = {name: instances[0] for name, instances in self._instances.items()}

    def to_raw_log(self) -> RawLog:
        """Return the log with all data that a verdict needs.

        Raises LogError for a log without positions.
        """
        position = self.table("vehicle_global_position", ("lat", "lon", "alt"), ("latitude", "longitude", "altitude"))
        gps = self._read_gps_position()
        velocity = self.table("vehicle_local_position", ("vy", "vx", "vz"))
        if velocity is None:
            velocity = self.table("vehicle_global_position", ("vel_e", "vel_n", "vel_d"))
        if velocity is not None:
            velocity = LogSeries(velocity.source, velocity.time, velocity.values * np.array([1.0, 1.0, -1.0]))
        winds = (self.table(topic, ("windspeed_east", "windspeed_north")) for topic in WIND_TOPICS)
        battery = self.battery()
        # An airspeed that is always 0 was not measured.
        airspeed = None
        for topic in ("airspeed_validated", "airspeed"):
            table = self.table(topic, ("true_airspeed_m_s",))
            if table is not None:
                is_finite = np.isfinite(table.values[:, 0])
                if np.any(table.values[is_finite]):
                    airspeed = LogSeries(topic, table.time[is_finite], table.values[is_finite])
                    break
        tables = {
            "position": position if position is not None else gps,
            "velocity": velocity,
            "attitude": self.attitude(),
            "airspeed": airspeed,
            "wind": next((wind for wind in winds if wind is not None and np.any(wind.values)), None),
            "battery": None if battery is None else with_used_energy(battery),
            "throttle": self.table("actuator_controls_0", ("control[3]",)),
        }
        series = {name: table for name, table in tables.items() if table is not None and len(table.time)}
        if "position" not in series:
            raise LogError(
                f"{self._source}: no vehicle_global_position: the flown position is unknown", file=self._source
            )
        # Altitudes in the log other than the altitude of the position.
        heights = []
        if gps is not None and "vehicle_global_position" in self._data:
            gps_altitudes = LogSeries(gps.source, gps.time, gps.values[:, 2:])
            heights.append(HeightSource(f"{gps.source}.alt", "amsl", gps_altitudes))
        baro = self.table("vehicle_air_data", ("baro_alt_meter",))
        if baro is not None:
            heights.append(HeightSource("vehicle_air_data.baro_alt_meter", "pressure", baro))
        # Changes of the navigation state, the first state included.
        modes, last_state = [], -1
        status = self._data.get("vehicle_status", {})
        for time, state in zip(status.get("timestamp", ()), status.get("nav_state", ()), strict=False):
            if state != last_state:
                modes.append(ModeChange(float(time) * 1e-6, *describe_px4_state(int(state))))
                last_state = state
        # UTC time at time 0 of the log's clock, s since 1970; NaN if no GPS time is logged.
        utc_start = math.nan
        for topic in ("vehicle_gps_position", "sensor_gps"):
            data = self._data.get(topic, {})
            stamps = np.asarray(data.get("time_utc_usec", ()), dtype=np.float64)
            valid_rows = np.flatnonzero(stamps > 0.0)
            if valid_rows.size:
                utc_start = float((stamps[valid_rows[0]] - float(data["timestamp"][valid_rows[0]])) * 1e-6)
                break
        return RawLog(
            source=self._source,
            format=FORMAT,
            program=self.program(),
            vehicle=self.vehicle(),
            series=series,
            heights=tuple(heights),
            datum="amsl",
            modes=tuple(modes),
            missions=tuple(self._read_missions()),
            parameters=self.parameters(),
            events=tuple((message.timestamp * 1e-6, str(message.message)) for message in self._log.logged_messages),
            utc_start=utc_start,
            damage=replace(self._damage, places=self._damage.places + len(self._log.dropouts)),
        )

    @property
    def source(self) -> str:
        """Path of the file."""
        return self._source

    def table(self, topic: str, *choices: tuple[str, ...]) -> LogSeries | None:
        """Return fields of a topic's first instance as the columns of a series; None if the log lacks them.

        choices: alternative groups of fields; the first group that the topic has in full is returned.
        """
        return _read_instance_table(topic, self._data.get(topic, {}), choices)

    def _read_gps_position(self) -> LogSeries | None:
        """Return latitude, longitude (degrees) and altitude (m AMSL) from GPS, (n, 3); None if not logged."""
        for topic in ("vehicle_gps_position", "sensor_gps"):
            position = self.table(topic, ("latitude_deg", "longitude_deg", "altitude_msl_m"))
            if position is not None:
                return position
            scaled_position = self.table(topic, ("lat", "lon", "alt"))
            if scaled_position is not None:
                return LogSeries(
                    topic, scaled_position.time, np.round(scaled_position.values * np.array([1e-7, 1e-7, 1e-3]), 7)
                )
        return None

    def attitude(self) -> LogSeries | None:
        """Return roll, pitch and yaw, rad, (n, 3); None if not logged."""
        quaternions = self.table("vehicle_attitude", ("q[0]", "q[1]", "q[2]", "q[3]"))
        if quaternions is None:
            return self.table("vehicle_attitude", ("roll", "pitch", "yaw"))
        w, x, y, z = quaternions.values.T
        roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return LogSeries(quaternions.source, quaternions.time, np.stack([roll, pitch, yaw], axis=1))

    def battery(self) -> LogSeries | None:
        """Return the mean voltage (V) of all connected batteries and the sum of their currents (A), (n, 2).

        Return None if there is no battery, or if the current of a battery in use was not measured.  Only batteries with
        the same kind of measurement (`source`) as the first battery are used, because another kind, such as
        measurements of motor controllers, contains the same current again.
        """
        connected_batteries = []
        for data in self._instances.get("battery_status", []):
            status = _read_instance_table("battery_status", data, (("voltage_v", "current_a"),))
            if status is None or ("connected" in data and not np.any(data["connected"])):
                continue
            kind = float(data["source"][0]) if "source" in data else 0.0
            is_measured = np.isfinite(status.time) & np.isfinite(status.values).all(axis=1)
            is_measured &= status.values[:, 1] != CURRENT_NOT_MEASURED_A
            battery = LogSeries(status.source, status.time[is_measured], status.values[is_measured])
            connected_batteries.append((kind, battery))
        batteries = [series for kind, series in connected_batteries if kind == connected_batteries[0][0]]
        if not batteries or not all((series.values[:, 1] > 0.0).any() for series in batteries):
            return None
        first = batteries[0]
        volts, amps = (
            np.array([np.interp(first.time, series.time, series.values[:, k]) for series in batteries])
            for k in range(2)
        )
        return LogSeries(first.source, first.time, np.stack([volts.mean(axis=0), amps.sum(axis=0)], axis=1))

    def vehicle(self) -> VehicleKind:
        """Return the kind of vehicle, "plane" for a VTOL; "unknown" if not logged."""
        data = self._data.get("vehicle_status", {})
        if "vehicle_type" in data:
            kinds = np.asarray(data["vehicle_type"])
            # Type 2 is a fixed wing; a VTOL is a copter at the beginning and the end of a flight.
            if (kinds == 2).any():
                return "plane"
            return _TYPES.get(int(kinds[0]), "unknown")
        if "is_rotary_wing" in data:
            return "copter" if np.all(np.asarray(data["is_rotary_wing"])) else "plane"
        return "unknown"

    def _read_missions(self) -> Iterable[LoggedMission]:
        """Yield the log's mission, with those valid items that became current: PX4 logs no other items.

        The total number of items comes from mission_result.  Nothing is yielded if the log has neither items nor their
        number.
        """
        data = self._data.get("navigator_mission_item", {})
        stamps = data.get("timestamp", [0.0])
        columns = ("sequence_current", "nav_cmd", "latitude", "longitude", "altitude")
        # Items by their number from 0.
        items: dict[int, MissionItem] = {}
        for k in range(len(stamps) if all(name in data for name in columns) else 0):
            number, command, lat, lon, up = (float(data[name][k]) for name in columns)
            # Check before the conversion to int, because garbage may be too large.
            has_position = abs(lat) <= 90.0 and abs(lon) <= 180.0 and math.isfinite(up)
            if not (has_position and 0.0 <= number < _MAX_ITEMS and math.isfinite(command)):
                continue
            frame = _OVER_HOME if "altitude_is_relative" in data and data["altitude_is_relative"][k] else _AMSL
            radius = float(data["acceptance_radius"][k]) if "acceptance_radius" in data else 0.0
            position = (round_to_grid(lat), round_to_grid(lon), round(up, 6))
            item = MissionItem(int(number), int(command), frame, (0.0, radius, 0.0, 0.0), *position)
            if item_problem(item) is None:
                items.setdefault(item.seq, item)
        mission_result = self._data.get("mission_result", {})
        total = 0
        if "seq_total" in mission_result:
            rows_before = np.flatnonzero(
                np.asarray(mission_result["timestamp"], dtype=np.float64) <= (float(stamps[-1]) if items else math.inf)
            )
            logged_total = float(mission_result["seq_total"][rows_before[-1] if rows_before.size else 0])
            total = int(logged_total) if 0.0 <= logged_total <= _MAX_ITEMS else 0
        if not items and not total:
            return
        flown_items = renumber_px4_items([items[seq] for seq in sorted(items)])
        mission = Mission(self.home(), flown_items, source=f"{self._source}: mission items")
        logged = LoggedMission(float(stamps[0]) * 1e-6, mission, "navigator_mission_item")
        gapless_mission = without_gaps(logged, total, max([total, *(item.seq for item in flown_items[-1:])]))
        if gapless_mission is not None:
            yield gapless_mission

    def home(self) -> Home | None:
        """Return the last valid home in the log; None if there is none."""
        positions = self.table("home_position", ("lat", "lon", "alt"))
        if positions is None:
            return None
        homes = positions.values[
            np.isfinite(positions.values).all(axis=1) & (np.abs(positions.values) < _HOME_LIMITS).all(axis=1)
        ]
        return (
            Home(round_to_grid(homes[-1, 0]), round_to_grid(homes[-1, 1]), float(homes[-1, 2])) if len(homes) else None
        )

    def parameters(self) -> dict[str, float]:
        """Return the last value of each parameter, keyed by name.

        Values that are not finite numbers are left out.
        """
        values = dict(self._log.initial_parameters)
        values |= {name: value for _, name, value in self._log.changed_parameters}
        # A damaged parameter may be a text.
        numbers = {str(name): float(value) for name, value in values.items() if isinstance(value, int | float)}
        return {name: value for name, value in numbers.items() if math.isfinite(value)}

    def program(self) -> str:
        """Return the name of the program, and its release if logged, such as "PX4 v1.14.0"."""
        info = self._log.msg_info_dict
        name, release = str(info.get("sys_name", "PX4")), info.get("ver_sw_release")
        # The bytes of the release are, from the highest: major, minor and patch number, and kind of release.
        if isinstance(release, int):
            return f"{name} v{release >> 24 & 0xFF}.{release >> 16 & 0xFF}.{release >> 8 & 0xFF}"
        return name
