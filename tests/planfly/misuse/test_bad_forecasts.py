"""Bad forecasts: one line that names file, field and what is allowed, exit code 2, and nothing left behind."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from tests.planfly.misuse.test_bad_input import refused
from tests.planfly.workflow.test_forecast_flights import AT, MISSION, SCENARIO
from tests.world.made.forecast_files import (
    LATITUDES,
    LONGITUDES,
    grib_messages,
    open_meteo_answer,
    wind_dataset,
    write_grib,
    write_json,
    write_netcdf,
)
from world.errors import ForecastError
from world.forecast.forecast import Box
from world.forecast.read_forecast import read_forecast

FLY = ("fly", "valley.waypoints", "--scenario", "valley.toml", "--log", "out.mcap")
Writer = Callable[[Path], Any]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "valley.toml").write_text(SCENARIO, encoding="utf-8")
    (tmp_path / "valley.waypoints").write_text(MISSION, encoding="ascii")
    monkeypatch.chdir(tmp_path)


def winds(**changes: Any) -> xarray.Dataset:
    """Return a varied wind: a forecast that nothing is wrong with."""
    return wind_dataset(np.array([3.0, 4.0, 5.0, 6.0])[:, np.newaxis, np.newaxis], 1.0, **changes)


def aloft(**changes: Any) -> xarray.Dataset:
    """Return a wind on pressure levels."""
    heights = np.array([100.0, 780.0, 1500.0])[:, np.newaxis, np.newaxis]
    return wind_dataset(4.0, 1.0, kind="pressure", levels=(1000.0, 925.0, 850.0), **{"heights": heights} | changes)


def with_units(dataset: xarray.Dataset, name: str, units: str | None) -> xarray.Dataset:
    array = dataset[name].copy()
    array.attrs.pop("units")
    array.attrs |= {} if units is None else {"units": units}
    return dataset.assign_coords({name: array}) if name in dataset.coords else dataset.assign({name: array})


def with_value(dataset: xarray.Dataset, value: float, time: int = 1, row: int = 2, column: int = 3) -> xarray.Dataset:
    """Return a dataset with another eastward wind at the lowest level of one node, by default 46 N, 8 E."""
    u = dataset.u.copy()
    u[time, 0, row, column] = value
    return dataset.assign(u=u)


def in_calendar(path: Path, calendar: str) -> None:
    dataset = winds()
    hours = xarray.DataArray(
        np.arange(4.0), dims="time", attrs={"units": "hours since 2026-05-01", "calendar": calendar}
    )
    dataset.assign_coords(time=hours).to_netcdf(path, engine="h5netcdf")


def nc(make: Callable[[], xarray.Dataset]) -> Writer:
    return lambda path: write_netcdf(path, make())


# What is written, and words of the line.
NETCDF: dict[str, tuple[Writer, tuple[str, ...]]] = {
    "units of a temperature": (
        nc(lambda: with_units(winds(), "u", "K")),
        ("u: units 'K': allowed", "knots", "m/s"),
    ),
    "no units": (nc(lambda: with_units(winds(), "v", None)), ("v: units None: allowed", "m/s")),
    "no units of the levels": (nc(lambda: with_units(winds(), "height", None)), ("height: units None: allowed", "km")),
    "levels in parsecs": (nc(lambda: with_units(winds(), "height", "pc")), ("height: units 'pc': allowed",)),
    "no units of pressure": (
        nc(lambda: with_units(aloft(), "isobaricInhPa", None)),
        ("isobaricInhPa: units None: allowed Pa, hPa",),
    ),
    "no northward wind": (nc(lambda: winds().drop_vars("v")), ("u: the northward wind that belongs to it is missing",)),
    "no eastward wind": (nc(lambda: winds().drop_vars("u")), ("v: the eastward wind that belongs to it is missing",)),
    "no wind": (
        nc(lambda: aloft().drop_vars(["u", "v"])),
        ("wind: missing: no pair of",),
    ),
    "no geopotential height": (
        nc(lambda: aloft().drop_vars("gh")),
        ("u: the geopotential height of its pressure levels is missing (gh, HGT, z)",),
    ),
    "geopotential in feet of water": (
        nc(lambda: with_units(aloft(), "gh", "ftH2O")),
        ("gh: units 'ftH2O': allowed m, gpm, m2 s-2",),
    ),
    "no level": (
        nc(lambda: winds().isel(height=0, drop=True)),
        ("u: its level is not stated; expected a pressure, a height above ground or an altitude",),
    ),
    "descending times": (
        nc(lambda: winds().isel(time=slice(None, None, -1))),
        ("time: the times are not in ascending",),
    ),
    "a time twice": (nc(lambda: winds(hours=(0.0, 1.0, 1.0, 2.0))), ("time: the times are not in ascending order",)),
    "no times": (nc(lambda: winds().isel(time=0, drop=True)), ("time: missing for u",)),
    "a year without leap days": (
        lambda path: in_calendar(path, "noleap"),
        ("time: calendar 'noleap': allowed standard, gregorian, proleptic_gregorian",),
    ),
    "months of 30 days": (lambda path: in_calendar(path, "360_day"), ("time: calendar '360_day': allowed standard",)),
    "a value missing at the mission": (
        nc(lambda: with_value(winds(), np.nan)),
        ("u, v: values are missing around the mission, the first at 10 m above ground, 2026-05-01 07:00 UTC",),
    ),
    "a masked value at the mission": (
        lambda path: write_netcdf(
            path, with_value(winds(), -32767.0 * 0.01), u={"dtype": "int16", "scale_factor": 0.01, "_FillValue": -32767}
        ),
        ("u, v: values are missing around the mission, the first at 10 m above ground, 2026-05-01 07:00 UTC",),
    ),
    "a fill value that the file does not state": (
        nc(lambda: with_value(winds(), 9.96921e36)),
        ("u, v: 9.969e+36 m/s: allowed up to 150 m/s",),
    ),
    "an infinite value": (nc(lambda: with_value(winds(), np.inf)), ("u, v: values are missing",)),
    "only missing values": (nc(lambda: winds() * np.nan), ("u: no value around the mission",)),
    "one latitude": (
        nc(lambda: winds(latitudes=np.array([46.0]))),
        ("latitude: only one grid node; expected at least two",),
    ),
    "one longitude": (
        nc(lambda: winds(longitudes=np.array([8.0]))),
        ("longitude: only one grid node; expected at least two",),
    ),
    "a node twice": (
        nc(lambda: winds(longitudes=np.array([7.9, 8.0, 8.0, 8.1]))),
        ("longitude: two nodes at the same place",),
    ),
    "latitudes up and down": (
        nc(lambda: winds(latitudes=np.array([45.9, 46.1, 46.0, 46.2]))),
        ("latitude: neither ascending nor descending",),
    ),
    "latitudes of metres": (nc(lambda: winds(latitudes=LATITUDES * 1e5)), ("latitude: expected numbers of degrees",)),
    "latitudes missing": (nc(lambda: winds().rename(latitude="row").drop_vars("row")), ("latitude: missing for u",)),
    "a dimension that is not known": (
        nc(lambda: winds().expand_dims(soil=[0.0, 1.0])),
        ("u: dimension 'soil' is not known: allowed time, level, member and place",),
    ),
    "several times of issue": (
        nc(
            lambda: (
                winds()
                .rename(time="step")
                .drop_vars("step")
                .expand_dims(time=winds().time.values[:2])
                .assign_coords(valid_time=(("time", "step"), np.stack([winds().time.values] * 2)))
            )
        ),
        ("valid_time: the file has several issue times; only one is allowed",),
    ),
    "another place": (
        nc(lambda: winds(latitudes=LATITUDES + 10.0)),
        ("latitude, longitude: the mission is at 46.000, 8.000: outside the forecast's area, latitude 55.8",),
    ),
    "a file that does not close round the globe": (
        nc(lambda: winds(longitudes=np.linspace(60.0, 300.0, 7))),
        ("longitude: nodes 120° apart around the mission: allowed up to 3°",),
    ),
    "nodes far apart": (
        nc(lambda: winds(latitudes=LATITUDES[2] + 4.0 * np.arange(-2.0, 3.0))),
        ("latitude: nodes 4° apart around the mission: allowed up to 3°",),
    ),
    "no time around the take-off": (
        nc(lambda: winds(hours=(-4.0, -3.0, 4.0, 5.0))),
        ("time: take-off 2026-05-01 06:00 UTC: the forecast has no time between 2026-05-01 03:00 and", "at most 6 h"),
    ),
    "currents of the sea": (
        nc(lambda: winds().assign(u=winds().u.assign_attrs(standard_name="eastward_sea_water_velocity"))),
        ("v: the eastward wind that belongs to it is missing",),
    ),
    "missing values of -99": (
        nc(lambda: with_value(winds(), -99.0)),
        ("u, v: values of -99 around the mission: a fill value that the file does not declare",),
    ),
    "geopotential heights that fall": (
        nc(lambda: aloft(heights=np.array([1500.0, 780.0, 100.0])[:, np.newaxis, np.newaxis])),
        ("gh: the heights of its levels do not increase from high pressure to low pressure",),
    ),
    "other times": (
        nc(lambda: winds(hours=(24.0, 25.0, 26.0, 27.0))),
        ("time: take-off 2026-05-01 06:00 UTC: the forecast covers 2026-05-02 06:00 to 2026-05-02 09:00 UTC",),
    ),
    "the take-off at its end": (
        nc(lambda: winds(hours=(-3.0, -2.0, -1.0, 0.0))),
        (
            "time: 2026-05-01 06:00 UTC: the flight takes ",
            " min, but the forecast ends at 2026-05-01 06:00 UTC",
        ),
    ),
    "no level above the mission": (
        nc(lambda: winds(levels=(10.0, 50.0, 100.0, 150.0))),
        ("levels: the mission flies at 260 m AMSL: this is above the forecast's highest level, 250 m AMSL there",),
    ),
    "no level below the mission": (
        nc(lambda: winds(levels=(200.0, 300.0, 400.0, 500.0))),
        ("levels: the mission flies at 180 m AMSL: the forecast's lowest level is at 300 m AMSL there, and applies",),
    ),
    "members of two numbers": (
        nc(
            lambda: xarray.merge(
                [
                    winds().expand_dims(number=[0, 1, 2]),
                    winds(levels=(20.0, 30.0, 40.0, 50.0))
                    .rename(u="u10", v="v10", height="height_2")
                    .expand_dims(member=[0, 1]),
                ]
            )
        ),
        ("members: 2 and 3: expected the same number of members at all levels",),
    ),
    "a wind of three dimensions and one of four": (
        nc(lambda: winds().assign(v=winds().v.isel(time=0, drop=True))),
        ("v: its dimensions differ from those of u",),
    ),
}
GRIB: dict[str, tuple[Writer, tuple[str, ...]]] = {
    "no northward wind": (
        lambda path: write_grib(path, grib_messages(winds(levels=(10.0, 11.0, 12.0, 13.0))[["u"]])),
        ("u: the northward wind that belongs to it is missing",),
    ),
    "no geopotential height": (
        lambda path: write_grib(path, grib_messages(aloft()[["u", "v"]])),
        ("u: the geopotential height of its pressure levels is missing (gh, HGT, z)",),
    ),
    "geopotential heights of other levels": (
        lambda path: write_grib(
            path, grib_messages(aloft()[["u", "v"]]), grib_messages(aloft().isel(isobaricInhPa=slice(0, 2))[["gh"]])
        ),
        ("gh: its pressure levels differ from those of u",),
    ),
    "a text after the first bytes": (lambda path: path.write_bytes(b"GRIB is a format\n" * 20), ("damaged",)),
}


def answer(**changes: Any) -> dict[str, Any]:
    return open_meteo_answer(winds(), 46.0, 8.0, 100.0) | changes


def hourly(**changes: Any) -> dict[str, Any]:
    """Return an answer with other hourly variables; None leaves a variable out."""
    made = answer()
    made["hourly"] = {name: values for name, values in (made["hourly"] | changes).items() if values is not None}
    return made


def hourly_units(**changes: Any) -> dict[str, Any]:
    made = answer()
    made["hourly_units"] |= changes
    return made


def json_file(content: Any) -> Writer:
    return lambda path: write_json(path, content)


OPEN_METEO: dict[str, tuple[Writer, tuple[str, ...]]] = {
    "an empty object": (json_file({}), ("hourly: hourly winds and hourly_units are missing",)),
    "an empty list": (json_file([]), ("hourly: expected the answer of Open-Meteo's API",)),
    "a list of numbers": (json_file([1, 2]), ("hourly: expected the answer of Open-Meteo's API",)),
    "an error of the API": (
        json_file({"error": True, "reason": "Parameter 'latitude' must be numeric"}),
        ("hourly winds and hourly_units are missing: Parameter 'latitude' must be numeric",),
    ),
    "an error beside values": (
        json_file(answer(error=True, reason="too many calls")),
        ("error: the service answered with an error: too many calls",),
    ),
    "hourly a list": (json_file(answer(hourly=[])), ("hourly: hourly winds and hourly_units are missing",)),
    "a latitude as text": (json_file(answer(latitude="46")), ("latitude: 46: allowed -90..90",)),
    "a latitude of 146": (json_file(answer(latitude=146.0)), ("latitude: 146.0: allowed -90..90",)),
    "a longitude that is true": (json_file(answer(longitude=True)), ("longitude: True: allowed -180..360",)),
    "no longitude": (json_file(answer(longitude=None)), ("longitude: None: allowed -180..360",)),
    "an elevation of nothing": (json_file(answer(elevation=None)), ("elevation: None: allowed -500..9000",)),
    "an offset as text": (json_file(answer(utc_offset_seconds="0")), ("utc_offset_seconds: 0: allowed -86399..86399",)),
    "no times": (json_file(hourly(time=None)), ("hourly.time: missing: a list of times is needed",)),
    "times that are none": (
        json_file(hourly(time=["noon"] * 4)),
        ("hourly.time: allowed ISO 8601 times, or unixtime",),
    ),
    "times that are numbers": (json_file(hourly(time=[1, 2, 3, 4])), ("hourly.time: allowed ISO 8601",)),
    "times that descend": (
        json_file(hourly(time=answer()["hourly"]["time"][::-1])),
        ("hourly.time: the times are not in ascending order",),
    ),
    "fewer values than times": (json_file(hourly(wind_speed_10m=[3.0])), ("hourly.wind_speed_10m: expected 4 values",)),
    "a value as text": (
        json_file(hourly(wind_speed_10m=[3.0, "4", 5.0, 6.0])),
        ("hourly.wind_speed_10m: value number 2 is '4'; expected a number",),
    ),
    "a null in the middle": (
        json_file(hourly(wind_speed_10m=[3.0, None, 5.0, 6.0])),
        ("hourly.wind_speed_10m: value number 2 is None; expected a number",),
    ),
    "NaN": (json_file(hourly(wind_direction_10m=[3.0, 1.0, float("nan"), 6.0])), ("value number 3 is nan",)),
    "a number of 400 digits": (json_file(hourly(wind_speed_10m=[3, 10**400, 5, 6])), ("value number 2 is 1000",)),
    "a negative speed": (json_file(hourly(wind_speed_10m=[3, -1, 5, 6])), ("-1 to 6 m/s: allowed 0..150 m/s",)),
    "a speed of sound": (json_file(hourly(wind_speed_10m=[3, 340, 5, 6])), ("3 to 340 m/s: allowed 0..150 m/s",)),
    "no direction": (
        json_file(hourly(wind_direction_10m=None)),
        ("hourly.wind_direction_10m: missing, although wind_speed_10m is there",),
    ),
    "only nulls": (
        json_file(answer(hourly={name: [None] * 4 if "wind" in name else v for name, v in answer()["hourly"].items()})),
        ("hourly: no wind: wind_speed_10m and wind_direction_10m",),
    ),
    "no geopotential height": (
        json_file(hourly(wind_speed_900hPa=[1.0] * 4, wind_direction_900hPa=[1.0] * 4)),
        ("hourly.geopotential_height_900hPa: missing, although wind_speed_900hPa is there",),
    ),
    "speeds in furlongs": (
        json_file(hourly_units(wind_speed_10m="furlong/fortnight")),
        ("hourly_units.wind_speed_10m: 'furlong/fortnight': allowed km/h, knots, m/s, mph",),
    ),
    "no units": (json_file(hourly_units(wind_speed_10m=None)), ("hourly_units.wind_speed_10m: None: allowed km/h",)),
    "places of no grid": (
        json_file([answer(), answer(latitude=46.1, longitude=8.1)]),
        ("latitude, longitude: several places must form a regular grid",),
    ),
    "places in a row": (
        json_file([answer(), answer(longitude=8.1)]),
        ("latitude, longitude: several places must form a grid of at least two rows and two columns",),
    ),
    "a place twice": (
        json_file([answer(), answer()]),
        ("latitude, longitude: several places must form a regular grid",),
    ),
    "another place": (
        json_file(answer(latitude=47.0)),
        ("the mission is at 46.000, 8.000: it must be within 15 km of the forecast's only place, 47.000, 8.000",),
    ),
    "JSON of another kind": (json_file({"type": "FeatureCollection", "features": []}), ("hourly: hourly winds",)),
    "brackets": (lambda path: path.write_text("[" * 100_000), ("damaged or incomplete: not JSON",)),
}
OTHER: dict[str, tuple[Writer, tuple[str, ...]]] = {
    "an empty file": (lambda path: path.write_bytes(b""), ("not a forecast: expected NetCDF, GRIB, or the JSON of",)),
    "a text": (lambda path: path.write_text("wind 5 m/s\n" * 9), ("not a forecast: expected NetCDF, GRIB, or the",)),
    "zeros": (lambda path: path.write_bytes(bytes(4096)), ("not a forecast: expected NetCDF, GRIB, or the JSON",)),
    "a folder": (lambda path: path.mkdir(), ("is a folder",)),
    "no file": (lambda path: None, ("no such file",)),
}
CASES = {
    f"{suffix}: {name}": (suffix, *case)
    for suffix, cases in (("nc", NETCDF), ("grib2", GRIB), ("json", OPEN_METEO), ("dat", OTHER))
    for name, case in cases.items()
}
assert len(CASES) >= 40


@pytest.mark.parametrize("name", CASES)
def test_a_bad_forecast(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    suffix, write, words = CASES[name]
    file = tmp_path / f"winds.{suffix}"
    write(file)
    line = refused([*FLY, "--forecast", file.name, "--at", AT], tmp_path, capfd)
    assert f"winds.{suffix}: " in line
    for part in words:
        assert part in line, line


# ----------------------------------------------------------------------
# Damaged files.


# Reads each forecast, and tells the error, if any, and all that was printed to standard error, also by libraries and by
# objects that Python removes.
_RUN = """
import gc, json, os, sys
from pathlib import Path
from world.errors import PlanflyError
from world.forecast.forecast import Box
from world.forecast.read_forecast import read_forecast

