"""The law's memory begins as nothing flown."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from aircraft.envelope import GRAVITY
from benchmarks.against_arduplane import BINARY, compare, flown_figures
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.law import (
    ARDUPILOT_MEMORY,
    ROLL_LAG_RATIO,
    control_attitude,
    update_height_demand,
)
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.tecs import (
    AIRSPEED_READING,
    airspeed_target,
    limited_nav_roll,
    min_airspeed,
    update_tecs,
)
from flight.dynamics.state import COMMANDS
from flight.guidance.gains import GAINS
from flight.guidance.inner_loops import GUIDANCE_MEMORY, steer_elevator
from flight.guidance.navigation_error import MOTION
from flight.mission_files.formats import parse_mission
from flight.simulation.simulate import Flight, fly_to_end
from planfly.workflow.open_flight import make_setup as setup_of
from planfly.workflow.uav import load_uav
from tests.flight.autopilots.arduplane.laws import flying, memory, parameters, record, state, waypoints
from tests.setups import MakeSetup
from tests.soak import SOAK
from world.kernels import Record, field_names
from world.scenario import scenario_from_spec
from world.scenario_tables import ArduPlaneVersion


def test_a_fresh_memory_is_on_the_first_leg_and_has_flown_nothing() -> None:
    fresh: Record = np.zeros(1, ARDUPILOT_MEMORY)[0]
    assert (
        fresh.leg,
        bool(fresh.is_initialised),
        bool(fresh.has_last_velocity),
        bool(fresh.reached_loiter_target),
    ) == (0, False, False, False)


def test_counts_are_whole_and_all_else_are_numbers() -> None:
    kinds = {name: ARDUPILOT_MEMORY[name] for name in field_names(ARDUPILOT_MEMORY)}
    assert {name for name, kind in kinds.items() if kind == np.int64} == {
        *("leg", "saturation", "leg_after_loiter", "terrain_leg", "sloped_leg"),
    }
    truths = {name for name, kind in kinds.items() if kind == np.bool_}
    assert truths == {
        "is_initialised",
        "has_last_velocity",
        "reached_loiter_target",
        "loiter_started",
        "reached_target_altitude",
        "loiter_complete",
        "is_in_rtl",
        "rtl_climb_complete",
        "is_throttle_saturated",
        "bad_descent",
        "underspeed",
    }
    assert all(kind == np.float64 for kind in kinds.values() if kind not in (np.int64, np.bool_))


# ----------------------------------------------------------------------
# ArduPlane's height demand and TECS by plain sums: steps and slopes, lag and rate limits, throttle and pitch.

DT = 0.1


def demanded(own: Record, north: float, end: float, up: float = 500.0, **values: float) -> float:
    """Height that a leg of 1,000 m from 500 m asks for."""
    (b,) = waypoints((0, 1000, end))
    update_height_demand(flying(0.0, north, up), b, parameters(**values), own, DT)
    return float(own.altitude_demand_in)


@pytest.mark.parametrize(
    ("rise", "expected"), [(14.9, 514.9), (15.0, 507.5), (-14.9, 485.1), (-15.0, 492.5), (100.0, 550.0)]
)
def test_small_changes_of_height_are_steps_and_others_slopes(rise: float, expected: float) -> None:
    assert demanded(memory(), 500.0, 500.0 + rise, up=expected) == pytest.approx(expected)


def test_the_least_slope_is_alt_slope_min() -> None:
    assert demanded(memory(), 500.0, 520.0, ALT_SLOPE_MIN=21.0) == 520.0
    assert demanded(memory(), 500.0, 520.0, ALT_SLOPE_MIN=19.0) == pytest.approx(510.0)
    # 0 disables slopes (`Plane::set_offset_altitude_location`).
    assert demanded(memory(), 500.0, 600.0, ALT_SLOPE_MIN=0.0) == 600.0
    assert demanded(memory(), 500.0, 400.0, ALT_SLOPE_MIN=0.0) == 400.0


@pytest.mark.parametrize(
    ("over_home", "end", "options", "expected"),
    [
        (20.0, 600.0, 0, 600.0),  # a climb that begins at 20 m over home or below is a step
        (20.1, 600.0, 0, 550.0),
        (-30.0, 600.0, 0, 600.0),  # also below home
        (20.0, 400.0, 0, 450.0),  # a descent is a slope from any height
        (100.0, 600.0, 1 << 14, 600.0),  # FLIGHT_OPTIONS bit 14: every climb
        (100.0, 600.0, 1 << 13, 550.0),
        (100.0, 400.0, 1 << 14, 450.0),
        (math.nan, 600.0, 0, 550.0),  # no home is known
    ],
)
def test_a_climb_that_begins_low_over_home_is_a_step(
    over_home: float, end: float, options: int, expected: float
) -> None:
    """`Plane::setup_glide_slope`; what applies at the leg's begin applies to all of it."""
    own = memory()
    (b,) = waypoints((0, 1000, end), home_up=500.0 - over_home)
    made = parameters("4.6", FLIGHT_OPTIONS=float(options), ALT_SLOPE_MAXHGT=0.0)
    for north, up in ((0.0, 500.0), (500.0, 540.0)):
        update_height_demand(flying(0.0, north, up), b, made, own, DT)
    assert own.altitude_demand_in == pytest.approx(expected)


