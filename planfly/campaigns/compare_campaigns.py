"""Compare two campaigns.

Compared are their probabilities, the rules that fail more often, and their inputs.
"""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

import numpy as np

from logs.verdict.rule_words import RULE_WORDS
from planfly.campaigns.campaign_inputs import difference_texts
from planfly.campaigns.dispersions import NAMES
from planfly.campaigns.flight_row import OUTCOMES, parse_failed_findings
from planfly.campaigns.statistics.decision import DEFAULT_CONFIDENCE, Estimator, Goal, Interval, Tally
from planfly.campaigns.statistics.proportions import ProportionDifference, independent_difference, paired_difference
from planfly.campaigns.tables import CAMPAIGN_DATABASE, StoreError, check_rows, read_stored_settings, read_table
from world.html_table import html_table
from world.wording import count_text


@dataclass(frozen=True, repr=False)
class ComparedCampaign:
    """One of two campaigns that are compared.

    name: its folder.
    tally: number of flights with each outcome.
    interval: two-sided interval of the probability of a flyable flight, at 95 % confidence.
    failed_by_rule: number of compared flights that failed each rule.  Compared flights are the pairs, or all flights if
        there are no pairs.
    """

    name: str
    tally: Tally
    interval: Interval
    failed_by_rule: dict[str, int] = field(hash=False)


