"""An autopilot's program: started with its options in a folder of its own, and never left."""

import hashlib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from flight.autopilots.arduplane_sitl.process import arduplane_launch
from flight.autopilots.guard import Guard
from flight.autopilots.sitl import process
from flight.autopilots.sitl.process import AutopilotProcess, check_binary
from flight.mission.items import Home
from world.errors import FlightError

HOME = Home(36.5, -84.25, 300.0)


@pytest.fixture(autouse=True)
def own_folder_for_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))


def script(tmp_path: Path, text: str) -> Path:
    program = tmp_path / "autopilot"
    program.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    program.chmod(0o755)
    return program


def started(program: Path) -> AutopilotProcess:
    return AutopilotProcess(
        program, arduplane_launch(HOME, 90.0, {"WP_RADIUS": 90.0, "NAVL1_PERIOD": 17.5}, 4001, 4002)
    )


def wait_for(file: Path) -> str:
    for _ in range(6000):
        if file.exists() and file.read_text():
            return file.read_text()
        time.sleep(0.01)
    raise AssertionError(f"{file} was not written")


def test_the_program_gets_its_place_its_ports_and_its_parameters(tmp_path: Path) -> None:
    program = script(
        tmp_path, f'cp "$0" x; pwd > {tmp_path}/folder; cat "${{22}}" > {tmp_path}/p; echo "$@" > {tmp_path}/said'
    )
    with started(program):
        said = wait_for(tmp_path / "said").split()
        folder = Path((tmp_path / "folder").read_text().strip())
        options = dict(zip(said[::2], said[1::2], strict=False))
        assert options["--model"] == "JSON:127.0.0.1"
        assert options["--home"] == "36.500000000,-84.250000000,300.000,90.00"
        assert options["--serial0"] == "tcpclient:127.0.0.1:4002"
        assert options["--sim-port-out"] == "4001"
        assert len({options[name] for name in ("--base-port", "--sim-port-in", "--rc-in-port")}) == 3
        assert Path(said[-1]).read_text() == "WP_RADIUS 90\nNAVL1_PERIOD 17.5\n"
        assert (folder / "x").exists()
    assert not folder.exists()


def test_leaving_kills_a_program_that_would_stay(tmp_path: Path) -> None:
    program = script(tmp_path, f"trap '' TERM; echo $$ > {tmp_path}/pid; while :; do sleep 0.05; done")
    with started(program):
        pid = int(wait_for(tmp_path / "pid"))
        os.kill(pid, 0)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def gone(pid: int) -> bool:
    """Whether a process has ended, waited for or not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def wait_until_gone(pid: int) -> None:
    for _ in range(1000):
        if gone(pid):
            return
        time.sleep(0.01)
    raise AssertionError(f"process {pid} was left")


def wrapper(tmp_path: Path, text: str) -> Path:
    """A script that runs the program and waits for it, without exec."""
    inner = tmp_path / "inner"
    inner.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    inner.chmod(0o755)
    return script(tmp_path, f"{inner}; echo over")


STUBBORN = "trap '' TERM; echo $$ > {0}/pid; while :; do sleep 0.05; done"


def test_leaving_kills_what_a_wrapper_without_exec_has_started(tmp_path: Path) -> None:
    with started(wrapper(tmp_path, STUBBORN.format(tmp_path))):
        pid = int(wait_for(tmp_path / "pid"))
        assert not gone(pid)
    wait_until_gone(pid)


def test_what_a_wrapper_has_started_is_asked_to_end_and_closes_its_log(tmp_path: Path) -> None:
    text = (
        f"mkdir logs; trap 'sleep 0.2; echo end >> logs/00000001.BIN; exit' TERM; echo log > logs/00000001.BIN\n"
        f"echo up > {tmp_path}/up; while :; do sleep 0.02; done"
    )
    with started(wrapper(tmp_path, text)) as process:
        wait_for(tmp_path / "up")
        process.end(lambda: False)
        assert process.save_log(tmp_path / "kept.BIN")
    assert (tmp_path / "kept.BIN").read_text() == "log\nend\n"


def test_a_guard_that_is_gone_keeps_no_program_from_running(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone(Guard):
        def register_folder(self, folder: Path) -> None:
            self._process.kill()
            self._process.wait()

    monkeypatch.setattr(process, "Guard", Gone)
    with started(script(tmp_path, f"echo up > {tmp_path}/up; sleep 60")):
        assert wait_for(tmp_path / "up") == "up\n"


# Killed when the program runs, and we know nothing of it yet.
HELD_AT_THE_START = """start = subprocess.Popen
def held(*words, **options):
    started = start(*words, **options)
    time.sleep(60 if "preexec_fn" in options else 0)
    return started
