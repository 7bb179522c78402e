"""Which legs of a route each stretch of a flight was flown on: an imported log may hold a part of them, or none."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.route import part_of_route
from flight.simulation.setup import FlightSetup, Gap, MissionStretch
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track, approaches
from logs.verdict.tolerances import (
    ANOTHER_PLACE,
    ARRIVED,
    CAPTURE_RADIUS,
    IN_ORDER,
    MAX_NEAR,
    MIN_NEAR,
    PARTLY_FLOWN,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FlownLegs:
    """The legs of one stretch.

    stretch: when, and how it ended.
    first, last: waypoints that were flown between.
    partial: whether the last of them was not reached.
    requirements, aligned: of the route between them alone, and the rows flown on it.
    """

    stretch: MissionStretch
    first: int
    last: int
    partial: bool
    requirements: RouteRequirements
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
    whole = route_requirements(setup)
    aligned = align_track(whole, rows)
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
    part = route_requirements(replace(setup, route=part_of_route(setup.route, first, until)))
    laid = align_track(part, flown)
    if laid is None:
        return None
    # A log or a stretch that ends a few metres before the waypoint does not show that it was passed.
    return FlownLegs(stretch, first, until, partial or not bool(laid.passed[-1]), part, laid)


def gaps_between(legs: FlownLegs, start: float, end: float) -> list[Gap]:
    """Pauses of the log between two times, s."""
    source = legs.requirements.setup.source
    return [] if source is None else [gap for gap in source.gaps if gap.start < end and gap.end > start]


def stretch_end_text(stretch: MissionStretch) -> str:
    """How a stretch ended, in words."""
    if stretch.ended == "mode":
        return f"{stretch.mode} was left for {stretch.next_mode} at {stretch.end:.1f} s"
    if stretch.ended == "landed":
        return f"the flight was over at {stretch.end:.1f} s"
    return f"the log ends at {stretch.end:.1f} s"


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
        requirements = route_requirements(replace(setup, route=part_of_route(setup.route, 0, end)))
        laid = align_track(requirements, rows)
        found = met if laid is None else met_waypoints(requirements, laid)
        # Each item once: a place that was passed once is near to its waypoints of all laps.
        if laid is not None and len(np.unique(items[found])) >= len(np.unique(items[met])):
            return laid, found
    return aligned, met


def between(track: Track, start: float, end: float) -> Track:
    """Rows of a track from one time to another, s."""
    low, high = np.searchsorted(track.time, [start, end + 1e-6])
    return track.rows(int(low), int(high))


def met_waypoints(requirements: RouteRequirements, aligned: AlignedTrack) -> NDArray[np.intp]:
    """Waypoints that a flight passed near enough to be told by, in order; one that it began or ended beside is not."""
    edge = np.maximum(requirements.fly_by_offset + ARRIVED, requirements.setup.corridor)
    inside = (aligned.rows > 0) & (aligned.rows < len(aligned.track) - 1)
    near = np.where(inside, aligned.distance < CAPTURE_RADIUS, aligned.distance <= edge)
    return np.flatnonzero(near)


# ----------------------------------------------------------------------
# Is this the plan that was flown at all?  One line that says why not, in place of a fault for every leg of it.

# Waypoints that are named in the order they were passed.
_NAMED = 6


@dataclass(frozen=True, slots=True)
class PlanMismatch:
    """Why a flight was not flown by a plan.

    kind: "place" where it came near none of the plan's waypoints, "order" where it passed them in another order.
    distance: m, to the nearest waypoint, for "place".
    order: items of the waypoints as they were passed, the first of them, for "order".
    """

    kind: str
    distance: float = 0.0
    order: tuple[int, ...] = ()

    @property
    def text(self) -> str:
        """In words."""
        if self.kind == "place":
            far = f"{self.distance / 1000.0:.1f} km" if self.distance >= 1000.0 else f"{self.distance:.0f} m"
            return f"another place: the flight comes no nearer than {far} to any of its waypoints"
        return f"another order: the flight passed its items in the order {', '.join(map(str, self.order))}, ..."


def plan_mismatch(setup: FlightSetup, track: Track) -> PlanMismatch | None:
    """Whether the stretches of a flight that followed a mission followed another one than the setup's; None if not.

    >>> from dataclasses import replace
    >>> from flight.simulation.setup import ImportedLog, MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> source = ImportedLog("a.BIN", "", "", stretches=(MissionStretch(0.0, 36.5, "AUTO", "log"),))
    >>> setup = replace(log.setup, source=source)
    >>> far = replace(log.track, position=log.track.position + np.array([0.0, 9000.0, 0.0]))
    >>> plan_mismatch(setup, log.track) is None, plan_mismatch(setup, far).text
    (True, 'another place: the flight comes no nearer than 8.9 km to any of its waypoints')
    """
    source = setup.source
    stretches = () if source is None else source.stretches
    flown = [between(track, stretch.start, stretch.end) for stretch in stretches]
    flown = [rows for rows in flown if len(rows) > 1]
    points = setup.route.waypoints
    if not flown:
        return None
    nearest, when = _closest(points, flown)
    if nearest.min() > ANOTHER_PLACE:
        return PlanMismatch("place", distance=float(nearest.min()))
    near = min(MAX_NEAR, max(MIN_NEAR, setup.corridor))
    passed = nearest <= near
    if passed.sum() < 3:
        return None
    requirements = route_requirements(setup)
    in_order = np.zeros(len(points), bool)
    for rows in flown:
        aligned = align_track(requirements, rows)
        if aligned is not None:
            low = np.maximum(0, aligned.rows - 1)
            off = np.hypot(*(aligned.track.position[aligned.rows, :2] - points[:, :2]).T)
            # The row that is nearest may be half a step from the waypoint.
            step = np.hypot(*(aligned.track.position[aligned.rows, :2] - aligned.track.position[low, :2]).T)
            in_order |= off <= near + step
    if (in_order & passed).sum() >= IN_ORDER * passed.sum():
        return None
    order = [int(k) for k in np.argsort(when, kind="stable") if passed[k]]
    return PlanMismatch("order", order=tuple(int(setup.route.items[k]) for k in order[:_NAMED]))


def _closest(points: Floats, flown: list[Track]) -> tuple[Floats, Floats]:
    """Least horizontal distance of each waypoint (w,) from the flight, m, and when that was, s."""
    nearest, when = np.full(len(points), np.inf), np.zeros(len(points))
    for rows in flown:
        for k, point in enumerate(points):
            distance, _ = approaches(rows.position, point)
            row = int(np.argmin(distance))
            if distance[row] < nearest[k]:
                nearest[k], when[k] = float(distance[row]), float(rows.time[row])
    return nearest, when
