"""The loiter rule: judge if a loiter can be held within the bank limit, and was completed.

The wind is taken into account.

A loiter is flown as corners around its circle, each judged like any turn.  The findings on the corners of a loiter are
merged into one, and each rule keeps only its worst finding on the legs between the corners.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flight.mission.itinerary import Loiter, stated_loiter
from logs.verdict.findings import (
    UNKNOWN_AIRCRAFT,
    UNKNOWN_PATH,
    Finding,
    Message,
    finding_reason,
    make_finding,
    message,
    worst_first_key,
)
from logs.verdict.measures.bank_limit import bank_limit_text
from logs.verdict.measures.circle_reach import end_loiter_hazards, find_hazards
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack, closest_approaches
from logs.verdict.places import Place
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_larger_loiter
from logs.verdict.tolerances import (
    BANK_TOLERANCE_RAD,
    LOITER_LAPS_TOLERANCE,
    LOITER_RADIUS_TOLERANCE_M,
    LOITER_SWING_RADII,
    LOITER_WIDENING_FRACTION,
    WAYPOINT_PASS_MARGIN_M,
)
from logs.verdict.wording import compared_texts, place_text
from world.arrays import Floats
from world.geometry import tangent_length


@dataclass(frozen=True, slots=True)
class LoiterCircle:
    """One loiter of a route.

    first, last: waypoints of the first and last corner; neither is an end of the route.
    center: center, m, (2,).
    radius: m.
    laps: number of laps.
    """

    first: int
    last: int
    center: Floats
    radius: float
    laps: float


def loiter_circles(requirements: RouteRequirements) -> list[LoiterCircle]:
    """Return the loiters of a route, in flying order.

    A loiter is a series of corners with arcs that belong to one mission item.
    """
    arc_radii, items = requirements.setup.route.arc_radii, requirements.setup.route.items
    loiters: list[LoiterCircle] = []
    first = 0
    while first < len(arc_radii):
        last = first
        while last + 1 < len(arc_radii) and arc_radii[last + 1] > 0.0 and items[last + 1] == items[first]:
            last += 1
        if arc_radii[first] > 0.0:
            laps = float(np.abs(requirements.turns[first : last + 1]).sum()) / (2.0 * math.pi)
            # Center of the circle to which the arc of the corner belongs.
            ux, uy = requirements.leg_unit(first - 1)
            turn_sign = math.copysign(1.0, requirements.turns[first])
            tangent = tangent_length(abs(float(requirements.turns[first])), float(requirements.radius[first]))
            center = np.array(
                requirements.points[first, :2]
                - tangent * np.array([ux, uy])
                + turn_sign * requirements.radius[first] * np.array([uy, -ux])
            )
            loiters.append(LoiterCircle(first, last, center, float(arc_radii[first]), laps))
            first = last
        first += 1
    return loiters


def merge_loiter_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Merge the findings on each loiter: one for all corners, and each rule's worst on the loiter's legs."""
    joins_at_center = requirements.setup.autopilot.loiters.steers_to_center
    merged: list[Finding | None] = list(findings)
    # Indexed by rule and place: a mission of jumps has hundreds of loiters, and each thousands of findings.
    positions: dict[tuple[str, Place], list[int]] = {}
    for k, finding in enumerate(findings):
        positions.setdefault((finding.rule, finding.place), []).append(k)

    def remaining_findings(rules: Sequence[str], places: Sequence[Place]) -> list[tuple[int, Finding]]:
        """Return index and finding for each finding of these rules and places, in order.

        Findings that are already merged are left out.
        """
        indices = sorted(k for rule in rules for place in places for k in positions.get((rule, place), ()))
        return [(k, finding) for k in indices if (finding := merged[k]) is not None and finding.rule in rules]

    for circle in loiter_circles(requirements):
        # If the mission ends on this loiter, its last waypoint belongs to the loiter.
        last_items = requirements.setup.route.items[circle.last : circle.last + 2].tolist()
        includes_end = joins_at_center and len(last_items) == 2 and last_items[0] == last_items[1]
        last = circle.last + 1 if includes_end else circle.last
        corner_findings = remaining_findings(
            ("turn", "waypoint"), [requirements.waypoint_place(i) for i in range(circle.first, last + 1)]
        )
        for k, _ in corner_findings:
            merged[k] = None
        if corner_findings:
            merged[corner_findings[0][0]] = _loiter_finding(
                requirements, aligned, circle, [finding for _, finding in corner_findings]
            )
        legs = [requirements.leg_place(leg) for leg in range(circle.first, circle.last)]
        for rule in ("slope", "speed", "clearance", "corridor"):
            rule_findings = remaining_findings((rule,), legs)
            if joins_at_center and any(finding.ok is not None for _, finding in rule_findings):
                # The aircraft left the loiter before its other legs: judge only the flown legs.
                for k, finding in rule_findings:
                    merged[k] = finding if finding.ok is not None else None
                rule_findings = [entry for entry in rule_findings if entry[1].ok is not None]
            if len(rule_findings) > 1:
                worst_index, worst_finding = min(rule_findings, key=lambda entry: worst_first_key(entry[1]))
                for k, _ in rule_findings:
                    merged[k] = None
                reason = f"{worst_finding.reason}; the worst of the circle's {len(rule_findings)} legs"
                merged[worst_index] = replace(worst_finding, reason=reason)
    return tuple(finding for finding in merged if finding is not None)


