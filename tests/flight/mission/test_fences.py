"""Fences and rally points of a scenario: made of its area and threats, and the same after either file form."""

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from flight.mission.fences import (
    fence_problem,
    fence_shapes,
    fence_zones,
    with_fences,
    zone_fences,
)
from flight.mission.from_plan import plan_mission
from flight.mission.items import Command, Frame, Mission, MissionItem
from flight.mission_files.formats import fence_text, mission_text, parse_mission
from planner.plan import Plan
from tests.mission_lines import a_plan
from tests.setups import small_scenario
from world.airspace.zones import Cylinder, Polygon, Zone, ZoneLevel, make_polygon
from world.errors import MissionError
from world.frames import GeoOrigin, to_geo, to_map


def nothing(_shape: tuple[MissionItem, ...]) -> bool:
    """No shape is passed."""
    return False


def test_threats_and_area_become_a_fence() -> None:
    plan = a_plan([(9000.0, -5000.0, 700.0), (9500.0, -3000.0, 700.0), (-9000.0, 3000.0, 900.0)])
    scenario = plan.scenario
    mission, notes = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), scenario, nothing)
    shapes = fence_shapes(mission.fences)
    missiles = [k for k, radius in enumerate(scenario.threats.kill_radius) if radius > 0.0]
    assert [shape[0].command for shape in shapes] == [5001] + [5004] * len(missiles)
    assert [item.seq for item in mission.fences] == list(range(4 + len(missiles)))
    for shape, k in zip(shapes[1:], missiles, strict=True):
        east, north = to_map(scenario.origin, shape[0].lat_deg, shape[0].lon_deg)
        assert (float(east), float(north)) == pytest.approx(tuple(scenario.threats.position[k, :2]), abs=0.02)
        assert shape[0].params[0] == scenario.threats.kill_radius[k]
    corners = np.array([to_map(scenario.origin, item.lat_deg, item.lon_deg) for item in shapes[0]])
    box = np.array([corners.min(axis=0), corners.max(axis=0)]).T
    assert box == pytest.approx(scenario.bounds, abs=0.02)
    assert "a fence has no height" in notes[0]
    assert len(notes) == 1
    # Its verdict had no rally points, as the scenario has no [returns].
    assert mission.rally == ()
    inside = scenario.threats.position[missiles[0]]
    assert "exclusion" in str(fence_problem(mission.fences, scenario.origin, *map(float, inside[:2])))
    assert fence_problem(mission.fences, scenario.origin, 9000.0, -5000.0) is None


def test_what_the_mission_passes_is_left_out_and_named() -> None:
    plan = a_plan([(9000.0, -5000.0, 700.0), (-9000.0, 3000.0, 900.0)])
    threats = plan.scenario.threats
    first = next(k for k, radius in enumerate(threats.kill_radius) if radius > 0.0)
    centre = [float(value) for value in to_geo(plan.scenario.origin, *threats.position[first, :2])]

    def over_the_first(shape: tuple[MissionItem, ...]) -> bool:
        return [shape[0].lat_deg, shape[0].lon_deg] == pytest.approx(centre, abs=1e-6)

    whole, _ = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario, nothing)
    mission, notes = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario, over_the_first)
    assert [item.x for item in mission.fences] == [item.x for k, item in enumerate(whole.fences) if k != 4]
    assert [item.seq for item in mission.fences] == list(range(len(whole.fences) - 1))
    (said,) = (note for note in notes if note.startswith("the mission passes above or below "))
    assert f" {threats.names[first]}, so the fence omits it. " in said