told, errors = [], os.dup(2)
for name in json.loads(sys.argv[1]):
    with open("printed.txt", "w+b") as printed:
        os.dup2(printed.fileno(), 2)
        message = ""
        try:
            read_forecast(Path(name), Box(45.98, 7.96, 46.02, 8.04), 100.0)
        except PlanflyError as error:
            message = str(error)
        gc.collect()
        sys.stderr.flush()
        os.dup2(errors, 2)
        printed.seek(0)
        told.append([message, printed.read().decode()])
print(json.dumps(told))
"""
KINDS = ("nc", "nc3", "grib2", "json")


def write_kind(file: Path, kind: str) -> bytes:
    """Write a good forecast of a kind, and return its bytes."""
    if kind == "nc":
        write_netcdf(file, winds())
    elif kind == "nc3":
        winds().to_netcdf(file, engine="scipy")
    elif kind == "grib2":
        write_grib(file, grib_messages(aloft()))
    else:
        write_json(file, [answer(latitude=la, longitude=lo) for la in LATITUDES.tolist() for lo in LONGITUDES.tolist()])
    return file.read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    """Truncated at several lengths; and with a byte changed, where it may be read if the byte is not needed."""
    data = write_kind(tmp_path / "good", kind)
    random = np.random.default_rng(1)
    shares = (0.002, 0.2, 0.5, 0.8, 0.99)
    places = random.integers(0, min(len(data), 6000), 30).tolist()
    if kind == "grib2":
        # GRIB is read in a new process each time, of more than a second.
        shares, places = (0.2, 0.99), places[:2]
    files = {f"{share}.{kind}": data[: int(share * len(data))] for share in shares}
    for place in places:
        changed = bytearray(data)
        changed[place] ^= int(random.integers(1, 256))
        files[f"{place}.{kind}"] = bytes(changed)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    done = subprocess.run(
        [sys.executable, "-c", _RUN, json.dumps(["good", *files])],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    told = dict(zip(["good", *files], json.loads(done.stdout), strict=True))
    assert told["good"] == ["", ""]
    for name, (message, printed) in told.items():
        assert printed == "", (name, printed)
        assert message.count("\n") == 0, message
        assert not message or message.startswith(f"{name}: "), message
        if name.startswith("0."):
            assert message, name


def test_a_count_of_values_in_a_grib_message_cannot_take_the_memory(tmp_path: Path) -> None:
    """Section 5 of a message states its number of values: one changed byte asks eccodes for 14 GB."""
    data = bytearray(write_kind(tmp_path / "good", "grib2"))
    section = data.index(b"GRIB", 1) + 16
    while data[section + 4] != 5:
        section += int.from_bytes(data[section : section + 4], "big")
    data[section + 5] = 108
    (tmp_path / "large.grib2").write_bytes(data)
    with pytest.raises(ForecastError, match=r"^[^\n]*large.grib2: damaged or incomplete: [^\n]+$"):
        read_forecast(tmp_path / "large.grib2", Box(45.98, 7.96, 46.02, 8.04), 100.0)


# ----------------------------------------------------------------------
# Options and scenarios.


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--forecast", "a.nc"], "--at: missing; a forecast needs the time of take-off"),
        (["--forecast", "a.nc", "--at", "2026-05-01T06:00"], "--at 2026-05-01T06:00:"),
        (["--forecast", "a.nc", "--at", "tomorrow"], "--at tomorrow:"),
        (
            ["--forecast", "a.nc", "--at", AT, "--wind", "5,270"],
            "--wind: not allowed with a forecast, which states the wind",
        ),
        (["--forecast", "", "--at", AT], "is a folder"),
        (["--forecast", "http://example.org/a.nc", "--at", AT], "no such file"),
    ],
)
def test_options_that_do_not_fit(
    options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_netcdf(tmp_path / "a.nc", winds())
    assert words in refused([*FLY, *options], tmp_path, capsys)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('[wind]\nforecast = "a.nc"\nspeed_mps = 5\n', "wind.speed_mps: 5: not allowed with wind.forecast"),
        ('[wind]\nforecast = "a.nc"\nfrom_deg = 5\n', "wind.from_deg: 5: not allowed with wind.forecast"),
        ('[wind]\nforecast = "a.nc"\ngradient = 0.01\n', "wind.gradient: 0.01: not allowed with wind.forecast"),
        ('[wind]\nforecast = ""\n', "wind.forecast"),
        ("[wind]\nforecast = 5\n", "wind.forecast"),
        ('[wind]\nforecast = ["a.nc"]\n', "wind.forecast"),
        ('[wind]\nforecast = "nowhere/a.nc"\n', "nowhere/a.nc: "),
    ],
)
def test_a_table_of_the_wind_that_does_not_fit(
    table: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_netcdf(tmp_path / "a.nc", winds())
    (tmp_path / "valley.toml").write_text(f'at = "{AT}"\n{SCENARIO}{table}', encoding="utf-8")
    for command in (list(FLY), ["plan", "valley.toml", "--out", "plan.json"]):
        assert words in refused(command, tmp_path, capsys)


def test_a_scenario_with_a_forecast_and_no_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_netcdf(tmp_path / "a.nc", winds())
    (tmp_path / "valley.toml").write_text(f'{SCENARIO}[wind]\nforecast = "a.nc"\n', encoding="utf-8")
    for command in (list(FLY), ["plan", "valley.toml"], ["run", "valley.toml"], ["campaign", "valley.toml"]):
        assert "--at: missing; a forecast needs the time of take-off" in refused(command, tmp_path, capsys)
