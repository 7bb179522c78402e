"""Units call the kernels that are counted for them, and no others."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from planfly.kernel_units import ready_kernels
from planfly.kernel_units.ready_kernels import is_ready, run_unit
from planfly.kernel_units.unit_kernels import (
    FRONT_PLANNING,
    GLIDING,
    PLANNING_AND_FLYING,
    UNIT_KERNELS,
    list_unit_kernels,
)
from world.compile_events import announce_compilation
from world.kernels import compiled

ROOT = Path(__file__).parents[3]
# The kernels that a process calls are those with types, where all are in the cache: what they call comes with them.
CODE = """
import json, sys
from planfly.kernel_units.ready_kernels import run_unit
said = {}
for unit in sys.argv[1:]:
    said[unit] = []
    run_unit(unit, said[unit].append)
rooms = ("aircraft", "flight", "logs", "planner", "world")
modules = [module for name, module in list(sys.modules.items()) if name.split(".")[0] in rooms]
every = [one for module in modules for one in vars(module).values() if getattr(one, "signatures", ())]
missed = sum(sum(one.stats.cache_misses.values()) for one in every)
print(json.dumps([missed, said, sorted({f"{one.py_func.__module__}.{one.py_func.__name__}" for one in every})]))
"""


def test_units_call_what_is_counted_for_them() -> None:
    missed = 1
    while missed:
        done = subprocess.run(
            [sys.executable, "-c", CODE, *PLANNING_AND_FLYING, *GLIDING, *FRONT_PLANNING],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        )
        missed, said, called = json.loads(done.stdout)
    for unit, lines in said.items():
        assert sorted(lines) == sorted(f"ready {name}" for name in UNIT_KERNELS[unit]), unit
    assert called == sorted(list_unit_kernels((*PLANNING_AND_FLYING, *GLIDING, *FRONT_PLANNING)))


# ----------------------------------------------------------------------
# A process that does units answers, and ends with who asks.


def test_kernels_are_told_once_as_soon_as_they_are_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    ready: set[str] = set()

    def work() -> None:
        for name in ("first", "second", "third"):
            announce_compilation()
            ready.add(name)
            told.append(name)

    told: list[str] = []
    monkeypatch.setattr(ready_kernels, "UNIT_KERNELS", {"unit": ("third", "first")})
    monkeypatch.setattr(ready_kernels, "UNITS", {"unit": work})
    monkeypatch.setattr(ready_kernels, "is_ready", ready.__contains__)
    run_unit("unit", told.append)
    assert told == ["first", "ready first", "second", "third", "ready third"]


@compiled
def _never_called(number: float) -> float:
    return number


def test_a_kernel_is_ready_once_it_has_been_called() -> None:
    import numpy as np

    from world.terrain import steepest_slopes

    steepest_slopes(np.zeros((2, 2), np.float32), 1.0)
    assert is_ready("world.terrain.steepest_slopes")
    assert not is_ready(f"{__name__}._never_called")


def test_a_unit_that_fails_is_told_and_the_end_of_input_ends_the_process() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "planfly.kernel_units"],
        cwd=ROOT,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as helper:
        assert helper.stdin is not None
        assert helper.stdout is not None
        helper.stdin.write("no-such-unit\n")
        helper.stdin.flush()
        assert helper.stdout.readline() == "failed no-such-unit\n"
        helper.stdin.close()
        assert helper.wait(10.0) == 0
