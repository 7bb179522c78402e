"""What an autopilot gets of a mission: places above the sea, jumps to where they lead, and one place more."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.items import Command, Frame, Home, Mission, MissionItem
from flight.mission.routing import make_route
from flight.real_autopilot.uploaded_mission import uploaded_mission
from flight.simulation.flight_setup import FlightSetup, make_limits
from tests.setups import setup_maker
from world.frames import to_geo, to_map
from world.scenario import load_scenario

AEROSONDE = load_aircraft("aerosonde")
ENVELOPE = load_envelope(AEROSONDE)
SCENARIO = load_scenario("tight")
C = Command
HOME = Home(46.0, 8.0, 20.0)


def place(seq: int, north: float, up: float = 80.0, command: int = C.NAV_WAYPOINT, **more: Any) -> MissionItem:
    """An item north of the map's origin, m; its height is over home."""
    lat, lon = to_geo(SCENARIO.origin, 0.0, north)
    params = more.get("params", (0.0,) * 4)
    frame = int(more.get("frame", Frame.GLOBAL_RELATIVE_ALT))
    return MissionItem(seq, int(command), frame, params, float(lat), float(lon), up)


def order(seq: int, command: int, *params: float) -> MissionItem:
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(seq, int(command), int(Frame.MISSION), (p1, p2, p3, p4), 0.0, 0.0, 0.0)


def setup_of(*items: MissionItem, home: Home | None = HOME) -> FlightSetup:
    mission = Mission(home, items)
    limits = make_limits(SCENARIO, ENVELOPE, 25.0, 0.5)
    route = make_route(mission, SCENARIO.origin, SCENARIO.terrain, 25.0, False, limits)
    return FlightSetup(SCENARIO, mission, "", route, limits, "aerosonde", 100.0, 1)


def flown(setup: FlightSetup) -> list[tuple[int, int, int, int]]:
    """Number, command, metres north and metres up of each item."""
    found = []
    for item in uploaded_mission(setup).items:
        _, north = to_map(SCENARIO.origin, item.lat_deg, item.lon_deg)
        found.append((item.seq, item.command, round(float(north)), round(item.alt)))
    return found


def test_places_are_above_the_sea_and_one_more_is_straight_on() -> None:
    setup = setup_of(place(1, 0.0), order(2, C.DO_CHANGE_SPEED, 0, 22, -1), place(3, 900.0, 90.0))
    items = uploaded_mission(setup).items
    assert [(item.seq, item.command, item.alt) for item in items] == [
        (1, 16, 100.0), (2, 178, 0.0), (3, 16, 110.0), (4, 16, 110.0)
    ]  # fmt: skip
    assert flown(setup)[-1] == (4, 16, 1900, 110)
    assert {item.frame for item in items if item.command == 16} == {Frame.GLOBAL}
    assert items[1].params == (0.0, 22.0, -1.0, 0.0)


def test_an_acceptance_radius_goes_with_its_waypoint() -> None:
    setup = setup_of(place(1, 0.0), place(2, 900.0, params=(0.0, 35.0, 0.0, 0.0)), place(3, 1900.0))
    assert [item.params[1] for item in uploaded_mission(setup).items] == [0.0, 35.0, 0.0, 0.0]


def test_what_cannot_be_in_the_air_is_a_waypoint_where_the_route_has_it() -> None:
    setup = setup_of(
        place(1, 500.0, 60.0, C.NAV_TAKEOFF), order(2, C.DO_SET_SERVO, 9, 1500), place(3, 1500.0),
        place(4, 2500.0, 0.0, C.NAV_LAND),
    )  # fmt: skip
    # The landing ends above its place at the last height, 80 m over home.
    assert flown(setup) == [(1, 16, 500, 80), (2, 16, 1500, 100), (3, 16, 2500, 100), (4, 16, 3500, 100)]


def test_a_return_to_launch_is_a_leg_home_at_the_last_height_and_nothing_follows() -> None:
    items = (place(1, 1500.0), place(2, 2500.0), order(3, C.NAV_RETURN_TO_LAUNCH), place(4, 9000.0))
    setup = setup_of(*items)
    assert flown(setup) == [(1, 16, 1500, 100), (2, 16, 2500, 100), (3, 16, 0, 100), (4, 16, -1000, 100)]


