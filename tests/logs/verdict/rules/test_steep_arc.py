"""An arc that is steeper than its legs: named with both numbers, and a suggestion that passes."""

import math
import re

import numpy as np

from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_demands import route_demands
from tests.logs.verdict.judging import of
from tests.synthetic import bank_radius, make_setup


def corner(turn_deg: float, slopes_deg: tuple[float, float]) -> np.ndarray:
    turn = math.radians(turn_deg)
    first, second = (2000.0 * math.tan(math.radians(slope)) for slope in slopes_deg)
    east, north = 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
    return np.array([[0.0, 0.0, 1500.0], [0.0, 2000.0, 1500.0 + first], [east, north, 1500.0 + first + second]])


def test_the_arc_and_both_legs_are_named() -> None:
    item = of(judge_geometry(make_setup(corner(120.0, (-7.0, -6.0)))), "slope", "leg 0")
    turn = math.radians(120.0)
    tangent = bank_radius() * math.tan(0.5 * turn)
    # The heights at the arc's ends over its own length.
    steep = math.atan(tangent * (math.tan(math.radians(7.0)) + math.tan(math.radians(6.0))) / (bank_radius() * turn))
    said = re.search(
        r"the arc at waypoint 1 \(item 1\) falls ([\d.]+)° for (\d+) m, where legs 0 and 1 have", item.reason
    )
    assert said is not None, item.reason
    assert abs(float(said[1]) - math.degrees(steep)) < 0.06
    assert abs(float(said[2]) - bank_radius() * turn) < 1.0
    assert "have 7.0° and 6.0°" in item.reason
    assert "the aircraft can 7.8° there" in item.reason


def test_its_suggestion_passes() -> None:
    points = corner(120.0, (-7.0, -6.0))
    item = of(judge_geometry(make_setup(points)), "slope", "leg 0")
    for rise, leg in re.findall(r"fall (\d+) m on leg (\d)", item.suggestion):
        k = int(leg)
        points[k + 1 :, 2] += -float(rise) - (points[k + 1, 2] - points[k, 2])
    assert of(judge_geometry(make_setup(points)), "slope", "leg 0").ok is True


def test_what_the_other_leg_can_counts_too() -> None:
    """With the wind behind on one leg and ahead on the other, half of the arc has either's limit."""
    points = corner(100.0, (10.5, 10.5))
    behind, ahead = (make_setup(points, wind={"speed_mps": 9.0, "from_deg": from_deg}) for from_deg in (180.0, 280.0))
    first, second = route_demands(behind), route_demands(ahead)
    assert first.climb[0] < first.climb[1]
    assert second.climb[0] > second.climb[1]
    for setup in (behind, ahead):
        item = of(judge_geometry(setup), "slope", "leg 0")
        limits = route_demands(setup).climb
        can = re.search(r"the aircraft can ([\d.]+)° there", item.reason)
        if can is not None:
            assert abs(math.tan(math.radians(float(can[1]))) - float(np.tan(limits).mean())) < 2e-3
