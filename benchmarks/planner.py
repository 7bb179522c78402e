"""Measure the planner: evaluation compared with NumPy and brute force, ranking, searches, scale, and cold start."""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from benchmarks.reference import brute_scores, numpy_scores, ranks_by_definition
from benchmarks.task import PROBLEMS, Task, best_known, exact_uav, graded_scores, make_task
from benchmarks.timing import median_cpu
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import ProblemArrays
from planner.optimisers.preference import NO_GOAL, Level, ranks
from planner.search.algorithms import DEFAULT
from planner.search.plan_path import plan_path
from world.arrays import Floats
from world.scenario import Scenario, load_scenario, scenario_from_spec

# Largest relative difference of equal objectives.
EQUAL = 1e-12
# Levels by which paths are ranked: the four counts of violations, length and kill exposure, then the other objectives.
LEVELS = (Level((0, 1, 2, 3), (0.0,) * 4), Level((4, 5), (NO_GOAL,) * 2), Level((6, 7), (NO_GOAL,) * 2))
# Number of threats of the test of scale.
MANY = 10_000


def measure(seeds: int) -> dict[str, Any]:
    """Measure everything, print tables, and return them."""
    return {
        "evaluation": evaluation(),
        "ranking": ranking(),
        "scale": scale(),
        "runs": whole_searches(seeds),
        "cold_start": cold_start(),
    }


def random_paths(task: Task, count: int) -> Floats:
    """Draw uniform samples of the rotated encoding (n, w, 3)."""
    rng = np.random.default_rng(1)
    shape = (count, task.encoding.lower.size)
    return np.ascontiguousarray(task.encoding.decode(rng.uniform(task.encoding.lower, task.encoding.upper, shape)))


def repeated(evaluate: Callable[..., object], data: ProblemArrays, paths: Floats, times: int) -> None:
    """Evaluate the same paths several times."""
    for _ in range(times):
        evaluate(data, paths)


def evaluation() -> dict[str, Any]:
    """Measure the evaluation of one population by three methods.

    They are planfly, brute force, and one NumPy batch over all paths.
    """
    print("\nFull evaluation of a population (four counts, four objectives), us a path; one core, median of 5")
    print(f"  {'problem':<10}{'ours':>8}{'graded':>9}{'brute force':>13}{'NumPy batch':>13}{'NumPy / ours':>14}  equal")
    record = {}
    for name in ("paper-07", "paper-60", "hard-60"):
        task = make_task(name)
        paths, data = random_paths(task, task.scenario.planner.population), task.problem.search
        counts, objectives = paper_scores(data, paths)
        equal = []
        for other in (brute_scores, numpy_scores):
            again, values = other(data, paths)
            scale = np.maximum(1.0, np.abs(objectives))
            equal.append(bool(np.array_equal(counts, again) and (np.abs(values - objectives) <= EQUAL * scale).all()))
        graded_scores(data, paths)
        evaluators: tuple[Callable[..., object], ...] = (paper_scores, graded_scores, brute_scores, numpy_scores)
        micro = []
        for evaluate in evaluators:
            # Short work is repeated, so that it is long compared with a tick of the clock.
            repeat = 1 if evaluate is numpy_scores else 20
            spent = median_cpu(partial(repeated, evaluate, data, paths, repeat))
            micro.append(1e6 * spent / repeat / len(paths))
        ours, graded, brute, batch = micro
        print(
            f"  {name:<10}{ours:>8.2f}{graded:>9.2f}{brute:>13.2f}{batch:>13.1f}{batch / ours:>14.0f}"
            f"  {'to 1e-12' if all(equal) else 'NO'}"
        )
        record[name] = {
            "ours_us": ours,
            "graded_us": graded,
            "brute_us": brute,
            "numpy_us": batch,
            "numpy_over_ours": batch / ours,
            "paths_per_second": 1e6 / ours,
            "equal": all(equal),
        }
    return record


def ranking() -> dict[str, Any]:
    """Measure exact ranks of 500 random paths of paper-60.

    They are computed level by level, and by the generic pairwise relation.
    """
    task = make_task("paper-60")
    counts, objectives = paper_scores(task.problem.search, random_paths(task, 500))
    scores = np.concatenate([counts.astype(np.float64), objectives], axis=1)
    # As in a late generation: half of the paths meet the constraints, and level 2 decides.
    scores[:250, :4] = 0.0
    same = bool(np.array_equal(ranks(scores, LEVELS), ranks_by_definition(scores, LEVELS)))
    split = median_cpu(lambda: [ranks(scores, LEVELS) for _ in range(20)]) / 20
    generic = median_cpu(lambda: [ranks_by_definition(scores, LEVELS) for _ in range(5)]) / 5
    print("\nExact ranking of 500 paths, ms; median of 5")
    print(
        f"  split by level {1e3 * split:.2f}, generic relation {1e3 * generic:.2f}, ratio {generic / split:.1f}, ",
        end="",
    )
    print("identical" if same else "DIFFERENT")
    return {"split_ms": 1e3 * split, "generic_ms": 1e3 * generic, "ratio": generic / split, "identical": same}


def scaled(threats: int) -> Scenario:
    """Make paper-60 with more threats of the same coverage: radii shrink with the root of their number."""
    spec = load_scenario("paper-60").spec
    rng, share = np.random.default_rng(threats), np.sqrt(60.0 / threats)
    unit = spec.threats[0]
    units = []
    for k in range(threats):
        east, north = rng.uniform(0.0, 10_000.0, 2)
        while min(np.hypot(east - 500.0, north - 500.0), np.hypot(east - 9600.0, north - 9600.0)) < 700.0 * share:
            east, north = rng.uniform(0.0, 10_000.0, 2)
        sizes = {
            key: share * getattr(unit, key)
            for key in ("kill_radius_m", "kill_scale_m", "detection_radius_m", "detection_scale_m")
        }
        units.append(unit.model_copy(update={"name": f"unit {k}", "east_m": east, "north_m": north} | sizes))
    return scenario_from_spec(spec.model_copy(update={"threats": units}), f"{threats} threats")


