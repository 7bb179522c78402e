"""The command line that repeats a campaign or a search for winds, for its page."""

import shlex
from collections.abc import Mapping

from planfly.campaigns.find_winds import USUAL_FLIGHTS, WindsGoal
from planfly.campaigns.statistics.decision import Goal

# Options that decide what is flown, beside the goal's; of the command line's usual values nothing is said.
OPTIONS = (
    *("seed", "spread", "scenario", "terrain", "fence", "aircraft", "airspeed", "wind", "turbulence"),
    *("params", "guidance", "nav"),
)
_USUAL = {"confidence": 0.95, "directions": 16, "most": 20.0}


def campaign_line(target: str, goal: Goal, options: Mapping[str, object]) -> str:
    """``planfly campaign`` with the goal and with options by name, of which those that are None or empty are not given.

    >>> campaign_line("my plan.json", Goal(0.99, True, 5000), {"seed": 3, "wind": (8.0, 270.0), "fence": ["a", "b"]})
    "planfly campaign 'my plan.json' --prove 0.99 --flights 5000 --seed 3 --wind 8,270 --fence a --fence b"
    """
    target_option = {"prove" if goal.stops else "at_least": goal.target}
    return _line(
        "campaign", target, {**target_option, "flights": goal.flights, "confidence": goal.confidence, **options}
    )


def winds_line(target: str, goal: WindsGoal, options: Mapping[str, object]) -> str:
    """``planfly winds``, as `campaign_line`.

    >>> winds_line("jacksboro", WindsGoal(0.9, 0.95, 8, 20.0, 5000), {"seed": 1})
    'planfly winds jacksboro --prove 0.9 --directions 8 --seed 1'
    """
    flights = None if goal.flights == USUAL_FLIGHTS else goal.flights
    asked = {"prove": goal.target, "directions": goal.directions, "most": goal.most, "flights": flights}
    return _line("winds", target, {**asked, "confidence": goal.confidence, **options})


def _line(command: str, target: str, options: Mapping[str, object]) -> str:
    words = ["planfly", command, shlex.quote(target)]
    for name, value in options.items():
        if value is None or value == _USUAL.get(name):
            continue
        for one in value if isinstance(value, list) else [value]:
            words += [f"--{name.replace('_', '-')}", shlex.quote(_text(one))]
    return " ".join(words)


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return ",".join(_text(one) for one in value)
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)
