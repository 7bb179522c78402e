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

# Identity of a place: its kind, and its first and last item by index or number, or None.
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


_Results = dict[tuple[str, PlaceKey], Figure]


class Figures(NamedTuple):
    """Results of a flight, for a comparison with another flight.

    items: contents of each item of its mission, in order.
    results: worst result of each rule at each place.
    seconds: duration of the flight.
    """

    items: tuple[tuple[float, ...], ...]
    results: _Results
    seconds: float


def flight_figures(mission: Mission, route: Route, findings: Iterable[Finding], seconds: float) -> Figures:
    """Collect the results of a flight of a mission."""
    item_contents = tuple((float(item.command), item.lat_deg, item.lon_deg, item.alt) for item in mission.items)
    order = {item.seq: k for k, item in enumerate(mission.items)}
    results: _Results = {}
    for finding in findings:
        key, description = _place_key(finding.place, route.items.tolist(), order)
        value = finding.planned if finding.flown is None else finding.flown
        figure = Figure(finding.ok, value, finding.margin, finding.unit, description, RULE_WORDS[finding.rule].scale)
        previous = results.get((finding.rule, key))
        if previous is None or _severity_key(figure) < _severity_key(previous):
            results[finding.rule, key] = figure
    return Figures(item_contents, results, seconds)


def _severity_key(figure: Figure) -> tuple[int, float]:
    return _WORST_FIRST[figure.ok], 0.0 if figure.margin is None else figure.margin


def _place_key(place: Place, route_items: Sequence[int], order: dict[int, int]) -> tuple[PlaceKey, str]:
    """Return the identity of a place across missions, and its description with item numbers."""
    if place.kind == "leg" and place.index is not None:
        first_item, last_item = (route_items[place.index + k] for k in (0, 1))
        if first_item in order and last_item in order:
            return (
                "leg",
                order[first_item],
                order[last_item],
            ), f"leg {first_item}\u2013{last_item}" if first_item != last_item else f"item {last_item}"
    elif place.kind == "waypoint" and place.index is not None and route_items[place.index] in order:
        number = route_items[place.index]
        return ("waypoint", order[number], order[number]), f"item {number}"
    elif place.kind == "mission" and place.item in order:
        return ("mission", order[place.item], order[place.item]), f"item {place.item}"
    return (f"the {place.kind}", place.index, place.item), place_text(place)


def match_items(old_items: Sequence[tuple[float, ...]], new_items: Sequence[tuple[float, ...]]) -> dict[int, int]:
    """Map the position of each item in one mission to its position in another; removed items are omitted.

    >>> a, b, c, d = [(16.0, 46.0, 8.0 + k, 100.0) for k in range(4)]
    >>> match_items([a, b, c], [a, d, b, c]), match_items([a, b, c], [a, c]), match_items([a, b, c], [a, d, c])
    ({0: 0, 1: 2, 2: 3}, {0: 0, 2: 1}, {0: 0, 1: 1, 2: 2})
    """
    new_position: dict[int, int] = {}
    # NaN is unequal to itself; replace it by None, so that equal items compare equal.
    old_keys, new_keys = (
        [tuple(None if v != v else v for v in item) for item in mission_items]
        for mission_items in (old_items, new_items)
    )
    for kind, a, a_end, b, b_end in SequenceMatcher(a=old_keys, b=new_keys, autojunk=False).get_opcodes():
        if kind == "equal" or (kind == "replace" and a_end - a == b_end - b):
            new_position.update(zip(range(a, a_end), range(b, b_end), strict=True))
    return new_position


def describe_changes(previous: Figures | None, current: Figures) -> list[str]:
    """Return a line for each change since the previous flight; no lines for the first flight.

    >>> leg = ("clearance", ("leg", 0, 1))
    >>> items = ((16.0, 46.0, 8.0, 100.0), (16.0, 46.0, 8.1, 100.0))
    >>> low = Figures(items, {leg: Figure(False, 22.0, -38.0, "m", "leg 1\u20132")}, 500.0)
    >>> high = Figures(items, {leg: Figure(True, 61.0, 1.0, "m", "leg 1\u20132")}, 512.0)
    >>> describe_changes(low, high)
    ['leg 1\u20132: clearance 22 m \u2192 61 m, now passes', '12 s longer']
    >>> describe_changes(high, high), describe_changes(None, high)
    (['nothing'], [])
    """
    if previous is None:
        return []
    old_results = _renumber(previous, current)
    lines = _state_changes(old_results, current.results)
    if len(lines) > _MAX_STATE_CHANGES:
        lines[_MAX_STATE_CHANGES:] = [f"and {len(lines) - _MAX_STATE_CHANGES} more"]
    if not lines:
        lines = _value_changes(old_results, current.results)
    time_difference = current.seconds - previous.seconds
    if abs(time_difference) >= 0.5:
        lines.append(f"{abs(time_difference):.0f} s {'longer' if time_difference > 0.0 else 'shorter'}")
    return lines or ["nothing"]


