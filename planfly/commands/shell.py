"""``planfly help``, ``planfly completion`` and ``planfly scenarios``."""

import argparse
import sys

from planfly.terminal.arguments import SHELLS, shell_script, with_completer
from planfly.terminal.command_parser import BAD_INPUT, FLYABLE, LineParser
from planfly.terminal.options import add_json_and_quiet_options
from planfly.terminal.output import write_json_if_requested
from planfly.terminal.schemas import commands_with_json, schema_text
from world.files import did_you_mean

# Help text on how to install the completion.
_COMPLETION_HELP = """\
to enable completion in this shell and in new ones:
  bash   eval "$(planfly completion bash)", in ~/.bashrc
  zsh    eval "$(planfly completion zsh)", in ~/.zshrc after compinit
  fish   planfly completion fish > ~/.config/fish/completions/planfly.fish"""

# ----------------------------------------------------------------------
# ``planfly completion``: the completion script of a shell.


def add_completion_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly completion``."""
    parser = command_line.add_command(
        "completion",
        "print a script that makes a shell complete planfly's commands, options and names",
        "planfly completion bash",
    )
    parser.extra_help = lambda: _COMPLETION_HELP
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help="bash, zsh or fish")


def completion(args: argparse.Namespace) -> int:
    """Print the completion script of a shell."""
    print(shell_script(args.shell))
    return FLYABLE


# ----------------------------------------------------------------------
# ``planfly help``: the help of a command, or the JSON schema of its answer.


def add_show_help_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly help``."""
    parser = command_line.add_command(
        "help", "show the help of a command, or list the commands", "planfly help fly", "planfly help fly --schema"
    )
    with_completer(
        parser.add_argument("topic", metavar="COMMAND", nargs="?", help="a command (default: all of them)"),
        lambda prefix, **_: [name for name in command_line.commands if name.startswith(prefix)],
    )
    parser.add_argument("--schema", action="store_true", help="print the JSON schema of the command's --json output")
    parser.set_defaults(command_line=command_line)


def show_help(args: argparse.Namespace) -> int:
    """Print the help of planfly or of one command, or a command's schema; return 2 for an unknown command."""
    line_parser: LineParser = args.command_line
    if args.topic is None:
        if args.schema:
            return _report_bad_usage("--schema: name a command, as in planfly help fly --schema")
        line_parser.print_help()
        return FLYABLE
    if args.topic not in line_parser.commands:
        return _report_bad_usage(f"{args.topic!r}: unknown command{did_you_mean(args.topic, line_parser.commands)}")
    if args.schema:
        if args.topic not in commands_with_json():
            return _report_bad_usage(
                f"--schema: {args.topic} has no --json; these have: {', '.join(commands_with_json())}"
            )
        print(schema_text(args.topic), end="")
        return FLYABLE
    line_parser.commands[args.topic].print_help()
    return FLYABLE


def _report_bad_usage(reason: str) -> int:
    """Print the reason why the usage is wrong, and return the exit code for bad input."""
    print(f"planfly help: {reason}", file=sys.stderr)
    return BAD_INPUT


# ----------------------------------------------------------------------
# ``planfly scenarios``: the built-in scenarios, one line each.


def add_scenarios_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly scenarios``."""
    parser = command_line.add_command("scenarios", "list the built-in scenarios, one line each", "planfly scenarios")
    add_json_and_quiet_options(parser.add_group("results"), "scenarios")


def scenarios(args: argparse.Namespace) -> int:
    """Print the name and description of each built-in scenario."""
    from planfly.api import planning

    descriptions = planning.scenarios()
    for name, description in descriptions.items():
        print(f"{name:<12} {description}")

    def json_answer() -> object:
        """Return the answer of ``planfly scenarios`` for --json."""
        from planfly.terminal.answers import ScenarioEntry, ScenariosAnswer

        entries = [ScenarioEntry(name=name, description=description) for name, description in descriptions.items()]
        return ScenariosAnswer(exit_code=FLYABLE, scenarios=entries)

    write_json_if_requested(args, json_answer)
    return FLYABLE
