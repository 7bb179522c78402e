"""Ranges of numbers as a scenario file states them, and names of one line."""

import math
from typing import Any

import pytest

from world.scenario_types import no_line_break, within


def test_a_range_holds_its_ends_unless_it_says_otherwise() -> None:
    check: Any = within(0.0, 5.0).func
    assert [check(value) for value in (0.0, 5.0)] == [0.0, 5.0]
    for value in (-0.001, 5.001, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"^allowed 0\.\.5$"):
            check(value)
    open_ends: Any = within(0.0, 5.0, above=True, below=True, also=', or "aircraft"').func
    for value in (0.0, 5.0):
        with pytest.raises(ValueError, match=r'^allowed above 0\.\.below 5, or "aircraft"$'):
            open_ends(value)


def test_a_name_is_one_line() -> None:
    assert no_line_break("Cove Creek") == "Cove Creek"
    with pytest.raises(ValueError, match="control characters"):
        no_line_break("two\nlines")
