"""Suggest the smallest changes that make a finding pass.

Examples are a gentler slope, a longer leg and a lower airspeed.

Each public function takes the route's requirements, the aligned track (None if nothing was flown) and the failed
finding; each `Rule` names the function that suggests changes for its findings.  The suggestions are alternatives, the
smallest relative change first; the tuple is empty if no change helps.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aircraft.path_limits import aircraft_slopes, turn_radius_between
from flight.mission.altitude_frames import find_misread_altitudes
from flight.mission.items import OVER_HOME, PLACES, Frame
from flight.mission.itinerary import stated_loiter
from flight.mission.placing import HOME_ALTITUDE_TOLERANCE_M
from flight.mission_files.formats import HOME_LINE_MISSING_TEXT
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import UNKNOWN_AIRCRAFT, Finding
from logs.verdict.measures.acceptance import position_error
from logs.verdict.measures.path_moves import flown_moves, planned_moves
from logs.verdict.measures.path_sweeps import path_clearance, path_spheres
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    available_lengths,
    ground_slope_limit,
    leg_performance,
    slope_limit,
    steep_arc,
    tighter_turn_limit,
    turn_lengths,
    turn_limit,
    turn_requirements,
)
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.zone_visits import DEPTH_PRECISION, path_zones
from logs.verdict.places import FLIGHT, MISSION, Change, ChangeKind, Place, Suggestion
from logs.verdict.tolerances import (
    CALM_WIND_MPS,
    HEIGHT_ERROR_LIMIT_M,
    HOME_ERROR_M,
    LEVEL_SLOPE_RAD,
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
    UNDECIDED_FRACTION,
    ZONE_SUGGESTION_TRIAL_COUNT,
)
from logs.verdict.trials import first_that_passes
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.frames import to_map
from world.kernels import Records
from world.terrain import Terrain

# ----------------------------------------------------------------------
# Shift of a path past a zone: the smallest shift of its legs that ends the violation.

# Horizontal shifts of a path: name, coordinate, and sign of the shift.
_HORIZONTAL_SHIFTS: tuple[tuple[ChangeKind, str, float], ...] = (
    ("north", "north", 1.0),
    ("east", "east", 1.0),
    ("south", "north", -1.0),
    ("west", "east", -1.0),
)
# Vertical shifts of a path, in the same form.
_VERTICAL_SHIFTS: tuple[tuple[ChangeKind, str, float], ...] = (("height", "up", 1.0), ("descent", "up", -1.0))


def suggest_shift_past_zone(
    requirements: RouteRequirements, aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest passing a zone further to one side, or higher or lower; the smallest change first.

    The shift is measured on the violating legs of the planned path, or of the flown track if the plan does not violate
    the zone.  If the flight violates the zone more deeply than the plan, the shift grows by the difference.  The
    shifted path clears the zone by the navigation error and `SUGGESTION_LENGTH_MARGIN_M`.
    """
    zone_index, facts = finding.place.index, {fact.what: fact.value for fact in finding.facts}
    if zone_index is None or "entry leg" not in facts:
        return ()
    first_leg, last_leg = int(facts["entry leg"]), int(facts["exit leg"])
    record, terrain = zone_records([requirements.airspace.zones[zone_index]]), requirements.setup.scenario.terrain
    planned_depth, flown_depth = finding.planned or 0.0, finding.flown or 0.0
    margin = position_error(requirements.setup) + SUGGESTION_LENGTH_MARGIN_M
    if aligned is not None and planned_depth <= ROUNDING_M:
        moves, extra_depth = flown_moves(aligned, first_leg, last_leg), 0.0
    else:
        moves = planned_moves(requirements, first_leg, last_leg)
        extra_depth = max(0.0, flown_depth - planned_depth)
    leg_moves = moves[(moves["leg"] >= first_leg) & (moves["leg"] <= last_leg)]
    changes = []
    for shifts in (_HORIZONTAL_SHIFTS, _VERTICAL_SHIFTS):
        smallest_shift: tuple[float, Change] | None = None
        for direction, axis, sign in shifts:
            shift = _smallest_shift(
                leg_moves, record, terrain, axis, sign, math.inf if smallest_shift is None else smallest_shift[0]
            )
            if shift is not None:
                smallest_shift = (
                    shift,
                    Change(
                        direction,
                        finding.place,
                        current=None,
                        wanted=float(math.ceil(shift + extra_depth + margin)),
                        unit="m",
                    ),
                )
        if smallest_shift is not None:
            changes.append(smallest_shift)
    return tuple((change,) for _, change in sorted(changes, key=lambda sized: sized[0]))


