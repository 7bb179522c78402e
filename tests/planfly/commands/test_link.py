"""``planfly link``: a flight's link by options and by a scenario; what it prints and answers; bad input."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

import planfly
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission.items import Home
from logs.recording.example_log import example_log, write_example_log
from logs.verdict.judge_flight import judge_flight
from planfly.cli import main
from tests.logs.verdict.rules.flown_circuits import flown_circuit
from tests.world.made.elevation_files import from_origin, write_raster
from world.errors import PlanflyError
from world.frames import to_map
from world.scenario import with_link

RADIO = {"frequency": 1000.0, "power": 20.0, "sensitivity": -100.0}


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return write_example_log(tmp_path / "flight.mcap")


def test_options_and_a_scenario_give_the_same_answer() -> None:
    flight = example_log()
    origin = flight.setup.scenario.origin
    by_options = planfly.link(flight, **RADIO, station=(origin.lat_deg, origin.lon_deg), antenna=20.0, fade_margin=5.0)
    entries = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -100.0, "antenna_m": 20.0}
    scenario = with_link(
        flight.setup.scenario, **entries, lat_deg=origin.lat_deg, lon_deg=origin.lon_deg, fade_margin_db=5.0
    )
    linked = replace(flight, setup=flight.setup.in_scenario(scenario))
    assert planfly.link(linked).finding == by_options.finding
    verdict = judge_flight(linked.setup, linked.track, "completed")
    assert by_options.finding in verdict.findings


def test_a_weaker_receiver_keeps_less_margin() -> None:
    """10 dB less sensitivity are 10 dB less margin at every point."""
    flight = example_log()
    origin = flight.setup.scenario.origin
    station = (origin.lat_deg, origin.lon_deg)
    strong, weak = (
        planfly.link(flight, **{**RADIO, "sensitivity": sensitivity}, station=station).along
        for sensitivity in (-100.0, -90.0)
    )
    assert strong is not None
    assert weak is not None
    assert (strong.points.margin - weak.points.margin) == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frequency": 900.0, "power": 20.0}, r"sensitivity: missing; state it, or name a scenario with \[link\]"),
        ({**RADIO, "frequency": 29.9}, "frequency 29.9: expected a frequency from 30 to 15,000 MHz"),
        ({**RADIO, "frequency": 15_001.0}, "frequency 15001.0: expected a frequency from 30 to 15,000 MHz"),
        ({**RADIO, "power": math.nan}, "power nan: expected a power from -30 to 60 dBm"),
        ({**RADIO, "station_gain": 61.0}, "station_gain 61.0: expected a gain from -20 to 60 dBi"),
        ({**RADIO, "aircraft_gain": -21.0}, "aircraft_gain -21.0: expected a gain from -20 to 60 dBi"),
        ({**RADIO, "cable_loss": -1.0}, "cable_loss -1.0: expected a loss from 0 to 60 dB"),
        ({**RADIO, "max_outage": 3601.0}, "max_outage 3601.0: expected a time from 0 to 3,600 s"),
        ({**RADIO, "use": "smoke"}, "use smoke: expected telemetry, control"),
        (
            {**RADIO, "station": (99.0, 0.0)},
            r"station \(99\.0, 0\.0\): expected latitude -89\.\.89 and longitude -180\.\.180",
        ),
        (
            {**RADIO, "station": (1.0, 2.0, 3.0)},
            r"station \(1\.0, 2\.0, 3\.0\): expected latitude -89\.\.89 and longitude -180\.\.180",
        ),
        ({**RADIO, "station": "46"}, "station 46: expected latitude -89"),
        ({**RADIO, "station": (0.0, 0.0)}, "the elevation file has no data at the ground station"),
    ],
)
def test_bad_input_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(PlanflyError, match=message) as refused:
        planfly.link(example_log(), **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "options",
    [
        ["--frequency", "60000"],
        ["--frequency", "nan"],
        ["--max-outage", "-1"],
        ["--station-gain", "high"],
        ["--use", "smoke"],
        ["--station", "99,0"],
        ["--station", "46"],
        ["--station", "0,0"],
        ["--antenna", "0"],
        ["--out", "flight.mcap"],
    ],
    ids=" ".join,
)
def test_a_bad_option_is_one_line(options: list[str], log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    radio = ["--frequency", "915", "--power", "20", "--sensitivity", "-100"]
    try:
        code: object = main(["link", str(log), *radio, *options, "--quiet"])
    except SystemExit as stopped:
        code = stopped.code
    assert code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_each_entry_of_the_budget_counts() -> None:
    """Gains add to the margin at every point; losses and the fade margin are taken from it."""
    flight = example_log()
    origin = flight.setup.scenario.origin

    def margins(**options: float) -> Any:
        found = planfly.link(flight, **RADIO, station=(origin.lat_deg, origin.lon_deg), **options)
        assert found.along is not None
        return found.along.points.margin

    bare = margins()
    for options, change in (
        ({"station_gain": 6.0}, 6.0),
        ({"aircraft_gain": 2.0}, 2.0),
        ({"cable_loss": 3.0}, -3.0),
        ({"fade_margin": 14.0}, -4.0),
    ):
        assert margins(**options) == pytest.approx(bare + change)


@pytest.mark.usefixtures("blank_pictures")
def test_the_command_prints_answers_and_draws(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    origin = example_log().setup.scenario.origin
    radio = ["--frequency", "1000", "--power", "-30", "--sensitivity", "-30"]
    place = ["--station", f"{origin.lat_deg},{origin.lon_deg}"]
    assert main(["link", str(log), *radio, *place, "--out", "drawn", "--json", "answer.json"]) == 4
    out = capsys.readouterr().out
    assert "It is lowest on leg 0 (to item 2) at 0 s" in out
    answer = json.loads(Path("answer.json").read_text(encoding="utf-8"))
    assert (answer["ok"], answer["exit_code"], answer["where"]) == (False, 4, "leg 0 (to item 2)")
    names = ("link.png", "link-map.png", "link-coverage.tif")
    assert answer["files"] == [str(Path("drawn") / name) for name in names]
    assert all(Path(name).exists() for name in answer["files"])
    # The whole flight is one outage, at its worst at its start.
    (outage,) = answer["outages"]
    track = example_log().track
    east, north = to_map(origin, outage["lat_deg"], outage["lon_deg"])
    assert (outage["first_s"], outage["last_s"]) == (0.0, float(track.time[-1]))
    assert (float(east), float(north)) == pytest.approx(track.position[0, :2].tolist(), abs=0.1)
    assert outage["margin_db"] == pytest.approx(answer["facts"]["smallest margin left after the fade margin"], abs=0.01)
    assert main(["link", str(log), *radio[:4]]) == 2
    assert "--sensitivity: missing; state it, or name a scenario with [link]" in capsys.readouterr().err


def test_the_coverage_has_the_margin_of_the_path_below_it(log: Path) -> None:
    """The flight is level: in the cell of a point of the path the margin is that of the path, within the cell."""
    flight = example_log()
    origin = flight.setup.scenario.origin
    found = planfly.link(log, **RADIO, station=(origin.lat_deg, origin.lon_deg), out="drawn")
    assert found.along is not None
    assert found.antenna is not None
    with rasterio.Env(), rasterio.open("drawn/link-coverage.tif") as file:
        far = found.along.points.distance > 400.0
        places = [tuple(place) for place in found.along.positions[far, :2].tolist()]
        values = np.array([value[0] for value in file.sample(places)])
        cell = file.res[0]
    # Half a cell's diagonal at 400 m is so many dB of free space.
    assert cell < 40.0
    assert values == pytest.approx(found.along.points.margin[far], abs=20.0 * math.log10(1.0 + 0.75 * cell / 400.0))


def test_the_returns_from_an_outage_are_those_of_planfly_returns() -> None:
    """Judge each of ArduPlane's returns without the link as `planfly returns` judges it."""
    flight = example_log()
    parameters = ArduPilotParameters.from_text("FS_GCS_ENABL 1\nFS_LONG_ACTN 1\n", "mine.param")
    origin = flight.setup.scenario.origin
    mission = replace(flight.setup.mission, home=Home(origin.lat_deg, origin.lon_deg, 0.0))
    setup = replace(flight.setup, autopilot=ArduPlane(parameters), mission=mission)
    flight = replace(flight, setup=setup)
    found = planfly.link(flight, **{**RADIO, "power": -30.0, "sensitivity": -30.0}, max_outage=3600.0)
    assert found.finding.ok is False
    assert found.returns is not None
    every = {ret.time: ret for ret in planfly.returns(flight).returns.each}
    assert len(found.returns.each) > 20
    assert [repr(every[ret.time]) for ret in found.returns.each] == [repr(ret) for ret in found.returns.each]
    assert found.return_lines
    assert all(line.startswith("return from ") for line in found.return_lines)


