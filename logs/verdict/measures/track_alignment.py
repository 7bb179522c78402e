"""Align a track with a route: find the usable rows, and the rows of each leg.

All findings on a flight use this alignment.  Only time, position, velocity, attitude, airspeed, throttle, wind, current
and energy are read.  The columns that guidance records about itself (leg, cross-track, height error, clearance) are not
read, because a verdict must not depend on them.  The column ``leg`` is written again, by position.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.mission.ground_phases import GroundPhases, airborne_route
from flight.simulation.setup import FlightSetup
from flight.simulation.tick import RTL_ARRIVAL_RADIUS_M
from flight.simulation.track import Track
from logs.verdict.measures.acceptance import acceptance_limit
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_progress import (
    RouteProgress,
    return_loiter_reach,
    route_progress,
    rtl_arrival_circle,
    rtl_waypoints,
)
from logs.verdict.measures.route_requirements import FlownGround, RouteRequirements, route_requirements
from logs.verdict.tolerances import (
    CAPTURE_RADIUS_M,
    CHORD_TIME_S,
    FINAL_WAYPOINT_TOLERANCE_M,
    MAX_PLAUSIBLE_POSITION_M,
    MAX_PLAUSIBLE_SPEED_MPS,
    MAX_PLAUSIBLE_VALUE,
    MIN_AIRBORNE_AIRSPEED_MPS,
    SPEED_MEMORY_S,
)
from world.arrays import Flags, Floats, Singles
from world.kernels import compiled, read_only

RowNumbers = NDArray[np.int64]


# Margin beyond a waypoint's arrival radius, m.  A waypoint was not passed if the route from the track's end to it is
# longer than both together.
_MISSED_MARGIN_M = 50.0
# Largest number of cells in the assignment of rows to waypoints; the track is thinned to stay within it.
_CELLS = 40_000_000


@dataclass(frozen=True)
class AlignedTrack:
    """Track of t usable rows, aligned with a route of w waypoints.

    track: the usable rows.  Their column ``leg`` is the last waypoint that the flight had passed, -1 before the first.
    guidance_legs: leg to which the guidance steered in each row, as recorded, (t,).
    bad_rows: number of rows left out because of non-finite or implausible numbers, or of a time not later than before.
    first_bad: time of the first bad row, s; NaN if there is none.
    apex_distance: distance of the waypoint's row from the point at which the planned path passes it (apex), m, (w,).
    course: course over the ground, unwrapped, rad, (t,).
    distance_run: distance along the ground track, m, (t,).
    clearance, clearance_fraction: minimum height above ground between a row and the next, m, and the fraction of the
        segment at which it occurs, (t - 1,); the height is NaN outside the terrain data and without terrain.
    lift_gain: airspeed gained from rising air, m/s, (t,).
    tick: median time between rows, s.
    draws_current: True if the motor drew current in any row; an aircraft that burns fuel draws none.
    """

    track: Track
    guidance_legs: NDArray[np.int32]
    bad_rows: int
    first_bad: float
    apex_distance: Floats
    course: Floats
    distance_run: Floats
    clearance: Floats
    clearance_fraction: Floats
    lift_gain: Floats
    tick: float
    draws_current: bool

    @cached_property
    def rows(self) -> RowNumbers:
        """Row at which the leg from each waypoint starts, (w,).

        For a waypoint that was not passed, it is the last row.
        """
        first_rows = np.searchsorted(self.track.leg, np.arange(len(self.apex_distance)))
        return np.minimum(first_rows, len(self.track) - 1)

    @cached_property
    def passed(self) -> Flags:
        """Mask of the waypoints that the flight passed, (w,)."""
        return np.asarray(np.arange(len(self.apex_distance)) <= self.track.leg[-1])

    def leg_rows(self, leg: int) -> slice:
        """Return the rows between a leg's two waypoints, both included."""
        return slice(int(self.rows[leg]), int(self.rows[leg + 1]) + 1)

    def leg_ends(self) -> tuple[float, ...]:
        """Return the end time of each leg except the last, s; inf for a leg whose end was not reached."""
        ends = np.where(self.passed, self.track.time[self.rows], math.inf)[1:-1]
        return tuple(ends.tolist())

    def has_flown(self, leg: int) -> bool:
        """Return True if any part of a leg was flown."""
        return bool(self.passed[leg]) and self.rows[leg + 1] > self.rows[leg]

    def leg_segments(self, leg: int) -> tuple[int, int]:
        """Return the range of the track's segments on a leg: the first one, and the one after the last.

        Return (0, 0) for a leg that was not flown.  The first leg includes the track before it, the last leg the track
        after it.  If both waypoints of a short leg were passed at the same row, as within a turn, the leg has the
        segment after this row.
        """
        if not self.has_flown(leg) and not self.passed[leg + 1]:
            return 0, 0
        last_row = len(self.track) - 1
        first = 0 if leg == 0 else int(self.rows[leg])
        end = last_row if leg + 2 == len(self.rows) else int(self.rows[leg + 1])
        return (first, end) if end > first else (min(first, last_row - 1), min(first, last_row - 1) + 1)

    def leg_at(self, row: int) -> int:
        """Return the leg on which a row was flown; the last row belongs to the leg of the row before it."""
        return int(np.clip(self.track.leg[min(row, len(self.track) - 2)], 0, len(self.rows) - 2))

    def position_text(self, row: int, fraction: float = 0.0) -> str:
        """Describe the position in a row, or at a fraction (0 to 1) of the segment to the next row."""
        position = self.track.position
        east, north = (position[row] + fraction * (position[min(row + 1, len(position) - 1)] - position[row]))[:2]
        return f"east {east:.0f} m, north {north:.0f} m"

    def rows_around(self, first: int, last: int, margin: float) -> slice:
        """Return the rows from `first` to `last`, extended by a time `margin` (s) on both sides."""
        time = self.track.time
        start = int(np.searchsorted(time, time[first] - margin))
        return slice(start, int(np.searchsorted(time, time[last] + margin, side="right")))


