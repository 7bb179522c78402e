"""Format numbers and findings: sensible digits, units, real minus signs, failing rows first."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from flight.simulation.setup import MissionStretch
from logs.verdict.findings import Finding, undecided_findings, worst_first_key
from logs.verdict.imported.model_comparison import Reflight
from logs.verdict.places import DecidingParameter
from logs.verdict.presentation import RuleFindings, findings_by_rule
from logs.verdict.rule_words import rule_word
from logs.verdict.verdict import Verdict
from logs.verdict.wording import quantity_text, suggestions_text

NOTHING = "–"
_UNITS = {"deg": "°", "none": "", "1": ""}


@dataclass(frozen=True, slots=True)
class FindingRow:
    """One finding as text.

    state: "fail", "pass", "open" (not judged, which leaves the verdict open) or "unjudged".
    sign: the state as a symbol, for readers who see no colour.
    missed_by: distance of a failed finding from the values that pass; "" if unknown.
    remedy: changes that would have made a failed finding pass; "" if unknown.
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
    missed_by: str
    remedy: str


@dataclass(frozen=True, slots=True)
class RuleRow:
    """One rule over the whole flight: numbers of findings by state, and the one closest to its limit."""

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
class Badge:
    """Verdict in one word, with a sign before it.

    state: "pass", "fail", "open" (not judged in full) or "unjudged"; it sets the colour.
    """

    state: str
    sign: str
    word: str


_SIGNS = {"pass": "✓", "fail": "✗", "open": "?", "unjudged": "–"}
_WORDS = {"pass": "ok", "fail": "fails", "open": "not judged", "unjudged": "not judged"}


