"""Notes on launch, landing, home, rally points and returns: each just where it is due, and just where it is not."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.mission.items import Mission
from flight.mission.return_path import DEFAULT_RETURN_RULES, ReturnRules
from logs.verdict.findings import NOT_FLOWN
from logs.verdict.rules.mission_rule import mission_findings
from planfly.workflow.open_flight import preflight_notes
from tests.mission_lines import ORIGIN, setup_of, wp
from world.airfield import LandingStrip, Launch
from world.frames import to_geo
from world.scenario import Scenario
from world.terrain import Terrain, make_gridded_terrain
from world.wind import Wind

# To the north from home, at 100 m AMSL like all ground here, and landed on course 090.
TAKE_OFF, LAND = wp(0, 0, 60, command=22), wp(2500, 2000, 0, command=21)
WAY = (TAKE_OFF, wp(0, 2000, 80), wp(1500, 2000, 80), LAND)


def rally(east: float, north: float, alt: float) -> str:
    return wp(east, north, alt, command=5100)


def notes(
    *lines: str,
    rules: ReturnRules = DEFAULT_RETURN_RULES,
    parameters: dict[str, float] | None = None,
    assumed: dict[str, float] | None = None,
    home: str = "36.5 -84.2 100",
    ground: Terrain | None = None,
    **changes: Any,
) -> list[str]:
    setup = setup_of(*lines, home=home)
    changes |= {} if ground is None else {"terrain": ground}
    scenario: Scenario = replace(setup.scenario, **changes)
    found = preflight_notes(setup.mission, setup.route, scenario, rules, parameters or {}, assumed or {})
    return [one for one in found if ": landing on " not in one]


def landed_on(ground: Terrain | None, wind: Wind, landing: LandingStrip | None = None) -> list[str]:
    """The notes on where `WAY` lands."""
    setup = setup_of(*WAY, home="36.5 -84.2 100")
    scenario = replace(setup.scenario, terrain=ground, wind=wind, landing=landing)
    found = preflight_notes(setup.mission, setup.route, scenario, DEFAULT_RETURN_RULES, {}, {})
    return [one for one in found if ": landing on " in one]


def sloped(east: float, north: float) -> Terrain:
    """Ground that rises by so much to the east and to the north, m per m, from 100 m at the landing point."""
    axis = np.arange(-6000.0, 6001.0, 50.0)
    heights = 100.0 + east * (axis[None, :] - 2500.0) + north * (axis[:, None] - 2000.0)
    return make_gridded_terrain(heights, axis, axis, source="slope", sha256="", datum="mean sea level")


def test_a_mission_in_the_air_has_none() -> None:
    assert notes(*WAY) == []


def test_a_landing_without_a_strip_tells_its_course_wind_and_ground() -> None:
    """Landed to the east: what rises to the north falls to the right."""
    (said,) = landed_on(sloped(0.03, 0.02), Wind(4.0, math.radians(90.0)))
    assert said == (
        "item 4: landing on course 90°, against 4.0 m/s of wind. Over 200 m around the landing point the ground rises"
        " by 3.0% in the landing direction and falls by 2.0% to the right. Touchdown and roll-out"
        " are not judged, because the scenario has no [landing]"
    )
    assert (
        "around the landing point the ground is level. Touchdown and roll-out"
        in landed_on(sloped(0.0, 0.0), Wind(0.0, 0.0))[0]
    )
    assert (
        "the ground rises by 3.0% in the landing direction and is level to the right"
        in landed_on(sloped(0.03, 0.0), Wind(0.0, 0.0))[0]
    )
    (said,) = landed_on(None, Wind(4.0, math.radians(270.0)))
    assert "with 4.0 m/s of tailwind. The terrain there is unknown. Touchdown and roll-out are not judged" in said
    assert landed_on(sloped(0.0, 0.0), Wind(0.0, 0.0), LandingStrip(2500.0, 2000.0)) == []


@pytest.mark.parametrize(("east", "north", "told"), [(0.099, 0.0, False), (0.101, 0.0, True), (0.0, -0.101, True)])
def test_ground_that_no_plan_would_land_on_is_told(east: float, north: float, told: bool) -> None:
    (said,) = landed_on(sloped(east, north), Wind(0.0, 0.0))
    assert ("(planfly plan accepts landing slopes up to 10%)" in said) is told
    # It leaves the verdict open, too.
    setup = setup_of(*WAY, home="36.5 -84.2 100")
    setup = replace(setup, scenario=replace(setup.scenario, terrain=sloped(east, north)))
    left = [one.reason for one in mission_findings(setup) if one.check == NOT_FLOWN]
    assert left == (
        ["NAV_LAND: not judged, because the ground there has a slope of 10.1%; a touchdown is judged only on up to 10%"]
        if told
        else []
    )


@pytest.mark.parametrize(("from_deg", "tail"), [(89.0, 0.0), (181.0, 4.0), (180.0, 4.0), (359.0, 0.0)])
def test_wind_from_behind_at_a_launch(from_deg: float, tail: float) -> None:
    found = notes(*WAY, launch=Launch("hand"), wind=Wind(4.0, math.radians(from_deg)))
    assert len(found) == (tail > 0.0)
    assert all(one.startswith("launch: 4.0 m/s of tailwind on course 0°") for one in found)


def test_wind_from_behind_at_a_stated_course_and_at_a_landing() -> None:
    wind = Wind(4.0, math.radians(270.0))
    assert notes(*WAY, launch=Launch("hand", course=math.radians(60.0)), wind=wind) == [
        f"launch: {4.0 * math.cos(math.radians(30.0)):.1f} m/s of tailwind on course 60°"
    ]
    assert notes(*WAY, landing=LandingStrip(2500.0, 2000.0), wind=wind) == [
        ("landing: 4.0 m/s of tailwind on course 90°")
    ]
    assert notes(*WAY, landing=LandingStrip(2500.0, 2000.0), wind=Wind(4.0, math.radians(90.0))) == []


@pytest.mark.parametrize(("north", "told"), [(49.0, False), (51.0, True)])
def test_home_far_from_the_launch(north: float, told: bool) -> None:
    assert notes(*WAY, home=_home(0.0, north)) == []
    setup = setup_of(*WAY, home=_home(0.0, north))
    scenario = replace(setup.scenario, home=np.array([0.0, 0.0, 100.0]))
    said = [
        one for one in preflight_notes(setup.mission, setup.route, scenario, ReturnRules(), {}, {}) if "home" in one
    ]
    assert bool(said) is told
    assert all(one.startswith("the mission's home is 51 m from the scenario's") for one in said)


def _home(east: float, north: float) -> str:
    lat, lon = to_geo(ORIGIN, east, north)
    return f"{float(lat):.7f} {float(lon):.7f} 100"


@pytest.mark.parametrize(("alt", "told"), [(0.5, False), (-0.5, True)])
def test_a_rally_point_in_the_ground(alt: float, told: bool) -> None:
    found = notes(*WAY, rally(300, 300, alt))
    assert bool(found) is told
    assert all(one.startswith("rally point 1 is 0 m below the ground (100 m AMSL") for one in found)


@pytest.mark.parametrize(("alt", "depth"), [(-9.0, None), (-11.0, 11), (-50.0, 50)])
def test_a_rally_point_in_the_ground_is_named_though_the_return_ends_above_it(alt: float, depth: int | None) -> None:
    """PX4 descends to RTL_DESCEND_ALT over a rally point: with 60 m, a point 50 m below the ground looks flyable."""
    found = notes(*WAY, rally(300, 300, alt), rules=ReturnRules(rally_height=60.0))
    expected = [
        f"rally point 1 is {depth} m below the ground ({100 + alt:.0f} m AMSL; the ground there is at 100 m AMSL)"
    ]
    assert found == ([] if depth is None else expected)


@pytest.mark.parametrize(("east", "told"), [(-4990.0, False), (-5010.0, True)])
def test_a_rally_point_that_no_return_flies_to(east: float, told: bool) -> None:
    found = notes(*WAY, rally(east, 1000, 100), rules=ReturnRules(rally_limit=5000.0))
    assert bool(found) is told
    assert all("because it is at least 5.0 km from the mission, beyond RALLY_LIMIT_KM 5" in one for one in found)
    # Without a limit none is too far.
    assert notes(*WAY, rally(east, 1000, 100), rules=ReturnRules(rally_limit=0.0)) == []


def test_a_rally_point_of_another_continent_is_told_and_refuses_nothing() -> None:
    (said,) = notes(*WAY, "3 5100 0 0 0 0 -36.5 84.2 100")
    assert "km from the map's origin" in said


def hill(north: float, top: float) -> Terrain:
    axis = np.arange(-6000.0, 6001.0, 50.0)
    heights = np.full((axis.size, axis.size), 100.0)
    heights[np.ix_(np.abs(axis - north) < 60.0, np.abs(axis) < 60.0)] = top
    return make_gridded_terrain(heights, axis, axis, source="hill", sha256="", datum="mean sea level")


@pytest.mark.parametrize(("north", "top", "told"), [(200.0, 179.0, False), (200.0, 181.0, True), (450.0, 181.0, False)])
def test_a_return_below_the_hills_about_home(north: float, top: float, told: bool) -> None:
    found = notes(*WAY, rules=ReturnRules(height=80.0), ground=hill(north, top))
    assert bool(found) is told
    assert all(
        one.startswith("an RTL loiters 80 m above home, but the ground within 260 m of home rises to 8")
        for one in found
    )


@pytest.mark.parametrize(("value", "told"), [(0.0, True), (1.0, False), (None, False)])
def test_a_landing_sequence_that_does_not_arm(value: float | None, told: bool) -> None:
    way = (*WAY[:2], "2 189 0 0 0 0 0 0 0", *WAY[2:])
    stated = {} if value is None else {"RTL_AUTOLAND": value}
    found = notes(*way, parameters=stated)
    assert found == (["item 3: ArduPlane does not arm with DO_LAND_START and RTL_AUTOLAND 0"] if told else [])
    # Without a landing sequence it does.
    assert notes(*WAY, parameters={"RTL_AUTOLAND": 0.0}) == []


def test_a_setting_that_is_assumed_for_a_landing_sequence_is_told() -> None:
    way = (*WAY[:2], "2 189 0 0 0 0 0 0 0", *WAY[2:])
    text = "item 3: RTL_AUTOLAND 1 is assumed for DO_LAND_START, because ArduPlane does not arm with the default 0"
    assert notes(*way, assumed={"RTL_AUTOLAND": 1.0}) == [text]
    # planfly writes the parameters of a scenario with a landing.
    strip = LandingStrip(2500.0, 2000.0)
    assert notes(*way, assumed={"RTL_AUTOLAND": 1.0}, landing=strip) == []


def test_a_mission_without_home_has_no_return_to_speak_of() -> None:
    setup = setup_of(*WAY)
    nowhere = Mission(None, setup.mission.items)
    found = preflight_notes(nowhere, setup.route, setup.scenario, ReturnRules(), {}, {})
    assert [one for one in found if ": landing on " not in one] == []


def test_an_item_that_states_its_height_above_home_as_amsl_is_named() -> None:
    """The ground is at 100 m AMSL and home is on it: 80 m AMSL are 20 m below the ground, 180 m AMSL 80 m above it."""
    (note,) = notes(TAKE_OFF, wp(0, 2000, 80), wp(1500, 2000, 80, frame=0), LAND)
    assert note == (
        "item 3: flown as altitudes above mean sea level (frame 0), 20 m below ground;"
        " read as heights above home (frame 3): 80 m above ground. Check the frame"
    )
    # Above the ground in its own frame, and below the ground in both: nothing is said.
    assert notes(TAKE_OFF, wp(0, 2000, 80), wp(1500, 2000, 180, frame=0), LAND) == []
    assert notes(TAKE_OFF, wp(0, 2000, 80), wp(1500, 2000, -20, frame=0), LAND) == []


def test_a_mission_that_states_amsl_as_heights_above_home_is_named() -> None:
    """With 100 m added to each height, the mission lands 100 m above the ground."""
    raised = (wp(0, 0, 160, command=22), wp(0, 2000, 180), wp(1500, 2000, 180), wp(2500, 2000, 100, command=21))
    (note,) = notes(*raised)
    assert note == (
        "items 1, 2, 3, 4: flown as heights above home (frame 3), 100 to 180 m above ground;"
        " read as altitudes above mean sea level (frame 0): 0 to 80 m above ground. Check the frame"
    )
    # One item that is higher than the others by home's altitude, and one that is 1 m short of it.
    (note,) = notes(TAKE_OFF, wp(0, 2000, 80), wp(1500, 2000, 160), LAND)
    assert note.startswith("item 3: flown as heights above home (frame 3), 160 m above ground; read as ")
    assert notes(TAKE_OFF, wp(0, 2000, 80), wp(1500, 2000, 159), LAND) == []
    # Heights above home among altitudes that are right as AMSL: as high as these, or 1 m below.
    mixed = (wp(0, 500, 180, frame=0), wp(0, 2000, 180), wp(1500, 2000, 180))
    (note,) = [text for text in notes(*mixed) if "frame" in text]
    assert note.startswith(
        "items 2, 3: flown as heights above home (frame 3), 180 m above ground; read as altitudes above"
    )
    assert not any("frame" in text for text in notes(mixed[0], wp(0, 2000, 179), wp(1500, 2000, 179)))
    # An altitude below the ground is wrong itself, and says nothing about the others.
    (note,) = [text for text in notes(wp(0, 500, 80, frame=0), wp(0, 2000, 80), wp(1500, 2000, 80)) if "frame" in text]
    assert note.startswith(
        "item 1: flown as altitudes above mean sea level (frame 0), 20 m below ground; read as heights above home"
    )
    # A home near sea level does not tell the frames apart.
    low = make_gridded_terrain(np.full((3, 3), 20.0), *[np.array([-9e3, 0.0, 9e3])] * 2, source="", sha256="", datum="")
    assert notes(*raised, home="36.5 -84.2 20", ground=low) == []
