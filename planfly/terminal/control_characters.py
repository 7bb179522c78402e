"""Escapes for control characters, so that no text of a foreign file controls the terminal."""

import json
import re
import unicodedata

from planfly.terminal.command_parser import COLOUR_SEQUENCE

# Unicode categories of characters that move the cursor, reverse the text, or are not text.
_CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")
# Colour sequences of planfly, and any character beyond plain ASCII, which may be a control character.
_COLOUR_OR_SPECIAL = re.compile(COLOUR_SEQUENCE + r"|[^\n\t\x20-\x7e]")
_SPECIAL = re.compile(r"[^\n\t\x20-\x7e]")


def without_controls(text: str, *, colours: bool = False) -> str:
    r"""Return a text with escapes for all control characters except line feeds and tabs.

    colours: True to keep planfly's own colours.

    >>> print(without_controls("a\x1b[2J \u202e\x9b \xb0"))
    a\x1b[2J \u202e\x9b °
    """
    return (_COLOUR_OR_SPECIAL if colours else _SPECIAL).sub(_escape, text)


def _escape(match: re.Match[str]) -> str:
    text = match[0]
    is_control = len(text) == 1 and unicodedata.category(text) in _CONTROLS
    return text.encode("unicode_escape").decode() if is_control else text


def escaped_json(text: str) -> str:
    """Return JSON text with JSON's escapes for control characters in its strings."""
    return _SPECIAL.sub(lambda match: match[0] if _escape(match) == match[0] else json.dumps(match[0])[1:-1], text)
