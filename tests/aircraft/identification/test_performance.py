"""The quick formulas against JSBSim's trims."""

import math

import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.parameters import prior_means
from aircraft.identification.performance import max_level_speeds, performance
from flight.dynamics.envelope_tables import load_envelope
from planfly.identification.base_numbers import base_model


@pytest.mark.parametrize("name", ["aerosonde", "x8", "zagi"])
def test_the_fastest_level_flight_is_the_envelopes(name: str) -> None:
    aircraft = load_aircraft(name)
    (found,) = max_level_speeds(base_model(aircraft), prior_means(), 1.1673)
    assert found == pytest.approx(load_envelope(aircraft).level_speeds(500.0)[1], rel=0.01)


@pytest.mark.parametrize("airspeed", [20.0, 25.0, 29.0])
def test_climb_descent_and_power_are_the_envelopes(airspeed: float) -> None:
    aircraft = load_aircraft("aerosonde")
    envelope = load_envelope(aircraft)
    climb, descent = envelope.air_angles(airspeed, 500.0)
    # The standard atmosphere at 500 m (ISO 2533).
    found = performance(base_model(aircraft), prior_means(), airspeed, 1.1673)
    assert math.degrees(found.climb[0]) == pytest.approx(math.degrees(climb), abs=0.1)
    assert math.degrees(found.sink[0]) == pytest.approx(math.degrees(descent), abs=0.1)
    assert found.power[0] == pytest.approx(envelope.power(airspeed, 500.0, 0.0), rel=0.02)
