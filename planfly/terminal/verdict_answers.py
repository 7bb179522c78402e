"""Answers of `planfly fly` and `planfly check` with ``--json``, which contain verdicts."""

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING, Literal

from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from logs.verdict.document import VerdictDocument

if TYPE_CHECKING:
    from planfly.workflow.pipeline import ReturnSummary

# Configuration of answers for pydantic.
STRICT = ConfigDict(extra="forbid", use_attribute_docstrings=True, json_schema_serialization_defaults_required=True)


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ReturnCounts:
    """Returns from some 50 points of a flight, which do not decide the verdict.

    `planfly returns` judges them all.
    """

    line: str
    """Summary of the returns, or the reason why none is judged."""
    returns: int
    """Number of returns."""
    outcomes: dict[str, int]
    """Number of returns of each outcome that occurs: ground, threat, zone, lost, energy, unknown, power, unsure, low or
    safe."""


def count_returns(summary: "ReturnSummary") -> ReturnCounts | None:
    """Return the numbers of returns in a summary; None for a mission without a home or a terrain."""
    if not summary.line:
        return None
    kinds = [] if summary.returns is None else [ret.kind for ret in summary.returns.each]
    return ReturnCounts(line=summary.line, returns=len(kinds), outcomes=dict(Counter(kinds)))


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FlyAnswer:
    """planfly fly: the log and the verdict."""

    schema: Literal["planfly.fly/1"] = "planfly.fly/1"
    exit_code: int
    mission: str
    headline: str
    """The verdict in one line."""
    seed: int
    log: str | None
    """Flight log; null if nothing was flown."""
    autopilot_log: str | None
    """Log that the autopilot program wrote; null if no program flew."""
    warnings: list[str]
    verdict: VerdictDocument
    returns: ReturnCounts | None


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class CheckAnswer(VerdictDocument):
    """planfly check: the verdict, as in verdict.json, the exit code and the returns."""

    exit_code: int
    headline: str
    """The verdict in one line."""
    returns: ReturnCounts | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class VerdictsDocument:
    """planfly check --for: the verdict on the mission for each autopilot."""

    schema: Literal["planfly.verdicts/1"] = "planfly.verdicts/1"
    exit_code: int
    mission: str
    verdicts: dict[str, VerdictDocument]
    """Verdicts by the name of the simulated autopilot."""


# Answer of ``planfly check``, without or with --for.
CheckDocument = CheckAnswer | VerdictsDocument
