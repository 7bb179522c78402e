"""Missions between stations and files: home is item 0, seq has no gaps, jumps go where they went."""

from flight.live.mavlink_items import MissionType
from flight.live.station_missions import listed, uploaded
from flight.mission.items import Home, Mission, MissionItem

HOME, OWN = Home(46.0, 8.0, 400.0), Home(47.0, 9.0, 500.0)


def waypoint(seq: int, lat: float, frame: int = 3, radius: float = 0.0) -> MissionItem:
    return MissionItem(seq, 16, frame, (0.0, radius, 0.0, 0.0), lat, 8.0, 100.0)


def lists_of(*items: MissionItem) -> dict[MissionType, tuple[MissionItem, ...]]:
    return dict.fromkeys(MissionType, ()) | {MissionType.MISSION: items}


def test_jumps_keep_their_targets_in_numbers_without_gaps() -> None:
    jump = MissionItem(9, 177, 2, (7.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    items, fences, rally = listed(Mission(HOME, (waypoint(3, 46.1), waypoint(7, 46.2), jump)))
    assert [item.seq for item in items] == [0, 1, 2, 3]
    assert (items[0].lat_deg, items[0].alt) == (46.0, 400.0)
    assert items[3].params[:2] == (2.0, 2.0)
    assert (fences, rally) == ((), ())


def test_a_listed_mission_comes_back() -> None:
    mission = Mission(HOME, (waypoint(1, 46.1), waypoint(2, 46.2)))
    back, shift = uploaded(lists_of(*listed(mission)[0]), OWN)
    assert (back, shift) == (mission, 0)


def test_a_station_that_sends_no_home_gets_its_own_numbers() -> None:
    """MAVSDK's mission plugin: the first item is relative and has a radius."""
    back, shift = uploaded(lists_of(waypoint(0, 46.1, radius=1.0), waypoint(1, 46.2, radius=1.0)), OWN)
    assert back.home == OWN
    assert [item.seq + shift for item in back.items] == [0, 1]