def test_each_leg_is_a_step_or_a_slope_by_the_height_at_its_own_begin() -> None:
    own, made = memory(), parameters("4.6")
    for leg, over_home, expected in ((0, 10.0, 600.0), (1, 30.0, 550.0)):
        own.leg, own.from_up = leg, 500.0
        (b,) = waypoints((0, 1000, 600.0), home_up=500.0 - over_home)
        update_height_demand(flying(0.0, 500.0, 500.0), b, made, own, DT)
        assert own.altitude_demand_in == pytest.approx(expected)


@pytest.mark.parametrize(
    ("end", "over_home", "stated", "expected"),
    [
        (600.0, 24.9, {}, 600.0),  # below CLIMB_SLOPE_HGT, 25 m, the end of a climb is demanded at once
        (600.0, 25.0, {}, 550.0),  # from there on its slope
        (600.0, 25.0, {"CLIMB_SLOPE_HGT": 30.0}, 600.0),
        (400.0, 24.9, {}, 450.0),  # a descent is a slope at any height
        (600.0, 100.0, {"FLIGHT_OPTIONS": float(1 << 14)}, 600.0),
    ],
)
def test_in_47_a_climb_is_a_slope_from_a_height_over_home(
    end: float, over_home: float, stated: dict[str, float], expected: float
) -> None:
    """`Plane::set_target_altitude_proportion` decides by the height at each update, not at the leg's begin."""
    own, made = memory(), parameters("4.7", ALT_SLOPE_MAXHGT=0.0, **stated)
    (b,) = waypoints((0, 1000, end), home_up=500.0 - over_home)
    # The leg begins well above home; halfway the aircraft is at a height over home.
    begin = waypoints((0, 1000, end), home_up=0.0)[0]
    update_height_demand(flying(0.0, 0.0, 500.0), begin, made, own, DT)
    update_height_demand(flying(0.0, 500.0, 500.0), b, made, own, DT)
    assert own.altitude_demand_in == pytest.approx(expected)


def test_before_and_past_a_leg_its_ends_heights_hold() -> None:
    assert demanded(memory(), -100.0, 600.0) == 500.0
    assert demanded(memory(), 1001.0, 600.0) == 600.0


@pytest.mark.parametrize(("above", "again"), [(4.9, False), (5.1, True)])
def test_high_above_a_climbing_slope_it_is_drawn_anew(above: float, again: bool) -> None:
    own = memory()
    asked = demanded(own, 500.0, 600.0, up=550.0 + above)
    assert asked == pytest.approx(550.0 + (above if again else 0.0))
    # The new slope goes from here to the end: a quarter of the way on it is half way up what is left.
    later = demanded(own, 750.0, 600.0, up=560.0)
    assert later == pytest.approx(600.0 - 0.5 * (50.0 - above) if again else 575.0)


@pytest.mark.parametrize("time", [1.0, 3.0])
def test_a_slope_is_followed_one_time_constant_late(time: float) -> None:
    own, (b,) = memory(), waypoints((0, 1000, 600))
    for k in range(600):
        north = 25.0 * DT * k
        update_height_demand(flying(0.0, north, own.altitude_demand), b, parameters(TECS_HDEM_TCONST=time), own, DT)
        if north > 900.0:
            break
    climb = 2.5
    # The sampled lag is behind by its time constant x the rate, and up to a sample.
    assert own.altitude_demand_in - own.altitude_demand == pytest.approx(time * climb, abs=climb * DT)
    assert own.climb_rate_demand == pytest.approx(climb, rel=DT / time + 1e-6)


@pytest.mark.parametrize(("end", "rate"), [(900.0, 5.0), (100.0, -4.0)])
def test_no_more_is_asked_than_the_climb_and_sink_rates(end: float, rate: float) -> None:
    own, (b,) = memory(), waypoints((0, 1000, end))
    for _ in range(300):
        update_height_demand(flying(0.0, 1001.0), b, parameters(TECS_SINK_MAX=4.0), own, DT)
    assert own.altitude_demand_limited == pytest.approx(500.0 + 30.0 * rate)
    assert own.climb_rate_demand == pytest.approx(rate, rel=0.04)


@pytest.mark.parametrize("held", [1, -1])
def test_what_cannot_be_followed_waits(held: int) -> None:
    end = 500.0 + held * 100.0
    own, (b,) = memory(), waypoints((0, 1000, end))
    for k in range(100):
        update_height_demand(flying(0.0, 25.0 * DT * k), b, parameters(), own, DT)
    asked, share = own.altitude_demand_in, own.max_climb_scaler if held > 0 else own.max_sink_scaler
    assert share == pytest.approx(1.0)
    own.saturation = held
    for k in range(100, 130):
        update_height_demand(flying(0.0, 25.0 * DT * k), b, parameters(), own, DT)
    assert own.altitude_demand_in == asked
    # After three seconds of a lag of three, 1 / e of the rate is left.
    assert (own.max_climb_scaler if held > 0 else own.max_sink_scaler) == pytest.approx((3.0 / 3.1) ** 30)
    own.saturation = -held
    update_height_demand(flying(0.0, 25.0 * 13.0), b, parameters(), own, DT)
    assert abs(own.altitude_demand_in - 500.0) == pytest.approx(2.5 * 13.0)