subprocess.Popen = held
"""


@pytest.mark.parametrize("first", ["", HELD_AT_THE_START])
def test_killed_we_leave_neither_program_nor_folder(tmp_path: Path, first: str) -> None:
    program = wrapper(tmp_path, STUBBORN.format(tmp_path))
    code = (
        "import os, subprocess, sys, tempfile, time; from pathlib import Path\n"
        "from tests.flight.autopilots.arduplane_sitl.test_autopilot_process import started\n"
        f"tempfile.tempdir = sys.argv[2]\n{first}"
        "with started(Path(sys.argv[1])): time.sleep(60)"
    )
    temporary = tmp_path / "temporary"
    ours = subprocess.Popen([sys.executable, "-c", code, str(program), str(temporary)], cwd=Path(__file__).parents[4])
    try:
        pid = int(wait_for(tmp_path / "pid"))
        assert list(temporary.iterdir())
    finally:
        ours.kill()
        ours.wait()
    wait_until_gone(pid)
    for _ in range(1000):
        if not list(temporary.iterdir()):
            return
        time.sleep(0.01)
    raise AssertionError("the folder was left")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("echo starting; echo PANIC: no storage; exit 1", "panicked: no storage"),
        ("echo 'last  words'; exit 7", "ended with exit code 7: last words"),
        ("kill -ABRT $$", "was ended by SIGABRT"),
        ("exit 0", "ended with exit code 0"),
    ],
)
def test_a_watch_tells_how_the_program_ended(tmp_path: Path, text: str, said: str) -> None:
    def watch() -> None:
        for _ in range(6000):
            process.check_running()
            time.sleep(0.01)

    with started(script(tmp_path, text)) as process, pytest.raises(FlightError) as ended:
        watch()
    assert str(ended.value) == said


def test_a_program_that_is_asked_to_end_closes_its_log(tmp_path: Path) -> None:
    text = (
        f"mkdir logs; trap 'echo end >> logs/00000001.BIN; exit' TERM; echo log > logs/00000001.BIN\n"
        f"echo up > {tmp_path}/up; while :; do sleep 0.02; done"
    )
    with started(script(tmp_path, text)) as process:
        wait_for(tmp_path / "up")
        process.end(lambda: False)
        assert process.save_log(tmp_path / "kept.BIN")
    assert (tmp_path / "kept.BIN").read_text() == "log\nend\n"


def test_a_program_without_a_log_leaves_none(tmp_path: Path) -> None:
    with started(script(tmp_path, "exit 0")) as process:
        assert not process.save_log(tmp_path / "kept.BIN")
    assert not (tmp_path / "kept.BIN").exists()


def test_the_digest_is_the_files(tmp_path: Path) -> None:
    program = script(tmp_path, "exit 0")
    assert check_binary(program, "ArduPlane") == hashlib.sha256(program.read_bytes()).hexdigest()


def test_what_is_no_program_is_told_apart(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.write_text("no program")
    for path, said in ((tmp_path / "none", "no such file"), (tmp_path, "is a folder"), (plain, "not executable")):
        with pytest.raises(FlightError, match=said):
            check_binary(path, "ArduPlane")
