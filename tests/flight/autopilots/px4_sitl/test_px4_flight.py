"""A flight that another program steers in PX4's place: the exchange, the conversation, and what goes wrong with it."""

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.autopilots.px4_sitl import flight as px4_flight
from flight.autopilots.px4_sitl import physics
from flight.autopilots.px4_sitl.autopilot import Px4Sitl
from flight.autopilots.px4_sitl.flight import Px4Flight
from flight.mission.route import make_route
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import SimulatedFlight, fly_to_end
from tests.autopilots import shorten_run_in
from tests.flight.autopilots.px4_sitl.conftest import MakeFake
from tests.flight.autopilots.px4_sitl.fake_px4 import CIRCLE
from tests.setups import setup_maker, waypoint_mission
from tests.soak import SOAK, only_in_soak, some
from world.arrays import Floats
from world.errors import CrashError, FlightError

AEROSONDE = load_aircraft("aerosonde")
BEND = math.radians(20.0)
WAY = np.array(
    [[0.0, 0.0, 500.0], [0.0, 700.0, 500.0], [700.0 * math.sin(BEND), 700.0 + 700.0 * math.cos(BEND), 500.0]]
)
# For the fakes, which settle at once; every frame costs both processes.
SHORT = WAY if SOAK else WAY * [0.4, 0.4, 1.0]


@pytest.fixture(autouse=True)
def own_folder_for_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))