def weighed(own: Record, seen: Record, at: Record, **values: float) -> None:
    usual = {"AIRSPEED_CRUISE": 25.0, "AIRSPEED_MAX": 40.0}
    update_tecs(seen, at, parameters(**usual | values), own, 25.0, 1.0, DT)


def steady(**values: Any) -> Record:
    """Memory of steady flight: what the sensor reads is what is demanded."""
    return memory(
        **({"tas": 25.0, "airspeed_smoothed": 25.0, "has_last_velocity": True, "last_velocity_north": 25.0} | values)
    )


def reading(**values: Any) -> Record:
    return state(**({"airspeed": 25.0 / AIRSPEED_READING} | values))


def test_in_steady_flight_nothing_changes() -> None:
    own = steady()
    weighed(own, reading(), flying())
    assert own.throttle_demand == pytest.approx(0.45)
    assert own.pitch_demand == pytest.approx(0.0)
    assert own.saturation == 0


def test_throttle_for_missing_height() -> None:
    # 2 m low: feed-forward, error and damping, divided by the energy rate that all of the throttle gives.
    own = steady(altitude_demand=502.0)
    weighed(own, reading(), flying())
    missing, per_throttle = 2.0 * GRAVITY, (5.0 + 2.0) * GRAVITY / 1.0
    damped = 0.5 * (missing / 5.0) * DT / (DT + 0.5)
    expected = 0.45 + (missing / 5.0 + (missing + damped) / 5.0) / per_throttle
    assert own.last_throttle_demand == pytest.approx(min(expected, 0.45 + 1.0 * DT))
    assert own.ste_integrator == pytest.approx(0.3 * missing * DT / (5.0 * per_throttle))


def test_the_rate_of_energy_that_is_amiss_is_smoothed_over_half_a_second() -> None:
    """A first-order filter of 0.5 s (`AP_TECS`): n turns of 0.1 s leave (0.5 / 0.6)^n of what it has to come to."""
    own = steady()
    for k in range(1, 6):
        before = own.ste_rate_error
        weighed(own, reading(), flying(up=501.0))
        # 1 m too high asks for g / 5 s less.
        wanted = -GRAVITY / 5.0
        assert own.ste_rate_error - before == pytest.approx((wanted - before) / 6.0, rel=0.05), k


def test_too_fast_to_sink_height_is_no_reason_to_throttle_back() -> None:
    """3 m too high are 29.4 m^2/s^2; at 30.5 m/s to AIRSPEED_MAX 31 are only 15.4, and no more is taken back."""
    fast = {"tas": 30.5, "airspeed_smoothed": 30.5, "last_velocity_north": 30.5, "tas_demand": 30.5}
    own = steady(**fast)
    seen = record(MOTION, up=503.0, velocity_north=30.5)
    at = state(airspeed=30.5 / AIRSPEED_READING, velocity_north=30.5)
    update_tecs(at, seen, parameters(AIRSPEED_MAX=31.0), own, 30.5, 1.0, DT)
    # The integral's share of 0.3 of the gain: a throttle by 5 s and (5 + 2) m/s of climb.
    gain = 1.0 / (5.0 * 7.0 * GRAVITY)
    assert own.ste_integrator == pytest.approx(gain * 0.3 * -0.5 * (31.0**2 - 30.5**2) * DT, rel=0.02)


def test_a_bank_takes_throttle() -> None:
    own = steady()
    weighed(own, reading(roll=math.radians(30.0)), flying())
    # TECS_RLL2THR x (1 / cos^2 - 1): a third of it at 30 degrees.
    assert own.throttle_demand == pytest.approx(0.45 + 10.0 / 3.0 / ((5.0 + 2.0) * GRAVITY))


def test_pitch_for_missing_height() -> None:
    own = steady(altitude_demand=501.0)
    weighed(own, reading(), flying())
    wanted = GRAVITY / 5.0
    total = wanted + 0.3 * wanted + 0.3 * wanted * DT
    expected = total / (25.0 * GRAVITY)
    assert own.pitch_demand == pytest.approx(min(expected, 7.0 / 25.0 * DT))


def test_pitch_moves_no_faster_than_the_vertical_acceleration_allows() -> None:
    own = steady(altitude_demand=520.0)
    weighed(own, reading(), flying(), TECS_VERT_ACC=4.0)
    assert own.pitch_demand == pytest.approx(4.0 / 25.0 * DT)


@pytest.mark.parametrize(("high", "degrees", "throttle"), [(50.0, 15.0, 1.0), (-50.0, -25.0, 0.1)])
def test_pitch_and_throttle_keep_their_limits(high: float, degrees: float, throttle: float) -> None:
    own = steady()
    for _ in range(200):
        own.altitude_demand = 500.0 + high
        # With this damping the demand is beyond the limits without its integrators: 5 m/s x 2.5 at 25 m/s.
        weighed(own, reading(), flying(), THR_MIN=10.0, AIRSPEED_MAX=35.0, TECS_PTCH_DAMP=1.5)
    assert math.degrees(own.pitch_demand) == pytest.approx(degrees)
    assert own.throttle_demand == throttle
    assert own.saturation == (1 if high > 0.0 else -1)


