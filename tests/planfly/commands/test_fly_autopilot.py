"""``planfly fly --sitl``: a real autopilot's flight, its log beside ours, its verdict again, and its failures."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from logs.recording.reader import read_log
from planfly.cli import main
from tests.autopilots import need_arduplane, shorten_run_in, write_fake, write_fake_px4
from tests.soak import SOAK, some

ROOT = Path(__file__).parents[3]
MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
1\t0\t0\t16\t0\t60\t0\t0\t46.000\t8.0\t400\t1
2\t0\t0\t16\t0\t60\t0\t0\t46.006\t8.0\t400\t1
3\t0\t0\t16\t0\t60\t0\t0\t46.012\t8.001\t400\t1
"""


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    file = tmp_path / "short.waypoints"
    file.write_text(MISSION, encoding="utf-8")
    return file


@pytest.fixture
def short_flight(mission: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the way, and little run-in: each of the fakes' flights takes as long as its seconds."""
    if not SOAK:
        mission.write_text(MISSION.replace("46.006", "46.002").replace("46.012", "46.004"), encoding="utf-8")
        shorten_run_in(monkeypatch)


@pytest.mark.usefixtures("short_flight")
def test_a_flight_is_logged_judged_and_judged_again(
    mission: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    params, log = tmp_path / "mine.parm", tmp_path / "f.mcap"
    params.write_text("LIM_ROLL_CD 3500\nSERVO1_MIN 1000\nNAVL1_PERIOD 17\n", encoding="utf-8")
    given = ["--params", str(params), "--log", str(log)]
    code = main(["fly", str(mission), "--sitl", str(write_fake(tmp_path)), *given])
    printed = capsys.readouterr().out
    assert "Flown by: ArduPlane V0.0-fake (0badc0de) (sha256 " in printed
    assert "changed: NAVL1_PERIOD 17, ROLL_LIMIT_DEG 35" in printed
    assert f"{tmp_path / 'f.BIN'} (the autopilot's own)" in printed
    assert (tmp_path / "f.BIN").read_bytes() == b"\xa3\x95fake"
    recorded = read_log(log)
    assert recorded.ended == "completed"
    assert recorded.setup.autopilot.program is not None
    assert recorded.setup.autopilot.program.unused == ("SERVO1_MIN",)
    assert recorded.setup.autopilot.parameters is not None
    again = tmp_path / "again.json"
    assert main(["check", str(log), "--json", str(again)]) == code
    assert recorded.recorded_verdict is not None
    answer = json.loads(again.read_text(encoding="utf-8"))
    answer.pop("returns")
    assert answer.pop("headline") == "flyable; terrain not judged"
    assert answer == recorded.recorded_verdict | {"exit_code": code}
    assert recorded.recorded_verdict["flown_by"]["changed"] == {"NAVL1_PERIOD": 17.0, "ROLL_LIMIT_DEG": 35.0}


@pytest.mark.usefixtures("short_flight")
def test_a_program_with_px4s_start_up_files_is_flown_as_px4(
    mission: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever law the scenario names."""
    params, log = tmp_path / "mine.params", tmp_path / "f.mcap"
    params.write_text("1\t1\tFW_R_LIM\t35.0\t9\n1\t1\tBAT1_N_CELLS\t3\t6\n", encoding="utf-8")
    program = write_fake_px4(tmp_path)
    code = main(["fly", str(mission), "--sitl", str(program), "--params", str(params), "--log", str(log)])
    printed = capsys.readouterr().out
    assert "Flown by: PX4 1.16.0 (sha256 " in printed
    assert "changed: FW_R_LIM 35" in printed
    assert f"{tmp_path / 'f.ulg'} (the autopilot's own)" in printed
    assert (tmp_path / "f.ulg").read_bytes() == b"ULogfake"
    recorded = read_log(log)
    assert recorded.ended == "completed"
    assert recorded.setup.autopilot.name == "px4"
    assert recorded.setup.autopilot.version == "PX4 1.16.0"
    assert recorded.setup.autopilot.program is not None
    assert recorded.setup.autopilot.program.unused == ("BAT1_N_CELLS",)
    assert main(["check", str(log)]) == code


FAULTS = [
    ("panic", 2, "panicked: Failed to load defaults"),
    ("refuses", 2, "refused the mission at item 2 (NAV_WAYPOINT): MAV_MISSION_UNSUPPORTED"),
    ("crash-in-air", 1, "ended with exit code 1"),
    ("reboot", 1, "restarted in the air: frame 1 after frame"),
]


# One before its flight and one in it; what else can go wrong is told by the tests of the link itself.
@pytest.mark.parametrize(("fault", "code", "said"), some(FAULTS, 2))
def test_a_program_that_fails_is_one_line_and_leaves_no_log(
    mission: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str, code: int, said: str
) -> None:
    program, log = write_fake(tmp_path, fault), tmp_path / "f.mcap"
    assert main(["fly", str(mission), "--sitl", str(program), "--log", str(log)]) == code
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("planfly: ")]
    assert len(errors) == 1
    assert errors[0].startswith(f"planfly: {program}: {said}")
    assert not log.exists()
    assert not (tmp_path / "f.BIN").exists()


def test_what_cannot_be_run_is_one_line_before_anything_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in (["fly", "no.waypoints"], ["run", "no-scenario"]):
        assert main([*command, "--sitl", str(tmp_path / "none")]) == 2
        assert capsys.readouterr().err.startswith(f"planfly: {tmp_path / 'none'}: no such file; ")


def test_a_law_of_guidance_and_a_real_autopilot_exclude_each_other(
    mission: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fly", str(mission), "--sitl", str(write_fake(tmp_path)), "--guidance", "l1"]) == 2
    assert 'guidance: not allowed with autopilot = "ardupilot"' in capsys.readouterr().err


def test_the_folder_of_the_default_log_may_be_missing(
    mission: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The program is started, and its own failure reported."""
    monkeypatch.chdir(tmp_path)
    assert main(["fly", str(mission), "--sitl", str(write_fake(tmp_path, "panic"))]) == 2
    assert "panicked: Failed to load defaults" in capsys.readouterr().err


def test_the_autopilots_log_is_not_written_over_another(
    mission: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "f.BIN"
    mine.write_bytes(b"mine")
    given = ["--sitl", str(write_fake(tmp_path)), "--log", str(tmp_path / "f.mcap")]
    assert main(["fly", str(mission), *given]) == 2
    assert capsys.readouterr().err == f"planfly: {mine}: exists; --overwrite replaces it\n"
    assert mine.read_bytes() == b"mine"


@pytest.mark.parametrize("number", some([signal.SIGTERM, signal.SIGINT], 2))
def test_a_signal_ends_the_program_and_leaves_none_of_its_files(
    mission: Path, tmp_path: Path, number: signal.Signals
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    command = [sys.executable, "-m", "planfly", "fly", str(mission), "--sitl", str(write_fake(tmp_path, "silent"))]
    running = subprocess.Popen(
        [*command, "--log", str(tmp_path / "f.mcap")],
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(temporary)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        # Whoever runs the tests in the background may have told all processes to ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    for _ in range(15_000):
        if list(temporary.glob("planfly-autopilot-*/logs/*.BIN")):
            break
        time.sleep(0.02)
    time.sleep(0.3)
    children = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
    running.send_signal(number)
    _, complaint = running.communicate(timeout=120.0)
    assert running.returncode == 128 + number, complaint
    assert list(temporary.glob("planfly-autopilot-*")) == []
    # The program, and the guard of what it has started.
    assert len(children) == 2
    assert not [child for child in children if Path("/proc", child).exists()]


@pytest.mark.client
def test_arduplane_flies_a_mission_file(mission: Path, tmp_path: Path) -> None:
    log = tmp_path / "f.mcap"
    given = ["--sitl", str(need_arduplane()), "--log", str(log), "--wind", "5,250", "--turbulence", "light"]
    main(["fly", str(mission), *given])
    recorded = read_log(log)
    assert recorded.ended == "completed"
    assert recorded.recorded_verdict["flown_by"]["version"].startswith("ArduPlane V")
    # A dataflash log begins with the message that describes the others.
    assert (tmp_path / "f.BIN").read_bytes()[:3] == b"\xa3\x95\x80"
