"""Airspeed: commanded within the envelope, and flown near the command."""

import pytest

from flight.simulation.flight_setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import ROUTE, failing, judge, leg, of
from tests.synthetic import (
    fly_path,
    make_setup,
)


def test_speed(setup: FlightSetup) -> None:
    assert of(judge(setup, fly_path(setup, airspeed=lambda s: 0.0 * s + 0.8)), "speed", leg(0)).ok
    verdict = judge(setup, fly_path(setup, airspeed=lambda s: 0.0 * s + 1.4))
    assert {("speed", leg(k)) for k in range(4)} <= failing(verdict)
    fast = make_setup(ROUTE, airspeed=33.0)
    item = of(judge_geometry(fast), "speed", leg(0))
    assert (item.ok, item.limit, item.limit_source) == (False, 32.0, "aircraft")
    changed = make_setup(ROUTE, speeds=[25.0, 20.0, 25.0, 25.0])
    assert of(judge(changed, fly_path(changed)), "speed", leg(1)).flown == pytest.approx(20.0, abs=0.1)


def test_wind_that_leaves_no_way() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [2000, 2000, 300]], wind={"speed_mps": 30.0, "from_deg": 0.0})
    verdict = judge_geometry(setup)
    assert ("speed", leg(0)) in failing(verdict)
    assert "no way" in of(verdict, "speed", leg(0)).reason
