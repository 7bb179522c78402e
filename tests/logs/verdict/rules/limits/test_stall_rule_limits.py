"""How long and how far a flown airspeed may be below the stall."""

import numpy as np
import pytest

from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_setup

STRAIGHT = [[0, 0, 300], [0, 3000, 300]]


def dipped(speed: float, rows: int, **world: object) -> bool | None:
    """The rule's answer on level flight at 25 m/s with so many rows, 60 a second, at a lower speed (m/s)."""
    setup = make_setup(STRAIGHT, **world)
    track = fly_path(setup)
    airspeed = np.asarray(track.airspeed, dtype=np.float64).copy()
    airspeed[1000 : 1000 + rows] = speed
    return of(judge(setup, edited(track, airspeed=airspeed)), "stall").ok


@pytest.mark.parametrize(
    ("turbulence", "speed", "ok"),
    # 16 m/s is the slowest level flight of the made envelope; 0.15 W20 is a gust's standard deviation.
    [
        ("none", 15.84, True),
        ("none", 15.76, False),
        ("light", 16.0 - 0.2 - 0.15 * 7.7 + 0.04, True),
        ("light", 16.0 - 0.2 - 0.15 * 7.7 - 0.04, False),
    ],
)
def test_an_airspeed_may_be_a_fifth_of_a_metre_a_second_and_a_gust_below(
    turbulence: str, speed: float, ok: bool
) -> None:
    assert dipped(speed, 120, wind={"turbulence": turbulence}) is ok


@pytest.mark.parametrize(("rows", "ok"), [(40, True), (45, False)])
def test_the_mean_over_a_second_counts(rows: int, ok: bool) -> None:
    """Of 60 rows at 25 m/s so many at 12 have a mean below 15.8 m/s from 42.5 on."""
    assert dipped(12.0, rows) is ok
