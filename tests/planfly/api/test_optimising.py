"""The planner's algorithm alone: known bottoms by plain sums, and the planner's own steps for the same seed."""

import copy
from typing import Any

import numpy as np
import pytest

import planfly
from planfly.api.optimising import Model
from planfly.workflow.uav import load_uav
from planner.plan import Violation
from planner.search import generations as generations_module
from planner.search.plan_path import plan_path
from planner.search.search_state import KILL, LENGTH, Search
from world.scenario import load_scenario, with_planner

EDAS: tuple[Model, ...] = ("umda", "emna", "multistart", "partial")


@pytest.mark.parametrize("model", ["umda", "emna", "differential"])
def test_the_bottom_of_a_bowl_is_found(model: Model) -> None:
    bottom = np.linspace(-1.0, 2.0, 5)
    search = planfly.optimise(np.full(5, -3.0), np.full(5, 5.0), model=model, seed=3)
    best = search.minimise(lambda points: ((points - bottom) ** 2).sum(axis=1) + 7.0, 120)
    np.testing.assert_allclose(best.x, bottom, atol=0.02)
    assert best.value == pytest.approx(7.0, abs=1e-3)
    assert best.feasible
    assert search.evaluations == 100 + 119 * 50


def test_a_narrow_bottom_beside_others_is_found_by_many_starts() -> None:
    """Rastrigin's function in four variables, moved: a bottom of 0 among some 10,000."""
    bottom = np.array([1.3, -2.1, 0.4, 3.2])

    def hills(points: np.ndarray) -> np.ndarray:
        off = points - bottom
        return np.asarray((off**2 + 10.0 * (1.0 - np.cos(2.0 * np.pi * off))).sum(axis=1))

    search = planfly.optimise([-5.0] * 4, [5.0] * 4, model="multistart", seed=3)
    best = search.minimise(hills, evaluations=20_000)
    np.testing.assert_allclose(best.x, bottom, atol=0.05)
    assert search.evaluations == 20_000


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_gap_in_a_wall_is_found_by_many_starts(seed: int) -> None:
    """Two waypoints on each side of a wall: through its gap, or around its end, which is twice as long."""
    gap = 0.2

    def length(across: np.ndarray) -> np.ndarray:
        rows = np.pad(across, ((0, 0), (1, 1)))
        wall = 0.5 * (rows[:, 2] + rows[:, 3])
        shut = (np.abs(wall) < 1.0) & (np.abs(wall - gap) > 0.01)
        return np.where(shut, np.inf, np.hypot(0.2, np.diff(rows, axis=1)).sum(axis=1))

    search = planfly.optimise([-2.0] * 4, [2.0] * 4, model="multistart", seed=seed)
    # The least through the gap: straight up to its lower edge between the two waypoints beside the wall, and back.
    least = 0.2 + 2.0 * np.hypot(0.4, gap - 0.01)
    assert search.minimise(length, evaluations=10_000).value == pytest.approx(least, abs=0.005)


@pytest.mark.parametrize("model", EDAS)
def test_a_bottom_that_a_constraint_forbids_gives_way_to_its_edge(model: Model) -> None:
    # x^2 + y^2 with x at least 1: the bottom of what is left is (1, 0), worth 1.
    search = planfly.optimise([-4, -4], [4, 4], model=model, seed=3)
    while search.evaluations < 3000:
        x, y = search.ask().T
        search.tell(x**2 + y**2, violations=1.0 - x)
    assert search.best.feasible
    # A Gaussian narrows beside an edge before it gets to it.
    assert 1.0 <= search.best.value < 1.1
    assert 1.0 <= search.best.x[0] < 1.05


def test_less_violation_counts_before_value_and_a_met_constraint_not_at_all() -> None:
    search = planfly.optimise([0.0], [1.0], population=4, initial=[[0.1], [0.2], [0.3], [0.4]])
    # The second is cheapest and violates; the third and the fourth meet it, the fourth with more to spare.
    search.tell([5.0, 1.0, 3.0, 4.0], violations=[0.0, 0.1, -1.0, -9.0])
    assert search.best.x.tolist() == [0.3]
    assert (search.best.value, search.best.violations.tolist()) == (3.0, [0.0])


def test_where_nothing_is_feasible_the_least_violation_is_best() -> None:
    search = planfly.optimise([0.0], [1.0], population=4, initial=[[0.1], [0.2], [0.3], [0.4]])
    search.tell([1.0, 2.0, 3.0, 4.0], violations=[0.4, 0.3, 0.1, 0.2])
    assert search.best.x.tolist() == [0.3]
    assert not search.best.feasible


