"""ArduPlane's law flies home as ArduPlane did: 38 kept flights, and what each rule of a return is by itself.

Every eighth of them, one that hits the ground among them; all with PLANFLY_SOAK=1.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.law import update_height_demand
from flight.autopilots.arduplane.navigator import navigate_legs
from flight.guidance.path import waypoint_records
from tests.flight.autopilots.arduplane.kept_flights import KEPT, flown_return, kept_track, return_setup
from tests.flight.autopilots.arduplane.laws import flying, memory, parameters, waypoints
from tests.soak import some
from world.kernels import Record

# Law less flight, where the least clearance before the circle is compared, m.
CLEARANCE = {"default": (-5.0, 5.0), "climbs": (-13.0, 8.0), "rally": (-10.0, 10.0)}
# On the way: aside and height, m; the time of arrival, s.  A turn at 5 degrees of bank is the farthest aside.
ASIDE, HEIGHT, ARRIVAL = 80.0, 20.0, 4.0


def kind(flight: str) -> str:
    """Which of them a flight belongs to."""
    if KEPT[flight]["rally_set"]:
        return "rally"
    return "default" if KEPT[flight]["rtl_altitude_m"] == "100" else "climbs"


@pytest.mark.parametrize("flight", some(KEPT, 8))
def test_a_return_is_flown_as_arduplane_flew_it(flight: str) -> None:
    real, flown = KEPT[flight], flown_return(flight)
    assert f"NAV_RETURN_TO_LAUNCH returns to {real['target']}, " in flown.route.notes[0]
    assert flown.hit == (real["hit"] == "1")
    assert (flown.outside < 0.0) == (float(real["outside_spheres_m"]) < 0.0)
    low, high = CLEARANCE[kind(flight)]
    assert low <= flown.low - float(real["least_clearance_m"]) <= high
    if flown.hit:
        assert abs(flown.time[-1] - kept_track(flight)[-1, 0]) < 20.0 + ARRIVAL
    else:
        assert flown.ended == "completed"
        assert abs(flown.arrived - float(real["to_circle_s"])) < ARRIVAL


@pytest.mark.parametrize("flight", some(KEPT, 8))
def test_on_the_way_it_is_where_arduplane_was(flight: str) -> None:
    flown = flown_return(flight)
    for time, east, north, up in kept_track(flight):
        if time > flown.time[-1]:
            continue
        here = np.array([np.interp(time, flown.time, flown.position[:, k]) for k in range(3)])
        assert math.hypot(here[0] - east, here[1] - north) < ASIDE
        assert abs(here[2] - up) < HEIGHT


# ----------------------------------------------------------------------
# Each rule by itself.

# A target 4 km north and 1 km east of the aircraft, which flies north at 500 m.
EAST, NORTH = 1000.0, 4000.0


def back(up: float, radius: float = 60.0, base: float = 0.0) -> np.ndarray:
    """The waypoints of a return from the origin: its second is of the way back."""
    made = waypoints((0.0, -1000.0, 500.0), (0.0, 100.0, 500.0), is_rtl=True)
    for name, value in (("centre_east", EAST), ("centre_north", NORTH), ("up", up), ("loiter_radius", radius)):
        made[name] = value
    made["slope_base"] = base
    return made


def navigated(own: Record, here: Record, way: np.ndarray, **values: float) -> Record:
    """The memory after a navigation at sea level, with these parameters."""
    navigate_legs(here, way, parameters(**values), own, 1.0, 0.1)
    return own


def asked(own: Record, here: Record, way: np.ndarray, **values: float) -> float:
    """Height that is asked for after that."""
    update_height_demand(here, way[own.leg + 1], parameters(**values), own, 0.1)
    return float(own.altitude_demand_in)


def test_it_turns_to_the_middle_of_its_circle_at_once() -> None:
    # L1 asks for 4 d^2 V^2 / L sin(angle), with L = d T V / pi; the target is atan(1/4) right of the course.
    own, speed = navigated(memory(), flying(), back(600.0)), 25.0
    length = 17.0 * 0.75 * speed / math.pi
    wanted = 4.0 * 0.75**2 * speed**2 / length * math.sin(math.atan2(EAST, NORTH))
    assert own.lateral_acceleration == pytest.approx(wanted)
    # Behind it, as much as for a right angle, to the short side.
    west = navigated(memory(), flying(course=math.radians(-120.0)), back(600.0))
    assert west.lateral_acceleration == pytest.approx(4.0 * 0.75**2 * speed**2 / length)
    assert navigated(memory(), flying(course=math.radians(150.0)), back(600.0)).lateral_acceleration < 0.0


def test_it_sinks_on_a_straight_slope_in_distance_and_climbs_at_once() -> None:
    way = back(100.0)
    own = navigated(memory(altitude_demand_in=500.0), flying(), way)
    # A quarter of the way, 100 m aside of the line, which counts for nothing.
    run = math.hypot(EAST, NORTH)
    ue, un = EAST / run, NORTH / run
    here = flying(0.25 * EAST + 100.0 * un, 0.25 * NORTH - 100.0 * ue, 450.0)
    assert asked(navigated(own, here, way), here, way) == pytest.approx(500.0 - 0.25 * 400.0)
    assert asked(navigated(memory(), flying(), back(700.0)), flying(), back(700.0)) == 700.0
    # A fall of less than ALT_SLOPE_MIN, 15 m, is a step.
    assert asked(navigated(memory(), flying(), back(486.0)), flying(), back(486.0)) == 486.0


def test_to_a_rally_point_it_holds_its_height_first() -> None:
    # 300 m over a home at 200 m: the slope is drawn from 500 m to 300 m AMSL, 200 m too high, and no higher than 500 m.
    # Down to 350 m it begins after 200 of the 350 m: where (1 - p) (150 + 200) = 150.
    way = back(350.0, base=200.0)
    own = navigated(memory(), flying(), way)
    for share, height in ((0.3, 500.0), (0.571, 500.0), (0.7, 350.0 + 0.3 * 350.0)):
        here = flying(share * EAST, share * NORTH)
        assert asked(navigated(own, here, way), here, way) == pytest.approx(height, abs=0.5)


def test_the_circle_is_flown_at_the_targets_height_and_grows_with_height() -> None:
    way = back(100.0, radius=-200.0)
    own = memory(is_in_rtl=True, rtl_climb_complete=True, from_up=500.0)
    # On the circle, the left way round: what the speed takes, V^2 / R.
    here = flying(EAST + 200.0, NORTH, 300.0, course=0.0)
    assert asked(navigated(own, here, way), here, way) == 100.0
    assert own.lateral_acceleration == pytest.approx(-(25.0**2) / 200.0)
    # At 1.05 of true by equivalent airspeed the circle is 1.1025 times as wide.
    there = flying(EAST + 200.0 * 1.05**2, NORTH, 300.0, course=0.0)
    navigate_legs(there, way, parameters(), own, 1.05, 0.1)
    assert own.lateral_acceleration == pytest.approx(-(25.0**2) / (200.0 * 1.05**2))


def test_after_a_loiter_the_slope_begins_at_its_top() -> None:
    # At the corner of the loiter's circle where it is left: the return has a circle of its own, 4 km away.
    way = waypoints((-60.0, -60.0, 500.0), (0.0, 0.0, 500.0), (EAST, NORTH, 100.0))
    for name, loiter, ahead in (
        ("centre_east", 120.0, EAST),
        ("centre_north", 0.0, NORTH),
        ("loiter_radius", 120.0, 60.0),
    ):
        way[name][:2], way[name][2] = loiter, ahead
    way["is_rtl"][2], way["stop"] = True, (1, 1, 2)
    course = math.atan2(EAST - 120.0, NORTH)
    east, north = 120.0 - 120.0 * math.cos(course), 120.0 * math.sin(course)
    here = flying(east, north, course=course)
    own = navigated(memory(loiter_started=True, loiter_complete=True), here, way)
    assert own.leg == 1
    assert asked(own, here, way) > 499.0


def test_it_banks_little_before_it_has_climbed_what_it_has_to() -> None:
    most = GRAVITY * math.tan(math.radians(5.0))
    way = back(700.0)
    own = navigated(memory(), flying(), way, RTL_CLIMB_MIN=50.0)
    assert own.lateral_acceleration == pytest.approx(most)
    assert navigated(own, flying(up=549.9), way, RTL_CLIMB_MIN=50.0).lateral_acceleration == pytest.approx(most)
    assert navigated(own, flying(up=550.1), way, RTL_CLIMB_MIN=50.0).rtl_climb_complete
    assert navigated(own, flying(up=550.1), way, RTL_CLIMB_MIN=50.0).lateral_acceleration > most
    # Above its target it does so too, and turns normally from there.
    low = navigated(memory(), flying(up=500.0), back(100.0), RTL_CLIMB_MIN=50.0)
    assert low.lateral_acceleration == pytest.approx(most)
    assert navigated(low, flying(up=550.1), back(100.0), RTL_CLIMB_MIN=50.0).lateral_acceleration > most
    # Bit 4 of FLIGHT_OPTIONS: up to the target's height, whatever RTL_CLIMB_MIN says.
    bit4 = {"FLIGHT_OPTIONS": 16.0, "RTL_CLIMB_MIN": 50.0}
    own = navigated(memory(), flying(up=699.0), way, **bit4)
    assert own.lateral_acceleration == pytest.approx(most)
    assert navigated(own, flying(up=700.5), way, **bit4).lateral_acceleration > most
    assert navigated(memory(), flying(up=710.0), way, FLIGHT_OPTIONS=8.0 + 32.0).lateral_acceleration > most


@pytest.mark.parametrize(
    ("target", "values", "demand"),
    [
        (100.0, {"RTL_CLIMB_MIN": 30.0}, 500.0 + 30.0 + 10.0),
        (700.0, {"RTL_CLIMB_MIN": 30.0}, 700.0 + 30.0 + 10.0),
        (700.0, {"FLIGHT_OPTIONS": 16.0}, 700.0 + 10.0),
        (700.0, {"FLIGHT_OPTIONS": 16.0, "RTL_CLIMB_MIN": 30.0}, 700.0 + 30.0 + 10.0),
        (100.0, {"FLIGHT_OPTIONS": 16.0}, 500.0),  # above its target already: on the slope
    ],
)
def test_before_its_turn_it_demands_the_climb_above_start_and_target(
    target: float, values: dict[str, float], demand: float
) -> None:
    """`Plane::update_alt` adds RTL_CLIMB_MIN and 10 m to the higher of the target and the altitude at the start."""
    way, here = back(target), flying(up=500.0)
    assert asked(navigated(memory(), here, way, **values), here, way, **values) == pytest.approx(demand)


def test_the_slope_begins_where_the_climb_has_ended() -> None:
    way = back(300.0)
    own = navigated(memory(), flying(up=500.0), way, RTL_CLIMB_MIN=10.0)
    here = flying(0.5 * EAST, 0.5 * NORTH, 511.0)
    assert asked(navigated(own, here, way, RTL_CLIMB_MIN=10.0), here, way) == pytest.approx(511.0)


def test_a_return_is_flown_in_one_leg_at_the_cruise_speed() -> None:
    setup = return_setup("rtl-def-00")
    records = waypoint_records(setup.route)
    # It begins as early as at a right angle, the mission's end, if no item says where.
    assert records["turn"][1] == pytest.approx(0.5 * math.pi)
    assert records["is_rtl"].tolist() == [False, False, *[True] * (len(records) - 2)]
    assert set(records["centre_east"][2:].round()) == {9500.0}
    assert setup.route.rtl_start == 1
    assert (setup.route.leg_airspeeds[1:] == setup.airspeed).all()
    own = memory(leg=0)
    assert navigated(own, flying(EAST, NORTH), back(100.0)).leg == 0


def test_the_turn_before_a_return_is_one_to_0_north_0_east() -> None:
    """At r1's last waypoint, 36.28° N 84.10° W, ArduPlane 4.6.3 on a course of 126.3° turned 12.5 m before it.

    The bearing to 0° N 0° E is atan2(84.10, -36.27 / cos 18.14°) = 114.4°: 11.9 of 90 degrees of 90 m, and 7 % for the
    height's air density, are 12.7 m.
    """
    setup = return_setup("rtl-def-00")
    seq = int(setup.route.items[1])
    (item,) = (one for one in setup.mission.items if one.seq == seq)
    item = replace(item, lat_deg=36.2712892, lon_deg=-84.1011091)
    for course, turn in ((126.3, 11.9), (114.4, 0.0), (24.0, 90.4), (-65.6, 180.0)):
        way = np.array(setup.route.positions)
        way[0] = way[1] - 900.0 * np.array([math.sin(math.radians(course)), math.cos(math.radians(course)), 0.0])
        records = waypoint_records(setup.route.with_fields(position=way), replace(setup.mission, items=(item,)))
        assert math.degrees(records["turn"][1]) == pytest.approx(turn, abs=0.1)


def test_the_parameters_decide_where_it_goes_and_how_high() -> None:
    to = return_setup("rtl-rally5-04", RALLY_LIMIT_KM=2.0).route.rtl_loiter
    assert to is not None
    assert (round(to.east), round(to.north), round(to.up)) == (9500, -5000, 435)
    near = return_setup("rtl-def-00", RALLY_INCL_HOME=1.0, RTL_ALTITUDE=-1.0, RTL_RADIUS=-120.0).route.rtl_loiter
    assert near is not None
    # Where it began: 570.9 m, and the lead of its slope.
    assert (round(near.east), near.radius, near.up) == (9500, -120.0, pytest.approx(580.3, abs=0.1))
    assert (near.slope_base, rally_base("rtl-rally5-04")) == (0.0, pytest.approx(335.055))


def rally_base(flight: str) -> float:
    """By how much the slope to its rally point is drawn too low, m."""
    to = return_setup(flight).route.rtl_loiter
    assert to is not None
    return to.slope_base
