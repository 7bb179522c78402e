"""Define how findings are shown: their signs, words and numbers, and their order by rule.

Three renderings read their texts here and in `logs.verdict.verdict.Verdict`: the document (``verdict.json``, and the
list of the studio), the lines of the terminal, and the rows of `FindingRow`, which HTML (report and notebook), JUnit
XML and the studio's map lay out.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from logs.verdict.findings import Finding, State, closest_to_limit, undecided_findings, worst_first_key
from logs.verdict.rule_words import FRONT_OVERLAP, RULE_WORDS, SIDE_OVERLAP, Margin, RuleWords
from logs.verdict.wording import noun_with_place, quantity_text
from world.wording import NOTHING, display_value, format_number, format_quantity

# Signs of states, for readers who see no color.
STATE_SIGNS: dict[State, str] = {"ok": "✓", "fail": "✗", "open": "?", "unjudged": "–"}
# Words of states of findings.
STATE_WORDS: dict[State, str] = {"ok": "ok", "fail": "fails", "open": "not judged", "unjudged": "not judged"}
# Columns of a table of results, filled by `RuleFindings.cells`.
RESULT_COLUMNS = ("rule", "result", "findings", "place", "planned", "flown", "limit", "margin", "unit")
# Fraction of the limit within which a value is near the limit, if the margin's scale is not smaller.
_NEAR_FRACTION = 0.1
# Texts after a limit that name its source; limits from other sources are planfly's own.
_LIMIT_SOURCE_TEXTS = {
    "near the field": ", which applies near the field",
    **{source: f", set by the {source}" for source in ("scenario", "aircraft", "autopilot", "mission")},
}
# Largest number of decimals with which a value is distinguished from its limit.
_MAX_DECIMALS = 6
# Texts of the overlap of a survey's photos.  It is shown apart from the photo lines, because it is no share of a line.
_OVERLAP_WORDS = replace(
    RULE_WORDS["survey"],
    title="photo overlap",
    noun="photo overlap",
    question="Do the photos of a survey overlap as required?",
    margin=Margin("overlap", "%", 5.0),
)
# Texts of all rules and of the parts that are shown apart, in the order in which they are shown.
_SHOWN_WORDS = tuple(
    words
    for rule_words in RULE_WORDS.values()
    for words in ((rule_words, _OVERLAP_WORDS) if rule_words.name == _OVERLAP_WORDS.name else (rule_words,))
)


def finding_words(finding: Finding) -> RuleWords:
    """Return the texts of a finding's rule, or the texts on photo overlap for an overlap of a survey."""
    is_overlap = finding.rule == _OVERLAP_WORDS.name and finding.check in (FRONT_OVERLAP, SIDE_OVERLAP)
    return _OVERLAP_WORDS if is_overlap else RULE_WORDS[finding.rule]


def finding_heading(finding: Finding) -> str:
    """Return the rule of a finding and its place, such as "slope at leg 7 (to item 9)"."""
    word = finding_words(finding).word
    # The place of a fence item already begins with the rule's name.
    return finding.where if finding.where.startswith(f"{word} ") else noun_with_place(word, finding.place)


def limit_with_tolerance_text(finding: Finding) -> str:
    """Describe the values that pass by the limit and, separately, the tolerance with its purpose.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> numbers = {"limit": 9.5, "tolerance": 0.2, "unit": "m/s", "at_least": True}
    >>> limit_with_tolerance_text(make_finding("stall", Place("flight"), ok=True, reason="", **numbers))
    '≥ 9.5 m/s, less a tolerance of 0.2 m/s'
    """
    purpose = finding_words(finding).tolerance_purpose
    tolerance_text = quantity_text(finding.tolerance or 0.0, finding.unit)
    return (
        f"{finding.limit_sign} {quantity_text(finding.limit or 0.0, finding.unit)},"
        f" {'less' if finding.at_least else 'plus'}"
        f" {f'{tolerance_text} for {purpose}' if purpose else f'a tolerance of {tolerance_text}'}"
    )


