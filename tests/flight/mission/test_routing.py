"""From missions to routes: what is flown, where it starts, and what is noted or refused."""

import json
import math
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.mission.from_plan import plan_mission
from flight.mission.implied_scenario import implied_scenario, mission_origin
from flight.mission.items import Mission, item_problem
from flight.mission.itinerary import plan_stops
from flight.mission.route import Route
from flight.mission.routing import make_route
from flight.mission_files.formats import mission_text, parse_mission, read_mission
from planner.plan import Certificate, Plan
from world.errors import MissionError, TerrainError
from world.frames import GeoOrigin, to_geo
from world.geometry import leg_runs, leg_slopes, turning_angles
from world.scenario import from_spec, load_scenario
from world.scenario_variants import with_wind
from world.terrain import Terrain, flat_terrain

SAMPLES = Path(__file__).parents[1] / "missions"
ORIGIN = GeoOrigin(36.5, -84.2)

# Counted by hand in the files: legs, and the items that the route goes through (-1: over home).  A loiter is several
# corners of one item: as many eighths of a turn as it takes to leave towards the next place.
LEGS = {
    "by_hand.waypoints": (3, [1, 2, 3, 5]),
    "endless.waypoints": (7, [1, 2, 3, 4, 1, 2, 3, 4]),
    "mavproxy.txt": (21, [1, 2, 4, 7, 8]),
    "mavproxy_terrain.txt": (3, [1, 2, 3, 4]),
    "mission_planner.waypoints": (10, [1, 3, 4, 5, 6, 7, 4, 5, 6, 7, 10]),
    "mission_planner_land.waypoints": (5, [1, 2, 3, 6, 7]),
    "qgc.waypoints": (14, [3, 5, 7, 9, 10, 11]),
    "qgc_amsl.plan": (4, [1, 3, 4, 5, 6]),
    "qgc_takeoff.plan": (7, [-1, 1, 3, 4, 6, 8, 10, 11]),
}
# Those that need ground to count heights from.
ON_TERRAIN = {"endless.waypoints", "mavproxy_terrain.txt"}


def ground(amsl: float = 300.0) -> Terrain:
    return flat_terrain(np.array([[-5000.0, 5000.0], [-5000.0, 5000.0]]), amsl, 1000.0)


def mission(*lines: str, home: str = "36.5 -84.2 300") -> Mission:
    """A mission of lines without seq, current and autocontinue: "frame command p1 p2 p3 p4 lat lon alt"."""
    rows = [f"{k} 0 {line} 1" for k, line in enumerate([f"0 16 0 0 0 0 {home}", *lines])]
    return parse_mission("\n".join(["QGC WPL 110", *rows]), "a.waypoints")


def wp(east: float, north: float, alt: float = 100.0, command: int = 16, frame: int = 3, p: str = "0 0 0 0") -> str:
    lat, lon = to_geo(ORIGIN, east, north)
    return f"{frame} {command} {p} {float(lat):.7f} {float(lon):.7f} {alt}"


def route(*lines: str, home: str = "36.5 -84.2 300", terrain: Terrain | None = None) -> Route:
    return make_route(mission(*lines, home=home), ORIGIN, terrain, 25.0, False)


def refusal(*lines: str, home: str = "36.5 -84.2 300", terrain: Terrain | None = None) -> str:
    with pytest.raises(MissionError) as caught:
        route(*lines, home=home, terrain=terrain)
    message = str(caught.value)
    assert message.startswith("a.waypoints: ")
    assert "\n" not in message
    return message


@pytest.mark.parametrize("name", sorted(LEGS))
def test_samples_fly_over_the_tile(name: str) -> None:
    """Each sample's legs, and that an Aerosonde can fly them: what the flight tests build on."""
    legs, items = LEGS[name]
    read = read_mission(SAMPLES / name)
    scenario = implied_scenario(read, "jacksboro")
    flown = make_route(read, scenario.origin, scenario.terrain, 25.0, False)
    assert flown.legs == legs
    assert [item for item, _ in groupby(flown.items.tolist())] == items
    circling = flown.arcs > 0.0
    assert leg_runs(flown.waypoints)[~(circling[1:] | circling[:-1])].min() >= 600.0
    assert np.degrees(turning_angles(flown.waypoints)).max() < 105.0
    assert np.degrees(np.abs(leg_slopes(flown.waypoints))).max() < 2.5
    assert scenario.terrain is not None
    pairs = zip(flown.waypoints[:-1], flown.waypoints[1:], strict=True)
    assert min(scenario.terrain.clearance(a, b)[0] for a, b in pairs) > 100.0
    assert scenario.external
    assert len(scenario.threats.names) == 0


