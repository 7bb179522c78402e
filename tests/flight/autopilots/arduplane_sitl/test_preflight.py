"""What an autopilot gets of a mission: places above the sea, jumps to where they lead, and one place more."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane_sitl.preflight import AUTO, Preflight, version_text
from flight.autopilots.sitl.conversation import ConversationStep
from flight.autopilots.sitl.link import ReportedState
from flight.autopilots.sitl.mission import UploadedMission, make_uploaded_mission
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.items import Command, Frame, Home, Mission, MissionItem
from flight.mission.itinerary import NO_ITEM
from flight.mission.route import make_route, route_points
from flight.simulation.setup import FlightSetup, make_limits
from tests.setups import setup_maker
from world.errors import FlightError
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
    return FlightSetup(SCENARIO, mission, route, limits, "aerosonde", 100.0, 1)


def flown(setup: FlightSetup) -> list[tuple[int, int, int, int]]:
    """Number, command, metres north and metres up of each item."""
    found = []
    for item in make_uploaded_mission(setup).items:
        _, north = to_map(SCENARIO.origin, item.lat_deg, item.lon_deg)
        found.append((item.seq, item.command, round(float(north)), round(item.alt)))
    return found


def test_places_are_above_the_sea_and_one_more_is_straight_on() -> None:
    setup = setup_of(place(1, 0.0), order(2, C.DO_CHANGE_SPEED, 0, 22, -1), place(3, 900.0, 90.0))
    items = make_uploaded_mission(setup).items
    assert [(item.seq, item.command, item.alt) for item in items] == [
        (1, 16, 100.0),
        (2, 178, 0.0),
        (3, 16, 110.0),
        (4, 16, 110.0),
    ]
    assert flown(setup)[-1] == (4, 16, 1900, 110)
    assert {item.frame for item in items if item.command == 16} == {Frame.GLOBAL}
    assert items[1].params == (0.0, 22.0, -1.0, 0.0)


def test_an_acceptance_radius_goes_with_its_waypoint() -> None:
    setup = setup_of(place(1, 0.0), place(2, 900.0, params=(0.0, 35.0, 0.0, 0.0)), place(3, 1900.0))
    assert [item.params[1] for item in make_uploaded_mission(setup).items] == [0.0, 35.0, 0.0, 0.0]


def test_a_waypoint_is_uploaded_with_what_its_file_says() -> None:
    """Its time to hold, the distance to fly on beyond it, and its yaw; only a NaN becomes 0."""
    stated = (5.0, 35.0, 150.0, math.nan)
    setup = setup_of(place(1, 0.0), place(2, 900.0, params=stated), place(3, 1900.0, params=(0.0, 0.0, -40.0, 90.0)))
    assert [item.params for item in make_uploaded_mission(setup).items[1:3]] == [
        (5.0, 35.0, 150.0, 0.0),
        (0.0, 0.0, -40.0, 90.0),
    ]


def test_what_cannot_be_in_the_air_is_a_waypoint_where_the_route_has_it() -> None:
    setup = setup_of(
        place(1, 500.0, 60.0, C.NAV_TAKEOFF),
        order(2, C.DO_SET_SERVO, 9, 1500),
        place(3, 1500.0),
        place(4, 2500.0, 0.0, C.NAV_LAND),
    )
    # The landing ends above its place at the last height, 80 m over home.
    assert flown(setup) == [(1, 16, 500, 80), (2, 16, 1500, 100), (3, 16, 2500, 100), (4, 16, 3500, 100)]


def test_a_return_to_launch_goes_as_it_is_with_home_and_the_rally_points_and_nothing_follows() -> None:
    items = (place(1, 1500.0), place(2, 2500.0), order(3, C.NAV_RETURN_TO_LAUNCH), place(4, 9000.0))
    setup = setup_of(*items)
    rally = (place(0, 2000.0, 60.0, C.NAV_RALLY_POINT),)
    given = make_uploaded_mission(replace(setup, mission=replace(setup.mission, rally=rally)))
    assert [(item.seq, item.command) for item in given.items] == [(1, 16), (2, 16), (3, 20)]
    # A home 15 m below the start is left where it is: the return's height counts from it.
    assert (given.home, given.rally) == (HOME, rally)
    assert make_uploaded_mission(setup_of(place(1, 1500.0), place(2, 2500.0))).rally == ()


def test_a_jump_leads_to_the_item_that_it_named() -> None:
    setup = setup_of(
        order(1, C.DO_SET_SERVO, 9, 1500),
        place(2, 0.0),
        order(3, C.DO_SET_SERVO, 9, 1500),
        place(4, 900.0),
        place(5, 1900.0),
        order(6, C.DO_JUMP, 3, 2),
        place(7, 2900.0),
    )
    kept = [(item.seq, item.command, item.params[:2]) for item in make_uploaded_mission(setup).items]
    # Item 3 is left out, and 4 comes after it.
    assert kept[3] == (4, 177, (2.0, 2.0))
    assert [command for _, command, _ in kept] == [16, 16, 16, 177, 16, 16]


def test_a_loiter_keeps_its_centre_and_its_turns_and_one_without_end_stays_and_is_the_last() -> None:
    turns, endless = (2.0, 0.0, -150.0, 0.0), (0.0, 0.0, 150.0, 0.0)
    setup = setup_of(
        place(1, 0.0),
        place(2, 1500.0, 80.0, C.NAV_LOITER_TURNS, params=turns),
        place(3, 4000.0, 80.0, C.NAV_LOITER_UNLIM, params=endless),
    )
    first, second = make_uploaded_mission(setup).items[1:3]
    assert (first.command, first.params, round(first.alt)) == (18, turns, 100)
    # ArduPlane flies the item's radius without end, but WP_LOITER_RAD for a time: no other item stands for this one.
    assert (second.command, second.params) == (17, endless)
    assert len(make_uploaded_mission(setup).items) == 3
    assert flown(setup)[1][2] == 1500


def test_home_is_the_missions_unless_it_would_hold_the_motor_back() -> None:
    assert make_uploaded_mission(setup_of(place(1, 0.0), place(2, 900.0))).home == HOME
    # 80 m over a home at 20 m is where the flight starts: one at 90 m is too near.
    near = make_uploaded_mission(setup_of(place(1, 0.0, 5.0), place(2, 900.0, 9.0), home=Home(46.0, 8.0, 75.0))).home
    assert (near.lat_deg, near.alt) == (46.0, pytest.approx(80.0 - 100.0))


def test_a_mission_without_a_home_has_it_below_the_start() -> None:
    way = [place(k, 900.0 * k, 80.0, frame=Frame.GLOBAL) for k in (1, 2)]
    home = make_uploaded_mission(setup_of(*way, home=None)).home
    _, north = to_map(SCENARIO.origin, home.lat_deg, home.lon_deg)
    assert (round(float(north)), home.alt) == (900, -20.0)


def test_a_route_of_no_mission_is_its_waypoints_and_its_speeds() -> None:
    way = np.array([[0.0, 0.0, 500.0], [0.0, 1000.0, 500.0], [0.0, 2000.0, 500.0], [0.0, 3000.0, 520.0]])
    setup = setup_maker(AEROSONDE)(way, speeds=[25.0, 25.0, 22.0])
    found = [
        (item.command, item.params[1] if item.command == 178 else item.alt)
        for item in make_uploaded_mission(setup).items
    ]
    assert found == [(16, 500.0), (178, 25.0), (16, 500.0), (16, 500.0), (178, 22.0), (16, 520.0), (16, 520.0)]


def test_the_end_of_a_lead_out_leg_is_a_place_too() -> None:
    setup = setup_of(place(1, 0.0), place(2, 900.0))
    route = setup.route
    way = np.vstack([route.positions, route.positions[-1] + [300.0, 0.0, 0.0]])
    longer = replace(route, points=route_points(way, 25.0, item=[*route.items, NO_ITEM]))
    east = [
        round(float(to_map(SCENARIO.origin, item.lat_deg, item.lon_deg)[0]))
        for item in make_uploaded_mission(replace(setup, route=longer)).items
    ]
    assert east == [0, 0, 300, 1300]


# ----------------------------------------------------------------------
# The conversation before a flight, with an autopilot that is a few answers made by hand.

WAYPOINTS = tuple(MissionItem(k, 16, 0, (0.0, 20.0, 0.0, 0.0), 36.5 + 0.01 * k, -84.2, 500.0) for k in (1, 2, 3))
MISSION = UploadedMission(Home(36.5, -84.2, 300.0), WAYPOINTS)
EKF_GOOD = 831


class Autopilot:
    """A link's two ends in one: what is sent is answered at once."""

    def __init__(self) -> None:
        self.reported = ReportedState(vehicle=1, ekf=EKF_GOOD)
        self.sent: list[Any] = []
        self.received: list[Any] = []
        self.results = [mavlink.MAV_MISSION_ACCEPTED]
        self.has: dict[str, float] = {}
        self.accepts: Callable[[int], int] = lambda command: mavlink.MAV_RESULT_ACCEPTED

    def send(self, message: Any) -> None:
        self.sent.append(message)
        kind = message.get_type()
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            result = self.reported.acknowledged[message.command] = self.accepts(message.command)
            if message.command == 176 and result == 0:
                self.reported.mode, self.reported.armed = AUTO, True
        if kind == "PARAM_REQUEST_READ":
            self.reported.parameters |= {name: self.has[name] for name in (message.param_id,) if name in self.has}
        if kind == "MISSION_COUNT":
            self.count, self.received, self.reported.requested = message.count, [], 0
        if kind == "MISSION_ITEM_INT":
            self.received.append(message)
            if len(self.received) < self.count:
                self.reported.requested = len(self.received)
            else:
                self.reported.mission_result = self.results.pop(0)

    def commands(self) -> list[int]:
        return [message.command for message in self.sent if message.get_type().startswith("COMMAND")]


