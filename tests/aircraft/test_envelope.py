"""The envelope's interpolation, wind triangle, power and turn, by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aircraft.envelope import (
    GRAVITY,
    UNDECIDED_SIGMAS,
    Envelope,
    _interpolate_rows,
    ground_slope,
    ground_speed,
    turn_radius,
)
from logs.verdict import tolerances
from tests.setups import falling_envelope


def powered() -> Envelope:
    """The hand-written envelope with 100 W gliding, 300 W level and 900 W climbing, at every speed and height."""
    size = (3, 3)
    return replace(
        falling_envelope(),
        power_idle=np.full(size, 100.0),
        power_level=np.full(size, 300.0),
        power_full=np.full(size, 900.0),
    )


def test_angles_are_bilinear_in_airspeed_and_height() -> None:
    envelope = falling_envelope()
    # 17 degrees at 20 m/s and 14.9 at 25; 2.4 less for each 1000 m.
    for airspeed, amsl, climb_deg in (
        (20.0, 0.0, 17.0),
        (25.0, 1000.0, 12.5),
        (22.5, 0.0, 15.95),
        (22.5, 500.0, 14.75),
        (27.0, 2000.0, 14.9 - 0.4 * 8.9 - 4.8),
    ):
        assert envelope.air_angles(airspeed, amsl)[0] == pytest.approx(math.radians(climb_deg))
    assert envelope.air_angles(22.5, 777.0)[1] == pytest.approx(math.radians(7.15))


def test_outside_the_table_heights_hold_their_edge_and_speeds_have_no_angles() -> None:
    envelope = falling_envelope()
    assert envelope.air_angles(25.0, -200.0) == envelope.air_angles(25.0, 0.0)
    assert envelope.air_angles(25.0, 9000.0) == envelope.air_angles(25.0, 3000.0)
    # Below the slowest level flight, 18 m/s, and beyond the fastest of the table; between 18 and 20 m/s there is none.
    for airspeed in (17.9, 18.5, 30.1, math.nan):
        assert np.isnan(envelope.air_angles(airspeed, 500.0)).all()


def test_between_the_slowest_level_flight_and_the_slowest_trim_the_trim_counts() -> None:
    climb = np.radians([[math.nan] * 3, [12.0] * 3, [6.0] * 3])
    envelope = replace(falling_envelope(), climb=climb, level_speed_min=np.full(3, 21.0))
    assert envelope.air_angles(22.0, 500.0)[0] == pytest.approx(math.radians(12.0))
    assert envelope.air_angles(27.5, 500.0)[0] == pytest.approx(math.radians(9.0))
    assert math.isnan(envelope.air_angles(20.9, 500.0)[0])


@given(st.lists(st.floats(-50.0, 50.0) | st.just(math.nan), min_size=8, max_size=8), st.floats(-2.0, 12.0))
def test_a_table_between_heights_is_numpys_interpolation(values: list[float], amsl: float) -> None:
    heights, table = np.array([0.0, 1.5, 4.0, 10.0]), np.array(values).reshape(2, 4)
    wanted = [np.interp(amsl, heights, row) for row in table]
    np.testing.assert_array_equal(_interpolate_rows(heights, table, amsl), wanted)


def test_wind_bends_the_slope_over_the_ground() -> None:
    envelope = falling_envelope()
    climb, descent = envelope.air_angles(25.0, 500.0)
    assert envelope.slope_limits(25.0, 500.0) == pytest.approx((climb, descent))
    got = envelope.slope_limits(25.0, 500.0, -10.0)
    rise, sink = 25.0 * math.sin(climb), 25.0 * math.sin(descent)
    assert got == pytest.approx(
        (math.atan(rise / (25.0 * math.cos(climb) - 10.0)), math.atan(sink / (25.0 * math.cos(descent) - 10.0)))
    )


def test_a_crosswind_takes_from_the_speed_along_the_course() -> None:
    # 7, 24, 25 is a right triangle.
    assert ground_speed(25.0, 0.0, 7.0) == pytest.approx(24.0)
    assert ground_speed(25.0, 4.0, -7.0) == pytest.approx(28.0)
    assert math.isnan(ground_speed(25.0, -24.5, 7.0))
    assert math.isnan(ground_speed(25.0, 0.0, 25.1))
    assert math.isnan(ground_slope(0.1, 25.0, -26.0, 0.0))
    assert ground_slope(-0.1, 25.0, 0.0, 0.0) == pytest.approx(-0.1)


def test_a_coordinated_turn_balances_gravity() -> None:
    # At 45 degrees the side force is the weight: v^2 / r = g.
    assert turn_radius(30.0, math.pi / 4) == pytest.approx(900.0 / GRAVITY)
    assert turn_radius(25.0, math.radians(30.0)) == pytest.approx(110.39, abs=0.01)


def test_power_is_a_parabola_through_idle_level_and_full_throttle() -> None:
    envelope = powered()
    climb, descent = envelope.air_angles(25.0, 500.0)
    assert envelope.power(25.0, 500.0, 0.0) == pytest.approx(300.0)
    assert envelope.power(25.0, 500.0, climb) == 900.0
    assert envelope.power(25.0, 500.0, climb + 0.1) == 900.0
    assert envelope.power(25.0, 500.0, -descent) == 100.0
    assert envelope.power(25.0, 500.0, -descent - 0.1) == 100.0
    x = np.array([-math.sin(descent), 0.0, math.sin(climb)])
    angle = 0.6 * climb
    wanted = np.polyval(np.polyfit(x, [100.0, 300.0, 900.0], 2), math.sin(angle))
    assert envelope.power(25.0, 500.0, angle) == pytest.approx(wanted)


def test_power_is_unknown_without_a_table_and_off_it() -> None:
    assert math.isnan(falling_envelope().power(25.0, 500.0, 0.0))
    assert math.isnan(powered().power(35.0, 500.0, 0.0))


def test_level_speeds_lie_between_those_of_the_heights() -> None:
    envelope = replace(falling_envelope(), level_speed_min=np.array([16.0, 17.0, 21.0]))
    assert envelope.level_speeds(500.0) == pytest.approx((16.5, 33.0))
    assert envelope.level_speeds(2000.0) == pytest.approx((19.0, 33.0))
    with pytest.raises(ValueError, match="read-only"):
        envelope.climb[0, 0] = 1.0


def test_the_verdict_publishes_what_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    # 2 deviations of 0.05 rad, and not 1.645, once the one constant says so.
    monkeypatch.setattr("aircraft.envelope.UNDECIDED_SIGMAS", 2.0)
    known = replace(falling_envelope(), climb=np.full_like(falling_envelope().climb, 0.2), climb_sd=0.05)
    assert known.with_margin().climb == pytest.approx(0.1)
    monkeypatch.undo()
    assert tolerances.UNDECIDED_FRACTION == UNDECIDED_SIGMAS == 1.645


def test_the_fastest_that_is_sure_is_1_645_deviations_less_and_no_slower_than_the_slowest() -> None:
    known = replace(falling_envelope(), fastest_sd=2.0)
    assert known.with_margin().level_speed_max == pytest.approx(falling_envelope().level_speed_max - 3.29)
    assert known.with_margin().fastest_sd == 0.0
    none = replace(falling_envelope(), fastest_sd=50.0).with_margin()
    assert none.level_speed_max.tolist() == none.level_speed_min.tolist()