@pytest.mark.parametrize("kind", ["fence", "rally", "plan"])
def test_fences_come_back_from_every_form(kind: Any) -> None:
    plan = a_plan([(9000.0, -5000.0, 700.0), (-9000.0, 3000.0, 900.0)])
    fenced, _ = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario, nothing)
    mission = replace(fenced, rally=(MissionItem(0, Command.NAV_RALLY_POINT, 3, (0.0,) * 4, 36.3, -84.2, 90.0),))
    again = parse_mission(mission_text(mission, kind), f"a.{kind}")
    assert again.warnings == ()
    assert again.fences == (() if kind == "rally" else mission.fences)
    assert again.rally == (() if kind == "fence" else mission.rally)
    assert mission_text(again, kind) == mission_text(mission, kind)


@pytest.mark.parametrize(("home", "number"), [("0 1 0 16 0 0 0 0 36.5 -84.2 300 1\n", 3), ("", 2)])
def test_a_zone_is_named_after_its_number_in_the_file(home: str, number: int) -> None:
    """Mission Planner writes a home line, which is number 0; MAVProxy begins with fence item 0."""
    radii, first = (70.0, 80.0, 90.0), 1 if home else 0
    lines = [f"{first + k} 0 0 5004 {radius} 0 0 0 36.6 -84.3 0 1\n" for k, radius in enumerate(radii)]
    fences = parse_mission(f"QGC WPL 110\n{home}{''.join(lines)}", "a.fence").fences
    zones = fence_zones(fences, GeoOrigin(36.5, -84.2))
    assert [(zone.name, cast("Cylinder", zone.shape).radius) for zone in zones][2] == (f"fence item {number}", 90.0)
    violation = fence_problem(fences[2:], GeoOrigin(36.6, -84.3), 0.0, 0.0)
    assert violation == ("inside an exclusion circle of radius 90 m", number)
    # A fence file is written from 0, as a vehicle stores the fence.
    assert [line.split()[0] for line in fence_text(Mission(None, (), fences)).splitlines()[1:]] == ["0", "1", "2"]


def test_a_polygon_with_too_few_corners_is_refused() -> None:
    text = "QGC WPL 110\n0 0 0 5002 3 0 0 0 36.5 -84.2 0 1\n1 0 0 5002 3 0 0 0 36.6 -84.2 0 1\n"
    with pytest.raises(MissionError, match="fence item 0: p1 3: the polygon has fewer corners"):
        parse_mission(text, "a.fence")


# ----------------------------------------------------------------------
# A mission's fence as zones on the map: every kind of shape, and what is none.

ORIGIN = GeoOrigin(46.0, 8.0)
# Metres of a degree at 46 N on WGS84: by the meridian's and the prime vertical's radii of curvature.
_A, _E2 = 6_378_137.0, 0.006_694_379_990_14
_W = math.sqrt(1.0 - _E2 * math.sin(math.radians(46.0)) ** 2)
NORTH = math.radians(_A * (1.0 - _E2) / _W**3)
EAST = math.radians(_A / _W * math.cos(math.radians(46.0)))


def item(seq: int, command: Command, p1: float, east: float, north: float) -> MissionItem:
    lat, lon = 46.0 + north / NORTH, 8.0 + east / EAST
    return MissionItem(seq, int(command), int(Frame.GLOBAL), (p1, 0.0, 0.0, 0.0), lat, lon, 0.0)


def polygon(first: int, command: Command, corners: list[tuple[float, float]]) -> list[MissionItem]:
    return [item(first + k, command, float(len(corners)), *corner) for k, corner in enumerate(corners)]


