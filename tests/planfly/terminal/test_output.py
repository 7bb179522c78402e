"""Standard output that outlives its reader: what is printed after it has gone is dropped, and no error is left."""

import io
import re
import subprocess
import sys

import pytest

from planfly.terminal.output import progress

CODE = """
import sys
from planfly.terminal.output import tolerate_closed_output
with tolerate_closed_output():
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


def test_a_reader_that_stays_gets_every_line() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], input="go on\n", capture_output=True, text=True, check=False)
    assert done.returncode == 4
    assert done.stdout.splitlines() == ["first", *(f"line {number}" for number in range(100_000))]


# ----------------------------------------------------------------------
# Progress on standard error: plain lines where no terminal is, and none for work that never begins.


def test_a_line_when_work_begins_and_one_when_it_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("flying") as advance:
        assert capsys.readouterr().err == ""
        advance(1.0, 4.0, "1 of 4 km")
        assert capsys.readouterr().err == "flying ...\n"
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
        (0, "flying ..."),
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
    assert told == ["flying ...", "flying: 50 flights, 7 s left at least", "flying: done in 100.0 s: a fresh one"]


def test_a_bar_has_the_estimate_from_the_second_report(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, terminal = Clock(monkeypatch), io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", terminal)
    with progress("flying") as advance:
        advance(0.0, 10.0, "0 of 10 km")
        clock.now += 1.0
        advance(1.0, 10.0, "1 of 10 km")
        assert "10 %, 1 of 10 km, 9 s left" in terminal.getvalue()
        advance(1.0, 0.0, "nobody knows")
        assert terminal.getvalue().rstrip().endswith("10 %, nobody knows")


def test_input_that_is_refused_first_has_no_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="refused"), progress("flying"):
        raise ValueError("refused")
    assert capsys.readouterr().err == ""
