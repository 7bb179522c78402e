"""Whatever a command meets, the shell gets one line and the code that docs/commands.md states."""

import argparse
import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from planfly import cli
from planfly.cli import main
from world.errors import ScenarioError


@pytest.mark.parametrize(
    ("met", "code", "line"),
    [
        (ScenarioError("bad.toml:\n  start: missing"), 2, "planfly: bad.toml: start: missing\n"),
        (
            OSError(errno.ENOSPC, "No space left on device", "out.mcap"),
            1,
            "planfly: out.mcap: No space left on device\n",
        ),
        (OSError("no reason"), 1, "planfly: file: no reason\n"),
        (KeyboardInterrupt(), 130, "planfly: interrupted\n"),
    ],
)
def test_an_error_is_one_line_and_its_code(
    met: BaseException, code: int, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_args: argparse.Namespace) -> int:
        raise met

    monkeypatch.setattr(cli, "find_command", lambda _: fail)
    assert main(["scenarios"]) == code
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", line)


def test_a_fault_of_our_own_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_args: argparse.Namespace) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr(cli, "find_command", lambda _: fail)
    with pytest.raises(ZeroDivisionError):
        main(["scenarios"])


@pytest.mark.parametrize(
    ("said", "told"), [("std::bad_alloc", ""), ("", ""), ("Unable to allocate 9 GiB", ": Unable to allocate 9 GiB")]
)
def test_too_little_memory_is_one_line(
    said: str, told: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> int:
        raise MemoryError(*([said] if said else []))

    monkeypatch.setattr("planfly.cli.find_command", lambda _name: fail)
    assert main(["scenarios"]) == 1
    assert capsys.readouterr().err == f"planfly: too little memory{told}\n"


def test_the_commands_own_code_is_the_process_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[str] = []

    def find(name: str) -> Callable[[argparse.Namespace], int]:
        taken.append(name)
        return lambda _args: 4

    monkeypatch.setattr(cli, "find_command", find)
    assert main(["check", "m.plan"]) == 4
    assert taken == ["check"]


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom planfly.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit as stop:\n"
        "    print('code', stop.code, [name for name in ('numpy', 'numba', 'pydantic') if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.endswith("code 0 []\n")


@pytest.mark.parametrize(("number", "code"), [(errno.EMFILE, 1), (errno.EIO, 1), (errno.ENOENT, 2), (errno.EACCES, 2)])
def test_a_file_that_the_machine_cannot_read_is_no_bad_input(
    number: int, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    (tmp_path / "a.waypoints").write_text("QGC WPL 110", encoding="ascii")
    monkeypatch.setattr("world.files.read_at_most", fail)
    assert main(["check", str(tmp_path / "a.waypoints")]) == code
    (said,) = capsys.readouterr().err.splitlines()
    assert said.endswith(f"a.waypoints: cannot be read: {os.strerror(number)}")