def align_track(requirements: RouteRequirements, track: Track) -> AlignedTrack | None:
    """Align a track with a route; return None if the track has fewer than two usable rows."""
    is_usable = _usable_rows(track, is_own=requirements.setup.imported_log is None)
    if int(is_usable.sum()) < 2:
        return None
    if is_usable.all():
        usable_track, first_bad = track, math.nan
    else:
        first_bad = float(track.time[int(np.argmin(is_usable))])
        usable_track = Track(*(getattr(track, column.name)[is_usable] for column in fields(track)))
    apexes, last_row = requirements.apexes(), len(usable_track) - 1
    progress = route_progress(
        requirements.setup.route, usable_track.position, starts_anywhere=requirements.setup.imported_log is not None
    )
    centers, arrival_radius = _arrival_circles(requirements)
    route = requirements.setup.route
    ends_at_loiter = requirements.setup.imported_log is None and route.rtl_end > requirements.legs
    if ends_at_loiter and (reach := return_loiter_reach(route, usable_track)):
        # A completed loiter counts as flown, however wide the bank limit and the wind made it.
        arrival_radius[rtl_waypoints(route)] = np.maximum(arrival_radius[rtl_waypoints(route)], reach)
    # Inside an arrival circle that the track enters and never leaves, the aircraft already flies to the next waypoint.
    target, first_rows, last_rows = progress.target, progress.first.copy(), progress.last.copy()
    while target + 1 < len(centers):
        distances = np.hypot(*(usable_track.position[:, :2] - centers[target]).T)
        rows_outside = np.flatnonzero(distances > arrival_radius[target])
        entry_row = int(rows_outside[-1]) + 1 if rows_outside.size else 0
        if entry_row > last_row:
            break
        target += 1
        first_rows[target], last_rows[target] = max(int(first_rows[target - 1]), entry_row), last_row
    progress = replace(progress, first=first_rows, last=last_rows, target=target)
    rows, distance = _find_passage_rows(usable_track, apexes, progress)
    distances = np.hypot(*(usable_track.position[rows, :2] - centers).T)
    # A waypoint was passed if the track continues after its nearest row, or ends within its arrival circle.  A waypoint
    # far ahead along the route was not passed.
    is_far_ahead = progress.remaining_distance > arrival_radius + _MISSED_MARGIN_M
    is_far_ahead[-1] = False
    passed = ((rows < last_row) & ~is_far_ahead) | (distances <= arrival_radius)
    passed &= np.arange(len(rows)) <= progress.target
    passed = np.logical_and.accumulate(passed)
    # If the track ends inside the arrival circle of the last passed waypoint, before the waypoint itself, the autopilot
    # is already on the next leg: the waypoint's row is then the entry into this circle.
    last_passed = int(np.flatnonzero(passed)[-1]) if passed.any() else 0
    if 0 < last_passed < len(rows) - 1 and rows[last_passed] == last_row and not route.arc_radii[last_passed] > 0.0:
        previous_row = int(rows[last_passed - 1])
        distances = np.hypot(*(usable_track.position[previous_row:, :2] - centers[last_passed]).T)
        rows_outside = np.flatnonzero(distances > arrival_radius[last_passed])
        entry_row = previous_row + (int(rows_outside[-1]) + 1 if rows_outside.size else 0)
        rows[: last_passed + 1] = np.minimum(rows[: last_passed + 1], min(last_row - 1, entry_row))
    legs = np.searchsorted(rows[passed], np.arange(last_row + 1), side="right") - 1
    steps = np.diff(usable_track.position[:, :2], axis=0)
    course = np.unwrap(np.arctan2(steps[:, 0], steps[:, 1]))
    terrain = requirements.setup.scenario.terrain
    clearance, clearance_fraction = np.full(last_row, math.nan), np.zeros(last_row)
    if terrain is not None:
        clearance, clearance_fraction = path_clearance(terrain.heights, terrain.to_pixel.record, usable_track.position)
    return AlignedTrack(
        track=replace(usable_track, leg=legs.astype(np.int32)),
        guidance_legs=usable_track.leg,
        bad_rows=int(is_usable.size - is_usable.sum()),
        first_bad=first_bad,
        apex_distance=distance,
        course=np.append(course, course[-1]),
        distance_run=np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))]),
        clearance=clearance,
        clearance_fraction=clearance_fraction,
        lift_gain=airspeed_gain_in_rising_air(usable_track.time, usable_track.airspeed, usable_track.wind[:, 2]),
        tick=float(np.median(np.diff(usable_track.time))),
        draws_current=bool(usable_track.current.any()),
    )