def scale() -> dict[str, Any]:
    """Measure the cost per path with 10,000 threats of the coverage of 60."""
    from planner.evaluation.problem import make_problem

    task = make_task("paper-60")
    paths = random_paths(task, 500)
    micro: dict[str, dict[int, float]] = {"paper": {}, "graded": {}}
    for threats in (60, MANY):
        scenario = scaled(threats)
        uav = exact_uav(scenario)
        data = make_problem(scenario, uav.limits).search
        for name, evaluate in (("paper", paper_scores), ("graded", graded_scores)):
            evaluate(data, paths)
            spent = median_cpu(partial(repeated, evaluate, data, paths, 5))
            micro[name][threats] = 1e6 * spent / 5 / len(paths)
    print(f"\n{MANY:,} threats at the coverage of 60, us a path; median of 5")
    for name, pair in micro.items():
        print(f"  {name:<8}{pair[60]:>8.2f}{pair[MANY]:>8.2f}{pair[MANY] / pair[60]:>8.2f} x")
    return {f"{name}_ratio": pair[MANY] / pair[60] for name, pair in micro.items()}


def whole_searches(seeds: int) -> dict[str, Any]:
    """Run seeded searches of the default planner and of the paper's algorithm on every problem."""
    print(f"\nWhole searches, seeds 1..{seeds}, one core, warm, CPU s (first safe: default planner, ended by it)")
    print(
        f"  {'problem':<10}{'algorithm':<14}{'safe':>7}{'PLR median':>12}{'worst':>8}{'/ best known':>14}{'worst':>8}"
        f"{'CPU s':>8}{'first safe':>12}{'evaluations':>13}"
    )
    record = {}
    for family in ("hard", "paper"):
        for number in PROBLEMS:
            for algorithm in (DEFAULT, "umda"):
                name = f"{family}-{number:02d}"
                row = _searches_of(make_task(name), algorithm, seeds)
                record[f"{name} {algorithm}"] = row
                print(
                    f"  {name:<10}{algorithm:<14}{row['safe']:>4}/{seeds}"
                    f"{row['length_median']:>12.4f}{row['length_worst']:>8.4f}{row['median_over_best']:>14.4f}"
                    f"{row['worst_over_best']:>8.4f}{row['cpu_s_median']:>8.2f}{row['first_safe_s_median']:>12.3f}"
                    f"{row['evaluations_most']:>13}"
                )
    return record


def _searches_of(task: Task, algorithm: str, seeds: int) -> dict[str, Any]:
    """Search a problem with each seed, and return times and results."""
    limits = task.problem.limits
    plan_path(task.scenario, limits, seed=1, algorithm=algorithm)
    safe, seconds, first, most = [], [], [], 0
    for seed in range(1, seeds + 1):
        began = time.process_time()
        plan = plan_path(task.scenario, limits, seed=seed, algorithm=algorithm)
        seconds.append(time.process_time() - began)
        most = max(most, plan.evaluations)
        if plan.safe:
            safe.append(float(plan.objectives[0]))
        if algorithm == DEFAULT:
            began = time.process_time()
            if plan_path(task.scenario, limits, seed=seed, algorithm=algorithm, first_safe=True).safe:
                first.append(time.process_time() - began)
    known = best_known(task.scenario.name)
    nan = float("nan")
    median, worst = (float(np.median(safe)), max(safe)) if safe else (nan, nan)
    return {
        "safe": len(safe),
        "length_median": median,
        "length_worst": worst,
        "median_over_best": median / known,
        "worst_over_best": worst / known,
        "cpu_s_median": float(np.median(seconds)),
        "first_safe_s_median": float(np.median(first)) if first else nan,
        "evaluations_most": most,
    }


# Program of a new process: it plans to the first certified path, and prints its result and CPU time.
_FIRST = """
import json, time
from benchmarks.task import make_task
from planner.search.plan_path import plan_path
task = make_task("hard-60")
plan = plan_path(task.scenario, task.problem.limits, seed=1, first_safe=True)
print(json.dumps([plan.safe, float(plan.objectives[0]), time.process_time()]))
"""


def cold_start() -> dict[str, Any]:
    """Time new processes to a first certified path of hard-60.

    The cache of compiled code is warm or empty.
    """
    print("\nNew process, s of wall clock (CPU s of the process)")
    record: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for title, cache, rounds in (("warm cache", None, 3), ("empty cache", folder, 1)):
            extra = {} if cache is None else {"NUMBA_CACHE_DIR": cache}
            spent, answer = [], [False, float("nan"), 0.0]
            for _ in range(rounds + (cache is None)):
                began = time.perf_counter()
                done = subprocess.run(
                    [sys.executable, "-c", _FIRST], check=True, capture_output=True, text=True, env=os.environ | extra
                )
                spent.append(time.perf_counter() - began)
                answer = json.loads(done.stdout)
            safe, ratio, cpu = answer
            print(
                f"  to a first certified path of hard-60, {title}: {statistics.median(spent):.2f} ({cpu:.2f})"
                f", {'safe' if safe else 'NOT SAFE'}, PLR {ratio:.4f}"
            )
            record[title] = {"seconds": statistics.median(spent), "cpu_s": cpu, "safe": safe, "length_ratio": ratio}
    return record
