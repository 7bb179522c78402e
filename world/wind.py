"""Steady wind with a vertical gradient, and its turbulence level."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from world.arrays import Floats
from world.forecast.forecast import ForecastFacts
from world.forecast.wind_field import WindField
from world.kernels import compiled, compiled_inline

Turbulence = Literal["none", "light", "moderate"]
# Wind speed at 6 m (20 ft) of MIL-F-8785C's low-altitude model, m/s.
W20 = {"none": 0.0, "light": 7.7, "moderate": 15.4}


@compiled_inline
def mean_wind_speed(speed: float, gradient: float, reference_amsl: float, amsl: float) -> float:
    """Return the mean wind speed (m/s) at an altitude (m AMSL).

    speed: wind speed at the altitude ``reference_amsl``, m/s.
    gradient: 1/s.

    The speed is linear in altitude, but never below 0.
    """
    return max(0.0, speed + gradient * (amsl - reference_amsl))


@compiled
def _mean_wind_speeds(speed: float, gradient: float, reference_amsl: float, amsl: Floats) -> Floats:
    """Return the mean wind speed at n altitudes, m/s, (n,); arguments as for `mean_wind_speed`."""
    speeds = np.empty(amsl.size)
    for k in range(amsl.size):
        speeds[k] = mean_wind_speed(speed, gradient, reference_amsl, amsl[k])
    return speeds


@dataclass(frozen=True, slots=True)
class Wind:
    """Mean wind and turbulence level.

    speed: m/s at `reference_amsl` (m).
    from_course: direction that the wind blows from, rad clockwise from north.
    gradient: increase of the speed in m/s per metre of altitude, 1/s; the speed is never below 0.
    turbulence: level of MIL-F-8785C, see `W20`.
    seed: seed of the turbulence; None for the seed of the flight.
    field: deviation of a forecast's wind from this mean wind, which a flight adds to the mean wind; its times are s
        after take-off. None for a wind without such a deviation.
    forecast: the forecast that the wind was made from; None for a stated wind.
    """

    speed: float = 0.0
    from_course: float = 0.0
    gradient: float = 0.0
    turbulence: Turbulence = "none"
    seed: int | None = None
    reference_amsl: float = 0.0
    field: WindField | None = None
    forecast: ForecastFacts | None = None

    @property
    def to_course(self) -> float:
        """Direction that the wind blows towards, rad clockwise from north."""
        return self.from_course + math.pi

    def velocity_at(self, amsl: float) -> tuple[float, float]:
        """Return the east and north components of the mean wind (m/s) at an altitude (m AMSL).

        >>> Wind(6.0, from_course=0.0, gradient=0.01, reference_amsl=300.0).velocity_at(700.0)
        (-0.0, -10.0)
        """
        speed = mean_wind_speed(self.speed, self.gradient, self.reference_amsl, amsl)
        return -speed * math.sin(self.from_course), -speed * math.cos(self.from_course)

    def velocities_at(self, amsl: Floats) -> Floats:
        """Return the east and north components of the mean wind at altitudes, m/s, shape (n, 2).

        amsl: (n,) m AMSL.

        >>> Wind(6.0, from_course=0.0, gradient=0.01, reference_amsl=300.0).velocities_at(np.array([300.0, 700.0]))
        array([[ -0.,  -6.],
               [ -0., -10.]])
        """
        speeds = _mean_wind_speeds(self.speed, self.gradient, self.reference_amsl, amsl)
        return np.column_stack([-speeds * math.sin(self.from_course), -speeds * math.cos(self.from_course)])

    def max_speed_at(self, amsl: Floats) -> float:
        """Return the highest mean wind speed (m/s) at the given altitudes (m AMSL)."""
        return max(math.hypot(*self.velocity_at(float(altitude))) for altitude in amsl)

    def components_on_course(self, course: float, amsl: float) -> tuple[float, float]:
        """Return the tailwind and the crosswind (m/s) on a course (rad) at an altitude (m AMSL).

        A crosswind from the left is positive.
        """
        east, north = self.velocity_at(amsl)
        return (
            east * math.sin(course) + north * math.cos(course),
            east * math.cos(course) - north * math.sin(course),
        )
