"""What legs cost: wind triangles by hand, a climb through a shear by a fine sum, energy by the envelope's own power."""

import math

import numpy as np
import pytest

from aircraft.path_limits import PerformanceTable
from planfly.workflow.uav import load_uav
from planner.evaluation.travel_cost import LENGTH_COST, TravelCost, WindGrid, make_travel_cost, path_cost
from tests.setups import falling_envelope
from world.scenario import load_scenario

SECONDS = LENGTH_COST._replace(length=0.0, time=1.0)
NORTH, EAST = [0.0, 3000.0, 100.0], [3000.0, 0.0, 100.0]


def table(airspeed: float = 25.0, wind: float = 0.0, gradient: float = 0.0) -> PerformanceTable:
    """True airspeed in a wind that blows to the north, to the south where it is negative, at 100 m."""
    nothing, to = np.zeros(2), 0.0 if wind >= 0.0 else math.pi
    heights = np.array([0.0, 1000.0])
    return PerformanceTable(airspeed, 0.5, abs(wind), to, gradient, 100.0, 0.0, heights, nothing, nothing)


def cost(end: list[float], made: PerformanceTable, travel: TravelCost = SECONDS) -> float:
    return path_cost(travel, made, np.array([[0.0, 0.0, 100.0], end]))


@pytest.mark.parametrize(
    ("end", "wind", "seconds"),
    [
        (NORTH, 0.0, 120.0),
        (NORTH, 5.0, 100.0),
        (NORTH, -5.0, 150.0),
        # 15 across of 25 leave 20 along.
        (EAST, 15.0, 150.0),
        # 7 of 25 across leave 24; courses of 3, 4, 5: 0.8 x 7 = 5.6 along, 4.2 across.
        ([1800.0, 2400.0, 100.0], 7.0, 3000.0 / (5.6 + math.sqrt(25.0**2 - 4.2**2))),
        # 7 m/s upwards leave 24 for the 2,400 m over the ground, and the wind adds 6.
        ([0.0, 3000.0, 800.0], 6.0, 100.0),
        # Faster than the aircraft: with it, and neither against it nor across.
        (NORTH, 35.0, 50.0),
        (NORTH, -35.0, math.inf),
        (EAST, 35.0, math.inf),
    ],
)
def test_a_leg_takes_the_time_of_its_wind_triangle(end: list[float], wind: float, seconds: float) -> None:
    assert cost(end, table(wind=wind)) == pytest.approx(seconds, rel=1e-12)


def test_a_path_costs_the_sum_of_its_legs_and_length_costs_its_length() -> None:
    path = np.array([[0.0, 0.0, 100.0], NORTH, [4000.0, 3000.0, 100.0]])
    assert path_cost(SECONDS, table(wind=15.0), path) == pytest.approx(3000.0 / 40.0 + 4000.0 / 20.0)
    assert path_cost(LENGTH_COST, table(wind=15.0), path) == 7000.0


def test_a_climb_through_a_shear_takes_what_a_fine_sum_says() -> None:
    """The wind rises from 5 to 15 m/s over 500 m of height: each metre of the way has its own ground speed."""
    length, rise = 5000.0, 500.0
    winds = 5.0 + 10.0 * (np.arange(20_000) + 0.5) / 20_000
    # Along the slope: the wind's part along and across, as in the level triangle.
    slope = math.atan2(rise, length)
    speeds = winds * math.cos(slope) + np.sqrt(25.0**2 - (winds * math.sin(slope)) ** 2)
    want = math.hypot(length, rise) * float(np.mean(1.0 / speeds))
    found = cost([0.0, length, 100.0 + rise], table(wind=5.0, gradient=0.02))
    assert found == pytest.approx(want, rel=1e-4)


def test_a_leg_through_a_tailwind_that_rises_along_it_takes_the_integral_of_its_speed() -> None:
    """dt = dx / (25 + x / 100) from 0 to 1,000 m: 100 ln(35 / 25), which Simpson's rule meets within 1.1e-4."""
    velocities = np.zeros((2, 2, 2, 2))
    velocities[1, ..., 0] = 20.0
    winds = WindGrid(np.array([0.0, -500.0, 0.0]), np.array([2000.0, 1000.0, 500.0]), velocities)
    for array in winds:
        array.setflags(write=False)
    found = cost([1000.0, 0.0, 100.0], table(wind=9.0), SECONDS._replace(winds=winds))
    assert found == pytest.approx(100.0 * math.log(1.4), rel=1.2e-4)
    # Beyond the grid, the wind at its edge: 20 m/s.
    beyond = np.array([[2500.0, 0.0, 100.0], [4750.0, 0.0, 100.0]])
    assert path_cost(SECONDS._replace(winds=winds), table(), beyond) == pytest.approx(2250.0 / 45.0, rel=1e-9)


@pytest.mark.parametrize("climb", [-0.02, 0.0, 0.05])
def test_energy_is_the_envelopes_power_over_the_time_of_the_wind_triangle(climb: float) -> None:
    limits = load_uav(load_scenario("tight")).limits
    made = limits.performance()._replace(equivalent=0.0, wind_speed=5.0, wind_to=0.0, wind_gradient=0.0)
    travel = make_travel_cost("energy", limits.envelope, made)
    assert travel is not None
    amsl = float(made.amsl[1])
    # A leg so short that its height does not change, at this angle to the air.
    east = 25.0 * math.cos(climb)
    step = np.array([math.sqrt(east**2 - 5.0**2), 0.0, 25.0 * math.sin(climb)])
    path = np.array([[0.0, 0.0, amsl], [0.0, 0.0, amsl] + 0.01 * step])
    joules = path_cost(travel, made, path) / travel.energy
    assert joules == pytest.approx(0.01 * limits.envelope.power(25.0, amsl, climb), rel=1e-4)


def test_without_the_aircrafts_power_there_is_no_cost_of_energy() -> None:
    assert make_travel_cost("energy", falling_envelope(), table()) is None
    assert make_travel_cost("length", falling_envelope(), table()) is LENGTH_COST
