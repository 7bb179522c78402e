"""The JSBSim wrapper: units, signs, starts, winds, actuators, and what it refuses."""

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.catalog import Aircraft, load_aircraft, read_aircraft
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.state import COMMAND_SIZE, STATE_SIZE, C, S
from flight.dynamics.trim import straight
from world.errors import FlightError

Floats = NDArray[np.float64]

AEROSONDE = load_aircraft("aerosonde")


def _state(fdm: Fdm) -> Floats:
    out = np.empty(STATE_SIZE)
    fdm.read(out)
    return out


def _fly(fdm: Fdm, trim_commands: Floats, seconds: float, record: Callable[[Floats], None] | None = None) -> None:
    """Hold wings level and height with the simplest autopilot that does."""
    commands, state = trim_commands.copy(), _state(fdm)
    pitch, amsl = state[S.PITCH], state[S.AMSL]
    for _ in range(round(seconds * 60.0)):
        fdm.read(state)
        if record is not None:
            record(state)
        target = pitch + 0.01 * (amsl - state[S.AMSL]) + 0.05 * state[S.V_DOWN]
        commands[C.ELEVATOR] = trim_commands[C.ELEVATOR] + 0.8 * (state[S.PITCH] - target) + 0.1 * state[S.Q]
        commands[C.AILERON] = trim_commands[C.AILERON] - 0.8 * state[S.ROLL] - 0.05 * state[S.P]
        fdm.write(commands)
        fdm.step(2)


def test_start_reads_back_what_was_asked() -> None:
    fdm = Fdm(AEROSONDE)
    trim = fdm.start(47.25, 8.5, 1234.0, 2.0, 24.0, 0.03, (3.0, -6.0, 0.4), terrain_amsl=1000.0)
    state = _state(fdm)
    assert state[S.TIME] == 0.0
    assert math.degrees(state[S.LATITUDE]) == pytest.approx(47.25, abs=1e-9)  # geodetic; geocentric is 47.06
    assert math.degrees(state[S.LONGITUDE]) == pytest.approx(8.5, abs=1e-9)
    assert state[S.AMSL] == pytest.approx(1234.0, abs=1e-4)
    assert fdm.height() == pytest.approx(234.0, abs=0.02)
    assert math.atan2(state[S.V_EAST], state[S.V_NORTH]) == pytest.approx(2.0, abs=1e-9)
    ground = math.hypot(state[S.V_NORTH], state[S.V_EAST])
    assert math.atan2(-state[S.V_DOWN], ground) == pytest.approx(0.03, abs=1e-9)
    assert state[S.AIRSPEED] == pytest.approx(24.0, abs=1e-9)
    assert state[S.BETA] == pytest.approx(0.0, abs=1e-9)
    assert state[[S.WIND_NORTH, S.WIND_EAST, S.WIND_DOWN]] == pytest.approx([3.0, -6.0, 0.4], abs=1e-9)
    air = state[[S.V_NORTH, S.V_EAST, S.V_DOWN]] - [3.0, -6.0, 0.4]
    assert np.linalg.norm(air) == pytest.approx(24.0, abs=1e-9)
    assert math.asin(-air[2] / 24.0) == pytest.approx(trim.climb, abs=1e-9)
    # The aircraft points into the air, not along the course.
    assert math.remainder(state[S.YAW] - math.atan2(air[1], air[0]), math.tau) == pytest.approx(0.0, abs=1e-3)
    assert state[[S.ELEVATOR, S.AILERON, S.RUDDER, S.THROTTLE]] == pytest.approx(trim.commands(), abs=1e-12)
    assert state[S.ACCEL_N] == pytest.approx(1.0, abs=0.02)


def test_start_has_no_transient() -> None:
    fdm = Fdm(AEROSONDE)
    trim = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0, 0.0, (3.0, -8.0, 0.5))
    before = _state(fdm)
    fdm.write(trim.commands())
    worst = np.zeros(STATE_SIZE)
    for _ in range(120):
        fdm.step()
        worst = np.maximum(worst, np.abs(_state(fdm) - before))
    assert worst[[S.ROLL, S.PITCH, S.YAW, S.P, S.Q, S.R, S.ALPHA, S.BETA]].max() < 2e-5
    assert worst[[S.V_DOWN, S.AIRSPEED, S.AMSL]].max() < 2e-4
    assert worst[[S.ELEVATOR, S.AILERON, S.RUDDER, S.THROTTLE]].max() < 1e-12


