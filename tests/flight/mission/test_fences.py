"""Fences and rally points of a scenario, and QGroundControl's complex items."""

import json
import math
from typing import Any

import numpy as np
import pytest

from flight.mission.fences import fence_problem, fence_shapes, with_fences
from flight.mission.from_plan import plan_mission
from flight.mission_files.formats import mission_text, parse_mission
from tests.flight.mission.test_routing import a_plan
from tests.flight.mission_files.test_bad_mission_files import plan_data
from world.errors import MissionError
from world.frames import to_map


def test_threats_and_area_become_a_fence() -> None:
    plan = a_plan([(9000.0, -5000.0, 700.0), (9500.0, -3000.0, 700.0), (-9000.0, 3000.0, 900.0)])
    scenario = plan.scenario
    mission, notes = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), scenario)
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
    assert any("passes through" in note for note in notes[1:])
    assert mission.home is not None
    assert [item.alt + mission.home.alt for item in mission.rally] == pytest.approx([700.0, 900.0], abs=0.01)
    inside = scenario.threats.position[missiles[0]]
    assert "exclusion" in str(fence_problem(mission.fences, scenario.origin, *map(float, inside[:2])))
    assert fence_problem(mission.fences, scenario.origin, 9000.0, -5000.0) is None


@pytest.mark.parametrize("kind", ["fence", "rally", "plan"])
def test_fences_come_back(kind: Any) -> None:
    plan = a_plan([(9000.0, -5000.0, 700.0), (-9000.0, 3000.0, 900.0)])
    mission, _ = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario)
    again = parse_mission(mission_text(mission, kind), f"a.{kind}")
    assert again.warnings == ()
    assert again.fences == (() if kind == "rally" else mission.fences)
    assert again.rally == (() if kind == "fence" else mission.rally)
    assert mission_text(again, kind) == mission_text(mission, kind)


def test_mission_planners_fence_has_a_home_line() -> None:
    text = "QGC WPL 110\n0 1 0 16 0 0 0 0 36.5 -84.2 300 1\n1 0 0 5004 90 0 0 0 36.6 -84.3 0 1\n"
    (item,) = parse_mission(text, "a.fence").fences
    assert (item.seq, item.params[0], item.x) == (0, 90.0, 366_000_000)


def test_a_polygon_with_too_few_corners() -> None:
    text = "QGC WPL 110\n0 0 0 5002 3 0 0 0 36.5 -84.2 0 1\n1 0 0 5002 3 0 0 0 36.6 -84.2 0 1\n"
    with pytest.raises(MissionError, match="fence item 0: p1 3: fewer corners follow"):
        parse_mission(text, "a.fence")


def simple(number: int, lat: float) -> dict[str, Any]:
    return {
        "type": "SimpleItem", "autoContinue": True, "command": 16, "doJumpId": number, "frame": 3,
        "params": [0, 0, 0, None, lat, -84.2, 100],
    }  # fmt: skip


def plan_with(*items: dict[str, Any]) -> str:
    data = plan_data()
    data["mission"]["items"] = list(items)
    return json.dumps(data)


@pytest.mark.parametrize("name", ["survey", "CorridorScan"])
def test_a_survey_is_its_items(name: str) -> None:
    held = [simple(2, 36.5), simple(3, 36.51), simple(4, 36.52)]
    survey = {"type": "ComplexItem", "complexItemType": name, "TransectStyleComplexItem": {"Items": held}}
    mission = parse_mission(plan_with(simple(1, 36.4), survey, simple(5, 36.6)), "a.plan")
    assert [item.seq for item in mission.items] == [1, 2, 3, 4, 5]
    assert [item.x for item in mission.items] == [364_000_000, 365_000_000, 365_100_000, 365_200_000, 366_000_000]
    assert mission.warnings == (f"a.plan: mission.items.1: {name} taken as the 3 simple items that it stands for",)


@pytest.mark.parametrize(("clockwise", "spiral"), [(True, True), (False, True), (True, False)])
def test_a_landing_pattern_is_three_items(clockwise: bool, spiral: bool) -> None:
    pattern = {
        "type": "ComplexItem", "complexItemType": "fwLandingPattern", "altitudesAreRelative": True,
        "landCoordinate": [36.5, -84.2, 0], "landingApproachCoordinate": [36.52, -84.2, 60],
        "loiterRadius": 120, "loiterClockwise": clockwise, "useLoiterToAlt": spiral,
    }  # fmt: skip
    mission = parse_mission(plan_with(simple(1, 36.6), pattern), "a.plan")
    assert [item.command for item in mission.items] == [16, 189, 31 if spiral else 16, 21]
    assert [item.seq for item in mission.items] == [1, 2, 3, 4]
    assert mission.items[3].alt == 0.0
    assert not spiral or mission.items[2].params[1] == (120.0 if clockwise else -120.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"complexItemType": "StructureScan"}, "'StructureScan'"),
        ({"complexItemType": "fwLandingPattern", "landCoordinate": [1, 2]}, "landCoordinate: \\[1, 2\\]"),
        (
            {
                "complexItemType": "fwLandingPattern", "landCoordinate": [91, 2, 3],
                "landingApproachCoordinate": [1, 2, 3],
            },
            "latitude 91",
        ),
        (
            {
                "complexItemType": "fwLandingPattern", "landCoordinate": [1, 2, 3],
                "landingApproachCoordinate": [1, 2, 3], "loiterRadius": "wide",
            },
            "loiterRadius",
        ),
    ],
)  # fmt: skip
def test_complex_items_that_cannot_be_read(change: dict[str, Any], words: str) -> None:
    with pytest.raises(MissionError, match=words) as caught:
        parse_mission(plan_with(simple(1, 36.6), {"type": "ComplexItem"} | change), "a.plan")
    assert "\n" not in str(caught.value)
