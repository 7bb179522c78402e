"""Bank and airspeed just inside and just outside what counts as flying."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_setup


@pytest.fixture(scope="module")
def setup() -> FlightSetup:
    return make_setup([[0, 0, 300], [0, 3000, 300]])


@pytest.mark.parametrize(("bank", "ok"), [(74.5, True), (-74.5, True), (75.5, False), (-75.5, False)])
def test_a_bank_beyond_75_degrees_is_a_departure(setup: FlightSetup, bank: float, ok: bool) -> None:
    track = fly_path(setup)
    attitude = track.attitude.copy()
    attitude[1000, 0] = math.radians(bank)
    assert of(judge(setup, edited(track, attitude=attitude)), "departure").ok is ok


@pytest.mark.parametrize(
    ("aircraft", "speed", "ok"),
    # 0.94 of the slowest level flight of the made envelope, 16 m/s, for any other aircraft than the Aerosonde.
    [("aerosonde", 15.1, True), ("aerosonde", 14.9, False), ("c172x", 15.1, True), ("c172x", 14.98, False)],
)
def test_an_airspeed_below_flight_is_a_departure(setup: FlightSetup, aircraft: str, speed: float, ok: bool) -> None:
    track = fly_path(setup)
    airspeed = np.asarray(track.airspeed, dtype=np.float64).copy()
    airspeed[1000] = speed
    verdict = judge(replace(setup, aircraft=aircraft), edited(track, airspeed=airspeed))
    assert of(verdict, "departure").ok is ok
