"""Define the result and the goal of a campaign, and the command line that repeats the campaign."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planfly.arguments import check_arguments
from planfly.campaigns.find_winds import DEFAULT_WINDS_GOAL, WindsGoal
from planfly.campaigns.statistics.decision import DEFAULT_CONFIDENCE, Answer, Goal, Interval
from planfly.campaigns.summary import CampaignSummary, campaign_lines
from planfly.campaigns.tables import read_path_arrays, with_place_numbers
from world.errors import ArgumentError
from world.html_table import html_table
from world.wording import count_text

# ----------------------------------------------------------------------
# Write the command line that repeats a campaign or a search for winds, for its page.

# Default values of the command line, which are omitted.
_DEFAULTS = {"confidence": 0.95, "directions": 16, "most": 20.0}


def campaign_command_line(target: str, goal: Goal, options: Mapping[str, object]) -> str:
    """Return the ``planfly campaign`` command line for a goal and options.

    Options that are None are omitted.

    target: scenario, plan or mission of the campaign.

    >>> options = {"seed": 3, "wind": (8.0, 270.0), "fence": ["a", "b"]}
    >>> campaign_command_line("my plan.json", Goal(0.99, True, 5000), options)
    "planfly campaign 'my plan.json' --prove 0.99 --flights 5000 --seed 3 --wind 8,270 --fence a --fence b"
    """
    target_option = {"prove" if goal.stops else "at_least": goal.target}
    return command_line(
        "campaign", target, {**target_option, "flights": goal.flights, "confidence": goal.confidence, **options}
    )


def winds_command_line(target: str, goal: WindsGoal, options: Mapping[str, object]) -> str:
    """Return the ``planfly winds`` command line for a goal and options.

    Options that are None are omitted.
    target: scenario, plan or mission of the search.

    >>> winds_command_line("jacksboro-air", WindsGoal(0.9, 0.95, 8, 20.0, 5000), {"seed": 1})
    'planfly winds jacksboro-air --prove 0.9 --directions 8 --seed 1'
    """
    flights = None if goal.flights == DEFAULT_WINDS_GOAL.flights else goal.flights
    goal_options = {"prove": goal.target, "directions": goal.directions, "most": goal.most, "flights": flights}
    return command_line("winds", target, {**goal_options, "confidence": goal.confidence, **options})


def command_line(command: str, target: str, options: Mapping[str, object]) -> str:
    """Return a ``planfly`` command line with quoted options.

    command, target: name of the command, and its positional argument.
    options: values by name.  True gives a flag, and a list repeats the option.  Options that are None, False or equal
        to their default are omitted.

    >>> command_line("ground-risk", "a b.plan", {"glide": True, "controlled": False, "max_speed": 31.0})
    "planfly ground-risk 'a b.plan' --glide --max-speed 31"
    """
    parts = ["planfly", command, shlex.quote(target)]
    for name, value in options.items():
        if value is None or value is False or value == _DEFAULTS.get(name):
            continue
        option = f"--{name.replace('_', '-')}"
        for option_value in value if isinstance(value, list) else [value]:
            parts += [option] if option_value is True else [option, shlex.quote(_option_text(option_value))]
    return " ".join(parts)


def _option_text(value: object) -> str:
    """Return an option's value as text; the entries of a tuple are separated by commas."""
    if isinstance(value, tuple):
        return ",".join(_option_text(number) for number in value)
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


# Default number of flights of a campaign with a fixed number.
DEFAULT_FLIGHTS = 300
# Default maximum number of flights of a campaign that stops by itself.
MAX_FLIGHTS = 5000


@dataclass(frozen=True, repr=False, eq=False)
class CampaignResult:
    """Result of `planfly.campaign`.

    summary: probability, failures and deciding rules of the flights.
    columns: columns of the table of flights by name, (n,) each.
    table: file of this table; None if it was not kept.
    """

    summary: CampaignSummary
    columns: Mapping[str, NDArray[Any]]
    table: Path | None = None

    @property
    def probability(self) -> float:
        """Fraction of flyable flights."""
        return self.summary.estimate.tally.share

    @property
    def interval(self) -> Interval:
        """Two-sided interval of the probability, with the requested confidence."""
        return self.summary.estimate.interval

    @property
    def bounds(self) -> Interval:
        """Lower and upper bound, each with the requested confidence; `answer` is based on these bounds."""
        return Interval(self.summary.estimate.lower, self.summary.estimate.upper)

    @property
    def answer(self) -> Answer:
        """Answer to the goal: "reached", "missed" or "undecided"; "no target" without a target."""
        return self.summary.estimate.answer

    @property
    def by_rule(self) -> dict[str, int]:
        """Number of flights that failed each rule; rules that no flight failed are omitted."""
        return {failures.rule: failures.flights for failures in self.summary.by_rule}

    @property
    def flights(self) -> Any:
        """Table of flights as a pandas DataFrame, or as arrays keyed by name if pandas is not installed.

        The place of the smallest margin of each rule has three columns: ``place_RULE_kind`` (such as "leg", None if not
        judged), ``place_RULE_index`` and ``place_RULE_item``, NaN if there is none.

        Drawn wind speeds (m/s) and directions (degrees) are added to the scenario's wind; ``mass``, ``drag``,
        ``control_power`` and ``battery`` are factors.  ``margin_RULE`` is the smallest distance from failing the rule:
        a finding's margin plus its tolerance, in the unit of the rule in docs/campaigns.md (m, m/s, degrees, Wh or %).
        ``energy_left`` is in Wh.
        """
        columns = with_place_numbers(self.columns)
        try:
            import pandas as pd
        except ImportError:
            return columns
        return pd.DataFrame(columns)

    def path_arrays(self) -> dict[str, NDArray[np.float32]]:
        """Read each flight's clearance along the route and offset at each stop from the campaign's folder.

        "clearance": minimum height above ground on each of 150 equally long parts of the route, m, (n, 150).
        "crossings": offset from each waypoint at closest approach, m, (n, w, 2): to the right and upwards.
        Unknown values are NaN.

        Raises ValueError for a campaign without a folder.
        """
        if self.table is None:
            raise ValueError("path_arrays: the campaign has no folder; name one with `out`")
        return read_path_arrays(self.table)

    def __repr__(self) -> str:
        tally, (low, high) = self.summary.estimate.tally, self.interval
        flights_text = count_text(tally.flown, "flight")
        return f"<CampaignResult {self.probability:.4f} ({low:.4f} to {high:.4f}) of {flights_text}; {self.answer}>"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook."""
        return html_table(campaign_lines(self.summary)[0], self.by_rule.items(), ("rule", "flights that it fails"))


def make_goal(flights: int | None, prove: float | None, at_least: float | None, confidence: float | None) -> Goal:
    """Return the goal of a campaign from the keyword arguments of `planfly.campaign`.

    The value None stands for a default.

    Raises ArgumentError for numbers outside their ranges, and if both `prove` and `at_least` are given.

    >>> make_goal(None, 0.99, None, None)
    Goal(target=0.99, stops=True, flights=5000, confidence=0.95, changed=False)
    """
    if prove is not None and at_least is not None:
        raise ArgumentError("`prove` and `at_least`: give only one of them", field="prove", value=prove)
    check_arguments(prove=prove, at_least=at_least, confidence=confidence, flights=flights)
    flight_count = flights or (DEFAULT_FLIGHTS if prove is None else MAX_FLIGHTS)
    return Goal(
        prove if prove is not None else at_least, prove is not None, flight_count, confidence or DEFAULT_CONFIDENCE
    )
