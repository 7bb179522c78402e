"""Named modes, trims and step responses of an aircraft."""

import math

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.characteristics import name_modes, step_responses, trim_table
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import linearise, steady_flight

AEROSONDE = load_aircraft("aerosonde")


def test_the_books_modes_get_their_names() -> None:
    fdm = Fdm(AEROSONDE, flat_earth=True)
    level = steady_flight(fdm, 25.0, 100.0)
    assert level is not None
    modes = {mode.name: mode for mode in name_modes(linearise(fdm, level)[0], 25.0)}
    expected = {
        "short period": -4.895 + 9.870j,
        "phugoid": -0.1426 + 0.4780j,
        "Dutch roll": -1.140 + 4.655j,
        "roll": -22.44,
        "spiral": 0.0892,
    }
    assert modes.keys() == expected.keys()
    for name, root in expected.items():
        assert abs(modes[name].root - root) < 1e-3 * abs(root)
    assert modes["short period"].damping == pytest.approx(0.444, abs=0.001)
    # Unstable, doubling in 8 s.
    assert modes["spiral"].damping == -1.0
    assert modes["spiral"].time == pytest.approx(7.8, abs=0.1)


def test_a_merged_pair_is_named_roll_spiral() -> None:
    a = np.diag([-1.0, -0.5, -2.0, -0.5, -3.0, -4.0, -0.3, -0.1])
    # v and r swing fast, p and roll slowly.
    a[np.ix_([1, 5], [1, 5])] = [[-0.5, -75.0], [0.12, -0.5]]
    a[np.ix_([3, 6], [3, 6])] = [[-0.2, -0.5], [1.0, -0.2]]
    names = [mode.name for mode in name_modes(a, 25.0)]
    assert names.count("Dutch roll") == 1
    assert names.count("roll-spiral") == 1
    assert "spiral" not in names


def test_slower_takes_less_power_and_lasts_longer() -> None:
    rows = trim_table(AEROSONDE, 4)
    assert [row.trim.airspeed for row in rows] == pytest.approx([18.0, 67 / 3, 80 / 3, 31.0])
    assert np.all(np.diff([row.power for row in rows]) > 0.0)
    for row in rows:
        assert row.power * row.endurance == pytest.approx(0.8 * 888.0 * 3600.0)


@pytest.mark.parametrize("name", ["aerosonde", "c172x"])
def test_each_control_is_answered_the_right_way(name: str) -> None:
    steps = {step.control: step for step in step_responses(load_aircraft(name))}
    assert list(steps) == ["elevator", "throttle", "aileron", "rudder"]
    for control, quantity, sign in (
        ("elevator", "alpha", 1.0),
        ("throttle", "airspeed", 1.0),
        ("aileron", "roll", 1.0),
        ("rudder", "yaw_rate", -1.0),
    ):
        step = steps[control]
        answer = step.change[:, step.quantities.index(quantity)]
        before = step.time < 1.0
        assert np.abs(answer[before]).max() < 2e-3
        assert sign * answer[np.searchsorted(step.time, 1.8)] > 2e-3
        assert math.isfinite(float(np.abs(step.change).max()))
