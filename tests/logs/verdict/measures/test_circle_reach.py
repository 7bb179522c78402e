"""What lies within reach of a circle: a hill, heights over ground, the terrain's end, missiles, zones, the edge."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from logs.verdict.measures.circle_reach import _ring_points, end_loiter_hazards, find_hazards
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from tests.logs.verdict.rules.test_loiter_rule_own_radius import TIME, loiter, radius_at, sphere
from world.terrain import make_gridded_terrain

REACH = 261.0


def found(low: float, high: float, requirements: RouteRequirements | None = None, **tables: Any) -> list[str]:
    """Within 261 m of home, over flat ground at 0 m."""
    known = requirements or route_requirements(loiter(TIME, {}, **tables))
    return find_hazards(known, np.zeros(2), low, high, REACH)


# Distance of the ground's pixels, m.
PITCH = 20.0


def with_ground(away: float, up: float) -> RouteRequirements:
    """Flat ground with a block of this height, m or NaN, wherever it is farther east than that, m."""
    setup, axis = loiter(TIME, {}), np.arange(-4000.0, 4001.0, PITCH)
    heights = np.tile(np.where(axis > away, up, 0.0), (axis.size, 1))
    ground = make_gridded_terrain(heights, axis, axis, source="", sha256="", datum="")
    return route_requirements(replace(setup, scenario=replace(setup.scenario, terrain=ground)))


def test_a_missions_end_has_circles_where_the_autopilot_flies_them() -> None:
    """After the last waypoint ArduPlane returns; PX4 circles, within 2.25 radii of 30 degrees of bank."""
    setup = loiter(TIME, {})
    assert end_loiter_hazards(route_requirements(setup)) is None
    beside = end_loiter_hazards(
        route_requirements(replace(setup, autopilot=Px4(Px4Parameters.defaults().changed(FW_AIRSPD_MAX=30.0))))
    )
    assert beside is not None
    assert beside[0] == pytest.approx(2.25 * radius_at(30.0), rel=0.02)
    assert beside[1] == []


def test_the_lowest_height_counts_against_the_ground() -> None:
    """Its least clearance is 30 m, of which 0.1 m is forgiven."""
    limit = route_requirements(loiter(TIME, {})).limits.min_clearance
    assert found(limit - 0.09, 900.0) == []
    assert found(limit - 0.11, 900.0) == [f"the ground is only {limit - 0.11:.0f} m below ({limit:.0f} m are required)"]


def test_the_highest_height_counts_against_the_greatest_above_ground() -> None:
    limits = {"max_height_m": 600.0}
    assert found(500.0, 599.0, limits=limits) == []
    assert found(500.0, 610.0, limits=limits) == ["the ground is 610 m below, more than the 600 m allowed"]


@pytest.mark.parametrize(
    ("up", "what"),
    [
        (490.0, "the ground is only 10 m below (30 m are required)"),
        (510.0, "the ground is 10 m above (30 m are required)"),
        (np.nan, "the terrain is unknown"),
    ],
)
def test_a_hill_counts_within_its_reach_only(up: float, what: str) -> None:
    assert found(500.0, 500.0, with_ground(REACH - 2.0 * PITCH, up)) == [what]
    assert found(500.0, 500.0, with_ground(REACH + 2.0 * PITCH, up)) == []


@pytest.mark.parametrize(("reach", "spacing", "rings"), [(900.0, 30.0, 30), (900.0, 90.0, 24), (9000.0, 30.0, 120)])
def test_a_disc_is_looked_at_along_rings_a_step_of_the_ground_apart(reach: float, spacing: float, rings: int) -> None:
    """So many between its middle and its edge, of 24 at the least and 120 at the most."""
    away = np.hypot(*(_ring_points(np.array([200.0, -100.0]), reach, spacing) - [200.0, -100.0]).T)
    found = np.unique(away.round(6))
    assert len(found) == rings + 1
    assert np.diff(found) == pytest.approx(found[-1] / rings, rel=1e-5)
    # Its edge's corners lie a little outside.
    assert reach <= found[-1] < 1.002 * reach


def test_a_missile_counts_by_its_height_too() -> None:
    """A sphere of 100 m about 500 m, 250 m away."""
    assert found(650.0, 700.0, **sphere(250.0, 100.0)) == []
    assert found(590.0, 700.0, **sphere(250.0, 100.0)) == ["missile m is in range"]
    assert found(300.0, 390.0, **sphere(250.0, 100.0)) == []
    assert found(300.0, 410.0, **sphere(250.0, 100.0)) == ["missile m is in range"]


def test_a_zone_counts_at_any_height_of_a_spiral() -> None:
    zone = {"name": "z", "kind": "exclusion", "east_m": 150.0, "north_m": 60.0, "radius_m": 50.0}
    zone |= {"floor_amsl_m": 600.0, "ceiling_amsl_m": 640.0}
    assert found(500.0, 590.0, zones=[zone]) == []
    assert found(500.0, 700.0, zones=[zone]) == ["exclusion zone z may be violated"]
    assert found(500.0, 620.0, zones=[zone]) == ["exclusion zone z may be violated"]


@pytest.mark.parametrize("side", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_the_area_may_end_on_any_side(side: tuple[int, int]) -> None:
    """West, east, south, north of home; on the other three it ends 9 km away."""
    setup = loiter(TIME, {})
    for beyond, said in ((1.0, []), (-1.0, ["the area's edge is in reach"])):
        bounds = np.array(setup.scenario.bounds)
        bounds[side] = (REACH + beyond) * (1.0 if side[1] else -1.0)
        scenario = replace(setup.scenario, bounds=bounds)
        assert found(500.0, 500.0, route_requirements(replace(setup, scenario=scenario))) == said
