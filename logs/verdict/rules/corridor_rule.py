"""The corridor rule: judge the maximum distance of the flight, including its turns, from the legs."""

import math

import numpy as np

from logs.verdict.findings import Finding, finding_reason, make_finding, message
from logs.verdict.measures.acceptance import corridor_limit, farthest_from_legs, turn_deviations
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack, project_onto_leg
from logs.verdict.rule import Rule
from logs.verdict.tolerances import ROUNDING_M, RUNWAY_COURSE_TOLERANCE_RAD
from logs.verdict.wording import compared_texts


def corridor_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the cross-track distance on each leg.

    The legs of a survey are judged only if the scenario states a corridor.  The survey rule judges its photo lines, and
    the autopilot chooses the turns onto the first line and off the last line.

    geometric: True to judge the planned turns only, False to judge the flown track.
    """
    has_stated_corridor = requirements.setup.scenario.limits.corridor_m is not None
    return [
        _leg_finding(requirements, aligned, leg, geometric)
        for leg in range(requirements.legs)
        if has_stated_corridor or not any(survey.has_leg(leg) for survey in requirements.surveys)
    ]


def _leg_finding(requirements: RouteRequirements, aligned: AlignedTrack | None, leg: int, geometric: bool) -> Finding:
    """Judge the largest cross-track distance on one leg.

    geometric: True to judge the planned turns only, False to judge the flown track.
    """
    limit, source = corridor_limit(requirements, leg)
    planned_distance, flown_distance, ok = float(turn_deviations(requirements, leg).max()), math.nan, None
    faults, facts = [], []
    if geometric:
        ok = planned_distance <= limit + ROUNDING_M
        facts.append(f"its turns are planned within {planned_distance:.1f} m of the legs")
        if not ok:
            off_text, max_text = compared_texts(planned_distance, limit, "m", 0)
            faults.append(message(f"its turns lead {off_text} off the legs", f"; the corridor allows {max_text}"))
    elif aligned is None or not aligned.has_flown(leg):
        facts.append("the leg was not flown")
    else:
        # The leg after a take-off begins once the aircraft flies on the leg's course and within the limit of its line.
        # Before, it may still be on the launch course, on which the take-off ends.
        leg_rows, ground = aligned.leg_rows(leg), requirements.ground_phases
        rows = leg_rows
        if ground is not None and ground.procedures.take_off is not None and ground.procedures.take_off.waypoint == leg:
            course_error = aligned.course[leg_rows] - requirements.courses[leg]
            lateral_offset = project_onto_leg(
                requirements, leg, np.asarray(aligned.track.position[leg_rows], dtype=np.float64)
            )[1]
            has_joined = (np.cos(course_error) > math.cos(RUNWAY_COURSE_TOLERANCE_RAD)) & (
                np.abs(lateral_offset) <= limit
            )
            rows = slice(leg_rows.start + int(np.argmax(has_joined)), leg_rows.stop) if has_joined.any() else leg_rows
        nearby_legs = slice(max(0, leg - 1), min(requirements.legs, leg + 2) + 1)
        flown_distance, row = farthest_from_legs(aligned.track.position[rows], requirements.points[nearby_legs])
        ok = flown_distance <= limit
        farthest_row = rows.start + row
        east, north, _ = aligned.track.position[farthest_row]
        time_and_place = f"at {aligned.track.time[farthest_row]:.1f} s, east {east:.0f} m, north {north:.0f} m"
        facts.append(f"within {flown_distance:.1f} m of the legs, the farthest {time_and_place}")
        if not ok:
            off_text, max_text = compared_texts(flown_distance, limit, "m", 0)
            faults.append(message(f"{off_text} off the legs {time_and_place}", f"; the corridor allows {max_text}"))
    return make_finding(
        "corridor",
        requirements.leg_place(leg),
        ok=ok,
        reason=finding_reason(faults) if faults else finding_reason([], facts),
        faults=faults,
        planned=planned_distance,
        flown=flown_distance,
        limit=limit,
        source=source,
        tolerance=ROUNDING_M if geometric else 0.0,
        margin=limit - (planned_distance if geometric else flown_distance),
        unit="m",
        method="arcs of the turns" if geometric else "greatest distance of all rows from the leg and its neighbours",
    )


RULE = Rule(
    name="corridor",
    tolerances=("ROUNDING_M", "WAYPOINT_PASS_MARGIN_M", "FLY_OVER_SWING_RATIO", "RUNWAY_COURSE_TOLERANCE_RAD"),
    judge=corridor_findings,
)
