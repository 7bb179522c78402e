"""Fresh random instances that no tuning has seen: ``python -m benchmarks.planning.fresh_instances --from 7001``.

Of `tests.instances`: 60 threats, each instance one that a grid can pass.  Best known is the shortest certified path of
`benchmarks.planning.lattice_search` and of everything that is measured here.  What the lattice finds is kept in
``runs/fresh-instances.json``, for it takes the longest.
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planning.lattice_search import lattice_search
from benchmarks.task import Task, exact_airframe
from planner.evaluation.encoding import ENCODINGS
from planner.evaluation.problem import make_problem
from planner.plan import Objective
from planner.search.algorithms import DEFAULT
from planner.search.plan_path import plan_path
from tests.instances import random_scenario
from world.scenario import from_spec
from world.scenario_file import parse_scenario

KEPT = Path("runs") / "fresh-instances.json"
THREATS = 60


def random_task(seed: int, threats: int = THREATS) -> Task:
    """The task of a random instance."""
    scenario = from_spec(parse_scenario(random_scenario(seed, threats), "random"), "random")
    airframe = exact_airframe(scenario)
    problem = make_problem(scenario, airframe.limits)
    return Task(scenario, airframe, problem, ENCODINGS["rotated"](problem.space, scenario.planner.waypoints))


def lattice_ratios(seeds: Sequence[int]) -> dict[str, dict[str, float]]:
    """Length ratio (0 for none) and CPU time of the lattice search of each instance, kept from earlier runs."""
    KEPT.parent.mkdir(exist_ok=True)
    known: dict[str, dict[str, float]] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for seed in seeds:
        if str(seed) in known:
            continue
        began = time.process_time()
        ratio, _ = lattice_search(random_task(seed))
        known[str(seed)] = {"ratio": ratio if np.isfinite(ratio) else 0.0, "cpu_s": time.process_time() - began}
        KEPT.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    return {str(seed): known[str(seed)] for seed in seeds}


def measure(seeds: Sequence[int], algorithms: Sequence[str], runs: int, *, with_lattice: bool = True) -> dict[str, Any]:
    """Runs of each algorithm on each instance; prints a table and returns it.

    with_lattice: whether the lattice is searched too; without it best known is the best of the runs.
    """
    lattice = lattice_ratios(seeds) if with_lattice else {}
    ratios = np.full((len(algorithms), len(seeds), runs), np.nan)
    seconds = np.zeros(ratios.shape)
    for at, seed in enumerate(seeds):
        task = random_task(seed)
        for row, name in enumerate(algorithms):
            for run in range(runs):
                began = time.process_time()
                plan = plan_path(task.scenario, task.problem.limits, seed=run + 1, algorithm=name)
                seconds[row, at, run] = time.process_time() - began
                if plan.safe:
                    ratios[row, at, run] = plan.objectives[Objective.LENGTH_RATIO]
    other = np.array([item["ratio"] or np.nan for item in lattice.values()] or [np.nan] * len(seeds))
    best = np.fmin(other, np.fmin.reduce(ratios, axis=(0, 2)))
    solvable = np.isfinite(best)
    print(f"\n{len(seeds)} instances from seed {seeds[0]}, {runs} runs each; {solvable.sum()} solved by any method")
    print(f"  {'method':<24}{'solved':>10}{'/ best: median':>16}{'90 %':>8}{'worst':>8}{'CPU s':>8}{'most':>7}")
    record: dict[str, Any] = {"seeds": list(seeds), "runs": runs, "solvable": int(solvable.sum())}
    rows = [(name, ratios[row], seconds[row]) for row, name in enumerate(algorithms)]
    if lattice:
        rows.append(("lattice, many starts", other[:, None], np.array([[item["cpu_s"]] for item in lattice.values()])))
    for name, found, spent in rows:
        over = (found / best[:, None])[solvable].ravel()
        safe = over[np.isfinite(over)]
        record[name] = {
            "solved": int(safe.size), "of": int(over.size), "median": float(np.median(safe)),
            "p90": float(np.quantile(safe, 0.9)), "worst": float(safe.max()),
            "cpu_s": float(np.median(spent)), "cpu_s_most": float(spent.max()),
            "worst_seed": int(np.array(seeds)[solvable].repeat(found.shape[1])[np.nanargmax(over)]),
        }  # fmt: skip
        row_of = record[name]
        print(
            f"  {name:<24}{row_of['solved']:>6}/{row_of['of']:<4}{row_of['median']:>15.4f}{row_of['p90']:>8.4f}"
            f"{row_of['worst']:>8.4f}{row_of['cpu_s']:>8.2f}{row_of['cpu_s_most']:>7.2f}"
        )
    return record


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.fresh_instances")
    parser.add_argument("--from", dest="first", type=int, default=7001, help="seed of the first instance")
    parser.add_argument("--count", type=int, default=60, help="instances")
    parser.add_argument("--runs", type=int, default=1, help="seeds of each algorithm on each")
    parser.add_argument("--without-lattice", action="store_true", help="best known is the best of the runs")
    parser.add_argument("--algorithms", nargs="+", default=[DEFAULT, "fda"])
    args = parser.parse_args()
    seeds = range(args.first, args.first + args.count)
    if args.algorithms == ["none"]:
        lattice_ratios(seeds)
        return
    measure(list(seeds), args.algorithms, args.runs, with_lattice=not args.without_lattice)


if __name__ == "__main__":
    main()
