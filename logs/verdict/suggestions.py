"""Suggest the smallest change that makes a finding pass: gentler slope, longer leg, lower speed.

Each function takes the route's requirements, the aligned track (None if nothing was flown) and the failed finding; a
rule names the function that suggests for it.  All suggestions are alternatives, the smallest relative change first.
"""

import math
from dataclasses import replace

import numpy as np

from aircraft.path_limits import aircraft_slopes, turn_radius_between
from logs.verdict.findings import UNKNOWN_AIRCRAFT, Finding
from logs.verdict.measures.path_moves import flown_moves, planned_moves
from logs.verdict.measures.path_sweeps import path_spheres
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    available_lengths,
    performance_tables,
    slope_limit,
    steep_arc,
    tighter_turn,
    turn_lengths,
    turn_limit,
    turn_requirements,
)
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.zone_visits import DEPTH_PRECISION, path_zones
from logs.verdict.places import FLIGHT, Change, Quantity, Suggestion
from logs.verdict.tolerances import (
    MIN_EVIDENCE_FLIGHT_S,
    MIN_LEG_LENGTH_M,
    MIN_SUGGESTED_RISE_M,
    MIN_SUGGESTED_SPEED_RATIO,
    ROUNDING_M,
    SUGGESTION_ANGLE_MARGIN_RAD,
    SUGGESTION_LENGTH_MARGIN_M,
    SUGGESTION_SPEED_MARGIN_FRACTION,
    SUGGESTION_SPEED_STEP_MPS,
    SUGGESTION_TRIAL_COUNT,
    ZONE_SUGGESTION_TRIAL_COUNT,
)
from logs.verdict.trials import first_that_passes
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.kernels import Records
from world.terrain import Terrain

# ----------------------------------------------------------------------
# The side on which a path should pass a zone: the smallest shift of its legs that ends the violation.

# Horizontal shifts of a path: their name, the coordinate, and its sign.
_HORIZONTAL_SHIFTS: tuple[tuple[Quantity, str, float], ...] = (
    ("north", "north", 1.0),
    ("east", "east", 1.0),
    ("south", "north", -1.0),
    ("west", "east", -1.0),
)
# Vertical shifts of a path, in the same form.
_VERTICAL_SHIFTS: tuple[tuple[Quantity, str, float], ...] = (("height", "up", 1.0), ("descent", "up", -1.0))


