"""Check the power of an identified aircraft against its drag: motor and propeller always have losses."""

import math
from dataclasses import dataclass

from aircraft.power_prior import EFFICIENCY_LOG_SD, POWER_PRIOR

# Efficiency of motor and propeller above which drag and power contradict each other; the best published values are 0.75
# to 0.8.
MAX_EFFICIENCY = 0.9
# Standard deviations from the median to either end of an interval of 95 %.
_INTERVAL_SIGMAS = 1.96


@dataclass(frozen=True, slots=True)
class PowerConflict:
    """Conflict of an identified aircraft: its power in level flight is too small for its drag.

    drag_power: drag times airspeed in level flight, W.
    power: identified power, W.
    largest_power: battery power that the drag may need with motor and propeller of this size (upper end of 95 %), W.
    """

    drag_power: float
    power: float
    largest_power: float

    @property
    def text(self) -> str:
        """Description of the conflict, and of the log that would resolve it.

        >>> PowerConflict(55.0, 58.0, 200.0).text
        'drag takes 55 W, so 58 W would need an efficiency of 95 %; power may be up to 200 W; log the current (BAT)'
        """
        efficiency = 100.0 * self.drag_power / self.power
        return (
            f"drag takes {self.drag_power:.0f} W, so {self.power:.0f} W would need an efficiency of"
            f" {efficiency:.0f} %; power may be up to {self.largest_power:.0f} W; log the current (BAT)"
        )


def power_conflict(drag_power: float, power: float, mass: float) -> PowerConflict | None:
    """Return the conflict if the identified power is too small for the identified drag, otherwise None.

    drag_power: drag times airspeed in level flight, W.
    power: identified battery power in level flight, W.
    mass: mass of the aircraft, kg; it determines the typical efficiency of motor and propeller.

    >>> power_conflict(55.0, 120.0, 2.0) is None
    True
    """
    if drag_power <= MAX_EFFICIENCY * power:
        return None
    min_plausible_efficiency = POWER_PRIOR.propulsive_efficiency(mass) * math.exp(-_INTERVAL_SIGMAS * EFFICIENCY_LOG_SD)
    return PowerConflict(drag_power, power, drag_power / min_plausible_efficiency + POWER_PRIOR.avionics)
