"""How finely JSBSim steps in the flights of a campaign."""

from typing import Literal

from aircraft.catalog import Aircraft
from flight.simulation.flight_setup import FDM_HZ

# Embedded aircraft that fly the same at half the steps: the same verdicts on 200 missions, and within 0.1 m of the same
# track without gusts, as `python -m tests.bench.campaigns.compare_step_rates` finds.
_AT_HALF = ("aerosonde",)


def steps_of(aircraft: Aircraft) -> Literal[60, 120]:
    """Steps of JSBSim a second: half of what `planfly fly` takes where that has been shown to change nothing.

    >>> from aircraft.catalog import load_aircraft
    >>> steps_of(load_aircraft("aerosonde")), steps_of(load_aircraft("c172x"))
    (60, 120)
    """
    return 60 if aircraft.embedded and aircraft.name in _AT_HALF else FDM_HZ
