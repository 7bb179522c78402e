"""Problems of Shehadeh and Kudela: generator and cost by hand, by the package metaevobox, and the ranking by hand."""

import importlib.util
import math
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from benchmarks.planning.public_instances import PublicInstance, make_instance, vector_costs
from benchmarks.planning.public_planner import find_cheapest, find_highest, plan_public
from benchmarks.planning.public_ranking import BudgetSpentError, CountedCost, rank_methods

# Far from every path below.
NO_THREAT = np.array([[99.0, 1.0, 0.0, 5.0]])


def cost(
    vector: list[float],
    start: tuple[float, float],
    end: tuple[float, float],
    threats: np.ndarray = NO_THREAT,
    ground: np.ndarray | None = None,
) -> float:
    ground = np.zeros((100, 100)) if ground is None else ground
    ends = (np.array([*place, 150.0]) for place in (start, end))
    return float(vector_costs(np.array([vector]), ground, threats, *ends)[0])


def straight(count: int) -> list[float]:
    """Return waypoints at equal steps from (10, 10) to (90, 90)."""
    return [80.0 * math.sqrt(2.0) / (count + 1), 0.0, 0.25 * math.pi] * count


def test_length() -> None:
    assert cost(straight(10), (10, 10), (90, 90)) == pytest.approx(5.0 * 80.0 * math.sqrt(2.0))


def test_threats() -> None:
    """A threat halfway, of radius 5: three legs within 6 cells; two legs end 15.428 away, within 16."""
    threats = np.array([[50.0, 50.0, 0.0, 5.0]])
    away = 1.5 * 80.0 * math.sqrt(2.0) / 11
    expected = 5.0 * 80.0 * math.sqrt(2.0) + 3e4 + 2.0 * (16.0 - away)
    assert cost(straight(10), (10, 10), (90, 90), threats) == pytest.approx(expected)


def test_turn_above_45_degrees() -> None:
    """North 40 cells, then east 40: a turn of 90 degrees; bearings are counted from north."""
    assert cost([40.0, 0.0, 0.0], (10, 10), (50, 50)) == pytest.approx(5.0 * 80.0 + 90.0)


def test_height_and_change_of_climb_angle() -> None:
    """North 40 cells and 30 m up, then north and down: two slopes of 36.87 degrees."""
    angle = math.asin(0.6)
    expected = 5.0 * 100.0 + 10.0 * 30.0 + math.degrees(2.0 * angle)
    assert cost([50.0, angle, 0.0], (10, 10), (10, 90)) == pytest.approx(expected)


@pytest.mark.parametrize(("elevation", "added"), [(140.0, 0.0), (160.0, 1e4)])
def test_ground_between_two_waypoints(elevation: float, added: float) -> None:
    ground = np.zeros((100, 100))
    ground[25:35, :] = elevation
    assert cost([40.0, 0.0, 0.0], (10, 10), (10, 90), ground=ground) == pytest.approx(5.0 * 80.0 + added)


def test_waypoint_outside_the_map_is_moved_to_its_side() -> None:
    """400 cells to the west are 9 on the map; the path turns back, by 180 degrees."""
    assert cost([400.0, 0.0, -0.5 * math.pi], (10, 10), (50, 10)) == pytest.approx(5.0 * (9.0 + 49.0) + 180.0)


def test_leg_of_no_length_takes_the_direction_of_its_neighbours() -> None:
    assert cost([0.0, 0.0, 0.0, 40.0, 0.0, 0.0], (10, 10), (10, 90)) == pytest.approx(400.0)


def test_small_instance_is_that_of_the_package() -> None:
    """Values of `createmodel` of metaevobox 2.0.2, called with 3 threats, 60 cells and a generator of seed 7."""
    rng = np.random.RandomState(7)
    instance = make_instance(rng, 3, 60)
    assert instance.threats.tolist() == [[36.0, 56.0, 159.0, 5.0], [14.0, 13.0, -38.0, 5.0], [39.0, 17.0, 459.0, 5.0]]
    assert (instance.start.tolist(), instance.end.tolist()) == ([2.0, 2.0, 150.0], [55.0, 58.0, 150.0])
    corners = instance.ground[[0, 30, 59], [0, 40, 59]]
    assert corners == pytest.approx([265.44328066794856, 272.90955464449627, -155.5286780951003], abs=1e-6)
    assert rng.rand() == pytest.approx(0.30608527113762063, abs=1e-12)


