"""Ranges of numbers as a scenario file states them, and names of one line."""

import math
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.world.made.made_scenario import SMALL, THREAT, refused, with_fault
from world.errors import ScenarioError
from world.scenario_file import check_scenario, parse_scenario
from world.scenario_tables import (
    DEFAULT_AUTOPILOT,
    FlightTable,
    ScenarioFile,
    ThreatTable,
    ZoneTable,
    check_no_line_break,
    in_range,
)


def test_a_range_holds_its_ends_unless_it_says_otherwise() -> None:
    check: Any = in_range(0.0, 5.0).func
    assert [check(value) for value in (0.0, 5.0)] == [0.0, 5.0]
    for value in (-0.001, 5.001, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"^allowed 0\.\.5$"):
            check(value)
    open_ends: Any = in_range(0.0, 5.0, exclude_min=True, exclude_max=True, also=', or "aircraft"').func
    for value in (0.0, 5.0):
        with pytest.raises(ValueError, match=r'^allowed above 0, below 5, or "aircraft"$'):
            open_ends(value)


def test_a_name_is_one_line() -> None:
    assert check_no_line_break("Cove Creek") == "Cove Creek"
    with pytest.raises(ValueError, match="control characters"):
        check_no_line_break("two\nlines")


# ----------------------------------------------------------------------
# [[zones]]: each form of a shape and a band, and each fault in one line.

SQUARE = "polygon_m = [[-500, 1000], [500, 1000], [500, 2000], [-500, 2000]]"


def zone(text: str, *, name: str = "town", kind: str = "exclusion") -> str:
    return f'[[zones]]\nname = "{name}"\nkind = "{kind}"\n{text}\n'


def test_what_a_table_holds() -> None:
    table = ZoneTable(name="mast", kind="exclusion", lat_deg=46.0, lon_deg=8.0, radius_m=200.0, ceiling_agl_m=120.0)
    assert table.model_dump(exclude_none=True) == {
        "name": "mast",
        "kind": "exclusion",
        "lat_deg": 46.0,
        "lon_deg": 8.0,
        "radius_m": 200.0,
        "ceiling_agl_m": 120.0,
    }


