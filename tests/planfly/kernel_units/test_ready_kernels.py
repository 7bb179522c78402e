"""A process that does units answers, and ends with who asks."""

import subprocess
import sys
from pathlib import Path

import pytest

from planfly.kernel_units import ready_kernels
from planfly.kernel_units.ready_kernels import do_unit, is_ready
from world.compilation.announcement import kernel_is_compiled

ROOT = Path(__file__).parents[3]


def test_kernels_are_told_once_as_soon_as_they_are_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    ready: set[str] = set()

    def work() -> None:
        for name in ("first", "second", "third"):
            kernel_is_compiled()
            ready.add(name)
            told.append(name)

    told: list[str] = []
    monkeypatch.setattr(ready_kernels, "UNIT_KERNELS", {"unit": ("third", "first")})
    monkeypatch.setattr(ready_kernels, "UNITS", {"unit": work})
    monkeypatch.setattr(ready_kernels, "is_ready", ready.__contains__)
    do_unit("unit", told.append)
    assert told == ["first", "ready first", "second", "third", "ready third"]


def test_a_kernel_is_ready_once_it_has_been_called() -> None:
    import numpy as np

    from world.terrain import steepest_slopes

    steepest_slopes(np.zeros((2, 2), np.float32), 1.0)
    assert is_ready("world.terrain.steepest_slopes")
    assert not is_ready("world.airspace.zone_kernels.inside_share")


def test_a_unit_that_fails_is_told_and_the_end_of_input_ends_the_process() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "planfly.kernel_units"], cwd=ROOT, text=True, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as helper:  # fmt: skip
        assert helper.stdin is not None
        assert helper.stdout is not None
        helper.stdin.write("no-such-unit\n")
        helper.stdin.flush()
        assert helper.stdout.readline() == "failed no-such-unit\n"
        helper.stdin.close()
        assert helper.wait(10.0) == 0
