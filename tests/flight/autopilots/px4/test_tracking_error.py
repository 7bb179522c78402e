"""How far PX4 strays from a plan's legs: its corners against those that PX4 itself flew, and its height."""

import math

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from aircraft.tracking import TURNS
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4.tracking_error import WIND_SPREAD, altitude_miss_probability, tracking_error
from tests.flight.autopilots.px4.kept_flights import kept
from world.scenario_tables import Px4Version

# Degrees of the corners at waypoints 2 to 5 of the kept flights.
CORNERS = {2: 60.0, 3: 90.0, 4: 60.0, 5: 45.0}


def still(aerosonde: Aircraft, version: Px4Version, turn_deg: float, airspeed: float) -> float:
    """The excursion at a corner in still air, what is left for wind taken off."""
    error = tracking_error(Px4Parameters.load(aerosonde, None, version), airspeed, "perfect")
    share, more = WIND_SPREAD
    spread = share + more * (TURNS / (0.5 * math.pi)) ** 2
    table = [np.interp(1.0, [0.6, 1.0], row[:2]) for row in error.excursion / spread[:, None]]
    return float(np.interp(math.radians(turn_deg), TURNS, table))


@pytest.mark.parametrize("waypoint", sorted(CORNERS))
def test_a_corner_takes_the_room_that_px4_took(waypoint: int, aerosonde: Aircraft) -> None:
    """At 600 m, 25 m/s are 25.7 m/s true."""
    flown = kept("corners-1.17").overshoot(waypoint)
    assert still(aerosonde, "1.17", CORNERS[waypoint], 25.75) == pytest.approx(flown, rel=0.12)


def test_turning_early_halves_a_right_angles_overshoot(aerosonde: Aircraft) -> None:
    early, late = (still(aerosonde, version, 90.0, 25.75) for version in ("1.16", "1.17"))
    assert early == pytest.approx(kept("corners-1.16").overshoot(3), rel=0.12)
    assert late > 1.4 * early


def test_a_straight_leg_takes_none(aerosonde: Aircraft) -> None:
    error = tracking_error(Px4Parameters.load(aerosonde, None, "1.16"), 25.0, "perfect")
    assert (error.excursion[0] == 0.0).all()
    assert (error.before[0] == 0.0).all()
    # It turns 2.24 s before a waypoint, at the ground speeds of the table.
    assert error.acceptance[3].tolist() == pytest.approx([33.6, 56.0, 78.4, 100.8])
    assert (error.excursion[3] > 0.0).all()


@pytest.mark.parametrize(
    ("turbulence", "share", "of_aircraft"), [("none", 0.8, 1.0), ("light", 0.7, 0.7), ("moderate", 0.6, 0.6)]
)
def test_slopes_are_those_of_the_reference_and_late_by_its_lag(
    turbulence: str, share: float, of_aircraft: float, aerosonde: Aircraft
) -> None:
    made = Px4Parameters.load(aerosonde).changed(FW_T_CLMB_R_SP=5.0, FW_T_HRATE_FF=0.5, FW_T_ALT_TC=4.0)
    error = tracking_error(made, 25.0, "gnss", turbulence=turbulence)  # type: ignore[arg-type]  # a name of the table
    assert (error.climb_rate, error.sink_rate, error.lag, error.step) == pytest.approx(
        (share * 5.0, share * 2.0, 2.0, 0.0)
    )
    assert (error.own_climb_share, error.own_sink_share) == (of_aircraft, of_aircraft)
    # Three standard deviations of 1.5 m beside 2 and 3 m.
    assert (error.across, error.up) == pytest.approx((math.hypot(2.0, 4.5), math.hypot(3.0, 4.5)))


def test_gusts_leave_a_waypoints_height_by_the_normal_distribution() -> None:
    """In moderate turbulence 4 m are one deviation of the height, and 1.54 m/s one of the gusts, 10 m in 6 s."""
    # Beyond 2.5 deviations lie 0.62097 % on either side; beyond 2 and 1.5 of them 2.27501 and 6.68072 %.
    strong = altitude_miss_probability(10.0, 100.0, 100.0, "moderate")
    assert strong == pytest.approx(2.0 * 0.0062097, rel=1e-4)
    assert altitude_miss_probability(10.0, 2.0 * 1.54 - 10.0 / 6.0, 100.0, "moderate") == pytest.approx(
        strong + 0.0227501
    )
    assert altitude_miss_probability(10.0, 100.0, 1.5 * 1.54 - 10.0 / 6.0, "moderate") == pytest.approx(
        strong + 0.0668072
    )
    assert altitude_miss_probability(6.0, 100.0, 100.0, "moderate") == pytest.approx(2.0 * 0.0668072)


def test_calmer_air_has_no_chance_of_it() -> None:
    assert altitude_miss_probability(0.1, -5.0, -5.0, "light") == 0.0
    assert altitude_miss_probability(0.1, -5.0, -5.0, "none") == 0.0


def test_px4s_own_acceptance_counts() -> None:
    made = Px4(Px4Parameters.defaults().changed(NAV_FW_ALT_RAD=6.0))
    assert made.deviations.altitude_miss_probability(100.0, 100.0, "moderate") == pytest.approx(2.0 * 0.0668072)
    assert PlanflyGuidance().deviations.altitude_miss_probability(-5.0, -5.0, "moderate") == 0.0
