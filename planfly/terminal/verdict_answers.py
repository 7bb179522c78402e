"""Answer of `planfly check` with ``--json``: one verdict, or one for each of several autopilots."""

import dataclasses
from typing import Literal

from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from logs.verdict.document import VerdictDocument

# Configuration of answers for pydantic.
STRICT = ConfigDict(extra="forbid", use_attribute_docstrings=True, json_schema_serialization_defaults_required=True)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class CheckAnswer(VerdictDocument):
    """planfly check: the verdict, as in verdict.json, and the exit code."""

    exit_code: int


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
