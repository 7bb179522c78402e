"""The fence of a plan: kept by the plan's path, in the judgement of whoever gets both."""

from dataclasses import replace
from typing import Any

import pytest

from flight.mission.fences import fence_shapes
from flight.simulation.flight_setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from planfly.fence_of_plan import fence_of_plan
from tests.mission_lines import setup_of, wp

# North 1500 m, then east: the fly-by arc of 90 degrees cuts the corner by some 50 m.
CORNER = (wp(0.0, 0.0), wp(0.0, 1500.0), wp(1500.0, 1500.0))


def missile(east: float, north: float, radius: float) -> dict[str, Any]:
    return {"name": f"m{east:g}", "east_m": east, "north_m": north, "kill_radius_m": radius, "kill_scale_m": 10.0}


def circles(setup: FlightSetup) -> list[float]:
    mission, _ = fence_of_plan(setup)
    return [shape[0].params[0] for shape in fence_shapes(mission.fences) if shape[0].command == 5004]


@pytest.mark.parametrize(
    ("east", "north", "kept"),
    [
        (202.0, 700.0, True),
        (198.0, 700.0, False),
        # On the arc, and 30 m off both legs.
        (30.0 + 200.0 * 0.7071, 1470.0 - 200.0 * 0.7071, False),
        (110.0 + 200.0 * 0.7071, 1390.0 - 200.0 * 0.7071, True),
    ],
)
def test_a_circle_that_the_path_goes_through_is_no_fence(east: float, north: float, kept: bool) -> None:
    setup = setup_of(*CORNER, threats=[missile(east, north, 200.0), missile(-900.0, 0.0, 150.0)])
    assert circles(setup) == ([200.0, 150.0] if kept else [150.0])


def test_the_judge_finds_the_fence_kept() -> None:
    """All circles together fail the rule `fence`; those that are exported do not."""
    threats = [missile(198.0, 700.0, 200.0), missile(-900.0, 0.0, 150.0)]
    setup = setup_of(*CORNER, threats=threats)
    mission, notes = fence_of_plan(setup)
    assert any(note.startswith("left out of the fence, as the mission passes above or below: m198;") for note in notes)

    def failed(fences: Any) -> list[str]:
        judged = judge_geometry(replace(setup, mission=replace(setup.mission, fences=fences)))
        return [item.rule for item in judged.findings if item.rule == "fence" and item.ok is False]

    every, _ = fence_of_plan(setup_of(wp(-2000.0, -2000.0), wp(-1500.0, -2000.0), threats=threats))
    assert failed(mission.fences) == []
    assert failed(every.fences) == ["fence"]
