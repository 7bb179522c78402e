"""Turns that are judged as reversals, because no leg would be long enough for their arc."""

import math

import pytest

from logs.verdict.measures.route_requirements import route_requirements, turn_lengths
from tests.synthetic import bank_radius, make_setup


@pytest.mark.parametrize(("short", "ends"), [(5e-7, False), (2e-6, True)])
def test_a_turn_within_a_millionth_of_a_half_circle_has_no_tangent(short: float, ends: bool) -> None:
    before, after = turn_lengths(math.pi - short, 100.0, fly_over=False)
    assert before == after
    assert math.isfinite(before) is ends
    if ends:
        # R tan((pi - e) / 2) = 2 R / e
        assert before == pytest.approx(2.0 * 100.0 / short, rel=1e-6)


# ----------------------------------------------------------------------
# How far from its waypoint an arc is taken to pass at most.


@pytest.mark.parametrize(("turn", "radii"), [(175.9, None), (178.0, 30.0)])
def test_a_fly_by_passes_its_waypoint_at_thirty_radii_at_most(turn: float, radii: float | None) -> None:
    """R (1 / cos(turn / 2) - 1) up to about 176 degrees."""
    angle = math.radians(turn)
    points = [[0, 0, 300], [0, 9000, 300], [9000 * math.sin(angle), 9000 + 9000 * math.cos(angle), 300]]
    expected = radii or 1.0 / math.cos(0.5 * angle) - 1.0
    assert route_requirements(make_setup(points)).fly_by_offset[1] == pytest.approx(expected * bank_radius(), rel=1e-6)
