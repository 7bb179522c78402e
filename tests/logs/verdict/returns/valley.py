"""A mission along a valley of measured terrain, whose landing sequence has a low approach."""

from pathlib import Path

import numpy as np

from world.frames import to_geo
from world.scenario import load_scenario


def valley_mission(folder: Path) -> Path:
    """Write a mission along the valley of the elevation file `jacksboro`, which is 325 m to 356 m high there.

    It flies 2 km west at 600 m.  Its approach begins at 460 m, 2.1 km before the landing point, and then sinks to 10 m
    above the ground, below the 30 m that are required before it.
    """
    scenario = load_scenario("jacksboro")
    assert scenario.terrain is not None

    def line(number: int, command: int, east: float, amsl: float) -> str:
        lat, lon = to_geo(scenario.origin, east, 3000.0)
        return f"{number}\t{int(number == 0)}\t0\t{command}\t0\t0\t0\t0\t{lat:.7f}\t{lon:.7f}\t{amsl:g}\t1\n"

    home, low, field = scenario.terrain.height(np.array([9500.0, 5200.0, 4400.0]), np.full(3, 3000.0)).tolist()
    route = line(0, 16, 9500.0, home) + line(1, 16, 9000.0, 600.0) + line(2, 16, 7000.0, 600.0)
    mark = "3\t0\t0\t189\t0\t0\t0\t0\t0\t0\t0\t1\n"
    approach = mark + line(4, 16, 6500.0, 460.0) + line(5, 16, 5200.0, low + 10.0) + line(6, 21, 4400.0, field)
    file = folder / "valley.waypoints"
    file.write_text("QGC WPL 110\n" + route + approach, encoding="utf-8")
    return file
