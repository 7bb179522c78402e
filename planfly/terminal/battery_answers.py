"""Answer of ``planfly battery`` with ``--json``."""

import math
from typing import Literal

from pydantic.dataclasses import dataclass

from logs.verdict.conditions import Conditions
from planfly.terminal.verdict_answers import STRICT


def finite_or_none(value: float) -> float | None:
    """Return a number, or None for NaN and infinity, which JSON does not have."""
    return value if math.isfinite(value) else None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class DecisionEntry:
    """Part of the flight that needs the most energy, in some of the flights."""

    flights: int
    returns_from_leg: int | None
    """Number of the leg, as in texts, on which the most expensive return starts; null if the mission itself needs the
    most energy."""
    start_s: float | None
    """Median start of these returns, s."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class BatteryAnswer:
    """planfly battery: the smallest battery for a mission and its returns."""

    schema: Literal["planfly.battery/1"] = "planfly.battery/1"
    exit_code: int
    what: str
    headline: str
    is_enough: bool | None
    """True if the aircraft's battery keeps the reserve with the probability; null if it is not known."""
    capacity_wh: float | None
    """Smallest capacity; null if no battery is enough, or if it is not known."""
    lowest_wh: float | None
    highest_wh: float | None
    own_capacity_wh: float | None
    """Capacity of the aircraft's battery; null if it is a guess."""
    mass_kg: float
    """Mass of the aircraft with the found battery."""
    probability: float
    confidence: float
    reserve: float
    specific_energy_wh_kg: float | None
    flights: int
    completed: int
    kept_by_own_battery: int
    """Flights in which the aircraft's battery keeps the reserve."""
    decisions: list[DecisionEntry]
    leg_energies_wh: list[float]
    """Median energy of each leg, by the leg's number in texts; all legs around a loiter are one."""
    conditions: Conditions
    files: list[str]
