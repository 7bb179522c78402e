"""Flights in a forecast: the wind that they meet, and what their logs and plans keep of it."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import planfly
from logs.recording.reader import read_log
from logs.verdict.returns.judge_returns import judge_returns, make_return_world
from logs.verdict.returns.return_starts import planned_starts
from planfly.cli import main
from planfly.rtl.jsbsim_returns import LEAD_IN_LENGTH_M, return_setup
from tests.world.made.forecast_files import HEIGHTS, ISSUED, open_meteo_answer, wind_dataset, write_json, write_netcdf
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo

AT = f"{ISSUED}Z"
# Resolution of a track's wind.
LOG_QUANTUM_MPS = 1e-3
# Around 46 N, 8 E.
SCENARIO = """\
name = "valley"
[terrain]
kind = "flat"
amsl_m = 100
[origin]
lat_deg = 46.0
lon_deg = 8.0
[area]
east_m = [-3000, 3000]
north_m = [-2500, 2500]
ceiling_amsl_m = 800
[start]
east_m = 0
north_m = 0
amsl_m = 180
[destination]
east_m = 1500
north_m = 0
amsl_m = 180
[limits]
min_clearance_m = 60
"""
# East, then north-west and up.
MISSION = """\
QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t180\t1
2\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.0194\t200\t1
3\t0\t0\t16\t0\t0\t0\t0\t46.0135\t8.0065\t260\t1
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a mission and its scenario, as the working folder."""
    (tmp_path / "valley.toml").write_text(SCENARIO, encoding="utf-8")
    (tmp_path / "valley.waypoints").write_text(MISSION, encoding="ascii")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fly(**options: Any) -> planfly.FlownMission:
    return planfly.fly("valley.waypoints", scenario="valley.toml", **options)


def varied_winds() -> xarray.Dataset:
    """Winds that differ along every axis, by up to 6 m/s."""
    t, k, y, x = np.ogrid[0:4, 0:4, 0:5, 0:7]
    return wind_dataset(
        2.0 + 1.5 * np.sin(2.0 * t + x) + k + 0.5 * y,
        -1.0 + 3.0 * np.cos(3.0 * x + y) - 0.4 * k * np.cos(t),
        # Levels above the sea, the lowest above the start.
        kind="altitude",
        levels=(150.0, 210.0, 240.0, 800.0),
        hours=(0.0, 0.02, 0.04, 1.0),
    )


# ----------------------------------------------------------------------
# The wind that is flown in.


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "planfly"])
@pytest.mark.parametrize("write", ["NetCDF", "Open-Meteo"])
def test_a_wind_that_is_the_same_everywhere_is_the_stated_wind(autopilot: str, write: str, folder: Path) -> None:
    speed, from_deg = 6.0, 250.0
    u, v = (-speed * function(math.radians(from_deg)) for function in (math.sin, math.cos))
    dataset = wind_dataset(u, v)
    file = (
        write_netcdf(folder / "a.nc", dataset)
        if write == "NetCDF"
        else write_json(folder / "a.json", open_meteo_answer(dataset, 46.0, 8.0, 100.0))
    )
    forecast = fly(autopilot=autopilot, forecast=file, at=AT, turbulence="light")
    stated = fly(autopilot=autopilot, wind=(speed, from_deg), at=AT, turbulence="light")
    assert forecast.setup.scenario.wind.field is None
    for name in ("time", "position", "velocity", "attitude", "wind", "energy"):
        assert getattr(forecast.track, name).tobytes() == getattr(stated.track, name).tobytes(), name
    assert forecast.verdict.findings == stated.verdict.findings


def map_angle(origin: GeoOrigin, position: Floats) -> Floats:
    """Return the map course of true north at positions (n, 3), rad, from a step of 1 m along the map's north."""
    start, end = (to_geo(origin, position[:, 0], position[:, 1] + step) for step in (-0.5, 0.5))
    east = (end[1] - start[1]) * np.cos(np.radians(start[0]))
    return np.asarray(-np.arctan2(east, end[0] - start[0]))


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_flown_wind_is_what_xarray_interpolates_along_the_track(autopilot: str, folder: Path) -> None:
    file = write_netcdf(folder / "a.nc", varied_winds())
    flown = fly(autopilot=autopilot, forecast=file, at=AT)
    assert flown.ended == "completed"
    track, origin = flown.track, flown.setup.scenario.origin
    position = track.position.astype(np.float64)
    latitudes, longitudes = to_geo(origin, position[:, 0], position[:, 1])
    coordinates = {
        "time": np.datetime64(ISSUED, "ns") + (track.time * 1e9).round().astype("timedelta64[ns]"),
        "altitude": np.clip(position[:, 2], 150.0, 800.0),
        "latitude": latitudes,
        "longitude": longitudes,
    }
    with xarray.open_dataset(file, engine="h5netcdf") as read:
        found = read.interp({name: xarray.DataArray(values, dims="row") for name, values in coordinates.items()})
        east, north = found.u.values, found.v.values
    angle = map_angle(origin, position)
    expected = np.column_stack(
        [east * np.cos(angle) + north * np.sin(angle), north * np.cos(angle) - east * np.sin(angle)]
    )
    assert np.ptp(expected, axis=0).min() > 0.5
    # The wind acts from the next step of the flight model on.
    difference = track.wind[1:, :2] - expected[:-1]
    assert np.abs(difference).max() < 0.5 * LOG_QUANTUM_MPS + 2e-5
    assert np.abs(difference.mean(axis=0)).max() < 2e-5


