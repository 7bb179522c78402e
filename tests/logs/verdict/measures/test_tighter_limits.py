"""Of a fly-by arc too steep for the aircraft: its slope, and the limit on the mean of both legs' courses."""

import math

import numpy as np

from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.tighter_limits import steep_arc
from tests.synthetic import (
    make_setup,
)


def corner(turn_deg: float, slopes_deg: tuple[float, float]) -> np.ndarray:
    turn = math.radians(turn_deg)
    first, second = (2000.0 * math.tan(math.radians(slope)) for slope in slopes_deg)
    east, north = 2000.0 * math.sin(turn), 2000.0 + 2000.0 * math.cos(turn)
    return np.array([[0.0, 0.0, 1500.0], [0.0, 2000.0, 1500.0 + first], [east, north, 1500.0 + first + second]])


def test_what_the_other_leg_can_counts_too() -> None:
    """With the wind behind on one leg and ahead on the other, half of the arc has either's limit."""
    points = corner(100.0, (10.5, 10.5))
    behind, ahead = (make_setup(points, wind={"speed_mps": 9.0, "from_deg": from_deg}) for from_deg in (180.0, 280.0))
    first, second = route_demands(behind), route_demands(ahead)
    assert first.climb[0] < first.climb[1]
    assert second.climb[0] > second.climb[1]
    for setup in (behind, ahead):
        demands = route_demands(setup)
        found = steep_arc(demands, 0)
        assert found is None or abs(found.limit - float(np.tan(demands.climb).mean())) < 1e-12
    assert steep_arc(first, 0) is not None
