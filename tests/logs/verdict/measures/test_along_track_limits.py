"""Two stays in a sphere that touch are one."""

import numpy as np
import pytest

from logs.verdict.measures.along_track import passages


@pytest.mark.parametrize(("gap", "stays"), [(3e-7, 1), (3e-5, 2)])
def test_stays_a_microsecond_apart_are_one(gap: float, stays: int) -> None:
    """Out of a sphere of 100 m at 100 m/s, and back in after so many seconds."""
    beyond = 100.0 * gap / 2.0
    time = np.array([0.0, 1.0 + gap / 2.0, 2.0 + gap])
    position = np.array([[0.0, 0.0, 0.0], [100.0 + beyond, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert len(passages(time, position, np.zeros(3), 100.0)) == stays