@dataclass(frozen=True, repr=False)
class CampaignComparison:
    """Result of `planfly.compare_campaigns`.

    difference: probability of the second campaign minus that of the first, with an interval at 95 % confidence.
    pairs: number of flights with the same draws in both campaigns, by which the difference is estimated; 0 if the
        flights of the campaigns have other draws, so that they are independent samples.
    only_first, only_second: number of pairs that are flyable in one campaign only.
    inputs: options that differ, in sentences.
    notes: further remarks.
    """

    first: ComparedCampaign
    second: ComparedCampaign
    difference: ProportionDifference
    pairs: int
    only_first: int
    only_second: int
    inputs: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def answer(self) -> Literal["more likely", "less likely", "no difference shown"]:
        """Answer to "are flights of the second campaign more likely flyable?".

        It is "no difference shown" if the interval of the difference contains 0.
        """
        if self.difference.interval.low > 0.0:
            return "more likely"
        return "less likely" if self.difference.interval.high < 0.0 else "no difference shown"

    @property
    def rules(self) -> list[tuple[str, int, int]]:
        """Each failed rule, with the number of flights that failed it in either campaign.

        The largest change comes first.
        """
        first, second = self.first, self.second
        names = [name for name in RULE_WORDS if name in first.failed_by_rule or name in second.failed_by_rule]
        counts = [(name, first.failed_by_rule.get(name, 0), second.failed_by_rule.get(name, 0)) for name in names]
        first_count, second_count = self.compared_counts
        return sorted(counts, key=lambda entry: -abs(entry[2] / second_count - entry[1] / first_count))

    @property
    def compared_counts(self) -> tuple[int, int]:
        """Number of compared flights of each campaign: the pairs, or all flights if there are no pairs."""
        return (self.pairs or self.first.tally.flown, self.pairs or self.second.tally.flown)

    def __repr__(self) -> str:
        value, (low, high), _ = self.difference
        return f"<CampaignComparison {value:+.4f} ({low:+.4f} to {high:+.4f}); {self.answer}>"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook."""
        return html_table(comparison_lines(self)[0], self.rules, ("rule", self.first.name, self.second.name))


def campaign_table(path: Path) -> Path | None:
    """Return the table file of a campaign, given its folder or the file itself; None for any other path."""
    if path.is_dir():
        path /= CAMPAIGN_DATABASE
    return path if path.name == CAMPAIGN_DATABASE and path.is_file() else None


def compare_tables(first: Path, second: Path) -> CampaignComparison:
    """Compare the campaigns in two tables.

    Raises StoreError for a file that is not a campaign's table, for an empty or damaged table, and for a table that
    another process has locked.
    """
    for path in (first, second):
        check_rows(path)
    tables = [read_table(path) for path in (first, second)]
    settings = [read_stored_settings(path) for path in (first, second)]
    for path, table in zip((first, second), tables, strict=True):
        if not len(table["flight"]):
            raise StoreError(f"{path}: no flight of this campaign was flown", file=path)
    # Flights that both campaigns have are paired, unless the draws of any of them differ.
    _, *pairs = np.intersect1d(tables[0]["flight"], tables[1]["flight"], return_indices=True)
    if not all(np.array_equal(tables[0][name][pairs[0]], tables[1][name][pairs[1]]) for name in ("seed", *NAMES)):
        pairs = [np.empty(0, dtype=np.intp)] * 2
    flyable = np.column_stack([table["outcome"][rows] == "flyable" for table, rows in zip(tables, pairs, strict=True)])
    compared_rows = pairs if len(flyable) else [np.arange(len(table["flight"])) for table in tables]
    # Count each campaign's flights by outcome, and its compared flights by failed rule.
    campaigns = []
    for path, table, rows, setting in zip((first, second), tables, compared_rows, settings, strict=True):
        tally = Tally(*map(table["outcome"].tolist().count, OUTCOMES))
        goal = Goal(
            **{field.name: setting[field.name] for field in fields(Goal) if field.name in setting}
            | {"confidence": DEFAULT_CONFIDENCE}
        )
        failed_rules = [
            {rule for rule, _ in parse_failed_findings(text)}
            for text, outcome in zip(table["failed"][rows], table["outcome"][rows], strict=True)
            if outcome != "undecided"
        ]
        failed_by_rule = {
            name: count for name in RULE_WORDS if (count := sum(name in failed for failed in failed_rules))
        }
        interval = Estimator(goal).estimate(tally).interval
        campaigns.append(ComparedCampaign(str(path.parent), tally, interval, failed_by_rule))
    only_first = int(np.count_nonzero(flyable[:, 0] & ~flyable[:, 1]))
    only_second = int(np.count_nonzero(flyable[:, 1] & ~flyable[:, 0]))
    counts = [(campaign.tally.flyable, campaign.tally.flown) for campaign in campaigns]
    difference = (
        paired_difference(only_first, only_second, len(flyable), DEFAULT_CONFIDENCE)
        if len(flyable)
        else independent_difference(counts[0], counts[1], DEFAULT_CONFIDENCE)
    )
    # Remarks on the compared flights, and on assumptions of the interval that do not hold.
    notes, pair_count = list[str](), len(flyable)
    if pair_count and pair_count < max(len(table["flight"]) for table in tables):
        notes.append(
            f"the difference and the counts by rule compare only the {count_text(pair_count, 'flight')} that both"
            " campaigns have"
        )
    if undecided_count := sum(table["outcome"].tolist().count("undecided") for table in tables):
        notes.append(f"the difference counts {count_text(undecided_count, 'flight')} not judged in full as not flyable")
    if any(setting.get("stops") or setting.get("changed") for setting in settings):
        notes.append(
            "the number of flights of a campaign was not fixed beforehand, so the interval of the difference is only"
            " approximate"
        )
    inputs = (setting.get("inputs", {}) for setting in settings)
    return CampaignComparison(
        campaigns[0],
        campaigns[1],
        difference,
        len(flyable),
        only_first,
        only_second,
        tuple(difference_texts(*inputs)),
        (*notes, *_disagreement_notes(difference, is_paired=bool(len(flyable)))),
    )


def _disagreement_notes(difference: ProportionDifference, *, is_paired: bool) -> list[str]:
    """Return a remark if the exact test contradicts the interval of the difference; otherwise [].

    The interval decides the answer of a comparison.
    is_paired: True if the flights are paired, so that the test is McNemar's; otherwise it is Fisher's.

    >>> _disagreement_notes(ProportionDifference(0.1, Interval(0.02, 0.3), 0.04), is_paired=True)
    []
    """
    low, high = difference.interval
    excludes_zero, max_p_value = low > 0.0 or high < 0.0, 1.0 - DEFAULT_CONFIDENCE
    if excludes_zero == (difference.p_value <= max_p_value):
        return []
    test = f"{'McNemar' if is_paired else 'Fisher'}'s exact test"
    p_text = f"p = {difference.p_value:.2g}, limit {max_p_value:.2g}"
    texts = ("shows a difference", "shows none")
    interval_text, test_text = texts if excludes_zero else reversed(texts)
    return [f"the interval {interval_text}, but {test} {test_text} ({p_text}); the interval decides the answer"]


def comparison_lines(comparison: CampaignComparison) -> list[str]:
    """Return the lines of a comparison for a terminal: answer, both campaigns, rules, inputs and notes."""
    difference, (low, high), p_value = comparison.difference
    interval_name = f"{100.0 * DEFAULT_CONFIDENCE:g} % interval"
    answers = {
        "more likely": "flights of the second campaign are more likely to be flyable",
        "less likely": "flights of the second campaign are less likely to be flyable",
        "no difference shown": "the flights show no difference",
    }
    lines = [
        f"{answers[comparison.answer]}: the probability differs by {difference:+.4f}"
        f" ({interval_name}: {low:+.4f} to {high:+.4f})"
    ]
    for title, campaign in (("first ", comparison.first), ("second", comparison.second)):
        lines.append(
            f"  {title}  {campaign.name}: {campaign.tally.flyable} of {count_text(campaign.tally.flown, 'flight')}"
            f" flyable, probability {campaign.tally.share:.4f} ({interval_name}: {campaign.interval.low:.4f} to"
            f" {campaign.interval.high:.4f})"
        )
    lines.append(
        f"  paired  {count_text(comparison.pairs, 'pair')} of flights with the same draws:"
        f" {comparison.only_first} flyable"
        f" only in the first campaign, {comparison.only_second} only in the second (McNemar's exact test:"
        f" p = {p_value:.2g})"
        if comparison.pairs
        else f"  paired  no: the draws of the campaigns differ (Fisher's exact test: p = {p_value:.2g}). Campaigns with"
        " the same --seed and --spread are compared in pairs, which shows smaller differences"
    )
    # Change of the percentage of flights that failed each rule.
    first_count, second_count = comparison.compared_counts
    for rule, first, second in comparison.rules:
        change = 100.0 * (second / second_count - first / first_count)
        word = "more often" if change > 0.0 else "less often" if change < 0.0 else "as often"
        lines.append(
            f"  fails   {RULE_WORDS[rule].title} {word} in the second campaign: {second} of {second_count} flights, and"
            f" {first} of {first_count} in the first ({change:+.1f} percentage points)"
        )
    lines += [f"  differs {text}" for text in comparison.inputs] or ["  differs no input; planfly's code may differ"]
    return [*lines, *(f"  note    {note}" for note in comparison.notes)]
