"""The waypoint rule: judge if each waypoint was reached.

The radius is the mission's or the autopilot's.

ArduPlane also considers a waypoint reached, and turns to the next leg, once the aircraft has crossed the line across
the leg at its end, however far to the side.  For ArduPlane's simulated law, crossing within the corridor is accepted.
The rule ignores altitude, because other rules judge the harm that a wrong altitude can do.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from logs.verdict.findings import Fact, Finding, Message, finding_reason, make_finding, message
from logs.verdict.measures.acceptance import acceptance_limit, position_error
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack, closest_approaches, project_onto_leg
from logs.verdict.measures.waypoint_circles import circles_text, waypoint_circles
from logs.verdict.rule import Rule
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.tolerances import CORNER_CUT_TOLERANCE_M, EQUAL_DISTANCE_TOLERANCE_M, ROUNDING_M
from logs.verdict.wording import compared_texts, place_text
from world.arrays import Floats


def waypoint_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the distance from each waypoint, except the waypoints of turnarounds.

    geometric: True to judge the planned path, False to judge the flown track.
    """
    turnaround_waypoints = requirements.turnaround_waypoints()
    judged_waypoints = [
        waypoint for waypoint in range(len(requirements.points)) if waypoint not in turnaround_waypoints
    ]
    if geometric:
        return [_planned_finding(requirements, waypoint) for waypoint in judged_waypoints]
    apexes = requirements.apexes()
    return [_flown_finding(requirements, aligned, waypoint, apexes) for waypoint in judged_waypoints]


def _planned_finding(requirements: RouteRequirements, waypoint: int) -> Finding:
    """Judge whether the fly-by arc passes within the acceptance radius of its waypoint.

    A waypoint that is flown over passes.  If the autopilot does not fly fly-by arcs, all waypoints pass.
    """
    limit, source = acceptance_limit(requirements, waypoint)
    offset = float(requirements.fly_by_offset[waypoint])
    faults, fact = [], f"the fly-by path passes {offset:.0f} m away"
    autopilot = requirements.setup.autopilot
    if requirements.setup.route.fly_over[waypoint]:
        fact = "flown over"
    elif not autopilot.turns.follows_path:
        # Without fly-by arcs, the autopilot turns at a distance before the waypoint.
        turn_distance, unread_text = limit, ""
        if source == "mission" and not autopilot.turns.reads_acceptance:
            turn = abs(float(requirements.turns[waypoint])) if 0 < waypoint < requirements.legs else math.pi
            turn_distance = autopilot.turns.distance(turn, float(requirements.points[waypoint, 2]))
            unread_text = f"; {autopilot.title} does not read the mission's {limit:.0f} m"
        fact = (
            f"{autopilot.title} turns to the next leg {turn_distance:.0f} m before the waypoint, or once the aircraft"
            f" has passed the waypoint{unread_text}"
        )
    elif offset > limit + ROUNDING_M:
        turn = math.degrees(abs(float(requirements.turns[waypoint])))
        offset_text, limit_text = compared_texts(offset, limit, "m", 0)
        radius = float(requirements.radius[waypoint])
        faults.append(
            message(
                f"the arc of the {turn:.0f}° corner passes the waypoint {offset_text} away",
                f" (radius {radius:.0f} m); the waypoint counts as reached within {limit_text}",
            )
        )
    return make_finding(
        "waypoint",
        requirements.waypoint_place(waypoint),
        ok=not faults,
        reason=finding_reason(faults) if faults else fact,
        faults=faults,
        planned=offset,
        limit=round(limit, 3),
        source=source,
        tolerance=ROUNDING_M,
        margin=limit - offset if autopilot.turns.follows_path else None,
        unit="m",
        method="the fly-by arc",
    )


