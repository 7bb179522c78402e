"""Units are shared out to two processes, counted once each, and given up with a process that dies."""

import sys
from pathlib import Path

import pytest

from planfly.runtime import first_start
from planfly.runtime.first_start import compile_units

# Speaks as `planfly.kernel_units` does; a unit's name says what it does.
HELPER = """
import os, sys, time
for line in sys.stdin:
    unit = line.strip()
    if unit == "die":
        sys.exit(1)
    print(f"ready common\\nready {unit}", flush=True)
    open(os.path.join(os.environ["NUMBA_CACHE_DIR"], unit), "w").write(str(os.getpid()))
    time.sleep(0.3)
    print(f"failed {unit}" if unit == "bad" else f"done {unit}", flush=True)
"""


@pytest.fixture(autouse=True)
def _helper(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "helper.py"
    file.write_text(HELPER, encoding="utf-8")
    monkeypatch.setattr(first_start, "PYTHON_ARGUMENTS", (str(file),))


def test_each_unit_is_done_once_by_one_of_two_processes(tmp_path: Path) -> None:
    told: list[int] = []
    units = ["a", "bad", "c", "d"]
    compile_units(list(units), tmp_path, told.append)
    assert told == [1, 2, 3, 4, 5]
    done_by = [(tmp_path / unit).read_text(encoding="utf-8") for unit in units]
    assert len(set(done_by)) == 2
    for number in set(done_by):
        assert not Path(f"/proc/{number}").exists() or sys.platform != "linux"


def test_a_process_that_dies_leaves_its_unit_to_whoever_needs_it(tmp_path: Path) -> None:
    told: list[int] = []
    compile_units(["die", "a", "b"], tmp_path, told.append)
    assert told == [1, 2, 3]
    compile_units(["die", "die", "die"], tmp_path, told.append)
    assert told == [1, 2, 3]
