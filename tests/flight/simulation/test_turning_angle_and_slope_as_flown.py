"""Turning angle and slope as flown against the plan, on random feasible missions; 100 with PLANFLY_SOAK=1."""

from benchmarks.angles import angles
from tests.soak import SOAK


def test_flown_angles_are_the_planned_ones() -> None:
    found = angles(range(100 if SOAK else 6), 0.1)
    assert found.turns.size >= (100 if SOAK else 4)
    assert found.slopes.size >= (200 if SOAK else 10)
    assert found.turns.max() <= 0.1
    assert found.slopes.max() <= 0.15
