"""Describe places, changes and disagreements in texts that no code of planfly parses."""

import math
from collections.abc import Sequence
from dataclasses import replace

from logs.verdict.places import (
    FAR_MOVE_DISTANCE_M,
    Change,
    DecidingParameter,
    Disagreement,
    ItemMove,
    Place,
    Suggestion,
)
from logs.verdict.tolerances import MIN_LEG_LENGTH_M
from world.threats import threat_label
from world.wording import count_text as count_text

# Text of a unit after a number.
UNITS = {"deg": "°", "m": " m", "s": " s", "m/s": " m/s", "Wh": " Wh", "dB": " dB", "legs": " legs", "%": " %"}
# Names of rules within a sentence that differ from their names in data.
RULE_NOUNS = {
    "survey": "photo line",
    "takeoff": "take-off",
    "climbout": "climb-out",
    "go_around": "go-around",
    "link": "radio link",
    "departure": "loss of control",
}
# Rules that judge only the planned route, each with the rule that judges the same part of a flight.
FLOWN_COUNTERPARTS = {"landing": "touchdown"}
# Greatest length of a statement in a headline, characters.
_MAX_STATEMENT_LENGTH = 80
# Minimum length of a clause that can replace its statement, characters.
_MIN_CLAUSE_LENGTH = 30
# Beginnings of what may follow a clause within a statement.
_CLAUSE_ENDS = (
    ". ",
    "; ",
    ": ",
    " (",
    " but ",
    " because ",
    " so that ",
    ", so ",
    ", and ",
    ", which ",
    ", while ",
    ", where ",
)


def place_text(place: Place) -> str:
    """Return the name of a place for use in texts.

    >>> [place_text(place) for place in (Place("waypoint", 3, item=4), Place("missile", 0, name="Alfa"), Place("plan"))]
    ['waypoint 3 (item 4)', 'Alfa (missile)', 'plan']
    >>> place_text(Place("exclusion", 0, name="town")), place_text(Place("leg", 7, to_item=9))
    ('town (exclusion)', 'leg 7 (to item 9)')
    >>> place_text(Place("waypoint", 11, item=4, number=3))
    'waypoint 3 (item 4)'
    """
    number = place.index if place.number is None else place.number
    match place:
        case Place("mission", item=int(item)):
            return f"item {item}"
        case Place("missile" | "radar"):
            return f"{threat_text(place)} ({place.kind})"
        case Place("exclusion" | "inclusion"):
            return f"{place.name} ({place.kind})"
        case Place("leg", index=int(), to_item=int(item)):
            return f"leg {number} (to item {item})"
        case Place(kind, index=int(), item=int(item)):
            return f"{kind} {number} (item {item})"
        case Place(kind, index=int()):
            return f"{kind} {number}"
    return place.kind


def noun_with_place(noun: str, place: Place) -> str:
    """Name the rule of a finding and its place, unless that is the whole flight, plan or mission.

    >>> noun_with_place("slope", Place("leg", 7, to_item=9)), noun_with_place("energy", Place("flight"))
    ('slope at leg 7 (to item 9)', 'energy')
    >>> noun_with_place("mission", Place("mission", item=3)), noun_with_place("mission", Place("mission"))
    ('mission item 3', 'mission')
    >>> noun_with_place("waypoint", Place("waypoint", 12, item=14))
    'waypoint 12 (item 14)'
    """
    if place.kind in ("flight", "plan") or (place.kind == "mission" and place.item is None):
        return noun
    name = place_text(place)
    if place.kind == "mission":
        return f"{noun} {name}"
    return name if noun == place.kind else f"{noun} at {name}"


def threat_text(place: Place) -> str:
    """Return the name of the threat of a missile or radar, or its number from 1 without a name.

    >>> threat_text(Place("missile", 0, name="Alfa")), threat_text(Place("missile", 2))
    ('Alfa', 'threat 3')
    """
    return threat_label(place.name, place.index or 0)


