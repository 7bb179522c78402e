"""A mission all over the world, with fences and rally points."""

import random

from flight.mission.fences import number_items
from flight.mission.items import Home, Mission, MissionItem, round_to_grid


def some_mission(count: int, seed: int = 1) -> Mission:
    """Waypoints and loiters all over the world, at coordinates that are not round."""
    dice = random.Random(seed)
    items = []
    for k in range(count):
        lat, lon = round_to_grid(dice.uniform(-89.9, 89.9)), round_to_grid(dice.uniform(-179.9, 179.9))
        command = dice.choice([16, 16, 16, 17, 18, 19, 31])
        items.append(MissionItem(k + 1, command, 3, (1.0, 30.0, 120.0, 0.0), lat, lon, round(dice.uniform(50, 900), 3)))
    place = [items[0].lat_deg, items[0].lon_deg]
    fences = [MissionItem(0, 5002, 0, (4.0, 0.0, 0.0, 0.0), item.lat_deg, item.lon_deg, 0.0) for item in items[:4]]
    fences += [MissionItem(0, 5004, 0, (250.5, 0.0, 0.0, 0.0), item.lat_deg, item.lon_deg, 0.0) for item in items[4:9]]
    rally = [MissionItem(0, 5100, 3, (0.0,) * 4, item.lat_deg, item.lon_deg, 100.0) for item in items[9:12]]
    return Mission(Home(place[0], place[1], 300.0), tuple(items), number_items(fences), number_items(rally))
