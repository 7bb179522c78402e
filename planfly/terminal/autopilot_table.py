"""One mission flown by several autopilots: their verdicts as a table, a column each."""

from collections.abc import Mapping

from logs.verdict.conditions import flown_lines
from logs.verdict.findings import Finding, Verdict
from logs.verdict.rules.registry import RULES
from planfly.terminal.command_parser import coloured

_GAP = "  "


def autopilot_lines(verdicts: Mapping[str, Verdict]) -> list[str]:
    """The table by rule, then what each autopilot's verdict says first.

    verdicts: by the autopilot's name, in the order of the columns.

    >>> flies = Verdict((), flyable=True, complete=True, lines=("flyable",), level="flown")
    >>> fails = Verdict((), flyable=False, complete=True, lines=("not flyable: speed", "NAV_ACC_RAD 10"), level="flown")
    >>> for line in autopilot_lines({"ardupilot": flies, "px4": fails}):
    ...     print(line)
               ardupilot  px4
      verdict  flyable    not flyable
    ardupilot: flyable
    px4: not flyable: speed; NAV_ACC_RAD 10
    """
    rows = [("", *verdicts), ("verdict", *(_answer(verdict) for verdict in verdicts.values()))]
    for rule in RULES.values():
        found = [[one for one in verdict.findings if one.rule == rule.name] for verdict in verdicts.values()]
        if any(found):
            rows.append((rule.title, *map(_state, found)))
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = []
    for title, *cells in rows:
        padded = [f"{cell:<{width}}" for cell, width in zip(cells, widths[1:], strict=True)]
        lines.append(f"  {title:<{widths[0]}}{_GAP}{_GAP.join(padded)}".rstrip())
    for name, verdict in verdicts.items():
        first, *rest = verdict.lines or ("",)
        # Where another value of a parameter passes, the second line names it.
        more = f"; {rest[0]}" if rest and not verdict.flyable else ""
        lines.append(f"{name}: " + coloured(first, "good" if verdict.flyable else "bad") + more)
        if verdict.conditions is not None:
            said = flown_lines(verdict.conditions)
            lines += [f"  {line}" for line in said]
    return lines


def _answer(verdict: Verdict) -> str:
    if verdict.undecided:
        return "undecided"
    return "flyable" if verdict.flyable else "not flyable"


def _state(findings: list[Finding]) -> str:
    """How the findings of a rule stand."""
    judged = [finding for finding in findings if finding.ok is not None]
    if not judged:
        return "not judged" if findings else ""
    failed = sum(not finding.ok for finding in judged)
    return f"{failed} of {len(judged)} failed" if failed else f"{len(judged)} ok"
