"""ArduPlane's height demand and TECS by plain sums: steps and slopes, lag and rate limits, throttle and pitch."""

import math
from typing import Any

import pytest

from aircraft.envelope import GRAVITY
from flight.ardupilot.height_law import AIRSPEED_READING, demand_height, weigh_energies
from tests.flight.ardupilot.laws import flying, memory, parameters, state, waypoints
from world.kernels import Record

DT = 0.1


def demanded(own: Record, north: float, end: float, up: float = 500.0, **values: float) -> float:
    """Height that a leg of 1,000 m from 500 m asks for."""
    (b,) = waypoints((0, 1000, end))
    demand_height(flying(0.0, north, up), b, parameters(**values), own, DT)
    return float(own.height_asked)


@pytest.mark.parametrize(
    ("rise", "expected"), [(14.9, 514.9), (15.0, 507.5), (-14.9, 485.1), (-15.0, 492.5), (100.0, 550.0)]
)
def test_small_changes_of_height_are_steps_and_others_slopes(rise: float, expected: float) -> None:
    assert demanded(memory(), 500.0, 500.0 + rise, up=expected) == pytest.approx(expected)


def test_the_least_slope_is_glide_slope_min() -> None:
    assert demanded(memory(), 500.0, 520.0, GLIDE_SLOPE_MIN=21.0) == 520.0
    assert demanded(memory(), 500.0, 520.0, GLIDE_SLOPE_MIN=19.0) == pytest.approx(510.0)
    assert demanded(memory(), 500.0, 504.0, GLIDE_SLOPE_MIN=0.0) == pytest.approx(502.0)


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
        demand_height(flying(0.0, north, own.height_demand), b, parameters(TECS_HDEM_TCONST=time), own, DT)
        if north > 900.0:
            break
    climb = 2.5
    # The sampled lag is behind by its time constant x the rate, and up to a sample.
    assert own.height_asked - own.height_demand == pytest.approx(time * climb, abs=climb * DT)
    assert own.height_rate == pytest.approx(climb, rel=DT / time + 1e-6)


@pytest.mark.parametrize(("end", "rate"), [(900.0, 5.0), (100.0, -4.0)])
def test_no_more_is_asked_than_the_climb_and_sink_rates(end: float, rate: float) -> None:
    own, (b,) = memory(), waypoints((0, 1000, end))
    for _ in range(300):
        demand_height(flying(0.0, 1001.0), b, parameters(TECS_SINK_MAX=4.0), own, DT)
    assert own.height_limited == pytest.approx(500.0 + 30.0 * rate)
    assert own.height_rate == pytest.approx(rate, rel=0.04)


@pytest.mark.parametrize("held", [1, -1])
def test_what_cannot_be_followed_waits(held: int) -> None:
    end = 500.0 + held * 100.0
    own, (b,) = memory(), waypoints((0, 1000, end))
    for k in range(100):
        demand_height(flying(0.0, 25.0 * DT * k), b, parameters(), own, DT)
    asked, share = own.height_asked, own.climb_share if held > 0 else own.sink_share
    assert share == pytest.approx(1.0)
    own.held = held
    for k in range(100, 130):
        demand_height(flying(0.0, 25.0 * DT * k), b, parameters(), own, DT)
    assert own.height_asked == asked
    # After three seconds of a lag of three, 1 / e of the rate is left.
    assert (own.climb_share if held > 0 else own.sink_share) == pytest.approx((3.0 / 3.1) ** 30)
    own.held = -held
    demand_height(flying(0.0, 25.0 * 13.0), b, parameters(), own, DT)
    assert abs(own.height_asked - 500.0) == pytest.approx(2.5 * 13.0)


def weighed(own: Record, seen: Record, at: Record, **values: float) -> None:
    weigh_energies(seen, at, parameters(**values), own, 25.0, 1.0, DT)


def steady(**values: Any) -> Record:
    """Memory of steady flight: what the sensor reads is what is demanded."""
    return memory(**({"airspeed": 25.0, "airspeed_read": 25.0, "flown": True, "last_velocity_north": 25.0} | values))


def reading(**values: Any) -> Record:
    return state(**({"airspeed": 25.0 / AIRSPEED_READING} | values))


def test_in_steady_flight_nothing_changes() -> None:
    own = steady()
    weighed(own, reading(), flying())
    assert own.throttle_demand == pytest.approx(0.45)
    assert own.pitch_demand == pytest.approx(0.0)
    assert own.held == 0


