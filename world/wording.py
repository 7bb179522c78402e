"""Phrase numbers in messages."""


def count_text(count: int, noun: str) -> str:
    """Return a number with its noun.

    >>> count_text(1, "threat"), count_text(2, "threat"), count_text(1200, "row")
    ('1 threat', '2 threats', '1,200 rows')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
