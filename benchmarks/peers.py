"""Compare NSGA-II (pymoo), CMA-ES (cmaes) and Informed RRT* (ompl) on the same problem and evaluation."""

import json
import math
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.task import PROBLEMS, Task, all_known, best_known, is_safe, make_task, scalar, seed_vectors, smooth_axes
from planner.search.plan_path import plan_path
from world.arrays import Floats

# Scenarios without a path in a straight frame; their best length is not known.
TRAPS = ("trap-u", "trap-valley", "trap-wall", "trap-spiral")
# Excess over the best known length at which a race ends, as a fraction.
WITHIN = 0.02
# Number of seeds of each race.
RACES = 5


@dataclass(frozen=True, slots=True)
class Found:
    """Result of one search by a peer.

    path: (w, 3) world m as lists.
    safe: True if the path, certified again, meets all four constraints and no missile reaches it.
    checks: number of paths evaluated, or of motions checked.
    callback_share: fraction of the time spent in planfly's evaluation, called from the peer.
    trace: (seconds, length ratio) whenever the best path got shorter; for OMPL and planfly, of certified paths.
    """

    path: list[list[float]]
    length_ratio: float
    safe: bool
    problems: list[str]
    seconds: float
    checks: int
    callback_share: float
    trace: list[tuple[float, float]]


def found(task: Task, path: Floats, seconds: float, checks: int, inside: float, trace: Any = ()) -> Found:
    """Certify a peer's path and collect its numbers.

    seconds: CPU time of the search, s.
    inside: part of it that was spent in planfly's evaluation, s.
    """
    certificate = task.certificate(path)
    problems = list(certificate.problems)
    if certificate.kill_distance <= 0.0:
        problems.append(f"{-certificate.kill_distance:.1f} m inside a missile's sphere")
    share = inside / seconds if seconds > 0.0 else 0.0
    return Found(
        path.tolist(), task.length_ratio(path), is_safe(certificate), problems, seconds, checks, share, list(trace)
    )


def best_path(task: Task, vectors: Floats) -> Floats:
    """Return the path of lowest scalar cost that is certified and safe, of the paths of vectors (n, d).

    If no path is, return the path of lowest cost.
    """
    order = np.argsort(scalar(*task.scores(vectors)), kind="stable")
    paths = task.encoding.decode(vectors[order])
    return next((path for path in paths if is_safe(task.certificate(path))), paths[0])


def solve_with_cmaes(task: Task, seed: int, evaluations: int, *, seeded: bool = True, sigma: float = 0.05) -> Found:
    """Search with CMA-ES in the smooth basis, with restarts.

    It starts from planfly's best coarse seed if `seeded`, otherwise from the straight line.  A restart begins at
    the best path so far.
    """
    from cmaes import CMA

    started, inside = time.process_time(), 0.0
    basis, spread = smooth_axes(task)
    low, high = task.encoding.lower, task.encoding.upper
    if seeded:
        home = seed_vectors(task)[0]
    else:
        home, sigma = 0.5 * (low + high), 1.0
        share = np.linspace(0.0, 1.0, task.encoding.waypoints)[1:-1]
        home[1::3] = 0.0
        home[2::3] = task.scenario.start[2] + share * (task.scenario.destination[2] - task.scenario.start[2])
    best, best_cost, kept, trace, done, restarts = home, np.inf, [home], [], 0, 0
    size = int(4 + 3 * np.log(home.size)) * 2
    search = CMA(mean=np.zeros(home.size), sigma=sigma, seed=seed, population_size=size)
    while done < evaluations:
        asked = np.array([search.ask() for _ in range(size)])
        vectors = home + np.einsum("nk,dk->nd", asked * spread, basis)
        clipped = np.clip(vectors, low, high)
        before = time.process_time()
        costs = scalar(*task.scores(clipped))
        inside += time.process_time() - before
        done += size
        outside = np.abs((vectors - clipped) / (high - low)).sum(axis=1)
        with warnings.catch_warnings():
            # A population of equal costs divides by zero inside the library.
            warnings.simplefilter("ignore", RuntimeWarning)
            search.tell(list(zip(asked, costs + outside, strict=True)))
        row = int(np.argmin(costs))
        if costs[row] < best_cost:
            best, best_cost = clipped[row], costs[row]
            kept = [*kept[-30:], best]
            if best_cost < 10.0:
                trace.append((time.process_time() - started, float(best_cost)))
        if search.should_stop() or search._sigma < 1e-5:
            restarts += 1
            home = best
            search = CMA(mean=np.zeros(home.size), sigma=0.02, seed=seed + 1000 * restarts, population_size=size)
    path = best_path(task, np.array(kept))
    return found(task, path, time.process_time() - started, done, inside, trace)


