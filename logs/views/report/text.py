"""Format numbers and tables of findings: sensible digits, units, real minus signs, failing rows first."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from flight.simulation.setup import MissionStretch
from logs.verdict.findings import Finding, State
from logs.verdict.imported.model_comparison import Reflight
from logs.verdict.presentation import STATE_SIGNS, STATE_WORDS, RuleFindings, finding_words
from logs.verdict.wording import quantity_text

NOTHING = "–"
_UNITS = {"deg": "°", "none": "", "1": ""}


@dataclass(frozen=True, slots=True)
class FindingRow:
    """One finding as a row of a table.

    state, sign: the state as a name and as a symbol, for readers who see no colour.
    """

    finding: Finding
    state: State
    sign: str
    rule: str
    planned: str
    flown: str
    limit: str
    margin: str
    unit: str
    method: str


@dataclass(frozen=True, slots=True)
class RuleRow:
    """One rule over the whole flight: numbers of findings by state, and the one closest to its limit."""

    state: State
    sign: str
    rule: str
    counts: str
    where: str
    planned: str = NOTHING
    flown: str = NOTHING
    limit: str = NOTHING
    margin: str = NOTHING
    unit: str = ""


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
    shown_value, name = display_value(value, unit)
    text = number(shown_value)
    if text == NOTHING or not name:
        return text
    return f"{text}{name}" if name in ("°", "%") else f"{text}\u00a0{name}"


def display_value(value: float | None, unit: str) -> tuple[float | None, str]:
    """Return a value and its unit for display: radians become degrees, and a value of None stays None."""
    if unit == "rad":
        return (None if value is None else math.degrees(value)), "°"
    return value, _UNITS.get(unit, unit)


def finding_rows(findings: Iterable[Finding]) -> list[FindingRow]:
    """Return all findings as rows, in this order: failed, undecided, passed, not judged.

    Within each state, the order of the verdict is kept.
    """
    order = ("fail", "open", "ok", "unjudged")
    return sorted(map(_make_finding_row, findings), key=lambda row: order.index(row.state))


def count_sentence(findings: Sequence[Finding]) -> str:
    """Return a sentence on the numbers of findings that pass, fail, and were not judged."""
    counts = Counter(finding.state for finding in findings)
    passed_text = f"{counts['ok']} of {counts['ok'] + counts['fail']} judged findings pass"
    failed_text = f", {counts['fail']} {'fails' if counts['fail'] == 1 else 'fail'}" if counts["fail"] else ""
    unjudged = counts["open"] + counts["unjudged"]
    unjudged_text = f"; {unjudged} could not be judged" if unjudged else ""
    return f"{passed_text}{failed_text}{unjudged_text}."


def _describe_state(state: State) -> str:
    """Return a state as its sign and its word."""
    return f"{STATE_SIGNS[state]} {STATE_WORDS[state]}"


def _make_finding_row(finding: Finding) -> FindingRow:
    """Return the row of one finding: its numbers and texts."""
    planned_value, flown_value, margin = (
        display_value(value, finding.unit)[0] for value in (finding.planned, finding.flown, finding.margin)
    )
    # The margin is the distance from the shown limit.
    tolerance_in_limit = 0.0 if finding.tolerance_note else display_value(finding.tolerance, finding.unit)[0] or 0.0
    shown_margin = None if margin is None else margin + tolerance_in_limit
    # Decimals needed to distinguish the value from its limit; None if the usual number suffices.
    judged_value, shown_limit = (
        display_value(value, finding.unit)[0] for value in (finding.value, finding.shown_limit)
    )
    digits = None
    if (
        judged_value is not None
        and shown_limit is not None
        and judged_value != shown_limit
        and number(judged_value) == number(shown_limit)
    ):
        sufficient_decimals = (
            decimals
            for decimals in range(_MAX_DECIMALS)
            if number(judged_value, digits=decimals) != number(shown_limit, digits=decimals)
        )
        digits = next(sufficient_decimals, _MAX_DECIMALS)
    method = finding.method
    if finding.tolerance and method and finding.limit is not None:
        limit_text, tolerance = (quantity(value, finding.unit) for value in (finding.limit, finding.tolerance))
        method = f"{method}; limit {limit_text} with a tolerance of {tolerance}"
    limit = number(shown_limit, digits=digits)
    return FindingRow(
        finding=finding,
        state=finding.state,
        sign=_describe_state(finding.state),
        rule=finding_words(finding).word,
        planned=number(planned_value, digits=digits),
        flown=number(flown_value, digits=digits),
        limit=limit if limit == NOTHING else f"{finding.limit_sign}\u00a0{limit}",
        margin=number(shown_margin, signed=True),
        unit=display_value(value=None, unit=finding.unit)[1],
        method=method,
    )


# Largest number of decimals of a value and its limit.
_MAX_DECIMALS = 6


def missed_text(finding: Finding) -> str:
    """State by how much a failed finding misses its limit, with the unit; "" if the finding has no limit."""
    if finding.ok is not False or finding.margin is None or finding.effective_limit is None:
        return ""
    distance = -finding.margin - (finding.tolerance or 0.0)
    # A count has no decimals.
    return quantity_text(distance, finding.unit) if finding.unit == "legs" else quantity(distance, finding.unit)


def rule_row(rule: RuleFindings) -> RuleRow:
    """Return the row of one rule: numbers of its findings, and values of the representative finding.

    Without a representative finding there are no values.  A rule that was not judged states the reason as its place.
    """
    head = (rule.state, _describe_state(rule.state), rule.words.word, rule.tally_text)
    if rule.shown is None:
        return RuleRow(*head, "" if rule.judged else rule.findings[0].reason)
    row = _make_finding_row(rule.shown)
    return RuleRow(*head, rule.shown.where, row.planned, row.flown, row.limit, row.margin, row.unit)


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
        leg_table.append((f"leg {leg_numbers[pair.leg - reflight.first]}", *map(_format_pair, numbers)))
    turn_table: list[tuple[str, ...]] = [("", "overshoot (m)", "bank (deg)", "nearest pass (m)")]
    for turn in reflight.turns:
        name = f"waypoint {stops[turn.waypoint - reflight.first]} ({turn.turn:+.1f}°)"
        turn_table.append((name, *map(_format_pair, (turn.overshoot, turn.bank, turn.passed))))
    stretch = reflight.stretch
    stretch_text = f"{stretch.mode or 'the flight'} from {stretch.start:.1f} s to {stretch.end:.1f} s"
    legs_text = f", legs {leg_numbers[0]} to {leg_numbers[len(reflight.legs) - 1]}"
    lines = [f"{stretch_text}{legs_text}: flown / simulated", *format_columns(leg_table)]
    if reflight.turns:
        lines += ["", *format_columns(turn_table)]
    return [*lines, "", describe_model_trust(reflight)]


def describe_model_trust(reflight: Reflight) -> str:
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
    head = f"Median difference (95 %) between the flight and model {model_text}{wind_text}"
    return f"{head}: {', '.join(spread_texts)}{end_text}"


def list_not_reflown(reflights: Sequence[Reflight], stretches: Sequence[MissionStretch], max_count: int) -> list[str]:
    """List the stretches of an imported flight that were not simulated, with the reasons.

    reflights: simulated flights, each with its stretch.
    stretches: all stretches of the imported flight, which are the periods in which it followed its mission.
    max_count: largest number of stretches that are simulated.

    >>> list_not_reflown((), (MissionStretch(50.0, 60.0, "AUTO", "log"),), 9)
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


def _format_pair(pair: tuple[float, float]) -> str:
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
