"""Phrase numbers in messages and tables."""

import math
from collections.abc import Sequence

# Text of a missing value in a table.
NOTHING = "–"
# Texts of units that are shown in another form.
_UNIT_TEXTS = {"deg": "°", "none": "", "1": ""}


def count_text(count: int, noun: str) -> str:
    """Return a count with its noun in the singular or plural.

    >>> count_text(1, "threat"), count_text(2, "threat"), count_text(1200, "row")
    ('1 threat', '2 threats', '1,200 rows')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def count_range_text(counts: Sequence[int], noun: str) -> str:
    """Return the smallest and the largest of several counts with their noun, as text.

    >>> count_range_text([12, 6, 10], "flight"), count_range_text([1, 1], "flight")
    ('6 to 12 flights', '1 flight')
    """
    lowest, highest = min(counts), max(counts)
    return count_text(highest, noun) if lowest == highest else f"{lowest} to {count_text(highest, noun)}"


def is_one_edit(first: str, second: str) -> bool:
    """Return True if two words differ by one edit.

    An edit adds, removes or replaces a letter, or swaps two neighbouring letters.

    >>> [is_one_edit("WP_RADUIS", word) for word in ("WP_RADIUS", "WP_RADUI", "WP_RADUIX", "RTL_RADIUS", "WP_RADUIS2")]
    [True, True, True, False, False]
    """
    for _ in range(2):
        start = next(
            (k for k, letters in enumerate(zip(first, second, strict=False)) if letters[0] != letters[1]),
            min(len(first), len(second)),
        )
        # Remove the common beginning, and reverse the words, so that the second pass removes the common end.
        first, second = first[start:][::-1], second[start:][::-1]
    if not (first + second).replace("_", "").isalpha():
        return False
    return max(len(first), len(second)) == 1 or (len(first) == 2 and first == second[::-1])


def format_number(value: float | None, *, signed: bool = False, digits: int | None = None) -> str:
    """Return a number as text with three or four significant digits.

    None and non-finite values become an en dash.

    signed: True to show the sign of a positive number.
    digits: number of decimals, for a column of numbers with equal decimals; None to choose it by the size of the value.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    magnitude = abs(value)
    if digits is None:
        digits = 0 if magnitude >= 1000 else 1 if magnitude >= 10 else 2
        if 5e-5 < magnitude < 0.1:
            digits = 4 if magnitude < 0.01 else 3
    text = f"{value:{'+' if signed else ''},.{digits}f}"
    if not any(character in "123456789" for character in text):
        text = text.lstrip("+-")
    # A thousands comma could be read as a decimal comma; a thin space cannot.
    return text.replace(",", "\u2009").replace("-", "−")


def format_quantity(value: float | None, unit: str) -> str:
    """Return a number and its unit as text; an en dash if the number is None or NaN.

    Radians are shown as degrees.
    """
    shown_value, name = display_value(value, unit)
    text = format_number(shown_value)
    if text == NOTHING or not name:
        return text
    return f"{text}{name}" if name in ("°", "%") else f"{text}\u00a0{name}"


def display_value(value: float | None, unit: str) -> tuple[float | None, str]:
    """Return a value and its unit for display: radians become degrees, and a value of None stays None."""
    if unit == "rad":
        return (None if value is None else math.degrees(value)), "°"
    return value, _UNIT_TEXTS.get(unit, unit)
