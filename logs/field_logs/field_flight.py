"""A log made one flight: rows at the times of its places, and everything else it holds brought to those times."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flight.simulation.field_source import Gap, HeightOffset, Heights, MissionStretch, Quantity, RowFaults
from logs.field_logs.clean_places import Places, clean_places, find_gaps
from logs.field_logs.flight_parts import IN_THE_AIR, FlightPart, choose_part, flight_parts, flown_spans
from logs.field_logs.raw_log import COLUMNS, LoggedMission, LogSeries, RawLog, VehicleKind
from world.errors import LogError

Floats = NDArray[np.float64]

# s.  What is shown before and after a flight.
BESIDE = 10.0
# A value is taken from rows that are no further apart than this (s), or than so many usual steps of its own.
_NEAR, _NEAR_STEPS = 1.0, 2.5
# s.  Over which heights are compared at the start.
_COMPARED = 5.0
_REFUSED: dict[VehicleKind, str] = {
    "copter": "a copter's", "rover": "a rover's", "boat": "a boat's", "submarine": "a submarine's",
    "tracker": "an antenna tracker's", "blimp": "a blimp's",
}  # fmt: skip
_HELD: tuple[Quantity, ...] = ("velocity", "attitude", "airspeed", "wind", "battery", "throttle")
_MOST_ROWS = 4_000_000


@dataclass(frozen=True, slots=True)
class FieldFlight:
    """One flight of a log.

    raw: the log.
    time: (n,) s of the log's clock.  lat, lon: (n,) degrees.  up: (n,) m.
    columns: by the names of `logs.field_logs.raw_log.COLUMNS`, (n, k), NaN where the log has nothing near.
    holds: which of them it holds.
    stretches: flown along the mission.
    mission: that it was flown with; None where the log holds none.
    heights, gaps, faults: see `flight.simulation.field_source.FieldSource`.
    number, count: which of the log's flights, from 1, and how many there are.
    others: of the others, when they began and for how long they followed a mission, s.
    begins, ends: whether the log's first row, and its last, is in the air: what came before and after it does not hold.
    """

    raw: RawLog
    time: Floats
    lat: Floats
    lon: Floats
    up: Floats
    columns: dict[str, Floats]
    holds: tuple[Quantity, ...]
    stretches: tuple[MissionStretch, ...]
    mission: LoggedMission | None
    heights: Heights
    gaps: tuple[Gap, ...]
    faults: RowFaults
    number: int
    count: int
    others: tuple[tuple[float, float], ...] = ()
    begins: bool = False
    ends: bool = False
    clock: Places | None = field(default=None, repr=False)


def make_flight(raw: RawLog, number: int | None = None) -> FieldFlight:
    """The flight of a log that was flown along its mission for the longest, or the one of a number, from 1.

    Raises LogError for a vehicle that is no aeroplane, a log without a flight, and a number that it does not have.

    >>> from logs.field_logs.example_raw_log import example_raw_log
    >>> flight = make_flight(example_raw_log())
    >>> [(stretch.mode, stretch.ended) for stretch in flight.stretches], flight.holds[:2]
    ([('AUTO', 'log')], ('velocity', 'attitude'))
    """
    if raw.vehicle in _REFUSED:
        named = f" ({raw.program})" if raw.program else ""
        raise LogError(
            f"{raw.source}: {_REFUSED[raw.vehicle]} log{named}: flights of aeroplanes are judged", file=raw.source
        )
    series = raw.series["position"]
    if len(series.time) > _MOST_ROWS:
        raise LogError(f"{raw.source}: {len(series.time):,} places: at most {_MOST_ROWS:,} are read", file=raw.source)
    places = clean_places(series, raw.clock_jumps)
    spans = flown_spans(places.time, places.lat, places.lon)
    if not spans:
        raise LogError(f"{raw.source}: no flight in it: {_why_none(places)}", file=raw.source)
    last = float(places.time[-1])
    modes = [type(one)(float(places.on_clock(np.array([one.time]))[0]), one.name, one.automatic) for one in raw.modes]
    parts = flight_parts(spans, modes, raw.missions, last)
    chosen = choose_part(parts)
    if number is not None:
        if not 1 <= number <= len(parts):
            raise LogError.of_option("--flight", number, f"it holds flights 1..{len(parts)}", file=raw.source)
        chosen = number - 1
    others = tuple((part.start, part.along_mission) for k, part in enumerate(parts) if k != chosen)
    return _cut(raw, places, parts[chosen], chosen + 1, len(parts), others)


def _why_none(places: Places) -> str:
    if places.time.size < 2:
        return f"{places.time.size} usable places"
    return f"in {places.time[-1] - places.time[0]:.0f} s it never went faster than a person for long"


def _cut(
    raw: RawLog, places: Places, part: FlightPart, number: int, count: int, others: tuple[tuple[float, float], ...]
) -> FieldFlight:
    keep = (places.time >= part.start - BESIDE) & (places.time <= part.end + BESIDE)
    time = places.time[keep]
    columns = {name: _at(raw.series.get(name), name, time, places) for name in COLUMNS if name != "height"}
    up = places.up[keep]
    holds: list[Quantity] = [name for name in _HELD if np.isfinite(columns[name]).any()]
    if np.isfinite(up).all():
        holds.append("heights")
    start = part.stretches[0].start if part.stretches else part.start
    return FieldFlight(
        raw=raw,
        time=time,
        lat=places.lat[keep],
        lon=places.lon[keep],
        up=up,
        columns=columns,
        holds=tuple(holds),
        stretches=part.stretches,
        mission=raw.missions[part.mission] if part.mission >= 0 else None,
        heights=_heights(raw, places, start),
        gaps=find_gaps(time),
        faults=places.faults,
        number=number,
        count=count,
        others=others,
        begins=part.start - float(places.time[0]) < IN_THE_AIR,
        ends=float(places.time[-1]) - part.end < IN_THE_AIR,
        clock=places,
    )


def _at(series: LogSeries | None, name: str, time: Floats, places: Places) -> Floats:
    """A series at the times of the places (n,), NaN where it has no rows near."""
    width = len(COLUMNS[name])
    out = np.full((time.size, width), math.nan)
    if series is None:
        return out
    good = np.isfinite(series.time) & np.isfinite(series.values).all(axis=1) & (np.abs(series.values) < 1e7).all(axis=1)
    own = places.on_clock(series.time[good])
    order = np.argsort(own, kind="stable")
    own, values = own[order], series.values[good][order]
    fresh = np.concatenate([[True], np.diff(own) > 0.0]) if own.size else np.zeros(0, bool)
    own, values = own[fresh], values[fresh]
    if own.size < 2:
        return out
    near = max(_NEAR, _NEAR_STEPS * float(np.median(np.diff(own))))
    after = np.clip(np.searchsorted(own, time), 1, own.size - 1)
    within = (own[after] - own[after - 1] <= near) & (time >= own[0] - near) & (time <= own[-1] + near)
    exact = np.isclose(own[after], time, atol=1e-9) | np.isclose(own[after - 1], time, atol=1e-9)
    if name == "attitude":
        values = np.unwrap(values, axis=0)
    for k in range(width):
        out[:, k] = np.where(within | exact, np.interp(time, own, values[:, k]), math.nan)
    if name == "attitude":
        # Back into -pi..pi, the yaw into 0..2 pi.
        out[:, :2] = np.remainder(out[:, :2] + math.pi, 2.0 * math.pi) - math.pi
        out[:, 2] = np.remainder(out[:, 2], 2.0 * math.pi)
    return out


def _heights(raw: RawLog, places: Places, start: float) -> Heights:
    """Which height was taken, and how much higher the others are in the first seconds of what is judged."""
    offsets = []
    for other in raw.heights:
        time = places.on_clock(other.series.time)
        first = (time >= start) & (time <= start + _COMPARED) & np.isfinite(other.series.values[:, 0])
        if first.any() and np.isfinite(places.up).any():
            own = np.interp(time[first], places.time, places.up)
            offsets.append(HeightOffset(other.name, float(np.median(other.series.values[first, 0] - own))))
    source = raw.series["position"].source
    return Heights(source, raw.datum, tuple(offsets))
