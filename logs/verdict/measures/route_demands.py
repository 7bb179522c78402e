"""What a route asks of the aircraft and what the aircraft can: the planned side of every finding."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import (
    BLEND_ACCELERATION,
    Limits,
    PerformanceTable,
    aircraft_slopes,
    downwind,
    fly_over_run,
    ground_speed_on,
    roll_reversal_length,
    turn_radius_between,
)
from flight.simulation.flight_setup import FlightSetup
from world.geometry import fly_by_offset, leg_courses, leg_runs, leg_slopes, signed_turns, tangent_length

Floats = NDArray[np.float64]

# A leg shorter than this is a climb on the spot, with no course of its own, m.
ON_THE_SPOT = 0.5
# A turn sharper than this has no useful tangent length; a U-turn's is infinite.
_U_TURN = math.pi - 1e-6
# The distance by which a fly-by passes its waypoint is capped at this many radii (a turn of about 176 degrees).
_LARGEST_CUT = 30.0


@dataclass(frozen=True, slots=True)
class RouteDemands:
    """A route's turns and legs in numbers, and the aircraft's limits at each.

    For w waypoints: points (w, 3) m; runs (w - 1,) horizontal m; courses, slopes (w - 1,) rad; turns (w,) rad,
    positive to the right, 0 at the ends; radius (w,) m of the arc, at the bank limit or of a loiter's circle; tightest
    (w,) m, the arc at the bank limit; before, after (w,) m of leg that the turn uses on either side, inf for a U-turn;
    reversal (w - 1,) m of leg that the roll from a turn into one the other way round uses;
    blend (w,) m of leg beyond them on which the slope still changes;
    sag (w,) m by which such a blend may pass above or below its corner; cut (w,) m by which the fly-by passes the
    waypoint; turn_limit (w,) rad, the sharpest turn there that fits both legs
    beside the neighbouring turns, inf where the envelope is left out;
    climb, dive (w - 1,) rad over the ground, the least along the leg, inf where the envelope is left out;
    ground_speed (w - 1,) m/s, NaN where the wind leaves no way.
    """

    setup: FlightSetup
    limits: Limits
    points: Floats
    runs: Floats
    courses: Floats
    slopes: Floats
    turns: Floats
    radius: Floats
    before: Floats
    after: Floats
    reversal: Floats
    blend: Floats
    sag: Floats
    cut: Floats
    tightest: Floats
    turn_limit: Floats
    climb: Floats
    dive: Floats
    ground_speed: Floats

    @property
    def legs(self) -> int:
        """How many legs there are."""
        return len(self.runs)

    def waypoint(self, index: int) -> str:
        """Name of a waypoint in findings."""
        item = int(self.setup.route.items[index])
        return f"waypoint {index}" if item < 0 else f"waypoint {index} (item {item})"

    def leg_unit(self, leg: int) -> Floats:
        """East and north components of a leg's course, (2,)."""
        return np.array([math.sin(self.courses[leg]), math.cos(self.courses[leg])])

    def apexes(self) -> Floats:
        """Where the fly-by path passes each waypoint: the middles of the arcs, (w, 3) m."""
        out = self.points.copy()
        for i in range(1, len(out) - 1):
            if self.cut[i] > 0.0:
                inward = self.leg_unit(i) - self.leg_unit(i - 1)
                out[i, :2] += self.cut[i] * inward / max(1e-9, math.hypot(inward[0], inward[1]))
                # Halfway between the heights at the arc's ends.
                reach = min(self.before[i], self.runs[i - 1], self.runs[i])
                out[i, 2] += 0.5 * reach * (math.tan(self.slopes[i]) - math.tan(self.slopes[i - 1]))
        return out


def route_demands(setup: FlightSetup, *, envelope: bool = True) -> RouteDemands:
    """Work out a route's shape.  ``envelope=False`` leaves the aircraft's limits out, for flown evidence alone."""
    route, limits = setup.route, setup.limits
    points = np.asarray(route.waypoints, dtype=np.float64)
    count, legs = len(points), len(points) - 1
    tables = {float(v): limits.performance(float(v)) for v in route.airspeed}
    courses, runs = leg_courses(points), leg_runs(points)
    turns = np.zeros(count)
    if count > 2:
        turns[1:-1] = signed_turns(points)
    tightest, radius, before, after = (np.zeros(count) for _ in range(4))
    for i in range(1, count - 1):
        speed = float(max(route.airspeed[i - 1], route.airspeed[i]))
        tightest[i] = turn_radius_between(tables[speed], courses[i - 1], courses[i], points[i, 2])
        radius[i] = route.arcs[i] or tightest[i]
        before[i], after[i] = turn_room(abs(float(turns[i])), float(radius[i]), bool(route.fly_over[i]))
    climb, dive, speeds = np.full(legs, math.inf), np.full(legs, math.inf), np.zeros(legs)
    for leg in range(legs):
        table, course = tables[float(route.airspeed[leg])], float(courses[leg])
        heights = (points[leg, 2], 0.5 * (points[leg, 2] + points[leg + 1, 2]), points[leg + 1, 2])
        speeds[leg] = min(ground_speed_on(table, course, up) for up in heights)
        if any(math.isnan(ground_speed_on(table, course, up)) for up in heights):
            speeds[leg] = math.nan
        if envelope:
            climb[leg], dive[leg] = np.min([aircraft_slopes(table, course, up) for up in heights], axis=0)
    reversal = _reversals(setup, tables, courses, turns, radius, points[:, 2])
    blend, sag = _blends(setup, points, runs, turns, radius, after)
    cut = np.zeros(count)
    for i in np.flatnonzero(np.isfinite(radius) & ~route.fly_over).tolist():
        cut[i] = min(fly_by_offset(abs(float(turns[i])), float(radius[i])), _LARGEST_CUT * float(radius[i]))
    return RouteDemands(
        setup=setup,
        limits=limits,
        points=points,
        runs=runs,
        courses=courses,
        slopes=leg_slopes(points),
        turns=turns,
        radius=radius,
        before=before,
        after=after,
        reversal=reversal,
        blend=blend,
        sag=sag,
        cut=cut,
        tightest=tightest,
        turn_limit=_turn_limits(setup, runs, tightest, before, after, reversal)
        if envelope
        else np.full(count, math.inf),
        climb=climb,
        dive=dive,
        ground_speed=speeds,
    )


