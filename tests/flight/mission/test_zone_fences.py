"""Zones as a fence, in every form that a fence has, and what is said of those that it cannot hold."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.mission.fences import fence_problem, fence_shapes, with_fences
from flight.mission.from_plan import plan_mission
from flight.mission.zone_fences import zone_fences
from flight.mission_files.formats import mission_text, parse_mission
from planner.plan import Plan
from tests.mission_lines import a_plan
from tests.setups import small_scenario
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon
from world.frames import GeoOrigin, to_map

ORIGIN = GeoOrigin(46.0, 8.0)
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
    assert zone_fences(zones, ORIGIN)[1] == [
        "a fence has no holes in what it excludes: ring is in the fence without them"
    ]


def test_parts_of_an_exclusion_are_polygons_and_an_inclusion_of_parts_is_left_out_and_said() -> None:
    both = make_polygon([SQUARE, APART])
    assert [inside([Zone("it", "exclusion", both)], *p) for p in ((450.0, 450.0), (2400.0, 100.0))] == [False, False]
    items, notes = zone_fences([Zone("it", "inclusion", both)], ORIGIN)
    assert items == []
    assert notes == ["every inclusion of a fence counts: it is left out, being of several parts"]


def test_floors_and_ceilings_are_said() -> None:
    zones = [
        Zone("low", "exclusion", Cylinder(0.0, 0.0, 100.0), ceiling=ZoneLevel(120.0, "ground")),
        Zone("all", "exclusion", Cylinder(900.0, 0.0, 100.0)),
        Zone("high", "exclusion", make_polygon([SQUARE]), floor=ZoneLevel(600.0, "amsl")),
    ]
    _, notes = zone_fences(zones, ORIGIN)
    assert notes == ["a fence has no floor and no ceiling: low, high are in the fence at every height"]


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
        "a fence has no floor and no ceiling: mast is in the fence at every height",
        "a fence does not follow the ground: the greatest height of 400 m above ground is not in it",
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
    assert any("above or below: mast;" in note for note in notes)
