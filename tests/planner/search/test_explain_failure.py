"""Zones that separate start and destination: a wall, a ring around an end, a floor to pass under, and a gap."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.problem import CERTIFIED_BUFFER_M, make_problem
from planner.plan import Certificate, Plan, nearest_missile_text
from planner.search.explain_failure import (
    describe_closed_bands,
    explain_failure,
    find_separating_zones,
    max_altitude,
    violated_zones,
)
from planner.search.plan_path import plan_path
from tests.setups import with_path
from world.scenario import Scenario

FLAT = {"kind": "flat", "amsl_m": 0}


def wall(low: float, high: float, name: str = "wall", **levels: float) -> dict[str, Any]:
    return {
        "name": name,
        "kind": "exclusion",
        "polygon_m": [[2900, low], [3100, low], [3100, high], [2900, high]],
        **levels,
    }


def names(small: Callable[..., Scenario], *zones: dict[str, Any], **tables: Any) -> tuple[str, ...]:
    closed = find_separating_zones(small(**({"terrain": FLAT, "threats": [], "zones": list(zones)} | tables)))
    return () if closed is None else closed.zones


def test_a_wall_across_the_map_and_one_with_a_gap(small: Callable[..., Scenario]) -> None:
    far = {"name": "far", "kind": "exclusion", "east_m": 5000, "north_m": 2000, "radius_m": 100}
    assert names(small, wall(-3000, 3000), far) == ("wall",)
    assert names(small, wall(-3000, 2000), far) == ()
    assert names(small, wall(-3000, 0, "south"), wall(0, 3000, "north")) == ("south", "north")


def test_a_ring_about_the_destination(small: Callable[..., Scenario]) -> None:
    outer = [[5500, -900], [6490, -900], [6490, 900], [5500, 900]]
    inner = [[5800, -300], [6300, -300], [6300, 300], [5800, 300]]
    assert names(small, {"name": "ring", "kind": "exclusion", "rings_m": [outer, inner]}) == ("ring",)


@pytest.mark.parametrize(("floor", "closed"), [(320.0, False), (20.0, True)])
def test_a_wall_with_a_floor(small: Callable[..., Scenario], floor: float, closed: bool) -> None:
    """Paths may be from 30 to 450 m."""
    assert bool(names(small, wall(-3000, 3000, floor_amsl_m=floor))) == closed
    # Above 120 m no path may be, under a floor of 20 m none either.
    low = {"limits": {"max_height_m": 160.0, "min_clearance_m": 30.0}}
    assert bool(names(small, wall(-3000, 3000, floor_amsl_m=floor), **low)) == closed
    assert bool(names(small, wall(-3000, 3000, ceiling_amsl_m=200.0), **low))


def test_an_inclusion_that_ends_before_the_destination(small: Callable[..., Scenario]) -> None:
    west = {"name": "west", "kind": "inclusion", "polygon_m": [[-400, -900], [3000, -900], [3000, 900], [-400, 900]]}
    east = {"name": "east", "kind": "inclusion", "polygon_m": [[-400, -800], [6400, -800], [6400, 800], [-400, 800]]}
    with pytest.raises(Exception, match="west"):
        names(small, west, east)  # an end outside is refused when the scenario is read


def failed_plan(scenario: Scenario) -> Plan:
    path = np.stack([scenario.start, scenario.destination])
    certificate = Certificate(0.1, np.inf, 0.1, 9.0, 50.0, np.inf, ("",), -5.0)
    counts = np.zeros(4, dtype=np.int64), np.zeros(4)
    return Plan(scenario, path, *counts, certificate, 1, "umda-seeded", 60, np.zeros((0, 3)))


def test_separating_zones_are_named(small: Callable[..., Scenario]) -> None:
    closed = small(terrain=FLAT, threats=[], zones=[wall(-3000, 3000)])
    assert explain_failure(failed_plan(closed))[:2] == [
        "zones block every route: wall (gaps narrower than 47 m are treated as closed)",
        "the best path violates: wall",
    ]
    beside = small(terrain=FLAT, threats=[], zones=[wall(-3000, 2000), wall(2500, 2600, "other")])
    assert explain_failure(failed_plan(beside))[0] == "the best path violates: wall"


def test_zones_are_violated_by_their_heights(small: Callable[..., Scenario]) -> None:
    path = np.array([[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
    fence = {"name": "fence", "kind": "inclusion", "polygon_m": [[-400, -90], [6400, -90], [6400, 90], [-400, 90]]}
    scenario = small(terrain=FLAT, threats=[], zones=[wall(-50, 50, floor_agl_m=151.0), fence])
    assert violated_zones(scenario, path) == []
    assert violated_zones(scenario, path + np.array([0.0, 0.0, 2.0])) == ["wall"]
    assert violated_zones(scenario, path + np.array([0.0, 91.0, 0.0])) == ["fence"]


# ----------------------------------------------------------------------
# Bands of heights that leave no room are named, with the figure; those that leave some are not.

GROUND: dict[str, Any] = {"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []}
MakeLimits = Callable[[Scenario], Limits]
Small = Callable[..., Scenario]


@pytest.mark.parametrize(("more", "said"), [(0.5, []), (-0.5, ["0.5 m too narrow"])])
def test_a_band_of_the_limits(more: float, said: list[str], small: Small, make_limits: MakeLimits) -> None:
    limits = {"min_clearance_m": 145.0, "max_height_m": 145.0 + 2.0 * CERTIFIED_BUFFER_M + more}
    scenario = small(**GROUND, limits=limits)
    lines = describe_closed_bands(make_problem(scenario, make_limits(scenario)))
    assert all(f" is {end}: " in line for line, end in zip(lines, said, strict=True))
    assert all("min_clearance_m 145 m" in line and "max_height_m" in line for line in lines)


def test_an_inclusions_band_is_named_where_the_plan_cannot_keep_both_edges(
    small: Small, make_limits: MakeLimits
) -> None:
    zone = {"name": "corridor", "kind": "inclusion", "east_m": 3000, "north_m": 0, "radius_m": 8000}
    scenario = small(**GROUND, limits={"min_clearance_m": 148.0}, zones=[zone | {"ceiling_agl_m": 151.0}])
    (line,) = describe_closed_bands(make_problem(scenario, make_limits(scenario)))
    assert "m too low: a plan needs margins above the clearance of 148 m and below the zone's ceiling at 151 m" in line
    wide = small(**GROUND, limits={"min_clearance_m": 100.0}, zones=[zone | {"ceiling_agl_m": 200.0}])
    assert describe_closed_bands(make_problem(wide, make_limits(wide))) == []


def test_the_lowest_ceiling_is_named(small: Small, make_limits: MakeLimits) -> None:
    zone = {"name": "shelf", "kind": "inclusion", "east_m": 3000, "north_m": 0, "radius_m": 8000}
    scenario = small(**GROUND, zones=[zone | {"ceiling_amsl_m": 300.0}])
    assert max_altitude(make_problem(scenario, make_limits(scenario))) == (
        300.0 - CERTIFIED_BUFFER_M,
        "the ceiling of shelf",
    )


@pytest.mark.parametrize(("more", "said"), [(-2.0, True), (40.0, False)])
def test_ground_clearance_and_reserve_against_the_ceiling(
    more: float, said: bool, small: Small, make_limits: MakeLimits
) -> None:
    """A ridge across the whole map, 30 m of clearance and 5 m in reserve."""
    hills = [{"east_m": 3000, "north_m": north, "height_m": 92, "sigma_m": 400} for north in range(-8000, 8001, 400)]
    tables: dict[str, Any] = {
        "terrain": {"kind": "peaks", "peak": hills},
        "area": {"east_m": [-1500, 7500], "north_m": [-4000, 4000]},
        "threats": [],
        "limits": {"min_clearance_m": 30.0},
        "planner": {"waypoints": 6, "population": 20, "generations": 3},
    }
    ground = small(**tables).terrain
    assert ground is not None
    # The ridge is level but for its waves.
    top = max(float(ground.height(3000.0, north)) for north in range(-4000, 4001, 50))
    tables["area"] |= {"ceiling_amsl_m": top + 30.0 + 5.0 + more}
    scenario = small(**tables)
    limits = make_limits(scenario)
    lines = explain_failure(plan_path(scenario, limits, seed=1, algorithm="umda"), limits)
    assert (
        any("the ground is too high across the whole map" in line and "margin of 5.0 m" in line for line in lines)
        is said
    )
    assert not any("terrain blocks the whole width" in line for line in lines)


# ----------------------------------------------------------------------
# Why no path was found is named.


def test_obstacles_that_block_every_route_are_named(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    hills = [{"east_m": 3000, "north_m": n, "height_m": 600, "sigma_m": 300} for n in range(-4000, 4001, 400)]
    table = {"waypoints": 6, "population": 20, "generations": 3}
    walled = small(terrain={"kind": "peaks", "peak": hills}, planner=table)
    plan = plan_path(walled, make_limits(walled), seed=1)
    assert not plan.feasible
    lines = explain_failure(plan)
    assert "terrain blocks the whole width" in lines[0]
    assert "ceiling is at 450 m AMSL" in lines[0]
    assert "also tried routes that turn back or circle to climb" in lines[-1]
    alone = plan_path(walled, make_limits(walled), seed=1, algorithm="umda")
    assert "it searched no route that turns back" in explain_failure(alone)[-1]


def test_of_a_path_that_fails_by_its_autopilot_alone_nothing_is_said(small: Small, make_limits: MakeLimits) -> None:
    """The certificate names that: no obstacle is to blame, and no longer search would help."""
    scenario = small(terrain={"kind": "flat", "amsl_m": 0})
    plan = plan_path(scenario, make_limits(scenario), seed=1)
    circles = replace(plan, certificate=replace(plan.certificate, problems=("it circles at a waypoint",)))
    assert plan.safe
    assert not circles.safe
    assert explain_failure(circles, make_limits(scenario)) == []
    stray = with_path(circles, plan.waypoints - [0.0, 0.0, 200.0])
    assert explain_failure(stray, make_limits(scenario)) != []


def test_the_nearest_missile_and_its_leg(small: Callable[..., Scenario]) -> None:
    """The second leg runs along north = 0, 1,000 m from a missile of 990 m; a radar without a kill radius is nearer."""
    threats = [
        {"name": "far", "east_m": 1000, "north_m": -2000, "kill_radius_m": 990, "kill_scale_m": 100, "height_m": 150},
        {"name": "near", "east_m": 4500, "north_m": 1000, "kill_radius_m": 990, "kill_scale_m": 100, "height_m": 150},
        {"name": "radar", "east_m": 1000, "north_m": 10, "detection_radius_m": 500, "detection_scale_m": 100},
    ]
    scenario = small(terrain=FLAT, threats=threats)
    path = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
    certificate = Certificate(0.1, np.inf, 0.1, 9.0, 50.0, -2.5, ())
    plan = Plan(scenario, path, np.zeros(4), np.zeros(4), certificate, 7, "umda", 60, np.zeros((0, 3)))
    assert nearest_missile_text(plan) == (
        "leg 1 passes 10.0 m outside the kill radius of near;"
        " with its tracking error the flight may come 2.5 m inside it"
    )
    # 132.2 m further north the leg is 867.8 m from the missile: 122.2 m inside.
    inside = replace(
        plan, waypoints=path + np.array([0.0, 132.2, 0.0]), certificate=replace(certificate, kill_distance=-134.7)
    )
    assert nearest_missile_text(inside) == (
        "leg 1 passes 122.2 m inside the kill radius of near;"
        " with its tracking error the flight may come 134.7 m inside it"
    )