def change_text(change: Change) -> str:
    """Phrase one change as an instruction.

    >>> change_text(Change("length", Place("leg", 1), 300.0, 400.0, "m"))
    'lengthen leg 1 from 300 m to 400 m'
    >>> change_text(Change("airspeed", Place("leg", 2), 36.0, 18.1, "m/s", most=31.5))
    'command an airspeed of 18.1 to 31.5 m/s on leg 2'
    >>> change_text(Change("north", Place("exclusion", 0, name="town"), None, 40.0, "m"))
    'pass town 40 m further north'
    >>> change_text(Change("descent", Place("leg", 3), None, 12.0, "m"))
    'lower both ends of leg 3 by 12 m'
    >>> change_text(Change("descent", Place("leg", 3, to_item=5), None, 12.0, "m"))
    'lower both ends of leg 3 (to item 5) by 12 m'
    >>> change_text(Change("descent", Place("waypoint", 4, item=5), None, 12.0, "m"))
    'lower waypoint 4 (item 5) by 12 m'
    >>> change_text(Change("radius", Place("waypoint", 4, item=5), 80.0, 94.0, "m"))
    'set the radius of item 5 to 94 m instead of 80 m'
    >>> change_text(Change("full throttle", Place("leg", 3), None, 20.0, "s"))
    'fly a climb of 20 s at full throttle and give its log to planfly aircraft --identify'
    """
    place_name, requested_value = place_text(change.place), change.wanted
    match change.what:
        case "length":
            return f"lengthen {_length_text(change)}"
        case "terrain height":
            return _terrain_height_text((change,))
        case "rise":
            verb = "climb" if math.copysign(1.0, requested_value) > 0.0 else "descend"
            if change.current is None:
                return f"{verb} {abs(requested_value):.0f} m on {place_name}"
            wanted_text, current_text = _changed_texts(change)
            return f"{verb} {wanted_text} instead of {current_text} on {place_name}"
        case "airspeed" if change.most is not None:
            return f"command an airspeed of {requested_value:.1f} to {change.most:.1f} m/s on {place_name}"
        case "airspeed":
            wanted_text, current_text = _changed_texts(change)
            where = {"leg": f" {place_name}", "waypoint": f" through {place_name}"}.get(change.place.kind, "")
            return f"fly{where} at {wanted_text} instead of {current_text}"
        case "turn":
            return f"turn at most {requested_value:.1f}° at {place_name}"
        case "height" | "descent":
            verb = "raise" if change.what == "height" else "lower"
            if change.place.kind == "leg":
                return f"{verb} both ends of {place_name} by {requested_value:.0f} m"
            if change.place.kind == "waypoint":
                return f"{verb} {place_name} by {requested_value:.0f} m"
            return (
                f"pass {change.place.name} {requested_value:.0f} m {'higher' if change.what == 'height' else 'lower'}"
            )
        case "north" | "east" | "south" | "west":
            verb = "stay in" if change.place.kind == "inclusion" else "pass"
            return f"{verb} {change.place.name} {requested_value:.0f} m further {change.what}"
        case "radius":
            return (
                f"set the radius of item {change.place.item} to {requested_value:g} m instead of {change.current:g} m"
            )
        case "inset":
            return f"bring the path {requested_value:.0f} m further inside the area"
        case "distance":
            return f"pass {requested_value:.0f} m further away from {threat_text(change.place)}"
    return _other_change_text(change)


