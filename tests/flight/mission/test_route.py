"""A route holds copies of what it was given, locked, and knows its legs."""

from typing import Any

import numpy as np
import pytest

from flight.mission.route import Route

ARRAYS = ("waypoints", "airspeed", "acceptance", "fly_over", "items", "arcs")


def parts() -> dict[str, Any]:
    """Three waypoints and the two legs between them."""
    return {
        "waypoints": np.array([[0.0, 0.0, 500.0], [0.0, 900.0, 500.0], [800.0, 900.0, 550.0]]),
        "airspeed": np.array([25.0, 27.0]),
        "acceptance": np.array([0.0, 30.0, 0.0]),
        "fly_over": np.array([False, True, False]),
        "items": np.array([-1, 1, 2]),
        "started": "on the ground",
    }


def test_a_leg_is_between_two_waypoints() -> None:
    assert Route(**parts()).legs == 2


def test_turns_have_the_bank_limits_radius_unless_one_is_given() -> None:
    assert Route(**parts()).arcs.tolist() == [0.0, 0.0, 0.0]
    assert Route(**parts(), arcs=np.array([0.0, 80.0, 0.0])).arcs.tolist() == [0.0, 80.0, 0.0]


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_locked_copies(name: str) -> None:
    given = parts() | {"arcs": np.array([0.0, 80.0, 0.0])}
    kept = given[name].copy()
    route = Route(**given)
    with pytest.raises(ValueError, match="read-only"):
        getattr(route, name)[0] = 1
    given[name][:] = 1 - given[name].astype(kept.dtype) if kept.dtype != bool else ~kept
    np.testing.assert_array_equal(getattr(route, name), kept)