def _arrival_circles(requirements: RouteRequirements) -> tuple[Floats, Floats]:
    """Return the arrival circle of each waypoint as centers, m, (w, 2), and radii, m, (w,).

    A track that ends within a waypoint's arrival circle has passed the waypoint.
    """
    route, follows_path = requirements.setup.route, requirements.setup.autopilot.turns.follows_path
    offsets = requirements.fly_by_offset if follows_path else np.zeros(len(route.points))
    centers, radii = (
        requirements.points[:, :2].copy(),
        np.array(
            [
                max(float(offset) + FINAL_WAYPOINT_TOLERANCE_M, acceptance_limit(requirements, waypoint)[0])
                for waypoint, offset in enumerate(offsets)
            ]
        ),
    )
    loiter_circle = rtl_arrival_circle(route)
    if loiter_circle is not None:
        # The autopilot chooses the path of an RTL and its end on the loiter, so its drawn waypoints are not compared.
        centers[rtl_waypoints(route)], radii[rtl_waypoints(route)] = loiter_circle
    if requirements.setup.autopilot.loiters.steers_to_center:
        # A mission that ends on a loiter may end anywhere on the loiter, which may be flown wider than drawn.
        corner, item = route.arc_radii.size - 1, route.items[-1]
        while corner > 0 and route.items[corner] == item and route.arc_radii[corner - 1]:
            radii[corner] = max(radii[corner], RTL_ARRIVAL_RADIUS_M)
            corner -= 1
    return centers, radii


def project_onto_leg(requirements: RouteRequirements, leg: int, position: Floats) -> tuple[Floats, Floats]:
    """Return along-track and cross-track distances (right positive) from a leg's start, m, (n,) each.

    position: positions, m, (n, 3).
    """
    east, north = position[:, 0] - requirements.points[leg, 0], position[:, 1] - requirements.points[leg, 1]
    ux, uy = math.sin(requirements.courses[leg]), math.cos(requirements.courses[leg])
    return east * ux + north * uy, east * uy - north * ux


