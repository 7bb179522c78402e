"""Print a verdict on a terminal."""

from collections.abc import Callable, Iterable

from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.presentation import RuleFindings
from logs.verdict.rule_words import RULE_WORDS, rule_word
from logs.verdict.verdict import Verdict
from logs.verdict.wording import noun_with_place, shorten_statement
from planfly.terminal.command_parser import STATE_STYLES, colour_text
from planfly.workflow.suggestion_trials import has_geometric_suggestion

# Maximum number of failed findings of a rule that are listed after the worst finding.
_MAX_LISTED = 6
# Sources of a limit that are named after the limit; limits from other sources are planfly's own.
_LIMIT_SOURCES = ("scenario", "near the field", "aircraft", "autopilot", "mission")
# Width of the column of rules, characters.
_TITLE_WIDTH = 2 + max(len(rule.title) for rule in RULE_WORDS.values())


def print_verdict(verdict: Verdict, notes: Iterable[str], setup: FlightSetup | None = None) -> None:
    """Print a verdict: summary, failed rules, and the finding closest to its limit for each rule.

    setup: setup of the judged flight, used to look for suggestions on its planned route; None without a flight.
    """
    print("\n".join(verdict_lines(verdict, notes, lambda: setup is not None and has_geometric_suggestion(setup))))


def never_suggests() -> bool:
    """Return False, for a verdict without a planned route that could have suggestions."""
    return False


def verdict_lines(
    verdict: Verdict, notes: Iterable[str], suggests_by_geometry: Callable[[], bool] = never_suggests
) -> list[str]:
    """Return the lines of a verdict for a terminal.

    They are the summary, the failures, the finding closest to its limit for each rule, and the notes.

    suggests_by_geometry: function that returns True if changes of the planned route are suggested without a flight.  It
        is called only if the flight has no suggestion.
    """
    presentation = verdict.present()
    lines = [colour_text(presentation.headline, STATE_STYLES[presentation.state]), *presentation.details]
    for rule in presentation.failed_rules:
        lines += _failed_lines(rule)
    no_change_text = _no_change_text(verdict, suggests_by_geometry)
    lines += [colour_text("          no remedy: ", "hint") + no_change_text] if no_change_text else []
    lines += [
        f"  open    {noun_with_place(rule_word(finding.rule), finding.place)}: {finding.reason}"
        for finding in presentation.undecided[: 2 * _MAX_LISTED]
    ]
    # One flight would decide all findings with the same suggestion.
    deciding_flights = dict.fromkeys(finding.suggestion for finding in presentation.undecided if finding.suggestions)
    lines += [colour_text("          would decide: ", "hint") + text for text in deciding_flights]
    for rule in presentation.rules:
        zone_count_text = (
            f"{presentation.zones:,} zones; " if rule.words.name == "fence" and presentation.zones > 1 else ""
        )
        lines.append(f"  {rule.words.title:<{_TITLE_WIDTH}}{zone_count_text}{_rule_summary(rule)}")
    return [*lines, *(f"  note    {note}" for note in notes)]


def _no_change_text(verdict: Verdict, suggests_by_geometry: Callable[[], bool]) -> str:
    """State that no change passed its trial if no failed finding has a suggestion; otherwise return "".

    After a failed flight, the text is returned only if the planned route fails, too.
    """
    # Findings on returns state their own remedy.
    is_judged = verdict.level in ("geometric", "flown") and not verdict.imported
    has_hint = any(finding.suggestions for finding in verdict.failed) or all(
        finding.rule == "return" for finding in verdict.failed
    )
    if not is_judged or has_hint:
        return ""
    if verdict.level == "geometric":
        return "no change that passes was found"
    if not any(level.name == "geometry" and not level.flyable and not level.undecided for level in verdict.levels):
        return ""
    further_text = "; planfly check --geometry suggests changes for the planned route" if suggests_by_geometry() else ""
    return f"no change that passes was found in simulated flights{further_text}"


def _failed_lines(rule: RuleFindings) -> list[str]:
    """Return the lines for a failed rule: its worst finding, a suggestion, and the other failed places.

    The suggestion is that of the worst finding, or else of another finding.
    """
    worst_finding, *other_findings = rule.failed
    # A fence item names its rule.
    place_text = noun_with_place(rule.words.word, worst_finding.place)
    if worst_finding.where.startswith(f"{rule.words.word} "):
        place_text = worst_finding.where
    if other_findings:
        place_text = f"{rule.words.word}: {len(rule.failed)} of {rule.judged} fail; the worst at {worst_finding.where}"
    lines = [colour_text("  failed  ", "bad") + f"{place_text}: {worst_finding.reason}"]
    if worst_finding.suggestions:
        lines.append(colour_text("          would pass: ", "hint") + worst_finding.suggestion)
    elif helped_finding := next((finding for finding in other_findings if finding.suggestions), None):
        helped_text = f"at {helped_finding.where}: {helped_finding.suggestion}"
        lines.append(colour_text("          would pass: ", "hint") + helped_text)
    elif worst_finding.rule == "return" and worst_finding.limit_source == "scenario":
        lines.append(colour_text("          would help: ", "hint") + "planfly returns --suggest looks for a remedy")
    if other_findings:
        other_places = "; ".join(map(_place_and_value, other_findings[:_MAX_LISTED]))
        more_text = f"; {len(other_findings) - _MAX_LISTED} more" if len(other_findings) > _MAX_LISTED else ""
        lines.append(f"          also at {other_places}{more_text}")
    return lines


def _place_and_value(finding: Finding) -> str:
    """Return the place of a failed finding, with its value if it has one, such as "leg 4 (12.3 m)".

    If the value is within its limit, the finding fails for another reason: this reason then replaces the value.
    """
    value = finding.compared_texts()[0] if finding.margin is not None else shorten_statement(finding.brief)
    return finding.where + (f" ({value})" if value else "")


def _rule_summary(rule: RuleFindings) -> str:
    """Return the counts of a rule's findings and the finding closest to its limit.

    If no finding of the rule was judged, the text states the reason.
    """
    if not rule.judged:
        return f"{'warning' if rule.words.is_warning else 'not judged'}: {rule.findings[0].reason}"
    closest, margin = rule.closest, rule.words.margin
    if closest is None or closest.margin is None or margin is None:
        # Of several such findings the first stands for all.
        return "; ".join(
            [rule.count_text, *(f"{finding.where}: {finding.reason}" for finding in rule.passed_otherwise[:1])]
        )
    value, limit = closest.compared_texts()
    if not value or not limit:
        return rule.count_text
    relation = "furthest beyond its limit" if closest.ok is False else "closest to its limit"
    place_text = "" if closest.place.kind == "flight" else f"{relation} at {closest.where}: "
    source_text = f", {closest.limit_source}" if closest.limit_source in _LIMIT_SOURCES else ""
    note = f"; {closest.tolerance_note}" if closest.tolerance_note else ""
    return f"{rule.count_text}; {place_text}{margin.quantity} {value} (limit {limit}{source_text}{note})"
