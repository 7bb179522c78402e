"""Plans for time and energy in a forecast, beside the best path that scipy finds with a fine march through its wind."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import planfly
from planfly.workflow.uav import load_uav
from planner.evaluation.problem import make_problem
from planner.evaluation.travel_cost import NO_WINDS
from tests.world.made.forecast_files import ISSUED, wind_dataset, write_netcdf
from world.arrays import Floats
from world.scenario import Scenario, load_scenario

LATITUDES = np.linspace(45.7, 46.3, 25)
LEVELS = (50.0, 200.0, 400.0, 900.0)
SCENARIO = """\
name = "shear"
at = "{at}Z"
[terrain]
kind = "flat"
amsl_m = 100
[origin]
lat_deg = 46.0
lon_deg = 8.0
[area]
east_m = [-8000, 8000]
north_m = [-5000, 5000]
ceiling_amsl_m = 800
[start]
east_m = -6000
north_m = 0
amsl_m = 250
[destination]
east_m = 6000
north_m = 0
amsl_m = 250
[limits]
min_clearance_m = 60
[planner]
objective = "energy"
[wind]
forecast = "winds.nc"
"""


def scenario_in(folder: Path, eastward: Floats) -> Path:
    """Write a scenario and its forecast with an eastward wind (m/s) that broadcasts to (time, level, y, x)."""
    write_netcdf(folder / "winds.nc", wind_dataset(eastward, 0.0, kind="altitude", levels=LEVELS, latitudes=LATITUDES))
    file = folder / "shear.toml"
    file.write_text(SCENARIO.format(at=ISSUED), encoding="utf-8")
    return file


def march_seconds(scenario: Scenario, path: Floats, airspeed: float) -> float:
    """Return the time of a path (w, 3) in the wind of each place at the time of passing it, by steps of 100 m."""
    seconds = 0.0
    for start, end in pairwise(path):
        length = float(np.linalg.norm(end - start))
        course, count = (end - start) / length, 1 + int(length / 100.0)
        for step in range(count):
            place = start + (step + 0.5) / count * (end - start)
            wind = np.append(scenario.wind_velocities(place[None], np.array([seconds]))[0], 0.0)
            along = float(wind @ course)
            across2 = float(wind @ wind) - along**2
            seconds += length / count / (along + np.sqrt(airspeed**2 - across2))
    return seconds


def test_a_plan_for_energy_takes_the_detour_to_the_tailwind(tmp_path: Path) -> None:
    """The wind blows to the east in the north and to the west in the south, 10 m/s: a level path of least time."""
    eastward = 10.0 * np.tanh((LATITUDES - 46.0) / 0.01)[None, None, :, None]
    plan = planfly.plan(str(scenario_in(tmp_path, eastward)), seed=1)
    assert plan.safe
    scenario, airspeed, path = plan.scenario, 25.0, np.asarray(plan.waypoints)
    assert np.ptp(path[:, 2]) < 15.0
    east = np.linspace(-6000.0, 6000.0, 9)

    def bent(north: Floats) -> Floats:
        return np.column_stack([east, np.concatenate([[0.0], north, [0.0]]), np.full(9, 250.0)])

    first = 1500.0 * np.cos(east[1:-1] / 6000.0)
    found = minimize(
        lambda north: march_seconds(scenario, bent(north), airspeed), first, method="L-BFGS-B", options={"maxfun": 160}
    )
    straight = march_seconds(scenario, bent(np.zeros(7)), airspeed)
    planned = march_seconds(scenario, path, airspeed)
    assert found.fun < 0.95 * straight
    assert planned < 1.005 * found.fun


def test_the_wind_of_a_place_is_that_of_the_time_of_passing_it(tmp_path: Path) -> None:
    """A wind that rises from calm by 10 m/s in an hour, met at 25 m/s, 1.2 % faster at 250 m than the airspeed."""
    hours = np.arange(4.0)[:, None, None, None]
    scenario = load_scenario(str(scenario_in(tmp_path, 10.0 * hours)))
    winds = make_problem(scenario, load_uav(scenario).limits).search.travel.winds
    x, y, z = np.meshgrid(
        *(winds.first[k] + winds.step[k] * np.arange(winds.velocities.shape[k]) for k in range(3)), indexing="ij"
    )
    expected = 10.0 * np.hypot(x + 6000.0, y) / 25.0 / 3600.0
    assert z.min() == pytest.approx(float(scenario.floor))
    assert z.max() == pytest.approx(float(scenario.ceiling))
    np.testing.assert_allclose(winds.velocities[..., 0], expected, rtol=0.02, atol=0.005)
    calm = load_scenario("tight")
    assert make_problem(calm, load_uav(calm).limits).search.travel.winds is NO_WINDS
