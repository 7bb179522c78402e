"""Units call the kernels that are counted for them, and no others; their process answers, and ends with who asks."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from planfly.commands.registry import COMMAND_NAMES
from planfly.kernel_units.unit_kernels import BOTH, COMMAND_UNITS, FLYING, PLANNING, UNIT_KERNELS, kernels_of

ROOT = Path(__file__).parents[3]
# The kernels that a process calls are those with types: all are in the cache, and what they call comes with them.
CODE = """
import json, sys
from planfly.kernel_units.ready_kernels import do_unit
said = {}
for unit in sys.argv[1:]:
    said[unit] = []
    do_unit(unit, said[unit].append)
rooms = ("aircraft", "flight", "logs", "planner", "world")
modules = [module for name, module in list(sys.modules.items()) if name.split(".")[0] in rooms]
every = [one for module in modules for one in vars(module).values() if getattr(one, "signatures", ())]
print(json.dumps([said, sorted({f"{one.py_func.__module__}.{one.py_func.__name__}" for one in every})]))
"""


def test_units_call_what_is_counted_for_them() -> None:
    done = subprocess.run([sys.executable, "-c", CODE, *BOTH], cwd=ROOT, capture_output=True, text=True, check=True)
    said, called = json.loads(done.stdout)
    for unit, lines in said.items():
        assert sorted(lines) == sorted(f"ready {name}" for name in UNIT_KERNELS[unit]), unit
    assert called == sorted(kernels_of(BOTH))


def test_units_of_commands_are_units() -> None:
    assert set(COMMAND_UNITS) <= set(COMMAND_NAMES)
    assert set(BOTH) == {*PLANNING, *FLYING} == set(UNIT_KERNELS)
    assert {unit for units in COMMAND_UNITS.values() for unit in units} == set(UNIT_KERNELS)


@pytest.fixture
def helper() -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "planfly.kernel_units"], cwd=ROOT, text=True, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )  # fmt: skip


def test_a_unit_that_fails_is_told_and_the_end_of_input_ends_the_process(helper: "subprocess.Popen[str]") -> None:
    with helper:
        assert helper.stdin is not None
        assert helper.stdout is not None
        helper.stdin.write("no-such-unit\n")
        helper.stdin.flush()
        assert helper.stdout.readline() == "failed no-such-unit\n"
        helper.stdin.close()
        assert helper.wait(10.0) == 0
