"""Whole searches: the same plan from the same seed, margins kept, options refused, honest failures."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits, turn_tangents
from flight.guidance.fly_by_path import fly_by_path, sample_path
from flight.mission.route import Route
from planner.evaluation.certify import certify
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN, SPARE, make_problem
from planner.plan import Plan, parse_plan, plan_json
from planner.search.algorithms import ALGORITHMS
from planner.search.plan_path import plan_path
from world.errors import ScenarioError
from world.geometry import leg_slopes, sphere_window, turning_angles
from world.scenario import Scenario, load_scenario

EMBEDDED = ("jacksboro", "steep", "tight")


@pytest.fixture(scope="module", params=EMBEDDED)
def embedded(request: pytest.FixtureRequest, make_limits: Callable[[Scenario], Limits]) -> Plan:
    scenario = load_scenario(request.param)
    return plan_path(scenario, make_limits(scenario), seed=1)


def test_embedded_scenarios_are_planned_safely(embedded: Plan) -> None:
    assert embedded.safe
    assert embedded.certificate.kill_distance >= CERTIFIED_KILL_MARGIN
    assert embedded.certificate.slope >= SPARE - 1e-9
    assert embedded.certificate.clearance >= 5.0 - 1e-9


def test_certificate_against_fine_samples(embedded: Plan) -> None:
    """One-metre samples of the legs find nothing lower, nearer or steeper than the certificate says."""
    scenario, path = embedded.scenario, embedded.waypoints
    assert scenario.terrain is not None
    runs = [max(2, int(np.hypot(*step[:2]))) for step in np.diff(path, axis=0)]
    points = np.concatenate([np.linspace(path[i], path[i + 1], runs[i]) for i in range(len(runs))])
    above = points[:, 2] - scenario.terrain.height(points[:, 0], points[:, 1]) - scenario.limits.min_clearance_m
    # The certificate takes a straight line for straight in pixels, `STRAIGHT_PIECE` m at a time.
    assert above.min() >= embedded.certificate.clearance - 1e-3
    armed = scenario.threats.kill_radius > 0
    distance = np.linalg.norm(points[:, None] - scenario.threats.position[armed][None], axis=2)
    assert (distance - scenario.threats.kill_radius[armed]).min() >= embedded.certificate.kill_distance - 1e-6


def fits(path: np.ndarray, limits: Limits) -> bool:
    """Whether every leg is as long as its two turns."""
    tangents = turn_tangents(limits.performance(), path)
    return bool(np.all(tangents[:-1] + tangents[1:] <= np.hypot(*np.diff(path[:, :2], axis=0).T)))


def test_certificate_against_the_path_that_guidance_flies(
    embedded: Plan, make_limits: Callable[[Scenario], Limits]
) -> None:
    """Two-metre samples of the flight's own arcs and parabolas are no lower and no nearer than certified."""
    scenario, path = embedded.scenario, embedded.waypoints
    if scenario.name == "tight":
        # Its corners cannot be flown as planned: there the certificate is of the legs as drawn.
        assert not fits(path, make_limits(scenario))
        return
    count = len(path)
    route = Route(path, np.full(count - 1, 25.0), np.zeros(count), np.zeros(count, bool), np.full(count, -1), "")
    flown = sample_path(fly_by_path(route, make_limits(scenario)), 2.0)
    assert scenario.terrain is not None
    above = flown[:, 2] - scenario.terrain.height(flown[:, 0], flown[:, 1]) - scenario.limits.min_clearance_m
    assert above.min() >= embedded.certificate.clearance - 0.05
    armed = scenario.threats.kill_radius > 0
    distance = np.linalg.norm(flown[:, None] - scenario.threats.position[armed][None], axis=2)
    assert (distance - scenario.threats.kill_radius[armed]).min() >= embedded.certificate.kill_distance - 2.0


@pytest.mark.parametrize("seed", [2, 3, 2**40])
def test_jacksboro_is_safe_for_other_seeds(seed: int, make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("jacksboro")
    assert plan_path(scenario, make_limits(scenario), seed=seed).safe


def test_jacksboro_is_a_problem() -> None:
    """At least 12 km and 12 threats of all three kinds; ground and a missile stand in the straight line's way."""
    scenario = load_scenario("jacksboro")
    threats = scenario.threats
    assert math.dist(scenario.start[:2], scenario.destination[:2]) >= 12_000
    assert len(threats) >= 12
    kinds = {(bool(kill), bool(seen)) for kill, seen in zip(threats.kill_radius, threats.detection_radius, strict=True)}
    assert kinds == {(True, True), (True, False), (False, True)}
    assert scenario.terrain is not None
    assert scenario.terrain.clearance(scenario.start, scenario.destination)[0] < 0
    # The straight line on the map, at any height the ceiling leaves, meets a sphere.
    for height in np.linspace(scenario.start[2], scenario.ceiling, 12):
        a, b = scenario.start.copy(), scenario.destination.copy()
        a[2] = b[2] = height
        assert any(
            sphere_window(a, b, threats.position[k], threats.kill_radius[k])[0] < threats.kill_radius[k]
            for k in range(len(threats))
            if threats.kill_radius[k] > 0
        )


def test_steep_needs_a_climb_that_the_aircraft_has_not(make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("steep")
    limits = make_limits(scenario)
    plan = plan_path(scenario, limits, seed=3)
    climbs = np.degrees(leg_slopes(plan.waypoints))
    most = max(math.degrees(limits.slopes(math.radians(90), amsl)[0]) for amsl in (0.0, 600.0))
    assert climbs.max() > most + 2.0
    # Only a few legs are beyond it; the others can be flown.
    assert (climbs > most).sum() <= 3
    assert climbs.max() < 24.0


def test_tight_has_corners_that_the_aircraft_cannot_turn(make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("tight")
    limits = make_limits(scenario)
    plan = plan_path(scenario, limits, seed=3)
    turns = np.degrees(turning_angles(plan.waypoints))
    assert (turns > 80).sum() in (2, 3, 4)
    assert turns.max() <= 134.5
    as_flown = certify(
        make_problem(scenario, Limits(None, None, None, 60, limits.envelope, 25.0, limits.max_bank, limits.wind)),
        plan.waypoints,
    )
    failing = {line.split(":")[0] for line in as_flown.problems}
    assert failing
    assert len(failing) < 12


@pytest.mark.parametrize("name", ["umda-seeded", "umda-smooth", "umda"])
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
    if not ALGORITHMS[name].seeded:
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
    assert not plan.violations.any()


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


def test_limit_below_what_plans_keep_is_refused(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    scenario = small(limits={"max_climb_deg": 0.4})
    with pytest.raises(ScenarioError, match=r"max_climb_deg: 0\.4"):
        plan_path(scenario, make_limits(scenario), seed=1)


def test_budget_ends_a_search(make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]) -> None:
    scenario = small(planner={"waypoints": 8, "population": 40, "generations": 100, "budget": 150, "algorithm": "umda"})
    plan = plan_path(scenario, make_limits(scenario), seed=1)
    assert 150 <= plan.evaluations < 190
