"""Tables of a page that the code knows, between ``<!-- made: NAME WORD... -->`` and ``<!-- end of NAME -->``.

Pages hold them as `filled` makes them, so that they can be read in place; ``make tables`` updates them.
"""

import re
from collections.abc import Callable
from pathlib import Path

from making.commands import command_pages
from making.extras import extras_table
from making.mission_commands import command_table
from making.public_names import name_tables, public_names
from making.quantities import quantity_table
from making.schemas import answer_table, schema_tables
from making.state_fields import state_fields
from making.tolerances import tolerance_tables

_PLACE = re.compile(
    r"^<!-- made: (?P<name>\w+)(?P<words>(?: [\w./-]+)*) -->\n(?:.*?\n)??<!-- end of (?P=name) -->$",
    re.MULTILINE | re.DOTALL,
)
_BEGIN = re.compile(r"^<!-- made: ", re.MULTILINE)
MAKERS: dict[str, Callable[..., str]] = {
    "answers": answer_table,
    "commands": command_pages,
    "extras": extras_table,
    "mission_commands": command_table,
    "names": name_tables,
    "quantities": quantity_table,
    "schema": schema_tables,
    "state": state_fields,
    "tolerances": tolerance_tables,
}
# What the built pages have instead: Sphinx writes signatures and docstrings out.
BUILT: dict[str, Callable[..., str]] = {"names": public_names}


def filled(text: str, *, built: bool = False) -> str:
    """Return a page with its tables updated from the code.

    built: True for the page that Sphinx lays out.  Raises KeyError for an unknown table, and ValueError for one without
    an end.
    """
    if len(_BEGIN.findall(text)) != len(_PLACE.findall(text)):
        raise ValueError("a table has no end: <!-- end of NAME --> on a line of its own")
    return _PLACE.sub(lambda found: _table(found, built), text)


def _table(found: re.Match[str], built: bool) -> str:
    """Return the placeholder with the table that it names."""
    name, words = found["name"], found["words"]
    make = BUILT.get(name, MAKERS[name]) if built else MAKERS[name]
    made = make(*words.split()).strip("\n")
    return f"<!-- made: {name}{words} -->\n\n{made}\n\n<!-- end of {name} -->"


def fill_pages(folder: Path) -> list[Path]:
    """Update the generated tables of all pages of a folder, and return the pages that changed."""
    changed = []
    for page in sorted(folder.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            page.write_text(new, encoding="utf-8")
            changed.append(page)
    return changed