@pytest.mark.parametrize("name", sorted(set(LEGS) - ON_TERRAIN))
def test_samples_without_terrain(name: str) -> None:
    read = read_mission(SAMPLES / name)
    scenario = implied_scenario(read, None)
    assert scenario.terrain is None
    assert make_route(read, scenario.origin, None, 25.0, False).legs == LEGS[name][0]
    again = from_spec(scenario.to_json(), "log", external=True)
    assert again.to_json() == scenario.to_json()
    assert again.origin == scenario.origin
    assert np.array_equal(again.bounds, scenario.bounds)


def test_heights_that_need_terrain() -> None:
    with pytest.raises(MissionError, match=r"item 1: height above terrain.*no terrain is given"):
        implied_scenario(read_mission(SAMPLES / "mavproxy_terrain.txt"), None)


def test_heights_over_an_unknown_home_count_from_sea_level() -> None:
    mission = read_mission(SAMPLES / "endless.waypoints")
    scenario = implied_scenario(mission, None)
    route = make_route(mission, scenario.origin, None, 25.0, False)
    assert route.waypoints[0, 2] == mission.items[0].alt
    assert any("count from 0 m AMSL" in note for note in route.notes)


def test_foreign_scenario_from_its_log() -> None:
    """A log keeps the scenario's JSON and the terrain, and makes the same scenario of them."""
    scenario = implied_scenario(read_mission(SAMPLES / "qgc.waypoints"), "jacksboro")
    again = from_spec(scenario.to_json(), "log", ground=scenario.terrain, external=True)
    assert again.to_json() == scenario.to_json()
    assert again.origin == scenario.origin
    assert again.ceiling == scenario.ceiling
    for name in ("bounds", "start", "destination"):
        assert np.array_equal(getattr(again, name), getattr(scenario, name))


def test_foreign_scenario_off_the_tile() -> None:
    with pytest.raises(TerrainError, match="the mission flies to east"):
        implied_scenario(mission(wp(0, 0), wp(0, -9000), home="40 -84 0"), "jacksboro")


def test_foreign_scenario_below_ground() -> None:
    """A mission through a hill is not bad input: it has a scenario, and its verdict says no."""
    read = mission(wp(3000, 3000, 20, frame=0), wp(3000, 6000, 20, frame=0))
    scenario = implied_scenario(read, "jacksboro")
    assert scenario.terrain is not None
    assert scenario.destination[2] > 100.0
    assert make_route(read, scenario.origin, scenario.terrain, 25.0, False).waypoints[:, 2].tolist() == [20.0, 20.0]


def test_origin() -> None:
    assert mission_origin(mission(wp(0, 500), wp(0, 900))) == GeoOrigin(36.5, -84.2)
    # A ground station's default home on the other side of the world is nobody's home.
    away = mission_origin(mission(wp(0, 500), wp(0, 900), home="47.4 8.5 488"))
    assert away.lat_deg == pytest.approx(36.5045, abs=1e-4)


def test_starts() -> None:
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


def test_take_off_without_home() -> None:
    """Home at 0, 0 means none: the first position item stands for it."""
    flown = route(wp(0, 700, 80, command=22), wp(900, 700), home="0 0 0", terrain=ground())
    assert flown.items.tolist() == [1, 2]
    assert flown.waypoints[0] == pytest.approx([0.0, 700.0, 380.0], abs=0.01)
    assert "over the first position, as there is no home" in flown.started
    assert "no home height: taken as the ground at 36.506" in flown.notes[-1]


def test_frames() -> None:
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


def test_home_that_is_not_on_the_ground() -> None:
    flown = route(wp(0, 100), wp(0, 900), home="36.5 -84.2 0", terrain=ground())
    assert "home is at 0.0 m AMSL, and the ground there at 300.0 m" in flown.notes[0]


