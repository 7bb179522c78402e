"""Phrase a failed finding for a headline: the rule, the place, and the numbers or the reason in brief."""

from collections.abc import Callable

from logs.verdict.findings import Finding
from logs.verdict.wording import compared_texts, place_text, shortened

# Function that phrases a failed finding; its first argument is the rule's name for people.
HeadlinePhrase = Callable[[str, Finding], str]


def _with_place(noun: str, item: Finding, text: str) -> str:
    """Join a rule's noun, its place (unless the place is the whole flight), and a text in brackets."""
    if item.place.kind == "flight":
        return f"{noun} ({text})"
    return f"{noun} {'at' if item.place.kind == 'waypoint' else 'on'} {place_text(item.place)} ({text})"


def name_reason(noun: str, item: Finding) -> str:
    """Name the place and the reason in brief."""
    return _with_place(noun, item, shortened(item.brief))


def name_event(noun: str, item: Finding) -> str:
    """Name the brief reason of an event that ends the flight, without its place."""
    return f"{noun} ({shortened(item.brief)})"


def name_shortfall(noun: str, item: Finding) -> str:
    """Compare the flown value, or else the planned value, with a minimum."""
    low, limit = item.value, item.effective_limit
    if low is None or limit is None or low >= limit:
        return name_reason(noun, item)
    return _with_place(noun, item, " < ".join(compared_texts(low, limit, item.unit)))


def name_excess(noun: str, item: Finding) -> str:
    """Compare the worse of planned and flown value with the limit, or name the reason if both are within the limit."""
    values = [value for value in (item.flown, item.planned) if value is not None]
    worst = max(values, key=abs, default=None)
    limit = item.effective_limit
    if limit is None or worst is None or abs(worst) <= abs(limit):
        return name_reason(noun, item)
    sign = " > " if worst > 0.0 else " < "
    return _with_place(noun, item, sign.join(compared_texts(worst, limit, item.unit)))


def name_circle(noun: str, item: Finding) -> str:
    """Compare the radius of a circle that is too small with the minimum radius."""
    limit = item.effective_limit
    if item.planned is None or limit is None or item.planned >= limit:
        return name_excess(noun, item)
    return _with_place(noun, item, f"radius {' < '.join(compared_texts(item.planned, limit, item.unit))}")


def name_zone(noun: str, item: Finding) -> str:
    """Name a violated zone and the depth of the violation."""
    if not item.place.name:
        return name_excess(noun, item)
    depth = max(item.flown or 0.0, item.planned or 0.0)
    return f"{place_text(item.place)} violated ({depth:.1f} m beyond it)"


def name_missile(_noun: str, item: Finding) -> str:
    """Name the missile and the time inside its sphere; a missile without a name is "threat 3 (missile)"."""
    where = place_text(item.place)
    named = f"threat {where}" if item.place.name else where
    return f"{named} ({max(item.flown or 0.0, item.planned or 0.0):.1f} s inside)"


def name_photo_line(noun: str, item: Finding) -> str:
    """Phrase the shortfall of a photo line: its usable share, or its photos' overlap, against the required minimum."""
    return name_shortfall(item.check or noun, item)


def name_missed_waypoint(_noun: str, item: Finding) -> str:
    """Name a missed waypoint and the distance at which it was passed."""
    if item.flown is not None and item.brief != item.reason:
        return f"{place_text(item.place)} {item.brief}"
    limit = item.effective_limit
    if item.flown is None or limit is None or item.flown <= limit:
        return f"{place_text(item.place)} missed"
    return f"{place_text(item.place)} missed ({' > '.join(compared_texts(item.flown, limit, item.unit))})"