def solve_with_nsga2(task: Task, seed: int, evaluations: int) -> Found:
    """Search with pymoo's NSGA-II: length and kill exposure, four constraints, the paper's population."""
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem as PymooProblem
    from pymoo.optimize import minimize

    started = time.process_time()
    spent = [0.0, 0]

    class Paths(PymooProblem):
        def _evaluate(self, x: Floats, out: dict[str, Floats], *_args: object, **_more: object) -> None:
            before = time.process_time()
            violations, objectives = task.scores(x)
            spent[0] += time.process_time() - before
            spent[1] += len(x)
            out["F"], out["G"] = objectives[:, :2], violations

    problem = Paths(
        n_var=task.encoding.lower.size, n_obj=2, n_ieq_constr=4, xl=task.encoding.lower, xu=task.encoding.upper
    )
    size = task.scenario.planner.population
    algorithm = NSGA2(pop_size=size, n_offsprings=size // 2)
    result = minimize(problem, algorithm, ("n_eval", evaluations), seed=seed, verbose=False)
    vectors = np.atleast_2d(result.X) if result.X is not None else result.pop.get("X")
    return found(task, best_path(task, vectors), time.process_time() - started, int(spent[1]), spent[0])


def solve_with_ompl(task: Task, seed: int, seconds: float, ratio: float = 0.0) -> Found:
    """Search with Informed RRT* for a time or to a length ratio.

    It runs in a process of its own, because it prints at exit.
    """
    command = [sys.executable, "-m", "benchmarks.ompl_peer", task.scenario.name]
    command += [str(number) for number in (seed, seconds, ratio)]
    result = subprocess.run(command, check=True, capture_output=True, text=True)
    return Found(**json.loads(result.stdout.splitlines()[-1]))


def measure(seconds: float) -> dict[str, Any]:
    """Run every peer once on each problem, print a table and return it.

    All peers use seed 1 and the paper's budget of evaluations, but OMPL runs for a CPU time, `seconds`.
    """
    print("\nPeers on the hard set and traps, seed 1: one problem, evaluation and certificate; one core, CPU s, warm")
    print(f"  {'problem':<13}{'method':<28}{'safe':>5}{'PLR':>9}{'/ best':>8}{'CPU s':>8}{'checks':>9}{'in ours':>9}")
    record: dict[str, Any] = {}
    for problem in (*(f"hard-{number:02d}" for number in PROBLEMS), *TRAPS):
        task = make_task(problem)
        known = best_known(task.scenario.name)
        task.scores(task.encoding.lower[None])
        rows: dict[str, Callable[[], Found]] = {
            "planfly, default": partial(solve_with_planfly, task, 1),
            "cmaes, our seeds and basis": partial(solve_with_cmaes, task, 1, task.evaluations),
            "cmaes, our basis, no seeds": partial(solve_with_cmaes, task, 1, task.evaluations, seeded=False),
            "pymoo NSGA-II": partial(solve_with_nsga2, task, 1, task.evaluations),
            "ompl InformedRRTstar": partial(solve_with_ompl, task, 1, seconds),
        }
        if problem in TRAPS:
            # The grids of a straight frame have no route out of a trap, so that there are no seeds to begin from.
            del rows["cmaes, our seeds and basis"]
        for name, work in rows.items():
            package = name.split()[0].rstrip(",")
            if package != "planfly" and find_spec(package) is None:
                print(f"  {task.scenario.name:<13}{name:<28}  not measured: package {package} is missing (make bench)")
                record[f"{task.scenario.name} {name}"] = "missing package"
                continue
            if package != "ompl":
                work()
            item = work()
            print(
                f"  {task.scenario.name:<13}{name:<28}{'yes' if item.safe else 'no':>5}{item.length_ratio:>9.4f}"
                f"{item.length_ratio / known:>8.4f}{item.seconds:>8.2f}{item.checks:>9}"
                f"{100 * item.callback_share:>8.0f}%"
            )
            if not item.safe:
                print(f"  {'':<13}{'':<28}  not certified: {'; '.join(item.problems)[:100]}")
            entry = {key: value for key, value in asdict(item).items() if key != "path"}
            record[f"{task.scenario.name} {name}"] = entry
    if find_spec("ompl") is not None:
        record["to_2_percent"] = race(seconds)
    return record


def race(seconds: float) -> dict[str, Any]:
    """Print the CPU time of OMPL's Informed RRT* and of planfly to a nearly best certified path.

    The path is at most 2 % longer than the best known one.

    Planfly's time begins with the call of the planner, with scenario and envelope loaded, and includes problem, grids
    and certificates.  OMPL's time begins with its first step, without certificates.  A search that does not reach the
    length within `seconds` is recorded with that time.
    """
    print(f"\nTo a certified path within {100 * WITHIN:.0f} % of best known, CPU ms; median of seeds 1..{RACES}")
    print(f"  {'problem':<9}{'ours':>9}{'OMPL':>11}{'ratio':>10}{'in evaluation':>10}{'ratio without it':>19}")
    record: dict[str, Any] = {}
    for name in all_known():
        task, goal = make_task(name), (1.0 + WITHIN) * best_known(name)
        solve_with_planfly(task, 1)
        ours = [_time_to(solve_with_planfly(task, seed), goal, math.inf) for seed in range(1, RACES + 1)]
        searches = [solve_with_ompl(task, seed, seconds, goal) for seed in range(1, RACES + 1)]
        theirs = [_time_to(item, goal, seconds) for item in searches]
        mine, other = float(np.median(ours)), float(np.median(theirs))
        more = ">=" if sum(spent >= seconds for spent in theirs) > RACES // 2 else ""
        share = float(np.median([item.callback_share for item in searches]))
        without = other * (1.0 - share) / mine
        print(
            f"  {name:<9}{1e3 * mine:>9.1f}{more + f'{1e3 * other:.0f}':>11}{more + f'{other / mine:.1f}':>10}"
            f"{100 * share:>9.0f}%{more + f'{without:.1f}':>19}"
        )
        record[name] = {
            "ours_s": ours,
            "ompl_s": theirs,
            "cap_s": seconds,
            "ratio": other / mine,
            "share_in_evaluation": share,
            "ratio_without_evaluation": without,
        }
    for key, text in (("ratio", "ratio"), ("ratio_without_evaluation", "ratio without the time in our evaluation")):
        record[f"median_{key}"] = float(np.median([row[key] for row in record.values() if isinstance(row, dict)]))
        print(f"  median of the problems, {text}: {record[f'median_{key}']:.1f}")
    return record


def _time_to(item: Found, ratio: float, never: float) -> float:
    """Return the first time in the trace at which the length ratio is at most this, s."""
    return next((seconds for seconds, length in item.trace if length <= ratio), never)


def solve_with_planfly(task: Task, seed: int) -> Found:
    """Search with the default planner.

    Its trace contains certified paths, and includes the time of certificates.
    """
    trace: list[tuple[float, float]] = []

    def see(path: Floats) -> None:
        """Add a certified path to the trace if it is shorter than all earlier ones."""
        length = task.length_ratio(path)
        if (not trace or length < trace[-1][1]) and is_safe(task.certificate(path)):
            trace.append((time.process_time() - started, length))

    started = time.process_time()
    plan = plan_path(task.scenario, task.problem.limits, seed=seed, improved=see)
    spent = time.process_time() - started
    return found(task, plan.waypoints, spent, plan.evaluations, 0.0, trace)


def as_json(item: Found) -> str:
    """Return a result as one line of JSON."""
    return json.dumps(asdict(item))
