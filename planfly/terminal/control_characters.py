"""Escape control characters, so that no text from a file controls the terminal."""

import json
import re
import unicodedata

from planfly.terminal.command_parser import COLOUR_SEQUENCE

# Unicode categories of characters that move the cursor, reverse the text, or are not text.
_CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")
# Colour sequences of planfly, and any character beyond plain ASCII, which may be a control character.
_COLOUR_OR_SPECIAL = re.compile(COLOUR_SEQUENCE + r"|[^\n\t\x20-\x7e]")
_SPECIAL = re.compile(r"[^\n\t\x20-\x7e]")


def escape_controls(text: str, *, colours: bool = False) -> str:
    r"""Return a text with escapes for all control characters except line feeds and tabs.

    colours: True to keep planfly's own colours.

    >>> print(escape_controls("a\x1b[2J \u202e\x9b \xb0"))
    a\x1b[2J \u202e\x9b °
    """
    return (_COLOUR_OR_SPECIAL if colours else _SPECIAL).sub(_escape, text)


def _escape(match: re.Match[str]) -> str:
    """Return the escape for a matched control character.

    A match that is longer, or is another character, is returned unchanged.
    """
    text = match[0]
    is_control = len(text) == 1 and unicodedata.category(text) in _CONTROLS
    return text.encode("unicode_escape").decode() if is_control else text


def escape_json_controls(text: str) -> str:
    r"""Return JSON text in which control characters are replaced by JSON escapes such as \u009b."""
    return _SPECIAL.sub(lambda match: match[0] if _escape(match) == match[0] else json.dumps(match[0])[1:-1], text)
