"""The verdict as data: findings, and the two questions they answer."""

import json
from dataclasses import asdict, dataclass
from typing import Any

SCHEMA = "planfly.verdict/1"

RULES = ("turn", "slope", "clearance", "threat", "bounds", "waypoint", "speed", "energy", "departure", "completion")


@dataclass(frozen=True, slots=True)
class Finding:
    """One rule at one place: what was planned, what was flown, what is allowed.

    where: "waypoint 3 (item 4)", "leg 2", "flight".  planned, flown, limit, tolerance, margin: in `unit`, None
    where there is no such number.  margin: how far inside the limit (negative: beyond), tolerance not
    counted.  limit_source: "scenario", "aircraft", or what set it.  method: how the number was got.
    ok: None where it was not judged, with the reason.
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


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a plan really flies.

    flyable: complete, and no finding failed.  complete: the plan was feasible, flown to its end, and recorded
    whole.  level: "flown" or "geometric" (from the envelope, without a flight).
    """

    findings: tuple[Finding, ...]
    flyable: bool
    complete: bool
    summary: str
    level: str


def verdict_json(verdict: Verdict) -> str:
    """The verdict as the text of a ``verdict.json``."""
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "level": verdict.level,
        "flyable": verdict.flyable,
        "complete": verdict.complete,
        "summary": verdict.summary,
        "findings": [asdict(finding) for finding in verdict.findings],
    }
    return json.dumps(data, indent=1, allow_nan=False) + "\n"
