"""Match a track to its route by positions alone, to find how far it came and the rows along each leg.

A route that returns to its start, or repeats a lap, passes the same place several times.  The whole track is therefore
matched to the whole route: both only go forward, and the track may end anywhere on the route.  Data that guidance
recorded about itself are not read.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.guidance.equivalent_airspeed import eas_to_tas_ratio
from flight.mission.itinerary import ENDLESS_LOITER_TIME_S
from flight.mission.route import Route
from flight.simulation.tick import (
    END_LOITER_ANGLE_RAD,
    RTL_ARRIVAL_ALTITUDE_TOLERANCE_M,
    RTL_ARRIVAL_LOITER_RADII,
    RTL_ARRIVAL_RADIUS_M,
)
from flight.simulation.track import Track
from logs.verdict.tolerances import CAPTURE_RADIUS_M
from world.arrays import Floats
from world.kernels import compiled, read_only

Numbers = NDArray[np.int64]

# Distance between samples of route and track, m.  It is larger if the table of costs would exceed `_MAX_CELLS`.
_SAMPLE_SPACING_M = 20.0
# Largest number of cells of the table of costs.
_MAX_CELLS = 16_000_000
# Length of track before and after the rows along a waypoint's two legs in which the nearest row is also searched, m.
_WINDOW_MARGIN_M = 300.0
# Cost of a part of the route to which no part of the track is matched, as a fraction of its squared distance.
_SKIP_FRACTION = 0.1
# Distance whose square is added to the cost of a skipped part of the route, m.
_SKIP_DISTANCE_M = 15.0
# Distance whose square is the cost of each route sample before the start, m.  A flight that may begin anywhere on the
# route thus begins at the earliest of equally near samples.
_LATE_START_M = 1.0
# Largest distance of a flown loiter from its drawn circle, m; the number of laps does not matter here.
_LOITER_MARGIN_M = 60.0
# Angle by which a logged loiter may fall short of a full lap, rad.  The rows may miss 1 s of the loiter, in which an
# aircraft at 26 m/s turns by this angle on a radius of 260 m.
_LAP_TOLERANCE_RAD = 0.1


@dataclass(frozen=True, slots=True)
class RouteProgress:
    """Progress of a track along a route of w waypoints.

    first, last: rows between which each waypoint may have been passed, (w,); first > last for a waypoint to which the
        aircraft never flew.
    target: waypoint to which the aircraft was flying, or at which it was, when the flight ended.
    remaining_distance: distance along the route from the track's end to each waypoint, m, (w,); negative for waypoints
        before the track's end.
    """

    first: Numbers
    last: Numbers
    target: int
    remaining_distance: Floats


@dataclass(frozen=True, slots=True)
class _Samples:
    """Sampled positions along a route, in flying order.

    positions: m, (m, 2).
    radii: radius within which each sample is reached, m, (m,); 0 on a leg, the reach of the circle for a loiter.
    distances: distance from the route's start, m, (m,).
    sample_of_waypoint: index of each waypoint's sample, (w,); the corners of a loiter share one sample.
    """

    positions: Floats
    radii: Floats
    distances: Floats
    sample_of_waypoint: Numbers


def route_progress(route: Route, position: Floats, *, starts_anywhere: bool) -> RouteProgress:
    """Match a track to a route by positions alone, and return its progress along the route.

    position: positions in at least two usable rows, m, (t, 3).
    starts_anywhere: True if the track may begin anywhere on the route, like a part of an imported log; False if it
        begins at the route's start.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> route_progress(log.setup.route, log.track.position, starts_anywhere=False).target
    2
    """
    steps = np.hypot(*np.diff(position[:, :2], axis=0).T)
    distance_run = np.concatenate([[0.0], np.cumsum(steps)])
    length = float(np.hypot(*np.diff(route.positions[:, :2], axis=0).T).sum())
    spacing = max(_SAMPLE_SPACING_M, math.sqrt(max(1.0, length) * max(1.0, float(distance_run[-1])) / _MAX_CELLS))
    samples = _sample_route(route, spacing)
    rows = np.unique(
        np.searchsorted(distance_run, np.append(np.arange(0.0, distance_run[-1], spacing), distance_run[-1]))
    )
    ends = _match_rows(
        read_only(np.ascontiguousarray(position[rows, :2])),
        read_only(samples.positions),
        read_only(samples.radii),
        CAPTURE_RADIUS_M,
        starts_anywhere,
    )
    begin_rows, end_rows = rows[ends[:, 0]], rows[ends[:, 1]]
    final_sample = int(np.flatnonzero(ends[:, 0] >= 0)[-1])
    count = len(route.points)
    target = min(count - 1, int(np.searchsorted(samples.sample_of_waypoint, final_sample, side="right")))
    while target + 1 < count and samples.sample_of_waypoint[target + 1] == samples.sample_of_waypoint[target]:
        target += 1
    first, last = np.full(count, len(distance_run)), np.full(count, -1)
    for waypoint in range(target + 1):
        sample = int(samples.sample_of_waypoint[waypoint])
        earlier_samples = samples.sample_of_waypoint[samples.sample_of_waypoint < sample]
        later_samples = samples.sample_of_waypoint[samples.sample_of_waypoint > sample]
        first_sample = int(earlier_samples[-1]) if earlier_samples.size else 0
        last_sample = min(final_sample, int(later_samples[0]) if later_samples.size else len(samples.distances) - 1)
        matched_samples = np.flatnonzero(ends[first_sample : last_sample + 1, 0] >= 0) + first_sample
        if matched_samples.size:
            first[waypoint] = np.searchsorted(
                distance_run, distance_run[begin_rows[matched_samples[0]]] - _WINDOW_MARGIN_M
            )
            last[waypoint] = (
                np.searchsorted(
                    distance_run, distance_run[end_rows[matched_samples[-1]]] + _WINDOW_MARGIN_M, side="right"
                )
                - 1
            )
    remaining_distance = samples.distances[samples.sample_of_waypoint] - samples.distances[final_sample]
    return RouteProgress(first, last, target, remaining_distance)


def _sample_route(route: Route, spacing: float) -> _Samples:
    """Sample the legs of a route about every `spacing` (m); each loiter is one sample."""
    points, rtl_circle = route.positions[:, :2], rtl_arrival_circle(route)
    positions, radii, distances = [points[:1]], [np.zeros(1)], [np.zeros(1)]
    sample_of_waypoint = np.zeros(len(points), dtype=np.int64)
    sample_count = 1
    for waypoint in range(1, len(points)):
        start, end = points[waypoint - 1], points[waypoint]
        if (
            route.arc_radii[waypoint] > 0.0
            and route.arc_radii[waypoint - 1] > 0.0
            and route.stops[waypoint] == route.stops[waypoint - 1]
        ):
            sample_of_waypoint[waypoint] = sample_of_waypoint[waypoint - 1]
            continue
        length = math.dist(start, end)
        count = max(1, math.ceil(length / spacing))
        fractions = np.arange(1, count + 1) / count
        positions.append(start + fractions[:, None] * (end - start))
        radii.append(np.zeros(count))
        distances.append(distances[-1][-1] + fractions * length)
        sample_count += count
        sample_of_waypoint[waypoint] = sample_count - 1
        if route.arc_radii[waypoint] > 0.0:
            corners = [
                k
                for k in range(waypoint, len(points))
                if route.stops[k] == route.stops[waypoint] and route.arc_radii[waypoint : k + 1].all()
            ]
            # Only the last arcs of an RTL are its loiter; earlier arcs are turns.
            is_rtl_loiter = (
                corners[0] in rtl_waypoints(route) and not route.arc_radii[corners[-1] + 1 : route.rtl_end].any()
            )
            if rtl_circle is not None and is_rtl_loiter:
                positions[-1][-1], radii[-1][-1] = rtl_circle
            else:
                center = 0.5 * (points[corners].min(axis=0) + points[corners].max(axis=0))
                positions[-1][-1] = center
                radii[-1][-1] = float(np.hypot(*(points[corners] - center).T).max()) + _LOITER_MARGIN_M
    return _Samples(np.concatenate(positions), np.concatenate(radii), np.concatenate(distances), sample_of_waypoint)


def rtl_waypoints(route: Route) -> range:
    """Return the waypoints that stand for an RTL; empty without an RTL.

    The autopilot chooses the actual path of the RTL.
    """
    return range(0) if route.rtl_start is None else range(route.rtl_start + 1, route.rtl_end)


def rtl_arrival_circle(route: Route) -> tuple[Floats, float] | None:
    """Return the center of an RTL's loiter, m, (2,), and its arrival radius, m.

    Return None without an RTL loiter.

    An RTL has arrived once the aircraft is within the arrival radius of the center.  A simulated flight arrives within
    the same radius (`flight.simulation.tick.update_rtl_loiter`), which does not depend on the waypoints that represent
    the loiter.
    """
    loiter = route.rtl_loiter
    if loiter is None:
        return None
    # True radii grow with altitude as the square of true airspeed.
    radius = abs(loiter.radius) * eas_to_tas_ratio(loiter.up) ** 2
    return np.array(loiter[:2]), max(RTL_ARRIVAL_RADIUS_M, RTL_ARRIVAL_LOITER_RADII * radius)


def return_loiter_reach(route: Route, track: Track) -> float | None:
    """Return the largest distance from the center of an RTL loiter, m.

    Return None if the loiter was not completed.

    The loiter is complete after `ENDLESS_LOITER_TIME_S` and one lap.  Both begin when the aircraft is near the center
    and at the loiter's altitude, as in a simulated flight (`flight.simulation.tick.update_rtl_loiter`).  An aircraft
    whose bank limit or wind does not allow the loiter's radius flies wider than the arrival radius, or flies circles
    that do not contain the center.  A lap is therefore also complete after a course change of `END_LOITER_ANGLE_RAD`,
    which includes a quarter turn onto the circle.
    """
    loiter, arrival_circle = route.rtl_loiter, rtl_arrival_circle(route)
    if loiter is None or arrival_circle is None:
        return None
    east, north, up = (track.position - (loiter.east, loiter.north, loiter.up)).T
    distances = np.hypot(east, north)
    is_at_loiter = (distances < arrival_circle[1]) & (np.abs(up) < RTL_ARRIVAL_ALTITUDE_TOLERANCE_M)
    first = int(np.argmax(is_at_loiter))
    if not is_at_loiter.any() or float(track.time[-1] - track.time[first]) < ENDLESS_LOITER_TIME_S:
        return None
    bearings = np.unwrap(np.arctan2(east[first:], north[first:]))
    courses = np.unwrap(np.arctan2(*track.velocity[first:, :2].T.astype(np.float64)))
    has_circled = (
        abs(float(bearings[-1] - bearings[0])) >= 2.0 * math.pi - _LAP_TOLERANCE_RAD
        or abs(float(courses[-1] - courses[0])) >= END_LOITER_ANGLE_RAD
    )
    return float(distances[first:].max()) if has_circled else None


@compiled
def _match_rows(track: Floats, samples: Floats, radii: Floats, capture: float, starts_anywhere: bool) -> Numbers:
    """Match the rows of a track to the samples of a route, both in order, at the lowest total cost.

    Dynamic programming fills a table of rows and samples: a cell holds the lowest cost of all matches in which this row
    is at this sample.  A match gets there from the sample before, stays at the sample, skips it, or starts there.  A
    row costs min(distance, capture)^2.  A skipped sample costs `_SKIP_FRACTION` of this plus `_SKIP_DISTANCE_M`^2.  A
    start at a later sample costs `_LATE_START_M`^2 for each sample before it.  If several ends have the same cost, the
    earliest is taken.

    track: positions, m, (n, 2).
    samples, radii: route samples, m, (m, 2), and the radii within which they are reached, m, (m,).
    capture: distance beyond which the cost of a row does not increase, m.
    starts_anywhere: True if the track may begin at any sample; False if it begins at the first.

    Return the first and the last row at each sample, (m, 2); -1 for samples before the track's start or after its end.
    """
    rows, count = track.shape[0], samples.shape[0]
    # Move by which each row came to each sample: 0 from the sample before, 1 the row before was at the same sample,
    # 2 the sample is skipped, 3 the track starts there.
    moves = np.zeros((rows, count), dtype=np.uint8)
    total = np.zeros(count)
    for i in range(rows):
        advancing_cost = math.inf
        for j in range(count):
            # Without math.hypot, which takes five times as long.
            east, north = track[i, 0] - samples[j, 0], track[i, 1] - samples[j, 1]
            distance = math.sqrt(east * east + north * north) - radii[j]
            cost = min(max(0.0, distance), capture) ** 2
            waiting_cost = total[j]
            if i == 0:
                min_cost, move = cost + j * _LATE_START_M**2 if starts_anywhere or j == 0 else math.inf, 3
            elif waiting_cost <= advancing_cost:
                min_cost, move = waiting_cost + cost, 1
            else:
                min_cost, move = advancing_cost + cost, 0
            if j > 0:
                skipping_cost = total[j - 1] + _SKIP_FRACTION * cost + _SKIP_DISTANCE_M**2
                if skipping_cost < min_cost:
                    min_cost, move = skipping_cost, 2
            advancing_cost = waiting_cost
            total[j] = min_cost
            moves[i, j] = move
    ends = np.full((count, 2), -1, dtype=np.int64)
    i, j = rows - 1, int(np.argmin(total))
    ends[j, 0], ends[j, 1] = i, i
    while moves[i, j] != 3:
        move = moves[i, j]
        if move != 2:
            i -= 1
        if move != 1:
            j -= 1
            ends[j, 1] = i
        ends[j, 0] = i
    return ends
