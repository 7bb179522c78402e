"""Forecast of the wind, as its file states it, and the wind of a mission made from it."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np

from world.arrays import Floats
from world.forecast.wind_field import WindField

# Length of a degree of a great circle, km.
_KM_PER_DEGREE = 111.2
# Age at the departure after which a forecast is called old.
OLD_AGE = timedelta(hours=12)
# Longest step between two times between which the wind is interpolated.  Models state every hour to every 6 hours.
LONGEST_STEP = timedelta(hours=6)
# Longest time after the departure for which the wind is kept, s.
LONGEST_FLIGHT_S = 24 * 3600.0


class Box(NamedTuple):
    """Area around a mission, deg; the west is below the east, and may be below -180."""

    south: float
    west: float
    north: float
    east: float


@dataclass(frozen=True, eq=False, slots=True)
class Forecast:
    """Wind at the nodes of a forecast's grid around a mission.

    source: name of the file.
    issued: time of issue of the forecast; None if the file does not state it.
    times: (t,) time of each step, s since 1970 in UTC, ascending.
    latitudes, longitudes: (y,), (x,) deg, ascending.
    altitudes: (t, y, x, k) m AMSL, ascending along the last axis.
    velocities: (m, t, y, x, k, 2) m/s, east and north, of each member of an ensemble; m is 1 for a single forecast.
    ground: source of the ground above which heights are stated; "" if the levels state altitudes.
    """

    source: str
    issued: datetime | None
    times: Floats
    latitudes: Floats
    longitudes: Floats
    altitudes: Floats
    velocities: Floats
    ground: str = ""

    @property
    def members(self) -> int:
        """Number of members of the ensemble; 1 for a single forecast."""
        return len(self.velocities)

    @property
    def first_time(self) -> datetime:
        """First time of the forecast, UTC."""
        return datetime.fromtimestamp(float(self.times[0]), UTC)

    @property
    def last_time(self) -> datetime:
        """Last time of the forecast, UTC."""
        return datetime.fromtimestamp(float(self.times[-1]), UTC)

    @property
    def is_single_place(self) -> bool:
        """True if the forecast is for a single place, without a grid."""
        return len(self.latitudes) == len(self.longitudes) == 1

    @property
    def grid_km(self) -> float:
        """Largest distance between neighbouring nodes of the grid, km; 0 for a single place."""
        north = np.diff(self.latitudes).max(initial=0.0)
        east = np.diff(self.longitudes).max(initial=0.0) * math.cos(math.radians(float(np.abs(self.latitudes).min())))
        return float(max(north, east)) * _KM_PER_DEGREE

    def step_at(self, departure: datetime) -> tuple[datetime, datetime]:
        """Return the two successive times of the forecast between which a departure lies.

        For a departure before the first or after the last time, they are the first two or the last two times.
        """
        after = int(np.clip(np.searchsorted(self.times, departure.timestamp(), side="right"), 1, len(self.times) - 1))
        return (
            datetime.fromtimestamp(float(self.times[max(0, after - 1)]), UTC),
            datetime.fromtimestamp(float(self.times[after]), UTC),
        )

    def interpolation_end(self, departure: datetime) -> datetime:
        """Return the time up to which the wind after a departure can be interpolated.

        It is the time before the first step longer than `LONGEST_STEP`, or the last time of the forecast if there is
        no such step.
        """
        times = self.times[self.times >= departure.timestamp()]
        long_steps = np.flatnonzero(np.diff(times) > LONGEST_STEP.total_seconds())
        return self.last_time if not len(long_steps) else datetime.fromtimestamp(float(times[long_steps[0]]), UTC)

    def field_from(self, departure: datetime, member: int = 0) -> WindField:
        """Return the wind of one ensemble member from a departure until `LONGEST_FLIGHT_S` later.

        The times of the field are s after the departure.
        """
        field = WindField(
            self.times - departure.timestamp(),
            self.latitudes,
            self.longitudes,
            self.altitudes,
            self.velocities[member],
        )
        return field.between(0.0, LONGEST_FLIGHT_S)

    def facts(self, departure: datetime) -> "ForecastFacts":
        """Return the source and extent of the forecast, as messages state them for a departure."""
        return ForecastFacts(
            source=self.source,
            issued=self.issued,
            departure=departure,
            last_time=self.interpolation_end(departure),
            grid_km=self.grid_km,
            levels=self.altitudes.shape[-1],
            lowest_amsl=float(self.altitudes[..., 0].max()),
            highest_amsl=float(self.altitudes[..., -1].min()),
            box=(
                float(self.latitudes[0]),
                float(self.longitudes[0]),
                float(self.latitudes[-1]),
                float(self.longitudes[-1]),
            ),
            ground=self.ground,
            members=self.members,
        )


@dataclass(frozen=True, slots=True)
class ForecastFacts:
    """Source and extent of the forecast that a wind was made from.

    source, issued, grid_km, ground, members: see `Forecast`.
    departure: time of take-off.
    last_time: last time of the forecast before a step longer than `LONGEST_STEP`.
    levels: number of levels.
    lowest_amsl, highest_amsl: altitudes between which the forecast has levels everywhere, m.
    box: south, west, north, east, deg, of the nodes around the mission.
    """

    source: str
    issued: datetime | None
    departure: datetime
    last_time: datetime
    grid_km: float
    levels: int
    lowest_amsl: float
    highest_amsl: float
    box: tuple[float, float, float, float]
    ground: str = ""
    members: int = 1

    @property
    def age(self) -> timedelta | None:
        """Age of the forecast at the departure; None if the time of issue is unknown."""
        return None if self.issued is None else self.departure - self.issued

    @property
    def is_old(self) -> bool:
        """True if the forecast is older than `OLD_AGE` at the departure.

        False if the time of issue is unknown.
        """
        return self.age is not None and self.age > OLD_AGE

    def describe(self) -> str:
        """Return the forecast's source, time of issue, age, grid and levels as text for a message.

        >>> noon = datetime(2026, 5, 1, 12, tzinfo=UTC)
        >>> ForecastFacts("a.nc", noon, noon, noon, 2.2, 3, 10.0, 900.0, (0.0, 0.0, 1.0, 1.0)).describe()
        'forecast a.nc, issued 2026-05-01 12:00 UTC (0 h before take-off), grid 2.2 km, 3 levels to 900 m AMSL'
        """
        issue = "issue time unknown"
        if self.issued is not None and self.age is not None:
            hours = self.age.total_seconds() / 3600.0
            order = "before" if hours >= 0.0 else "after"
            issue = f"issued {self.issued:%Y-%m-%d %H:%M} UTC ({abs(hours):.3g} h {order} take-off"
            issue += ": old)" if self.is_old else ")"
        grid = f"grid {self.grid_km:.{0 if self.grid_km >= 10.0 else 1}f} km" if self.grid_km else "for one place"
        levels = f"{self.levels} level{'s' * (self.levels != 1)} to {self.highest_amsl:.0f} m AMSL"
        member_text = f", {self.members} members (one flight takes the first)" if self.members > 1 else ""
        return f"forecast {self.source}, {issue}, {grid}, {levels}{member_text}"
