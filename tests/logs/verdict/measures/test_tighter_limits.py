"""Of a fly-by arc too steep for the aircraft: its slope, and the limit on the mean of both legs' courses."""

import math
import re

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.tighter_limits import slope_limit, steep_arc, turn_limit
from tests.logs.verdict.judging import leg, of
from tests.synthetic import CALM_CLIMB, CALM_DESCENT, bank_radius, make_setup

# Degrees of climb of both legs: each is within what the aircraft can there, the arc between them is not.
SLOPE = 10.5


def corner(turn_deg: float, slopes_deg: tuple[float, float]) -> np.ndarray:
    turn = math.radians(turn_deg)
    first, second = (2000.0 * math.tan(math.radians(slope)) for slope in slopes_deg)
    east, north = 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
    return np.array([[0.0, 0.0, 1500.0], [0.0, 2000.0, 1500.0 + first], [east, north, 1500.0 + first + second]])


def limit_by_hand(course_deg: float, wind: float, from_deg: float) -> float:
    """Tangent of the steepest climb over the ground, at 25 m/s, of an aircraft that climbs 13.7 degrees in calm air."""
    level = 25.0 * math.cos(math.radians(CALM_CLIMB))
    off = math.radians(from_deg + 180.0 - course_deg)
    tail, cross = wind * math.cos(off), wind * math.sin(off)
    return 25.0 * math.sin(math.radians(CALM_CLIMB)) / (math.sqrt(level**2 - cross**2) + tail)


@pytest.mark.parametrize("from_deg", [180.0, 280.0])
def test_the_other_legs_limit_counts_too(from_deg: float) -> None:
    """With the wind behind on one leg and ahead on the other, half of the arc has either's limit."""
    setup = make_setup(corner(100.0, (SLOPE, SLOPE)), wind={"speed_mps": 9.0, "from_deg": from_deg})
    limits = [limit_by_hand(course, 9.0, from_deg) for course in (0.0, 100.0)]
    assert (limits[0] < limits[1]) is (from_deg == 180.0)
    item = of(judge_geometry(setup), "slope", leg(0))
    printed = re.search(r"the aircraft can ([\d.]+)° there", item.reason)
    assert printed is not None, item.reason
    assert abs(math.tan(math.radians(float(printed[1]))) - sum(limits) / 2.0) < 2e-3
    found = steep_arc(route_demands(setup), 0)
    assert found is not None
    assert abs(found.limit - sum(limits) / 2.0) < 1e-4


@pytest.mark.parametrize(("speeds", "steep"), [([25.0, 25.0], True), ([25.0, 34.0], False), ([34.0, 25.0], False)])
def test_an_arc_beside_a_leg_that_cannot_climb_at_all_is_not_judged(speeds: list[float], steep: bool) -> None:
    """At 34 m/s the aircraft sinks at full throttle: the leg fails by its speed."""
    demands = route_demands(make_setup(corner(100.0, (11.0, 11.0)), speeds=speeds))
    assert (demands.climb > 0.0).all() == (34.0 not in speeds)
    assert (steep_arc(demands, 0) is not None) is steep


@pytest.mark.parametrize(("climb", "dive"), [(9.0, 6.0), (15.0, 9.0)])
def test_the_tighter_of_scenario_and_aircraft(climb: float, dive: float) -> None:
    """The aircraft has 13.7 degrees up and 7.8 down."""
    setup = make_setup(corner(20.0, (4.0, -4.0)), limits={"max_climb_deg": climb, "max_dive_deg": dive})
    demands = route_demands(setup)
    for number, (fixed, own) in enumerate(((climb, CALM_CLIMB), (dive, CALM_DESCENT))):
        limit, source = slope_limit(demands, number)
        assert math.degrees(limit) == pytest.approx(min(fixed, own))
        assert source == ("scenario" if fixed < own else "aircraft")


@pytest.mark.parametrize(("fixed", "source"), [(70.0, "scenario"), (175.0, "aircraft")])
def test_the_tighter_turn(fixed: float, source: str) -> None:
    """Legs of 400 m hold an arc of R tan(turn / 2) = 400 m."""
    points = [[0, 0, 300], [0, 400, 300], [400, 400, 300]]
    demands = route_demands(make_setup(points, limits={"max_turn_deg": fixed}))
    own = 2.0 * math.degrees(math.atan(400.0 / bank_radius()))
    assert turn_limit(demands, 1) == (pytest.approx(math.radians(min(fixed, own))), source)
    assert turn_limit(route_demands(make_setup(points), envelope=False), 1) == (math.inf, "none")
