"""Which legs of a route each stretch of a flight was flown on: a log of the field may hold a part of them, or none."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.route import Route
from flight.simulation.field_source import MissionStretch
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_demands import RouteDemands, route_demands
from logs.verdict.measures.track_alignment import AlignedTrack, lay_track
from logs.verdict.tolerances import ARRIVED, CAPTURE_RADIUS, PARTLY_FLOWN

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FlownLegs:
    """The legs of one stretch.

    stretch: when, and how it ended.
    first, last: waypoints that were flown between.
    partial: whether the last of them was not reached.
    demands, aligned: of the route between them alone, and the rows flown on it.
    """

    stretch: MissionStretch
    first: int
    last: int
    partial: bool
    demands: RouteDemands
    aligned: AlignedTrack


def flown_legs(setup: FlightSetup, track: Track, stretch: MissionStretch) -> FlownLegs | None:
    """Find the legs of a stretch; None where it met no waypoint but at most one, or has fewer than two rows.

    A flight begins with the first waypoint that it passed: what was flown to get there is no leg.  It ends with the
    last that it passed, or on the leg from there, which was then flown in part.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> found = flown_legs(log.setup, log.track, MissionStretch(0.0, 30.0, "AUTO", "log"))
    >>> found.first, found.last, found.partial
    (0, 2, True)
    """
    rows = between(track, stretch.start, stretch.end)
    whole = route_demands(setup)
    aligned = lay_track(whole, rows)
    if aligned is None:
        return None
    met = met_waypoints(whole, aligned)
    if not met.size:
        return None
    aligned, met = _earliest_lap(setup, rows, aligned, met)
    first, last = int(met[0]), int(met[-1])
    ended = len(setup.route.waypoints) - 1
    behind = float(aligned.track.time[-1] - aligned.track.time[aligned.rows[last]])
    partial = last < ended and behind > PARTLY_FLOWN
    until = last + 1 if partial else last
    if until <= first:
        return None
    # Rows before the first waypoint are of no leg, and rows after the route's end are none of it.
    stop = None if partial or last < ended else int(aligned.rows[last]) + 2
    flown = aligned.track.rows(int(aligned.rows[first]), stop if stop is not None else len(aligned.track))
    part = route_demands(replace(setup, route=part_of_route(setup.route, first, until)))
    laid = lay_track(part, flown)
    if laid is None:
        return None
    # A log or a stretch that ends a few metres before the waypoint does not show that it was passed.
    return FlownLegs(stretch, first, until, partial or not bool(laid.passed[-1]), part, laid)


def _earliest_lap(
    setup: FlightSetup, rows: Track, aligned: AlignedTrack, met: NDArray[np.intp]
) -> tuple[AlignedTrack, NDArray[np.intp]]:
    """Rows laid beside the first laps of a route that comes by the same items again, if they do for the flight.

    One that ended on the way was as near to the waypoints of any later lap.
    """
    items, last = setup.route.items, int(met[-1])
    if len(met) == last - met[0] + 1:
        return aligned, met
    for end in np.flatnonzero(items[:last] == items[last]).tolist():
        if end < 1:
            continue
        demands = route_demands(replace(setup, route=part_of_route(setup.route, 0, end)))
        laid = lay_track(demands, rows)
        found = met if laid is None else met_waypoints(demands, laid)
        # Each item once: a place that was passed once is near to its waypoints of all laps.
        if laid is not None and len(np.unique(items[found])) >= len(np.unique(items[met])):
            return laid, found
    return aligned, met


def between(track: Track, start: float, end: float) -> Track:
    """Rows of a track from one time to another, s."""
    low, high = np.searchsorted(track.time, [start, end + 1e-6])
    return track.rows(int(low), int(high))


def met_waypoints(demands: RouteDemands, aligned: AlignedTrack) -> NDArray[np.intp]:
    """Waypoints that a flight passed near enough to be told by, in order; one that it began or ended beside is not."""
    edge = np.maximum(demands.fly_by_offset + ARRIVED, demands.setup.corridor)
    inside = (aligned.rows > 0) & (aligned.rows < len(aligned.track) - 1)
    near = np.where(inside, aligned.distance < CAPTURE_RADIUS, aligned.distance <= edge)
    return np.flatnonzero(near)


def part_of_route(route: Route, first: int, last: int) -> Route:
    """A route from one of its waypoints to another, both included.

    >>> way = np.array([[0.0, 1000.0 * k, 300.0] for k in range(4)])
    >>> whole = Route(way, np.full(3, 25.0), np.zeros(4), np.zeros(4, bool), np.arange(4), "")
    >>> part_of_route(whole, 1, 3).items.tolist()
    [1, 2, 3]
    """
    if (first, last) == (0, route.legs):
        return route
    points = slice(first, last + 1)
    return replace(
        route,
        waypoints=route.waypoints[points],
        airspeed=route.airspeed[first:last],
        acceptance=route.acceptance[points],
        fly_over=route.fly_over[points],
        items=route.items[points],
        arcs=route.arcs[points],
        endless=-1,
        takeoff_ground=route.takeoff_ground if first == 0 else math.nan,
        landing_ground=route.landing_ground if last == route.legs else math.nan,
    )
