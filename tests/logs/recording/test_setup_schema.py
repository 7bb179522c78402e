"""Mission, route and envelope come back from their JSON tables to the last bit, and misfits are refused."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.mission.items import Camera, SurveyPlan
from flight.mission.return_path import ReturnCircle
from logs.recording.setup_attachments import pack_setup, unpack_setup
from logs.recording.setup_schema import EnvelopeTable, MissionTable, RouteTable, SetupModel
from tests.logs.log_copies import same
from tests.logs.made_flight import make_setup
from world.errors import LogError

PLAIN = make_setup()
WATTS = {f"power_{name}": 100.0 / 3.0 * k * np.ones((3, 2)) for k, name in enumerate(("idle", "level", "full"))}
# Circles and power, too, which a route and an envelope may go without.
SETUP = replace(
    PLAIN,
    route=PLAIN.route.with_fields(arc_radius=np.array([0.0, 80.1, 0.0, 0.0])),
    limits=replace(PLAIN.limits, envelope=replace(PLAIN.envelope, volts=44.4, **WATTS)),
)


def through_json(table: SetupModel) -> Any:
    return json.loads(json.dumps(table.model_dump(by_alias=True)))


ROUTE = through_json(RouteTable.from_dataclass(SETUP.route))
ENVELOPE = through_json(EnvelopeTable.from_dataclass(SETUP.envelope))


# Of a return: the circle at its end.
RETURN = {"return_to_east_north_amsl_radius_slope_base_m": [0.0] * 5}


def test_each_table_comes_back_through_json_to_the_last_bit() -> None:
    same(
        MissionTable.model_validate(through_json(MissionTable.from_dataclass(SETUP.mission))).to_mission(),
        SETUP.mission,
    )
    same(RouteTable.model_validate(ROUTE).to_route("x"), SETUP.route)
    same(EnvelopeTable.model_validate(ENVELOPE).to_envelope("x"), SETUP.envelope)


def test_what_is_kept_of_surveys_comes_back() -> None:
    plans = (
        SurveyPlan(25.5, 30.0, Camera(1.5, 1.0, 0.7, None, 2.0, 6000.0, 16.0), 24.0, 120.0),
        SurveyPlan(None),
        SurveyPlan(0.0, 10.0),
    )
    with_surveys = replace(SETUP.mission, survey_plans=plans)
    table = through_json(MissionTable.from_dataclass(with_surveys))
    assert table["survey_plans"][0] == {
        "photo_m": 25.5,
        "turn_around_m": 30.0,
        "camera": {
            **{"across_m_per_m": 1.5, "along_m_per_m": 1.0, "front": 0.7, "side": None, "interval_s": 2.0},
            **{"pixels_across": 6000.0, "focal_length_mm": 16.0},
        },
        "stated_photo_m": 24.0,
        "height_m": 120.0,
    }
    same(MissionTable.model_validate(table).to_mission(), with_surveys)
    # A log of before there were any, and of a mission without a survey, says nothing of them.
    assert "survey_plans" not in json.loads(pack_setup(SETUP)["setup.json"])["mission"]
    packed = pack_setup(replace(SETUP, mission=with_surveys))
    assert unpack_setup(packed, "x").setup.mission.survey_plans == plans


def test_an_unknown_height_is_null() -> None:
    assert (ROUTE["takeoff_ground_m"], ROUTE["landing_ground_m"]) == (None, None)
    known = replace(SETUP.route, takeoff_ground=12.5)
    assert through_json(RouteTable.from_dataclass(known))["takeoff_ground_m"] == 12.5
    same(RouteTable.from_dataclass(known).to_route("x"), known)


def test_a_waypoint_or_item_that_is_none_is_minus_one() -> None:
    assert [ROUTE[key] for key in ("return_from_waypoint", "straight_to_waypoint", "endless_jump")] == [-1] * 3
    made = RouteTable.model_validate(ROUTE).to_route("x")
    assert (made.rtl_start, made.direct_landing_start, made.endless_jump) == (None, None, None)
    with pytest.raises(LogError, match=r"^x: route\.straight_to_waypoint: 4: expected a waypoint, or -1"):
        RouteTable.model_validate(ROUTE | {"straight_to_waypoint": 4}).to_route("x")


def test_a_return_comes_back_with_its_circle() -> None:
    circle = ReturnCircle(1.5, -2.0, 435.1, -80.0, 335.0)
    back = replace(SETUP.route, rtl_start=2, rtl_loiter=circle)
    table = through_json(RouteTable.from_dataclass(back))
    assert table["return_from_waypoint"] == 2
    assert table["return_to_east_north_amsl_radius_slope_base_m"] == [1.5, -2.0, 435.1, -80.0, 335.0]
    made = RouteTable.model_validate(table).to_route("x")
    same(made, back)
    assert made.rtl_loiter is not None
    assert made.rtl_loiter.radius == -80.0
    # A log of before there were returns says nothing of them.
    old = {key: value for key, value in ROUTE.items() if not key.startswith("return")}
    assert RouteTable.model_validate(old).to_route("x").rtl_start is None


def test_numbers_stand_under_the_unit_that_they_have() -> None:
    route, envelope = ROUTE, ENVELOPE
    assert route["waypoints_east_north_amsl_m"][2] == [300.0, 700.0, 460.0]
    assert route["airspeed_mps"] == [25.0, 26.1, 24.7]
    assert route["fly_over"] == [False, True, False, False]
    assert (envelope["airspeed_mps"], envelope["amsl_m"]) == ([18.0, 25.0, 33.3], [0.0, 1500.1])
    assert envelope["descent_rad"][2][0] == 0.3
    item = through_json(MissionTable.from_dataclass(SETUP.mission))["items"][2]
    assert (item["seq"], item["command"], item["alt_m"], item["autocontinue"]) == (3, 16, 460.0, False)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"airspeed_mps": [25.0] * 4}, r"route\.airspeed_mps: 4 values: expected 3"),
        ({"acceptance_m": [0.0] * 3}, r"route\.acceptance_m: 3 values: expected 4"),
        ({"fly_over": [False]}, r"route\.fly_over: 1 values: expected 4"),
        ({"items": []}, r"route\.items: 0 values: expected 4"),
        ({"arcs_m": [0.0]}, r"route\.arcs_m: 1 values: expected 4"),
        ({"return_from_waypoint": 1}, r"route\.return_from_waypoint: 1: expected a waypoint before the last, and a"),
        ({"return_from_waypoint": 3} | RETURN, r"route\.return_from_waypoint: 3: expected a waypoint before"),
        (RETURN, r"route\.return_from_waypoint: -1: expected a waypoint before"),
    ],
)
def test_a_route_whose_arrays_do_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(LogError, match=f"^x: {message}"):
        RouteTable.model_validate(ROUTE | change).to_route("x")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"amsl_m": [1500.0, 0.0]}, r"envelope\.amsl_m: not increasing"),
        ({"airspeed_mps": [18.0, 18.0, 20.0]}, r"envelope\.airspeed_mps: not increasing"),
        ({"climb_rad": [[0.1, 0.1]] * 2}, r"envelope\.climb_rad: shape \[2, 2\]: expected \[3, 2\]"),
        ({"level_speed_min_mps": [16.0]}, r"envelope\.level_speed_min_mps: shape \[1\]: expected \[2\]"),
        ({"power_idle_w": []}, r"envelope\.power_idle_w: shape"),
    ],
)
def test_an_envelope_whose_tables_do_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(LogError, match=f"^x: {message}"):
        EnvelopeTable.model_validate(ENVELOPE | change).to_envelope("x")


@pytest.mark.parametrize(
    "change",
    [
        {"colour": 1},
        {"airspeed": [25.0] * 3},
        {"airspeed_mps": [np.nan] * 3},
        {"airspeed_mps": ["fast"] * 3},
        {"waypoints_east_north_amsl_m": [[0.0, 0.0]]},
        {"items": [1.7, 2, 3, 4]},
        {"items": [2**70, 2, 3, 4]},
        {"takeoff_ground_m": "nan"},
    ],
)
def test_unknown_keys_and_numbers_that_are_none_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="validation error"):
        RouteTable.model_validate(ROUTE | change)
