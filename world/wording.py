"""Phrase numbers in messages."""

from collections.abc import Sequence


def count_text(count: int, noun: str) -> str:
    """Return a number with its noun.

    >>> count_text(1, "threat"), count_text(2, "threat"), count_text(1200, "row")
    ('1 threat', '2 threats', '1,200 rows')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def count_range_text(counts: Sequence[int], noun: str) -> str:
    """Return several counts of the same things as text.

    >>> count_range_text([12, 6, 10], "flight"), count_range_text([1, 1], "flight")
    ('6 to 12 flights', '1 flight')
    """
    lowest, highest = min(counts), max(counts)
    return count_text(highest, noun) if lowest == highest else f"{lowest} to {count_text(highest, noun)}"