def test_too_fast_it_pitches_up_and_throttles_back() -> None:
    own = steady(tas=26.0)
    weighed(own, reading(airspeed=26.0 / AIRSPEED_READING), flying())
    assert own.pitch_demand > 0.0
    assert own.throttle_demand < 0.45


def test_the_airspeed_demand_changes_within_what_the_energy_allows() -> None:
    own = steady()
    update_tecs(reading(), flying(), parameters(AIRSPEED_MAX=40.0), own, 30.0, 1.0, DT)
    assert own.tas_demand == pytest.approx(25.0 + 0.5 * 5.0 * GRAVITY / 25.0 * DT)


def test_what_a_pull_up_turns_the_velocity_by_counts_as_acceleration_along_the_nose() -> None:
    """A nose 10 degrees up, and a climb that begins with 2 m/s^2: sin 10 of that is felt along the nose."""
    own = steady()
    weighed(own, reading(pitch=math.radians(10.0)), flying(climb=0.2))
    lost = 1.0 - DT / (DT + 5.0)
    assert own.tas_rate == pytest.approx(2.0 * math.sin(math.radians(10.0)) * lost)
    # On the level it is not.
    own = steady()
    weighed(own, reading(), flying(climb=0.2))
    assert own.tas_rate == pytest.approx(0.0)


def test_the_airspeed_is_a_smoothed_reading_of_before() -> None:
    """The sensor reads 1 m/s more from now on: 0.3 of what is missing at each turn, and none of it at the first."""
    own = steady()
    for k in range(1, 4):
        held = own.tas
        weighed(own, reading(airspeed=26.0 / AIRSPEED_READING), flying())
        assert own.airspeed_smoothed == pytest.approx(26.0 - 0.7**k)
        if k == 1:
            assert own.tas == held


@pytest.mark.parametrize(("bank_deg", "prevents", "least"), [(30.0, 1.0, 19.34), (30.0, 0.0, 18.0), (0.0, 1.0, 18.0)])
def test_the_least_airspeed_grows_with_the_load_in_a_bank(bank_deg: float, prevents: float, least: float) -> None:
    """18 m/s over the root of cos 30: as ArduPlane's log of a turn shows it, at once (19.32 m/s; TECS.spdem)."""
    own = steady(tas_demand=18.0, lateral_acceleration=GRAVITY * math.tan(math.radians(bank_deg)))
    values = parameters(AIRSPEED_MIN=18.0, AIRSPEED_MAX=31.0, STALL_PREVENTION=prevents)
    update_tecs(reading(), flying(), values, own, 18.0, 1.0, DT)
    assert own.tas_demand == pytest.approx(least, abs=0.005)


@pytest.mark.parametrize(
    ("airspeed", "loss"),
    [
        # At AIRSPEED_CRUISE and below: nine tenths of the energy rate of TECS_SINK_MIN.
        (25.0, 0.9 * 2.0 * GRAVITY / 25.0),
        (20.0, 0.9 * 2.0 * GRAVITY / 25.0),
        # At AIRSPEED_MAX: of TECS_SINK_MAX; halfway the mean of both.
        (40.0, 0.9 * 5.0 * GRAVITY / 40.0),
        (32.5, 0.9 * 0.5 * (2.0 / 25.0 + 5.0 / 40.0) * GRAVITY),
    ],
)
def test_the_tas_demand_falls_with_nine_tenths_of_the_energy_rate(airspeed: float, loss: float) -> None:
    """`AP_TECS::_update_speed_demand`."""
    own = steady(tas=airspeed, airspeed_smoothed=airspeed, last_velocity_north=airspeed, tas_demand=airspeed)
    made = parameters(AIRSPEED_CRUISE=25.0, AIRSPEED_MAX=40.0)
    seen, at = record(MOTION, up=500.0, velocity_north=airspeed), state(airspeed=airspeed / AIRSPEED_READING)
    update_tecs(at, seen, made, own, 10.0, 1.0, DT)
    assert own.tas_demand == pytest.approx(airspeed - loss * DT, rel=1e-4)


def test_the_demanded_rate_of_the_kinetic_energy_drives_the_throttle() -> None:
    """`AP_TECS::_update_energies`: V times the demanded rate, less its mean over TECS_TIME_CONST."""
    own, made = steady(), parameters(AIRSPEED_CRUISE=25.0, AIRSPEED_MAX=40.0)
    update_tecs(reading(), flying(), made, own, 30.0, 1.0, DT)
    rate, per_throttle = 0.5 * 5.0 * GRAVITY / 25.0, (5.0 + 2.0) * GRAVITY
    demanded_rate = 25.0 * rate * (1.0 - DT / (DT + 5.0))
    ste_error = 0.5 * ((25.0 + rate * DT) ** 2 - 25.0**2)
    damped = 0.5 * demanded_rate * DT / (DT + 0.5)
    expected = 0.45 + (demanded_rate + (ste_error + damped) / 5.0) / per_throttle
    assert own.last_throttle_demand == pytest.approx(min(expected, 0.45 + 1.0 * DT))


