"""Is this the plan that was flown at all?  One line that says why not, in place of a fault for every leg of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.field.flown_legs import between
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import approaches, lay_track
from logs.verdict.tolerances import ANOTHER_PLACE, IN_ORDER, NEAR_AT_LEAST, NEAR_AT_MOST

Floats = NDArray[np.float64]

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
    >>> from flight.simulation.field_source import FieldSource, MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> source = FieldSource("a.BIN", "", "", stretches=(MissionStretch(0.0, 36.5, "AUTO", "log"),))
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
    near = min(NEAR_AT_MOST, max(NEAR_AT_LEAST, setup.corridor))
    passed = nearest <= near
    if passed.sum() < 3:
        return None
    demands = route_demands(setup)
    in_order = np.zeros(len(points), bool)
    for rows in flown:
        aligned = lay_track(demands, rows)
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
