"""Summarise a campaign as data.

The data are its probability, failures by place, deciding quantities, and worst flights.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from logs.verdict.conditions import Conditions, flown_condition_lines
from logs.verdict.junit import JunitCase, JunitSuite
from logs.verdict.measures.mission_ends import missing_home_text
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.rules.mission_rule import mission_findings
from logs.verdict.wording import place_text, quantity_text
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import QUANTITY_BY_NAME
from planfly.campaigns.failure_counts import (
    RuleFailures,
    count_failures,
    deciding_rules,
    failure_lines,
    failures_document,
)
from planfly.campaigns.flight_row import MARGIN_SCALES, FlightRow, scale_margin
from planfly.campaigns.statistics.decision import (
    MAX_DECIDING_FLIGHTS,
    MIN_FLIGHTS_FOR_INDEX,
    Estimate,
    Estimator,
    Goal,
    Tally,
    dependence_p_value,
    first_order_index,
    rank_slope,
)
from planfly.campaigns.tables import Store
from world.arrays import Floats
from world.wording import count_text

# Schema of ``summary.json``.
SUMMARY_SCHEMA = "planfly.campaign-summary/1"
# Minimum share of a margin's variance that a quantity must explain to be named.
_MIN_NAMED_FRACTION = 0.05
# Maximum probability that chance alone makes a campaign name any quantity.
_MAX_CHANCE = 0.05
# Maximum number of quantities that the line of a terminal names.
_MAX_NAMED_QUANTITIES = 3
# Number of worst flights that the summary lists.
WORST_FLIGHT_COUNT = 10
# Number of worst flights with a log.  A log takes as long as the flight itself, and `--refly` writes any other log.
LOGGED_FLIGHT_COUNT = 3


@dataclass(frozen=True)
class Sensitivity:
    """Dependence of a rule's minimum margin on a quantity.

    index: first-order index: fraction of the margin's variance that the quantity explains, 0 to 1.
    slope: rank correlation, negative if an increase of the quantity reduces the margin.
    p_value: probability of a dependence at least as strong by chance, see `dependence_p_value`.
    """

    quantity: str
    index: float
    slope: float
    p_value: float

    @property
    def title(self) -> str:
        """Name of the quantity in texts.

        >>> Sensitivity("ident/lift-slope", 0.1, 0.2, 0.5).title
        "the aircraft's lift slope"
        """
        quantity = QUANTITY_BY_NAME.get(self.quantity)
        if quantity is not None:
            return quantity.title
        return f"the aircraft's {self.quantity.rpartition('/')[2].replace('-', ' ')}"


@dataclass(frozen=True)
class RankedRule:
    """Rule in a campaign's ranking of rules by how close the flights came to failing them.

    failed: number of flights that failed the rule.
    lowest: smallest margin of all flights, in `unit`; None if no flight has a margin, or if a flight failed by an
        unknown margin that may be smaller.
    low_margin: 5 % quantile of the margin, in `unit`; None if it is unknown.
    """

    rule: str
    failed: int
    lowest: float | None
    low_margin: float | None
    unit: str

    @property
    def is_narrow_pass(self) -> bool:
        """True if no flight failed the rule, but at least one passed it by less than the rule's scale."""
        scale = MARGIN_SCALES[self.rule]
        return not self.failed and self.lowest is not None and scale is not None and self.lowest < scale


@dataclass(frozen=True)
class DecidingRule:
    """Rule that decides a campaign, and the quantities on which its margin depends.

    low_margin: 5 % quantile of its margin, in `unit`; None if it is unknown, for example because 5 % of the flights
        failed by an unknown margin.
    sensitivities: dependence of its margin on each varying quantity, the strongest first.
    """

    rule: str
    low_margin: float | None
    unit: str
    sensitivities: tuple[Sensitivity, ...]

    @property
    def drivers(self) -> tuple[Sensitivity, ...]:
        """Quantities that significantly explain the margin, the strongest first.

        The probability that any quantity is included by chance alone is at most `_MAX_CHANCE` (Bonferroni).
        """
        max_p_value = _MAX_CHANCE / max(1, len(self.sensitivities))
        return tuple(
            sensitivity
            for sensitivity in self.sensitivities
            if sensitivity.index >= _MIN_NAMED_FRACTION and sensitivity.p_value <= max_p_value
        )


