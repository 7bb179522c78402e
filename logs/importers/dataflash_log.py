"""Read ArduPilot's dataflash logs (`.BIN`) into a `RawLog`.

`logs.importers.dataflash_frames` finds the messages.  Names of messages and fields follow ArduPilot's log documentation
of the current release and of older releases.
"""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.mission.items import Home, MissionItem, round_to_grid
from logs.importers.clean_positions import remove_clock_jumps
from logs.importers.dataflash_frames import Dataflash, MappedFile, Messages, index_dataflash
from logs.importers.logged_missions import LoggedItem, combine_items, describe_plane_mode, make_logged_mission
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

# Missions: from the CMD messages, with home from ORGN if the items contain none.

_NUMBERS = ("CNum", "CId", "Prm1", "Prm2", "Prm3", "Prm4", "Lat", "Lng", "Alt")
# Largest item number: 16 bits (ArduPilot's log documentation, CMD).
_MAX_ITEMS = 65535.0
# Value of ORGN.Type for home; the other value is the origin of the estimator's map.
_HOME = 1


def make_dataflash_missions(
    commands: Messages, time: Floats, origins: Messages, source: str
) -> Iterator[LoggedMission]:
    """Yield the missions of a log in the order in which they were logged.

    An item that is logged again when it is flown is not repeated.  Nothing is yielded without usable CMD messages.

    commands: CMD messages, each with one item.
    time: time of each CMD message, s, (n,).
    origins: ORGN messages, which contain home.
    source: name of the log.

    >>> none = Messages(np.zeros(0, np.int64), np.zeros(0, np.dtype([])), {})
    >>> list(make_dataflash_missions(none, np.zeros(0), none, "a.BIN"))
    []
    """
    if not commands.has(*_NUMBERS):
        return
    has_frames = commands.has("Frame")
    table = [commands.column(name).tolist() for name in _NUMBERS]
    frames = commands.column("Frame").tolist() if has_frames else [3.0] * len(commands)
    totals = commands.column("CTot").tolist() if commands.has("CTot") else [0.0] * len(commands)
    rows = []
    for row, (stamp, total, frame) in enumerate(zip(time.tolist(), totals, frames, strict=True)):
        number, command, p1, p2, p3, p4, lat, lon, up = (column[row] for column in table)
        # Skip garbage that looks like a message, or the items of a hostile log.
        if not (0.0 <= number <= _MAX_ITEMS and math.isfinite(command) and math.isfinite(frame)):
            continue
        # A float32 has seven digits; a mission file has six after the decimal point.
        position = (round_to_grid(lat), round_to_grid(lon), round(up, 6))
        item = MissionItem(int(number), int(command), int(frame), (p1, p2, p3, p4), *position)
        rows.append(LoggedItem(stamp, int(total) if 0.0 <= total <= _MAX_ITEMS else 0, item))
    notes = () if has_frames else ("the log states no altitude frames: altitudes are taken as heights above home",)
    for logged in combine_items(rows):
        usable_mission = make_logged_mission(logged, source, "CMD")
        if usable_mission is not None:
            mission = usable_mission.mission
            home = mission.home if mission.home is not None else find_logged_home(origins)
            yield replace(usable_mission, mission=replace(mission, home=home, warnings=(*mission.warnings, *notes)))


def find_logged_home(origins: Messages) -> Home | None:
    """Return the last home of the vehicle from the ORGN messages; None if not logged or invalid."""
    if not origins.has("Type", "Lat", "Lng", "Alt"):
        return None
    homes = origins.select(origins.column("Type") == _HOME)
    if not len(homes):
        return None
    lat, lon, up = (float(homes.column(name)[-1]) for name in ("Lat", "Lng", "Alt"))
    is_valid = np.isfinite([lat, lon, up]).all() and abs(lat) <= 90.0 and abs(lon) <= 180.0 and (lat, lon) != (0.0, 0.0)
    return Home(round_to_grid(lat), round_to_grid(lon), up) if is_valid else None


