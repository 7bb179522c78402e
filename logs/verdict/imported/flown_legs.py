"""Find the legs of a route that were flown in each stretch of an imported log.

A stretch is a part of the log in which the aircraft followed the mission; it may contain only some of the legs.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.route import part_of_route
from flight.simulation.setup import FlightSetup, Gap, MissionStretch
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack, align_track, closest_approaches
from logs.verdict.tolerances import (
    CAPTURE_RADIUS_M,
    FINAL_WAYPOINT_TOLERANCE_M,
    MAX_NEAR_WAYPOINT_M,
    MIN_IN_ORDER_FRACTION,
    MIN_NEAR_WAYPOINT_M,
    PARTIAL_LEG_MIN_S,
    PLAN_MISMATCH_DISTANCE_M,
)


@dataclass(frozen=True, slots=True)
class FlownLegs:
    """Legs of a route that were flown in one stretch of a log.

    stretch: times of the stretch, and how it ended.
    first, last: waypoints between which the stretch was flown.
    partial: True if waypoint `last` was not reached.
    requirements: requirements of the part of the route between these waypoints.
    aligned: track of the stretch, aligned with this part.
    """

    stretch: MissionStretch
    first: int
    last: int
    partial: bool
    requirements: RouteRequirements
    aligned: AlignedTrack


def flown_legs(setup: FlightSetup, track: Track, stretch: MissionStretch) -> FlownLegs | None:
    """Find the legs that the aircraft flew in one stretch of the log; return None if there are none.

    The first leg starts at the first waypoint that was passed, and the last leg ends at the last one.  If the log
    continues for more than `PARTIAL_LEG_MIN_S` beyond it, the next leg is added as a partly flown leg.

    stretch: part of the log in which the aircraft follows the mission.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> found = flown_legs(log.setup, log.track, MissionStretch(0.0, 30.0, "AUTO", "log"))
    >>> found.first, found.last, found.partial
    (0, 2, True)
    """
    rows = rows_between(track, stretch.start, stretch.end)
    whole_requirements = route_requirements(setup)
    aligned = align_track(whole_requirements, rows)
    if aligned is None:
        return None
    waypoint_indices = identified_waypoints(whole_requirements, aligned)
    if not waypoint_indices.size:
        return None
    aligned, waypoint_indices = _earliest_lap(setup, rows, aligned, waypoint_indices)
    first, last = int(waypoint_indices[0]), int(waypoint_indices[-1])
    route_end = len(setup.route.points) - 1
    time_after_last = float(aligned.track.time[-1] - aligned.track.time[aligned.rows[last]])
    is_partial = last < route_end and time_after_last > PARTIAL_LEG_MIN_S
    end = last + 1 if is_partial else last
    if end <= first:
        return None
    # Rows before the first waypoint, and rows after the route's end, belong to no leg.
    end_row = None if is_partial or last < route_end else int(aligned.rows[last]) + 2
    leg_track = aligned.track.rows(int(aligned.rows[first]), end_row if end_row is not None else len(aligned.track))
    part_requirements = route_requirements(replace(setup, route=part_of_route(setup.route, first, end)))
    part_aligned = align_track(part_requirements, leg_track)
    if part_aligned is None:
        return None
    # A log or a stretch that ends a few metres before the last waypoint does not show that the waypoint was passed.
    return FlownLegs(
        stretch, first, end, is_partial or not bool(part_aligned.passed[-1]), part_requirements, part_aligned
    )


def gaps_between(legs: FlownLegs, start: float, end: float) -> list[Gap]:
    """Return the gaps of the log that overlap the time from `start` to `end`, s."""
    imported_log = legs.requirements.setup.imported_log
    return [] if imported_log is None else [gap for gap in imported_log.gaps if gap.start < end and gap.end > start]


def stretch_end_text(stretch: MissionStretch) -> str:
    """Describe how a stretch ended: by a change of mode, the end of the flight, or the end of the log."""
    if stretch.ended == "mode":
        return f"{stretch.mode} was left for {stretch.next_mode} at {stretch.end:.1f} s"
    if stretch.ended == "landed":
        return f"the flight ended at {stretch.end:.1f} s"
    return f"the log ends at {stretch.end:.1f} s"


def _earliest_lap(
    setup: FlightSetup, rows: Track, aligned: AlignedTrack, waypoint_indices: NDArray[np.intp]
) -> tuple[AlignedTrack, NDArray[np.intp]]:
    """Align a track with the earliest matching laps of a repeated route.

    All laps have the same waypoints, so a flight that ended within a lap could otherwise be matched to any later lap.

    rows: track of the stretch.
    aligned, waypoint_indices: this track aligned with the whole route, and the waypoints that it passes.

    Return the new aligned track and its waypoints, or both arguments unchanged if no shorter route matches the track.
    """
    items, last = setup.route.items, int(waypoint_indices[-1])
    if len(waypoint_indices) == last - waypoint_indices[0] + 1:
        return aligned, waypoint_indices
    for end in np.flatnonzero(items[:last] == items[last]).tolist():
        if end < 1:
            continue
        requirements = route_requirements(replace(setup, route=part_of_route(setup.route, 0, end)))
        lap_aligned = align_track(requirements, rows)
        lap_indices = waypoint_indices if lap_aligned is None else identified_waypoints(requirements, lap_aligned)
        # Each item counts once, because a single pass is near the item's waypoints of all laps.
        if lap_aligned is not None and len(np.unique(items[lap_indices])) >= len(np.unique(items[waypoint_indices])):
            return lap_aligned, lap_indices
    return aligned, waypoint_indices


def rows_between(track: Track, start: float, end: float) -> Track:
    """Return the part of a track between two times, s, both included."""
    first_row, end_row = np.searchsorted(track.time, [start, end + 1e-6])
    return track.rows(int(first_row), int(end_row))


def identified_waypoints(requirements: RouteRequirements, aligned: AlignedTrack) -> NDArray[np.intp]:
    """Return the indices, in order, of the waypoints that the track passes closely enough to identify.

    The track must come within `CAPTURE_RADIUS_M` of the place where the planned path passes the waypoint.  If its
    nearest row is its first or last row, it must come closer: within the fly-by offset plus a tolerance, or within the
    corridor, whichever is wider.
    """
    edge_distance = np.maximum(requirements.fly_by_offset + FINAL_WAYPOINT_TOLERANCE_M, requirements.setup.corridor)
    is_inner = (aligned.rows > 0) & (aligned.rows < len(aligned.track) - 1)
    is_near = np.where(is_inner, aligned.apex_distance < CAPTURE_RADIUS_M, aligned.apex_distance <= edge_distance)
    return np.flatnonzero(is_near)


# ----------------------------------------------------------------------
# Check that the flight followed this plan at all.  If not, one line gives the reason instead of a fault for every leg.

# Number of waypoints that are named in the order in which they were passed.
_MAX_NAMED = 6


@dataclass(frozen=True, slots=True)
class PlanMismatch:
    """Reason why a flight did not follow a plan.

    reason: "place" if it came near none of the plan's waypoints, "order" if it passed them in another order.
    distance: for "place", the minimum distance of the flight from a waypoint, m.
    order: for "order", the items of the first waypoints in the order in which they were passed.
    """

    reason: str
    distance: float = 0.0
    order: tuple[int, ...] = ()

    @property
    def text(self) -> str:
        """Text of the reason."""
        if self.reason == "place":
            distance_text = f"{self.distance / 1000.0:.1f} km" if self.distance >= 1000.0 else f"{self.distance:.0f} m"
            return f"the flight is elsewhere, at least {distance_text} from every waypoint"
        return f"the flight passed its items in another order: {', '.join(map(str, self.order))}, ..."


def plan_mismatch(setup: FlightSetup, track: Track) -> PlanMismatch | None:
    """Return the reason why a flight did not follow the setup's mission; None if it did.

    >>> from dataclasses import replace
    >>> from flight.simulation.setup import ImportedLog, MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> source = ImportedLog("a.BIN", "", "", stretches=(MissionStretch(0.0, 36.5, "AUTO", "log"),))
    >>> setup = replace(log.setup, imported_log=source)
    >>> far = replace(log.track, position=log.track.position + np.array([0.0, 9000.0, 0.0]))
    >>> plan_mismatch(setup, log.track) is None, plan_mismatch(setup, far).text
    (True, 'the flight is elsewhere, at least 8.9 km from every waypoint')
    """
    imported_log = setup.imported_log
    stretches = () if imported_log is None else imported_log.stretches
    stretch_tracks = [rows_between(track, stretch.start, stretch.end) for stretch in stretches]
    stretch_tracks = [rows for rows in stretch_tracks if len(rows) > 1]
    points = setup.route.positions
    if not stretch_tracks:
        return None
    # Each waypoint's minimum horizontal distance from the flight, m, and its time, s.
    min_distances, times = np.full(len(points), np.inf), np.zeros(len(points))
    for stretch_track in stretch_tracks:
        for k, point in enumerate(points):
            distance, _ = closest_approaches(stretch_track.position, point)
            row = int(np.argmin(distance))
            if distance[row] < min_distances[k]:
                min_distances[k], times[k] = float(distance[row]), float(stretch_track.time[row])
    if min_distances.min() > PLAN_MISMATCH_DISTANCE_M:
        return PlanMismatch("place", distance=float(min_distances.min()))
    near_distance = min(MAX_NEAR_WAYPOINT_M, max(MIN_NEAR_WAYPOINT_M, setup.corridor))
    is_passed = min_distances <= near_distance
    if is_passed.sum() < 3:
        return None
    requirements = route_requirements(setup)
    is_in_order = np.zeros(len(points), bool)
    for rows in stretch_tracks:
        aligned = align_track(requirements, rows)
        if aligned is not None:
            previous_rows = np.maximum(0, aligned.rows - 1)
            distances = np.hypot(*(aligned.track.position[aligned.rows, :2] - points[:, :2]).T)
            # The nearest row may be half a step from the waypoint.
            steps = np.hypot(*(aligned.track.position[aligned.rows, :2] - aligned.track.position[previous_rows, :2]).T)
            is_in_order |= distances <= near_distance + steps
    if (is_in_order & is_passed).sum() >= MIN_IN_ORDER_FRACTION * is_passed.sum():
        return None
    order = [int(k) for k in np.argsort(times, kind="stable") if is_passed[k]]
    return PlanMismatch("order", order=tuple(int(setup.route.items[k]) for k in order[:_MAX_NAMED]))
