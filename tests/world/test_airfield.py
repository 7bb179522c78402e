"""Home, launch, landing strip and returns of a scenario: what is read, what is a default, and what is refused."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.world.made.made_scenario import made_spec, refused, same_scenario, with_fault
from world.airfield import LandingStrip, Launch
from world.errors import ScenarioError
from world.scenario import Scenario, scenario_from_spec, with_wind
from world.scenario_file import parse_scenario
from world.terrain import make_gridded_terrain
from world.wind import Wind

FIELD: dict[str, Any] = {
    "home": {"east_m": -2400.0, "north_m": 50.0},
    "launch": {"method": "catapult", "course_deg": 90.0, "speed_mps": 20.0, "length_m": 5.0, "incline_deg": 10.0},
    "landing": {
        "lat_deg": 46.0,
        "lon_deg": 8.0,
        "course_deg": 270,
        "length_m": 150.0,
        "width_m": 30.0,
        "approach_m": 700.0,
        "slope_deg": 5.0,
    },
    "returns": {
        "require": ["rtl"],
        "rtl_altitude_m": 180.0,
        "rtl_autoland": 3,
        "rally": [
            {"east_m": 0.0, "north_m": 0.0, "height_m": 100.0},
            {"east_m": 900.0, "north_m": 1.0, "amsl_m": 700.0},
        ],
    },
}


def hill(east: float, north: float) -> float:
    """Ground of the made scenario, m."""
    return 500.0 * math.exp(-(east**2 + north**2) / (2 * 600.0**2))


def field(**changes: Any) -> Scenario:
    return scenario_from_spec(made_spec(**(FIELD | changes)), "made")


def test_the_tables_become_places_courses_and_heights() -> None:
    scenario = field()
    assert scenario.home is not None
    assert scenario.home.tolist() == pytest.approx([-2400.0, 50.0, hill(2400.0, 50.0)], abs=0.3)
    assert scenario.launch == Launch("catapult", math.pi / 2, 20.0, 5.0, math.radians(10.0))
    strip = scenario.landing
    assert strip is not None
    # The made scenario has its origin there.
    assert (strip.east, strip.north) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert (strip.course, strip.length, strip.width, strip.approach, strip.slope) == (
        math.radians(270.0),
        150.0,
        30.0,
        700.0,
        math.radians(5.0),
    )
    returns = scenario.returns
    assert returns is not None
    assert (returns.require, returns.rtl_altitude, returns.rtl_autoland) == (("rtl",), 180.0, 3)
    assert returns.rally == pytest.approx(np.array([[0.0, 0.0, hill(0.0, 0.0) + 100.0], [900.0, 1.0, 700.0]]), abs=0.5)
    for array in (scenario.home, returns.rally):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_home_is_on_the_ground_below_the_start() -> None:
    scenario = field(home={"place": "start"})
    assert scenario.home is not None
    assert scenario.home[:2].tolist() == scenario.start[:2].tolist()
    # The made scenario starts 120 m above ground.
    assert scenario.start[2] - scenario.home[2] == pytest.approx(120.0, abs=1e-6)


def test_what_is_not_stated_is_left_to_the_method() -> None:
    scenario = field(launch={"method": "hand"}, landing={"east_m": 0, "north_m": 0}, returns={"require": ["rtl"]})
    assert scenario.launch == Launch("hand", None, None, None, math.radians(10.0))
    assert scenario.landing == LandingStrip(0.0, 0.0, None, 200.0, 40.0, None, None)
    assert scenario.returns is not None
    assert scenario.returns.rally.shape == (0, 3)
    assert (scenario.returns.rtl_altitude, scenario.returns.rtl_autoland) == (None, None)
    inclines = [field(launch={"method": one}).launch for one in ("catapult", "runway")]
    assert [one and one.incline for one in inclines] == [math.radians(12.0), 0.0]


def test_a_scenario_without_the_tables_has_none_of_them() -> None:
    scenario = scenario_from_spec(made_spec(), "made")
    assert (scenario.home, scenario.launch, scenario.landing, scenario.returns) == (None,) * 4
    assert not {"home", "launch", "landing", "returns"} & set(scenario.to_json())


def test_the_tables_come_back_through_json_and_stay_in_another_wind() -> None:
    scenario = field()
    text = json.dumps(scenario.to_json(), allow_nan=False)
    again = scenario_from_spec(json.loads(text), "again")
    assert same_scenario(scenario, again)
    assert json.dumps(again.to_json()) == text
    assert {key: json.loads(text)[key] for key in FIELD} == FIELD
    assert with_wind(scenario, 9.0, 1.0, None).landing == scenario.landing


def test_the_acceleration_of_a_launch() -> None:
    # v^2 / 2 L: 20^2 / (2 * 5); 1.2 * 15 = 18, 18^2 / (2 * 6); 10^2 / (2 * 2).
    assert Launch("catapult", speed=20.0, length=5.0).acceleration(15.0) == pytest.approx(40.0)
    assert Launch("catapult").acceleration(15.0) == pytest.approx(27.0)
    assert Launch("hand").acceleration(15.0) == pytest.approx(25.0)
    assert Launch("runway", speed=20.0, length=5.0).acceleration(15.0) == 0.0


def test_a_strip_without_a_course_is_landed_on_into_the_wind() -> None:
    wind = Wind(5.0, from_course=2.0, gradient=-0.01, reference_amsl=100.0)
    assert LandingStrip(0.0, 0.0).landing_course(wind, 100.0) == 2.0
    assert LandingStrip(0.0, 0.0, course=0.5).landing_course(wind, 100.0) == 0.5
    # At 700 m AMSL nothing is left of it.
    assert LandingStrip(0.0, 0.0).landing_course(wind, 700.0) is None


# What is appended to the small file, and what the line must say.
HOME = "[home]\neast_m = 0\nnorth_m = 0\n"
LAND = HOME + "[landing]\neast_m = 0\nnorth_m = 0\n"
CASES = {
    "a launch without home": ('[launch]\nmethod = "hand"', "home: missing; [launch] requires it"),
    "an empty home": ("[home]", 'home: position: missing; give place = "start"'),
    "a home in the air": (HOME + "amsl_m = 9", "home: amsl_m: home is on the scenario's ground"),
    "two landings": (HOME + "[[landing]]\neast_m = 0\nnorth_m = 0", "landing: expected a table"),
    "a landing without home": ("[landing]\neast_m = 0\nnorth_m = 0", "home: missing; [landing] requires it"),
    "home nowhere": ("[home]\neast_m = 0", "home: north_m: missing; a position needs east_m and north_m"),
    "home twice": ('[home]\nplace = "start"\neast_m = 0', 'home: place: give place = "start" or a position, not both'),
    "home by another name": ('[home]\nplace = "base"', 'home.place: "base": expected "start"'),
    "home outside": ("[home]\neast_m = 5001\nnorth_m = 0", "home: east 5001 m: 1 m outside the area"),
    "a launch by rocket": (HOME + '[launch]\nmethod = "rocket"', 'launch.method: "rocket": expected'),
    "a launch without a method": (HOME + "[launch]\nspeed_mps = 20", 'launch: method: missing; give "catapult",'),
    "a launch too fast": (HOME + '[launch]\nmethod = "hand"\nspeed_mps = 61', "launch.speed_mps: 61: allowed 1..60"),
    "a launch without speed": (HOME + '[launch]\nmethod = "hand"\nspeed_mps = 0', "launch.speed_mps: 0: allowed 1..60"),
    "a runway up a wall": (
        HOME + '[launch]\nmethod = "runway"\nincline_deg = 5.1',
        "launch: incline_deg: 5.1: allowed 0..5 for a runway",
    ),
    "a runway that pushes": (
        HOME + '[launch]\nmethod = "runway"\nspeed_mps = 20',
        "launch: speed_mps: 20: not allowed for a runway, where the motor accelerates the aircraft",
    ),
    "no rail": (HOME + '[launch]\nmethod = "catapult"\nlength_m = 0', "launch.length_m: 0: allowed 0.1..3000"),
    "a steep launch": (HOME + '[launch]\nmethod = "hand"\nincline_deg = 46', "launch.incline_deg: 46: allowed 0..45"),
    "a landing nowhere": (HOME + "[landing]\ncourse_deg = 9", "landing: position: missing; give east_m and north_m"),
    "a landing outside": (
        HOME + "[landing]\neast_m = 0\nnorth_m = 9999",
        "landing: north 9999 m: 5999 m outside the area",
    ),
    "a landing by luck": (LAND + 'course_deg = "luck"', 'landing.course_deg: "luck": allowed -360..360, or "wind"'),
    "a short strip": (LAND + "length_m = 19", "landing.length_m: 19: allowed 20..5000"),
    "a narrow strip": (LAND + "width_m = 4", "landing.width_m: 4: allowed 5..500"),
    "a short final": (LAND + "approach_m = 9", "approach_m: 9: allowed 200..5000"),
    "a flat glide": (LAND + "slope_deg = 0.5", "slope_deg: 0.5: allowed 1..20"),
    "returns that ask nothing": (
        "[returns]",
        "returns: require: missing; give require, rtl_altitude_m, rtl_autoland or rally",
    ),
    "returns that require nothing": ("[returns]\nrequire = []", "returns: require: missing; give require"),
    "a return that does not arm": ("[returns]\nrtl_autoland = 0", "returns.rtl_autoland: 0: allowed 1, 2 or 3"),
    "a true number": ("[returns]\nrtl_autoland = true", "returns.rtl_autoland: true: allowed 1, 2 or 3"),
    "a number that is not whole": ("[returns]\nrtl_autoland = 2.0", "returns.rtl_autoland: 2.0: allowed 1, 2 or 3"),
    "no rally": ("[returns]\nrally = []", "returns.rally: expected at least 1"),
    "a return underground": ("[returns]\nrtl_altitude_m = -1", "returns.rtl_altitude_m: -1: allowed 1..9000"),
    "rally without a height": (
        "[returns]\nrally = [{east_m = 0, north_m = 0}]",
        "returns.rally.0: amsl_m: missing; give amsl_m or height_m",
    ),
    "rally in the ground": (
        "[returns]\nrally = [{east_m = 0, north_m = 0, amsl_m = 300}, {east_m = 0, north_m = 0, amsl_m = 200}]",
        "returns.rally[1]: 200 m AMSL: not above the terrain, which is at 200 m",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_one_fault_one_line(case: str, tmp_path: Path) -> None:
    text, wanted = CASES[case]
    said = refused(tmp_path, with_fault("", text))
    assert wanted in said
    assert "file: " not in said


@pytest.mark.parametrize("key", ["home", "landing"])
def test_where_the_ground_is_not_known(key: str) -> None:
    # A file with holes in the area is refused as a whole; ground from a log need not cover it.
    east, north = np.linspace(-3000.0, 0.0, 7), np.linspace(-2000.0, 2000.0, 5)
    ground = make_gridded_terrain(np.full((5, 7), 100.0), east, north, source="west", sha256="", datum="mean sea level")
    spec = made_spec(threats=[], home={"place": "start"})
    assert scenario_from_spec(spec, "x", ground=ground).home is not None
    beyond = {key: {"east_m": 500.0, "north_m": 0.0}}
    with pytest.raises(
        ScenarioError, match=rf"^x: {key}: east 500 m, north 0 m: the elevation file has no data there$"
    ):
        scenario_from_spec(spec | beyond, "x", ground=ground)


def test_the_tables_are_read_from_a_file() -> None:
    text = with_fault(
        "", HOME + '[launch]\nmethod = "runway"\n[landing]\neast_m = 1\nnorth_m = 2\ncourse_deg = "wind"\n'
    )
    file = parse_scenario(text, "small.toml")
    assert file.launch is not None
    assert file.landing is not None
    assert (file.launch.method, file.landing.course_deg, file.landing.east_m) == ("runway", "wind", 1.0)