@dataclass(frozen=True, repr=False)
class CampaignSummary:
    """Contents of the summary and the report.

    deciding: rules that the most flights failed (ties included), the most urgent first.  If no flight failed a rule, it
        is the rule with the smallest reliability index: the mean of its margins divided by their standard deviation
        (Cornell, "A probability-based structural code", ACI Journal 66, 1969).  () if no margin is known.
    conditions: nominal conditions of the flights: aircraft, weather, world and autopilot.
    deciding_flights: number of flights that would decide the target with the same fraction of flyable flights; None if
    the target is decided, or for more than `MAX_DECIDING_FLIGHTS`.
    unjudged_return: reason why the return after the last item is not judged in any flight; "" if it is judged.
    ranking: rules that flights failed, the most flights first, then all others with a margin, the closest first.
    undecided_text: rules not judged in the first undecided flight, with their reasons; "" if no flight is undecided.
    mission_fault: reason why the mission fails as a whole in nominal conditions; "" if it does not.
    """

    name: str
    seed: int
    goal: Goal
    estimate: Estimate
    by_rule: tuple[RuleFailures, ...]
    lost: tuple[int, ...]
    deciding: tuple[DecidingRule, ...]
    ranking: tuple[RankedRule, ...]
    worst: tuple[FlightRow, ...]
    dispersions: dict[str, dict[str, Any]] = field(hash=False)
    made_of: str
    conditions: Conditions
    deciding_flights: int | None = None
    unjudged_return: str = ""
    undecided_text: str = ""
    mission_fault: str = ""

    def __repr__(self) -> str:
        tally = self.estimate.tally
        return f"<CampaignSummary {self.name}: {_flyable_text(tally)}>"


def summarise_campaign(base: CampaignBase, goal: Goal, estimate: Estimate, store: Store) -> CampaignSummary:
    """Summarise the flights in a campaign's table: failures, margins and the worst flights.

    base: the campaign's conditions; without dispersions, they show the faults of the mission itself.
    estimate: the estimate from all flights of the table.
    """
    by_rule = count_failures(store.failures())
    worst_rows = tuple(store.worst_flights(WORST_FLIGHT_COUNT))
    # Margin of each flight by rule: NaN if the rule was not judged, -inf if the flight failed the rule by an
    # unknown margin.
    failed_rules = [{rule for rule, _ in failures} for failures in store.failures()]
    margins = {}
    for rule, words in RULE_WORDS.items():
        has_failed = np.array([rule in failed for failed in failed_rules], dtype=bool)
        known_margins = store.column(words.margin_column)
        margins[rule] = np.where(has_failed & ~(known_margins < 0.0), -np.inf, known_margins)
    # The rules that the most flights failed (ties included) decide the campaign.  Without failures, it is the rule with
    # the smallest ratio of mean margin to standard deviation, if any margin is known.
    rules_that_decide = deciding_rules(by_rule)
    if not by_rule:
        reliability_indices = {}
        for rule, rule_margins in margins.items():
            known_margins = rule_margins[np.isfinite(rule_margins)]
            if known_margins.size:
                deviation = float(known_margins.std())
                reliability_indices[rule] = float(known_margins.mean()) / deviation if deviation > 0.0 else math.inf
        rules_that_decide = tuple(sorted(reliability_indices, key=lambda name: reliability_indices[name])[:1])
    is_undecided = estimate.answer == "undecided" and estimate.tally.flown > 0
    # Reason why the mission fails as a whole in nominal conditions.
    mission_fault = ""
    if any(failures.rule == "mission" for failures in by_rule):
        findings = mission_findings(base.nominal_setup())
        reasons = (finding.reason for finding in findings if finding.ok is False and finding.place.item is None)
        mission_fault = next(reasons, "")
    return CampaignSummary(
        name=base.name,
        seed=base.seed,
        goal=goal,
        estimate=estimate,
        by_rule=by_rule,
        lost=tuple(index for index, outcome in store.outcomes().items() if outcome == "lost"),
        deciding=tuple(
            DecidingRule(
                rule,
                _margin_quantile(margins[rule]),
                _margin_unit(store, rule),
                _rule_sensitivities(base, store, margins[rule]),
            )
            for rule in rules_that_decide
        ),
        ranking=_rank_rules(store, margins, by_rule),
        worst=worst_rows,
        dispersions=base.dispersions.to_json(),
        made_of=store.made_of,
        conditions=base.conditions(),
        deciding_flights=Estimator(goal).deciding_flights(estimate.tally) if is_undecided else None,
        unjudged_return=missing_home_text(base.nominal_setup()),
        undecided_text=next(filter(None, store.texts("undecided_text")), ""),
        mission_fault=mission_fault,
    )


