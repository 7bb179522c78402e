"""Lays out docstrings for Sphinx: a line ``name: what it is`` describes an argument or a field."""

import re
from collections.abc import Iterable

_NAMED = re.compile(r"^([a-z]\w*(?:, [a-z]\w*)*): (.*)$")


def as_rst(lines: Iterable[str]) -> list[str]:
    """Return the lines with each argument's entry as a list item and the argument's name in bold."""
    out: list[str] = []
    named = False
    for line in lines:
        found = _NAMED.match(line)
        if found:
            if not named and out and out[-1]:
                out.append("")
            out += [f"* **{found[1]}**: {found[2]}"]
            named = True
        elif named and line.strip() and not line.startswith((" ", ">>>")):
            out.append(f"  {line}")
        else:
            named = False
            out.append(line)
    return out
