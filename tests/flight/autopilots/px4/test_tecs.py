"""PX4's TECS by plain sums: the reference height, what pitch and throttle are asked for, and their limits."""

import math
from typing import Any

import pytest

from flight.autopilots.px4.tecs import detect_underspeed, update_airspeed_filter, update_altitude_reference, update_tecs
from tests.flight.autopilots.px4.laws import flying, memory, parameters, state
from world.kernels import Record

DT, G = 0.05, 9.80665


def led(asked: float, seconds: float, **values: float) -> Record:
    own = memory(altitude_setpoint=asked)
    made = parameters(**values)
    for _ in range(round(seconds / DT)):
        update_altitude_reference(made, own, DT)
    return own


@pytest.mark.parametrize(
    ("asked", "values", "rate"),
    [
        (900.0, {}, 3.0),
        (100.0, {}, -2.0),
        (900.0, {"FW_T_CLMB_R_SP": 5.0, "FW_T_CLMB_MAX": 4.0}, 4.0),
        (100.0, {"FW_T_SINK_R_SP": 6.0}, -5.0),
    ],
)
def test_the_reference_climbs_and_sinks_no_faster(asked: float, values: dict[str, float], rate: float) -> None:
    own = led(asked, 5.0, **values)
    assert own.altitude_rate_reference == pytest.approx(rate)
    # It takes |rate| / 7 s to be as fast.
    assert own.altitude_reference == pytest.approx(500.0 + rate * (5.0 - 0.5 * abs(rate) / 7.0), abs=0.2)


def test_the_reference_stops_at_the_height_without_going_past() -> None:
    own, made, highest = memory(altitude_setpoint=530.0), parameters(), 0.0
    for _ in range(300):
        update_altitude_reference(made, own, DT)
        highest = max(highest, own.altitude_reference)
    assert own.altitude_reference == pytest.approx(530.0, abs=0.01)
    assert highest < 530.1


def test_airspeed_follows_its_sensor_and_its_rate_is_held_to_nothing() -> None:
    own, made = memory(), parameters()
    for _ in range(300):
        update_airspeed_filter(26.0, made, own, DT)
    assert (own.tas, own.tas_rate) == pytest.approx((26.0, 0.0), abs=1e-6)


def demanded(own: Record, up: float = 500.0, climb: float = 0.0, speed: float = 25.0, **values: float) -> Record:
    usual = {"FW_AIRSPD_MIN": 18.0, "FW_AIRSPD_TRIM": 25.0, "FW_AIRSPD_MAX": 31.0}
    made = parameters(**(usual | values))
    update_tecs(state(airspeed=speed), flying(up=up, climb=climb), made, own, 25.0, 1.0, DT)
    return own


def test_level_at_its_speed_it_holds_trim() -> None:
    own = demanded(memory())
    assert (own.pitch_setpoint, own.throttle_setpoint) == pytest.approx((0.0, 0.6))


def test_pitch_leads_a_climb_by_its_angle() -> None:
    # 10 m below: 2 m/s are asked for, 2 / 25 rad, and 0.1 of what is missing of it.
    own = demanded(memory(altitude_reference=510.0, altitude_setpoint=510.0), FW_T_VERT_ACC=10.0, FW_T_I_GAIN_PIT=0.0)
    for _ in range(20):
        demanded(own, FW_T_VERT_ACC=10.0, FW_T_I_GAIN_PIT=0.0)
    assert own.pitch_setpoint == pytest.approx(1.1 * 2.0 / 25.0, rel=1e-3)
    # Its feed-forward: 0.3 of the reference's own rate.
    own = memory(altitude_reference=500.0, altitude_setpoint=900.0, altitude_rate_reference=3.0)
    demanded(own, up=500.06, FW_T_I_GAIN_PIT=0.0, FW_T_PTCH_DAMP=0.0)
    step = 7.0 / 25.0 * DT
    assert own.pitch_setpoint == pytest.approx(min(step, 0.9 / 25.0))


@pytest.mark.parametrize(("off", "rate"), [(1000.0, 5.0), (-1000.0, -5.0)])
def test_no_climb_beyond_the_limits_is_asked_for(off: float, rate: float) -> None:
    own = memory(altitude_reference=500.0 + off, altitude_setpoint=500.0 + off)
    for _ in range(40):
        demanded(own, FW_T_I_GAIN_PIT=0.0, FW_T_PTCH_DAMP=0.0)
    assert own.pitch_setpoint == pytest.approx(rate / 25.0, rel=1e-3)


