"""An engine settles while everything else stands still, and then everything moves as before."""

import contextlib
import io
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight.dynamics.trim import (
    QUANTITIES,
    Engine,
    Trim,
    air_velocity,
    attitude,
    body_axes,
    euler,
    first_guess,
    full_throttle_climb,
    idle_descent,
    linearise,
    slowest_level_flight,
    solve_trim,
    steady_flight,
    trim_from_vector,
)
from tests.kernels.processors import NUMPY_ON_BASELINE_CPU
from tests.soak import SOAK
from world.arrays import Floats
from world.errors import FlightError

INTEGRATORS = tuple(
    f"simulation/integrator/{kind}"
    for kind in ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
)
RATE = "accelerations/udot-ft_sec2"
DT = 1.0 / 120.0


class FakeJsbsim:
    """An engine whose push halves its distance to its final value at each step that takes time."""

    def __init__(self) -> None:
        self.values = {name: 3.0 + k for k, name in enumerate(INTEGRATORS)}
        self.push, self.calls, self.steps = 64.0, list[str](), list[float]()
        self.dt = DT
        self.engine = Engine(self, DT, self.getter, self.setter)

    def getter(self, name: str) -> Callable[[], float]:
        return lambda: self.push if name == RATE else self.values.get(name, 0.0)

    def setter(self, name: str) -> Callable[[float], None]:
        def put(value: float) -> None:
            self.values[name] = value
            self.calls.append(name)

        return put

    def run_ic(self) -> None:
        self.calls.append("run_ic")

    def set_dt(self, dt: float) -> None:
        self.dt = dt

    def run(self) -> None:
        self.steps.append(self.dt)
        if self.dt > 0.0:
            self.push *= 0.5


@pytest.fixture
def fake() -> FakeJsbsim:
    return FakeJsbsim()


def test_held_nothing_moves_and_no_fuel_is_used(fake: FakeJsbsim) -> None:
    fake.engine.hold()
    assert [fake.values[name] for name in INTEGRATORS] == [0.0] * 4
    assert fake.values["propulsion/fuel_freeze"] == 1.0


def test_it_is_started_once(fake: FakeJsbsim) -> None:
    fake.engine.hold()
    # All engines: -1, after the initial conditions, which would stop it.
    assert fake.values["propulsion/set-running"] == -1.0
    assert fake.calls.index("run_ic") < fake.calls.index("propulsion/set-running")
    fake.engine.hold()
    assert fake.calls.count("propulsion/set-running") == 1


def test_released_everything_moves_as_before(fake: FakeJsbsim) -> None:
    fake.engine.hold()
    fake.engine.release()
    assert [fake.values[name] for name in INTEGRATORS] == [3.0, 4.0, 5.0, 6.0]
    assert fake.values["propulsion/fuel_freeze"] == 0.0


def test_it_runs_until_its_push_is_steady(fake: FakeJsbsim) -> None:
    fake.engine.settle(spin=True)
    # 64 / 2^n changes by less than 1e-10 from n = 40 on: 2^-34 is 5.8e-11.
    assert len(fake.steps) == 40
    assert all(step > 0.0 for step in fake.steps)
    assert fake.dt == DT


def test_without_spin_no_time_passes(fake: FakeJsbsim) -> None:
    fake.engine.settle(spin=False)
    assert fake.push == 64.0
    assert set(fake.steps) == {0.0}
    assert fake.dt == DT


class RestlessJsbsim(FakeJsbsim):
    """Its engine's push changes its sign at every step."""

    def run(self) -> None:
        self.steps.append(self.dt)
        self.push = -self.push


def test_an_engine_that_never_settles_is_given_up() -> None:
    restless = RestlessJsbsim()
    restless.engine.settle(spin=True)
    assert 100 <= len(restless.steps) <= 1000
    assert restless.dt == DT


# ----------------------------------------------------------------------
# Newton's method, rotations and the wind triangle of a trim, against models whose answers are known.

ROOT = Path(__file__).parents[3]
LIMITS = (0.5, 0.4, 0.3)
GUESS = first_guess(25.0)


class LinearAircraft:
    """Its six accelerations are linear in the trim vector, and vanish at `balanced` and along two ways from it.

    Climbing takes throttle, 1 for a slope of 0.5; a higher airspeed takes less elevator.
    """

    balanced = np.array([25.0, 0.0, 0.05, 0.01, -0.1, 0.02, -0.01, 0.5])

    def __init__(self) -> None:
        self.amsl = math.nan
        rng = np.random.default_rng(8)
        self.a, self.b = rng.normal(size=(8, 8)), rng.normal(size=(8, 4))

    def move_to(self, amsl: float) -> None:
        self.amsl = amsl

    def apply_trim(self, values: Floats) -> Floats:
        airspeed, climb, alpha, bank, elevator, aileron, rudder, throttle = values - self.balanced
        return np.array(
            [
                4.0 * (throttle - 2.0 * climb) + 0.1 * alpha,
                alpha + 0.004 * airspeed,
                bank,
                aileron + 0.2 * rudder,
                rudder - 0.1 * aileron,
                9.0 * (elevator - 0.01 * airspeed),
            ]
        )

    def surface_limits(self) -> tuple[float, float, float]:
        return LIMITS

    def first_guess(self) -> Floats:
        return GUESS

    def derivatives(self, states: Floats, commands: Floats) -> Floats:
        return np.asarray(self.a @ states + self.b @ commands)


