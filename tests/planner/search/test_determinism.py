"""The same plan, byte for byte, whatever the number of threads, the hash seed and the features of the processor.

All changes at once; each by itself with PLANFLY_SOAK=1.
"""

import contextlib
import hashlib
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kernels.processors import NUMPY_ON_BASELINE_CPU
from tests.soak import SOAK

ROOT = Path(__file__).parents[3]
SCRIPT = """
import hashlib
from planfly.workflow.make_plan import make_plan
from planfly.workflow.uav import load_uav
from planner.plan import plan_json
from world.scenario import load_scenario
for name in NAMES:
    scenario = load_scenario(name)
    print(hashlib.sha256(plan_json(make_plan(scenario, load_uav(scenario), 7)).encode()).hexdigest())
"""
NAMES = ("hard-07", "jacksboro-air", "paper-07") if SOAK else ("hard-07",)


def hashes(**changes: str) -> str:
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | changes
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", f"NAMES = {NAMES}\n{SCRIPT}"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


@pytest.fixture(scope="module")
def plain() -> str:
    with contextlib.redirect_stdout(io.StringIO()) as here:
        exec(SCRIPT, {"NAMES": NAMES})
    found = here.getvalue()
    assert len(found.split()) == len(NAMES)
    assert len(found.split()[0]) == len(hashlib.sha256().hexdigest())
    return found


EACH = {
    "threads 1, hash seed 1": {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "1"},
    "threads 2, hash seed 2": {"NUMBA_NUM_THREADS": "2", "OMP_NUM_THREADS": "2", "PYTHONHASHSEED": "2"},
    "threads 4": {"NUMBA_NUM_THREADS": "4", "OMP_NUM_THREADS": "4", "OPENBLAS_NUM_THREADS": "4"},
    "NumPy as on its least processor": NUMPY_ON_BASELINE_CPU,
    "an older OpenBLAS core": {"OPENBLAS_CORETYPE": "Nehalem"},
    "a C library without AVX2 and FMA": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4"},
}
# A plan that one change moves is moved with the others, too.
AT_ONCE = {name: value for changes in EACH.values() for name, value in changes.items()}
CASES = EACH if SOAK else {"all at once": AT_ONCE}


@pytest.mark.parametrize("case", CASES)
def test_plan_is_the_same(plain: str, case: str) -> None:
    assert hashes(**CASES[case]) == plain


@pytest.mark.skipif(not SOAK, reason="compiles everything for another processor; set PLANFLY_SOAK=1")
def test_plan_is_the_same_with_kernels_for_any_processor(plain: str, tmp_path: Path) -> None:
    """Without vectors wider than two numbers, and without fused multiplications."""
    for features in ({}, {"NUMBA_CPU_FEATURES": ""}):
        cache = {"NUMBA_CACHE_DIR": str(tmp_path / f"kernels{len(features)}")}
        assert hashes(NUMBA_CPU_NAME="generic", **features, **cache) == plain