FORMAT = "ArduPilot dataflash log"
# Kind of vehicle by VER.BT, the number of the vehicle for which the program was built.
_BUILDS: dict[int, VehicleKind] = {
    1: "rover",
    2: "copter",
    3: "plane",
    4: "tracker",
    7: "submarine",
    12: "blimp",
    13: "copter",
}
_PROGRAMS: dict[str, VehicleKind] = {
    "ArduPlane": "plane",
    "ArduCopter": "copter",
    "Rover": "rover",
    "ArduRover": "rover",
    "APMrover2": "rover",
    "ArduSub": "submarine",
    "AntennaTracker": "tracker",
    "Blimp": "blimp",
    # Names until 2018.
    "APM:Plane": "plane",
    "APM:Copter": "copter",
    "APM:Rover": "rover",
}
_PROGRAM = re.compile(rf"^({'|'.join(_PROGRAMS)})\b")
# Time from 1970 to the epoch of GPS, s.
_GPS_EPOCH_S = 315_964_800.0
# Leap seconds since the epoch of GPS, s; constant since 2017.
_LEAP_SECONDS_S = 18.0
_WEEK_S = 604_800.0


def read_dataflash(path: Path) -> RawLog:
    """Read a dataflash log into a `RawLog`.

    Raises LogError for a log without positions.
    """
    file = MappedFile(path)
    index = index_dataflash(file.data, _READ, file.release_memory)
    return _Reader(index, str(path)).read()


def find_firmware_and_vehicle(texts: Iterable[str], version: Messages) -> tuple[str, VehicleKind]:
    """Return the name and version of the firmware, and the kind of vehicle.

    They come from the first MSG text that names a firmware, or else from VER.  Without either they are "" and
    "unknown".

    texts: texts of the MSG messages.
    version: VER messages.

    >>> none = Messages(np.zeros(0, np.int64), np.zeros(0, np.dtype([])), {})
    >>> find_firmware_and_vehicle(["ArduCopter V4.5.7"], none), find_firmware_and_vehicle([], none)
    (('ArduCopter V4.5.7', 'copter'), ('', 'unknown'))
    """
    for text in texts:
        if match := _PROGRAM.match(text):
            return text, _PROGRAMS[match.group(1)]
    # VER.BT is the number of the vehicle, VER.FWS the name and version of the firmware.
    if version.has("BT") and len(version):
        text = version.texts("FWS")[0] if version.has("FWS") else ""
        return text, _BUILDS.get(int(version.column("BT")[0]), "unknown")
    return "", "unknown"


