"""Choose one flight of a log, and resample all its data at the times of its positions.

A log may contain several flights, and each flight may follow several missions: `make_flight` chooses one flight along
one mission.  The other functions derive from it altitudes for a plan without altitudes, the mean wind, and the track
that is judged.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flight.mission.items import Mission
from flight.simulation.setup import DataKind, Gap, HeightOffset, Heights, MissionStretch, RowFaults, StretchEnd
from flight.simulation.track import THROTTLE, Track
from logs.importers.clean_positions import DEGREE_LENGTH_M, CleanPositions, clean_positions, find_gaps, measure_steps
from logs.importers.raw_log import COLUMNS, LoggedMission, LogSeries, ModeChange, RawLog, VehicleKind
from world.arrays import Floats
from world.errors import LogError
from world.frames import GeoOrigin, to_map
from world.wording import count_text

# ----------------------------------------------------------------------
# Flights of a log, and the parts of them that were flown along a mission.

# Median ground speed above which the aircraft flies, m/s.
MIN_FLYING_SPEED_MPS = 6.0
# Longest time for which an aircraft in flight may be slower than that, because of a headwind, s.
MAX_SLOW_TIME_S = 60.0
# Window of the median ground speed, s.
_MEDIAN_WINDOW_S = 5.0
# A flight that begins or ends within this time of the log's first or last row is cut off by the log, s.
CUT_FLIGHT_TIME_S = _MEDIAN_WINDOW_S
# Shortest duration of a flight, s.
MIN_FLIGHT_TIME_S = 20.0


@dataclass(frozen=True, slots=True)
class FlightPart:
    """One flight of a log, and one mission that it followed.

    start, end: start and end of the flight, s.
    mission: index of the mission in the log; -1 for none.
    stretches: periods in which the flight followed this mission.
    """

    start: float
    end: float
    mission: int
    stretches: tuple[MissionStretch, ...]

    @property
    def along_mission(self) -> float:
        """Total duration of the stretches, s."""
        return sum(stretch.end - stretch.start for stretch in self.stretches)


def find_flight_spans(time: Floats, lat: Floats, lon: Floats) -> list[tuple[float, float]]:
    """Return the start and end of each flight, s.

    A flight is a period of at least `MIN_FLIGHT_TIME_S` in which the running median of the ground speed is above
    `MIN_FLYING_SPEED_MPS`.  It may contain slower periods of up to `MAX_SLOW_TIME_S`.  Fewer than three rows have no
    flight.

    time: increasing times, s, (n,).
    lat, lon: positions, degrees, (n,).

    >>> time = np.arange(0.0, 200.0)
    >>> north = np.cumsum(np.where((time > 50.0) & (time < 150.0), 20.0, 0.1))
    >>> [(start, end)] = find_flight_spans(time, 46.0 + north / 111195.0, np.full(200, 8.0))
    >>> 45.0 < start < 55.0, 145.0 < end < 155.0
    (True, True)
    """
    if time.size < 3:
        return []
    speed = measure_steps(lat, lon) / np.maximum(np.diff(time), 1e-3)
    width = max(1, int(_MEDIAN_WINDOW_S / max(1e-3, float(np.median(np.diff(time))))))
    # Running median; the end values are repeated.
    median_speed = speed
    if width >= 2 and speed.size > width:
        half = width // 2
        padded = np.pad(speed, (half, width - 1 - half), mode="edge")
        median_speed = np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))
    is_flying = median_speed > MIN_FLYING_SPEED_MPS
    spans: list[list[float]] = []
    for k in np.flatnonzero(is_flying).tolist():
        if spans and time[k] - spans[-1][1] <= MAX_SLOW_TIME_S:
            spans[-1][1] = float(time[k + 1])
        else:
            spans.append([float(time[k]), float(time[k + 1])])
    return [(start, end) for start, end in spans if end - start >= MIN_FLIGHT_TIME_S]


def find_flight_parts(
    spans: Sequence[tuple[float, float]],
    modes: Sequence[ModeChange],
    missions: Sequence[LoggedMission],
    log_end: float,
) -> list[FlightPart]:
    """Split the flights of a log by the missions that they followed: one part for each flight and mission.

    A flight followed its mission while the vehicle was in a mode that follows the mission, such as AUTO.  A flight that
    followed no mission is one part without stretches.

    spans: start and end of each flight, s, as returned by `find_flight_spans`.
    modes: mode changes in the log; without any, each flight is assumed to follow its mission throughout.
    missions: missions in the log, in the order of time.
    log_end: time of the last row of the log, s.
    """
    parts = []
    sorted_modes = sorted(modes, key=lambda mode: mode.time)
    for start, end in spans:
        # A flight that continues to the log's last rows is cut off by the log.
        flight_end: StretchEnd = "log" if log_end - end < CUT_FLIGHT_TIME_S else "landed"
        stretches = [] if modes else [MissionStretch(start, end, "", flight_end)]
        for mode, next_mode in itertools.zip_longest(sorted_modes, sorted_modes[1:]):
            mode_end = math.inf if next_mode is None else next_mode.time
            stretch_start, stretch_end = max(start, mode.time), min(end, mode_end)
            if not mode.automatic or stretch_end <= stretch_start:
                continue
            if next_mode is not None and mode_end <= end:
                stretches.append(MissionStretch(stretch_start, stretch_end, mode.name, "mode", next_mode.name))
            else:
                stretches.append(MissionStretch(stretch_start, stretch_end, mode.name, flight_end))
        stretches_by_mission: dict[int, list[MissionStretch]] = {}
        for stretch in stretches:
            stretches_by_mission.setdefault(_find_mission(stretch, missions), []).append(stretch)
        if not stretches_by_mission:
            stretches_by_mission[_find_mission(MissionStretch(start, end, "", "log"), missions)] = []
        parts += [
            FlightPart(start, end, number, tuple(mission_stretches))
            for number, mission_stretches in stretches_by_mission.items()
        ]
    return parts


def _find_mission(stretch: MissionStretch, missions: Sequence[LoggedMission]) -> int:
    """Return the index of the mission that a stretch of a flight followed, or -1 if unknown.

    It is the last mission that was logged no later than a second after the start of the stretch, or else the first
    mission that was logged later in the stretch.
    """
    earlier_missions = [k for k, logged in enumerate(missions) if logged.time <= stretch.start + 1.0]
    if earlier_missions:
        return earlier_missions[-1]
    later_missions = [k for k, logged in enumerate(missions) if logged.time <= stretch.end]
    return later_missions[0] if later_missions else -1


def choose_part(parts: Sequence[FlightPart]) -> int:
    """Return the index of the part that followed its mission for the longest time.

    In a tie, the part of the longest flight is chosen.
    """
    return max(range(len(parts)), key=lambda k: (parts[k].along_mission, parts[k].end - parts[k].start))


# Time before and after a flight that is kept and shown, s.
SHOWN_MARGIN_S = 10.0
# Longest interval between rows over which values are interpolated, s.
_MAX_INTERPOLATED_STEP_S = 1.0
# That interval as a multiple of the series' usual interval; the longer of both limits applies.
_MAX_INTERPOLATED_STEPS = 2.5
# Duration at the start of a flight over which altitudes from several sources are compared, s.
_COMPARED_TIME_S = 5.0
# Vehicles whose logs are refused, with their names in the message.
_REFUSED: dict[VehicleKind, str] = {
    "copter": "a copter",
    "rover": "a rover",
    "boat": "a boat",
    "submarine": "a submarine",
    "tracker": "an antenna tracker",
    "blimp": "a blimp",
}
# Quantities that a log may lack.
_OPTIONAL_QUANTITIES: tuple[DataKind, ...] = ("velocity", "attitude", "airspeed", "wind", "battery", "throttle")
# Largest number of positions that are read.
_MAX_ROWS = 4_000_000


@dataclass(frozen=True, slots=True)
class LoggedFlight:
    """One flight of a log, with n rows at the times of its positions.

    raw: the log.
    time: times on the log's clock without forward jumps, s, (n,).
    lat, lon: latitude and longitude, degrees, (n,).
    up: altitude, m, (n,).
    columns: values of each quantity in `logs.importers.raw_log.COLUMNS` except "height", keyed by its name:
        ``columns["velocity"]`` is (n, 3).  NaN at times where the log has no value nearby.
    holds: names of the quantities that the log contains.
    stretches: periods in which the flight followed its mission.
    mission: mission of the flight; None if the log contains none.
    heights, gaps, faults: see `flight.simulation.setup.ImportedLog`.
    number: number of this flight in the log, from 1.
    count: number of flights in the log.
    others: for each other flight, its start (s) and the time for which it followed a mission (s).
    begins_in_flight, ends_in_flight: True if the log begins or ends in the air, and so lacks a part of the flight.
    clock: cleaned positions of the whole log, which convert times on the log's clock to `time`.
    """

    raw: RawLog
    time: Floats
    lat: Floats
    lon: Floats
    up: Floats
    columns: dict[str, Floats]
    holds: tuple[DataKind, ...]
    stretches: tuple[MissionStretch, ...]
    mission: LoggedMission | None
    heights: Heights
    gaps: tuple[Gap, ...]
    faults: RowFaults
    number: int
    count: int
    others: tuple[tuple[float, float], ...] = ()
    begins_in_flight: bool = False
    ends_in_flight: bool = False
    clock: CleanPositions | None = field(default=None, repr=False)


def make_flight(raw: RawLog, number: int | None = None) -> LoggedFlight:
    """Extract one flight from a log.

    A flight that followed several missions is treated as several flights.

    Raises LogError for a vehicle other than an aeroplane, a log that is too long, a log without a flight, and a number
    that is not in the log.

    number: number of the flight in the log, from 1; None for the flight that followed its mission for the longest time.

    >>> from logs.importers.raw_log import example_raw_log
    >>> flight = make_flight(example_raw_log())
    >>> [(stretch.mode, stretch.ended) for stretch in flight.stretches], flight.holds[:2]
    ([('AUTO', 'log')], ('velocity', 'attitude'))
    """
    if raw.vehicle in _REFUSED:
        program_text = f" (program {raw.program})" if raw.program else ""
        raise LogError(
            f"{raw.source}: this log is from {_REFUSED[raw.vehicle]}{program_text}; planfly judges only aeroplanes",
            file=raw.source,
        )
    series = raw.series["position"]
    if len(series.time) > _MAX_ROWS:
        raise LogError(
            f"{raw.source}: too long: the log has {len(series.time):,} positions; the limit is {_MAX_ROWS:,}",
            file=raw.source,
        )
    positions = clean_positions(series, raw.clock_jumps)
    spans = find_flight_spans(positions.time, positions.lat, positions.lon)
    if not spans:
        if positions.time.size < 2:
            unusable_count = positions.faults.unusable
            reason = f"{count_text(positions.time.size, 'usable position')}" + (
                f"; {count_text(unusable_count, 'row')} without a valid position or time" if unusable_count else ""
            )
        else:
            duration = positions.time[-1] - positions.time[0]
            limit_text = f"{MIN_FLYING_SPEED_MPS:g} m/s for {MIN_FLIGHT_TIME_S:g} s"
            reason = f"the ground speed never stayed above {limit_text} in the log's {duration:.0f} s"
        raise LogError(f"{raw.source}: contains no flight: {reason}", file=raw.source)
    last = float(positions.time[-1])
    modes = [
        type(mode)(float(positions.to_steady_clock(np.array([mode.time]))[0]), mode.name, mode.automatic)
        for mode in raw.modes
    ]
    parts = find_flight_parts(spans, modes, raw.missions, last)
    index = choose_part(parts)
    if number is not None:
        if not 1 <= number <= len(parts):
            raise LogError.of_argument("flight", number, f"the log has flights 1..{len(parts)}", file=raw.source)
        index = number - 1
    other_flights = tuple((part.start, part.along_mission) for k, part in enumerate(parts) if k != index)
    return _extract_flight(raw, positions, parts[index], index + 1, len(parts), other_flights)


def _extract_flight(
    raw: RawLog,
    positions: CleanPositions,
    part: FlightPart,
    number: int,
    count: int,
    others: tuple[tuple[float, float], ...],
) -> LoggedFlight:
    """Return one part of a log as a flight, with all its data interpolated at the times of its positions.

    positions: cleaned positions of the whole log.
    number, count, others: as in `LoggedFlight`.
    """
    is_kept = (positions.time >= part.start - SHOWN_MARGIN_S) & (positions.time <= part.end + SHOWN_MARGIN_S)
    time = positions.time[is_kept]
    columns = {
        name: _interpolate_at(raw.series.get(name), name, time, positions) for name in COLUMNS if name != "height"
    }
    up = positions.up[is_kept]
    available_quantities: list[DataKind] = [name for name in _OPTIONAL_QUANTITIES if np.isfinite(columns[name]).any()]
    if np.isfinite(up).all():
        available_quantities.append("heights")
    start = part.stretches[0].start if part.stretches else part.start
    offsets = []
    for other in raw.heights:
        other_time = positions.to_steady_clock(other.series.time)
        is_compared = (
            (other_time >= start) & (other_time <= start + _COMPARED_TIME_S) & np.isfinite(other.series.values[:, 0])
        )
        if is_compared.any() and np.isfinite(positions.up).any():
            altitudes = np.interp(other_time[is_compared], positions.time, positions.up)
            offset = float(np.median(other.series.values[is_compared, 0] - altitudes))
            offsets.append(HeightOffset(other.name, offset))
    source = raw.series["position"].source
    return LoggedFlight(
        raw=raw,
        time=time,
        lat=positions.lat[is_kept],
        lon=positions.lon[is_kept],
        up=up,
        columns=columns,
        holds=tuple(available_quantities),
        stretches=part.stretches,
        mission=raw.missions[part.mission] if part.mission >= 0 else None,
        heights=Heights(source, raw.datum, tuple(offsets)),
        gaps=find_gaps(time),
        faults=positions.faults,
        number=number,
        count=count,
        others=others,
        begins_in_flight=part.start - float(positions.time[0]) < CUT_FLIGHT_TIME_S,
        ends_in_flight=float(positions.time[-1]) - part.end < CUT_FLIGHT_TIME_S,
        clock=positions,
    )


def _interpolate_at(series: LogSeries | None, name: str, time: Floats, positions: CleanPositions) -> Floats:
    """Interpolate a series at n times, (n, k); all NaN for a series of fewer than two valid rows.

    Values are NaN in long intervals without rows, and long before the first and after the last row.  Invalid rows of
    the series are ignored.  Angles of the attitude are interpolated across full turns.

    series: the series; None if the log lacks it.
    name: name of the series in `COLUMNS`.
    time: times on the clock without jumps, s, (n,).
    positions: cleaned positions, which convert times of the series to the clock without jumps.
    """
    width = len(COLUMNS[name])
    interpolated = np.full((time.size, width), math.nan)
    if series is None:
        return interpolated
    # Values of 1e7 and more are garbage.
    is_valid = (
        np.isfinite(series.time) & np.isfinite(series.values).all(axis=1) & (np.abs(series.values) < 1e7).all(axis=1)
    )
    series_time = positions.to_steady_clock(series.time[is_valid])
    order = np.argsort(series_time, kind="stable")
    series_time, values = series_time[order], series.values[is_valid][order]
    is_new = np.concatenate([[True], np.diff(series_time) > 0.0]) if series_time.size else np.zeros(0, bool)
    series_time, values = series_time[is_new], values[is_new]
    if series_time.size < 2:
        return interpolated
    max_gap = max(_MAX_INTERPOLATED_STEP_S, _MAX_INTERPOLATED_STEPS * float(np.median(np.diff(series_time))))
    next_rows = np.clip(np.searchsorted(series_time, time), 1, series_time.size - 1)
    is_covered = (
        (series_time[next_rows] - series_time[next_rows - 1] <= max_gap)
        & (time >= series_time[0] - max_gap)
        & (time <= series_time[-1] + max_gap)
    )
    is_exact = np.isclose(series_time[next_rows], time, atol=1e-9) | np.isclose(
        series_time[next_rows - 1], time, atol=1e-9
    )
    if name == "attitude":
        values = np.unwrap(values, axis=0)
    for k in range(width):
        interpolated[:, k] = np.where(is_covered | is_exact, np.interp(time, series_time, values[:, k]), math.nan)
    if name == "attitude":
        # Wrap roll and pitch into -pi..pi, and yaw into 0..2 pi.
        interpolated[:, :2] = np.remainder(interpolated[:, :2] + math.pi, 2.0 * math.pi) - math.pi
        interpolated[:, 2] = np.remainder(interpolated[:, 2], 2.0 * math.pi)
    return interpolated


# ----------------------------------------------------------------------
# Altitudes for a plan without altitudes: those at which the flight passed its items.


def with_flown_altitudes(mission: Mission, lat: Floats, lon: Floats, up: Floats) -> Mission:
    """Set the altitude of each item with a position to the flight's altitude at its closest point.

    If no altitude of the flight is known, the altitudes are set to 0.  Without rows, the items are not changed.

    lat, lon, up: positions of the flight, degrees and m, (n,); rows with an unknown altitude (NaN) are ignored.

    >>> from flight.mission.items import MissionItem
    >>> task = Mission(None, tuple(MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + k, 8.0, 0.0) for k in (0, 1)))
    >>> flown = with_flown_altitudes(task, np.array([46.0, 47.0]), np.array([8.0, 8.0]), np.array([900.0, 1500.0]))
    >>> [item.alt for item in flown.items]
    [900.0, 1500.0]
    """
    is_known = np.isfinite(up)
    altitudes = up[is_known] if is_known.any() else np.zeros(len(up))
    lat, lon = (lat[is_known], lon[is_known]) if is_known.any() else (lat, lon)
    items = []
    for item in mission.items:
        if item.has_position and altitudes.size:
            east = ((lon - item.lon_deg + 180.0) % 360.0 - 180.0) * np.cos(np.radians(item.lat_deg))
            distances = np.hypot((lat - item.lat_deg) * DEGREE_LENGTH_M, east * DEGREE_LENGTH_M)
            items.append(replace(item, alt=round(float(altitudes[int(np.argmin(distances))]), 2)))
        else:
            items.append(item)
    return replace(mission, items=tuple(items))


# ----------------------------------------------------------------------
# The wind of a flight, as estimated by its autopilot.

# Largest wind speed that a scenario allows, m/s.
_MAX_WIND_MPS = 30.0


@dataclass(frozen=True, slots=True)
class MeanWind:
    """The mean wind of a flight.

    speed: wind speed, m/s.
    from_course: direction from which the wind blows, rad, clockwise from north.
    source: name of the log message with the wind.
    """

    speed: float
    from_course: float
    source: str


def mean_wind(flight: LoggedFlight) -> MeanWind | None:
    """Return the mean of the logged wind while the flight followed its mission.

    Return None if the log contains no wind.  If the flight never followed its mission with a known wind, it is the mean
    over the whole flight.  The first fifth of the rows is left out, because the autopilot's estimate starts at zero and
    converges only in the first turns.  The speed is limited to the largest wind speed that a scenario allows.

    >>> from logs.importers.raw_log import example_raw_log
    >>> from logs.importers.imported_flight import make_flight
    >>> mean_wind(make_flight(example_raw_log()))
    MeanWind(speed=3.0, from_course=0.0, source='XKF2')
    """
    wind = flight.columns["wind"]
    is_on_mission = np.zeros(len(flight.time), bool)
    for stretch in flight.stretches:
        is_on_mission |= (flight.time >= stretch.start) & (flight.time <= stretch.end)
    rows = np.flatnonzero(np.isfinite(wind).all(axis=1) & (is_on_mission if is_on_mission.any() else True))
    if not rows.size:
        return None
    east, north = wind[rows[len(rows) // 5 :]].mean(axis=0).tolist()
    speed = min(_MAX_WIND_MPS, math.hypot(east, north))
    return MeanWind(speed, math.atan2(-east, -north) % (2.0 * math.pi), flight.raw.series["wind"].source)


# ----------------------------------------------------------------------
# Rows of an imported flight as a track; quantities that are not logged are NaN.


def make_track(flight: LoggedFlight, origin: GeoOrigin) -> Track:
    """Convert a flight to a track with map coordinates relative to `origin`.

    Velocities that the log lacks are computed from the positions.  Unknown altitudes become 0; no rule judges them.
    The energy is relative to its first known value.  Columns that no imported log contains are NaN, and all rows are on
    leg 0.

    >>> from logs.importers.raw_log import example_raw_log
    >>> from logs.importers.imported_flight import make_flight
    >>> track = make_track(make_flight(example_raw_log()), GeoOrigin(46.0, 8.0))
    >>> track.position[-1].round(1).tolist(), float(track.airspeed[0]), float(track.current[0])
    ([1045.0, 1000.0, 500.0], 25.0, nan)
    """
    count = len(flight.time)
    east, north = to_map(origin, flight.lat, flight.lon)
    position = np.column_stack([east, north, np.nan_to_num(flight.up, nan=0.0)])
    velocity = flight.columns["velocity"].copy()
    is_missing = ~np.isfinite(velocity).all(axis=1)
    if is_missing.any() and count > 1:
        velocity[is_missing] = np.gradient(position, flight.time, axis=0)[is_missing]
    wind = np.column_stack([flight.columns["wind"], np.where(np.isfinite(flight.columns["wind"][:, 0]), 0.0, math.nan)])
    controls = np.full((count, 4), math.nan)
    controls[:, THROTTLE] = flight.columns["throttle"][:, 0]
    current, energy = flight.columns["battery"].T
    known_energy = energy[np.isfinite(energy)]
    unknown = np.full(count, math.nan)
    return Track(
        time=flight.time,
        position=position,
        velocity=velocity.astype(np.float32),
        attitude=flight.columns["attitude"].astype(np.float32),
        rates=np.full((count, 3), math.nan),
        airspeed=flight.columns["airspeed"][:, 0].astype(np.float32),
        flow=np.full((count, 2), math.nan),
        controls=controls,
        commands=np.full((count, 4), math.nan),
        wind=wind,
        load_factor=unknown,
        current=current,
        energy=energy - known_energy[0] if known_energy.size else energy,
        leg=np.zeros(count, dtype=np.int32),
        cross_track=unknown,
        height_error=unknown,
        speed_command=unknown,
        clearance=unknown,
    )