def test_below_and_above_the_levels_the_wind_of_the_nearest_level_applies(folder: Path) -> None:
    """Its mean profile, which the planner reads, has a gradient that does not go on there."""
    u = np.array([4.0, 9.0])[:, np.newaxis, np.newaxis]
    file = write_netcdf(folder / "a.nc", wind_dataset(u, 0.0, kind="altitude", levels=(230.0, 300.0)))
    flown = fly(autopilot="planfly", forecast=file, at=AT)
    assert flown.setup.scenario.wind.gradient > 0.01
    is_below = flown.track.position[:, 2] < 229.0
    assert is_below.sum() > 100
    np.testing.assert_allclose(flown.track.wind[is_below, 0], 4.0, atol=2e-3)


def test_a_head_wind_that_comes_up_leaves_the_flight_its_time(folder: Path) -> None:
    """Calm at the start; at 4 m/s over the ground, the first leg of 1.5 km then takes five minutes instead of one."""
    u = np.array([0.0, -21.0, -21.0])[:, np.newaxis, np.newaxis, np.newaxis]
    file = write_netcdf(folder / "a.nc", wind_dataset(u, 0.0, hours=(0.0, 0.005, 2.0)))
    flown = fly(autopilot="planfly", forecast=file, at=AT)
    assert flown.ended == "completed"
    assert flown.track.time[-1] > 300.0


@pytest.mark.parametrize("longitude", [179.99, 180.0])
@pytest.mark.parametrize("grid", [np.arange(0.0, 360.0, 0.25), np.arange(-180.0, 180.0, 0.25)], ids=["0", "-180"])
def test_a_mission_across_the_antimeridian(longitude: float, grid: Floats, folder: Path) -> None:
    u = np.broadcast_to(5.0 + 4.0 * np.abs((grid % 360.0) - 180.0), (2, 2, 5, len(grid)))
    dataset = wind_dataset(u, 1.0, kind="altitude", levels=(100.0, 800.0), hours=(0.0, 3.0), longitudes=grid)
    file = write_netcdf(folder / "a.nc", dataset)
    text = SCENARIO.replace("lon_deg = 8.0", f"lon_deg = {longitude}")
    (folder / "valley.toml").write_text(text, encoding="utf-8")
    mission = MISSION
    for stated in ("8.0194", "8.0065", "8.0"):
        near = (longitude + float(stated) - 8.0 + 180.0) % 360.0 - 180.0
        mission = mission.replace(f"\t{stated}\t", f"\t{near:.6f}\t")
    (folder / "valley.waypoints").write_text(mission, encoding="ascii")
    flown = fly(autopilot="planfly", forecast=file, at=AT)
    assert flown.ended == "completed"
    degrees = longitude + flown.track.position[:, 0] / (111_319.5 * math.cos(math.radians(46.0)))
    # The peak between two nodes is cut; all that is near it is below 1 m/s of the nodes' line.
    offset = np.abs((degrees % 360.0) - 180.0)
    assert np.abs(flown.track.wind[5:, 0] - (5.0 + 4.0 * offset)[5:]).max() < 0.02
    assert offset.min() < 0.002


# ----------------------------------------------------------------------
# What is kept of it.