class Clock:
    """Time that goes on by a tenth of a second a turn."""

    def __init__(self) -> None:
        self.time = 0.0

    def go_through(self, talk: ConversationStep) -> None:
        for _ in talk:
            self.time += 0.1


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def autopilot() -> Autopilot:
    return Autopilot()


def preflight(autopilot: Autopilot, clock: Clock) -> Preflight:
    return Preflight(autopilot, lambda: clock.time, lambda: clock.time)  # type: ignore[arg-type]  # a link by hand


def test_it_is_given_the_mission_home_and_auto_in_order(autopilot: Autopilot, clock: Clock) -> None:
    clock.go_through(preflight(autopilot, clock).prepare(MISSION))
    assert [(item.seq, item.x, item.z) for item in autopilot.received] == [
        (0, 365000000, 300.0),
        (1, 365100000, 500.0),
        (2, 365200000, 500.0),
        (3, 365300000, 500.0),
    ]
    assert autopilot.commands()[-3:] == [179, 400, 176]
    home, arm, mode = autopilot.sent[-3:]
    assert (home.x, home.y, home.z, home.frame) == (365000000, -842000000, 300.0, 0)
    assert (arm.param1, arm.param2) == (1.0, 21196.0)
    assert mode.param2 == 10.0


def test_rally_points_are_handed_over_after_the_mission(autopilot: Autopilot, clock: Clock) -> None:
    point = MissionItem(7, int(C.NAV_RALLY_POINT), 3, (0.0,) * 4, 36.51, -84.2, 90.0)
    autopilot.results *= 2
    clock.go_through(preflight(autopilot, clock).prepare(replace(MISSION, rally=(point,))))
    counts = [message for message in autopilot.sent if message.get_type() == "MISSION_COUNT"]
    assert [(count.count, count.mission_type) for count in counts] == [(4, 0), (1, 2)]
    assert [(item.seq, item.command, item.mission_type, item.frame, item.z) for item in autopilot.received] == [
        (0, 5100, 2, 3, 90.0)
    ]
    autopilot.results = [mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_ERROR]
    with pytest.raises(FlightError, match=r"refused the rally points at item 0 \(NAV_RALLY_POINT\): MAV_MISSION_ERROR"):
        clock.go_through(preflight(autopilot, clock).prepare(replace(MISSION, rally=(point,))))


