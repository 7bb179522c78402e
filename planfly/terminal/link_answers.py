"""Answer of ``planfly link`` with ``--json``."""

from typing import Literal

from pydantic.dataclasses import dataclass

from logs.verdict.conditions import Conditions
from planfly.terminal.verdict_answers import STRICT


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class OutageEntry:
    """Stretch of the flight below the fade margin, with the margin and the position of its worst point."""

    first_s: float
    last_s: float
    margin_db: float
    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class LinkAnswer:
    """planfly link: the radio link along a flight."""

    schema: Literal["planfly.link/1"] = "planfly.link/1"
    exit_code: int
    what: str
    headline: str
    where: str
    """Leg with the least margin; empty if no margin is known."""
    ok: bool | None
    """False if the link is lost for longer than accepted; null if it is not known."""
    conditions: Conditions
    facts: dict[str, float]
    """Least margin (dB), time below the fade margin (s), greatest distance (m), least Fresnel clearance (radii)."""
    outages: list[OutageEntry]
    returns: str | None
    """Outcome of the autopilot's returns from the outages; null if it does not return."""
    files: list[str]
    """Files that were written."""
