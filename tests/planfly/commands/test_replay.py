"""``planfly replay``: instruments on a terminal, the timeline of a whole flight or a part elsewhere."""

import os
import pty
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from logs.recording.example_log import write_example_log
from planfly.cli import main


def on_a_terminal(*argv: str) -> tuple[int, str]:
    """Run planfly with its output on a pseudo-terminal: exit code and what it wrote."""
    ours, theirs = pty.openpty()
    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(1) as pool:
        reader = pool.submit(all_of, ours)
        patch.setenv("COLUMNS", "90")
        patch.setenv("LINES", "40")
        with os.fdopen(theirs, "w", encoding="utf-8") as terminal:
            patch.setattr(sys, "stdout", terminal)
            code = main(list(argv))
        return code, reader.result().decode()


def all_of(terminal: int) -> bytes:
    """What is written to a terminal until its other end closes."""
    read = b""
    while True:
        try:
            data = os.read(terminal, 65536)
        except OSError:  # the other end has closed
            data = b""
        if not data:
            os.close(terminal)
            return read
        read += data


def test_replay_on_a_terminal_shows_instruments(flight: Path) -> None:
    log = flight / "flight.mcap"
    code, printed = on_a_terminal("replay", str(log), "--speed", "40", "--from", "10", "--to", "50")
    assert code == 0
    assert printed.count("\x1b[H") >= 4
    # The terminal is as it was, and the last moment stays on it.
    assert printed.index("\x1b[?1049h") < printed.index("\x1b[H") < printed.index("\x1b[?25h\x1b[?1049l")
    last = printed.rpartition("\x1b[?1049l")[2]
    assert "\x1b" not in last
    assert "50.0 of" in last
    assert "airspeed" in last
    code, printed = on_a_terminal("replay", str(log), "--at-once")
    assert "\x1b" not in printed
    assert "leg 0 to waypoint 1" in printed


def test_a_part_is_printed_as_in_the_whole(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


@pytest.mark.parametrize(
    ("to", "code"), [("14550", 2), ("1024", 2), ("65535", 2), ("1023", 0), ("65536", 0), ("14550.5", 0)]
)
def test_a_port_is_not_taken_for_a_time_in_silence(
    to: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_example_log(tmp_path / "a.mcap")
    assert main(["replay", str(log), "--to", to]) == code
    out = capsys.readouterr()
    if code:
        assert f"--to {to}: after the end of the log at" in out.err
        assert f"--to 127.0.0.1:{to}" in out.err
        assert out.out == ""
