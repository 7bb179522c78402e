"""The mutation run's list: every mutant changes its source, leaves it readable, and has tests that cover it."""

import ast
from xml.etree import ElementTree

import pytest

from logs.verdict import tolerances
from tests.mutations.choice import chosen_mutants
from tests.mutations.covering import covering_tests, kernels_on
from tests.mutations.generated import BY_ORDERS, EFFORTS, limit_mutants
from tests.mutations.listed import listed_mutants
from tests.mutations.mutant import ROOT, replacing
from tests.soak import some


def test_every_mutant_changes_its_source_into_another_that_can_be_read() -> None:
    chosen = chosen_mutants(200)
    parsed = some(chosen, 20)
    for mutant in chosen:
        source = (ROOT / mutant.file).read_bytes()
        changed = mutant.applied(source)
        assert changed != source
        if not mutant.file.endswith(".py"):
            assert ElementTree.fromstring(changed) is not None
            continue
        if mutant in parsed:
            assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source)), mutant


def test_every_limit_is_tried_larger_and_smaller_but_where_more_costs_time_alone() -> None:
    found = [(mutant.start, mutant.new.split()[1]) for mutant in limit_mutants()]
    assert len(found) == len(set(found))
    larger, smaller = ({start for start, sign in found if sign in signs} for signs in ("*+", "/-"))
    assert len(larger ^ smaller) == sum(len(signs) == 1 for signs in EFFORTS.values())


@pytest.mark.parametrize("name", [*BY_ORDERS, *EFFORTS])
def test_a_limit_that_is_changed_in_its_own_way_exists(name: str) -> None:
    assert hasattr(tolerances, name)


def test_two_hundred_of_them_are_the_same_each_time_and_of_all_rooms() -> None:
    chosen = chosen_mutants(200)
    assert chosen == chosen_mutants(200)
    assert len(set(chosen)) == 200
    assert set(listed_mutants()) < set(chosen)
    assert {mutant.part for mutant in chosen} == {"limits", "rules", "measures", "physics"}


def test_a_modules_own_tests_come_first_and_its_limits_are_found_where_they_are_used() -> None:
    mutant = replacing("rules", "logs/verdict/rules/bounds_rule.py", "planned_margin >= -ROUNDING_M", "planned >= -9.0")
    own = "tests/logs/verdict/rules/test_bounds_rule.py", "tests/logs/verdict/rules/limits/test_bounds_rule_limits.py"
    assert set(own) == set(covering_tests(mutant)[0])
    # The pages state what rules rank by.
    assert covering_tests(mutant)[1:] == [["tests/logs/verdict", "tests/docs/test_pages_hold.py"]]
    reserve = replacing(
        "limits", "logs/verdict/tolerances.py", "ENERGY_RESERVE_FRACTION = 0.2", "ENERGY_RESERVE_FRACTION = 0.1"
    )
    assert "tests/logs/verdict/rules/limits/test_energy_rule_limits.py" in covering_tests(reserve)[0]
    stages = [stage for one in some(chosen_mutants(200), 66) for stage in covering_tests(one)]
    assert all((ROOT / test).exists() for stage in stages for test in stage)


def test_compiled_code_that_rests_on_what_changes_is_known() -> None:
    gusts = replacing("physics", "flight/simulation/turbulence.py", "sigma_w = 0.1 * w20", "sigma_w = 0.2 * w20")
    assert "flight/simulation/tick.py" in kernels_on(gusts)
    far = replacing("limits", "logs/verdict/tolerances.py", "SPHERE_FAR_DIAGONALS = 30.0", "SPHERE_FAR_DIAGONALS = 3.0")
    assert "logs/verdict/measures/path_sweeps.py" in kernels_on(far)
    assert "planner/evaluation/certify_kernels.py" not in kernels_on(far)
    # With those, what Python calls inner kernels by; without any, nothing.
    assert "world/kernels.py" in kernels_on(far)
    title = replacing("rules", "logs/verdict/rules/registry.py", "RULES: ", "RULES : ")
    assert kernels_on(title) == []
    assert all(isinstance(kernels_on(mutant), list) for mutant in listed_mutants())


def test_a_text_that_stands_twice_or_nowhere_is_refused() -> None:
    for text in ("import", "no such text"):
        with pytest.raises(ValueError, match="instead of once"):
            replacing("rules", "logs/verdict/rules/bounds_rule.py", text, "")