# Kinds of places that are identified by items.
_OF_ITEMS = ("leg", "waypoint", "mission")
# Kind of a place whose item was removed.
_GONE_PLACE = "gone"
# Position of a removed item.
_GONE = -1


def _renumber(previous: Figures, current: Figures) -> _Results:
    """Return the previous results keyed by their current places; each result at a removed item gets a unique place."""
    new_positions, renumbered = match_items(previous.items, current.items), {}
    for number, ((rule, (kind, first, last)), figure) in enumerate(previous.results.items()):
        if kind in _OF_ITEMS and first is not None and last is not None:
            first, last = new_positions.get(first, _GONE), new_positions.get(last, _GONE)
            if _GONE in (first, last):
                kind, first, last = _GONE_PLACE, number, _GONE
        renumbered[rule, (kind, first, last)] = figure
    return renumbered


def _state_changes(old_results: _Results, new_results: _Results) -> list[str]:
    """Describe each change of a place's state, with both values; places that became worse come first."""
    worse, better = [], []
    for (rule, key), figure in new_results.items():
        old_figure = old_results.get((rule, key))
        had_failed = old_figure is not None and old_figure.ok is False
        if figure.ok is False and not had_failed:
            worse.append(_change_text(rule, figure, old_figure, "fails now"))
        elif figure.ok is not False and had_failed:
            better.append(_change_text(rule, figure, old_figure, "now passes" if figure.ok else "is not judged now"))
    current_keys = {key for _, key in new_results}
    for (rule, key), old_figure in old_results.items():
        if old_figure.ok is False and (rule, key) not in new_results:
            was_removed = key not in current_keys and key[0] in (*_OF_ITEMS, _GONE_PLACE)
            better.append(
                f"the former {_change_text(rule, old_figure, None, 'is gone')}"
                if was_removed
                else _change_text(rule, old_figure, None, "now passes")
            )
    return worse + better


def _change_text(rule: str, figure: Figure, old_figure: Figure | None, state_text: str) -> str:
    values = dict.fromkeys(
        value_figure.text for value_figure in (old_figure, figure) if value_figure is not None and value_figure.text
    )
    values_text = " \u2192 ".join(values)
    return f"{figure.place}: {RULE_WORDS[rule].word} {values_text}".rstrip() + f", {state_text}"


def _value_changes(old_results: _Results, new_results: _Results) -> list[str]:
    """Describe the changes of the values of failures, then of the smallest margin of each rule."""
    failures = [
        (rule, old_results[rule, key], figure)
        for (rule, key), figure in new_results.items()
        if figure.ok is False and (rule, key) in old_results
    ]
    failure_lines = [
        _change_text(rule, figure, old_figure, "still fails")
        for rule, old_figure, figure in failures
        if old_figure.text != figure.text
    ]
    old_closest, new_closest = _closest_figures(old_results), _closest_figures(new_results)
    change_lines = []
    for rule, figure in new_closest.items():
        old_figure = old_closest.get(rule)
        if old_figure is None or old_figure.text == figure.text or not old_figure.scale:
            continue
        relative_change = abs((figure.margin or 0.0) - (old_figure.margin or 0.0)) / old_figure.scale
        where = figure.place if old_figure.place == figure.place else f"{old_figure.place}, now {figure.place}"
        change_lines.append(
            (
                relative_change,
                f"closest to its limit: {RULE_WORDS[rule].word} {old_figure.text} \u2192 {figure.text} ({where})",
            )
        )
    return failure_lines[:_MAX_VALUE_CHANGES] + [
        text for _, text in sorted(change_lines, reverse=True)[:_MAX_VALUE_CHANGES]
    ]


def _closest_figures(results: _Results) -> dict[str, Figure]:
    closest: dict[str, Figure] = {}
    for (rule, _), figure in results.items():
        if figure.margin is not None and (rule not in closest or figure.margin < (closest[rule].margin or 0.0)):
            closest[rule] = figure
    return closest
