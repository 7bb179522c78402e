"""Loiters that PX4's law flies: on its own laps, which are not the corners that the route draws."""

from dataclasses import replace

from aircraft.catalog import load_aircraft
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.route import make_route
from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.judge_flight import judge_flight
from tests.logs.verdict.judging import of
from tests.mission_lines import ORIGIN, setup_of, wp


def test_a_loiter_to_an_altitude_that_was_reached_is_whole() -> None:
    """PX4 climbs on fewer laps than are drawn, so that corners are left out: nothing of it was not flown."""
    aircraft = load_aircraft("aerosonde")
    law = Px4(Px4Parameters.load(aircraft, None, "1.17"))
    made = setup_of(wp(0, 500), wp(0, 2500, 250, command=31, p="0 150 0 0"), wp(2500, 2500, 250))
    route = make_route(made.mission, ORIGIN, made.scenario.terrain, 25.0, False, made.limits, law.route_rules)
    setup = replace(made, route=route, autopilot=law)
    result = fly_to_end(Flight(setup, aircraft))
    item = of(judge_flight(setup, result.track, result.ended), "loiter")
    assert item.ok is True
    assert " laps flown at " in item.reason
    assert "not flown" not in item.reason
