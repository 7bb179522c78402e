"""Format a verdict, or the verdicts for several autopilots, as lines for a terminal."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import autopilot_line, condition_lines
from logs.verdict.findings import Finding
from logs.verdict.presentation import finding_heading, findings_by_rule
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.verdict import Verdict
from planfly.terminal.command_parser import STATE_STYLES, colour_text
from planfly.workflow.suggestion_trials import has_geometric_suggestion

if TYPE_CHECKING:
    from planfly.workflow.pipeline import ReturnSummary

# Maximum number of failed findings of a rule that are listed after the worst finding.
_MAX_LISTED = 6
# Maximum number of failed findings of a rule whose suggestions are stated.
_MAX_SUGGESTED = 5
# Width of the column of rules, characters.
_TITLE_WIDTH = 2 + max(len(rule.title) for rule in RULE_WORDS.values())


def verdict_lines(
    verdict: Verdict,
    notes: Iterable[str],
    setup: FlightSetup | None = None,
    returns: "ReturnSummary | None" = None,
) -> list[str]:
    """Return the lines of a verdict for a terminal.

    They are the summary, the failures, the finding closest to its limit for each rule, the notes, and the returns.

    setup: setup of the judged flight, used to look for suggestions on its planned route; None without a flight.
    returns: returns from a few points of the flight.  Unsafe returns of a flyable mission follow the first line.
    """
    lines = [colour_text(verdict.headline, STATE_STYLES[verdict.state]), *verdict.details]
    for rule in verdict.failed_rules:
        # The worst finding, the suggestions of the rule's findings, and the other failed places.
        worst_finding, *other_findings = rule.failed
        lines.append(colour_text("  failed  ", "bad") + f"{rule.failure_heading}: {worst_finding.reason}")
        # The first finding with each suggestion: several findings may have the same one.
        helped_findings: dict[str, Finding] = {}
        for finding in rule.failed:
            if finding.suggestions:
                helped_findings.setdefault(finding.suggestion, finding)
        for suggestion, finding in list(helped_findings.items())[:_MAX_SUGGESTED]:
            place_text = "" if finding is worst_finding else f"at {finding.where}: "
            lines.append(colour_text("          would pass: ", "hint") + place_text + suggestion)
        if len(helped_findings) > _MAX_SUGGESTED:
            lines.append(f"          would pass: and {len(helped_findings) - _MAX_SUGGESTED} more, in --json")
        if not helped_findings and worst_finding.rule == "return" and worst_finding.limit_source == "scenario":
            lines.append(colour_text("          would help: ", "hint") + "planfly returns --suggest looks for a remedy")
        if other_findings:
            other_places = "; ".join(finding.place_and_value for finding in other_findings[:_MAX_LISTED])
            more_text = f"; {len(other_findings) - _MAX_LISTED} more" if len(other_findings) > _MAX_LISTED else ""
            lines.append(f"          also at {other_places}{more_text}")
    # State that no change passed its trial, unless a finding has a suggestion or a line names the parameter that
    # decides.  Findings on returns state their own remedy.  After a failed flight, this is stated only if the planned
    # route fails, too.
    is_judged = verdict.level in ("geometric", "flown") and not verdict.imported
    has_suggestion = verdict.deciding is not None or any(finding.suggestions for finding in verdict.failed)
    has_hint = has_suggestion or all(finding.rule == "return" for finding in verdict.failed)
    no_change_text = ""
    if is_judged and not has_hint and verdict.level == "geometric":
        no_change_text = "no change was found with which it would pass"
    elif is_judged and not has_hint:
        geometry = next((level for level in verdict.levels if level.name == "geometry"), None)
        if geometry is not None and not geometry.flyable and not geometry.undecided:
            no_change_text = "no change was found with which a simulated flight would pass"
            if setup is not None and has_geometric_suggestion(setup):
                no_change_text += "; planfly check --geometry suggests changes for the planned route"
    lines += [colour_text("          no remedy: ", "hint") + no_change_text] if no_change_text else []
    undecided = verdict.undecided_findings
    lines += [f"  open    {finding_heading(finding)}: {finding.reason}" for finding in undecided[: 2 * _MAX_LISTED]]
    # One flight would decide all findings with the same suggestion.
    deciding_flights = dict.fromkeys(finding.suggestion for finding in undecided if finding.suggestions)
    lines += [colour_text("          would decide: ", "hint") + text for text in deciding_flights]
    zone_count = 0 if verdict.conditions is None else verdict.conditions.zones
    for rule in verdict.rules:
        zone_count_text = f"{zone_count:,} zones; " if rule.words.name == "fence" and zone_count > 1 else ""
        lines.append(f"  {rule.words.title:<{_TITLE_WIDTH}}{zone_count_text}{rule.summary}")
    lines += [f"  note    {note}" for note in notes]
    if returns is not None and returns.line:
        is_warning = verdict.flyable and returns.has_failures
        requirement = "; the scenario requires no safe return" if is_warning else ""
        text = f"returns   {returns.line}{requirement}; planfly returns tries every second of the flight"
        lines.insert(1 if is_warning else len(lines), colour_text(text, "warning") if is_warning else text)
    return lines


def autopilot_lines(verdicts: Mapping[str, Verdict]) -> list[str]:
    """Return a table of several autopilots' verdicts as lines, and the main lines of each verdict.

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
    rows = [("", *verdicts), ("verdict", *(verdict.answer for verdict in verdicts.values()))]
    # Keyed by title: photo lines and their overlap are shown apart, and have the rule "survey" in common.
    rules_by_title = [{rule.words.title: rule for rule in verdict.rules} for verdict in verdicts.values()]
    all_findings = [finding for verdict in verdicts.values() for finding in verdict.findings]
    rows += [
        (title, *(rules[title].tally_text if title in rules else "" for rules in rules_by_title))
        for title in [rule.words.title for rule in findings_by_rule(all_findings)]
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for title, *cells in rows:
        padded = [f"{cell:<{width}}" for cell, width in zip(cells, widths[1:], strict=True)]
        lines.append(f"  {title:<{widths[0]}}  {'  '.join(padded)}".rstrip())
    for name, verdict in verdicts.items():
        first, *other_lines = verdict.lines or ("",)
        # If another parameter value passes, the second line of the verdict names that value.
        remedy = f"; {other_lines[0]}" if other_lines and not verdict.flyable else ""
        lines.append(f"{name}: " + colour_text(first, STATE_STYLES[verdict.state]) + remedy)
        if verdict.conditions is not None:
            # The headline states the notes already.
            condition_texts = [*condition_lines(verdict.conditions), autopilot_line(verdict.conditions, is_flown=True)]
            lines += [f"  {line}" for line in condition_texts]
    return lines