def short_text(finding: Finding, *, with_tolerance: bool = False) -> str:
    """Return a finding in a few words.

    The text has its rule, and its value and limit if it passes, otherwise its brief reason.

    with_tolerance: True to state the tolerance apart from the limit.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> numbers = {"planned": 13.5, "limit": 14.2, "margin": 0.7, "unit": "deg"}
    >>> short_text(make_finding("slope", Place("leg", 1), ok=True, reason="", **numbers))
    'slope 13.5° (≤ 14.2°)'
    """
    word = finding_words(finding).word
    if not finding.ok:
        return f"{word}: {finding.brief or finding.reason}"
    value, limit_text = finding.compared_texts()
    if finding.limit is not None and (with_tolerance or finding.tolerance_note):
        limit_text = limit_with_tolerance_text(finding)
    return f"{word} {value}" + (f" ({limit_text})" if limit_text else "")


class NumberTexts(NamedTuple):
    """Numbers of a finding as texts for a table, in the given unit; a missing number is an en dash."""

    planned: str = NOTHING
    flown: str = NOTHING
    limit: str = NOTHING
    margin: str = NOTHING
    unit: str = ""


def number_texts(finding: Finding) -> NumberTexts:
    """Return the numbers of a finding as texts, with enough digits to tell the value from its limit.

    The limit includes the tolerance, unless `Finding.tolerance_note` states it.  The margin is the distance from the
    shown limit.
    """
    planned, flown, margin, tolerance, value, limit = (
        display_value(number, finding.unit)[0]
        for number in (
            finding.planned,
            finding.flown,
            finding.margin,
            0.0 if finding.tolerance_note else finding.tolerance,
            finding.value,
            finding.shown_limit,
        )
    )
    digits = None
    if value is not None and limit is not None and value != limit and format_number(value) == format_number(limit):
        sufficient_decimals = (
            decimals
            for decimals in range(_MAX_DECIMALS)
            if format_number(value, digits=decimals) != format_number(limit, digits=decimals)
        )
        digits = next(sufficient_decimals, _MAX_DECIMALS)
    limit_text = format_number(limit, digits=digits)
    return NumberTexts(
        planned=format_number(planned, digits=digits),
        flown=format_number(flown, digits=digits),
        limit=limit_text if limit_text == NOTHING else f"{finding.limit_sign}\u00a0{limit_text}",
        margin=format_number(None if margin is None else margin + (tolerance or 0.0), signed=True),
        unit=display_value(value=None, unit=finding.unit)[1],
    )


def state_text(state: State) -> str:
    """Return a state as its sign and its word."""
    return f"{STATE_SIGNS[state]} {STATE_WORDS[state]}"


class PlaceState(NamedTuple):
    """State of a place on the studio's map.

    state: "fail", "open" (not judged, therefore not flyable), "near" (close to a limit) or "ok".
    closeness: margin divided by the margin below which a value is near its limit; negative beyond the limit.
    text: short text of the finding, shown at the pointer.
    """

    state: str
    closeness: float = math.inf
    text: str = ""


