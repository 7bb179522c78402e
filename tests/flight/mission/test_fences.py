"""Fences and rally points of a scenario: made of its area and threats, and the same after either file form."""

import math
from typing import Any

import numpy as np
import pytest

from flight.mission.fences import fence_problem, fence_shapes, with_fences
from flight.mission.from_plan import plan_mission
from flight.mission.items import MissionItem
from flight.mission_files.formats import mission_text, parse_mission
from tests.mission_lines import a_plan
from world.errors import MissionError
from world.frames import to_geo, to_map


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
    assert mission.home is not None
    assert [item.alt + mission.home.alt for item in mission.rally] == pytest.approx([700.0, 900.0], abs=0.01)
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
    (said,) = (note for note in notes if note.startswith("left out of the fence"))
    assert f": {threats.names[first]};" in said


@pytest.mark.parametrize("kind", ["fence", "rally", "plan"])
def test_fences_come_back_from_every_form(kind: Any) -> None:
    plan = a_plan([(9000.0, -5000.0, 700.0), (-9000.0, 3000.0, 900.0)])
    mission, _ = with_fences(plan_mission(plan, 25.0, math.radians(30.0)), plan.scenario, nothing)
    again = parse_mission(mission_text(mission, kind), f"a.{kind}")
    assert again.warnings == ()
    assert again.fences == (() if kind == "rally" else mission.fences)
    assert again.rally == (() if kind == "fence" else mission.rally)
    assert mission_text(again, kind) == mission_text(mission, kind)


def test_mission_planners_fence_has_a_home_line() -> None:
    text = "QGC WPL 110\n0 1 0 16 0 0 0 0 36.5 -84.2 300 1\n1 0 0 5004 90 0 0 0 36.6 -84.3 0 1\n"
    (item,) = parse_mission(text, "a.fence").fences
    assert (item.seq, item.params[0], item.x) == (0, 90.0, 366_000_000)


def test_a_polygon_with_too_few_corners_is_refused() -> None:
    text = "QGC WPL 110\n0 0 0 5002 3 0 0 0 36.5 -84.2 0 1\n1 0 0 5002 3 0 0 0 36.6 -84.2 0 1\n"
    with pytest.raises(MissionError, match="fence item 0: p1 3: fewer corners follow"):
        parse_mission(text, "a.fence")
