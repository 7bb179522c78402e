"""How finely JSBSim steps in the flights of a campaign."""

from typing import Literal

from aircraft.catalog import Aircraft
from flight.simulation.flight_setup import FDM_HZ

# Embedded aircraft whose flights at half the steps are held to the same verdicts, and without gusts to within 0.1 m of
# the same track, by `tests.bench.campaigns.compare_step_rates`: on 3 missions in `make test`, on 200 in `make soak`.
_AT_HALF = ("aerosonde",)


def steps_of(aircraft: Aircraft) -> Literal[60, 120]:
    """Steps of JSBSim a second: half of what `planfly fly` takes where that has been shown to change nothing.

    >>> from aircraft.catalog import load_aircraft
    >>> steps_of(load_aircraft("aerosonde")), steps_of(load_aircraft("c172x"))
    (60, 120)
    """
    return 60 if aircraft.embedded and aircraft.name in _AT_HALF else FDM_HZ