@pytest.fixture
def short_run_in(monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_run_in(monkeypatch)


@pytest.fixture
def short_run_in_but_for_a_soak(request: pytest.FixtureRequest) -> None:
    if not SOAK:
        request.getfixturevalue("short_run_in")


def left_behind() -> list[Path]:
    return list(Path(tempfile.gettempdir()).glob("planfly-autopilot-*"))


def make_setup(way: Floats = SHORT, **keywords: object) -> FlightSetup:
    return replace(setup_maker(AEROSONDE)(way, **keywords), autopilot=Px4(Px4Parameters.load(AEROSONDE)))


def fly(setup: FlightSetup, program: Path, log: Path | None = None) -> tuple[SimulatedFlight, FlightSetup]:
    with Px4Flight(setup, AEROSONDE, Px4Sitl(Px4Parameters.load(AEROSONDE), binary=program)) as flight:
        flight.prepare()
        flown = fly_to_end(flight)
        if log is not None:
            assert flight.save_log(log)
        lock = Path(f"/tmp/px4_lock-{flight._lockstep._port.port}")
        assert lock.exists()
    assert not lock.exists()
    return flown, flight.setup


@pytest.mark.parametrize("fault", some(["none", "slow-start"], 2))
@pytest.mark.usefixtures("short_run_in_but_for_a_soak")
def test_px4s_link_flies_the_mission_to_its_end(fake_px4: MakeFake, tmp_path: Path, fault: str) -> None:
    """The fake finds its way by what the sensors tell it: forces, field, pressures, rates and places must be right."""
    kept = tmp_path / "flight.ulg"
    flown, setup = fly(make_setup(wind=(5.0, 250.0)), fake_px4(fault), kept)
    track, program = flown.track, setup.autopilot.program
    assert flown.ended == "completed"
    assert np.allclose(np.diff(track.time), 1.0 / 60.0)
    assert np.hypot(*(track.position[-1, :2] - SHORT[-1, :2])) < 15.0
    assert abs(track.position[:, 2] - 500.0).max() < 15.0
    assert program is not None
    assert program.version == "PX4 1.16.0"
    # As the program says which release it is, that one's law is its law.
    assert setup.autopilot.model.version == "1.16"
    assert program.parameters["CA_SV_CS_COUNT"] == 3.0
    assert program.parameters["FW_R_LIM"] == 30.0
    assert (program.changed, program.unused) == ({}, ())
    assert kept.read_bytes() == b"ULogfake"
    assert left_behind() == []


@only_in_soak
@pytest.mark.usefixtures("short_run_in_but_for_a_soak")
def test_the_flight_goes_once_around_where_px4_circles_about_its_last_waypoint(fake_px4: MakeFake) -> None:
    made = make_setup()
    mission = waypoint_mission(SHORT, np.array([25.0]), made.scenario.origin)
    route = make_route(mission, made.scenario.origin, made.scenario.terrain, 25.0, False, made.limits)
    flown, _ = fly(replace(made, mission=mission, route=route), fake_px4())
    off = flown.track.position[:, :2] - SHORT[-1, :2]
    distance = np.hypot(off[:, 0], off[:, 1])
    assert flown.ended == "completed"
    reached = int(np.argmin(distance))
    assert distance[reached] < 10.0
    # To the right onto the circle, a quarter of a turn, and once around, but for what the last look at the link takes.
    course = np.unwrap(np.arctan2(flown.track.velocity[reached:, 0], flown.track.velocity[reached:, 1]))
    assert course[-1] - course[0] == pytest.approx(2.5 * math.pi, abs=0.1)
    assert np.median(distance[reached:]) == pytest.approx(CIRCLE, rel=0.2)


@pytest.mark.parametrize(
    ("fault", "said"),
    some(
        [
            ("silent", "sent no outputs for 1 s; the flight is ended"),
            ("does-not-connect", "did not connect to the simulator within 1 s"),
            ("never-starts", "did not start up within 1 s"),
            ("crash", "ended with exit code 3: out of memory"),
            ("crash-in-air", "ended with exit code 1"),
            ("mute", "sent no heartbeat over MAVLink within 30 s"),
            ("copter", "is not PX4: its heartbeat states vehicle type 2"),
            ("ardupilot", "is not PX4: its heartbeat states autopilot 3; expected 12, PX4"),
            ("no-ekf", "had no position estimate (EKF) within 60 s"),
            # Without home, which ArduPlane counts, item 1 sets the speed.
            ("refuses", "refused the mission at item 2 (NAV_WAYPOINT): MAV_MISSION_UNSUPPORTED"),
            (
                "will-not-arm",
                "did not accept arming (command 400) within 5 s; its last message: Arming denied",
            ),
            ("stays-in-manual", "did not accept MISSION (DO_SET_MODE) within 5 s"),
        ],
        6,
    ),
)
@pytest.mark.usefixtures("short_run_in")
def test_what_goes_wrong_with_px4_is_one_line_that_names_it(
    fake_px4: MakeFake, monkeypatch: pytest.MonkeyPatch, fault: str, said: str
) -> None:
    # Of the three patiences the one that runs out; on a loaded machine a program takes longer than that to connect.
    if fault == "silent":
        monkeypatch.setattr(physics, "SILENCE_TIMEOUT_S", 1.0)
    elif fault == "does-not-connect":
        monkeypatch.setattr(px4_flight, "_CONNECT_TIMEOUT_S", 1.0)
    elif fault == "never-starts":
        monkeypatch.setattr(px4_flight, "_STARTUP_TIMEOUT_S", 1.0)
    program = fake_px4(fault)
    with pytest.raises(FlightError) as failed:
        fly(make_setup(), program)
    assert str(failed.value).startswith(f"{program}: {said}")
    assert "\n" not in str(failed.value)
    assert isinstance(failed.value, CrashError) is (fault in ("crash-in-air", "stays-in-manual"))
    assert left_behind() == []


@only_in_soak
@pytest.mark.usefixtures("short_run_in")
def test_a_dive_into_the_ground_is_a_flight_that_ended_so(fake_px4: MakeFake) -> None:
    setup = setup_maker(AEROSONDE)(WAY * [1.0, 3.0, 1.0] - [0.0, 0.0, 300.0])
    flown, _ = fly(replace(setup, autopilot=Px4(Px4Parameters.load(AEROSONDE))), fake_px4("dive"))
    assert flown.ended == "ground contact" or flown.ended.startswith("loss of control")
    assert flown.track.clearance[-1] < 100.0


def test_a_program_without_its_start_up_files_is_one_line(tmp_path: Path) -> None:
    program = tmp_path / "px4"
    program.write_text("#!/bin/sh\nexit 0\n", encoding="utf-8")
    program.chmod(0o755)
    with pytest.raises(FlightError, match=r"px4: expected PX4.s start-up files next to the program"):
        fly(make_setup(), program)
    assert left_behind() == []


@pytest.mark.client
def test_px4_flies_a_bend_as_its_law_has_it(px4: Path) -> None:
    setup = make_setup(WAY)
    flown, flown_setup = fly(setup, px4)
    assert flown.ended == "completed"
    assert flown_setup.autopilot.program is not None
    assert flown_setup.autopilot.program.version.startswith("PX4 1.")
    track = flown.track
    # On each leg's second half it is on the leg.
    late = (track.position[:, 1] > 350.0) & (track.position[:, 1] < 600.0)
    assert abs(track.position[late, 0]).max() < 2.0
    assert abs(track.position[:, 2] - 500.0).max() < 6.0
