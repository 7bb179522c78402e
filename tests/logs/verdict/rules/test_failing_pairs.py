"""A failing value and its limit are printed so that they differ."""

import math
import re

import pytest

from logs.verdict.judge_geometry import judge_geometry
from tests.logs.verdict.judging import judge
from tests.logs.verdict.rules.flown_circuits import flown_circuit, moved
from tests.synthetic import bump, fly_path, make_setup

STRAIGHT = [[0, 0, 500], [0, 3000, 500], [0, 6000, 500]]


def numbers_of(pattern: str, text: str) -> list[str]:
    """The numbers of a text by a pattern with two groups."""
    found = re.search(pattern, text)
    assert found is not None, text
    return list(found.groups())


@pytest.mark.parametrize("over", [0.02, 0.3, 20.0])
def test_a_track_beside_its_corridor(over: float) -> None:
    setup = make_setup(STRAIGHT, limits={"corridor_m": 60.0})
    (failed,) = judge(setup, fly_path(setup, across=bump(4500.0, 60.0 + over, 150.0))).failed
    off, allowed = numbers_of(r"([\d.]+) m off the legs .*the corridor allows ([\d.]+) m", failed.reason)
    assert off != allowed
    assert float(off) == pytest.approx(60.0 + over, abs=0.5)
    # No more digits than it takes.
    assert over < 1.0 or "." not in off + allowed


def test_a_turn_just_beyond_its_limit() -> None:
    """46.03 degrees, where 46 are allowed: both were printed as 46.0."""
    angle = math.radians(46.03)
    points = [[0, 0, 500], [0, 3000, 500], [3000 * math.sin(angle), 3000 + 3000 * math.cos(angle), 500]]
    setup = make_setup(points, limits={"max_turn_deg": 46.0})
    (failed,) = judge_geometry(setup).failed
    turn, limit = numbers_of(r"turns ([\d.]+)°.*?([\d.]+)°", failed.reason)
    assert turn != limit


def test_a_launch_that_sinks_hardly_too_far() -> None:
    flown = flown_circuit()
    lost = flown.track.position[0, 2] - flown.track.position[20:60, 2].min()
    low = moved(flown.track, slice(20, 60), up=-(1.004 - lost))
    failed = next(finding for finding in judge(flown.setup, low).failed if finding.rule == "launch")
    sunk, allowed = numbers_of(r"sinks ([\d.]+) m after the launch; at most ([\d.]+) m", failed.reason)
    assert float(sunk) > float(allowed) == 1.0
