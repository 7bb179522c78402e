"""A suggestion, taken, passes; and the two levels stand side by side."""

import re

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, of
from tests.synthetic import fly_path, make_scenario, make_setup

STEEP = [[0, 0, 300], [0, 2000, 300], [0, 3000, 600], [0, 6000, 600]]
SHORT = [[0, 0, 300], [0, 1000, 300], [150, 1000, 300], [150, 2000, 300]]


def number(pattern: str, text: str) -> float:
    found = re.search(pattern, text)
    assert found, text
    return float(found[1])


def test_a_gentler_slope_a_longer_leg_and_a_lower_speed_each_pass() -> None:
    failed = of(judge_geometry(make_setup(STEEP)), "slope", "leg 1")
    assert failed.ok is False
    rise = number(r"climb (\d+) m on leg 1", failed.suggestion)
    gentler = [[*point[:2], min(point[2], 300 + rise)] for point in STEEP]
    assert of(judge_geometry(make_setup(gentler)), "slope", "leg 1").ok is True
    run = number(r"make leg 1 (\d+) m long", failed.suggestion)
    longer = [[0, 0, 300], [0, 2000, 300], [0, 2000 + run, 600], [0, 6000, 600]]
    assert of(judge_geometry(make_setup(longer)), "slope", "leg 1").ok is True
    # No more than needed: a little less of each still fails.
    steeper = [[*point[:2], min(point[2], 300 + rise + 6)] for point in STEEP]
    assert of(judge_geometry(make_setup(steeper)), "slope", "leg 1").ok is False
    shorter = [[0, 0, 300], [0, 2000, 300], [0, 2000 + 0.97 * run, 600], [0, 6000, 600]]
    assert of(judge_geometry(make_setup(shorter)), "slope", "leg 1").ok is False


def test_a_gentler_turn_longer_legs_and_a_lower_speed_each_pass() -> None:
    verdict = judge_geometry(make_setup(SHORT))
    failed = of(verdict, "turn", "waypoint 1")
    assert failed.ok is False
    length = number(r"leg 1 (\d+) m long", failed.suggestion)
    longer = [[0, 0, 300], [0, 1000, 300], [length, 1000, 300], [length, 2000, 300]]
    assert all(item.ok for item in judge_geometry(make_setup(longer)).findings if item.rule == "turn")
    speed = number(r"fly it at ([\d.]+) m/s", failed.suggestion)
    slower = judge_geometry(make_setup(SHORT, airspeed=speed))
    assert all(item.ok for item in slower.findings if item.rule == "turn")
    angle = np.radians(number(r"turn at most ([\d.]+)°", failed.suggestion))
    gentle = [[0, 0, 300], [0, 1000, 300]]
    for course in (angle, 0.0):
        gentle.append([gentle[-1][0] + 150 * np.sin(course), gentle[-1][1] + 150 * np.cos(course), 300])
    gentle[-1] = [gentle[-2][0], gentle[-2][1] + 1000, 300]
    assert all(item.ok for item in judge_geometry(make_setup(gentle)).findings if item.rule == "turn")


@pytest.mark.parametrize("depth", [40.0, 400.0])
def test_a_missile_is_passed_further_away(depth: float) -> None:
    threat = {"name": "battery", "north_m": 3000.0, "amsl_m": 300.0, "kill_radius_m": 500.0, "kill_scale_m": 100.0}
    straight = [[0, 0, 300], [0, 6000, 300]]
    here = make_scenario(straight, threats=[threat | {"east_m": 500.0 - depth}])
    failed = of(judge_geometry(make_setup(straight, scenario=here)), "threat", "battery (missile)")
    assert failed.ok is False
    further = number(r"pass battery (\d+) m further", failed.suggestion)
    assert depth < further < depth + 3.0
    there = make_scenario(straight, threats=[threat | {"east_m": 500.0 - depth + further}])
    assert judge_geometry(make_setup(straight, scenario=there)).flyable


def test_what_passes_has_no_suggestion() -> None:
    setup = make_setup([[0, 0, 300], [0, 3000, 320], [3000, 5000, 300]])
    verdict = judge(setup, fly_path(setup))
    assert verdict.flyable
    assert {item.suggestion for item in verdict.findings} == {""}
    assert verdict.prediction is not None
    assert verdict.prediction.flyable
    assert verdict.prediction.disagreements == ()
    assert "flight and geometry agree" in verdict.summary


def test_where_the_levels_disagree_both_are_told() -> None:
    """A flight that cannot keep its speed fails where the geometry sees nothing wrong."""
    setup = make_setup([[0, 0, 300], [0, 4000, 300]])
    verdict = judge(setup, fly_path(setup, airspeed=lambda s: np.full_like(s, 21.0)))
    assert not verdict.flyable
    assert verdict.prediction is not None
    assert verdict.prediction.flyable
    assert any(line.startswith("speed at leg 0 passes by geometry") for line in verdict.prediction.disagreements)
    assert "By geometry alone: flyable" in verdict.summary
