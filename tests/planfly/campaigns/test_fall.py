"""Falls against their closed forms: without drag a parabola, and with drag the terminal velocity and the wind."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from planfly.campaigns.fall import impact_points, plate_drag
from world.terrain import Terrain, make_flat_terrain
from world.wind import Wind

GRAVITY = 9.80665
BOUNDS = np.array([[-3000.0, 3000.0], [-3000.0, 3000.0]])


@pytest.fixture(scope="module")
def ground() -> Terrain:
    return make_flat_terrain(BOUNDS, 100.0, 500.0)


def at_altitudes(wind: Wind) -> Callable[[np.ndarray], np.ndarray]:
    return lambda places: wind.velocities_at(np.ascontiguousarray(places[:, 2]))


def falls(height: float, velocity: tuple[float, float, float], drag: float, wind: Wind, ground: Terrain) -> np.ndarray:
    """Impact of one fall from a height above the ground at 100 m, m from its start."""
    start = np.array([[10.0, -20.0, 100.0 + height]])
    return impact_points(start, np.array([velocity]), drag, at_altitudes(wind), ground)[0] - (10.0, -20.0)


def test_without_drag_a_fall_is_a_parabola(ground: Terrain) -> None:
    # From 150 m: sqrt(2 x 150 / 9.80665) = 5.531 s; the step of 0.05 s goes up to 1.5 m beyond the ground.
    east, north = falls(150.0, (18.0, 24.0, 0.0), 0.0, Wind(10.0), ground)
    time = math.sqrt(2.0 * 150.0 / GRAVITY)
    assert 18.0 * time <= east <= 18.0 * (time + 0.05)
    assert 24.0 * time <= north <= 24.0 * (time + 0.05)


def test_a_climbing_aircraft_falls_longer(ground: Terrain) -> None:
    east, _ = falls(150.0, (20.0, 0.0, 5.0), 0.0, Wind(), ground)
    time = (5.0 + math.sqrt(25.0 + 2.0 * GRAVITY * 150.0)) / GRAVITY
    assert 20.0 * time <= east <= 20.0 * (time + 0.05)


def test_with_much_drag_a_fall_drifts_with_the_wind(ground: Terrain) -> None:
    """Drag of 1/m stops the aircraft at once; it sinks with sqrt(g / drag), and drifts with the wind from the west."""
    east, north = falls(100.0, (0.0, 25.0, 0.0), 1.0, Wind(8.0, from_course=1.5 * math.pi), ground)
    assert east == pytest.approx(8.0 * 100.0 / math.sqrt(GRAVITY), rel=0.03)
    # Quadratic drag stops 25 m/s within some metres: ln(25 / 3.1) / 1.
    assert 0.0 < north < 5.0


def test_the_wind_may_differ_from_place_to_place(ground: Terrain) -> None:
    """With much drag a fall drifts with the wind where it is: to the east in the west, and not beyond."""

    def wind_at(places: np.ndarray) -> np.ndarray:
        return np.column_stack([np.where(places[:, 0] < 100.0, 8.0, 0.0), np.zeros(len(places))])

    start = np.array([[10.0, 0.0, 300.0], [200.0, 0.0, 300.0]])
    ends = impact_points(start, np.zeros((2, 3)), 1.0, wind_at, ground)
    assert ends[0, 0] == pytest.approx(100.0, abs=5.0)
    assert ends[1, 0] == pytest.approx(200.0)


def test_a_slope_is_met_where_it_stands() -> None:
    """On ground that rises by 1:10 to the east, a fall ends earlier than on level ground."""
    level = make_flat_terrain(BOUNDS, 0.0, 500.0)
    columns = [float(level.to_pixel(one, 0.0)[0]) for one in (0.0, 1000.0)]
    metres_per_column = 1000.0 / (columns[1] - columns[0])
    heights = 0.1 * (np.arange(level.heights.shape[1]) - columns[0]) * metres_per_column
    slope = replace(level, heights=np.broadcast_to(heights, level.heights.shape))
    end = impact_points(np.array([[0.0, 0.0, 150.0]]), np.array([[30.0, 0.0, 0.0]]), 0.0, at_altitudes(Wind()), slope)[
        0
    ]
    # 150 - g t^2 / 2 = 0.1 x 30 t has its root at t = 5.233 s.
    time = (-3.0 + math.sqrt(9.0 + 2.0 * GRAVITY * 150.0)) / GRAVITY
    assert 30.0 * time <= end[0] <= 30.0 * (time + 0.06)


def test_the_drag_of_a_wing_across_the_air_by_hand() -> None:
    aerosonde = load_aircraft("aerosonde")
    # 0.5 x 1.225 kg/m3 x 1.2 x 0.55 m2 / 11 kg; the terminal velocity is 16.3 m/s.
    assert plate_drag(aerosonde) == pytest.approx(0.5 * 1.225 * 1.2 * 0.55 / 11.0, rel=1e-3)
