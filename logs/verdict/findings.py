"""The verdict as data: findings, and the two questions they answer."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from flight.autopilots.autopilot import AutopilotProgram, Parameters
from logs.verdict.conditions import Conditions
from logs.verdict.places import DecidingParameter, LevelAnswer, Place, Suggestion
from logs.verdict.wording import deciding_text, disagreement_text, place_text, suggestions_text
from world.extras import need_extra

SCHEMA = "planfly.verdict/3"
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
class Fact:
    """A number that a rule measured and does not judge.

    what: "overshoot", "settled", "bank", "radius", "height error", "slope error", "throttle at full", "throttle at
    idle", "too slow", "too fast", "speed error", "nearest", "nearest pass".
    value: in ``unit``.
    """

    what: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule at one place: what was planned, what was flown, what is allowed.

    rule: a name of `logs.verdict.rules.registry.RULES`.
    place: where.
    planned, flown, limit, tolerance, margin: in `unit`, None where there is no such number.
    margin: how far inside the limit (negative: beyond), tolerance not counted.
    limit_source: "scenario", "aircraft", or what set it.
    method: how the numbers were got.
    ok: None where it was not judged.
    reason: why, for a person to read; everything that a program needs of it stands in another field.
    suggestions: of a failed finding, the smallest changes of the plan that would pass it, the least change first.
    brief: the reason in a few words, for a headline.
    placed: whether the reason begins with the place.
    check: where a rule has several checks, which one; `UNKNOWN_AIRCRAFT`, `UNKNOWN_WAY`, `NOT_FLOWN`, `GROUND_WAY` or
    `UNKNOWN_RETURN` of what those leave open; "" otherwise.
    facts: what was measured beside it and is no fault.
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


@dataclass(frozen=True, slots=True, repr=False)
class Verdict:
    """Whether a plan really flies.

    flyable: complete, and no finding failed.
    complete: the plan was feasible, flown to its end, and recorded whole (at the geometric level: feasible, or a
    mission that a person brought).
    lines: the summary for a person, of which the first, the headline, answers the question.
    level: "flown", "geometric" (from the envelope, without a flight) or "plan" (no feasible plan, so nothing was
    flown).
    levels: what each level says that was asked, geometry first, the verdict's own last; none of a plan that was not
    flown.
    deciding: the autopilot's parameter that decides, where the flight fails by one and the aircraft passes.
    notes: what is not flown as the mission has it; the lines say it too.
    leg_ends: of a flown verdict, when the flight passed each waypoint between its ends, s, and inf from the first that
    it did not get to; empty where too little was recorded to tell.
    program: of a flown verdict, the real autopilot that flew, None where none did.
    parameters: of a flown verdict, those of the ArduPlane that flew, by its law or itself; None where none did.
    unjudged: what was not judged, so that the flight is not flyable although nothing failed; "" for nothing: items that
    the log of an imported flight lacks, its end, or slopes that the aircraft is not known well enough for.
    imported: of a flight that another program logged, which was flown as planned or was not.
    conditions: what it is for: aircraft, speed, weather, navigation, autopilot, ground; the lines say it too.

    >>> verdict = Verdict((), flyable=True, complete=True, lines=("flyable", "Start: not stated"), level="flown")
    >>> verdict.headline, verdict.summary.count("Start")
    ('flyable', 1)
    >>> verdict
    <Verdict flown: flyable; 0 findings, 0 failed>
    """

    findings: tuple[Finding, ...]
    flyable: bool
    complete: bool
    lines: tuple[str, ...]
    level: str
    levels: tuple[LevelAnswer, ...] = ()
    deciding: DecidingParameter | None = None
    notes: tuple[str, ...] = ()
    leg_ends: tuple[float, ...] = ()
    program: AutopilotProgram | None = None
    parameters: Parameters | None = None
    unjudged: str = ""
    imported: bool = False
    conditions: Conditions | None = None

    @property
    def answer(self) -> str:
        """The verdict in a few words.

        >>> Verdict((), flyable=False, complete=True, lines=(), level="flown", imported=True).answer
        'not flown as planned'
        """
        if self.undecided:
            return "not judged in full"
        yes = "flown as planned" if self.imported else "flyable"
        return yes if self.flyable else f"not {yes}" if self.complete else "incomplete"

    @property
    def undecided(self) -> bool:
        """Whether nothing failed, and a part of the mission was not judged."""
        return bool(self.unjudged) and not self.failed

    @property
    def flies(self) -> bool:
        """Whether it is flyable, but for ways from and to the ground and returns that are left open beside the flight.

        >>> open_way = make_finding("climbout", Place("waypoint", 0), ok=None, reason="", check=GROUND_WAY)
        >>> verdict = Verdict((open_way,), flyable=False, complete=True, lines=(), level="flown", unjudged="a way")
        >>> verdict.flies, replace(verdict, complete=False).flies
        (True, False)
        """
        beside = all(item.check in BESIDE_FLIGHT for item in left_open(self.findings))
        return self.flyable or (self.complete and self.undecided and beside)

    @property
    def headline(self) -> str:
        """The answer in a line."""
        return self.lines[0] if self.lines else ""

    @property
    def summary(self) -> str:
        """All lines as one text."""
        return "\n".join(self.lines)

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The findings that fail."""
        return tuple(finding for finding in self.findings if finding.ok is False)

    @property
    def closest(self) -> dict[str, Finding]:
        """By rule the failed finding that is furthest beyond its limit, else the one closest to it.

        Rules of which nothing was judged by a number, or failed, are not among them.

        >>> near, far = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (4.0, 9.0))
        >>> verdict = Verdict((far, near), flyable=True, complete=True, lines=(), level="flown")
        >>> verdict.closest["slope"].margin
        4.0
        """
        rules = dict.fromkeys(finding.rule for finding in self.findings)
        found = {rule: closest_to_limit(one for one in self.findings if one.rule == rule) for rule in rules}
        return {rule: finding for rule, finding in found.items() if finding is not None}

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: a row a finding, in the verdict's order, NaN for numbers that it has none of.

        Columns: rule, place and index (of the leg, turn or threat), then as in `Finding`: planned, flown, limit,
        tolerance, margin, unit, limit_source, method, ok (None where it was not judged) and reason.
        Raises `planfly.MissingExtraError`, which is an ImportError, without the extra ``planfly[tables]``.
        """
        need_extra("tables", "to_pandas() needs")
        # An extra: nobody else needs it.
        import pandas as pd

        numbers = ("planned", "flown", "limit", "tolerance", "margin")
        names = (*numbers, "unit", "limit_source", "method", "ok", "reason")
        rows = [
            [one.rule, one.place.kind, one.place.index, *(getattr(one, name) for name in names)]
            for one in self.findings
        ]
        frame = pd.DataFrame(rows, columns=["rule", "place", "index", *names])
        return frame.astype(dict.fromkeys(numbers, float))

    def __repr__(self) -> str:
        return f"<Verdict {self.level}: {self.answer}; {len(self.findings)} findings, {len(self.failed)} failed>"

    def to_junit(self, name: str) -> str:
        """The verdict as JUnit XML, as continuous integration shows test results.  name: of what was judged."""
        from logs.verdict.junit import junit_text

        return junit_text({name: self})

    def _repr_html_(self) -> str:
        """How a notebook shows it."""
        from logs.verdict.summary import verdict_html

        return verdict_html(self)


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
    """Make a finding of plain numbers: rounded to 1e-6, and None for what is not finite.

    faults: what the reason begins with, where it begins with faults.
    facts: measured beside it; one that is not a number is left out.
    A finding that fails by other evidence than its number, which is within the limit and its tolerance, has no margin:
    the reason says what failed.

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


