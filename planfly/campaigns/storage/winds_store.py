"""The table of a search for the largest winds: a row a flight, numbered in the order in which they are asked for."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from logs.verdict.places import Place
from planfly.campaigns.flights.flight_row import FlightRow, Outcome
from planfly.campaigns.flights.narrow_passes import NarrowPass
from planfly.campaigns.storage.held_table import HeldTable, TableKind
from planfly.campaigns.storage.row_values import ROW_COLUMNS, failed_of, row_values

WINDS_DATABASE = "winds.sqlite"
# What decides which flights are asked for; of the number of flights, only how many are.
FIXED = ("target", "confidence", "directions", "most")
KIND = TableKind(
    "planfly.winds-flights/2",
    {
        "flight": "INTEGER PRIMARY KEY",
        "direction": "INTEGER NOT NULL",
        "asked_speed": "REAL NOT NULL",
        "draw": "INTEGER NOT NULL",
        "narrow": "TEXT NOT NULL",
        **ROW_COLUMNS,
    },
    FIXED,
)


@dataclass(frozen=True, slots=True)
class AskedFlight:
    """A flight that a search asks for.

    number: in the order of the search.
    direction: counted from the north.  speed: of the mean wind, m/s.
    draw: index of what varies about that wind; the same in all directions.
    """

    number: int
    direction: int
    speed: float
    draw: int


@dataclass(frozen=True, slots=True)
class FlownFlight:
    """What came of a flight: its outcome, rule and place of each finding that failed, and its narrow passes."""

    outcome: Outcome
    failed: tuple[tuple[str, Place], ...]
    narrow: tuple[NarrowPass, ...] = ()


class WindsStore(HeldTable):
    """A search's table, held by one process at a time."""

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on with the same question; settings: with `FIXED` among them."""
        super().__init__(path, KIND, made_of, settings, resume=resume)

    def add(self, asked: AskedFlight, row: FlightRow) -> None:
        """Write a flight, for good.  Raises OSError for a full disk; what was written before stays."""
        asked_for = {
            "flight": asked.number, "direction": asked.direction, "asked_speed": asked.speed, "draw": asked.draw,
            "narrow": json.dumps([{"rule": rule, "room": room, **asdict(place)} for rule, place, room in row.narrow]),
        }  # fmt: skip
        self.insert({**asked_for, **row_values(row, self.made_of)})

    def known(self) -> dict[int, tuple[AskedFlight, FlownFlight]]:
        """Each flight there is and what came of it, by number."""
        rows = self._connection.execute(
            "SELECT flight, direction, asked_speed, draw, outcome, failed, narrow FROM flights ORDER BY flight"
        )
        return {
            number: (AskedFlight(number, *asked), FlownFlight(outcome, failed_of(failed), narrow_passes_of(narrow)))
            for number, *asked, outcome, failed, narrow in rows
        }


def narrow_passes_of(text: str) -> tuple[NarrowPass, ...]:
    """Narrow passes of the column's text.

    >>> narrow_passes_of('[{"rule": "slope", "room": 0.25, "kind": "leg", "index": 3}]')[0][2]
    0.25
    """
    return tuple(_narrow_pass(**entry) for entry in json.loads(text))


def _narrow_pass(rule: str, room: float, **place: Any) -> NarrowPass:
    return rule, Place(**place), room
