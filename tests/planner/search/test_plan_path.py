"""Whole searches: the same plan from the same seed, options refused, honest failures."""

import math
from collections.abc import Callable

import numpy as np
import pytest

import planner.search.plan_path as plan_path_module
from aircraft.path_limits import Limits
from planner.plan import Objective, parse_plan, plan_json
from planner.search.algorithms import ALGORITHMS
from planner.search.plan_path import plan_path
from planner.search.search_state import Search
from world.errors import ScenarioError
from world.geometry import path_length
from world.scenario import Scenario, load_scenario

FLAT = {"kind": "flat", "amsl_m": 0}


def test_among_zones_there_are_two_attempts_at_most(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each finds the straight line, through a zone or a missile; without zones there are three attempts."""
    monkeypatch.setattr(plan_path_module, "may_try_again", lambda _: True)
    monkeypatch.setattr(plan_path_module, "is_closed", lambda _: False)
    monkeypatch.setattr(plan_path_module, "may_turn_back", lambda *_: False)
    made: list[int] = []

    def attempt(search: Search, number: int, *_: object) -> None:
        made.append(number)
        search.evaluate(search.straight_vectors())

    monkeypatch.setattr(plan_path_module, "_run_attempt", attempt)
    zone = {"name": "it", "kind": "exclusion", "east_m": 3000, "north_m": 0, "radius_m": 500}
    missile = {"east_m": 3000, "north_m": 0, "kill_radius_m": 500, "kill_scale_m": 100}
    for obstacles, attempts in (({"zones": [zone], "threats": []}, 2), ({"threats": [missile]}, 3)):
        made.clear()
        scenario = small(terrain=FLAT, **obstacles)
        assert not plan_path(scenario, make_limits(scenario), seed=1).safe
        assert made == list(range(attempts))


@pytest.mark.parametrize("name", ["fda-seeded", "fda", "umda-smooth", "umda"])
def test_same_seed_same_bytes(scenario: Scenario, limits: Limits, name: str) -> None:
    one, two = (plan_json(plan_path(scenario, limits, seed=7, algorithm=name)) for _ in range(2))
    assert one == two
    other = plan_json(plan_path(scenario, limits, seed=8, algorithm=name))
    assert other != one


@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_algorithm_runs_within_its_evaluations(scenario: Scenario, limits: Limits, name: str) -> None:
    seen: list[tuple[int, int, str]] = []
    plan = plan_path(scenario, limits, seed=5, algorithm=name, progress=lambda *report: seen.append(report))
    assert plan.algorithm == name
    np.testing.assert_array_equal(plan.waypoints[0], scenario.start)
    np.testing.assert_array_equal(plan.waypoints[-1], scenario.destination)
    assert seen
    assert all(0 <= done <= total for done, total, _ in seen)
    if not ALGORITHMS[name].final_shortening:
        assert plan.evaluations == 60 + 25 * 30
        assert len(plan.history) == 26
    again = parse_plan(plan_json(plan), "plan.json")
    np.testing.assert_array_equal(again.waypoints, plan.waypoints)


def test_paper_scenario_names_the_papers_planner(make_limits: Callable[[Scenario], Limits]) -> None:
    for name, waypoints, population in (
        ("paper-07", 10, 120),
        ("paper-15", 12, 200),
        ("paper-30", 15, 300),
        ("paper-60", 20, 500),
    ):
        scenario = load_scenario(name)
        assert len(scenario.threats) == int(name[-2:])
        assert (scenario.planner.waypoints, scenario.planner.population, scenario.planner.generations) == (
            waypoints,
            population,
            100,
        )
        assert scenario.planner.algorithm == "umda"
        assert scenario.limits.max_turn_deg == 45
        assert (scenario.threats.detection_radius > scenario.threats.kill_radius).all()
    plan = plan_path(load_scenario("paper-15"), make_limits(load_scenario("paper-15")), seed=1)
    assert plan.algorithm == "umda"
    assert not any(plan.violations)


def test_no_feasible_path_is_a_plan_that_says_so(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    walled = small(
        terrain={
            "kind": "peaks",
            "peak": [{"east_m": 3000, "north_m": n, "height_m": 600, "sigma_m": 300} for n in range(-4000, 4001, 400)],
        },
        planner={"waypoints": 6, "population": 20, "generations": 3},
    )
    plan = plan_path(walled, make_limits(walled), seed=1)
    assert not plan.feasible
    assert plan.certificate.problems
    assert all("\n" not in line for line in plan.certificate.problems)


def test_missiles_without_a_way_past_leave_a_feasible_plan_that_is_not_safe(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    guarded = small(
        threats=[
            {"east_m": 3000, "north_m": n, "kill_radius_m": 800, "kill_scale_m": 200} for n in range(-3000, 3001, 600)
        ],
        terrain={"kind": "flat", "amsl_m": 0},
        planner={"waypoints": 6, "population": 30, "generations": 5},
    )
    plan = plan_path(guarded, make_limits(guarded), seed=1)
    assert plan.feasible
    assert not plan.safe
    assert plan.certificate.kill_distance < 0


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ({"algorithm": "simplex"}, "planner.algorithm"),
        ({"waypoints": 500, "population": 100_000}, "planner.population"),
        ({"population": 100, "budget": 50}, "planner.budget"),
    ],
)
def test_options_that_cannot_work_are_refused(
    table: dict[str, object], key: str, make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    scenario = small(planner=table)
    with pytest.raises(ScenarioError, match=key) as caught:
        plan_path(scenario, make_limits(scenario), seed=1)
    assert "\n" not in str(caught.value)


def test_a_wind_of_more_than_eighty_percent_of_the_airspeed_is_refused(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    flight = {"airspeed_mps": 25.0}
    scenario = small(wind={"speed_mps": 20.1}, flight=flight)
    with pytest.raises(ScenarioError, match=r"small: wind\.speed_mps: 20\.1: .* at most 80% of the airspeed of 25 m/s"):
        plan_path(scenario, make_limits(scenario), seed=1)
    strong = small(wind={"speed_mps": 20.0}, flight=flight, planner={"waypoints": 4, "population": 4, "generations": 1})
    assert plan_path(strong, make_limits(strong), seed=1).waypoints.shape == (4, 3)


def test_limit_below_what_plans_keep_is_refused(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    scenario = small(limits={"max_climb_deg": 0.4})
    with pytest.raises(ScenarioError, match=r"max_climb_deg: 0\.4"):
        plan_path(scenario, make_limits(scenario), seed=1)


def test_straight_line_is_taken_where_it_is_safe(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    clear = small(terrain=FLAT, threats=[])
    plan = plan_path(clear, make_limits(clear), seed=1)
    assert plan.safe
    assert plan.evaluations == 1
    assert plan.objectives[Objective.LENGTH_RATIO] == pytest.approx(1.0, abs=1e-12)
    guarded = small(terrain=FLAT)
    other = plan_path(guarded, make_limits(guarded), seed=1)
    assert other.safe
    assert other.objectives[Objective.LENGTH_RATIO] > 1.0


def serpentine(small: Callable[..., Scenario], walls: int, **planner: int) -> Scenario:
    """A plain with walls across it, each open for 1.5 km at the end opposite to the gap of the wall before."""
    zones = [
        {
            "name": f"wall {k}",
            "kind": "exclusion",
            "polygon_m": [[x - 100, low], [x + 100, low], [x + 100, high], [x - 100, high]],
        }
        for k, x in enumerate(range(2000, 2000 * walls + 1, 2000))
        for low, high in [(-8500, 10000) if k % 2 else (-10000, 8500)]
    ]
    length = 2000.0 * (walls + 1)
    return small(
        terrain=FLAT,
        threats=[],
        zones=zones,
        area={"east_m": [-2000, length + 2000], "north_m": [-10000, 10000], "ceiling_amsl_m": 450},
        destination={"east_m": length, "north_m": 0, "height_m": 150},
        planner={"population": 60, "generations": 25, **planner},
    )


def test_more_waypoints_are_tried_unless_their_number_is_stated(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    """A way through seven walls turns twice at each: 14 corners, and 12 waypoints have ten."""
    scenario = serpentine(small, 7)
    plan = plan_path(scenario, make_limits(scenario), seed=1)
    assert plan.safe
    assert len(plan.waypoints) == 24
    # A string that is pulled tight around the walls, without turns.
    length = 2 * math.hypot(1900, 8500) + 6 * math.hypot(1800, 17000) + 7 * 200
    assert length < path_length(plan.waypoints) < 1.05 * length
    scenario = serpentine(small, 7, waypoints=12)
    plan = plan_path(scenario, make_limits(scenario), seed=1)
    assert not plan.safe
    assert len(plan.waypoints) == 12


def test_the_last_progress_is_of_the_path_that_turns_back(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    """Three walls about the destination, open behind it: the paths that advance all meet a wall."""
    boxes = [(2400, 2600, -2600, 2600), (-2500, 2600, 2400, 2600), (-2500, 2600, -2600, -2400)]
    zones = [
        {
            "name": f"wall {k}",
            "kind": "exclusion",
            "polygon_m": [[west, south], [east, south], [east, north], [west, north]],
        }
        for k, (west, east, south, north) in enumerate(boxes)
    ]
    scenario = small(
        terrain=FLAT,
        threats=[],
        zones=zones,
        area={"east_m": [-10000, 10000], "north_m": [-10000, 10000], "ceiling_amsl_m": 450},
        start={"east_m": 8000, "north_m": 0, "height_m": 150},
        destination={"east_m": 0, "north_m": 0, "height_m": 150},
        planner={"waypoints": 12, "population": 60, "generations": 25},
    )
    texts: list[str] = []
    plan = plan_path(scenario, make_limits(scenario), seed=1, progress=lambda done, total, text: texts.append(text))
    assert plan.safe
    assert "no feasible path yet" in texts
    assert texts[-1] == f"{plan.objectives.length_ratio:.4f} times the straight line, kill exposure 0"
