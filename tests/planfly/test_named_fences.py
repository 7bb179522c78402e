"""``--fence``: fences named beside a mission, a plan or a log, by every command that takes them."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from flight.mission_files.formats import read_fence, read_mission
from logs.recording.reader import read_log
from planfly.cli import main
from planfly.named_fences import read_named_fences
from planfly.served_flights import ServeOptions, open_served
from planner.plan import plan_json
from tests.mission_lines import a_plan
from world.errors import MissionError
from world.frames import GeoOrigin, to_geo

ORIGIN = GeoOrigin(36.5, -84.2)
HEAD = "QGC WPL 110\n"
LENGTH, RADIUS = 3000.0, 200.0


def degrees(east: float, north: float) -> tuple[float, float]:
    lat, lon = to_geo(ORIGIN, east, north)
    return float(lat), float(lon)


def row(seq: int, frame: int, command: int, p1: float, east: float, north: float, up: float) -> str:
    lat, lon = degrees(east, north)
    return f"{seq}\t0\t{frame}\t{command}\t{p1:g}\t0\t0\t0\t{lat:.8f}\t{lon:.8f}\t{up:g}\t1\n"


def circle(north: float, command: int = 5004) -> str:
    """A fence of one circle half way along the leg, with its centre so far beside it."""
    return HEAD + row(0, 0, command, RADIUS, 0.5 * LENGTH, north, 0.0)


def feature(ceiling: float) -> str:
    """A square across the leg's middle, as GeoJSON, up to a height above the sea."""
    ring = [degrees(0.5 * LENGTH + east, north)[::-1] for east, north in ((-90, -90), (90, -90), (90, 90), (-90, 90))]
    geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    return json.dumps(
        {"type": "Feature", "properties": {"name": "mill", "ceiling_amsl_m": ceiling}, "geometry": geometry}
    )


@pytest.fixture
def mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A leg of 3 km to the east at 700 m."""
    monkeypatch.chdir(tmp_path)
    rows = [row(0, 0, 16, 0, 0.0, 0.0, 300.0), row(1, 0, 16, 0, 0.0, 0.0, 700.0), row(2, 0, 16, 0, LENGTH, 0.0, 700.0)]
    (tmp_path / "leg.waypoints").write_text(HEAD + "".join(rows), encoding="ascii")
    return tmp_path / "leg.waypoints"


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("inside.fence", circle(RADIUS - 5.0), 4),
        ("outside.fence", circle(RADIUS + 5.0), 0),
        ("inside.txt", circle(-RADIUS + 5.0), 4),
        ("left.waypoints", circle(0.0, 5003), 4),
        ("above.geojson", feature(705.0), 4),
        ("below.geojson", feature(695.0), 0),
    ],
)
def test_a_mission_is_judged_by_the_fence_that_is_named(name: str, text: str, code: int, mission: Path) -> None:
    Path(name).write_text(text, encoding="ascii")
    assert main(["check", str(mission)]) == 0
    assert main(["check", str(mission), "--fence", name, "--json", "v.json"]) == code
    found = json.loads(Path("v.json").read_text(encoding="utf-8"))["findings"]
    assert [item["ok"] for item in found if item["rule"] == "fence"] == [code == 0]


def test_fences_join_the_missions_own_and_each_other(mission: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission.write_text(mission.read_text() + row(3, 0, 5004, RADIUS, 0.5 * LENGTH, 5.0 + RADIUS, 0.0), encoding="ascii")
    Path("a.fence").write_text(circle(RADIUS - 5.0), encoding="ascii")
    Path("b.geojson").write_text(feature(705.0), encoding="ascii")
    command = ["check", str(mission), "--fence", "a.fence", "--fence", "b.geojson", "--json", "v.json"]
    assert main(command) == 4
    assert "its own fence of 1 items counts beside the one named" in capsys.readouterr().err
    found = json.loads(Path("v.json").read_text(encoding="utf-8"))["findings"]
    failed = [item["where"] for item in found if item["rule"] == "fence" and item["ok"] is False]
    assert failed == ["mill (exclusion)", "fence item 1 (exclusion)"]


def test_a_flight_keeps_the_fence_in_its_log_and_a_log_takes_another(mission: Path) -> None:
    Path("away.fence").write_text(circle(1000.0), encoding="ascii")
    Path("through.fence").write_text(circle(0.0), encoding="ascii")
    Path("mill.geojson").write_text(feature(650.0), encoding="ascii")
    options = ["--fence", "away.fence", "--fence", "mill.geojson"]
    assert main(["fly", str(mission), *options, "--guidance", "path", "--log", "f.mcap", "--log-hz", "10"]) == 0
    setup = read_log(Path("f.mcap")).setup
    assert (len(setup.mission.fences), [zone.name for zone in setup.scenario.zones]) == (1, ["mill"])
    assert main(["check", "f.mcap"]) == 0
    assert main(["check", "f.mcap", "--fence", "through.fence"]) == 4
    assert main(["check", "f.mcap", "--fence", "mill.geojson"]) == 0


def test_export_writes_the_fence_that_is_named(mission: Path) -> None:
    Path("a.fence").write_text(circle(1000.0), encoding="ascii")
    Path("mill.geojson").write_text(feature(650.0), encoding="ascii")
    options = ["--fence", "a.fence", "--fence", "mill.geojson"]
    assert main(["export", str(mission), "out.plan", "out.fence", *options]) == 0
    items = read_fence(Path("out.fence"))
    assert [item.command for item in items] == [5004, 5002, 5002, 5002, 5002]
    # A .plan has its polygons before its circles.
    assert [replace(item, seq=0) for item in read_mission(Path("out.plan")).fences] == [
        replace(item, seq=0) for item in (*items[1:], items[0])
    ]
    assert main(["export", str(mission), "map.kml", *options]) == 0
    text = Path("map.kml").read_text(encoding="utf-8")
    assert "fence item 0 (keep out)" in text
    assert "mill (keep out)" in text


def test_export_of_a_plan_adds_the_fence_to_area_and_threats(mission: Path) -> None:
    plan = mission.parent / "plan.json"
    plan.write_text(plan_json(a_plan([(9500.0, -5000.0, 700.0), (9000.0, -3000.0, 750.0), (6000.0, -2000.0, 800.0)])))
    Path("a.fence").write_text(circle(0.0), encoding="ascii")
    assert main(["export", str(plan), "without.fence"]) == 0
    assert main(["export", str(plan), "with.fence", "with.kml", "--fence", "a.fence"]) == 0
    without, with_it = read_fence(Path("without.fence")), read_fence(Path("with.fence"))
    assert with_it[: len(without)] == without
    assert [(item.command, item.params[0]) for item in with_it[len(without) :]] == [(5004, RADIUS)]


def test_serve_begins_with_the_fence_that_is_named(mission: Path) -> None:
    Path("a.fence").write_text(circle(0.0), encoding="ascii")
    Path("mill.geojson").write_text(feature(650.0), encoding="ascii")
    fences = read_named_fences(["a.fence", "mill.geojson"])
    served = open_served(ServeOptions(str(mission), None, None, 1.0, Path("logs"), {}, fences))
    assert served.mission is not None
    assert len(served.mission.fences) == 1
    assert [zone.name for zone in served.scenario.zones] == ["mill"]


def test_a_file_that_holds_no_fence_is_named(mission: Path) -> None:
    with pytest.raises(MissionError, match=r"leg\.waypoints: no fence in it"):
        read_named_fences([str(mission)])
