"""Mission files as QGroundControl, Mission Planner and MAVProxy write them, flown from the command line."""

import json
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from logs.recording.reader import read_log
from planfly.cli import main
from tests.soak import SOAK

MISSIONS = Path(__file__).parents[2] / "flight" / "missions"
LEGS = {
    "by_hand.waypoints": 3,
    "endless.waypoints": 7,
    "mavproxy.txt": 21,
    "mavproxy_terrain.txt": 3,
    "mission_planner.waypoints": 10,
    "mission_planner_land.waypoints": 5,
    "qgc.waypoints": 14,
    "qgc_amsl.plan": 4,
    "qgc_takeoff.plan": 7,
}
# What fails of them if ArduPlane flies: a jump without end, and a command of PX4's that ArduPlane refuses.
NOT_FLYABLE = {"endless.waypoints": "energy", "qgc.waypoints": "mission"}
# What leaves them open: a course that is the autopilot's, a climb that is too steep, a waypoint without a position.
OPEN = {
    "mission_planner.waypoints": "the take-off at waypoint 0 (item 1) is not judged",
    "qgc_takeoff.plan": "the take-off climbs 180 m in 800 m, 12.7°",
    "qgc_amsl.plan": "item 2: NAV_WAYPOINT without a position is not flown",
}
ABOVE_TERRAIN = {"mavproxy_terrain.txt"}
# One is flown without terrain, one over it, and in make soak all that can be: their items are flown in tests of
# missions, too, and all are judged below.
WITHOUT = sorted(set(LEGS) - ABOVE_TERRAIN if SOAK else {"qgc_amsl.plan"})
OVER = sorted(LEGS if SOAK else {"mavproxy_terrain.txt"})


def test_every_sample_is_listed() -> None:
    assert {path.name for path in MISSIONS.iterdir() if path.name != ".gitattributes"} == set(LEGS)


Flown = Callable[[str], tuple[int, str, Path]]


@pytest.fixture(scope="module")
def over_terrain(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """Fly a mission over terrain, once: exit code, what was printed, and the log."""

    @cache
    def fly(name: str) -> tuple[int, str, Path]:
        log = tmp_path_factory.mktemp("flown") / "flight.mcap"
        with redirect_stdout(StringIO()) as out:
            code = main(["fly", str(MISSIONS / name), "--terrain", "jacksboro", "--log", str(log)])
        return code, out.getvalue(), log

    return fly


@pytest.mark.parametrize("name", OVER)
def test_it_flies_over_terrain(name: str, over_terrain: Flown) -> None:
    code, out, log = over_terrain(name)
    why = NOT_FLYABLE.get(name)
    assert code == (3 if name in OPEN else 0 if why is None else 4), out
    first = "flyable" if why is None else f"not flyable: {why} "
    if name in OPEN:
        first = f"not judged in full: {OPEN[name]}"
    assert out.splitlines()[0].startswith(first)
    assert "terrain not judged" not in out.splitlines()[0]
    flies_all_legs(log, name)


def flies_all_legs(log: Path, name: str) -> None:
    flown = read_log(log)
    route = flown.setup.route
    # All that stands for a way back counts as one leg.
    assert (route.legs if route.rtl_start is None else route.rtl_start + 1) == LEGS[name]
    assert set(np.minimum(flown.track.leg, LEGS[name] - 1)) == set(range(LEGS[name]))


@pytest.mark.parametrize("name", WITHOUT)
def test_without_terrain_it_says_so(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "verdict.json"
    log = tmp_path / "flight.mcap"
    code = 4 if name in NOT_FLYABLE else 3 if name in OPEN else 0
    assert main(["fly", str(MISSIONS / name), "--log", str(log)]) == code
    first = capsys.readouterr().out.splitlines()[0]
    expected = {0: "flyable; terrain not judged", 3: "not judged in full: ", 4: "not flyable: "}[code]
    assert first.startswith(expected)
    flies_all_legs(log, name)
    assert main(["check", str(log), "--json", str(target)]) == code
    findings = json.loads(target.read_text(encoding="utf-8"))["findings"]
    for rule in ("clearance", "threat"):
        mine = [finding for finding in findings if finding["rule"] == rule]
        assert mine
        assert all(finding["ok"] is None and finding["reason"] for finding in mine)


@pytest.mark.parametrize("name", sorted(ABOVE_TERRAIN))
def test_heights_above_terrain_need_terrain(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fly", str(MISSIONS / name), "--log", str(tmp_path / "f.mcap")]) == 2
    assert "terrain" in capsys.readouterr().err


@pytest.mark.parametrize("name", LEGS)
def test_the_geometric_level_agrees(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["check", "--geometry", str(MISSIONS / name), "--terrain", "jacksboro"])
    out = capsys.readouterr().out
    why = NOT_FLYABLE.get(name)
    assert code == (3 if name in OPEN else 0 if why is None else 4), out
    assert out.startswith(f"not judged in full: {OPEN.get(name)}") is (name in OPEN)
    failed = [line for line in out.splitlines() if line.startswith("  failed")]
    assert all(line.startswith(tuple(f"  failed  {why}{end}" for end in " ,:")) for line in failed)


def test_wind_turns_a_verdict(over_terrain: Flown, tmp_path: Path) -> None:
    """A wind that leaves too little room or climb is told apart from calm air."""
    name = str(MISSIONS / "mavproxy_terrain.txt")
    windy = ["--wind", "9,250", "--turbulence", "moderate", "--seed", "4"]
    code = main(["fly", name, "--terrain", "jacksboro", "--log", str(tmp_path / "b.mcap"), *windy])
    calm, wind = read_log(over_terrain("mavproxy_terrain.txt")[2]), read_log(tmp_path / "b.mcap")
    assert code in (0, 4)
    assert wind.setup.scenario.wind.speed == 9.0
    assert wind.track.wind.std() > 0.3 > calm.track.wind.std()
    assert len(wind.track) != len(calm.track)
