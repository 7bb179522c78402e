"""JSBSim as a flight-dynamics model: where a flight may begin, its state, and what varies it."""

import math
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.fdm import Fdm, Variation, check_start_position
from flight.dynamics.jsbsim_properties import FOOT, TERRAIN
from flight.dynamics.state import STATE, Commands
from flight.dynamics.trim import steady_flight
from world.errors import FlightError
from world.kernels import Record, field_names

# ----------------------------------------------------------------------
# Where a flight may begin, at each limit and just beyond it.

BEYOND = {
    "latitude": (90.0, 8.0, 500.0, 400.0),
    "longitude": (46.0, -180.1, 500.0, 400.0),
    "on the ground": (46.0, 8.0, 400.0, 400.0),
    "too high": (46.0, 8.0, 11000.0, 400.0),
}


@pytest.mark.parametrize("place", [(-89.9, 180.0, 500.0, 400.0), (46.0, 8.0, 400.1, 400.0), (46.0, 8.0, 10999.9, 0.0)])
def test_a_place_within_the_limits_is_taken(place: tuple[float, float, float, float]) -> None:
    check_start_position(*place)


@pytest.mark.parametrize("case", BEYOND)
def test_a_place_beyond_one_is_refused_by_its_name_and_value(case: str) -> None:
    place = BEYOND[case]
    with pytest.raises(FlightError) as caught:
        check_start_position(*place)
    error = caught.value
    # Both heights are the start's.
    field, value = {"latitude": ("latitude", 90.0), "longitude": ("longitude", -180.1)}.get(case, ("start", place[2]))
    assert (error.field, error.value) == (field, value)
    assert str(error).startswith("start at")
    assert str(error).endswith(error.allowed)


# ----------------------------------------------------------------------
# The JSBSim wrapper: units, signs, starts, winds, actuators, and what it refuses.

AEROSONDE = load_aircraft("aerosonde")


def _fly(fdm: Fdm, trimmed: Commands, seconds: float, record: Callable[[Record], None] | None = None) -> None:
    """Hold wings level and height with the simplest autopilot that does."""
    begun = fdm.read()
    for _ in range(round(seconds * 60.0)):
        state = fdm.read()
        if record is not None:
            record(state)
        target = begun.pitch + 0.01 * (begun.amsl - state.amsl) + 0.05 * state.velocity_down
        fdm.write(
            trimmed._replace(
                elevator=trimmed.elevator + 0.8 * (state.pitch - target) + 0.1 * state.pitch_rate,
                aileron=trimmed.aileron - 0.8 * state.roll - 0.05 * state.roll_rate,
            )
        )
        fdm.step(2)


def test_start_reads_back_what_was_asked() -> None:
    fdm = Fdm(AEROSONDE)
    trim = fdm.start(47.25, 8.5, 1234.0, 2.0, 24.0, 0.03, (3.0, -6.0, 0.4), terrain_amsl=1000.0)
    state = fdm.read()
    assert state.time == 0.0
    assert math.degrees(state.latitude) == pytest.approx(47.25, abs=1e-9)  # geodetic; geocentric is 47.06
    assert math.degrees(state.longitude) == pytest.approx(8.5, abs=1e-9)
    assert state.amsl == pytest.approx(1234.0, abs=1e-4)
    assert fdm.height() == pytest.approx(234.0, abs=0.02)
    assert math.atan2(state.velocity_east, state.velocity_north) == pytest.approx(2.0, abs=1e-9)
    ground = math.hypot(state.velocity_north, state.velocity_east)
    assert math.atan2(-state.velocity_down, ground) == pytest.approx(0.03, abs=1e-9)
    assert state.airspeed == pytest.approx(24.0, abs=1e-9)
    assert state.beta == pytest.approx(0.0, abs=1e-9)
    assert [state.wind_north, state.wind_east, state.wind_down] == pytest.approx([3.0, -6.0, 0.4], abs=1e-9)
    air = np.array([state.velocity_north, state.velocity_east, state.velocity_down]) - [3.0, -6.0, 0.4]
    assert np.linalg.norm(air) == pytest.approx(24.0, abs=1e-9)
    assert math.asin(-air[2] / 24.0) == pytest.approx(trim.climb, abs=1e-9)
    # The aircraft points into the air, not along the course.
    assert math.remainder(state.yaw - math.atan2(air[1], air[0]), math.tau) == pytest.approx(0.0, abs=1e-3)
    assert [state.elevator, state.aileron, state.rudder, state.throttle] == pytest.approx(trim.commands(), abs=1e-12)
    assert state.load_factor == pytest.approx(1.0, abs=0.02)