def test_a_link_by_options_is_judged_as_the_verdict_judges_a_mission_from_the_ground() -> None:
    """Take-off and landing are part of the link."""
    flown = flown_circuit()
    log = replace(example_log(), setup=flown.setup, track=flown.track, ended=flown.flight.ended)
    origin = flown.setup.scenario.origin
    found = planfly.link(log, **RADIO, station=(origin.lat_deg, origin.lon_deg))
    verdict = judge_flight(found.setup, flown.track, flown.flight.ended)
    assert found.finding in verdict.findings
    assert found.along is not None
    assert (found.along.time[0], found.along.time[-1]) == (flown.track.time[0], flown.track.time[-1])


# ----------------------------------------------------------------------
# A station far from the mission: the elevation file knows the ground there, 100 m, and 4.4 km further north, 200 m.

FAR_MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t100.0\t1
1\t0\t3\t16\t0\t0\t0\t0\t47.04\t8.005\t400.0\t1
2\t0\t3\t16\t0\t0\t0\t0\t47.04\t7.995\t400.0\t1
"""
LINKED_SCENARIO = """name = "linked"
origin = {lat_deg = 47.0, lon_deg = 8.0}
terrain = {kind = "dem", path = "ground.tif"}
area = {east_m = [-1000, 1000], north_m = [4000, 5000]}
start = {east_m = 380, north_m = 4447, amsl_m = 400}
destination = {east_m = -380, north_m = 4447, amsl_m = 400}
link = {frequency_mhz = 1000, power_dbm = 20, sensitivity_dbm = -100}
"""


@pytest.fixture
def far(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the mission, an elevation file of 46.98 to 47.07 degrees, and a scenario with a link."""
    monkeypatch.chdir(tmp_path)
    heights = np.full((108, 96), 100.0, dtype=np.float32)
    heights[:54] = 200.0
    write_raster(tmp_path / "ground.tif", heights, "EPSG:4326", from_origin(7.96, 47.07, 1 / 1200.0, 1 / 1200.0))
    (tmp_path / "far.waypoints").write_text(FAR_MISSION)
    (tmp_path / "linked.toml").write_text(LINKED_SCENARIO)
    return tmp_path


