"""Steady wind with a gradient in height, and the turbulence that goes with it."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from world.kernels import inlined

Turbulence = Literal["none", "light", "moderate"]
# Wind speed at 6 m (20 ft) of MIL-F-8785C's low-altitude model, m/s.
W20 = {"none": 0.0, "light": 7.7, "moderate": 15.4}


@inlined
def mean_wind_speed(
    speed: float, gradient: float, reference_amsl: float, amsl: float
) -> float:  # pragma: no cover - compiled
    """Mean wind speed (m/s) at a height (m): linear in height from the reference, and never below 0."""
    return max(0.0, speed + gradient * (amsl - reference_amsl))


@dataclass(frozen=True, slots=True)
class Wind:
    """Mean wind and turbulence level.

    speed: m/s at `reference_amsl` (m).
    from_course: rad clockwise from north, where the wind comes from.
    gradient: m/s more per metre of height, 1/s; the speed is never below 0.
    turbulence: level of MIL-F-8785C, see `W20`.
    seed: of the turbulence; None to take the flight's.
    """

    speed: float = 0.0
    from_course: float = 0.0
    gradient: float = 0.0
    turbulence: Turbulence = "none"
    seed: int | None = None
    reference_amsl: float = 0.0

    @property
    def to_course(self) -> float:
        """Direction that the wind blows towards, rad clockwise from north."""
        return self.from_course + math.pi

    def at(self, amsl: float) -> tuple[float, float]:
        """East and north components of the mean wind at this height (m), m/s.

        >>> Wind(6.0, from_course=0.0, gradient=0.01, reference_amsl=300.0).at(700.0)
        (-0.0, -10.0)
        """
        speed = mean_wind_speed(self.speed, self.gradient, self.reference_amsl, amsl)
        return -speed * math.sin(self.from_course), -speed * math.cos(self.from_course)

    def strongest(self, amsl: NDArray[np.float64]) -> float:
        """Highest mean wind speed at these heights (m), m/s."""
        return max(math.hypot(*self.at(float(up))) for up in amsl)

    def along(self, course: float, amsl: float) -> tuple[float, float]:
        """Tailwind and crosswind (from the left positive) on a course (rad), m/s."""
        east, north = self.at(amsl)
        return (
            east * math.sin(course) + north * math.cos(course),
            east * math.cos(course) - north * math.sin(course),
        )