def closest_approaches(position: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Return each track segment's minimum horizontal distance from a target, m, and its fraction.

    Both have shape (n - 1,); the fraction is 0 at the start and 1 at the end of the segment.

    position: positions of the track, m, (n, 3).
    target: position, m, (2,) or (3,).
    """
    # Column by column: sums over rows of two numbers take three times as long.
    step_east, step_north = np.diff(position[:, 0]), np.diff(position[:, 1])
    east, north = target[0] - position[:-1, 0], target[1] - position[:-1, 1]
    length_square = np.maximum(step_east * step_east + step_north * step_north, 1e-12)
    fraction = np.clip((step_east * east + step_north * north) / length_square, 0.0, 1.0)
    return np.hypot(east - fraction * step_east, north - fraction * step_north), fraction


def _usable_rows(track: Track, *, is_own: bool) -> NDArray[np.bool_]:
    """Return a mask (t,): True for rows with finite, plausible numbers and an increasing time.

    is_own: True for planfly's own flights, which have all numbers in every row.  In an imported log, only positions and
        velocities are checked here: each rule checks the other data that it needs.
    """
    is_usable = np.isfinite(track.time)
    plausible_bounds: tuple[tuple[str, float], ...] = (
        ("position", MAX_PLAUSIBLE_POSITION_M),
        ("velocity", MAX_PLAUSIBLE_SPEED_MPS),
    )
    if is_own:
        for name in ("airspeed", "current", "energy"):
            is_usable &= np.isfinite(getattr(track, name))
        plausible_bounds = (
            *plausible_bounds,
            ("attitude", MAX_PLAUSIBLE_VALUE),
            ("controls", MAX_PLAUSIBLE_VALUE),
            ("wind", MAX_PLAUSIBLE_VALUE),
        )
    for name, bound in plausible_bounds:
        # Column by column: a reduction of rows of three takes four times as long.  The comparison is False for NaN.
        for column in getattr(track, name).T:
            is_usable &= np.abs(column) <= bound
    time = np.where(is_usable, track.time, -math.inf)
    latest_before = np.concatenate([[-math.inf], np.maximum.accumulate(time)[:-1]]) if time.size else time
    return np.asarray(is_usable & (time > latest_before))


def _find_passage_rows(track: Track, apexes: Floats, progress: RouteProgress) -> tuple[RowNumbers, Floats]:
    """Return the row in which each waypoint was passed, and its distance from the apex (m), (w,) each.

    The row numbers never decrease.  Among the rows along each waypoint's legs, those with the smallest sum of squared
    distances from the apexes are taken.

    apexes: points at which the planned path passes the waypoints, m, (w, 3).
    """
    position, count, last_row = track.position, len(apexes), len(track) - 1
    tick = max(1e-6, float(track.time[-1] - track.time[0]) / last_row)
    step = max(1, int(CHORD_TIME_S / tick), -(-len(track) * count // _CELLS))
    first, last = read_only(progress.first // step), read_only(progress.last // step)
    chords, is_missed = _match_chords(read_only(position), apexes, first, last, step, CAPTURE_RADIUS_M)
    rows = np.zeros(count, dtype=np.int64)
    distance = np.zeros(count)
    # The row of a missed waypoint lies between the rows of its neighbours.  Waypoints after the last captured waypoint
    # get the last row.
    captured_waypoints = np.flatnonzero(~is_missed)
    last_captured = int(captured_waypoints[-1]) if captured_waypoints.size else -1
    previous_row = 0
    for waypoint in range(count):
        if waypoint > last_captured and waypoint > 0:
            start, end = last_row, last_row
        elif is_missed[waypoint]:
            later_captured = captured_waypoints[captured_waypoints > waypoint]
            start, end = (
                previous_row,
                min(last_row, (int(chords[later_captured[0]]) + 1) * step) if later_captured.size else last_row,
            )
        else:
            start, end = (
                max(previous_row, (int(chords[waypoint]) - 1) * step),
                min(last_row, (int(chords[waypoint]) + 2) * step),
            )
        start, end = min(start, last_row), max(min(start, last_row), end)
        offsets = position[start : end + 1] - apexes[waypoint]
        distances = np.sqrt((offsets * offsets).sum(axis=1))
        nearest_row = int(np.argmin(distances))
        rows[waypoint], distance[waypoint] = start + nearest_row, distances[nearest_row]
        previous_row = int(rows[waypoint])
    return rows, distance


@compiled
def airspeed_gain_in_rising_air(time: Floats, airspeed: Singles, vertical_wind: Singles) -> Floats:
    """Return the airspeed that an aircraft on a fixed path gains from rising air, m/s, (t,).

    The gain decays with the time constant `SPEED_MEMORY_S`.
    """
    speed = np.zeros(time.size)
    for k in range(1, time.size):
        step = time[k] - time[k - 1]
        rate = GRAVITY * vertical_wind[k] / max(MIN_AIRBORNE_AIRSPEED_MPS, airspeed[k])
        # A log may lack the airspeed or the wind in some rows.
        rate = rate if math.isfinite(rate) else 0.0
        speed[k] = (speed[k - 1] + rate * step) / (1.0 + step / SPEED_MEMORY_S)
    return speed


@compiled
def _match_chords(
    position: Floats, marks: Floats, first: RowNumbers, last: RowNumbers, step: int, capture: float
) -> tuple[RowNumbers, NDArray[np.bool_]]:
    """Assign each mark, such as a waypoint, to a chord of the track, in order of time.

    A chord is the straight line from a row of the track to the row `step` rows later.  Dynamic programming minimizes
    the sum of min(distance, capture)^2.  The earliest of equally good assignments is taken.

    position, marks: positions of the track, m, (t, 3), and of the marks, m, (n, 3).
    first, last: first and last chord that can capture each mark, (n,).
    capture: distance within which a mark is captured, m.

    Return the chord of each mark, and a mask: True for each mark that is farther than `capture` from all rows of its
    chord.
    """
    last_row = position.shape[0] - 1
    chords = -(-last_row // step)
    count = marks.shape[0]
    cost = np.zeros(chords)
    is_assigned = np.zeros((count, chords), dtype=np.uint8)
    for i in range(count):
        min_total = math.inf
        for j in range(chords):
            start_row, end_row = j * step, min(last_row, (j + 1) * step)
            length_square = 0.0
            projection = 0.0
            offset_square = 0.0
            for k in range(3):
                chord_step = position[end_row, k] - position[start_row, k]
                offset = marks[i, k] - position[start_row, k]
                length_square += chord_step * chord_step
                projection += chord_step * offset
                offset_square += offset * offset
            fraction = min(1.0, max(0.0, projection / length_square)) if length_square > 0.0 else 0.0
            distance_square = max(
                0.0, offset_square - 2.0 * fraction * projection + fraction * fraction * length_square
            )
            if not first[i] <= j <= last[i]:
                distance_square = math.inf
            total = cost[j] + min(distance_square, capture * capture)
            if total < min_total:
                min_total = total
                is_assigned[i, j] = 1
            cost[j] = min_total
    chord_of_mark = np.zeros(count, dtype=np.int64)
    is_missed = np.zeros(count, dtype=np.bool_)
    j = chords - 1
    for i in range(count - 1, -1, -1):
        while is_assigned[i, j] == 0:
            j -= 1
        chord_of_mark[i] = j
        nearest_square = math.inf
        for row in range(j * step, min(last_row, (j + 1) * step) + 1):
            distance_square = 0.0
            for k in range(3):
                distance_square += (marks[i, k] - position[row, k]) ** 2
            nearest_square = min(nearest_square, distance_square)
        is_missed[i] = nearest_square >= capture * capture or not first[i] <= j <= last[i]
    return chord_of_mark, is_missed


# ----------------------------------------------------------------------
# Leg on which each row of a track was flown, found by the same alignment as in the verdict.
#
# The legs that guidance recorded are not read, so that a report's tables and a replay agree with the verdict.

_IGNORED_COLUMNS = ("velocity", "attitude", "airspeed", "controls", "wind", "current", "energy")


def find_leg_ends(setup: FlightSetup, track: Track) -> tuple[float, ...]:
    """Return the end time of each leg except the last, s, for a track without a verdict.

    The time is inf for a leg whose end was not reached.  Only time and position are used.  Return () for a track with
    fewer than two usable rows.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> find_leg_ends(log.setup, log.track)
    (20.0,)
    """
    positions = replace(track, **{name: np.zeros_like(getattr(track, name)) for name in _IGNORED_COLUMNS})
    aligned = align_track(route_requirements(setup), positions)
    return () if aligned is None else aligned.leg_ends()


def with_legs(track: Track, leg_ends: Sequence[float]) -> Track:
    """Return the track with its ``leg`` column computed again from the end times of the legs.

    leg_ends: increasing end times, s, from a `logs.verdict.verdict.Verdict` or from `find_leg_ends`; if empty, all rows
        are on leg 0.
    """
    ends = np.array(leg_ends, dtype=np.float64)
    return replace(track, leg=np.searchsorted(ends, track.time, side="right").astype(np.int32))


# ----------------------------------------------------------------------
# Split a flight that includes ground phases into take-off, airborne part and landing.  The usual rules judge the
# airborne part.  The route of this part begins where the take-off ended, like the autopilot's own first leg, and ends
# at the last waypoint before the landing point.  Only positions and times are used to find the phases.

# Time after the last waypoint at which the airborne part ends, s.
_END_DELAY_S = 2.0


def flown_phases(whole_requirements: RouteRequirements, track: Track) -> tuple[RouteRequirements, AlignedTrack | None]:
    """Return route requirements and aligned track of a flight between take-off and landing.

    The track is None if it has fewer than two usable rows.  For a flight without ground phases, both are those of the
    whole route.

    whole_requirements: requirements of the whole route.
    """
    procedures = whole_requirements.setup.ground_phases
    if not procedures:
        return whole_requirements, align_track(whole_requirements, track)
    start = _takeoff_end_row(track, procedures)
    start_point = np.asarray(track.position[start], dtype=np.float64) if procedures.take_off is not None else None
    setup = whole_requirements.setup
    airborne_setup = replace(setup, route=airborne_route(setup.route, procedures, start_point))
    requirements = route_requirements(airborne_setup, envelope=whole_requirements.envelope)
    airborne_track = track.rows(start, len(track))
    aligned, landing_row = align_track(requirements, airborne_track), len(track) - 1
    if procedures.approach is not None and aligned is not None and aligned.passed[-1]:
        passed_time = float(aligned.track.time[aligned.rows[-1]])
        landing_row = min(landing_row, int(np.searchsorted(track.time, passed_time)))
        end_row = int(np.searchsorted(track.time, passed_time + _END_DELAY_S, side="right"))
        aligned = align_track(requirements, track.rows(start, end_row))
    ground_phases = FlownGround(procedures, whole_requirements, track, start, landing_row)
    return replace(requirements, ground_phases=ground_phases), aligned


def _takeoff_end_row(track: Track, procedures: GroundPhases) -> int:
    """Return the row at which the take-off ended; 0 without a take-off, the last row if it never ended."""
    if procedures.take_off is None:
        return 0
    is_above = track.position[:, 2] > procedures.take_off.end_altitude
    return int(np.argmax(is_above)) if is_above.any() else len(track) - 1


def takeoff_and_approach_rows(track: Track, procedures: GroundPhases) -> Flags:
    """Return a mask of the rows of the take-off, and from the start of the approach leg on, (t,).

    A phase that the flight does not simulate has no rows.  The example's flight has neither phase:

    >>> from logs.recording.example_log import example_log
    >>> bool(takeoff_and_approach_rows(example_log().track, GroundPhases()).any())
    False
    """
    is_ground_phase = np.arange(len(track)) < _takeoff_end_row(track, procedures)
    if procedures.approach is not None:
        is_ground_phase |= track.leg >= procedures.approach.leg
    return np.asarray(is_ground_phase)


def leg_ends(requirements: RouteRequirements, aligned: AlignedTrack) -> tuple[float, ...]:
    """Return the end time of each leg except the last, s, for the whole route including its landing.

    The time is inf for a leg whose end was not reached.
    """
    ground_phases, end_times = requirements.ground_phases, aligned.leg_ends()
    if ground_phases is None or ground_phases.procedures.approach is None:
        return end_times
    return (
        *end_times,
        float(ground_phases.track.time[ground_phases.landing_start_row]) if aligned.passed[-1] else float("inf"),
    )
