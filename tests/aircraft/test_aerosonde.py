"""The JSBSim model against the book's equations in plain Python, and against the book's published numbers."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.catalog import load_aircraft
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import Trim, attitude, full_throttle_climb, idle_descent, linearise, steady_flight
from tests.aircraft import beard_mclain as reference
from world.arrays import Floats
from world.kernels import Record

CLEAN = Variation(parasite_drag=0.0)


def _flat(variation: Variation | None = None, *, motor_braking: bool = False) -> Fdm:
    return Fdm(load_aircraft("aerosonde"), flat_earth=True, variation=variation, motor_braking=motor_braking)


def _trim(fdm: Fdm, airspeed: float, climb: float = 0.0) -> Trim:
    found = steady_flight(fdm, airspeed, 100.0, climb)
    assert found is not None
    return found


def _modes(a: Floats) -> NDArray[np.complex128]:
    return np.sort_complex(np.linalg.eigvals(a))


def _near(modes: NDArray[np.complex128], value: complex) -> complex:
    return complex(modes[np.argmin(np.abs(modes - value))])


@pytest.mark.parametrize("airspeed", [19.0, 25.0, 31.0])
@pytest.mark.parametrize("climb_deg", [-4.0, 0.0, 3.0])
def test_trim_is_the_reference_trim(airspeed: float, climb_deg: float) -> None:
    climb = math.radians(climb_deg)
    states, commands = reference.book_trim(airspeed, climb, reference.BookAtmosphere())
    if not 0.0 < commands[3] < 1.0:
        assert steady_flight(_flat(), airspeed, 100.0, climb) is None
        return
    found = _trim(_flat(), airspeed, climb)
    np.testing.assert_allclose(found.commands(), commands, rtol=2e-5)
    assert found.alpha == pytest.approx(math.atan2(states[2], states[0]), rel=2e-5)
    np.testing.assert_allclose(attitude(found), states[6:], rtol=2e-5)


def test_published_trim_without_parasite_drag() -> None:
    # Beard and McLain's trim at 25 m/s.  It holds for CDp = 0 only, a lift-to-drag ratio of 80.
    found = _trim(_flat(CLEAN), 25.0)
    published = {"elevator": -0.125112, "aileron": 0.001837, "throttle": 0.676780}
    for name, value in published.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-3)
    # Published with six decimals, of which the rudder uses three.
    assert found.rudder == pytest.approx(-0.000303, abs=1.2e-5)
    # With the parasite drag that the model flies with, the throttle is another.
    assert abs(_trim(_flat(), 25.0).throttle - published["throttle"]) > 0.05


@pytest.mark.parametrize("variation", [None, CLEAN])
def test_modes_are_the_reference_modes(variation: Variation | None) -> None:
    world = reference.BookAtmosphere(parasite_drag=0.043 if variation is None else 0.0)
    fdm = _flat(variation)
    a, b = linearise(fdm, _trim(fdm, 25.0))
    expected_a, expected_b = reference.book_linearise(*reference.book_trim(25.0, 0.0, world), world)
    expected = _modes(expected_a)
    assert np.abs((_modes(a) - expected) / expected).max() < 1e-5
    np.testing.assert_allclose(a, expected_a, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(b, expected_b, rtol=1e-4, atol=1e-4)


def test_modes_of_the_flying_model() -> None:
    fdm = _flat()
    modes = _modes(linearise(fdm, _trim(fdm, 25.0))[0])
    for value in (-4.895 + 9.870j, -0.1426 + 0.4780j, -1.140 + 4.655j, -22.44, 0.0892):
        assert abs(_near(modes, value) - value) < 1e-3 * abs(value)


def test_published_transfer_function_constants() -> None:
    # a_phi1, a_phi2, a_theta1, a_theta3 (chapter 5).  The first two depend on the sign of Jxz by 2 %.
    fdm = _flat()
    a, b = linearise(fdm, _trim(fdm, 25.0))
    assert [-a[3, 3], b[3, 1], -a[4, 4], b[4, 0]] == pytest.approx([22.62885, 130.88368, 5.29474, -36.11239], rel=5e-6)


@pytest.mark.parametrize("motor_braking", [False, True])
@pytest.mark.parametrize(("spread", "tolerance"), [(0.18, 2e-5), (1.3, 1e-2)])
def test_rates_in_any_flight_are_the_reference_rates(motor_braking: bool, spread: float, tolerance: float) -> None:
    # Off trim, sideslipping, turning, windmilling; with the wider spread, beyond the stall, where JSBSim reads the
    # lift from a table.
    fdm, world = _flat(motor_braking=motor_braking), reference.BookAtmosphere(motor_braking=motor_braking)
    fdm.move_to(100.0)
    rng = np.random.default_rng(3)
    for _ in range(60):
        alpha, beta, airspeed = rng.uniform(-spread, spread), rng.uniform(-0.3, 0.3), rng.uniform(12.0, 40.0)
        direction = [math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)]
        states = np.array([*(airspeed * x for x in direction), *rng.uniform(-0.8, 0.8, 3), *rng.uniform(-1.0, 1.0, 2)])
        commands = np.array([*rng.uniform(-0.5, 0.5, 3), rng.uniform(0.0, 1.0)])
        got, expected = fdm.derivatives(states, commands), reference.rates(states, commands, world)
        scale = np.array([10.0] * 3 + [10.0] * 3 + [1.0] * 2)
        np.testing.assert_allclose(got / scale, expected / scale, atol=tolerance, rtol=tolerance)


def _body(state: Record) -> Floats:
    alpha, beta, airspeed = state.alpha, state.beta, state.airspeed
    u, v, w = math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)
    rates = (state.roll_rate, state.pitch_rate, state.yaw_rate)
    return np.array([airspeed * u, airspeed * v, airspeed * w, *rates, state.roll, state.pitch])


def _departure(rate_hz: int) -> Floats:
    """Worst difference, over 3 s of kicks on every control, between JSBSim and the reference integrated by Runge-Kutta.

    Both fly the surfaces and the motor as JSBSim's actuators move them.
    """
    fdm, world = Fdm(load_aircraft("aerosonde"), flat_earth=True, rate_hz=rate_hz), reference.BookAtmosphere()
    trimmed = np.array(fdm.start(0.0, 0.0, 500.0, 0.0, 25.0).commands())
    state = fdm.read()
    states, worst = _body(state), np.zeros(8)
    for k in range(3 * rate_hz):
        commands = trimmed.copy()
        sign = 1.0 if k < rate_hz / 2 else -1.0 if k < rate_hz else 0.0
        commands += [-0.08 * sign, 0.1 * sign, 0.05, 0.2]
        fdm.write(commands)
        flown = np.array([state.elevator, state.aileron, state.rudder, state.throttle])
        k1 = reference.rates(states, flown, world)
        k2 = reference.rates(states + 0.5 * fdm.dt * k1, flown, world)
        k3 = reference.rates(states + 0.5 * fdm.dt * k2, flown, world)
        k4 = reference.rates(states + fdm.dt * k3, flown, world)
        states = states + fdm.dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        fdm.step()
        state = fdm.read()
        worst = np.maximum(worst, np.abs(_body(state) - states))
    return worst


def test_a_kicked_flight_is_the_reference_flight() -> None:
    # At 120 Hz JSBSim's own integration is a few thousandths off, and that error falls with the step: nothing else is.
    coarse, fine = _departure(120), _departure(480)
    assert coarse[:3].max() < 0.1  # m/s
    assert coarse[3:6].max() < 0.06  # rad/s
    assert coarse[6:].max() < 0.005  # rad
    np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.1)


@pytest.mark.parametrize("motor_braking", [False, True])
def test_limits_of_the_envelope_balance_in_the_reference(motor_braking: bool) -> None:
    # On the turning WGS84 earth in the standard atmosphere: 1.16727 kg/m^3 at 500 m (ISO 2533).
    fdm = Fdm(load_aircraft("aerosonde"), motor_braking=motor_braking)
    world = reference.BookAtmosphere(density=1.16727, gravity=9.8046, motor_braking=motor_braking)
    for found in (full_throttle_climb(fdm, 25.0, 500.0), idle_descent(fdm, 25.0, 500.0)):
        assert found is not None
        roll, pitch = attitude(found)
        states = np.zeros(8)
        states[[0, 2, 6, 7]] = 25.0 * math.cos(found.alpha), 25.0 * math.sin(found.alpha), roll, pitch
        assert np.abs(reference.rates(states, found.commands(), world)).max() < 6e-3