def test_two_objectives_have_a_front() -> None:
    search = planfly.optimise([0.0], [1.0], population=4, initial=[[0.1], [0.2], [0.3], [0.4]])
    search.tell([[1.0, 4.0], [2.0, 2.0], [3.0, 3.0], [4.0, 1.0]])
    # (3, 3) is worse than (2, 2) in both; of the others none is.
    assert [one.values.tolist() for one in search.front] == [[1.0, 4.0], [2.0, 2.0], [4.0, 1.0]]
    assert search.best.x.tolist() == [0.1]


def test_the_best_is_kept_though_its_generation_is_gone() -> None:
    search = planfly.optimise([0.0], [1.0], population=4, initial=[[0.1], [0.2], [0.3], [0.4]])
    search.tell([1.0, 2.0, 3.0, 4.0])
    for _ in range(5):
        search.tell(np.full(len(search.ask()), 9.0))
    assert (search.best.x.tolist(), search.best.value) == ([0.1], 1.0)


def test_what_is_no_number_counts_as_worst() -> None:
    search = planfly.optimise([0.0], [1.0], population=4, initial=[[0.1], [0.2], [0.3], [0.4]])
    search.tell([np.nan, np.inf, 3.0, np.nan])
    assert search.best.x.tolist() == [0.3]


def test_the_same_seed_gives_the_same_points_and_another_others() -> None:
    def points(seed: int) -> np.ndarray:
        search = planfly.optimise([0, 0], [1, 1], seed=seed)
        search.minimise(lambda rows: rows.sum(axis=1), 5)
        return search.ask()

    np.testing.assert_array_equal(points(1), points(1))
    assert not np.array_equal(points(1), points(2))


def test_points_given_are_the_callers_own_to_change() -> None:
    search = planfly.optimise([0.0, 0.0], [1.0, 1.0], seed=1)
    asked = search.ask()
    asked[:] = 0.5
    assert not np.array_equal(search.ask(), asked)


def test_it_is_the_planners_own_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """The paper's UMDA on a problem of its own, and ask and tell of the same scores: the same paths, bit for bit."""
    told: list[tuple[np.ndarray, np.ndarray]] = []
    twins: list[planfly.Optimiser] = []
    evaluate, make = Search.evaluate, generations_module._make_optimiser

    def recorded(search: Search, vectors: np.ndarray) -> np.ndarray:
        scores = evaluate(search, vectors)
        told.append((vectors.copy(), scores.copy()))
        return scores

    def begin(search: Search, rank: object, population: int, initial: None) -> object:
        told.clear()
        box = search.encoding
        twins.append(planfly.optimise(box.lower, box.upper, population=population, seed=copy.deepcopy(search.rng)))
        return make(search, rank, population, initial)  # type: ignore[arg-type]

    monkeypatch.setattr(Search, "evaluate", recorded)
    monkeypatch.setattr(generations_module, "_make_optimiser", begin)
    scenario = with_planner(load_scenario("paper-07"), "test", population=40, generations=6)
    plan_path(scenario, load_uav(scenario).limits, seed=5, algorithm="umda")
    generations, (twin,) = told[:7], twins
    assert [len(vectors) for vectors, _ in generations] == [40, *[20] * 6]
    for vectors, scores in generations:
        np.testing.assert_array_equal(twin.ask(), vectors)
        # Its constraints as the violations, its length and exposure as two objectives.
        twin.tell(scores[:, [LENGTH, KILL]], violations=scores[:, : len(Violation)])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0.0], [1.0, 2.0]), "shapes"),
        (([[0.0]], [[1.0]]), "shapes"),
        (([], []), "shapes"),
        (([0.0], [0.0]), "lower below upper"),
        (([-1e308], [1e308]), "lower below upper by a finite difference"),
        (([0.0], [np.inf]), "finite"),
    ],
)
def test_a_box_that_is_none_is_refused(arguments: tuple[list[float], list[float]], words: str) -> None:
    with pytest.raises(planfly.ArgumentError, match=words):
        planfly.optimise(*arguments)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"population": 2}, "population 2: expected an even whole number from 4"),
        ({"population": 5}, "population 5: expected an even whole number from 4"),
        ({"model": "ga"}, "model ga: expected umda, emna, multistart, partial, differential"),
        ({"seed": np.nan}, "seed nan: expected a whole number"),
        ({"initial": [[0.5]]}, r"shape \(1, 1\): expected finite numbers of shape \(100, 1\)"),
        ({"initial": [[np.nan]] * 100}, "finite"),
    ],
)
def test_options_that_are_none_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(planfly.ArgumentError, match=words):
        planfly.optimise([0.0], [1.0], **options)


