"""Every unit of kernels is one that planning or flying calls."""

from importlib import import_module

import pytest

from planfly.kernel_units.ready_kernels import UNITS
from planfly.kernel_units.unit_kernels import (
    FLYING,
    FRONT_PLANNING,
    GLIDING,
    PLANNING,
    PLANNING_AND_FLYING,
    UNIT_KERNELS,
)
from planner.search.kernel_calls import FRONT, PARTS


def test_planning_and_flying_call_all_units() -> None:
    assert set(PLANNING_AND_FLYING) == {*PLANNING, *FLYING}
    assert {*PLANNING_AND_FLYING, *GLIDING, *FRONT_PLANNING} == set(UNIT_KERNELS) == set(UNITS)
    assert {*PLANNING, "flight"} == set(PLANNING_AND_FLYING) == {"problem", "tracking", "ranks", "flight", *PARTS}


def test_a_choice_of_plans_calls_its_own_units_beside_those_of_a_plan() -> None:
    """A first plan does not wait for them."""
    assert set(FRONT_PLANNING) - set(PLANNING) == {FRONT}
    assert set(PLANNING) < set(FRONT_PLANNING)
    assert FRONT not in PLANNING_AND_FLYING


@pytest.mark.parametrize("unit", UNIT_KERNELS)
def test_every_counted_kernel_exists_by_its_name(unit: str) -> None:
    """A renamed function leaves its old name in a list of strings, where no checker finds it."""
    for kernel in UNIT_KERNELS[unit]:
        module, _, name = kernel.rpartition(".")
        assert hasattr(import_module(module), name), kernel
