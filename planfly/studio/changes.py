"""What a flight has that the one before it had not, by places and figures, whatever was inserted or deleted between.

Items have other numbers when one is inserted or deleted before them: those of two missions that are the same, or that
stand between such, are matched first, and legs are known by the items at their ends.
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

# A place: its kind, and the items that it is at, by their order in the mission, or its number; None for what is none.
PlaceKey = tuple[str, int | None, int | None]
# Changes of a state, and of figures where no state has changed, that are named.
_STATES, _FIGURES = 6, 3
_WORST_FIRST = {False: 0, None: 1, True: 2}


class Figure(NamedTuple):
    """What a rule found at a place.

    ok: None where it was not judged.  value, margin: in ``unit``, None for none.
    place: in words, by the numbers of its own mission.  scale: a difference of the margin that is noticeable.
    """

    ok: bool | None
    value: float | None
    margin: float | None
    unit: str
    place: str
    scale: float | None = None

    @property
    def text(self) -> str:
        """Its value in words, "" for none."""
        return "" if self.value is None else quantity_text(self.value, self.unit)


_Found = dict[tuple[str, PlaceKey], Figure]


class Figures(NamedTuple):
    """A flight as another is compared with it.

    items: what each item of its mission is, in order.  found: the worst of each rule at each place.  seconds: in all.
    """

    items: tuple[tuple[float, ...], ...]
    found: _Found
    seconds: float


def flight_figures(mission: Mission, route: Route, findings: Iterable[Finding], seconds: float) -> Figures:
    """The figures of a flight of a mission."""
    items = tuple((float(item.command), item.lat_deg, item.lon_deg, item.alt) for item in mission.items)
    order = {item.seq: k for k, item in enumerate(mission.items)}
    found: _Found = {}
    for item in findings:
        key, words = _place(item.place, route.items.tolist(), order)
        value = item.planned if item.flown is None else item.flown
        figure = Figure(item.ok, value, item.margin, item.unit, words, RULE_WORDS[item.rule].scale)
        old = found.get((item.rule, key))
        if old is None or _badness(figure) < _badness(old):
            found[item.rule, key] = figure
    return Figures(items, found, seconds)


def _badness(figure: Figure) -> tuple[int, float]:
    return _WORST_FIRST[figure.ok], 0.0 if figure.margin is None else figure.margin


def _place(place: Place, route: Sequence[int], order: dict[int, int]) -> tuple[PlaceKey, str]:
    """What a place is known by in another mission, and its words: legs and waypoints by the numbers of items."""
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
    """The order that items of one mission have in another; those that are gone are left out.

    >>> a, b, c, d = [(16.0, 46.0, 8.0 + k, 100.0) for k in range(4)]
    >>> same_items([a, b, c], [a, d, b, c]), same_items([a, b, c], [a, c]), same_items([a, b, c], [a, d, c])
    ({0: 0, 1: 2, 2: 3}, {0: 0, 2: 1}, {0: 0, 1: 1, 2: 2})
    """
    found: dict[int, int] = {}
    # NaN is like no other number: what has none of a number has it in both.
    old, new = ([tuple(None if v != v else v for v in one) for one in side] for side in (before, now))
    for kind, a, a_end, b, b_end in SequenceMatcher(a=old, b=new, autojunk=False).get_opcodes():
        if kind == "equal" or (kind == "replace" and a_end - a == b_end - b):
            found.update(zip(range(a, a_end), range(b, b_end), strict=True))
    return found


def changes(before: Figures | None, now: Figures) -> list[str]:
    """What has changed since the flight before, in words; nothing for the first.

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
    old = _in_numbers_of(before, now)
    found = _changed_states(old, now.found)
    if len(found) > _STATES:
        found[_STATES:] = [f"and {len(found) - _STATES} more"]
    if not found:
        found = _changed_figures(old, now.found)
    longer = now.seconds - before.seconds
    if abs(longer) >= 0.5:
        found.append(f"{abs(longer):.0f} s {'longer' if longer > 0.0 else 'shorter'}")
    return found or ["nothing"]


_OF_ITEMS, _GONE_PLACE, _GONE = ("leg", "waypoint", "mission"), "gone", -1


def _in_numbers_of(before: Figures, now: Figures) -> _Found:
    """The figures of before by the places of now; those of items that are gone by places that none is."""
    same, found = same_items(before.items, now.items), {}
    for number, ((rule, (kind, first, last)), figure) in enumerate(before.found.items()):
        if kind in _OF_ITEMS and first is not None and last is not None:
            first, last = same.get(first, _GONE), same.get(last, _GONE)
            if _GONE in (first, last):
                kind, first, last = _GONE_PLACE, number, _GONE
        found[rule, (kind, first, last)] = figure
    return found


def _changed_states(old: _Found, new: _Found) -> list[str]:
    """What fails and did not, or did and does not, with both figures; what is worse first."""
    worse, better = [], []
    for (rule, key), now in new.items():
        was = old.get((rule, key))
        failed = was is not None and was.ok is False
        if now.ok is False and not failed:
            worse.append(_said(rule, now, was, "fails now"))
        elif now.ok is not False and failed:
            better.append(_said(rule, now, was, "now passes" if now.ok else "is not judged now"))
    there = {key for _, key in new}
    for (rule, key), was in old.items():
        if was.ok is False and (rule, key) not in new:
            gone = key not in there and key[0] in (*_OF_ITEMS, _GONE_PLACE)
            better.append(
                f"the former {_said(rule, was, None, 'is gone')}" if gone else _said(rule, was, None, "now passes")
            )
    return worse + better


def _said(rule: str, now: Figure, was: Figure | None, end: str) -> str:
    values = dict.fromkeys(one.text for one in (was, now) if one is not None and one.text)
    figures = " \u2192 ".join(values)
    return f"{now.place}: {RULE_WORDS[rule].word} {figures}".rstrip() + f", {end}"


def _changed_figures(old: _Found, new: _Found) -> list[str]:
    """Where no state has changed: what still fails, and what of each rule is closest to its limit, the most first."""
    both = [(rule, old[rule, key], now) for (rule, key), now in new.items() if now.ok is False and (rule, key) in old]
    still = [_said(rule, now, was, "still fails") for rule, was, now in both if was.text != now.text]
    least_old, least_new = _closest(old), _closest(new)
    found = []
    for rule, now in least_new.items():
        was = least_old.get(rule)
        if was is None or was.text == now.text or not was.scale:
            continue
        moved = abs((now.margin or 0.0) - (was.margin or 0.0)) / was.scale
        there = now.place if was.place == now.place else f"{was.place}, now {now.place}"
        found.append((moved, f"closest to its limit: {RULE_WORDS[rule].word} {was.text} \u2192 {now.text} ({there})"))
    return still[:_FIGURES] + [text for _, text in sorted(found, reverse=True)[:_FIGURES]]


def _closest(figures: _Found) -> dict[str, Figure]:
    found: dict[str, Figure] = {}
    for (rule, _), figure in figures.items():
        if figure.margin is not None and (rule not in found or figure.margin < (found[rule].margin or 0.0)):
            found[rule] = figure
    return found