def _margin_quantile(margins: Floats) -> float | None:
    """Return the 5 % quantile of a rule's margins; None without a margin, or if the quantile is infinite.

    >>> _margin_quantile(np.array([-np.inf, *np.linspace(0.0, 2.0, 10)])) is None
    True
    >>> _margin_quantile(np.array([np.nan, *np.linspace(0.0, 2.0, 21)]))
    0.1
    """
    judged_margins = margins[~np.isnan(margins)]
    if not judged_margins.size:
        return None
    # An interpolation with -inf is NaN.
    with np.errstate(invalid="ignore"):
        quantile = float(np.quantile(judged_margins, 0.05))
    return quantile if math.isfinite(quantile) else None


def _rank_rules(
    store: Store, margins: Mapping[str, Floats], by_rule: tuple[RuleFailures, ...]
) -> tuple[RankedRule, ...]:
    """Return the rules in their ranking: the rule that the flights came closest to failing is first.

    Rules that flights failed come first, the most flights first; they are included even without a margin.

    margins: margin of each flight, (n,), for each rule: NaN if not judged, -inf if failed by an unknown margin.
    by_rule: failures by rule and place.
    """
    failed_counts = {failures.rule: failures.flights for failures in by_rule}
    ranked = []
    for rule, rule_margins in margins.items():
        known_margins = rule_margins[np.isfinite(rule_margins)]
        if known_margins.size or rule in failed_counts:
            lowest = float(known_margins.min()) if known_margins.size else None
            if lowest is not None and lowest >= 0.0 and np.isneginf(rule_margins).any():
                # A flight that failed by an unknown margin has a smaller one.
                lowest = None
            failed_count, scale = failed_counts.get(rule, 0), MARGIN_SCALES[rule]
            order = (-failed_count, math.inf if lowest is None or scale is None else lowest / scale)
            low_margin, unit = _margin_quantile(rule_margins), _margin_unit(store, rule)
            ranked.append((order, RankedRule(rule, failed_count, lowest, low_margin, unit)))
    return tuple(entry for _, entry in sorted(ranked, key=lambda item: item[0]))


def _margin_unit(store: Store, rule: str) -> str:
    """Return the unit of a rule's margins.

    It is taken from the first flight that has a margin, or else it is the rule's usual unit.
    """
    words = RULE_WORDS[rule]
    place_json = store.first_text(words.place_column)
    if place_json is not None:
        return str(json.loads(place_json)["unit"])
    return "" if words.margin is None else words.margin.unit


def _rule_sensitivities(base: CampaignBase, store: Store, margins: Floats) -> tuple[Sensitivity, ...]:
    """Return the sensitivity of a rule's minimum margin to each varying quantity, the strongest first.

    A failed flight with an unknown margin gets the smallest known margin, but at most zero.  The result is empty for
    fewer than `MIN_FLIGHTS_FOR_INDEX` flights with a margin.

    margins: margin of each flight, (n,): NaN if not judged, -inf if the flight failed by an unknown margin.
    """
    is_judged = ~np.isnan(margins)
    if np.count_nonzero(is_judged) < MIN_FLIGHTS_FOR_INDEX:
        return ()
    lower_limit = min(0.0, float(np.min(margins[np.isfinite(margins)], initial=0.0)))
    margin = np.maximum(margins[is_judged], lower_limit)
    sensitivities = []
    drawn_values = {varying.quantity.name: store.column(varying.quantity.name) for varying in base.dispersions.varying}
    draws = base.dispersions.draws
    if draws is not None:
        # As texts, because the seeds have more digits than a float.
        rows = [draws.row(int(seed)) for seed in store.texts("seed")]
        drawn_values |= dict(zip(draws.names, draws.values[rows].T, strict=True))
    for name, all_values in drawn_values.items():
        values = all_values[is_judged]
        index = first_order_index(values, margin)
        p_value = dependence_p_value(values, margin)
        sensitivities.append(Sensitivity(name, index, rank_slope(values, margin), p_value))
    return tuple(sorted(sensitivities, key=lambda sensitivity: -sensitivity.index))