FAULTS = {
    "no shape": (
        zone(""),
        "zones.0: polygon_m: a zone needs exactly one of polygon_m, polygon_deg, rings_m, rings_deg, radius_m",
    ),
    "two shapes": (
        zone(f"{SQUARE}\nradius_m = 5\neast_m = 0\nnorth_m = 0"),
        "zones.0: polygon_m: a zone needs exactly one of",
    ),
    "a centre alone": (
        zone(f"{SQUARE}\neast_m = 0"),
        "zones.0: radius_m: missing; a zone with a centre is a cylinder and needs a radius",
    ),
    "a radius alone": (zone("radius_m = 50"), "zones.0: position: missing; give east_m and north_m, or lat_deg"),
    "half a centre": (zone("radius_m = 50\nlon_deg = 8"), "zones.0: lat_deg: missing; a position needs lat_deg and"),
    "a kind": (zone(SQUARE, kind="prohibited"), 'zones.0.kind: "prohibited"'),
    "no name": (zone(SQUARE, name=""), "zones.0.name"),
    "an unknown key": (zone(f"{SQUARE}\nbase_ft = 100"), "zones.0.base_ft: unknown key"),
    "NaN": (zone("polygon_m = [[0, nan], [9, 0], [9, 9]]"), "zones.0.polygon_m.0.1: nan: allowed -500000..500000"),
    "a corner of three": (zone("polygon_m = [[0, 0, 5], [9, 0], [9, 9]]"), "zones.0.polygon_m.0"),
    "longitude first": (
        zone("polygon_deg = [[-97.5, 46.0], [-97.0, 46.0], [-97.0, 46.5]]"),
        "zones.0.polygon_deg.0: latitude -97.5: allowed -89..89; a corner is [latitude, longitude]",
    ),
    "a radius of zero": (zone("east_m = 0\nnorth_m = 0\nradius_m = 0"), "zones.0.radius_m: 0: allowed above 0"),
    "two floors": (zone(f"{SQUARE}\nfloor_amsl_m = 9\nfloor_agl_m = 9"), "floor_agl_m: give floor_amsl_m or floor_agl"),
    "floor above ceiling": (
        zone(f"{SQUARE}\nfloor_amsl_m = 900\nceiling_amsl_m = 500"),
        "zones.0: ceiling_amsl_m: 500: must be above floor_amsl_m 900",
    ),
    "floor at ceiling": (
        zone(f"{SQUARE}\nfloor_agl_m = 120\nceiling_agl_m = 120"),
        "zones.0: ceiling_agl_m: 120: must be above floor_agl_m 120",
    ),
    "the greatest height below the least": (
        "[limits]\nmin_clearance_m = 120\nmax_height_m = 120\n",
        "limits: max_height_m: 120: must be above min_clearance_m 120",
    ),
    "the greatest height NaN": (
        "[limits]\nmax_height_m = nan\n",
        "limits.max_height_m: nan: allowed above 0, up to 9000",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_one_fault_one_line(case: str, tmp_path: Path) -> None:
    text, wanted = FAULTS[case]
    assert wanted in refused(tmp_path, with_fault("", text))


# ----------------------------------------------------------------------
# The tables of a scenario file: every default, every range, and every fault in one line with its key and value.


CALM = {"speed_mps": 0.0, "from_deg": 0.0, "gradient": 0.0, "turbulence": "none", "seed": None, "forecast": None}


def test_every_default() -> None:
    file = parse_scenario(SMALL, "small.toml")
    assert file.model_dump(exclude={"terrain", "area", "start", "destination"}) == {
        "name": "small",
        "description": "",
        "origin": None,
        "threats": [],
        "zones": None,
        "zones_file": None,
        "zone_notes": None,
        "at": None,
        "limits": {
            "max_turn_deg": "aircraft",
            "max_climb_deg": "aircraft",
            "max_dive_deg": "aircraft",
            "min_clearance_m": 30.0,
            "max_height_m": None,
            "corridor_m": None,
            "surveys": None,
        },
        "planner": {
            "algorithm": None,
            "objective": None,
            "waypoints": 12,
            "population": 200,
            "generations": 100,
            "across_m": None,
            "zone_margin_m": None,
            "goals": {"length_ratio": None, "kill_exposure": None},
            "budget": None,
            "seed": None,
        },
        "flight": {
            "aircraft": "aerosonde",
            "aircraft_by_default": True,
            "airspeed_mps": None,
            "max_bank_deg": None,
            "autopilot": None,
            "autopilot_from": None,
            "params": None,
            "arduplane_version": None,
            "px4_version": None,
            "guidance": None,
            "guidance_hz": 60,
            "nav": None,
            "fly_over": False,
            "motor_braking": False,
            "battery_wh": None,
        },
        "wind": CALM,
        "home": None,
        "launch": None,
        "landing": None,
        "returns": None,
        "link": None,
    }


@pytest.mark.parametrize(
    ("stated", "flown_by"),
    [
        ({}, (DEFAULT_AUTOPILOT, "path", "perfect" if DEFAULT_AUTOPILOT == "planfly" else "gnss")),
        ({"guidance": "l1"}, ("planfly", "l1", "perfect")),
        ({"autopilot": "planfly"}, ("planfly", "path", "perfect")),
        # The name before version 0.2.
        ({"autopilot": "ideal"}, ("planfly", "path", "perfect")),
        ({"autopilot": "planfly", "nav": "gnss"}, ("planfly", "path", "gnss")),
        ({"autopilot": "ardupilot"}, ("ardupilot", "path", "gnss")),
        ({"params": "mine.parm"}, ("ardupilot", "path", "gnss")),
        ({"params": "mine.parm", "nav": "perfect"}, ("ardupilot", "path", "perfect")),
    ],
)
def test_who_flies(stated: dict[str, Any], flown_by: tuple[str, str, str]) -> None:
    table = FlightTable(**stated)
    assert table.steering == flown_by
    # As it is written down, it says the same whatever the default becomes.
    again = table.with_stated_defaults()
    assert again.steering == flown_by
    assert (again.autopilot == "ardupilot") == (flown_by[0] == "ardupilot")
    assert (again.guidance is None) == (flown_by[0] == "ardupilot")
    assert again.nav == flown_by[2]


# What is replaced in the small file or appended to it, and what the line must say.
CASES: dict[str, tuple[str, str, str]] = {
    "missing table": ("[area]\neast_m = [-5000, 5000]\nnorth_m = [-4000, 4000]\n", "", "area: missing"),
    "nan": ("amsl_m = 400", "amsl_m = nan", "start.amsl_m: nan: allowed -500..9000"),
    "inf": ("amsl_m = 400", "amsl_m = inf", "start.amsl_m: inf: allowed -500..9000"),
    "minus inf": ("amsl_m = 400", "amsl_m = -inf", "start.amsl_m: -inf: allowed -500..9000"),
    "nan in a list": ("[-5000, 5000]", "[-5000, nan]", "area.east_m.1: nan: allowed -500000..500000"),
    "out of range": ("amsl_m = 400", "amsl_m = 9001", "start.amsl_m: 9001"),
    "a number of 400 digits": ("amsl_m = 400", f"amsl_m = 1{'0' * 400}", "start.amsl_m: 1000"),
    "quoted number": ("amsl_m = 400", 'amsl_m = "400"', 'start.amsl_m: "400": expected a number'),
    "bool for a number": ("amsl_m = 400", "amsl_m = true", "start.amsl_m: true: expected a number"),
    "bool in a list": ("[-5000, 5000]", "[-5000, true]", "area.east_m.1: true: expected a number"),
    "text for a truth": ("", '[flight]\nfly_over = "yes"', 'flight.fly_over: "yes": expected true or false'),
    "number for a truth": ("", "[flight]\nfly_over = 1", "flight.fly_over: 1: expected true or false"),
    "number for a text": ('name = "small"', "name = 5", "name: 5: expected text"),
    "part of a generation": (
        "",
        "[planner]\ngenerations = 2.5",
        "planner.generations: 2.5: expected a whole number",
    ),
    "a list for a number": ("amsl_m = 400", "amsl_m = [400]", "start.amsl_m: expected a number"),
    "span of three": ("[-5000, 5000]", "[-5000, 0, 5000]", "area.east_m: expected at most 2 values"),
    "span upside down": ("[-5000, 5000]", "[5000, -5000]", "east_m: [5000, -5000]: the second value must exceed"),
    "ceiling under floor": (
        "[start]",
        "ceiling_amsl_m = 300\nfloor_amsl_m = 300\n[start]",
        "area: ceiling_amsl_m: 300: must be above floor_amsl_m 300",
    ),
    "no height": ("amsl_m = 400", "", "start: amsl_m: missing; give amsl_m or height_m"),
    "two heights": ("amsl_m = 400", "amsl_m = 400\nheight_m = 9", "start: height_m: give amsl_m or height_m, not both"),
    "half a position": ("east_m = -4000", "", "start: east_m: missing; a position needs east_m and north_m"),
    "two positions": ("east_m = -4000", "east_m = -4000\nlat_deg = 46\nlon_deg = 8", "start: position: give"),
    "latitude": ("", "[origin]\nlat_deg = 91\nlon_deg = 8", "origin.lat_deg: 91: allowed -89..89"),
    "missing longitude": ("", "[origin]\nlat_deg = 46", "origin.lon_deg: missing"),
    "scale without radius": (
        "",
        THREAT.replace("kill_radius_m = 800", ""),
        "kill_scale_m: needs kill_radius_m",
    ),
    "a threat without either": ("", THREAT.split("kill_radius")[0], "threats.0: kill_radius_m: missing"),
    "a radius of zero": ("", THREAT.replace("800", "0"), "threats.0.kill_radius_m: 0: allowed above 0, up to 200000"),
    "turn": ("", "[limits]\nmax_turn_deg = 200", 'limits.max_turn_deg: 200: allowed above 0, up to 180, or "aircraft"'),
    "turn by name": ("", '[limits]\nmax_turn_deg = "any"', 'limits.max_turn_deg: "any"'),
    "climb of 90": ("", "[limits]\nmax_climb_deg = 90", "limits.max_climb_deg: 90: allowed above 0, below 90"),
    "dive nan": ("", "[limits]\nmax_dive_deg = nan", "limits.max_dive_deg: nan: allowed above 0, below 90"),
    "waypoints": ("", "[planner]\nwaypoints = 2", "planner.waypoints: 2: allowed 3..500"),
    "seed": ("", "[planner]\nseed = -1", "planner.seed: -1: allowed 0..9223372036854775807"),
    "returns": ("", '[returns]\nrequire = ["land"]', 'returns.require.0: "land": expected'),
    "returns twice": (
        "",
        '[returns]\nrequire = ["glide", "glide"]',
        "require: glide, glide: name each requirement only once",
    ),
    "goals": ("", "[planner.goals]\nlength_ratio = 0.5", "planner.goals.length_ratio: 0.5: allowed 1..100"),
    "airspeed": ("", "[flight]\nairspeed_mps = 2", "flight.airspeed_mps: 2: allowed 3..150"),
    "guidance": ("", '[flight]\nguidance = "luck"', 'flight.guidance: "luck"'),
    "guidance_hz": ("", "[flight]\nguidance_hz = 45", "flight.guidance_hz: 45"),
    "nav": ("", '[flight]\nnav = "sextant"', 'flight.nav: "sextant"'),
    "wind": ("", "[wind]\nspeed_mps = 41", "wind.speed_mps: 41: allowed 0..40"),
    "wind from": ("", "[wind]\nfrom_deg = 361", "wind.from_deg: 361: allowed -360..360"),
    "turbulence": ("", '[wind]\nturbulence = "severe"', 'wind.turbulence: "severe"'),
    "terrain kind": ('kind = "flat"', 'kind = "mars"', 'terrain.kind: "mars"'),
    "another kind's key": ("amsl_m = 200", 'amsl_m = 200\npath = "x"', 'path: not a key of kind = "flat"'),
    "kind without its key": ("amsl_m = 200", "", 'amsl_m: missing; kind = "flat" requires it'),
    "a tile's name with a line break": (
        'kind = "flat"\namsl_m = 200',
        'kind = "dem"\npath = "a\\nb.tif"',
        'terrain.path: "a\\nb.tif": control characters',
    ),
    "a name with a line break": ('"small"', '"a\\nb"', 'name: "a\\nb": control characters are not allowed'),
    "a peak of no width": (
        'kind = "flat"\namsl_m = 200',
        'kind = "peaks"\npeak = [{east_m = 0, north_m = 0, height_m = 9, sigma_m = 1}]',
        "terrain.peak.0.sigma_m: 1: allowed 10..100000",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_one_fault_in_a_scenario_is_one_line(case: str, tmp_path: Path) -> None:
    old, new, wanted = CASES[case]
    assert wanted in refused(tmp_path, with_fault(old, new))


def test_numbers_may_be_whole_and_ranges_include_their_ends() -> None:
    text = SMALL.replace("amsl_m = 400", "amsl_m = 9000") + THREAT.replace("800", "200_000")
    file = parse_scenario(text + "[limits]\nmax_turn_deg = 180\nmax_climb_deg = 89.999\n", "x")
    assert file.start.amsl_m == 9000.0
    assert isinstance(file.start.amsl_m, float)
    assert file.limits.max_turn_deg == 180.0


def test_every_number_has_a_range() -> None:
    # The range is what keeps NaN out.
    def tried(model: Any, path: tuple[str | int, ...] = ()) -> None:
        for key, value in model.items():
            if isinstance(value, dict):
                tried(value, (*path, key))
            elif key == "zones":
                tried(value[0], (*path, key, 0))
            elif isinstance(value, float):
                data = full.model_dump(mode="json", exclude_none=True)
                place = data
                for part in path:
                    place = place[part]
                place[key] = math.nan
                with pytest.raises(ScenarioError, match="nan: allowed"):
                    check_scenario(data, "x")

    full = ScenarioFile.model_validate(
        tomllib.loads(
            SMALL
            + "course_deg = 5.0\n[origin]\nlat_deg = 46.0\nlon_deg = 8.0\n"
            + "[planner]\nacross_m = 500.0\n[planner.goals]\nlength_ratio = 2.0\nkill_exposure = 1.0\n"
            + "[flight]\nairspeed_mps = 25.0\nbattery_wh = 700.0\n"
            + "[limits]\nmax_turn_deg = 60.0\nmax_climb_deg = 9.0\nmax_dive_deg = 9.0\nmax_height_m = 120.0\n"
            + '[[zones]]\nname = "z"\nkind = "exclusion"\neast_m = 0.0\nnorth_m = 0.0\nradius_m = 9.0\n'
            + "floor_amsl_m = 9.0\nceiling_agl_m = 9.0\n"
        )
    )
    tried(full.model_dump(mode="json", exclude_none=True))


def test_a_threat_without_scales_has_a_quarter_and_a_third_of_its_radii() -> None:
    table = ThreatTable(east_m=0.0, north_m=0.0, kill_radius_m=1200.0, detection_radius_m=2400.0)
    assert (table.kill_scale_m, table.detection_scale_m) == (300.0, 800.0)
    stated = ThreatTable(east_m=0.0, north_m=0.0, kill_radius_m=1200.0, kill_scale_m=100.0)
    assert (stated.kill_scale_m, stated.detection_scale_m) == (100.0, None)
    with pytest.raises(ValueError, match="kill_scale_m: needs kill_radius_m"):
        ThreatTable(east_m=0.0, north_m=0.0, kill_scale_m=100.0, detection_radius_m=9.0)
