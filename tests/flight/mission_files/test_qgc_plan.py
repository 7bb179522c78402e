"""QGroundControl's complex items: read as the simple items that they stand for, or refused by name."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from flight.mission.items import Camera, Mission, SurveyPlan
from flight.mission_files.formats import parse_mission, read_fence
from tests.flight.mission_files.malformed_files import BAD_PLAN, plan_data, refused
from world.errors import MissionError


def simple(number: int, lat: float) -> dict[str, Any]:
    return {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": 16,
        "doJumpId": number,
        "frame": 3,
        "params": [0, 0, 0, None, lat, -84.2, 100],
    }


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
    assert mission.warnings == (f"a.plan: mission.items.1: {name} replaced by the 3 simple items that it represents",)


# QGroundControl's custom camera of 6.17 mm by 4.55 mm, 4,000 by 3,000 pixels, behind 4.5 mm.  From 50 m it writes
# footprints of 15.425 m along and 20.5667 m across, which are the distances left by overlaps of 70 %.
CALC = {
    "AdjustedFootprintFrontal": 15.425,
    "AdjustedFootprintSide": 20.566666666666663,
    "CameraName": "Custom Camera",
    "DistanceToSurface": 50,
    "FixedOrientation": False,
    "FocalLength": 4.5,
    "FrontalOverlap": 70,
    "ImageHeight": 3000,
    "ImageWidth": 4000,
    "Landscape": True,
    "MinTriggerInterval": 0,
    "SensorHeight": 4.55,
    "SensorWidth": 6.17,
    "SideOverlap": 70,
}


def trigger(number: int, metres: float) -> dict[str, Any]:
    return simple(number, 0.0) | {"command": 206, "frame": 2, "params": [metres, 0, 1, 0, 0, 0, 0]}


def plan_of_survey(
    calc: dict[str, Any], beyond: Any = 30, metres: float = 15.425000190734863, *, follows: bool = False
) -> Mission:
    held = [simple(1, 36.5), trigger(2, metres), simple(3, 36.51), trigger(4, 0.0)]
    transects = {"Items": held, "CameraCalc": calc, "TurnAroundDistance": beyond, "FollowTerrain": follows}
    survey = {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": transects}
    return parse_mission(plan_with(survey), "a.plan")


def test_the_camera_of_a_survey_is_read() -> None:
    [plan] = plan_of_survey(CALC).survey_plans
    assert (plan.photo, plan.turn_around) == (pytest.approx(15.425), 30.0)
    assert plan.camera is not None
    # What QGroundControl itself worked out: 50 m up, 30 % of what a photo shows.
    assert 0.3 * 50.0 * plan.camera.along == pytest.approx(CALC["AdjustedFootprintFrontal"])
    assert 0.3 * 50.0 * plan.camera.across == pytest.approx(CALC["AdjustedFootprintSide"])
    assert (plan.camera.front, plan.camera.side, plan.camera.interval) == (0.7, 0.7, 0.0)
    assert plan.camera.focal_length_mm == 4.5
    [turned] = plan_of_survey(CALC | {"Landscape": False, "MinTriggerInterval": 1.5}).survey_plans
    pixels = CALC["ImageWidth"], CALC["ImageHeight"]
    assert (plan.camera.pixels_across, plan.stated_photo) == (pixels[0], CALC["AdjustedFootprintFrontal"])
    assert turned.camera == Camera(plan.camera.along, plan.camera.across, 0.7, 0.7, 1.5, pixels[1])
    assert plan.height == 50.0
    # Lines that follow the terrain have no height above home.
    assert plan_of_survey(CALC, follows=True).survey_plans[0].height == 0.0
    # Without pixels the sensor's own sides.
    [plain] = plan_of_survey({key: value for key, value in CALC.items() if not key.startswith("Image")}).survey_plans
    assert plain.camera == Camera(6.17 / 4.5, 4.55 / 4.5, 0.7, 0.7)


def test_a_camera_of_distances_alone_is_none() -> None:
    manual = {"AdjustedFootprintFrontal": 25, "AdjustedFootprintSide": 25, "CameraName": "Manual (no camera specs)"}
    assert plan_of_survey(manual, metres=25.0).survey_plans == (SurveyPlan(25.0, 30.0, stated_photo=25.0),)
    # Nor is one that takes no photos known by a way between them.
    assert plan_of_survey(manual, metres=0.0).survey_plans == (SurveyPlan(0.0, 30.0, stated_photo=25.0),)
    assert parse_mission(plan_with(simple(1, 36.4), simple(2, 36.5)), "a.plan").survey_plans == ()


@pytest.mark.parametrize(
    ("calc", "beyond", "text"),
    [
        ({"FocalLength": 0}, 30, "CameraCalc.FocalLength: 0"),
        ({"SensorWidth": "wide"}, 30, 'CameraCalc.SensorWidth: "wide"'),
        ({"SideOverlap": 100}, 30, "CameraCalc.SideOverlap: 100"),
        ({}, "far", ""),
        ({}, -1, ""),
        ({}, True, ""),
    ],
)
def test_a_camera_that_is_none_is_left_out_and_said_to_be(calc: dict[str, Any], beyond: Any, text: str) -> None:
    mission = plan_of_survey(CALC | calc, beyond)
    [plan] = mission.survey_plans
    assert (plan.camera is None, plan.turn_around) == (bool(text), 30.0 if text else 0.0)
    said = [one for one in mission.warnings if "CameraCalc" in one]
    assert said == (
        [f"a.plan: mission.items.0: {text}: the camera is ignored, and no overlap is judged"] if text else []
    )


@pytest.mark.parametrize(
    ("kind", "name"),
    [(2, "a multicopter or helicopter"), (13, "a multicopter or helicopter"), (10, "a rover"), (20, "a VTOL aircraft")],
)
def test_a_plan_for_another_kind_of_vehicle_is_a_line(kind: int, name: str) -> None:
    data = plan_data()
    data["mission"]["vehicleType"] = kind
    with pytest.raises(MissionError) as caught:
        parse_mission(json.dumps(data), "a.plan")
    assert str(caught.value) == (
        f"a.plan: mission.vehicleType: {kind}: {name}; planfly flies only fixed-wing aircraft (vehicleType 1)"
    )
    # An aeroplane, and what does not say.
    for also in (1, 0, None):
        data["mission"]["vehicleType"] = also
        assert parse_mission(json.dumps(data), "a.plan").items


@pytest.mark.parametrize(("clockwise", "spiral"), [(True, True), (False, True), (True, False)])
def test_a_landing_pattern_is_three_items(clockwise: bool, spiral: bool) -> None:
    pattern = {
        "type": "ComplexItem",
        "complexItemType": "fwLandingPattern",
        "altitudesAreRelative": True,
        "landCoordinate": [36.5, -84.2, 0],
        "landingApproachCoordinate": [36.52, -84.2, 60],
        "loiterRadius": 120,
        "loiterClockwise": clockwise,
        "useLoiterToAlt": spiral,
    }
    mission = parse_mission(plan_with(simple(1, 36.6), pattern), "a.plan")
    assert [item.command for item in mission.items] == [16, 189, 31 if spiral else 16, 21]
    assert [item.seq for item in mission.items] == [1, 2, 3, 4]
    assert mission.items[3].alt == 0.0
    assert not spiral or mission.items[2].params[1] == (120.0 if clockwise else -120.0)


PATTERN = {
    "type": "ComplexItem",
    "complexItemType": "fwLandingPattern",
    "landCoordinate": [36.5, -84.2, 0],
    "landingApproachCoordinate": [36.52, -84.2, 60],
    "loiterRadius": 120,
}


@pytest.mark.parametrize(
    ("settings", "commands"),
    [
        ({}, [189, 31, 21]),
        ({"stopTakingPhotos": True, "stopVideoPhotos": False}, [189, 206, 2001, 31, 21]),
        ({"stopVideoPhotos": True}, [189, 2501, 31, 21]),
        ({"stopTakingPhotos": True, "stopVideoPhotos": True}, [189, 206, 2001, 2501, 31, 21]),
        ({"useDoChangeSpeed": False, "finalApproachSpeed": 15}, [189, 31, 21]),
        (
            {"useDoChangeSpeed": True, "finalApproachSpeed": 15.9, "stopTakingPhotos": True, "stopVideoPhotos": True},
            [189, 178, 206, 2001, 2501, 31, 21],
        ),
    ],
)
def test_a_landing_pattern_stops_the_camera_before_its_approach(settings: dict[str, Any], commands: list[int]) -> None:
    """The order of QGroundControl's LandingComplexItem::appendMissionItems; later items count on."""
    last = simple(2 + len(commands), 36.6)
    mission = parse_mission(plan_with(simple(1, 36.6), PATTERN | settings, last), "a.plan")
    assert [item.command for item in mission.items] == [16, *commands, 16]
    assert [item.seq for item in mission.items] == list(range(1, len(commands) + 3))
    by_command = {item.command: item.params[:3] for item in mission.items}
    assert by_command.get(206, (0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    # SPEED_TYPE_AIRSPEED; QGroundControl passes the speed on as a whole number.
    assert by_command.get(178, (0.0, 15.0, -1.0)) == (0.0, 15.0, -1.0)


@pytest.mark.parametrize(("loiter", "land", "frame"), [(True, True, 3), (False, False, 0), (True, False, 3)])
def test_a_landing_pattern_of_the_first_version_states_its_frames_apart(loiter: bool, land: bool, frame: int) -> None:
    pattern = PATTERN | {"loiterAltitudeRelative": loiter, "landAltitudeRelative": land}
    mission = parse_mission(plan_with(simple(1, 36.6), pattern), "a.plan")
    assert [item.frame for item in mission.items[2:]] == [frame, frame]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (PATTERN | {"useDoChangeSpeed": True, "finalApproachSpeed": "slow"}, 'finalApproachSpeed: "slow": expected'),
        ({"complexItemType": "StructureScan"}, "'StructureScan'"),
        ({"complexItemType": "fwLandingPattern", "landCoordinate": [1, 2]}, "landCoordinate: \\[1, 2\\]"),
        ({"complexItemType": "fwLandingPattern", "landCoordinate": [46.0, None, 0]}, "landCoordinate: \\[46.0, null"),
        (
            {
                "complexItemType": "fwLandingPattern",
                "landCoordinate": [91, 2, 3],
                "landingApproachCoordinate": [1, 2, 3],
            },
            "latitude 91",
        ),
        (
            {
                "complexItemType": "fwLandingPattern",
                "landCoordinate": [1, 2, 3],
                "landingApproachCoordinate": [1, 2, 3],
                "loiterRadius": "wide",
            },
            "loiterRadius",
        ),
    ],
)
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
    assert mission.warnings == (
        "a.plan: the values of doJumpId are not 1 to 3: items are numbered by their order instead",
    )


@pytest.mark.parametrize(("altitude", "known"), [(None, False), (0.0, True), (310.0, True)])
def test_a_home_without_an_altitude_is_not_at_sea_level(altitude: float | None, known: bool) -> None:
    data = plan_data()
    data["mission"]["plannedHomePosition"] = [36.5, -84.2, altitude]
    home = parse_mission(json.dumps(data), "a.plan").home
    assert home is not None
    assert home.alt == altitude if known else math.isnan(home.alt)


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
        "a.plan: mission.items.1: QGroundControl has not calculated its altitude: flown 150 m above the terrain there",
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
    assert [item.command for item in read_fence(file).fences] == [5001] * 3 + [5002] * 3
    # Without one it is no plan of anything.
    data["geoFence"] = {"circles": [], "polygons": [], "version": 2}
    with pytest.raises(MissionError, match=r"^a\.plan: mission\.items: no items$"):
        parse_mission(json.dumps(data), "a.plan")