def pass_zone(
    requirements: RouteRequirements, aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest passing a zone further to one side, or higher or lower; the smallest change first.

    item: the finding on the violated zone.

    If the planned path violates the zone, the shift of its violating legs includes how much deeper the flight went.  If
    only the flight violates the zone, the violating legs of the flight are shifted.
    """
    z, facts = finding.place.index, {fact.what: fact.value for fact in finding.facts}
    if z is None or "entry leg" not in facts:
        return ()
    first, last = int(facts["entry leg"]), int(facts["exit leg"])
    record, terrain = zone_records([requirements.airspace.zones[z]]), requirements.setup.scenario.terrain
    planned, flown = finding.planned or 0.0, finding.flown or 0.0
    if aligned is not None and planned <= ROUNDING_M:
        moves, deeper = flown_moves(aligned, first, last), 0.0
    else:
        moves, deeper = planned_moves(requirements, first, last), max(0.0, flown - planned)
    near = moves[(moves["leg"] >= first) & (moves["leg"] <= last)]
    found = []
    for ways in (_HORIZONTAL_SHIFTS, _VERTICAL_SHIFTS):
        best: tuple[float, Change] | None = None
        for what, axis, sign in ways:
            shift = _smallest_shift(near, record, terrain, axis, sign, math.inf if best is None else best[0])
            if shift is not None:
                best = (
                    shift,
                    Change(
                        what, finding.place, None, float(math.ceil(shift + deeper + SUGGESTION_LENGTH_MARGIN_M)), "m"
                    ),
                )
        if best is not None:
            found.append(best)
    return tuple((change,) for _, change in sorted(found, key=lambda one: one[0]))


def _smallest_shift(
    moves: Records, record: ZoneRecords, terrain: Terrain | None, axis: str, sign: float, most: float
) -> float | None:
    """Return the smallest shift (m) in one direction that ends a violation; None if above ``most`` or not found.

    A path at some depth beyond a limit needs a shift of at least that depth, so shifting by the depth at each step
    misses no smaller shift.  Ground that rises faster than the step may be missed.
    """
    shift, shifted = 0.0, np.array(moves)
    for _ in range(ZONE_SUGGESTION_TRIAL_COUNT):
        visit = path_zones(shifted, record, terrain)[0]
        if visit.unknown:
            return None
        if visit.depth <= DEPTH_PRECISION:
            return shift
        shift += float(visit.depth)
        if shift >= most:
            return None
        shifted[axis] = moves[axis] + sign * shift
    return None


# A suggestion with the relative size of its change.
_Sized = tuple[float, Suggestion]


# Largest relative change that is suggested: more than ten times the plan is no advice (a leg of 84 km instead of 326
# m).
_MAX_RELATIVE_CHANGE = 9.0


def _smallest_first(alternatives: list[_Sized]) -> tuple[Suggestion, ...]:
    """Sort alternatives by the relative size of their changes, stably, and drop those that are too large."""
    helpful = [sized for sized in alternatives if sized[0] <= _MAX_RELATIVE_CHANGE]
    return tuple(suggestion for _, suggestion in sorted(helpful, key=lambda sized: sized[0]))


def ease_slope(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a gentler slope, a longer leg or another speed for one leg; the smallest relative change first.

    If the aircraft is not known well enough, suggest a flight that measures its ability.
    """
    leg = finding.place.index
    if leg is None:
        return ()
    if finding.check == UNKNOWN_AIRCRAFT:
        what: Quantity = "full throttle" if requirements.slopes[leg] > 0.0 else "no throttle"
        return ((Change(what, finding.place, None, MIN_EVIDENCE_FLIGHT_S, "s"),),)
    limit, source = slope_limit(requirements, leg)
    planned = abs(float(requirements.slopes[leg]))
    rise = abs(float(requirements.points[leg + 1, 2] - requirements.points[leg, 2]))
    run = float(requirements.runs[leg])
    if planned <= limit and finding.flown is not None:
        # The geometry passes and the flight failed: the slope that was flown is the limit.
        limit = min(limit, abs(math.radians(finding.flown)))
    allowed = limit - SUGGESTION_ANGLE_MARGIN_RAD
    if allowed <= 0.0 or planned <= allowed:
        return _gentler_arc(requirements, leg)
    place, sign = requirements.leg(leg), 1.0 if requirements.slopes[leg] >= 0.0 else -1.0
    gentler, longer = run * math.tan(allowed), rise / math.tan(allowed)
    alternatives: list[_Sized] = []
    if gentler >= MIN_SUGGESTED_RISE_M:
        change = Change("rise", place, sign * rise, sign * math.floor(gentler), "m")
        alternatives.append((1.0 - gentler / rise, (change,)))
    speed = _slope_speed(requirements, leg, planned + SUGGESTION_ANGLE_MARGIN_RAD) if source == "aircraft" else None
    if speed is not None:
        now = float(requirements.setup.route.airspeed[leg])
        alternatives.append((abs(speed - now) / now, (Change("airspeed", place, now, speed, "m/s"),)))
    # A leg that goes straight up has no length to compare with.
    relative = longer / run - 1.0 if run >= MIN_LEG_LENGTH_M else _MAX_RELATIVE_CHANGE
    alternatives.append((relative, (Change("length", place, run, float(math.ceil(longer)), "m"),)))
    return _smallest_first(alternatives)


def _gentler_arc(requirements: RouteRequirements, leg: int) -> tuple[Suggestion, ...]:
    """Suggest gentler legs on either side of a fly-by arc that is too steep although the legs are not."""
    steep = steep_arc(requirements, leg)
    if steep is None:
        return ()
    share = math.tan(math.atan(steep.limit) - SUGGESTION_ANGLE_MARGIN_RAD) / abs(steep.tangent)
    changes = []
    for k in (leg, leg + 1):
        rise = share * float(requirements.points[k + 1, 2] - requirements.points[k, 2])
        # A leg of opposite slope makes the arc flatter, and is kept.
        if rise * steep.tangent > 0.0:
            wanted = math.copysign(math.floor(abs(rise)), rise)
            changes.append(Change("rise", requirements.leg(k), None, wanted, "m"))
    return (tuple(changes),) if changes else ()


def ease_turn(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a gentler turn, longer legs or a lower speed; the smallest relative change first."""
    i = finding.place.index
    if i is None:
        return ()
    limit, source = turn_limit(requirements, i)
    planned = abs(float(requirements.turns[i]))
    if planned <= limit or limit <= SUGGESTION_ANGLE_MARGIN_RAD:
        return ()
    place, allowed = requirements.waypoint(i), limit - SUGGESTION_ANGLE_MARGIN_RAD
    alternatives: list[_Sized] = []
    if source == "aircraft" and math.isfinite(requirements.before[i]):
        speed = _turn_speed(requirements, i)
        if speed is not None:
            now = float(max(requirements.setup.route.airspeed[i - 1 : i + 1]))
            alternatives.append((1.0 - speed / now, (Change("airspeed", place, now, speed, "m/s"),)))
        alternatives += _longer_legs(requirements, i)
    degrees = _gentler_turn(requirements, i, allowed)
    if degrees > 0.0:
        change = Change("turn", place, math.degrees(planned), degrees, "deg")
        alternatives.append((1.0 - allowed / planned, (change,)))
    return _smallest_first(alternatives)


def _longer_legs(requirements: RouteRequirements, i: int) -> list[_Sized]:
    """Suggest legs at a waypoint long enough for its turn and the neighbouring turns; return [] if they already are."""
    before = (
        requirements.before[i] + requirements.after[i - 1] + requirements.reversal[i - 1] + SUGGESTION_LENGTH_MARGIN_M
    )
    after = requirements.after[i] + requirements.before[i + 1] + requirements.reversal[i] + SUGGESTION_LENGTH_MARGIN_M
    changes = []
    grown = 0.0
    for leg, needed in ((i - 1, before), (i, after)):
        run = float(requirements.runs[leg])
        if math.isfinite(needed) and needed > run:
            changes.append(Change("length", requirements.leg(leg), run, float(math.ceil(needed)), "m"))
            grown = max(grown, needed / run - 1.0)
    return [(grown, tuple(changes))] if changes else []


def _gentler_turn(requirements: RouteRequirements, i: int, allowed: float) -> float:
    """Return the largest turn up to ``allowed`` (rad) that passes, in steps of 0.1 degrees; 0 if none passes.

    The route after the waypoint is rotated with the turn.  In wind the next turns change with their courses, and so
    does the length available to this turn.
    """
    first, last = max(0, i - 2), min(len(requirements.points), i + 3)
    route = requirements.route
    near = replace(
        route,
        waypoints=route.waypoints[first:last],
        airspeed=route.airspeed[first : last - 1],
        **{
            name: getattr(route, name)[first:last]
            for name in ("acceptance", "fly_over", "items", "arcs", "above_ground")
        },
    )
    tables, at = performance_tables(near, requirements.limits), i - first
    for _ in range(SUGGESTION_TRIAL_COUNT):
        degrees = math.floor(10.0 * math.degrees(allowed)) / 10.0
        if degrees <= 0.0:
            return 0.0
        points = np.array(requirements.points[first:last])
        change = math.copysign(math.radians(degrees), requirements.turns[i]) - float(requirements.turns[i])
        cos, sin = math.cos(change), math.sin(change)
        onward = points[at + 1 :, :2] - points[at, :2]
        points[at + 1 :, :2] = points[at, :2] + onward @ np.array([[cos, -sin], [sin, cos]])
        turning = turn_requirements(replace(near, waypoints=points), tables)
        limit, _ = tighter_turn(requirements, i, float(turning.limit[at]))
        if limit >= math.radians(degrees):
            return degrees
        allowed = min(allowed, limit) - SUGGESTION_ANGLE_MARGIN_RAD
    return 0.0


def _true_airspeed_ratio(requirements: RouteRequirements, leg: int) -> float:
    """Return the ratio of true airspeed to the commanded airspeed on a leg."""
    return float(requirements.route.airspeed[leg] / requirements.setup.route.airspeed[leg])


def _level_speeds(requirements: RouteRequirements, amsl: float, now: float, factor: float) -> list[float]:
    """Return the airspeeds to command for level flight at an altitude, m/s, the nearest to ``now`` first.

    factor: ratio of true airspeed to commanded airspeed.
    """
    envelope = requirements.setup.envelope
    low, high = envelope.level_speeds(amsl)
    low, high = (
        max(low * MIN_SUGGESTED_SPEED_RATIO, float(envelope.airspeed[0])),
        min(high, float(envelope.airspeed[-1])),
    )
    low, high = low / factor, high / factor
    steps = (
        np.arange(math.ceil(low / SUGGESTION_SPEED_STEP_MPS), math.floor(high / SUGGESTION_SPEED_STEP_MPS) + 1)
        * SUGGESTION_SPEED_STEP_MPS
    )
    return sorted((float(v) for v in steps), key=lambda v: (abs(v - now), v))


def _slope_speed(requirements: RouteRequirements, leg: int, slope: float) -> float | None:
    """Return the airspeed nearest to the command at which the aircraft can hold a slope on a leg, or None."""
    course, side = float(requirements.courses[leg]), 0 if requirements.slopes[leg] >= 0.0 else 1
    heights = (float(requirements.points[leg, 2]), float(requirements.points[leg + 1, 2]))
    factor = _true_airspeed_ratio(requirements, leg)

    def passes(speed: float) -> bool:
        table = requirements.limits.performance(speed * factor)
        return min(aircraft_slopes(table, course, up)[side] for up in heights) >= slope

    commanded = float(requirements.setup.route.airspeed[leg])
    return first_that_passes(_level_speeds(requirements, max(heights), commanded, factor), passes)


def _turn_speed(requirements: RouteRequirements, i: int) -> float | None:
    """Return the highest airspeed below the command at which the turn at a waypoint fits its legs, or None."""
    now = float(max(requirements.setup.route.airspeed[i - 1 : i + 1]))
    available = min(
        available_lengths(requirements.runs, requirements.before, requirements.after, requirements.reversal, i)
    )
    factor = _true_airspeed_ratio(requirements, i)
    up = float(requirements.points[i, 2])

    def fits(speed: float) -> bool:
        table = requirements.limits.performance(speed * factor)
        radius = turn_radius_between(table, requirements.courses[i - 1], requirements.courses[i], up)
        used = turn_lengths(abs(float(requirements.turns[i])), radius, bool(requirements.setup.route.fly_over[i]))
        return max(used) + SUGGESTION_LENGTH_MARGIN_M <= available

    slower = [speed for speed in _level_speeds(requirements, up, now, factor) if speed < now]
    return first_that_passes(sorted(slower, reverse=True), fits)


def _whole_metres(metres: float) -> float:
    """Round a length to whole metres for a suggestion."""
    return float(round(metres))


def pass_threat(
    requirements: RouteRequirements, aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest passing a missile's sphere further away."""
    m = finding.place.index
    if m is None or finding.place.kind != "missile":
        return ()
    threats = requirements.setup.scenario.threats
    one = slice(m, m + 1)
    spheres = (threats.position[one], threats.kill_radius[one], threats.kill_scale[one])
    nearest = path_spheres(requirements.path.points, requirements.path.times, *spheres).closest[0]
    if aligned is not None and len(aligned.track) > 1:
        nearest = min(nearest, path_spheres(aligned.track.position, aligned.track.time, *spheres).closest[0])
    away = _whole_metres(threats.kill_radius[m] - nearest + SUGGESTION_LENGTH_MARGIN_M)
    return ((Change("distance", finding.place, None, away, "m"),),)


def fly_higher(
    _requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest flying a leg higher above the ground."""
    if finding.limit is None or finding.margin is None:
        return ()
    short = -finding.margin + SUGGESTION_LENGTH_MARGIN_M
    if finding.planned is not None:
        # A flight that ended early did not reach the lowest place.
        short = max(short, finding.limit - finding.planned + SUGGESTION_LENGTH_MARGIN_M)
    return (
        ((Change("height", finding.place, None, _whole_metres(short), "m"),),)
        if short > SUGGESTION_LENGTH_MARGIN_M
        else ()
    )


def fly_lower(
    _requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest flying a leg lower above the ground."""
    heights = [height for height in (finding.planned, finding.flown) if height is not None]
    if finding.place.kind != "leg" or finding.limit is None or not heights or not max(heights) > finding.limit:
        return ()
    high = _whole_metres(max(heights) - finding.limit + SUGGESTION_LENGTH_MARGIN_M)
    return ((Change("descent", finding.place, None, high, "m"),),)


def stay_inside(
    _requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest bringing the path further inside the area."""
    if finding.margin is None or not finding.margin < 0.0:
        return ()
    return ((Change("inset", FLIGHT, None, _whole_metres(-finding.margin + SUGGESTION_LENGTH_MARGIN_M), "m"),),)


def use_less_energy(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a shorter flight, or a larger battery or tank."""
    used = finding.planned if finding.flown is None else finding.flown
    if used is None or finding.limit is None or finding.margin is None or used <= finding.limit:
        return ()
    more = used / finding.limit
    envelope = requirements.setup.envelope
    store: Quantity = "battery" if envelope.volts or not envelope.power_level.size else "tank"
    shorter = Change("duration", FLIGHT, None, float(math.ceil(100.0 * (1.0 - 1.0 / more))), "%")
    larger = Change(store, FLIGHT, None, math.ceil(100.0 * more) / 100.0, "1")
    return (shorter,), (larger,)


def fly_faster(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a higher airspeed, above the stall."""
    if finding.limit is None:
        return ()
    leg = int(np.argmin(requirements.route.airspeed))
    now = float(requirements.setup.route.airspeed[leg])
    wanted = (
        math.ceil(
            10.0 * finding.limit * (1.0 + SUGGESTION_SPEED_MARGIN_FRACTION) / _true_airspeed_ratio(requirements, leg)
        )
        / 10.0
    )
    return ((Change("airspeed", finding.place, now, wanted, "m/s"),),) if wanted > now else ()


def fly_level_speed(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest an airspeed at which level flight is possible at the leg's altitude.

    If the maximum airspeed is uncertain, suggest only airspeeds that are certainly possible.
    """
    leg = finding.place.index
    if leg is None or finding.limit is None or finding.margin is None:
        return ()
    commanded = float(requirements.setup.route.airspeed[leg])
    up = float(max(requirements.points[leg, 2], requirements.points[leg + 1, 2]))
    envelope = requirements.setup.envelope
    known = envelope.surely() if finding.check == UNKNOWN_AIRCRAFT else envelope
    low, high = (speed / _true_airspeed_ratio(requirements, leg) for speed in known.level_speeds(up))
    if low <= commanded <= high:
        return ()
    low = math.ceil(10.0 * low * (1.0 + SUGGESTION_SPEED_MARGIN_FRACTION)) / 10.0
    high = math.floor(10.0 * high * (1.0 - SUGGESTION_SPEED_MARGIN_FRACTION)) / 10.0
    return ((Change("airspeed", finding.place, commanded, low, "m/s", most=high),),)
