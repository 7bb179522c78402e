"""Standard output that outlives its reader: what is printed after it has gone is dropped, and no error is left."""

import subprocess
import sys

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