@dataclass(frozen=True, slots=True)
class FindingRow:
    """A finding with its texts, which HTML, JUnit XML and the studio's map only lay out.

    remedy: changes of the plan with which a failed finding would pass; "" if none is known.
    """

    finding: Finding
    remedy: str = ""

    @property
    def word(self) -> str:
        """Word of the rule."""
        return finding_words(self.finding).word

    @property
    def result(self) -> str:
        """Sign and word of the state."""
        return state_text(self.finding.state)

    @property
    def numbers(self) -> NumberTexts:
        """Numbers for a table."""
        return number_texts(self.finding)

    @property
    def message(self) -> str:
        """Reason of a failed or unjudged finding, after the word of its rule or "not judged"; "" if it passes."""
        state = self.finding.state
        return "" if state == "ok" else f"{self.word if state == 'fail' else STATE_WORDS[state]}: {self.finding.reason}"

    @property
    def excess(self) -> str:
        """Distance of a failed finding beyond its limit and tolerance, with the unit.

        "" for a finding that did not fail, or that has no limit or no margin.
        """
        finding = self.finding
        if finding.ok is not False or finding.margin is None or finding.effective_limit is None:
            return ""
        distance = -finding.margin - (finding.tolerance or 0.0)
        # A count has no decimals.
        is_count = finding.unit == "legs"
        return quantity_text(distance, finding.unit) if is_count else format_quantity(distance, finding.unit)

    @property
    def method(self) -> str:
        """Method of the finding, with its limit and its tolerance if it has both."""
        finding = self.finding
        if not finding.tolerance or not finding.method or finding.limit is None:
            return finding.method
        limit, tolerance = (format_quantity(value, finding.unit) for value in (finding.limit, finding.tolerance))
        return f"{finding.method}; limit {limit} with a tolerance of {tolerance}"

    @property
    def place_state(self) -> PlaceState | None:
        """State of the place according to the finding; None if the finding does not affect the state.

        >>> from logs.verdict.findings import make_finding
        >>> from logs.verdict.places import Place
        >>> slope = make_finding(
        ...     "slope", Place("leg", 1), ok=True, reason="", planned=13.5, limit=14.2, margin=0.7, unit="deg"
        ... )
        >>> FindingRow(slope).place_state
        PlaceState(state='near', closeness=0.7, text='slope 13.5° (≤ 14.2°)')
        """
        finding = self.finding
        if finding.ok is None:
            # The height of a leg is unknown where the leg leaves the terrain data.
            is_leg_height = finding.rule == "clearance" and finding.place.kind == "leg"
            is_shown = finding.state == "open" or (is_leg_height and finding.planned is None)
            return PlaceState("open", 0.0, short_text(finding)) if is_shown else None
        if finding.ok is False:
            return PlaceState("fail", -math.inf if finding.margin is None else finding.margin, short_text(finding))
        if finding.margin is None or finding.planned is None:
            return None
        is_tolerated = (finding.limit or 0.0) <= (finding.tolerance or 0.0)
        if finding.rule == "waypoint" and finding.limit_source == "autopilot" and is_tolerated:
            # At a nearly straight waypoint, ArduPlane's acceptance radius is about zero: no value is near it.
            return PlaceState("ok", text=short_text(finding))
        closeness = _closeness(finding)
        # The tolerance and its purpose are stated if the value is near its limit only without the tolerance.
        with_tolerance = closeness < 1.0 <= _closeness(finding, finding.tolerance or 0.0)
        text = short_text(finding, with_tolerance=with_tolerance)
        return PlaceState("near" if closeness < 1.0 else "ok", closeness, text)


def _closeness(finding: Finding, tolerance: float = 0.0) -> float:
    """Return the margin of a finding divided by the margin below which a value is near its limit.

    A value is near its limit within a tenth of the limit, but at most within the scale of the rule's margin.  Returns
    infinity for a rule that has neither.

    tolerance: added to the margin, in the finding's unit.
    """
    scale = RULE_WORDS[finding.rule].scale or math.inf
    near_margin = min(scale, _NEAR_FRACTION * abs(finding.limit)) if finding.limit else scale
    return ((finding.margin or 0.0) + tolerance) / near_margin if math.isfinite(near_margin) else math.inf


def near_threat_text(name: str, distance: float, navigation_error: float) -> str:
    """Describe a missile near a leg.

    The text has its name, the distance outside its sphere, and the navigation error, both in m.
    """
    error_text = f" (navigation error {quantity_text(navigation_error, 'm')})" if navigation_error > 0.0 else ""
    return f"{RULE_WORDS['threat'].word} {name} {quantity_text(distance, 'm')} away{error_text}"


def count_sentence(findings: Sequence[Finding]) -> str:
    """Return a sentence that states how many findings pass, how many fail, and how many were not judged."""
    counts = Counter(finding.state for finding in findings)
    passed_text = f"{counts['ok']} of {counts['ok'] + counts['fail']} judged findings pass"
    failed_text = f", {counts['fail']} {'fails' if counts['fail'] == 1 else 'fail'}" if counts["fail"] else ""
    unjudged = counts["open"] + counts["unjudged"]
    unjudged_text = f"; {unjudged} could not be judged" if unjudged else ""
    return f"{passed_text}{failed_text}{unjudged_text}."


