"""What would have passed where a finding fails: the number, the changes of the plan, the autopilot's parameter."""

from dataclasses import dataclass
from typing import Literal

from logs.verdict.findings import Finding
from logs.verdict.levels import DecidingParameter
from logs.verdict.places import Suggestion

# How far a margin may be from the difference that it is, in the finding's unit: both are rounded to 1e-6.
_SAME = 1e-5


@dataclass(frozen=True, slots=True)
class WouldPass:
    """What would have passed one failed finding.

    bound: how the number that passes bounds what was flown; None where the finding fails by other evidence.
    value: that number, in the finding's unit.
    misses: how far beyond it the flight, or the plan, was; tolerance not counted.
    suggestions: the smallest changes of the plan, any of which would pass.
    parameter: that of the autopilot which decides, where it fails this finding first.
    """

    bound: Literal["at most", "at least"] | None
    value: float | None
    misses: float | None
    suggestions: tuple[Suggestion, ...]
    parameter: DecidingParameter | None

    def __bool__(self) -> bool:
        """Something is known that would pass."""
        return bool(self.bound or self.suggestions or self.parameter)


def would_pass(finding: Finding, deciding: DecidingParameter | None) -> WouldPass:
    """What would have passed a failed finding.

    deciding: the verdict's.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> low = make_finding("clearance", Place("leg", 4), ok=False, reason="", flown=52.0, limit=60.0, margin=-8.0)
    >>> found = would_pass(low, None)
    >>> found.bound, found.value, found.misses
    ('at least', 60.0, 8.0)
    """
    bound = _bound(finding)
    known = bound is not None and finding.margin is not None
    same = deciding is not None and (deciding.rule, deciding.place) == (finding.rule, finding.place)
    return WouldPass(
        bound=bound,
        value=finding.limit if known else None,
        misses=-finding.margin if known and finding.margin is not None else None,
        suggestions=finding.suggestions,
        parameter=deciding if same else None,
    )


def _bound(finding: Finding) -> Literal["at most", "at least"] | None:
    """Which side of its limit passes: that to which the margin counts; of a slope down, its steepness is bounded."""
    if finding.limit is None or finding.margin is None:
        return None
    values = [value for value in (finding.flown, finding.planned) if value is not None]
    if finding.rule == "slope" or not values:
        return "at most"
    if any(abs(value - finding.limit - finding.margin) < _SAME for value in values):
        return "at least"
    return "at most"