def test_held_quantities_stay_and_the_others_balance() -> None:
    aircraft = LinearAircraft()
    found = solve_trim(aircraft.apply_trim, {"airspeed": 28.0, "climb": 0.1}, LIMITS)
    assert found is not None
    # 3 m/s faster: alpha less by 0.012, elevator more by 0.03; a slope of 0.1 takes 0.2 more throttle and 0.0003.
    wanted = [28.0, 0.1, 0.038, 0.01, -0.07, 0.02, -0.01, 0.5 + 0.2 + 0.012 * 0.1 / 4.0]
    assert found == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize(("airspeed", "climb", "found"), [(25, 0.24, True), (25, 0.26, False), (66, 0, False)])
def test_what_the_stops_do_not_allow_is_no_flight(airspeed: float, climb: float, found: bool) -> None:
    # Throttles of 0.98 and 1.02; an elevator of 0.31, where 0.3 is the stop.
    aircraft = LinearAircraft()
    asked: list[Floats] = []

    def apply_trim(values: Floats) -> Floats:
        asked.append(values)
        return aircraft.apply_trim(values)

    trimmed = solve_trim(apply_trim, {"airspeed": airspeed, "climb": climb}, (0.3, 0.4, 0.3))
    assert (trimmed is not None) == found
    # Where steps get nowhere the search ends: most of an envelope's time went into flights that there are not.
    assert len(asked) < 100


def test_a_surface_that_moves_nothing_is_left_alone() -> None:
    """A flying wing's rudder: what its finite difference shows is noise, which is no way to balance anything."""
    aircraft = LinearAircraft()
    calls = iter(range(1000))

    def apply_trim(values: Floats) -> Floats:
        unmoved = values.copy()
        unmoved[QUANTITIES.index("rudder")] = aircraft.balanced[QUANTITIES.index("rudder")]
        # As JSBSim leaves: 1e-8 of the longest column.
        return aircraft.apply_trim(unmoved) + 1e-13 * np.cos(np.arange(6.0) + next(calls))

    found = solve_trim(apply_trim, {"airspeed": 28.0, "climb": 0.1}, LIMITS)
    assert found is not None
    assert found[QUANTITIES.index("rudder")] == 0.0
    assert found[QUANTITIES.index("throttle")] == pytest.approx(0.7003, abs=1e-6)


def test_a_balance_that_is_not_a_number_is_no_flight() -> None:
    assert solve_trim(lambda _: np.full(6, math.nan), {"airspeed": 25.0, "climb": 0.0}, LIMITS) is None


def test_each_kind_of_trim_holds_its_two_quantities() -> None:
    aircraft = LinearAircraft()
    held = steady_flight(aircraft, 26.0, 700.0, 0.05)
    assert held is not None
    assert (held.airspeed, held.climb, held.amsl, aircraft.amsl) == (26.0, 0.05, 700.0, 700.0)
    steepest, lowest = full_throttle_climb(aircraft, 25.0, 0.0), idle_descent(aircraft, 25.0, 0.0)
    assert steepest is not None
    assert lowest is not None
    assert (steepest.throttle, lowest.throttle) == (1.0, 0.0)
    # Half of the throttle is a slope of 0.25.
    assert (steepest.climb, lowest.climb) == pytest.approx((0.25, -0.25))


def test_the_slowest_flight_has_the_elevator_at_its_stop() -> None:
    slow = slowest_level_flight(LinearAircraft(), 0.0)
    # -0.5 is 40 m/s slower than the 25 m/s of -0.1, which is no flight; -0.2 is 15 m/s.
    assert slow is None
    aircraft = LinearAircraft()
    aircraft.surface_limits = lambda: (0.2, 0.4, 0.3)  # type: ignore[method-assign]  # an aircraft with less elevator
    slow = slowest_level_flight(aircraft, 0.0)
    assert slow is not None
    assert (slow.elevator, slow.climb) == (-0.2, 0.0)
    assert slow.airspeed == pytest.approx(15.0)