@pytest.mark.parametrize(
    ("demand", "throttle"), [(60.0, 0.6 + 0.4 * 0.5 * 31.0 / 25.0), (10.0, 0.6 - 0.6 * 0.5 * 18.0 / 25.0)]
)
def test_a_change_of_speed_takes_half_of_the_energy_there_is(demand: float, throttle: float) -> None:
    """`_calcSpecificEnergyRates`: the demanded speed, 31 or 18 m/s, times half of the energy rates over 25 m/s.

    It is a share of the way from trim, 0.6, to full throttle or to idle, whatever the energy rates are.
    """
    own = memory(tas_setpoint=demand)
    demanded(own, FW_T_THR_DAMPING=0.0, FW_T_THR_INTEG=0.0, FW_THR_MIN=0.0, FW_THR_MAX=1.0)
    assert own.throttle_setpoint == pytest.approx(throttle)


@pytest.mark.parametrize(("weight", "of_height", "of_speed"), [(0.0, 2.0, 0.0), (1.0, 1.0, 1.0), (2.0, 0.0, 2.0)])
def test_the_weights_of_height_and_speed_are_two_together(weight: float, of_height: float, of_speed: float) -> None:
    """`_updateSpeedAltitudeWeights` of 1.16 and later.

    5 m low: 1 m/s is asked for; 1.25 m/s fast: 0.25 m/s^2 less.  Their angles: g x 1 and 23.75 x 0.25 by 25 g.
    """
    own = memory(altitude_reference=505.0, altitude_setpoint=505.0, tas_setpoint=23.75)
    for _ in range(40):
        update_tecs(
            state(airspeed=25.0),
            flying(),
            parameters(
                FW_AIRSPD_MIN=18.0,
                FW_AIRSPD_TRIM=25.0,
                FW_AIRSPD_MAX=31.0,
                FW_T_SPDWEIGHT=weight,
                FW_T_PTCH_DAMP=0.0,
                FW_T_I_GAIN_PIT=0.0,
            ),
            own,
            23.75,
            1.0,
            DT,
        )
    assert own.pitch_setpoint == pytest.approx((of_height * G * 1.0 + of_speed * 23.75 * 0.25) / (25.0 * G), rel=1e-3)


def test_the_throttles_rate_is_a_share_of_its_range() -> None:
    own = memory(altitude_reference=1500.0, altitude_setpoint=1500.0, throttle_setpoint=0.6)
    # 20 % of the 0.5 from 0.3 to 0.8, each second.
    for _ in range(10):
        demanded(own, FW_THR_SLEW_MAX=0.2, FW_THR_MIN=0.3, FW_THR_MAX=0.8)
    assert own.throttle_setpoint == pytest.approx(0.6 + 0.2 * 0.5 * 10 * DT)


def test_pitch_keeps_to_its_limits_less_the_trim() -> None:
    own = memory(altitude_reference=1500.0, altitude_setpoint=1500.0)
    for _ in range(150):
        demanded(own, climb=-3.0, FW_P_LIM_MAX=15.0, FW_PSP_OFF=3.0)
    assert own.pitch_setpoint == pytest.approx(math.radians(12.0))
    before = own.pitch_integrator
    demanded(own, climb=-3.0, FW_P_LIM_MAX=15.0, FW_PSP_OFF=3.0)
    assert own.pitch_integrator == before


@pytest.mark.parametrize(
    ("climb", "values", "expected"),
    [
        (2.5, {}, 0.6 + 0.5 * 0.4),
        (5.0, {}, 1.0),
        (-1.0, {"FW_THR_MIN": 0.2}, 0.6 - 0.5 * 0.4),
        (-2.0, {"FW_THR_MIN": 0.2}, 0.2),
    ],
)
def test_throttle_goes_with_the_climb_between_trim_and_its_ends(
    climb: float, values: dict[str, float], expected: float
) -> None:
    # In the climb that is asked for: nothing is missing of the energy's rate.
    own = memory(altitude_reference=500.0 + 5.0 * climb, altitude_setpoint=500.0 + 5.0 * climb, ste_rate=G * climb)
    demanded(own, climb=climb, **values)
    assert own.throttle_setpoint == pytest.approx(expected, abs=1e-3)


