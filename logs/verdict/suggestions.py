"""The smallest change that would make a failed finding pass: a gentler slope, a longer leg, a lower speed."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import aircraft_slopes, turn_radius_between
from logs.verdict.findings import Finding
from logs.verdict.measures.path_sweeps import path_spheres
from logs.verdict.measures.route_demands import ON_THE_SPOT, RouteDemands, route_demands, turn_room
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.rules.slope_rule import slope_limit, steep_arc
from logs.verdict.rules.turn_rule import turn_limit
from logs.verdict.rules.world_rules import planned_path

Floats = NDArray[np.float64]

# A change is asked for with this much to spare, so that rounding does not undo it.
SPARE_ANGLE = math.radians(0.1)
SPARE_LENGTH = 1.0
SPARE_SPEED = 0.03
SPEED_STEP = 0.5
# Times that a gentler turn is tried.
_TRIES = 6


def with_suggestions(
    shape: RouteDemands, flown: AlignedTrack | None, findings: tuple[Finding, ...]
) -> tuple[Finding, ...]:
    """Fill in ``suggestion`` of every failed finding that a change of the plan could mend."""
    return tuple(
        replace(item, suggestion=_suggest(shape, flown, item)) if item.ok is False else item for item in findings
    )


def _suggest(shape: RouteDemands, flown: AlignedTrack | None, item: Finding) -> str:
    if item.rule == "slope" and item.where.startswith("leg "):
        return slope_suggestion(shape, int(item.where.split()[1]), item)
    if item.rule == "turn" and item.where.startswith("waypoint "):
        return turn_suggestion(shape, int(item.where.split()[1]))
    if item.rule == "threat":
        return _threat(shape, flown, item)
    if item.limit is None or item.margin is None:
        return ""
    short = -item.margin + SPARE_LENGTH
    if item.rule == "clearance" and item.planned is not None:
        # A flight that ended early did not get to the lowest place.
        short = max(short, item.limit - item.planned + SPARE_LENGTH)
    if item.rule == "clearance" and short > SPARE_LENGTH:
        return f"fly {item.where} {short:.0f} m higher"
    if item.rule == "bounds" and short > SPARE_LENGTH:
        return f"bring the path {short:.0f} m further inside"
    if item.rule == "energy":
        return _energy(shape, item)
    if item.rule == "speed":
        return _speed(shape, item)
    return ""


def slope_suggestion(shape: RouteDemands, leg: int, item: Finding) -> str:
    """Gentler slope, longer leg or another speed for one leg; the least relative change first."""
    limit, source = slope_limit(shape, leg)
    planned = abs(float(shape.slopes[leg]))
    rise = abs(float(shape.points[leg + 1, 2] - shape.points[leg, 2]))
    run = float(shape.runs[leg])
    if planned <= limit and item.flown is not None:
        # The geometry passes and the flight did not: what it managed is what it can.
        limit = min(limit, abs(math.radians(item.flown)))
    allowed = limit - SPARE_ANGLE
    if allowed <= 0.0 or planned <= allowed:
        return _arc_suggestion(shape, leg)
    word = "climb" if shape.slopes[leg] >= 0.0 else "fall"
    gentler, longer = run * math.tan(allowed), rise / math.tan(allowed)
    instead = "; it goes nowhere now" if run < ON_THE_SPOT else f" instead of {run:.0f} m"
    changes = [(longer / run - 1.0, f"make leg {leg} {math.ceil(longer)} m long{instead}")]
    if gentler >= 1.0:
        changes.append((1.0 - gentler / rise, f"{word} {math.floor(gentler)} m on leg {leg} instead of {rise:.0f} m"))
    speed = _slope_speed(shape, leg, planned + SPARE_ANGLE) if source == "aircraft" else None
    if speed is not None:
        now = float(shape.setup.route.airspeed[leg])
        changes.append((abs(speed - now) / now, f"fly it at {speed:g} m/s instead of {now:g} m/s"))
    return ", or ".join(text for _, text in sorted(changes))


def _arc_suggestion(shape: RouteDemands, leg: int) -> str:
    """Gentler legs on either side of a fly-by arc that is too steep where they are not, or ""."""
    steep = steep_arc(shape, leg)
    if steep is None:
        return ""
    tangent, can = steep
    share = math.tan(math.atan(can) - SPARE_ANGLE) / abs(tangent)
    parts = []
    for k in (leg, leg + 1):
        rise = share * float(shape.points[k + 1, 2] - shape.points[k, 2])
        # A leg that goes the other way makes the arc flatter, and stays.
        if rise * tangent > 0.0:
            parts.append(f"{'climb' if rise > 0.0 else 'fall'} {math.floor(abs(rise))} m on leg {k}")
    return " and ".join(parts)


def turn_suggestion(shape: RouteDemands, i: int) -> str:
    """Gentler turn, longer legs or a lower speed for one waypoint; the least relative change first."""
    limit, source = turn_limit(shape, i)
    planned = abs(float(shape.turns[i]))
    if planned <= limit or limit <= SPARE_ANGLE:
        return ""
    allowed = limit - SPARE_ANGLE
    degrees = _gentler_turn(shape, i, allowed)
    changes = [(1.0 - allowed / planned, f"turn at most {degrees:.1f}° there")] if degrees > 0.0 else []
    if source == "aircraft" and math.isfinite(shape.before[i]):
        before = shape.before[i] + shape.after[i - 1] + shape.reversal[i - 1] + SPARE_LENGTH
        after = shape.after[i] + shape.before[i + 1] + shape.reversal[i] + SPARE_LENGTH
        short = []
        grown = 0.0
        for leg, needed in ((i - 1, before), (i, after)):
            if math.isfinite(needed) and needed > shape.runs[leg]:
                short.append(f"leg {leg} {math.ceil(needed)} m long instead of {shape.runs[leg]:.0f} m")
                grown = max(grown, needed / float(shape.runs[leg]) - 1.0)
        if short:
            changes.append((grown, "make " + " and ".join(short)))
        speed = _turn_speed(shape, i)
        if speed is not None:
            now = float(max(shape.setup.route.airspeed[i - 1 : i + 1]))
            changes.append((1.0 - speed / now, f"fly it at {speed:g} m/s instead of {now:g} m/s"))
    return ", or ".join(text for _, text in sorted(changes))


def _gentler_turn(shape: RouteDemands, i: int, allowed: float) -> float:
    """Largest turn in tenths of a degree, up to ``allowed`` (rad), that passes with all that follows turned along.

    In wind the next turns change with their courses, and with them the room for this one.  0 where none was found.
    """
    first, last = max(0, i - 2), min(len(shape.points), i + 3)
    route = shape.setup.route
    near = replace(
        route,
        waypoints=route.waypoints[first:last],
        airspeed=route.airspeed[first : last - 1],
        **{name: getattr(route, name)[first:last] for name in ("acceptance", "fly_over", "items", "arcs")},
    )
    at = i - first
    for _ in range(_TRIES):
        degrees = math.floor(10.0 * math.degrees(allowed)) / 10.0
        if degrees <= 0.0:
            return 0.0
        points = np.array(shape.points[first:last])
        change = math.copysign(math.radians(degrees), shape.turns[i]) - float(shape.turns[i])
        cos, sin = math.cos(change), math.sin(change)
        onward = points[at + 1 :, :2] - points[at, :2]
        points[at + 1 :, :2] = points[at, :2] + onward @ np.array([[cos, -sin], [sin, cos]])
        limit, _ = turn_limit(route_demands(replace(shape.setup, route=replace(near, waypoints=points))), at)
        if limit >= math.radians(degrees):
            return degrees
        allowed = min(allowed, limit) - SPARE_ANGLE
    return 0.0


def _speeds(shape: RouteDemands, amsl: float, now: float) -> list[float]:
    """Speeds of level flight at this height in the envelope, the nearest to ``now`` first."""
    envelope = shape.setup.envelope
    low, high = envelope.level_speeds(amsl)
    low, high = max(low * 1.1, float(envelope.airspeed[0])), min(high, float(envelope.airspeed[-1]))
    steps = np.arange(math.ceil(low / SPEED_STEP), math.floor(high / SPEED_STEP) + 1) * SPEED_STEP
    return sorted((float(v) for v in steps), key=lambda v: (abs(v - now), v))


def _slope_speed(shape: RouteDemands, leg: int, slope: float) -> float | None:
    """Airspeed nearest to the commanded one at which the aircraft can hold a slope on a leg, or None."""
    course, side = float(shape.courses[leg]), 0 if shape.slopes[leg] >= 0.0 else 1
    heights = (float(shape.points[leg, 2]), float(shape.points[leg + 1, 2]))
    for speed in _speeds(shape, max(heights), float(shape.setup.route.airspeed[leg])):
        table = shape.limits.performance(speed)
        if min(aircraft_slopes(table, course, up)[side] for up in heights) >= slope:
            return speed
    return None


def _turn_speed(shape: RouteDemands, i: int) -> float | None:
    """Highest lower airspeed at which the turn at a waypoint fits its legs beside its neighbours, or None."""
    now = float(max(shape.setup.route.airspeed[i - 1 : i + 1]))
    # As the turn limit has it: what the neighbours leave, and half of each leg in any case.
    room = min(
        max(shape.runs[i - 1] - shape.after[i - 1], 0.5 * shape.runs[i - 1]) - shape.reversal[i - 1],
        max(shape.runs[i] - shape.before[i + 1], 0.5 * shape.runs[i]) - shape.reversal[i],
    )
    for speed in sorted((v for v in _speeds(shape, float(shape.points[i, 2]), now) if v < now), reverse=True):
        table = shape.limits.performance(speed)
        radius = turn_radius_between(table, shape.courses[i - 1], shape.courses[i], float(shape.points[i, 2]))
        used = turn_room(abs(float(shape.turns[i])), radius, bool(shape.setup.route.fly_over[i]))
        if max(used) + SPARE_LENGTH <= room:
            return speed
    return None


def _energy(shape: RouteDemands, item: Finding) -> str:
    used = item.planned if item.flown is None else item.flown
    if used is None or item.limit is None or used <= item.limit:
        return ""
    more = used / item.limit
    store = "battery" if shape.setup.envelope.volts or not shape.setup.envelope.power_level.size else "tank"
    shorter, larger = math.ceil(100.0 * (1.0 - 1.0 / more)), math.ceil(100.0 * more) / 100.0
    return f"shorten the flight by {shorter} %, or take a {store} {larger:.2f} times as large"


def _threat(shape: RouteDemands, flown: AlignedTrack | None, item: Finding) -> str:
    threats = shape.setup.scenario.threats
    name = item.where.removesuffix(" (missile)")
    if name == item.where or name not in threats.names:
        return ""
    m = threats.names.index(name)
    one = slice(m, m + 1)
    spheres = (threats.position[one], threats.kill_radius[one], threats.kill_scale[one])
    points, _, times = planned_path(shape)
    nearest = path_spheres(points, times, *spheres)[0, 2]
    if flown is not None and len(flown.track) > 1:
        nearest = min(nearest, path_spheres(flown.track.position, flown.track.time, *spheres)[0, 2])
    return f"pass {name} {threats.kill_radius[m] - nearest + SPARE_LENGTH:.0f} m further away"


def _speed(shape: RouteDemands, item: Finding) -> str:
    if not item.where.startswith("leg "):
        return ""
    leg = int(item.where.split()[1])
    commanded = float(shape.setup.route.airspeed[leg])
    low, high = shape.setup.envelope.level_speeds(float(max(shape.points[leg, 2], shape.points[leg + 1, 2])))
    if low <= commanded <= high:
        return ""
    low, high = math.ceil(10.0 * low * (1.0 + SPARE_SPEED)) / 10.0, math.floor(10.0 * high * (1.0 - SPARE_SPEED)) / 10.0
    return f"command {low:.1f} to {high:.1f} m/s on leg {leg}"
