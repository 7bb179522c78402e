"""No sample of a planned path, as drawn or as flown, is worse than its certificate."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import planfly
from aircraft.path_limits import Limits, turn_tangents
from flight.guidance.path import fly_by_path
from flight.mission.route import Route, route_points
from planfly.workflow.uav import load_uav
from planner.evaluation.certify import certify
from planner.evaluation.problem import CERTIFIED_KILL_MARGIN_M, make_problem
from planner.plan import Plan
from planner.search.algorithms import find_algorithm, limits_for
from planner.search.plan_path import plan_path
from tests.sampled_paths import sample_path
from tests.soak import scaled
from world.scenario import Scenario, load_scenario

EMBEDDED = ("jacksboro-air", "steep", "tight")


@pytest.fixture(scope="module", params=EMBEDDED)
def embedded(request: pytest.FixtureRequest, make_limits: Callable[[Scenario], Limits]) -> Plan:
    scenario = load_scenario(request.param)
    return plan_path(scenario, make_limits(scenario), seed=1)


def test_embedded_scenarios_are_planned_safely(embedded: Plan) -> None:
    assert embedded.safe
    assert embedded.certificate.kill_distance >= CERTIFIED_KILL_MARGIN_M
    assert all(margin >= 0.0 for margin in embedded.margins)


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


# ----------------------------------------------------------------------
# A margin is negative exactly if the path fails by this limit.

_MAST = {"name": "mast", "kind": "exclusion", "east_m": 5200.0, "north_m": 300.0, "radius_m": 250.0}
# Scenarios and their changed tables: limits of the aircraft and fixed ones, a zone, a maximum height, fly-over turns,
# wind, and an algorithm that counts violations.  The margins that some paths fail by, besides those that all do.
VARIANTS: tuple[tuple[str, dict[str, Any], set[str]], ...] = (
    ("jacksboro-air", {}, {"available_length"}),
    ("jacksboro-air", {"flight": {"fly_over": True}, "limits": {"max_height_m": 260.0}}, {"headroom"}),
    (
        "jacksboro-air",
        {"wind": {"speed_mps": 8.0, "from_deg": 250.0, "turbulence": "light"}},
        {"available_length"},
    ),
    ("hard-07", {"zones": [_MAST]}, {"zone_distance"}),
    ("hard-07", {"planner": {"algorithm": "umda"}, "limits": {"max_climb_deg": "aircraft"}}, set()),
    ("trap-u", {}, {"available_length"}),
    ("steep", {}, {"available_length"}),
    ("tight", {}, {"available_length"}),
)
# The margin that a line of ``problems`` belongs to; any other line is about a zone.
MARGIN_OF_PROBLEM = (
    (r": turns ", "turn"),
    (r" m long", "available_length"),
    (r": (climbs|sinks) ", "slope"),
    (r"at its lowest|leaves the terrain", "clearance"),
    (r"beyond the edge of the area", "bounds"),
    (r"at its highest", "headroom"),
    (r"", "zone_distance"),
)


def moved_paths(path: np.ndarray, count: int) -> list[np.ndarray]:
    """The path with its inner waypoints moved, sideways and up, by a little and by much."""
    rng = np.random.default_rng(3)
    waves = np.sin(np.outer(np.linspace(0.0, np.pi, len(path)), np.arange(1, 5)))
    moved = []
    for size in np.geomspace(1.0, 6000.0, count):
        steps = rng.normal(0.0, 1.0, (4, 3)) * [size, size, 0.1 * size] / 3.0
        moved.append(path + waves @ steps)
    return moved


@pytest.mark.parametrize(("base", "tables", "failing"), VARIANTS)
def test_a_margin_is_negative_exactly_if_the_path_fails_by_it(
    base: str, tables: dict[str, Any], failing: set[str]
) -> None:
    scenario = planfly.make_scenario(base, **tables)
    limits = load_uav(scenario).limits.with_margin()
    found = plan_path(scenario, limits, seed=1, algorithm=None if base == "tight" else "fda-seeded")
    problem = make_problem(scenario, limits_for(find_algorithm(scenario.planner.algorithm, base), limits))
    names = [name for _, name in MARGIN_OF_PROBLEM]
    kept, seen, paths = 0, set[str](), moved_paths(found.waypoints, scaled(1500, 150))
    for path in paths:
        certificate = certify(problem, path)
        failed = {
            next(name for pattern, name in MARGIN_OF_PROBLEM if re.search(pattern, line))
            for line in certificate.problems
        }
        # NaN, off the terrain, is not 0 or more.
        assert {name for name in names if not getattr(certificate, name) >= 0.0} == failed, certificate
        kept, seen = kept + certificate.ok, seen | failed
    assert 0 < kept < len(paths)
    assert seen >= {"turn", "slope", "clearance", "bounds"} | failing
