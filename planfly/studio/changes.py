"""Compare a flight with the previous flight, even if items were inserted or deleted.

An inserted or deleted item renumbers the later items.  Therefore equal items of both missions, and items between equal
items, are matched first, and legs are identified by the items at their ends.
"""

from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

from flight.mission.items import Mission
from flight.mission.route import Route
from logs.verdict.findings import Finding
from logs.verdict.places import Place
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.wording import place_text, quantity_text

# Identity of a place, which is its kind and its items, by their order in the mission or by their number, or None.
PlaceKey = tuple[str, int | None, int | None]
# Maximum number of changes of state that are named.
_MAX_STATE_CHANGES = 6
# Maximum number of changes of value that are named if no state has changed.
_MAX_VALUE_CHANGES = 3
# Sort key of the states.
_WORST_FIRST = {False: 0, None: 1, True: 2}


class Figure(NamedTuple):
    """Result of a rule at a place.

    ok: True if it passes, None if not judged.
    value, margin: in ``unit``, or None.
    place: description of the place, with the item numbers of its own mission.
    scale: smallest noticeable difference of the margin.
    """

    ok: bool | None
    value: float | None
    margin: float | None
    unit: str
    place: str
    scale: float | None = None

    @property
    def text(self) -> str:
        """Value with its unit, or "" without a value."""
        return "" if self.value is None else quantity_text(self.value, self.unit)


_Found = dict[tuple[str, PlaceKey], Figure]


class Figures(NamedTuple):
    """Results of a flight, for a comparison with another flight.

    items: contents of each item of its mission, in order.
    found: worst result of each rule at each place.
    seconds: duration of the flight.
    """

    items: tuple[tuple[float, ...], ...]
    found: _Found
    seconds: float


def flight_figures(mission: Mission, route: Route, findings: Iterable[Finding], seconds: float) -> Figures:
    """Collect the results of a flight of a mission."""
    items = tuple((float(item.command), item.lat_deg, item.lon_deg, item.alt) for item in mission.items)
    order = {item.seq: k for k, item in enumerate(mission.items)}
    found: _Found = {}
    for item in findings:
        key, words = _place_key(item.place, route.items.tolist(), order)
        value = item.planned if item.flown is None else item.flown
        figure = Figure(item.ok, value, item.margin, item.unit, words, RULE_WORDS[item.rule].scale)
        old = found.get((item.rule, key))
        if old is None or _severity_key(figure) < _severity_key(old):
            found[item.rule, key] = figure
    return Figures(items, found, seconds)


def _severity_key(figure: Figure) -> tuple[int, float]:
    return _WORST_FIRST[figure.ok], 0.0 if figure.margin is None else figure.margin


def _place_key(place: Place, route: Sequence[int], order: dict[int, int]) -> tuple[PlaceKey, str]:
    """Return the identity of a place across missions, and its description with item numbers."""
    if place.kind == "leg" and place.index is not None:
        first, last = (route[place.index + k] for k in (0, 1))
        if first in order and last in order:
            return ("leg", order[first], order[last]), f"leg {first}\u2013{last}" if first != last else f"item {last}"
    elif place.kind == "waypoint" and place.index is not None and route[place.index] in order:
        number = route[place.index]
        return ("waypoint", order[number], order[number]), f"item {number}"
    elif place.kind == "mission" and place.item in order:
        return ("mission", order[place.item], order[place.item]), f"item {place.item}"
    return (f"the {place.kind}", place.index, place.item), place_text(place)


def same_items(before: Sequence[tuple[float, ...]], now: Sequence[tuple[float, ...]]) -> dict[int, int]:
    """Map the position of each item in one mission to its position in another; removed items are left out.

    >>> a, b, c, d = [(16.0, 46.0, 8.0 + k, 100.0) for k in range(4)]
    >>> same_items([a, b, c], [a, d, b, c]), same_items([a, b, c], [a, c]), same_items([a, b, c], [a, d, c])
    ({0: 0, 1: 2, 2: 3}, {0: 0, 2: 1}, {0: 0, 1: 1, 2: 2})
    """
    found: dict[int, int] = {}
    # NaN is unequal to itself: replace it by None, so that equal items are found equal.
    old, new = ([tuple(None if v != v else v for v in one) for one in side] for side in (before, now))
    for kind, a, a_end, b, b_end in SequenceMatcher(a=old, b=new, autojunk=False).get_opcodes():
        if kind == "equal" or (kind == "replace" and a_end - a == b_end - b):
            found.update(zip(range(a, a_end), range(b, b_end), strict=True))
    return found


