"""Where a flight may begin, at each limit and just beyond it."""

import pytest

from flight.dynamics.start_place import check_place
from world.errors import FlightError

BEYOND = {
    "latitude": (90.0, 8.0, 500.0, 400.0),
    "longitude": (46.0, -180.1, 500.0, 400.0),
    "on the ground": (46.0, 8.0, 400.0, 400.0),
    "too high": (46.0, 8.0, 11000.0, 400.0),
}


@pytest.mark.parametrize("place", [(-89.9, 180.0, 500.0, 400.0), (46.0, 8.0, 400.1, 400.0), (46.0, 8.0, 10999.9, 0.0)])
def test_a_place_within_the_limits_is_taken(place: tuple[float, float, float, float]) -> None:
    check_place(*place)


@pytest.mark.parametrize("case", BEYOND)
def test_a_place_beyond_one_is_refused_by_its_name_and_value(case: str) -> None:
    place = BEYOND[case]
    with pytest.raises(FlightError) as caught:
        check_place(*place)
    error = caught.value
    # Both heights are the start's.
    field, value = {"latitude": ("latitude", 90.0), "longitude": ("longitude", -180.1)}.get(case, ("start", place[2]))
    assert (error.field, error.value) == (field, value)
    assert str(error).startswith("start at")
    assert str(error).endswith(error.allowed)