def test_starts_all_over_the_world() -> None:
    rng = np.random.default_rng(1)
    for _ in range(25):
        fdm = Fdm(AEROSONDE)
        lat_deg, lon_deg, amsl = rng.uniform(-85, 85), rng.uniform(-180, 180), rng.uniform(50, 3500)
        course, airspeed, climb = rng.uniform(-math.pi, math.pi), rng.uniform(20.5, 29), rng.uniform(-0.05, 0.05)
        wind = (*rng.uniform(-8, 8, 2), rng.uniform(-0.5, 0.5))
        fdm.start(lat_deg, lon_deg, amsl, course, airspeed, climb, wind, terrain_amsl=amsl - 40)
        state = _state(fdm)
        assert state[S.AIRSPEED] == pytest.approx(airspeed, abs=1e-6)
        turned = math.remainder(math.atan2(state[S.V_EAST], state[S.V_NORTH]) - course, math.tau)
        assert turned == pytest.approx(0.0, abs=1e-9)
        assert math.degrees(state[S.LATITUDE]) == pytest.approx(lat_deg, abs=1e-9)


def test_two_flights_are_equal_to_the_last_bit() -> None:
    ends = []
    for _ in range(2):
        fdm = Fdm(AEROSONDE)
        trim = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0)
        _fly(fdm, trim.commands(), 10.0)
        ends.append(_state(fdm))
    np.testing.assert_array_equal(*ends)


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
    state = _state(fdm)
    assert state[S.V_NORTH] == pytest.approx(math.sqrt(25.0**2 - 10.0**2), abs=1e-6)
    assert state[S.V_EAST] == pytest.approx(0.0, abs=1e-6)
    assert state[S.YAW] == pytest.approx(math.tau - math.asin(0.4), abs=1e-3)  # nose to the west, into the wind
    _fly(fdm, trim.commands(), 20.0)
    moved = np.degrees(_state(fdm)[[S.LATITUDE, S.LONGITUDE]]) - [47.0, 8.0]
    assert moved[0] * 111170.0 == pytest.approx(20.0 * math.sqrt(525.0), abs=2.0)
    assert moved[1] * 75990.0 == pytest.approx(0.0, abs=2.0)


@pytest.mark.parametrize("setter", ["set_wind", "set_gust"])
@pytest.mark.parametrize(("wind", "headwind"), [((5.0, 0, 0), -5.0), ((-5.0, 0, 0), 5.0), ((0, 0, -3.0), 0.0)])
def test_wind_and_gust_change_the_airspeed(setter: str, wind: tuple[float, ...], headwind: float) -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 0.0, 25.0)
    before = _state(fdm)
    getattr(fdm, setter)(*wind)
    fdm.step()
    state = _state(fdm)
    assert state[[S.WIND_NORTH, S.WIND_EAST, S.WIND_DOWN]] == pytest.approx(wind, abs=1e-9)
    assert state[S.AIRSPEED] == pytest.approx(math.hypot(25.0 + headwind, wind[2]), abs=0.02)
    # Rising air (down < 0) meets the wing from below.
    assert state[S.ALPHA] - before[S.ALPHA] == pytest.approx(math.atan2(-wind[2], 25.0), abs=2e-3)
    # The motion over the ground follows only later.
    assert state[S.V_NORTH] == pytest.approx(25.0, abs=0.02)


def test_gust_adds_to_the_wind() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 0.0, 25.0, wind_ned=(1.0, 2.0, 0.0))
    fdm.set_gust(0.5, -4.0, 0.25)
    fdm.step()
    assert _state(fdm)[[S.WIND_NORTH, S.WIND_EAST, S.WIND_DOWN]] == pytest.approx([1.5, -2.0, 0.25], abs=1e-9)


def test_airspeed_is_true_airspeed() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 3500.0, 0.5, 25.0)
    state = _state(fdm)
    assert math.hypot(state[S.V_NORTH], state[S.V_EAST]) == pytest.approx(25.0, abs=1e-6)  # calibrated would be 21


