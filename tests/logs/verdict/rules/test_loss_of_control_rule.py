"""Departures: extreme bank, too slow, numbers that are none."""

import math

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from tests.logs.verdict.judging import judge, of
from tests.logs.verdict.rules.flown_circuits import flown_circuit, found, moved
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


def test_the_steepest_bank_and_the_lowest_airspeed_are_told(setup: FlightSetup, track: Track) -> None:
    columns = copied(track)
    columns["attitude"][3000, 0] = math.radians(-52.0)
    columns["airspeed"][5000] = 17.5
    item = of(judge(setup, Track(**columns)), "departure")
    assert (item.ok, item.reason) == (True, "bank at most 52°, airspeed at least 17.5 m/s")
    assert (item.flown, item.margin, item.limit) == pytest.approx((52.0, 23.0, 75.0))


def test_the_first_row_of_each_departure_is_told(setup: FlightSetup, track: Track) -> None:
    columns = copied(track)
    for row, bank, speed in ((3000, 80.0, 14.0), (3600, 85.0, 12.0)):
        columns["attitude"][row, 0] = math.radians(bank)
        columns["airspeed"][row] = speed
    reason = of(judge(setup, Track(**columns)), "departure").reason
    bank_text, airspeed_text = "bank 80° at 50.0 s, more than the limit of 75°", "airspeed 14.0 m/s at 50.0 s"
    assert reason.startswith(f"{bank_text}; {airspeed_text}, below 15.0 m/s")
    columns = copied(track)
    columns["position"][3000:3600, 2] = -5.0
    assert "ground contact at 50.0 s" in of(judge(setup, Track(**columns)), "departure").reason


@pytest.mark.parametrize(("height", "ok"), [(0.95, False), (1.05, True)])
def test_an_aircraft_with_landing_gear_meets_the_ground_before_its_center_of_gravity_does(
    height: float, ok: bool
) -> None:
    """The circuit is flown over level ground at 0 m; the track ends on the way, at its last row so high."""
    flown = flown_circuit()
    row = int(np.argmax(flown.track.time > 40.0))
    track = flown.track.rows(0, row + 1)
    low = moved(track, slice(row, row + 1), up=height - float(track.position[row, 2]))
    item = found(flown.setup, low, "departure", "ground contact")
    assert item.ok is ok
    assert ("ground contact at 40.0 s on leg" in item.reason) is not ok