def changes(before: Figures | None, now: Figures) -> list[str]:
    """Describe the changes since the previous flight, a line each; empty for the first flight.

    >>> leg = ("clearance", ("leg", 0, 1))
    >>> items = ((16.0, 46.0, 8.0, 100.0), (16.0, 46.0, 8.1, 100.0))
    >>> low = Figures(items, {leg: Figure(False, 22.0, -38.0, "m", "leg 1\u20132")}, 500.0)
    >>> high = Figures(items, {leg: Figure(True, 61.0, 1.0, "m", "leg 1\u20132")}, 512.0)
    >>> changes(low, high)
    ['leg 1\u20132: clearance 22 m \u2192 61 m, now passes', '12 s longer']
    >>> changes(high, high), changes(None, high)
    (['nothing'], [])
    """
    if before is None:
        return []
    old = _renumber(before, now)
    found = _state_changes(old, now.found)
    if len(found) > _MAX_STATE_CHANGES:
        found[_MAX_STATE_CHANGES:] = [f"and {len(found) - _MAX_STATE_CHANGES} more"]
    if not found:
        found = _value_changes(old, now.found)
    longer = now.seconds - before.seconds
    if abs(longer) >= 0.5:
        found.append(f"{abs(longer):.0f} s {'longer' if longer > 0.0 else 'shorter'}")
    return found or ["nothing"]


# Kinds of places that are identified by items.
_OF_ITEMS = ("leg", "waypoint", "mission")
# Kind of a place whose item was removed.
_GONE_PLACE = "gone"
# Position of a removed item.
_GONE = -1


def _renumber(before: Figures, now: Figures) -> _Found:
    """Return the earlier results by their current places; each result at a removed item gets its own place."""
    same, found = same_items(before.items, now.items), {}
    for number, ((rule, (kind, first, last)), figure) in enumerate(before.found.items()):
        if kind in _OF_ITEMS and first is not None and last is not None:
            first, last = same.get(first, _GONE), same.get(last, _GONE)
            if _GONE in (first, last):
                kind, first, last = _GONE_PLACE, number, _GONE
        found[rule, (kind, first, last)] = figure
    return found


def _state_changes(old: _Found, new: _Found) -> list[str]:
    """Describe the places whose state has changed, with both values; those that became worse come first."""
    worse, better = [], []
    for (rule, key), now in new.items():
        was = old.get((rule, key))
        failed = was is not None and was.ok is False
        if now.ok is False and not failed:
            worse.append(_change_text(rule, now, was, "fails now"))
        elif now.ok is not False and failed:
            better.append(_change_text(rule, now, was, "now passes" if now.ok else "is not judged now"))
    there = {key for _, key in new}
    for (rule, key), was in old.items():
        if was.ok is False and (rule, key) not in new:
            gone = key not in there and key[0] in (*_OF_ITEMS, _GONE_PLACE)
            better.append(
                f"the former {_change_text(rule, was, None, 'is gone')}"
                if gone
                else _change_text(rule, was, None, "now passes")
            )
    return worse + better


def _change_text(rule: str, now: Figure, was: Figure | None, end: str) -> str:
    values = dict.fromkeys(one.text for one in (was, now) if one is not None and one.text)
    figures = " \u2192 ".join(values)
    return f"{now.place}: {RULE_WORDS[rule].word} {figures}".rstrip() + f", {end}"


def _value_changes(old: _Found, new: _Found) -> list[str]:
    """Describe changes of value if no state has changed, first of failures, then of each rule's smallest margin."""
    both = [(rule, old[rule, key], now) for (rule, key), now in new.items() if now.ok is False and (rule, key) in old]
    still = [_change_text(rule, now, was, "still fails") for rule, was, now in both if was.text != now.text]
    least_old, least_new = _closest_by_rule(old), _closest_by_rule(new)
    found = []
    for rule, now in least_new.items():
        was = least_old.get(rule)
        if was is None or was.text == now.text or not was.scale:
            continue
        moved = abs((now.margin or 0.0) - (was.margin or 0.0)) / was.scale
        there = now.place if was.place == now.place else f"{was.place}, now {now.place}"
        found.append((moved, f"closest to its limit: {RULE_WORDS[rule].word} {was.text} \u2192 {now.text} ({there})"))
    return still[:_MAX_VALUE_CHANGES] + [text for _, text in sorted(found, reverse=True)[:_MAX_VALUE_CHANGES]]


def _closest_by_rule(figures: _Found) -> dict[str, Figure]:
    found: dict[str, Figure] = {}
    for (rule, _), figure in figures.items():
        if figure.margin is not None and (rule not in found or figure.margin < (found[rule].margin or 0.0)):
            found[rule] = figure
    return found
