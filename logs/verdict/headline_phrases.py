"""Phrase a failed finding for a headline: the rule, the place, and the numbers or the reason in brief."""

from collections.abc import Callable
from dataclasses import replace

from logs.verdict.findings import Finding
from logs.verdict.wording import compared_texts, noun_with_place, place_text, shorten_statement, threat_text

# Function that phrases a failed finding; its first argument is the rule's name for people.
HeadlinePhrase = Callable[[str, Finding], str]


def _with_place(noun: str, finding: Finding, text: str) -> str:
    """Join a rule's noun, a place and a text in brackets: "slope on leg 0 (14.5° > 14.2°)".

    A place that is the whole flight, plan or mission is left out.
    """
    place = finding.place
    if place.kind in ("flight", "plan", "mission"):
        return f"{noun_with_place(noun, place)} ({text})"
    # The item is separated by a comma, so that only `text` is in brackets.
    item_text = f", to item {place.to_item}" if place.to_item is not None else ""
    item_text = f", item {place.item}" if place.item is not None else item_text
    place_name = place_text(replace(place, item=None, to_item=None)) + item_text
    return f"{noun} {'at' if place.kind == 'waypoint' else 'on'} {place_name} ({text})"


def reason_phrase(noun: str, finding: Finding) -> str:
    """Return a phrase with the finding's place and its brief reason."""
    return _with_place(noun, finding, shorten_statement(finding.brief))


def event_phrase(noun: str, finding: Finding) -> str:
    """Return a phrase for an event that ends the flight: the finding's brief reason, without its place."""
    return f"{noun} ({shorten_statement(finding.brief)})"


def return_phrase(noun: str, finding: Finding) -> str:
    """Return a phrase for a failed return to launch: `reason_phrase`, but at a waypoint without the place."""
    if finding.place.kind == "waypoint":
        return shorten_statement(finding.brief)
    return reason_phrase(noun, finding)


def shortfall_phrase(noun: str, finding: Finding) -> str:
    """Return a phrase for a value below its limit: "speed on leg 2 (11.9 m/s < 12 m/s)".

    Return `reason_phrase` if no value is below the limit.
    """
    value, limit = finding.value, finding.effective_limit
    if value is None or limit is None or value >= limit:
        return reason_phrase(noun, finding)
    return _with_place(noun, finding, " < ".join(compared_texts(value, limit, finding.unit)))


def excess_phrase(noun: str, finding: Finding) -> str:
    """Return a phrase for a value beyond its limit: "slope on leg 0 (14.5° > 14.2°)".

    The value is the one that was compared with the limit.  Without a margin, it is the flown or the planned value,
    whichever has the larger magnitude.  Return `reason_phrase` if its magnitude does not exceed the limit's.
    """
    values = [value for value in (finding.flown, finding.planned) if value is not None]
    worst_value = max(values, key=abs, default=None) if finding.margin is None else finding.value
    limit = finding.effective_limit
    if limit is None or worst_value is None or abs(worst_value) <= abs(limit):
        return reason_phrase(noun, finding)
    sign = " > " if worst_value > 0.0 else " < "
    return _with_place(noun, finding, sign.join(compared_texts(worst_value, limit, finding.unit)))


def slope_phrase(noun: str, finding: Finding) -> str:
    """Return `excess_phrase`, or `reason_phrase` for a limit of 0°.

    With a limit of 0°, the aircraft can fly no slope.
    """
    return reason_phrase(noun, finding) if finding.limit == 0.0 else excess_phrase(noun, finding)


def small_circle_phrase(noun: str, finding: Finding) -> str:
    """Return a phrase for a loiter that is too small: "loiter at waypoint 3 (radius 40 m < 76 m)".

    Return `excess_phrase` if the planned radius is not below its limit.
    """
    limit = finding.effective_limit
    if finding.planned is None or limit is None or finding.planned >= limit:
        return excess_phrase(noun, finding)
    return _with_place(noun, finding, f"radius {' < '.join(compared_texts(finding.planned, limit, finding.unit))}")


def zone_phrase(noun: str, finding: Finding) -> str:
    """Return a phrase for a violated zone: "town (exclusion) violated (12.0 m inside)".

    The depth is the flown one, or without a flight the planned one.  Return `excess_phrase` for a place without a name.
    """
    if not finding.place.name:
        return excess_phrase(noun, finding)
    depth = _flown_or_planned(finding)
    side = "outside" if finding.place.kind == "inclusion" else "inside"
    return f"{place_text(finding.place)} violated ({depth:.1f} m {side})"


def missile_phrase(_noun: str, finding: Finding) -> str:
    """Return a phrase for time within a missile's range: "missile Alfa (13.3 s inside its range)"."""
    return f"missile {threat_text(finding.place)} ({_flown_or_planned(finding):.1f} s inside its range)"


def _flown_or_planned(finding: Finding) -> float:
    """Return a finding's flown value, or its planned value if nothing was flown, or 0 if both are missing."""
    value = finding.planned if finding.flown is None else finding.flown
    return value or 0.0


def photo_line_phrase(noun: str, finding: Finding) -> str:
    """Return `shortfall_phrase` for a photo line's usable fraction or a survey's overlap.

    `Finding.check` names the overlap that failed.
    """
    return shortfall_phrase(finding.check or noun, finding)


def missed_waypoint_phrase(_noun: str, finding: Finding) -> str:
    """Return a phrase for a missed waypoint: "waypoint 3 missed (120 m > 50 m)".

    Without a distance beyond the limit, the phrase is only "waypoint 3 missed".  If a flown finding has a brief reason
    that differs from its full reason, this reason replaces "missed" and the distances.
    """
    if finding.flown is not None and finding.brief != finding.reason:
        return f"{place_text(finding.place)} {finding.brief}"
    limit = finding.effective_limit
    if finding.flown is None or limit is None or finding.flown <= limit:
        return f"{place_text(finding.place)} missed"
    return f"{place_text(finding.place)} missed ({' > '.join(compared_texts(finding.flown, limit, finding.unit))})"
