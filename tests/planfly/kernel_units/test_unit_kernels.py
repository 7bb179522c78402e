"""Every unit of kernels is one that planning or flying calls."""

from planfly.kernel_units.ready_kernels import UNITS
from planfly.kernel_units.unit_kernels import BOTH, FLYING, GLIDING, PLANNING, UNIT_KERNELS
from planner.search.kernel_calls import PARTS


def test_planning_and_flying_call_all_units() -> None:
    assert set(BOTH) == {*PLANNING, *FLYING}
    assert {*BOTH, *GLIDING} == set(UNIT_KERNELS) == set(UNITS)
    assert {*PLANNING, "flight"} == set(BOTH) == {"problem", "tracking", "ranks", "flight", *PARTS}
