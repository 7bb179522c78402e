"""What planning loads in a new process, and that numba's linear algebra is left as it was."""

import json
import subprocess
import sys

import pytest

_PLANNING = """
import json, sys
import planfly.commands.plan
print(json.dumps([name for name in sys.argv[1:] if name in sys.modules]))
"""
_DOT = """
import world.kernels
import numba
import numpy as np

@numba.njit
def dot(a, b):
    return np.dot(a, b)

print(dot(np.eye(3), np.full((3, 3), 2.0)).sum())
"""
HEAVY = (
    "scipy.linalg",
    "pyproj",
    "logs.recording.reader",
    "logs.recording.recorder",
    "matplotlib",
    "mcap",
    "pymavlink",
    "rasterio",
)


def output(code: str, *arguments: str) -> str:
    done = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    return done.stdout


def test_planning_loads_neither_logs_nor_what_it_does_not_use() -> None:
    assert json.loads(output(_PLANNING, "planner.search.plan_path", *HEAVY)) == ["planner.search.plan_path"]


def test_other_peoples_kernels_still_have_linear_algebra() -> None:
    assert float(output(_DOT)) == pytest.approx(18.0)