def test_at_full_throttle_the_highest_airspeed_falls_to_the_cruise_airspeed() -> None:
    """`AP_TECS::_update_speed`: down with half of the rate of TECS_SINK_MIN, up with half of TECS_CLMB_MAX's."""
    own, made = steady(tas_demand=35.0), parameters(AIRSPEED_CRUISE=25.0, AIRSPEED_MAX=35.0)
    for count in (1, 2):
        own.is_throttle_saturated = True
        update_tecs(reading(), flying(), made, own, 35.0, 1.0, DT)
        assert own.tas_demand == pytest.approx(35.0 - count * 0.5 * 2.0 * GRAVITY / 25.0 * DT, rel=1e-4)
    own.tas_max_drop = 9.99
    own.is_throttle_saturated = True
    update_tecs(reading(), flying(), made, own, 35.0, 1.0, DT)
    assert own.tas_max_drop == 10.0
    own.is_throttle_saturated = False
    update_tecs(reading(), flying(), made, own, 35.0, 1.0, DT)
    assert own.tas_max_drop == pytest.approx(10.0 - 0.5 * 5.0 * GRAVITY / 25.0 * DT, rel=1e-2)


def test_without_reverse_thrust_a_negative_throttle_counts_as_none() -> None:
    """`Plane::apply_throttle_limits` gives TECS a minimum of 0: the gain is that of a range from 0 to THR_MAX."""
    found = []
    for least in (0.0, -100.0):
        own = steady(altitude_demand=498.0)
        weighed(own, reading(), flying(), THR_MIN=least)
        found.append((own.last_throttle_demand, own.ste_integrator, own.throttle_demand, own.saturation))
    assert found[0] == found[1]
    # 2 m high at idle: no thrust is left to take away.
    own = steady(altitude_demand=400.0)
    for _ in range(30):
        weighed(own, reading(), flying(), THR_MIN=-100.0)
    assert (own.throttle_demand, own.saturation) == (0.0, -1)


def test_a_descent_at_full_throttle_gives_up_the_airspeed() -> None:
    """`AP_TECS::_detect_bad_descent`: an STE error above 200 m^2/s^2, sinking, at 90 % of the throttle or more."""
    made = parameters(AIRSPEED_CRUISE=25.0, AIRSPEED_MAX=40.0)
    for climb, before, demand, begins in (
        (-3.0, 1.0, 33.0, True),  # 0.5 (33^2 - 25^2) = 232
        (-3.0, 1.0, 32.0, False),  # 199
        (3.0, 1.0, 33.0, False),
        (-3.0, 0.2, 33.0, False),
    ):
        own = steady(tas_demand=demand, last_throttle_demand=before)
        update_tecs(reading(), flying(climb=climb), made, own, demand, 1.0, DT)
        assert bool(own.bad_descent) == begins, (climb, before, demand)
    # While it lasts, the minimum airspeed is demanded; it ends with the energy error.
    own = steady(tas_demand=33.0, last_throttle_demand=1.0, bad_descent=True)
    update_tecs(reading(), flying(), made, own, 33.0, 1.0, DT)
    assert own.tas_demand < 33.0
    assert own.bad_descent
    own.tas_demand = 24.0
    update_tecs(reading(), flying(), made, own, 33.0, 1.0, DT)
    assert not own.bad_descent


def test_beyond_a_pitch_limit_the_integrators_fade() -> None:
    """`AP_TECS::_update_pitch`: each update leaves 1 - dt / (dt + TECS_TIME_CONST) of them."""
    # 50 m low: 5 m/s of climb and their damping demand 63.7 of the 64.2 m^2/s^3 that 15 degrees are.
    own = steady(altitude_demand=550.0, seb_integrator=10.0, ske_integrator=5.0)
    weighed(own, reading(), flying())
    kept = 1.0 - DT / (DT + 5.0)
    assert (own.seb_integrator, own.ske_integrator) == pytest.approx((10.0 * kept, 5.0 * kept))
    # Within the limits they grow: 1 m low is an error of g / 5.
    own = steady(altitude_demand=501.0, seb_integrator=10.0, ske_integrator=5.0)
    weighed(own, reading(), flying())
    assert (own.seb_integrator, own.ske_integrator) == pytest.approx((10.0 + 0.3 * GRAVITY / 5.0 * DT, 5.0))


# ----------------------------------------------------------------------
# ArduPlane's bank, by plain sums.


def test_bank_is_that_of_the_acceleration_within_the_limit() -> None:
    wide = parameters(ROLL_LIMIT_DEG=60.0, AIRSPEED_MIN=9.0)
    assert limited_nav_roll(5.0, 0.0, 25.0, wide) == pytest.approx(math.atan(5.0 / GRAVITY))
    # Pitched up, the lift's share across is less.
    assert limited_nav_roll(5.0, 0.3, 25.0, wide) == pytest.approx(math.atan(5.0 / (GRAVITY * math.cos(0.3))))
    limited = parameters(ROLL_LIMIT_DEG=30.0)
    for wanted, degrees in ((100.0, 30.0), (-100.0, -30.0)):
        assert math.degrees(limited_nav_roll(wanted, 0.0, 25.0, limited)) == pytest.approx(degrees)


