"""Measure planners on fresh random instances: ``python -m benchmarks.planning.fresh_instances --from 7001``.

No tuning has used these instances of 60 threats.  ``--family passable``: draws of `tests.instances` with a path on a
coarse grid; ``drawn``: the first draw of each seed, with or without a path; ``wild``: instances of
`benchmarks.planning.wild_instances`.  ``--autopilot`` names the autopilot of the plans.  Best known is the shortest
certified path of `benchmarks.planning.reference_search` and of all measurements here.  The results of the reference,
which takes the longest, are stored in ``--kept FILE``.  An algorithm named "NAME without generations" ends with its
seeds, so that the difference is what its distribution adds.
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planning.reference_search import reference_search
from benchmarks.planning.wild_instances import wild_scenario
from benchmarks.task import Task, with_planner
from planfly.workflow.uav import load_uav
from planner.evaluation.encoding import ENCODINGS
from planner.evaluation.problem import make_problem
from planner.plan import Objective
from planner.search.algorithms import DEFAULT
from planner.search.plan_path import plan_path
from tests.instances import SEED, Instance, draw_threats, random_scenario, scenario_text
from world.arrays import Floats
from world.scenario import scenario_from_spec
from world.scenario_file import parse_scenario

# Default file of the stored references.
KEPT = Path("runs") / "fresh-instances.json"
# Number of threats of an instance.
THREATS = 60
FAMILIES = ("passable", "drawn", "wild")
# Excess over the best known length above which a path is long, as a fraction.
LONG = 0.01
# End of the name of an algorithm that runs no generations.
WITHOUT_GENERATIONS = " without generations"
# CPU time above which a run is slow, s.
SLOW = 1.0


def random_task(seed: int, threats: int = THREATS, family: str = "passable", autopilot: str = "planfly") -> Task:
    """Make the task of a random instance."""
    if family == "wild":
        scenario = wild_scenario(seed, autopilot)
    else:
        if family == "passable":
            text = random_scenario(seed, threats)
        else:
            positions, radii = draw_threats(np.random.default_rng([SEED, threats, seed, 0]), threats)
            text = scenario_text(f"drawn-{threats}-{seed}", Instance(positions, radii, 0), f"drawn instance {seed}")
        flown = text.replace("[flight]\n", f'[flight]\nautopilot = "{autopilot}"\n')
        scenario = scenario_from_spec(parse_scenario(flown, "random"), "random")
    uav = load_uav(scenario)
    problem = make_problem(scenario, uav.limits)
    return Task(scenario, uav, problem, ENCODINGS["rotated"](problem.space, scenario.planner.waypoints))


def reference_ratios(names: Sequence[str], tasks: Sequence[Task], kept: Path) -> Floats:
    """Return the reference length ratio of each task (n,), NaN without one.

    Earlier results are read by name.
    """
    kept.parent.mkdir(exist_ok=True)
    known: dict[str, dict[str, float]] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    for name, task in zip(names, tasks, strict=True):
        if name in known:
            continue
        began = time.process_time()
        ratio, _ = reference_search(task)
        known[name] = {"ratio": ratio if np.isfinite(ratio) else 0.0, "cpu_s": time.process_time() - began}
        kept.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    return np.array([known[name]["ratio"] or np.nan for name in names])


def measure(tasks: Sequence[Task], reference: Floats, algorithms: Sequence[str], runs: int) -> dict[str, Any]:
    """Run each algorithm on each task, print a table of comparisons and return it.

    The results are compared with the reference ratios (n,).
    """
    ratios = np.full((len(algorithms), len(tasks), runs), np.nan)
    seconds = np.zeros(ratios.shape)
    for at, task in enumerate(tasks):
        for row, name in enumerate(algorithms):
            whole = not name.endswith(WITHOUT_GENERATIONS)
            scenario = task.scenario if whole else with_planner(task.scenario, generations=0)
            algorithm = name.removesuffix(WITHOUT_GENERATIONS)
            for run in range(runs):
                began = time.process_time()
                plan = plan_path(scenario, task.problem.limits, seed=run + 1, algorithm=algorithm)
                seconds[row, at, run] = time.process_time() - began
                if plan.safe:
                    ratios[row, at, run] = plan.objectives[Objective.LENGTH_RATIO]
    best = np.fmin(reference, np.fmin.reduce(ratios, axis=(0, 2)))
    solvable, by_reference = np.isfinite(best), np.isfinite(reference)
    print(
        f"\n{len(tasks)} instances, {runs} runs each; {by_reference.sum()} solved by the reference,"
        f" {solvable.sum()} by any method"
    )
    print(
        f"  {'method':<32}{'solved':>9}{'and more':>9}{'/ best: median':>16}{'90 %':>8}{'worst':>8}"
        f"{f'over {LONG:.0%}':>9}{'CPU s':>8}{'most':>7}"
    )
    record: dict[str, Any] = {"instances": len(tasks), "runs": runs, "solvable": int(solvable.sum())}
    rows = [(name, ratios[row], seconds[row]) for row, name in enumerate(algorithms)]
    if by_reference.any():
        rows.append(("the reference", reference[:, None], np.full((len(tasks), 1), np.nan)))
    for name, found, spent in rows:
        over = found / best[:, None]
        safe, solved = over[np.isfinite(over)], np.isfinite(over[by_reference])
        entry = record[name] = {
            "solved": int(solved.sum()),
            "of": int(solved.size),
            "more": int(safe.size - solved.sum()),
            "median": float(np.median(safe)),
            "p90": float(np.quantile(safe, 0.9)),
            "worst": float(safe.max()),
            "long": int((safe > 1.0 + LONG).sum()),
            "cpu_s": float(np.median(spent)),
            "cpu_s_most": float(spent.max()),
            "ratios": over.round(5).tolist(),
            "seconds": spent.round(3).tolist(),
        }
        print(
            f"  {name:<32}{entry['solved']:>5}/{entry['of']:<3}{entry['more']:>9}{entry['median']:>16.4f}"
            f"{entry['p90']:>8.4f}{entry['worst']:>8.4f}{entry['long']:>9}{entry['cpu_s']:>8.2f}"
            f"{entry['cpu_s_most']:>7.2f}",
            flush=True,
        )
    return record


def print_worst(names: Sequence[str], record: dict[str, Any], algorithm: str) -> None:
    """Print a line for each instance that an algorithm solves by a long path, slowly, or not at all."""
    entry = record[algorithm]
    # Without the reference no instance is known to have a path.
    solved = np.isfinite(record["the reference"]["ratios"])[:, 0] if "the reference" in record else [False] * len(names)
    for name, over, spent, known in zip(names, entry["ratios"], entry["seconds"], solved, strict=True):
        if max(spent) > SLOW or (known and not max(over) <= 1.0 + LONG):
            print(f"    {name}: / best {' '.join(f'{ratio:.4f}' for ratio in over)}; CPU {max(spent):.2f} s")


def main() -> None:
    """Measure with the options of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.fresh_instances")
    parser.add_argument("--family", choices=FAMILIES, default="drawn", help="which instances")
    parser.add_argument("--from", dest="first", type=int, default=7001, help="seed of the first instance")
    parser.add_argument("--count", type=int, default=60, help="instances")
    parser.add_argument("--runs", type=int, default=1, help="seeds of each algorithm on each")
    parser.add_argument("--autopilot", default="planfly", help="autopilot that the plans leave room for")
    parser.add_argument("--kept", type=Path, default=KEPT, help="file that keeps what the reference finds")
    parser.add_argument("--without-reference", action="store_true", help="best known is the best of the runs")
    parser.add_argument("--algorithms", nargs="+", default=[DEFAULT])
    args = parser.parse_args()
    seeds = range(args.first, args.first + args.count)
    tasks = [random_task(seed, family=args.family, autopilot=args.autopilot) for seed in seeds]
    suffix = "" if args.autopilot == "planfly" else f" {args.autopilot}"
    names = [f"{args.family} {seed}{suffix}" for seed in seeds]
    nothing = np.full(len(tasks), np.nan)
    reference = nothing if args.without_reference else reference_ratios(names, tasks, args.kept)
    if args.algorithms != ["none"]:
        record = measure(tasks, reference, args.algorithms, args.runs)
        print_worst(names, record, args.algorithms[0])


if __name__ == "__main__":
    main()
