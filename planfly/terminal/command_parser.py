"""A parser that answers bad usage in a line, names the option that was meant, and lays its help out in groups."""

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any, Literal, NoReturn, Protocol, TextIO

from planfly.terminal.exit_codes import BAD_INPUT, EXIT_CODES
from world.errors import PlanflyError
from world.files import did_you_mean

# ----------------------------------------------------------------------
# Colour where a terminal wants it: a terminal that is none, NO_COLOR and TERM=dumb want none, FORCE_COLOR wants it.

Style = Literal["good", "bad", "warning", "hint"]
# Colours of ECMA-48, "select graphic rendition": green, red, yellow and cyan.
_STYLES: dict[Style, int] = {"good": 32, "bad": 31, "warning": 33, "hint": 36}


def wants_colour(stream: TextIO) -> bool:
    """Return True if a stream is shown in colour.  NO_COLOR precedes FORCE_COLOR; empty ones are ignored.

    >>> import io
    >>> wants_colour(io.StringIO())
    False
    """
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return stream.isatty() and os.environ.get("TERM", "") != "dumb"


def coloured(text: str, style: Style, stream: TextIO | None = None) -> str:
    """Return a text as a stream, standard output if None, is to get it.

    >>> coloured("flyable", "good")
    'flyable'
    """
    if not wants_colour(stream if stream is not None else sys.stdout):
        return text
    return f"\x1b[{_STYLES[style]}m{text}\x1b[0m"


# In a help: what stands above a paragraph, and options, wherever they stand.
_HEADING = re.compile(r"^(\S[^\n]*:)(?=$| planfly)", re.MULTILINE)
_NAMED = re.compile(r"(?<![\w/-])--?[a-z][a-z-]*")


def coloured_help(text: str) -> str:
    r"""Return a help as a terminal that wants colour gets it; the text is the same.

    >>> coloured_help("usage: planfly fly [--at TIME]").split("\x1b")
    ['', '[33musage:', '[0m planfly fly [', '[36m--at', '[0m TIME]']
    """
    for pattern, code in ((_NAMED, _STYLES["hint"]), (_HEADING, _STYLES["warning"])):
        text = pattern.sub(f"\x1b[{code}m\\g<0>\x1b[0m", text)
    return text


_OPTION = re.compile(r"--[a-z][a-z-]*")


class OptionTaker(Protocol):
    """A parser, or a group of its options."""

    def add_argument(self, *names: str, **settings: Any) -> argparse.Action:
        """Take an option."""


