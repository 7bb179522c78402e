"""The findings of a verdict as data."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from logs.verdict.places import Place, Suggestion
from logs.verdict.wording import place_text, suggestions_text
from world.json_schema import DocumentConfig

# The check of a finding that is not judged because the aircraft is not known well enough.
UNKNOWN_AIRCRAFT = "unknown aircraft"
# And of one whose way a flight tells, and geometry does not.
UNKNOWN_WAY = "unknown way"
# And of a way from the ground or to it that may not be free.
GROUND_WAY = "ground way"
# And of an item that changes the flight path and is not flown as the autopilot would, or of parameters that contradict
# one another, where nothing is flown.
NOT_FLOWN = "not flown"
# And of returns or glides that a scenario requires, which are not known well enough.
UNKNOWN_RETURN = "unknown return"
# What stands beside the flight and no flight shows: a flight may go well all the same.
BESIDE_FLIGHT = (GROUND_WAY, UNKNOWN_RETURN)
_OPEN = (UNKNOWN_AIRCRAFT, UNKNOWN_WAY, NOT_FLOWN, *BESIDE_FLIGHT)


@dataclass(frozen=True, slots=True)
class Fact(DocumentConfig):
    """Number that a rule measured and does not judge."""

    what: str
    """overshoot, settled, bank, radius, height error, slope error, throttle at full, nearest, ..."""
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one rule at one place: the planned value, the flown value, and the limit.

    rule: a name of `logs.verdict.rule_words.RULE_WORDS`.
    place: place of the finding.
    planned, flown, limit, tolerance, margin: in `unit`, None if there is no such number.
    margin: distance inside the limit (negative: beyond), without the tolerance.
    limit_source: "scenario", "aircraft", or another source of the limit.
    method: how the numbers were obtained.
    ok: None if it was not judged.
    reason: the reason for a person to read; everything that a program needs is in other fields.
    suggestions: for a failed finding, the smallest changes of the plan with which it passes, the least change first.
    brief: the reason in a few words, for a headline.
    placed: True if the reason begins with the place.
    check: the check of a rule with several checks; `UNKNOWN_AIRCRAFT`, `UNKNOWN_WAY`, `NOT_FLOWN`, `GROUND_WAY` or
        `UNKNOWN_RETURN` for what those leave undecided; "" otherwise.
    facts: further measured numbers that are no faults.
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

    @property
    def where(self) -> str:
        """Place in words."""
        return place_text(self.place)

    @property
    def suggestion(self) -> str:
        """Suggestions in words, "" without any."""
        return suggestions_text(self.suggestions)


@dataclass(frozen=True, slots=True)
class Message:
    """A statement of a rule: in full, and how it begins, which is what a headline takes.

    placed: whether it begins with the finding's place.
    """

    text: str
    brief: str
    placed: bool = False


def message(brief: str, more: str = "", *, placed: bool = False) -> Message:
    """Make a statement of its beginning and the rest.

    >>> message("overshoots its arc by 8 m", " (at most 5 m)").text
    'overshoots its arc by 8 m (at most 5 m)'
    """
    return Message(brief + more, brief, placed)


def left_open(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """The findings that are not judged because the aircraft or a way is not known well enough.

    >>> left_open([make_finding("slope", Place("leg", 1), ok=None, reason="", check=UNKNOWN_AIRCRAFT)])[0].place.index
    1
    """
    return tuple(item for item in findings if item.ok is None and item.check in _OPEN)


def closest_to_limit(findings: Iterable[Finding]) -> Finding | None:
    """Of one rule's findings the failed one that is furthest beyond its limit, else the one closest to it.

    A finding that fails by other evidence than its number has no margin and comes after failed ones that have one.
    None where nothing was judged by a number.

    >>> wide, close = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (9.0, 4.0))
    >>> failed = make_finding("slope", Place("leg", 2), ok=False, reason="too slow", margin=5.0)
    >>> closest_to_limit([wide, close]) is close, closest_to_limit([wide, failed, close]) is failed
    (True, True)
    """
    judged = (one for one in findings if one.ok is False or (one.ok is True and one.margin is not None))
    return min(judged, key=lambda one: (one.ok is True, math.inf if one.margin is None else one.margin), default=None)


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
) -> Finding:
    """Make a finding with numbers rounded to 1e-6, and None for non-finite numbers.

    faults: the beginning of the reason, if it begins with faults.
    facts: further measured numbers; non-finite ones are left out.
    A finding that fails by other evidence while its number is within the limit and its tolerance has no margin: the
    reason says what failed.

    >>> make_finding("speed", Place("leg", 2), ok=False, reason="too slow", limit=16.0, margin=0.5).margin is None
    True
    """
    if ok is False and margin is not None and margin >= -(tolerance or 0.0):
        margin = None
    return Finding(
        rule=rule,
        place=place,
        planned=_plain(planned),
        flown=_plain(flown),
        limit=_plain(limit),
        limit_source=source,
        tolerance=_plain(tolerance),
        margin=_plain(margin),
        unit=unit,
        method=method,
        ok=None if ok is None else bool(ok),
        reason=reason,
        brief=faults[0].brief if faults else reason,
        placed=bool(faults) and faults[0].placed,
        check=check,
        facts=tuple(replace(fact, value=round(fact.value, 6) + 0.0) for fact in facts if math.isfinite(fact.value)),
    )


def _plain(value: float | None) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 6) + 0.0  # no -0.0


def badness(item: Finding) -> tuple[int, float]:
    """Order of findings from the worst: failed, open, passed, and by margin.

    >>> near, far = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (4.0, 9.0))
    >>> badness(near) < badness(far)
    True
    """
    return (0 if item.ok is False else 1 if item.ok is None else 2), 0.0 if item.margin is None else item.margin


def reason_of(faults: Sequence[Message], facts: Sequence[str] = ()) -> str:
    """Faults with the facts in brackets after them, or the facts alone.

    >>> reason_of([message("bank 40.0° beyond 35.0°")], ["turns 62.0°", "radius 76 m"])
    'bank 40.0° beyond 35.0° (turns 62.0°; radius 76 m)'
    """
    known = "; ".join(facts)
    if not faults:
        return known
    return "; ".join(fault.text for fault in faults) + (f" ({known})" if known else "")
