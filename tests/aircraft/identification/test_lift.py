import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.lift import fit_lift
from planfly.identification.base_numbers import base_model
from tests.aircraft.identification.made_signals import steady


def test_one_speed_leaves_the_slope_at_its_prior() -> None:
    """All lift alike tells nothing of the slope: 12 %, whatever the angle of attack."""
    base = base_model(load_aircraft("aerosonde"))
    level = steady(attitude=(0.0, 0.05, 0.0), velocity=(25.0, 0.0, 0.0))
    _, (slope, _), spread = fit_lift(level, base, np.full(len(level.airspeed), 0.5))
    assert slope == pytest.approx(1.0, abs=1e-6)
    assert np.sqrt(spread[0, 0]) == pytest.approx(0.12, rel=1e-3)