def test_every_shape_comes_to_its_place() -> None:
    triangle, square = [(0.0, 0.0), (900.0, 0.0), (0.0, 600.0)], [(0.0, 0.0), (50.0, 0.0), (50.0, 50.0), (0.0, 50.0)]
    fence = (
        *polygon(0, Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, triangle),
        item(3, Command.NAV_FENCE_CIRCLE_EXCLUSION, 123.0, 300.0, -200.0),
        *polygon(4, Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION, square),
        item(8, Command.NAV_FENCE_CIRCLE_INCLUSION, 50.5, -10.0, 20.0),
    )
    zones = fence_zones(fence, ORIGIN)
    assert [(zone.name, zone.kind) for zone in zones] == [
        ("fence item 0", "inclusion"),
        ("fence item 3", "exclusion"),
        ("fence item 4", "exclusion"),
        ("fence item 8", "inclusion"),
    ]
    assert all(zone.floor is None and zone.ceiling is None for zone in zones)
    for k, corners in ((0, triangle), (2, square)):
        shape = zones[k].shape
        assert isinstance(shape, Polygon)
        # The Earth curves between the corners: a decimetre in 900 m.
        np.testing.assert_allclose(shape.rings[0], corners, atol=0.15)
    for k, (east, north, radius) in ((1, (300.0, -200.0, 123.0)), (3, (-10.0, 20.0, 50.5))):
        circle = zones[k].shape
        assert isinstance(circle, Cylinder)
        np.testing.assert_allclose((circle.east, circle.north, circle.radius), (east, north, radius), atol=0.02)


