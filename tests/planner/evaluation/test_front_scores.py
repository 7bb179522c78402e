"""What plans of a front are compared by, against plain sums along fine points of their legs."""

import itertools

import numpy as np
import pytest

from planner.evaluation.front_scores import Value, front_values
from planner.evaluation.problem import Problem, SlopeBounds
from planner.evaluation.travel_cost import LENGTH_COST
from world.frames import polymap
from world.kernels import read_only


def test_the_values_of_a_path_are_plain_sums(problem: Problem) -> None:
    data = problem.search
    path = np.array([data.start, [1500.0, 900.0, 320.0], [4100.0, 800.0, 300.0], data.destination])
    heights = np.ones(len(data.aircraft.amsl))
    # 200 W whatever the climb.
    power = LENGTH_COST._replace(level=200.0 * heights, linear=0.0 * heights, square=0.0 * heights)
    values = front_values(data, power._replace(min_sine=-heights, max_sine=heights), path[None])[0]
    steps = (np.arange(40_000) + 0.5) / 40_000
    points = np.concatenate([a + steps[:, None] * (b - a) for a, b in itertools.pairwise(path)])
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert values[Value.LENGTH] == pytest.approx(lengths.sum(), rel=1e-12)
    # Still air, and the airspeed of the limits.
    seconds = lengths / data.aircraft.airspeed
    assert values[Value.TIME] == pytest.approx(seconds.sum(), rel=1e-12)
    assert values[Value.ENERGY] == pytest.approx(200.0 * seconds.sum(), rel=1e-12)
    unit = problem.scenario.threats
    away = np.linalg.norm(points - unit.position[0], axis=1)
    density = np.where(away <= unit.detection_radius[0], (unit.detection_scale[0] / away) ** 4, 0.0)
    exposure = (density.reshape(3, -1).mean(axis=1) * seconds).sum()
    assert exposure > 1.0
    assert values[Value.EXPOSURE] == pytest.approx(exposure, rel=1e-3)
    terrain = problem.scenario.terrain
    assert terrain is not None
    lowest = (points[:, 2] - terrain.height(points[:, 0], points[:, 1])).min()
    assert values[Value.CLEARANCE] == pytest.approx(lowest, abs=1.5)


def test_without_power_energy_is_not_known_and_off_the_terrain_there_is_no_clearance(problem: Problem) -> None:
    data = problem.search
    path = np.array([data.start, [1e6, 0.0, 300.0], data.destination])
    values = front_values(data, None, path[None])[0]
    assert np.isnan(values[Value.ENERGY])
    assert values[Value.CLEARANCE] == -np.inf


def test_the_least_height_is_that_of_every_sample_though_most_are_passed_over(problem: Problem) -> None:
    data, terrain = problem.search, problem.scenario.terrain
    assert terrain is not None
    rng = np.random.default_rng(7)
    low, high = [data.west, data.south, 0.0], [data.east, data.north, 900.0]
    paths = np.ascontiguousarray(rng.uniform(low, high, (200, 5, 3)))
    for path, value in zip(paths, front_values(data, None, paths), strict=True):
        heights = []
        for a, b in itertools.pairwise(path):
            count = 1 + int(np.hypot(*(b - a)[:2]) / data.sample_spacing)
            points = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
            heights.append(points[:, 2] - terrain.height(points[:, 0], points[:, 1]))
        assert value[Value.CLEARANCE] == pytest.approx(np.concatenate(heights).min(), abs=1e-6)


@pytest.mark.parametrize("fall", [0.0, 60.0])
def test_no_sample_is_passed_over_on_ground_as_steep_as_can_be(problem: Problem, fall: float) -> None:
    """A ridge like a tent, which the bounds know exactly; the way there is a little lower than over the ridge."""
    data, steep = problem.search, 0.25
    middle, north = 0.5 * (data.west + data.east), 0.5 * (data.south + data.north)
    (first, _), (second, _) = (polymap(data.to_pixel, middle + away, north) for away in (0.0, 100.0))
    columns = np.arange(data.heights.shape[1])
    ridge = round((first + second) / 2.0)
    east = middle + 100.0 * (columns - first) / (second - first)
    tent = np.broadcast_to(200.0 - steep * np.abs(east - east[ridge]), data.heights.shape).astype(np.float32)
    tiles = np.full_like(data.slope_bounds.tiles, steep)
    made = data._replace(heights=read_only(tent), slope_bounds=SlopeBounds(steep, read_only(tiles), 1e9))
    top, begin, end = (float(east[ridge]) + away for away in (0.0, -1000.0, 1000.0))
    # Over the ridge at 300 m, and before that, 1 km away, at 1 m more above the ground.
    low = 200.0 - steep * 1000.0 + 101.0
    path = np.array([[begin, north, low], [begin, north + 10.0, 300.0 + fall], [end, north, 300.0 - fall]])
    count = 1 + int(np.hypot(2000.0, 10.0) / data.sample_spacing)
    share = np.linspace(0.0, 1.0, count + 1)
    over = 300.0 + fall - 2.0 * fall * share - (200.0 - steep * np.abs(begin + 2000.0 * share - top))
    assert over.min() < 101.0 - 1e-3
    value = front_values(made, None, path[None])[0, Value.CLEARANCE]
    assert value == pytest.approx(over.min(), abs=1e-3)
