"""What pages take from the code: placeholders, docstrings and units as they are laid out."""

import sys
from pathlib import Path

import pytest

from flight.mission.commands import SUPPORT
from tests.docs.page_blocks import PAGES, ROOT

sys.path.insert(0, str(ROOT / "docs"))
from making.docstrings import as_rst
from making.mission_commands import command_table
from making.placeholders import filled
from making.schemas import answer_table, commands_with_json
from making.tolerances import tolerance_list

sys.path.pop(0)


@pytest.mark.parametrize(
    "page", [page for page in PAGES if "<!-- made: " in page.read_text(encoding="utf-8")], ids=lambda page: page.name
)
def test_pages_hold_their_tables_as_the_code_is(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert filled(text) == text, "make tables writes the tables anew"


def test_a_placeholder_that_is_none_is_noticed() -> None:
    with pytest.raises(KeyError, match="nothing"):
        filled("text\n<!-- made: nothing -->\n<!-- end of nothing -->\n")
    with pytest.raises(ValueError, match="a table has no end"):
        filled("text\n<!-- made: extras -->\n")
    old = "<!-- made: extras -->\nof yesterday\n<!-- end of extras -->\n"
    assert "of yesterday" not in filled(old)
    assert filled(filled(old)) == filled(old)
    assert filled("in a line <!-- made: nothing --> it is text") == "in a line <!-- made: nothing --> it is text"


def test_named_lines_of_a_docstring_are_a_list() -> None:
    lines = ["Read it.", "", "path: where.", "seed, wind: of the search,", "or None.", "", ">>> read()"]
    told = ["* **path**: where.", "* **seed, wind**: of the search,", "  or None."]
    assert as_rst(lines) == ["Read it.", "", *told, "", ">>> read()"]
    assert as_rst(["Text goes on.", "out: a file."]) == ["Text goes on.", "", "* **out**: a file."]


def test_angles_are_degrees_and_nothing_else_is() -> None:
    shown = {one.name: one for one in tolerance_list()}
    assert (shown["BANK_TOLERANCE_RAD"].value, shown["OVERSHOOT_TOLERANCE_M"].value) == ("5°", "5")
    assert [
        shown[f"SUGGESTION_{what}"].value for what in ("ANGLE_MARGIN_RAD", "LENGTH_MARGIN_M", "SPEED_MARGIN_FRACTION")
    ] == ["0.1°", "1", "0.03"]
    assert shown["GUST_OFFSET_M"].value == "none 0, light 0.5, moderate 1"
    assert not shown["BANK_TOLERANCE_RAD"].text.startswith("rad")
    assert (shown["GUST_OFFSET_M"].unit, shown["OVERSHOOT_TOLERANCE_M"].unit) == ("m, by turbulence", "m")
    assert shown["OVERSHOOT_TOLERANCE_M"].text == "A turn may be flown this far outside its arc."
    assert [one.name for one in tolerance_list() if not one.text] == []


def test_every_command_with_an_answer_has_a_row() -> None:
    table = answer_table()
    assert [name for name in commands_with_json() if f"\n| `{name}` | `planfly." not in table] == []


def test_every_command_that_an_autopilot_takes_has_a_row() -> None:
    table = command_table()
    assert "\n| 601 | DO_JUMP_TAG | flown | refused | a jump to the first JUMP_TAG with its number |" in table
    assert "\n| 30 | NAV_CONTINUE_AND_CHANGE_ALT | not judged | refused |" in table
    assert all(f"| {command.name} |" in table for command in SUPPORT)
