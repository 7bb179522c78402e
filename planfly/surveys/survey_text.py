"""Describe the photo lines of a survey, and remedies for them."""

import math
from collections.abc import Sequence

from flight.autopilots.parameter_set import ParameterSet
from flight.mission.surveys import Survey
from logs.verdict.measures.photo_lines import LineMeasure, OverlapMeasure, planned_switch_radius
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.rule_words import FRONT_OVERLAP, SIDE_OVERLAP
from logs.verdict.rules.survey_rule import crab_text, overlap_text, relief_text, unusable_parts_text, usable_text
from logs.verdict.tolerances import PHOTO_OVERLAP_TOLERANCE
from planfly.surveys.survey_remedies import NearMiss, SurveyRemedy, ordinal_text
from world.wording import count_text

# Smallest fraction of the lines' length without usable photos that is stated; it is printed as 1 %.
MIN_STATED_FRACTION = 0.005
# Smallest loss of common area by the crab angle that is stated, as a fraction of a photo.
MIN_STATED_AREA_LOSS = 0.01


def is_line_usable(measure: LineMeasure | None) -> bool:
    """Return True if at least `logs.verdict.tolerances.PHOTO_COVERAGE_FRACTION` of a photo line is usable.

    A line that was not flown is not usable.

    >>> is_line_usable(None)
    False
    """
    return measure is not None and measure.ok is True


def is_line_unknown(measure: LineMeasure | None) -> bool:
    """Return True if a photo line cannot be judged because too much of it lies outside the terrain data.

    >>> is_line_unknown(None)
    False
    """
    return measure is not None and measure.ok is None


def lines_headline(measures: list[LineMeasure | None]) -> str:
    """Return one line with the number of usable photo lines, and the worst line if some are not usable.

    measures: measure of each line, in the order flown; None for a line that was not flown.

    >>> lines_headline([None, None])
    '0 of 2 photo lines can be used; line 1 is the worst: not flown'
    """
    usable_count = sum(is_line_usable(measure) for measure in measures)
    unknown_count = sum(is_line_unknown(measure) for measure in measures)
    summary = f"{usable_count} of {len(measures)} photo lines can be used"
    if unknown_count:
        verb = "lies" if unknown_count == 1 else "lie"
        summary += f"; {unknown_count} {verb} outside the terrain data and cannot be judged"
    if usable_count + unknown_count == len(measures):
        return summary
    judged_fractions = {
        k: -1.0 if measure is None else measure.usable
        for k, measure in enumerate(measures)
        if not is_line_unknown(measure)
    }
    worst_index = min(judged_fractions, key=lambda k: judged_fractions[k])
    measure = measures[worst_index]
    return (
        f"{summary}; line {worst_index + 1} is the worst:"
        f" {'not flown' if measure is None else f'{usable_text(measure.usable)} usable'}"
    )


def line_text(number: int, measure: LineMeasure | None) -> str:
    """Return a line of text on a photo line: its length, its usable fraction, and the causes of the loss.

    number: number of the line, from 1.
    measure: measure of the line; None if it was not flown.
    """
    if measure is None:
        return f"line {number:<3} not flown"
    text = f"line {number:<3} {measure.length:6.0f} m  "
    text += "not judged" if is_line_unknown(measure) else f"{100.0 * measure.usable:5.1f} % can be used"
    loss_text = unusable_parts_text(measure)
    photos_text = (
        f"; {measure.missed_photo_count} of {count_text(measure.planned_photo_count, 'photo')} missed"
        if measure.missed_photo_count
        else ""
    )
    return f"{text}{': ' if loss_text else ''}{loss_text}{photos_text}"


