"""Makes ``best_known.json``: the best certified path of four methods for each problem of the hard set.

``python -m tests.authorities.make_best_known [NN ...] [planfly] [cmaes] [ompl] [slsqp]`` runs, for each problem: our
default planner with 20 times the paper's population, seeds 1 and 2; CMA-ES in the smooth basis from our coarse seeds,
4 seeds, 5 times the paper's budget; OMPL's Informed RRT* for 60 s of CPU; SciPy's SLSQP from 40 ways over a lattice and
4 plans that know no grids, 100 times the default's CPU time or more (`benchmarks.planning.smooth_search`).  A path
that is already in the file stays unless a certified one is shorter.
"""

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.peers import Found, solve_with_cmaes, solve_with_ompl
from benchmarks.planning.smooth_search import smooth_search
from benchmarks.task import PROBLEMS, Task, is_safe, make_task, with_planner
from planfly.workflow.make_plan import make_plan
from planner.plan import Objective

FILE = Path(__file__).with_name("best_known.json")
MORE, OURS, SEEDS, RRT_SECONDS = 20, (1, 2), (1, 2, 3, 4), 60.0
METHODS = ("planfly", "cmaes", "ompl", "slsqp")
WAYS, PLANS = 40, 4


def candidates(task: Task, methods: Sequence[str]) -> Iterator[tuple[str, list[list[float]], float, bool]]:
    """How each path was got, the path, its length ratio, and whether it is certified and safe."""
    larger = with_planner(task.scenario, population=MORE * task.scenario.planner.population)
    for seed in OURS if "planfly" in methods else ():
        plan = make_plan(larger, task.uav, seed)
        how = f"planfly {plan.algorithm}, population x {MORE}, seed {seed}, {plan.evaluations} evaluations"
        yield how, plan.waypoints.tolist(), float(plan.objectives[Objective.LENGTH_RATIO]), plan.safe
    for seed in SEEDS if "cmaes" in methods else ():
        found = solve_with_cmaes(task, seed, 5 * task.evaluations)
        yield f"cmaes in the smooth basis, seeded, seed {seed}, {found.checks} evaluations", *_path_of(found)
    if "ompl" in methods:
        found = solve_with_ompl(task, 1, RRT_SECONDS)
        yield f"ompl InformedRRTstar, seed 1, {found.seconds:.0f} s, {found.checks} motions checked", *_path_of(found)
    if "slsqp" in methods:
        yield from _shortened(task)


def _shortened(task: Task) -> Iterator[tuple[str, list[list[float]], float, bool]]:
    """The same of what SLSQP makes of ways over a lattice."""
    ratio, path = smooth_search(task, WAYS, PLANS)
    if path is not None:
        yield f"slsqp from {WAYS} ways over a lattice and {PLANS} plans", path.tolist(), ratio, True


def _path_of(found: Found) -> tuple[list[list[float]], float, bool]:
    """Path, ratio and whether it is safe."""
    return found.path, found.length_ratio, found.safe


def main() -> None:
    """Write the file again, problem by problem."""
    known = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    methods = [text for text in sys.argv[1:] if text in METHODS] or METHODS
    for number in [int(text) for text in sys.argv[1:] if text.isdecimal()] or PROBLEMS:
        name = f"hard-{number:02d}"
        task = make_task(name)
        entry = known.get(name, {"length_ratio": np.inf})
        tried = {key: value for key, value in entry.pop("tried", {}).items() if key.split()[0] not in methods}
        for how, path, ratio, safe in candidates(task, methods):
            certificate = task.certificate(np.array(path))
            tried[how] = round(ratio, 6) if safe else f"not certified: {'; '.join(certificate.problems)[:120]}"
            sys.stdout.write(f"{name}: {how}: {tried[how]}\n")
            sys.stdout.flush()
            if how == entry.get("how") and ratio != entry["length_ratio"]:
                # The same search of an older revision, from other coarse seeds.
                entry["how"] = f"{how}, at an earlier revision"
            if safe and is_safe(certificate) and ratio < entry["length_ratio"]:
                entry = {"length_ratio": ratio, "how": how, "waypoints_east_north_amsl_m": path}
        known[name] = entry | {"tried": tried}
        FILE.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
