"""Photo lines of a survey, and what would help them, in words."""

import math

from flight.mission.surveys import Survey
from logs.verdict.measures.photo_lines import LineMeasure
from logs.verdict.rules.survey_rule import lost_text
from logs.verdict.tolerances import PHOTO_SHARE
from planfly.survey_remedies import SurveyRemedy, nth


def usable(measure: LineMeasure | None) -> bool:
    """Whether enough of a line can be used.

    >>> usable(None)
    False
    """
    return measure is not None and measure.good >= PHOTO_SHARE


def lines_headline(measures: list[LineMeasure | None]) -> str:
    """How many of some lines can be used, and which is the worst.

    >>> lines_headline([None, None])
    '0 of 2 photo lines can be used; line 1 is the worst: not flown'
    """
    good = sum(usable(one) for one in measures)
    said = f"{good} of {len(measures)} photo lines can be used"
    if good == len(measures):
        return said
    shares = [-1.0 if one is None else one.good for one in measures]
    worst = min(range(len(shares)), key=lambda k: shares[k])
    one = measures[worst]
    return f"{said}; line {worst + 1} is the worst: {'not flown' if one is None else f'{100.0 * one.good:.0f} %'}"


def line_text(number: int, measure: LineMeasure | None) -> str:
    """One line: its length, how much of it can be used, and what the rest lacks."""
    if measure is None:
        return f"line {number:<3} not flown"
    said = f"line {number:<3} {measure.length:6.0f} m  {100.0 * measure.good:5.1f} % can be used"
    lacks = lost_text(measure)
    photos = f"; {measure.missed} of {measure.photos} photos missed" if measure.missed else ""
    return f"{said}{': ' if lacks else ''}{lacks}{photos}"


def survey_text(survey: Survey) -> str:
    """A survey's lines, spacing and course."""
    course = round(math.degrees(survey.course)) % 360
    return f"{len(survey.lines)} lines, {survey.spacing:.0f} m apart, the first on course {course}°"


def remedy_text(remedy: SurveyRemedy, length: float) -> str:
    """What would help, and what it costs of way.  length: of the route as it is, m."""
    match remedy.kind:
        case "side":
            change = "the lines from the other side"
        case "turn-around":
            change = f"turn-arounds of {remedy.value:.0f} m instead of {remedy.current:.0f} m"
        case "every":
            change = f"every {nth(round(remedy.value))} line first, with turn-arounds of {remedy.turn_around:.0f} m"
        case "course":
            change = f"lines on course {remedy.value:.0f}° instead of {remedy.current:.0f}°"
        case "parameter":
            change = f"{remedy.name} {remedy.value:g} instead of {remedy.current:g}"
        case "airspeed":
            change = f"{remedy.value:g} m/s instead of {remedy.current:g} m/s"
    return f"{change}: flown, and all lines can be used; {remedy.length / 1000.0:.1f} km, {length / 1000.0:.1f} km now"
