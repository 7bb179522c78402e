"""Which algorithms keep room for an autopilot."""

import pytest

from planfly.airframe import load_airframe
from planner.search.algorithms import ALGORITHMS, find_algorithm
from planner.search.limits_for import limits_for
from world.scenario import load_scenario

# That search by the paper's counts of violations.
PAPERS = {"umda", "umda-cartesian", "umda-polar", "umda-polar-45", "umda-bearing", "de-paper"}


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_those_that_count_violations_are_the_papers_and_know_no_autopilot(name: str) -> None:
    limits = load_airframe(load_scenario("jacksboro")).limits
    assert limits.tracking is not None
    within = limits_for(find_algorithm(name, "a.toml"), limits)
    assert (within.tracking is None) == (name in PAPERS)
    assert within.max_turn == limits.max_turn