def summary_json(summary: CampaignSummary) -> str:
    """Return the text of ``summary.json``.

    Computing times and the number of workers are left out, so that the text is the same for any number of workers.
    """
    estimate = summary.estimate
    deciding = [
        {
            "deciding_rule": entry.rule,
            "margin_of_one_in_twenty": _to_plain_number(entry.low_margin),
            "margin_unit": entry.unit,
            "sensitivities": [
                {
                    "quantity": sensitivity.quantity,
                    "first_order": _to_plain_number(sensitivity.index),
                    "rank_slope": _to_plain_number(sensitivity.slope),
                    "p_value": _to_plain_number(sensitivity.p_value),
                    "shown": sensitivity in entry.drivers,
                }
                for sensitivity in entry.sensitivities
            ],
        }
        for entry in summary.deciding
    ]
    undefined: dict[str, Any] = {
        "deciding_rule": "",
        "margin_of_one_in_twenty": None,
        "margin_unit": "",
        "sensitivities": [],
    }
    data = {
        "schema": SUMMARY_SCHEMA,
        "name": summary.name,
        "seed": summary.seed,
        "target": summary.goal.target,
        "answer": estimate.answer,
        "deciding_flights": summary.deciding_flights,
        "unjudged_return": summary.unjudged_return,
        "flights": estimate.tally.flown,
        "flyable": estimate.tally.flyable,
        "not_flyable": estimate.tally.failed,
        "undecided": estimate.tally.undecided,
        "not_judged": summary.undecided_text,
        "lost": list(summary.lost),
        "probability": _to_plain_number(estimate.tally.share),
        "confidence": summary.goal.confidence,
        "lower_bound": _to_plain_number(estimate.lower),
        "upper_bound": _to_plain_number(estimate.upper),
        "interval": [_to_plain_number(estimate.interval.low), _to_plain_number(estimate.interval.high)],
        "method": summary.goal.bound_method,
        "failed_by_rule": failures_document(summary.by_rule),
        **(deciding[0] if deciding else undefined),
        "tied_rules": deciding[1:],
        "closest_rules": [
            {
                "rule": entry.rule,
                "failed": entry.failed,
                "smallest_margin": _to_plain_number(entry.lowest),
                "margin_of_one_in_twenty": _to_plain_number(entry.low_margin),
                "unit": entry.unit,
            }
            for entry in summary.ranking
        ],
        "worst": [
            _flight_data(row, log) for row, log in zip(summary.worst, worst_flight_logs(summary.worst), strict=True)
        ],
        "spread": summary.dispersions,
        "conditions": asdict(summary.conditions),
        "made_of": summary.made_of,
    }
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def _flight_data(row: FlightRow, log: str) -> dict[str, Any]:
    """Return the row of a flight as data for ``summary.json``.

    log: path of the flight's log, or "" for a flight without a log.
    """
    return {
        "flight": row.draw.index,
        "outcome": row.outcome,
        "ended": row.ended,
        "failed": [{"rule": rule, "where": place_text(place)} for rule, place in row.failures],
        "not_judged": row.undecided_text,
        "closest": closest_text(row),
        "drawn": {name: _to_plain_number(value) for name, value in row.draw.values.items() if name in QUANTITY_BY_NAME},
        "seed": row.draw.seed,
        "log": log or None,
    }


