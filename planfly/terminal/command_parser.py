"""Parse the command line, and report bad usage in one line.

The intended option is suggested, and the help is grouped.
"""

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn, Protocol, TextIO

from world.errors import PlanflyError
from world.files import did_you_mean

if TYPE_CHECKING:
    from planfly import Verdict

# ----------------------------------------------------------------------
# Exit codes and their meaning.

# Help text on the exit codes.
EXIT_CODES = """\
exit codes: 0 flyable, or flown as planned
            1 internal or system error
            2 incorrect usage or invalid input; nothing is written, except the error in --json and --junit
            3 finished, but part of a log is unreadable, a campaign is undecided, or a flight is not judged in full
            4 not flyable, not flown as planned, or no feasible plan
            130 stopped by SIGINT (Ctrl-C), 143 by SIGTERM, within a second"""

FLYABLE = 0
FAULT = 1
BAD_INPUT = 2
INCOMPLETE = 3
NOT_FLYABLE = 4
# Interrupted by Ctrl-C.  By the convention of shells, this is 128 plus the number of the signal.
INTERRUPTED = 130


def verdict_code(verdict: "Verdict") -> int:
    """Return the exit code for a verdict: FLYABLE, NOT_FLYABLE, or INCOMPLETE if it is undecided."""
    if verdict.undecided:
        return INCOMPLETE
    return FLYABLE if verdict.flyable else NOT_FLYABLE


# ----------------------------------------------------------------------
# Colour text for terminals.  Colour is off if the stream is not a terminal, with NO_COLOR and with TERM=dumb, and it is
# on with FORCE_COLOR.

# Meaning of a colour.
Style = Literal["good", "bad", "warning", "hint"]
# Colours of ECMA-48, "select graphic rendition": green, red, yellow and cyan.
_STYLES: dict[Style, int] = {"good": 32, "bad": 31, "warning": 33, "hint": 36}
# Regular expression of the escape sequences that start and end a colour.
COLOUR_SEQUENCE = rf"\x1b\[(?:0|{'|'.join(map(str, _STYLES.values()))})m"
# Style of an answer by its state; an undecided answer is amber, not red.
STATE_STYLES: dict[str, Style] = {"ok": "good", "open": "warning", "fail": "bad"}


def wants_colour(stream: TextIO) -> bool:
    """Return True if a stream is shown in colour.

    NO_COLOR overrides FORCE_COLOR; empty environment variables are ignored.

    >>> import io
    >>> wants_colour(io.StringIO())
    False
    """
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return stream.isatty() and os.environ.get("TERM", "") != "dumb"


def colour_text(text: str, style: Style, stream: TextIO | None = None) -> str:
    """Return a text in a style if the stream is shown in colour, otherwise unchanged.

    stream: None for standard output.

    >>> colour_text("flyable", "good")
    'flyable'
    """
    if not wants_colour(stream if stream is not None else sys.stdout):
        return text
    return f"\x1b[{_STYLES[style]}m{text}\x1b[0m"


# Heading of a paragraph in a help text.
_HEADING = re.compile(r"^(\S[^\n]*:)(?=$| planfly)", re.MULTILINE)
# Option anywhere in a help text.
_OPTION_IN_TEXT = re.compile(r"(?<![\w/-])--?[a-z][a-z-]*")


def colour_help(text: str) -> str:
    r"""Add colours to a help text for a terminal; the words are not changed.

    >>> colour_help("usage: planfly fly [--at TIME]").split("\x1b")
    ['', '[33musage:', '[0m planfly fly [', '[36m--at', '[0m TIME]']
    """
    for pattern, code in ((_OPTION_IN_TEXT, _STYLES["hint"]), (_HEADING, _STYLES["warning"])):
        text = pattern.sub(f"\x1b[{code}m\\g<0>\x1b[0m", text)
    return text


# Options that only the terminal has; all others are keywords of the API.
_TERMINAL_OPTIONS = ("command", "json", "junit", "quiet")
# Comma-separated numbers that start with a negative number, which argparse would take for an option.
_NEGATIVE_NUMBERS = re.compile(r"-\.?\d[^=]*")
# Long option as one word.
_LONG_OPTION = re.compile(r"--[a-z][a-z-]*")


class OptionGroup(Protocol):
    """Parser, or group of a parser's options."""

    def add_argument(self, *names: str, **settings: Any) -> argparse.Action:
        """Add an option, as `argparse.ArgumentParser.add_argument` does."""


