"""Positions just inside and just outside each side of the area, planned and flown."""

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_scenario, make_setup

# 1,500 m of area around these, from the ground at the sea to 5,000 m.
WAY = [[0, 0, 300], [0, 3000, 300]]
SIDES = {
    "western": (0, -1500.0, -1.0),
    "eastern": (0, 1500.0, 1.0),
    "southern": (1, -1500.0, -1.0),
    "northern": (1, 4500.0, 1.0),
    "ceiling": (2, 5000.0, 1.0),
}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("beyond", "ok"), [(0.018, True), (0.022, False), (2.5, False)])
def test_a_position_is_inside_to_two_centimetres(side: str, beyond: float, ok: bool) -> None:
    axis, edge, out = SIDES[side]
    scenario = make_scenario(WAY)
    planned = np.array([WAY[0], [0, 1500, 300], WAY[1]], dtype=np.float64)
    planned[1, axis] = edge + out * beyond
    item = of(judge_geometry(make_setup(planned, scenario=scenario)), "bounds")
    assert item.ok is ok
    assert item.planned == pytest.approx(-beyond)
    assert side in item.reason
    setup = make_setup(WAY, scenario=scenario)
    track = fly_path(setup)
    position = track.position.copy()
    position[1000, axis] = edge + out * beyond
    item = of(judge(setup, edited(track, position=position)), "bounds")
    assert item.ok is ok
    assert item.flown == pytest.approx(-beyond)