@dataclass(frozen=True, slots=True)
class RuleFindings:
    """Findings of one rule, or of one part of a rule, in the verdict's order."""

    words: RuleWords
    findings: tuple[Finding, ...]

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Failed findings, the worst first."""
        return tuple(
            sorted(
                (finding for finding in self.findings if finding.ok is False), key=lambda finding: finding.margin or 0.0
            )
        )

    @property
    def judged_count(self) -> int:
        """Number of findings that were judged."""
        return sum(finding.ok is not None for finding in self.findings)

    @property
    def state(self) -> State:
        """State of the rule over the whole flight."""
        states = {finding.state for finding in self.findings}
        return next((state for state in ("fail", "open", "ok") if state in states), "unjudged")

    @property
    def closest(self) -> Finding | None:
        """Failed finding furthest beyond its limit, or else the passed finding closest to its limit, or None."""
        return closest_to_limit(self.findings)

    @property
    def shown(self) -> Finding | None:
        """Finding that represents the rule: an undecided finding if none fails, otherwise `closest`."""
        return min(undecided_findings(self.findings), key=worst_first_key) if self.state == "open" else self.closest

    @property
    def passed_beyond_limit(self) -> tuple[Finding, ...]:
        """Findings that pass although their number is beyond the limit; their reason explains it."""
        return tuple(
            finding
            for finding in self.findings
            if finding.ok and finding.margin is None and None not in (finding.value, finding.limit)
        )

    @property
    def count_text(self) -> str:
        """Text such as "3 of 4 ok": the number of passed findings, and the number of judged findings."""
        return (
            f"{self.judged_count - len(self.failed)} of {self.judged_count} ok" if self.judged_count else "not judged"
        )

    @property
    def tally_text(self) -> str:
        """Text such as "2 of 3 fail, 1 not judged" or "3 ok": the numbers of findings, for a cell of a table."""
        failed_count, unjudged_count = len(self.failed), len(self.findings) - self.judged_count
        judged_text = f"{failed_count} of {self.judged_count} fail" if failed_count else f"{self.judged_count} ok"
        parts = [judged_text if self.judged_count else "", f"{unjudged_count} not judged" if unjudged_count else ""]
        return ", ".join(filter(None, parts))

    @property
    def failure_heading(self) -> str:
        """Rule and place of its worst failed finding, with the number of failed findings if there are several.

        Raises IndexError for a rule without failed findings.
        """
        worst_finding = self.failed[0]
        if len(self.failed) == 1:
            return finding_heading(worst_finding)
        count_text = f"{len(self.failed)} of {self.judged_count} places fail"
        return f"{self.words.word}: {count_text}; the worst is at {worst_finding.where}"

    @property
    def summary(self) -> str:
        """Counts of the rule's findings and the finding closest to its limit.

        If no finding of the rule was judged, the text states the reason.
        """
        if not self.judged_count:
            return f"{'warning' if self.words.is_warning else 'not judged'}: {self.findings[0].reason}"
        closest, margin = self.closest, self.words.margin
        if closest is None or closest.margin is None or margin is None:
            # Of several such findings the first stands for all.
            return "; ".join(
                [self.count_text, *(f"{finding.where}: {finding.reason}" for finding in self.passed_beyond_limit[:1])]
            )
        value, limit = closest.compared_texts()
        if not value or not limit:
            return self.count_text
        relation = "furthest beyond its limit" if closest.ok is False else "closest to its limit"
        place_text = "" if closest.place.kind == "flight" else f"{relation} at {closest.where}: "
        source_text = _LIMIT_SOURCE_TEXTS.get(closest.limit_source, "")
        note = f"; {closest.tolerance_note}" if closest.tolerance_note else ""
        return f"{self.count_text}; {place_text}{margin.quantity} {value} (limit {limit}{source_text}{note})"

    @property
    def cells(self) -> tuple[str, ...]:
        """Cells of the rule's row in a table with the columns `RESULT_COLUMNS`.

        If the rule was not judged, the cell for the place contains the reason.
        """
        place = self.shown.where if self.shown else "" if self.judged_count else self.findings[0].reason
        numbers = number_texts(self.shown) if self.shown else NumberTexts()
        return (self.words.word, state_text(self.state), self.tally_text, place, *numbers)


def findings_by_rule(findings: Sequence[Finding]) -> tuple[RuleFindings, ...]:
    """Group findings by rule in the order of `RULE_WORDS`, with photo overlap as a group of its own.

    A rule without findings is omitted.  The worst of a rule's failed findings is first.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> beyond = {0: 2.0, 1: 5.0}
    >>> slopes = [make_finding("slope", Place("leg", k), ok=False, reason="", margin=-m) for k, m in beyond.items()]
    >>> [[finding.place.index for finding in rule.failed] for rule in findings_by_rule(slopes)]
    [[1, 0]]
    """
    grouped: dict[str, list[Finding]] = {words.title: [] for words in _SHOWN_WORDS}
    for finding in findings:
        grouped[finding_words(finding).title].append(finding)
    return tuple(RuleFindings(words, tuple(grouped[words.title])) for words in _SHOWN_WORDS if grouped[words.title])
