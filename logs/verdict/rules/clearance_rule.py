"""The clearance rule: judge the minimum height above ground on each leg, planned and flown."""

import math
from typing import NamedTuple

import numpy as np

from logs.verdict.findings import (
    GROUND_PATH,
    LOWEST_POINT_ERROR,
    Fact,
    Finding,
    Message,
    make_finding,
    message,
)
from logs.verdict.measures.ground_following import altitude_error
from logs.verdict.measures.ground_paths import (
    first_landing_leg,
    has_ground_paths,
    landing_item,
    takeoff_item,
)
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import home_height, lowest_clearance, suggest_flying_higher
from logs.verdict.tolerances import (
    BELOW_HOME_M,
    CLEARANCE_TOLERANCE_M,
    FIELD_RADIUS_M,
    GROUND_LEG_CLEARANCE_M,
    HOME_ERROR_M,
)
from logs.verdict.wording import place_text
from world.arrays import Floats
from world.frames import to_geo, to_map
from world.terrain import Terrain

# Greatest depth below ground of the last row of a flight that hits the ground, m: a tick of 1/60 s at 50 m/s is 0.8 m.
_CONTACT_DEPTH_M = 1.0


def clearance_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the minimum height above ground on each leg, except on a landing that another rule judges.

    Without terrain data, a single unjudged finding stands for all legs.  A further, undecided finding reports a
    doubtful altitude of home.

    geometric: True to judge the planned path only.
    """
    terrain = requirements.setup.scenario.terrain
    limit = requirements.limits.min_clearance
    if terrain is None:
        reason = "no terrain was given, so heights above ground are unknown"
        unknown = make_finding(
            "clearance",
            FLIGHT,
            ok=None,
            reason=reason,
            limit=limit,
            source=requirements.limits_source,
            unit="m",
            at_least=True,
        )
        return [unknown, *_below_home_findings(requirements)]
    landing = _find_landing(requirements)
    fields_by_leg = _fields_by_leg(requirements, landing)
    legs, points = requirements.path.legs, requirements.path.points
    # Each segment's lowest known height above ground, and its first place over unknown ground.
    heights, fractions = path_clearance(terrain.heights, terrain.to_pixel.record, points)
    off_terrain = np.full((len(heights), 3), np.nan)
    for k in np.flatnonzero(np.isnan(heights)):
        start, step = points[k], points[k + 1] - points[k]
        off_terrain[k] = start + fractions[k] * step
        sample_count = 2 + int(np.hypot(step[0], step[1]) / terrain.spacing)
        samples = start + np.linspace(0.0, 1.0, sample_count)[:, None] * step
        sampled_heights = samples[:, 2] - terrain.height(samples[:, 0], samples[:, 1])
        if np.isfinite(sampled_heights).any():
            heights[k] = np.nanmin(sampled_heights)
    findings = []
    for leg in range(requirements.legs):
        if landing is not None and leg == landing.leg and not landing.is_judged_here:
            continue
        requirement = _Requirement(limit, fields_by_leg.get(leg, ()))
        segments = np.flatnonzero(legs == leg)
        planned_height, required_height = requirement.worst_height(heights[segments], points[segments])
        if geometric:
            # The first place where the leg leaves the terrain data.
            places, off_text = off_terrain[segments], ""
            is_off = np.isfinite(places[:, 0])
            if is_off.any():
                east, north = places[int(np.argmax(is_off)), :2].tolist()
                place_text = f"east {east:.0f} m, north {north:.0f} m{_geographic_text(requirements, east, north)}"
                off_text = f"leaves the data of {terrain.source} at {place_text}"
            findings.append(_planned_finding(requirements, leg, planned_height, required_height, terrain, off_text))
        else:
            is_short = planned_height < required_height - CLEARANCE_TOLERANCE_M
            findings.append(
                _flown_finding(requirements, aligned, leg, planned_height, requirement, is_planned_short=is_short)
            )
    # When an autopilot is armed, it sets home to its own position on the ground.  All heights above home are then lower
    # by the height of the mission's home above the ground; it is NaN if it is unknown.
    height = home_height(requirements.setup)
    if height > HOME_ERROR_M and any(
        finding.margin is not None and 0.0 <= finding.margin < height for finding in findings
    ):
        fault = message(
            f"the mission's home is {height:.0f} m above the ground there",
            f"; if the aircraft is armed on that ground, the whole flight is {height:.0f} m lower. Its lowest point is"
            f" then {lowest_clearance(findings) - height:.0f} m above ground",
        )
        home_finding = make_finding("clearance", FLIGHT, ok=None, reason=fault.text, faults=[fault], check=GROUND_PATH)
        findings.insert(0, home_finding)
    return findings


def _geographic_text(requirements: RouteRequirements, east: float, north: float) -> str:
    """Return the latitude and longitude of a map position (m) as a text in brackets."""
    lat, lon = to_geo(requirements.setup.scenario.origin, east, north)
    return f" (latitude {float(lat):.5f}, longitude {float(lon):.5f})"


def _below_home_findings(requirements: RouteRequirements) -> list[Finding]:
    """Return an undecided finding if a waypoint is more than `BELOW_HOME_M` below home, otherwise [].

    It is made only without terrain data: nothing then shows that the ground there is lower than home.
    """
    home = requirements.setup.mission.home
    if home is None:
        return []
    depths = home.alt - requirements.points[:, 2]
    k = int(np.argmax(depths))
    if not float(depths[k]) > BELOW_HOME_M:
        return []
    lowest_waypoint = requirements.waypoint_place(k)
    brief = f"waypoint {lowest_waypoint.number} is {float(depths[k]):.0f} m below home ({home.alt:.0f} m AMSL)"
    fault = message(
        brief, "; no terrain data confirms that the ground there is so low. Name an elevation file with --terrain"
    )
    return [make_finding("clearance", lowest_waypoint, ok=None, reason=fault.text, faults=[fault], check=GROUND_PATH)]


class _Requirement(NamedTuple):
    """Required height above ground on a leg, which is reduced near a flown take-off or landing.

    limit: required height away from home and landing points, m.
    fields: positions (east, north) of home or landing points near which less height is required, m.
    """

    limit: float
    fields: tuple[tuple[float, float], ...]

    def required_heights(self, points: Floats) -> Floats:
        """Return the required heights above ground, m: an array (n,) for `points` (n, 3)."""
        requirement = np.full(len(points), self.limit)
        for east, north in self.fields:
            distances = np.hypot(points[:, 0] - east, points[:, 1] - north)
            requirement[distances <= FIELD_RADIUS_M] = min(self.limit, GROUND_LEG_CLEARANCE_M)
        return requirement

    def worst_height(self, heights: Floats, points: Floats) -> tuple[float, float]:
        """Return the height above ground with the smallest margin, m, and the height required there, m.

        The returned height is NaN, and the requirement `limit`, if no height is known.

        heights: heights above ground at `points`, m, (n,).
        points: positions, m, (n, 3).
        """
        if not np.isfinite(heights).any():
            return math.nan, self.limit
        k, requirement = self.smallest_margin(heights, points)
        return float(heights[k]), requirement

    def smallest_margin(self, heights: Floats, points: Floats) -> tuple[int, float]:
        """Return the index of the height with the smallest margin, and the height required there, m.

        heights, points: as in `worst_height`, with at least one known height.
        """
        if not self.fields:
            return int(np.nanargmin(heights)), self.limit
        requirement = self.required_heights(points)
        k = int(np.nanargmin(heights - requirement))
        return k, float(requirement[k])


class _Landing(NamedTuple):
    """Landing of a mission.

    leg: number of the final approach.
    item: number of the mission item.
    point: landing point (east, north), m.
    is_judged_here: True if this rule judges the final approach, because the flight continues down to the ground.
    """

    leg: int
    item: int
    point: tuple[float, float]
    is_judged_here: bool


def _find_landing(requirements: RouteRequirements) -> _Landing | None:
    """Return the landing of a mission.

    Return None without a landing, or if its path to the ground is not judged.

    Without a `[landing]` in the scenario, a simulated flight ends in the air over the landing point.  This rule then
    leaves the descent to the rules `landing` and `approach`.  In an imported log, the descent ends on the ground.
    """
    setup, ground = requirements.setup, requirements.ground_phases
    approach = (setup.ground_phases if ground is None else ground.procedures).approach
    if approach is not None:
        return _Landing(
            approach.leg, approach.item, (float(approach.point[0]), float(approach.point[1])), is_judged_here=True
        )
    landing = landing_item(requirements.setup)
    if landing is None or (setup.imported_log is None and not has_ground_paths(requirements)):
        return None
    waypoint, item = landing
    position = setup.route.positions[waypoint]
    return _Landing(waypoint - 1, item.seq, (float(position[0]), float(position[1])), is_judged_here=False)


def _fields_by_leg(
    requirements: RouteRequirements, landing: _Landing | None
) -> dict[int, tuple[tuple[float, float], ...]]:
    """Return by leg the positions near which it may be lower than required: home, landing point or both.

    A position is (east, north), m; legs without such a position have no entry.  The legs of a flown or logged take-off
    have the position of home.  The final approach has the landing point.  So have earlier legs of the landing, from the
    last waypoint that keeps the full required height.  A landing begins at DO_LAND_START, or without this item one leg
    before the final approach.
    """
    setup, ground = requirements.setup, requirements.ground_phases
    procedures = setup.ground_phases if ground is None else ground.procedures
    fields_by_leg: dict[int, tuple[tuple[float, float], ...]] = {}
    if procedures.take_off is not None:
        fields_by_leg[procedures.take_off.waypoint] = (
            (float(procedures.take_off.home[0]), float(procedures.take_off.home[1])),
        )
    elif (home := _logged_takeoff_home(requirements)) is not None:
        fields_by_leg = dict.fromkeys(range(takeoff_item(requirements.setup)[0] + 1), (home,))
    if landing is not None:
        first_leg = first_landing_leg(setup, landing.item, landing.leg)
        # Last waypoint before the final approach that keeps the required height; if there is none, the start of the
        # approach.
        final_leg = landing.leg
        terrain, waypoints = requirements.setup.scenario.terrain, requirements.setup.route.positions[: final_leg + 1]
        last_clear_waypoint = final_leg
        if terrain is not None:
            heights = waypoints[:, 2] - terrain.height(waypoints[:, 0], waypoints[:, 1])
            clear_waypoints = np.flatnonzero(heights >= requirements.limits.min_clearance - CLEARANCE_TOLERANCE_M)
            last_clear_waypoint = int(clear_waypoints[-1]) if clear_waypoints.size else final_leg
        for leg in range(max(first_leg, last_clear_waypoint), landing.leg + 1):
            fields_by_leg[leg] = (*fields_by_leg.get(leg, ()), landing.point)
    return fields_by_leg


def _logged_takeoff_home(requirements: RouteRequirements) -> tuple[float, float] | None:
    """Return home's position (east, north, m) if an imported log has a take-off, otherwise None."""
    setup, home = requirements.setup, requirements.setup.mission.home
    if setup.imported_log is None or home is None or takeoff_item(requirements.setup)[1] is None:
        return None
    east, north = to_map(setup.scenario.origin, home.lat_deg, home.lon_deg)
    return float(east), float(north)


