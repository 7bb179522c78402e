"""Fronts of plans: each certified, none better than another, the same from the same seed."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planfly.terminal.plan_answers import fewer_plans_line
from planfly.workflow.uav import load_uav
from planner.evaluation.certify import certify, least_height
from planner.plan import Plan, plan_json
from planner.search import plan_front as fronts
from planner.search.plan_front import Front, fit_margins, front_task, noticeable_gains, plan_front
from world.scenario import Scenario, load_scenario, scenario_from_spec
from world.scenario_file import check_scenario

GENERATIONS = 4


@pytest.fixture(scope="module")
def front(scenario: Scenario, limits: Limits) -> Front:
    return plan_front(scenario, limits, 6, seed=3, generations=GENERATIONS)


def test_every_plan_is_safe_and_has_a_certificate_of_its_own(front: Front) -> None:
    assert 3 <= len(front.plans) <= 6
    assert all(one.plan.safe for one in front.plans)
    assert len({one.plan.certificate for one in front.plans}) == len(front.plans)
    for one in front.plans:
        legs = np.linalg.norm(np.diff(one.plan.waypoints, axis=0), axis=1)
        assert one.length == pytest.approx(legs.sum())
        # No lower than 30 m, which the scenario requires, and the margin of its certificate.
        assert one.clearance >= one.plan.certificate.clearance + 30.0 - 1e-6


def test_the_height_above_ground_is_the_paths_own() -> None:
    """As sampled each metre along a leg; the certificate's is less by what ArduPlane may deviate."""
    scenario = load_scenario("jacksboro-air")
    assert scenario.terrain is not None
    problem = front_task(scenario, load_uav(scenario).limits).problem
    leg = np.stack([scenario.start, scenario.destination])
    points = leg[0] + np.linspace(0.0, 1.0, 20_001)[:, None] * (leg[1] - leg[0])
    sampled = float((points[:, 2] - scenario.terrain.height(points[:, 0], points[:, 1])).min())
    assert sampled - 0.5 <= least_height(problem.certified, leg) <= sampled
    assert certify(problem, leg).clearance + scenario.limits.min_clearance_m < sampled - 1.0


def test_no_plan_is_better_than_another_in_everything(front: Front) -> None:
    rows = front.objectives()
    for k, row in enumerate(rows):
        others = np.delete(rows, k, axis=0)
        assert not ((others <= row).all(axis=1) & (others < row).any(axis=1)).any()
    assert (rows < front.reference).all()
    # The envelope written by hand knows no power.
    assert front.fourth == "time"
    assert [one.length for one in front.plans] == sorted(one.length for one in front.plans)


def test_each_plan_gains_something_that_is_noticed(front: Front, scenario: Scenario, limits: Limits) -> None:
    """0.1 % of length and time, 1 % of exposure and 1 m: so much better than any other, one of two is in something."""
    rows, default = front.objectives(), front.default
    amounts = noticeable_gains(default, "time")
    assert amounts.tolist() == [0.001 * default.length, 0.01 * default.exposure, 1.0, 0.001 * default.time]
    assert default.exposure > 1.0
    assert noticeable_gains(replace(default, exposure=0.5, energy=4e5), "energy").tolist()[1::2] == [0.01, 400.0]
    for k, one in enumerate(rows):
        for other in rows[:k]:
            assert (np.abs(one - other) > amounts).any()
    assert front.asked == 6


