"""The verdict as data: findings, and the two questions they answer."""

import json
import math
from dataclasses import asdict, dataclass
from typing import Any

SCHEMA = "planfly.verdict/1"

RULES = (
    "mission",
    "turn",
    "loiter",
    "slope",
    "clearance",
    "threat",
    "bounds",
    "waypoint",
    "speed",
    "energy",
    "departure",
    "completion",
)


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule at one place: what was planned, what was flown, what is allowed.

    where: "waypoint 3 (item 4)", "leg 2", "flight"; waypoints and legs count from 0, as `Track.leg` does.
    planned, flown, limit, tolerance, margin: in `unit`, None where there is no such number.  margin: how far inside
    the limit (negative: beyond), tolerance not counted.  limit_source: "scenario", "aircraft", or what set it.
    method: how the number was got.  ok: None where it was not judged, with the reason.  suggestion: of a failed
    finding, the smallest changes of the plan that would pass it, "" where none is known.
    """

    rule: str
    where: str
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
    suggestion: str = ""


@dataclass(frozen=True, slots=True)
class Prediction:
    """What the geometric level says of a mission that was flown.

    headline: its answer in a line.  disagreements: one line for each finding that the two levels judge differently.
    """

    flyable: bool
    headline: str
    disagreements: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a plan really flies.

    flyable: complete, and no finding failed.  complete: the plan was feasible, flown to its end, and recorded
    whole (at the geometric level: feasible, or a mission that a person brought).  summary: lines, of which the first
    answers the question.  level: "flown", "geometric" (from the envelope, without a flight) or "plan" (no feasible
    plan, so nothing was flown).  prediction: of a flown verdict, what the geometric level says beside it.
    """

    findings: tuple[Finding, ...]
    flyable: bool
    complete: bool
    summary: str
    level: str
    prediction: Prediction | None = None


def make_finding(
    rule: str,
    where: str,
    *,
    ok: bool | None,
    reason: str,
    planned: float | None = None,
    flown: float | None = None,
    limit: float | None = None,
    source: str = "none",
    tolerance: float | None = None,
    margin: float | None = None,
    unit: str = "",
    method: str = "",
) -> Finding:
    """Make a finding of plain numbers: rounded to 1e-6, and None for what is not finite.

    A finding that fails by other evidence than its number has no margin: the reason says what failed.
    """
    if ok is False and margin is not None and margin >= 0.0:
        margin = None
    return Finding(
        rule=rule,
        where=where,
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
    )


def _plain(value: float | None) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 6) + 0.0  # no -0.0


def verdict_json(verdict: Verdict) -> str:
    """Write the verdict as the text of a ``verdict.json``."""
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "level": verdict.level,
        "flyable": verdict.flyable,
        "complete": verdict.complete,
        "summary": verdict.summary,
        "geometric": None if verdict.prediction is None else asdict(verdict.prediction),
        "findings": [asdict(finding) for finding in verdict.findings],
    }
    return json.dumps(data, indent=1, allow_nan=False) + "\n"