def _other_change_text(change: Change) -> str:
    """Phrase a change of anything other than the path as an instruction."""
    requested_value = change.wanted
    match change.what:
        case "parameter":
            suffix = _unit_suffix(change.unit)
            return f"set {change.parameter} to {requested_value:g}{suffix} instead of {change.current:g}{suffix}"
        case "home altitude":
            return f"set home to {requested_value:.1f} m AMSL, the ground there, instead of {change.current:.1f} m"
        case "altitude frame":
            if requested_value == 0.0:
                return (
                    "read the altitudes of the items that are too high as above mean sea level (frame 0 instead of 3)"
                )
            return "read the altitudes of the items below ground as heights above home (frame 3 instead of 0)"
        case "end loiter":
            return f"end with a loiter: make item {change.place.item} a NAV_LOITER_UNLIM (or add a landing)"
        case "landing course":
            return (
                f"land from the other end, on a course of {requested_value:.0f}° instead of {change.current:.0f}°,"
                " against the wind"
            )
        case "launch course":
            return f"launch on a course of {requested_value:.0f}° instead of {change.current:.0f}°, against the wind"
        case "launch speed":
            return f"launch at {requested_value:.0f} m/s over the ground instead of {change.current:.1f} m/s"
        case "duration":
            return f"shorten the flight by {requested_value:.0f} %"
        case "full throttle" | "no throttle":
            climb = change.what == "full throttle"
            flight_text = (
                f"a climb of {requested_value:.0f} s at full throttle"
                if climb
                else f"a glide of {requested_value:.0f} s without throttle"
            )
            return f"fly {flight_text} and give its log to planfly aircraft --identify"
        case "stated climb":
            return "state the climb of the aircraft at full throttle: planfly aircraft --new ... --climb DEGREES"
        case "stated bank":
            return (
                f"state the aircraft's bank limit, because its {change.current:.0f}° is a guess: planfly aircraft"
                " --new ... --bank DEGREES"
            )
    return f"use a {change.what} {requested_value:.2f} times as large"


def _changed_texts(change: Change, digits: int = 0) -> tuple[str, str]:
    """Return the wanted and the current value as unsigned texts, with enough digits to tell them apart.

    digits: minimum number of digits after the decimal point.

    >>> _changed_texts(Change("rise", Place("leg", 1), -86.4, -86.0, "m"))
    ('86.0 m', '86.4 m')
    >>> _changed_texts(Change("airspeed", Place("leg", 1), 25.0, 20.5, "m/s"))
    ('20.5 m/s', '25 m/s')
    """
    wanted, current = abs(change.wanted), abs(change.current or 0.0)
    suffix = _unit_suffix(change.unit)
    if change.what == "airspeed" and f"{wanted:g}" != f"{current:g}":
        return f"{wanted:g}{suffix}", f"{current:g}{suffix}"
    while digits < _MAX_DIGITS and wanted != current and f"{wanted:.{digits}f}" == f"{current:.{digits}f}":
        digits += 1
    return f"{wanted:.{digits}f}{suffix}", f"{current:.{digits}f}{suffix}"


def _length_text(change: Change) -> str:
    """Name a leg with its present and its new length, such as "leg 1 from 150 m to 260 m".

    For a vertical leg, the text is "leg 1 to 260 m (it is vertical)".
    """
    current = change.current or 0.0
    place_name = place_text(change.place)
    if current < MIN_LEG_LENGTH_M:
        return f"{place_name} to {change.wanted:.0f} m (it is vertical)"
    wanted_text, current_text = _changed_texts(change)
    return f"{place_name} from {current_text} to {wanted_text}"


def _terrain_height_text(suggestion: Suggestion) -> str:
    """Phrase changes that let legs follow the ground, with their end items and heights above ground.

    >>> legs = [Change("terrain height", Place("leg", k, to_item=k + 1), None, 70.0 + k, "m") for k in (1, 2)]
    >>> _terrain_height_text(tuple(legs))
    'follow the ground to item 2 at 71 m and item 3 at 72 m above it (frame 10)'
    """
    texts = []
    for change in suggestion:
        end = place_text(change.place) if change.place.to_item is None else f"item {change.place.to_item}"
        texts.append(f"{end} at {change.wanted:.0f} m")
    return f"follow the ground to {_join_with_and(texts)} above it (frame 10)"


