"""Numbers in messages, and no number of one with a plural in what commands print most."""

import pytest

from logs.verdict.wording import compared_texts, quantity_text
from world.wording import count_text


@pytest.mark.parametrize(("count", "text"), [(0, "0 legs"), (1, "1 leg"), (2, "2 legs"), (12345, "12,345 legs")])
def test_a_noun_is_singular_after_one_only(count: int, text: str) -> None:
    assert count_text(count, "leg") == text


def test_a_counted_unit_is_singular_after_one_only() -> None:
    assert [quantity_text(value, "legs") for value in (1.0, 2.0)] == ["1 leg", "2 legs"]
    assert compared_texts(1.0, 2.0, "legs") == ("1 leg", "2 legs")
    assert quantity_text(1.0, "m") == "1 m"
