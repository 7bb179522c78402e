"""Departures: extreme bank, too slow, numbers that are none."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from tests.logs.verdict.judging import judge, of
from tests.synthetic import copied, edited


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


@pytest.mark.parametrize(
    ("column", "value", "ok"),
    [
        ("attitude", math.radians(74.9), True),
        ("attitude", math.radians(75.1), False),
        ("attitude", -math.radians(75.1), False),
        ("airspeed", 15.05, True),
        ("airspeed", 14.95, False),
    ],
)
def test_one_row_beyond_the_limit_is_a_departure(
    setup: FlightSetup, track: Track, column: str, value: float, ok: bool
) -> None:
    columns = copied(track)
    if column == "attitude":
        columns[column][4000, 0] = value
    else:
        columns[column][4000] = value
    assert of(judge(setup, Track(**columns)), "departure").ok is ok


@pytest.mark.parametrize(("speed", "ok"), [(15.1, True), (14.98, False)])
def test_another_aircraft_departs_at_its_own_speed(setup: FlightSetup, track: Track, speed: float, ok: bool) -> None:
    """0.94 of the slowest level speed, which is 16 m/s at every height: 15.04 m/s."""
    other = replace(setup, aircraft="c172x")
    slow = edited(track, airspeed=np.where(np.arange(len(track)) == 4000, speed, track.airspeed).astype(np.float32))
    assert of(judge(other, slow), "departure").ok is ok


@pytest.mark.parametrize(("above", "ok"), [(0.05, True), (-0.05, False)])
def test_the_ground_is_where_it_is(setup: FlightSetup, track: Track, above: float, ok: bool) -> None:
    """Flat ground at 0 m, and the lowest row this far above it."""
    low = track.position - np.array([0.0, 0.0, float(track.position[:, 2].min()) - above])
    item = of(judge(setup, edited(track, position=low)), "departure")
    assert item.ok is ok
    assert ("ground contact" in item.reason) is not ok