def _limit_source(requirements: RouteRequirements, limit: float) -> str:
    """Return the source of a required height above ground (m).

    It is "near the field" if the height is below the usual limit.
    """
    return "near the field" if limit < requirements.limits.min_clearance else requirements.limits_source


def _terrain_error_text(clearance: float, limit: float, error: float | None) -> str:
    """Describe the clearance minus the terrain's stated error; return "" if no error is stated.

    clearance: minimum height above ground, m.
    limit: required height above ground, m.
    error: vertical error of the terrain data, m; None if it is not stated.
    """
    if error is None or math.isnan(clearance):
        return ""
    shortfall_text = (
        f", less than the {limit:.0f} m required" if limit - CLEARANCE_TOLERANCE_M > clearance - error else ""
    )
    return f"; {clearance - error:.1f} m if the terrain's stated error of {error:g} m is subtracted{shortfall_text}"


def _planned_finding(
    requirements: RouteRequirements, leg: int, planned_height: float, limit: float, terrain: Terrain, off_text: str
) -> Finding:
    """Judge the minimum height above ground of a leg's planned path.

    planned_height: minimum known height above ground, m; NaN if it is known nowhere on the leg.
    limit: required height, m.
    off_text: where the leg leaves the terrain data; "" if it does not.
    """
    is_short = planned_height < limit - CLEARANCE_TOLERANCE_M
    reason = f"{_height_text(planned_height)} at the lowest point"
    if is_short:
        reason += f"; {limit:.0f} m are required"
    reason += _terrain_error_text(planned_height, limit, terrain.vertical_error)
    # A leg that is too low over known ground fails, even if other ground below it is unknown.
    is_unknown = bool(off_text) and not is_short
    if off_text:
        reason = f"{off_text}; {reason} elsewhere" if math.isfinite(planned_height) else off_text
    known_height = math.nan if is_unknown else planned_height
    return make_finding(
        "clearance",
        requirements.leg_place(leg),
        ok=None if is_unknown else not is_short,
        reason=reason,
        faults=[_placed_message(requirements, leg, off_text)] if is_unknown else [],
        planned=known_height,
        limit=limit,
        at_least=True,
        source=_limit_source(requirements, limit),
        tolerance=CLEARANCE_TOLERANCE_M,
        margin=known_height - limit,
        unit="m",
        method="exact along the fly-by path",
        check=GROUND_PATH if is_unknown else "",
    )