def test_start_has_no_transient() -> None:
    fdm = Fdm(AEROSONDE)
    trim = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0, 0.0, (3.0, -8.0, 0.5))
    before = fdm.read()
    fdm.write(trim.commands())
    worst = dict.fromkeys(field_names(STATE), 0.0)
    for _ in range(120):
        fdm.step()
        state = fdm.read()
        # Unlike Python's max, numpy's keeps a NaN.
        worst = {name: np.maximum(most, abs(state[name] - before[name])) for name, most in worst.items()}
    for name in ("roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate", "alpha", "beta"):
        assert worst[name] < 2e-5, name
    for name in ("velocity_down", "airspeed", "amsl"):
        assert worst[name] < 2e-4, name
    for name in ("elevator", "aileron", "rudder", "throttle"):
        assert worst[name] < 1e-12, name


def test_starts_all_over_the_world() -> None:
    rng = np.random.default_rng(1)
    for _ in range(25):
        fdm = Fdm(AEROSONDE)
        lat_deg, lon_deg, amsl = rng.uniform(-85, 85), rng.uniform(-180, 180), rng.uniform(50, 3500)
        course, airspeed, climb = rng.uniform(-math.pi, math.pi), rng.uniform(20.5, 29), rng.uniform(-0.05, 0.05)
        wind = (*rng.uniform(-8, 8, 2), rng.uniform(-0.5, 0.5))
        fdm.start(lat_deg, lon_deg, amsl, course, airspeed, climb, wind, terrain_amsl=amsl - 40)
        state = fdm.read()
        assert state.airspeed == pytest.approx(airspeed, abs=1e-6)
        turned = math.remainder(math.atan2(state.velocity_east, state.velocity_north) - course, math.tau)
        assert turned == pytest.approx(0.0, abs=1e-9)
        assert math.degrees(state.latitude) == pytest.approx(lat_deg, abs=1e-9)


def test_two_flights_are_equal_to_the_last_bit() -> None:
    ends = []
    for _ in range(2):
        fdm = Fdm(AEROSONDE)
        trim = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0)
        _fly(fdm, trim.commands(), 10.0)
        ends.append(fdm.read())
    assert ends[0].tobytes() == ends[1].tobytes()


def test_a_start_with_little_power_to_spare_is_found() -> None:
    """Newton's method finds no trim from afar there; the climb at full throttle at this airspeed leads to it."""
    fdm = Fdm(load_aircraft("zagi"))
    trim = fdm.start(45.0, 0.0, 2355.4, 0.7, 16.8433, 0.0016)
    assert 0.9 < trim.throttle < 1.0
    assert np.abs(fdm.apply_trim(trim.vector())).max() < 1e-7
    # It does hold it: in a second nothing has moved.
    again = Fdm(load_aircraft("zagi"))
    again.write(again.start(45.0, 0.0, 2355.4, 0.7, 16.8433, 0.0).commands())
    again.step(120)
    state = again.read()
    assert (state.airspeed, state.amsl) == pytest.approx((16.8433, 2355.4), abs=0.05)
    # Its fastest level flight at this height is 17.6 m/s.
    with pytest.raises(FlightError, match=r"cannot hold steady flight at 18\.5 m/s"):
        fdm.start(45.0, 0.0, 2355.4, 0.7, 18.5)


@pytest.mark.parametrize(
    "start",
    [
        (47.0, 8.0, math.nan, 0.0, 25.0),
        (95.0, 8.0, 500.0, 0.0, 25.0),
        (47.0, 190.0, 500.0, 0.0, 25.0),
        (47.0, 8.0, -10.0, 0.0, 25.0),
        (47.0, 8.0, 20000.0, 0.0, 25.0),
        (47.0, 8.0, 500.0, 0.0, -25.0),
        (47.0, 8.0, 500.0, 0.0, 12.0),
        (47.0, 8.0, 500.0, 0.0, 25.0, 0.4),
        (47.0, 8.0, 500.0, 0.0, 25.0, -0.2),
        (47.0, 8.0, 500.0, 0.0, 25.0, 0.0, (-26.0, 0.0, 0.0)),
        (47.0, 8.0, 500.0, 0.0, 25.0, 0.0, (0.0, 26.0, 0.0)),
        (47.0, 8.0, 500.0, 0.0, 25.0, 0.0, (0.0, 26.0)),
    ],
)
def test_impossible_starts_are_refused_in_one_line(start: tuple[float, ...]) -> None:
    with pytest.raises(FlightError) as caught:
        Fdm(AEROSONDE).start(*start)
    assert "\n" not in str(caught.value)