def test_speeds_count_for_the_legs_after_them() -> None:
    flown = route(
        wp(0, 0),
        wp(0, 900),
        "2 178 0 22 -1 0 0 0 0",
        wp(0, 1800),
        "2 178 1 28 80 0 0 0 0",
        "2 178 2 3 -1 0 0 0 0",
        wp(0, 2700),
        "2 178 0 -1 -1 0 0 0 0",
        wp(0, 3600),
        "2 178 0 -2 -1 0 0 0 0",
        wp(0, 4500),
        "2 178 0 0 -1 0 0 0 0",
        wp(0, 5400),
    )
    assert flown.airspeed.tolist() == [25.0, 22.0, 28.0, 28.0, 25.0, 25.0]
    assert flown.notes == (
        "item 5: DO_CHANGE_SPEED of ground speed: flown as airspeed",
        "item 5: DO_CHANGE_SPEED's throttle: ignored",
        "item 6: DO_CHANGE_SPEED of type 2, neither airspeed nor ground speed: ignored",
        "item 12: DO_CHANGE_SPEED to 0 m/s: ignored",
    )


def test_cruise_speed_is_no_command() -> None:
    flown = make_route(read_mission(SAMPLES / "qgc_amsl.plan"), ORIGIN, None, 25.0, False)
    assert set(flown.airspeed.tolist()) == {25.0}
    assert "cruiseSpeed 15 m/s is the ground station's estimate" in flown.notes[-1]


def test_jumps() -> None:
    corners = [wp(0, 0), wp(0, 900), wp(900, 900)]
    assert route(*corners, "2 177 2 2 0 0 0 0 0").items.tolist() == [1, 2, 3, 2, 3, 2, 3]
    assert route(*corners, "2 177 1 0 0 0 0 0 0").items.tolist() == [1, 2, 3]
    endless = route(*corners, "2 177 2 -1 0 0 0 0 0")
    assert endless.items.tolist() == [1, 2, 3, 2, 3]
    assert endless.notes == ("item 4: DO_JUMP without end: taken once",)
    skipping = route(wp(0, 0), "2 177 4 1 0 0 0 0 0", wp(0, 900), wp(900, 900))
    assert skipping.items.tolist() == [1, 4]
    assert skipping.notes == ("item 3: never reached",)
    # A counter is never reset: the inner jump is taken once, not once each time round.
    nested = route(*corners, "2 177 2 1 0 0 0 0 0", "2 177 1 1 0 0 0 0 0")
    assert nested.items.tolist() == [1, 2, 3, 2, 3, 1, 2, 3]


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 6), st.integers(0, 30))
def test_a_jump_flies_its_body_once_more_each_time(corners: int, repeats: int) -> None:
    places = [wp(900 * math.cos(k), 900 * math.sin(k)) for k in range(corners)]
    flown = route(*places, f"2 177 1 {repeats} 0 0 0 0 0")
    assert flown.items.tolist() == list(range(1, corners + 1)) * (repeats + 1)


def test_jumps_that_are_refused() -> None:
    assert "item 3: DO_JUMP p1 9: the mission has no item 9" in refusal(wp(0, 0), wp(0, 900), "2 177 9 1 0 0 0 0 0")
    assert "DO_JUMP p1 0" in refusal(wp(0, 0), wp(0, 900), "2 177 0 1 0 0 0 0 0")
    assert "more than 10,000 places" in refusal(wp(0, 0), wp(0, 900), "2 177 1 9999 0 0 0 0 0")
    assert "more than 200,000 items" in refusal(wp(0, 0), wp(0, 900), "2 177 3 999999 0 0 0 0 0")


def test_ends() -> None:
    home = route(wp(0, 500, 150), wp(0, 1500, 200), "0 20 0 0 0 0 0 0 0", wp(5, 5))
    assert home.waypoints[-1] == pytest.approx([0.0, 0.0, 500.0], abs=0.01)
    assert home.notes == (
        "item 3: NAV_RETURN_TO_LAUNCH: flown as a leg to home at the last height",
        "item 4: never reached",
    )
    landed = route(
        wp(0, 500, 150), "3 189 0 0 0 0 36.5 -84.2 0", wp(0, 1500, 60), wp(900, 1500, 0, command=21), wp(0, 0)
    )
    assert landed.waypoints[-1] == pytest.approx([900.0, 1500.0, 360.0], abs=0.02)
    assert [note.split(":")[0] for note in landed.notes] == ["item 2", "item 4", "item 5"]
    here = route(wp(0, 500), wp(0, 1500), "3 85 0 0 0 0 0 0 0")
    assert here.items.tolist() == [1, 2]
    assert "without a position" in here.notes[0]
    ignored = route(wp(0, 500), wp(0, 1500), "0 20 0 0 0 0 0 0 0", home="0 0 0", terrain=ground())
    assert ignored.legs == 1
    assert ignored.notes[0] == "item 3: NAV_RETURN_TO_LAUNCH without a home: ignored"