def test_thin_air_takes_more_throttle_and_a_bank_more_energy() -> None:
    own = memory()
    usual: dict[str, Any] = {"FW_AIRSPD_MIN": 18.0, "FW_AIRSPD_TRIM": 25.0, "FW_AIRSPD_MAX": 31.0}
    update_tecs(state(), flying(), parameters(**usual), own, 25.0 / 1.1, 1.1, DT)
    assert own.throttle_setpoint == pytest.approx(0.66, abs=2e-3)
    banked = memory()
    update_tecs(state(roll=math.radians(60.0)), flying(), parameters(**usual), banked, 25.0, 1.0, DT)
    # 15 (1 / cos 60 - 1) m^2/s^3 of 5 g that full throttle gives.
    assert banked.throttle_setpoint == pytest.approx(0.6 + 0.4 * 15.0 / (5.0 * G) + 0.05 * 15.0 / (7.0 * G), abs=1e-3)


def test_a_speed_is_taken_up_by_one_metre_a_second_squared_within_its_limits() -> None:
    own = memory()
    demanded(own, FW_AIRSPD_MAX=24.5)
    assert own.tas_setpoint == pytest.approx(24.5)
    # A minimum that a bank raises, and the maximum, apply at once (`adapt_airspeed_setpoint`).
    own = memory(roll_setpoint=math.radians(60.0))
    demanded(own, FW_AIRSPD_MIN=20.0)
    assert own.tas_setpoint == pytest.approx(20.0 * math.sqrt(2.0))
    own = memory(tas_setpoint=40.0)
    demanded(own)
    assert own.tas_setpoint == pytest.approx(31.0)
    own = memory(tas_setpoint=20.0)
    for _ in range(20):
        demanded(own)
    assert own.tas_setpoint == pytest.approx(21.0)


@pytest.mark.parametrize(("speed", "expected"), [(18.0, 0.0), (14.25, 0.0), (12.375, 0.5), (10.5, 1.0), (5.0, 1.0)])
def test_speed_comes_first_below_the_least(speed: float, expected: float) -> None:
    # 18 m/s less 15 % of 25 m/s, and as much less again.
    made = parameters(FW_AIRSPD_MIN=18.0, FW_AIRSPD_TRIM=25.0, FW_AIRSPD_MAX=31.0)
    assert detect_underspeed(speed, made) == pytest.approx(expected)


@pytest.mark.parametrize(("eas_to_tas", "throttle"), [(1.0, 0.6 * (1.0 - 1.0 / 2.0)), (1.1, 0.66 * (1.0 - 1.0 / 2.2))])
def test_in_thin_air_the_least_sink_is_faster(eas_to_tas: float, throttle: float) -> None:
    """`getMinimumSinkRate`: FW_T_SINK_MIN, 2 m/s, by the root of the density; 1 m/s of sink is a share of it."""
    own = memory(altitude_reference=495.0, altitude_setpoint=495.0, ste_rate=-G)
    made = parameters(FW_AIRSPD_MIN=18.0, FW_AIRSPD_TRIM=25.0, FW_AIRSPD_MAX=31.0, FW_THR_MIN=0.0)
    update_tecs(state(), flying(climb=-1.0), made, own, 25.0 / eas_to_tas, eas_to_tas, DT)
    assert own.throttle_setpoint == pytest.approx(throttle, abs=1e-3)


@pytest.mark.parametrize(("speed", "share"), [(18.0, 1.0), (12.375, 0.5), (10.5, 0.0)])
def test_the_throttles_integrator_pauses_below_the_least_speed(speed: float, share: float) -> None:
    """`_calcThrottleControlUpdate`: 1 less the underspeed ratio; 0.02 of the missing energy rate over (5 + 2) g."""
    own = memory(tas=speed, tas_setpoint=speed, altitude_reference=502.5, altitude_setpoint=502.5)
    demanded(own, speed=speed, FW_T_TAS_TC=1e9)
    missing = 0.5 * G
    assert own.throttle_integrator == pytest.approx(share * 0.02 * missing / (7.0 * G) * DT, rel=1e-3, abs=1e-12)


def test_the_pitchs_integrator_is_an_angle_at_any_speed() -> None:
    """`_calcPitchControlOutput` adds it to the angle: it does not grow where the aircraft is slower."""
    for speed in (20.0, 25.0, 30.0):
        own = memory(tas=speed, tas_setpoint=speed, pitch_integrator=0.04, pitch_setpoint=0.04)
        update_tecs(
            state(airspeed=speed),
            flying(),
            parameters(FW_AIRSPD_MIN=18.0, FW_AIRSPD_TRIM=25.0, FW_AIRSPD_MAX=31.0),
            own,
            speed,
            1.0,
            DT,
        )
        assert own.pitch_setpoint == pytest.approx(0.04, abs=1e-9)
