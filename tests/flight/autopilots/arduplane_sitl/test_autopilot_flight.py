"""Flights that another program steers: with a fake that flies or fails as it is told, and with ArduPlane itself."""

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane_sitl import physics
from flight.autopilots.arduplane_sitl.flight import AutopilotFlight, fly_autopilot
from flight.simulation.setup import FlightSetup
from tests.autopilots import arduplane_program, shorten_run_in
from tests.flight.autopilots.arduplane_sitl.conftest import MakeFake
from tests.mission_lines import setup_of, wp
from tests.setups import setup_maker
from tests.soak import SOAK, some
from world.arrays import Floats
from world.errors import FlightError

AEROSONDE = load_aircraft("aerosonde")
MAKE = setup_maker(AEROSONDE)
# A short way with a bend of 20 degrees.
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
    if not SOAK:
        shorten_run_in(monkeypatch)


def left_behind() -> list[Path]:
    """Folders of programs that have ended."""
    return list(Path(tempfile.gettempdir()).glob("planfly-autopilot-*"))


def children() -> set[str]:
    """Our child processes but for the one that lists them."""
    asked = ["ps", "-o", "pid=,comm=", "--ppid", str(os.getpid())]
    listed = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.splitlines()
    return {line for line in listed if not line.endswith(" ps")}


def make_setup(way: Floats = SHORT, **keywords: object) -> FlightSetup:
    return MAKE(way, **keywords)


