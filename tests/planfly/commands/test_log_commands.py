"""The commands that start from a log, in processes of their own: replay, recover, compare, and a full disk."""

import json
import os
import pty
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from logs.recording.reader import read_log
from planfly.cli import main

ROOT = Path(__file__).parents[3]
HERE = {**os.environ, "PYTHONPATH": str(ROOT)}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short flight's folder: plan.json and flight.mcap of the scenario `tight`."""
    folder = tmp_path_factory.mktemp("flight") / "run"
    assert main(["run", "tight", "--out", str(folder)]) == 4
    return folder


@pytest.fixture(scope="module")
def broken(flight: Path) -> Path:
    data = (flight / "flight.mcap").read_bytes()
    path = flight.parent / "broken.mcap"
    path.write_bytes(data[: len(data) * 3 // 4])
    return path


@pytest.mark.parametrize("command", ["check", "report", "replay", "recover"])
def test_an_unfinished_log_ends_with_3_and_its_end_time(
    broken: Path, tmp_path: Path, command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "cut.mcap"
    copy.write_bytes(broken.read_bytes())
    assert main([command, str(copy)]) == 3
    out = capfd.readouterr()
    assert f"{copy}: incomplete: " in out.err
    assert f"ends at {read_log(broken).end_time:.1f} s" in out.err
    assert not out.out.startswith("flyable")


def test_recover_writes_a_whole_log_once(broken: Path, flight: Path, tmp_path: Path) -> None:
    target = tmp_path / "whole.mcap"
    assert main(["recover", str(broken), "--out", str(target)]) == 3
    assert len(read_log(target).track) == len(read_log(broken).track)
    assert main(["recover", str(broken), "--out", str(target)]) == 2
    assert main(["recover", str(flight / "flight.mcap"), "--out", str(tmp_path / "other.mcap")]) == 0
    assert not (tmp_path / "other.mcap").exists()


def test_a_full_disk_is_one_line_and_leaves_a_readable_log(flight: Path, tmp_path: Path) -> None:
    log = tmp_path / "full.mcap"
    most = (flight / "flight.mcap").stat().st_size // 2

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    result = subprocess.run(
        [sys.executable, "-m", "planfly", "fly", str(flight / "plan.json"), "--log", str(log)],
        cwd=tmp_path, capture_output=True, text=True, check=False, env=HERE, preexec_fn=limit,
    )  # fmt: skip
    assert result.returncode == 1, result.stderr
    said = [line for line in result.stderr.splitlines() if line.startswith("planfly: ")]
    assert len(said) == 1
    assert str(log) in said[0]
    assert "Traceback" not in result.stderr
    read = read_log(log)
    assert not read.complete
    full = read_log(flight / "flight.mcap").track
    assert 10 < len(read.track) < len(full)
    assert read.track.position.tobytes() == full.position[: len(read.track)].tobytes()


def on_a_terminal(*argv: str, cwd: Path) -> tuple[int, str]:
    """Run planfly with its output on a pseudo-terminal: exit code and what it wrote."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "planfly", *argv], cwd=cwd, stdout=theirs, stderr=subprocess.DEVNULL,
        env={**HERE, "COLUMNS": "90", "LINES": "40"},
    )  # fmt: skip
    os.close(theirs)
    said = b""
    while True:
        try:
            data = os.read(ours, 65536)
        except OSError:  # the other end has closed
            break
        if not data:
            break
        said += data
    os.close(ours)
    return process.wait(), said.decode()


def test_replay_on_a_terminal_shows_instruments(flight: Path, tmp_path: Path) -> None:
    log = flight / "flight.mcap"
    code, said = on_a_terminal("replay", str(log), "--speed", "40", "--from", "10", "--to", "50", cwd=tmp_path)
    assert code == 0
    assert said.count("\x1b[H") >= 4
    # The terminal is as it was, and the last moment stays on it.
    assert said.index("\x1b[?1049h") < said.index("\x1b[H") < said.index("\x1b[?25h\x1b[?1049l")
    last = said.rpartition("\x1b[?1049l")[2]
    assert "\x1b" not in last
    assert "50.0 of" in last
    assert "airspeed" in last
    code, said = on_a_terminal("replay", str(log), "--at-once", cwd=tmp_path)
    assert "\x1b" not in said
    assert "leg 0 to waypoint 1" in said


def test_replay_of_a_part(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(flight / "flight.mcap")
    assert main(["replay", log]) == 0
    whole = capsys.readouterr().out.splitlines()
    assert main(["replay", log, "--from", "20", "--to", "60"]) == 0
    part = capsys.readouterr().out.splitlines()
    assert 0 < len(part) < len(whole)
    first = whole.index(part[0])
    assert whole[first : first + len(part)] == part
    assert main(["replay", log, "--from", "60", "--to", "20"]) == 2
    assert main(["replay", log, "--from", "5000"]) == 2


def test_a_thinner_log_is_judged_as_it_is(flight: Path, tmp_path: Path) -> None:
    log = tmp_path / "thin.mcap"
    code = main(["fly", str(flight / "plan.json"), "--log", str(log), "--log-hz", "20"])
    thin, full = read_log(log), read_log(flight / "flight.mcap")
    assert len(thin.track) in (len(full.track) // 3 + 1, len(full.track) // 3 + 2)
    assert thin.track.time[-1] == full.track.time[-1]
    assert main(["check", str(log), "--json", str(tmp_path / "v.json")]) == code
    assert json.loads((tmp_path / "v.json").read_text(encoding="utf-8")) == thin.recorded_verdict


def test_compare(flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(flight / "flight.mcap")
    assert main(["compare", log, log]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:1] == ["verdict"]
    assert main(["compare", log, log, "--out", str(tmp_path / "c"), "--svg"]) == 0
    assert len(list((tmp_path / "c").iterdir())) == 5
    assert main(["compare", log, log, "--out", str(tmp_path / "c")]) == 2


def test_layout_and_svg(flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "--layout", str(tmp_path / "layout.json")]) == 0
    assert (tmp_path / "layout.json").stat().st_size > 1000
    assert main(["report", "--layout", str(tmp_path / "layout.json")]) == 2
    assert main(["report"]) == 2
    assert main(["report", str(flight / "flight.mcap"), "--svg", "--out", str(tmp_path / "r")]) == 4
    names = {path.name for path in (tmp_path / "r").iterdir()}
    drawn = ("map", "profile", "scene", "turns", "envelope")
    assert names == {"report.html", *(f"{name}.{kind}" for name in drawn for kind in ("png", "svg"))}
