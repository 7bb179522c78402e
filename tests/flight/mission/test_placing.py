"""The places of a mission: merged within a metre, refused beyond the map and the heights, home's height doubted."""

import numpy as np
import pytest

from flight.mission.placing import PlacedMission, place_stops
from tests.mission_lines import ORIGIN, ground, mission, wp
from world.errors import MissionError
from world.terrain import Terrain

HOME = "36.5 -84.2 300"


def placed(*lines: str, home: str = HOME, terrain: Terrain | None = None, vertical_legs: bool = False) -> PlacedMission:
    return place_stops(mission(*lines, home=home), ORIGIN, terrain, vertical_legs=vertical_legs)


def test_a_place_has_no_speed_of_its_own_before_the_mission_sets_one() -> None:
    stops = placed(
        wp(0, 0), wp(0, 900), "2 178 0 18 -1 0 0 0 0", wp(0, 1800), "2 178 0 -2 -1 0 0 0 0", wp(0, 2700)
    ).stops
    assert [place.airspeed for place in stops] == pytest.approx([np.nan, np.nan, 18.0, np.nan], nan_ok=True)


@pytest.mark.parametrize(("apart", "places"), [(0.95, 2), (1.05, 3)])
def test_positions_within_a_metre_are_one(apart: float, places: int) -> None:
    assert len(placed(wp(0, 0), wp(0, 900), wp(0, 900 + apart)).stops) == places


RTL = "0 20 0 0 0 0 0 0 0"


def rally(east: float, north: float, alt: float, frame: int) -> str:
    return wp(east, north, alt, command=5100, frame=frame)


def test_a_return_has_home_and_the_rally_points_at_their_heights() -> None:
    # Over home at 300 m, above the sea, and above the ground at 250 m.
    points = (rally(900, 0, 120, 3), rally(0, 1800, 420, 0), rally(900, 900, 70, 10))
    found = placed(wp(0, 500), wp(0, 900), RTL, *points, terrain=ground(250.0)).return_points
    flat = [(round(place.east), round(place.north), place.up, place.base) for place in found]
    assert flat == [(0, 0, 300.0, 0.0), (900, 0, 420.0, 300.0), (0, 1800, 420.0, 0.0), (900, 900, 320.0, 0.0)]
    assert placed(wp(0, 500), wp(0, 900), *points, terrain=ground(250.0)).return_points == ()


def test_a_rally_point_beyond_the_map_or_the_heights_is_named() -> None:
    with pytest.raises(MissionError, match=r"rally point 2: 9400\.0 m AMSL: allowed -500\.\.9000"):
        placed(wp(0, 500), wp(0, 900), RTL, rally(900, 0, 120, 3), rally(900, 0, 9100, 3))
    with pytest.raises(MissionError, match=r"rally point 1: latitude .*more than .* km from the map's origin"):
        placed(wp(0, 500), wp(0, 900), RTL, "3 5100 0 0 0 0 -36.5 84.2 100")


def test_a_return_over_the_last_place_is_not_merged_with_it() -> None:
    stops = placed(wp(0, 900), wp(0, 0), RTL).stops
    assert [place.item for place in stops] == [1, 2, 3]


@pytest.mark.parametrize(("rise", "places"), [(0.9, 2), (1.1, 3)])
def test_a_metre_straight_up_is_a_leg_where_such_legs_are_laid(rise: float, places: int) -> None:
    lines = wp(0, 0), wp(0, 900, 100), wp(0, 900, 100 + rise)
    stops = placed(*lines, vertical_legs=True).stops
    assert len(stops) == places
    if places == 3:
        # A centimetre on, on the course of the leg before: due north.
        assert np.subtract(stops[2].map_position, stops[1].map_position) == pytest.approx([0.0, 0.01, rise], abs=1e-6)
        with pytest.raises(MissionError, match=r"item 3: 1\.1 m straight above item 2"):
            placed(*lines)


@pytest.mark.parametrize(("amsl", "allowed"), [(-499.9, True), (-500.1, False), (8999.9, True), (9000.1, False)])
def test_heights_are_allowed_from_the_dead_sea_to_beyond_everest(amsl: float, allowed: bool) -> None:
    lines = wp(0, 0, 300, frame=0), wp(0, 900, amsl, frame=0)
    if allowed:
        assert placed(*lines).stops[1].map_position[2] == pytest.approx(amsl)
    else:
        with pytest.raises(MissionError, match=r"item 2: .* m AMSL: allowed -500\.\.9000"):
            placed(*lines)


@pytest.mark.parametrize(("home_amsl", "doubted"), [(291, False), (309, False), (289, True), (311, True)])
def test_a_home_ten_metres_off_the_ground_is_doubted(home_amsl: int, doubted: bool) -> None:
    found = placed(wp(0, 100), wp(0, 900), home=f"36.5 -84.2 {home_amsl}", terrain=ground(300.0))
    assert bool(found.notes) == doubted
    assert found.stops[0].map_position[2] == pytest.approx(home_amsl + 100.0)
