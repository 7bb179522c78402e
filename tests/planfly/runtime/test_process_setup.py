"""A process of planfly's own collects garbage seldom, and so do those that it starts; a script's own does not."""

import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

import planfly
from planfly.runtime import process_setup
from planfly.runtime.process_setup import address_space_limit, guard_imports, prepare_process, with_large_stack
from tests.soak import some
from world.address_space import AddressSpaceGuard

ROOT = Path(planfly.__file__).parents[1]

LIMIT = 480_000 * 1024

CHILD = "import gc, planfly; print(gc.get_threshold()[0])"
PARENT = f"""
import subprocess, sys
from planfly.runtime.process_setup import prepare_process
prepare_process()
print(subprocess.run([sys.executable, "-c", {CHILD!r}], capture_output=True, text=True, check=True).stdout)
"""


def threshold(code: str) -> int:
    env = {name: value for name, value in os.environ.items() if name != "PLANFLY_OWN_PROCESS"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    return int(done.stdout)


def test_only_processes_of_planflys_own_are_set_up() -> None:
    pythons_own = threshold("import gc; print(gc.get_threshold()[0])")
    assert threshold(CHILD) == pythons_own < 1_000_000
    assert threshold(PARENT) == 1_000_000


def test_a_number_of_threads_that_a_user_has_set_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    prepare_process()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"


def test_work_in_a_large_stack_returns_and_raises_as_it_does_alone() -> None:
    def depth(left: int) -> int:
        return 0 if left == 0 else 1 + depth(left - 1)

    def stack_around() -> int:
        frame, largest = sys._getframe(), 0
        while frame.f_back is not None:
            frame = frame.f_back
            largest = max(largest, frame.f_code.co_stacksize)
        return largest

    # The piece of memory that frames lie in is as large as the largest of them asks for.
    assert stack_around() < 1000 < 100_000 < with_large_stack(stack_around)
    assert with_large_stack(lambda: depth(500)) == 500
    with pytest.raises(ZeroDivisionError):
        with_large_stack(lambda: 1 // 0)


def test_only_a_process_with_a_limit_is_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    before = list(sys.meta_path)
    monkeypatch.setattr(sys, "meta_path", list(before))
    monkeypatch.setattr(process_setup, "address_space_limit", lambda: None)
    guard_imports()
    assert sys.meta_path == before
    monkeypatch.setattr(process_setup, "address_space_limit", lambda: LIMIT)
    for _ in range(2):
        guard_imports()
    assert [type(one) for one in sys.meta_path[:2]] == [AddressSpaceGuard, type(before[0])]


def test_the_limit_is_the_systems(monkeypatch: pytest.MonkeyPatch) -> None:
    for given, found in (((LIMIT, resource.RLIM_INFINITY), LIMIT), ((resource.RLIM_INFINITY,) * 2, None)):
        monkeypatch.setattr(resource, "getrlimit", lambda _, given=given: given)
        assert address_space_limit() == found


SCRIPTS = {
    "campaign": "planfly.campaign('p.json', flights=1, workers=1)",
    "paper": "planfly.paper_tables((7,), runs=2, jobs=2)",
    "serve": "planfly.serve('p.json', bind='127.0.0.1:0')",
}


@pytest.mark.parametrize("name", some(SCRIPTS, 2))
def test_a_script_without_its_guard_is_one_error_that_names_the_line(name: str, tmp_path: Path) -> None:
    """Its processes import it, and end without a word instead of starting others."""
    planfly.plan("tight", seed=1, out=tmp_path / "p.json")
    (tmp_path / "mine.py").write_text(f"import planfly\n{SCRIPTS[name]}\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "mine.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1, done.stderr
    line = done.stderr.splitlines()[-1]
    assert re.match(r"world\.errors\.PlanflyError: .*mine\.py: .*`if __name__ == \"__main__\":`", line)
