"""Answer of ``planfly ground-risk`` with ``--json``."""

from typing import Literal

from pydantic.dataclasses import dataclass

from logs.verdict.conditions import Conditions
from planfly.terminal.verdict_answers import STRICT


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PopulationEntry:
    """Population in operational volume and ground risk buffer."""

    source: str
    known_fraction: float
    """Fraction of the footprint's cells that have data."""
    max_density_per_km2: float
    mean_density_per_km2: float
    max_lat_deg: float
    max_lon_deg: float
    cell_size_m: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class GroundRiskAnswer:
    """planfly ground-risk: the volumes and the ground risk class of a mission."""

    schema: Literal["planfly.ground-risk/1"] = "planfly.ground-risk/1"
    exit_code: int
    what: str
    headline: str
    is_judged: bool
    ground_risk_class: int | None
    """Intrinsic ground risk class; null if it is not judged, or if the operation is not part of SORA."""
    dimension_m: float
    max_speed_mps: float
    mass_kg: float
    probability: float
    flights: int
    completed: int
    geography_half_width_m: float
    geography_height_m: float
    flown_contingency_width_m: float
    flown_contingency_height_m: float
    formula_contingency_width_m: float
    formula_contingency_height_m: float
    flown_buffer_m: float
    one_to_one_buffer_m: float
    ballistic_buffer_m: float
    glide_buffer_m: float | None
    volume_area_km2: float
    footprint_area_km2: float
    population: PopulationEntry | None
    entered_zones: list[str]
    conditions: Conditions
    files: list[str]