def test_an_upload_before_there_is_space_is_offered_again(autopilot: Autopilot, clock: Clock) -> None:
    autopilot.results = [mavlink.MAV_MISSION_NO_SPACE, mavlink.MAV_MISSION_NO_SPACE, mavlink.MAV_MISSION_ACCEPTED]
    clock.go_through(preflight(autopilot, clock).prepare(MISSION))
    assert sum(message.get_type() == "MISSION_COUNT" for message in autopilot.sent) == 3
    assert len(autopilot.received) == 4
    assert 2.0 < clock.time < 4.0


def test_space_that_never_comes_is_a_refusal(autopilot: Autopilot, clock: Clock) -> None:
    autopilot.results = [mavlink.MAV_MISSION_NO_SPACE] * 100
    with pytest.raises(FlightError, match=r"refused the mission at item 3 \(NAV_WAYPOINT\): MAV_MISSION_NO_SPACE"):
        clock.go_through(preflight(autopilot, clock).prepare(MISSION))
    assert 30.0 < clock.time < 35.0


def test_an_estimator_without_a_place_is_waited_for_a_minute(autopilot: Autopilot, clock: Clock) -> None:
    # All but the place above the sea, then all, but without satellites.
    for flags in (EKF_GOOD & ~mavlink.ESTIMATOR_POS_VERT_ABS, EKF_GOOD | mavlink.ESTIMATOR_CONST_POS_MODE):
        autopilot.reported.ekf, started = flags, clock.time
        with pytest.raises(FlightError, match=r"had no position estimate \(EKF\) within 60 s"):
            clock.go_through(preflight(autopilot, clock).prepare(MISSION))
        assert clock.time - started == pytest.approx(60.0, abs=0.3)


