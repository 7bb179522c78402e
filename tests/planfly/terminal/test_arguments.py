"""Texts of the command line as values: both ends of each range, and what lies just beyond."""

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from planfly.cli import COMMANDS
from planfly.terminal import arguments
from planfly.terminal.arguments import (
    SHELLS,
    complete_aircraft,
    complete_mission_or_scenario,
    complete_scenario,
    number_parser,
    shell_script,
)

TAKEN: list[tuple[Callable[[str], Any], str, Any]] = [
    (number_parser("seed"), "0", 0),
    (number_parser("seed"), "9223372036854775807", 2**63 - 1),
    (number_parser("refine"), "20", 20),
    (number_parser("max_hours"), "1e6", 1e6),
    (number_parser("max_hours"), "0.25", 0.25),
    (number_parser("served_speed"), "0.1", 0.1),
    (number_parser("served_speed"), "100", 100.0),
    (arguments.parse_wind, "40,-360", (40.0, -360.0)),
    (arguments.parse_wind, "0,360", (0.0, 360.0)),
    (number_parser("start"), "0", 0.0),
    (number_parser("start"), "1e7", 1e7),
    (arguments.parse_time_or_stations, "12.5", 12.5),
    (arguments.parse_time_or_stations, "127.0.0.1:14550", "127.0.0.1:14550"),
    (arguments.parse_budget, "4", (4, None)),
    (arguments.parse_budget, "2.5s", (None, 2.5)),
    (number_parser("at_leg"), "10000", 10_000),
    (arguments.parse_threat, "-5,6.5,0,300", (-5.0, 6.5, 0.0, 300.0)),
    (arguments.parse_problems, "60, 7,7", (7, 60)),
    (number_parser("runs"), "1000", 1000),
    (number_parser("port"), "65535", 65535),
    (number_parser("port"), "0", 0),
]

REFUSED: list[tuple[Callable[[str], Any], tuple[str, ...]]] = [
    (number_parser("seed"), ("-1", "9223372036854775808", "1.0", "")),
    (number_parser("refine"), ("21", "-1", "\u0663", "2.0")),
    (number_parser("max_hours"), ("0", "-1", "1000001", "nan", "inf", "ten")),
    (number_parser("served_speed"), ("0.09", "100.1", "nan")),
    (arguments.parse_wind, ("5", "5,6,7", "-1,0", "40.1,0", "5,361", "nan,0", "5,nan")),
    (number_parser("start"), ("-0.1", "10000001", "nan")),
    (arguments.parse_time_or_stations, ("-1", "soon")),
    (arguments.parse_budget, ("3", "10000000001", "0s", "nans", "-2s", "s", "1000001s")),
    (number_parser("at_leg"), ("-1", "10001", "1.5")),
    (arguments.parse_threat, ("1,2,3", "1,2,-3,4", "1,2,3,-4", "nan,2,3,4", "1,inf,3,4", "1,2,nan,4")),
    (arguments.parse_problems, ("8", "7,", "7,-15", "")),
    (number_parser("runs"), ("0", "1001", "-1", "2.5")),
    (number_parser("port"), ("65536", "-1", "80.0")),
]


@pytest.mark.parametrize(("take", "text", "value"), TAKEN)
def test_a_text_is_the_value_that_it_states(take: Callable[[str], Any], text: str, value: Any) -> None:
    assert take(text) == value


@pytest.mark.parametrize(("take", "text"), [(take, text) for take, texts in REFUSED for text in texts])
def test_what_lies_outside_is_refused_with_the_text_given(take: Callable[[str], Any], text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="expected") as caught:
        take(text)
    assert repr(text) in str(caught.value)


# ----------------------------------------------------------------------
# What a shell proposes: asked as bash asks, and by the words themselves.


def proposed(line: str, folder: Path) -> list[str]:
    """What planfly proposes for the end of a line, by the protocol of argcomplete's scripts."""
    told = folder / "told"
    environment = os.environ | {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(told),
        "_ARGCOMPLETE_SHELL": "bash",
    }
    told.write_text("", encoding="utf-8")
    subprocess.run([sys.executable, "-m", "planfly"], env=environment, cwd=folder, check=True)
    return [word.strip() for word in told.read_text(encoding="utf-8").split("\n")]


def test_commands_options_and_names(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("", encoding="utf-8")
    (tmp_path / "notes.txt").write_text("", encoding="utf-8")
    assert set(proposed("planfly ", tmp_path)) >= {command.name for command in COMMANDS}
    assert proposed("planfly sce", tmp_path) == ["scenarios"]
    assert {"--wind", "--turbulence", "--json"} <= set(proposed("planfly fly --", tmp_path))
    assert proposed("planfly run --tur", tmp_path) == ["--turbulence"]
    assert {"light", "moderate"} <= set(proposed("planfly run --turbulence ", tmp_path))
    names = proposed("planfly plan ", tmp_path)
    assert {"jacksboro", "tight", "mine.toml"} <= set(names)
    assert "notes.txt" not in names
    assert proposed("planfly run jack", tmp_path) == ["jacksboro", "jacksboro-air", "jacksboro-field"]
    assert proposed("planfly fly m.plan --aircraft aero", tmp_path) == ["aerosonde"]
    assert proposed("planfly help air", tmp_path) == ["aircraft"]


def test_asking_loads_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import os, sys\nfrom planfly.terminal.arguments import complete_scenario, complete_aircraft\n"
        "complete_scenario('')\ncomplete_aircraft('')\n"
        "print([name for name in ('numpy', 'numba', 'pydantic', 'rich') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout == "[]\n"


def test_words_begin_as_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert complete_scenario("stee") == ["steep"]
    assert complete_aircraft("c1") == ["c172x"]
    Path("tight.plan").write_text("", encoding="utf-8")
    assert complete_mission_or_scenario("tig") == ["tight", "tight.plan"]


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_takes_its_script(shell: str) -> None:
    script = shell_script(shell)
    assert "planfly" in script
    # A shell reads it without a fault, where there is one.
    if shutil.which(shell):
        done = subprocess.run([shell, "-n"], input=script, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")


def test_bash_completes_by_the_script(tmp_path: Path) -> None:
    program = tmp_path / "planfly"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m planfly "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    asked = (
        f'export PATH={tmp_path}:$PATH\neval "$(planfly completion bash)"\n'
        'COMP_LINE="planfly run jack" COMP_POINT=16 COMP_TYPE=9 COMP_WORDS=(planfly run jack) COMP_CWORD=2\n'
        '_python_argcomplete planfly jack run\necho "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.stdout.split() == ["jacksboro", "jacksboro-air", "jacksboro-field"], done.stderr
