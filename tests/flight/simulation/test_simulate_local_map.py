"""The local map projection against the map that it copies."""

import numpy as np
import pytest

from flight.simulation.simulate import LocalMap
from tests.setups import MakeSetup
from world.frames import GeoOrigin, to_map


@pytest.mark.parametrize("origin", [GeoOrigin(36.6, -84.2), GeoOrigin(70.0, 179.0), GeoOrigin(-45.0, 10.0)])
def test_positions_and_the_course_of_north_are_the_maps(make_setup: MakeSetup, origin: GeoOrigin) -> None:
    at = {"lat_deg": origin.lat_deg, "lon_deg": origin.lon_deg}
    setup = make_setup([[-15000, 0, 500], [15000, 9000, 500]], origin=at)
    local = LocalMap.around(setup)
    lat = origin.lat_deg + np.linspace(-0.05, 0.1, 40)
    lon = origin.lon_deg + np.linspace(-0.2, 0.15, 40)
    east, north = to_map(origin, lat, lon)
    got = local.position(np.radians(lat), np.radians(lon))
    assert np.hypot(got[0] - east, got[1] - north).max() < 1e-3
    # Map course of true north, by a step of a hundredth of a second of arc to the north.
    ahead_e, ahead_n = to_map(origin, lat + 1e-4, lon)
    back_e, back_n = to_map(origin, lat - 1e-4, lon)
    turn = local.angle(np.radians(lat), np.radians(lon))[0]
    assert turn == pytest.approx(np.arctan2(ahead_e - back_e, ahead_n - back_n), abs=1e-7)
