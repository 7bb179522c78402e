"""Departures: extreme bank, too slow, numbers that are none."""

import math

import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from tests.logs.verdict.judging import judge, of
from tests.synthetic import (
    copied,
)


@pytest.mark.parametrize(
    ("column", "value", "word"),
    [("attitude", math.radians(80.0), "bank 80"), ("airspeed", 14.0, "airspeed 14.0"), ("position", math.nan, "rows")],
)
def test_departures(setup: FlightSetup, track: Track, column: str, value: float, word: str) -> None:
    columns = copied(track)
    columns[column][4000 if column != "position" else slice(4000, 4003)] = value
    verdict = judge(setup, Track(**columns))
    assert not verdict.flyable
    item = of(verdict, "departure")
    assert item.ok is False
    assert word in item.reason
