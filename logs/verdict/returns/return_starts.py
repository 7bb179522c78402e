"""Sample places from which an aircraft may be called home, at intervals along a flight or path."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_speed
from flight.autopilots.arduplane.rtl_point_mass import RETURN_START
from flight.simulation.setup import FlightSetup
from flight.simulation.track import ROLL, Track
from logs.verdict.measures.flown_phases import by_the_ground
from logs.verdict.measures.path_moves import path_moves
from world.arrays import Flags, Floats
from world.geometry import leg_courses
from world.kernels import Records

# Time over which velocities are computed for a track without velocities, s.
_VELOCITY_WINDOW_S = 1.0
# Height that a return loses from a final with its motor off before it climbs, m; a place this close to a limit is low.
SINKING = 10.0


@dataclass(frozen=True, slots=True)
class ReturnStarts:
    """Places where returns begin.

    time: (n,) s.  rows: (n,) of `flight.autopilots.arduplane.rtl_point_mass.RETURN_START`.
    used: (n,) energy used until then, Wh; NaN if unknown.
    flown: True for a flown track, False for the planned path.
    low: (n,) True for a place in a flown take-off or landing that is lower above ground than the required clearance
        plus `SINKING`.
    grounded: number of further places where the aircraft is too slow to fly: on its launch, or landed.
    """

    time: Floats
    rows: Records
    used: Floats
    flown: bool
    low: Flags
    grounded: int = 0

    def __len__(self) -> int:
        """Return the number of places."""
        return len(self.time)

    def at(self, chosen: NDArray[np.intp]) -> "ReturnStarts":
        """Return the chosen places."""
        chosen_of = (self.time[chosen], self.rows[chosen], self.used[chosen])
        return ReturnStarts(*chosen_of, self.flown, self.low[chosen], self.grounded)


def flown_starts(setup: FlightSetup, track: Track, every: float) -> ReturnStarts:
    """Sample a flown track at an interval in s, up to its own return to launch, while the aircraft flies.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> starts = flown_starts(log.setup, log.track, 0.5)
    >>> starts.flown, float(starts.time[0]), bool((np.diff(starts.time) > 0.4).all())
    (True, 0.0, True)
    """
    whole = np.isfinite(track.position).all(axis=1) & np.isfinite(track.time)
    if setup.route.return_from >= 0 and setup.source is None:
        whole &= track.leg < setup.route.return_from
    known = np.flatnonzero(whole)
    if not known.size:
        return _no_starts(flown=True)
    time = track.time[known]
    wanted = np.arange(time[0], time[-1] + 1e-9, every)
    # Take the nearest row, except in a pause of the log.
    every_row = known[np.unique(np.searchsorted(time, wanted - 1e-9).clip(0, len(known) - 1))]
    near, slow = _low_and_slow_rows(setup, track, every_row)
    rows, low = every_row[~slow], near[~slow]
    velocity = _velocities(track, rows)
    roll = track.attitude[rows, ROLL].astype(np.float64)
    energy = track.energy[rows].astype(np.float64)
    records = _start_records(track.position[rows], velocity, np.nan_to_num(roll))
    return ReturnStarts(track.time[rows], records, energy, True, low, int(slow.sum()))


def _no_starts(*, flown: bool) -> ReturnStarts:
    return ReturnStarts(np.zeros(0), np.zeros(0, RETURN_START), np.zeros(0), flown, np.zeros(0, dtype=np.bool_))


def _low_and_slow_rows(setup: FlightSetup, track: Track, rows: NDArray[np.intp]) -> tuple[Flags, Flags]:
    """Flag the rows that are low in a flown take-off or landing, and those that are also too slow to fly, (n,) each."""
    ways, terrain = setup.ground_ways, setup.scenario.terrain
    on_way = by_the_ground(track, ways)[rows]
    position = np.asarray(track.position[rows], dtype=np.float64)
    if terrain is None or not ways:
        return on_way, on_way.copy()
    above_ground = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
    low = on_way & (above_ground < setup.limits.min_clearance + SINKING)
    slowest = setup.envelope.level_speeds(float(setup.route.waypoints[0, 2]))[0]
    return low, low & (track.airspeed[rows] < slowest)


def _velocities(track: Track, rows: NDArray[np.intp]) -> Floats:
    """Return velocities over the ground at some rows, m/s, (n, 3), from nearby positions if the track has none."""
    velocity = track.velocity[rows].astype(np.float64)
    for k in np.flatnonzero(~np.isfinite(velocity).all(axis=1)):
        near = np.flatnonzero(np.abs(track.time - track.time[rows[k]]) <= _VELOCITY_WINDOW_S)
        first, last = (near[0], near[-1]) if near.size else (rows[k], rows[k])
        lasts = float(track.time[last] - track.time[first])
        velocity[k] = (track.position[last] - track.position[first]) / lasts if lasts > 0.0 else 0.0
    return np.asarray(np.nan_to_num(velocity))


def planned_starts(setup: FlightSetup, every: float) -> ReturnStarts:
    """Sample the planned path at an interval in s, up to its own return to launch; no energy is used yet.

    >>> from logs.recording.example_log import example_log
    >>> starts = planned_starts(example_log().setup, 1.0)
    >>> bool(starts.rows["velocity_north"][0] > 0.0), starts.flown
    (True, False)
    """
    route = setup.route
    last = route.return_from - 1 if route.return_from >= 0 else route.legs - 1
    moves = path_moves(setup.path, _ground_speeds(setup), 0, last)
    moves = moves[moves["leg"] <= last]
    if not len(moves):
        return _no_starts(flown=False)
    times = np.arange(0.0, float(moves["time"][-1] + moves["lasts"][-1]), every)
    at = np.searchsorted(moves["time"], times, side="right") - 1
    move = moves[at]
    share = np.clip((times - move["time"]) / np.maximum(1e-9, move["lasts"]), 0.0, 1.0)
    run, turned = share * move["length"], share * move["length"] * move["curvature"]
    bent = move["curvature"] != 0.0
    curvature = np.where(bent, move["curvature"], 1.0)
    ahead = np.where(bent, np.sin(turned) / curvature, run)
    aside = np.where(bent, (1.0 - np.cos(turned)) / curvature, 0.0)
    ce, cn = move["course_east"], move["course_north"]
    position = np.stack(
        [
            move["east"] + ahead * ce + aside * cn,
            move["north"] + ahead * cn - aside * ce,
            move["up"] + (move["climb"] + move["bend"] * share) * share,
        ],
        axis=1,
    )
    speed = move["length"] / np.maximum(1e-9, move["lasts"])
    east, north = ce * np.cos(turned) + cn * np.sin(turned), cn * np.cos(turned) - ce * np.sin(turned)
    rise = (move["climb"] + 2.0 * move["bend"] * share) / np.maximum(1e-9, move["lasts"])
    velocity = np.stack([speed * east, speed * north, rise], axis=1)
    bank = np.arctan(speed * speed * move["curvature"] / GRAVITY)
    unknown, none_low = np.full(len(times), np.nan), np.zeros(len(times), dtype=np.bool_)
    return ReturnStarts(times, _start_records(position, velocity, bank), unknown, False, none_low)


def _ground_speeds(setup: FlightSetup) -> Floats:
    """Return the ground speed on each leg in the mean wind, m/s.

    The airspeed if the wind leaves no ground speed.
    """
    route, found = setup.route, []
    courses = leg_courses(route.waypoints)
    for leg, speed in enumerate(route.airspeed.tolist()):
        wind = setup.scenario.wind.along(float(courses[leg]), float(route.waypoints[leg, 2]))
        over = ground_speed(speed, *wind)
        found.append(over if over > 0.0 else speed)
    return np.array(found)


def _start_records(position: Floats, velocity: Floats, roll: Floats) -> Records:
    rows: Records = np.zeros(len(position), RETURN_START)
    for k, name in enumerate(("east", "north", "up")):
        rows[name], rows[f"velocity_{name}"] = position[:, k], velocity[:, k]
    rows["roll"] = roll
    return rows
