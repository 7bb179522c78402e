"""Whatever a command meets, the shell gets one line and the code that docs/commands.md states."""

import argparse
import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from planfly.cli import COMMANDS_BY_NAME, main
from planfly.terminal import output
from planfly.terminal.command_parser import UsageExit
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

    monkeypatch.setitem(COMMANDS_BY_NAME, "scenarios", SimpleNamespace(run=fail))
    assert main(["scenarios"]) == code
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", line)


WELL = """QGC WPL 110
0 1 0 16 0 0 0 0 46 8 0 1
1 0 3 16 0 0 0 0 46 8 100 1
2 0 3 16 0 0 0 0 46 8.01 100 1
"""


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["fly", "missing.waypoints"], "missing.waypoints: no such file"),
        (["check", "well.waypoints", "--terrain", "missing.tif"], "missing.tif"),
        (["check", "well.waypoints", "--wind", "3"], "argument --wind: '3': expected SPEED,FROM"),
        (["check", "well.waypoints", "--wnid", "3,4"], "--wnid: no such option: did you mean '--wind'?"),
        (["campaign", "missing.waypoints", "--out", "out"], "missing.waypoints"),
        (["winds", "missing.waypoints", "--directions", "3"], "argument --directions: '3'"),
        (["import", "missing.BIN", "flight.mcap"], "missing.BIN"),
    ],
)
def test_results_of_an_earlier_run_are_replaced_by_the_error(
    argv: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("r.json", "r.xml"):
        Path(name).write_text("of yesterday")
    Path("well.waypoints").write_text(WELL)
    outputs = ["--json", "r.json", "--junit", "r.xml"]
    # Without --overwrite the files are not this command's.
    assert code_of([*argv, *outputs]) == 2
    assert (Path("r.json").read_text(), Path("r.xml").read_text()) == ("of yesterday", "of yesterday")
    assert code_of([*argv, *outputs, "--overwrite"]) == 2
    answer = json.loads(Path("r.json").read_text())
    assert words in answer.pop("error")
    assert answer == {"schema": "planfly.error/1", "exit_code": 2}
    ((case,),) = ElementTree.parse("r.xml").getroot()
    assert [child.tag for child in case] == ["error"]


def test_an_error_is_the_answer_on_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "missing.waypoints", "--json", "-"]) == 2
    assert json.loads(capsys.readouterr().out)["exit_code"] == 2


def test_an_error_of_planfly_itself_is_in_both_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The traceback stays; the exit code of an uncaught exception is 1."""

    def fail(_args: argparse.Namespace) -> int:
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setitem(COMMANDS_BY_NAME, "fly", SimpleNamespace(run=fail))
    answer, cases = tmp_path / "r.json", tmp_path / "r.xml"
    with pytest.raises(ZeroDivisionError):
        main(["fly", "well.waypoints", "--json", str(answer), "--junit", str(cases)])
    text = "internal error: ZeroDivisionError: float division by zero"
    assert json.loads(answer.read_text()) == {"schema": "planfly.error/1", "exit_code": 1, "error": text}
    ((case,),) = ElementTree.parse(cases).getroot()
    assert [(child.tag, child.get("message")) for child in case] == [("error", text)]


def test_an_old_result_that_cannot_be_replaced_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: Path, _data: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(output, "write_atomically", fail)
    old = tmp_path / "r.json"
    old.write_text("of yesterday")
    assert main(["check", "missing.waypoints", "--json", str(old), "--overwrite"]) == 2
    assert not old.exists()


@pytest.mark.parametrize(
    "argv",
    [
        ["fly", "well.waypoints", "--json", "r", "--junit", "./r"],
        ["check", "well.waypoints", "--json", "r", "--junit", "r"],
        ["campaign", "well.waypoints", "--json", "r", "--junit", "r"],
        ["fly", "well.waypoints", "--log", "r.mcap", "--json", "r.mcap"],
        ["import", "a.BIN", "r.mcap", "--junit", "r.mcap"],
        ["plan", "tight", "--out", "plan.json", "--json", "plan.json"],
        ["export", "well.waypoints", "r.plan", "--json", "r.plan"],
        ["fly", "well.waypoints", "--json", "well.waypoints"],
    ],
)
def test_two_outputs_are_two_files(
    argv: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("well.waypoints").write_text(WELL)
    assert main([*argv, "--overwrite"]) == 2
    assert "is already named by another argument; name another file for --" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["well.waypoints"]
    assert Path("well.waypoints").read_text() == WELL


def test_bad_usage_leaves_a_file_that_another_argument_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("well.waypoints").write_text(WELL)
    assert code_of(["fly", "well.waypoints", "--json", "well.waypoints", "--overwrite", "--wind", "3"]) == 2
    assert Path("well.waypoints").read_text() == WELL


def code_of(argv: list[str]) -> int:
    """The exit code, also of usage that argparse refuses."""
    try:
        return main(argv)
    except UsageExit:
        return 2


def test_a_fault_of_our_own_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_args: argparse.Namespace) -> int:
        raise ZeroDivisionError

    monkeypatch.setitem(COMMANDS_BY_NAME, "scenarios", SimpleNamespace(run=fail))
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

    monkeypatch.setitem(COMMANDS_BY_NAME, "scenarios", SimpleNamespace(run=fail))
    assert main(["scenarios"]) == 1
    assert capsys.readouterr().err == f"planfly: not enough memory{told}\n"


def test_the_commands_own_code_is_the_process_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[str] = []

    def run(args: argparse.Namespace) -> int:
        taken.append(args.what)
        return 4

    monkeypatch.setitem(COMMANDS_BY_NAME, "check", SimpleNamespace(run=run))
    assert main(["check", "m.plan"]) == 4
    assert taken == ["m.plan"]


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