def test_wind_carries_the_aircraft_the_way_it_moves() -> None:
    fdm = Fdm(AEROSONDE)
    trim = fdm.start(47.0, 8.0, 500.0, 0.0, 25.0, wind_ned=(0.0, 10.0, 0.0))
    state = fdm.read()
    assert state.velocity_north == pytest.approx(math.sqrt(25.0**2 - 10.0**2), abs=1e-6)
    assert state.velocity_east == pytest.approx(0.0, abs=1e-6)
    assert state.yaw == pytest.approx(math.tau - math.asin(0.4), abs=1e-3)  # nose to the west, into the wind
    _fly(fdm, trim.commands(), 20.0)
    end = fdm.read()
    moved = np.degrees([end.latitude, end.longitude]) - [47.0, 8.0]
    assert moved[0] * 111170.0 == pytest.approx(20.0 * math.sqrt(525.0), abs=2.0)
    assert moved[1] * 75990.0 == pytest.approx(0.0, abs=2.0)


@pytest.mark.parametrize("setter", ["set_wind", "set_gust"])
@pytest.mark.parametrize(("wind", "headwind"), [((5.0, 0, 0), -5.0), ((-5.0, 0, 0), 5.0), ((0, 0, -3.0), 0.0)])
def test_wind_and_gust_change_the_airspeed(setter: str, wind: tuple[float, ...], headwind: float) -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 0.0, 25.0)
    before = fdm.read()
    getattr(fdm, setter)(*wind)
    fdm.step()
    state = fdm.read()
    assert [state.wind_north, state.wind_east, state.wind_down] == pytest.approx(wind, abs=1e-9)
    assert state.airspeed == pytest.approx(math.hypot(25.0 + headwind, wind[2]), abs=0.02)
    # Rising air (down < 0) meets the wing from below.
    assert state.alpha - before.alpha == pytest.approx(math.atan2(-wind[2], 25.0), abs=2e-3)
    # The motion over the ground follows only later.
    assert state.velocity_north == pytest.approx(25.0, abs=0.02)


def test_gust_adds_to_the_wind() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 0.0, 25.0, wind_ned=(1.0, 2.0, 0.0))
    fdm.set_gust(0.5, -4.0, 0.25)
    fdm.step()
    state = fdm.read()
    assert [state.wind_north, state.wind_east, state.wind_down] == pytest.approx([1.5, -2.0, 0.25], abs=1e-9)


def test_airspeed_is_true_airspeed() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 3500.0, 0.5, 25.0)
    state = fdm.read()
    assert math.hypot(state.velocity_north, state.velocity_east) == pytest.approx(
        25.0, abs=1e-6
    )  # calibrated would be 21


def test_height_above_sea_level_over_five_kilometres() -> None:
    pyproj = pytest.importorskip("pyproj")
    fdm = Fdm(AEROSONDE)
    trim = fdm.start(47.0, 8.0, 500.0, 0.7, 25.0)
    track: list[Record] = []
    _fly(fdm, trim.commands(), 200.0, track.append)
    flown = np.array(track, STATE)
    down = flown["velocity_down"]
    sunk = np.concatenate([[0.0], np.cumsum((down[1:] + down[:-1]) / 2.0 / 60.0)])
    # A tangent plane would have it 2 m lower by the end.
    np.testing.assert_allclose(flown["amsl"], 500.0 - sunk, atol=0.02)
    begin, end = (np.degrees([state.longitude, state.latitude]) for state in (flown[0], flown[-1]))
    distance = pyproj.Geod(ellps="WGS84").inv(*begin, *end)[2]
    assert distance == pytest.approx(25.0 * 200.0, rel=3e-3)
    assert abs(flown[-1].amsl - 500.0) < 5.0


@pytest.mark.parametrize(
    ("control", "rate", "sign"),
    [("elevator", "pitch_rate", -1.0), ("aileron", "roll_rate", 1.0), ("rudder", "yaw_rate", -1.0)],
)
def test_surfaces_lag_and_turn_the_right_way(control: str, rate: str, sign: float) -> None:
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    begin = getattr(commands, control)
    fdm.write(commands._replace(**{control: begin + 0.05}))
    fdm.step(6)  # 0.05 s, one time constant
    state = fdm.read()
    assert (state[control] - begin) / 0.05 == pytest.approx(1.0 - math.exp(-1.0), abs=0.04)
    assert sign * state[rate] > 0.01


