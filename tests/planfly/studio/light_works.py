"""Works for the studio's processes that import nothing: such a process is there in no time."""

import time
from collections.abc import Callable

Advance = Callable[[float, float, str], None]


def count(most: int, advance: Advance) -> int:
    """Count, some thousandths of a second a number."""
    for number in range(most):
        advance(number, most, "")
        time.sleep(0.002)
    return most


def sleep(seconds: float, advance: Advance) -> None:
    """Hear nothing for so long."""
    advance(0, 1, "")
    time.sleep(seconds)


def length(data: bytes, advance: Advance) -> int:
    """How many bytes came."""
    advance(0, 1, "")
    return len(data)