def _smallest_shift(
    moves: Records, zone: ZoneRecords, terrain: Terrain | None, axis: str, sign: float, max_shift: float
) -> float | None:
    """Return the smallest shift of a path in one direction that ends its violation of a zone, m.

    Return None if the shift reaches `max_shift` (m), if it depends on unknown ground, or if it is not found within
    `ZONE_SUGGESTION_TRIAL_COUNT` steps.
    moves: the path, (m,) of dtype `logs.verdict.measures.path_moves.MOVE`.
    zone: record of the one zone.
    axis: coordinate that is shifted: "east", "north" or "up".
    sign: direction of the shift, 1 or -1.

    Each step shifts the path by the depth of its remaining violation.  No smaller shift is missed, because ending a
    violation needs a shift of at least its depth.  Only ground that rises faster than the step may be missed.
    """
    shift, shifted_moves = 0.0, np.array(moves)
    for _ in range(ZONE_SUGGESTION_TRIAL_COUNT):
        visit = path_zones(shifted_moves, zone, terrain)[0]
        if visit.unknown:
            return None
        if visit.depth <= DEPTH_PRECISION:
            return shift
        shift += float(visit.depth)
        if shift >= max_shift:
            return None
        shifted_moves[axis] = moves[axis] + sign * shift
    return None


# Greatest step to which an autopilot rounds the radius of a loiter, m.
_MAX_RADIUS_ROUNDING_M = 10

# Relative size of a change, and the suggestion.
_SizedSuggestion = tuple[float, Suggestion]


# Largest relative change that is suggested; a leg of 84 km instead of 326 m would be no useful advice.
_MAX_RELATIVE_CHANGE = 9.0


def _sort_by_change(alternatives: list[_SizedSuggestion]) -> tuple[Suggestion, ...]:
    """Sort alternatives by their relative change, and drop those above `_MAX_RELATIVE_CHANGE`."""
    helpful = [sized for sized in alternatives if sized[0] <= _MAX_RELATIVE_CHANGE]
    return tuple(suggestion for _, suggestion in sorted(helpful, key=lambda sized: sized[0]))