def number(value: float | None, *, signed: bool = False, digits: int | None = None) -> str:
    """Return a number as text with three or four significant digits.

    None and non-finite values become an en dash.

    digits: number of decimals, for columns in which all numbers need the same number.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    magnitude = abs(value)
    if digits is None:
        digits = 0 if magnitude >= 1000 else 1 if magnitude >= 10 else 2
        if 5e-5 < magnitude < 0.1:
            digits = 4 if magnitude < 0.01 else 3
    text = f"{value:{'+' if signed else ''},.{digits}f}"
    if not any(character in "123456789" for character in text):
        text = text.lstrip("+-")
    # A thousands comma could be read as a decimal comma; a thin space cannot.
    return text.replace(",", "\u2009").replace("-", "−")


def quantity(value: float | None, unit: str) -> str:
    """Return a number and its unit as text, with radians shown as degrees."""
    shown_value, name = in_unit(value, unit)
    text = number(shown_value)
    if text == NOTHING or not name:
        return text
    return f"{text}{name}" if name in ("°", "%") else f"{text}\u00a0{name}"


def in_unit(value: float | None, unit: str) -> tuple[float | None, str]:
    """Return a value and the name of its unit as shown, with radians as degrees."""
    if unit == "rad":
        return (None if value is None else math.degrees(value)), "°"
    return value, _UNITS.get(unit, unit)


def finding_state(ok: bool | None, *, is_open: bool = False) -> str:
    """Return the state of a finding, as in `FindingRow`.

    is_open: True if the finding, unjudged, leaves the verdict open.
    """
    return ("open" if is_open else "unjudged") if ok is None else "pass" if ok else "fail"


def verdict_badge(verdict: Verdict) -> Badge:
    """Return the verdict in a few words; a verdict whose only failure is completion is "incomplete"."""
    if verdict.flyable:
        answer = verdict.answer.capitalize() + ("" if verdict.level == "flown" else " on paper, not flown")
        return Badge("pass", _SIGNS["pass"], answer)
    if verdict.level == "plan":
        return Badge("fail", _SIGNS["fail"], "Not flyable: no feasible plan")
    if verdict.undecided:
        return Badge("open", _SIGNS["open"], "Not judged in full")
    answer = "not flown as planned" if verdict.imported else "not flyable"
    failed_rules = {finding.rule for finding in verdict.findings if finding.ok is False} - {"completion"}
    if not failed_rules and not verdict.complete:
        return Badge("fail", "!", f"Incomplete, so {answer}")
    return Badge("fail", _SIGNS["fail"], answer.capitalize() + ("" if verdict.complete else ", and incomplete"))


def headline_without_answer(badge: Badge, headline: str) -> str:
    """Return the headline without the answer at its beginning, if the badge gives the same answer.

    >>> headline_without_answer(Badge("fail", "✗", "Not flyable"), "not flyable: slope on leg 1")
    'slope on leg 1'
    """
    starts_with_answer = headline.lower().startswith(badge.word.lower())
    return headline[len(badge.word) :].lstrip(":; ") if starts_with_answer else headline


def finding_rows(findings: Iterable[Finding], deciding: DecidingParameter | None = None) -> list[FindingRow]:
    """Return all findings as text, in this order: failed, undecided, passed, not judged.

    Within each state, the order of the verdict is kept.

    deciding: deciding parameter of the verdict, for the remedies.
    """
    order = {"fail": 0, "open": 1, "pass": 2, "unjudged": 3}
    return sorted((_finding_row(finding, deciding) for finding in findings), key=lambda row: order[row.state])


@dataclass(frozen=True, slots=True)
class FailedGroup:
    """The failed findings of one rule.

    judged: number of judged findings of the rule.  others: places and values of further failures, worst first.
    """

    rule: str
    judged: int
    worst: FindingRow
    others: tuple[str, ...]


def failed_groups(verdict: Verdict) -> list[FailedGroup]:
    """List the failed rules, in the order of the first line of the verdict."""
    groups = []
    for rule in verdict.present().failed_rules:
        worst, *others = (_finding_row(finding, verdict.deciding) for finding in rule.failed)
        groups.append(FailedGroup(rule.words.word, rule.judged, worst, tuple(map(_place_and_value, others))))
    return groups


def first_remedy(verdict: Verdict) -> FindingRow | None:
    """Return the first failed finding with a remedy, or None if none has one.

    A finding on ground contact comes before all others.
    """
    worst = [rule.failed[0] for rule in verdict.present().failed_rules]
    # A ground contact ended the flight; the sort keeps the order of the others.
    worst.sort(key=lambda finding: finding.rule != "clearance" or finding.flown is None or finding.flown > 0.0)
    rows = (_finding_row(finding, verdict.deciding) for finding in worst)
    return next((row for row in rows if row.remedy), None)


def _place_and_value(row: FindingRow) -> str:
    """Return the place and the value of a failed finding as text."""
    value = row.planned if row.flown == NOTHING else row.flown
    unit = row.unit if row.unit in ("°", "%") else f" {row.unit}"
    return row.where if value == NOTHING else f"{row.where} ({value}{unit.rstrip()})"


def remedy_text(finding: Finding, deciding: DecidingParameter | None) -> str:
    r"""Return alternative changes of the plan, as text, that would make a failed finding pass.

    Return "" if none is known.

    deciding: deciding parameter of the verdict; its value is named at the finding that it decides.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> low = make_finding("clearance", Place("leg", 4), ok=False, reason="")
    >>> remedy_text(low, DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", "clearance", Place("leg", 4)))
    'the plan as it is, with TECS_HDEM_TCONST 1.2\xa0s instead of 3'
    """
    parts = [suggestions_text(finding.suggestions)] if finding.suggestions else []
    if deciding is not None and (deciding.rule, deciding.place) == (finding.rule, finding.place):
        unit = f"\u00a0{deciding.unit}" if deciding.unit else ""
        parts.append(
            f"the plan as it is, with {deciding.name} {deciding.passing:g}{unit} instead of {deciding.current:g}"
        )
    return "; ".join(parts)


def count_sentence(rows: list[FindingRow]) -> str:
    """Return a sentence on the numbers of findings that pass, fail, and were not judged."""
    counts = {state: sum(row.state == state for row in rows) for state in _SIGNS}
    passed_text = f"{counts['pass']} of {counts['pass'] + counts['fail']} judged findings pass"
    failed_text = f", {counts['fail']} {'fails' if counts['fail'] == 1 else 'fail'}" if counts["fail"] else ""
    unjudged = counts["open"] + counts["unjudged"]
    unjudged_text = f"; {unjudged} could not be judged" if unjudged else ""
    return f"{passed_text}{failed_text}{unjudged_text}."


def _finding_row(finding: Finding, deciding: DecidingParameter | None = None) -> FindingRow:
    """Return the row of one finding: its numbers and texts.

    deciding: as in `finding_rows`.
    """
    state = finding_state(finding.ok, is_open=bool(undecided_findings([finding])))
    planned_value, flown_value, margin = (
        in_unit(value, finding.unit)[0] for value in (finding.planned, finding.flown, finding.margin)
    )
    margin_with_tolerance = None if margin is None else margin + (in_unit(finding.tolerance, finding.unit)[0] or 0.0)
    method, digits = finding.method, _needed_decimals(finding)
    if finding.tolerance and method and finding.limit is not None:
        limit_text, tolerance = (quantity(value, finding.unit) for value in (finding.limit, finding.tolerance))
        method = f"{method}; limit {limit_text} with a tolerance of {tolerance}"
    return FindingRow(
        state=state,
        sign=f"{_SIGNS[state]} {_WORDS[state]}",
        rule=rule_word(finding.rule),
        where=finding.where,
        planned=number(planned_value, digits=digits),
        flown=number(flown_value, digits=digits),
        limit=_limit_text(finding, digits),
        limit_source=finding.limit_source,
        margin=number(margin_with_tolerance, signed=True),
        unit=in_unit(None, finding.unit)[1],
        method=method,
        reason=finding.reason,
        sentence=_sentence(finding),
        missed_by=_missed_text(finding),
        remedy=remedy_text(finding, deciding) if finding.ok is False else "",
    )


# Largest number of decimals of a value and its limit.
_MAX_DECIMALS = 6


def _needed_decimals(finding: Finding) -> int | None:
    """Return the decimals needed to distinguish a value from its limit; None if the usual number suffices."""
    value, limit = (
        in_unit(quantity_value, finding.unit)[0] for quantity_value in (finding.value, finding.effective_limit)
    )
    if value is None or limit is None or value == limit or number(value) != number(limit):
        return None
    sufficient_decimals = (
        digits for digits in range(_MAX_DECIMALS) if number(value, digits=digits) != number(limit, digits=digits)
    )
    return next(sufficient_decimals, _MAX_DECIMALS)


def _limit_text(finding: Finding, digits: int | None) -> str:
    """Return the values that pass as text; an en dash without a limit."""
    text = number(in_unit(finding.effective_limit, finding.unit)[0], digits=digits)
    return text if text == NOTHING else f"{finding.limit_sign}\u00a0{text}"


def _missed_text(finding: Finding) -> str:
    """Return the distance of a failed finding from the values that pass; "" if no limit decides it."""
    if finding.ok is not False or finding.margin is None or finding.effective_limit is None:
        return ""
    distance = -finding.margin - (finding.tolerance or 0.0)
    # A count has no decimals.
    return quantity_text(distance, finding.unit) if finding.unit == "legs" else quantity(distance, finding.unit)


def _sentence(finding: Finding) -> str:
    """Return a finding in words: its reason, or the flown or planned value and its limit."""
    parts: list[str] = []
    digits, unit = _needed_decimals(finding), in_unit(None, finding.unit)[1]
    space = "" if unit in ("", "°", "%") else "\u00a0"
    if (value := finding.value) is not None:
        word = "planned" if finding.flown is None or value != finding.flown else "flown"
        parts.append(f"{word} {number(in_unit(value, finding.unit)[0], digits=digits)}{space}{unit}")
    if finding.limit is not None:
        source = f" ({finding.limit_source})" if finding.limit_source else ""
        parts.append(f"limit {_limit_text(finding, digits)}{space}{unit}{source}")
    return finding.reason or ", ".join(parts)


def rule_rows(findings: Sequence[Finding]) -> list[RuleRow]:
    """Return a row for each rule with findings, in the order of `RULE_WORDS`.

    A row has the numbers of findings by state, and the finding closest to its limit.
    """
    return [_rule_row(rule) for rule in findings_by_rule(findings)]


def _rule_row(rule: RuleFindings) -> RuleRow:
    """Return the row of one rule: the numbers of its findings, and the finding closest to its limit.

    If none fails, an undecided finding is named instead of those that pass.
    """
    failed_count, judged_count = len(rule.failed), rule.judged
    open_findings = undecided_findings(rule.findings)
    state = "fail" if failed_count else "open" if open_findings else "pass" if judged_count else "unjudged"
    parts: list[str] = (
        [f"{failed_count} of {judged_count} fail" if failed_count else f"{judged_count} ok"] if judged_count else []
    )
    if judged_count < len(rule.findings):
        parts.append(f"{len(rule.findings) - judged_count} not judged")
    sign = f"{_SIGNS[state]} {_WORDS[state]}"
    rule_name = rule.words.word
    counts = ", ".join(parts)
    closest = rule.closest if failed_count or not open_findings else min(open_findings, key=worst_first_key)
    if closest is None:
        reason = "" if judged_count else rule.findings[0].reason
        return RuleRow(state, sign, rule_name, counts, reason, NOTHING, NOTHING, NOTHING, NOTHING, "")
    row = _finding_row(closest)
    return RuleRow(state, sign, rule_name, counts, row.where, row.planned, row.flown, row.limit, row.margin, row.unit)


# ----------------------------------------------------------------------
# An imported flight compared with its simulation, in words: legs, turns, and how far the model can be trusted.

_QUANTITY_NAMES = {
    "cross_track": "cross-track",
    "height_error": "height",
    "ground_speed": "ground speed",
    "bank": "bank",
}
_HEAD = ("", "cross-track (m)", "height (m)", "ground speed (m/s)", "bank (deg)", "energy (Wh)")


def refly_lines(reflight: Reflight) -> list[str]:
    """Return tables of legs and turns, as flown and as simulated, and a line on how well the model fits.

    >>> from flight.simulation.setup import MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.imported.flown_legs import flown_legs
    >>> from logs.verdict.imported.model_comparison import compare_with_model
    >>> log = example_log()
    >>> flown = flown_legs(log.setup, log.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    >>> again = compare_with_model(log.setup, flown, log.track, "completed")
    >>> refly_lines(again)[0]
    'AUTO from 0.0 s to 36.5 s, legs 0 to 1: flown / simulated'
    """
    route = reflight.setup.route
    leg_numbers, stops = route.leg_numbers.tolist(), route.stops.tolist()
    leg_table: list[tuple[str, ...]] = [_HEAD]
    for pair in reflight.legs:
        numbers = (pair.cross_track, pair.height_error, pair.ground_speed, pair.bank, pair.energy)
        leg_table.append((f"leg {leg_numbers[pair.leg - reflight.first]}", *map(_pair_text, numbers)))
    turn_table: list[tuple[str, ...]] = [("", "overshoot (m)", "bank (deg)", "nearest pass (m)")]
    for turn in reflight.turns:
        name = f"waypoint {stops[turn.waypoint - reflight.first]} ({turn.turn:+.1f}°)"
        turn_table.append((name, *map(_pair_text, (turn.overshoot, turn.bank, turn.passed))))
    stretch = reflight.stretch
    stretch_text = f"{stretch.mode or 'the flight'} from {stretch.start:.1f} s to {stretch.end:.1f} s"
    legs_text = f", legs {leg_numbers[0]} to {leg_numbers[len(reflight.legs) - 1]}"
    lines = [f"{stretch_text}{legs_text}: flown / simulated", *format_columns(leg_table)]
    if reflight.turns:
        lines += ["", *format_columns(turn_table)]
    return [*lines, "", trust_line(reflight)]


def trust_line(reflight: Reflight) -> str:
    """Return one line on how well the model represents the aircraft of an imported flight."""
    model = reflight.setup.aircraft
    model_text = f"{model}, used because no aircraft was named," if reflight.stands_in else model
    if not reflight.spreads:
        return f"Model and flight have no part in common: it is unknown how far {model_text} can be trusted"
    spread_texts = [
        f"{_QUANTITY_NAMES[spread.name]} {number(spread.median)} {spread.unit}"
        f" ({number(spread.percentile_95)} {spread.unit})"
        for spread in reflight.spreads
    ]
    end_text = "" if reflight.ended == "completed" else f"; the simulated flight ended early: {reflight.ended}"
    wind = reflight.setup.scenario.wind
    gust_text = "no gusts" if wind.turbulence == "none" else f"{wind.turbulence} turbulence"
    wind_text = f" in {wind.speed:.1f} m/s of wind, {gust_text}"
    return f"Model {model_text}{wind_text}, against the flight, median (95 %): {', '.join(spread_texts)}{end_text}"


def not_reflown_lines(reflights: Sequence[Reflight], stretches: Sequence[MissionStretch], max_count: int) -> list[str]:
    """List the stretches of an imported flight that were not simulated, with the reasons.

    stretches: stretches of the imported flight.  max_count: largest number of stretches to fly again.

    >>> not_reflown_lines((), (MissionStretch(50.0, 60.0, "AUTO", "log"),), 9)
    ['Not flown again: AUTO from 50.0 s to 60.0 s: it did not pass two waypoints in order']
    """
    compared_starts = {reflight.stretch.start for reflight in reflights}
    lines = []
    for stretch in stretches:
        if stretch.start not in compared_starts:
            reason = "it did not pass two waypoints in order"
            if len(reflights) >= max_count:
                reason += f", or {max_count} longer stretches were flown again"
            name = stretch.mode or "the flight"
            lines.append(f"Not flown again: {name} from {stretch.start:.1f} s to {stretch.end:.1f} s: {reason}")
    return lines


def _pair_text(pair: tuple[float, float]) -> str:
    """Return a flown and a simulated value as text; "-" for an unknown one."""
    return " / ".join("-" if math.isnan(value) else f"{value:.1f}" for value in pair)


def format_columns(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Align the cells of a table: the first column left, all others right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first_cell, *cells in rows:
        right_cells = [cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True)]
        lines.append("  ".join([first_cell.ljust(widths[0]), *right_cells]))
    return lines
