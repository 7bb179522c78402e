"""Full counts with PLANFLY_SOAK=1, and one file with the figures of all rooms: build/soak.json."""

import fcntl
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

SOAK = os.environ.get("PLANFLY_SOAK") == "1"
FIGURES = Path(os.environ.get("PLANFLY_SOAK_FIGURES", Path(__file__).parents[2] / "build" / "soak.json"))


def scaled(full: int, few: int) -> int:
    """The full count in a soak, or PLANFLY_SOAK_SHARE of it where that is set; a few otherwise."""
    if not SOAK:
        return few
    return max(few, round(full * float(os.environ.get("PLANFLY_SOAK_SHARE", "1"))))


def note(row: str, **figures: float | int | str) -> None:
    """Put a row of figures into the file, in a soak; rows of the same run stand beside each other."""
    _change(row, lambda there: there | figures)


def tally(row: str, **figures: int) -> None:
    """Add figures to those of a row, in a soak: for a test with many cases."""
    _change(row, lambda there: there | {name: there.get(name, 0) + value for name, value in figures.items()})


def widen(row: str, **figures: float) -> None:
    """Put the largest of figures into a row, in a soak: for a test with many cases."""
    _change(row, lambda there: there | {name: max(there.get(name, value), value) for name, value in figures.items()})


def _change(row: str, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    if not SOAK:
        return
    FIGURES.parent.mkdir(parents=True, exist_ok=True)
    with FIGURES.open("a+", encoding="utf-8") as file:
        # Two processes test at a time.
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        text = file.read()
        rows = json.loads(text) if text else {}
        rows[row] = change(rows.get(row, {}))
        file.seek(0)
        file.truncate()
        file.write(json.dumps(rows, indent=1, sort_keys=True) + "\n")
