"""Coordinates through our files into other people's importers, as whole numbers of 1e-7 degrees."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flight.mission.items import MissionItem
from flight.mission_files.formats import fence_text, mission_text, parse_mission
from tests.flight.mission_files.worldwide_mission import some_mission

IMPORTERS = Path(__file__).parents[2] / "clients" / "mavsdk_import.py"


@pytest.mark.client
def test_mavsdk_importers_get_the_same_integers(tmp_path: Path) -> None:
    pytest.importorskip("mavsdk")
    mission = some_mission(400)
    names = []
    for kind in ("plan", "waypoints"):
        file = tmp_path / f"a.{kind}"
        file.write_text(mission_text(mission, kind), encoding="ascii", newline="")  # type: ignore[arg-type]  # a FileKind
        names.append(str(file))
    done = subprocess.run(
        [sys.executable, str(IMPORTERS), *names], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr[-1000:]
    plan, waypoints = json.loads(done.stdout.splitlines()[-1])
    wanted = [(int(item.frame), item.command, item.x, item.y) for item in mission.items]
    assert [tuple(row[1:5]) for row in plan[0]] == wanted
    # Mission Planner's importer keeps the home line as item 0.
    assert [tuple(row[1:5]) for row in waypoints[0]][-len(wanted) :] == wanted
    assert [tuple(row[2:5]) for row in plan[1]] == [(item.command, item.x, item.y) for item in mission.fences]
    assert [tuple(row[2:5]) for row in plan[2]] == [(item.command, item.x, item.y) for item in mission.rally]


def test_pymavlink_loads_fences_as_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fence file has no home line: pymavlink, and MAVProxy with it, would send that to the fence."""
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink import mavutil, mavwp

    # Another test may have loaded the first version's messages.
    mavutil.set_dialect("ardupilotmega")

    mission = some_mission(30)
    text = fence_text(mission)
    assert parse_mission(text, "a.fence").fences == mission.fences
    loader = mavwp.MissionItemProtocol_Fence()
    file = tmp_path / "a.fence"
    file.write_text(text)
    assert loader.load(str(file)) == len(mission.fences)
    assert [loader.wp(k).command for k in range(loader.count())] == [item.command for item in mission.fences]
    assert [round(loader.wp(k).x * 1e7) for k in range(loader.count())] == [item.x for item in mission.fences]


# Mission Planner's `MissionFile` (ExtLibs/Utilities, MissionFile.cs): its reader, Json.NET, takes no "25.0" for an int
# and no null for a double.
_MISSION_PLANNER: dict[str, Any] = {
    "version": int,
    "fileType": str,
    "groundStation": str,
    "geoFence": {
        "version": int,
        "circles": [{"circle": {"center": [float], "radius": float}, "inclusion": bool, "version": int}],
        "polygons": [{"inclusion": bool, "polygon": [[float]], "version": int}],
    },
    "mission": {
        **dict.fromkeys(("cruiseSpeed", "firmwareType", "hoverSpeed", "vehicleType", "version"), int),
        "plannedHomePosition": [float],
        "items": [
            {
                **dict.fromkeys(("command", "doJumpId", "frame"), int),
                "autoContinue": bool,
                "type": str,
                "params": [float | None],
            }
        ],
    },
    "rallyPoints": {"points": [[float]], "version": int},
}


def mismatches(value: Any, kind: Any, where: str = "") -> list[str]:
    """Places where a JSON value does not fit a C# class; keys that the class does not have are ignored."""
    if isinstance(kind, dict):
        return [line for key, part in kind.items() for line in mismatches(value[key], part, f"{where}.{key}")]
    if isinstance(kind, list):
        return [line for k, part in enumerate(value) for line in mismatches(part, kind[0], f"{where}[{k}]")]
    numbers = kind in (float, float | None) and type(value) is int
    return [] if numbers or (isinstance(value, kind) and not (kind is int and type(value) is bool)) else [where]


@pytest.mark.parametrize("speed", [12.4, 25.0, None])
def test_mission_planners_classes_take_what_is_written(speed: float | None) -> None:
    mission = some_mission(30)
    loose = MissionItem(9, 5100, 3, (0.0,) * 4, 46.0, 8.0, math.nan)
    mission = replace(mission, cruise_speed=speed, rally=(*mission.rally, loose))
    written = json.loads(mission_text(mission, "plan"))
    assert mismatches(written, _MISSION_PLANNER) == []
    assert written["mission"]["cruiseSpeed"] == {12.4: 12, 25.0: 25, None: written["mission"]["cruiseSpeed"]}[speed]
    assert mismatches({**written, "version": 1.0}, _MISSION_PLANNER) == [".version"]