def verdict_json(verdict: Verdict) -> str:
    """Write the verdict as the text of a ``verdict.json``: each place and suggestion as data and in words.

    >>> finding = make_finding("turn", Place("waypoint", 1, item=2), ok=True, reason="turns 30.0°", planned=30.0)
    >>> written = json.loads(verdict_json(Verdict((finding,), True, True, ("flyable",), "flown")))
    >>> written["schema"], written["summary"], written["findings"][0]["where"], written["findings"][0]["place"]["index"]
    ('planfly.verdict/3', 'flyable', 'waypoint 1 (item 2)', 1)
    """
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "level": verdict.level,
        "flyable": verdict.flyable,
        "complete": verdict.complete,
        "answer": verdict.answer,
        "undecided": verdict.undecided,
        "summary": verdict.summary,
        "conditions": None if verdict.conditions is None else asdict(verdict.conditions),
        "flown_by": None if verdict.program is None else asdict(verdict.program),
        "parameters": None if verdict.parameters is None else _parameters_data(verdict.parameters),
        "levels": [_level_data(level) for level in verdict.levels],
        "deciding_parameter": None if verdict.deciding is None else _deciding_data(verdict.deciding),
        "findings": [_finding_data(finding) for finding in verdict.findings],
    }
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def _parameters_data(parameters: Parameters) -> dict[str, Any]:
    """Each parameter's value, in ArduPlane's unit, and who states it; and what a file states that has no use."""
    return {
        "file": parameters.source,
        "values": [parameter._asdict() for parameter in parameters.values],
        "unused": list(parameters.unused),
        "not_flown": list(parameters.not_flown),
    }


def _level_data(level: LevelAnswer) -> dict[str, Any]:
    differing = level.disagreements
    return {
        "name": level.name,
        "flyable": level.flyable,
        "undecided": level.undecided,
        "headline": level.headline,
        "disagreements": [disagreement_text(one) for one in differing],
        "differences": [asdict(one) for one in differing],
    }


def _deciding_data(deciding: DecidingParameter) -> dict[str, Any]:
    return {**asdict(deciding), "text": deciding_text(deciding)}


def _finding_data(finding: Finding) -> dict[str, Any]:
    """A finding's fields, and its place and suggestions in words beside them."""
    data = asdict(finding)
    return {
        "rule": data.pop("rule"),
        "where": place_text(finding.place),
        **data,
        "suggestion": suggestions_text(finding.suggestions),
    }
