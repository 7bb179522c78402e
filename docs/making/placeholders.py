"""Placeholders of a page, ``<!-- made: NAME WORD... -->`` on a line of their own, and what replaces them."""

import re
from collections.abc import Callable

from making.commands import command_pages
from making.extras import extras_table
from making.mission_commands import command_table
from making.public_names import public_names
from making.schemas import answer_table, schema_tables
from making.state_fields import state_fields
from making.tolerances import all_tolerances, rule_tolerances

_PLACE = re.compile(r"^<!-- made: (\w+)((?: [\w./-]+)*) -->$", re.MULTILINE)
MAKERS: dict[str, Callable[..., str]] = {
    "answers": answer_table,
    "commands": command_pages,
    "extras": extras_table,
    "mission_commands": command_table,
    "names": public_names,
    "schema": schema_tables,
    "state": state_fields,
    "tolerances": rule_tolerances,
    "all_tolerances": all_tolerances,
}


def filled(text: str) -> str:
    """Return the page with its placeholders replaced.  Raises KeyError for an unknown placeholder."""
    return _PLACE.sub(lambda found: MAKERS[found[1]](*found[2].split()), text)
