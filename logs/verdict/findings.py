"""Define the findings of a verdict as data."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from logs.verdict.places import Place, Suggestion
from logs.verdict.wording import (
    compared_texts,
    place_text,
    quantity_text,
    shorten_statement,
    suggestions_text,
    within_tolerance_text,
)
from world.json_schema import DocumentConfig

# Fact of a slope finding: the largest error of the height above ground that its leg follows.
GROUND_FOLLOWING_ERROR = "error of the height above ground"
# Fact: altitude error where a failed leg is lowest above its required height, m, positive above the leg.
LOWEST_POINT_ERROR = "height error at the lowest point"
# Fact of a slope finding: time with the pitch at the autopilot's limit.
PITCH_LIMIT_TIME = "pitch at its limit"
# Fact of a slope finding: time with the throttle at its upper limit.
FULL_THROTTLE_TIME = "throttle at full"
# Fact of a slope finding: steepest slope that the aircraft can fly, if the leg or its arc exceeds it.
AIRCRAFT_SLOPE = "steepest slope of the aircraft"

# Values of `Finding.check` for unjudged findings that leave the verdict undecided.
# The aircraft is not known well enough.
UNKNOWN_AIRCRAFT = "unknown aircraft"
# Only a flight shows the flown path.
UNKNOWN_PATH = "unknown way"
# The path from the ground or to the ground may not be clear of obstacles.
GROUND_PATH = "ground way"
# An item that changes the flight path is not flown as the autopilot would fly it, or parameters contradict one another.
NOT_FLOWN = "not flown"
# Simulated returns to launch or glides that a scenario requires are not known well enough.
UNKNOWN_RETURN = "unknown return"
# The side overlap is sufficient, but the crab angles reduce the common area of the photos below what is required.
UNKNOWN_OVERLAP = "unknown overlap"
# The return to launch after the last item has no destination, because the mission has no home.  The verdict may still
# be "flyable", as without elevation data.
NO_HOME = "no home"
# Checks that a flight cannot decide.  A flight may pass although they are undecided.
APART_FROM_FLIGHT = (GROUND_PATH, UNKNOWN_RETURN, UNKNOWN_OVERLAP)
_UNDECIDED = (UNKNOWN_AIRCRAFT, UNKNOWN_PATH, NOT_FLOWN, *APART_FROM_FLIGHT)


# State of a finding, of the findings of a rule, or of a verdict, as shown by signs and colors: "open" if something that
# is not judged leaves the verdict undecided, "unjudged" if it does not.
State = Literal["ok", "fail", "open", "unjudged"]


@dataclass(frozen=True, slots=True)
class Fact(DocumentConfig):
    """Number that a rule measured but does not judge."""

    what: str
    """overshoot, settled, bank, radius, height error, slope error, throttle at full, nearest, ..."""
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one rule at one place.

    rule: a name of `logs.verdict.rule_words.RULE_WORDS`.
    place: place of the finding.
    planned, flown, limit, tolerance, margin: numbers in `unit`; None if there is no such number.
    margin: distance inside the limit without the tolerance; negative beyond the limit.
    limit_source: "scenario", "aircraft", or another source of the limit.
    method: how the numbers were obtained.
    ok: True if the finding passes, False if it fails, None if it was not judged.
    reason: the reason for a person to read; all data for programs are in other fields.
    suggestions: for a failed finding, changes of the plan with which it passes, the smallest change first.
    brief: the reason in a few words, for a headline.
    placed: True if the reason begins with the place.
    check: name of the check, for a rule with several checks; `UNKNOWN_AIRCRAFT`, `UNKNOWN_PATH`, `NOT_FLOWN`,
        `GROUND_PATH`, `UNKNOWN_RETURN` or `UNKNOWN_OVERLAP` if the finding is undecided for that reason; `NO_HOME` if
        it is not judged for that reason; "" otherwise.
    facts: other measured numbers, which are not judged.
    at_least: True if values of at least the limit pass, False if values of at most the limit pass.
    """

    rule: str
    place: Place
    planned: float | None
    flown: float | None
    limit: float | None
    limit_source: str
    tolerance: float | None
    margin: float | None
    unit: str
    method: str
    ok: bool | None
    reason: str
    suggestions: tuple[Suggestion, ...] = ()
    brief: str = ""
    placed: bool = False
    check: str = ""
    facts: tuple[Fact, ...] = ()
    at_least: bool = False

    @property
    def state(self) -> State:
        """State of the finding: "ok", "fail", "open" or "unjudged" (see `State`).

        Signs and colors show the state.

        >>> make_finding("slope", Place("leg", 1), ok=None, reason="", check=UNKNOWN_AIRCRAFT).state
        'open'
        """
        if self.ok is None:
            return "open" if self.check in _UNDECIDED else "unjudged"
        return "ok" if self.ok else "fail"

    @property
    def effective_limit(self) -> float | None:
        """Limit extended by its tolerance; None without a limit.

        If the finding fails for a reason other than its number, the tolerance is left out.

        >>> make_finding("waypoint", Place("waypoint", 1), ok=True, reason="", limit=3.0, tolerance=5.3).effective_limit
        8.3
        """
        if self.limit is None:
            return None
        tolerance = 0.0 if self.ok is False and self.margin is None else self.tolerance or 0.0
        return self.limit - tolerance if self.at_least else self.limit + tolerance

    @property
    def shown_limit(self) -> float | None:
        """Limit to show next to the value; includes the tolerance unless `tolerance_note` states it."""
        return self.limit if self.tolerance_note else self.effective_limit

    @property
    def limit_sign(self) -> str:
        """Comparison sign between a passing value and the limit."""
        return "≥" if self.at_least else "≤"

    @property
    def value(self) -> float | None:
        """Value that was compared with the limit: the flown or the planned value, as the margin shows.

        Without a limit or a margin, it is the flown value, or else the planned value; None if both are missing.
        """
        if self.flown is None or self.planned is None or self.limit is None or self.margin is None:
            return self.planned if self.flown is None else self.flown
        sign = 1.0 if self.at_least else -1.0
        errors = {value: abs(sign * (value - self.limit) - self.margin) for value in (self.flown, self.planned)}
        return min(errors, key=lambda value: errors[value])

    @property
    def nearest_distance(self) -> float | None:
        """Distance from the nearest kill zone or airspace zone, m, negative inside it, or None.

        It is the fact "nearest", which only findings of the rules `threat` and `fence` may have.
        """
        return next((fact.value for fact in self.facts if fact.what == "nearest"), None)

    @property
    def limit_text(self) -> str:
        """Passing values as text, including the tolerance, such as "≤ 12 m"; "" without a limit.

        >>> make_finding("stall", Place("flight"), ok=True, reason="", limit=9.5, unit="m/s", at_least=True).limit_text
        '≥ 9.5 m/s'
        """
        return self._value_and_limit_texts(self.effective_limit)[1]

    def compared_texts(self) -> tuple[str, str]:
        """Return the value and the range of passing values as texts, with enough digits to tell the two apart.

        The range includes the tolerance, unless `tolerance_note` states it.
        """
        return self._value_and_limit_texts(self.shown_limit)

    def _value_and_limit_texts(self, limit: float | None) -> tuple[str, str]:
        """Return the value and the passing range ("≤ limit" or "≥ limit") as texts; "" for a missing number.

        Both have enough digits to tell value and limit apart.
        """
        value = self.value
        if value is None or limit is None:
            texts = ["" if number is None else quantity_text(number, self.unit) for number in (value, limit)]
        else:
            texts = list(compared_texts(value, limit, self.unit))
        return texts[0], f"{self.limit_sign} {texts[1]}" if texts[1] else ""

    @property
    def tolerance_note(self) -> str:
        """Note on a value that is beyond its limit but passes within the tolerance; otherwise "".

        >>> place = Place("leg", 1)
        >>> make_finding("stall", place, ok=True, reason="", tolerance=0.2, margin=-0.1, unit="m/s").tolerance_note
        'within the tolerance of 0.2 m/s'
        """
        is_beyond_limit = self.ok is True and self.margin is not None and self.margin < 0.0
        return within_tolerance_text(self.tolerance, self.unit) if is_beyond_limit else ""

    @property
    def where(self) -> str:
        """Name of the place, such as "leg 4"."""
        return place_text(self.place)

    @property
    def place_and_value(self) -> str:
        """Text of the place with the value, if there is one, such as "leg 4: 12.3 m".

        A finding without a margin did not fail because of its value; its brief reason then replaces the value.
        """
        value = self.compared_texts()[0] if self.margin is not None else shorten_statement(self.brief)
        return self.where + (f": {value}" if value else "")

    @property
    def suggestion(self) -> str:
        """Text of the suggestions; "" without suggestions."""
        return suggestions_text(self.suggestions)


