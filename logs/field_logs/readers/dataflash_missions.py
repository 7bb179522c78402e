"""Missions of ArduPilot's dataflash logs: the messages CMD, and home from ORGN where they hold none."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Home, MissionItem, on_grid
from logs.field_logs.raw_log import LoggedMission
from logs.field_logs.readers.dataflash_frames import Messages
from logs.field_logs.readers.logged_items import Item, gather_items, logged_mission

Floats = NDArray[np.float64]

_NUMBERS = ("CNum", "CId", "Prm1", "Prm2", "Prm3", "Prm4", "Lat", "Lng", "Alt")
# ORGN.Type of home; the other is where the estimator's map has its origin.
_HOME = 1


def dataflash_missions(commands: Messages, time: Floats, origins: Messages, source: str) -> Iterator[LoggedMission]:
    """Missions in the order in which they were logged: each whole, items that are flown again left out.

    commands: CMD.  time: (n,) s, of each.  origins: ORGN.  source: the log's name.

    >>> none = Messages(np.zeros(0, np.int64), np.zeros(0, np.dtype([])), {})
    >>> list(dataflash_missions(none, np.zeros(0), none, "a.BIN"))
    []
    """
    if not commands.has(*_NUMBERS):
        return
    framed = commands.has("Frame")
    table = [commands.column(name).tolist() for name in _NUMBERS]
    frames = commands.column("Frame").tolist() if framed else [3.0] * len(commands)
    totals = commands.column("CTot").tolist() if commands.has("CTot") else [0.0] * len(commands)
    rows = []
    for row, (stamp, total, frame) in enumerate(zip(time.tolist(), totals, frames, strict=True)):
        number, command, p1, p2, p3, p4, lat, lon, up = (column[row] for column in table)
        # A float32 has seven digits; a mission file has six behind the point.
        place = (on_grid(lat), on_grid(lon), round(up, 6))
        item = MissionItem(int(number), int(command), int(frame), (p1, p2, p3, p4), *place)
        rows.append(Item(stamp, int(total), item))
    for start, items in gather_items(rows):
        made = logged_mission(items, f"{source}: CMD")
        if made is not None:
            made = made if made.home is not None else replace(made, home=_home(origins))
            notes = () if framed else ("the log states no frames: heights are taken as above home",)
            yield LoggedMission(start, replace(made, warnings=(*made.warnings, *notes)), "CMD")


def _home(origins: Messages) -> Home | None:
    """Home as the vehicle last had it."""
    if not origins.has("Type", "Lat", "Lng", "Alt"):
        return None
    homes = origins.only(origins.column("Type") == _HOME)
    if not len(homes):
        return None
    lat, lon, up = (float(homes.column(name)[-1]) for name in ("Lat", "Lng", "Alt"))
    known = np.isfinite([lat, lon, up]).all() and abs(lat) <= 90.0 and abs(lon) <= 180.0 and (lat, lon) != (0.0, 0.0)
    return Home(on_grid(lat), on_grid(lon), up) if known else None
