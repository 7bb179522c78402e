"""Colour where a terminal wants it: a terminal that is none, NO_COLOR and TERM=dumb want none, FORCE_COLOR wants it."""

import argparse
import os
import sys
from typing import Literal, TextIO

Style = Literal["good", "bad", "warning", "hint"]
_STYLES: dict[Style, str] = {"good": "green", "bad": "red", "warning": "yellow", "hint": "cyan"}


def wants_colour(stream: TextIO) -> bool:
    """Whether a stream's reader wants colour.  NO_COLOR counts before FORCE_COLOR, and both only where they hold text.

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
    """A text as a stream, standard output if None, is to get it.

    >>> coloured("flyable", "good")
    'flyable'
    """
    if not wants_colour(stream if stream is not None else sys.stdout):
        return text
    # Imported here: most output is read by no terminal.
    from rich.color import ColorSystem
    from rich.style import Style as RichStyle

    return RichStyle.parse(_STYLES[style]).render(text, color_system=ColorSystem.STANDARD)


def help_formatter(prog: str) -> argparse.HelpFormatter:
    """What lays a command's help out: in colour for a terminal that wants it."""
    if not wants_colour(sys.stdout):
        return argparse.RawDescriptionHelpFormatter(prog)
    # Imported here: it takes as long as all else of the help together.
    from rich_argparse import RawDescriptionRichHelpFormatter

    formatter = RawDescriptionRichHelpFormatter
    formatter.group_name_formatter = str
    return formatter(prog)
