"""Every suggestion of a failed finding, taken, passes: on random missions beyond one limit, judged and flown."""

import math
import os
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.simulate import simulate
from logs.verdict.findings import Finding, Verdict
from logs.verdict.judge_flight import judge_flight, judge_geometry
from tests.logs.verdict.judging import of
from tests.missions import KINDS, MadeMission, infeasible

SOAK = bool(os.environ.get("PLANFLY_SOAK"))
JUDGED = range(100) if SOAK else range(3 * len(KINDS))
FLOWN = range(100) if SOAK else range(len(KINDS))

Floats = NDArray[np.float64]


def taken(setup: FlightSetup, item: Finding, change: str) -> FlightSetup:
    """The setup with one suggested change of the plan."""
    points, speeds = setup.route.waypoints.copy(), setup.route.airspeed.copy()
    at = int(item.where.split()[1])
    done = False
    for rise, leg in re.findall(r"(?:climb|fall) (\d+) m on leg (\d+)", change):
        k = int(leg)
        now = points[k + 1, 2] - points[k, 2]
        points[k + 1 :, 2] += math.copysign(float(rise), now) - now
        done = True
    for leg, length in re.findall(r"leg (\d+) (\d+) m long", change):
        k = int(leg)
        step = points[k + 1, :2] - points[k, :2]
        run = math.hypot(*step)
        points[k + 1 :, :2] += step / run * (float(length) - run)
        done = True
    if found := re.search(r"fly it at ([\d.]+) m/s", change):
        speeds[at if item.rule == "slope" else slice(at - 1, at + 1)] = float(found[1])
        done = True
    if found := re.search(r"turn at most ([\d.]+)°", change):
        points = turned(points, at, math.radians(float(found[1])))
        done = True
    if found := re.search(r"fly leg \d+ (\d+) m higher", change):
        points[:, 2] += float(found[1])
        done = True
    if found := re.search(r"command ([\d.]+) to ([\d.]+) m/s on leg (\d+)", change):
        low, high = float(found[1]), float(found[2])
        speeds[int(found[3])] = low if speeds[int(found[3])] < low else high
        done = True
    assert done, change
    return replace(setup, route=replace(setup.route, waypoints=points, airspeed=speeds))


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
    assert any(item.suggestion for item in wrong)
    for item in wrong:
        for change in filter(None, item.suggestion.split(", or ")):
            again = judge_geometry(taken(made.setup, item, change))
            assert of(again, item.rule, item.where).ok is True, (item.where, change, of(again, item.rule, item.where))


@pytest.mark.parametrize("number", FLOWN)
def test_taken_until_none_is_left_the_mission_flies(number: int) -> None:
    """The first way of the first finding, over and over, as a person would: then the flight passes the rule too."""
    made = infeasible(number, 0.2)
    setup = made.setup
    for _ in range(8):
        wrong = failed(made, judge_geometry(setup))
        if not wrong:
            break
        setup = taken(setup, wrong[0], wrong[0].suggestion.split(", or ")[0])
    flown = simulate(setup, made.airframe.aircraft)
    still = failed(made, judge_flight(setup, flown.track, flown.ended))
    assert not still, [item.reason for item in still]
