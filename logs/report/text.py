"""Numbers and findings as a reader meets them: sensible digits, units, real minus signs, failing rows on top."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from logs.report.would_pass import WouldPass, would_pass
from logs.verdict.findings import RULES, Finding, Verdict
from logs.verdict.levels import DecidingParameter
from logs.verdict.wording import place_text, suggestions_text

NOTHING = "–"
_UNITS = {"deg": "°", "none": "", "1": ""}


@dataclass(frozen=True, slots=True)
class FindingRow:
    """One finding as text.

    state: "fail", "pass" or "unjudged"; sign: the same for people who see no colour.
    would_pass: of a failed one, the number and the changes that would have passed; "" where nothing is known.
    """

    state: str
    sign: str
    rule: str
    where: str
    planned: str
    flown: str
    limit: str
    limit_source: str
    margin: str
    unit: str
    method: str
    reason: str
    sentence: str
    would_pass: str


@dataclass(frozen=True, slots=True)
class RuleRow:
    """One rule over the whole flight: how many findings stand how, and the tightest of those judged."""

    state: str
    sign: str
    rule: str
    counts: str
    where: str
    planned: str
    flown: str
    limit: str
    margin: str
    unit: str


@dataclass(frozen=True, slots=True)
class LevelRow:
    """One level's answer as text.  state: "pass" or "fail"; sign: the same for people who see no colour."""

    state: str
    sign: str
    name: str
    asks: str
    flown_by: str
    answer: str


@dataclass(frozen=True, slots=True)
class Badge:
    """The verdict in a word.  state: "pass", "fail" or "unjudged"."""

    state: str
    sign: str
    word: str


# What each level asks, and who flies for it.
_LEVELS = {
    "geometry": ("Does the path ask for more than the envelope gives?", "nobody"),
    "airframe": ("Can this aircraft follow it at all?", "planfly's guidance"),
    "autopilot": ("Does it go well with the autopilot that will fly?", "ArduPlane, by its parameters"),
}
_SIGNS = {"pass": "✓", "fail": "✗", "unjudged": "?"}
_WORDS = {"pass": "ok", "fail": "fails", "unjudged": "not judged"}


def number(value: float | None, *, signed: bool = False, digits: int | None = None) -> str:
    """Write a number with three or four telling digits; an en dash for none, and for what is no finite number.

    digits: decimals, where a column wants all of its numbers alike.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    size = abs(value)
    if digits is None:
        digits = 0 if size >= 1000 else 1 if size >= 10 else 2
        if 5e-5 < size < 0.1:
            digits = 4 if size < 0.01 else 3
    text = f"{value:{'+' if signed else ''},.{digits}f}"
    if not any(mark in "123456789" for mark in text):
        text = text.lstrip("+-")
    # A thousands comma could pass for a decimal one: a thin space cannot.
    return text.replace(",", "\u2009").replace("-", "−")


def quantity(value: float | None, unit: str) -> str:
    """Write a number and its unit, with radians shown as degrees."""
    shown, name = in_unit(value, unit)
    text = number(shown)
    if text == NOTHING or not name:
        return text
    return f"{text}{name}" if name in ("°", "%") else f"{text}\u00a0{name}"


def in_unit(value: float | None, unit: str) -> tuple[float | None, str]:
    """Give the value and the name of its unit as shown."""
    if unit == "rad":
        return (None if value is None else math.degrees(value)), "°"
    return value, _UNITS.get(unit, unit)


def state_of(ok: bool | None) -> str:
    """Name a finding's state, from its answer."""
    return "unjudged" if ok is None else "pass" if ok else "fail"


def badge_of(verdict: Verdict) -> Badge:
    """Put the verdict in a word: incomplete where nothing failed but the completion itself."""
    if verdict.flyable:
        return Badge("pass", _SIGNS["pass"], "Flyable" if verdict.level == "flown" else "Flyable on paper, not flown")
    if verdict.level == "plan":
        return Badge("fail", _SIGNS["fail"], "Not flyable: no feasible plan")
    broken = {finding.rule for finding in verdict.findings if finding.ok is False} - {"completion"}
    if not broken and not verdict.complete:
        return Badge("fail", "!", "Incomplete, so not flyable")
    return Badge("fail", _SIGNS["fail"], "Not flyable" if verdict.complete else "Not flyable, and incomplete")


def level_rows(verdict: Verdict) -> list[LevelRow]:
    """Each level that was asked, geometry first; the verdict's own is the last."""
    rows = []
    for level in verdict.levels:
        state = state_of(level.flyable)
        asks, flown_by = _LEVELS[level.name]
        rows.append(LevelRow(state, f"{_SIGNS[state]} {_WORDS[state]}", level.name, asks, flown_by, level.headline))
    return rows


def finding_rows(findings: Iterable[Finding], deciding: DecidingParameter | None = None) -> list[FindingRow]:
    """All findings as text: failing first, then passed, then not judged; otherwise in the verdict's order.

    deciding: the verdict's parameter, for what would pass.
    """
    order = {"fail": 0, "pass": 1, "unjudged": 2}
    return sorted((_row(finding, deciding) for finding in findings), key=lambda row: order[row.state])


