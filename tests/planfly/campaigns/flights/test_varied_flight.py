"""A draw changes what it says, and nothing else."""

import math
from dataclasses import replace

import numpy as np
import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.varied_flight import GivenWind, vary
from planfly.campaigns.spread.draws import Draw
from planfly.campaigns.spread.quantities import QUANTITIES


def drawn(**values: float) -> Draw:
    return Draw(0, 99, {one.name: one.nominal for one in QUANTITIES} | values)


def test_the_nominal_draw_is_the_setup_itself(base: CampaignBase) -> None:
    made = vary(base, drawn())
    wind, own = made.setup.scenario.wind, base.scenario.wind
    assert (wind.speed, wind.turbulence) == (own.speed, own.turbulence)
    assert wind.from_course == pytest.approx(own.from_course)
    assert made.setup.seed == 99
    assert made.setup.scenario.terrain is base.scenario.terrain
    assert made.off_nominal.start_offset == (0.0, 0.0, 0.0)
    assert made.off_nominal.variation.mass == made.off_nominal.variation.drag == made.off_nominal.variation.control == 1


@pytest.mark.parametrize(
    ("values", "speed", "from_deg", "turbulence"),
    [
        ({"wind_speed": 2.0, "wind_from": 120.0}, 7.0, 10.0, "light"),
        ({"wind_speed": -9.0}, 0.0, 250.0, "light"),
        ({"turbulence": 1.0}, 5.0, 250.0, "moderate"),
        ({"turbulence": 2.0}, 5.0, 250.0, "moderate"),
        ({"turbulence": -1.0}, 5.0, 250.0, "none"),
    ],
)
def test_wind(base: CampaignBase, values: dict[str, float], speed: float, from_deg: float, turbulence: str) -> None:
    setup = vary(base, drawn(**values)).setup
    for wind in (setup.scenario.wind, setup.limits.wind):
        assert (wind.speed, wind.turbulence) == (speed, turbulence)
        assert math.degrees(wind.from_course) == pytest.approx(from_deg)
    # The log's scenario says the same.
    assert setup.scenario.spec.wind.speed_mps == speed


def test_gusts_are_the_flights_own_whatever_the_scenario_states(base: CampaignBase) -> None:
    fixed = replace(base, scenario=replace(base.scenario, wind=replace(base.scenario.wind, seed=3)))
    assert vary(fixed, drawn()).setup.scenario.wind.seed is None


def test_a_mean_wind_takes_the_scenarios_place(base: CampaignBase) -> None:
    wind = vary(base, drawn(wind_gradient=0.002), GivenWind(11.0, 45.0)).setup.scenario.wind
    assert (wind.speed, math.degrees(wind.from_course), wind.gradient) == (11.0, pytest.approx(45.0), 0.002)


def test_aircraft_battery_terrain_and_start(base: CampaignBase) -> None:
    values = {"mass": 1.1, "drag": 0.9, "control_power": 0.8, "battery": 0.5, "terrain_height": 7.0}
    made = vary(base, drawn(**values, start_east=1.0, start_north=-2.0, start_up=3.0))
    variation = made.off_nominal.variation
    assert (variation.mass, variation.drag, variation.control) == (1.1, 0.9, 0.8)
    assert made.setup.battery == pytest.approx(0.5 * base.airframe.battery)
    assert made.off_nominal.start_offset == (1.0, -2.0, 3.0)
    ground = made.setup.scenario.terrain
    assert ground is not None
    assert float(ground.height(500.0, 0.0)) == pytest.approx(107.0)
    # The route stays where it was planned.
    np.testing.assert_array_equal(made.setup.route.waypoints, vary(base, drawn()).setup.route.waypoints)
