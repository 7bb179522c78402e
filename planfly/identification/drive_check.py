"""Hold the power of an identified aircraft against its drag: no drive is almost without losses."""

import math
from dataclasses import dataclass

from aircraft.power_prior import EFFICIENCY_LOG_SD, POWER_PRIOR

# Efficiency of the drive above which drag and power contradict each other; the best published drives have 0.75 to 0.8.
MAX_EFFICIENCY = 0.9
# Standard deviations from the median to either end of an interval of 95 %.
_INTERVAL_SIGMAS = 1.96


@dataclass(frozen=True, slots=True)
class DriveConflict:
    """A power in level flight that is too small for the drag.

    drag_power: drag times airspeed in level flight, W.
    power: identified power, W.
    largest_power: upper end (95 %) of the power that the drag takes with a drive of this size, W.
    """

    drag_power: float
    power: float
    largest_power: float

    @property
    def text(self) -> str:
        """Description of the conflict, and what would settle it.

        >>> DriveConflict(55.0, 58.0, 200.0).text
        'drag takes 55 W, so 58 W would be a drive of 95 % efficiency: power may be up to 200 W; log the current (BAT)'
        """
        efficiency = 100.0 * self.drag_power / self.power
        return (
            f"drag takes {self.drag_power:.0f} W, so {self.power:.0f} W would be a drive of {efficiency:.0f} %"
            f" efficiency: power may be up to {self.largest_power:.0f} W; log the current (BAT)"
        )


def drive_conflict(drag_power: float, power: float, mass: float) -> DriveConflict | None:
    """Return the conflict of drag and power, or None if the drive's efficiency is possible.

    drag_power: drag times airspeed in level flight, W.
    mass: kg, by which real drives have their efficiency.

    >>> drive_conflict(55.0, 120.0, 2.0) is None
    True
    """
    if drag_power <= MAX_EFFICIENCY * power:
        return None
    least_efficiency = POWER_PRIOR.drive_efficiency(mass) * math.exp(-_INTERVAL_SIGMAS * EFFICIENCY_LOG_SD)
    return DriveConflict(drag_power, power, drag_power / least_efficiency + POWER_PRIOR.avionics)
