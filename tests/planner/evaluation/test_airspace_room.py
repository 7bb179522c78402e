"""What the certificate finds of zones and of a greatest height, just inside and just outside."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.airspace_room import airspace_pieces
from planner.evaluation.certify import certify
from planner.evaluation.problem import CERTIFIED_BUFFER, CERTIFIED_ZONE_MARGIN, Problem, make_problem
from planner.plan import Certificate
from tests.planner.straying import straying
from world.scenario import Scenario

Made = Callable[..., Problem]
STRAIGHT = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
TURNED = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [3000.0, 2900.0, 150.0]])


@pytest.fixture
def made(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Made:
    def problem(numbers: dict[str, float] | None = None, **tables: Any) -> Problem:
        scenario = small(**({"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []} | tables))
        limits = make_limits(scenario)
        return make_problem(scenario, limits if numbers is None else straying(limits, **numbers))

    return problem


def tower(off: float, east: float = 1500.0, **levels: float) -> list[dict[str, Any]]:
    """A cylinder whose edge is this far (m) south of the straight way."""
    return [{"name": "mast", "kind": "exclusion", "east_m": east, "north_m": -200.0 - off, "radius_m": 200.0, **levels}]


def certificate(problem: Problem, path: np.ndarray) -> Certificate:
    return certify(problem, path)


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False), (-40.0, False)])
def test_a_zone_beside_the_way(made: Made, more: float, ok: bool) -> None:
    result = certificate(made(zones=tower(CERTIFIED_ZONE_MARGIN + more)), STRAIGHT)
    assert result.ok == ok
    assert result.zone_distance == pytest.approx(CERTIFIED_ZONE_MARGIN + more, abs=1e-6)
    result = certificate(made({"across": 12.0}, zones=tower(CERTIFIED_ZONE_MARGIN + 12.0 + more)), STRAIGHT)
    assert result.ok == ok
    assert result.zone_distance == pytest.approx(CERTIFIED_ZONE_MARGIN + more, abs=1e-6)


def test_what_fails_names_the_zone_and_the_leg(made: Made) -> None:
    assert certificate(made(zones=tower(4.0)), STRAIGHT).problems == (
        "leg 0: 4.0 m from mast, 10 m or 5 m in height wanted",
    )
    assert certificate(made(zones=tower(-9.0)), STRAIGHT).problems == ("leg 0: 9.0 m inside mast",)


def test_a_zone_inside_a_turn_is_what_the_arc_comes_near(made: Made) -> None:
    """An arc of 121 m radius or more passes 50 m within the corner of 90 degrees: there stands a mast."""
    ends = {"destination": {"east_m": 3000, "north_m": 2900, "amsl_m": 150}}
    zone = {"name": "mast", "kind": "exclusion", "east_m": 2960.0, "north_m": 40.0, "radius_m": 5.0}
    problem = made(zones=[zone], **ends)
    result = certificate(problem, TURNED)
    assert result.problems[0].startswith("turn at waypoint 1")
    legs = [piece for piece in airspace_pieces(problem.certified, TURNED) if not piece["of_corner"]]
    assert all(piece["zones"]["kept"] for piece in legs)


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_a_floor_over_the_way(made: Made, more: float, ok: bool) -> None:
    result = certificate(made(zones=tower(-200.0, floor_amsl_m=150.0 + CERTIFIED_BUFFER + more)), STRAIGHT)
    assert result.ok == ok
    assert result.zone_distance == pytest.approx(CERTIFIED_BUFFER + more)


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_a_greatest_height(made: Made, more: float, ok: bool) -> None:
    path = STRAIGHT + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 30.0], [0.0, 0.0, 0.0]])
    limits = {"max_height_m": 180.0 + CERTIFIED_BUFFER + more, "min_clearance_m": 30}
    result = certificate(made(limits=limits), path)
    assert result.ok == ok
    assert result.headroom == pytest.approx(CERTIFIED_BUFFER + more, abs=1e-3)
    assert ok or "m above ground at its highest" in result.problems[0]


def test_a_flight_that_follows_late_is_high_on_the_way_down(made: Made) -> None:
    """3 s late at 25 m/s down a slope of 1 in 50 is 1.5 m high."""
    path = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 210.0], [6000.0, 0.0, 150.0]])
    limits = {"max_height_m": 300.0, "min_clearance_m": 30}
    problem = made({"lag": 3.0}, limits=limits)
    assert certificate(problem, path).headroom == pytest.approx(90.0, abs=0.2)
    pieces = airspace_pieces(problem.certified, path)
    last = [piece for piece in pieces if piece["number"] == 1 and not piece["of_corner"]][-2]
    # It ends 100 m before the destination, where the leg is at 152 m.
    begins = 152.0 + (6000.0 - 100.0 - 3000.0 - 4.0 * 75.0) / 50.0
    assert float(last["height"]) == pytest.approx(begins + 1.5, abs=0.3)


def test_the_ground_beside_the_way_is_what_a_flight_is_high_over(made: Made) -> None:
    """Midway the ground is 140 exp(-2.5^2 / 4.5) = 34.9 m high, 50 m south of it 140 exp(-2.55^2 / 4.5) = 33.0."""
    hill = {"kind": "peaks", "peak": [{"east_m": 3000, "north_m": 2500, "height_m": 140, "sigma_m": 1500}]}
    limits = {"max_height_m": 400.0, "min_clearance_m": 1}
    tables = {"terrain": hill, "limits": limits}
    exact, wide = made(**tables), made({"across": 50.0}, **tables)
    path = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 250.0], [6000.0, 0.0, 150.0]])
    assert certificate(exact, path).headroom == pytest.approx(400.0 - 250.0 + 34.9, abs=0.1)
    assert certificate(wide, path).headroom == pytest.approx(400.0 - 250.0 + 33.0, abs=0.1)


def test_without_zones_and_greatest_height_there_is_nothing_to_tell(made: Made) -> None:
    result = certificate(made(), STRAIGHT)
    assert (result.zone_distance, result.headroom) == (np.inf, np.inf)