@pytest.mark.parametrize(("command", "said"), [(179, "home"), (400, "arming"), (176, "AUTO")])
def test_what_is_refused_is_named(autopilot: Autopilot, clock: Clock, command: int, said: str) -> None:
    autopilot.accepts = lambda asked: mavlink.MAV_RESULT_DENIED if asked == command else mavlink.MAV_RESULT_ACCEPTED
    autopilot.reported.texts.append("not today")
    with pytest.raises(FlightError, match=rf"did not accept {said} \(.*\) within 5 s; its last message: not today"):
        clock.go_through(preflight(autopilot, clock).prepare(MISSION))


def test_it_is_met_by_its_parameters_those_it_does_not_have_left_out(autopilot: Autopilot, clock: Clock) -> None:
    autopilot.has = {f"P{k}": float(k) for k in range(25)}
    names = [*autopilot.has, "NO_SUCH"]
    clock.go_through(preflight(autopilot, clock).identify(names))
    assert autopilot.reported.parameters == autopilot.has
    assert mavlink.MAV_CMD_DO_SEND_BANNER in autopilot.commands()


@pytest.mark.parametrize(
    ("vehicle", "said"), [(2, "is not ArduPlane: .* type 2; expected 1, a fixed"), (None, "sent no heartbeat over MAV")]
)
def test_who_is_no_plane_or_says_nothing_is_named(
    autopilot: Autopilot, clock: Clock, vehicle: int | None, said: str
) -> None:
    autopilot.reported.vehicle = vehicle
    with pytest.raises(FlightError, match=said):
        clock.go_through(preflight(autopilot, clock).identify([]))


def test_a_version_without_a_name_is_its_number() -> None:
    assert version_text(["Barometer ready"], 0x04060000) == "ArduPlane 4.6.0"
    assert version_text([], None) == "ArduPlane, version unknown"


def test_time_that_flies_is_no_reason_to_give_up(autopilot: Autopilot) -> None:
    # A hundred times as fast as the clock: its answer comes after 2 s of its own time, 0.02 s by the clock.
    clock = Clock()
    autopilot.has, names = {"LATE": 1.0}, ["LATE"]
    talk = Preflight(autopilot, lambda: clock.time, lambda: 0.01 * clock.time).identify(names)  # type: ignore[arg-type]  # a link by hand
    autopilot.has = {}
    for _ in talk:
        clock.time += 0.1
        if clock.time > 2.0:
            autopilot.reported.parameters["LATE"] = 1.0
    assert autopilot.reported.parameters == {"LATE": 1.0}
    assert clock.time < 3.0