def end_loiter_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the unlimited loiter after the last waypoint; return [] if the mission ends otherwise.

    The finding fails if the wind is too strong for a circle, because the aircraft then drifts downwind.  Otherwise,
    hazards around the loiter leave the finding of a plan undecided, and a flight has no finding.
    """
    reach_and_hazards = end_loiter_hazards(requirements)
    if reach_and_hazards is None:
        return []
    reach, hazards = reach_and_hazards
    title, place = requirements.setup.autopilot.title, requirements.waypoint_place(requirements.legs)
    if not math.isfinite(reach):
        fault = message(
            f"{title} then circles here indefinitely, and the wind is too strong to fly a circle",
            f": at {float(requirements.route.leg_airspeeds[-1]):.1f} m/s the aircraft drifts downwind",
        )
        return [
            make_finding(
                *("loiter", place), ok=False, reason=fault.text, faults=[fault], method="wind and airspeed at the end"
            )
        ]
    if not geometric:
        return []
    reason = f"{title} then circles here, up to {reach:.0f} m from this waypoint"
    if hazards:
        reason += f": {', '.join(hazards)}; only a simulated flight shows how close the aircraft comes"
    return [
        make_finding(
            "loiter",
            place,
            ok=None if hazards else True,
            reason=reason,
            method="the area that its circles may reach, at the altitude of the last waypoint",
            check=UNKNOWN_PATH if hazards else "",
        )
    ]


def _loiter_finding(
    requirements: RouteRequirements, aligned: AlignedTrack | None, circle: LoiterCircle, corner_findings: list[Finding]
) -> Finding:
    """Judge one loiter by its radius, its laps, and the findings on its corners.

    The new finding replaces those findings.
    """
    # A flight that ended before a corner does not fail there: the completion rule judges the early end.
    corner_findings = [
        replace(finding, ok=None)
        if finding.ok is False
        and not (aligned is None or finding.place.index is None or aligned.passed[finding.place.index])
        else finding
        for finding in corner_findings
    ]
    failed_corners = [finding for finding in corner_findings if finding.ok is False]
    rules, loiter = requirements.setup.autopilot.loiters, _stated_loiter(requirements, circle)
    # Without a radius in its item, a loiter is flown with the radius of a parameter.
    uses_parameter = (
        rules.exits_on_heading and rules.radius != 0.0 and loiter is not None and rules.radius_of(loiter) == 0.0
    )
    if rules.steers_to_center and aligned is None:
        failed_corners = [] if uses_parameter else failed_corners
    elif rules.steers_to_center and aligned is not None:
        # The flight has arrived if it came close enough to the center.  The corners do not show the arrival, because a
        # flight that leaves the loiter early may miss all of them.
        distances, _ = closest_approaches(aligned.track.position, circle.center)
        altitude = float(requirements.points[circle.first, 2])
        arrival_distance = circle.radius + requirements.setup.autopilot.turns.distance(math.pi, altitude)
        if distances.min() <= arrival_distance + WAYPOINT_PASS_MARGIN_M:
            failed_corners = []
    judgement = _judge_radius(
        requirements, circle, corner_findings, uses_parameter=uses_parameter, is_flown=aligned is not None
    )
    faults, facts = judgement.faults, judgement.facts
    faults += _corner_faults(requirements, aligned, circle, failed_corners, has_faults=bool(faults))
    radii, laps = _measure_circles(requirements, aligned, circle)
    mean_radius = float(radii.mean()) if radii.size else math.nan
    max_radius = circle.radius * (1.0 + LOITER_WIDENING_FRACTION) + WAYPOINT_PASS_MARGIN_M
    if rules.steers_to_center and not uses_parameter and circle.laps >= 1.0 and mean_radius > max_radius:
        mean_text, max_text = compared_texts(mean_radius, max_radius, "m", 0)
        faults.append(message(f"flown with a mean radius of {mean_text}", f"; at most {max_text}"))
    ok: bool | None = not (faults or failed_corners)
    if radii.size:
        laps_text = "" if math.isnan(laps) else f"{laps:.1f} laps "
        facts.append(f"{laps_text}flown at {radii.min():.1f} to {radii.max():.1f} m from the center")
    has_unjudged = any(finding.ok is None and finding.check != UNKNOWN_AIRCRAFT for finding in corner_findings)
    # A loiter that ends at an altitude needs no number of laps.
    is_to_altitude = loiter is not None and loiter.to_altitude
    is_whole = math.isfinite(laps) and (is_to_altitude or laps >= circle.laps - LOITER_LAPS_TOLERANCE)
    if ok and has_unjudged and not is_whole:
        ok = None
        is_complete = aligned is not None and bool(aligned.passed[circle.last])
        facts.append("a part of the circle was not flown" if is_complete else "the flight did not reach its end")
    if ok and judgement.check:
        ok = None
        facts += [judgement.hazards_text] if judgement.hazards_text else []
    return make_finding(
        "loiter",
        requirements.waypoint_place(circle.first),
        ok=ok,
        reason=finding_reason(faults, facts),
        faults=faults,
        planned=circle.radius,
        flown=mean_radius,
        limit=judgement.min_radius,
        at_least=True,
        source="none" if math.isnan(judgement.min_radius) else "aircraft",
        tolerance=LOITER_RADIUS_TOLERANCE_M,
        margin=circle.radius - judgement.min_radius,
        unit="m",
        method="radius over the ground, and the radius at the bank limit in this wind; each corner as a turn",
        check=judgement.check if ok is None else "",
    )


class _RadiusJudgement(NamedTuple):
    """Judgement of a loiter's radius.

    min_radius: smallest radius that the bank limit permits, m; NaN if the limit is unknown.
    faults, facts: messages and texts on the radius and the laps for the finding.
    check: `UNKNOWN_AIRCRAFT` or `UNKNOWN_PATH` if the radius cannot be judged, otherwise "".
    hazards_text: text on hazards within reach of a loiter that is flown wider than drawn; "" without hazards.
    """

    min_radius: float
    faults: list[Message]
    facts: list[str]
    check: str
    hazards_text: str


def _judge_radius(
    requirements: RouteRequirements,
    circle: LoiterCircle,
    corner_findings: list[Finding],
    *,
    uses_parameter: bool,
    is_flown: bool,
) -> _RadiusJudgement:
    """Judge whether the aircraft can fly a loiter's radius in this wind.

    uses_parameter: True if a parameter states the radius.
    is_flown: True after a flight, which shows where the aircraft circled.
    """
    setup, max_bank = requirements.setup, requirements.limits.max_bank
    is_known = bool(np.isfinite(requirements.turn_limit[circle.first : circle.last + 1]).all())
    min_radius = _min_radius(requirements, circle) if is_known else math.nan
    loiter, laps_text = _stated_loiter(requirements, circle), f"{circle.laps:.1f} laps from joining to leaving"
    if loiter is not None and loiter.turns:
        laps_text = f"{loiter.turns:g} {'lap' if loiter.turns == 1.0 else 'laps'} planned ({laps_text})"
    facts = [f"{laps_text}, with a radius of {circle.radius:.0f} m"]
    if not is_known or circle.radius >= min_radius - LOITER_RADIUS_TOLERANCE_M:
        return _RadiusJudgement(min_radius, [], facts, "", "")
    speed = float(requirements.route.leg_airspeeds[circle.first])
    radius_text, min_text = compared_texts(circle.radius, min_radius, "m", 0)
    need_text = f"at {speed:.0f} m/s and {bank_limit_text(setup)} the aircraft needs {min_text}"
    if not math.isfinite(min_radius):
        need_text = f"at {speed:.0f} m/s the circle cannot be flown"
    fault = message(f"the radius is {radius_text}, but {need_text} in this wind")
    # The largest bank limit that the aircraft may have permits the radius.
    if circle.radius >= _min_radius(requirements, circle, possible=True) - LOITER_RADIUS_TOLERANCE_M:
        return _RadiusJudgement(min_radius, [], [fault.text, *facts], UNKNOWN_AIRCRAFT, "")
    if not uses_parameter or not math.isfinite(min_radius):
        return _RadiusJudgement(min_radius, [fault], facts, "", "")
    # If the parameter makes the loiter too tight, the autopilot flies it wider, as at the end of a return.  The bank
    # held is the largest measured one-second mean, or else the bank that the radius needs, up to the autopilot's limit.
    parameter_name = setup.autopilot.loiters.radius_name
    measured_banks = [fact.value for finding in corner_findings for fact in finding.facts if fact.what == "bank"]
    needed_bank = math.atan(math.tan(max_bank) * min_radius / circle.radius)
    bank = math.radians(max(measured_banks)) if measured_banks else min(setup.autopilot.turns.max_bank, needed_bank)
    if bank > max_bank + BANK_TOLERANCE_RAD + 1e-9:
        facts.append(f"{parameter_name}, held with {math.degrees(bank):.0f}° of bank")
        return _RadiusJudgement(min_radius, [fault], facts, "", "")
    facts.append(f"flown wider than {parameter_name}: the bank limit requires a radius of {min_radius:.0f} m")
    heights = requirements.points[circle.first : circle.last + 1, 2]
    reach, hazards = LOITER_SWING_RADII * min_radius, []
    if not is_flown:
        hazards = find_hazards(requirements, circle.center, float(heights.min()), float(heights.max()), reach)
    hazards_text = (
        f"the aircraft may get {reach:.0f} m from the center, and there, {', '.join(hazards)}; only a simulated flight"
        " shows where the aircraft circles"
    )
    return _RadiusJudgement(min_radius, [], facts, UNKNOWN_PATH if hazards else "", hazards_text if hazards else "")


def _corner_faults(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    circle: LoiterCircle,
    failed_corners: list[Finding],
    *,
    has_faults: bool,
) -> list[Message]:
    """Return one message on the failed corners of a loiter, or [] if there is nothing to report.

    aligned: flown track, whose worst failed corner is described; None for a plan, whose first failed corner is.
    has_faults: True if the loiter itself has a fault; planned corners are then not reported.
    """
    if not failed_corners or (aligned is None and has_faults):
        return []
    if aligned is not None:
        # Number of corners that failed in flight, and the worst of them.
        worst_corner = min(failed_corners, key=worst_first_key)
        corner_count = len({finding.place for finding in failed_corners})
        count_text = f"{corner_count} of {circle.last - circle.first + 1} corners not held; the worst is "
        return [
            Message(
                f"{count_text}{place_text(worst_corner.place)}: {worst_corner.reason}",
                f"{count_text}{_corner_text(worst_corner.place)}",
            )
        ]
    finding = failed_corners[0]
    reason_text = f"{place_text(finding.place)}: {finding.reason}"
    return [
        Message(reason_text, _corner_text(finding.place), finding.place == requirements.waypoint_place(circle.first))
    ]


def _min_radius(requirements: RouteRequirements, circle: LoiterCircle, *, possible: bool = False) -> float:
    """Return the smallest radius that the bank limit permits for a loiter in this wind, m.

    The wind is taken only on the courses of the loiter's arcs.  An unlimited loiter has all courses, even if the route
    contains only a part of a lap.

    possible: True for the largest bank limit that the aircraft may have, False for the setup's limit.
    """
    radii = requirements.possible_min_radius if possible else requirements.min_radius
    min_radius = float(radii[circle.first : circle.last + 1].max())
    setup, loiter = requirements.setup, _stated_loiter(requirements, circle)
    if loiter is None or not loiter.endless:
        return min_radius
    altitude = float(requirements.points[circle.first, 2])
    airspeed = float(requirements.route.leg_airspeeds[circle.first - 1])
    bank_ratio = math.tan(requirements.limits.max_bank) / math.tan(requirements.possible_bank) if possible else 1.0
    # Two half laps cover all courses.
    return max(
        min_radius,
        *(
            bank_ratio * setup.limits.turn_radius(course, course + math.pi, altitude, airspeed)
            for course in (0.0, math.pi)
        ),
    )


def _stated_loiter(requirements: RouteRequirements, circle: LoiterCircle) -> Loiter | None:
    """Return the loiter stated by a circle's mission item; None without such an item."""
    seq = int(requirements.setup.route.items[circle.first])
    return next((stated_loiter(item) for item in requirements.setup.mission.items if item.seq == seq), None)


