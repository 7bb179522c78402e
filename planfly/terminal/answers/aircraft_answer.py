"""What ``planfly aircraft`` answers with ``--json``."""

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from pydantic.dataclasses import dataclass

from aircraft.catalog import Aircraft
from aircraft.envelope import Envelope
from flight.dynamics.characteristics import Mode, TrimRow
from planfly.terminal.answers.verdict_document import STRICT


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class TrimEntry:
    """Level flight at one airspeed."""

    airspeed_mps: float
    alpha_deg: float
    elevator_deg: float
    throttle: float
    power_w: float
    endurance_s: float | None
    """How long 80 % of what it carries lasts."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class ModeEntry:
    """A mode in cruise: its root, of a pair the one with the positive imaginary part."""

    name: str
    root_real_1_s: float
    root_imaginary_1_s: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftDetail:
    """What is worked out of one aircraft."""

    model_sha256: str
    level_speed_min_mps: float
    """At sea level."""
    level_speed_max_mps: float
    trims: list[TrimEntry]
    modes: list[ModeEntry]
    lacking: list[str]
    """What lacks in its folder for a flight."""
    files: list[str]
    """The pictures."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftEntry:
    """An aircraft."""

    name: str
    title: str
    folder: str
    mass_kg: float
    wing_area_m2: float
    wing_span_m: float
    airspeed_mps: float
    airspeed_min_mps: float
    airspeed_max_mps: float
    stall_speed_mps: float
    max_bank_deg: float
    detail: AircraftDetail | None
    """null in a list."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class AircraftAnswer:
    """planfly aircraft: the one that was named or made, or all that come with planfly."""

    schema: Literal["planfly.aircraft/1"] = "planfly.aircraft/1"
    exit_code: int
    aircraft: list[AircraftEntry]


class AircraftNumbers(NamedTuple):
    """What the command works out of an aircraft.

    modes: by airspeed, m/s.  cruise: modes in cruise.  steps: of `flight.dynamics.characteristics.step_responses`.
    """

    envelope: Envelope
    trims: tuple[TrimRow, ...]
    modes: dict[float, tuple[Mode, ...]]
    cruise: tuple[Mode, ...]
    steps: Any


def aircraft_entry(one: Aircraft, detail: AircraftDetail | None) -> AircraftEntry:
    """An aircraft's metadata, and what was worked out."""
    return AircraftEntry(
        name=one.name,
        title=one.title,
        folder=str(one.folder),
        mass_kg=one.mass,
        wing_area_m2=one.wing_area,
        wing_span_m=one.wing_span,
        airspeed_mps=one.airspeed,
        airspeed_min_mps=one.airspeed_min,
        airspeed_max_mps=one.airspeed_max,
        stall_speed_mps=one.stall_speed,
        max_bank_deg=round(math.degrees(one.max_bank), 9),
        detail=detail,
    )


def aircraft_detail(
    numbers: AircraftNumbers, identity: str, lacking: Sequence[str], files: Sequence[str]
) -> AircraftDetail:
    """What was worked out, in the answer's units."""
    slow, fast = numbers.envelope.level_speeds(0.0)
    trims = [
        TrimEntry(
            airspeed_mps=row.trim.airspeed,
            alpha_deg=math.degrees(row.trim.alpha),
            elevator_deg=math.degrees(row.trim.elevator),
            throttle=row.trim.throttle,
            power_w=row.power,
            endurance_s=row.endurance if math.isfinite(row.endurance) else None,
        )
        for row in numbers.trims
    ]
    modes = [
        ModeEntry(name=mode.name, root_real_1_s=mode.root.real, root_imaginary_1_s=mode.root.imag)
        for mode in numbers.cruise
    ]
    return AircraftDetail(
        model_sha256=identity,
        level_speed_min_mps=float(slow),
        level_speed_max_mps=float(fast),
        trims=trims,
        modes=modes,
        lacking=list(lacking),
        files=list(files),
    )