def test_throttle_for_missing_height() -> None:
    # 2 m low: feed-forward, error and damping, divided by the energy rate that all of the throttle gives.
    own = steady(height_demand=502.0)
    weighed(own, reading(), flying())
    missing, per_throttle = 2.0 * GRAVITY, (5.0 + 2.0) * GRAVITY / 1.0
    damped = 0.5 * (missing / 5.0) * DT / (DT + 0.5)
    expected = 0.45 + (missing / 5.0 + (missing + damped) / 5.0) / per_throttle
    assert own.throttle_before == pytest.approx(min(expected, 0.45 + 1.0 * DT))
    assert own.throttle_sum == pytest.approx(0.3 * missing * DT / (5.0 * per_throttle))


def test_a_bank_takes_throttle() -> None:
    own = steady()
    weighed(own, reading(roll=math.radians(30.0)), flying())
    # TECS_RLL2THR x (1 / cos^2 - 1): a third of it at 30 degrees.
    assert own.throttle_demand == pytest.approx(0.45 + 10.0 / 3.0 / ((5.0 + 2.0) * GRAVITY))


def test_pitch_for_missing_height() -> None:
    own = steady(height_demand=501.0)
    weighed(own, reading(), flying())
    wanted = GRAVITY / 5.0
    total = wanted + 0.3 * wanted + 0.3 * wanted * DT
    expected = total / (25.0 * GRAVITY)
    assert own.pitch_demand == pytest.approx(min(expected, 7.0 / 25.0 * DT))


def test_pitch_moves_no_faster_than_the_vertical_acceleration_allows() -> None:
    own = steady(height_demand=520.0)
    weighed(own, reading(), flying(), TECS_VERT_ACC=4.0)
    assert own.pitch_demand == pytest.approx(4.0 / 25.0 * DT)


@pytest.mark.parametrize(("high", "degrees", "throttle"), [(50.0, 15.0, 1.0), (-50.0, -25.0, 0.1)])
def test_pitch_and_throttle_keep_their_limits(high: float, degrees: float, throttle: float) -> None:
    own = steady()
    for _ in range(200):
        own.height_demand = 500.0 + high
        weighed(own, reading(), flying(), THR_MIN=10.0, AIRSPEED_MAX=35.0)
    assert math.degrees(own.pitch_demand) == pytest.approx(degrees)
    assert own.throttle_demand == throttle
    assert own.held == (1 if high > 0.0 else -1)


def test_too_fast_it_pitches_up_and_throttles_back() -> None:
    own = steady(airspeed=26.0)
    weighed(own, reading(airspeed=26.0 / AIRSPEED_READING), flying())
    assert own.pitch_demand > 0.0
    assert own.throttle_demand < 0.45


def test_the_airspeed_demand_changes_within_what_the_energy_allows() -> None:
    own = steady()
    weigh_energies(reading(), flying(), parameters(AIRSPEED_MAX=40.0), own, 30.0, 1.0, DT)
    assert own.airspeed_demand == pytest.approx(25.0 + 0.5 * 5.0 * GRAVITY / 25.0 * DT)


def test_what_a_pull_up_turns_the_velocity_by_counts_as_acceleration_along_the_nose() -> None:
    """A nose 10 degrees up, and a climb that begins with 2 m/s^2: sin 10 of that is felt along the nose."""
    own = steady()
    weighed(own, reading(pitch=math.radians(10.0)), flying(climb=0.2))
    lost = 1.0 - DT / (DT + 5.0)
    assert own.acceleration == pytest.approx(2.0 * math.sin(math.radians(10.0)) * lost)
    # On the level it is not.
    own = steady()
    weighed(own, reading(), flying(climb=0.2))
    assert own.acceleration == pytest.approx(0.0)


def test_the_airspeed_is_a_smoothed_reading_of_before() -> None:
    """The sensor reads 1 m/s more from now on: 0.3 of what is missing at each turn, and none of it at the first."""
    own = steady()
    for k in range(1, 4):
        held = own.airspeed
        weighed(own, reading(airspeed=26.0 / AIRSPEED_READING), flying())
        assert own.airspeed_read == pytest.approx(26.0 - 0.7**k)
        if k == 1:
            assert own.airspeed == held


@pytest.mark.parametrize(("bank_deg", "prevents", "least"), [(30.0, 1.0, 19.34), (30.0, 0.0, 18.0), (0.0, 1.0, 18.0)])
def test_the_least_airspeed_grows_with_the_load_in_a_bank(bank_deg: float, prevents: float, least: float) -> None:
    """18 m/s over the root of cos 30: as ArduPlane's log of a turn shows it, at once (19.32 m/s; TECS.spdem)."""
    own = steady(airspeed_demand=18.0, side_acceleration=GRAVITY * math.tan(math.radians(bank_deg)))
    values = parameters(AIRSPEED_MIN=18.0, AIRSPEED_MAX=31.0, STALL_PREVENTION=prevents)
    weigh_energies(reading(), flying(), values, own, 18.0, 1.0, DT)
    assert own.airspeed_demand == pytest.approx(least, abs=0.005)
