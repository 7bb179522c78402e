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
    """Lists of a mission as stations see them: home first, seq without gaps, jumps moved with their targets."""
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
