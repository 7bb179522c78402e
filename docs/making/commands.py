"""The command-line reference, generated from the help of its parser."""

import os
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from planfly.cli import build_parser
from planfly.terminal.command_parser import EXIT_CODES, CommandParser

# Commands.  An option with the same meaning in this many is explained once, among the common options.
COMMON_OPTION_USES = 5
_ENTRY = re.compile(r"^  (\S.*?)(?:  +(\S.*))?$")


@contextmanager
def _wide(columns: int) -> Iterator[None]:
    """Format help with this number of columns and without colour, inside the block."""
    before = {name: os.environ.get(name) for name in ("COLUMNS", "NO_COLOR")}
    os.environ.update(COLUMNS=str(columns), NO_COLOR="1")
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})


class _Option(NamedTuple):
    """An option as the help prints it: the group's title, its form and its meaning."""

    group: str
    form: str
    meaning: str


def command_pages() -> str:
    """Return the common options, and one section per command."""
    commands = build_parser().commands
    texts = {name: _help_text(name, parser) for name, parser in commands.items()}
    uses = Counter(option[1:] for text in texts.values() for option in dict.fromkeys(_options_in(text)))
    common = {
        (form, meaning)
        for (form, meaning), count in uses.items()
        if count >= COMMON_OPTION_USES and form.startswith("-")
    }
    sections = [_section(name, parser, texts[name], common) for name, parser in commands.items()]
    return "\n\n".join([_common_section(list(texts.values()), common), *sections])


def _help_text(name: str, parser: CommandParser) -> str:
    """Return a command's help after its usage, one line per option, with the command's name left out of --schema."""
    with _wide(100_000):
        text = parser.format_help().replace(EXIT_CODES.strip(), "")
    return text.partition("\n\n")[2].replace(f"planfly help {name} --schema", "planfly help COMMAND --schema")


def _options_in(text: str) -> list[_Option]:
    """Return the options of a command's help."""
    found = []
    for block in _blocks(text.partition("\n\n")[2]):
        title, _, entries = block.partition("\n")
        if _holds_options(block):
            found += [_Option(title.rstrip(":"), form, meaning) for form, meaning in _entries(entries)]
    return found


def _common_section(texts: list[str], common: set[tuple[str, str]]) -> str:
    """Return the section of the options that several commands have, in their groups."""
    groups: dict[str, list[tuple[str, str]]] = {}
    shown = set()
    for option in (option for text in texts for option in _options_in(text)):
        if option[1:] in common and option[1:] not in shown:
            shown.add(option[1:])
            groups.setdefault(option.group, []).append(option[1:])
    out = [
        "## Common options",
        "Each of these options means the same for every command that has it, unless the command's section explains it.",
    ]
    return "\n\n".join(out + [f"**{title}**\n\n{_definitions(entries)}" for title, entries in groups.items()])


def _section(name: str, parser: CommandParser, text: str, common: set[tuple[str, str]]) -> str:
    with _wide(76):
        usage = parser.format_usage().strip()
    # The description is followed by the groups of options, and examples.
    description, _, rest = text.partition("\n\n")
    out = [f"## {name}", _escaped(description.strip()), f"```text\n{usage}\n```"]
    for block in _blocks(rest):
        title, _, lines = block.partition("\n")
        if not _holds_options(block):
            out += [f"```text\n{block.strip()}\n```"] if block.strip() else []
        elif entries := [entry for entry in _entries(lines) if entry not in common]:
            out.append(f"**{title.rstrip(':')}**\n\n{_definitions(entries)}")
    return "\n\n".join(
        [*out, "Options in the usage that are not explained here are [common options](#common-options)."]
    )


def _blocks(text: str) -> list[str]:
    return re.split(r"\n(?=\S)", text)


def _holds_options(block: str) -> bool:
    title, _, entries = block.partition("\n")
    return not title.startswith("example:") and bool(_ENTRY.match(entries.split("\n")[0]))


def _entries(text: str) -> list[tuple[str, str]]:
    """Return the options of a group with their meaning."""
    found: list[list[str]] = []
    for line in text.splitlines():
        if not line.strip():
            continue
        if not line.startswith("   ") and (entry := _ENTRY.match(line)):
            found.append([entry[1], entry[2] or ""])
        elif found:
            found[-1][1] = f"{found[-1][1]} {line.strip()}".strip()
    return [(form, meaning) for form, meaning in found]


def _definitions(entries: list[tuple[str, str]]) -> str:
    """Return the options and their meaning, as a definition list."""
    return "\n\n".join(f"`{form}`\n: {_escaped(meaning) or '–'}" for form, meaning in entries)


def _escaped(text: str) -> str:
    """Escape the characters that have a meaning in Markdown."""
    return re.sub(r"([*_<>\[\]|$`])", r"\\\1", text).replace("--", "\\--")