def test_slow_flight_narrows_the_bank() -> None:
    # At 1.2 times the least airspeed 1 / 1.2^2 of the lift must stay upright: 46 degrees; at 1.1, 34.3; at 1.0, 25.
    limits = parameters(ROLL_LIMIT_DEG=60.0, AIRSPEED_MIN=20.0)
    for airspeed, degrees in ((24.0, math.degrees(math.acos(1 / 1.44))), (22.0, 34.2654), (20.0, 25.0)):
        assert math.degrees(limited_nav_roll(100.0, 0.0, airspeed, limits)) == pytest.approx(degrees, abs=1e-3)


@pytest.mark.parametrize(
    ("version", "airspeed", "values", "degrees"),
    [
        # 4.6 does not read AIRSPEED_STALL for the bank: 20 m/s are AIRSPEED_MIN.
        ("4.6", 20.0, {}, 25.0),
        # 20 m/s are 1.25 times 16 m/s: a load factor of 1.5625.
        ("4.7", 20.0, {}, math.degrees(math.acos(1 / 1.5625))),
        ("4.7", 16.0, {}, 25.0),
        ("4.7", 16.0, {"AIRSPEED_STALL": 0.0}, 25.0),
        # With bit 16 of FLIGHT_OPTIONS down to LEVEL_ROLL_LIMIT; at 16.5 m/s the load factor is 1.0635.
        ("4.7", 16.0, {"FLIGHT_OPTIONS": float(1 << 16)}, 5.0),
        ("4.7", 16.5, {"FLIGHT_OPTIONS": float(1 << 16)}, math.degrees(math.acos(1 / (16.5 / 16.0) ** 2))),
        ("4.7", 16.0, {"FLIGHT_OPTIONS": float(1 << 16), "AIRSPEED_STALL": 0.0}, 25.0),
        ("4.6", 16.0, {"FLIGHT_OPTIONS": float(1 << 16)}, 25.0),
    ],
)
def test_a_stall_speed_widens_the_bank_of_47(
    version: ArduPlaneVersion, airspeed: float, values: dict[str, float], degrees: float
) -> None:
    """`Plane::apply_load_factor_roll_limits`."""
    limits = {"ROLL_LIMIT_DEG": 60.0, "AIRSPEED_MIN": 20.0, "AIRSPEED_STALL": 16.0} | values
    made = parameters(version, **limits)
    assert math.degrees(limited_nav_roll(100.0, 0.0, airspeed, made)) == pytest.approx(degrees, abs=1e-3)


@pytest.mark.parametrize(
    ("values", "degrees", "expected"),
    [
        ({}, 60.0, 20.0 * math.sqrt(2.0)),
        # A stall speed counts by the load factor, where that is above AIRSPEED_MIN.
        ({"AIRSPEED_STALL": 16.0}, 60.0, 16.0 * math.sqrt(2.0)),
        ({"AIRSPEED_STALL": 16.0}, 40.0, 20.0),
        ({"AIRSPEED_STALL": 16.0, "STALL_PREVENTION": 0.0}, 60.0, 20.0),
        ({"STALL_PREVENTION": 0.0}, 60.0, 20.0),
    ],
)
def test_the_least_airspeed_grows_with_the_load_factor(
    values: dict[str, float], degrees: float, expected: float
) -> None:
    """`AP_TECS::_update_speed` of 4.6.3 and of 4.7."""
    for version in ("4.6", "4.7"):
        made = parameters(version, AIRSPEED_MIN=20.0, AIRSPEED_MAX=40.0, **values)
        assert min_airspeed(math.radians(degrees), made) == pytest.approx(expected)


# ----------------------------------------------------------------------
# How attitudes are followed, and what of the rudder is steered.


def even_gains() -> Record:
    """Gains of one, but for the angle of attack, which would come to its limits, and the damping of the pitch rate."""
    gains = record(GAINS)
    for name in field_names(GAINS):
        setattr(gains, name, 1.0)
    gains.alpha_per_g, gains.pitch_rate_gain = 0.01, 0.0
    gains.reference_airspeed, gains.roll_rate_max, gains.roll_acceleration_max = 25.0, 10.0, 1000.0
    return gains


def followed(own: Record, at: Record) -> tuple[Record, Record]:
    """Commands and memory after a tick of a sixtieth of a second, with ArduPlane's parameters."""
    kept, commands = record(GUIDANCE_MEMORY), record(COMMANDS)
    control_attitude(at, flying(), even_gains(), kept, parameters(KFF_RDDRMIX=0.3), own, 1.0, commands, 1.0 / 60.0)
    return commands, kept


def test_a_bank_is_late_as_in_logs_of_arduplane() -> None:
    """Its first-order lag, fitted to desired and flown roll of the kept logs: 0.42, 0.44 and 0.44 s.

    Those of ridge-5mps, demo and tight, with ArduPlane's RLL2SRV_TCONST of 0.5 s.  A share of an error of 0.1 rad is
    rolled off at once, in proportion to it.
    """
    own = memory(lateral_acceleration=GRAVITY * math.tan(0.1))
    _, kept = followed(own, state())
    assert own.roll_demand == pytest.approx(0.1)
    assert 0.1 / kept.bank_rate == pytest.approx(0.43, abs=0.015)


