"""``planfly help``, ``planfly completion`` and ``planfly scenarios``."""

import argparse
import sys

from planfly.terminal.answers.giving import give_answer
from planfly.terminal.arguments import shell_script
from planfly.terminal.exit_codes import BAD_INPUT, FLYABLE
from planfly.terminal.parser import build_parser
from world.files import did_you_mean
from world.scenario import embedded_scenarios

# ----------------------------------------------------------------------
# ``planfly completion``: the script by which a shell completes.


def completion(args: argparse.Namespace) -> int:
    """Print the script of a shell."""
    print(shell_script(args.shell))
    return FLYABLE


# ----------------------------------------------------------------------
# ``planfly help``: what a command does, or the JSON schema of its answer.


def show_help(args: argparse.Namespace) -> int:
    """Print the help of a command, of all, or a schema; 2 for a command that there is not."""
    line = build_parser()
    if args.topic is None:
        if args.schema:
            return _refuse("--schema: name a command, as in planfly help fly --schema")
        line.print_help()
        return FLYABLE
    if args.topic not in line.commands:
        return _refuse(f"{args.topic!r}: no such command{did_you_mean(args.topic, line.commands)}")
    if args.schema:
        from planfly.terminal.answers.giving import ANSWERS, schema_text

        if args.topic not in ANSWERS:
            return _refuse(f"--schema: {args.topic} has no --json; these have: {', '.join(ANSWERS)}")
        print(schema_text(args.topic), end="")
        return FLYABLE
    line.commands[args.topic].print_help()
    return FLYABLE


def _refuse(why: str) -> int:
    print(f"planfly help: {why}", file=sys.stderr)
    return BAD_INPUT


# ----------------------------------------------------------------------
# ``planfly scenarios``: the embedded scenarios, one line each.


def scenarios(args: argparse.Namespace) -> int:
    """Name and description of each embedded scenario, on standard output."""
    known = embedded_scenarios()
    for name, spec in known.items():
        print(f"{name:<12} {spec.description}")

    def answer() -> object:
        from planfly.terminal.answers.answer_data import ScenarioEntry, ScenariosAnswer

        entries = [ScenarioEntry(name=name, description=spec.description) for name, spec in known.items()]
        return ScenariosAnswer(exit_code=FLYABLE, scenarios=entries)

    give_answer(args, answer)
    return FLYABLE