BOW = [(0.0, 0.0), (90.0, 90.0), (90.0, 0.0), (0.0, 90.0)]
EXCLUSION = Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION
FAULTS = {
    "a bow tie": (polygon(2, EXCLUSION, BOW), "fence item 2: crosses or touches itself"),
    "two corners": (polygon(0, EXCLUSION, BOW[:2]), "fence item 0: 2 corners: at least three"),
    "no radius": ([item(5, Command.NAV_FENCE_CIRCLE_EXCLUSION, 0.0, 0.0, 0.0)], "fence item 5: radius 0 m"),
    "too few follow": (polygon(0, EXCLUSION, BOW)[:3], "fence item 0: p1 4: the polygon has fewer corners"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_shape_is_refused_by_its_item(case: str) -> None:
    items, wanted = FAULTS[case]
    with pytest.raises(MissionError, match=f"^m.plan: {wanted}"):
        fence_zones(tuple(items), ORIGIN, "m.plan")


# ----------------------------------------------------------------------
# Zones as a fence, in every form that a fence has, and what is said of those that it cannot hold.

SQUARE = [(0.0, 0.0), (900.0, 0.0), (900.0, 900.0), (0.0, 900.0)]
HOLE = [(300.0, 300.0), (600.0, 300.0), (600.0, 600.0), (300.0, 600.0)]
APART = [(2000.0, 0.0), (2500.0, 0.0), (2500.0, 500.0)]


def inside(zones: list[Zone], east: float, north: float) -> bool:
    """Whether a place is allowed by the zones' fence."""
    items, _ = zone_fences(zones, ORIGIN)
    return fence_problem(tuple(items), ORIGIN, east, north) is None


@pytest.mark.parametrize("kind", ["exclusion", "inclusion"])
def test_a_cylinder_is_a_circle_and_a_polygon_a_polygon(kind: Any) -> None:
    zones = [Zone("a", kind, Cylinder(500.0, -200.0, 150.0)), Zone("b", kind, make_polygon([SQUARE]))]
    items, notes = zone_fences(zones, ORIGIN)
    circle, polygon = fence_shapes(tuple(items))
    assert (circle[0].command, polygon[0].command) == ((5004, 5002) if kind == "exclusion" else (5003, 5001))
    assert circle[0].params[0] == 150.0
    assert to_map(ORIGIN, circle[0].lat_deg, circle[0].lon_deg) == pytest.approx((500.0, -200.0), abs=0.01)
    corners = [to_map(ORIGIN, item.lat_deg, item.lon_deg) for item in polygon]
    assert {(round(float(east)), round(float(north))) for east, north in corners} == set(SQUARE)
    assert notes == []


def test_a_hole_of_an_inclusion_is_excluded() -> None:
    fence = [Zone("it", "inclusion", make_polygon([SQUARE, HOLE]))]
    places = [(100.0, 100.0), (450.0, 450.0), (1000.0, 450.0)]
    assert [inside(fence, *place) for place in places] == [True, False, False]
    assert zone_fences(fence, ORIGIN)[1] == []


def test_a_hole_of_an_exclusion_is_closed_and_said() -> None:
    zones = [Zone("ring", "exclusion", make_polygon([SQUARE, HOLE]))]
    assert not inside(zones, 450.0, 450.0)
    assert zone_fences(zones, ORIGIN)[1] == ["an exclusion of a fence cannot have holes: ring is written without holes"]


def test_parts_of_an_exclusion_are_polygons_and_an_inclusion_of_parts_is_left_out_and_said() -> None:
    both = make_polygon([SQUARE, APART])
    assert [inside([Zone("it", "exclusion", both)], *p) for p in ((450.0, 450.0), (2400.0, 100.0))] == [False, False]
    items, notes = zone_fences([Zone("it", "inclusion", both)], ORIGIN)
    assert items == []
    assert notes == [
        "a flight must stay inside every inclusion of a fence: it is omitted, because of several separate parts"
    ]


def test_floors_and_ceilings_are_said() -> None:
    zones = [
        Zone("low", "exclusion", Cylinder(0.0, 0.0, 100.0), ceiling=ZoneLevel(120.0, "ground")),
        Zone("all", "exclusion", Cylinder(900.0, 0.0, 100.0)),
        Zone("high", "exclusion", make_polygon([SQUARE]), floor=ZoneLevel(600.0, "amsl")),
    ]
    _, notes = zone_fences(zones, ORIGIN)
    assert notes == ["a fence has no floor and no ceiling: low, high are fenced at every height"]


def planned(**tables: Any) -> Plan:
    plan = a_plan([(0.0, 0.0, 150.0), (6000.0, 0.0, 150.0)])
    scenario = small_scenario(threats=[], **tables)
    return Plan(
        **{name: getattr(plan, name) for name in plan.__dataclass_fields__ if name not in ("scenario", "waypoints")},
        scenario=scenario,
        waypoints=np.array([scenario.start, scenario.destination]),
    )


TABLES: dict[str, Any] = {
    "limits": {"max_height_m": 400, "min_clearance_m": 30},
    "zones": [
        {"name": "mast", "kind": "exclusion", "east_m": 3000, "north_m": 50, "radius_m": 200, "ceiling_amsl_m": 100},
        {"name": "fence", "kind": "inclusion", "polygon_m": [[-400, -900], [6400, -900], [6400, 900], [-400, 900]]},
    ],
}


@pytest.mark.parametrize("kind", ["fence", "plan"])
def test_a_scenarios_zones_come_back_from_every_form(kind: Any) -> None:
    plan = planned(**TABLES)
    mission, notes = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario, lambda _: False)
    # The area's four corners, the circle, and the polygon's four.
    assert [item.command for item in mission.fences] == [5001] * 4 + [5004] + [5001] * 4
    again = parse_mission(mission_text(mission, kind), f"a.{kind}").fences
    # A `.plan` has its polygons before its circles.
    assert {replace(item, seq=0) for item in again} == {replace(item, seq=0) for item in mission.fences}
    assert len(again) == len(mission.fences)
    assert notes == (
        "a fence has no floor and no ceiling: mast is fenced at every height",
        "a fence does not follow the ground: the maximum height of 400 m above ground is not part of it",
    )


def test_a_scenario_without_zones_says_nothing_of_them() -> None:
    plan = planned()
    mission, notes = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario, lambda _: False)
    assert (len(mission.fences), notes) == (4, ())


def test_what_is_to_be_stayed_in_is_never_left_out() -> None:
    """Whatever is said to be passed: only exclusions are."""
    plan = planned(**TABLES)
    mission, notes = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario, lambda _: True)
    assert [item.command for item in mission.fences] == [5001] * 8
    assert any("above or below mast, so the fence omits it." in note for note in notes)
