"""Default plans among zones and in a band of heights above ground: planned where a grid can, and flown inside all.

The counts that docs/measured.md states are `benchmarks.airspace.flights` and `benchmarks.airspace.many_zones`.
"""

import dataclasses
import itertools

import numpy as np
import pytest

from benchmarks.airspace.flights import fly, kept_by
from benchmarks.airspace.many_zones import crowded_scenario
from benchmarks.airspace.scenarios import draw_scenario, passable, ring_distance
from planfly.workflow.make_plan import make_plan
from planfly.workflow.uav import load_uav
from tests.soak import SOAK, some

# Of the bench's: the first draws of these numbers that the grid search passes.
DRAWS = {3: 3, 0: 1}


def sampled(path: np.ndarray) -> np.ndarray:
    """Places of the legs of a path (w, 3), 5 m apart."""
    return np.concatenate(
        [np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / 5.0))) for a, b in itertools.pairwise(path)]
    )


@pytest.mark.parametrize("number", some(DRAWS, 2))
def test_planned_where_a_grid_can_and_flown_inside_all(number: int) -> None:
    flown = fly(number)
    assert flown.kept is not None
    assert flown.wrong == ""
    assert flown.kept.least >= 0.0


def test_no_sample_of_a_plan_keeps_less_than_its_certificate() -> None:
    scenario = draw_scenario(3, DRAWS[3])
    assert scenario is not None
    assert passable(scenario)
    plan = make_plan(scenario, load_uav(scenario), 4)
    assert plan.safe
    kept = kept_by(scenario, sampled(plan.waypoints))
    assert kept.zones >= plan.certificate.zone_distance - 0.01
    assert kept.high >= plan.certificate.headroom - 0.01
    assert kept.low >= plan.certificate.clearance - 0.01
    # And the certificate leaves room for the autopilot, not for another one.
    assert kept.zones < plan.certificate.zone_distance + 60.0


def test_without_its_zones_and_its_greatest_height_the_same_way_is_planned_through_them() -> None:
    """Or the test above would tell nothing."""
    scenario = draw_scenario(3, DRAWS[3])
    assert scenario is not None
    limits = scenario.limits.model_copy(update={"max_height_m": None})
    free = dataclasses.replace(scenario, zones=(), limits=limits)
    plan = make_plan(free, load_uav(free), 4)
    assert plan.safe
    assert kept_by(scenario, sampled(plan.waypoints)).least < 0.0


def test_a_way_between_many_zones_of_many_corners() -> None:
    scenario = crowded_scenario(*((200, 50) if SOAK else (60, 30)))
    plan = make_plan(scenario, load_uav(scenario), 1)
    assert plan.safe
    places = sampled(plan.waypoints)[:, :2]
    rings = [np.array(zone.polygon_m) for zone in scenario.spec.zones or ()]
    least = min(float(ring_distance(ring, places).min()) for ring in rings)
    # A plan stays 10 m outside, which its margin does not include.
    assert least - 10.0 >= plan.certificate.zone_distance - 0.01 >= -0.01
    straight = np.linspace(scenario.start[:2], scenario.destination[:2], 4000)
    assert min(float(ring_distance(ring, straight).min()) for ring in rings) < 0.0
