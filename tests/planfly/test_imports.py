"""What planning loads in a new process."""

import json
import subprocess
import sys

_PLANNING = """
import json, sys
import planfly.api.planning, planfly.commands.plan
print(json.dumps([name for name in sys.argv[1:] if name in sys.modules]))
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