def closest_text(row: FlightRow) -> str:
    """Return the minimum margin of a flight with its rule and place as text; "" if no margin is known.

    If a rule failed, the text is on this rule, even if it has no margin.
    """
    scaled_margins = [
        (fraction, rule, margin) for rule, margin in row.margins if (fraction := scale_margin(rule, margin)) is not None
    ]
    failed_rules = {rule for rule, _ in row.failures}
    for rule, place in row.failures:
        if rule not in {known_rule for _, known_rule, _ in scaled_margins}:
            return f"{RULE_WORDS[rule].title} failed at {place_text(place)} by an unknown margin"
    if not scaled_margins:
        return ""
    _, rule, margin = min(scaled_margins, key=lambda entry: (entry[1] not in failed_rules, entry[0]))
    return f"{RULE_WORDS[rule].title} at {place_text(margin.place)}: {margin.value or 0.0:+.1f} {margin.unit}"


def worst_flight_logs(worst: Sequence[FlightRow]) -> list[str]:
    """Return the path of each worst flight's log, relative to the campaign's folder.

    Only the first `LOGGED_FLIGHT_COUNT` flights that flew at all have a log; the path is "" for the others.
    """
    logged_indices = [row.draw.index for row in worst if row.duration > 0.0][:LOGGED_FLIGHT_COUNT]
    return [f"worst/flight-{row.draw.index:06d}.mcap" if row.draw.index in logged_indices else "" for row in worst]


def campaign_lines(summary: CampaignSummary) -> list[str]:
    """Return the lines of the summary for a terminal."""
    estimate, goal = summary.estimate, summary.goal
    tally, confidence_text = estimate.tally, f"{100.0 * goal.confidence:g} %"
    share_text = (
        f"a share of {tally.share:.4f}"
        if not tally.undecided
        else f"a share of {tally.share:.4f} to {(tally.flyable + tally.undecided) / tally.flown:.4f}"
    )
    # Number of flights that would decide an undecided target.
    deciding_flights_lines = []
    if estimate.answer == "undecided":
        unjudged_text = " and unjudged" if tally.undecided else ""
        shares_text = f"the same fraction{'s' if tally.undecided else ''} of flyable{unjudged_text}"
        flights = summary.deciding_flights
        if flights is None:
            flights_text = f"more than {MAX_DECIDING_FLIGHTS:,} flights with {shares_text} flights"
        elif tally.share == 1.0:
            flights_text = f"{flights:,} flights without a failure"
        else:
            flights_text = f"about {flights:,} flights with {shares_text} flights"
        deciding_flights_lines.append(f"  {flights_text} would decide the target")
    target = goal.target
    texts = {
        "reached": f"the probability of a flyable flight is at least {target}",
        "missed": f"the probability of a flyable flight is below {target}",
        "undecided": f"it is undecided whether the probability of a flyable flight is at least {target}",
    }
    varied = [QUANTITY_BY_NAME[name].title if name in QUANTITY_BY_NAME else name for name in summary.dispersions]
    constant = [quantity.title for name, quantity in QUANTITY_BY_NAME.items() if name not in summary.dispersions]
    answer_text = texts.get(estimate.answer, "no target is set (--prove P or --at-least P)")
    lines = [
        f"{answer_text}: {_flyable_text(tally)}, {share_text}"
        + ("; return not judged" if summary.unjudged_return else ""),
        f"  probability at least {estimate.lower:.4f} and at most {estimate.upper:.4f} (each with {confidence_text}"
        f" confidence; {goal.bound_method})",
        f"  two-sided {confidence_text} interval of the probability: {estimate.interval.low:.4f} to"
        f" {estimate.interval.high:.4f}",
        *deciding_flights_lines,
        *(f"  {line}" for line in flown_condition_lines(summary.conditions)),
        f"  Varied around these conditions: {', '.join(varied) or 'nothing'}; the same in every flight:"
        f" {', '.join(constant) or 'nothing else'}",
        *([f"  Not judged: return ({summary.unjudged_return})"] if summary.unjudged_return else []),
        *undecided_lines(summary),
    ]
    lines += failure_lines(summary.by_rule, summary.mission_fault)
    lines += [
        f"  narrow  {RULE_WORDS[entry.rule].title}: the smallest margin of all flights, including the"
        f" tolerance, is {entry.lowest or 0.0:+.1f} {entry.unit}"
        for entry in summary.ranking
        if entry.is_narrow_pass
    ]
    if summary.lost:
        lost_text = ", ".join(map(str, summary.lost[:10]))
        lines.append(
            f"  lost    {count_text(len(summary.lost), 'flight')} could not be flown, because their"
            f" workers died (numbers {lost_text})"
        )
    return lines + deciding_lines(summary)