def suggestion_text(suggestion: Suggestion) -> str:
    """Join the changes of one suggestion into one instruction.

    >>> longer = [Change("length", Place("leg", k), 150.0, 260.0, "m") for k in (1, 2)]
    >>> suggestion_text(tuple(longer))
    'lengthen leg 1 from 150 m to 260 m and leg 2 from 150 m to 260 m'
    >>> moves = (ItemMove(3, 0.0, 412.0, 0.0),)
    >>> suggestion_text((Change("north", Place("exclusion", 0, name="town"), None, 40.0, "m", moves=moves),))
    'pass town 40 m further north, with a move of 412 m: move item 3 north by 412 m'
    """
    if all(change.what == "terrain height" for change in suggestion):
        text = _terrain_height_text(suggestion)
    elif all(change.what == "length" for change in suggestion):
        text = "lengthen " + " and ".join(map(_length_text, suggestion))
    else:
        text = " and ".join(map(change_text, suggestion))
    moves = [move for change in suggestion for move in change.moves]
    remaining = [finding for change in suggestion for finding in change.remaining]
    distance = max((math.hypot(move.east, move.north) for move in moves), default=0.0)
    if distance >= FAR_MOVE_DISTANCE_M:
        text = f"{text}, with a move of {distance:.0f} m"
    notes = [f"move {moves_text(moves)}"] if moves else []
    notes += [
        f"{_join_with_and(texts)} then {verbs[len(texts) > 1]} later in the flight"
        for verbs, fails in ((("fails", "fail"), True), (("is undecided", "are undecided"), False))
        if (
            texts := [
                noun_with_place(RULE_NOUNS.get(item.rule, item.rule), item.place)
                for item in remaining
                if item.fails is fails
            ]
        )
    ]
    if any(change.not_flown for change in suggestion):
        notes.append(f"not tried in flight, because the flight ended before this {suggestion[-1].place.kind}")
    return f"{text}: {'; '.join(notes)}" if notes else text


def without_trial(suggestion: Suggestion) -> Suggestion:
    """Return a suggestion without the results of its trial.

    >>> slower = Change("airspeed", Place("leg", 1), 25.0, 20.5, "m/s", not_flown=True)
    >>> suggestion_text(without_trial((slower,)))
    'fly leg 1 at 20.5 m/s instead of 25 m/s'
    """
    return tuple(replace(change, moves=(), remaining=(), not_flown=False) for change in suggestion)


def within_tolerance_text(tolerance: float | None, unit: str) -> str:
    """Return the phrase for a value that is beyond its limit but passes.

    tolerance: in `unit`; None if it is not known.

    >>> within_tolerance_text(0.5, "m/s"), within_tolerance_text(None, "")
    ('within the tolerance of 0.5 m/s', 'within the tolerance')
    """
    return "within the tolerance" + (f" of {quantity_text(tolerance, unit)}" if tolerance else "")


def moves_text(moves: Sequence[ItemMove]) -> str:
    """List moves of items; items with the same move are named together.

    >>> moves_text([ItemMove(8, -1.96, 48.9, 0.0), ItemMove(9, 0.0, 0.0, -6.5), ItemMove(10, 0.0, 0.0, -6.5)])
    'item 8 north by 48.9 m and west by 2 m, items 9 and 10 down by 6.5 m'
    >>> moves_text([ItemMove(item, 40.0, 0.0, 12.0) for item in (3, 4, 5, 9)])
    'items 3 to 5 and 9 east by 40 m and up by 12 m'
    """
    items_by_offset: dict[str, list[int]] = {}
    for move in sorted(moves, key=lambda move: move.item):
        sides = (move.north, "north", "south"), (move.east, "east", "west"), (move.up, "up", "down")
        steps = [
            f"{positive if step > 0.0 else negative} by {round(abs(step), 1):g} m"
            for step, positive, negative in sides
            if round(abs(step), 1) > 0.0
        ]
        items_by_offset.setdefault(_join_with_and(steps), []).append(move.item)
    texts = []
    for offset, items in items_by_offset.items():
        # Three or more consecutive items are named as a range.
        runs: list[list[int]] = []
        for item in items:
            if runs and item == runs[-1][-1] + 1:
                runs[-1].append(item)
            else:
                runs.append([item])
        names = [name for run in runs for name in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else map(str, run))]
        texts.append(f"item{'s' if len(items) > 1 else ''} {_join_with_and(names)} {offset}")
    return ", ".join(texts)


