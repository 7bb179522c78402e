"""Missions that reach the branches of docs/arduplane-branches.md, flown by planfly's law of ArduPlane.

Each case names the function of ArduPlane's source whose arithmetic gives its expected value.  Home is at 300 m, the
missions are 200 m over it, where the density ratio of the standard atmosphere makes the square of true by equivalent
airspeed 1.0494.
"""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from logs.verdict.rules.mission_rule import mission_findings
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from tests.flight.autopilots.arduplane.kept_missions import setup_by_law
from tests.mission_lines import mission, wp
from world.arrays import Floats
from world.scenario_tables import ArduPlaneVersion
from world.wind import Wind

GROWTH = 1.225 / 1.1673
HOME_M = 300.0
RTL = "2 20 0 0 0 0 0 0 0"
SPEEDS = {"AIRSPEED_MIN": 18.0, "AIRSPEED_CRUISE": 25.0, "AIRSPEED_MAX": 31.0}


class Flown(NamedTuple):
    """A flight's track, and the bank (deg) and height over home (m) of its rows."""

    track: Track
    bank: Floats
    height: Floats

    def away(self, east: float, north: float) -> Floats:
        """Return the distances from a place, m."""
        return np.hypot(self.track.position[:, 0] - east, self.track.position[:, 1] - north)

    def turn_before(self, east: float, north: float) -> float:
        """Return the distance from a waypoint at which the aircraft turns to the next leg, m.

        The bank passes 4 degrees 0.3 s after the turn is demanded.
        """
        away = self.away(east, north)
        first = int(np.flatnonzero(away > 700.0)[np.flatnonzero(away > 700.0) < np.argmin(away)][-1])
        row = first + int(np.argmax(self.bank[first:] > 4.0))
        return float(away[row - round(0.3 / float(np.median(np.diff(self.track.time))))])

    def circle(self, east: float, north: float, radius: float) -> tuple[float, float]:
        """Return the laps flown around a place, positive to the right, and their median radius, m."""
        away = self.away(east, north)
        rows = away < 1.35 * radius
        angle = np.unwrap(np.arctan2(self.track.position[rows, 0] - east, self.track.position[rows, 1] - north))
        return float(angle[-1] - angle[0]) / (2.0 * math.pi), float(np.median(away[rows]))

    def passes(self, east: float, north: float) -> int:
        """Return how often the aircraft comes within 150 m of a place."""
        near = self.away(east, north) < 150.0
        return int(np.sum(np.diff(near.astype(int)) == 1) + near[0])

    def height_at(self, east: float, north: float) -> float:
        """Return the height over home where the aircraft is nearest to a place, m."""
        return float(self.height[int(np.argmin(self.away(east, north)))])

    @property
    def returning(self) -> slice:
        """Rows of the return."""
        return slice(int(np.flatnonzero(self.track.leg > 1)[0]), None)


@functools.cache
def flown(
    lines: tuple[str, ...],
    values: tuple[tuple[str, float], ...] = (),
    version: ArduPlaneVersion = "4.7",
    wind: tuple[float, float] = (0.0, 0.0),
) -> Flown:
    """Fly a mission.  wind: speed, m/s, and where it comes from, degrees."""
    read = mission(*lines)
    aircraft = load_aircraft("aerosonde")
    law = ArduPlane(ArduPilotParameters.load(aircraft, None, version)).with_parameters(**dict(values))
    scenario = replace(setup_by_law(read).scenario, wind=Wind(wind[0], math.radians(wind[1])))
    uav = replace(load_uav(scenario), autopilot=law)
    done = fly_to_end(Flight(replace(make_setup(scenario, uav, read, 1), nav="perfect"), aircraft))
    assert done.ended == "completed"
    track = done.track
    return Flown(track, np.degrees(np.abs(track.attitude[:, 0])), track.position[:, 2] - HOME_M)


class Case(NamedTuple):
    """A mission, what is measured of its flight, and what it is by the source, within a tolerance."""

    function: str
    lines: tuple[str, ...]
    measure: Callable[[Flown], float]
    expected: float
    tolerance: float
    values: Mapping[str, float] = {}
    version: ArduPlaneVersion = "4.7"
    wind: tuple[float, float] = (0.0, 0.0)


def corner(radius: float = 0.0, pass_by: float = 0.0) -> tuple[str, ...]:
    """A right angle at 2 km north, with an acceptance radius and a distance to fly on beyond it."""
    return (wp(0, 0, 200), wp(0, 2000, 200, p=f"0 {radius} {pass_by} 0"), wp(2000, 2000, 200), wp(4000, 2000, 200))