def undecided_lines(summary: CampaignSummary) -> list[str]:
    """Return a line with the number of undecided flights and the first reason.

    Return [] without undecided flights.
    """
    tally = summary.estimate.tally
    if not tally.undecided:
        return []
    flights_text = f"{tally.undecided} of {count_text(tally.flown, 'flight')}"
    return [f"  Not judged in full: {flights_text}; the first for this reason: {summary.undecided_text}"]


def deciding_lines(summary: CampaignSummary) -> list[str]:
    """Return a line on each deciding rule: its margin and the quantities that explain it.

    Return [] without deciding rules.
    """
    choice_text = (
        "" if summary.by_rule else "no flight fails, and this margin is the smallest relative to its scatter. "
    )
    lines = []
    for entry in summary.deciding:
        if entry.low_margin is not None:
            margin_words = f"5 % of the flights have a margin below {quantity_text(entry.low_margin, entry.unit)}"
        else:
            failed_count = next(failures.flights for failures in summary.by_rule if failures.rule == entry.rule)
            flights_text = count_text(summary.estimate.tally.flown, "flight")
            verb = "fails" if failed_count == 1 else "fail"
            margin_words = f"{failed_count} of {flights_text} {verb} this rule, by an unknown margin"
        if not entry.sensitivities:
            causes = f"At least {MIN_FLIGHTS_FOR_INDEX} judged flights are needed to find what the margin depends on"
        elif not entry.drivers:
            causes = "None of the varied quantities has a significant effect on this margin"
        else:
            causes = "Causes of the margin's variance: " + ", ".join(
                f"{sensitivity.title} ({100.0 * sensitivity.index:.0f} %)"
                for sensitivity in entry.drivers[:_MAX_NAMED_QUANTITIES]
            )
        lines.append(f"  decides {RULE_WORDS[entry.rule].title}: {choice_text}{margin_words}. {causes}")
    return lines


def campaign_suite(name: str, summary: CampaignSummary) -> JunitSuite:
    """Return the JUnit suite of a campaign.

    It has a test case for its target, and one for each rule that a flight failed.

    name: mission of the campaign.

    All cases are skipped without a target, and fail if the target is missed or undecided.  If the target is reached,
    all cases pass, and the cases of rules contain their failures as text.
    """
    answer, lines = summary.estimate.answer, campaign_lines(summary)
    result: Literal["passed", "failure", "skipped"] = (
        "passed" if answer == "reached" else "skipped" if answer == "no target" else "failure"
    )
    cases = [JunitCase("planfly", "verdict", result, lines[0])]
    for failures in summary.by_rule:
        text = f"{failures.flights} of {count_text(summary.estimate.tally.flown, 'flight')} failed"
        (line,) = failure_lines([failures], summary.mission_fault)
        cases.append(JunitCase(f"planfly.{failures.rule}", "flights", result, text, line.strip()))
    return JunitSuite(name, cases, "\n".join(lines))


def _flyable_text(tally: Tally) -> str:
    """Return the number of flyable flights as text, such as "1 of 4 flights is flyable"."""
    text = f"{tally.flyable} of {count_text(tally.flown, 'flight')} {'is' if tally.flyable == 1 else 'are'} flyable"
    return f"{text}, {tally.undecided} not judged in full" if tally.undecided else text


def _to_plain_number(value: float | None) -> float | None:
    """Round a number to 9 decimals for a JSON document; return None for None, NaN and infinity.

    A negative zero becomes 0.
    """
    return None if value is None or not math.isfinite(value) else round(float(value), 9) + 0.0
