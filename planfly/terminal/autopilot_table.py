"""Print the verdicts on one mission flown by several autopilots in a table with one column for each."""

from collections.abc import Mapping

from logs.verdict.conditions import flown_lines
from logs.verdict.presentation import RuleFindings, findings_by_rule
from logs.verdict.verdict import Verdict
from planfly.terminal.command_parser import STATE_STYLES, colour_text

# Space between two columns.
_GAP = "  "


def autopilot_lines(verdicts: Mapping[str, Verdict]) -> list[str]:
    """Return the lines of a table of verdicts, followed by the main lines of each verdict.

    The table has a row for each rule and a column for each autopilot.

    verdicts: verdict for each autopilot, keyed by name, in the order of the columns.

    >>> flies = Verdict((), flyable=True, complete=True, lines=("flyable",), level="flown")
    >>> fails = Verdict((), flyable=False, complete=True, lines=("not flyable: speed", "NAV_ACC_RAD 10"), level="flown")
    >>> for line in autopilot_lines({"ardupilot": flies, "px4": fails}):
    ...     print(line)
               ardupilot  px4
      verdict  flyable    not flyable
    ardupilot: flyable
    px4: not flyable: speed; NAV_ACC_RAD 10
    """
    rows = [("", *verdicts), ("verdict", *(_verdict_result_text(verdict) for verdict in verdicts.values()))]
    # Keyed by title: photo lines and their overlap are shown apart, and have the rule "survey" in common.
    rules_by_title = [{rule.words.title: rule for rule in verdict.present().rules} for verdict in verdicts.values()]
    all_findings = [finding for verdict in verdicts.values() for finding in verdict.findings]
    rows += [
        (title, *(_rule_summary(rules.get(title)) for rules in rules_by_title))
        for title in [rule.words.title for rule in findings_by_rule(all_findings)]
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for title, *cells in rows:
        padded = [f"{cell:<{width}}" for cell, width in zip(cells, widths[1:], strict=True)]
        lines.append(f"  {title:<{widths[0]}}{_GAP}{_GAP.join(padded)}".rstrip())
    for name, verdict in verdicts.items():
        first, *other_lines = verdict.lines or ("",)
        # If another parameter value passes, the second line of the verdict names that value.
        remedy = f"; {other_lines[0]}" if other_lines and not verdict.flyable else ""
        lines.append(f"{name}: " + colour_text(first, STATE_STYLES[verdict.state]) + remedy)
        if verdict.conditions is not None:
            condition_texts = flown_lines(verdict.conditions)
            lines += [f"  {line}" for line in condition_texts]
    return lines


def _verdict_result_text(verdict: Verdict) -> str:
    """Return the result of a verdict as a short text for a cell of the table, such as "not flyable"."""
    if verdict.undecided:
        return verdict.answer
    return "flyable" if verdict.flyable else "not flyable"


def _rule_summary(rule: RuleFindings | None) -> str:
    """Return a text for a cell: how many findings of a rule failed or passed.

    Returns "" if the rule has no findings.
    """
    if rule is None or not rule.judged:
        return "not judged" if rule else ""
    return f"{len(rule.failed)} of {rule.judged} failed" if rule.failed else f"{rule.judged} ok"
