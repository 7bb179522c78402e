"""Sample the starts of simulated returns to launch (RTL) along a flight or a planned path."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_speed
from flight.autopilots.simulated_returns import RETURN_START
from flight.simulation.setup import FlightSetup
from flight.simulation.track import ROLL, Track
from logs.verdict.measures.ground_paths import first_landing_leg, landing_item, takeoff_item
from logs.verdict.measures.path_moves import path_moves
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    find_leg_winds,
    leg_energies,
    predicted_energy,
    route_requirements,
    true_airspeed_route,
)
from logs.verdict.measures.track_alignment import takeoff_and_approach_rows
from logs.verdict.tolerances import GROUND_LEG_CLEARANCE_M
from world.arrays import Flags, Floats
from world.geometry import leg_courses
from world.kernels import Records

# Time before and after a row over which a missing velocity is computed from positions, s.
_VELOCITY_WINDOW_S = 1.0
# Height lost at the beginning of a return from a final approach with the motor off, before the aircraft climbs, m.
SINK_HEIGHT_LOSS_M = 10.0
# Longest time between the samples of the planned path's height above ground, s.
_PATH_INTERVAL_S = 1.0
# Time in which a return from a descent stops sinking, s: the default of ArduPlane's TECS_TIME_CONST.
SINK_TIME_S = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class ReturnStarts:
    """States of the aircraft at which simulated returns to launch begin.

    time: flight times, s, (n,).
    rows: position, velocity and bank, (n,) of dtype `flight.autopilots.simulated_returns.RETURN_START`.
    energy_used: energy used before the return, Wh, (n,); NaN if unknown.
    is_flown: True for a flown track, False for the planned path.
    is_ground_phase: True for a start in the climb-out of a take-off or the approach of a landing, (n,); see
        `_ground_phase_starts`.
    is_low: True for a start in a flown take-off or landing that is lower above ground than the required clearance plus
        `SINK_HEIGHT_LOSS_M`, (n,).
    height_loss: height above ground that the flight itself loses in the `SINK_TIME_S` after the start, m, (n,).
    grounded_count: number of omitted samples where the aircraft is too slow to fly: at its launch, or after landing.
    """

    time: Floats
    rows: Records
    energy_used: Floats
    is_flown: bool
    is_ground_phase: Flags
    is_low: Flags
    height_loss: Floats
    grounded_count: int = 0

    def __len__(self) -> int:
        """Return the number of starts."""
        return len(self.time)

    def subset(self, indices: NDArray[np.intp]) -> "ReturnStarts":
        """Return the starts with these indices."""
        arrays = (self.time[indices], self.rows[indices], self.energy_used[indices])
        masks = (self.is_ground_phase[indices], self.is_low[indices])
        return ReturnStarts(*arrays, self.is_flown, *masks, self.height_loss[indices], self.grounded_count)


def return_starts(
    setup: FlightSetup, track: Track | None, interval: float, requirements: RouteRequirements | None = None
) -> ReturnStarts:
    """Sample the starts of simulated returns to launch on the flown track.

    Without a flight they lie on the planned path.

    track: flown track; None or without rows if there is none.
    interval: time between two starts, s.
    requirements: the setup's route requirements if already known.
    """
    if track is not None and len(track):
        return flown_starts(setup, track, interval)
    return planned_starts(setup, interval, requirements)


def flown_starts(setup: FlightSetup, track: Track, interval: float) -> ReturnStarts:
    """Sample the starts of simulated returns to launch on a flown track.

    Samples on the ground and samples in the mission's own RTL are left out.

    interval: time between samples, s.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> starts = flown_starts(log.setup, log.track, 0.5)
    >>> starts.is_flown, float(starts.time[0]), bool((np.diff(starts.time) > 0.4).all())
    (True, 0.0, True)
    """
    is_usable = np.isfinite(track.position).all(axis=1) & np.isfinite(track.time)
    if setup.route.rtl_start is not None and setup.imported_log is None:
        is_usable &= track.leg < setup.route.rtl_start
    usable_rows = np.flatnonzero(is_usable)
    if not usable_rows.size:
        return _empty_starts(is_flown=True)
    time = track.time[usable_rows]
    sample_times = np.arange(time[0], time[-1] + 1e-9, interval)
    # Take the next row at or after each sample time; a gap in the log gives only one row.
    sampled_rows = usable_rows[np.unique(np.searchsorted(time, sample_times - 1e-9).clip(0, len(usable_rows) - 1))]
    # Low rows of a take-off or landing, and those of them that are too slow to fly. Without terrain, both are all rows
    # of the take-off and the landing.
    procedures, terrain = setup.ground_phases, setup.scenario.terrain
    is_ground_phase = takeoff_and_approach_rows(track, procedures)[sampled_rows]
    position = np.asarray(track.position[sampled_rows], dtype=np.float64)
    if terrain is None or not procedures:
        is_low, is_slow = is_ground_phase, is_ground_phase.copy()
    else:
        height_above_ground = position[:, 2] - terrain.height(position[:, 0], position[:, 1])
        is_low = is_ground_phase & (height_above_ground < setup.limits.min_clearance + SINK_HEIGHT_LOSS_M)
        min_airspeed = setup.envelope.level_speeds(float(setup.route.positions[0, 2]))[0]
        is_slow = is_low & (track.airspeed[sampled_rows] < min_airspeed)
    start_rows, is_low_start = sampled_rows[~is_slow], is_low[~is_slow]
    velocity = _ground_velocities(track, start_rows)
    roll = track.attitude[start_rows, ROLL].astype(np.float64)
    energy = track.energy[start_rows].astype(np.float64)
    times = track.time[start_rows]
    records = _start_records(times, track.position[start_rows], velocity, np.nan_to_num(roll))
    position = track.position[usable_rows]
    height_loss = _height_losses(setup, time, position, times)
    legs = None if setup.imported_log is not None else track.leg[usable_rows]
    is_ground_phase = is_low_start | _ground_phase_starts(setup, time, position, legs, times)
    return ReturnStarts(times, records, energy, True, is_ground_phase, is_low_start, height_loss, int(is_slow.sum()))


def _empty_starts(*, is_flown: bool) -> ReturnStarts:
    """Return a `ReturnStarts` without any start."""
    mask = np.zeros(0, dtype=np.bool_)
    return ReturnStarts(np.zeros(0), np.zeros(0, RETURN_START), np.zeros(0), is_flown, mask, mask, np.zeros(0))


def _height_losses(setup: FlightSetup, time: Floats, position: Floats, start_times: Floats) -> Floats:
    """Return the height above ground lost in the `SINK_TIME_S` after each start, m, (n,); 0 if unknown.

    time, position: times of the flight, s, (t,), and its positions, m, (t, 3).
    start_times: s, (n,), within these times.
    """
    if setup.scenario.terrain is None:
        return np.zeros(len(start_times))
    heights = position[:, 2] - setup.scenario.terrain.height(position[:, 0], position[:, 1])
    first_rows = np.searchsorted(time, start_times, side="right") - 1
    end_rows = np.searchsorted(time, start_times + SINK_TIME_S, side="right")
    losses = [heights[first] - heights[first:end].min() for first, end in zip(first_rows, end_rows, strict=True)]
    return np.nan_to_num(np.array(losses, dtype=np.float64))


def _ground_phase_starts(
    setup: FlightSetup, time: Floats, position: Floats, legs: NDArray[np.integer[Any]] | None, start_times: Floats
) -> Flags:
    """Return a mask (n,): True for each start in the climb-out of a take-off or the approach of a landing.

    The climb-out lasts until the flight first has the required height above ground, at most up to the end of the leg
    after NAV_TAKEOFF.  The approach begins `SINK_TIME_S` before the flight last has this height, but not before its
    landing sequence.  In an imported log, whose legs are unknown, both belong to a flight that begins or ends lower
    than `GROUND_LEG_CLEARANCE_M`.

    time, position: times of the flight, s, (t,), and its positions, m, (t, 3).
    legs: leg of the route at these times, (t,); None for an imported log.
    start_times: s, (n,), within these times.
    """
    if setup.scenario.terrain is None:
        return np.zeros(len(start_times), dtype=np.bool_)
    heights = position[:, 2] - setup.scenario.terrain.height(position[:, 0], position[:, 1])
    clear_rows = np.flatnonzero(heights >= setup.limits.min_clearance)
    first_clear_time = time[clear_rows[0]] if clear_rows.size else math.inf
    last_clear_time = time[clear_rows[-1]] if clear_rows.size else -math.inf
    if legs is None:
        may_climb_out, may_approach = (np.full(len(time), heights[row] < GROUND_LEG_CLEARANCE_M) for row in (0, -1))
    else:
        (waypoint, take_off), landing = takeoff_item(setup), landing_item(setup)
        may_climb_out = np.full(len(time), take_off is not None) & (legs <= waypoint)
        landing_leg = math.inf if landing is None else first_landing_leg(setup, landing[1].seq, landing[0] - 1)
        may_approach = legs >= landing_leg
    is_ground_phase = (may_climb_out & (time < first_clear_time)) | (
        may_approach & (time >= last_clear_time - SINK_TIME_S)
    )
    return np.asarray(is_ground_phase[np.searchsorted(time, start_times, side="right") - 1])


def _ground_velocities(track: Track, rows: NDArray[np.intp]) -> Floats:
    """Return the ground velocities in n rows of a track, m/s, (n, 3).

    A missing velocity is computed from positions, and is 0 if that is not possible.
    """
    velocity = track.velocity[rows].astype(np.float64)
    for k in np.flatnonzero(~np.isfinite(velocity).all(axis=1)):
        window_rows = np.flatnonzero(np.abs(track.time - track.time[rows[k]]) <= _VELOCITY_WINDOW_S)
        first, last = (window_rows[0], window_rows[-1]) if window_rows.size else (rows[k], rows[k])
        duration = float(track.time[last] - track.time[first])
        velocity[k] = (track.position[last] - track.position[first]) / duration if duration > 0.0 else 0.0
    return np.asarray(np.nan_to_num(velocity))


def planned_starts(setup: FlightSetup, interval: float, requirements: RouteRequirements | None = None) -> ReturnStarts:
    """Sample the starts of simulated returns to launch on the planned path up to the mission's RTL.

    The energy used up to each start is predicted.

    interval: time between samples, s.
    requirements: the setup's route requirements if already known.

    >>> from logs.recording.example_log import example_log
    >>> starts = planned_starts(example_log().setup, 1.0)
    >>> bool(starts.rows["velocity_north"][0] > 0.0), starts.is_flown
    (True, False)
    """
    moves = _moves_before_return(setup)
    if not len(moves):
        return _empty_starts(is_flown=False)
    times, move_numbers, fraction, position = _sample_positions(moves, interval)
    move = moves[move_numbers]
    course_change = fraction * move["length"] * move["curvature"]
    course_east, course_north = move["course_east"], move["course_north"]
    speed = move["length"] / np.maximum(1e-9, move["lasts"])
    east = course_east * np.cos(course_change) + course_north * np.sin(course_change)
    north = course_north * np.cos(course_change) - course_east * np.sin(course_change)
    climb_rate = (move["climb"] + 2.0 * move["bend"] * fraction) / np.maximum(1e-9, move["lasts"])
    velocity = np.stack([speed * east, speed * north, climb_rate], axis=1)
    bank = np.arctan(speed * speed * move["curvature"] / GRAVITY)
    leg_energy = np.array(leg_energies(requirements or route_requirements(setup))[0])
    leg_duration = np.bincount(moves["leg"], weights=moves["lasts"])
    move_energy = leg_energy[moves["leg"]] * moves["lasts"] / np.maximum(1e-9, leg_duration[moves["leg"]])
    energy = np.cumsum(move_energy)[move_numbers] - (1.0 - fraction) * move_energy[move_numbers]
    is_low = np.zeros(len(times), dtype=np.bool_)
    path_times, path_move_numbers, _, path_position = _sample_positions(moves, min(interval, _PATH_INTERVAL_S))
    height_loss = _height_losses(setup, path_times, path_position, times)
    path_legs = moves["leg"][path_move_numbers]
    is_ground_phase = _ground_phase_starts(setup, path_times, path_position, path_legs, times)
    records = _start_records(times, position, velocity, bank)
    return ReturnStarts(times, records, energy, False, is_ground_phase, is_low, height_loss)


def planned_positions(setup: FlightSetup, interval: float) -> tuple[Floats, Floats]:
    """Return times, s, (t,), and positions, m, (t, 3), on the planned path up to the mission's RTL.

    interval: time between samples, s.
    """
    moves = _moves_before_return(setup)
    if not len(moves):
        return np.zeros(0), np.zeros((0, 3))
    times, _, _, position = _sample_positions(moves, interval)
    return times, position


def _moves_before_return(setup: FlightSetup) -> Records:
    """Return the moves of the planned path up to the mission's RTL, of dtype `MOVE`.

    The result is empty if the mission begins with an RTL.
    """
    route = setup.route
    last_leg = (route.legs if route.rtl_start is None else route.rtl_start) - 1
    moves = path_moves(setup.path, _ground_speeds(setup), 0, last_leg)
    return moves[moves["leg"] <= last_leg]


def _sample_positions(moves: Records, interval: float) -> tuple[Floats, NDArray[np.intp], Floats, Floats]:
    """Sample the moves of a planned path at an interval of time.

    moves: at least one straight segment or arc, of dtype `MOVE`.
    interval: time between samples, s.

    Return for each sample its time, s, (t,), the index of its move, (t,), the fraction of this move that is flown,
    (t,), and the position, m, (t, 3).
    """
    times = np.arange(0.0, float(moves["time"][-1] + moves["lasts"][-1]), interval)
    move_numbers = np.searchsorted(moves["time"], times, side="right") - 1
    move = moves[move_numbers]
    fraction = np.clip((times - move["time"]) / np.maximum(1e-9, move["lasts"]), 0.0, 1.0)
    distance = fraction * move["length"]
    course_change = fraction * move["length"] * move["curvature"]
    is_curved = move["curvature"] != 0.0
    curvature = np.where(is_curved, move["curvature"], 1.0)
    ahead = np.where(is_curved, np.sin(course_change) / curvature, distance)
    lateral_offset = np.where(is_curved, (1.0 - np.cos(course_change)) / curvature, 0.0)
    course_east, course_north = move["course_east"], move["course_north"]
    position = np.stack(
        [
            move["east"] + ahead * course_east + lateral_offset * course_north,
            move["north"] + ahead * course_north - lateral_offset * course_east,
            move["up"] + (move["climb"] + move["bend"] * fraction) * fraction,
        ],
        axis=1,
    )
    return times, move_numbers, fraction, position


def return_start_at_track_end(track: Track) -> ReturnStarts:
    """Return the end of a flown track as the only start of a simulated return to launch."""
    row = np.array([len(track) - 1], dtype=np.intp)
    roll = np.nan_to_num(track.attitude[row, ROLL].astype(np.float64))
    records = _start_records(track.time[row], track.position[row], _ground_velocities(track, row), roll)
    energy, mask = track.energy[row].astype(np.float64), np.zeros(1, dtype=np.bool_)
    return ReturnStarts(track.time[row], records, energy, True, mask, mask, np.zeros(1))


def return_start_at_path_end(requirements: RouteRequirements) -> ReturnStarts:
    """Return the end of the planned path as the only start of a simulated return to launch.

    The aircraft is assumed to be flying straight there.  The energy used is predicted.
    """
    course = float(requirements.courses[-1])
    slope = math.tan(float(requirements.slopes[-1]))
    speed = float(_ground_speeds(requirements.setup)[-1])
    velocity = speed * np.array([[math.sin(course), math.cos(course), slope]])
    time = requirements.path.times[-1:]
    energy = np.array([predicted_energy(requirements)[0]])
    records = _start_records(time, requirements.points[-1:], velocity, np.zeros(1))
    mask = np.zeros(1, dtype=np.bool_)
    return ReturnStarts(time, records, energy, False, mask, mask, np.zeros(1))


def _ground_speeds(setup: FlightSetup) -> Floats:
    """Return the ground speed on each leg in the mean wind, m/s.

    It is the true airspeed if the wind is too strong.

    In a forecast, the wind is taken at the midpoint of the leg and the time when the aircraft is there.
    """
    route, speeds = true_airspeed_route(setup), []
    courses, winds = leg_courses(route.positions), find_leg_winds(setup, route)
    for leg, speed in enumerate(route.leg_airspeeds.tolist()):
        wind = winds[leg] if winds else setup.scenario.wind
        components = wind.components_on_course(float(courses[leg]), float(route.positions[leg, 2]))
        speed_over_ground = ground_speed(speed, *components)
        speeds.append(speed_over_ground if speed_over_ground > 0.0 else speed)
    return np.array(speeds)


def _start_records(time: Floats, position: Floats, velocity: Floats, roll: Floats) -> Records:
    """Combine the states of n starts into records of dtype `RETURN_START`.

    time: s after take-off, (n,).
    position: m, (n, 3).
    velocity: ground velocity, m/s, (n, 3).
    roll: rad, (n,).
    """
    rows: Records = np.zeros(len(position), RETURN_START)
    for k, name in enumerate(("east", "north", "up")):
        rows[name], rows[f"velocity_{name}"] = position[:, k], velocity[:, k]
    rows["roll"], rows["time"] = roll, time
    return rows
