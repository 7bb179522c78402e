"""The run that a fly-over turn takes, against flying it."""

import math

import numpy as np
import pytest

from aircraft.path_limits import fly_over_run


def overshoot(turn: float) -> float:
    """Run after a fly-over turn, in radii, by flying it: past the course and back until the track is on the leg."""

    def beside(extra: float) -> tuple[float, float]:
        """Along and beside the leg, after the turn and `extra` past it, and back by as much."""
        course, along, aside, steps = -turn, 0.0, 0.0, 4000
        for side, angle in ((1.0, turn + extra), (-1.0, extra)):
            for _ in range(steps):
                middle = course + side * angle / (2 * steps)
                along += math.cos(middle) * angle / steps
                aside += math.sin(middle) * angle / steps
                course += side * angle / steps
        return along, aside

    low, high = 0.0, math.pi / 2
    for _ in range(50):
        extra = 0.5 * (low + high)
        low, high = (extra, high) if beside(extra)[1] < 0.0 else (low, extra)
    return beside(low)[0]


@pytest.mark.parametrize("degrees", [10.0, 45.0, 90.0, 105.0])
def test_run_after_a_fly_over(degrees: float) -> None:
    assert fly_over_run(math.radians(degrees)) == pytest.approx(overshoot(math.radians(degrees)), rel=1e-5)


def test_run_after_a_fly_over_never_falls_with_the_angle() -> None:
    runs = [fly_over_run(angle) for angle in np.linspace(0.0, math.pi, 200)]
    assert np.diff(runs).min() >= 0.0
    assert runs[-1] == pytest.approx(2.0 * math.sqrt(2.0))
