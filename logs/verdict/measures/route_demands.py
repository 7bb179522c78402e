"""What a route asks of the aircraft and what the aircraft's limits are: the planned side of every finding."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import BLEND_ACCELERATION, Limits, PerformanceTable, aircraft_slopes, ground_speed_on
from flight.ardupilot.pilot import true_by_equivalent
from flight.guidance.fly_by_path import FlyByPath, path_polyline
from flight.mission.route import Route
from flight.simulation.flight_setup import FlightSetup
from logs.verdict.measures.airspace import Airspace, airspace_of
from logs.verdict.measures.turn_demands import TurnDemands, performance_tables, turn_demands
from logs.verdict.places import Place
from logs.verdict.tolerances import LARGEST_OFFSET
from world.geometry import fly_by_offset, leg_courses, leg_runs, leg_slopes

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PlannedPath:
    """The fly-by path as a chain of n points.

    points: (n, 3) m.
    legs: (n - 1,) leg of each segment.
    times: (n,) s at which each point is passed.
    """

    points: Floats
    legs: NDArray[np.int64]
    times: Floats


@dataclass(frozen=True, slots=True)
class RouteDemands:
    """A route's turns and legs in numbers, the aircraft's limits at each, and its planned path: made once a verdict.

    route: the setup's, with true airspeeds where an autopilot takes those that are commanded for equivalent ones.

    For w waypoints:

    points: (w, 3) m.
    runs: (w - 1,) m, horizontal.
    courses, slopes: (w - 1,) rad.
    turns, tightest, radius, before, after, reversal: as of `TurnDemands`.
    blend: (w,) m of leg beyond each turn on which the slope still changes.
    fly_by_offset: (w,) m by which the fly-by passes the waypoint.
    turn_limit: (w,) rad, as `TurnDemands.limit`; inf where the envelope is left out.
    climb, dive: (w - 1,) rad over the ground, the least along the leg, inf where the envelope is left out.
    ground_speed: (w - 1,) m/s, NaN where the wind leaves no way.
    envelope: whether the aircraft's limits count; where they do not, what the flight showed of them does.
    airspace: the zones of scenario and mission.
    """

    setup: FlightSetup
    route: Route
    points: Floats
    runs: Floats
    courses: Floats
    slopes: Floats
    turns: Floats
    tightest: Floats
    radius: Floats
    before: Floats
    after: Floats
    reversal: Floats
    blend: Floats
    fly_by_offset: Floats
    turn_limit: Floats
    climb: Floats
    dive: Floats
    ground_speed: Floats
    path: PlannedPath
    envelope: bool
    airspace: Airspace

    @property
    def limits(self) -> Limits:
        """Limits of scenario and aircraft."""
        return self.setup.limits

    @property
    def legs(self) -> int:
        """How many legs there are."""
        return len(self.runs)

    @property
    def limits_source(self) -> str:
        """Whose the limits of the scenario are: planfly's own where the mission came without one."""
        return "default" if self.setup.scenario.external else "scenario"

    def waypoint(self, index: int) -> Place:
        """A waypoint as the place of a finding."""
        return Place("waypoint", index, self._item(index))

    def leg(self, index: int) -> Place:
        """A leg as the place of a finding, with the item that it leads to."""
        return Place("leg", index, to_item=self._item(index + 1))

    def _item(self, waypoint: int) -> int | None:
        item = int(self.setup.route.items[waypoint])
        return None if item < 0 else item

    def leg_unit(self, leg: int) -> Floats:
        """East and north components of a leg's course, (2,)."""
        return np.array([math.sin(self.courses[leg]), math.cos(self.courses[leg])])

    def apexes(self) -> Floats:
        """Where the fly-by path passes each waypoint: the middles of the arcs, (w, 3) m."""
        out = self.points.copy()
        for i in range(1, len(out) - 1):
            if self.fly_by_offset[i] > 0.0:
                inward = self.leg_unit(i) - self.leg_unit(i - 1)
                out[i, :2] += self.fly_by_offset[i] * inward / math.hypot(*inward)
                # Halfway between the heights at the arc's ends.
                tangent = min(self.before[i], self.runs[i - 1], self.runs[i])
                out[i, 2] += 0.5 * tangent * (math.tan(self.slopes[i]) - math.tan(self.slopes[i - 1]))
        return out