def would_pass_text(found: WouldPass, unit: str) -> str:
    """What would have passed, in words; "" where nothing is known.

    unit: of the finding.

    >>> would_pass_text(WouldPass("at most", 7.8, 3.45, (), None), "deg")
    'at most 7.80° (misses by 3.45°)'
    """
    parts = []
    if found.bound is not None:
        value = abs(found.value) if found.value is not None and unit in ("deg", "rad") else found.value
        parts.append(f"{found.bound} {quantity(value, unit)} (misses by {quantity(found.misses, unit)})")
    if found.suggestions:
        parts.append(suggestions_text(found.suggestions))
    if found.parameter is not None:
        one = found.parameter
        unit_text = f"\u00a0{one.unit}" if one.unit else ""
        parts.append(f"the plan as it is, with {one.name} {one.passing:g}{unit_text} instead of {one.current:g}")
    return "; ".join(parts)


def count_sentence(rows: list[FindingRow]) -> str:
    """Say how many findings hold, fail, and were not judged."""
    counts = {state: sum(row.state == state for row in rows) for state in _SIGNS}
    held = f"{counts['pass']} of {counts['pass'] + counts['fail']} judged findings hold"
    failed = f", {counts['fail']} {'fails' if counts['fail'] == 1 else 'fail'}" if counts["fail"] else ""
    left = f"; {counts['unjudged']} could not be judged: grey below, with the reason" if counts["unjudged"] else ""
    return f"{held}{failed}{left}."


def _row(finding: Finding, deciding: DecidingParameter | None = None) -> FindingRow:
    state = state_of(finding.ok)
    planned, flown, limit, margin = (
        in_unit(value, finding.unit)[0] for value in (finding.planned, finding.flown, finding.limit, finding.margin)
    )
    method, mended = finding.method, suggestions_text(finding.suggestions)
    if finding.tolerance:
        method = f"{method} (±\u00a0{quantity(finding.tolerance, finding.unit)})" if method else ""
    return FindingRow(
        state=state,
        sign=f"{_SIGNS[state]} {_WORDS[state]}",
        rule=finding.rule,
        where=place_text(finding.place),
        planned=number(planned),
        flown=number(flown),
        limit=number(limit),
        limit_source=finding.limit_source,
        margin=number(margin, signed=True),
        unit=in_unit(None, finding.unit)[1],
        method=method,
        reason=finding.reason + (f"; would pass: {mended}" if mended else ""),
        sentence=_sentence(finding),
        would_pass=would_pass_text(would_pass(finding, deciding), finding.unit) if finding.ok is False else "",
    )


def _sentence(finding: Finding) -> str:
    """Say in words how a finding stands: what was flown or planned, against what, and why."""
    parts: list[str] = []
    for word, value in (("flown", finding.flown), ("planned", finding.planned)):
        if value is not None and not parts:
            parts.append(f"{word} {quantity(value, finding.unit)}")
    if finding.limit is not None:
        source = f" ({finding.limit_source})" if finding.limit_source else ""
        parts.append(f"limit {quantity(finding.limit, finding.unit)}{source}")
    if finding.margin is not None and finding.margin < 0.0:
        parts.append(f"beyond it by {quantity(-finding.margin, finding.unit)}")
    numbers = ", ".join(parts)
    return f"{numbers}; {finding.reason}" if numbers and finding.reason else numbers or finding.reason


def rule_rows(findings: Iterable[Finding]) -> list[RuleRow]:
    """Count the findings by rule, in the order of `RULES`; a rule without findings is left out."""
    grouped: dict[str, list[Finding]] = {rule: [] for rule in RULES}
    for finding in findings:
        grouped.setdefault(finding.rule, []).append(finding)
    return [_rule_row(rule, group) for rule, group in grouped.items() if group]


def _rule_row(rule: str, group: list[Finding]) -> RuleRow:
    failed = sum(finding.ok is False for finding in group)
    judged = sum(finding.ok is not None for finding in group)
    state = "fail" if failed else "pass" if judged else "unjudged"
    parts: list[str] = [f"{failed} of {judged} fail" if failed else f"{judged} ok"] if judged else []
    if judged < len(group):
        parts.append(f"{len(group) - judged} not judged")
    tightest = min(
        (finding for finding in group if finding.ok is not None and finding.margin is not None),
        key=lambda finding: (finding.ok is True, finding.margin),
        default=None,
    )
    sign = f"{_SIGNS[state]} {_WORDS[state]}"
    if tightest is None:
        why = "" if judged else group[0].reason
        return RuleRow(state, sign, rule, ", ".join(parts), why, NOTHING, NOTHING, NOTHING, NOTHING, "")
    row = _row(tightest)
    numbers = (row.planned, row.flown, row.limit, row.margin, row.unit)
    return RuleRow(state, sign, rule, ", ".join(parts), row.where, *numbers)
