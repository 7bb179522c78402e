"""The rail in the air: what the sensors of an aircraft that is held, and then pushed, would measure."""

import math

import pytest

from flight.real_autopilot.start_rail import PUSH, RailEnd, motion_on_rail

GRAVITY = 9.80665
LAT, LON = math.radians(46.0), math.radians(8.0)
# East at 20 m/s over the ground, in 5 m/s of head wind from the east, nose up by 3 degrees.
END = RailEnd(LAT, LON, 500.0, 0.0, math.radians(3.0), math.pi / 2.0, math.pi / 2.0, 20.0, 0.0, -5.0)
ORIGIN = (LAT, LON, 400.0)


def test_at_rest_it_measures_the_force_that_holds_it() -> None:
    motion = motion_on_rail(END, 7.0, 0.0, ORIGIN)
    assert motion.time == 7.0
    assert (motion.roll_rate, motion.pitch_rate, motion.yaw_rate) == (0.0, 0.0, 0.0)
    # Up: backwards is the nose's part of it.
    assert (motion.force_x, motion.force_y, motion.force_z) == pytest.approx(
        (GRAVITY * math.sin(math.radians(3.0)), 0.0, -GRAVITY * math.cos(math.radians(3.0)))
    )
    assert (motion.velocity_north, motion.velocity_east, motion.velocity_down) == (0.0, 0.0, 0.0)
    # The wind alone.
    assert motion.airspeed == 5.0
    # Behind its end by v^2 / 2 a, and 100 m above the origin.
    assert (motion.north, motion.east, motion.down) == pytest.approx((0.0, -40.0, -100.0), abs=0.2)


def test_a_banked_hold_shares_the_force_between_the_axes() -> None:
    rolled = RailEnd(LAT, LON, 500.0, math.radians(30.0), 0.0, 1.0, 1.0, 20.0, 0.0, 0.0)
    motion = motion_on_rail(rolled, 0.0, 0.0, ORIGIN)
    # The right wing is down: what holds it up points to its left side.
    assert (motion.force_x, motion.force_y, motion.force_z) == pytest.approx(
        (0.0, -0.5 * GRAVITY, -GRAVITY * math.cos(math.radians(30.0))), abs=1e-9
    )


def test_a_push_is_felt_seen_and_adds_up() -> None:
    assert END.push_time == 20.0 / PUSH
    half = motion_on_rail(END, 0.0, 2.0, ORIGIN)
    assert half.velocity_east == pytest.approx(10.0)
    assert half.airspeed == pytest.approx(15.0)
    # PUSH along the nose, but for its rise.
    rise = math.radians(3.0)
    assert half.force_x == pytest.approx(PUSH * math.cos(rise) + GRAVITY * math.sin(rise))
    # 0.5 a t^2 from the beginning.
    begin = motion_on_rail(END, 0.0, 0.0, ORIGIN)
    assert half.east - begin.east == pytest.approx(0.5 * PUSH * 4.0, rel=2e-3)


def test_at_its_end_it_is_the_trimmed_flight_and_no_push() -> None:
    for late in (0.0, 3.0):
        motion = motion_on_rail(END, 0.0, END.push_time + late, ORIGIN)
        assert (motion.north, motion.east, motion.velocity_east) == pytest.approx((0.0, 0.0, 20.0), abs=1e-6)
        assert motion.airspeed == pytest.approx(25.0)
        assert motion.force_x == pytest.approx(GRAVITY * math.sin(math.radians(3.0)))
