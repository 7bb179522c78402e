"""QGroundControl's complex items: read as the simple items that they stand for, or refused by name."""

import json
from pathlib import Path
from typing import Any

import pytest

from flight.mission_files.formats import parse_mission
from tests.flight.mission_files.malformed_files import BAD_PLAN, plan_data, refused
from world.errors import MissionError


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
    ("change", "text"),
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
def test_complex_items_that_cannot_be_read_are_refused(change: dict[str, Any], text: str) -> None:
    with pytest.raises(MissionError, match=text) as caught:
        parse_mission(plan_with(simple(1, 36.6), {"type": "ComplexItem"} | change), "a.plan")
    assert "\n" not in str(caught.value)


# ----------------------------------------------------------------------
# Malformed .plan files: each is refused in one line that names the field and what is allowed.


@pytest.mark.parametrize("case", sorted(BAD_PLAN))
def test_malformed_plans_are_refused(case: str, tmp_path: Path) -> None:
    data, wanted = BAD_PLAN[case]
    file = tmp_path / "bad.plan"
    file.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
    refused(file, wanted)


def test_items_are_counted_by_their_order_and_jumps_go_to_the_item_named() -> None:
    """As QGroundControl loads a plan: doJumpId says which item a jump means, and no more."""
    jump = simple(9, 0.0) | {"command": 177, "frame": 2, "params": [5, 1, 0, 0, 0, 0, 0]}
    mission = parse_mission(plan_with(simple(2, 36.4), simple(5, 36.5), jump), "a.plan")
    assert [item.seq for item in mission.items] == [1, 2, 3]
    assert mission.items[2].params[0] == 2.0
    assert mission.warnings == ("a.plan: doJumpId is not 1 to 3: items are counted by their order",)
