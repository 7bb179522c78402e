"""The survey rule: judge the usable fraction of each photo line, and the overlap of the photos.

The autopilot chooses the path of a survey's turnarounds, as long as they stay clear of ground, threats and zones.  The
turn, slope and waypoint rules therefore ignore turnarounds, and so does the corridor rule unless a corridor is stated.
"""

import math

import numpy as np

from flight.mission.surveys import LineAxis, PhotoLine, Survey
from logs.verdict.findings import (
    GROUND_PATH,
    UNKNOWN_OVERLAP,
    UNKNOWN_PATH,
    Fact,
    Finding,
    Message,
    finding_reason,
    make_finding,
    message,
)
from logs.verdict.measures.circle_reach import find_hazards
from logs.verdict.measures.photo_lines import (
    LineMeasure,
    OverlapMeasure,
    heights_over_ground,
    is_covered,
    line_distances,
    measure_line,
    measure_overlap,
    planned_switch_radius,
)
from logs.verdict.measures.route_requirements import RouteRequirements, slope_limits, turn_limit
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import Place
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.rule_words import FRONT_OVERLAP, SIDE_OVERLAP
from logs.verdict.tolerances import (
    CLEARANCE_TOLERANCE_M,
    MAX_PHOTO_BANK_RAD,
    MIN_PHOTO_HEIGHT_ERROR_M,
    PHOTO_COVERAGE_FRACTION,
    PHOTO_HEIGHT_FRACTION,
    PHOTO_OVERLAP_TOLERANCE,
    PLAN_TOLERANCE_RAD,
    TURN_AROUND_RADII,
)
from logs.verdict.wording import compared_texts
from world.wording import count_text

# Limit of a slope if neither the aircraft nor the scenario has one.
_MAX_SLOPE_RAD = math.radians(89.0)
# Smallest gap between photos that is printed, m; it is rounded to 1 m.
_MIN_STATED_GAP_M = 0.5


