"""The algorithms that may be named: each whole, the default among them, and no other."""

import pytest

from planfly.workflow.uav import load_uav
from planner.evaluation.encoding import ENCODINGS
from planner.search.algorithms import ALGORITHMS, DEFAULT, algorithm_lines, find_algorithm, limits_for
from world.errors import ScenarioError
from world.scenario import load_scenario


def test_each_is_found_by_its_own_name_and_the_default_without_one() -> None:
    for name in ALGORITHMS:
        assert find_algorithm(name, "x").name == name
    assert find_algorithm(None, "x") is ALGORITHMS[DEFAULT]


@pytest.mark.parametrize("name", ["", "UMDA", "umda ", "annealing"])
def test_an_unknown_name_is_refused_with_those_there_are(name: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        find_algorithm(name, "s.toml")
    assert str(caught.value).startswith(f"s.toml: planner.algorithm: {name!r}: unknown; allowed: ")
    assert f"allowed: {', '.join(ALGORITHMS)}" in str(caught.value)


def test_each_has_an_encoding_that_there_is() -> None:
    assert {item.encoding for item in ALGORITHMS.values()} == set(ENCODINGS)


def test_no_two_search_alike() -> None:
    ways = [(item.encoding, item.graded, item.smooth, item.seeded, item.optimiser) for item in ALGORITHMS.values()]
    assert len(set(ways)) == len(ways)


def test_what_a_name_promises_it_does() -> None:
    for name, item in ALGORITHMS.items():
        assert item.seeded == name.endswith("-seeded"), name
    # The paper's own planner and its baselines count violations on six points a leg and know no seeds.
    for name in ("umda", "umda-cartesian", "umda-polar", "umda-polar-45", "umda-bearing", "de-paper"):
        item = ALGORITHMS[name]
        assert (item.graded, item.smooth, item.seeded) == (False, False, False), name


def test_each_has_a_line_for_people() -> None:
    lines = algorithm_lines().splitlines()
    assert [line.split()[0] for line in lines] == list(ALGORITHMS)
    assert all(line.endswith(item.summary) for line, item in zip(lines, ALGORITHMS.values(), strict=True))
    assert len({line.index(item.summary) for line, item in zip(lines, ALGORITHMS.values(), strict=True)}) == 1


# ----------------------------------------------------------------------
# Which algorithms keep room for an autopilot.

# That search by the paper's counts of violations.
PAPERS = {"umda", "umda-cartesian", "umda-polar", "umda-polar-45", "umda-bearing", "de-paper"}


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_those_that_count_violations_are_the_papers_and_know_no_autopilot(name: str) -> None:
    limits = load_uav(load_scenario("jacksboro-air")).limits
    assert limits.tracking is not None
    within = limits_for(find_algorithm(name, "a.toml"), limits)
    assert (within.tracking is None) == (name in PAPERS)
    assert within.max_turn == limits.max_turn