def test_values_of_points_that_nobody_knows_are_refused() -> None:
    search = planfly.optimise([0.0], [1.0], population=4)
    with pytest.raises(planfly.ArgumentError, match=r"values: call ask\(\) first"):
        search.tell(np.zeros(4))
    search.ask()
    search.tell(np.zeros(4))
    # The next points are others than those whose values were told.
    with pytest.raises(planfly.ArgumentError, match=r"values: call ask\(\) first"):
        search.tell(np.zeros(2))
    assert search.evaluations == 4
    # The points of `initial` are known; the points after them are not.
    search = planfly.optimise([0.0], [1.0], population=4, initial=[[0.1], [0.2], [0.3], [0.4]])
    search.tell(np.zeros(4))
    with pytest.raises(planfly.ArgumentError, match=r"values: call ask\(\) first"):
        search.tell(np.zeros(2))


def test_values_of_another_shape_are_refused() -> None:
    search = planfly.optimise([0.0], [1.0], population=4)
    search.ask()
    for values in ([1.0, 2.0], 1.0, np.zeros((4, 1, 1)), np.zeros((4, 0)), ["a"] * 4):
        with pytest.raises(planfly.ArgumentError, match=r"values"):
            search.tell(values)
    search.tell(np.zeros(4))
    search.ask()
    with pytest.raises(ValueError, match="differ from the previous call"):
        search.tell(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="differ from the previous call"):
        search.tell(np.zeros(2), violations=np.zeros(2))


def test_before_anything_is_told_there_is_no_best() -> None:
    search = planfly.optimise([0.0], [1.0])
    assert repr(search) == "<Optimiser Umda: 1 variables, 0 evaluations>"
    with pytest.raises(ValueError, match="nothing has been evaluated"):
        _ = search.best
    search.minimise(lambda points: points[:, 0] * 0.0 + 2.0, 1)
    assert repr(search) == "<Optimiser Umda: 1 variables, 100 evaluations, best 2>"


def test_the_least_of_a_cost_of_ones_own_is_a_safe_plan() -> None:
    """The recipe of docs/planner-and-paper.md: to pass far from a place, with samples that leave the terrain."""
    path = planfly.plan("jacksboro-air", seed=1)
    waves = np.sin(np.outer(np.linspace(0.0, np.pi, len(path.waypoints)), [1, 2]))

    def planned(x: np.ndarray) -> planfly.Plan:
        moved = np.array(path.waypoints)
        # The last tenth of the box leads off the map.
        moved[1:-1, 1] += (waves @ np.where(x > 2700.0, 60_000.0, x))[1:-1]
        return planfly.plan(path.scenario, waypoints=moved)

    def nearness(plan: planfly.Plan) -> float:
        return float(-np.abs(plan.waypoints[5, 1] - path.waypoints[5, 1]))

    search, off_terrain = planfly.optimise([-3000.0] * 2, [3000.0] * 2, population=40, seed=1), 0
    for _ in range(12):
        plans = [planned(x) for x in search.ask()]
        off_terrain += sum(np.isnan(plan.certificate.clearance) for plan in plans)
        search.tell([nearness(plan) for plan in plans], [-np.minimum(plan.margins, 0.0).sum() for plan in plans])
    found = planned(search.best.x)
    assert off_terrain
    assert search.best.feasible
    assert found.safe
    assert search.best.value == nearness(found) < 0.0


@pytest.mark.parametrize("model", ["umda", "emna", "multistart", "partial", "differential"])
@pytest.mark.parametrize("evaluations", [150, 1001])
def test_the_number_of_evaluations_is_exact(model: str, evaluations: int) -> None:
    """Of the last generation, only as many points as are left are evaluated."""
    calls = []

    def bowl(points: np.ndarray) -> np.ndarray:
        calls.append(len(points))
        return np.asarray((points**2).sum(axis=1))

    search = planfly.optimise([-5.0] * 3, [5.0] * 3, model=model, seed=1)  # type: ignore[arg-type]
    best = search.minimise(bowl, evaluations=evaluations)
    assert sum(calls) == search.evaluations == evaluations
    assert np.isfinite(best.value)


def test_points_outside_the_box_and_less_than_one_evaluation_are_refused() -> None:
    search = planfly.optimise([0.0], [1.0], population=4)
    for count in (0, -7):
        with pytest.raises(planfly.ArgumentError, match=f"generations {count}: expected a whole number of gen"):
            search.minimise(lambda points: points[:, 0], count)
        with pytest.raises(planfly.ArgumentError, match=f"evaluations {count}: expected a whole number of eval"):
            search.minimise(lambda points: points[:, 0], evaluations=count)
    with pytest.raises(planfly.ArgumentError, match=r"initial row 2: \[2.0\]: outside the box"):
        planfly.optimise([0.0], [1.0], population=4, initial=[[0.0], [0.5], [2.0], [1.0]])
    # The edges belong to the box.
    assert planfly.optimise([0.0], [1.0], population=4, initial=[[0.0], [0.5], [0.7], [1.0]]).ask().max() == 1.0