def _flown_finding(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    leg: int,
    planned_height: float,
    requirement: _Requirement,
    *,
    is_planned_short: bool,
) -> Finding:
    """Judge the minimum height above ground on a leg.

    The finding is not judged if the leg was not flown.

    planned_height: minimum height above ground of the planned path, m, which is only reported.
    is_planned_short: True if the planned path is lower than required.
    """
    min_clearance, ok, reason, limit = math.nan, None, "the leg was not flown", requirement.limit
    terrain, off_text, facts = requirements.setup.scenario.terrain, "", list[Fact]()
    first, last = (0, 0) if aligned is None else aligned.leg_segments(leg)
    if aligned is not None and last > first:
        home = _logged_takeoff_home(requirements)
        if home is not None and leg <= takeoff_item(requirements.setup)[0]:
            # In an imported log with a take-off, the leg is judged from where it reaches `GROUND_LEG_CLEARANCE_M`, if
            # the aircraft stays near home until then.
            is_airborne = aligned.clearance[first:last] >= GROUND_LEG_CLEARANCE_M
            climb_rows = int(np.argmax(is_airborne)) if is_airborne.any() else 0
            places = aligned.track.position[first : first + climb_rows, :2]
            is_near_home = np.hypot(places[:, 0] - home[0], places[:, 1] - home[1]) <= FIELD_RADIUS_M
            first += climb_rows if is_near_home.all() else 0
        clearances = aligned.clearance[first:last]
        is_known = np.isfinite(clearances)
        if is_known.any():
            row, limit = requirement.smallest_margin(clearances, aligned.track.position[first:last].astype(np.float64))
            k, min_clearance = first + row, float(clearances[row])
            ok = min_clearance >= limit - CLEARANCE_TOLERANCE_M
            if not ok and -_CONTACT_DEPTH_M < min_clearance < 0.0:
                # The row of a ground contact is below the surface by at most the distance flown in one tick.
                min_clearance = 0.0
            reason = f"{_height_text(min_clearance)} {_time_and_place_text(aligned, k, aligned.clearance_fraction[k])}"
        if not is_known.all():
            k = first + int(np.argmin(is_known))
            off_text = f"flown outside the terrain data {_time_and_place_text(aligned, k, 0.0)}"
            off_text += _geographic_text(requirements, *aligned.track.position[k, :2].tolist())
            reason = off_text if math.isnan(min_clearance) else f"{reason}; {off_text}"
            ok = None if ok is not False else False
        if aligned is not None and ok is False:
            reason += f"; {limit:.0f} m are required"
            height_error = altitude_error(requirements, leg, aligned.track.position[first + row])
            facts = [Fact(LOWEST_POINT_ERROR, height_error, "m")]
        reason += _terrain_error_text(min_clearance, limit, None if terrain is None else terrain.vertical_error)
    is_unknown = ok is None and bool(off_text)
    if is_planned_short:
        reason += f"; the planned path descends to {_height_text(planned_height)}"
    return make_finding(
        "clearance",
        requirements.leg_place(leg),
        ok=ok,
        reason=reason,
        faults=[_placed_message(requirements, leg, off_text)] if is_unknown else [],
        planned=planned_height,
        flown=min_clearance,
        limit=limit,
        at_least=True,
        source=_limit_source(requirements, limit),
        tolerance=CLEARANCE_TOLERANCE_M,
        margin=math.nan if is_unknown else min_clearance - limit,
        unit="m",
        method="exact along the flown track",
        check=GROUND_PATH if is_unknown else "",
        facts=facts,
    )


