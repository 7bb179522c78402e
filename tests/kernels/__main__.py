"""``python -m tests.kernels``: compile what most tests run, once, before each of pytest's workers would.

First what a first start compiles, in the same two processes; then the planner's other kernels in one process, and those
of other flights, verdicts and reports in another: they are not each other's.  Beside them all tests are read, so that
Python's own bytecode of them is kept too.  All stay in the cache for all later processes, with a note of the sources
that they were compiled for: with the same sources nothing is done a second time.  What tests call with types, or in
parts, that no command has, they compile themselves: such files come first (conftest.py).
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from planfly.kernel_units.ready_kernels import MISSION_TEXT
from planfly.kernel_units.unit_kernels import GLIDING, PLANNING_AND_FLYING
from planfly.runtime.first_start import compile_units
from planfly.runtime.process_setup import prepare_process, with_large_stack
from planner.search.kernel_calls import FRONT
from tests.kernels import note_of_compiled
from world.kernels import cache_folder

# Over which the climb and the corner of MISSION lead.
FIELD = """name = "field"
[terrain]
kind = "flat"
amsl_m = 0
[area]
east_m = [-3000, 3000]
north_m = [-3000, 3000]
ceiling_amsl_m = 600
[start]
east_m = 0
north_m = 0
height_m = 100
[destination]
east_m = 500
north_m = 0
height_m = 100
[[threats]]
name = "post"
east_m = 2000
north_m = -2000
amsl_m = 50
kill_radius_m = 100
kill_scale_m = 50
[wind]
speed_mps = 3
from_deg = 250
turbulence = "light"
[limits]
min_clearance_m = 50
max_height_m = 400
[[zones]]
name = "round"
kind = "exclusion"
east_m = -1500
north_m = 0
radius_m = 200
[[zones]]
name = "square"
kind = "exclusion"
polygon_m = [[1000, -1000], [1400, -1000], [1400, -600], [1000, -600]]
floor_agl_m = 60
"""
FLY = ("fly", "field.waypoints", "--scenario", "field.toml", "--overwrite")
# Commands one after the other, of each process.
PROCESSES = (
    (
        ("plan", "tight", "--out", "tight.json"),
        ("plan", "field.toml", "--out", "field.json"),
        ("plan", "trap-u", "--out", "trap.json"),
    ),
    (
        (*FLY, "--log", "ardupilot.mcap"),
        (*FLY, "--log", "path.mcap", "--guidance", "path"),
        (*FLY, "--log", "l1.mcap", "--guidance", "l1"),
        (*FLY, "--log", "field.mcap", "--guidance", "vector-field"),
        (*FLY, "--log", "px4.mcap", "--autopilot", "px4"),
        ("replay", "path.mcap"),
        ("report", "path.mcap", "--out", "report"),
    ),
)
ROOT = Path(__file__).parents[2]
PYTEST = (sys.executable, "-m", "pytest", "-q")


def main() -> int:
    """Run them; 1 where a command fails otherwise than by its verdict."""
    if len(sys.argv) > 1:
        return _run(PROCESSES[int(sys.argv[1])])
    done = note_of_compiled()
    if done.exists():
        return 0
    with tempfile.TemporaryDirectory(prefix="planfly-kernels-") as name:
        folder = Path(name)
        (folder / "field.toml").write_text(FIELD, encoding="utf-8")
        (folder / "field.waypoints").write_text(MISSION_TEXT, encoding="utf-8")
        # The longest of what is beside each other, and no kernel's.
        reading = subprocess.Popen([*PYTEST, "-n", "0", "--collect-only"], cwd=ROOT)
        compile_units([*PLANNING_AND_FLYING, *GLIDING, FRONT], cache_folder(), lambda _: None)
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        command = [sys.executable, "-m", "tests.kernels"]
        started = [subprocess.Popen([*command, str(k)], cwd=folder, env=environment) for k in range(len(PROCESSES))]
        failed = max(one.wait() for one in started)
        reading.wait()
    if not failed:
        done.touch()
    return failed


def _run(commands: tuple[tuple[str, ...], ...]) -> int:
    from planfly.cli import main as planfly

    prepare_process()
    return int(any(with_large_stack(lambda argv=argv: planfly(list(argv))) not in (0, 4) for argv in commands))


if __name__ == "__main__":
    sys.exit(main())
