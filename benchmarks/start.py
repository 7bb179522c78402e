"""Measure start times: of the first start after an installation, and of a new process with cached kernels.

Wall-clock times are valid only on an idle machine; CPU times include all processes, also compiling ones.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

# Number of repetitions.
ROUNDS = 5
# Largest wall-clock time of a first start on two idle cores, s.
MAX_COLD = 30.0
# Largest CPU time to a first safe path in a new process, s.
MAX_WARM = 1.2
# Commands of a first start.
COLD = {
    "planfly plan jacksboro-air": ("plan", "jacksboro-air", "--seed", "1", "--out", "plan.json"),
    "planfly run jacksboro-air": ("run", "jacksboro-air", "--seed", "1", "--out", "run"),
}
# Program of a first safe path; it exits at once, as the shutdown of the interpreter is not measured.
FIRST_SAFE = """
import os
from planfly.runtime.process_setup import prepare_process
prepare_process()
from planfly.workflow.uav import load_uav
from planner.search.plan_path import plan_path
from world.scenario import load_scenario
scenario = load_scenario("jacksboro-air")
plan = plan_path(scenario, load_uav(scenario).limits, seed=1, first_safe=True)
os._exit(not plan.safe)
"""


class Spent(NamedTuple):
    """Wall-clock time, and CPU time of all cores, s."""

    wall: float
    cpu: float


def spent_on(arguments: tuple[str, ...], folder: Path, **environment: str) -> Spent:
    """Measure a Python process and its children.

    Raises CalledProcessError for a failure other than a verdict.
    """
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=os.environ | environment, capture_output=True, check=False
    )
    if done.returncode not in (0, 4):
        raise subprocess.CalledProcessError(done.returncode, arguments, done.stdout, done.stderr)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return Spent(time.perf_counter() - began, cpu)


def run() -> dict[str, dict[str, float]]:
    """Measure, print a table, and return it."""
    print("\nstarting, s by the clock; CPU s of all processes")
    record: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for title, command in COLD.items():
            cache = folder / f"kernels-{command[0]}"
            spent = spent_on(("-m", "planfly", *command), folder, NUMBA_CACHE_DIR=str(cache))
            record[f"{title}, empty cache"] = spent._asdict()
            print(f"  {title}, empty cache: {spent.wall:.1f} (at most {MAX_COLD:g}); {spent.cpu:.1f}")
        cache = folder / "kernels-plan"
        warm = [spent_on(("-c", FIRST_SAFE), folder, NUMBA_CACHE_DIR=str(cache)) for _ in range(ROUNDS + 1)][1:]
        spent = Spent(statistics.median(one.wall for one in warm), statistics.median(one.cpu for one in warm))
        title = "a first safe path of jacksboro-air, full cache"
        record[title] = spent._asdict()
        print(f"  {title}: {spent.wall:.2f}; {spent.cpu:.2f} (at most {MAX_WARM:g})")
    return record
