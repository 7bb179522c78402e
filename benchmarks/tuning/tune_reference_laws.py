"""Tune the other lateral laws of the benchmark: choose the best settings that oscillate in no wind.

``python -m benchmarks.tuning.tune_reference_laws`` flies a grid of each law's settings, with the present inner loops,
through winds and turbulence that the benchmark does not report on, and prints the settings with the smallest median RMS
on straight legs among those without oscillation.  `benchmarks.flight.BEST_L1` and `BEST_FIELD` are its results.  A few
minutes on one core.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from benchmarks.flight import aerosonde, errors_of, flown_with, straight_rms, windy
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.guidance.gains import load_gains
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end

# Seeds of the training winds, 10 m/s with moderate turbulence from any direction; the benchmark uses seeds from 0.
SEEDS = range(500, 506)
# Number of winds that are flown first, to leave out settings that oscillate at once.
SCREEN = 1
# Grid of L1: period (s) and damping.
L1 = {
    "l1_period": (3.0, 4.0, 5.0, 6.0, 8.0),
    "l1_damping": (0.75, 0.9, 1.05, 1.2, 1.4),
}
# Grid of the vector field: 1/m, 1/s and 1/s^2.
FIELD = {
    "field_path": (0.06, 0.08, 0.1, 0.12, 0.15),
    "field_course": (4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.5),
    "field_course_integral": (0.2, 0.5),
}
LAWS: dict[str, dict[str, tuple[float, ...]]] = {"l1": L1, "vector-field": FIELD}
# Ratio of the largest to the median error above which a law oscillates.
SWINGS = 3.0


@dataclass(frozen=True, slots=True)
class Setting:
    """Settings of a law, and its errors.

    rms: RMS distance from the straight legs in each training wind, m; empty if a flight failed.
    """

    gains: dict[str, float]
    rms: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median of the RMS, m; infinite if a flight failed."""
        return float(np.median(self.rms)) if self.rms else float("inf")

    @property
    def swings(self) -> bool:
        """True if a flight failed, or was far worse in one wind than in the others."""
        return not self.rms or max(self.rms) > SWINGS * self.median


def settings(law: str) -> Iterator[dict[str, float]]:
    """Yield every point of the law's grid."""
    for values in itertools.product(*LAWS[law].values()):
        yield dict(zip(LAWS[law], values, strict=True))


def measure(law: str, chosen: dict[str, float], setups: list[FlightSetup]) -> Setting:
    """Fly all setups with these settings of a law; return the errors of the flights.

    There are no errors if a flight is not completed.
    """
    found = []
    with flown_with(replace(load_gains(aerosonde()), **cast("Any", chosen))):
        for setup in setups:
            flown = fly_to_end(Flight(replace(setup, autopilot=PlanflyGuidance(cast("Any", law))), aerosonde()))
            if not errors_of(flown).completed:
                return Setting(chosen, ())
            found.append(straight_rms(setup, flown))
    return Setting(chosen, tuple(found))


def search(law: str) -> Setting:
    """Return the best setting of the grid that oscillates in no wind.

    After the first wind only settings within 1.5 times the smallest error continue.
    """
    setups = [windy(seed) for seed in SEEDS]
    first = [measure(law, chosen, setups[:SCREEN]) for chosen in settings(law)]
    least = min(item.median for item in first)
    left = [item.gains for item in first if item.median < 1.5 * least]
    found = sorted((measure(law, chosen, setups) for chosen in left), key=lambda item: item.median)
    for item in found[:12]:
        print(f"  {item.gains}: median {item.median:.4f}, most {max(item.rms, default=float('inf')):.4f} m", flush=True)
    return next(item for item in found if not item.swings)


def main() -> None:
    """Print the best of each law."""
    for law in LAWS:
        print(law)
        best = search(law)
        print(f"best: {best.gains}, median {best.median:.4f} m")


if __name__ == "__main__":
    main()
