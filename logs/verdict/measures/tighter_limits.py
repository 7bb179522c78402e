"""The tighter of the scenario's and the aircraft's limit at each turn, leg and fly-by arc."""

import math
from dataclasses import dataclass

import numpy as np

from aircraft.envelope import GRAVITY
from aircraft.path_limits import arc_slope
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.tolerances import OFF_SPEED


@dataclass(frozen=True, slots=True)
class SteepArc:
    """A fly-by arc that is steeper than the aircraft can climb or sink.

    tangent: of the arc's slope.  limit: tangent of the aircraft's, on the mean of both legs' courses; positive.
    """

    tangent: float
    limit: float


def turn_limit(demands: RouteDemands, i: int) -> tuple[float, str]:
    """Tighter of the scenario's and the aircraft's limit at a waypoint, rad, and whose it is."""
    return tighter_turn(demands, i, float(demands.turn_limit[i]))


def tighter_turn(demands: RouteDemands, i: int, aircraft: float) -> tuple[float, str]:
    """Tighter of the scenario's limit at a waypoint and this one of the aircraft, rad, and whose it is."""
    fixed = demands.limits.max_turn
    # A circle has no angle: its corners are of our making.
    if fixed is not None and fixed <= aircraft and demands.setup.route.arcs[i] == 0.0:
        return fixed, "scenario"
    return aircraft, "aircraft" if math.isfinite(aircraft) else "none"


def slope_limit(demands: RouteDemands, leg: int) -> tuple[float, str]:
    """Tighter limit on a leg's climb or, for a leg that falls, dive: rad, positive, and whose it is."""
    rising = demands.slopes[leg] >= 0.0
    fixed = demands.limits.max_climb if rising else demands.limits.max_dive
    aircraft = float((demands.climb if rising else demands.dive)[leg])
    if fixed is not None and fixed <= aircraft:
        return fixed, "scenario"
    return aircraft, "aircraft" if math.isfinite(aircraft) else "none"


def steep_arc(demands: RouteDemands, leg: int) -> SteepArc | None:
    """The fly-by arc at a leg's end, where it is too steep.

    None where it leaves the airspeed within `OFF_SPEED`: what the aircraft cannot climb or sink on the arc it takes
    from its speed or adds to it, g dh / V.
    """
    i = leg + 1
    if i == demands.legs or demands.setup.route.fly_over[i] or demands.setup.route.arcs[i] > 0.0:
        return None
    before, length = float(demands.before[i]), float(demands.radius[i]) * abs(float(demands.turns[i]))
    if not 0.0 < before < min(demands.runs[leg : leg + 2]):
        return None
    into, out = math.tan(demands.slopes[leg]), math.tan(demands.slopes[i])
    tangent = arc_slope(into, out, before, float(demands.radius[i]))
    limits = (demands.climb if tangent > 0.0 else demands.dive)[leg : leg + 2]
    if not np.isfinite(limits).all() or not (limits > 0.0).all():
        return None
    limit, speed = float(np.tan(limits).mean()), float(demands.route.airspeed[leg])
    return SteepArc(tangent, limit) if GRAVITY * (abs(tangent) - limit) * length / speed > OFF_SPEED else None
