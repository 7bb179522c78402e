"""No sample of a planned path, as drawn or as flown, is worse than its certificate."""

from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits, turn_tangents
from flight.guidance.path import fly_by_path
from flight.mission.route import Route, route_points
from planner.evaluation.problem import ANGLE_MARGIN_RAD, CERTIFIED_KILL_MARGIN_M
from planner.plan import Plan
from planner.search.plan_path import plan_path
from tests.sampled_paths import sample_path
from world.scenario import Scenario, load_scenario

EMBEDDED = ("jacksboro-air", "steep", "tight")


@pytest.fixture(scope="module", params=EMBEDDED)
def embedded(request: pytest.FixtureRequest, make_limits: Callable[[Scenario], Limits]) -> Plan:
    scenario = load_scenario(request.param)
    return plan_path(scenario, make_limits(scenario), seed=1)


def test_embedded_scenarios_are_planned_safely(embedded: Plan) -> None:
    assert embedded.safe
    assert embedded.certificate.kill_distance >= CERTIFIED_KILL_MARGIN_M
    assert embedded.certificate.slope >= ANGLE_MARGIN_RAD - 1e-9
    assert embedded.certificate.clearance >= 5.0 - 1e-9


def test_certificate_against_fine_samples(embedded: Plan) -> None:
    """One-metre samples of the legs find nothing lower, nearer or steeper than the certificate says."""
    scenario, path = embedded.scenario, embedded.waypoints
    assert scenario.terrain is not None
    runs = [max(2, int(np.hypot(*step[:2]))) for step in np.diff(path, axis=0)]
    points = np.concatenate([np.linspace(path[i], path[i + 1], runs[i]) for i in range(len(runs))])
    above = points[:, 2] - scenario.terrain.height(points[:, 0], points[:, 1]) - scenario.limits.min_clearance_m
    # The certificate takes a straight line for straight in pixels, `STRAIGHT_PIECE_M` m at a time.
    assert above.min() >= embedded.certificate.clearance - 1e-3
    armed = scenario.threats.kill_radius > 0
    distance = np.linalg.norm(points[:, None] - scenario.threats.position[armed][None], axis=2)
    assert (distance - scenario.threats.kill_radius[armed]).min() >= embedded.certificate.kill_distance - 1e-6


def fits(path: np.ndarray, limits: Limits) -> bool:
    """Whether every leg is as long as its two turns."""
    tangents = turn_tangents(limits.performance(), path)
    return bool(np.all(tangents[:-1] + tangents[1:] <= np.hypot(*np.diff(path[:, :2], axis=0).T)))


def test_certificate_against_the_path_that_guidance_flies(
    embedded: Plan, make_limits: Callable[[Scenario], Limits]
) -> None:
    """Two-metre samples of the flight's own arcs and parabolas are no lower and no nearer than certified."""
    scenario, path = embedded.scenario, embedded.waypoints
    if scenario.name == "tight":
        # Its corners cannot be flown as planned: there the certificate is of the legs as drawn.
        assert not fits(path, make_limits(scenario))
        return
    route = Route(route_points(path, 25.0), "")
    flown = sample_path(fly_by_path(route, make_limits(scenario)), 2.0)
    assert scenario.terrain is not None
    above = flown[:, 2] - scenario.terrain.height(flown[:, 0], flown[:, 1]) - scenario.limits.min_clearance_m
    assert above.min() >= embedded.certificate.clearance - 0.05
    armed = scenario.threats.kill_radius > 0
    distance = np.linalg.norm(flown[:, None] - scenario.threats.position[armed][None], axis=2)
    assert (distance - scenario.threats.kill_radius[armed]).min() >= embedded.certificate.kill_distance - 2.0
