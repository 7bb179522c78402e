"""The size and rate of navigation's errors, and a flight that follows its estimated state."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from flight.guidance.navigation_error import ERRORS, MOTION, NAVIGATION_LAGS, estimate_motion, start_navigation_error
from flight.simulation.simulate import Flight, fly_to_end
from tests.setups import MakeSetup
from tests.soak import scaled
from world.kernels import Record


def test_navigation_errors_have_their_size_and_their_rate() -> None:
    dt, count = 1 / 60, scaled(200_000, 30_000)
    random = np.random.default_rng(5)
    for sigma, time_constant in (ERRORS["rtk"], ERRORS["gnss"]):
        lags: Record = np.zeros(1, NAVIGATION_LAGS)[0]
        true, estimated = np.zeros(2, MOTION)
        start_navigation_error(random.standard_normal(6), lags)
        found = np.empty((count, 6))
        noise = random.standard_normal((count, 3))
        for k in range(count):
            estimate_motion(true, estimated, lags, noise[k], sigma, time_constant, dt)
            found[k] = estimated.tolist()
        assert np.sqrt((found[:, :3] ** 2).mean()) == pytest.approx(sigma, rel=0.25)
        # Of this process the rate's deviation is sigma / T, and the velocity's error is the rate of the position's.
        assert np.sqrt((found[:, 3:] ** 2).mean()) == pytest.approx(sigma / time_constant, rel=0.1)
        rate = np.diff(found[:, :3], axis=0) / dt
        assert np.sqrt(((rate - found[:-1, 3:]) ** 2).mean()) < 0.1 * sigma / time_constant


def test_guidance_follows_what_navigation_says_and_the_track_is_true(
    make_setup: MakeSetup, aerosonde: Aircraft
) -> None:
    setup = make_setup([[0, 0, 500], [0, 3000, 500]])
    perfect, rtk, gnss = (
        fly_to_end(Flight(replace(setup, nav=nav), aerosonde)).track for nav in ("perfect", "rtk", "gnss")
    )
    away = [float(np.abs(track.position[300:, 0]).max()) for track in (perfect, rtk, gnss)]
    assert away[0] < 0.05 < 0.3 < away[2] < 8.0
    assert away[0] < away[1] < 0.5
    # It believes to be on the path.
    assert float(np.abs(gnss.cross_track[300:]).max()) < 0.5 * away[2]
