"""The verdict as a small table for a notebook."""

from logs.verdict.findings import RULES, Finding, Verdict
from logs.verdict.wording import place_text, suggestions_text
from world.notebooks.html_table import html_table


def verdict_html(verdict: Verdict) -> str:
    """The headline, a row for each rule, and one for each finding that fails, with what would pass.

    >>> verdict_html(Verdict((), flyable=True, complete=True, lines=("flyable",), level="flown"))
    '<div><strong>flyable</strong><table>...<tbody></tbody></table></div>'
    """
    rows: list[tuple[str, ...]] = []
    for rule, title in RULES.items():
        mine = [finding for finding in verdict.findings if finding.rule == rule]
        if mine:
            rows.append((title, _count(mine), "", ""))
            rows += [
                ("", place_text(one.place), one.reason, suggestions_text(one.suggestions))
                for one in mine
                if one.ok is False
            ]
    return html_table(verdict.headline, rows, ("rule", "result", "reason", "would pass"))


def _count(findings: list[Finding]) -> str:
    judged = [finding for finding in findings if finding.ok is not None]
    if not judged:
        return "not judged"
    return f"{sum(finding.ok is True for finding in judged)} of {len(judged)} ok"