def _join_with_and(texts: Sequence[str]) -> str:
    """Join texts by commas, and the last text by "and"."""
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def suggestions_text(suggestions: tuple[Suggestion, ...]) -> str:
    """Join alternative suggestions into one instruction; return "" without any.

    >>> slower = Change("airspeed", Place("leg", 1), 25.0, 20.5, "m/s")
    >>> suggestions_text(((Change("length", Place("leg", 1), 300.0, 400.0, "m"),), (slower,)))
    'lengthen leg 1 from 300 m to 400 m; or fly leg 1 at 20.5 m/s instead of 25 m/s'
    """
    return "; or ".join(map(suggestion_text, suggestions))


# How each level judges, as a phrase after "passes" or "fails".
_LEVEL_PHRASES = {"geometry": "by geometry", "airframe": "with planfly's guidance", "autopilot": "with the autopilot"}


def disagreement_text(disagreement: Disagreement) -> str:
    """State that another level and the verdict judge a place differently.

    >>> disagreement_text(Disagreement("speed", Place("leg", 0), "geometry", there=True, here=False))
    'speed at leg 0 passes by geometry and fails in flight'
    >>> disagreement_text(Disagreement("landing", Place("waypoint", 2), "geometry", there=False, here=True))
    'landing at waypoint 2 fails by geometry, and touchdown, its counterpart, passes in flight'
    """
    verbs = {True: "passes", False: "fails"}
    rule_noun = RULE_NOUNS.get(disagreement.rule, disagreement.rule)
    rule_and_place = noun_with_place(rule_noun, disagreement.place)
    counterpart = FLOWN_COUNTERPARTS.get(disagreement.rule) if disagreement.level == "geometry" else None
    conjunction = f", and {counterpart}, its counterpart," if counterpart else " and"
    return (
        f"{rule_and_place} {verbs[disagreement.there]} {_LEVEL_PHRASES[disagreement.level]}"
        f"{conjunction} {verbs[disagreement.here]} in flight"
    )


def deciding_text(deciding: DecidingParameter) -> str:
    """Describe the deciding parameter.

    The text has its current value, the effect of this value, and the value that would pass.

    >>> deciding_text(DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", "clearance", Place("leg", 4), -8.2))
    'with TECS_HDEM_TCONST 3 s the aircraft is 8 m too low on leg 4; with 1.2 s the flight would pass'
    """
    place_name, error = place_text(deciding.place), deciding.off
    effect = f"the flight fails {RULE_NOUNS.get(deciding.rule, deciding.rule)} at {place_name}"
    if error is not None and deciding.rule == "corridor":
        effect = f"the aircraft is {abs(error):.0f} m off {place_name}"
    elif error is not None:
        effect = f"the aircraft is {abs(error):.0f} m too {'low' if error < 0.0 else 'high'} on {place_name}"
    suffix = _unit_suffix(deciding.unit)
    return (
        f"with {deciding.name} {deciding.current:g}{suffix} {effect};"
        f" with {deciding.passing:g}{suffix} the flight would pass"
    )


def gentle_launch_text(acceleration: float, trigger: tuple[float, str]) -> str:
    """State that a launch accelerates too little to start the motor.

    acceleration: acceleration of the launch, m/s^2.
    trigger: acceleration that starts the motor, m/s^2, and the name of its parameter.

    >>> gentle_launch_text(8.33, (15.0, "TKOFF_THR_MINACC"))
    'the launch accelerates at 8.3 m/s², less than TKOFF_THR_MINACC 15'
    """
    return f"the launch accelerates at {acceleration:.1f} m/s², less than {trigger[1]} {trigger[0]:g}"


