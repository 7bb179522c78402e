"""Phrase numbers in messages."""

from collections.abc import Sequence


def count_text(count: int, noun: str) -> str:
    """Return a count with its noun in the singular or plural.

    >>> count_text(1, "threat"), count_text(2, "threat"), count_text(1200, "row")
    ('1 threat', '2 threats', '1,200 rows')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def count_range_text(counts: Sequence[int], noun: str) -> str:
    """Return the range of several counts of a noun, as text.

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