def test_height_above_sea_level_over_fifteen_kilometres() -> None:
    pyproj = pytest.importorskip("pyproj")
    fdm = Fdm(AEROSONDE)
    trim = fdm.start(47.0, 8.0, 500.0, 0.7, 25.0)
    track: list[Floats] = []
    _fly(fdm, trim.commands(), 600.0, lambda state: track.append(state.copy()))
    flown = np.array(track)
    down = flown[:, S.V_DOWN]
    sunk = np.concatenate([[0.0], np.cumsum((down[1:] + down[:-1]) / 2.0 / 60.0)])
    # A tangent plane would have it 17 m lower by the end.
    np.testing.assert_allclose(flown[:, S.AMSL], 500.0 - sunk, atol=0.02)
    place = np.degrees(flown[[0, -1]][:, [S.LONGITUDE, S.LATITUDE]])
    distance = pyproj.Geod(ellps="WGS84").inv(*place[0], *place[1])[2]
    assert distance == pytest.approx(25.0 * 600.0, rel=3e-3)
    assert abs(flown[-1, S.AMSL] - 500.0) < 5.0


@pytest.mark.parametrize(
    ("row", "surface", "rate", "sign"),
    [
        (C.ELEVATOR, S.ELEVATOR, S.Q, -1.0),
        (C.AILERON, S.AILERON, S.P, 1.0),
        (C.RUDDER, S.RUDDER, S.R, -1.0),
    ],
)
def test_surfaces_lag_and_turn_the_right_way(row: C, surface: S, rate: S, sign: float) -> None:
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    begin = commands[row]
    commands[row] += 0.05
    fdm.write(commands)
    fdm.step(6)  # 0.05 s, one time constant
    state = _state(fdm)
    assert (state[surface] - begin) / 0.05 == pytest.approx(1.0 - math.exp(-1.0), abs=0.04)
    assert sign * state[rate] > 0.01


def test_surfaces_are_limited_in_rate_and_travel() -> None:
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    commands[C.AILERON] = 2.0
    fdm.write(commands)
    aileron = [_state(fdm)[S.AILERON]]
    for _ in range(60):
        fdm.step()
        aileron.append(_state(fdm)[S.AILERON])
    assert np.diff(aileron).max() == pytest.approx(math.radians(200.0) * fdm.dt, rel=1e-6)
    assert max(aileron) == pytest.approx(AEROSONDE.max_aileron)


def test_motor_lags_and_draws_current() -> None:
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    level = _state(fdm)
    begin = commands[C.THROTTLE]
    commands[C.THROTTLE] = 1.0
    fdm.write(commands)
    fdm.step(12)  # 0.1 s
    state = _state(fdm)
    assert (state[S.THROTTLE] - begin) / (1.0 - begin) == pytest.approx(1.0 - math.exp(-1.0), abs=0.03)
    assert state[S.POWER] > 1.5 * level[S.POWER] > 0.0
    assert state[S.POWER] == pytest.approx(state[S.CURRENT] * AEROSONDE.battery_voltage, rel=1e-9)
    commands[C.THROTTLE] = 0.0
    fdm.write(commands)
    fdm.step(240)
    assert _state(fdm)[S.CURRENT] == 0.0


def test_state_is_si_and_complete() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 1.0, 25.0)
    fdm.step(60)
    state = _state(fdm)
    assert np.isfinite(state).all()
    assert state[S.TIME] == pytest.approx(0.5)
    with pytest.raises(ValueError, match="zip"):
        fdm.write(np.zeros(COMMAND_SIZE + 1))


def test_jsbsim_never_says_that_anything_is_wrong() -> None:
    # What a caller must look for itself: NaN in the state, and a height below zero.
    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 500.0, 1.0, 25.0).commands()
    commands[C.ELEVATOR] = math.nan
    fdm.write(commands)
    fdm.step(3)
    assert math.isnan(_state(fdm)[S.AMSL])

    fdm = Fdm(AEROSONDE)
    commands = fdm.start(47.0, 8.0, 60.0, 1.0, 25.0).commands()
    commands[[C.ELEVATOR, C.THROTTLE]] = 0.1, 0.0
    fdm.write(commands)
    fdm.step(600)
    assert fdm.height() < 0.0
    assert _state(fdm)[S.AIRSPEED] > 15.0