@pytest.mark.filterwarnings("ignore")
def test_costs_are_those_of_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec("metaevobox")
    if found is None or found.origin is None:
        pytest.skip("needs the package metaevobox")
    folder = Path(found.origin).parent / "environment" / "problem" / "SOO" / "UAV"
    # The package imports torch; its file of the cost does not, but for the names of its parents.
    for name in ("stub", "stub.problem", "stub.problem.SOO", "stub.problem.SOO.UAV"):
        parent = types.ModuleType(name)
        parent.__path__ = []
        monkeypatch.setitem(sys.modules, name, parent)
    base = types.ModuleType("stub.problem.basic_problem")
    base.__dict__["Basic_Problem"] = object
    monkeypatch.setitem(sys.modules, base.__name__, base)
    spec = importlib.util.spec_from_file_location("stub.problem.SOO.UAV.uav_numpy", folder / "uav_numpy.py")
    assert spec is not None
    assert spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(package)
    instance = make_instance(np.random.RandomState(7), 5, 120)
    model = {"n": 10, "J_pen": 1e4, "H": instance.ground, "threats": instance.threats, "drone_size": 1.0}
    model |= {"danger_dist": 10.0, "start": instance.start[:, None], "end": instance.end[:, None]}
    model |= {"xmin": 1.0, "xmax": 120.0, "ymin": 1.0, "ymax": 120.0, "zmin": 100.0, "zmax": 200.0}
    terrain = package.Terrain(model, 1)
    assert (terrain.lb, terrain.ub) == (pytest.approx(instance.lower), pytest.approx(instance.upper))
    rng = np.random.default_rng(1)
    vectors = rng.uniform(instance.lower, instance.upper, (1000, 30))
    vectors[500:] = 0.5 * (instance.lower + instance.upper) + 0.1 * (vectors[500:] - instance.lower)
    vectors[::50, 3:6] = 0.0
    assert instance.costs(vectors) == pytest.approx(terrain.func(vectors))


def test_rank_methods() -> None:
    """Errors 0 and 25 %, 10 % and 0, 0 and 50 %; ranks 1.5 and 2, 3 and 1, 1.5 and 3."""
    wins, errors, ranks = rank_methods(np.array([[100.0, 110.0, 100.0], [50.0, 40.0, 60.0]]))
    assert wins.tolist() == [1, 1, 1]
    assert errors == pytest.approx([0.125, 0.05, 0.25])
    assert ranks == pytest.approx([1.75, 2.0, 2.25])


def flat_instance(threats: np.ndarray) -> PublicInstance:
    """Return an instance on flat ground, 100 x 100, from (10, 10) to (90, 90)."""
    return PublicInstance(np.zeros((100, 100)), threats, np.array([10.0, 10.0, 150.0]), np.array([90.0, 90.0, 150.0]))


def test_values_after_the_budget_do_not_count() -> None:
    counted = CountedCost(flat_instance(NO_THREAT), 2)
    bad, good = [0.0] * 30, straight(10)
    counted([[1.0, 0.7, 0.0] * 10, [1.0, 0.7, 0.0] * 10, good])
    assert counted.least > 5.0 * 80.0 * math.sqrt(2.0) + 1.0
    with pytest.raises(BudgetSpentError):
        counted([bad])


def test_find_cheapest() -> None:
    """The chain 1, 0 costs 1 + 1 + 1; the best chain through each sample."""
    layers = [np.array([[5.0, 1.0]]), np.array([[1.0, 9.0], [1.0, 4.0]]), np.array([[1.0], [1.0]])]
    chain, through = find_cheapest(layers)
    assert chain.tolist() == [1, 0]
    assert [costs.tolist() for costs in through] == [[7.0, 3.0], [3.0, 6.0]]


def test_find_highest() -> None:
    ground = np.zeros((20, 20))
    ground[11, 7] = 5.0  # east 8, north 12
    assert find_highest(np.array([[10.0, 10.0], [4.0, 4.0]]), ground, 3)[0].tolist() == [8.0, 12.0]


def test_planner_goes_around_a_threat() -> None:
    """The shortest way around a circle of 21 cells between the ends: two tangents and an arc, 123.2 cells.

    From the middle, the ends are 56.57 away: tangents sqrt(56.57² - 21²) = 52.53 each, and an arc of
    2 asin(21 / 56.57) · 21 = 15.98.  Straight through it costs more than 10,000.
    """
    counted = CountedCost(flat_instance(np.array([[50.0, 50.0, 0.0, 10.0]])), 2500)
    plan_public(counted.instance, counted, 2500, np.random.default_rng(1))
    assert 5.0 * 113.1 < counted.least < 5.0 * (2.0 * 52.53 + 15.98) * 1.03
