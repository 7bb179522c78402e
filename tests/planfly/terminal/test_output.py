"""Standard output that outlives its reader: what is printed after it has gone is dropped, and no error is left."""

import argparse
import contextlib
import io
import json
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from planfly.terminal import output
from planfly.terminal.command_parser import colour_text
from planfly.terminal.output import progress
from tests.soak import only_in_soak

CODE = """
import sys
from planfly.terminal.output import safe_streams
with safe_streams():
    print("first", flush=True)
    sys.stdin.readline()
    for number in range(100_000):
        print("line", number)
sys.exit(4)
"""


def test_the_exit_code_survives_a_reader_that_leaves() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", CODE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline() == "first\n"
    process.stdout.close()
    process.stdin.write("go on\n")
    process.stdin.close()
    errors = process.stderr.read()
    process.stderr.close()
    assert process.wait(60.0) == 4
    assert errors == ""


@only_in_soak
def test_a_reader_that_stays_gets_every_line() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], input="go on\n", capture_output=True, text=True, check=False)
    assert done.returncode == 4
    assert done.stdout.splitlines() == ["first", *(f"line {number}" for number in range(100_000))]


# ----------------------------------------------------------------------
# Control characters of foreign files.

# Clears the screen, sets a title, rings, reverses, and begins a colour by its 8-bit code.
HOSTILE = "\x1b[2J\x1b]0;x\x07\r\b\x7f\x9b31m\u202eevil\u2028\x00"
ESCAPED = r"\x1b[2J\x1b]0;x\x07\r\x08\x7f\x9b31m\u202eevil\u2028\x00"


def test_no_control_character_is_printed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    with output.safe_streams():
        print(f"21 °C\t{HOSTILE}\nend \x1b[31m")
        print(HOSTILE, file=sys.stderr)
    printed = capsys.readouterr()
    assert printed.out == f"21 °C\t{ESCAPED}\nend \\x1b[31m\n"
    assert printed.err == f"{ESCAPED}\n"


