"""``planfly completion``: a script a shell, and no other."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import world
from planfly.cli import build_parser, main


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_script_for_each_shell(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    out = capsys.readouterr()
    assert "_ARGCOMPLETE" in out.out
    assert out.err == ""


def test_another_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["completion", "tcsh"])
    assert stopped.value.code == 2
    assert "bash" in capsys.readouterr().err


# ----------------------------------------------------------------------
# ``planfly help``: all commands, one, and its schema.

Output = pytest.CaptureFixture[str]


def test_it_says_what_help_says(capsys: Output) -> None:
    assert main(["help"]) == 0
    assert capsys.readouterr().out == build_parser().format_help()
    assert main(["help", "fly"]) == 0
    assert capsys.readouterr().out == build_parser().commands["fly"].format_help()


def test_the_schema_of_an_answer(capsys: Output) -> None:
    assert main(["help", "fly", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out)["properties"]["log"]["description"].startswith("Flight log")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("help flyy", "planfly help: 'flyy': unknown command: did you mean 'fly'?\n"),
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


# ----------------------------------------------------------------------
# ``planfly scenarios``: a line for each scenario file that is embedded.

FILES = sorted((Path(world.__path__[0]) / "scenarios").glob("*.toml"))


def test_every_embedded_file_has_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    lines = capsys.readouterr().out.splitlines()
    described = {line.split(maxsplit=1)[0]: line.split(maxsplit=1)[1] for line in lines}
    wanted = {}
    for file in FILES:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
        wanted[table["name"]] = table["description"]
    assert len(wanted) >= 4
    assert described == wanted
