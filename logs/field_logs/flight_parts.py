"""The flights of a log, and the stretches of them that were flown along a mission."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.simulation.field_source import MissionStretch
from logs.field_logs.clean_places import metres_between
from logs.field_logs.raw_log import LoggedMission, ModeChange

Floats = NDArray[np.float64]

# m/s over the ground as a median over `_OVER` s: more is flight.  An aircraft against the wind may be slower for so
# many seconds.
FLYING, SLOWER_FOR = 6.0, 60.0
_OVER = 5.0
# s.  A flight that is no further from the log's first row, or its last, is cut by it.
IN_THE_AIR = _OVER
# s.  A flight lasts this long at least.
SHORTEST = 20.0


@dataclass(frozen=True, slots=True)
class FlightPart:
    """One flight with one mission.

    start, end: s, of the flight.
    mission: number of the mission in the log that it was flown with; -1 for none.
    stretches: flown along it.
    """

    start: float
    end: float
    mission: int
    stretches: tuple[MissionStretch, ...]

    @property
    def along_mission(self) -> float:
        """Seconds flown along the mission."""
        return sum(stretch.end - stretch.start for stretch in self.stretches)


def flown_spans(time: Floats, lat: Floats, lon: Floats) -> list[tuple[float, float]]:
    """When the aircraft flew, as starts and ends in s: faster over the ground than a person on the field.

    >>> time = np.arange(0.0, 200.0)
    >>> north = np.cumsum(np.where((time > 50.0) & (time < 150.0), 20.0, 0.1))
    >>> [(start, end)] = flown_spans(time, 46.0 + north / 111195.0, np.full(200, 8.0))
    >>> 45.0 < start < 55.0, 145.0 < end < 155.0
    (True, True)
    """
    if time.size < 3:
        return []
    speed = metres_between(lat, lon) / np.maximum(np.diff(time), 1e-3)
    width = max(1, int(_OVER / max(1e-3, float(np.median(np.diff(time))))))
    fast = _running_median(speed, width) > FLYING
    spans: list[list[float]] = []
    for k in np.flatnonzero(fast).tolist():
        if spans and time[k] - spans[-1][1] <= SLOWER_FOR:
            spans[-1][1] = float(time[k + 1])
        else:
            spans.append([float(time[k]), float(time[k + 1])])
    return [(start, end) for start, end in spans if end - start >= SHORTEST]


def _running_median(values: Floats, width: int) -> Floats:
    if width < 2 or values.size <= width:
        return values
    half = width // 2
    padded = np.pad(values, (half, width - 1 - half), mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))


def flight_parts(
    spans: Sequence[tuple[float, float]],
    modes: Sequence[ModeChange],
    missions: Sequence[LoggedMission],
    last: float,
) -> list[FlightPart]:
    """Each flight, once for every mission that it was flown with.

    spans: of `flown_spans`.  last: time of the log's last row, s.  Without modes all of a flight counts as flown along
    the mission, for nothing says otherwise.
    """
    parts = []
    for start, end in spans:
        stretches = _stretches(start, end, modes, last)
        by_mission: dict[int, list[MissionStretch]] = {}
        for stretch in stretches:
            by_mission.setdefault(_mission_at(stretch, missions), []).append(stretch)
        if not by_mission:
            by_mission[_mission_at(MissionStretch(start, end, "", "log"), missions)] = []
        parts += [FlightPart(start, end, number, tuple(found)) for number, found in by_mission.items()]
    return parts


def _stretches(start: float, end: float, modes: Sequence[ModeChange], last: float) -> list[MissionStretch]:
    # A flight that goes on to the log's last rows is cut off by it.
    open_end = last - end < IN_THE_AIR
    if not modes:
        return [MissionStretch(start, end, "", "log" if open_end else "landed")]
    found = []
    ordered = sorted(modes, key=lambda mode: mode.time)
    for k, mode in enumerate(ordered):
        until = ordered[k + 1].time if k + 1 < len(ordered) else float("inf")
        begin, stop = max(start, mode.time), min(end, until)
        if not mode.automatic or stop <= begin:
            continue
        if until <= end:
            found.append(MissionStretch(begin, stop, mode.name, "mode", ordered[k + 1].name))
        else:
            found.append(MissionStretch(begin, stop, mode.name, "log" if open_end else "landed"))
    return found


def _mission_at(stretch: MissionStretch, missions: Sequence[LoggedMission]) -> int:
    """The mission in force when a stretch began: the last that was logged by then, or the first in it."""
    before = [k for k, logged in enumerate(missions) if logged.time <= stretch.start + 1.0]
    if before:
        return before[-1]
    inside = [k for k, logged in enumerate(missions) if logged.time <= stretch.end]
    return inside[0] if inside else -1


def choose_part(parts: Sequence[FlightPart]) -> int:
    """Which flight is judged: the one that was flown along its mission for the longest, or the longest."""
    return max(range(len(parts)), key=lambda k: (parts[k].along_mission, parts[k].end - parts[k].start))