class _Reader:
    """The reader of one log."""

    def __init__(self, index: Dataflash, source: str) -> None:
        """Find the backward jumps of the log's clock from the messages POS, ATT, GPS and MODE.

        Other messages are later shifted like their neighbours in the file.

        source: path of the log.
        """
        self._index, self._source = index, source
        self._cache: dict[str, Messages] = {}
        times, starts = [np.zeros(0)], [np.zeros(0, np.int64)]
        for name in ("POS", "ATT", "GPS", "MODE"):
            messages = self._select_messages(name)
            if messages.has("TimeUS") or messages.has("TimeMS"):
                times.append(_read_raw_time(messages))
                starts.append(messages.starts)
        order = np.argsort(np.concatenate(starts), kind="stable")
        raw_times = np.concatenate(times)[order]
        is_finite = np.isfinite(raw_times)
        steady = remove_clock_jumps(raw_times[is_finite])
        # Byte at which each of these messages starts, (n,); shift to add to its time, s, (n,); times of the jumps, s.
        self._clock_starts = np.concatenate(starts)[order][is_finite]
        self._clock_shifts = steady.time - raw_times[is_finite]
        self._clock_jumps = steady.jumps

    def read(self) -> RawLog:
        """Read all data of the log.

        Raises LogError for a log without positions.
        """
        wind = self._read_first_table([(name, ("VWE", "VWN")) for name in ("XKF2", "NKF2", "EKF2")])
        throttles = (self._read_table("CTUN", (column,), 0.01) for column in ("ThO", "ThrOut"))
        tables = {
            "position": self._read_position(),
            "velocity": self._read_velocity(),
            "attitude": self._read_first_table(
                (("ATT", ("Roll", "Pitch", "Yaw")), ("AHR2", ("Roll", "Pitch", "Yaw"))), _DEGREE
            ),
            # Without an estimate the wind stays zero.
            "wind": wind if wind is not None and np.any(wind.values) else None,
            "airspeed": self._read_airspeed(),
            "battery": self._read_battery(),
            "throttle": next((table for table in throttles if table is not None and len(table.time)), None),
        }
        series = {name: table for name, table in tables.items() if table is not None and len(table.time)}
        program, vehicle = find_firmware_and_vehicle(
            [text for _, text in self._read_events()], self._select_messages("VER")
        )
        if "position" not in series:
            names = ", ".join(sorted(self._index.names)[:12])
            raise LogError(
                f"{self._source}: no POS, AHR2 or GPS message: the flown position is unknown"
                f" (the log has {names or 'no known messages'})",
                file=self._source,
            )
        commands = self._select_messages("CMD")
        command_times = self._compute_times(commands) if len(commands) else np.zeros(0)
        messages = self._select_messages("PARM")
        parameters: dict[str, float] = {}
        if messages.has("Name", "Value"):
            values = zip(messages.texts("Name"), messages.column("Value").tolist(), strict=True)
            parameters = {name: value for name, value in values if name and math.isfinite(value)}
        # Altitudes in the log other than the altitude of the position.
        heights = []
        gps, baro = self._read_table("GPS", ("Alt",)), self._read_table("BARO", ("Alt",))
        baro_amsl = self._read_table("BARO", ("AltAMSL",))
        if gps is not None and series["position"].source != "GPS":
            heights.append(HeightSource("GPS.Alt", "amsl", gps))
        if baro_amsl is not None:
            heights.append(HeightSource("BARO.AltAMSL", "amsl", baro_amsl))
        elif baro is not None:
            heights.append(HeightSource("BARO.Alt (above the power-up position)", "unstated", baro))
        modes: list[ModeChange] = []
        mode_messages = self._select_messages("MODE")
        column = "ModeNum" if mode_messages.has("ModeNum") else "Mode"
        # Some logs state modes by name instead of number.
        if mode_messages.has(column) and mode_messages.rows.dtype[column].kind != "S":
            numbers = mode_messages.rows[column].tolist()
            for time, number in zip(self._compute_times(mode_messages).tolist(), numbers, strict=True):
                modes.append(ModeChange(time, *describe_plane_mode(int(number))))
        return RawLog(
            source=self._source,
            format=FORMAT,
            program=program,
            vehicle=vehicle,
            series=series,
            heights=tuple(heights),
            datum="amsl",
            modes=tuple(modes),
            missions=tuple(
                make_dataflash_missions(commands, command_times, self._select_messages("ORGN"), self._source)
            ),
            parameters=parameters,
            events=tuple(self._read_events()),
            utc_start=self._find_utc_start(),
            clock_jumps=self._clock_jumps,
            damage=self._index.damage,
        )

    def _select_messages(self, name: str) -> Messages:
        """Return the messages with a name.

        If several sensors or estimators log them, only those of the first one are returned.
        """
        if name not in self._cache:
            messages = self._index.messages(name)
            for column in ("I", "C", "Inst", "Instance"):
                # In other messages of earlier releases these names are a mode number or a counter.
                if name in _WITH_INSTANCES and messages.has(column) and messages.rows.dtype[column].kind in "ui":
                    number = messages.rows[column]
                    messages = messages.select(number == number.min())
            self._cache[name] = messages
        return self._cache[name]

    def _compute_times(self, messages: Messages) -> Floats:
        """Return the times of messages on the log's clock without its backward jumps, s, (n,)."""
        raw_time = _read_raw_time(messages)
        if not self._clock_jumps:
            return raw_time
        following = np.searchsorted(self._clock_starts, messages.starts)
        return np.asarray(raw_time + self._clock_shifts[np.clip(following, 0, len(self._clock_shifts) - 1)])

    def _read_table(self, name: str, columns: Iterable[str], scale: float = 1.0) -> LogSeries | None:
        """Read fields of the messages with a name as the columns of a series, multiplied by `scale`.

        Return None if the log lacks the messages, a field or the times.
        """
        columns = tuple(columns)
        messages = self._select_messages(name)
        if not messages.has(*columns) or not (messages.has("TimeUS") or messages.has("TimeMS")):
            return None
        values = np.stack([messages.column(column) for column in columns], axis=1)
        return LogSeries(name, self._compute_times(messages), values * scale)

    def _read_first_table(self, choices: Iterable[tuple[str, tuple[str, ...]]], scale: float = 1.0) -> LogSeries | None:
        """Read a quantity that several messages can state from the first of them that the log contains.

        Return None if the log contains none of them.

        choices: name and fields of each message, in the order of preference.
        scale: factor by which the values are multiplied.
        """
        for name, columns in choices:
            table = self._read_table(name, columns, scale)
            if table is not None and len(table.time):
                return table
        return None

    def _read_position(self) -> LogSeries | None:
        """Read latitude, longitude (degrees) and altitude (m), estimated or else from GPS, (n, 3).

        Of the GPS positions, only those with a 3-D fix are returned if the log states the fix.  Return None if the log
        has neither.
        """
        estimate = self._read_first_table((("POS", ("Lat", "Lng", "Alt")), ("AHR2", ("Lat", "Lng", "Alt"))))
        if estimate is not None:
            return estimate
        gps = self._select_messages("GPS")
        position = self._read_first_table((("GPS", ("Lat", "Lng", "Alt")),))
        if position is None or not gps.has("Status"):
            return position
        # Without a 3-D fix there is no altitude.
        has_fix = gps.column("Status") >= 3
        return LogSeries("GPS", position.time[has_fix], position.values[has_fix])

    def _read_velocity(self) -> LogSeries | None:
        """Read the ground velocity to east, north and up, m/s, (n, 3), from the estimator or else from GPS.

        Return None if the log has neither.
        """
        for name in ("XKF1", "NKF1", "EKF1"):
            velocity = self._read_table(name, ("VE", "VN", "VD"))
            if velocity is not None and len(velocity.time):
                return LogSeries(name, velocity.time, velocity.values * np.array([1.0, 1.0, -1.0]))
        gps = self._read_table("GPS", ("Spd", "GCrs", "VZ"))
        if gps is None:
            return None
        speed, course, down = gps.values.T
        course = np.radians(course)
        return LogSeries("GPS", gps.time, np.stack([speed * np.sin(course), speed * np.cos(course), -down], axis=1))

    def _read_airspeed(self) -> LogSeries | None:
        """Read the true airspeed, m/s, (n, 1); None if it was not measured.

        It is converted from the equivalent airspeed that ArduPilot logs: of a sensor in use (ARSP), or else in CTUN.
        """
        sensor = self._select_messages("ARSP")
        airspeed = self._read_table("ARSP", ("Airspeed",))
        if airspeed is not None and sensor.has("U"):
            is_used = sensor.column("U") > 0
            airspeed = LogSeries("ARSP", airspeed.time[is_used], airspeed.values[is_used]) if is_used.any() else None
        if airspeed is None or not len(airspeed.time):
            airspeed = (
                self._read_first_table((("CTUN", ("As",)),)) if self._select_messages("CTUN").has("AsT") else None
            )
        if airspeed is None or not len(airspeed.time) or not np.any(airspeed.values):
            return None
        # The ratio of true to equivalent airspeed is logged, or else taken from the standard atmosphere, or else 1.
        time = airspeed.time
        ratios = np.ones(len(time))
        logged_ratio, position = self._read_table("CTUN", ("E2T",)), self._read_position()
        if logged_ratio is not None and len(logged_ratio.time) > 1:
            order = np.argsort(logged_ratio.time, kind="stable")
            ratios = np.interp(time, logged_ratio.time[order], logged_ratio.values[order, 0])
        elif position is not None and len(position.time):
            order = np.argsort(position.time, kind="stable")
            # Limit implausible altitudes to the range of the standard atmosphere.
            altitudes = np.clip(np.interp(time, position.time[order], position.values[order, 2]), -500.0, 20_000.0)
            ratios = np.array([eas_to_tas_ratio(float(altitude)) for altitude in altitudes])
        return LogSeries(airspeed.source, time, airspeed.values * ratios[:, None])

    def _read_battery(self) -> LogSeries | None:
        """Read the battery's current (A) and the energy used (Wh), (n, 2); None if neither was measured.

        If the log has no energy, it is integrated from voltage and current.
        """
        battery = self._read_table("BAT", ("Curr", "EnrgTot"))
        if battery is None or not len(battery.time):
            battery = self._read_table("CURR", ("Curr", "EnrgTot"))
        if battery is not None and len(battery.time):
            return battery if np.any(battery.values) else None
        for name in ("BAT", "CURR"):
            battery = self._read_table(name, ("Volt", "Curr"))
            if battery is not None and len(battery.time) and np.any(battery.values[:, 1]):
                return with_used_energy(battery)
        return None

    def _read_events(self) -> Iterable[tuple[float, str]]:
        """Yield the time (s) and the text of each MSG message."""
        messages = self._select_messages("MSG")
        if messages.has("Message"):
            yield from zip(self._compute_times(messages).tolist(), messages.texts("Message"), strict=True)

    def _find_utc_start(self) -> float:
        """Return the UTC time at time 0 of the log's clock, s since 1970.

        Return NaN if no GPS time with a fix is logged.
        """
        messages = self._select_messages("GPS")
        for weeks, millis in (("GWk", "GMS"), ("Week", "TimeMS")):
            if messages.has(weeks, millis, "TimeUS"):
                # Without a fix a receiver may report a wrong week.
                has_fix = (messages.column(weeks) > 1000) & (
                    messages.column("Status") >= 3 if messages.has("Status") else True
                )
                if has_fix.any():
                    k = int(np.argmax(has_fix))
                    seconds = messages.column(weeks)[k] * _WEEK_S + messages.column(millis)[k] * 1e-3
                    return float(_GPS_EPOCH_S - _LEAP_SECONDS_S + seconds - self._compute_times(messages)[k])
        return math.nan


_DEGREE = math.pi / 180.0
_READ = (
    "POS",
    "AHR2",
    "GPS",
    "ATT",
    "XKF1",
    "NKF1",
    "EKF1",
    "XKF2",
    "NKF2",
    "EKF2",
    "ARSP",
    "CTUN",
    "BAT",
    "CURR",
    "BARO",
    "MODE",
    "CMD",
    "PARM",
    "MSG",
    "VER",
    "ORGN",
)
_WITH_INSTANCES = frozenset({"GPS", "BARO", "ARSP", "BAT", "XKF1", "XKF2", "NKF1", "NKF2", "EKF1", "EKF2"})


def _read_raw_time(messages: Messages) -> Floats:
    """Return the times of messages as logged, s, (n,).

    They are logged in microseconds, before 2015 in milliseconds.
    """
    if messages.has("TimeUS"):
        return messages.column("TimeUS") * 1e-6
    return messages.column("TimeMS") * 1e-3
