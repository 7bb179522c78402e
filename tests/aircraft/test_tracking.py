"""What an autopilot strays by, between the knots of its tables and outside them."""

import math

import numpy as np
import pytest

from aircraft.tracking import (
    SPEED_RATIOS,
    TURNS,
    TrackingError,
    air_density_factor,
    corner_deviation,
    corridor_half_width,
    zero_tracking_error,
)


def error_of(**numbers: float) -> TrackingError:
    """Excursion 10 m a radian plus 1 m for each m/s beyond 15; before and after 3 and 7 times the turn."""
    turns, speeds = np.meshgrid(TURNS, SPEED_RATIOS * 25.0, indexing="ij")
    tables = {"excursion": 10.0 * turns + (speeds - 15.0), "before": 3.0 * turns, "after": 7.0 * turns}
    given = {"across": 2.0, "up": 3.0, "lag": 3.0, "step": 15.0} | numbers
    return TrackingError(airspeed=25.0, acceptance=40.0 * turns, **tables, **given)


@pytest.mark.parametrize("turn_deg", [0.0, 7.0, 30.0, 44.0, 149.0])
@pytest.mark.parametrize("speed", [15.0, 22.0, 31.0, 45.0])
def test_what_is_linear_is_found_between_the_knots(turn_deg: float, speed: float) -> None:
    turn = math.radians(turn_deg)
    deviation = corner_deviation(error_of().record, turn, speed)
    assert deviation == pytest.approx((10.0 * turn + speed - 15.0, 3.0 * turn, 7.0 * turn))
    assert error_of().corner_acceptance(turn, speed) == pytest.approx(40.0 * turn)
    assert error_of().corner_excursion(turn, speed) == pytest.approx(10.0 * turn + speed - 15.0)


def test_outside_the_tables_their_edges_count() -> None:
    record, most = error_of().record, math.radians(150.0)
    assert corner_deviation(record, math.pi, 60.0) == pytest.approx((10.0 * most + 30.0, 3.0 * most, 7.0 * most))
    assert corner_deviation(record, 0.5, 5.0)[0] == pytest.approx(5.0)


def test_an_exact_autopilot_has_nothing_to_leave_room_for() -> None:
    record = zero_tracking_error()
    assert not record.has_error
    assert error_of().record.has_error
    with pytest.raises(ValueError, match="read-only"):
        error_of().record.lag = 1.0


@pytest.mark.parametrize(("amsl", "factor"), [(0.0, 1.0), (1000.0, 1.0497), (2000.0, 1.1029), (4000.0, 1.2217)])
def test_true_airspeed_grows_with_height(amsl: float, factor: float) -> None:
    """The standard atmosphere's density ratios at 1, 2 and 4 km are 0.9075, 0.8217 and 0.6689 (ICAO Doc 7488)."""
    assert air_density_factor(amsl) == pytest.approx(factor, rel=0.006)


# ----------------------------------------------------------------------
# The corridor: what a scenario states, or what whoever flies needs.


@pytest.mark.parametrize(
    ("stated", "radius", "wanted"),
    [
        (None, None, 30.0),
        (None, 14.9, 30.0),
        (None, 15.1, 30.2),
        (None, 90.0, 180.0),
        (5.0, 90.0, 5.0),
        (5.0, None, 5.0),
    ],
)
def test_half_width(stated: float | None, radius: float | None, wanted: float) -> None:
    assert corridor_half_width(stated, radius) == pytest.approx(wanted)
