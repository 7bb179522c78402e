"""Routes: what is flown, at which heights, where it starts, and what is noted or refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from flight.mission.implied_scenario import implied_scenario
from flight.mission.routing import make_route
from flight.mission_files.formats import mission_text, parse_mission, read_mission
from tests.mission_lines import ORIGIN, ground, mission, refusal, route, wp
from world.errors import MissionError

SAMPLES = Path(__file__).parents[1] / "missions"


def test_heights_over_an_unknown_home_count_from_sea_level() -> None:
    mission = read_mission(SAMPLES / "endless.waypoints")
    scenario = implied_scenario(mission, None).scenario
    route = make_route(mission, scenario.origin, None, 25.0, False)
    assert route.waypoints[0, 2] == mission.items[0].alt
    assert any("count from 0 m AMSL" in note for note in route.notes)


def test_a_route_starts_at_the_first_position_or_over_home() -> None:
    plain = route(wp(0, 500, 120), wp(0, 1500, 150))
    assert plain.waypoints[0] == pytest.approx([0.0, 500.0, 420.0], abs=0.01)
    assert plain.started.startswith("no TAKEOFF: starts trimmed at the first position, item 1: 36.504")
    assert plain.started.endswith("420.0 m AMSL, on course 0 degrees")
    over_home = route("3 22 15 0 0 0 0 0 80", wp(900, 0))
    assert over_home.waypoints[0] == pytest.approx([0.0, 0.0, 380.0], abs=0.01)
    assert over_home.items.tolist() == [1, 2]
    assert over_home.started.startswith(
        "NAV_TAKEOFF (item 1): starts trimmed in the air over home at that item's height"
    )
    own_place = route(wp(0, 700, 80, command=22), wp(900, 700))
    assert own_place.items.tolist() == [-1, 1, 2]
    assert own_place.waypoints[:2] == pytest.approx(np.array([[0, 0, 380], [0, 700, 380]]), abs=0.01)
    same_place = route(wp(0, 0, 80, command=84), wp(900, 700))
    assert same_place.items.tolist() == [1, 2]


def test_a_take_off_without_home_starts_at_the_first_position() -> None:
    """Home at 0, 0 means none: the first position item stands for it."""
    flown = route(wp(0, 700, 80, command=22), wp(900, 700), home="0 0 0", terrain=ground())
    assert flown.items.tolist() == [1, 2]
    assert flown.waypoints[0] == pytest.approx([0.0, 700.0, 380.0], abs=0.01)
    assert "over the first position, as there is no home" in flown.started
    assert "no home height: taken as the ground at 36.506" in flown.notes[-1]


def test_heights_of_every_frame_are_amsl() -> None:
    flown = route(
        wp(0, 100, 450, frame=0),
        wp(0, 900, 450, frame=5),
        wp(0, 1900, 150, frame=3),
        wp(0, 2900, 150, frame=6),
        wp(0, 3900, 140, frame=10),
        wp(0, 4900, 140, frame=11),
        terrain=ground(310.0),
    )
    assert flown.waypoints[:, 2].tolist() == pytest.approx([450, 450, 450, 450, 450, 450])
    assert "items 5-6: height above terrain" in flown.notes[0]


def test_a_home_off_the_ground_is_noted() -> None:
    flown = route(wp(0, 100), wp(0, 900), home="36.5 -84.2 0", terrain=ground())
    assert "home is at 0.0 m AMSL, and the ground there at 300.0 m" in flown.notes[0]


def test_cruise_speed_is_no_command() -> None:
    flown = make_route(read_mission(SAMPLES / "qgc_amsl.plan"), ORIGIN, None, 25.0, False)
    assert set(flown.airspeed.tolist()) == {25.0}
    assert "cruiseSpeed 15 m/s is the ground station's estimate" in flown.notes[-1]


def test_stops_at_one_position_are_merged() -> None:
    flown = route(wp(0, 0), wp(0, 900), wp(0.3, 900.3), wp(0, 900), wp(900, 900))
    assert flown.items.tolist() == [1, 2, 5]
    assert flown.notes == ("items 3-4: at the place of item 2: merged with it",)
    assert "item 3: 150.0 m straight above item 2" in refusal(wp(0, 0), wp(0, 900), wp(0, 900, 250), wp(900, 900))


def test_refusals_name_the_item() -> None:
    assert "no item with a position" in refusal("2 178 0 25 -1 0 0 0 0")
    assert "1 place to fly to" in refusal(wp(0, 0))
    assert "1 place to fly to" in refusal(wp(0, 0), wp(0, 0))
    assert "item 1: height above terrain (frame 10): no terrain" in refusal(wp(0, 0, frame=10), wp(0, 900))
    assert "has no data there" in refusal(wp(0, 0), wp(0, 9000, frame=10), terrain=ground())
    assert "item 2: 9400.0 m AMSL: allowed -500..9000" in refusal(wp(0, 0), wp(0, 900, 9100))
    # Swapped columns that are both within range end on another continent.
    assert "item 2: latitude -84" in refusal(wp(0, 0), "3 16 0 0 0 0 -84.2 36.5 100")


def test_null_in_a_plan_keeps_what_is() -> None:
    """NaN means "as it is now": no position is none to fly to, no altitude keeps the last."""
    data = json.loads(mission_text(mission(wp(0, 0), wp(0, 900), wp(900, 900, 180)), "plan"))
    first, second, third = (item["params"] for item in data["mission"]["items"])
    second[4:6] = [None, None]
    third[6] = None
    flown = make_route(parse_mission(json.dumps(data), "a.plan"), ORIGIN, None, 25.0, False)
    assert flown.items.tolist() == [1, 3]
    assert flown.waypoints[:, 2].tolist() == [400.0, 400.0]
    assert "item 2: NAV_WAYPOINT without a position" in flown.notes[0]
    assert flown.notes[1] == "item 3: NAV_WAYPOINT without an altitude: keeps the last height"
    first[6] = None
    with pytest.raises(MissionError, match="item 1: no altitude, and none before to keep"):
        make_route(parse_mission(json.dumps(data), "a.plan"), ORIGIN, None, 25.0, False)


def test_circles_are_flown_by_whatever_the_waypoints_are() -> None:
    read = mission(wp(0, 0, p="0 40 0 0"), wp(0, 900, p="0 -3 0 0"), wp(900, 900, command=18, p="1 2 80 0"))
    flown = make_route(read, ORIGIN, None, 25.0, True)
    assert flown.acceptance[:2].tolist() == [40.0, 0.0]
    assert not flown.acceptance[2:].any()
    assert flown.fly_over.tolist() == (flown.arcs == 0.0).tolist()
    assert flown.fly_over[:2].all()