def _blends(
    setup: FlightSetup, points: Floats, runs: Floats, turns: Floats, radius: Floats, after: Floats
) -> tuple[Floats, Floats]:
    """Length of leg beside each turn on which the slope still changes, and its distance from the corner, (w,) m.

    A parabola about each end of the arc, or about the waypoint where there is none.
    """
    rise = np.diff(points[:, 2]) / np.maximum(runs, 1.0)
    blend, sag = np.zeros(len(points)), np.zeros(len(points))
    speed = float(setup.route.airspeed.max()) + setup.scenario.wind.strongest(points[:, 2])
    for i in range(1, len(points) - 1):
        steps = [abs(rise[i] - rise[i - 1])]
        arc = radius[i] * abs(turns[i])
        if 0.0 < arc < math.inf and math.isfinite(after[i]) and not setup.route.fly_over[i]:
            # The arc is shorter than its two tangents, so that its slope is steeper than the legs'.
            on_arc = (rise[i - 1] + rise[i]) * after[i] / arc
            steps = [abs(on_arc - rise[i - 1]), abs(on_arc - rise[i])]
        blend[i] = max(steps) * speed**2 / (2.0 * BLEND_ACCELERATION)
        sag[i] = 0.25 * max(steps) * blend[i]
    return blend, sag


def turn_room(turn: float, radius: float, fly_over: bool) -> tuple[float, float]:
    """Length of leg (m) that a turn (rad) uses before and after its waypoint; a fly-over only after it."""
    if turn < 1e-9:
        return 0.0, 0.0
    if fly_over:
        return 0.0, radius * fly_over_run(turn)
    if turn > _U_TURN:
        return math.inf, math.inf
    reach = tangent_length(turn, radius)
    return reach, reach


def _reversals(
    setup: FlightSetup,
    tables: dict[float, PerformanceTable],
    courses: Floats,
    turns: Floats,
    radius: Floats,
    up: Floats,
) -> Floats:
    """Length of each leg that the roll from one bank into the other uses, (w - 1,) m; 0 between turns of one side."""
    out = np.zeros(len(courses))
    for leg in range(1, len(courses) - 1):
        flown_by = not setup.route.fly_over[leg : leg + 2].any() and np.isfinite(radius[leg : leg + 2]).all()
        if turns[leg] * turns[leg + 1] < 0.0 and flown_by:
            table = tables[float(setup.route.airspeed[leg])]
            ux, uy = math.sin(courses[leg]), math.cos(courses[leg])
            lower = float(min(up[leg], up[leg + 1]))
            out[leg] = roll_reversal_length(table, ux, uy, lower, radius[leg], radius[leg + 1], *downwind(table))
    return out


def _turn_limits(
    setup: FlightSetup, runs: Floats, radius: Floats, before: Floats, after: Floats, reversal: Floats
) -> Floats:
    """Sharpest turn at each waypoint that fits its legs beside the neighbouring turns, (w,) rad.

    Of a leg too short for its two turns the one that takes more than half of it is at fault, or both are.
    """
    out = np.full(len(radius), math.pi)
    for i in range(1, len(radius) - 1):
        if not math.isfinite(radius[i]):
            out[i] = 0.0
            continue
        behind = max(runs[i - 1] - after[i - 1], 0.5 * runs[i - 1]) - reversal[i - 1]
        ahead = max(runs[i] - before[i + 1], 0.5 * runs[i]) - reversal[i]
        if setup.route.fly_over[i]:
            out[i] = _sharpest_fly_over(ahead / radius[i])
        else:
            out[i] = 2.0 * math.atan(min(behind, ahead) / radius[i])
    return out


def _sharpest_fly_over(room: float) -> float:
    """Sharpest fly-over turn (rad) whose run fits ``room`` radii, by bisection."""
    low, high = 0.0, math.pi
    if fly_over_run(high) <= room:
        return high
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fly_over_run(middle) <= room else (low, middle)
    return low
