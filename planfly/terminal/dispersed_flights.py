"""Fly a finished plan with the default dispersions, and say in how many flights it holds (``--flights N``)."""

import argparse
from typing import TYPE_CHECKING

import planfly
from world.errors import ScenarioError
from world.extras import require_extra

if TYPE_CHECKING:
    from planfly import CampaignResult, Plan
    from planfly.terminal.answers import DispersedFlights


def check_flights_option(args: argparse.Namespace, excluded: str) -> None:
    """Raise an error, before anything is planned, if ``--flights`` cannot be flown.

    excluded: name of the option that cannot be combined with dispersed flights.
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
    from planfly.campaigns.remedies import remedies

    result = planfly.campaign(plan, flights=args.flights)
    answer = _dispersed_answer(result, remedies(result.summary, plan.scenario))
    print("\n".join(_dispersed_lines(result, answer)))
    return answer


def _dispersed_answer(result: "CampaignResult", remedy_texts: tuple[str, ...]) -> "DispersedFlights":
    """Return the answer of dispersed flights for --json.

    remedy_texts: texts on changes that would raise the probability.
    """
    from planfly.campaigns.failure_counts import failures_document
    from planfly.planning.expected_failures import HOLDING_PROBABILITY
    from planfly.terminal.answers import DispersedFlights, FailedPlace, FailedRule

    tally = result.summary.estimate.tally
    failed_by_rule = [
        FailedRule(**{**entry, "places": [FailedPlace(**place) for place in entry["places"]]})
        for entry in failures_document(result.summary.by_rule)
    ]
    return DispersedFlights(
        flights=tally.flown,
        flyable=tally.flyable,
        probability=tally.share,
        interval=list(result.interval),
        holds=result.interval.high >= HOLDING_PROBABILITY,
        deciding_rule=next((entry.rule for entry in result.summary.deciding), ""),
        failed_by_rule=failed_by_rule,
        remedies=list(remedy_texts),
    )


def _dispersed_lines(result: "CampaignResult", answer: "DispersedFlights") -> list[str]:
    """Return the answer of dispersed flights as lines for a terminal."""
    from planfly.campaigns.failure_counts import failure_lines
    from planfly.campaigns.summary import deciding_lines, undecided_lines

    low, high = answer.interval
    requirement_text = "" if answer.holds else "; a probability of 0.95 is required"
    lines = [
        f"flights   the plan succeeds in {answer.flyable} of {answer.flights} flights with the default dispersions"
        f" (95 % interval of the probability: {low:.2f} to {high:.2f}){requirement_text}",
        *undecided_lines(result.summary),
        *failure_lines(result.summary.by_rule, result.summary.mission_fault),
        *deciding_lines(result.summary),
    ]
    if answer.remedies:
        lines.append(f"  would help  {'; '.join(answer.remedies)}")
    return lines