def _height_text(clearance: float) -> str:
    """Return a height above ground (m) as text.

    >>> _height_text(12.34), _height_text(0.0), _height_text(-150.2)
    ('12.3 m above ground', 'on the ground', '150.2 m below ground')
    """
    if clearance == 0.0:
        return "on the ground"
    return f"{abs(clearance):.1f} m {'above' if clearance > 0.0 else 'below'} ground"


def _placed_message(requirements: RouteRequirements, leg: int, text: str) -> Message:
    """Make a message that begins with the name of a leg."""
    return message(f"{place_text(requirements.leg_place(leg))} {text}", placed=True)


def _time_and_place_text(aligned: AlignedTrack, segment: int, fraction: float) -> str:
    """Describe time and position of the aircraft at a fraction (0 to 1) of a segment of the track."""
    times = aligned.track.time
    time = times[segment] + fraction * (times[segment + 1] - times[segment])
    return f"at {time:.1f} s, {aligned.position_text(segment, fraction)}"


RULE = Rule(
    name="clearance",
    tolerances=("BELOW_HOME_M", "CLEARANCE_TOLERANCE_M", "GROUND_LEG_CLEARANCE_M", "HOME_ERROR_M", "FIELD_RADIUS_M"),
    judge=clearance_findings,
    suggest=suggest_flying_higher,
    log=LogNeeds(("heights",)),
)