def test_surfaces_are_limited_in_rate_and_travel() -> None:
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    fdm.write(commands._replace(aileron=2.0))
    aileron = [fdm.read().aileron]
    for _ in range(60):
        fdm.step()
        aileron.append(fdm.read().aileron)
    assert np.diff(aileron).max() == pytest.approx(math.radians(200.0) * fdm.dt, rel=1e-6)
    assert max(aileron) == pytest.approx(AEROSONDE.max_aileron)


def test_motor_lags_and_draws_current() -> None:
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    level = fdm.read()
    begin = commands.throttle
    fdm.write(commands._replace(throttle=1.0))
    fdm.step(12)  # 0.1 s
    state = fdm.read()
    assert (state.throttle - begin) / (1.0 - begin) == pytest.approx(1.0 - math.exp(-1.0), abs=0.03)
    assert state.power > 1.5 * level.power > 0.0
    assert state.power == pytest.approx(state.current * AEROSONDE.battery_voltage, rel=1e-9)
    fdm.write(commands._replace(throttle=0.0))
    fdm.step(240)
    assert fdm.read().current == 0.0


def test_state_is_si_and_complete() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 1.0, 25.0)
    fdm.step(60)
    state = fdm.read()
    assert np.isfinite(state.tolist()).all()
    assert state.time == pytest.approx(0.5)
    with pytest.raises(ValueError, match="zip"):
        fdm.write([0.0] * 5)


def test_jsbsim_never_says_that_anything_is_wrong() -> None:
    # What a caller must look for itself: NaN in the state, and a height below zero.
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    fdm.write(commands._replace(elevator=math.nan))
    fdm.step(3)
    assert math.isnan(fdm.read().amsl)

    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 60.0, 1.0, 25.0).commands()
    fdm.write(commands._replace(elevator=0.1, throttle=0.0))
    fdm.step(600)
    assert fdm.height() < 0.0
    assert fdm.read().airspeed > 15.0


def test_terrain_moves_the_height_and_nothing_else() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 1.0, 25.0)
    fdm.properties.setter(TERRAIN)(380.0 / FOOT)
    fdm.step()
    state = fdm.read()
    assert fdm.height() == pytest.approx(120.0, abs=0.02)
    assert state.amsl == pytest.approx(500.0, abs=1e-3)


def test_variations_change_what_they_say() -> None:
    level = {}
    for name, variation in {
        "none": None,
        "mass": Variation(mass=1.1),
        "drag": Variation(drag=1.3),
        "control": Variation(control=0.75),
    }.items():
        found = steady_flight(Fdm(AEROSONDE, variation=variation), 25.0, 500.0)
        assert found is not None
        level[name] = found
    lift = {name: 0.23 + 5.61 * trim.alpha + 0.13 * trim.elevator for name, trim in level.items()}
    assert lift["mass"] / lift["none"] == pytest.approx(1.1, rel=3e-3)
    assert level["drag"].throttle > level["none"].throttle + 0.01
    moment = {name: 0.0135 - 2.74 * trim.alpha for name, trim in level.items()}
    assert level["control"].elevator == pytest.approx(moment["control"] / 0.99 / 0.75, rel=1e-6)
    assert level["none"].elevator == pytest.approx(moment["none"] / 0.99, rel=1e-6)


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 1.0, 25.0)
    fdm.step(10)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("rate_hz", [0.0, -120.0, math.nan, math.inf])
def test_bad_rate_is_refused(rate_hz: float) -> None:
    with pytest.raises(FlightError, match="rate_hz"):
        Fdm(AEROSONDE, rate_hz=rate_hz)


def test_threads_that_fly_leave_standard_output_in_place() -> None:
    """Each of them suppresses the output of the whole process while it loads a model."""
    code = (
        "from concurrent.futures import ThreadPoolExecutor; from aircraft.catalog import load_aircraft;"
        "from flight.dynamics.fdm import Fdm; aircraft = load_aircraft('aerosonde');"
        "list(ThreadPoolExecutor(4).map(lambda _: Fdm(aircraft), range(12))); print('still here')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert ended.stdout == "still here\n"
