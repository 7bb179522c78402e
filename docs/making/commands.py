"""The command-line reference, generated from the help of its parser."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager

from planfly.commands.registry import build_parser
from planfly.terminal.command_parser import CommandParser
from planfly.terminal.exit_codes import EXIT_CODES

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


def command_pages() -> str:
    """Return one section per command: description, usage, grouped options, examples; exit codes at the end."""
    parts = [_section(name, parser) for name, parser in build_parser().commands.items()]
    return "\n\n".join([*parts, f"## Exit codes\n\n```text\n{EXIT_CODES.strip()}\n```"])


def _section(name: str, parser: CommandParser) -> str:
    """Return the section of one command: description, usage, options and examples."""
    with _wide(76):
        usage = parser.format_usage().strip()
    with _wide(100_000):
        text = parser.format_help().replace(EXIT_CODES.strip(), "")
    # The usage is followed by the description, the groups of options, and examples.
    description, _, rest = text.partition("\n\n")[2].partition("\n\n")
    out = [f"## {name}", _escaped(description.strip()), f"```text\n{usage}\n```"]
    for block in re.split(r"\n(?=\S)", rest):
        title, _, entries = block.partition("\n")
        if title.startswith("example:") or not _ENTRY.match(entries.split("\n")[0]):
            out += [f"```text\n{block.strip()}\n```"] if block.strip() else []
        else:
            out.append(f"**{title.rstrip(':')}**\n\n{_definitions(entries)}")
    return "\n\n".join(out)


def _definitions(entries: str) -> str:
    """Return the options and their meaning, as a definition list."""
    found: list[list[str]] = []
    for line in entries.splitlines():
        if not line.strip():
            continue
        if not line.startswith("   ") and (entry := _ENTRY.match(line)):
            found.append([entry[1], entry[2] or ""])
        elif found:
            found[-1][1] = f"{found[-1][1]} {line.strip()}".strip()
    return "\n\n".join(f"`{name}`\n: {_escaped(text) or '–'}" for name, text in found)


def _escaped(text: str) -> str:
    """Escape the characters that have a meaning in Markdown."""
    return re.sub(r"([*_<>\[\]|$`])", r"\\\1", text).replace("--", "\\--")