def camera_off_text(requirements: RouteRequirements, lines: Sequence[Sequence[LineMeasure | None]]) -> str:
    """Return a text on the radius within which the camera is switched off before the end of a line.

    The text names the parameter that sets the radius.  It is "" if no line loses photos at its end because of the
    radius.

    lines: measures of each line of each survey; None for a line that was not flown.
    """
    autopilot, route = requirements.setup.autopilot, requirements.setup.route
    turns, parameters = autopilot.turns, autopilot.parameters
    radius_by_waypoint = {
        line.camera_off_at: planned_switch_radius(requirements, line.camera_off_at)
        for survey, measures in zip(requirements.surveys, lines, strict=True)
        for line, measure in zip(survey.lines, measures, strict=True)
        if line.camera_off_at >= 0
        and measure is not None
        and measure.camera_off > MIN_STATED_FRACTION
        and measure.lost_at_end > 0.0
    }
    waypoint = max(radius_by_waypoint, key=lambda k: radius_by_waypoint[k], default=-1)
    radius = radius_by_waypoint.get(waypoint, 0.0)
    if radius <= 0.0:
        return ""
    item_radius = float(route.points["acceptance_radius"][waypoint]) if turns.reads_acceptance else 0.0
    cause = "the acceptance radius of the item"
    if item_radius <= 0.0 and turns.acceptance_parameter and isinstance(parameters, ParameterSet):
        value = parameters[turns.acceptance_parameter]
        cause = f"{turns.acceptance_parameter} {value:g} m"
        if radius > value:
            cause = f"the switch distance of the guidance, more than {cause}"
    return f"{autopilot.title} switches the camera off up to {radius:.0f} m before the end of a line ({cause})"


def survey_text(survey: Survey) -> str:
    """Return a text on the number of lines, the spacing and the course of a survey."""
    course = round(math.degrees(survey.course)) % 360
    return f"{count_text(len(survey.lines), 'line')}, {survey.spacing:.0f} m apart, the first on course {course}°"


def overlap_lines(measure: OverlapMeasure | None, *, is_flown: bool = True) -> tuple[str, ...]:
    """Return texts on the photo overlap along and across the lines.

    If it is not judged, return one text with the reason.

    measure: measured overlap; None if the camera is unknown.
    is_flown: True if at least one line was flown.

    >>> overlap_lines(None)
    ('overlap not judged: the camera is unknown (--camera)',)
    """
    if not is_flown:
        return ("photos not judged: no line was flown",)
    if measure is None:
        return ("overlap not judged: the camera is unknown (--camera)",)
    texts = [overlap_text(measure, check) for check in (FRONT_OVERLAP, SIDE_OVERLAP)]
    if measure.front is None:
        texts[0] = "front overlap not judged: the distance between photos is not stated, or no photo can be used"
    if measure.side is None:
        texts[1] = "side overlap not judged: no usable photos lie side by side"
    faults = overlap_faults(measure)
    needs = (("photos", measure.needed_photo_spacing), ("lines", measure.needed_line_spacing))
    for number, (check, (name, spacing)) in enumerate(zip((FRONT_OVERLAP, SIDE_OVERLAP), needs, strict=True)):
        is_slow = check == FRONT_OVERLAP and measure.is_camera_limited
        if check in faults and is_slow:
            texts[number] += f". T{slow_camera_text(measure)[1:]}"
        elif check in faults and not measure.is_lost_by_relief and spacing is not None and spacing >= 1.0:
            texts[number] += (
                f". The {name} must be at most {math.floor(spacing)} m apart, because the lowest photos are taken"
                f" {measure.min_height:.0f} m above ground"
            )
    if measure.is_lost_by_relief:
        texts.append(relief_text(measure))
    if measure.side is not None and measure.side_area < measure.side - MIN_STATED_AREA_LOSS:
        texts.append(crab_text(measure))
    if measure.unusable_fraction > MIN_STATED_FRACTION:
        unusable_text = f"{100.0 * measure.unusable_fraction:.0f} % of the lines' length, where no photo can be used"
        texts.append(f"overlap not judged on {unusable_text}")
    if measure.unknown_fraction > MIN_STATED_FRACTION:
        unknown_text = f"{100.0 * measure.unknown_fraction:.0f} % of the lines' length, outside the terrain data"
        texts.append(f"overlap not judged on {unknown_text}")
    if measure.ground_sampling is not None:
        sampling_text = " to ".join(dict.fromkeys(f"{100.0 * distance:.1f}" for distance in measure.ground_sampling))
        heights_text = f"{measure.min_height:.0f} m to {measure.max_height:.0f} m above ground"
        texts.append(f"ground sampling distance {sampling_text} cm per pixel ({heights_text})")
    texts.append("motion blur is not judged")
    return tuple(texts)


def overlap_faults(measure: OverlapMeasure | None) -> dict[str, str]:
    """Return a text on each overlap that is smaller than required, by `FRONT_OVERLAP` or `SIDE_OVERLAP`.

    An unknown overlap passes, and without a measure there are no faults.

    >>> overlap_faults(None)
    {}
    """
    if measure is None:
        return {}
    overlaps = (
        (FRONT_OVERLAP, measure.front, measure.camera.front),
        (SIDE_OVERLAP, measure.side, measure.camera.side),
    )
    return {
        check: f"{check} {100.0 * fraction:.1f} % < {100.0 * (required - PHOTO_OVERLAP_TOLERANCE):.0f} %"
        for check, fraction, required in overlaps
        if fraction is not None and required is not None and fraction < required - PHOTO_OVERLAP_TOLERANCE
    }