def test_terrain_moves_the_height_and_nothing_else() -> None:
    fdm = Fdm(AEROSONDE)
    fdm.start(47.0, 8.0, 500.0, 1.0, 25.0)
    fdm.set_terrain(380.0)
    fdm.step()
    state = _state(fdm)
    assert fdm.height() == pytest.approx(120.0, abs=0.02)
    assert state[S.AMSL] == pytest.approx(500.0, abs=1e-3)


def test_variations_change_what_they_say() -> None:
    level = {}
    for name, variation in {
        "none": None,
        "mass": Variation(mass=1.1),
        "drag": Variation(drag=1.3),
        "control": Variation(control=0.75),
    }.items():
        found = straight(Fdm(AEROSONDE, variation=variation), 25.0, 500.0)
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


# Models that must not be loaded.


@pytest.fixture
def model(tmp_path: Path) -> Aircraft:
    return read_aircraft(Path(shutil.copytree(AEROSONDE.folder, tmp_path / "aerosonde")))


def test_copied_model_flies(model: Aircraft) -> None:
    Fdm(model).start(47.0, 8.0, 500.0, 1.0, 25.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</fdm_config>", '<input port="5555"/></fdm_config>', "<input> opens a port"),
        ("</fdm_config>", "<input><property>a/b</property></input></fdm_config>", "<input> opens a port"),
        ("</fdm_config>", '<output name="f.csv" type="CSV" rate="9"/></fdm_config>', "<output> opens a port or writes"),
        ("</fdm_config>", '<output file="unitest"/></fdm_config>', "<output> opens a port"),
        ("<propulsion/>", '<propulsion><engine file="electric"/></propulsion>', "brings in another file"),
        ("<input> command/elevator-rad", '<input port="1"> command/elevator-rad', "<input> opens a port"),
        ("</flight_control>", '<output type="SOCKET"/></flight_control>', "<output> opens a port"),
        ("<p> aero/beta-rad </p>", "<p> aero/side-angle </p>", "property aero/side-angle is read, and neither"),
        ("> aero/alpha-rad </indep", "> aero/alfa </indep", "property aero/alfa is read, and neither"),
        ("<input> command/rudder-rad", "<input> -command/rudder", "property command/rudder is read, and neither"),
    ],
)
def test_models_are_refused_with_file_and_line(model: Aircraft, old: str, new: str, message: str) -> None:
    text = model.model_file.read_text()
    line = text[: text.index(old)].count("\n") + 1
    model.model_file.write_text(text.replace(old, new, 1))
    with pytest.raises(FlightError, match=message) as caught:
        Fdm(model)
    assert str(caught.value).startswith(f"{model.model_file}:{line}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE x [<!ENTITY a "b">]><fdm_config/>', "document type declaration"),
        ("<runscript/>", "root element is <runscript>"),
        ("<fdm_config>", "not well-formed"),
        ("", "not well-formed"),
        ("<fdm_config/>", "JSBSim"),
    ],
)
def test_other_files_are_refused(model: Aircraft, text: str, message: str) -> None:
    model.model_file.write_text(text)
    with pytest.raises(FlightError, match=message) as caught:
        Fdm(model)
    assert "\n" not in str(caught.value)


def test_missing_model_is_refused(model: Aircraft) -> None:
    model.model_file.unlink()
    with pytest.raises(FlightError, match="cannot be read: No such file"):
        Fdm(model)


def test_model_without_our_properties_is_refused(model: Aircraft) -> None:
    text = model.model_file.read_text()
    model.model_file.write_text(text.replace("motor/battery-current-a", "motor/amperes"))
    with pytest.raises(FlightError, match="property motor/battery-current-a is needed and not defined"):
        Fdm(model)


@pytest.mark.parametrize("rate_hz", [0.0, -120.0, math.nan, math.inf])
def test_bad_rate_is_refused(rate_hz: float) -> None:
    with pytest.raises(FlightError, match="rate_hz"):
        Fdm(AEROSONDE, rate_hz=rate_hz)
