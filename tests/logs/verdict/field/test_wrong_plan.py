from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.field_source import FieldSource, MissionStretch
from flight.simulation.flight_setup import FlightSetup
from logs.recording.example_log import example_log
from logs.verdict.field.wrong_plan import plan_mismatch
from logs.verdict.tolerances import ANOTHER_PLACE
from tests.setups import route_along

LOG = example_log()
SETUP = replace(LOG.setup, source=FieldSource("a", "", "", stretches=(MissionStretch(0.0, 36.5, "AUTO", "log"),)))


def along(waypoints: list[list[float]]) -> FlightSetup:
    return replace(SETUP, route=route_along(waypoints, 25.0))


def test_its_own_plan_is_no_other() -> None:
    assert plan_mismatch(SETUP, LOG.track) is None


@pytest.mark.parametrize(("beside", "kind"), [(-1.0, None), (1.0, "place")])
def test_another_place_is_farther_than_a_kilometre(beside: float, kind: str | None) -> None:
    # The flight's nearest is its first leg, on the line north = 0.
    north = -(ANOTHER_PLACE + beside)
    found = plan_mismatch(along([[-500.0, north, 200.0], [-200.0, north, 200.0], [0.0, north, 200.0]]), LOG.track)
    assert (None if found is None else found.kind) == kind


def test_the_same_places_the_other_way_round() -> None:
    way = [[300.0, 75.0, 215.0], [100.0, 25.0, 205.0], [-100.0, 0.0, 200.0], [-300.0, 0.0, 200.0]]
    found = plan_mismatch(along(way), LOG.track)
    assert found is not None
    assert (found.kind, found.order) == ("order", (3, 2, 1, 0))
    assert found.text == "another order: the flight passed its items in the order 3, 2, 1, 0, ..."
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
    assert (None if found is None else found.kind) == kind


def test_a_flight_that_went_home_half_way_is_not_another_plan() -> None:
    way = [[-500.0, 0.0, 200.0], [-200.0, 0.0, 200.0], [0.0, 0.0, 200.0], [3000.0, 0.0, 200.0], [6000.0, 0.0, 200.0]]
    assert plan_mismatch(along(way), LOG.track) is None


def test_without_stretches_nothing_is_said() -> None:
    assert plan_mismatch(replace(SETUP, source=FieldSource("a", "", "")), LOG.track) is None
    assert plan_mismatch(SETUP, LOG.track.rows(0, 0)) is None
    assert np.isfinite(LOG.track.position).all()
