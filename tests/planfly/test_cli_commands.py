"""The list of commands is that of the parser, and each has its functions and its answer."""

from itertools import pairwise
from pathlib import Path

import pytest

import planfly.commands
from planfly.cli import COMMANDS, COMMANDS_BY_NAME, build_parser
from planfly.terminal.schemas import answer_schema, commands_with_json


def test_each_command_is_a_parser_and_a_function_of_one_module() -> None:
    assert list(build_parser().commands) == [command.name for command in COMMANDS]
    modules = {path.stem for path in Path(planfly.commands.__path__[0]).glob("*.py")} - {"__init__"}
    assert {f"planfly.commands.{module}" for module in modules} == {command.run.__module__ for command in COMMANDS}
    for command in COMMANDS:
        assert command.run.__module__ == command.add_parser.__module__
        assert (command.run.__doc__ or "").strip()


def test_what_is_no_command_is_none() -> None:
    for name in ("cli", "os", ""):
        with pytest.raises(KeyError):
            COMMANDS_BY_NAME[name]
    for name in ("serve", "land"):
        with pytest.raises(KeyError):
            answer_schema(name)


def test_a_command_answers_in_json_where_the_list_names_its_answer() -> None:
    line = build_parser()
    for command in COMMANDS:
        assert ("--json" in line.commands[command.name].long_options()) == (command.name in commands_with_json())


def test_help_lists_each_command_below_its_section() -> None:
    text = build_parser().format_help()
    for before, after in pairwise(COMMANDS):
        assert text.index(f"\n  {before.name} ") < text.index(f"\n  {after.name} ")
        assert text.index(f"\n{after.section}:\n") < text.index(f"\n  {after.name} ")