# One line each of the commands that a fixed wing's mission may hold; none may go in silence.
@pytest.mark.parametrize(
    "command", [17, 18, 19, 30, 31, 80, 82, 92, 93, 94, 112, 115, 183, 189, 201, 206, 530, 601, 2000, 50_000]
)
def test_nothing_is_dropped_in_silence(command: int) -> None:
    flown = route(wp(0, 0), wp(0, 900, command=command), wp(900, 900), f"2 {command} 1 2 3 4 0 0 0")
    flies = command in (17, 18, 19, 31, 82, 94)
    assert (2 in flown.items) == flies
    assert {number for note in flown.notes for number in ("2", "4") if number in note.split(":")[0]} == {"2", "4"}


def test_merging() -> None:
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


def test_null_in_a_plan() -> None:
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


def test_acceptance_and_fly_over() -> None:
    read = mission(wp(0, 0, p="0 40 0 0"), wp(0, 900, p="0 -3 0 0"), wp(900, 900, command=18, p="1 2 80 0"))
    flown = make_route(read, ORIGIN, None, 25.0, True)
    assert flown.acceptance[:2].tolist() == [40.0, 0.0]
    assert not flown.acceptance[2:].any()
    assert flown.fly_over.tolist() == (flown.arcs == 0.0).tolist()
    assert flown.fly_over[:2].all()


def test_long_missions_walk_in_linear_time() -> None:
    stops = plan_stops(mission(*[wp(k, k) for k in range(9000)]), 25.0).stops
    assert len(stops) == 9000


def a_plan(points: list[tuple[float, float, float]]) -> Plan:
    scenario = with_wind(load_scenario("jacksboro"), 0.0, 0.0, None)
    certificate = Certificate(0.1, 100.0, 0.1, 50.0, 500.0, 100.0, ())
    zeros = np.zeros(4)
    return Plan(scenario, np.array(points), zeros.astype(int), zeros, certificate, 1, "umda", 10, np.zeros((1, 3)))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-12_000, 12_000), st.floats(-9000, 9000), st.floats(300, 1100)),
        min_size=2,
        max_size=20,
        unique_by=lambda p: (round(p[0] / 10), round(p[1] / 10)),
    )
)
def test_an_exported_plan_comes_back(points: list[tuple[float, float, float]]) -> None:
    """Through both forms, with equal numbers, to the planned waypoints within the grid's 8 mm."""
    plan = a_plan(points)
    exported = plan_mission(plan, 25.0, math.radians(30.0))
    assert all(item_problem(item) is None for item in exported.items)
    assert parse_mission(mission_text(exported, "waypoints"), "a.waypoints") == exported
    assert parse_mission(mission_text(exported, "plan"), "a.plan") == exported
    assert parse_mission(mission_text(exported, "plan"), "a.plan").cruise_speed == 25.0
    flown = make_route(exported, plan.scenario.origin, plan.scenario.terrain, 18.0, False)
    assert flown.waypoints.shape == plan.waypoints.shape
    assert np.abs(flown.waypoints - plan.waypoints).max() < 0.008
    assert set(flown.airspeed.tolist()) == {25.0}
    assert flown.notes == ()
    assert (flown.acceptance >= 10.0).all()


def test_export_of_a_corner() -> None:
    """R = 625 / (9.80665 tan 30) = 110.39 m; at 60 degrees the arc passes R(1/cos 30 - 1) = 17.08 m from the corner."""
    corner = [(0.0, 0.0, 700.0), (0.0, 1000.0, 700.0), (866.0, 1500.0, 700.0)]
    exported = plan_mission(a_plan(corner), 25.0, math.radians(30.0))
    assert [item.params[1] for item in exported.items] == [25.0, 10.0, 28.0, 10.0]
    assert exported.home is not None
    terrain = load_scenario("jacksboro").terrain
    assert terrain is not None
    assert exported.home.alt == pytest.approx(float(terrain.height(0.0, 0.0)), abs=0.001)
