"""Every unit of kernels is one that planning or flying calls."""

from planfly.kernel_units.ready_kernels import UNITS
from planfly.kernel_units.unit_kernels import BOTH, CHOOSING, FLYING, GLIDING, PLANNING, UNIT_KERNELS
from planner.search.kernel_calls import FRONT, PARTS


def test_planning_and_flying_call_all_units() -> None:
    assert set(BOTH) == {*PLANNING, *FLYING}
    assert {*BOTH, *GLIDING, *CHOOSING} == set(UNIT_KERNELS) == set(UNITS)
    assert {*PLANNING, "flight"} == set(BOTH) == {"problem", "tracking", "ranks", "flight", *PARTS}


def test_a_choice_of_plans_calls_its_own_units_beside_those_of_a_plan() -> None:
    """A first plan does not wait for them."""
    assert set(CHOOSING) - set(PLANNING) == {FRONT}
    assert set(PLANNING) < set(CHOOSING)
    assert FRONT not in BOTH
