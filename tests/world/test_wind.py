"""Wind components by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from world.wind import Wind


@pytest.mark.parametrize(
    ("from_deg", "east", "north"),
    [(0.0, 0.0, -10.0), (90.0, -10.0, 0.0), (180.0, 0.0, 10.0), (270.0, 10.0, 0.0), (225.0, 7.0710678, 7.0710678)],
)
def test_where_it_blows_from(from_deg: float, east: float, north: float) -> None:
    assert Wind(10.0, math.radians(from_deg)).velocity_at(0.0) == pytest.approx((east, north), abs=1e-6)


@pytest.mark.parametrize(
    ("course_deg", "tail", "cross"),
    [(90.0, 10.0, 0.0), (270.0, -10.0, 0.0), (0.0, 0.0, 10.0), (180.0, 0.0, -10.0), (45.0, 7.0710678, 7.0710678)],
)
def test_along_a_course_in_a_west_wind(course_deg: float, tail: float, cross: float) -> None:
    # Flying north, a west wind comes from the left.
    assert Wind(10.0, math.radians(270.0)).components_on_course(math.radians(course_deg), 0.0) == pytest.approx(
        (tail, cross), abs=1e-6
    )


@given(st.floats(0.0, 40.0), st.floats(-7.0, 7.0), st.floats(-7.0, 7.0))
def test_components_keep_the_speed(speed: float, source: float, course: float) -> None:
    wind = Wind(speed, source)
    assert math.hypot(*wind.velocity_at(500.0)) == pytest.approx(speed, abs=1e-9)
    assert math.hypot(*wind.components_on_course(course, 500.0)) == pytest.approx(speed, abs=1e-9)


def test_gradient_counts_from_the_reference_and_never_turns_the_wind() -> None:
    wind = Wind(6.0, math.radians(270.0), gradient=0.01, reference_amsl=300.0)
    assert wind.velocity_at(300.0)[0] == pytest.approx(6.0)
    assert wind.velocity_at(700.0)[0] == pytest.approx(10.0)
    assert wind.velocity_at(-400.0)[0] == 0.0


@pytest.mark.parametrize("from_deg", [0.0, 75.0, 200.0])
def test_it_blows_to_the_other_side(from_deg: float) -> None:
    wind = Wind(6.0, math.radians(from_deg))
    east, north = wind.velocity_at(500.0)
    assert (6.0 * math.sin(wind.to_course), 6.0 * math.cos(wind.to_course)) == pytest.approx((east, north))
