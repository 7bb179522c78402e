"""Missions as stations number them, and as they are flown: home, seq and jumps from one to the other."""

from dataclasses import replace

from flight.live.mavlink_items import MissionType
from flight.mission.items import AMSL, FENCES, Command, Frame, Home, Mission, MissionItem, is_located, renumbered


def uploaded(lists: dict[MissionType, tuple[MissionItem, ...]], own: Home) -> tuple[Mission, int]:
    """Mission of the lists, and what to add to its items' seq for the numbers that stations know.

    Item 0 is home, as ArduPilot has it, if it is a waypoint above mean sea level, or one with no parameter set:
    MAVSDK's `mission` plugin sends no home, and its waypoints are relative and have a radius.
    ``own``: the vehicle's home, for a mission that brings none.
    """
    items = lists[MissionType.MISSION]
    home = own
    if items and _is_home(items[0]):
        first = items[0]
        home = Home(first.lat_deg, first.lon_deg, first.alt) if first.has_position else own
        items = items[1:]
        shift = 0
    else:
        shift = -1
    mission = Mission(
        home=home,
        items=items,
        fences=tuple(item for item in lists[MissionType.FENCE] if item.command in FENCES),
        rally=lists[MissionType.RALLY],
        source="upload",
    )
    return renumbered(mission), shift


def _is_home(item: MissionItem) -> bool:
    if item.command != Command.NAV_WAYPOINT or not is_located(item.command, item.frame):
        return False
    return item.frame in AMSL or not any(item.params)


def listed(mission: Mission) -> tuple[tuple[MissionItem, ...], ...]:
    """Lists of a mission as stations see them: home first, seq without gaps, jumps moved with their targets.

    >>> place = MissionItem(4, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> items, fences, rally = listed(Mission(Home(46.0, 8.0, 0.0), (place, replace(place, seq=7))))
    >>> [item.seq for item in items], fences, rally
    ([0, 1, 2], (), ())
    """
    home = mission.home
    first = MissionItem(0, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, 0.0, 0.0, 0.0)
    if home is not None:
        first = replace(first, lat_deg=home.lat_deg, lon_deg=home.lon_deg, alt=home.alt)
    numbers = {item.seq: k for k, item in enumerate(mission.items, 1)}
    items = [first]
    for item in mission.items:
        params = item.params
        if item.command == Command.DO_JUMP:
            params = (float(numbers.get(int(params[0]), 65535)), *params[1:])
        items.append(replace(item, seq=numbers[item.seq], params=params))
    return (
        tuple(items),
        tuple(replace(item, seq=k) for k, item in enumerate(mission.fences)),
        tuple(replace(item, seq=k) for k, item in enumerate(mission.rally)),
    )


def start_problem(mission: Mission, first: int) -> str:
    """Why a mission cannot be flown from the item of this seq on; "" if it can.

    >>> place = MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> way = Mission(None, (place, replace(place, seq=2), replace(place, seq=3)))
    >>> start_problem(way, 2), start_problem(way, 3)
    ('', 'from there on no leg is left to fly')
    """
    if not mission.items or not 0 <= first <= mission.items[-1].seq:
        return "the mission has no such item"
    places = [item for item in mission.items if item.seq >= first and item.has_position]
    return "" if first <= mission.items[0].seq or len(places) > 1 else "from there on no leg is left to fly"


def flown_from(mission: Mission, first: int) -> Mission:
    """Mission from the item of this seq on, at the speed that the items before it have set; its numbers are kept.

    >>> place = MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 75.0)
    >>> speed = MissionItem(2, 178, 2, (0.0, 22.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    >>> way = Mission(None, (place, speed, replace(place, seq=3), replace(place, seq=4)))
    >>> [item.seq for item in flown_from(way, 4).items], flown_from(way, 1) == way
    ([2, 4], True)
    """
    before = [item for item in mission.items if item.seq < first]
    speeds = [item for item in before if item.command == Command.DO_CHANGE_SPEED][-1:]
    return replace(mission, items=(*speeds, *(item for item in mission.items if item.seq >= first)))