def loiter(command: int, p: str, alt: float = 200.0, begin: float = 200.0) -> tuple[str, ...]:
    """A loiter at 1.5 km east and 2 km north, and on."""
    return (wp(0, 0, begin), wp(1500, 2000, alt, command, p=p), wp(4000, 2000, alt))


def climb(begin: float, end: float) -> tuple[str, ...]:
    """4 km from one height to another, with 500 m before and 1 km behind."""
    return (wp(0, 0, begin), wp(0, 500, begin), wp(0, 4500, end), wp(0, 5500, end))


def speed(change: str) -> tuple[str, ...]:
    """A change of speed after 1 km."""
    return (wp(0, 0, 200), wp(0, 1000, 200), f"2 178 {change} 0 0 0 0", wp(0, 5000, 200))


def back(alt: float = 200.0) -> tuple[str, ...]:
    """A right angle, and a return from 2 km east and north."""
    return (wp(0, 0, alt), wp(0, 2000, alt), wp(2000, 2000, alt), RTL)


def airspeed_at_end(flight: Flown) -> float:
    """Equivalent airspeed of the last half minute, m/s."""
    return float(np.median(flight.track.airspeed[-1800:])) / math.sqrt(GROWTH)


def first_climb(flight: Flown) -> float:
    """The largest bank of a return before it has climbed 35 m, without its roll-out, deg."""
    rows = flight.returning
    climbed = int(np.argmax(flight.height[rows] - flight.height[rows][0] > 35.0))
    return float(flight.bank[rows][400:climbed].max())


