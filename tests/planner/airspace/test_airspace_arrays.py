"""The airspace of a problem: what is kept below a greatest height, and the ground seen from below."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from planner.airspace.airspace_arrays import is_limited, keep_airspace
from planner.airspace.kept_zones import ZoneMargins
from world.scenario import Scenario

MARGINS = ZoneMargins(10.0, 5.0, 0.75)
FLAT = {"kind": "flat", "amsl_m": 20}
ZONE = {"name": "it", "kind": "exclusion", "east_m": 3000, "north_m": 900, "radius_m": 200}


def test_nothing_is_limited_without_zones_and_greatest_height(small: Callable[..., Scenario]) -> None:
    assert not is_limited(keep_airspace(small(), MARGINS, 5.0))
    assert is_limited(keep_airspace(small(zones=[ZONE]), MARGINS, 5.0))
    assert is_limited(keep_airspace(small(limits={"max_height_m": 400}), MARGINS, 5.0))


@pytest.mark.parametrize(("most", "kept"), [(140.0, 5.0), (134.0, 0.75 * 3.99)])
def test_an_end_near_the_greatest_height_leaves_a_share_of_what_it_keeps(
    small: Callable[..., Scenario], most: float, kept: float
) -> None:
    """The ends are 130 m above ground."""
    space = keep_airspace(small(terrain=FLAT, limits={"max_height_m": most}), MARGINS, 5.0)
    assert (space.max_height, space.buffer) == (most, 5.0)
    assert (space.start_buffer, space.destination_buffer) == pytest.approx((kept, kept))


def test_depths_are_the_heights_with_the_other_sign_where_they_are_asked_for(small: Callable[..., Scenario]) -> None:
    scenario = small(limits={"max_height_m": 400})
    assert scenario.terrain is not None
    np.testing.assert_array_equal(keep_airspace(scenario, MARGINS, 5.0).depths, -scenario.terrain.heights)
    above = small(zones=[ZONE | {"floor_agl_m": 100}])
    assert keep_airspace(above, MARGINS, 5.0).depths.shape == scenario.terrain.heights.shape
    assert math.isinf(keep_airspace(small(zones=[ZONE]), MARGINS, 5.0).max_height)
    assert keep_airspace(small(zones=[ZONE]), MARGINS, 5.0).depths.size == 4
