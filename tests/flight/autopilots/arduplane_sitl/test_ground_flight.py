"""A program from the ground to the ground: what it is given, how it is launched, and a whole flight with a stand-in.

No ArduPlane flies here: the stand-in takes off and lands by a few lines of its own (`fake_autopilot`).
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.ground_law import APPROACHING, FLARING, GROUND_STATE, IN_AIR, TAKING_OFF
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.arduplane_sitl.flight import AutopilotFlight, fly_autopilot
from flight.autopilots.arduplane_sitl.ground_tick import update_phase
from flight.autopilots.arduplane_sitl.process import load_user_parameters
from flight.autopilots.parts import RtlSettings
from flight.autopilots.sitl.exchange import motion_on_rail
from flight.autopilots.sitl.flight import launch_rail
from flight.autopilots.sitl.mission import make_uploaded_mission
from flight.guidance.navigation_error import MOTION
from flight.mission.items import Command
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Release
from logs.verdict.judge_flight import judge_flight
from tests.autopilots import arduplane_program
from tests.flight.autopilots.arduplane.flown_grounds import circuit
from tests.flight.autopilots.arduplane.kept_sequences import kept_setup
from tests.flight.autopilots.arduplane_sitl.conftest import MakeFake
from tests.soak import SOAK
from world.airfield import LandingStrip, Launch

AEROSONDE = load_aircraft("aerosonde")
RAIL = Launch("catapult", math.radians(90.0), 20.0, 6.0, math.radians(12.0))
STRIP = LandingStrip(500.0, 600.0, length=600.0)


def by_program(setup: FlightSetup) -> FlightSetup:
    """The same flown by the program."""
    return replace(setup, autopilot=ArduPlaneSitl(setup.autopilot.parameters))


def test_the_mission_goes_up_as_it_is_with_home_where_it_is() -> None:
    setup = by_program(circuit(RAIL, STRIP))
    sent = make_uploaded_mission(setup)
    assert setup.mission.home is not None
    assert (sent.home.lat_deg, sent.home.lon_deg, sent.home.alt) == (46.0, 8.0, 0.0)
    assert sent.items == setup.mission.items
    assert sent.items[sent.last - 1].command == Command.NAV_LAND
    # In the air, on a rail, it is another: the landing a waypoint, and a place more.
    in_air = make_uploaded_mission(by_program(circuit(None, None)))
    assert {item.command for item in in_air.items} == {Command.NAV_WAYPOINT}
    assert len(in_air.items) == len(setup.mission.items) + 1


def test_with_one_end_alone_it_is_put_into_the_air_and_says_so() -> None:
    for launch, strip, lacks in ((RAIL, None, "landing"), (None, STRIP, "take-off")):
        ways = by_program(circuit(launch, strip)).ground_phases
        assert not ways
        assert ways.notes[-1].startswith(f"the {lacks} is not simulated on the ground")


def test_in_the_air_a_return_that_goes_on_to_land_is_sent_with_its_landing_sequence() -> None:
    setup = by_program(kept_setup("autoland-1"))
    in_air = replace(setup, scenario=replace(setup.scenario, launch=None, landing=None))
    commands = [item.command for item in make_uploaded_mission(in_air).items]
    land = [Command.DO_LAND_START, *[Command.NAV_WAYPOINT] * 4]
    assert commands == [Command.NAV_WAYPOINT, Command.NAV_WAYPOINT, Command.NAV_RETURN_TO_LAUNCH, *land]
    # One that stays in its circle ends with the return.
    stays = by_program(kept_setup("autoland-1", RTL_AUTOLAND=0.0))
    stays = replace(stays, scenario=replace(stays.scenario, launch=None, landing=None))
    assert make_uploaded_mission(stays).items[-1].command == Command.NAV_RETURN_TO_LAUNCH


def test_what_the_scenario_asks_of_its_returns_is_set() -> None:
    setup = circuit(RAIL, STRIP)
    asked = setup.autopilot.with_parameters(**setup.autopilot.returns.make_parameters(RtlSettings(180.0, lands=True)))
    assert load_user_parameters(replace(setup, autopilot=asked)) == {"RTL_ALTITUDE": 180.0, "RTL_AUTOLAND": 1.0}


def test_the_rail_of_a_launch_is_as_steep_and_as_quick_as_the_launch() -> None:
    """From 6 m before its end, 1.2 m lower, at rest, to 20 m/s in 0.6 s; 33 m/s^2 are felt along the nose."""
    take_off = circuit(RAIL, STRIP).ground_phases.take_off
    assert take_off is not None
    place, velocity = take_off.release_state()
    begin = Release(
        (46.0, 8.0, float(place[2])),
        (0.0, RAIL.incline, math.radians(90.0)),
        (0.0, float(velocity[0]), -float(velocity[2])),
        (0.0, 0.0, 0.0),
        0.0,
    )
    rail = launch_rail(begin, take_off)
    assert rail.push_time == pytest.approx(0.6)
    origin = (math.radians(46.0), math.radians(8.0), 0.0)
    rest, half, end = (motion_on_rail(rail, 0.0, pushed, origin) for pushed in (0.0, 0.3, 0.6))
    assert end.east - rest.east == pytest.approx(6.0 * math.cos(RAIL.incline), abs=0.02)
    assert rest.down - end.down == pytest.approx(6.0 * math.sin(RAIL.incline))
    assert (rest.velocity_east, rest.velocity_down) == (0.0, 0.0)
    assert math.hypot(end.velocity_east, end.velocity_down) == pytest.approx(20.0)
    assert -end.velocity_down == pytest.approx(20.0 * math.sin(RAIL.incline))
    assert half.force_x - rest.force_x == pytest.approx(20.0**2 / 12.0)
    assert rest.force_x == pytest.approx(9.80665 * math.sin(RAIL.incline), abs=1e-3)
    # On a runway it stands where it is.
    still = launch_rail(replace(begin, velocity=(0.0, 0.0, 0.0)), replace(take_off, acceleration=0.0))
    assert still.push_time == 0.0


def phase(stage: int, up: float, *, to_go: float = 300.0, on_last_leg: bool = False) -> int:
    """The phase after one look, of an aircraft so high over the landing point and so far before it, flying east."""
    true, ground = np.zeros(1, MOTION)[0], np.zeros(1, GROUND_STATE)[0]
    true.east, true.up, true.velocity_east = -to_go, up, 20.0
    ground.stage, ground.takeoff_end_altitude, ground.flare_height = stage, 60.0, 4.0
    update_phase(true, ground, on_last_leg)
    return int(ground.stage)


def test_phases_follow_heights_the_programs_item_and_the_landing_point() -> None:
    assert (phase(TAKING_OFF, 59.0), phase(TAKING_OFF, 61.0)) == (TAKING_OFF, IN_AIR)
    assert (phase(IN_AIR, 50.0), phase(IN_AIR, 50.0, on_last_leg=True)) == (IN_AIR, APPROACHING)
    assert (phase(APPROACHING, 8.1), phase(APPROACHING, 7.9)) == (APPROACHING, FLARING)
    # Beyond the point, however high.
    assert (phase(APPROACHING, 20.0, to_go=1.0), phase(APPROACHING, 20.0, to_go=-1.0)) == (APPROACHING, FLARING)


@pytest.mark.skipif(not SOAK, reason="145 s of flight: in a soak")
def test_a_stand_in_flies_from_the_catapult_to_rest_on_the_strip(fake_autopilot: MakeFake) -> None:
    setup = circuit(RAIL, STRIP)
    flown, flew = fly_autopilot(setup, AEROSONDE, arduplane_program(fake_autopilot("none")), {})
    track = flown.track
    assert flown.ended == "completed"
    assert flew.ground_phases
    # It begins at the rail's end, at 20 m/s over the ground, and comes to rest within 150 m of the landing point.
    assert np.hypot(*track.position[0, :2]) < 7.0
    assert np.linalg.norm(track.velocity[0]) == pytest.approx(20.0, abs=0.5)
    assert np.hypot(*(track.position[-1, :2] - (500.0, 600.0))) < 150.0
    assert track.clearance[-1] < 0.5
    assert np.linalg.norm(track.velocity[-1]) < 0.2
    verdict = judge_flight(flew, track, flown.ended)
    rules = {item.rule: item.ok for item in verdict.findings}
    assert rules["launch"] is True
    assert "touchdown" in rules


@pytest.mark.parametrize(("least", "seconds"), [(0.0, 1.7), (15.0, 0.0)])
def test_whoever_launches_waits_for_all_of_the_motor_where_it_runs_before(
    fake_autopilot: MakeFake, least: float, seconds: float
) -> None:
    """TKOFF_THR_DELAY 0.2 s, the throttle's whole range at THR_SLEWRATE 100 %/s, and half a second."""
    setup = by_program(circuit(RAIL, STRIP))
    parameters = setup.autopilot.parameters
    assert isinstance(parameters, ArduPilotParameters)
    autopilot = ArduPlaneSitl(parameters.changed(TKOFF_THR_MINACC=least), binary=fake_autopilot("none"))
    with AutopilotFlight(setup, AEROSONDE, autopilot, {}) as flight:
        began = flight.autopilot_time
        for _ in flight._wait_for_thrust():
            flight._lockstep.step_on_rail(flight._rail)
        assert flight.autopilot_time - began == pytest.approx(seconds, abs=0.01)