def suggest_gentler_slope(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a gentler slope, a longer leg or another airspeed; the smallest relative change first.

    If the aircraft is not known well enough, suggest a flight that measures its climb or sink performance.  If its
    climb performance is a guess, first suggest that the user state it.  Return () for a finding that is not on a leg.
    """
    leg = finding.place.index
    if leg is None:
        return ()
    if finding.check == UNKNOWN_AIRCRAFT:
        quantity: ChangeKind = "full throttle" if requirements.slopes[leg] > 0.0 else "no throttle"
        flight = (Change(quantity, finding.place, current=None, wanted=MIN_EVIDENCE_FLIGHT_S, unit="s"),)
        if quantity == "no throttle" or not requirements.setup.envelope.climb_guessed:
            return (flight,)
        slope_deg = math.degrees(float(requirements.slopes[leg]))
        return (Change("stated climb", finding.place, current=None, wanted=round(slope_deg, 1), unit="°"),), flight
    limit, source = slope_limit(requirements, leg)
    planned_slope = abs(float(requirements.slopes[leg]))
    height_change = abs(float(requirements.points[leg + 1, 2] - requirements.points[leg, 2]))
    leg_length = float(requirements.runs[leg])
    if planned_slope <= limit and finding.flown is not None:
        # If only the flight failed, the flown slope is the limit.
        limit = min(limit, abs(math.radians(finding.flown)))
    if source == "aircraft":
        # A slope beyond the certain part of the aircraft's limit would be undecided, unless the leg is nearly level.
        certain_limits = requirements.certain_climb if requirements.slopes[leg] >= 0.0 else requirements.certain_dive
        limit = min(limit, max(float(certain_limits[leg]), LEVEL_SLOPE_RAD))
    max_slope = limit - SUGGESTION_ANGLE_MARGIN_RAD
    if max_slope <= 0.0 or planned_slope <= max_slope:
        # The fault may be a fly-by arc that is too steep at the leg's end: suggest gentler legs around it.
        arc = steep_arc(requirements, leg)
        if arc is None:
            return ()
        slope_ratio = math.tan(math.atan(arc.limit) - SUGGESTION_ANGLE_MARGIN_RAD) / abs(arc.tangent)
        changes = []
        for k in (leg, leg + 1):
            rise = slope_ratio * float(requirements.points[k + 1, 2] - requirements.points[k, 2])
            # A leg of the opposite slope makes the arc flatter, so it is not changed.
            if rise * arc.tangent > 0.0:
                wanted_rise = math.copysign(math.floor(abs(rise)), rise)
                changes.append(Change("rise", requirements.leg_place(k), current=None, wanted=wanted_rise, unit="m"))
        return (tuple(changes),) if changes else ()
    place, sign = requirements.leg_place(leg), 1.0 if requirements.slopes[leg] >= 0.0 else -1.0
    gentler_height_change = leg_length * math.tan(max_slope)
    longer_length = height_change / math.tan(max_slope)
    alternatives: list[_SizedSuggestion] = []
    if gentler_height_change >= MIN_SUGGESTED_RISE_M:
        change = Change("rise", place, sign * height_change, sign * math.floor(gentler_height_change), "m")
        alternatives.append((1.0 - gentler_height_change / height_change, (change,)))
    speed = (
        _slope_speed(requirements, leg, planned_slope + SUGGESTION_ANGLE_MARGIN_RAD) if source == "aircraft" else None
    )
    if speed is not None:
        current_speed = float(requirements.setup.demanded_route.leg_airspeeds[leg])
        alternatives.append(
            (abs(speed - current_speed) / current_speed, (Change("airspeed", place, current_speed, speed, "m/s"),))
        )
    # A vertical leg has no length to compare with.
    relative_growth = longer_length / leg_length - 1.0 if leg_length >= MIN_LEG_LENGTH_M else _MAX_RELATIVE_CHANGE
    alternatives.append((relative_growth, (Change("length", place, leg_length, float(math.ceil(longer_length)), "m"),)))
    return (*_suggest_altitude_frame(requirements.setup, Frame.GLOBAL), *_sort_by_change(alternatives))


def suggest_gentler_landing(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a lower or more distant waypoint before a steep landing, or landing from the other end.

    If the aircraft is not known well enough, suggest a flight that measures its descent.  Return () if the slope
    passes, or if the limit permits no descent.
    """
    if finding.check == UNKNOWN_AIRCRAFT:
        return ((Change("no throttle", finding.place, current=None, wanted=MIN_EVIDENCE_FLIGHT_S, unit="s"),),)
    ground = requirements.setup.route.landing_ground
    if finding.ok is not False or not finding.place.index or ground is None:
        return ()
    leg = finding.place.index - 1
    altitude, length = float(requirements.points[leg, 2]), requirements.straight_length(leg)
    limit = ground_slope_limit(requirements, leg, (altitude, ground), is_climb=False, is_landing=True)
    max_slope = min(limit.limit, max(limit.certain, LEVEL_SLOPE_RAD)) - SUGGESTION_ANGLE_MARGIN_RAD
    if max_slope <= 0.0:
        return ()
    height = altitude - ground
    step = float(math.ceil(height - length * math.tan(max_slope)))
    longer_length = float(math.ceil(height / math.tan(max_slope)))
    lower = Change("descent", requirements.waypoint_place(leg), current=None, wanted=step, unit="m")
    further = Change("length", requirements.leg_place(leg), length, longer_length, "m")
    alternatives: list[_SizedSuggestion] = [
        (step / height, (lower,)),
        (longer_length / max(length, MIN_LEG_LENGTH_M) - 1.0, (further,)),
    ]
    step_east, step_north = (requirements.points[leg + 1, :2] - requirements.points[leg, :2]).tolist()
    course = math.atan2(step_east, step_north)
    return (
        *_sort_by_change(alternatives),
        *_suggest_landing_against_wind(requirements, finding.place, course, ground),
    )


def suggest_gentler_turn(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a gentler turn, longer legs or a lower airspeed; the smallest relative change first.

    If the aircraft is not known well enough, suggest stating its bank limit.  Return () if the planned turn passes.
    """
    corner = finding.place.index
    if corner is None:
        return ()
    if finding.check == UNKNOWN_AIRCRAFT:
        return suggest_stating_bank(requirements, _aligned, finding)
    limit, source = turn_limit(requirements, corner)
    planned_turn = abs(float(requirements.turns[corner]))
    if planned_turn <= limit or limit <= SUGGESTION_ANGLE_MARGIN_RAD:
        return ()
    place, max_turn = requirements.waypoint_place(corner), limit - SUGGESTION_ANGLE_MARGIN_RAD
    alternatives: list[_SizedSuggestion] = []
    if source == "aircraft" and math.isfinite(requirements.length_before[corner]):
        speed = _turn_speed(requirements, corner)
        if speed is not None:
            current_speed = float(max(requirements.setup.demanded_route.leg_airspeeds[corner - 1 : corner + 1]))
            alternatives.append(
                (1.0 - speed / current_speed, (Change("airspeed", place, current_speed, speed, "m/s"),))
            )
        # Longer legs, with room for this turn and the neighbouring turns.
        longer_legs = []
        relative_growth = 0.0
        for leg in (corner - 1, corner):
            needed_length = (
                requirements.length_after[leg]
                + requirements.length_before[leg + 1]
                + requirements.reversal[leg]
                + SUGGESTION_LENGTH_MARGIN_M
            )
            leg_length = float(requirements.runs[leg])
            if math.isfinite(needed_length) and needed_length > leg_length:
                wanted_length = float(math.ceil(needed_length))
                longer_legs.append(Change("length", requirements.leg_place(leg), leg_length, wanted_length, "m"))
                relative_growth = max(relative_growth, needed_length / leg_length - 1.0)
        alternatives += [(relative_growth, tuple(longer_legs))] if longer_legs else []
    degrees = _gentler_turn(requirements, corner, max_turn)
    if degrees > 0.0:
        change = Change("turn", place, math.degrees(planned_turn), degrees, "deg")
        alternatives.append((1.0 - max_turn / planned_turn, (change,)))
    return _sort_by_change(alternatives)


def suggest_stating_bank(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest that the user state the aircraft's bank limit if it is a guess; return () otherwise."""
    if finding.check != UNKNOWN_AIRCRAFT:
        return ()
    current, possible = (math.degrees(bank) for bank in (requirements.setup.max_bank, requirements.possible_bank))
    return ((Change("stated bank", finding.place, current, possible, "deg"),),)


def suggest_larger_loiter(
    requirements: RouteRequirements, aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest the radius at which a loiter keeps the bank limit in this wind.

    If the aircraft is not known well enough, suggest stating its bank limit.  Return () for a place without a loiter,
    or if the autopilot flies no sufficient radius.
    """
    if finding.check == UNKNOWN_AIRCRAFT:
        return suggest_stating_bank(requirements, aligned, finding)
    item = next((item for item in requirements.setup.mission.items if item.seq == finding.place.item), None)
    loiter, radius_of = None if item is None else stated_loiter(item), requirements.setup.autopilot.loiters.radius_of
    if loiter is None or finding.limit is None or not finding.planned or finding.planned >= finding.limit:
        return ()
    # The flown radius grows with the altitude.  The autopilot rounds the stated radius by up to 10 m.
    scale = finding.planned / radius_of(loiter) if radius_of(loiter) else math.nan
    if not math.isfinite(scale):
        return ()
    needed_radius = finding.limit / scale
    candidates = (float(math.ceil(needed_radius) + k) for k in range(_MAX_RADIUS_ROUNDING_M + 1))
    radius = first_that_passes(
        candidates,
        lambda radius: radius_of(replace(loiter, radius=math.copysign(radius, loiter.radius))) >= needed_radius,
    )
    return () if radius is None else ((Change("radius", finding.place, abs(loiter.radius), radius, "m"),),)


def _gentler_turn(requirements: RouteRequirements, corner: int, max_turn: float) -> float:
    """Return the largest turn that passes at a corner, deg, in steps of 0.1; 0 if none passes.

    The route after the corner is rotated with the turn.  In wind, the courses after the corner affect the next turns,
    and thus the length available to this turn.
    max_turn: largest turn to try, rad.
    """
    first_point, end_point = max(0, corner - 2), min(len(requirements.points), corner + 3)
    route = requirements.route
    nearby_route = replace(route, points=route.points[first_point:end_point])
    tables, local_corner = leg_performance(requirements.limits), corner - first_point
    for _ in range(SUGGESTION_TRIAL_COUNT):
        degrees = math.floor(10.0 * math.degrees(max_turn)) / 10.0
        if degrees <= 0.0:
            return 0.0
        points = np.array(requirements.points[first_point:end_point])
        change = math.copysign(math.radians(degrees), requirements.turns[corner]) - float(requirements.turns[corner])
        cos, sin = math.cos(change), math.sin(change)
        next_points = points[local_corner + 1 :, :2] - points[local_corner, :2]
        points[local_corner + 1 :, :2] = points[local_corner, :2] + next_points @ np.array([[cos, -sin], [sin, cos]])
        trial = turn_requirements(nearby_route.with_fields(position=points), tables)
        limit, _ = tighter_turn_limit(requirements, corner, float(trial.limit[local_corner]))
        if limit >= math.radians(degrees):
            return degrees
        max_turn = min(max_turn, limit) - SUGGESTION_ANGLE_MARGIN_RAD
    return 0.0


def _true_airspeed_ratio(requirements: RouteRequirements, leg: int) -> float:
    """Return the ratio of true airspeed to the commanded airspeed on a leg."""
    return float(requirements.route.leg_airspeeds[leg] / requirements.setup.demanded_route.leg_airspeeds[leg])


def _level_speeds(requirements: RouteRequirements, altitude: float, current_speed: float, factor: float) -> list[float]:
    """Return airspeed commands for level flight at an altitude (m AMSL), m/s.

    The airspeed closest to `current_speed` comes first.

    They are multiples of `SUGGESTION_SPEED_STEP_MPS`, and at least `MIN_SUGGESTED_SPEED_RATIO` times the slowest level
    speed.  If the maximum airspeed is uncertain, only airspeeds that are certainly possible are returned.

    factor: ratio of true airspeed to commanded airspeed.
    """
    envelope = requirements.setup.envelope.with_margin()
    min_speed, max_speed = envelope.level_speeds(altitude)
    min_speed = max(min_speed * MIN_SUGGESTED_SPEED_RATIO, float(envelope.airspeed[0]))
    max_speed = min(max_speed, float(envelope.airspeed[-1]))
    min_speed, max_speed = min_speed / factor, max_speed / factor
    steps = (
        np.arange(
            math.ceil(min_speed / SUGGESTION_SPEED_STEP_MPS), math.floor(max_speed / SUGGESTION_SPEED_STEP_MPS) + 1
        )
        * SUGGESTION_SPEED_STEP_MPS
    )
    return sorted((float(speed) for speed in steps), key=lambda speed: (abs(speed - current_speed), speed))


def _slope_speed(requirements: RouteRequirements, leg: int, slope: float) -> float | None:
    """Return the commanded airspeed closest to the present one at which the aircraft holds a slope, m/s.

    Return None if it certainly holds the slope at no other airspeed.
    slope: absolute value of the slope, rad.
    """
    course = float(requirements.courses[leg])
    direction = 0 if requirements.slopes[leg] >= 0.0 else 1
    altitudes = (float(requirements.points[leg, 2]), float(requirements.points[leg + 1, 2]))
    factor = _true_airspeed_ratio(requirements, leg)
    certain_limits = requirements.limits.with_margin()

    def can_hold_slope(speed: float) -> bool:
        """Return True if the aircraft certainly holds the slope at both ends of the leg at an airspeed, m/s."""
        table = certain_limits.performance(speed * factor)
        return min(aircraft_slopes(table, course, altitude)[direction] for altitude in altitudes) >= slope

    commanded = float(requirements.setup.demanded_route.leg_airspeeds[leg])
    other_speeds = (
        speed
        for speed in _level_speeds(requirements, max(altitudes), commanded, factor)
        # Closer to the present airspeed than this is no other airspeed.
        if abs(speed - commanded) >= 0.5 * SUGGESTION_SPEED_STEP_MPS
    )
    return first_that_passes(other_speeds, can_hold_slope)


def _turn_speed(requirements: RouteRequirements, corner: int) -> float | None:
    """Return the highest commanded airspeed below the present one at which a turn fits its legs, m/s.

    Return None if the turn fits at no lower airspeed.

    corner: waypoint at which the aircraft turns.
    """
    current_speed = float(max(requirements.setup.demanded_route.leg_airspeeds[corner - 1 : corner + 1]))
    available_length = min(
        available_lengths(
            requirements.runs, requirements.length_before, requirements.length_after, requirements.reversal, corner
        )
    )
    factor = _true_airspeed_ratio(requirements, corner)
    altitude = float(requirements.points[corner, 2])

    def does_turn_fit(speed: float) -> bool:
        """Return True if the turn fits its legs at a commanded airspeed, m/s."""
        table = requirements.limits.performance(speed * factor)
        radius = turn_radius_between(table, requirements.courses[corner - 1], requirements.courses[corner], altitude)
        lengths = turn_lengths(
            abs(float(requirements.turns[corner])), radius, bool(requirements.setup.route.fly_over[corner])
        )
        return max(lengths) + SUGGESTION_LENGTH_MARGIN_M <= available_length

    slower_speeds = [
        speed for speed in _level_speeds(requirements, altitude, current_speed, factor) if speed < current_speed
    ]
    return first_that_passes(sorted(slower_speeds, reverse=True), does_turn_fit)


def _round_to_meter(length: float) -> float:
    """Round a length to whole meters."""
    return float(round(length))


def suggest_wider_berth(
    requirements: RouteRequirements, aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest passing a missile at a greater distance, outside its sphere; return () for any other place."""
    missile = finding.place.index
    if missile is None or finding.place.kind != "missile":
        return ()
    threats = requirements.setup.scenario.threats
    index = slice(missile, missile + 1)
    spheres = (threats.position[index], threats.kill_radius[index], threats.kill_scale[index])
    min_distance = path_spheres(requirements.path.points, requirements.path.times, *spheres).closest[0]
    if aligned is not None and len(aligned.track) > 1:
        min_distance = min(min_distance, path_spheres(aligned.track.position, aligned.track.time, *spheres).closest[0])
    extra_distance = _round_to_meter(threats.kill_radius[missile] - min_distance + SUGGESTION_LENGTH_MARGIN_M)
    return ((Change("distance", finding.place, current=None, wanted=extra_distance, unit="m"),),)


def home_height(setup: FlightSetup) -> float:
    """Return the height of the mission's home above the ground there, m.

    The height is NaN if no item is placed relative to home, or if home's altitude or the ground there is unknown.
    """
    home, terrain = setup.mission.home, setup.scenario.terrain
    is_used = setup.plan is None and any(item.frame in OVER_HOME for item in setup.mission.items)
    if home is None or terrain is None or not is_used:
        return math.nan
    east, north = to_map(setup.scenario.origin, home.lat_deg, home.lon_deg)
    return home.alt - float(terrain.height(float(east), float(north)))


def home_height_text(setup: FlightSetup) -> str:
    """State how far a mission's home is above or below the ground there; "" within a tolerance.

    The tolerance is `HOME_ALTITUDE_TOLERANCE_M`, or `HOME_ERROR_M` for an imported log, which records the home of its
    flight.  The text is "" also if the height is unknown or not used (`home_height`).
    """
    height = home_height(setup)
    tolerance = HOME_ALTITUDE_TOLERANCE_M if setup.imported_log is None else HOME_ERROR_M
    # The height is NaN if it is unknown.
    if not abs(height) > tolerance:
        return ""
    return f"home is {abs(height):.0f} m {'above' if height > 0.0 else 'below'} the ground there"


def lowest_clearance(findings: Sequence[Finding]) -> float:
    """Return the lowest height above ground in the clearance findings, m; NaN if no finding has a margin."""
    heights = [
        finding.margin + (finding.limit or 0.0)
        for finding in findings
        if finding.rule == "clearance" and finding.margin is not None
    ]
    return min(heights, default=math.nan)


def _suggest_home_on_ground(setup: FlightSetup) -> tuple[Suggestion, ...]:
    """Suggest setting home on the ground; return () if it is there already.

    The tolerance is `HOME_ALTITUDE_TOLERANCE_M`.
    """
    home, height = setup.mission.home, home_height(setup)
    # The height is NaN if it is unknown.  If the file has no home line, its first item was probably taken for home, and
    # another altitude of this item would not help.
    is_first_item = any(HOME_LINE_MISSING_TEXT in warning for warning in setup.mission.warnings)
    if home is None or not abs(height) > HOME_ALTITUDE_TOLERANCE_M or is_first_item:
        return ()
    return ((Change("home altitude", MISSION, home.alt, round(home.alt - height, 1), "m"),),)


def _suggest_home_and_higher_legs(requirements: RouteRequirements) -> tuple[Suggestion, ...]:
    """Suggest setting home on the ground and, together with it, raising the legs that are then too low.

    Return () if home is on the ground already or if the terrain is unknown.
    """
    suggestions, setup = _suggest_home_on_ground(requirements.setup), requirements.setup
    terrain = setup.scenario.terrain
    if not suggestions or terrain is None:
        return ()
    raised = []
    for leg in range(requirements.legs):
        ends = requirements.points[leg : leg + 2] - np.array([0.0, 0.0, home_height(setup)])
        (height,), _ = path_clearance(terrain.heights, terrain.to_pixel.record, np.ascontiguousarray(ends))
        shortfall = setup.limits.min_clearance - height + SUGGESTION_LENGTH_MARGIN_M
        if shortfall > SUGGESTION_LENGTH_MARGIN_M:
            raised.append(
                Change("height", requirements.leg_place(leg), current=None, wanted=_round_to_meter(shortfall), unit="m")
            )
    return ((*suggestions[0], *raised),)


def _suggest_altitude_frame(setup: FlightSetup, frame: Frame) -> tuple[Suggestion, ...]:
    """Suggest another frame for altitudes if the items fit the terrain only in this frame.

    Otherwise return ().

    frame: the frame to suggest: GLOBAL_RELATIVE_ALT for items that would be below the ground, GLOBAL for items that
        would be too high above home.
    """
    below_ground, too_high = find_misread_altitudes(setup.mission, setup.scenario.origin, setup.scenario.terrain)
    if not (too_high if frame == Frame.GLOBAL else below_ground):
        return ()
    current = Frame.GLOBAL_RELATIVE_ALT if frame == Frame.GLOBAL else Frame.GLOBAL
    return ((Change("altitude frame", MISSION, float(current), float(frame), ""),),)


def _suggest_lower_altitudes(setup: FlightSetup) -> tuple[Suggestion, ...]:
    """Suggest setting a home above the ground on the ground, and reading too high altitudes as AMSL.

    Both lower the path.  Return () if neither applies.
    """
    home_on_ground = _suggest_home_on_ground(setup) if home_height(setup) > 0.0 else ()
    return (*home_on_ground, *_suggest_altitude_frame(setup, Frame.GLOBAL))


# A suggested RTL altitude is a multiple of this, m.
RTL_ALTITUDE_STEP_M = 1.0


def suggest_flying_higher(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest flying a leg higher above the ground.

    If home is below the ground and the leg is flown at heights above home, setting home on the ground is the only
    suggestion; the leg is raised together with it if that is not enough.  Otherwise the first suggestion is to read the
    altitudes of items below the ground as heights above home, if they then fit the terrain.  A leg of an RTL is raised
    by the RTL altitude's parameter, by the waypoint at which the RTL begins, or by both.  Any other leg is raised as a
    whole, or follows varied ground.

    For a finding on the flight as a whole, suggest setting home on the ground and raising the legs that are then too
    low.
    """
    if finding.place == FLIGHT:
        return _suggest_home_and_higher_legs(requirements)
    if finding.limit is None or finding.margin is None:
        return ()
    shortfall = -finding.margin + SUGGESTION_LENGTH_MARGIN_M
    if finding.planned is not None:
        # A flight that ended early did not reach the lowest point.
        shortfall = max(shortfall, finding.limit - finding.planned + SUGGESTION_LENGTH_MARGIN_M)
    setup, depth = requirements.setup, -home_height(requirements.setup)
    leg = finding.place.index
    is_above_home = True
    if leg is not None and leg not in setup.route.rtl_legs:
        items_above_home = {item.seq for item in setup.mission.items if item.frame in OVER_HOME}
        is_above_home = not items_above_home.isdisjoint(setup.route.items[leg : leg + 2].tolist())
    if depth > HOME_ALTITUDE_TOLERANCE_M and is_above_home:
        home_on_ground = _suggest_home_on_ground(setup)
        remaining_shortfall = shortfall - depth
        if remaining_shortfall <= SUGGESTION_LENGTH_MARGIN_M or not home_on_ground:
            return home_on_ground
        raised = Change("height", finding.place, current=None, wanted=_round_to_meter(remaining_shortfall), unit="m")
        return ((*home_on_ground[0], raised),)
    suggestions = list(_suggest_altitude_frame(setup, Frame.GLOBAL_RELATIVE_ALT))
    if finding.place.index in setup.route.rtl_legs:
        # Each of these changes alone may need more than the shortfall: a higher RTL altitude by a parameter, a higher
        # waypoint where the RTL begins, or both.
        start, returns = setup.route.rtl_start, setup.autopilot.model.returns
        # An RTL that keeps the altitude of its start has no altitude of its own.
        values = {} if math.isnan(returns.rules.height) else next(iter(returns.trials.altitudes), {})
        wanted = RTL_ALTITUDE_STEP_M * math.ceil((next(iter(values.values()), 0.0) + shortfall) / RTL_ALTITUDE_STEP_M)
        higher_end = tuple(
            Change("parameter", FLIGHT, value, wanted, "m", parameter=name)
            for name, value in values.items()
            if value < wanted
        )
        placed_items = {item.seq for item in setup.mission.items if item.command in PLACES}
        higher_start: Suggestion = ()
        if start is not None and int(setup.route.items[start]) in placed_items:
            higher_start = (
                Change("height", requirements.waypoint_place(start), None, _round_to_meter(shortfall), "m"),
            )
        both = (*higher_end, *higher_start) if higher_end and higher_start else ()
        return (*suggestions, *(suggestion for suggestion in (higher_end, both, higher_start) if suggestion))
    if shortfall > SUGGESTION_LENGTH_MARGIN_M:
        suggestions.append(
            (Change("height", finding.place, current=None, wanted=_round_to_meter(shortfall), unit="m"),)
        )
    following = _follow_ground(requirements, finding)
    if following:
        # A change that lets several legs follow the ground is tried before single legs are raised.
        suggestions.insert(0 if len(following) > 1 else len(suggestions), following)
    return tuple(suggestions)


# Following the ground is suggested on a leg along which the ground's altitude varies by at least this, m.
_MIN_FOLLOWED_RELIEF_M = 20.0


def _follow_ground(requirements: RouteRequirements, finding: Finding) -> Suggestion:
    """Return changes that let the finding's leg follow the ground.

    All other legs that are too low over varied ground follow it, too.

    The end of a changed leg keeps its height above ground, or gets the required height plus `HEIGHT_ERROR_LIMIT_M` if
    that is more.  A leg is not changed if it already follows the ground, or if its item states no height to fly at,
    such as a landing or an RTL.  Return () if the finding's leg cannot be changed, if the ground is unknown, or if the
    autopilot cannot follow terrain.
    """
    setup, leg, limit = requirements.setup, finding.place.index, finding.limit
    terrain = setup.scenario.terrain
    if terrain is None or limit is None or finding.place.kind != "leg" or not setup.autopilot.checks.follows_terrain:
        return ()
    placed_items = {item.seq for item in setup.mission.items if item.command in PLACES}
    changes = []
    for followed_leg in range(requirements.legs):
        start, end = requirements.points[followed_leg], requirements.points[followed_leg + 1]
        count = 2 + int(float(requirements.runs[followed_leg]) / terrain.spacing)
        places = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
        ground = np.asarray(terrain.height(places[:, 0], places[:, 1]), dtype=np.float64)
        follows = bool(np.isfinite(setup.route.points["above_ground"][followed_leg + 1]))
        is_placed = int(setup.route.items[followed_leg + 1]) in placed_items
        if follows or not is_placed or not np.isfinite(ground).all() or np.ptp(ground) < _MIN_FOLLOWED_RELIEF_M:
            continue
        heights = places[:, 2] - ground
        if followed_leg == leg or float(heights.min()) < limit:
            height = _round_to_meter(max(float(heights[-1]), limit + HEIGHT_ERROR_LIMIT_M))
            changes.append(
                Change("terrain height", requirements.leg_place(followed_leg), current=None, wanted=height, unit="m")
            )
    return tuple(changes) if any(change.place.index == leg for change in changes) else ()


def suggest_flying_lower(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest flying a leg below the maximum height above ground.

    Return () if the leg does not exceed it.
    """
    heights = [height for height in (finding.planned, finding.flown) if height is not None]
    if finding.place.kind != "leg" or finding.limit is None or not heights or not max(heights) > finding.limit:
        return ()
    excess = _round_to_meter(max(heights) - finding.limit + SUGGESTION_LENGTH_MARGIN_M)
    return (
        *_suggest_lower_altitudes(requirements.setup),
        (Change("descent", finding.place, current=None, wanted=excess, unit="m"),),
    )


def suggest_better_launch(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a launch into the wind, or a faster throw or catapult; return () without a take-off.

    In a tailwind, suggest the course into the wind, or on a runway the opposite course.  For a throw or catapult that
    is too slow, suggest the speed that reaches the minimum airspeed of level flight.
    """
    ground = requirements.ground_phases
    take_off = None if ground is None else ground.procedures.take_off
    if take_off is None:
        return ()
    wind_east, wind_north = requirements.setup.scenario.wind.velocity_at(take_off.home_altitude)
    tailwind = wind_east * math.sin(take_off.course) + wind_north * math.cos(take_off.course)
    suggestions: list[Suggestion] = []
    speed = float(math.ceil(requirements.setup.envelope.level_speeds(take_off.home_altitude)[0] + tailwind))
    if take_off.launch.method != "runway" and take_off.speed < speed:
        suggestions.append((Change("launch speed", finding.place, take_off.speed, speed, "m/s"),))
    if tailwind < CALM_WIND_MPS:
        return tuple(suggestions)
    course = math.atan2(-wind_east, -wind_north)
    if take_off.launch.method == "runway":
        course = take_off.course + math.pi
    current, suggested = (float(round(math.degrees(angle)) % 360) for angle in (take_off.course, course))
    return ((Change("launch course", finding.place, current, suggested, "deg"),), *suggestions)


def suggest_other_landing_course(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest landing from the other end after a failed landing in a tailwind; otherwise return ()."""
    ground = requirements.ground_phases
    approach = None if ground is None else ground.procedures.approach
    if finding.ok is not False or approach is None:
        return ()
    return _suggest_landing_against_wind(requirements, finding.place, approach.course, float(approach.point[2]))


def _suggest_landing_against_wind(
    requirements: RouteRequirements, place: Place, course: float, altitude: float
) -> tuple[Suggestion, ...]:
    """Suggest landing from the other end if the landing course (rad) has a tailwind; otherwise return ().

    altitude: altitude of the landing point, m AMSL.
    """
    wind_east, wind_north = requirements.setup.scenario.wind.velocity_at(altitude)
    if wind_east * math.sin(course) + wind_north * math.cos(course) < CALM_WIND_MPS:
        return ()
    current, wanted = (float(round(math.degrees(angle)) % 360) for angle in (course, course + math.pi))
    return ((Change("landing course", place, current, wanted, "deg"),),)


def suggest_staying_inside(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest lower altitudes if they were misread, then a path further inside the area.

    Return () if the path stays inside.
    """
    if finding.margin is None or not finding.margin < 0.0:
        return ()
    inset = _round_to_meter(-finding.margin + SUGGESTION_LENGTH_MARGIN_M)
    return (
        *_suggest_lower_altitudes(requirements.setup),
        (Change("inset", FLIGHT, current=None, wanted=inset, unit="m"),),
    )


def suggest_using_less_energy(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest a shorter flight, or a battery or tank with more energy.

    Return () if the energy is sufficient or unknown, or if a battery failsafe aborts the mission, because the charge
    at which it acts would not change.
    """
    energy = finding.planned if finding.flown is None else finding.flown
    is_failsafe = finding.limit_source == "autopilot"
    if energy is None or finding.limit is None or finding.margin is None or (is_failsafe and finding.ok is False):
        return ()
    if finding.planned is not None and finding.flown is not None and finding.flown >= requirements.setup.battery:
        # The flight ended with an empty battery or tank; only the prediction covers the whole mission.
        energy = np.fmax(finding.planned, finding.flown)
    envelope = requirements.setup.envelope
    # The energy in an imported log was measured; any other energy is raised to its one-sided 95 % limit.
    is_measured = requirements.setup.imported_log is not None and finding.flown is not None
    ratio = energy / finding.limit * math.exp(0.0 if is_measured else UNDECIDED_FRACTION * envelope.power_sd)
    if ratio <= 1.0:
        return ()
    storage: ChangeKind = "battery" if envelope.volts or not envelope.power_level.size else "tank"
    shorter_flight = Change(
        "duration", FLIGHT, current=None, wanted=float(math.ceil(100.0 * (1.0 - 1.0 / ratio))), unit="%"
    )
    larger_storage = Change(storage, FLIGHT, current=None, wanted=math.ceil(100.0 * ratio) / 100.0, unit="1")
    # A flight shortened by 100 % would have no length.
    changes = [shorter_flight] if shorter_flight.wanted < 100.0 else []
    changes += [larger_storage] if not is_failsafe else []
    return tuple((change,) for change in changes)


def suggest_flying_faster(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest an airspeed above the stall on the slowest leg; () if it already has one.

    finding: failed finding of the stall rule; without a limit there is no suggestion.
    """
    if finding.limit is None:
        return ()
    leg = int(np.argmin(requirements.route.leg_airspeeds))
    current_speed = float(requirements.setup.demanded_route.leg_airspeeds[leg])
    requested_speed = (
        math.ceil(
            10.0 * finding.limit * (1.0 + SUGGESTION_SPEED_MARGIN_FRACTION) / _true_airspeed_ratio(requirements, leg)
        )
        / 10.0
    )
    return (
        ((Change("airspeed", finding.place, current_speed, requested_speed, "m/s"),),)
        if requested_speed > current_speed
        else ()
    )


def suggest_level_flight_speed(
    requirements: RouteRequirements, _aligned: AlignedTrack | None, finding: Finding
) -> tuple[Suggestion, ...]:
    """Suggest an airspeed at which level flight is possible at the leg's altitude.

    If the maximum airspeed is uncertain, suggest only airspeeds that are certainly possible.
    """
    leg = finding.place.index
    if leg is None or finding.limit is None or finding.margin is None:
        return ()
    commanded = float(requirements.setup.demanded_route.leg_airspeeds[leg])
    altitude = float(max(requirements.points[leg, 2], requirements.points[leg + 1, 2]))
    min_speed, max_speed = (
        speed / _true_airspeed_ratio(requirements, leg)
        for speed in requirements.setup.envelope.with_margin().level_speeds(altitude)
    )
    if min_speed <= commanded <= max_speed:
        return ()
    min_speed = math.ceil(10.0 * min_speed * (1.0 + SUGGESTION_SPEED_MARGIN_FRACTION)) / 10.0
    max_speed = math.floor(10.0 * max_speed * (1.0 - SUGGESTION_SPEED_MARGIN_FRACTION)) / 10.0
    return ((Change("airspeed", finding.place, commanded, min_speed, "m/s", most=max_speed),),)
