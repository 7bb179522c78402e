"""Which zones close a way: a wall, a ring about an end, a floor to pass under, and a gap."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from planner.plan import Certificate, Plan
from planner.search.closing_zones import closing_zones
from planner.search.explain_failure import what_blocks, zones_entered
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
    closed = closing_zones(small(**({"terrain": FLAT, "threats": [], "zones": list(zones)} | tables)))
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


def test_what_blocks_names_the_zones(small: Callable[..., Scenario]) -> None:
    closed = small(terrain=FLAT, threats=[], zones=[wall(-3000, 3000)])
    assert what_blocks(failed_plan(closed))[:2] == [
        "zones close the whole way (gaps narrower than 47 m count as closed): wall",
        "the best path does not keep to: wall",
    ]
    beside = small(terrain=FLAT, threats=[], zones=[wall(-3000, 2000), wall(2500, 2600, "other")])
    assert what_blocks(failed_plan(beside))[0] == "the best path does not keep to: wall"


def test_zones_entered_by_their_heights(small: Callable[..., Scenario]) -> None:
    path = np.array([[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
    fence = {"name": "fence", "kind": "inclusion", "polygon_m": [[-400, -90], [6400, -90], [6400, 90], [-400, 90]]}
    scenario = small(terrain=FLAT, threats=[], zones=[wall(-50, 50, floor_agl_m=151.0), fence])
    assert zones_entered(scenario, path) == []
    assert zones_entered(scenario, path + np.array([0.0, 0.0, 2.0])) == ["wall"]
    assert zones_entered(scenario, path + np.array([0.0, 91.0, 0.0])) == ["fence"]