def test_vector_and_back_is_the_same_trim() -> None:
    trim = Trim(25.0, 700.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    assert trim_from_vector(trim.vector(), 700.0) == trim
    assert trim.commands() == (0.4, 0.5, 0.6, 0.7)
    assert dict(zip(QUANTITIES, trim.vector(), strict=True))["bank"] == 0.3


def test_linearising_a_linear_aircraft_gives_its_matrices() -> None:
    aircraft = LinearAircraft()
    a, b = linearise(aircraft, trim_from_vector(LinearAircraft.balanced, 300.0))
    np.testing.assert_allclose(a, aircraft.a, atol=1e-7)
    np.testing.assert_allclose(b, aircraft.b, atol=1e-7)
    assert aircraft.amsl == 300.0


@given(st.floats(-3.0, 3.0), st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(-0.3, 0.3))
def test_body_axes_put_the_velocity_where_alpha_says(heading: float, climb: float, bank: float, alpha: float) -> None:
    axes = body_axes(heading, climb, bank, alpha)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    velocity = axes @ [math.cos(alpha), 0.0, math.sin(alpha)]
    down = [math.cos(heading) * math.cos(climb), math.sin(heading) * math.cos(climb), -math.sin(climb)]
    np.testing.assert_allclose(velocity, down, atol=1e-12)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_euler_angles_are_those_of_the_rotation(roll: float, pitch: float, yaw: float) -> None:
    def turn(axis: int, angle: float) -> Floats:
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        out = np.eye(3)
        out[i, i] = out[j, j] = math.cos(angle)
        out[j, i], out[i, j] = math.sin(angle), -math.sin(angle)
        return out

    assert euler(turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)) == pytest.approx((roll, pitch, yaw), abs=1e-9)


def test_without_bank_the_pitch_is_the_slope_and_the_angle_of_attack() -> None:
    assert attitude(Trim(25.0, 0.0, 0.1, 0.06, 0.0, 0.0, 0.0, 0.0, 0.5)) == pytest.approx((0.0, 0.16))


def test_the_air_and_the_wind_add_up_to_the_course() -> None:
    # To the north in 7 m/s from the west: 24 of the 25 m/s are left.
    assert air_velocity(0.0, 0.0, 25.0, np.array([0.0, 7.0, 0.0])).tolist() == pytest.approx([24.0, -7.0, 0.0])
    wind = np.array([3.0, -6.0, 0.4])
    velocity = air_velocity(2.0, 0.05, 24.0, wind)
    assert np.linalg.norm(velocity) == pytest.approx(24.0)
    ground = velocity + wind
    assert math.atan2(ground[1], ground[0]) == pytest.approx(2.0)
    assert math.atan2(-ground[2], math.hypot(ground[0], ground[1])) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("airspeed", "wind"),
    [(25.0, (-25.1, 0.0, 0.0)), (25.0, (0.0, 25.1, 0.0)), (0.0, (0.0, 0.0, 0.0)), (-5.0, (9, 0, 0))],
)
def test_a_wind_that_leaves_no_way_is_refused(airspeed: float, wind: tuple[float, float, float]) -> None:
    with pytest.raises(FlightError, match=f"no progress along the course of 0 degrees: airspeed {airspeed:.1f} m/s"):
        air_velocity(0.0, 0.0, airspeed, np.array(wind))


TRIMS = """
from aircraft.catalog import load_aircraft
from flight.dynamics.fdm import Fdm
from flight.dynamics.trim import linearise, steady_flight
for name, airspeed in (("aerosonde", 25.0), ("aerosonde", 31.0), ("c172x", 50.0)):
    model = Fdm(load_aircraft(name))
    for climb in (-0.03, 0.0, 0.05):
        found = steady_flight(model, airspeed, 500.0, climb)
        print(found, [matrix.tobytes().hex() for matrix in linearise(model, found)])
"""


def test_a_trim_is_the_same_to_the_last_digit_on_other_processors() -> None:
    """A flight starts from it: a last digit comes to another track.

    NumPy's own code for this processor's features is left out, and OpenBLAS has other sums for each core; where it has
    none, both are the same anyway.
    """
    with contextlib.redirect_stdout(io.StringIO()) as here:
        exec(TRIMS, {})
    found = [here.getvalue()]
    # Of a trim that either changes, both at once change it, too.
    apart = [NUMPY_ON_BASELINE_CPU, *({"OPENBLAS_CORETYPE": core} for core in ("Nehalem", "Sandybridge", "Haswell"))]
    for changes in (NUMPY_ON_BASELINE_CPU | {"OPENBLAS_CORETYPE": "Prescott"}, *(apart if SOAK else ())):
        environment = os.environ | {"PYTHONPATH": str(ROOT)} | changes
        command = [sys.executable, "-W", "ignore", "-c", TRIMS]
        found.append(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
    assert found[0].count("Trim(") == 9
    assert len(set(found)) == 1


class HeldPropeller:
    """A propeller in a steady flow, in JSBSim's place: its speed follows its steady one with a time constant, s."""

    def __init__(self, constant: float) -> None:
        self.constant, self.speed, self.dt = constant, 10.0, 0.0

    def set_dt(self, dt: float) -> None:
        self.dt = dt

    def run(self) -> None:
        self.speed = max(0.0, self.speed + self.dt * (500.0 - self.speed) / self.constant)

    def getter(self, _name: str) -> Callable[[], float]:
        return lambda: self.speed

    def setter(self, _name: str) -> Callable[[float], None]:
        return lambda _value: None


@pytest.mark.parametrize("constant", [0.0005, 0.02, 0.15, 3.0, 40.0, 300.0])
def test_an_engine_settles_whatever_its_time_constant(constant: float) -> None:
    propeller = HeldPropeller(constant)
    Engine(propeller, 1.0 / 120.0, propeller.getter, propeller.setter).settle(spin=True)
    assert propeller.speed == pytest.approx(500.0, abs=1e-8)
    assert propeller.dt == 1.0 / 120.0
