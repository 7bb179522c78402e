"""QGroundControl's complex items: read as the simple items that they stand for, or refused by name."""

import json
from pathlib import Path
from typing import Any

import pytest

from flight.mission_files.formats import parse_mission, read_fence
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


@pytest.mark.parametrize(
    ("kind", "name"),
    [(2, "a multicopter or helicopter"), (13, "a multicopter or helicopter"), (10, "a rover"), (20, "a VTOL aircraft")],
)
def test_a_plan_for_another_kind_of_vehicle_is_a_line(kind: int, name: str) -> None:
    data = plan_data()
    data["mission"]["vehicleType"] = kind
    with pytest.raises(MissionError) as caught:
        parse_mission(json.dumps(data), "a.plan")
    assert str(caught.value) == (f"a.plan: mission.vehicleType: {kind}: {name}: planfly flies fixed-wing aircraft (1)")
    # An aeroplane, and what does not say.
    for also in (1, 0, None):
        data["mission"]["vehicleType"] = also
        assert parse_mission(json.dumps(data), "a.plan").items


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


# ----------------------------------------------------------------------
# What QGroundControl's own plans hold beyond that (mavlink/qgroundcontrol: test/plans, src/MissionManager/UnitTest,
# custom/res/geofences), in files of our own.


def test_a_height_that_is_counted_from_the_terrain_and_not_calculated_is_above_the_terrain() -> None:
    """As TerrainTest-ArduPlane.plan has it: frame 0, null, and the height beside it."""
    late = simple(2, 36.5) | {"frame": 0, "AltitudeMode": 3, "Altitude": 150}
    late["params"] = [*late["params"][:6], None]
    done = simple(3, 36.6) | {"frame": 0, "AltitudeMode": 3, "Altitude": 150, "AMSLAltAboveTerrain": 480.0}
    mission = parse_mission(plan_with(simple(1, 36.4), late, done), "a.plan")
    assert [(item.frame, item.alt) for item in mission.items] == [(3, 100.0), (10, 150.0), (0, 100.0)]
    assert mission.warnings == (
        "a.plan: mission.items.1: its height is not calculated yet: taken as 150 m above the terrain there",
    )


def test_a_place_of_an_older_version_is_read() -> None:
    """As SectionTest.plan has it: four parameters and a coordinate."""
    old = simple(1, 36.4)
    old |= {"params": [0, 0, 0, None], "coordinate": [36.4, -84.2, 20]}
    (first, second) = parse_mission(plan_with(old, simple(2, 36.5)), "a.plan").items
    assert (first.lat_deg, first.lon_deg, first.alt) == (36.4, -84.2, 20.0)
    assert second.seq == 2


def test_a_plan_of_a_fence_alone_is_a_fence(tmp_path: Path) -> None:
    """As ce_geofence_rd_2.plan has it: no items, and the corners of an inclusion and an exclusion."""
    data = plan_data()
    data["mission"]["items"] = []
    ring = [[36.5, -84.2], [36.6, -84.2], [36.6, -84.1]]
    polygons = [{"inclusion": side, "polygon": ring, "version": 1} for side in (True, False)]
    data["geoFence"] = {"circles": [], "polygons": polygons, "version": 2}
    file = tmp_path / "a.plan"
    file.write_text(json.dumps(data), encoding="utf-8")
    assert [item.command for item in read_fence(file)] == [5001] * 3 + [5002] * 3
    # Without one it is no plan of anything.
    data["geoFence"] = {"circles": [], "polygons": [], "version": 2}
    with pytest.raises(MissionError, match=r"^a\.plan: mission\.items: no items$"):
        parse_mission(json.dumps(data), "a.plan")
