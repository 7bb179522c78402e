"""Circles that PX4's law flies in JSBSim: at a waypoint too high or too low, and loiters that a mission orders."""

from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.route import make_route
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, SimulatedFlight, fly_to_end
from flight.simulation.track import Track
from logs.verdict.judge_flight import judge_flight
from tests.mission_lines import ORIGIN, setup_of, wp
from tests.setups import MakeSetup


def flown(aerosonde: Aircraft, *lines: str, **values: float) -> tuple[FlightSetup, SimulatedFlight]:
    """A mission by the law of 1.17, its route drawn for it."""
    law = Px4(Px4Parameters.load(aerosonde, None, "1.17").changed(**values))
    made = setup_of(*lines)
    route = make_route(made.mission, ORIGIN, made.scenario.terrain, 25.0, False, made.limits, law.route_rules)
    setup = replace(made, route=route, autopilot=law)
    return setup, fly_to_end(Flight(setup, aerosonde))


def until(track: Track, east: float, north: float) -> slice:
    """The rows until the aircraft is nearest to a place: to a last waypoint, before the circle about that."""
    return slice(0, int(np.argmin(np.hypot(track.position[:, 0] - east, track.position[:, 1] - north))) + 1)


def test_the_circle_at_the_gate_has_the_radius_of_loiters(make_setup: MakeSetup, aerosonde: Aircraft) -> None:
    # 250 m down in 1 km takes 125 s at 2 m/s, of which 85 s are circled.
    setup = make_setup([[0, 0, 650.0], [0, 1000, 400.0], [0, 3000, 400.0]])
    law = Px4(Px4Parameters.load(aerosonde).changed(NAV_LOITER_RAD=150.0))
    track = fly_to_end(Flight(replace(setup, autopilot=law), aerosonde)).track
    circles = (track.time > 65.0) & (track.position[:, 2] > 415.0)
    assert np.ptp(track.time[circles]) > 50.0
    away = np.hypot(track.position[circles, 0], track.position[circles, 1] - 1000.0)
    assert np.median(away) == pytest.approx(150.0, abs=3.0)
    assert np.ptp(away) < 8.0


def test_a_circle_begun_before_the_last_waypoint_does_not_end_the_flight(
    make_setup: MakeSetup, aerosonde: Aircraft
) -> None:
    # 56 m before the end it is some 12 m too low, for it climbs at its 3 m/s all the way, 3.5 s late, and circles; a
    # second later it is within 10 m, and flies on.
    setup = make_setup([[0, 0, 500.0], [0, 1500, 673.0]])
    law = Px4(Px4Parameters.load(aerosonde))
    result = fly_to_end(Flight(replace(setup, autopilot=law), aerosonde))
    track = result.track
    assert result.ended == "completed"
    low = 673.0 - track.position[:, 2]
    assert low[np.argmax(track.position[:, 1] > 1444.0)] > 10.0
    assert track.position[-1, 1] == pytest.approx(1500.0, abs=1.0)
    assert abs(low[-1]) < 10.0
    # Nowhere around a circle of 80 m.
    assert track.position[:, 1].max() < 1501.0


@pytest.mark.parametrize("radius", [100, 200])
def test_a_loiter_to_a_height_is_flown_to_level_and_left_at_that_height(aerosonde: Aircraft, radius: int) -> None:
    setup, result = flown(aerosonde, wp(0, -1500, 300), wp(0, 0, 450, 31, p=f"0 {radius} 0 0"), wp(2500, 0, 450))
    assert result.ended == "completed"
    rows = until(result.track, 2500.0, 0.0)
    position, time = result.track.position[rows], result.track.time[rows]
    away = np.hypot(position[:, 0], position[:, 1])
    rim = int(np.argmax(away < radius + 10.0))
    assert np.abs(position[:rim, 2] - 600.0).max() < 3.0
    high = int(np.argmax(position[:, 2] > 740.0))
    # 140 m at 3 m/s, and a little late.
    assert time[high] - time[rim] == pytest.approx(140.0 / 3.0 + 3.5, abs=3.0)
    # Then straight to the line from the middle.
    assert away[high:].max() == pytest.approx(2500.0, abs=15.0)
    late = (time > time[high] + 20.0) & (position[:, 0] > 700.0)
    assert np.abs(position[late, 1]).max() < 15.0
    # The drawn leg to the circle is level.
    assert setup.route.positions[:2, 2] == pytest.approx([600.0, 600.0])
    # At 30 degrees of bank a circle of 119 m is the tightest.
    assert judge_flight(setup, result.track, result.ended).flyable is (radius == 200)


@pytest.mark.parametrize(("radius", "flyable"), [(100, False), (150, True)])
def test_a_loiter_for_a_time_ends(aerosonde: Aircraft, radius: int, flyable: bool) -> None:
    setup, result = flown(aerosonde, wp(0, -1500, 300), wp(0, 0, 300, 19, p=f"60 0 {radius} 0"), wp(1500, 1500, 300))
    assert result.ended == "completed"
    track = result.track
    # 1,340 to 1,390 m to the rim, 60 s, 2,121 m on from the middle; and from wherever that finds it, around to there.
    least = (1340.0 + 2121.0 - radius) / 25.7 + 60.0
    assert least < track.time[until(track, 1500.0, 1500.0)][-1] < least + 35.0
    verdict = judge_flight(setup, track, result.ended)
    assert verdict.flyable is flyable
    # The bank of 30 degrees flies 119 m at the least.
    assert {item.rule for item in verdict.failed} == (set() if flyable else {"loiter"})


