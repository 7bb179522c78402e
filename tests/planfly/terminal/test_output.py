"""Standard output that outlives its reader: what is printed after it has gone is dropped, and no error is left."""

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


def test_input_that_is_refused_first_has_no_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="refused"), progress("flying"):
        raise ValueError("refused")
    assert capsys.readouterr().err == ""
