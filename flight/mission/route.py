"""A mission as the aircraft flies it: world-frame waypoints with speeds, jumps unrolled."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Route:
    """Waypoints in flying order; leg i goes from waypoint i to i + 1.

    waypoints: (w, 3) east, north, up, m.
    airspeed: (w - 1,) m/s on each leg.
    acceptance: (w,) m, 0 where the mission states none (advisory: the verdict has its own rule).
    fly_over: (w,) bool, whether the waypoint is flown through instead of by.
    items: (w,) the mission item's seq, -1 for a point that is no item.
    started: a sentence for people: where and how the flight starts.
    notes: what cannot be flown as written, with item numbers.
    arcs: (w,) m, the radius that the path turns with there, 0 for the bank limit's; a loiter is the corners of a
        polygon around its circle, all of one item, each with the circle's radius.
    endless: seq of the jump that would have the last round flown for ever, -1 for none.
    takeoff_ground, landing_ground: m, the ground that the mission takes off from and the place that it lands at, which
        the flight begins and ends above; NaN where there is none or it is not known.
    """

    waypoints: Floats
    airspeed: Floats
    acceptance: Floats
    fly_over: NDArray[np.bool_]
    items: NDArray[np.int64]
    started: str
    notes: tuple[str, ...] = ()
    arcs: Floats = field(default_factory=lambda: np.zeros(0))
    endless: int = -1
    takeoff_ground: float = math.nan
    landing_ground: float = math.nan

    def __post_init__(self) -> None:
        """Lock the arrays."""
        if not len(self.arcs):
            object.__setattr__(self, "arcs", np.zeros(len(self.waypoints)))
        for name in ("waypoints", "airspeed", "acceptance", "fly_over", "items", "arcs"):
            array = np.array(getattr(self, name))
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def legs(self) -> int:
        """How many legs there are."""
        return len(self.waypoints) - 1
