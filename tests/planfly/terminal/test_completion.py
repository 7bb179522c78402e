"""What a shell proposes: asked as bash asks, and by the words themselves."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from planfly.commands.registry import COMMAND_NAMES
from planfly.terminal.completion import SHELLS, aircraft_words, mission_or_scenario_words, scenario_words, shell_script


def proposed(line: str, folder: Path) -> list[str]:
    """What planfly proposes for the end of a line, by the protocol of argcomplete's scripts."""
    told = folder / "told"
    environment = os.environ | {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line, "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9", "_ARGCOMPLETE_STDOUT_FILENAME": str(told), "_ARGCOMPLETE_SHELL": "bash",
    }  # fmt: skip
    told.write_text("", encoding="utf-8")
    subprocess.run([sys.executable, "-m", "planfly"], env=environment, cwd=folder, check=True)
    return [word.strip() for word in told.read_text(encoding="utf-8").split("\n")]


def test_commands_options_and_names(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("", encoding="utf-8")
    (tmp_path / "notes.txt").write_text("", encoding="utf-8")
    assert set(proposed("planfly ", tmp_path)) >= set(COMMAND_NAMES)
    assert proposed("planfly sce", tmp_path) == ["scenarios"]
    assert {"--wind", "--turbulence", "--json"} <= set(proposed("planfly fly --", tmp_path))
    assert proposed("planfly run --tur", tmp_path) == ["--turbulence"]
    assert {"light", "moderate"} <= set(proposed("planfly run --turbulence ", tmp_path))
    names = proposed("planfly plan ", tmp_path)
    assert {"jacksboro", "tight", "mine.toml"} <= set(names)
    assert "notes.txt" not in names
    assert proposed("planfly run jack", tmp_path) == ["jacksboro"]
    assert proposed("planfly fly m.plan --aircraft aero", tmp_path) == ["aerosonde"]
    assert proposed("planfly help air", tmp_path) == ["aircraft"]


def test_asking_loads_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import os, sys\nfrom planfly.terminal.completion import scenario_words, aircraft_words\n"
        "scenario_words('')\naircraft_words('')\n"
        "print([name for name in ('numpy', 'numba', 'pydantic', 'rich') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout == "[]\n"


def test_words_begin_as_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert scenario_words("stee") == ["steep"]
    assert aircraft_words("c1") == ["c172x"]
    Path("tight.plan").write_text("", encoding="utf-8")
    assert mission_or_scenario_words("tig") == ["tight", "tight.plan"]


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
    assert done.stdout.split() == ["jacksboro"], done.stderr