def test_of_paths_that_hardly_differ_one_is_a_choice(
    scenario: Scenario, limits: Limits, front: Front, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where half the length, a hundred times the exposure or 500 m go unnoticed, the shortest is all there is."""
    monkeypatch.setattr(fronts, "NOTICEABLE_GAIN_FRACTION", 0.5)
    monkeypatch.setattr(fronts, "NOTICEABLE_EXPOSURE_FRACTION", 100.0)
    monkeypatch.setattr(fronts, "NOTICEABLE_CLEARANCE_M", 500.0)
    found = plan_front(scenario, limits, 6, seed=3, generations=GENERATIONS)
    assert [one.length for one in found.plans] == [min(one.length for one in front.plans)]
    assert found.asked == 6


def test_a_plan_that_its_certificate_makes_no_choice_gives_way_to_another(
    scenario: Scenario, limits: Limits, front: Front, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Plans that are lower than their samples said are replaced by others that were found."""
    best = max(one.clearance for one in front.plans)
    monkeypatch.setattr(fronts, "least_height", lambda data, path: min(least_height(data, path), best - 20.0))
    found = plan_front(scenario, limits, 6, seed=3, generations=GENERATIONS)
    assert len(found.plans) == 6
    assert max(one.clearance for one in found.plans) == pytest.approx(best - 20.0)


def test_the_front_offers_what_the_shortest_plan_does_not(front: Front) -> None:
    rows, default = front.objectives(), front.default
    assert rows[:, 0].min() < 1.001 * default.length
    assert rows[:, 1].min() < 0.5 * default.exposure
    assert -rows[:, 2].min() > default.clearance + 10.0


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("half_gap", "is_walled"), [(0.0, False), (2500.0, False), (0.0, True)])
def test_every_seed_finds_the_shortest_way_around_the_radars(
    half_gap: float,
    is_walled: bool,
    side: float,
    make_limits: Callable[[Scenario], Limits],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It consists of a tangent from each end, two arcs, and the tangent common to two circles as far from the line.

    Other radars close the line and the other side of it, or a zone does.
    """
    monkeypatch.setattr(fronts, "CLEARANCE_FRACTIONS", (0.0,))
    monkeypatch.setattr(fronts, "RADAR_FRACTIONS", (0.0, 1.0))
    radius, offset, half_length = 3500.0, 2000.0, 8000.0
    radar = {"height_m": 150.0, "detection_radius_m": radius}
    places = [(east, north) for east in sorted({-half_gap, half_gap}) for north in (-offset, 2500.0)[: 2 - is_walled]]
    corners = [[-100.0, 1000.0], [100.0, 1000.0], [100.0, 9000.0], [-100.0, 9000.0]]
    wall = {"name": "wall", "kind": "exclusion", "polygon_m": [[east, side * north] for east, north in corners]}
    spec = {
        "name": "radars",
        "terrain": {"kind": "flat", "amsl_m": 0.0},
        "area": {"east_m": [-9000.0, 9000.0], "north_m": [-9000.0, 9000.0], "ceiling_amsl_m": 250.0},
        "start": {"east_m": -half_length, "north_m": 0.0, "height_m": 150.0},
        "destination": {"east_m": half_length, "north_m": 0.0, "height_m": 150.0},
        "threats": [
            {"name": f"radar {east:g} {north:g}", "east_m": east, "north_m": side * north, **radar}
            for east, north in places
        ],
        "zones": [wall] * is_walled,
    }
    made = scenario_from_spec(check_scenario(spec, "radars"), "radars")
    distance, bearing = math.hypot(half_length - half_gap, offset), math.atan2(half_length - half_gap, -offset)
    tangent = math.sqrt(distance**2 - radius**2)
    shortest = 2.0 * (tangent + radius * (bearing - math.acos(radius / distance)) + half_gap)
    for seed in (1, 2, 3):
        found = plan_front(made, make_limits(made), 6, seed=seed, generations=GENERATIONS)
        unseen = min((one.length for one in found.plans if one.exposure == 0.0), default=math.inf)
        # The radar is 0.1 % narrower at the ceiling. Twelve waypoints, and the margins of a search, add 1 %.
        assert 0.999 * shortest < unseen < 1.01 * shortest


def test_a_notebook_shows_the_plans_with_units(front: Front) -> None:
    name, ended = front.default.plan.scenario.name, front.ended
    assert repr(front) == f"<Front {name}: {len(front.plans)} of {front.asked} plans, {ended}>"
    table = front._repr_html_()
    assert table.count("<tr>") == 1 + len(front.plans)
    first = front.plans[0]
    # Kilometres of metres; the power of this aircraft is not known.
    row = [f"{first.length / 1e3:.3f}", f"{first.exposure:.2f}", f"{first.clearance:.1f}", "unknown"]
    assert "".join(f"<td>{text}</td>" for text in row) in table
    assert f"Front of {front.default.plan.scenario.name}: {len(front.plans)} of {front.asked} plans" in table


def test_the_same_seed_gives_the_same_front(scenario: Scenario, limits: Limits, front: Front) -> None:
    again = plan_front(scenario, limits, 6, seed=3, generations=GENERATIONS)
    assert [plan_json(one.plan) for one in again.plans] == [plan_json(one.plan) for one in front.plans]


def test_a_plan_that_is_not_safe_when_it_is_finished_is_left_out(scenario: Scenario, limits: Limits) -> None:
    def refuse_long(plan: Plan) -> Plan:
        if plan.objectives[0] < 1.04:
            return plan
        return replace(plan, certificate=replace(plan.certificate, problems=("too long",)))

    found = plan_front(scenario, limits, 6, seed=3, generations=1, finish=refuse_long)
    assert found.plans
    straight = float(np.linalg.norm(scenario.destination - scenario.start))
    assert all(one.length < 1.04 * straight for one in found.plans)


def test_without_a_safe_plan_there_is_no_front(scenario: Scenario, limits: Limits) -> None:
    def refuse(plan: Plan) -> Plan:
        return replace(plan, certificate=replace(plan.certificate, problems=("no way down",)))

    found = plan_front(scenario, limits, 6, seed=3, generations=1, finish=refuse)
    assert found.plans == ()
    assert not found.default.plan.safe


def test_a_path_that_breaks_a_constraint_has_no_objectives(scenario: Scenario, limits: Limits, front: Front) -> None:
    task = front_task(scenario, limits)
    met = front.default.plan.waypoints
    under = np.array(met)
    under[1:-1, 2] = 0.0
    objectives, violations = task.scores(np.array([under, met]))
    assert violations[0].max() > 0.0
    assert violations[1].max() <= 0.0
    assert np.isinf(objectives[0]).all()
    first = front.default
    # Above the ground as sampled, which is the certificate's to a metre or two.
    assert objectives[1, [0, 1, 3]].tolist() == pytest.approx([first.length, first.exposure, first.time])
    assert objectives[1, 2] == pytest.approx(-first.clearance, abs=2.0)


def test_the_search_keeps_more_solutions_than_plans_are_asked_for(
    scenario: Scenario, limits: Limits, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fronts, "MIN_ARCHIVE_SIZE", 1)
    assert len(plan_front(scenario, limits, 6, seed=3, generations=2).plans) > 2


def test_margins_are_halved_and_given_up_where_the_default_plan_does_not_keep_them(
    scenario: Scenario, limits: Limits, front: Front
) -> None:
    task, path = front_task(scenario, limits), front.default.plan.waypoints
    search, certified = task.problem.search, task.problem.certified
    assert search.kill_margin > certified.kill_margin
    under = np.array(path)
    under[1:-1, 2] = 0.0
    for given, share in ((path, 0.5), (under, 0.0)):
        scored = fit_margins(task, given).scored
        for name in ("kill_margin", "buffer", "start_buffer", "destination_buffer"):
            low, high = getattr(certified, name), getattr(search, name)
            assert getattr(scored, name) == pytest.approx((1.0 - share) * low + share * high)


def test_a_front_that_is_to_end_is_begun_from_the_default_plan_alone(
    scenario: Scenario, limits: Limits, monkeypatch: pytest.MonkeyPatch
) -> None:
    def shorten(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(fronts, "shorten_path", shorten)
    made = plan_front(scenario, limits, 6, seed=3, stop=lambda: "interrupted", generations=GENERATIONS)
    assert [one.plan.safe for one in made.plans] == [True]


def test_plans_that_are_not_safe_when_completed_are_left_out_and_counted(
    scenario: Scenario, limits: Limits, front: Front
) -> None:
    def refuse(plan: Plan) -> Plan:
        return replace(plan, certificate=replace(plan.certificate, problems=("gusts",)))

    assert front.refused == 0
    made = plan_front(scenario, limits, 3, seed=3, default=front.default.plan, finish=refuse, generations=GENERATIONS)
    assert [one.plan for one in made.plans] == [front.default.plan]
    assert made.refused > 2
    note = f"1 of the 3 requested plans: {made.refused} other plans were not safe after completion, and no further"
    assert note in fewer_plans_line(made)
