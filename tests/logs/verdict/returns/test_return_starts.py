"""Starts of returns on the planned path: where the aircraft is at which time, by plain sums."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.returns.return_starts import planned_positions, planned_starts, return_start_at_path_end
from tests.synthetic import make_setup


@pytest.mark.parametrize("tailwind", [0.0, 7.0])
def test_an_equivalent_airspeed_is_flown_as_the_true_one(tailwind: float) -> None:
    """ArduPlane at 3,000 m, where the density is 0.9093 kg/m^3 by 1.2250 at sea level (ISO 2533)."""
    ground = {"kind": "flat", "amsl_m": 2500.0}
    wind = {"speed_mps": tailwind, "from_deg": 180.0}
    made = make_setup([[0, 0, 3000], [0, 4000, 3000]], terrain=ground, wind=wind)
    setup = replace(made, autopilot=ArduPlane(ArduPilotParameters.defaults()))
    for one, factor in ((made, 1.0), (setup, math.sqrt(1.2250 / 0.9093))):
        speed = 25.0 * factor + tailwind
        times, positions = planned_positions(one, 0.5)
        assert times[-1] == pytest.approx(4000.0 / speed, abs=0.6)
        np.testing.assert_allclose(positions[:, 1], speed * times, rtol=1e-3)
        np.testing.assert_allclose(planned_starts(one, 10.0).rows["velocity_north"], speed, rtol=1e-3)
        end = return_start_at_path_end(route_requirements(one))
        assert end.rows["velocity_north"][0] == pytest.approx(speed, rel=1e-3)
        assert end.time[0] == pytest.approx(times[-1], abs=0.6)