AROUND = functools.partial(Flown.circle, east=1500.0, north=2000.0)
JUMP = (wp(0, 0, 200), wp(0, 1500, 200), wp(800, 1500, 200))
NESTED = (*JUMP, "2 177 2 1 0 0 0 0 0", wp(1500, 800, 200), "2 177 2 1 0 0 0 0 0", wp(2800, 800, 200))
# The bearing to 0 N 0 E from 36.5 N 84.2 W, degrees.
ORIGIN_BEARING = 114.5
CASES = {
    # Ends of legs.
    "acceptance of 200 m": Case("verify_nav_wp", corner(200), lambda f: f.turn_before(0, 2000), 200.0, 4.0),
    "acceptance of 300 m is 255 m": Case(
        "mavlink_int_to_mission_cmd", corner(300), lambda f: f.turn_before(0, 2000), 255.0, 4.0
    ),
    "acceptance of 12.9 m is 12 m": Case(
        "mavlink_int_to_mission_cmd", corner(12.9), lambda f: f.turn_before(0, 2000), 12.0, 4.0
    ),
    "WP_RADIUS grows with height": Case(
        "turn_distance", corner(), lambda f: f.turn_before(0, 2000), 90.0 * GROWTH, 4.0, {"WP_RADIUS": 90.0}
    ),
    "half of WP_RADIUS at 45 degrees": Case(
        "turn_distance",
        (wp(0, 0, 200), wp(0, 2000, 200), wp(1414, 3414, 200), wp(4000, 3414, 200)),
        lambda f: f.turn_before(0, 2000),
        45.0 * GROWTH,
        4.0,
        {"WP_RADIUS": 90.0},
    ),
    "pass by 100 m flies to its end": Case(
        "verify_nav_wp", corner(0, 100), lambda f: f.turn_before(0, 2100), 0.0, 5.0, {"WP_RADIUS": 90.0}
    ),
    "pass by 100 m less 50 m of acceptance": Case(
        "verify_nav_wp", corner(50, 100), lambda f: f.turn_before(0, 2100), 50.0, 4.0
    ),
    # Returns.
    "the waypoint before a return turns for 0 N 0 E": Case(
        "get_next_ground_course_cd",
        back(),
        lambda f: f.turn_before(2000, 2000),
        90.0 * GROWTH * (ORIGIN_BEARING - 90.0) / 90.0,
        5.0,
        {"WP_RADIUS": 90.0},
    ),
    "RTL_ALTITUDE 150": Case("do_RTL", back(), lambda f: float(f.height[-1]), 150.0, 8.0, {"RTL_ALTITUDE": 150.0}),
    "RTL_ALTITUDE -1 keeps the height": Case(
        "do_RTL", back(220), lambda f: float(f.height[-1]), 220.0, 8.0, {"RTL_ALTITUDE": -1.0}
    ),
    # 200 m at its start, and 40 m more before the turn, though the target is lower.
    "RTL_CLIMB_MIN 40 above a lower target": Case(
        "update_alt",
        back(),
        lambda f: float(f.height[f.returning].max()),
        245.0,
        6.0,
        {"RTL_ALTITUDE": 120.0, "RTL_CLIMB_MIN": 40.0},
    ),
    "RTL_CLIMB_MIN limits the bank to LEVEL_ROLL_LIMIT": Case(
        "ModeRTL::update", back(), first_climb, 5.0, 4.0, {"RTL_ALTITUDE": 120.0, "RTL_CLIMB_MIN": 40.0}
    ),
    "FLIGHT_OPTIONS bit 4 climbs before the turn": Case(
        "ModeRTL::update", back(100), first_climb, 5.0, 4.0, {"RTL_ALTITUDE": 160.0, "FLIGHT_OPTIONS": 16.0}
    ),
    "RTL_RADIUS -150": Case(
        "ModeRTL::navigate",
        back(),
        lambda f: f.circle(0.0, 0.0, 158.0)[1],
        150.0 * GROWTH,
        6.0,
        {"RTL_RADIUS": -150.0, "RTL_ALTITUDE": 200.0},
    ),
    "RTL_RADIUS -150 is to the left": Case(
        "ModeRTL::navigate",
        back(),
        lambda f: math.copysign(1.0, f.circle(0.0, 0.0, 158.0)[0]),
        -1.0,
        0.0,
        {"RTL_RADIUS": -150.0, "RTL_ALTITUDE": 200.0},
    ),
    # Jumps.
    "a jump taken twice": Case(
        "get_next_cmd", (*JUMP, "2 177 2 2 0 0 0 0 0", wp(2500, 1500, 200)), lambda f: f.passes(0, 1500), 3.0, 0.0
    ),
    "a jump taken no times": Case(
        "get_next_cmd", (*JUMP, "2 177 2 0 0 0 0 0 0", wp(2500, 1500, 200)), lambda f: f.passes(0, 1500), 1.0, 0.0
    ),
    "nested jumps of 4.6": Case("get_next_cmd", NESTED, lambda f: f.passes(0, 1500), 3.0, 0.0, {}, "4.6"),
    "nested jumps of 4.7 are taken again": Case("get_next_cmd", NESTED, lambda f: f.passes(0, 1500), 4.0, 0.0),
    "MIS_OPTIONS bit 3 keeps the counters of 4.7": Case(
        "get_next_cmd", NESTED, lambda f: f.passes(0, 1500), 3.0, 0.0, {"MIS_OPTIONS": 8.0}
    ),
    # Loiters.
    "2.5 turns are 2": Case(
        "mavlink_int_to_mission_cmd", loiter(18, "2.5 0 200 0"), lambda f: AROUND(f, radius=200.0)[0], 2.55, 0.5
    ),
    "a radius of 307 m is 300 m": Case(
        "mavlink_int_to_mission_cmd",
        loiter(18, "1 0 307 0"),
        lambda f: AROUND(f, radius=300.0)[1],
        300.0 * GROWTH,
        6.0,
    ),
    "a negative radius is to the left": Case(
        "do_loiter_turns",
        loiter(18, "1 0 -200 0"),
        lambda f: math.copysign(1.0, AROUND(f, radius=200.0)[0]),
        -1.0,
        0.0,
    ),
    "LOITER_TIME flies WP_LOITER_RAD": Case(
        "do_loiter_time",
        loiter(19, "40 0 200 0"),
        lambda f: AROUND(f, radius=168.0)[1],
        160.0 * GROWTH,
        5.0,
        {"WP_LOITER_RAD": 160.0},
    ),
    "LOITER_TO_ALT climbs on its own radius": Case(
        "verify_loiter_to_alt", loiter(31, "0 150 0 0", 300.0), lambda f: AROUND(f, radius=150.0)[1], 159.0, 8.0
    ),
    "LOITER_TO_ALT reaches its height": Case(
        "verify_loiter_to_alt", loiter(31, "0 150 0 0", 300.0), lambda f: f.height_at(4000, 2000), 300.0, 8.0
    ),
    # At 2,000 m the square of true by equivalent airspeed is 1.2170.
    "a circle at 2,000 m is wider": Case(
        "loiter_radius",
        loiter(18, "2 0 200 0", 1700.0, 1700.0),
        lambda f: AROUND(f, radius=240.0)[1],
        200.0 * 1.225 / 1.0066,
        8.0,
    ),
    "a circle of 45 m that cannot be flown is left": Case(
        "loiter_angle_update",
        loiter(18, "2 0 45 0", 300.0),
        lambda f: f.height_at(4000, 2000),
        300.0,
        10.0,
        {},
        "4.7",
        (8.0, 270.0),
    ),
    # Airspeeds.
    "17 m/s is below AIRSPEED_MIN": Case("do_change_speed", speed("0 17 -1"), airspeed_at_end, 25.0, 0.5, SPEEDS),
    "33 m/s is above AIRSPEED_MAX": Case("do_change_speed", speed("0 33 -1"), airspeed_at_end, 25.0, 0.5, SPEEDS),
    "20 m/s": Case("do_change_speed", speed("0 20 -1"), airspeed_at_end, 20.0, 0.5, SPEEDS),
    "-2 goes back to AIRSPEED_CRUISE": Case(
        "do_change_speed",
        (*speed("0 20 -1")[:3], wp(0, 3000, 200), "2 178 0 -2 -1 0 0 0 0", wp(0, 5500, 200)),
        airspeed_at_end,
        25.0,
        0.5,
        SPEEDS,
    ),
    # 28 m/s over the ground against 6 m/s are 34 m/s, more than AIRSPEED_MAX.
    "a minimum ground speed raises the airspeed to AIRSPEED_MAX": Case(
        "calc_gndspeed_undershoot", speed("1 28 -1"), airspeed_at_end, 31.0, 0.7, SPEEDS, "4.7", (6.0, 0.0)
    ),
    # Heights along a leg, halfway.
    "14 m are a step": Case(
        "set_offset_altitude_location", climb(200, 214), lambda f: f.height_at(0, 2500), 214.0, 3.0
    ),
    "40 m are a slope": Case(
        "set_target_altitude_proportion", climb(200, 240), lambda f: f.height_at(0, 2500), 220.0, 4.0
    ),
    "ALT_SLOPE_MIN 0 makes steps": Case(
        "set_offset_altitude_location",
        climb(200, 240),
        lambda f: f.height_at(0, 2500),
        240.0,
        4.0,
        {"ALT_SLOPE_MIN": 0.0},
    ),
    "FLIGHT_OPTIONS bit 14 makes steps": Case(
        "setup_alt_slope", climb(200, 240), lambda f: f.height_at(0, 2500), 240.0, 4.0, {"FLIGHT_OPTIONS": 16384.0}
    ),
    "a climb of 4.6 from 10 m over home is a step": Case(
        "setup_glide_slope", climb(10, 60), lambda f: f.height_at(0, 2500), 60.0, 4.0, {}, "4.6"
    ),
    "a climb of 4.7 from 10 m over home is a slope above 25 m": Case(
        "set_target_altitude_proportion", climb(10, 60), lambda f: f.height_at(0, 3500), 47.5, 5.0
    ),
    "a descent is a slope": Case(
        "set_target_altitude_proportion", climb(200, 160), lambda f: f.height_at(0, 2500), 180.0, 5.0
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_mission_is_flown_as_the_source_says(name: str) -> None:
    case = CASES[name]
    found = case.measure(flown(case.lines, tuple(case.values.items()), case.version, case.wind))
    assert found == pytest.approx(case.expected, abs=case.tolerance + 1e-9), case.function


# Items and settings that are not flown: the function that reads them, the lines and the values.
OPEN = {
    "do_continue_and_change_alt": ((wp(0, 0, 200), "3 30 1 0 0 0 0 0 260", wp(0, 4000, 260)), {}),
    "do_change_speed, a throttle alone": (speed("0 -1 60"), {}),
    "do_change_speed, a throttle with an airspeed beyond the limits": (speed("0 50 60"), {}),
    "start_command, DO_INVERTED_FLIGHT": ((*corner()[:2], "2 210 1 0 0 0 0 0 0", wp(0, 4000, 200)), {}),
    "start_command_fence with FENCE_TYPE 1": (
        (*corner(), "2 207 1 0 0 0 0 0 0", wp(4000, 0, 200)),
        {"FENCE_TYPE": 1.0},
    ),
    "loiter_radius, NAVL1_LIM_BANK": (loiter(18, "1 0 200 0"), {"NAVL1_LIM_BANK": 30.0}),
    "jump_to_closest_mission_leg, RTL_AUTOLAND 4": (
        (*back(), "2 188 0 0 0 0 0 0 0", wp(0, 900)),
        {"RTL_AUTOLAND": 4.0},
    ),
    "setup_terrain_target_alt, TERRAIN_FOLLOW": (back(), {"TERRAIN_FOLLOW": 1.0}),
    "mission_alt_offset": (corner(), {"ALT_OFFSET": 10.0}),
    "_update_throttle_without_airspeed": (corner(), {"ARSPD_USE": 0.0}),
}


@pytest.mark.parametrize("name", OPEN)
def test_what_is_not_flown_leaves_the_verdict_open(name: str) -> None:
    lines, values = OPEN[name]
    read = mission(*lines)
    law = ArduPlane(ArduPilotParameters.load(load_aircraft("aerosonde"))).with_parameters(**values)
    scenario = setup_by_law(read).scenario
    made = make_setup(scenario, replace(load_uav(scenario), autopilot=law), read, 1)
    assert any(finding.ok is None for finding in mission_findings(made))
