"""The controls' limits, and the rows at which one is asked for all that it gives."""

import math
from typing import Any

import numpy as np
import pytest

from flight.simulation.control_limits import control_limits, held_at_limit
from flight.simulation.track import AILERON, ELEVATOR, RUDDER, THROTTLE, TRACK_ROW, Track, as_track


def commanded(column: int, *values: float) -> Track:
    rows: Any = np.zeros(len(values), TRACK_ROW)
    rows["commands"][:, column] = values
    return as_track(rows)


def test_limits_stand_in_the_order_of_the_commands() -> None:
    # 30 degrees of each surface: aircraft/aerosonde/aerosonde.toml.
    named = control_limits("aerosonde")
    assert [name for name, _ in named] == ["elevator", "aileron", "rudder", "throttle"]
    assert [limit for _, limit in named[:3]] == pytest.approx([math.radians(30.0)] * 3, abs=1e-3)
    assert named[THROTTLE] == ("throttle", 1.0)


def test_an_unknown_aircraft_has_a_throttle_and_no_limits() -> None:
    named = dict(control_limits("zeppelin"))
    assert named["throttle"] == 1.0
    assert all(math.isnan(named[name]) for name in ("elevator", "aileron", "rudder"))


@pytest.mark.parametrize("column", [ELEVATOR, AILERON, RUDDER])
def test_a_surface_is_held_at_either_limit_or_beyond(column: int) -> None:
    # Within a thousandth of the range, which is 1 here.
    track = commanded(column, -0.6, -0.5, -0.4995, -0.498, 0.0, 0.498, 0.4995, 0.5, 0.6)
    assert held_at_limit(track, column, -0.5, 0.5).tolist() == [True] * 3 + [False] * 3 + [True] * 3
    other = AILERON if column == ELEVATOR else ELEVATOR
    assert not held_at_limit(track, other, -0.5, 0.5).any()


def test_a_throttle_is_held_closed_and_open() -> None:
    track = commanded(THROTTLE, 0.0, 0.002, 0.5, 0.998, 1.0)
    assert held_at_limit(track, THROTTLE, 0.0, 1.0).tolist() == [True, False, False, False, True]


def test_unknown_limits_hold_nothing() -> None:
    assert not held_at_limit(commanded(ELEVATOR, -9.0, 0.0, 9.0), ELEVATOR, math.nan, math.nan).any()