def test_a_circle_left_on_its_far_side_is_left_within_its_corridor(aerosonde: Aircraft) -> None:
    # The leg climbs beside the loiter, which begins the later for it, and ends on the course away from what follows.
    setup, result = flown(aerosonde, wp(0, -2500, 300), wp(0, 0, 420, 19, p="60 0 150 0"), wp(2500, 1500, 420))
    verdict = judge_flight(setup, result.track, result.ended)
    assert verdict.flyable, verdict.headline
    # What is said of every mission that ends without a landing.
    assert [
        line
        for line in verdict.lines
        if line.startswith("PX4 would reject the mission: PX4's fixed-wing default refuses")
    ]
    assert "item 3: after the last waypoint the aircraft loiters around it indefinitely" in verdict.notes[-1]
    # On the way it climbs at 3 m/s from the beginning, not along the slope: 120 m in 40 s, of 2,500 m.
    track = result.track
    level = int(np.argmax(track.position[:, 2] > 710.0))
    assert track.time[level] == pytest.approx(110.0 / 3.0 + 3.5, abs=4.0)


@pytest.mark.parametrize(("version", "before"), [("1.16", 56.0), ("1.17", 10.0)])
def test_after_the_last_waypoint_it_goes_once_around(aerosonde: Aircraft, version: str, before: float) -> None:
    law = Px4(Px4Parameters.load(aerosonde, None, version))
    made = setup_of(wp(0, -1500, 300), wp(0, 0, 300))
    setup = replace(made, autopilot=law)
    result = fly_to_end(Flight(setup, aerosonde))
    assert result.ended == "completed"
    east, north, up = result.track.position.T
    # It is reached where any other waypoint is: 2.24 s before it up to 1.16, NAV_ACC_RAD (10 m) before it from 1.17 on.
    turning = int(np.argmax(np.abs(result.track.attitude[:, 0]) > np.radians(5.0)))
    assert -north[turning] == pytest.approx(before, abs=20.0)
    # Onto the circle, a quarter of a turn, and once around.
    course = np.degrees(np.unwrap(np.arctan2(result.track.velocity[:, 0], result.track.velocity[:, 1])))
    assert course[-1] - course[turning] == pytest.approx(450.0, abs=6.0)
    # NAV_LOITER_RAD is 80 m, to the right.  At 25.7 m/s a bank of 30 degrees turns with 117 m: a circle of that from
    # its center leads 233 m away, and a bank that is not all held some metres more.  The center is the waypoint, up to
    # 1.16 the place where it is reached (`setEndOfMissionItems`).
    radius, center = 25.7**2 / (9.80665 * np.tan(np.pi / 6.0)), -before if version == "1.16" else 0.0
    assert radius < np.hypot(east, north - center)[turning:].max() < 2.1 * radius
    # The loops lie evenly about the center.
    last_loop = slice(-1200, None)
    assert (north[last_loop].max() + north[last_loop].min()) / 2.0 == pytest.approx(center, abs=28.0)
    assert east[turning + 600] > 20.0
    assert np.abs(up[turning:] - 600.0).max() < 10.0
    assert judge_flight(setup, result.track, result.ended).flyable


def test_what_stands_beside_the_last_waypoint_is_met_in_its_circle(aerosonde: Aircraft) -> None:
    # Its middle is 200 m beside the leg, and the first circle leads 233 m to that side.
    missile = {"name": "m", "east_m": 200.0, "north_m": 60.0, "amsl_m": 600.0, "kill_radius_m": 60.0}
    missile |= {"kill_scale_m": 60.0, "detection_radius_m": 61.0, "detection_scale_m": 60.0}
    law, way = Px4(Px4Parameters.load(aerosonde)), (wp(0, -1500, 300), wp(0, 0, 300), wp(0, 1500, 300))
    for count, flies in ((2, False), (3, True)):
        made = setup_of(*way[:count], threats=[missile])
        setup = replace(made, scenario=replace(made.scenario, external=False), autopilot=law)
        result = fly_to_end(Flight(setup, aerosonde))
        assert result.ended == "completed"
        assert judge_flight(setup, result.track, result.ended).flyable is flies


def test_a_speed_after_a_gate_counts_from_where_it_is_crossed(aerosonde: Aircraft) -> None:
    # The gate is 300 m beside the leg; its plane, at right angles to the way from there to item 4, cuts the leg 75 m
    # sooner.
    gate, slow = wp(300, 600, command=4501), "2 178 0 20 -1 0 0 0 0"
    law = Px4(Px4Parameters.load(aerosonde, None, "1.17"))
    made = setup_of(wp(0, 0, 300), gate, slow, wp(0, 1800, 300))
    route = make_route(made.mission, ORIGIN, made.scenario.terrain, 25.0, False, made.limits, law.route_rules)
    result = fly_to_end(Flight(replace(made, route=route, autopilot=law), aerosonde))
    assert result.ended == "completed"
    track = result.track
    slowed = int(np.argmax(np.diff(track.speed_command) < -1.0))
    assert track.position[slowed, 1] == pytest.approx(525.0, abs=2.0)
    # Nothing is flown to there, and no leg begins.
    rows = until(track, 0.0, 1800.0)
    assert np.abs(track.position[rows, 0]).max() < 2.0