@pytest.mark.parametrize("fault", some(["32-outputs", "none", "no-space"], 3))
@pytest.mark.usefixtures("short_run_in")
def test_an_autopilot_flies_the_mission_to_its_end(fake_autopilot: MakeFake, tmp_path: Path, fault: str) -> None:
    before, folders, kept = children(), left_behind(), tmp_path / "flight.BIN"
    flown, setup = fly_autopilot(make_setup(), AEROSONDE, arduplane_program(fake_autopilot(fault)), {}, log=kept)
    track = flown.track
    assert flown.ended == "completed"
    assert track.time[0] == 0.0
    assert np.allclose(np.diff(track.time), 1.0 / 60.0)
    # From the first waypoint to the last, at some 25 m/s, and above the flat ground at 100 m.
    assert np.hypot(*track.position[0, :2]) < 5.0
    assert np.hypot(*(track.position[-1, :2] - SHORT[-1, :2])) < 15.0
    assert np.allclose(track.clearance, track.position[:, 2] - 100.0, atol=0.01)
    assert track.leg[0] == 0
    assert track.leg[-1] == 1
    assert abs(track.position[:, 2] - 500.0).max() < 15.0
    assert track.energy[-1] > track.energy[len(track) // 2] > 0.0
    assert setup.autopilot.program is not None
    assert setup.autopilot.program.version == "ArduPlane V0.0-fake (0badc0de)"
    assert kept.read_bytes() == b"\xa3\x95fake"
    assert (children(), left_behind()) == (before, folders)


@pytest.mark.parametrize(
    ("fault", "said"),
    some(
        [
            (
                "magic",
                "uses another version of the physics interface: a packet of 40 bytes that begins with 4711; allowed",
            ),
            ("deaf", "does not understand planfly's answers: it requested frame 300 again for 1 s"),
            ("silent", "sent no outputs for 1 s; the flight is ended"),
            ("crash", "ended with exit code 3: out of memory"),
            ("signal", "was ended by SIGSEGV"),
            ("panic", "panicked: Failed to load defaults"),
            ("mute", "sent no heartbeat over MAVLink within 30 s"),
            ("copter", "is not ArduPlane: its heartbeat states vehicle type 2"),
            ("no-ekf", "had no position estimate (EKF) within 60 s"),
            ("refuses", "refused the mission at item 2 (DO_CHANGE_SPEED): MAV_MISSION_UNSUPPORTED"),
            ("will-not-arm", "did not accept arming (command 400) within 5 s; its last message: Arm: no will"),
            ("crash-in-air", "ended with exit code 1"),
            ("reboot", "restarted in the air: frame 1 after frame"),
        ],
        3,
    ),
)
@pytest.mark.usefixtures("short_run_in")
def test_what_goes_wrong_with_the_program_is_one_line_that_names_it(
    fake_autopilot: MakeFake, monkeypatch: pytest.MonkeyPatch, fault: str, said: str
) -> None:
    if "for 1 s" in said:
        monkeypatch.setattr(physics, "SILENCE_TIMEOUT_S", 1.0)
    before, folders = children(), left_behind()
    program = fake_autopilot(fault)
    with pytest.raises(FlightError) as failed:
        fly_autopilot(make_setup(), AEROSONDE, arduplane_program(program), {})
    assert str(failed.value).startswith(f"{program}: {said}")
    assert "\n" not in str(failed.value)
    assert (children(), left_behind()) == (before, folders)


@pytest.mark.usefixtures("short_run_in")
def test_a_loiter_without_end_is_flown_with_its_own_radius_for_a_minute_and_a_lap(fake_autopilot: MakeFake) -> None:
    """The program circles on; the flight's clock counts from the circle on, and ends it there."""
    setup = setup_of(wp(0, 0), wp(0, 1000, command=17, p="0 0 -400 0"))
    flown, _ = fly_autopilot(setup, AEROSONDE, arduplane_program(fake_autopilot("none")), {})
    assert flown.ended == "completed"
    away = np.hypot(*(flown.track.position[:, :2] - (0.0, 1000.0)).T)
    # 600 m to the rim at 25 m/s are 24 s, then a lap of 100 s, in the circle alone once it has settled.
    assert 115.0 < flown.track.time[-1] < 140.0
    assert away[flown.track.time > 45.0] == pytest.approx(400.0, rel=0.15)
    around = np.unwrap(np.arctan2(*(flown.track.position[:, :2] - (0.0, 1000.0)).T))
    # A lap to the left.
    assert around[-1] - around[0] == pytest.approx(-2.0 * math.pi, abs=1.0)


@pytest.mark.usefixtures("short_run_in")
def test_a_dive_into_the_ground_is_a_flight_that_ended_so(fake_autopilot: MakeFake) -> None:
    way = WAY * [1.0, 3.0, 1.0]
    flown, _ = fly_autopilot(MAKE(way - [0.0, 0.0, 300.0]), AEROSONDE, arduplane_program(fake_autopilot("dive")), {})
    assert flown.ended == "ground contact" or flown.ended.startswith("loss of control")
    assert flown.track.clearance[-1] < 100.0


@pytest.mark.parametrize("write", [lambda path: None, lambda path: path.mkdir(), lambda path: path.write_text("#!")])
def test_what_cannot_be_run_is_one_line(tmp_path: Path, write: Callable[[Path], object]) -> None:
    program = tmp_path / "arduplane"
    write(program)
    with pytest.raises(FlightError, match=r"arduplane: (no such file|is a folder|not executable)"):
        AutopilotFlight(make_setup(), AEROSONDE, arduplane_program(program), {})


def test_a_file_that_is_no_program_is_one_line(tmp_path: Path) -> None:
    program = tmp_path / "arduplane"
    program.write_bytes(b"\x7fELF and no more")
    program.chmod(0o755)
    before = left_behind()
    with pytest.raises(FlightError, match=r"arduplane: not an executable program: "):
        AutopilotFlight(make_setup(), AEROSONDE, arduplane_program(program), {})
    assert left_behind() == before


@pytest.mark.usefixtures("short_run_in")
def test_an_exception_ends_the_program_and_removes_its_folder(
    fake_autopilot: MakeFake, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, folders = children(), left_behind()

    def interrupt(flight: AutopilotFlight) -> None:
        flight.fly_block(60)
        raise KeyboardInterrupt

    monkeypatch.setattr("flight.autopilots.arduplane_sitl.flight.fly_to_end", interrupt)
    with pytest.raises(KeyboardInterrupt):
        fly_autopilot(make_setup(), AEROSONDE, arduplane_program(fake_autopilot()), {})
    assert (children(), left_behind()) == (before, folders)


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's own end of a child is Linux's")
def test_our_death_is_the_programs(fake_autopilot: MakeFake, tmp_path: Path) -> None:
    code = f"""
import os, signal
from pathlib import Path
from tests.flight.autopilots.arduplane_sitl.test_autopilot_flight import AEROSONDE, make_setup
from flight.autopilots.arduplane_sitl.flight import AutopilotFlight
from tests.autopilots import arduplane_program
with AutopilotFlight(make_setup(), AEROSONDE, arduplane_program(Path({str(fake_autopilot())!r})), {{}}) as flight:
    print(flight._process._process.pid, flight._process._folder, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    pid, folder = ended.stdout.split()
    for _ in range(3000):
        if not Path("/proc", pid).exists():
            break
        time.sleep(0.02)
    assert not Path("/proc", pid).exists()
    # Its folder too is gone, though the process was killed without a word.
    for _ in range(1000):
        if not Path(folder).exists():
            break
        time.sleep(0.02)
    assert not Path(folder).exists()
    assert tmp_path.exists()


@pytest.mark.usefixtures("short_run_in")
def test_satellites_mistake_the_place_as_the_setup_says(fake_autopilot: MakeFake) -> None:
    def mistakes(nav: str, seconds: int) -> list[tuple[float, ...]]:
        found = []
        with AutopilotFlight(
            replace(make_setup(), nav=nav), AEROSONDE, arduplane_program(fake_autopilot()), {}
        ) as flight:
            found.append(flight._lockstep.error)
            flight.prepare()
            for _ in range(seconds):
                flight.fly_block(60)
                found.append(flight._lockstep.error)
        return found

    assert set(mistakes("perfect", 2)) == {(0.0,) * 6}
    off = np.array(mistakes("gnss", 20))
    # 1.5 m on each axis, wandering in some 20 s, from before the flight on; and the velocity by its rate.
    assert 0.3 < math.sqrt((off[:, :3] ** 2).mean()) < 4.0
    assert abs(off[0, :3] - off[1, :3]).max() < 0.5
    assert abs(off[0, :3]).min() > 0.0
    assert 0.005 < math.sqrt((off[2:, 3:] ** 2).mean()) < 0.3


@pytest.mark.client
def test_arduplane_flies_a_bend_as_its_law_has_it(arduplane: Path, tmp_path: Path) -> None:
    flown, setup = fly_autopilot(
        make_setup(WAY, wind=(5.0, 250.0)), AEROSONDE, arduplane_program(arduplane), {"WP_RADIUS": 60.0}
    )
    track, program = flown.track, setup.autopilot.program
    assert flown.ended == "completed"
    assert program is not None
    assert program.version.startswith("ArduPlane V")
    assert (program.changed, program.parameters["WP_RADIUS"]) == ({"WP_RADIUS": 60.0}, 60.0)
    assert program.parameters["ROLL_LIMIT_DEG"] == 30.0
    # On each leg's second half it is on the leg: L1 leaves a metre or two of an integral's work.
    late = (track.position[:, 1] > 350.0) & (track.position[:, 1] < 640.0)
    assert abs(track.position[late, 0]).max() < 2.0
    assert abs(track.position[:, 2] - 500.0).max() < 5.0
    # 25 m/s of equivalent airspeed are 2.5 % more at 500 m.
    assert np.median(track.airspeed) == pytest.approx(25.0 * 1.0246, abs=0.3)
    assert np.degrees(abs(track.attitude[:, 0]).max()) < 33.0


@pytest.mark.client
def test_arduplane_names_what_it_does_not_know(arduplane: Path) -> None:
    own = {"WP_NO_SUCH": 1.0, "SERVO1_REVERSED": 1.0, "NAVL1_PERIOD": 17.0}
    with AutopilotFlight(make_setup(), AEROSONDE, arduplane_program(arduplane), own) as flight:
        program = flight.setup.autopilot.program
    assert program is not None
    assert program.unused == ("SERVO1_REVERSED", "WP_NO_SUCH")
    assert program.changed == {"NAVL1_PERIOD": 17.0}