@pytest.mark.parametrize(("limit", "expected"), [(5.0, 5.0), (0.0, 13.6), (90.0, 13.6)])
def test_a_bank_changes_no_faster_than_rll2srv_rmax(limit: float, expected: float) -> None:
    """`AP_RollController::get_servo_out`: deg/s, 0 for no limit; 0.1 rad in 0.42 s are 13.6 deg/s."""
    kept, commands = record(GUIDANCE_MEMORY), record(COMMANDS)
    own = memory(lateral_acceleration=-GRAVITY * math.tan(0.1))
    made = parameters(KFF_RDDRMIX=0.3, RLL2SRV_RMAX=limit)
    control_attitude(state(), flying(), even_gains(), kept, made, own, 1.0, commands, 1.0 / 60.0)
    assert math.degrees(kept.bank_rate) == pytest.approx(-expected, rel=0.01)


def test_a_pitch_is_followed_a_tenth_later_than_its_time_constant_says() -> None:
    """0.055 rad of 0.55 s are 0.1 rad/s, and at 25 m/s 2.5 m/s^2 upwards, as a path that asks for them."""
    commands, _ = followed(memory(pitch_demand=0.055), state())
    kept, asked = record(GUIDANCE_MEMORY), record(COMMANDS)
    steer_elevator(state(), even_gains(), kept, asked, 0.0, 2.5)
    assert commands.elevator == pytest.approx(asked.elevator, abs=1e-6)


def test_the_rudder_has_its_share_of_the_ailerons_and_no_more() -> None:
    # Whatever sideslips: ArduPlane's yaw damper is off by default.
    commands, _ = followed(memory(lateral_acceleration=3.0), state(beta=0.05, yaw_rate=0.1))
    assert commands.aileron > 0.0
    # A roll to the right goes with a yaw to the right, which is negative.
    assert commands.rudder == pytest.approx(-0.3 * commands.aileron)


# ----------------------------------------------------------------------
# ArduPlane's law in flight: its airspeed with height, its bank's lag, its path, and what ArduPlane itself flew.