class UsageExit(SystemExit):
    """Exception that ends the process after bad usage.  line: the line that was printed."""

    def __init__(self, line: str) -> None:
        super().__init__(BAD_INPUT)
        self.line = line


class CommandParser(argparse.ArgumentParser):
    """Parser for one command, or for the whole command line."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self._aliases: dict[str, str] = {}
        # Text of the help between the examples and the exit codes; made when the help is printed.
        self.extra_help: Callable[[], str] = str

    def error(self, message: str) -> NoReturn:
        """Print a message on bad usage in one line, and exit with the code for bad input."""
        line = f"{self.prog}: {message} (see {self.prog} --help)"
        print(colour_text(line, "bad", sys.stderr), file=sys.stderr)
        raise UsageExit(line)

    def format_help(self) -> str:
        """Return the help text with the paragraph of `extra_help`."""
        epilog, extra_text = self.epilog, self.extra_help()
        if extra_text:
            self.epilog = (epilog or "").replace(EXIT_CODES, f"{extra_text}\n\n{EXIT_CODES}")
        text = super().format_help()
        self.epilog = epilog
        return colour_help(text) if wants_colour(sys.stdout) else text

    def add_group(self, title: str, description: str | None = None) -> OptionGroup:
        """Add a group of options, shown in the help under a title, and return the group."""
        return self.add_argument_group(title, description)

    def alias_keyword(self, keyword: str, option: str) -> None:
        """Set the option that error messages show in place of an API keyword.

        Call this for a keyword that differs from the option's dest.
        """
        self._aliases[keyword] = option

    def take_late_arguments(self, parsed: argparse.Namespace, unknown_arguments: list[str]) -> bool:
        """Store positional arguments that argparse left over, if a parameter can take them; return True if so.

        argparse itself accepts an optional positional argument only directly after the other positional arguments, not
        after an option.
        """
        for action in self._actions:
            if action.option_strings or any(argument.startswith("-") for argument in unknown_arguments):
                continue
            value = getattr(parsed, action.dest)
            if action.nargs == "+":
                setattr(parsed, action.dest, [*value, *unknown_arguments])
                return True
            if action.nargs == "?" and value == action.default and len(unknown_arguments) == 1:
                setattr(parsed, action.dest, unknown_arguments[0])
                return True
        return False

    def options_by_keyword(self) -> dict[str, str]:
        """Return a dictionary from API keywords to the options that set them, such as {"start": "--from"}."""
        options_by_dest = {action.dest: action.option_strings[-1] for action in self._actions if action.option_strings}
        return options_by_dest | self._aliases

    def long_options(self) -> list[str]:
        """Return the parser's options that begin with two dashes, without duplicates."""
        return list(dict.fromkeys(_LONG_OPTION.findall(self.format_usage())))