def test_a_jump_leads_to_the_item_that_it_named() -> None:
    setup = setup_of(
        order(1, C.DO_SET_SERVO, 9, 1500), place(2, 0.0), order(3, C.DO_SET_SERVO, 9, 1500), place(4, 900.0),
        place(5, 1900.0), order(6, C.DO_JUMP, 3, 2), place(7, 2900.0),
    )  # fmt: skip
    kept = [(item.seq, item.command, item.params[:2]) for item in uploaded_mission(setup).items]
    # Item 3 is left out, and 4 comes after it.
    assert kept[3] == (4, 177, (2.0, 2.0))
    assert [command for _, command, _ in kept] == [16, 16, 16, 177, 16, 16]


def test_a_loiter_keeps_its_centre_and_its_turns_and_one_without_end_gets_the_routes() -> None:
    turns, endless = (2.0, 0.0, -150.0, 0.0), (0.0, 0.0, 150.0, 0.0)
    setup = setup_of(
        place(1, 0.0), place(2, 1500.0, 80.0, C.NAV_LOITER_TURNS, params=turns),
        place(3, 4000.0, 80.0, C.NAV_LOITER_UNLIM, params=endless),
    )  # fmt: skip
    first, second = uploaded_mission(setup).items[1:3]
    assert (first.command, first.params, round(first.alt)) == (18, turns, 100)
    assert (second.command, second.params) == (19, (60.0, 0.0, 150.0, 0.0))
    assert flown(setup)[1][2] == 1500


def test_home_is_the_missions_unless_it_would_hold_the_motor_back() -> None:
    assert uploaded_mission(setup_of(place(1, 0.0), place(2, 900.0))).home == HOME
    # 80 m over a home at 20 m is where the flight starts: one at 90 m is too near.
    near = uploaded_mission(setup_of(place(1, 0.0, 5.0), place(2, 900.0, 9.0), home=Home(46.0, 8.0, 75.0))).home
    assert (near.lat_deg, near.alt) == (46.0, pytest.approx(80.0 - 100.0))


def test_a_mission_without_a_home_has_it_below_the_start() -> None:
    way = [place(k, 900.0 * k, 80.0, frame=Frame.GLOBAL) for k in (1, 2)]
    home = uploaded_mission(setup_of(*way, home=None)).home
    _, north = to_map(SCENARIO.origin, home.lat_deg, home.lon_deg)
    assert (round(float(north)), home.alt) == (900, -20.0)


def test_a_route_of_no_mission_is_its_waypoints_and_its_speeds() -> None:
    way = np.array([[0.0, 0.0, 500.0], [0.0, 1000.0, 500.0], [0.0, 2000.0, 500.0], [0.0, 3000.0, 520.0]])
    setup = setup_maker(AEROSONDE)(way, speeds=[25.0, 25.0, 22.0])
    found = [
        (item.command, item.params[1] if item.command == 178 else item.alt) for item in uploaded_mission(setup).items
    ]
    assert found == [(16, 500.0), (178, 25.0), (16, 500.0), (16, 500.0), (178, 22.0), (16, 520.0), (16, 520.0)]


def test_the_end_of_a_lead_out_leg_is_a_place_too() -> None:
    setup = setup_of(place(1, 0.0), place(2, 900.0))
    route = setup.route
    longer = replace(
        route,
        waypoints=np.vstack([route.waypoints, route.waypoints[-1] + [300.0, 0.0, 0.0]]),
        airspeed=np.append(route.airspeed, 25.0),
        acceptance=np.append(route.acceptance, 0.0),
        fly_over=np.append(route.fly_over, False),
        items=np.append(route.items, -1),
        arcs=np.append(route.arcs, 0.0),
    )
    east = [
        round(float(to_map(SCENARIO.origin, item.lat_deg, item.lon_deg)[0]))
        for item in uploaded_mission(replace(setup, route=longer)).items
    ]
    assert east == [0, 0, 300, 1300]
