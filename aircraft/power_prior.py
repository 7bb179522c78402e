"""Estimate the drag and the power of a small aircraft from its size.

The prior is calibrated on real aircraft.

Power in level flight is D V / efficiency + avionics. Minimum drag depends on layout and aspect ratio, propulsive
efficiency on mass. All deviations are log-normal. `examples/real/aircraft.csv` lists the powers of the 22 electric
aircraft that the coefficients are fitted to; `benchmarks/real_power.py` is the fit, and predicts each aircraft from
the others.
"""

import math
from dataclasses import dataclass

from aircraft.model_writer import Layout

# Reynolds number on the mean chord for the reference minimum drag.
DRAG_REYNOLDS = 3.2e5
# Exponent of the Reynolds number in the minimum drag: turbulent skin friction of a flat plate (Schlichting).
DRAG_EXPONENT = -0.2
# Aspect ratio for the reference minimum drag.
DRAG_ASPECT = 8.0
# Propulsive efficiency of a large aircraft: propeller 0.85, motor and speed controller 0.88. The Sky-Sailor's parts
# have efficiencies of 0.86 and 0.80 (Noth, "Design of Solar Powered Airplanes for Continuous Flight", ETH 2008).
MAX_EFFICIENCY = 0.75
# Exponent of the mass in the ratio of losses to output. Losses of bearings, iron, speed controller and of blades at low
# Reynolds numbers weigh more in a small aircraft; powers from -0.5 to -0.8 fit the table equally well.
LOSS_EXPONENT = -2.0 / 3.0
# Standard deviation of the logarithm of the minimum drag.
MIN_DRAG_LOG_SD = 0.35
# Standard deviation of the logarithm of drag due to lift; span efficiencies of 0.65 to 0.95 are published.
INDUCED_DRAG_LOG_SD = 0.15
# Standard deviation of the logarithm of the propulsive efficiency.
EFFICIENCY_LOG_SD = 0.29
# Standard deviation of the logarithm of the avionics' power.
AVIONICS_LOG_SD = 0.4


@dataclass(frozen=True, slots=True)
class PowerPrior:
    """Medians of drag, efficiency and avionics power, by size.

    tail_drag, wing_drag: minimum drag coefficient at `DRAG_REYNOLDS` and `DRAG_ASPECT`, with a tail and for a flying
        wing.
    aspect_power: exponent of the aspect ratio in the minimum drag; fuselage and tail are smaller with a slender wing.
    loss_mass: mass of an aircraft with half of `MAX_EFFICIENCY`, kg.
    avionics: power of autopilot, radios and servos, W.
    """

    tail_drag: float
    wing_drag: float
    aspect_power: float
    loss_mass: float
    avionics: float

    def min_drag_coefficient(self, layout: Layout, aspect: float, reynolds: float) -> float:
        """Return the minimum drag coefficient for an aspect ratio and a Reynolds number."""
        reference_drag = self.wing_drag if layout == "wing" else self.tail_drag
        return (
            reference_drag * (aspect / DRAG_ASPECT) ** self.aspect_power * (reynolds / DRAG_REYNOLDS) ** DRAG_EXPONENT
        )

    def propulsive_efficiency(self, mass: float) -> float:
        """Return the propulsive efficiency of an aircraft with a mass, kg.

        It is the ratio of drag times airspeed to the battery power without avionics.

        >>> [round(POWER_PRIOR.propulsive_efficiency(mass), 2) for mass in (0.5, 2.0, 20.0)]
        [0.26, 0.43, 0.64]
        """
        return MAX_EFFICIENCY / (1.0 + (mass / self.loss_mass) ** LOSS_EXPONENT)


# The fit of `benchmarks/real_power.py` to all aircraft of the table.
POWER_PRIOR = PowerPrior(tail_drag=0.0315, wing_drag=0.0171, aspect_power=-0.42, loss_mass=1.32, avionics=3.2)


def power_log_sd(min_drag_fraction: float, avionics_fraction: float, min_drag_sd: float = MIN_DRAG_LOG_SD) -> float:
    """Return the standard deviation of the logarithm of the power for level flight.

    min_drag_fraction: ratio of the minimum drag to the total drag.
    avionics_fraction: ratio of the avionics' power to the total power.
    min_drag_sd: standard deviation of the logarithm of the minimum drag.

    >>> round(power_log_sd(1.0, 0.0), 3)  # the root of 0.35^2 + 0.29^2
    0.455
    """
    drive_fraction = 1.0 - avionics_fraction
    return math.hypot(
        drive_fraction * min_drag_fraction * min_drag_sd,
        drive_fraction * (1.0 - min_drag_fraction) * INDUCED_DRAG_LOG_SD,
        drive_fraction * EFFICIENCY_LOG_SD,
        avionics_fraction * AVIONICS_LOG_SD,
    )
