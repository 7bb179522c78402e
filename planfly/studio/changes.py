"""Compare a flight with the previous flight, even if items were inserted or deleted.

An inserted or deleted item renumbers the later items. Therefore equal items of both missions, and items between equal
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
# Levels of results: numbers of the flight, numbers of the plan, and results at a place that the flight did not reach.
_FLOWN = "flown"
_PLANNED = "planned"
_NOT_REACHED = "not reached"


class PlaceResult(NamedTuple):
    """Result of a rule at a place.

    ok: True if the place passes the rule, False if it fails, None if it was not judged.
    value: flown value, or the planned value without a flown one, in ``unit``; None if unknown.
    margin: margin to the limit, in ``unit``; None if unknown.
    cause: reason of a failure whose value is within the limit and so does not show it; "" otherwise.
    place: description of the place, with the item numbers of its own mission.
    scale: smallest noticeable difference of the margin.
    level: "flown" or "planned", according to the value, or "not reached" if the flight ended before the place; only
        values of the same level are compared.
    planned: value of the planned path at a place that was flown; None elsewhere.
    """

    ok: bool | None
    value: float | None
    margin: float | None
    unit: str
    place: str
    scale: float | None = None
    level: str = _FLOWN
    cause: str = ""
    planned: float | None = None

    @property
    def text(self) -> str:
        """Value with its unit, or "" without a value."""
        return "" if self.value is None else quantity_text(self.value, self.unit)


# Worst result of each rule at each place; the keys are rule and place.
_Results = dict[tuple[str, PlaceKey], PlaceResult]


class FlightResults(NamedTuple):
    """Results of a flight, for a comparison with another flight.

    items: command, latitude, longitude and altitude of each item of the mission, in order.
    results: worst result of each rule at each place, over all laps that were flown.
    seconds: duration of the flight.
    """

    items: tuple[tuple[float, ...], ...]
    results: _Results
    seconds: float


def flight_results(mission: Mission, route: Route, findings: Iterable[Finding], seconds: float) -> FlightResults:
    """Return a flight's result for each rule and place.

    It is the worst result if the place was flown repeatedly.

    route: route of the mission.
    findings: findings of the flight's verdict.
    seconds: duration of the flight, s.
    """
    item_contents = tuple((float(item.command), item.lat_deg, item.lon_deg, item.alt) for item in mission.items)
    order = {item.seq: k for k, item in enumerate(mission.items)}
    results: _Results = {}
    findings = tuple(findings)
    places_reached: set[tuple[str, int | None]] = {
        (finding.place.kind, finding.place.index) for finding in findings if finding.flown is not None
    }
    for finding in findings:
        key, description = _place_key(finding.place, route.items.tolist(), order)
        planned, flown, limit = finding.planned, finding.flown, finding.limit
        is_planned = flown is None
        if planned is not None and flown is not None and limit is not None and finding.margin is not None:
            # The margin at a flown place may be computed from the planned value.
            planned_error, flown_error = (
                abs((value - limit if finding.at_least else limit - value) - finding.margin)
                for value in (planned, flown)
            )
            is_planned = planned_error < flown_error
        value, level = (planned, _PLANNED) if is_planned else (flown, _FLOWN)
        place = finding.place
        if places_reached and place.kind in ("leg", "waypoint") and place.index is not None:
            # A leg is reached if it was begun, and a waypoint also if the leg to it was begun.
            begun_leg = ("leg", place.index - (place.kind == "waypoint"))
            if not {(place.kind, place.index), begun_leg} & places_reached:
                level = _NOT_REACHED
        cause = ""
        if finding.ok is False and finding.limit is not None and value is not None:
            # A failed finding whose value is within the limit fails for another reason.
            is_within_limit = value >= finding.limit if finding.at_least else value <= finding.limit
            cause = finding.brief if is_within_limit else ""
        result = PlaceResult(
            finding.ok,
            value,
            finding.margin,
            finding.unit,
            description,
            RULE_WORDS[finding.rule].scale,
            level,
            cause,
            None if finding.flown is None else finding.planned,
        )
        previous = results.get((finding.rule, key))
        if previous is None or _severity_key(result) < _severity_key(previous):
            results[finding.rule, key] = result
    return FlightResults(item_contents, results, seconds)


def _severity_key(result: PlaceResult) -> tuple[bool, int, float]:
    """Return a key that sorts results from the worst to the best.

    Places that were not reached come last, unless they fail.
    """
    is_last = result.level == _NOT_REACHED and result.ok is not False
    return is_last, _WORST_FIRST[result.ok], 0.0 if result.margin is None else result.margin


def _place_key(place: Place, route_items: Sequence[int], order: dict[int, int]) -> tuple[PlaceKey, str]:
    """Return a key of a place for comparisons, and a description for the user.

    The key has the positions of its items in the mission's list, by which items of an edited mission are matched; the
    description has their numbers.

    route_items: item number of each waypoint.
    order: position in the mission's list by item number.
    """
    if place.kind == "leg" and place.index is not None:
        first_item, last_item = (route_items[place.index + k] for k in (0, 1))
        if first_item in order and last_item in order:
            return (
                "leg",
                order[first_item],
                order[last_item],
            ), f"leg to item {last_item}" if first_item != last_item else f"item {last_item}"
    elif place.kind == "waypoint" and place.index is not None and route_items[place.index] in order:
        number = route_items[place.index]
        return ("waypoint", order[number], order[number]), f"item {number}"
    elif place.kind == "mission" and place.item in order:
        return ("mission", order[place.item], order[place.item]), f"item {place.item}"
    return (f"the {place.kind}", place.index, place.item), place_text(place)


def match_items(old_items: Sequence[tuple[float, ...]], new_items: Sequence[tuple[float, ...]]) -> dict[int, int]:
    """Map the position of each item in an old mission to its position in a new mission.

    Removed items are omitted.

    >>> a, b, c, d = [(16.0, 46.0, 8.0 + k, 100.0) for k in range(4)]
    >>> match_items([a, b, c], [a, d, b, c]), match_items([a, b, c], [a, c]), match_items([a, b, c], [a, d, c])
    ({0: 0, 1: 2, 2: 3}, {0: 0, 2: 1}, {0: 0, 1: 1, 2: 2})
    """
    new_position: dict[int, int] = {}
    # NaN is unequal to itself; replace it by None, so that equal items compare equal.
    old_keys, new_keys = (
        [tuple(None if value != value else value for value in item) for item in mission_items]
        for mission_items in (old_items, new_items)
    )
    for kind, old_start, old_end, new_start, new_end in SequenceMatcher(
        a=old_keys, b=new_keys, autojunk=False
    ).get_opcodes():
        if kind == "equal" or (kind == "replace" and old_end - old_start == new_end - new_start):
            new_position.update(zip(range(old_start, old_end), range(new_start, new_end), strict=True))
    return new_position


def describe_changes(previous: FlightResults | None, current: FlightResults) -> list[str]:
    """Return lines on the differences between a flight and the previous flight.

    The lines state new and ended failures, or changed values if there are none, and a difference in duration.  The
    result is ["nothing"] without a difference, and [] without a previous flight.

    >>> leg = ("clearance", ("leg", 0, 1))
    >>> items = ((16.0, 46.0, 8.0, 100.0), (16.0, 46.0, 8.1, 100.0))
    >>> low = FlightResults(items, {leg: PlaceResult(False, 22.0, -38.0, "m", "leg to item 2")}, 500.0)
    >>> high = FlightResults(items, {leg: PlaceResult(True, 61.0, 1.0, "m", "leg to item 2")}, 512.0)
    >>> describe_changes(low, high)
    ['leg to item 2: clearance, height above ground 22 m \u2192 61 m, now passes', '12 s longer']
    >>> describe_changes(high, high), describe_changes(None, high)
    (['nothing'], [])
    >>> not_reached = PlaceResult(None, 62.0, None, "m", "leg to item 2", level="not reached")
    >>> ended_before = FlightResults(items, {leg: not_reached}, 500.0)
    >>> describe_changes(low, ended_before), describe_changes(ended_before, low)
    (['leg to item 2: clearance, height above ground 22 m, not flown now'],
    ['leg to item 2: clearance, height above ground 22 m, fails now, not flown before'])
    """
    if previous is None:
        return []
    # Key the previous results by the positions of their items in the current mission.  Results at a removed item get a
    # key that matches no current result.
    new_positions, old_results = match_items(previous.items, current.items), _Results()
    for number, ((rule, (kind, first, last)), result) in enumerate(previous.results.items()):
        if kind in _ITEM_PLACE_KINDS and first is not None and last is not None:
            first = new_positions.get(first, _REMOVED_POSITION)
            last = new_positions.get(last, _REMOVED_POSITION)
            if _REMOVED_POSITION in (first, last):
                kind, first, last = _REMOVED_PLACE, number, _REMOVED_POSITION
        old_results[rule, (kind, first, last)] = result
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
_ITEM_PLACE_KINDS = ("leg", "waypoint", "mission")
# Kind of a place whose item was removed.
_REMOVED_PLACE = "gone"
# Position of a removed item.
_REMOVED_POSITION = -1


def _state_changes(old_results: _Results, new_results: _Results) -> list[str]:
    """Return a line for each new failure, then a line for each earlier failure that no longer occurs."""
    new_failures, ended_failures = [], []
    for (rule, key), result in new_results.items():
        old_result = old_results.get((rule, key))
        old_failure = old_result if old_result is not None and old_result.ok is False else None
        if result.ok is False and old_failure is None:
            not_before = old_result is not None and old_result.level == _NOT_REACHED
            new_failures.append(_change_text(rule, result, old_result, f"fails now{', not flown before' * not_before}"))
        elif result.ok is not False and old_failure is not None and result.level == _NOT_REACHED:
            ended_failures.append(
                _change_text(
                    rule, old_failure._replace(place=result.place), old_result=None, state_text="not flown now"
                )
            )
        elif result.ok is not False and old_failure is not None:
            ended_failures.append(
                _change_text(rule, result, old_result, "now passes" if result.ok else "is not judged now")
            )
    current_keys = {key for _, key in new_results}
    for (rule, key), old_result in old_results.items():
        if old_result.ok is False and (rule, key) not in new_results:
            was_removed = key not in current_keys and key[0] in (*_ITEM_PLACE_KINDS, _REMOVED_PLACE)
            ended_failures.append(
                f"the former {_change_text(rule, old_result, old_result=None, state_text='is gone')}"
                if was_removed
                else _change_text(rule, old_result, old_result=None, state_text="now passes")
            )
    return new_failures + ended_failures


def _change_text(rule: str, result: PlaceResult, old_result: PlaceResult | None, state_text: str) -> str:
    """Return a line on a change at a place: rule, old and new value, and state.

    A cause that the values do not show replaces them.  Values of another level than the failure are omitted.

    old_result: result before the change; None to state only the value of `result`.
    state_text: text on the change, such as "now passes".
    """
    causes = [shown.cause for shown in (result, old_result) if shown is not None and shown.cause]
    if causes:
        return f"{result.place}: {RULE_WORDS[rule].word} ({causes[0]}), {state_text}"
    # The failure decides which values are compared; a better flown value does not explain a failure of the plan.
    level = next(
        (shown.level for shown in (result, old_result) if shown is not None and shown.ok is False), result.level
    )
    values: list[str] = []
    for shown in (old_result, result):
        if shown is None:
            continue
        text = shown.text if shown.level == level else ""
        if shown.level != level and level == _PLANNED and shown.planned is not None:
            text = quantity_text(shown.planned, shown.unit)
        if text and text not in values:
            values.append(text)
    values_text = " \u2192 ".join(values)
    name = _quantity_name(rule) if values else RULE_WORDS[rule].word
    was_flown = any(shown is not None and shown.planned is not None for shown in (old_result, result))
    planned_text = " planned" if values and level == _PLANNED and was_flown else ""
    return f"{result.place}: {name}{planned_text} {values_text}".rstrip() + f", {state_text}"


def _quantity_name(rule: str) -> str:
    """Return the name of a rule, followed by the quantity that it compares if it has another name.

    >>> _quantity_name("slope"), _quantity_name("departure")
    ('slope', 'loss of control, largest bank')
    """
    words = RULE_WORDS[rule]
    quantity = "" if words.margin is None else words.margin.quantity
    return words.word if quantity in ("", words.word) else f"{words.word}, {quantity}"


def _value_changes(old_results: _Results, new_results: _Results) -> list[str]:
    """Return lines on changed values.

    Failures that continue come first, then the place closest to each rule's limit.

    At most `_MAX_VALUE_CHANGES` lines of each of the two are returned; the latter with the largest changes first.
    """
    failures = [
        (rule, old_results[rule, key], result)
        for (rule, key), result in new_results.items()
        if result.ok is False and (rule, key) in old_results
    ]
    failure_lines = [
        _change_text(rule, result, old_result, "still fails")
        for rule, old_result, result in failures
        if old_result.text != result.text and old_result.level == result.level
    ]
    old_closest, new_closest = _closest_results(old_results), _closest_results(new_results)
    change_lines = []
    for rule, result in new_closest.items():
        old_result = old_closest.get(rule)
        if old_result is None or old_result.text == result.text or not old_result.scale:
            continue
        if old_result.level != result.level:
            continue
        relative_change = abs((result.margin or 0.0) - (old_result.margin or 0.0)) / old_result.scale
        place_description = (
            result.place if old_result.place == result.place else f"{old_result.place}, now {result.place}"
        )
        change_lines.append(
            (
                relative_change,
                f"closest to its limit: {_quantity_name(rule)} {old_result.text} \u2192 {result.text}"
                f" ({place_description})",
            )
        )
    return failure_lines[:_MAX_VALUE_CHANGES] + [
        text for _, text in sorted(change_lines, reverse=True)[:_MAX_VALUE_CHANGES]
    ]


def _closest_results(results: _Results) -> dict[str, PlaceResult]:
    """Return for each rule the result with the smallest margin.

    Rules without a margin and places that the flight did not reach are omitted.
    """
    closest: dict[str, PlaceResult] = {}
    for (rule, _), result in results.items():
        if result.level == _NOT_REACHED or result.margin is None:
            continue
        if rule not in closest or result.margin < (closest[rule].margin or 0.0):
            closest[rule] = result
    return closest