def test_colours_of_planfly_are_kept(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.delenv("NO_COLOR", raising=False)
    with output.safe_streams():
        print(colour_text("flyable", "good") + "\x1b[2J\x1b[8m")
    assert capsys.readouterr().out == "\x1b[32mflyable\x1b[0m\\x1b[2J\\x1b[8m\n"


def test_an_answer_on_standard_output_stays_json(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = argparse.Namespace(json="-", quiet=False, command="test")
    with output.safe_streams(), output.redirect_output(arguments):
        output.write_json_if_requested(arguments, lambda: json.dumps({"title": HOSTILE}, ensure_ascii=False) + "\n")
    text = capsys.readouterr().out
    assert json.loads(text) == {"title": HOSTILE}
    assert text[:-1].isprintable()


def test_a_progress_bar_has_no_control_characters_of_titles(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(shown, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", shown)
    with output.safe_streams(), progress("flying \x1b[2J") as advance:
        advance(1.0, 4.0, "\x1b]0;x\x07")
    text = shown.getvalue()
    assert "flying \\x1b[2J" in text
    assert not {"\x1b", "\x07"} & set(text)


# ----------------------------------------------------------------------
# Progress on standard error: plain lines where no terminal is, and none for work that never begins.


def test_a_line_when_work_begins_and_one_when_it_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("flying") as advance:
        assert capsys.readouterr().err == ""
        advance(1.0, 4.0, "1 of 4 km")
        assert capsys.readouterr().err == "flying ... (1 of 4 km, no estimate yet)\n"
        advance(4.0, 4.0, "4 of 4 km")
        assert capsys.readouterr().err == ""
    printed = capsys.readouterr()
    assert re.fullmatch(r"flying: done in \d+\.\d s: 4 of 4 km\n", printed.err)
    assert printed.out == ""


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr("planfly.terminal.output.time.monotonic", lambda: self.now)


def test_how_long_it_will_still_take_is_told_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """2 s after the first report, then at four times that, then once a minute; what went before it does not count."""
    clock = Clock(monkeypatch)
    clock.now -= 900.0
    said = []
    with progress("flying") as advance:
        for second in range(201):
            clock.now = 100.0 + second
            advance(second, 200.0, f"{second} flights")
            said += [(second, line) for line in capsys.readouterr().err.splitlines()]
    assert said == [
        (0, "flying ... (0 flights, no estimate yet)"),
        (2, "flying: 2 flights, 3 min left"),
        (8, "flying: 8 flights, 3 min left"),
        (32, "flying: 32 flights, 3 min left"),
        (92, "flying: 92 flights, 108 s left"),
        (152, "flying: 152 flights, 48 s left"),
    ]
    assert capsys.readouterr().err == "flying: done in 1100.0 s: 200 flights\n"


def test_an_estimate_of_the_works_own_goes_before(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = Clock(monkeypatch)
    with progress("flying") as advance:
        advance(0.0, 0.0, "")
        clock.now += 50.0
        advance(50.0, 100.0, "50 flights, 7 s left at least")
        # Nobody knows how much there is.
        clock.now += 50.0
        advance(70.0, 0.0, "a fresh one")
    told = capsys.readouterr().err.splitlines()
    assert told == [
        "flying ... (no estimate)",
        "flying: 50 flights, 7 s left at least",
        "flying: done in 100.0 s: a fresh one",
    ]


def test_a_bar_has_the_estimate_from_the_second_report(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, terminal = Clock(monkeypatch), io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", terminal)
    with progress("flying") as advance:
        assert "0 %, no estimate, 0 s so far" in terminal.getvalue()
        advance(0.0, 10.0, "0 of 10 km")
        assert terminal.getvalue().rstrip().endswith("0 %, 0 of 10 km, no estimate yet")
        clock.now += 1.0
        advance(1.0, 10.0, "1 of 10 km")
        assert "10 %, 1 of 10 km, 9 s left" in terminal.getvalue()
        advance(1.0, 0.0, "nobody knows")
        assert terminal.getvalue().rstrip().endswith("10 %, nobody knows")


def test_input_that_is_refused_first_has_no_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="refused"), progress("flying"):
        raise ValueError("refused")
    assert capsys.readouterr().err == ""


# ----------------------------------------------------------------------
# Before anything is measured: what such a stage took the last time on this machine.

REMEMBER = output._write_duration


@pytest.fixture
def times(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The file of what stages took, which is not there yet."""
    file = tmp_path / "cache" / "durations.json"
    monkeypatch.setattr(output, "_durations_file", lambda: file)
    monkeypatch.setattr(output, "_write_duration", REMEMBER)
    return file


def run(clock: Clock, title: str, kind: str, units: int, seconds: float) -> None:
    with progress(title, kind) as advance:
        # Kernels are loaded first.
        clock.now += 7.0
        for done in range(units + 1):
            advance(float(done), float(units), "")
            clock.now += seconds if done < units else 0.0


def test_a_first_estimate_is_the_last_ones_pace(
    times: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """20 units of 0.5 s each were counted: 60 of another of this kind are about 30 s; other kinds are unknown."""
    clock = Clock(monkeypatch)
    run(clock, "planning a", "planning", 20, 0.5)
    assert capsys.readouterr().err.splitlines()[0] == "planning a ... (no estimate yet)"
    run(clock, "planning b", "planning", 60, 1.0)
    assert capsys.readouterr().err.splitlines()[0] == "planning b ... (about 30 s, at the rate of the last run)"
    run(clock, "planning c", "planning", 60, 1.0)
    assert capsys.readouterr().err.splitlines()[0] == "planning c ... (about 60 s, at the rate of the last run)"
    with progress("flying") as advance:
        advance(0.0, 60.0, "")
    assert capsys.readouterr().err.splitlines()[0] == "flying ... (no estimate yet)"


def test_work_that_counted_nothing_the_last_time_is_said_to_take_as_long(
    times: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A search that finds its path among its seeds has no generations."""
    clock = Clock(monkeypatch)
    run(clock, "planning", "planning", 0, 0.5)
    run(clock, "planning", "planning", 20, 0.5)
    assert capsys.readouterr().err.splitlines()[2] == "planning ... (the last run took 7 s)"


def test_what_failed_or_had_a_stage_within_is_no_measure(times: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    with contextlib.suppress(ValueError), progress("planning") as advance:
        advance(0.0, 10.0, "")
        clock.now += 1.0
        advance(1.0, 10.0, "")
        raise ValueError("refused")
    assert not times.exists()
    with progress("planning"):
        run(clock, "compiling", "compiling", 2, 30.0)
    assert list(json.loads(times.read_text())) == ["compiling"]


@pytest.mark.parametrize(
    "text",
    ["", "[]", "nonsense", '{"flying": 3}', '{"flying": [1, "x"]}', '{"flying": [NaN, 1]}', "{" + " " * 20_000 + "}"],
)
def test_a_damaged_file_of_times_is_none(
    text: str, times: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    times.parent.mkdir()
    times.write_text(text)
    run(Clock(monkeypatch), "flying", "flying", 2, 1.0)
    assert capsys.readouterr().err.splitlines()[0] == "flying ... (no estimate yet)"
    assert json.loads(times.read_text())["flying"] == [1.0, 9.0]


def test_no_place_to_remember_is_no_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(output, "_write_duration", REMEMBER)
    monkeypatch.setattr(output, "_durations_file", lambda: tmp_path / "file" / "durations.json")
    run(Clock(monkeypatch), "flying", "flying", 2, 1.0)


def test_a_stage_that_reports_nothing_is_named_and_timed(
    times: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """After the first second, and each minute after; the next one says what this one took."""
    clock, lines = Clock(monkeypatch), []
    for _ in range(2):
        left = output._TimeLeft("drawing a map")
        shown = output._Lines("drawing", left)
        with shown:
            for _ in range(130):
                clock.now += 1.0
                shown.refresh()
        left.store_duration()
        lines.append(capsys.readouterr().err.splitlines())
    told = ["drawing: 61 s so far", "drawing: 121 s so far", "drawing: done in 130.0 s"]
    assert lines == [["drawing ... (no estimate)", *told], ["drawing ... (the last run took 2 min)", *told]]


def test_what_is_counted_late_has_its_estimate_then(
    times: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = Clock(monkeypatch)
    run(clock, "flying", "flying", 2, 3.0)
    capsys.readouterr()
    shown = output._Lines("flying", output._TimeLeft("flying"))
    shown.refresh()
    shown.advance(0.0, 4.0, "0 of 4 flights")
    shown.advance(0.0, 4.0, "0 of 4 flights")
    assert capsys.readouterr().err.splitlines() == [
        "flying ... (the last run took 13 s)",
        "flying: 0 of 4 flights, about 12 s, at the rate of the last run",
    ]


def test_the_clock_is_looked_at_whatever_the_work_is_at(monkeypatch: pytest.MonkeyPatch) -> None:
    said, heard = list[str](), threading.Event()

    def say(line: str) -> None:
        said.append(line)
        heard.set()

    monkeypatch.setattr(output, "_REFRESH_INTERVAL_S", 0.001)
    monkeypatch.setattr(output, "_print_line", say)
    with progress("drawing"):
        assert heard.wait(60.0)
    assert said[0] == "drawing ... (no estimate)"
