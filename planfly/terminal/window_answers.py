"""Answer of ``planfly window`` with ``--json``."""

from typing import Any, Literal

from pydantic.dataclasses import dataclass

from logs.verdict.conditions import Conditions
from planfly.terminal.verdict_answers import STRICT


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DepartureEntry:
    """One time of take-off."""

    time: str
    """Time of take-off, ISO 8601, UTC."""
    is_open: bool | None
    """True if the fraction of flyable flights reaches the probability; null if the departure is not judged."""
    not_judged: str
    flights: int
    flyable: int
    lowest: float | None
    highest: float | None
    """Interval of the probability of a flyable flight, with 95 % confidence."""
    wind_mps: float | None
    wind_from_deg: float | None
    """Mean wind at the start."""
    energy_left_wh: float | None
    """Lowest energy left at the end of a flight."""
    undecided: int
    """Flights that are not judged in full."""
    rules: list[str]
    """Rules that fail the most flights (ties included); empty without failures."""
    by_rule: list[dict[str, Any]]
    """Failed flights by rule and place."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindowEntry:
    """Run of open departures."""

    first: str
    last: str


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindowAnswer:
    """planfly window: the departures at which a mission is flyable."""

    schema: Literal["planfly.window/1"] = "planfly.window/1"
    exit_code: int
    what: str
    headline: str
    is_go: bool | None
    """True if the requested departure is open, or any departure if none is requested; null if it is not known, for
    example because flights are not judged in full."""
    asked: str | None
    """Requested time of take-off; null if any departure will do."""
    probability: float
    flights: int
    """Flights of each departure."""
    not_judged: str
    """Rules that are not judged in some flights, with their reasons; empty if all are judged."""
    windows: list[WindowEntry]
    departures: list[DepartureEntry]
    conditions: Conditions
    files: list[str]
