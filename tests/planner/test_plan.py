"""A plan's text and back, what counts as feasible and safe, and files that are no plan."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import planfly
from planner.plan import (
    GIVEN_WAYPOINTS,
    Certificate,
    Objective,
    Plan,
    Violation,
    parse_plan,
    path_digest,
    plan_html,
    plan_json,
    read_plan,
)
from planner.procedures import ClimbOut, DepartureAndApproach, Descent
from tests.setups import small_scenario
from world.errors import MissionError, PlanflyError, ScenarioError
from world.scenario import load_scenario

CERTIFICATE = Certificate(0.1, 20.0, 0.2, 9.0, 10.0, 50.0, ())


def made(**changes: Any) -> Plan:
    scenario = small_scenario()
    plan = Plan(
        scenario=scenario,
        waypoints=np.stack([scenario.start, [3000.0, 1 / 3, 200.0], scenario.destination]),
        violations=np.array([0, 0, 0, 0]),
        objectives=np.array([1.01, 0.0, 2.5, 900.0]),
        certificate=CERTIFICATE,
        seed=7,
        algorithm="umda",
        evaluations=60,
        history=np.array([[1.5, 0.25, 3.0], [1.01, 0.0, math.nan]]),
        ended="budget",
        flown_legs=1,
    )
    return replace(plan, **changes)


UP = ClimbOut(np.zeros(3), 0.5, 80.0, np.array([[0.0, 600.0, 1 / 3]]), 0.15)
DOWN = Descent(np.zeros((0, 3)), np.array([[9.0, 8.0, 90.0], [9.0, 9.0, 90.0]]), np.ones(3), 1.0, 0.08, 60.0)


@pytest.mark.parametrize(
    "ways", [DepartureAndApproach(), DepartureAndApproach(climb=UP), DepartureAndApproach(UP, DOWN)]
)
def test_ways_from_and_to_the_ground_come_back(ways: DepartureAndApproach) -> None:
    plan = made(procedures=ways)
    again = parse_plan(plan_json(plan), "plan.json")
    assert plan_json(again) == plan_json(plan)
    assert again.procedures is not None
    for kind in ("climb", "descent"):
        mine, read = getattr(ways, kind), getattr(again.procedures, kind)
        assert (mine is None) == (read is None)
        for name in () if mine is None else type(mine).__slots__:
            np.testing.assert_array_equal(getattr(read, name), getattr(mine, name))
    assert "ground_ways" not in json.loads(plan_json(made()))


def test_a_way_that_is_none_is_refused() -> None:
    data = json.loads(plan_json(made(procedures=DepartureAndApproach(UP, DOWN))))
    data["ground_ways"]["descent"]["line_up_east_north_amsl_m"].pop()
    with pytest.raises(MissionError, match=r"^x: ground_ways\.descent\.line_up_east_north_amsl_m: "):
        parse_plan(json.dumps(data), "x")


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"certificate": Certificate(-0.1, math.inf, -0.2, math.nan, -1.0, math.inf, ("leg 1: too steep", "b"))},
        {"history": np.zeros((0, 3)), "ended": "completed", "flown_legs": 0},
    ],
)
def test_text_and_back_is_the_same_plan(changes: dict[str, Any]) -> None:
    plan = made(**changes)
    text = plan_json(plan)
    again = parse_plan(text, "plan.json")
    for name in ("waypoints", "violations", "objectives", "history"):
        np.testing.assert_array_equal(getattr(again, name), getattr(plan, name))
    for name in ("seed", "algorithm", "evaluations", "ended", "flown_legs", "feasible", "safe"):
        assert getattr(again, name) == getattr(plan, name)
    # NaN is not equal to itself.
    assert str(again.certificate) == str(plan.certificate)
    assert again.scenario.to_json() == plan.scenario.to_json()
    assert plan_json(again) == text


def test_numbers_stand_under_their_names() -> None:
    data = json.loads(plan_json(made(violations=np.array([1, 2, 3, 4]))))
    assert data["violations"] == {"turn": 1, "slope": 2, "terrain": 3, "bounds": 4}
    assert data["objectives"] == {
        "length_ratio": 1.01,
        "kill_exposure": 0.0,
        "detection_exposure": 2.5,
        "height_sum": 900.0,
    }
    assert data["certificate"]["turn_room_m"] == 20.0
    assert data["history"][1] == [1.01, 0.0, None]
    assert data["waypoints_east_north_amsl_m"][1] == [3000.0, 1 / 3, 200.0]
    assert (len(Violation), len(Objective)) == (4, 4)


def test_feasible_is_counted_and_continuous_and_safe_is_outside_missiles_too() -> None:
    assert (made().feasible, made().safe) == (True, True)
    failed = replace(CERTIFICATE, problems=("too low",))
    assert not made(certificate=failed).feasible
    for kind in Violation:
        assert not made(violations=np.eye(4)[kind]).feasible
    for distance, safe in ((-1.0, False), (0.0, False), (0.1, True), (math.inf, True)):
        plan = made(certificate=replace(CERTIFICATE, kill_distance=distance))
        assert (plan.feasible, plan.safe) == (True, safe)
    assert not made(certificate=failed).safe


def test_the_last_margin_counts_what_no_other_measures() -> None:
    assert made().margins == (0.1, 20.0, 0.2, 9.0, 10.0, 50.0, math.inf, math.inf, 0.0)
    blocked = replace(CERTIFICATE, problems=("climb-out: no path", "landing: no path"))
    assert made(certificate=blocked).margins[-1] == -2.0
    assert made(violations=np.array([0, 1, 2, 0])).margins[-1] == -3.0


def test_plans_are_equal_if_their_files_are() -> None:
    assert made() == made()
    moved = made(certificate=CERTIFICATE, violations=np.array([0, 1, 0, 0]))
    assert made() != moved
    assert made() != "plan"


def test_margins_that_given_waypoints_miss_do_not_fail() -> None:
    problems = ("leg 1: 420 m long", "landing: none of 3 paths is clear")
    certificate, counted = (
        replace(CERTIFICATE, problems=problems),
        ("the path violates constraints at its sampled points",),
    )
    for algorithm, failures, unmet in (("umda", problems, ()), (GIVEN_WAYPOINTS, problems[1:], problems[:1])):
        plan = made(certificate=certificate, algorithm=algorithm)
        assert (plan.failures, plan.unmet_margins) == (failures, unmet)
    assert made(violations=np.eye(4)[0]).failures == counted
    assert made(violations=np.eye(4)[0], algorithm=GIVEN_WAYPOINTS).unmet_margins == counted
    assert made().failures == made(algorithm=GIVEN_WAYPOINTS).unmet_margins == ()


def test_given_waypoints_near_a_missile_miss_a_margin_too() -> None:
    """The missile of `small_scenario` has a kill radius of 700 m; the path passes it at a distance of 712 m."""
    certificate = replace(CERTIFICATE, kill_distance=-4.6)
    line = "passes {} the kill radius of threat 1; with its tracking error the flight may come 4.6 m inside it"
    threat = made().scenario.threats.position[0]
    beside = threat + np.array([[offset, 712.0, 0.0] for offset in (-900.0, 0.0, 900.0)])
    plan = made(waypoints=beside, certificate=certificate, algorithm=GIVEN_WAYPOINTS)
    assert plan.unmet_margins == (f"leg 0 {line.format('12.0 m outside')}",)
    assert plan.failures == ()
    assert planfly.what_blocks(plan) == plan.unmet_margins
    problem = "leg 1: climbs at 5.7°; at most 4.5° are allowed"
    steep = replace(plan, certificate=replace(certificate, problems=(problem,)))
    assert steep.unmet_margins == (problem, *plan.unmet_margins)
    assert planfly.what_blocks(steep) == steep.unmet_margins
    assert replace(plan, algorithm="umda").unmet_margins == ()
    assert replace(plan, certificate=CERTIFICATE).unmet_margins == ()


def test_arrays_are_locked() -> None:
    plan = made()
    for name in ("waypoints", "history"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(plan, name)[0] = 1


def test_waypoints_are_not_replaced_under_a_certificate_of_others() -> None:
    plan = made()
    certified = replace(plan, certificate=replace(CERTIFICATE, path_digest=path_digest(plan.waypoints[1:])))
    moved = np.array([plan.waypoints[0], plan.waypoints[1] + 9.0, plan.waypoints[2]])
    with pytest.raises(PlanflyError, match=r"certificate is for other waypoints; planfly\.plan\(scenario, waypoints="):
        replace(certified, waypoints=moved)
    assert replace(certified, waypoints=plan.waypoints.tolist(), seed=3).seed == 3
    # As written and read, too: its certificate is that of the waypoints behind the flown leg.
    read = parse_plan(plan_json(plan), "plan.json")
    with pytest.raises(PlanflyError, match="certificate is for other waypoints"):
        replace(read, waypoints=moved)
    assert replace(read, waypoints=[[9.0, 9.0, 9.0], *plan.waypoints[1:]]).flown_legs == 1


def test_scores_have_names_in_the_order_of_their_columns() -> None:
    plan = made(violations=np.array([1.0, 2.0, 3.0, 4.0]))
    assert plan.objectives._asdict() == {
        "length_ratio": 1.01,
        "kill_exposure": 0.0,
        "detection_exposure": 2.5,
        "height_sum": 900.0,
    }
    assert (plan.violations.turn, plan.violations.bounds) == (1, 4)
    assert [name.upper() for name in plan.objectives._fields] == [item.name for item in Objective]
    assert [name.upper() for name in plan.violations._fields] == [item.name for item in Violation]


def _without(key: str) -> Callable[[dict[str, Any]], None]:
    return lambda data: data.pop(key)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.update(schema="planfly.plan/2"), r"^p\.json: schema: .*planfly\.plan/1"),
        (_without("certificate"), r"^p\.json: certificate: missing"),
        (lambda data: data.update(colour=1), r"^p\.json: colour: "),
        (lambda data: data.update(seed=-1), r"^p\.json: seed: -1: "),
        (lambda data: data.update(ended="tired"), r"^p\.json: ended: "),
        (lambda data: data["waypoints_east_north_amsl_m"][1].pop(), r"^p\.json: waypoints_east_north_amsl_m\.1: "),
        (lambda data: data["waypoints_east_north_amsl_m"][1].append(1), r"^p\.json: waypoints_east_north_amsl_m\.1: "),
        (lambda data: data.update(waypoints_east_north_amsl_m=[[0, 0, 0]]), r"^p\.json: waypoints_east_north_amsl_m: "),
        (lambda data: data["waypoints_east_north_amsl_m"].insert(1, [5e5 + 1, 0, 0]), r"amsl_m\.1\.0: 500001"),
        (lambda data: data["violations"].pop("turn"), r"^p\.json: violations: \['bounds', 'slope', 'terrain'\]"),
        (lambda data: data["objectives"].update(beauty=1.0), r"^p\.json: objectives: \['beauty', "),
        (lambda data: data["scenario"].pop("terrain"), r"^p\.json: terrain: missing"),
    ],
)
def test_one_fault_one_line(change: Callable[[dict[str, Any]], object], message: str) -> None:
    data = json.loads(plan_json(made()))
    change(data)
    with pytest.raises(PlanflyError, match=message) as caught:
        parse_plan(json.dumps(data), "p.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity"])
def test_what_json_does_not_know_is_no_number(number: str) -> None:
    text = plan_json(made()).replace("200.0", number, 1)
    with pytest.raises(MissionError, match=f"p.json: not valid JSON: {number} is not a number"):
        parse_plan(text, "p.json")


def test_text_that_is_no_json_is_refused() -> None:
    for text in ("", "{", "[" * 100_000):
        with pytest.raises(MissionError, match=r"^p\.json: not valid JSON: "):
            parse_plan(text, "p.json")


def test_files_are_named_when_they_cannot_be_read(tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    file.write_text(plan_json(made()), encoding="utf-8")
    np.testing.assert_array_equal(read_plan(file).waypoints, made().waypoints)
    file.write_bytes(b"\xff")
    with pytest.raises(MissionError, match=r"plan\.json: not a text file in UTF-8 \(byte 0\)"):
        read_plan(file)
    with pytest.raises(MissionError, match=f"^{tmp_path}: is a folder that holds plan.json; expected a plan file"):
        read_plan(tmp_path)
    text = plan_json(made()).replace('"name": "small"', '"name": 5')
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"plan\.json: name: 5: "):
        read_plan(file)


def test_what_is_known_of_zones_and_height_comes_back_and_nothing_of_it_is_written_where_there_is_none() -> None:
    assert not {"zone_distance_m", "headroom_m"} & set(json.loads(plan_json(made()))["certificate"])
    certificate = replace(CERTIFICATE, zone_distance=-3.5, headroom=12.25)
    text = plan_json(made(certificate=certificate))
    assert json.loads(text)["certificate"]["zone_distance_m"] == -3.5
    assert parse_plan(text, "plan.json").certificate == certificate


# ----------------------------------------------------------------------
# A plan on a terminal's one line, and as a notebook shows it.

GOOD_CERTIFICATE = Certificate(np.radians(5.0), 84.2, np.radians(1.25), 9.04, 10.0, 51.0, ())


@pytest.fixture(scope="module")
def plan() -> Plan:
    scenario = load_scenario("tight")
    path = np.stack([scenario.start, scenario.destination])
    return Plan(
        scenario,
        path,
        np.zeros(4),
        np.array([1.25, 0, 0, 0]),
        GOOD_CERTIFICATE,
        7,
        "umda",
        60,
        np.zeros((0, 3)),
    )


ANGLES = ("max_turn_deg", "max_climb_deg", "max_dive_deg")


def test_a_plan_prints_in_a_line(plan: Plan) -> None:
    """[limits] of tight states max_turn_deg; a limit of the aircraft is not looser than itself."""
    assert repr(plan) == "<Plan tight: 2 waypoints, safe by [limits], 1.2500 times straight>"
    limits = plan.scenario.limits.model_copy(update=dict.fromkeys(ANGLES, "aircraft"))
    for name in (None, *ANGLES):
        stated = limits if name is None else limits.model_copy(update={name: 20.0})
        word = "safe" if name is None else "safe by [limits]"
        assert f", {word}, " in repr(replace(plan, scenario=replace(plan.scenario, limits=stated)))


@pytest.mark.parametrize(
    ("change", "state"),
    [
        ({}, "safe"),
        ({"kill_distance": -1.0}, "feasible, but inside a missile's reach"),
        ({"problems": ("slope: 9°",)}, "not feasible"),
    ],
)
def test_its_state_is_said_in_words(plan: Plan, change: dict[str, object], state: str) -> None:
    assert replace(plan, certificate=replace(GOOD_CERTIFICATE, **change)).state == state  # type: ignore[arg-type]


def test_a_notebook_shows_what_it_keeps_from_its_limits(plan: Plan) -> None:
    page = ElementTree.fromstring(plan._repr_html_())
    rows = {row[0].text: row[1].text for row in page.find("table/tbody") or ()}
    assert page.findtext("strong") == "Plan tight: safe"
    assert rows["length / straight line"] == "1.2500"
    assert rows["smallest margin of the clearance"] == "9.0 m"
    assert rows["smallest distance from a kill zone"] == "51 m"
    assert rows["smallest margin of a leg's length"] == "84 m"
    assert rows["margins of turns and slopes"] == "5.0°, 1.25°"
    assert rows["algorithm, seed"] == "umda, 7"


def test_problems_are_named_and_no_missile_is_told_so(plan: Plan) -> None:
    text = plan_html(
        replace(plan, certificate=replace(GOOD_CERTIFICATE, kill_distance=np.inf, problems=("slope: 9°",)))
    )
    assert "<td>fails</td><td>slope: 9°</td>" in text
    assert "<td>none</td>" in text