def shorten_statement(statement: str) -> str:
    """Shorten a statement for a headline at the end of a clause.

    The text has at most 80 characters, unless its first clause is longer.

    A first clause of more than 160 characters is cut at the end of a word, but not between number and unit.

    >>> shorten_statement("the jump at item 5 repeats indefinitely. Each round uses 57.5 Wh, enough for 15 rounds")
    'the jump at item 5 repeats indefinitely'
    """
    if len(statement) <= _MAX_STATEMENT_LENGTH:
        return statement
    clauses = [statement[:k].rstrip(",") for k in range(len(statement)) if statement.startswith(_CLAUSE_ENDS, k)]
    # A short clause, such as "not started", only introduces the statement, and a bracket is not cut.
    clauses = [
        clause for clause in clauses if len(clause) >= _MIN_CLAUSE_LENGTH and clause.count("(") == clause.count(")")
    ]
    fitting_clauses = [clause for clause in clauses if len(clause) <= _MAX_STATEMENT_LENGTH]
    clause = fitting_clauses[-1] if fitting_clauses else clauses[0] if clauses else statement
    if len(clause) <= 2 * _MAX_STATEMENT_LENGTH:
        return clause
    cut_length = _MAX_STATEMENT_LENGTH - 3
    words = statement[: cut_length + 1].split(" ")[:-1]
    while words and words[-1].strip("(+-").replace(".", "").isdigit():
        words.pop()
    return (" ".join(words).rstrip(",;:") or statement[:cut_length]) + "..."


def strip_prefix(text: str, prefixes: Sequence[str]) -> str:
    """Remove the first matching prefix from a text, and the punctuation after it.

    >>> strip_prefix("not flyable: slope on leg 1", ("Not flyable, and incomplete", "not flyable"))
    'slope on leg 1'
    """
    length = next((len(prefix) for prefix in prefixes if text.lower().startswith(prefix.lower())), 0)
    return text[length:].lstrip(":; ")


def quantity_text(value: float, unit: str) -> str:
    """Return a value with its unit, to three significant figures and without an exponent.

    >>> quantity_text(11.87, "deg"), quantity_text(1_140_000.0, "Wh")
    ('11.9°', '1140000 Wh')
    """
    return _with_unit(_significant_digits(value, 3), unit)


def energy_left_text(energy: float) -> str:
    """Describe the energy left at the end of a flight, Wh, or the missing energy if it is negative.

    >>> energy_left_text(11.87), energy_left_text(-3.0)
    ('11.9 Wh left', '3 Wh missing')
    """
    return f"{quantity_text(energy, 'Wh')} left" if energy >= 0.0 else f"{quantity_text(-energy, 'Wh')} missing"


def _with_unit(digits: str, unit: str) -> str:
    """Join the digits of a number and its unit, such as "12 m", "1 leg" or "2 legs"."""
    return digits + (" leg" if (digits, unit) == ("1", "legs") else _unit_suffix(unit))


def _unit_suffix(unit: str) -> str:
    """Return the text of a unit after a number; "" without a unit."""
    return UNITS.get(unit, f" {unit}" if unit else "")


# Largest number of significant digits of two numbers that are compared.
_MAX_DIGITS = 9


def compared_texts(value: float, limit: float, unit: str, decimals: int | None = None) -> tuple[str, str]:
    """Format a value and its limit with their unit.

    The texts have enough digits to show a difference.

    decimals: smallest number of decimals; None for three significant digits.

    >>> compared_texts(-7.04, -7.02, "deg"), compared_texts(12.0, 15.0, "m")
    (('-7.04°', '-7.02°'), ('12 m', '15 m'))
    >>> compared_texts(30.0004, 30.0, "m/s")
    ('30.0004 m/s', '30 m/s')
    >>> compared_texts(80.0, 80.3, "m", 0), compared_texts(76.2, 80.3, "m", 0)
    (('80.0 m', '80.3 m'), ('76 m', '80 m'))
    """
    if decimals is not None:
        while decimals < _MAX_DIGITS and value != limit and f"{value:.{decimals}f}" == f"{limit:.{decimals}f}":
            decimals += 1
        return _with_unit(f"{value:.{decimals}f}", unit), _with_unit(f"{limit:.{decimals}f}", unit)
    digits = 3
    while (
        digits < _MAX_DIGITS
        and value != limit
        and _significant_digits(value, digits) == _significant_digits(limit, digits)
    ):
        digits += 1
    return _with_unit(_significant_digits(value, digits), unit), _with_unit(_significant_digits(limit, digits), unit)


def _significant_digits(value: float, digits: int) -> str:
    """Format a value with this number of significant digits, without an exponent."""
    figures = f"{value:.{digits}g}"
    return figures if "e" not in figures else f"{value:.0f}" if abs(value) >= 1.0 else f"{value:.9f}".rstrip("0")
