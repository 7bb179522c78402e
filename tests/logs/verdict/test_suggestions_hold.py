"""Every suggestion of a failed finding, taken, passes: on random missions beyond one limit, judged and flown."""

import math
from dataclasses import replace

import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.places import Suggestion
from logs.verdict.verdict import Verdict
from tests.logs.verdict.judging import bare, of
from tests.missions import KINDS, MadeMission, infeasible
from tests.soak import scaled
from world.arrays import Floats

JUDGED, FLOWN = range(scaled(100, len(KINDS))), range(scaled(100, len(KINDS) // 2))


def taken(setup: FlightSetup, suggestion: Suggestion) -> FlightSetup:
    """The setup with one suggestion taken: all of its changes of the plan."""
    points, speeds = setup.route.positions.copy(), setup.route.leg_airspeeds.copy()
    for change in suggestion:
        k = change.place.index
        assert k is not None, change
        if change.what == "rise":
            points[k + 1 :, 2] += change.wanted - (points[k + 1, 2] - points[k, 2])
        elif change.what == "length":
            step = points[k + 1, :2] - points[k, :2]
            run = math.hypot(*step)
            points[k + 1 :, :2] += step / run * (change.wanted - run)
        elif change.what == "airspeed" and change.most is not None:
            speeds[k] = change.wanted if speeds[k] < change.wanted else change.most
        elif change.what == "airspeed":
            speeds[k if change.place.kind == "leg" else slice(k - 1, k + 1)] = change.wanted
        elif change.what == "turn":
            points = turned(points, k, math.radians(change.wanted))
        else:
            assert change.what == "height", change
            points[:, 2] += change.wanted
    return replace(setup, route=setup.route.with_fields(position=points, airspeed=speeds))


def turned(points: Floats, at: int, most: float) -> Floats:
    """What comes after a waypoint, turned about it so that its course changes by this much."""
    into, out = points[at] - points[at - 1], points[at + 1] - points[at]
    now = math.remainder(math.atan2(out[0], out[1]) - math.atan2(into[0], into[1]), 2.0 * math.pi)
    angle = math.copysign(most, now) - now
    moved = points.copy()
    east, north = (points[at + 1 :, :2] - points[at, :2]).T
    moved[at + 1 :, 0] = points[at, 0] + east * math.cos(angle) + north * math.sin(angle)
    moved[at + 1 :, 1] = points[at, 1] - east * math.sin(angle) + north * math.cos(angle)
    return moved


def failed(made: MadeMission, verdict: Verdict) -> list[Finding]:
    return [item for item in verdict.findings if item.ok is False and item.rule == made.rule]


@pytest.mark.parametrize("number", JUDGED)
def test_each_way_passes_the_geometry(number: int) -> None:
    made = infeasible(number, 0.2)
    wrong = failed(made, judge_geometry(made.setup))
    assert any(item.suggestions for item in wrong)
    for item in wrong:
        # A route without items cannot follow the ground; trial flights test that suggestion.
        for suggestion in (one for one in item.suggestions if one[0].what != "terrain height"):
            again = of(judge_geometry(taken(made.setup, suggestion)), item.rule, bare(item.place))
            assert again.ok is True, (item.place, suggestion, again)


@pytest.mark.parametrize("number", FLOWN)
def test_taken_until_none_is_left_the_mission_flies(number: int) -> None:
    """The first way of the first finding, over and over, as a person would: then the flight passes the rule too."""
    made = infeasible(number, 0.2)
    setup = made.setup
    for _ in range(8):
        wrong = failed(made, judge_geometry(setup))
        if not wrong:
            break
        setup = taken(setup, wrong[0].suggestions[0])
    flown = fly_to_end(Flight(setup, made.uav.aircraft))
    still = failed(made, judge_flight(setup, flown.track, flown.ended))
    assert not still, [item.reason for item in still]
