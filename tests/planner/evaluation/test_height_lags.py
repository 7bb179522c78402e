"""How far a late autopilot is below its legs, against the lag stepped through in hundredths of a second."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.path_limits import Limits, downwind
from planner.evaluation.height_lags import HEIGHT_LAG, below_at, measure_lags
from planner.evaluation.leg_geometry import LEG, measure_legs
from planner.evaluation.problem import make_problem
from tests.planner.straying import straying
from world.scenario import Scenario

Floats = NDArray[np.float64]
Make = Callable[[Scenario], Limits]
# Level, up at 5 degrees, level, down at 8, a step of 10 m down, a short climb, level.
RISES = (0.0, 87.0, 0.0, -140.0, -10.0, 17.0, 0.0)
RUNS = (600.0, 1000.0, 700.0, 1000.0, 900.0, 120.0, 800.0)


def path_of(runs: tuple[float, ...], rises: tuple[float, ...]) -> Floats:
    north = np.concatenate([[0.0], np.cumsum(runs)])
    up = 300.0 + np.concatenate([[0.0], np.cumsum(rises)])
    return np.stack([np.zeros(north.size), north - 2500.0, up], axis=1)


def lags_of(limits: Limits, scenario: Scenario, path: Floats) -> Any:
    data = make_problem(scenario, limits).search
    legs, lags = np.zeros(len(path) - 1, LEG), np.zeros(len(path) - 1, HEIGHT_LAG)
    measure_legs(path, legs)
    measure_lags(data.tracking, data.aircraft, downwind(data.aircraft), path, legs, lags)
    return lags


def stepped(path: Floats, speed: float, lag: float, step: float) -> list[Floats]:
    """How far below each leg, at even shares of it, an aircraft is whose height follows the demand late."""
    dt, height, found = 0.01, float(path[0, 2]), []
    for a, b in pairwise(path):
        run, rise = float(b[1] - a[1]), float(b[2] - a[2])
        ticks = round(run / speed / dt)
        below = np.empty(ticks)
        for k in range(ticks):
            drawn = float(a[2]) + rise * k / ticks
            below[k] = drawn - height
            demand = float(b[2]) if abs(rise) < step else drawn
            height += (demand - height) * dt / lag
        found.append(below)
    return found


@pytest.mark.parametrize("wind", [0.0, 8.0, -8.0])
def test_height_follows_late(small: Callable[..., Scenario], make_limits: Make, wind: float) -> None:
    """25 m/s north, with a wind along: within half a metre of the lag, and of its most and least, everywhere."""
    blowing = {"speed_mps": abs(wind), "from_deg": 180.0 if wind > 0.0 else 0.0}
    scenario = small(wind=blowing)
    limits = straying(make_limits(scenario), lag=3.0, step=15.0)
    path = path_of(RUNS, RISES)
    lags = lags_of(limits, scenario, path)
    for lag, below in zip(lags, stepped(path, 25.0 * 1.016 + wind, 3.0, 15.0), strict=True):
        shares = np.linspace(0.0, 1.0, below.size, endpoint=False)
        got = np.array([below_at(lag, share) for share in shares])
        assert got == pytest.approx(below, abs=0.7)
        assert lag["most"] >= max(0.0, got.max()) - 1e-9
        assert lag["least"] <= min(0.0, got.min()) + 1e-9


def test_a_steady_climb_is_lag_times_climb_rate_low(small: Callable[..., Scenario], make_limits: Make) -> None:
    """3 s of 25 m/s at 0.1 are 7.5 m, and with a lag of 1 s 2.5 m; at 300 m true airspeed is 1.5 % more."""
    scenario = small()
    path = path_of((3000.0,), (300.0,))
    for seconds, low in ((3.0, 7.5), (1.0, 2.5)):
        lag = lags_of(straying(make_limits(scenario), lag=seconds), scenario, path)[0]
        assert below_at(lag, 1.0) == pytest.approx(low * 1.015, rel=0.01)
        assert below_at(lag, 0.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("rise", "flown_level"), [(-14.9, True), (-15.1, False)])
def test_a_small_change_of_height_is_flown_at_its_end(
    small: Callable[..., Scenario], make_limits: Make, rise: float, flown_level: bool
) -> None:
    scenario = small()
    lag = lags_of(straying(make_limits(scenario), lag=3.0, step=15.0), scenario, path_of((2000.0,), (rise,)))[0]
    # Half way, 7.5 m below the leg; or a little above its slope.
    assert below_at(lag, 0.5) == pytest.approx(7.45 if flown_level else -3.0 * 25.4 * 15.1 / 2000.0, abs=0.05)


def test_no_lag_is_no_difference(small: Callable[..., Scenario], make_limits: Make) -> None:
    scenario = small()
    lags = lags_of(straying(make_limits(scenario), lag=0.0), scenario, path_of(RUNS, RISES))
    assert np.abs([[below_at(lag, share) for share in (0.0, 0.5, 1.0)] for lag in lags]).max() < 1e-3
    assert math.isclose(lags["most"].max(), 0.0, abs_tol=1e-3)
