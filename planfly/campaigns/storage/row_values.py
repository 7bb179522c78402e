"""A flight's row as values of the table's columns, and back."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from logs.verdict.findings import RULES
from logs.verdict.places import Place
from planfly.campaigns.flights.flight_row import FlightRow, LeastMargin
from planfly.campaigns.spread.draws import Draw
from planfly.campaigns.spread.quantities import NAMES

# Columns that a second campaign of the same flights may have otherwise.
NOT_THE_SAME = ("seconds", "worker")
# Arrays as bytes, of `planfly.campaigns.flights.track_shape`.
SHAPES = ("clearance", "crossings")
_MARGINS = tuple(f"{kind}_{rule}" for rule in RULES for kind in ("margin", "place"))
# Of a row, but for the flight's index, name and kind of each column.
ROW_COLUMNS: dict[str, str] = {
    "seed": "INTEGER NOT NULL",
    **dict.fromkeys(NAMES, "REAL NOT NULL"),
    "outcome": "TEXT NOT NULL",
    "ended": "TEXT NOT NULL",
    "failed": "TEXT NOT NULL",
    **{name: "REAL" if name.startswith("margin") else "TEXT" for name in _MARGINS},
    "closeness": "REAL",
    "energy_left": "REAL",
    "duration": "REAL NOT NULL",
    "made_of": "TEXT NOT NULL",
    **dict.fromkeys(SHAPES, "BLOB NOT NULL"),
    "seconds": "REAL NOT NULL",
    "worker": "TEXT NOT NULL",
}


def row_values(row: FlightRow, made_of: str) -> dict[str, Any]:
    """A value for each of `ROW_COLUMNS`."""
    margins: dict[str, Any] = dict.fromkeys(_MARGINS)
    for rule, margin in row.margins:
        margins[f"margin_{rule}"] = margin.value
        margins[f"place_{rule}"] = json.dumps({"unit": margin.unit, **asdict(margin.place)})
    return {
        "seed": row.draw.seed,
        **row.draw.values,
        "outcome": row.outcome,
        "ended": row.ended,
        "failed": json.dumps([{"rule": rule, **asdict(place)} for rule, place in row.failed]),
        **margins,
        "closeness": row.closeness if math.isfinite(row.closeness) else None,
        "energy_left": row.energy_left,
        "duration": row.duration,
        "made_of": made_of,
        "clearance": row.clearance,
        "crossings": row.crossings,
        "seconds": row.seconds,
        "worker": row.worker,
    }


def row_of(index: int, known: Mapping[str, Any]) -> FlightRow:
    """The row of a draw's index and its values by column."""
    margins = []
    for rule in RULES:
        if (place := known[f"place_{rule}"]) is not None:
            data = json.loads(place)
            margins.append((rule, LeastMargin(known[f"margin_{rule}"], data.pop("unit"), Place(**data))))
    return FlightRow(
        draw=Draw(index, known["seed"], {name: known[name] for name in NAMES}),
        outcome=known["outcome"],
        ended=known["ended"],
        failed=failed_of(known["failed"]),
        margins=tuple(margins),
        energy_left=known["energy_left"],
        duration=known["duration"],
        clearance=known["clearance"],
        crossings=known["crossings"],
        seconds=known["seconds"],
        worker=known["worker"],
    )


def failed_of(text: str) -> tuple[tuple[str, Place], ...]:
    """Rule and place of each finding that failed, of the column's text.

    >>> failed_of('[{"rule": "slope", "kind": "leg", "index": 3}]')[0][1].index
    3
    """
    entries = json.loads(text)
    return tuple((entry.pop("rule"), Place(**entry)) for entry in entries)


def same_flight(one: FlightRow, other: FlightRow) -> bool:
    """Whether two rows tell of the same flight, whoever flew it and however long that took."""
    mine, theirs = (row_values(row, "") for row in (one, other))
    same = all(mine[name] == theirs[name] for name in ROW_COLUMNS if name not in NOT_THE_SAME)
    return same and one.draw.index == other.draw.index
