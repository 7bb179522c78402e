"""Show a verdict as a small table in a notebook."""

from logs.verdict.presentation import Presentation
from world.html_table import html_table


def verdict_html(verdict: Presentation) -> str:
    """Return an HTML table with the headline, and a row for each rule and for each failed finding."""
    rows: list[tuple[str, ...]] = []
    for rule in verdict.rules:
        rows.append((rule.words.title, rule.count_text, "", ""))
        rows += [
            ("", finding.where, finding.reason, finding.suggestion) for finding in rule.findings if finding.ok is False
        ]
    return html_table(verdict.headline, rows, ("rule", "result", "reason", "would pass"))
