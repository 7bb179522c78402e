"""What ``planfly campaign`` and ``planfly winds`` answer: also the content of summary.json and winds.json."""

from typing import Any, Literal

from pydantic.dataclasses import dataclass

from planfly.terminal.answers.verdict_document import STRICT


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FailedPlace:
    """Flights that failed a rule at a place; the place as of a verdict's finding."""

    where: str
    flights: int
    kind: str
    index: int | None
    item: int | None
    name: str
    to_item: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FailedRule:
    """Flights that failed a rule."""

    rule: str
    flights: int
    places: list[FailedPlace]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class SensitivityEntry:
    """How much of the deciding margin's spread a quantity makes."""

    quantity: str
    first_order: float | None
    rank_slope: float | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CampaignDocument:
    """planfly campaign: how likely a mission is to fly."""

    schema: Literal["planfly.campaign-summary/1"]
    name: str
    seed: int
    target: float | None
    """The probability that was asked for."""
    answer: str
    """reached, missed, undecided or none asked."""
    flights: int
    flyable: int
    not_flyable: int
    lost: list[int]
    """Flights without an outcome."""
    probability: float | None
    confidence: float
    lower_bound: float | None
    upper_bound: float | None
    interval: list[float | None]
    method: str
    failed_by_rule: list[FailedRule]
    deciding_rule: str
    margin_of_one_in_twenty: float | None
    margin_unit: str
    sensitivities: list[SensitivityEntry]
    worst: list[dict[str, Any]]
    spread: dict[str, Any]
    made_of: str
    """What the campaign was made of, as a hash."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindFlights:
    """Flights in one wind."""

    speed_mps: float
    flights: int
    flyable: int


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindDirection:
    """The boundary of one direction."""

    from_deg: float
    boundary_mps: float
    interval_mps: list[float]
    beyond: bool
    """Whether it flies in every wind that was looked at."""
    flown: list[WindFlights]


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class WindsDocument:
    """planfly winds: the largest wind from each direction."""

    schema: Literal["planfly.winds/1"]
    name: str
    seed: int
    target: float
    confidence: float
    most: float
    """The strongest wind that was looked at, m/s."""
    flights: int
    lost: list[int]
    """Flights without an outcome, from 0 in the order in which they were asked for; they count as not flyable."""
    directions: list[WindDirection]
    spread: dict[str, Any]