# What ArduPlane flew, written by `python -m benchmarks.against_arduplane --plans 3 --from 1001 --keep FILE`.
KEPT: list[dict[str, Any]] = json.loads(
    (Path(__file__).parents[3] / "authorities" / "arduplane_flights.json").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def usual(aerosonde: Aircraft) -> ArduPilotParameters:
    return ArduPilotParameters.load(aerosonde, None, "4.6")


@pytest.mark.parametrize(
    ("least", "ground", "before", "target"),
    [
        (0.0, 10.0, 0.0, 25.0),  # no minimum
        (18.0, 18.4, 0.0, 25.0),  # fast enough
        (18.0, 17.4, 0.0, 26.0),  # 0.6 m/s are missing: in whole m/s, 1
        (18.0, 17.6, 0.0, 25.0),
        (18.0, 14.6, 0.0, 28.0),
        (18.0, 15.6, 3.0, 28.0),  # 2 are missing: the rise of 3 falls by 1.2 or more, or not
        (18.0, 16.6, 3.0, 26.0),
        (18.0, 5.0, 0.0, 32.0),  # AIRSPEED_MAX
    ],
)
def test_the_airspeed_is_raised_for_a_minimum_ground_speed(
    least: float, ground: float, before: float, target: float
) -> None:
    """At 25 m/s through the air, northwards (`Plane::calc_airspeed_errors` of 4.6.3)."""
    own = memory(airspeed_smoothed=25.0, ground_speed_undershoot=before)
    here = record(MOTION, velocity_north=ground, velocity_east=9.0)
    way = waypoints((0, 0, 500), (0, 5000, 500), min_ground_speed=least)
    made = airspeed_target(state(), here, 25.0, way[1], parameters(AIRSPEED_MAX=32.0), own, 1.0)
    assert made == pytest.approx(target)


def test_what_the_ground_speed_lacks_is_an_equivalent_airspeed() -> None:
    # 27.5 m/s of true airspeed are 25 at 1.1: 4.4 m/s over the ground are 4 of equivalent airspeed.
    own, here = memory(airspeed_smoothed=27.5), record(MOTION, velocity_north=13.6)
    way = waypoints((0, 0, 500), (0, 5000, 500), min_ground_speed=18.0)
    assert airspeed_target(state(), here, 25.0, way[1], parameters(AIRSPEED_MAX=32.0), own, 1.1) == pytest.approx(29.0)


def test_it_holds_an_equivalent_airspeed(
    make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters
) -> None:
    setup = make_setup([[0, 0, 2000.0], [0, 3000, 2000.0]], speeds=24.0)
    track = fly_to_end(Flight(replace(setup, autopilot=ArduPlane(usual)), aerosonde)).track
    late = track.airspeed[track.time > 40.0]
    # Standard density at 2,000 m: 1.0066.
    assert float(late.mean()) == pytest.approx(24.0 * math.sqrt(1.2250 / 1.0066), rel=0.005)
    assert track.speed_command[-1] == pytest.approx(24.0 * math.sqrt(1.2250 / 1.0066), rel=0.001)


def test_it_flies_no_faster_than_airspeed_max(
    make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters
) -> None:
    setup = make_setup([[0, 0, 0.0], [0, 1500, 0.0]], speeds=25.0, terrain={"kind": "flat", "amsl_m": -500.0})
    slow = usual.changed(AIRSPEED_MAX=22.0)
    track = fly_to_end(Flight(replace(setup, autopilot=ArduPlane(slow)), aerosonde)).track
    assert float(track.speed_command[-1]) == pytest.approx(22.0, rel=1e-3)


def test_a_climbing_leg_is_flown_a_time_constant_low(
    make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters
) -> None:
    # 120 m in 3 km: 1 m/s of climb.
    setup = make_setup([[0, 0, 500.0], [0, 3000, 620.0]])
    for time in (1.0, 3.0):
        track = fly_to_end(
            Flight(replace(setup, autopilot=ArduPlane(usual.changed(TECS_HDEM_TCONST=time))), aerosonde)
        ).track
        late = (track.time > 50.0) & (track.time < 100.0)
        climb = float(track.velocity[late, 2].mean())
        assert float(track.height_error[late].mean()) == pytest.approx(-time * climb, abs=0.15)


def test_bank_follows_its_demand_late(make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters) -> None:
    setup = make_setup([[0, 0, 500.0], [0, 1000, 500.0], [1000, 1600, 500.0]])
    flight = Flight(replace(setup, autopilot=ArduPlane(usual)), aerosonde)
    demanded, flown = [], []
    for _ in range(60 * 70):
        rows, ended = flight.fly_block(1)
        if ended:
            break
        demanded.append(float(flight._workspace.law_record.memory.roll_demand))
        flown.append(float(rows["attitude"][-1][0]))
    lag = round(ROLL_LAG_RATIO * usual.roll_time * 60)

    # A ramp is followed by its lag, and most of a turn is one.
    def apart(ticks: int) -> float:
        return float(np.abs(np.array(demanded[: -ticks or None]) - np.array(flown[ticks:])).mean())

    best = min(range(60), key=apart)
    assert best == pytest.approx(lag, abs=0.12 * 60)
    assert math.degrees(max(flown)) < 31.0


def test_bank_keeps_roll_limit_deg(make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters) -> None:
    setup = make_setup([[0, 0, 500.0], [0, 1000, 500.0], [1000, 1000, 500.0]])
    for limit in (20.0, 35.0):
        track = fly_to_end(
            Flight(replace(setup, autopilot=ArduPlane(usual.changed(ROLL_LIMIT_DEG=limit))), aerosonde)
        ).track
        assert math.degrees(float(np.abs(track.attitude[:, 0]).max())) == pytest.approx(limit, abs=0.5)


def test_a_wider_radius_turns_earlier(make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters) -> None:
    setup = make_setup([[0, 0, 500.0], [0, 1000, 500.0], [1000, 1000, 500.0]])
    past = []
    for radius in (20.0, 60.0, 90.0):
        track = fly_to_end(
            Flight(replace(setup, autopilot=ArduPlane(usual.changed(WP_RADIUS=radius))), aerosonde)
        ).track
        past.append(float(track.position[:, 1].max()) - 1000.0)
    # Each metre of radius is a metre less overshot.
    assert past[0] - past[1] == pytest.approx(40.0, abs=6.0)
    assert past[1] - past[2] == pytest.approx(30.0, abs=6.0)


def test_the_same_setup_gives_the_same_flight(
    make_setup: MakeSetup, aerosonde: Aircraft, usual: ArduPilotParameters
) -> None:
    setup = replace(
        make_setup([[0, 0, 500.0], [0, 800, 520.0], [800, 1000, 500.0]], wind=(6.0, 200.0), turbulence="moderate"),
        autopilot=ArduPlane(usual),
        nav="gnss",
    )
    first, second = (fly_to_end(Flight(setup, aerosonde)) for _ in range(2))
    assert first.ended == "completed"
    assert np.array_equal(first.track.position, second.track.position)


@pytest.mark.parametrize("kept", KEPT, ids=[str(kept["seed"]) for kept in KEPT])
def test_it_flies_as_arduplane_flew(kept: dict[str, Any]) -> None:
    scenario = scenario_from_spec(kept["scenario"], "kept")
    uav = load_uav(scenario)
    setup = setup_of(scenario, uav, parse_mission(kept["mission"], "kept.waypoints"), kept["seed"])
    law = fly_to_end(Flight(setup, uav.aircraft))
    ours, real = flown_figures(setup, law.track, law.ended), kept["real"]
    assert ours.ended == real["ended"] == "completed"
    assert ours.clearance == pytest.approx(real["clearance"], abs=3.0)
    ratios = [mine.overshoot / its["overshoot"] for mine, its in zip(ours.corners, real["corners"], strict=True)]
    assert all(0.8 < ratio < 1.25 for ratio in ratios), ratios


@pytest.mark.client
@pytest.mark.skipif(not BINARY.exists(), reason="PLANFLY_ARDUPLANE names no ArduPlane")
@pytest.mark.skipif(not SOAK, reason="beside flights that are kept of it, above: in make soak")
def test_it_flies_as_arduplane_flies() -> None:
    compared, _ = compare(7001)
    assert compared.law.ended == compared.real.ended == "completed"
    assert compared.law.clearance == pytest.approx(compared.real.clearance, abs=3.0)
    assert compared.apart_across[0] < 2.0
    assert compared.apart_up[0] < 4.0