class LineParser(CommandParser):
    """Parser for the whole command line.  commands: the parsers for its commands, by name."""

    def __init__(self, version: str, description: str, example: str) -> None:
        super().__init__(
            prog="planfly",
            description=description,
            epilog=f"{example}\n\n{EXIT_CODES}",
        )
        self.add_argument("--version", action="version", version=f"planfly {version}")
        self.commands: dict[str, CommandParser] = {}
        self._sections: dict[str, argparse._ArgumentGroup] = {}
        self._section = ""
        # Without `prog`, argparse would format a help text to determine the name of the program.
        self._parsers = self.add_subparsers(
            dest="command",
            metavar="COMMAND",
            required=True,
            parser_class=CommandParser,
            prog="planfly",
        )
        # Remove argparse's list of commands, because the help shows them in sections.
        self._positionals._group_actions.clear()

    def start_section(self, title: str) -> None:
        """Start a titled section of the help; it lists the commands that are added next."""
        self._section = title

    def add_command(self, name: str, summary: str, *examples: str, extra: str = "", details: str = "") -> CommandParser:
        """Add the parser for a command, and return it.

        summary: one sentence on the command, without the escapes of argparse.
        examples: example command lines in its help.
        extra: the extra of planfly that the command needs, or "".
        details: further sentences of its help.
        """
        extra_note = f"  It requires the extra planfly[{extra}]." if extra else ""
        example_text = f"\n{' ' * len('example: ')}".join(examples)
        command_parser: CommandParser = self._parsers.add_parser(
            name,
            help=summary.replace("%", "%%"),
            description=f"{summary[0].upper()}{summary[1:]}.{details}{extra_note}",
            epilog=f"example: {example_text}\n\n{EXIT_CODES}",
        )
        self.commands[name] = command_parser
        if self._section not in self._sections:
            self._sections[self._section] = self.add_argument_group(self._section)
        # Entry for the command list that argparse has just made.
        self._sections[self._section]._group_actions.append(self._parsers._choices_actions[-1])
        return command_parser

    def parse_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        """Parse the command line. For bad usage, print one line with a suggestion and raise SystemExit.

        The attribute ``options`` of the result has the given options of the command as keywords of the API. An option
        that was not given (None) is left out, so that its keyword keeps the default.
        """
        arguments: list[str] = []
        for argument in sys.argv[1:] if args is None else args:
            # A negative number is joined to the option before it, as in --from=-33.9,18.4.
            if _NEGATIVE_NUMBERS.fullmatch(argument) and arguments and _LONG_OPTION.fullmatch(arguments[-1]):
                arguments[-1] += f"={argument}"
            else:
                arguments.append(argument)
        if arguments and not arguments[0].startswith("-") and arguments[0] not in self.commands:
            hint = did_you_mean(arguments[0], self.commands) or f"; the commands are {', '.join(self.commands)}"
            self.error(f"{arguments[0]!r}: unknown command{hint}")
        parsed, unknown_arguments = self.parse_known_args(arguments, namespace)
        parser = self.commands[parsed.command]
        if unknown_arguments and not parser.take_late_arguments(parsed, unknown_arguments):
            # Words after a -- are not options, even if they begin with a dash.
            arguments_after_dashes = arguments[arguments.index("--") :] if "--" in arguments else []
            option = next(
                (
                    argument
                    for argument in unknown_arguments
                    if argument.startswith("-") and argument not in arguments_after_dashes
                ),
                "",
            ).partition("=")[0]
            if option:
                parser.error(f"{option}: no such option{_similar_option_hint(option, parser.long_options())}")
            word = next((argument for argument in unknown_arguments if argument != "--"), unknown_arguments[0])
            is_file = Path(word).exists()
            parser.error(f"{word}: {'the command takes one file at a time' if is_file else 'no such argument'}")
        given_options = {name: value for name, value in vars(parsed).items() if value is not None}
        parsed.options = {name: value for name, value in given_options.items() if name not in _TERMINAL_OPTIONS}
        return parsed


# ----------------------------------------------------------------------
# Replace the API's keywords in errors by the matching options of the command line.

# Keyword in the text of an error: `keyword` or keyword=True.
_KEYWORD = re.compile(r"`(\w+)`|\b(\w+)=True\b")


def error_text(error: PlanflyError, parser: CommandParser) -> str:
    """Return the text of an error, with each API keyword replaced by the command-line option that sets it.

    >>> parser = CommandParser(prog="planfly replay")
    >>> _ = parser.add_argument("--from", dest="start")
    >>> _ = parser.add_argument("--overwrite", action="store_true")
    >>> error_text(PlanflyError.of_argument("start", 9.0, "the log ends at 4 s", file="a.mcap"), parser)
    'a.mcap: --from 9.0: the log ends at 4 s'
    >>> error_text(PlanflyError("a.gif: exists; overwrite=True replaces it", file="a.gif"), parser)
    'a.gif: exists; --overwrite replaces it'
    """
    options, text = parser.options_by_keyword(), str(error)
    # An error in a scenario that a keyword changed names the keyword as its file; a real file may have the same name.
    is_keyword = error.file in options and bool(error.field)
    prefix = f"{error.file}: " if error.file and not is_keyword else ""
    head = error.file if is_keyword else error.argument
    if head in options and text.startswith(prefix + head):
        text = prefix + options[head] + text[len(prefix + head) :]
    return _KEYWORD.sub(lambda match: options.get(match[1] or match[2], match[0]), text)


def _similar_option_hint(option: str, options: Iterable[str]) -> str:
    """Return the end of a message that suggests the option most similar to an unknown option.

    Return "" if none is similar.

    The leading dashes, which all options share, are not compared.

    >>> _similar_option_hint("--terain", ["--terrain", "--overwrite"])
    ": did you mean '--terrain'?"
    >>> _similar_option_hint("--terrain", ["--overwrite"])
    ''
    """
    text = did_you_mean(option.lstrip("-"), [name.lstrip("-") for name in options])
    return text.replace("did you mean '", "did you mean '--")
