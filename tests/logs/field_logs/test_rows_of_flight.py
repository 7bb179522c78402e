"""Places on the map south of the equator, west of Greenwich, across the 180th meridian and below the sea."""

import numpy as np
import pytest

from logs.field_logs.example_raw_log import BEFORE, LEG, SPEED, example_raw_log
from logs.field_logs.field_flight import make_flight
from logs.field_logs.rows_of_flight import rows_of_flight
from world.frames import GeoOrigin

PLACES = {
    "north and east": (46.0, 8.0, 500.0),
    "south and west": (-33.9, -70.7, 900.0),
    "across the 180th meridian": (-17.0, 179.998, 120.0),
    "below the sea": (31.5, 35.45, -380.0),
}


@pytest.mark.parametrize("place", PLACES)
def test_the_flight_is_where_its_formula_has_it(place: str) -> None:
    lat, lon, up = PLACES[place]
    flight = make_flight(example_raw_log(lat, lon, up))
    track = rows_of_flight(flight, GeoOrigin(lat, lon))
    run = SPEED * (track.time - 20.0 - BEFORE)
    wanted = np.column_stack([np.maximum(run - LEG, 0.0), np.minimum(run, LEG), np.full(run.size, up)])
    assert np.abs(track.position - wanted).max() < 1e-3


def test_what_the_log_does_not_hold_is_no_number() -> None:
    track = rows_of_flight(make_flight(example_raw_log()), GeoOrigin(46.0, 8.0))
    for name in ("rates", "commands", "load_factor", "current", "energy"):
        assert np.isnan(getattr(track, name)).all()
    assert (track.controls[:, 3] == np.float32(0.6)).all()


def test_velocities_that_are_missing_are_those_of_the_places() -> None:
    raw = example_raw_log()
    series = {name: found for name, found in raw.series.items() if name != "velocity"}
    flight = make_flight(type(raw)(**{**{f: getattr(raw, f) for f in raw.__slots__}, "series": series}))
    track = rows_of_flight(flight, GeoOrigin(46.0, 8.0))
    assert np.abs(np.hypot(*track.velocity[:, :2].T)[10:200] - SPEED).max() < 0.01
