"""A verdict as lines for a terminal."""

from collections.abc import Iterable

from logs.verdict.findings import Finding, Verdict, closest_to_limit, left_open
from logs.verdict.rule import Rule
from logs.verdict.rules.registry import RULES
from logs.verdict.summary import failed_by_rule
from logs.verdict.wording import place_text, quantity_text, suggestions_text
from planfly.terminal.command_parser import coloured

# Findings of a rule that are named, beside the worst of those that fail.
_LISTED = 6
# Sources of a limit that are named beside it; any other limit is a check of planfly's own.
_LIMIT_SOURCES = ("scenario", "near the field", "aircraft", "autopilot", "mission")
# Width of the column of rules.
_TITLES = 2 + max(len(rule.title) for rule in RULES.values())


def verdict_lines(verdict: Verdict, notes: Iterable[str]) -> list[str]:
    """The summary, then what fails, then what is closest to each rule's limit, then notes, in colour where wanted."""
    first, *rest = verdict.lines or ("",)
    lines = [coloured(first, "good" if verdict.flyable else "bad"), *rest]
    for group in failed_by_rule(verdict.findings):
        judged = sum(finding.rule == group[0].rule and finding.ok is not None for finding in verdict.findings)
        lines += _failed_lines(group, judged)
    still_open = left_open(verdict.findings)
    lines += [f"  open    {_noun(one)} at {place_text(one.place)}: {one.reason}" for one in still_open[: 2 * _LISTED]]
    # The same flight tells of them all.
    telling = dict.fromkeys(suggestions_text(one.suggestions) for one in still_open if one.suggestions)
    lines += [coloured("          would tell: ", "hint") + text for text in telling]
    for rule in RULES.values():
        mine = [finding for finding in verdict.findings if finding.rule == rule.name]
        if mine:
            zones = 0 if verdict.conditions is None else verdict.conditions.zones
            count = f"{zones:,} zones; " if rule.name == "fence" and zones > 1 else ""
            lines.append(f"  {rule.title:<{_TITLES}}{count}{_state(rule, mine)}")
    return [*lines, *(f"  note    {note}" for note in notes)]


def _failed_lines(group: list[Finding], judged: int) -> list[str]:
    """What fails by one rule: the worst in full with what would pass, and where else.

    group: the worst first.  judged: how many findings of the rule are.
    """
    worst, *others = group
    where = f"{_noun(worst)} at {place_text(worst.place)}"
    many = f"{_noun(worst)}, {len(group)} of {judged}; the worst at {place_text(worst.place)}"
    lines = [coloured("  failed  ", "bad") + f"{many if others else where}: {worst.reason}"]
    if worst.suggestions:
        lines.append(coloured("          would pass: ", "hint") + suggestions_text(worst.suggestions))
    if others:
        named = "; ".join(map(_in_short, others[:_LISTED]))
        more = f"; {len(others) - _LISTED} more" if len(others) > _LISTED else ""
        lines.append(f"          also at {named}{more}")
    return lines


def _in_short(finding: Finding) -> str:
    """Where a finding fails, and by how much."""
    value = finding.planned if finding.flown is None else finding.flown
    by = "" if value is None else f" ({quantity_text(value, finding.unit)})"
    return place_text(finding.place) + by


def _noun(finding: Finding) -> str:
    return RULES[finding.rule].word


def _state(rule: Rule, findings: list[Finding]) -> str:
    """How the findings of a rule stand, and the one closest to its limit."""
    failed = sum(finding.ok is False for finding in findings)
    unknown = [finding for finding in findings if finding.ok is None]
    judged = len(findings) - len(unknown)
    if not judged:
        return f"{'warning' if rule.warns else 'not judged'}: {unknown[0].reason}"
    text = f"{judged - failed} of {judged} ok"
    closest = closest_to_limit(findings)
    if closest is None or closest.margin is None or rule.margin is None:
        return text
    value = closest.planned if closest.flown is None else closest.flown
    if value is None or closest.limit is None:
        return text
    how = "furthest beyond its limit" if closest.ok is False else "closest to its limit"
    where = "" if closest.place.kind == "flight" else f"{how} at {place_text(closest.place)}: "
    limit = quantity_text(closest.limit, closest.unit)
    whose = f", {closest.limit_source}" if closest.limit_source in _LIMIT_SOURCES else ""
    return f"{text}; {where}{rule.margin.of} {quantity_text(value, closest.unit)} (limit {limit}{whose})"