def test_a_log_has_the_wind_of_its_flight_without_the_forecast(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_netcdf(folder / "a.nc", varied_winds())
    flown = fly(forecast=file, at=AT, log="a.mcap")
    capsys.readouterr()
    file.unlink()
    log = planfly.read_log("a.mcap")
    assert log.setup.scenario.wind == flown.setup.scenario.wind
    assert log.setup.scenario.wind.field is not None
    assert log.setup.scenario.wind.forecast == flown.setup.scenario.wind.forecast
    assert main(["check", "a.mcap", "--json", "check.json"]) == (0 if flown.verdict.flyable else 4)
    answer = json.loads((folder / "check.json").read_text())
    assert "forecast a.nc" in answer["conditions"]["forecast"]
    judged = planfly.check("a.mcap")
    assert judged.findings == flown.verdict.findings


def test_a_log_in_a_uniform_forecast_names_it(folder: Path) -> None:
    file = write_netcdf(folder / "a.nc", wind_dataset(5.0, 0.0))
    flown = fly(forecast=file, at=AT, log="a.mcap")
    file.unlink()
    wind = read_log(folder / "a.mcap").setup.scenario.wind
    assert wind == flown.setup.scenario.wind
    assert wind.forecast is not None
    assert wind.forecast.source == "a.nc"


@pytest.mark.parametrize("suffix", [".nc", ".json"])
def test_a_plan_in_a_forecast_of_its_scenario_flies(suffix: str, folder: Path) -> None:
    """The scenario names the forecast by a path relative to itself."""
    (folder / "weather").mkdir()
    dataset = wind_dataset(5.0, np.array([0.0, 1.0, 2.0, 3.0])[:, np.newaxis, np.newaxis])
    if suffix == ".nc":
        write_netcdf(folder / "weather" / "a.nc", dataset)
    else:
        write_json(folder / "weather" / "a.json", open_meteo_answer(dataset, 46.0, 8.0, 100.0))
    text = f'at = "{AT}"\n{SCENARIO}[wind]\nforecast = "weather/a{suffix}"\n[planner]\ngenerations = 20\n'
    (folder / "valley.toml").write_text(text, encoding="utf-8")
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(elsewhere)
        plan = planfly.plan("../valley.toml", seed=1, out="plan.json")
        flown = planfly.fly("plan.json")
    wind = flown.setup.scenario.wind
    assert wind == plan.scenario.wind
    # The levels are 110 to 900 m AMSL: at 180 m, 0.78 m/s to the north.
    assert flown.setup.scenario.wind_velocity((0.0, 0.0, 180.0)) == pytest.approx((5.0, 70.0 / 90.0), abs=1e-4)
    stored = json.loads((elsewhere / "plan.json").read_text())["scenario"]["wind"]
    assert stored["forecast"] == str(folder / "weather" / f"a{suffix}")


def test_a_stated_wind_replaces_the_forecast_of_a_plan(folder: Path) -> None:
    dataset = wind_dataset(np.array([2.0, 5.0, 8.0, 12.0])[:, np.newaxis, np.newaxis], 0.0)
    write_netcdf(folder / "a.nc", dataset)
    (folder / "valley.toml").write_text(f'at = "{AT}"\n{SCENARIO}[wind]\nforecast = "a.nc"\n', encoding="utf-8")
    assert fly().setup.scenario.wind.gradient > 0.0
    wind = fly(wind=(3.0, 90.0)).setup.scenario.wind
    assert (wind.speed, wind.gradient, wind.field, wind.forecast) == (3.0, 0.0, None, None)


# ----------------------------------------------------------------------
# What decides whether a forecast covers a mission.


def longer_mission(seconds: float) -> str:
    """Return the mission with a loiter for a time at its second waypoint."""
    return MISSION.replace("2\t0\t0\t16\t0", f"2\t0\t0\t19\t{seconds:.0f}")


@pytest.mark.parametrize(("minutes", "is_covered"), [(40, True), (70, False)])
def test_a_loiter_takes_its_time(minutes: int, is_covered: bool, folder: Path) -> None:
    """The forecast ends an hour after the take-off; the legs take two minutes."""
    (folder / "valley.waypoints").write_text(longer_mission(60.0 * minutes), encoding="ascii")
    file = write_netcdf(folder / "a.nc", wind_dataset(5.0, 0.0, hours=(0.0, 1.0)))
    if is_covered:
        assert planfly.judge("valley.waypoints", scenario="valley.toml", forecast=file, at=AT) is not None
    else:
        with pytest.raises(planfly.ForecastError, match=r"time: 2026-05-01 06:00 UTC: the flight takes 7\d\.\d min"):
            planfly.judge("valley.waypoints", scenario="valley.toml", forecast=file, at=AT)


def test_levels_above_ground_count_where_the_mission_is(folder: Path) -> None:
    """A mountain of the forecast's model next to the mission raises the lowest level there alone."""
    ground = np.full((5, 7), 100.0)
    # 46.1 N, 8 E: within the nodes around the map, 11 km from the mission.
    ground[3, 3] = 900.0
    dataset = wind_dataset(np.array([3.0, 4.0, 5.0, 6.0])[:, np.newaxis, np.newaxis], 0.0)
    dataset = dataset.assign(orog=(("latitude", "longitude"), ground, {"units": "m"}))
    file = write_netcdf(folder / "a.nc", dataset)
    flown = fly(autopilot="planfly", forecast=file, at=AT)
    facts = flown.setup.scenario.wind.forecast
    assert facts is not None
    assert facts.lowest_amsl == 900.0 + HEIGHTS[0]


REFUSED: dict[str, tuple[Callable[[], xarray.Dataset], str]] = {
    "no level above the mission": (
        lambda: wind_dataset(3.0, 0.0, kind="altitude", levels=(100.0, 250.0)),
        r"a\.nc: levels: the mission flies at 260 m AMSL: this is above the forecast's highest level, 250 m AMSL there",
    ),
    "no level below the mission": (
        lambda: wind_dataset(3.0, 0.0, kind="altitude", levels=(290.0, 600.0)),
        r"a\.nc: levels: the mission flies at 180 m AMSL: the forecast's lowest level is at 290 m AMSL there",
    ),
    "a varied wind without a level above": (
        lambda: wind_dataset(
            np.array([3.0, 9.0])[:, np.newaxis, np.newaxis], 0.0, kind="altitude", levels=(100.0, 250.0)
        ),
        r"a\.nc: levels: the mission flies at 260 m AMSL: this is above the forecast's highest level, 250 m AMSL there",
    ),
    "a mean wind of a hurricane": (
        lambda: wind_dataset(50.0, 0.0),
        r"a\.nc: wind at the start: 50\.0 m/s at 2026-05-01 06:00 UTC: allowed 0\.\.40 m/s",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_mission_outside_the_levels_is_refused(name: str, folder: Path) -> None:
    make, words = REFUSED[name]
    file = write_netcdf(folder / "a.nc", make())
    with pytest.raises(planfly.ForecastError, match=words):
        fly(forecast=file, at=AT)


# ----------------------------------------------------------------------
# Returns.


def test_no_return_arrives_behind_a_wind_that_is_faster_than_the_aircraft(folder: Path) -> None:
    # 36 m/s around home, and calm from 580 m east on: the wind at its start would let a return arrive.
    longitudes = np.linspace(7.97, 8.05, 33)
    eastward = 36.0 * np.clip((8.0075 - longitudes) / 0.005, 0.0, 1.0)
    file = write_netcdf(folder / "a.nc", wind_dataset(eastward, 0.0, longitudes=longitudes))
    setup = fly(forecast=file, at=AT).setup
    world, starts = make_return_world(setup), planned_starts(setup, 20.0)
    is_beyond = starts.rows["east"] > 600.0
    assert is_beyond.sum() >= 2
    kinds = {one.kind for one in judge_returns(world, starts.subset(np.flatnonzero(is_beyond)), 20.0).each}
    assert kinds == {"lost"}
    # Planned starts have the ground speed of the wind on their leg, which is calm in its middle.
    assert np.hypot(starts.rows["velocity_east"], starts.rows["velocity_north"])[is_beyond].max() < 27.0


def test_jsbsim_flies_a_return_in_the_wind_of_its_time(folder: Path) -> None:
    # It rises by 9 m/s an hour.
    file = write_netcdf(
        folder / "a.nc", wind_dataset(np.array([0.0, 36.0, 72.0, 108.0])[:, None, None, None] / 4.0, 0.0)
    )
    setup = fly(forecast=file, at=AT).setup
    start = planned_starts(setup, 100.0).rows[1]
    again, _ = return_setup(make_return_world(setup), start)
    speed = math.hypot(float(start["velocity_east"]), float(start["velocity_north"]))
    lead_in_s = LEAD_IN_LENGTH_M / speed
    found = again.scenario.wind_velocity((0.0, 0.0, 200.0), lead_in_s)
    assert found == pytest.approx((100.0 * 9.0 / 3600.0, 0.0), abs=1e-3)


@pytest.mark.parametrize("longitude", [8.0, 180.0, -179.999])
def test_the_map_of_a_forecast_does_not_jump_at_180_degrees(longitude: float, folder: Path) -> None:
    mission = Path("valley.waypoints").read_text(encoding="ascii").replace("8.0\t", f"{longitude}\t")
    for old in ("8.0194", "8.0065"):
        mission = mission.replace(old, f"{(longitude + float(old) - 8.0 + 180.0) % 360.0 - 180.0:.6f}")
    (folder / "edge.waypoints").write_text(mission, encoding="ascii")
    longitudes = np.sort((longitude + np.linspace(-0.1, 0.1, 5) + 180.0) % 360.0 - 180.0)
    file = write_netcdf(folder / "a.nc", wind_dataset([2.0, 3.0, 4.0, 5.0, 6.0], 0.0, longitudes=longitudes))
    scenario = planfly.fly("edge.waypoints", forecast=file, at=AT).setup.scenario
    geo_map = scenario.geo_map
    assert geo_map is not None
    east, north = np.array([-1500.0, 0.0, 1400.0]), np.array([0.0, 900.0, -300.0])
    for found, expected in zip(geo_map(east, north), to_geo(scenario.origin, east, north)[::-1], strict=True):
        assert np.abs((found - expected + 180.0) % 360.0 - 180.0).max() < 2e-5
