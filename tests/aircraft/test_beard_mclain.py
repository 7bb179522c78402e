"""The book's equations against the numbers that the book prints, and against plain sums."""

import math

import numpy as np
import pytest

from tests.aircraft import beard_mclain as reference

CLEAN = reference.BookAtmosphere(parasite_drag=0.0)


def test_lift_breaks_at_the_stall() -> None:
    assert reference.lift(0.2) == pytest.approx(0.23 + 5.61 * 0.2, rel=1e-5)
    assert reference.lift(0.7) == pytest.approx(2.0 * math.sin(0.7) ** 2 * math.cos(0.7), rel=1e-4)
    assert reference.lift(0.7) < 0.5 * reference.lift(0.42)


@pytest.mark.parametrize("throttle", [0.0, 0.3, 0.55])
def test_without_braking_a_closed_throttle_draws_nothing(throttle: float) -> None:
    coasting = reference.propulsion(25.0, throttle, reference.BookAtmosphere())
    braking = reference.propulsion(25.0, throttle, reference.BookAtmosphere(motor_braking=True))
    assert coasting[2] == 0.0
    assert coasting[1] == pytest.approx(-reference.KQ * reference.NO_LOAD_CURRENT)
    assert braking[2] < 0.0
    assert braking[0] < coasting[0] < 0.0


def test_braking_makes_no_difference_while_current_flows() -> None:
    assert reference.propulsion(25.0, 0.8, reference.BookAtmosphere()) == reference.propulsion(
        25.0, 0.8, reference.BookAtmosphere(motor_braking=True)
    )


def test_reference_says_when_it_finds_no_trim() -> None:
    with pytest.raises(ValueError, match="no trim at"):
        reference.book_trim(25.0, 0.0, reference.BookAtmosphere(density=0.1))


def test_published_trim_without_parasite_drag() -> None:
    # Beard and McLain's trim at 25 m/s, which holds for CDp = 0 only.
    _, commands = reference.book_trim(25.0, 0.0, CLEAN)
    assert commands[[0, 1, 3]] == pytest.approx([-0.125112, 0.001837, 0.676780], rel=1e-3)
    assert commands[2] == pytest.approx(-0.000303, abs=1.2e-5)


def test_published_transfer_function_constants() -> None:
    # a_phi1, a_phi2, a_theta1, a_theta3 (chapter 5).
    a, b = reference.book_linearise(
        *reference.book_trim(25.0, 0.0, reference.BookAtmosphere()), reference.BookAtmosphere()
    )
    assert [-a[3, 3], b[3, 1], -a[4, 4], b[4, 0]] == pytest.approx([22.62885, 130.88368, 5.29474, -36.11239], rel=5e-6)


@pytest.mark.parametrize("climb", [-0.05, 0.0, 0.05])
def test_a_trim_stays_as_it_is_and_climbs_as_asked(climb: float) -> None:
    air = reference.BookAtmosphere()
    states, commands = reference.book_trim(24.0, climb, air)
    u, v, w, p, q, r, roll, pitch = states
    assert np.abs(reference.rates(states, commands, air)).max() < 1e-7
    assert (v, p, q, r) == (0.0, 0.0, 0.0, 0.0)
    assert math.hypot(u, w) == pytest.approx(24.0)
    # Body axes to the vertical: eq. 3.1's height rate.
    assert u * math.sin(pitch) - w * math.cos(roll) * math.cos(pitch) == pytest.approx(24.0 * math.sin(climb))


def test_the_nose_down_and_the_bank_are_pulled_by_the_weight() -> None:
    # The air's forces do not know the attitude: two attitudes differ by the weight in body axes alone.
    air, commands = reference.BookAtmosphere(), np.array([-0.1, 0.0, 0.0, 0.5])
    level = np.array([25.0, 0.0, 1.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    banked = np.array([*level[:6], 0.5, 0.3])
    change = (reference.rates(banked, commands, air) - reference.rates(level, commands, air))[:6]
    weight = 9.81 * np.array([-math.sin(0.3), math.cos(0.3) * math.sin(0.5), math.cos(0.3) * math.cos(0.5) - 1.0])
    assert change == pytest.approx([*weight, 0.0, 0.0, 0.0])


def test_mirrored_flight_has_mirrored_air_forces() -> None:
    # Without the propeller's torque left and right are alike.
    air = reference.BookAtmosphere()
    states, commands = np.array([24.0, 3.0, 2.0, 0.4, 0.1, -0.3, 0.2, 0.1]), np.array([-0.1, 0.2, -0.1, 0.6])
    side = np.array([1, -1, 1, -1, 1, -1, -1, 1])
    one = reference.rates(states, commands, air)
    other = side * reference.rates(side * states, commands * [1, -1, -1, 1], air)
    same = [0, 1, 2, 4, 6, 7]
    assert one[same] == pytest.approx(other[same], abs=1e-12)
    # The torque acts the same way in both, about the x axis of an inertia that couples x and z.
    torque = reference.propulsion(math.sqrt(24.0**2 + 3.0**2 + 2.0**2), 0.6, air)[1]
    gamma = reference.JX * reference.JZ - reference.JXZ**2
    assert (one - other)[3] == pytest.approx(-2.0 * torque * reference.JZ / gamma)
    assert (one - other)[5] == pytest.approx(-2.0 * torque * reference.JXZ / gamma)