@dataclass(frozen=True, slots=True)
class Message:
    """Statement of a rule, from which the reason of a finding is made.

    text: full text.
    brief: first part of the text, for a headline.
    placed: True if the message begins with the finding's place.
    """

    text: str
    brief: str
    placed: bool = False


def message(brief: str, explanation: str = "", *, placed: bool = False) -> Message:
    """Make a message from a brief statement, which a headline shows, and an explanation.

    explanation: appended as it is, so it begins with its own punctuation or space.
    placed: True if the message begins with the finding's place.

    >>> message("overshoots its arc by 8 m", " (at most 5 m)").text
    'overshoots its arc by 8 m (at most 5 m)'
    """
    return Message(brief + explanation, brief, placed)


def undecided_findings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings that leave the verdict undecided, such as findings on an uncertain aircraft.

    >>> slope = make_finding("slope", Place("leg", 1), ok=None, reason="", check=UNKNOWN_AIRCRAFT)
    >>> undecided_findings([slope]) == (slope,)
    True
    """
    return tuple(finding for finding in findings if finding.state == "open")


def closest_to_limit(findings: Iterable[Finding]) -> Finding | None:
    """Return the failed finding furthest beyond its limit, or else the finding closest to its limit.

    A failed finding without a margin ranks behind failed findings with one.  Return None if nothing failed and no
    passed finding has a margin.

    >>> wide, close = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (9.0, 4.0))
    >>> failed = make_finding("slope", Place("leg", 2), ok=False, reason="too slow", margin=5.0)
    >>> closest_to_limit([wide, close]) is close, closest_to_limit([wide, failed, close]) is failed
    (True, True)
    """
    judged_findings = (
        finding for finding in findings if finding.ok is False or (finding.ok is True and finding.margin is not None)
    )
    return min(
        judged_findings,
        key=lambda finding: (finding.ok is True, math.inf if finding.margin is None else finding.margin),
        default=None,
    )


def make_finding(
    rule: str,
    place: Place,
    *,
    ok: bool | None,
    reason: str,
    faults: Sequence[Message] = (),
    planned: float | None = None,
    flown: float | None = None,
    limit: float | None = None,
    source: str = "none",
    tolerance: float | None = None,
    margin: float | None = None,
    unit: str = "",
    method: str = "",
    check: str = "",
    facts: Sequence[Fact] = (),
    at_least: bool = False,
) -> Finding:
    """Make a finding with numbers rounded to 1e-6; non-finite numbers become None.

    reason: the whole reason, which begins with the faults.
    faults: messages on what failed.  The brief reason comes from the first one; without faults, it is `reason`.
    facts: further measured numbers; non-finite numbers are omitted.
    at_least: True if values of at least the limit pass.

    The margin is dropped if it contradicts `ok`: something other than the number then decided the outcome.

    >>> make_finding("speed", Place("leg", 2), ok=False, reason="too slow", limit=16.0, margin=0.5).margin is None
    True
    >>> make_finding("slope", Place("leg", 2), ok=True, reason="a step", tolerance=0.1, margin=-0.2).margin is None
    True
    """
    if ok is not None and margin is not None and bool(ok) != bool(margin >= -(tolerance or 0.0)):
        margin = None
    return Finding(
        rule=rule,
        place=place,
        planned=_rounded_or_none(planned),
        flown=_rounded_or_none(flown),
        limit=_rounded_or_none(limit),
        limit_source=source,
        tolerance=_rounded_or_none(tolerance),
        margin=_rounded_or_none(margin),
        unit=unit,
        method=method,
        ok=None if ok is None else bool(ok),
        reason=reason,
        brief=faults[0].brief if faults else reason,
        placed=bool(faults) and faults[0].placed,
        check=check,
        facts=tuple(replace(fact, value=round(fact.value, 6) + 0.0) for fact in facts if math.isfinite(fact.value)),
        at_least=at_least,
    )


def _rounded_or_none(value: float | None) -> float | None:
    """Round a number to 1e-6; return None for a missing or non-finite number."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 6) + 0.0  # no -0.0


def worst_first_key(finding: Finding) -> tuple[int, float]:
    """Return a sort key: failed findings first, then unjudged, then passed.

    Each group is sorted by increasing margin.

    >>> near, far = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (4.0, 9.0))
    >>> worst_first_key(near) < worst_first_key(far)
    True
    """
    rank = {False: 0, None: 1, True: 2}[finding.ok]
    return rank, 0.0 if finding.margin is None else finding.margin


def finding_reason(faults: Sequence[Message], facts: Sequence[str] = ()) -> str:
    """Join faults and details of a finding into its reason.

    facts: texts on measured values, such as "radius 76 m".

    >>> finding_reason([message("overshoots its arc by 8 m")], ["turns 62.0°", "radius 76 m"])
    'overshoots its arc by 8 m. Details: turns 62.0°; radius 76 m'
    """
    facts_text = "; ".join(facts)
    if not faults:
        return facts_text
    return "; ".join(fault.text for fault in faults) + (f". Details: {facts_text}" if facts_text else "")
