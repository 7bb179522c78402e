"""Coordinates through our files into other people's importers, as whole numbers of 1e-7 degrees."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from flight.mission_files.formats import mission_text, parse_mission
from flight.mission_files.wpl import fence_text
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
