"""The greatest height above ground, and the ceiling: just inside and just outside, planned and flown."""

from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_setup

LINE = [[0.0, 0.0, 300.0], [0.0, 4000.0, 300.0]]


# m beyond the limit; 0.1 m is what a waypoint's rounding may come to on steep ground.
@pytest.mark.parametrize(("beyond", "ok"), [(0.09, True), (0.11, False)])
def test_the_greatest_height(beyond: float, ok: bool) -> None:
    setup = make_setup(LINE, limits={"max_height_m": 300.0 - beyond})
    assert of(judge_geometry(setup), "height").ok is ok
    high = make_setup(LINE, limits={"max_height_m": 310.0})
    track = fly_path(high, rate=10.0)
    moved = edited(track, position=track.position + np.array([0.0, 0.0, 10.0 + beyond]))
    assert of(judge(high, moved), "height").ok is ok


@pytest.mark.parametrize(("beyond", "ok"), [(0.09, True), (0.11, False)])
def test_the_ceiling(beyond: float, ok: bool) -> None:
    setup = make_setup(LINE, limits={"max_height_m": 2000.0})
    setup = replace(setup, scenario=replace(setup.scenario, ceiling=300.0 - beyond))
    assert of(judge_geometry(setup), "height").ok is ok
