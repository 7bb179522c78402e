"""Phrase a failed finding for a headline: the rule, the place, and the numbers or the reason in brief."""

from collections.abc import Callable

from logs.verdict.findings import Finding
from logs.verdict.wording import compared_texts, place_text, shorten_statement

# Function that phrases a failed finding; its first argument is the rule's name for people.
HeadlinePhrase = Callable[[str, Finding], str]


def _with_place(noun: str, finding: Finding, text: str) -> str:
    """Join a rule's noun, the finding's place (unless it is the whole flight), and a text in brackets."""
    if finding.place.kind == "flight":
        return f"{noun} ({text})"
    return f"{noun} {'at' if finding.place.kind == 'waypoint' else 'on'} {place_text(finding.place)} ({text})"


def name_reason(noun: str, finding: Finding) -> str:
    """Phrase a finding by its place and its brief reason."""
    return _with_place(noun, finding, shorten_statement(finding.brief))


def name_event(noun: str, finding: Finding) -> str:
    """Phrase an event that ends the flight by its brief reason, without a place."""
    return f"{noun} ({shorten_statement(finding.brief)})"


def name_shortfall(noun: str, finding: Finding) -> str:
    """Phrase a finding as a comparison of its value with a minimum; if the value is not below it, give the reason."""
    value, limit = finding.value, finding.effective_limit
    if value is None or limit is None or value >= limit:
        return name_reason(noun, finding)
    return _with_place(noun, finding, " < ".join(compared_texts(value, limit, finding.unit)))


def name_excess(noun: str, finding: Finding) -> str:
    """Phrase a finding as a comparison of its worse value, planned or flown, with the limit.

    If both values are within the limit, give the reason.
    """
    values = [value for value in (finding.flown, finding.planned) if value is not None]
    worst_value = max(values, key=abs, default=None)
    limit = finding.effective_limit
    if limit is None or worst_value is None or abs(worst_value) <= abs(limit):
        return name_reason(noun, finding)
    sign = " > " if worst_value > 0.0 else " < "
    return _with_place(noun, finding, sign.join(compared_texts(worst_value, limit, finding.unit)))


def name_circle(noun: str, finding: Finding) -> str:
    """Phrase a finding on a circle that is too small as a comparison of its radius with the minimum radius."""
    limit = finding.effective_limit
    if finding.planned is None or limit is None or finding.planned >= limit:
        return name_excess(noun, finding)
    return _with_place(noun, finding, f"radius {' < '.join(compared_texts(finding.planned, limit, finding.unit))}")


def name_zone(noun: str, finding: Finding) -> str:
    """Phrase the violation of a zone by its depth inside an exclusion zone or outside an inclusion zone."""
    if not finding.place.name:
        return name_excess(noun, finding)
    depth = max(finding.flown or 0.0, finding.planned or 0.0)
    side = "outside" if finding.place.kind == "inclusion" else "inside"
    return f"{place_text(finding.place)} violated ({depth:.1f} m {side})"


def name_missile(_noun: str, finding: Finding) -> str:
    """Phrase the entry into a missile's sphere by the time inside; a missile without a name is "threat 3 (missile)"."""
    place = place_text(finding.place)
    name = f"threat {place}" if finding.place.name else place
    return f"{name} ({max(finding.flown or 0.0, finding.planned or 0.0):.1f} s inside its range)"


def name_photo_line(noun: str, finding: Finding) -> str:
    """Phrase a finding as a comparison of a photo line's usable fraction, or of the overlap, with the minimum."""
    return name_shortfall(finding.check or noun, finding)


def name_missed_waypoint(_noun: str, finding: Finding) -> str:
    """Phrase a missed waypoint by the distance at which the aircraft passed it, if it passed the waypoint."""
    if finding.flown is not None and finding.brief != finding.reason:
        return f"{place_text(finding.place)} {finding.brief}"
    limit = finding.effective_limit
    if finding.flown is None or limit is None or finding.flown <= limit:
        return f"{place_text(finding.place)} missed"
    return f"{place_text(finding.place)} missed ({' > '.join(compared_texts(finding.flown, limit, finding.unit))})"