def _measure_circles(
    requirements: RouteRequirements, aligned: AlignedTrack | None, circle: LoiterCircle
) -> tuple[Floats, float]:
    """Return the distances of the track's rows from a loiter's center, m, (n,), and the laps flown.

    The distances are taken between the first and the last corner, the laps between the waypoints before and after the
    loiter.  Without a flight that passed the last corner, the array is empty and the number is NaN.  The number is also
    NaN if the autopilot follows the drawn corners instead of circling the center.
    """
    radii, laps = np.zeros(0), math.nan
    if aligned is None or not aligned.passed[circle.last]:
        return radii, laps
    first, last = int(aligned.rows[circle.first]), int(aligned.rows[circle.last])
    if last > first:
        offsets = aligned.track.position[first : last + 1, :2] - circle.center
        radii = np.asarray(np.hypot(offsets[:, 0], offsets[:, 1]))
    if requirements.setup.autopilot.loiters.steers_to_center:
        end = min(circle.last + 1, requirements.legs)
        rows = slice(int(aligned.rows[circle.first - 1]), int(aligned.rows[end]) + 1)
        east, north = (aligned.track.position[rows, :2] - circle.center).T
        max_radius = circle.radius * (1.0 + LOITER_WIDENING_FRACTION) + WAYPOINT_PASS_MARGIN_M
        is_on_circle = np.hypot(east, north) <= max_radius
        steps = np.diff(np.unwrap(np.arctan2(east, north)))[is_on_circle[1:] & is_on_circle[:-1]]
        laps = abs(float(steps.sum())) / (2.0 * math.pi)
    return radii, laps


def _corner_text(place: Place) -> str:
    """Name a corner for a headline, without the mission item, which all corners of a loiter share."""
    return place_text(replace(place, item=None))


RULE = Rule(
    name="loiter",
    tolerances=(
        "LOITER_RADIUS_TOLERANCE_M",
        "LOITER_LAPS_TOLERANCE",
        "WAYPOINT_PASS_MARGIN_M",
        "BANK_TOLERANCE_RAD",
        "POSSIBLE_BANK_RAD",
        "LOITER_SWING_RADII",
        "LOITER_WIDENING_FRACTION",
    ),
    judge=end_loiter_findings,
    merge=merge_loiter_findings,
    suggest=suggest_larger_loiter,
    log=LogNeeds(needs_aircraft=True),
)
