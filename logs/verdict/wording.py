"""Places, changes and disagreements in words.  Nothing of ours reads these words back."""

import math

from logs.verdict.places import Change, Disagreement, Place, Suggestion
from logs.verdict.tolerances import ON_THE_SPOT
from world.threats import threat_label

# Longest statement of a headline, characters.
_LONGEST = 80


def place_text(place: Place) -> str:
    """Name a place as a person does.

    >>> [place_text(place) for place in (Place("waypoint", 3, item=4), Place("missile", 0, name="Alfa"), Place("plan"))]
    ['waypoint 3 (item 4)', 'Alfa (missile)', 'plan']
    """
    match place:
        case Place("mission", item=int(item)):
            return f"item {item}"
        case Place("missile" | "radar"):
            return f"{threat_text(place)} ({place.kind})"
        case Place(kind, index=int(index), item=int(item)):
            return f"{kind} {index} (item {item})"
        case Place(kind, index=int(index)):
            return f"{kind} {index}"
    return place.kind


def threat_text(place: Place) -> str:
    """What the threat of a missile or a radar is called.

    >>> threat_text(Place("missile", 0, name="Alfa")), threat_text(Place("missile", 2))
    ('Alfa', 'threat 3')
    """
    return threat_label(place.name, place.index or 0)


def change_text(change: Change) -> str:
    """One change as an instruction.

    >>> change_text(Change("length", Place("leg", 1), 300.0, 400.0, "m"))
    'make leg 1 400 m long instead of 300 m'
    >>> change_text(Change("airspeed", Place("leg", 2), 36.0, 18.1, "m/s", most=31.5))
    'command 18.1 to 31.5 m/s on leg 2'
    """
    where, wanted = place_text(change.place), change.wanted
    match change.what:
        case "length":
            return f"make {_length(change)}"
        case "rise":
            verb = "climb" if math.copysign(1.0, wanted) > 0.0 else "fall"
            instead = "" if change.current is None else f" instead of {abs(change.current):.0f} m"
            return f"{verb} {abs(wanted):.0f} m on {where}{instead}"
        case "airspeed" if change.most is not None:
            return f"command {wanted:.1f} to {change.most:.1f} m/s on {where}"
        case "airspeed":
            return f"fly it at {wanted:g} m/s instead of {change.current:g} m/s"
        case "turn":
            return f"turn at most {wanted:.1f}° there"
        case "height":
            return f"fly {where} {wanted:.0f} m higher"
        case "inset":
            return f"bring the path {wanted:.0f} m further inside"
        case "distance":
            return f"pass {threat_text(change.place)} {wanted:.0f} m further away"
        case "duration":
            return f"shorten the flight by {wanted:.0f} %"
        case "battery" | "tank":
            return f"take a {change.what} {wanted:.2f} times as large"


def _length(change: Change) -> str:
    current = change.current or 0.0
    instead = "; it goes nowhere now" if current < ON_THE_SPOT else f" instead of {current:.0f} m"
    return f"{place_text(change.place)} {change.wanted:.0f} m long{instead}"


def suggestion_text(suggestion: Suggestion) -> str:
    """Changes to make together, as one instruction.

    >>> longer = [Change("length", Place("leg", k), 150.0, 260.0, "m") for k in (1, 2)]
    >>> suggestion_text(tuple(longer))
    'make leg 1 260 m long instead of 150 m and leg 2 260 m long instead of 150 m'
    """
    if all(change.what == "length" for change in suggestion):
        return "make " + " and ".join(map(_length, suggestion))
    return " and ".join(map(change_text, suggestion))


def suggestions_text(suggestions: tuple[Suggestion, ...]) -> str:
    """Alternatives, as one instruction; "" for none.

    >>> slower = Change("airspeed", Place("leg", 1), 25.0, 20.5, "m/s")
    >>> suggestions_text(((Change("length", Place("leg", 1), 300.0, 400.0, "m"),), (slower,)))
    'make leg 1 400 m long instead of 300 m, or fly it at 20.5 m/s instead of 25 m/s'
    """
    return ", or ".join(map(suggestion_text, suggestions))


def disagreement_text(one: Disagreement) -> str:
    """That the two levels judge a place differently.

    >>> disagreement_text(Disagreement("speed", Place("leg", 0), geometric=True, flown=False))
    'speed at leg 0 passes by geometry and fails in flight'
    """
    verbs = {True: "passes", False: "fails"}
    return f"{one.rule} at {place_text(one.place)} {verbs[one.geometric]} by geometry and {verbs[one.flown]} in flight"


def shortened(text: str) -> str:
    """A statement cut to the length that a headline takes.

    >>> shortened("bank 80° at 3.0 s"), len(shortened("m" * 200))
    ('bank 80° at 3.0 s', 80)
    """
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."