def _flown_finding(
    requirements: RouteRequirements, aligned: AlignedTrack | None, waypoint: int, apexes: Floats
) -> Finding:
    """Judge the closest approach of the track to a waypoint.

    If the flight ended before it was flying to the waypoint, the finding is not judged.

    apexes: points at which the planned path passes the waypoints, m, (w, 3).
    """
    setup, (limit, source) = requirements.setup, acceptance_limit(requirements, waypoint)
    # The limit of an autopilot that follows the path already includes a margin.
    tolerance = 0.0
    if source in ("mission", "autopilot"):
        tolerance = position_error(setup) + CORNER_CUT_TOLERANCE_M[setup.scenario.wind.turbulence]
    offset, max_distance = float(requirements.fly_by_offset[waypoint]), limit + tolerance
    distance, reason = math.nan, "not reached: nothing was flown"
    ok: bool | None = None
    facts: tuple[Fact, ...] = ()
    faults: list[Message] = []
    if aligned is not None:
        distance, height_error = _closest_approach(requirements, aligned, waypoint, float(apexes[waypoint, 2]))
        facts = (Fact("height error", height_error, "m"),)
        ok = distance <= max_distance
        crossing_offset = math.inf
        if not ok and not setup.autopilot.turns.follows_path and waypoint > 0:
            # The track may have crossed the line that runs through the waypoint, across the leg.
            is_last = waypoint + 1 == len(requirements.points)
            last = len(aligned.track) - 1 if is_last else int(aligned.rows[waypoint + 1])
            distances_along, lateral_offsets = project_onto_leg(
                requirements, waypoint - 1, aligned.track.position[int(aligned.rows[waypoint - 1]) : last + 1]
            )
            rows_past = np.flatnonzero(distances_along >= requirements.runs[waypoint - 1])
            crossing_offset = abs(float(lateral_offsets[rows_past[0]])) if rows_past.size else math.inf
        if crossing_offset <= setup.corridor:
            ok = True
        side = "above" if height_error >= 0.0 else "below"
        reason = f"passed {distance:.1f} m away horizontally, {abs(height_error):.1f} m {side} its altitude"
        if offset >= 1.0:
            reason += f" (the fly-by path passes {offset:.0f} m away)"
        if math.isfinite(crossing_offset):
            reason += f"; the line across the leg at the waypoint was crossed {crossing_offset:.0f} m to the side"
        if waypoint > 0 and not aligned.passed[waypoint]:
            last_leg = requirements.leg_place(aligned.leg_at(len(aligned.track) - 1))
            text = f": the flight ended on {place_text(last_leg)} {math.hypot(distance, height_error):.0f} m away"
            faults = [message("not reached", text)]
            ok, reason = False, finding_reason(faults)
            if not aligned.passed[waypoint - 1]:
                # The aircraft was not flying to this waypoint, so its distance from the waypoint means nothing.
                distance, ok, facts = math.nan, None, ()
                reason = f"not reached: the flight ended on {place_text(last_leg)}"
        elif not ok:
            owner = {"mission": "the mission's", "autopilot": "the autopilot's"}.get(source, "the fly-by path's")
            purpose = RULE_WORDS["waypoint"].tolerance_purpose
            error_text = f" plus {tolerance:.1f} m for {purpose}" if tolerance else ""
            condition_text = f"the waypoint counts as reached within {limit:.0f} m ({owner} radius)"
            reason = f"missed: {reason}; {condition_text}{error_text}"
    return make_finding(
        "waypoint",
        requirements.waypoint_place(waypoint),
        ok=ok,
        reason=reason,
        faults=faults,
        planned=offset,
        flown=distance,
        limit=round(limit, 3),
        source=source,
        tolerance=tolerance,
        # A waypoint reached by crossing its line has no margin, nor does one that was not reached.
        margin=limit - distance if ok is (distance <= max_distance) and not faults else None,
        unit="m",
        method="closest approach, horizontal",
        facts=facts,
    )


def _closest_approach(
    requirements: RouteRequirements, aligned: AlignedTrack, waypoint: int, reference_altitude: float
) -> tuple[float, float]:
    """Return the track's minimum horizontal distance from a waypoint, and the altitude error there, m.

    The altitude error is relative to `reference_altitude` (m AMSL).  If several places are equally close, the error is
    the smallest one.
    """
    first = int(aligned.rows[waypoint - 1]) if waypoint else 0
    last = int(aligned.rows[waypoint + 1]) if waypoint + 1 < len(requirements.points) else len(aligned.track) - 1
    position = aligned.track.position[first : max(last, first + 1) + 1]
    distance, fraction = closest_approaches(position, requirements.points[waypoint])
    if not distance.size:
        offset = aligned.track.position[-1] - requirements.points[waypoint]
        return math.hypot(offset[0], offset[1]), float(offset[2])
    # Among equally close segments take the one nearest in altitude.
    nearest_rows = np.flatnonzero(distance <= distance.min() + EQUAL_DISTANCE_TOLERANCE_M)
    heights = (
        position[nearest_rows, 2]
        + fraction[nearest_rows] * (position[nearest_rows + 1, 2] - position[nearest_rows, 2])
        - reference_altitude
    )
    return float(distance.min()), float(heights[np.argmin(np.abs(heights))])


def with_circles_in_reasons(
    requirements: RouteRequirements, aligned: AlignedTrack | None, findings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Add the circles that the autopilot flew at a failed place to the reason of its finding.

    Return all findings.
    """
    if aligned is None or not (circles := waypoint_circles(requirements, aligned)):
        return tuple(findings)
    legs_of_lines = {
        line.first: range(transition[0], line.ends)
        for survey in requirements.surveys
        for line, transition in zip(survey.lines, survey.transitions(), strict=False)
    }
    explained = []
    for finding in findings:
        place, waypoints = finding.place, range(0)
        if finding.ok is False and place.index is not None and place.kind == "leg":
            legs = legs_of_lines.get(place.index) if finding.rule == "survey" else None
            legs = range(place.index, place.index + 1) if legs is None else legs
            waypoints = range(legs.start, legs.stop + 1)
        elif finding.ok is False and place.index is not None and place.kind == "waypoint":
            waypoints = range(place.index, place.index + 1)
        elif finding.ok is False and finding.rule == "completion" and not aligned.passed[-1]:
            # The first waypoint that was not passed, and the one before it, at which the aircraft may still circle.
            last = int(np.argmin(aligned.passed))
            waypoints = range(last - 1, last + 1)
        text = circles_text(requirements, {index: circles[index] for index in waypoints if index in circles})
        explained.append(replace(finding, reason=f"{finding.reason}; {text}") if text else finding)
    return tuple(explained)


RULE = Rule(
    name="waypoint",
    tolerances=(
        "ROUNDING_M",
        "EQUAL_DISTANCE_TOLERANCE_M",
        "WAYPOINT_PASS_MARGIN_M",
        "NAVIGATION_SIGMAS",
        "CORNER_CUT_TOLERANCE_M",
        "FINAL_WAYPOINT_TOLERANCE_M",
        "CAPTURE_RADIUS_M",
        "CHORD_TIME_S",
    ),
    judge=waypoint_findings,
    merge=with_circles_in_reasons,
)
