"""Fly a finished plan with the default dispersions (``--flights N``).

The number of flyable flights is stated.
"""

import argparse
from typing import TYPE_CHECKING

import planfly
from world.errors import ScenarioError
from world.extras import require_extra

if TYPE_CHECKING:
    from planfly import Plan
    from planfly.terminal.answers import DispersedFlights


def check_flights_option(args: argparse.Namespace, excluded: str) -> None:
    """Raise ScenarioError or MissingExtraError if ``--flights`` was given but cannot be flown.

    excluded: keyword of the option that cannot be combined with dispersed flights.

    It is called before anything is planned.
    """
    if args.flights is None:
        return
    if getattr(args, excluded) is not None:
        raise ScenarioError.of_argument("flights", args.flights, f"cannot be combined with `{excluded}`")
    require_extra("campaigns", "--flights needs")


def fly_dispersed(args: argparse.Namespace, plan: "Plan") -> "DispersedFlights | None":
    """Fly a plan N times for ``--flights N``, print and return the result; None without the option."""
    if args.flights is None:
        return None
    from planfly.campaigns.failure_counts import failure_lines, failures_document
    from planfly.campaigns.remedies import remedies
    from planfly.campaigns.summary import deciding_lines, undecided_lines
    from planfly.planning.expected_failures import HOLDING_PROBABILITY
    from planfly.terminal.answers import DispersedFlights, FailedPlace, FailedRule

    result = planfly.campaign(plan, flights=args.flights)
    summary, tally = result.summary, result.summary.estimate.tally
    # Changes that would raise the probability.
    remedy_texts = list(remedies(summary, plan.scenario))
    failed_by_rule = [
        FailedRule(**{**entry, "places": [FailedPlace(**place) for place in entry["places"]]})
        for entry in failures_document(summary.by_rule)
    ]
    low, high = result.interval
    holds = high >= HOLDING_PROBABILITY
    requirement_text = "" if holds else "; a probability of 0.95 is required"
    lines = [
        f"flights   the plan succeeds in {tally.flyable} of {tally.flown} flights with the default dispersions"
        f" (95 % interval of the probability: {low:.2f} to {high:.2f}){requirement_text}",
        *undecided_lines(summary),
        *failure_lines(summary.by_rule, summary.mission_fault),
        *deciding_lines(summary),
    ]
    lines += [f"  would help  {'; '.join(remedy_texts)}"] if remedy_texts else []
    print("\n".join(lines))
    return DispersedFlights(
        flights=tally.flown,
        flyable=tally.flyable,
        probability=tally.share,
        interval=[low, high],
        holds=holds,
        deciding_rule=next((entry.rule for entry in summary.deciding), ""),
        failed_by_rule=failed_by_rule,
        remedies=remedy_texts,
    )