class CommandParser(argparse.ArgumentParser):
    """A parser of one command, or of the whole line."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self._aliases: dict[str, str] = {}
        # What the help says between the examples and the exit codes; made when it is printed.
        self.more: Callable[[], str] = str

    def error(self, message: str) -> NoReturn:
        """One line, as for every other bad input."""
        line = f"{self.prog}: {message} (see {self.prog} --help)"
        self.exit(BAD_INPUT, coloured(line, "bad", sys.stderr) + "\n")

    def format_help(self) -> str:
        """Return the help, with what is made for it alone."""
        epilog, more = self.epilog, self.more()
        if more:
            self.epilog = (epilog or "").replace(EXIT_CODES, f"{more}\n\n{EXIT_CODES}")
        text = super().format_help()
        self.epilog = epilog
        return coloured_help(text) if wants_colour(sys.stdout) else text

    def group(self, title: str, description: str | None = None) -> OptionTaker:
        """Return options that stand together in the help, under a title."""
        return self.add_argument_group(title, description)

    def alias(self, keyword: str, option: str) -> None:
        """State that an option also stands for a keyword of the API that is not its destination."""
        self._aliases[keyword] = option

    def keywords(self) -> dict[str, str]:
        """Return the option that states each keyword of the API."""
        named = {action.dest: action.option_strings[-1] for action in self._actions if action.option_strings}
        return named | self._aliases

    def options(self) -> list[str]:
        """Return the long options that it takes."""
        return list(dict.fromkeys(_OPTION.findall(self.format_usage())))


class LineParser(CommandParser):
    """The parser of the whole line.  commands: those of its commands, by name."""

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
        # prog is named: to find it out argparse would lay out a help.
        self._parsers = self.add_subparsers(
            dest="command",
            metavar="COMMAND",
            required=True,
            parser_class=CommandParser,
            prog="planfly",
        )
        # Shown in sections instead.
        self._positionals._group_actions.clear()

    def section(self, title: str) -> None:
        """Have the commands that follow listed below a title."""
        self._section = title

    def command(self, name: str, summary: str, *examples: str, extra: str = "", more: str = "") -> CommandParser:
        """Make the parser of a command.

        summary: what it does.  examples: lines of its help.  extra: of planfly, which it needs; "" for none.
        more: sentences after the first, of its own help.
        """
        needs = f"  It needs the extra planfly[{extra}]." if extra else ""
        shown = f"\n{' ' * len('example: ')}".join(examples)
        made: CommandParser = self._parsers.add_parser(
            name,
            help=summary,
            description=f"{summary[0].upper()}{summary[1:]}.{more}{needs}",
            epilog=f"example: {shown}\n\n{EXIT_CODES}",
        )
        self.commands[name] = made
        if self._section not in self._sections:
            self._sections[self._section] = self.add_argument_group(self._section)
        # The line of the list of commands that argparse has just made.
        self._sections[self._section]._group_actions.append(self._parsers._choices_actions[-1])
        return made

    def parse_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        """Return the arguments by name; for bad usage one line that names what may have been meant, and SystemExit."""
        words = _with_negatives(sys.argv[1:] if args is None else list(args))
        if words and not words[0].startswith("-") and words[0] not in self.commands:
            there = did_you_mean(words[0], self.commands) or f"; there are {', '.join(self.commands)}"
            self.error(f"{words[0]!r}: no such command{there}")
        parsed, left = self.parse_known_args(words, namespace)
        if left:
            parser = self.commands[parsed.command]
            # What follows a -- is no option, whatever it begins with.
            after = words[words.index("--") :] if "--" in words else []
            option = next((word for word in left if word.startswith("-") and word not in after), "").partition("=")[0]
            if option:
                parser.error(f"{option}: no such option{did_you_mean(option, parser.options())}")
            parser.error(f"{next((word for word in left if word != '--'), left[0])}: no such argument")
        return parsed


# What argparse takes for an option of its own: the negative first of several numbers.
_NEGATIVES = re.compile(r"-\.?\d[^=]*")


def _with_negatives(words: list[str]) -> list[str]:
    """Return a command line in which negative numbers stand with the option that they follow: --from -33.9,18.4."""
    joined: list[str] = []
    for word in words:
        if _NEGATIVES.fullmatch(word) and joined and _OPTION.fullmatch(joined[-1]):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


# ----------------------------------------------------------------------
# Errors of the API name its keywords; on the command line they name the options that state them.

# In an error's text: `keyword`, and keyword=True.
_KEYWORD = re.compile(r"`(\w+)`|\b(\w+)=True\b")


def error_text(error: PlanflyError, parser: CommandParser) -> str:
    """Return an error's line with the options of a command's parser in place of the keywords that they state.

    >>> parser = CommandParser(prog="planfly replay")
    >>> _ = parser.add_argument("--from", dest="start")
    >>> _ = parser.add_argument("--overwrite", action="store_true")
    >>> error_text(PlanflyError.of_argument("start", 9.0, "the log ends at 4 s", file="a.mcap"), parser)
    'a.mcap: --from 9.0: the log ends at 4 s'
    >>> error_text(PlanflyError("a.gif: exists; overwrite=True replaces it", file="a.gif"), parser)
    'a.gif: exists; --overwrite replaces it'
    """
    options, text = parser.keywords(), str(error)
    # A change that a keyword asked for is reported in the keyword's name; a file alone may be named like one.
    of_keyword = error.file in options and bool(error.field)
    begin = f"{error.file}: " if error.file and not of_keyword else ""
    head = error.file if of_keyword else error.argument
    if head in options and text.startswith(begin + head):
        text = begin + options[head] + text[len(begin + head) :]
    return _KEYWORD.sub(lambda found: options.get(found[1] or found[2], found[0]), text)