def survey_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge each photo line, and the overlap of each survey's photos.

    geometric: True to judge the planned lines only.  The usable part of a line then excludes its turns,
        and a climb or descent before it.  Turnarounds near hazards that cannot be flown as drawn are reported, too.
    """
    findings = []
    for survey in requirements.surveys:
        for number, (line, transition) in enumerate(zip(survey.lines, survey.transitions(), strict=False), 1):
            if geometric:
                findings.append(_planned_finding(requirements, survey, line, number, transition[0]))
            else:
                findings.append(_flown_finding(requirements, aligned, survey, line, number))
        if geometric:
            findings += _unflyable_turnaround_findings(requirements, survey)
        if geometric or aligned is not None:
            findings += _overlap_findings(requirements, None if geometric else aligned, survey)
    return findings


def _overlap_findings(requirements: RouteRequirements, aligned: AlignedTrack | None, survey: Survey) -> list[Finding]:
    """Judge the smallest front and side overlap of a survey's photos against the required overlaps.

    An overlap that is not measured or not required has no finding.  The side overlap is undecided if it is large
    enough, but the crab angles reduce the common area of the photos below the limit.  Return [] if the survey's camera
    is unknown.
    """
    measure = measure_overlap(requirements, aligned, survey)
    if measure is None:
        return []
    overlaps = (
        (FRONT_OVERLAP, measure.front, measure.camera.front, survey.line(measure.line)),
        (SIDE_OVERLAP, measure.side, measure.camera.side, survey.line(measure.line_pair[1])),
    )
    findings = []
    for check, overlap, required, line in overlaps:
        if overlap is None or required is None:
            continue
        limit = required - PHOTO_OVERLAP_TOLERANCE
        text = overlap_text(measure, check)
        is_unknown = check == SIDE_OVERLAP and measure.is_side_unknown
        ok = None if is_unknown else overlap >= limit
        faults = [] if ok else [message(crab_text(measure), f"; {text}") if is_unknown else message(text)]
        if ok is False and measure.is_lost_by_relief:
            faults = [message(text, f"; {relief_text(measure)}")]
        findings.append(
            make_finding(
                "survey",
                _line_place(requirements, line),
                ok=ok,
                reason=finding_reason(faults, [] if faults else [text]),
                faults=faults,
                planned=100.0 * overlap if aligned is None else 100.0 * required,
                flown=None if aligned is None else 100.0 * overlap,
                limit=100.0 * limit,
                at_least=True,
                source="mission",
                margin=None if is_unknown else 100.0 * (overlap - limit),
                unit="%",
                method="photos of level ground, taken straight down",
                check=UNKNOWN_OVERLAP if is_unknown else check,
            )
        )
    return findings


def overlap_text(measure: OverlapMeasure, check: str) -> str:
    """Describe the minimum overlap of a survey's photos.

    The text names its lines and the required overlap.

    Return "" if the overlap is unknown.

    check: `FRONT_OVERLAP` or `SIDE_OVERLAP`.
    """
    if check == FRONT_OVERLAP:
        overlap, required, gap = measure.front, measure.camera.front, measure.front_gap
        spacing_text = f" apart, one every {measure.camera.interval:g} s" if measure.is_camera_limited else " apart"
        lines_text = (
            f"line {measure.line + 1}: photos {measure.photo_spacing:.0f} m{spacing_text},"
            f" {measure.height:.0f} m above ground"
        )
    else:
        overlap, required, gap = measure.side, measure.camera.side, measure.side_gap
        first, second = sorted(measure.line_pair)
        lines_text = (
            f"lines {first + 1} and {second + 1}: {measure.line_spacing:.0f} m apart,"
            f" {measure.side_height:.0f} m above ground"
        )
    if overlap is None:
        return ""
    gap_text = f", with a gap of {gap:.0f} m between the photos" if gap >= _MIN_STATED_GAP_M else ""
    text = f"lowest {check} {100.0 * overlap:.0f} %{gap_text} ({lines_text})"
    return text if required is None else f"{text}; {100.0 * required:.0f} % is required"


def relief_text(measure: OverlapMeasure) -> str:
    """Describe why photos overlap too little above sloping ground, and the remedy.

    The lines are at one altitude.
    """
    planned_text = f", planned {measure.planned_height:.0f} m" if measure.planned_height else ""
    return (
        "the lines are at one altitude and do not follow the terrain: their height above ground ranges from"
        f" {measure.min_height:.0f} to {measure.max_height:.0f} m{planned_text}; lines that follow the terrain keep the"
        " overlap (FollowTerrain of QGroundControl's survey; for ArduPlane also altitude frame 10)"
    )


def crab_text(measure: OverlapMeasure) -> str:
    """Describe the largest crab angle of a survey's photos, and its effect.

    The effect is the area that neighbouring photos have in common.
    """
    judged_text = (
        "the side overlap is therefore not judged" if measure.is_side_unknown else "the overlap does not include this"
    )
    return (
        f"crab angle up to {math.degrees(measure.max_crab):.0f}°: neighbouring photos have"
        f" {100.0 * measure.side_area:.0f} % of their area in common; {judged_text}"
    )


def _unflyable_turnaround_findings(requirements: RouteRequirements, survey: Survey) -> list[Finding]:
    """Return an undecided finding for each unflyable turnaround near hazards.

    Such a turnaround is too tight or too steep to fly as drawn.

    The path of such a turnaround is known only after a flight.  The turns onto the first line and off the last line
    are also turnarounds.
    """
    findings = []
    turnarounds = survey.transitions()
    for number, (first, last) in enumerate(turnarounds):
        is_tight = any(_is_too_tight(requirements, i) for i in range(first, last + 1))
        catch_up_length = _off_altitude_length(requirements, first, last, requirements.legs, CLEARANCE_TOLERANCE_M)
        if not is_tight and not catch_up_length:
            continue
        points = requirements.points[first : last + 1]
        radii = requirements.min_radius[first : last + 1]
        center = points[:, :2].mean(axis=0)
        radius = float(radii[np.isfinite(radii)].max(initial=0.0))
        reach = float(np.hypot(*(points[:, :2] - center).T).max()) + TURN_AROUND_RADII * radius + catch_up_length
        min_altitude, max_altitude = float(points[:, 2].min()), float(points[:, 2].max())
        if hazards := find_hazards(requirements, center, min_altitude, max_altitude, reach):
            end_names = {0: "the turn onto the first line", len(turnarounds) - 1: "the turn off the last line"}
            reason = (
                f"{end_names.get(number, f'turn-around {number}')} is too {'tight' if is_tight else 'steep'} to be "
                f"flown as drawn; within {reach:.0f} m of it {'; '.join(hazards)}; only a simulated "
                "flight shows whether the turn is safe"
            )
            place, method = requirements.leg_place(first), "its surroundings"
            findings.append(make_finding("survey", place, ok=None, reason=reason, check=UNKNOWN_PATH, method=method))
    return findings


def _is_too_tight(requirements: RouteRequirements, corner: int) -> bool:
    """Return True if the legs at a corner are too short for its turn; False at the ends of the route."""
    turn = abs(float(requirements.turns[corner]))
    return 0 < corner < requirements.legs and turn > turn_limit(requirements, corner)[0] + PLAN_TOLERANCE_RAD


def _off_altitude_length(requirements: RouteRequirements, first: int, last: int, end: int, tolerance: float) -> float:
    """Return the length after a turnaround that is not yet at the planned altitude, m.

    The aircraft starts the turnaround at the planned altitude, and then climbs or descends no steeper than its limits.

    first, last: waypoints at which the turnaround begins and ends.
    end: waypoint up to which the length is measured.
    tolerance: altitude error within which the aircraft is at the planned altitude, m.
    """
    altitude, length = float(requirements.points[first, 2]), 0.0
    for leg in range(first, end):
        start = float(requirements.points[leg, 2])
        target = float(requirements.points[leg + 1, 2])
        run = requirements.runs[leg]
        climb, dive = (
            run * math.tan(min(max(limit, 0.0), _MAX_SLOPE_RAD)) for limit in slope_limits(requirements, leg)
        )
        error = start - altitude
        if leg >= last:
            if abs(error) <= tolerance:
                break
            # Part of the altitude error that the aircraft makes up on this leg.
            gain = climb - (target - start) if error > 0.0 else dive + (target - start)
            if gain >= abs(error) - tolerance:
                return length + run * (abs(error) - tolerance) / gain
            length += run
        altitude += min(max(target - altitude, -dive), climb)
    return length


def _line_text(requirements: RouteRequirements, survey: Survey, line: PhotoLine, number: int) -> str:
    """Name a photo line by its number from 1 and its mission items."""
    items = [int(requirements.setup.route.items[i]) for i in (line.first, line.last)]
    return f"photo line {number} of {len(survey.lines)} (items {items[0]} to {items[1]})"


def _line_place(requirements: RouteRequirements, line: PhotoLine) -> Place:
    """Return the first leg of a photo line as the place of its findings."""
    return requirements.leg_place(line.first)


def _planned_finding(
    requirements: RouteRequirements, survey: Survey, line: PhotoLine, number: int, before: int
) -> Finding:
    """Judge the usable fraction of a planned photo line.

    It is the fraction flown straight, at its altitude and with the camera on.

    number: number of the line in its survey, from 1.
    before: waypoint at which the turnaround before the line begins.
    """
    length = float(requirements.runs[line.first : line.last].sum())
    # The turns may use the leads before and after the line.
    lead_in = float(requirements.runs[line.begins : line.first].sum())
    lead_out = float(requirements.runs[line.last : line.ends].sum())
    turn_in = _clip_to_length(float(requirements.length_after[line.begins]) - lead_in, length)
    height = float(heights_over_ground(requirements, requirements.points[line.first][None])[0])
    tolerance = max(MIN_PHOTO_HEIGHT_ERROR_M, PHOTO_HEIGHT_FRACTION * height)
    off_altitude = _off_altitude_length(requirements, before, line.first, line.last, tolerance)
    cut_in = max(turn_in, off_altitude)
    # Distance before the waypoint at the line's end at which the turn begins.
    setup, last = requirements.setup, line.ends
    if setup.autopilot.turns.follows_path or not 0 < last < requirements.legs:
        turn_lead = float(requirements.length_before[last])
    elif setup.autopilot.turns.radii_at is not None:
        turn_lead = float(setup.autopilot.turns.radii_at(requirements.ground_speed[last - 1 : last])[0])
    else:
        turn = abs(float(requirements.turns[last]))
        mission_radius = (
            float(setup.route.points["acceptance_radius"][last]) if setup.autopilot.turns.reads_acceptance else 0.0
        )
        turn_lead = mission_radius or setup.autopilot.turns.distance(turn, float(requirements.points[last, 2]))
    turn_out = _clip_to_length(turn_lead - lead_out, length)
    # The autopilot switches the camera off where it considers the waypoint reached.
    camera_out, off = 0.0, line.camera_off_at
    if off >= 0:
        beyond_end = float(requirements.runs[line.last : off].sum()) - float(requirements.runs[off : line.last].sum())
        camera_out = _clip_to_length(planned_switch_radius(requirements, off) - beyond_end, length)
    cut_out = max(turn_out, camera_out)
    straight_fraction = max(0.0, length - cut_in - cut_out) / length
    # Fraction of the line whose height above ground is unknown.
    axis = LineAxis(requirements.points[line.first : line.last + 1])
    heights = heights_over_ground(requirements, axis.points_at(line_distances(axis)))
    unknown_fraction = min(float(np.isnan(heights).mean()), straight_fraction)
    ok = is_covered(straight_fraction - unknown_fraction, unknown_fraction)
    name = _line_text(requirements, survey, line, number)
    faults, facts = [], [f"{name}: its turns leave {100.0 * straight_fraction:.0f} % of its {length:.0f} m straight"]
    if ok is None:
        faults.append(_unknown_ground_message(requirements, unknown_fraction, length, name))
    if ok is False:
        cause, usable_state = ("the turns at its ends leave", "straight")
        if off_altitude > turn_in:
            cause, usable_state = ("the climb or descent before it leaves", "at its planned height above ground")
        elif camera_out > max(cut_in, turn_out):
            cause, usable_state = ("the camera, which is switched off before its end, leaves", "with photos")
        faults.append(
            message(
                f"{name}: {cause} only {usable_text(straight_fraction)} of its {length:.0f} m {usable_state}",
                f" ({cut_in:.0f} m are lost at the start and {cut_out:.0f} m at the end)",
            )
        )
    return _line_finding(requirements, line, ok, faults, facts, straight_fraction, geometric=True)


def _unknown_ground_message(requirements: RouteRequirements, fraction: float, length: float, name: str) -> Message:
    """Make a message on the fraction of a photo line that lies outside the terrain data.

    fraction: fraction of the line's length.
    length: length of the line, m.
    name: name of the line.
    """
    terrain = requirements.setup.scenario.terrain
    source_text = "the terrain data" if terrain is None else f"the data of {terrain.source}"
    return message(f"{name}: {100.0 * fraction:.0f} % of its {length:.0f} m lies outside {source_text}")


def _clip_to_length(distance: float, length: float) -> float:
    """Clip a distance to the range from 0 to `length`, m; a non-finite distance becomes `length`."""
    return min(max(distance, 0.0), length) if math.isfinite(distance) else length


def _flown_finding(
    requirements: RouteRequirements, aligned: AlignedTrack | None, survey: Survey, line: PhotoLine, number: int
) -> Finding:
    """Judge the usable fraction of a flown photo line.

    A line is not judged if it was not flown, or if its usable fraction depends on unknown ground.

    aligned: flown track; None for a flight with too few rows.
    number: number of the line in its survey.
    """
    name = _line_text(requirements, survey, line, number)
    measure = None if aligned is None else measure_line(requirements, aligned, survey, line)
    if measure is None:
        return _line_finding(
            requirements,
            line,
            ok=None,
            faults=[],
            facts=[f"{name}: not flown"],
            usable_fraction=math.nan,
            geometric=False,
        )
    ok = measure.ok
    faults, facts = [], [f"{name}: {100.0 * measure.usable:.0f} % of its {measure.length:.0f} m can be used"]
    if ok is None:
        faults.append(_unknown_ground_message(requirements, measure.unknown, measure.length, name))
        facts = [unusable_parts_text(measure)] if unusable_parts_text(measure) else []
    elif not ok:
        ends_text = f"; its first {measure.lost_at_start:.0f} m and last {measure.lost_at_end:.0f} m are lost"
        if max(measure.lost_at_start, measure.lost_at_end) < 1.0:
            ends_text = ""
        fault = message(
            f"{name}: {usable_text(measure.usable)} of its {measure.length:.0f} m can be used",
            f": {unusable_parts_text(measure)}{ends_text}",
        )
        faults, facts = [fault], []
    if measure.missed_photo_count:
        facts.append(f"{measure.missed_photo_count} of {count_text(measure.planned_photo_count, 'photo')} missed")
    return _line_finding(requirements, line, ok, faults, facts, measure.usable, geometric=False, measure=measure)


def usable_text(fraction: float) -> str:
    """Return the usable fraction of a photo line in %.

    The text has enough digits to show that the fraction is below its limit.

    >>> usable_text(0.9494), usable_text(0.949), usable_text(0.665), usable_text(0.95)
    ('94.9 %', '94.9 %', '66 %', '95 %')
    """
    percent, limit = 100.0 * fraction, 100.0 * PHOTO_COVERAGE_FRACTION
    if round(limit) - 0.5 <= percent < limit:
        return compared_texts(percent, limit, "%")[0]
    return f"{percent:.0f} %"


def unusable_parts_text(measure: LineMeasure) -> str:
    """List the causes that make parts of a photo line unusable, the largest first.

    Each cause has its fraction of the line.

    Causes with less than 0.5 % of the line are left out.  Return "" if no cause remains.
    """
    fractions = {
        f"not flown along the line within {measure.lateral_tolerance:.0f} m": measure.off_line,
        f"banked more than {math.degrees(MAX_PHOTO_BANK_RAD):.0f}°": measure.banked,
        f"more than {measure.min_height_tolerance:.0f} m off the planned height above ground": measure.off_height,
        "with the camera off": measure.camera_off,
        "over unknown ground": measure.unknown,
    }
    parts = sorted(((fraction, defect) for defect, fraction in fractions.items() if fraction >= 0.005), reverse=True)
    return ", ".join(f"{100.0 * fraction:.0f} % {defect}" for fraction, defect in parts)


def _line_finding(
    requirements: RouteRequirements,
    line: PhotoLine,
    ok: bool | None,
    faults: list[Message],
    facts: list[str],
    usable_fraction: float,
    *,
    geometric: bool,
    measure: LineMeasure | None = None,
) -> Finding:
    """Make the finding on a photo line.

    ok: result; None if the line was not flown, or, with faults, if the result depends on unknown ground.
    faults, facts: texts on the result.
    usable_fraction: usable fraction of the line's length; NaN if the line was not flown.
    geometric: True for the planned line, False for the flown line.
    measure: measurements of the flown line, which are reported as facts.
    """
    is_unknown, measurements = ok is None and bool(faults), []
    if measure is not None:
        measurements = [
            Fact("distance from the line", measure.max_lateral_offset, "m"),
            Fact("height error", measure.max_height_error, "m"),
            Fact("lost at its start", measure.lost_at_start, "m"),
            Fact("lost at its end", measure.lost_at_end, "m"),
            Fact("photos missed", float(measure.missed_photo_count), ""),
        ]
    return make_finding(
        "survey",
        _line_place(requirements, line),
        ok=ok,
        reason=finding_reason(faults, facts),
        faults=faults,
        planned=None if geometric and is_unknown else 100.0 * usable_fraction if geometric else 100.0,
        flown=None if geometric or is_unknown else 100.0 * usable_fraction,
        limit=100.0 * PHOTO_COVERAGE_FRACTION,
        at_least=True,
        source="default",
        margin=None if is_unknown else 100.0 * (usable_fraction - PHOTO_COVERAGE_FRACTION),
        unit="%",
        method="arcs of the turns" if geometric else "on the line, level, at its height, camera on",
        check=GROUND_PATH if is_unknown else "",
        facts=measurements,
    )


RULE = Rule(
    name="survey",
    tolerances=(
        *(
            "PHOTO_COVERAGE_FRACTION",
            "PHOTO_OFFSET_FRACTION",
            "MAX_PHOTO_BANK_RAD",
            "PHOTO_HEIGHT_FRACTION",
            "MIN_PHOTO_HEIGHT_ERROR_M",
            "MAX_PHOTO_COURSE_ERROR_RAD",
        ),
        *("PHOTO_STEP_M", "PHOTO_OVERLAP_TOLERANCE", "TURN_AROUND_RADII", "CLEARANCE_TOLERANCE_M"),
    ),
    judge=survey_findings,
    log=LogNeeds(("attitude",), needs_planned_heights=True, needs_full_leg=True),
)
