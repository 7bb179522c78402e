"""Measure the value of each part of the default planner, without seeds, generations or final shortening."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import numpy as np

from benchmarks.planning.fresh_instances import random_task
from benchmarks.task import PROBLEMS, Task, best_known, make_task, with_planner
from planner.plan import Objective
from planner.search.algorithms import ALGORITHMS, DEFAULT, Algorithm
from planner.search.plan_path import plan_path

# Random instances in addition to the hard set; none of them was used to tune the planner.
RANDOM = range(8001, 8013)


@dataclass(frozen=True, slots=True)
class Variant:
    """Search variant: name in the table, algorithm, and True to run the scenario's generations."""

    name: str
    algorithm: Algorithm
    generations: bool = True


def variants() -> list[Variant]:
    """Return the default algorithm, and variants with each of its parts left out or exchanged."""
    whole, seedless = ALGORITHMS[DEFAULT], ALGORITHMS["fda"]
    return [
        Variant(f"{DEFAULT}, the default", whole),
        Variant("no generations", whole, generations=False),
        Variant("UMDA's generations (umda-seeded)", ALGORITHMS["umda-seeded"]),
        Variant("no final shortening", replace(whole, final_shortening=False)),
        Variant("no seeds (fda)", seedless),
        Variant("no seeds, no final shortening", replace(seedless, final_shortening=False)),
        Variant("no seeds, UMDA's generations (umda-smooth)", ALGORITHMS["umda-smooth"]),
    ]


@contextmanager
def _named(algorithm: Algorithm) -> Iterator[str]:
    """Register an algorithm under a temporary name, and yield the name."""
    name = "ablation"
    ALGORITHMS[name] = replace(algorithm, name=name)
    try:
        yield name
    finally:
        del ALGORITHMS[name]


def _runs(task: Task, variant: Variant, seeds: int) -> tuple[list[float], list[float]]:
    """Return the length ratio of each seed's plan, NaN if it is not safe, and its CPU time, s."""
    scenario = task.scenario if variant.generations else with_planner(task.scenario, generations=0)
    ratios, seconds = [], []
    with _named(variant.algorithm) as name:
        for seed in range(1, seeds + 1):
            began = process_time()
            plan = plan_path(scenario, task.problem.limits, seed=seed, algorithm=name)
            seconds.append(process_time() - began)
            ratios.append(float(plan.objectives[Objective.LENGTH_RATIO]) if plan.safe else np.nan)
    return ratios, seconds


def measure(seeds: int) -> dict[str, Any]:
    """Run each variant on the hard set with some seeds, and on random instances with one.

    Print and return a table.
    """
    tasks = [(make_task(f"hard-{number:02d}"), seeds) for number in PROBLEMS]
    tasks += [(random_task(seed), 1) for seed in RANDOM]
    found = {variant.name: [_runs(task, variant, many) for task, many in tasks] for variant in variants()}
    best = []
    for at, (task, _) in enumerate(tasks):
        known = best_known(task.scenario.name)
        best.append(np.nanmin([known, *(ratio for rows in found.values() for ratio in rows[at][0])]))
    print(
        f"\nAblation: {seeds} seeds of hard-60; {seeds} seeds of hard-07, 15, 30; {len(RANDOM)} random instances."
        "  Safe; length / best known, median, worst; CPU s, median"
    )
    groups = {"hard-60": [PROBLEMS.index(60)], "hard-07 to 30": [0, 1, 2], "random": range(4, len(tasks))}
    record: dict[str, Any] = {}
    for name, rows in found.items():
        line = f"  {name:<44}"
        for group, places in groups.items():
            over = np.concatenate([np.array(rows[at][0]) / best[at] for at in places])
            spent = float(np.median(np.concatenate([rows[at][1] for at in places])))
            safe = over[np.isfinite(over)]
            median, worst = (float(np.median(safe)), float(safe.max())) if safe.size else (np.nan, np.nan)
            record[f"{name}, {group}"] = {
                "safe": int(safe.size),
                "of": int(over.size),
                "median": median,
                "worst": worst,
                "cpu_s": spent,
            }
            line += f"{safe.size:>4}/{over.size:<3}{median:>8.4f}{worst:>8.4f}{spent:>6.2f}"
        print(line, flush=True)
    return record
