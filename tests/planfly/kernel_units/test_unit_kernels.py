"""Every command's units are there, and every unit is some command's."""

from planfly.commands.registry import COMMAND_NAMES
from planfly.kernel_units.ready_kernels import UNITS
from planfly.kernel_units.unit_kernels import BOTH, COMMAND_UNITS, FLYING, PLANNING, UNIT_KERNELS
from planner.search.kernel_calls import PARTS


def test_units_of_commands_are_units() -> None:
    assert set(COMMAND_UNITS) <= set(COMMAND_NAMES)
    assert set(BOTH) == {*PLANNING, *FLYING} == set(UNIT_KERNELS) == set(UNITS)
    assert set(PLANNING) == set(PARTS)
    assert {unit for units in COMMAND_UNITS.values() for unit in units} == set(UNIT_KERNELS)
