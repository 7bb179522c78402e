"""True by equivalent airspeed against the standard atmosphere."""

import math

import pytest

from flight.guidance.equivalent_airspeed import eas_to_tas_ratio


def test_true_airspeed_is_a_twentieth_more_at_a_thousand_metres() -> None:
    # Density of the standard atmosphere (ISO 2533): 1.2250 at sea level, 1.1117 at 1,000 m, 0.9093 at 3,000 m.
    for amsl, density in ((0.0, 1.2250), (1000.0, 1.1117), (3000.0, 0.9093)):
        assert eas_to_tas_ratio(amsl) == pytest.approx(math.sqrt(1.2250 / density), rel=2e-4)
