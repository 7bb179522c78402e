"""Steady wind with a gradient in height, and the turbulence that goes with it."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Turbulence = Literal["none", "light", "moderate"]
# Wind speed at 6 m (20 ft) of MIL-F-8785C's low-altitude model, m/s.
W20 = {"none": 0.0, "light": 7.7, "moderate": 15.4}


@dataclass(frozen=True, slots=True)
class Wind:
    """Mean wind and turbulence level.

    speed: m/s at `reference_amsl` (m).  from_course: rad clockwise from north, where the wind comes from.
    gradient: m/s more per metre of height (1/s).  seed: of the turbulence; None to take the run's.
    """

    speed: float = 0.0
    from_course: float = 0.0
    gradient: float = 0.0
    turbulence: Turbulence = "none"
    seed: int | None = None
    reference_amsl: float = 0.0

    def at(self, amsl: float) -> tuple[float, float]:
        """East and north components of the moving air at this height, m/s."""
        speed = max(0.0, self.speed + self.gradient * (amsl - self.reference_amsl))
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
