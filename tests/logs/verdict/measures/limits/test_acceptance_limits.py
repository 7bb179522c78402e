"""How many waypoints in a row, and how far aside, count as one negligible kink; how high a step is one."""

import math

import pytest

from logs.verdict.measures import acceptance
from logs.verdict.measures.acceptance import negligible_kink_distance, negligible_step_height
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.rules import turn_rule
from tests.synthetic import make_setup


def zigzag(count: int, aside: float = 3.0) -> list[list[float]]:
    """So many waypoints, 20 m apart, to the right and left of a straight line by turns."""
    middle = [[aside * (-1.0) ** k, 1000.0 + 20.0 * k, 300.0] for k in range(count)]
    return [[0.0, 0.0, 300.0], *middle, [0.0, 2000.0 + 20.0 * count, 300.0]]


@pytest.mark.parametrize(("count", "found"), [(8, True), (9, True), (10, False)])
def test_eight_waypoints_in_a_row_are_left_out_at_most(count: int, found: bool) -> None:
    """One of nine that stays turns by less than a degree; two of ten that stay turn by 17 between 20 m of leg."""
    assert (negligible_kink_distance(route_requirements(make_setup(zigzag(count))), 1) is not None) is found


def test_each_gap_of_a_long_zigzag_is_judged_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every gap of up to eight of 40 waypoints; each contains up to eight waypoints that ask for it."""
    judged, judge = [], acceptance.shortcut_distance
    monkeypatch.setattr(acceptance, "shortcut_distance", lambda *gap: judged.append(gap[1:]) or judge(*gap))
    requirements = route_requirements(make_setup(zigzag(40)))
    for _ in range(2):
        turn_rule.turn_findings(requirements, None, geometric=True)
    assert len(judged) == len(set(judged)) > 40


@pytest.mark.parametrize(("share", "found"), [(0.24, True), (0.26, False)])
def test_a_jog_is_within_a_quarter_of_the_corridor(share: float, found: bool) -> None:
    """A sidestep by twice that has the straight way past both its corners at that distance."""
    aside = 2.0 * share * 30.0
    setup = make_setup([[0, 0, 300], [0, 1000, 300], [aside, 1000, 300], [aside, 2000, 300]])
    assert (negligible_kink_distance(route_requirements(setup), 1) is not None) is found


@pytest.mark.parametrize(("rise", "found"), [(9.9, True), (-9.9, True), (10.1, False), (-10.1, False)])
def test_a_step_is_ten_metres_high(rise: float, found: bool) -> None:
    setup = make_setup([[0, 0, 300], [0, 1500, 300], [0, 1512, 300 + rise], [0, 3000, 300 + rise]])
    height = negligible_step_height(route_requirements(setup), 1)
    assert (height is not None) is found
    if found:
        assert height == pytest.approx(abs(rise))
    assert math.degrees(math.atan2(abs(rise), 12.0)) > 30.0