def route_demands(setup: FlightSetup, *, envelope: bool = True) -> RouteDemands:
    """Work out what a setup's route asks for.

    envelope: False leaves the aircraft's limits out, for flown evidence alone.
    """
    route, limits = true_route(setup), setup.limits
    points = np.asarray(route.waypoints, dtype=np.float64)
    tables = performance_tables(route, limits)
    turning = turn_demands(route, tables)
    courses, runs = leg_courses(points), leg_runs(points)
    climb, dive, speeds = _leg_limits(route, tables, points, courses)
    if not envelope:
        climb, dive = np.full_like(climb, math.inf), np.full_like(dive, math.inf)
    return RouteDemands(
        setup=setup,
        route=route,
        points=points,
        runs=runs,
        courses=courses,
        slopes=leg_slopes(points),
        turns=turning.turns,
        tightest=turning.tightest,
        radius=turning.radius,
        before=turning.before,
        after=turning.after,
        reversal=turning.reversal,
        blend=_blends(setup, route, points, runs, turning),
        fly_by_offset=_fly_by_offsets(route, turning),
        turn_limit=turning.limit if envelope else np.full(len(points), math.inf),
        climb=climb,
        dive=dive,
        ground_speed=speeds,
        path=_planned_path(setup.path, route, speeds),
        envelope=envelope,
        airspace=airspace_of(setup),
    )


def true_route(setup: FlightSetup) -> Route:
    """A setup's route with true airspeeds.  ArduPlane flies equivalent ones: each leg's counts at its middle height.

    >>> from flight.ardupilot.parameters import default_parameters
    >>> from logs.recording.example_log import example_log
    >>> setup = example_log().setup
    >>> true_route(setup) is setup.route
    True
    >>> faster = true_route(replace(setup, parameters=default_parameters()))
    >>> bool((faster.airspeed > setup.route.airspeed).all())
    True
    """
    route = setup.route
    if setup.parameters is None:
        return route
    middle = 0.5 * (route.waypoints[1:, 2] + route.waypoints[:-1, 2])
    return replace(route, airspeed=route.airspeed * [float(true_by_equivalent(up)) for up in middle])


def _planned_path(path: FlyByPath, route: Route, ground_speed: Floats) -> PlannedPath:
    points, legs = path_polyline(path)
    speed = np.where(np.isfinite(ground_speed), ground_speed, route.airspeed)
    run = np.hypot(*np.diff(points[:, :2], axis=0).T)
    return PlannedPath(points, legs, np.concatenate([[0.0], np.cumsum(run / speed[legs])]))


def _leg_limits(
    route: Route, tables: dict[float, PerformanceTable], points: Floats, courses: Floats
) -> tuple[Floats, Floats, Floats]:
    """Climb and dive over the ground, rad, and ground speed, m/s, that the aircraft has all along each leg."""
    legs = len(courses)
    climb, dive, speeds = np.zeros(legs), np.zeros(legs), np.zeros(legs)
    for leg in range(legs):
        table, course = tables[float(route.airspeed[leg])], float(courses[leg])
        heights = (points[leg, 2], 0.5 * (points[leg, 2] + points[leg + 1, 2]), points[leg + 1, 2])
        speeds[leg] = min(ground_speed_on(table, course, up) for up in heights)
        if any(math.isnan(ground_speed_on(table, course, up)) for up in heights):
            speeds[leg] = math.nan
        climb[leg], dive[leg] = np.min([aircraft_slopes(table, course, up) for up in heights], axis=0)
    return climb, dive, speeds


def _fly_by_offsets(route: Route, turning: TurnDemands) -> Floats:
    """Distance by which the fly-by passes each waypoint, (w,) m."""
    out = np.zeros(len(turning.radius))
    for i in np.flatnonzero(np.isfinite(turning.radius) & ~route.fly_over).tolist():
        radius = float(turning.radius[i])
        out[i] = min(fly_by_offset(abs(float(turning.turns[i])), radius), LARGEST_OFFSET * radius)
    return out


def _blends(setup: FlightSetup, route: Route, points: Floats, runs: Floats, turning: TurnDemands) -> Floats:
    """Length of leg beside each turn on which the slope still changes, (w,) m.

    A parabola about each end of the arc, or about the waypoint where there is none.
    """
    rise = np.diff(points[:, 2]) / np.maximum(runs, 1.0)
    blend = np.zeros(len(points))
    speed = float(route.airspeed.max()) + setup.scenario.wind.strongest(points[:, 2])
    for i in range(1, len(points) - 1):
        steps = [abs(rise[i] - rise[i - 1])]
        arc = turning.radius[i] * abs(turning.turns[i])
        if 0.0 < arc < math.inf and math.isfinite(turning.after[i]) and not setup.route.fly_over[i]:
            # The arc is shorter than its two tangents, so that its slope is steeper than the legs'.
            on_arc = (rise[i - 1] + rise[i]) * turning.after[i] / arc
            steps = [abs(on_arc - rise[i - 1]), abs(on_arc - rise[i])]
        blend[i] = max(steps) * speed**2 / (2.0 * BLEND_ACCELERATION)
    return blend