def slow_camera_text(measure: OverlapMeasure) -> str:
    """Return a text on a camera that is too slow for the stated distance between photos.

    The text has the camera's own distance.
    """
    return (
        f"the camera is too slow for the distance between photos: one every {measure.camera.interval:g} s, or"
        f" {measure.photo_spacing:.0f} m"
    )


def count_line_photos(lines: Sequence[LineMeasure | None]) -> int:
    """Return the number of photos taken on lines; 0 if the distance between photos is not stated.

    >>> count_line_photos([None])
    0
    """
    return sum(0 if measure is None else measure.taken_photo_count for measure in lines)


def usable_segments_text(survey: Survey, lines: Sequence[LineMeasure | None]) -> str:
    """Return a text on the length lost at the ends of the lines.

    It indicates the needed turn-around distance.

    If no line has a usable part, the text states that instead.

    lines: measure of each line; None for a line that was not flown.
    """
    usable_lines = [measure for measure in lines if measure is not None and measure.usable > 0.0]
    if not usable_lines:
        return (
            f"no part of the {count_text(len(lines), 'line')}, {survey.spacing:.0f} m apart, can be used, "
            "because there is no room to turn"
        )
    start = max(measure.lost_at_start for measure in usable_lines)
    end = max(measure.lost_at_end for measure in usable_lines)
    text = (
        f"lines lose at most {start:.0f} m at their start and {end:.0f} m at their end;"
        f" the longest line is {max(measure.length for measure in usable_lines):.0f} m long"
    )
    return (
        f"{text}, and {len(lines) - len(usable_lines)} of {len(lines)} have no usable part"
        if len(usable_lines) < len(lines)
        else text
    )


def near_miss_text(near_miss: NearMiss) -> str:
    """Return a text on the trial that came closest to passing, and on the reason of its failure."""
    return (
        f"{near_miss.what}: {near_miss.usable} of {near_miss.lines} photo lines can be used, the worst one to"
        f" {near_miss.worst:.0f} % of its length; {near_miss.verdict.headline}"
    )


def remedy_text(remedy: SurveyRemedy, length: float) -> str:
    """Return a text on a remedy, with the path length before and after it.

    length: length of the current route, m.
    """
    match remedy.kind:
        case "side":
            change = "the lines in the opposite order"
        case "turn-around":
            change = f"turn-arounds of {remedy.value:.0f} m instead of {remedy.current:.0f} m"
        case "gates":
            change = (
                "gates (CONDITION_GATE, a setting of QGroundControl) instead of waypoints where the camera is switched"
            )
        case "trigger":
            change = f"photos every {remedy.value:g} m instead of {remedy.current:.4g} m"
        case "height":
            change = f"lines {remedy.value:.0f} m higher"
        case "every":
            first_line_text = (
                f" and {remedy.lead_in:.0f} m onto the first" if remedy.lead_in > remedy.turn_around else ""
            )
            order_text = f"every {ordinal_text(round(remedy.value))} line first"
            change = f"{order_text}, with turn-arounds of {remedy.turn_around:.0f} m{first_line_text}"
        case "course":
            change = f"lines on course {remedy.value:.0f}° instead of {remedy.current:.0f}°"
        case "parameter":
            change = f"{remedy.name} {remedy.value:g} instead of {remedy.current:g} (--params)"
        case "airspeed":
            change = f"{remedy.value:g} m/s instead of {remedy.current:g} m/s (DO_CHANGE_SPEED)"
            change += " and gates (CONDITION_GATE) where the camera is switched" if remedy.has_gates else ""
    if remedy.kind in ("gates", "parameter", "airspeed") and not math.isnan(remedy.turn_around):
        change += f", with turn-arounds of {remedy.turn_around:.0f} m"
    new_length, old_length = (f"{value / 1000.0:.1f} km" for value in (remedy.length, length))
    length_text = "as long as before" if new_length == old_length else f"{new_length} long instead of {old_length}"
    return f"{change}; all lines could be used in a trial flight, and the path is {length_text}"
