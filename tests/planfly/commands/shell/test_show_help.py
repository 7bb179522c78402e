"""``planfly help``: all commands, one, and its schema."""

import json
import subprocess
import sys

import pytest

from planfly.cli import main
from planfly.terminal.parser import build_parser

Output = pytest.CaptureFixture[str]


def test_it_says_what_help_says(capsys: Output) -> None:
    assert main(["help"]) == 0
    assert capsys.readouterr().out == build_parser().format_help()
    assert main(["help", "fly"]) == 0
    assert capsys.readouterr().out == build_parser().commands["fly"].format_help()


def test_the_schema_of_an_answer(capsys: Output) -> None:
    assert main(["help", "fly", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out)["properties"]["log"]["description"].startswith("The flight log")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("help flyy", "planfly help: 'flyy': no such command: did you mean 'fly'?\n"),
        ("help --schema", "planfly help: --schema: name a command"),
        ("help serve --schema", "planfly help: --schema: serve has no --json; these have: run, plan"),
    ],
)
def test_what_there_is_not_is_one_line(line: str, said: str, capsys: Output) -> None:
    assert main(line.split()) == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert out.err.startswith(said)
    assert out.err.count("\n") == 1


def test_it_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom planfly.cli import main\nmain(['help', 'run'])\n"
        "print([name for name in ('numpy', 'numba', 'pydantic', 'matplotlib', 'pymavlink') if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.endswith("[]\n")
