"""Every command is found by its name, and none but the one that is given is loaded."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import planfly.commands
from planfly.commands.registry import COMMAND_NAMES, find_command

HELPERS = {"__init__", "registry"}
# Commands that share a module, or whose function has another name than the command.
ELSEWHERE = {
    "import": ("imported_logs", "import_log"),
    "refly": ("imported_logs", "refly"),
    "help": ("shell", "show_help"),
    "completion": ("shell", "completion"),
    "scenarios": ("shell", "scenarios"),
}


def test_the_commands_are_the_modules_of_their_folder() -> None:
    modules = {path.stem for path in Path(planfly.commands.__path__[0]).glob("*.py")} - HELPERS
    shared = {module for module, _ in ELSEWHERE.values()}
    assert sorted(COMMAND_NAMES) == sorted((modules - shared) | set(ELSEWHERE))
    for name in COMMAND_NAMES:
        command = find_command(name)
        module, function = ELSEWHERE.get(name, (name, name))
        assert (command.__module__, command.__name__) == (f"planfly.commands.{module}", function)


def test_what_is_no_command_is_not_imported() -> None:
    for name in ("registry", "os", ""):
        with pytest.raises(KeyError):
            find_command(name)


def test_a_command_loads_no_other() -> None:
    code = (
        "import json, sys; from planfly.commands.registry import find_command; find_command('scenarios'); "
        "print(json.dumps([name for name in sys.modules if name.startswith('planfly.commands.')]))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert sorted(json.loads(done.stdout)) == ["planfly.commands.registry", "planfly.commands.shell"]