@pytest.mark.parametrize("station", [None, (47.0, 8.0), (46.99, 8.01)])
def test_the_ground_at_a_station_far_from_the_mission_is_read(station: tuple[float, float] | None, far: Path) -> None:
    """The station stands at home, or where an option states it, on 100 m with an antenna of 3 m."""
    found = planfly.link("far.waypoints", terrain="ground.tif", **RADIO, station=station)
    assert found.antenna is not None
    origin = found.setup.scenario.origin
    expected = to_map(origin, *(station or (47.0, 8.0)))
    assert found.antenna == pytest.approx([float(expected[0]), float(expected[1]), 103.0], abs=0.01)
    assert found.along is not None
    # Free space and the step of the ground: the margin is known along the whole path.
    assert np.isfinite(found.along.points.margin).all()
    assert found.along.points.distance.min() > 4000.0


def test_the_command_reads_the_ground_at_the_station(far: Path, capsys: pytest.CaptureFixture[str]) -> None:
    radio = ["--frequency", "1000", "--power", "20", "--sensitivity", "-100"]
    assert main(["link", "far.waypoints", "--terrain", "ground.tif", *radio, "--quiet", "--json", "answer.json"]) != 3
    assert json.loads(Path("answer.json").read_text(encoding="utf-8"))["ok"] is not None
    assert "unknown" not in capsys.readouterr().out


@pytest.mark.parametrize("place", ["", ", lat_deg = 47.0, lon_deg = 8.0", ", east_m = 0, north_m = 0"])
def test_the_ground_at_a_scenarios_station_is_read(place: str, far: Path) -> None:
    """The scenario's area begins 4 km north of the station, which stands at the mission's home or where it states."""
    (far / "linked.toml").write_text(LINKED_SCENARIO.replace("-100}", f"-100{place}}}"))
    judged = planfly.judge("far.waypoints", scenario="linked.toml", geometry=True)
    (finding,) = (finding for finding in judged.verdict.findings if finding.rule == "link")
    assert finding.ok is not None
    assert planfly.link("far.waypoints", scenario="linked.toml").finding.ok is not None


@pytest.mark.parametrize("station", [(46.5, 8.0), (0.0, 0.0), (-47.0, -172.0)])
def test_a_station_beyond_the_elevation_file_is_refused(station: tuple[float, float], far: Path) -> None:
    with pytest.raises(PlanflyError, match="the elevation file has no data at the ground station"):
        planfly.link("far.waypoints", terrain="ground.tif", **RADIO, station=station)


def test_a_flight_without_its_elevation_file_keeps_its_terrain(far: Path) -> None:
    """The ground at home was read for the flight; a station beyond it is refused with the file's name."""
    flown = planfly.fly("far.waypoints", terrain="ground.tif")
    (far / "ground.tif").unlink()
    assert planfly.link(flown, **RADIO).finding.ok is not None
    # 11 km south of home, beyond the margin of 2 km.
    with pytest.raises(PlanflyError, match=r"ground\.tif"):
        planfly.link(flown, **RADIO, station=(46.9, 8.0))
