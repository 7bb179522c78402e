from dataclasses import replace

import numpy as np
import pytest

from flight.mission.return_path import ReturnCircle
from flight.mission.route import part_of_route
from flight.simulation.setup import FlightSetup, ImportedLog, MissionStretch
from logs.recording.example_log import example_log
from logs.verdict.imported.flown_legs import flown_legs, plan_mismatch
from logs.verdict.tolerances import PARTIAL_LEG_MIN_S, PLAN_MISMATCH_DISTANCE_M
from tests.setups import route_along
from tests.synthetic import fly_path, make_setup

LOG = example_log()
# The turn is passed at 20 s, the end at 36.5 s.
TURN = 20.0


def legs(start: float, end: float) -> tuple[int, int, bool] | None:
    found = flown_legs(LOG.setup, LOG.track, MissionStretch(start, end, "AUTO", "log"))
    return None if found is None else (found.first, found.last, found.partial)


def test_the_whole_route() -> None:
    assert legs(0.0, 36.5) == (0, 2, False)


def test_a_stretch_that_goes_on_has_flown_a_part_of_the_next_leg() -> None:
    assert legs(0.0, TURN + PARTIAL_LEG_MIN_S - 0.2) == (0, 1, False)
    assert legs(0.0, TURN + PARTIAL_LEG_MIN_S + 0.2) == (0, 2, True)


def test_what_was_flown_to_the_first_waypoint_is_no_leg() -> None:
    assert legs(10.0, 36.5) == (1, 2, False)


def test_a_stretch_between_waypoints_has_no_leg() -> None:
    assert legs(5.0, 12.0) is None
    assert legs(5.0, 5.05) is None


def test_a_part_of_a_route_keeps_what_belongs_to_its_waypoints() -> None:
    route = LOG.setup.route
    part = part_of_route(route, 1, 2)
    assert part.positions.tolist() == route.positions[1:].tolist()
    assert (part.legs, part.items.tolist()) == (1, route.items[1:].tolist())
    assert part_of_route(route, 0, 2) is route
    back = replace(route, rtl_start=1, rtl_loiter=ReturnCircle(0.0, 0.0, 400.0, 80.0))
    assert (part_of_route(back, 1, 2).rtl_start, part_of_route(back, 1, 2).rtl_loiter) == (0, back.rtl_loiter)
    assert (part_of_route(back, 0, 1).rtl_start, part_of_route(back, 0, 1).rtl_loiter) == (None, None)


def test_a_flight_that_ends_in_its_first_lap_has_flown_none_of_the_second() -> None:
    """Three corners of a triangle, twice: what was near to a corner once was near to it on every lap."""
    corners = [(0.0, 0.0, 300.0), (0.0, 1500.0, 300.0), (1500.0, 1500.0, 300.0)]
    setup = make_setup([*corners, *corners, *corners])
    laps = replace(setup, route=setup.route.with_fields(item=np.array([1, 2, 3] * 3)))
    # To the last corner, and ten seconds on along the same course.
    track = fly_path(make_setup([*corners, (4000.0, 1500.0, 300.0)]), stop=3400.0)
    found = flown_legs(laps, track, MissionStretch(0.0, 1e4, "AUTO", "log"))
    assert found is not None
    assert (found.first, found.last, found.partial) == (0, 3, True)


SETUP = replace(LOG.setup, imported_log=ImportedLog("a", "", "", stretches=(MissionStretch(0.0, 36.5, "AUTO", "log"),)))


def along(waypoints: list[list[float]]) -> FlightSetup:
    return replace(SETUP, route=route_along(waypoints, 25.0))


def test_its_own_plan_is_no_other() -> None:
    assert plan_mismatch(SETUP, LOG.track) is None


@pytest.mark.parametrize(("beside", "kind"), [(-1.0, None), (1.0, "place")])
def test_another_place_is_farther_than_a_kilometre(beside: float, kind: str | None) -> None:
    # The flight's nearest is its first leg, on the line north = 0.
    north = -(PLAN_MISMATCH_DISTANCE_M + beside)
    found = plan_mismatch(along([[-500.0, north, 200.0], [-200.0, north, 200.0], [0.0, north, 200.0]]), LOG.track)
    assert (None if found is None else found.reason) == kind


def test_the_same_places_the_other_way_round() -> None:
    way = [[300.0, 75.0, 215.0], [100.0, 25.0, 205.0], [-100.0, 0.0, 200.0], [-300.0, 0.0, 200.0]]
    found = plan_mismatch(along(way), LOG.track)
    assert found is not None
    assert (found.reason, found.order) == ("order", (3, 2, 1, 0))
    assert found.text == "the flight passed its items in another order: 3, 2, 1, 0, ..."
    assert plan_mismatch(along(way[::-1]), LOG.track) is None


@pytest.mark.parametrize(("beside", "kind"), [(-1.0, "order"), (1.0, None)])
@pytest.mark.parametrize(
    ("corridor", "near"), [(10.0, 50.0), (49.0, 50.0), (100.0, 100.0), (151.0, 150.0), (400.0, 150.0)]
)
def test_a_waypoint_is_passed_within_the_corridor_but_50_to_150_m(
    corridor: float, near: float, beside: float, kind: str | None
) -> None:
    # South of the flight's first leg, from east to west, where the flight went from west to east.
    way = [[east, -(near + beside), 200.0] for east in (-50.0, -200.0, -350.0, -450.0)]
    scenario = SETUP.scenario
    limits = scenario.limits.model_copy(update={"corridor_m": corridor})
    spec = scenario.spec.model_copy(update={"limits": limits})
    found = plan_mismatch(along(way).in_scenario(replace(scenario, spec=spec, limits=limits)), LOG.track)
    assert (None if found is None else found.reason) == kind


@pytest.mark.parametrize(("in_order", "kind"), [(8, None), (7, "order")])
def test_four_fifths_of_the_passed_waypoints_are_in_the_plans_order(in_order: int, kind: str | None) -> None:
    """Of ten, the plan begins with the flight's last ones, at its end; the others are on the flight's first leg."""
    last = [[400.0 - 20.0 * k, 100.0 - 5.0 * k, 200.0] for k in range(10 - in_order)]
    way = [*last, *([-480.0 + 50.0 * k, 0.0, 200.0] for k in range(in_order))]
    found = plan_mismatch(along(way), LOG.track)
    assert (None if found is None else found.reason) == kind


def test_a_flight_that_went_home_half_way_is_not_another_plan() -> None:
    way = [[-500.0, 0.0, 200.0], [-200.0, 0.0, 200.0], [0.0, 0.0, 200.0], [3000.0, 0.0, 200.0], [6000.0, 0.0, 200.0]]
    assert plan_mismatch(along(way), LOG.track) is None


def test_without_stretches_nothing_is_said() -> None:
    assert plan_mismatch(replace(SETUP, imported_log=ImportedLog("a", "", "")), LOG.track) is None
    assert plan_mismatch(SETUP, LOG.track.rows(0, 0)) is None
    assert np.isfinite(LOG.track.position).all()
