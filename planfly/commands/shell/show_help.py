"""``planfly help``: what a command does, or the JSON schema of its answer."""

import argparse
import sys

from planfly.terminal.exit_codes import BAD_INPUT, FLYABLE
from planfly.terminal.parser import build_parser
from world.text_files import did_you_mean


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
        from planfly.terminal.answers.schemas import ANSWERS, schema_text

        if args.topic not in ANSWERS:
            return _refuse(f"--schema: {args.topic} has no --json; these have: {', '.join(ANSWERS)}")
        print(schema_text(args.topic), end="")
        return FLYABLE
    line.commands[args.topic].print_help()
    return FLYABLE


def _refuse(why: str) -> int:
    print(f"planfly help: {why}", file=sys.stderr)
    return BAD_INPUT
