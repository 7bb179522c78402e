"""L1 and the vector field by their formulas and in flight."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import Aircraft
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.guidance.lateral_reference_laws import (
    WAYPOINT,
    field_course,
    has_reached_leg_end,
    l1_acceleration,
    l1_angles,
    l1_length,
)
from flight.guidance.navigation_error import MOTION
from flight.simulation.simulate import Flight, fly_to_end
from tests.setups import MakeSetup
from world.kernels import Record

A, B = np.zeros(2, WAYPOINT)
for waypoint in (A, B):
    waypoint.airspeed, waypoint.up = 25.0, 500.0
B.north, B.turn = 1000.0, math.pi / 4
LEG = (A.east, A.north, B.east, B.north)


def _at(east: float, north: float, course: float = 0.0) -> Record:
    rows = [(east, north, 500.0, 25.0 * math.sin(course), 25.0 * math.cos(course), 0.0)]
    return np.array(rows, MOTION)[0]


def test_l1_is_the_second_order_law_it_claims() -> None:
    # Near its line the law is cross" = -(2 pi / period)^2 cross - 2 damping (2 pi / period) cross'... of the paper.
    length = l1_length(25.0, 17.0, 0.75)
    assert length == pytest.approx(17.0 * 0.75 * 25.0 / math.pi)
    angle, aim = l1_angles(_at(1.0, 500.0), *LEG, length)
    pull = l1_acceleration(angle + aim, 25.0, length, 0.75)
    assert pull == pytest.approx(-((2.0 * math.pi / 17.0) ** 2), rel=1e-3)
    angle, aim = l1_angles(_at(0.0, 500.0, 0.01), *LEG, length)
    damping = l1_acceleration(angle + aim, 25.0, length, 0.75)
    assert damping == pytest.approx(-2.0 * 0.75 * (2.0 * math.pi / 17.0) * 25.0 * 0.01, rel=1e-3)


def test_l1_far_away_and_at_its_corners() -> None:
    assert l1_angles(_at(900.0, 500.0), *LEG, 100.0)[1] == pytest.approx(math.pi / 4)
    assert math.isnan(l1_angles(_at(0.0, -500.0), *LEG, 100.0)[1])
    assert math.isnan(l1_angles(_at(0.0, 1100.0), *LEG, 100.0)[1])
    # Half of a right angle turns at half the distance; a waypoint flown over at its own.
    assert has_reached_leg_end(_at(0.0, 956.0), A, B, 200.0, 90.0)
    assert not has_reached_leg_end(_at(0.0, 954.0), A, B, 200.0, 90.0)
    over = B.copy()
    over.fly_over = True
    assert not has_reached_leg_end(_at(0.0, 999.0), A, over, 200.0, 90.0)
    assert has_reached_leg_end(_at(30.0, 1000.1), A, over, 200.0, 90.0)


def test_the_field_points_to_its_path() -> None:
    assert field_course(1.0, 0.0, 0.0, 1.0, 0.05, 4.0) == 1.0
    assert field_course(1.0, 1e9, 0.0, 1.0, 0.05, 4.0) == pytest.approx(0.0, abs=1e-6)
    for curvature in (0.01, -0.01):
        assert (
            field_course(1.0, 10.0, curvature, 1.0, 0.05, 4.0)
            < 1.0
            < field_course(1.0, -10.0, curvature, 1.0, 0.05, 4.0)
        )


@pytest.mark.parametrize("law", ["l1", "vector-field"])
def test_a_reference_law_flies_the_mission(make_setup: MakeSetup, aerosonde: Aircraft, law: str) -> None:
    way = [[0, 0, 500], [0, 1500, 520], [1000, 2500, 520], [1000, 4000, 500]]
    setup = make_setup(way, wind=(5.0, 70.0))
    flown = fly_to_end(Flight(replace(setup, autopilot=PlanflyGuidance(law)), aerosonde))
    ours = fly_to_end(Flight(setup, aerosonde))
    assert flown.ended == "completed"
    assert 0.3 < float(np.abs(flown.track.cross_track).max()) < 40.0
    assert float(np.abs(ours.track.cross_track).max()) < float(np.abs(flown.track.cross_track).max())
    assert float(np.abs(flown.track.height_error[300:]).max()) < 1.0
