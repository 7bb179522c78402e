"""Compare fronts of 20 plans with fronts of pymoo's NSGA-II and MOEA/D, by hypervolume.

``python -m benchmarks.planning.fronts [--seeds N] [--from SEED] [--problems NAME,...] [--whole] [--json FILE]`` plans a
front of 20 (`planner.search.plan_front`) and lets pymoo's algorithms search the same four objectives: length, exposure,
clearance and energy, under the same graded constraints, with the same number of evaluations, and again with the same
CPU time, which includes planfly's default plan, seeds and certificates. NSGA-II handles constraints itself; MOEA/D does
not, so that violations are added to its objectives. Both search the box of the rotated encoding from random samples,
and once more from the start paths of planfly, which they would not have alone: one population of them, the paths that
cover most. Of each result the 20 certified paths that cover most are used; a front without any has hypervolume 0.

A problem is the name of a scenario, ``random-7101`` or ``wild-7101``: an instance of 60 threats of that number of
`benchmarks.planning.fresh_instances`. ``--fresh`` measures twelve of these with the first seed, from planfly's paths
only.

The reference point of `reference_point` is 1.5 times the length, exposure and energy of the default plan (1 s of
exposure at least), and the required clearance. Hypervolumes are fractions of the box between it and the straight line's
length, no exposure, the clearance of the lower end, and the default plan's energy times straight / length.
"""

import argparse
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planning.fresh_instances import random_task
from planfly.workflow.uav import load_uav
from planner.evaluation.certify import certify
from planner.evaluation.encoding import ENCODINGS, Encoding
from planner.optimisers.hypervolume import covering_order, hypervolume
from planner.search.plan_front import Front, FrontTask, fit_margins, front_task, plan_front, seed_paths
from world.arrays import Floats
from world.scenario import Scenario, load_scenario

# Scenarios of the comparison.
PROBLEMS = ("hard-30", "hard-60", "jacksboro")
# Number of plans of a front.
COUNT = 20
# First seed by default.
FIRST_SEED = 100
# Instances of ``--fresh``.
FRESH = tuple(f"{family}-{number}" for family in ("random", "wild") for number in range(7101, 7107))
# Population of pymoo's algorithms.
POPULATION = 120
# Partitions of the reference directions of MOEA/D.
PARTITIONS = 7
# Neighbours of MOEA/D.
NEIGHBOUR_COUNT = 15
# Weight of violations in MOEA/D's objectives, which are fractions of the reference box.
PENALTY = 100.0


@dataclass(frozen=True, slots=True)
class Row:
    """Result of one search: hypervolume as a fraction of the box, plans, evaluations and CPU time, s."""

    hypervolume: float
    plans: int
    evaluations: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Contest:
    """Problem that all algorithms share.

    ideal, reference: corners (4,) of the box of objectives.
    """

    task: FrontTask
    encoding: Encoding
    ideal: Floats
    reference: Floats

    def share(self, paths: Floats) -> float:
        """Return the hypervolume of paths (n, w, 3) as a fraction of the box."""
        if not len(paths):
            return 0.0
        objectives = self.task.objectives(self.task.values(paths))
        scaled = np.maximum(0.0, (objectives - self.ideal) / (self.reference - self.ideal))
        return hypervolume(scaled, np.ones(4))

    def certified(self, paths: Floats) -> Floats:
        """Return those 20 certified and safe paths of (n, w, 3) that together have the largest hypervolume."""
        certificates = [certify(self.task.problem, path) for path in paths]
        safe = [
            path
            for path, certificate in zip(paths, certificates, strict=True)
            if certificate.ok and certificate.kill_distance > 0.0
        ]
        if not safe:
            return paths[:0]
        kept = np.array(safe)
        order = covering_order(self.task.objectives(self.task.values(kept)), self.reference, COUNT)
        return np.asarray(kept[order])


def make_contest(scenario: Scenario, front: Front) -> Contest:
    """Make the contest of a problem, with the box of its default plan."""
    default = front.default
    task = fit_margins(front_task(scenario, load_uav(scenario).limits.with_margin()), default.plan.waypoints)
    space = task.problem.space
    straight = float(np.sqrt(((space.destination - space.start) ** 2).sum()))
    ends = np.stack([[end, end] for end in (space.start, space.destination)])
    highest = float(task.values(ends)[:, 2].min())
    fourth = default.energy if front.fourth == "energy" else default.time
    ideal = np.array([straight, 0.0, -highest, fourth * straight / default.length])
    encoding = ENCODINGS["rotated"](space, scenario.planner.waypoints)
    return Contest(task, encoding, ideal, front.reference)


def ours(name: str, seed: int) -> tuple[Front, Contest, Row]:
    """Plan a front with planfly; return it with its contest and its row."""
    kind, _, number = name.partition("-")
    families = {"random": "passable", "wild": "wild"}
    scenario = random_task(int(number), family=families[kind]).scenario if kind in families else load_scenario(name)
    limits = load_uav(scenario).limits.with_margin()
    began = time.process_time()
    front = plan_front(scenario, limits, COUNT, seed=seed)
    seconds = time.process_time() - began
    contest = make_contest(scenario, front)
    paths = np.array([one.plan.waypoints for one in front.plans])
    evaluations = front.evaluations + front.default.plan.evaluations
    return front, contest, Row(contest.share(paths), len(paths), evaluations, seconds)


def theirs(
    contest: Contest, algorithm: str, seed: int, evaluations: int | None, seconds: float | None, seeds: Floats
) -> Row:
    """Search a front with one of pymoo's algorithms, up to a number of evaluations or a CPU time.

    seeds: vectors (n, d) in its first population.
    """
    from pymoo.core.problem import Problem as PymooProblem

    task = contest.task
    # Seeds are not bound to the intervals of the encoding.
    low, high = contest.encoding.lower, contest.encoding.upper
    if len(seeds):
        low, high = np.minimum(low, seeds.min(axis=0)), np.maximum(high, seeds.max(axis=0))
    penalised = algorithm == "MOEA/D"
    kept_vectors: list[Floats] = []
    spent = 0

    class Paths(PymooProblem):
        def _evaluate(self, x: Floats, out: dict[str, Floats], *_args: object, **_more: object) -> None:
            nonlocal spent
            spent += len(x)
            objectives, violations = task.scores(task.to_paths(x))
            if penalised:
                # MOEA/D compares infeasible paths, too.
                objectives = task.objectives(task.values(task.to_paths(x)))
            scaled = (objectives - contest.ideal) / (contest.reference - contest.ideal)
            scaled = np.nan_to_num(scaled, nan=1e6, posinf=1e6, neginf=-1.0)
            met = (violations <= 0.0).all(axis=1)
            kept_vectors.extend(x[met & (objectives < contest.reference).all(axis=1)])
            out["F"] = scaled + PENALTY * violations.sum(axis=1, keepdims=True) if penalised else scaled
            if not penalised:
                out["G"] = violations

    problem = Paths(n_var=low.size, n_obj=4, n_ieq_constr=0 if penalised else 5, xl=low, xu=high)
    engine = _engine(algorithm, seeds, low, high, seed)
    began = time.process_time()
    engine.setup(problem, termination=("n_eval", 10**9), seed=seed, verbose=False)
    while (evaluations is None or spent < evaluations) and (seconds is None or time.process_time() - began < seconds):
        engine.next()
    took = time.process_time() - began
    # All feasible paths of the search are used, not only its last population.
    if not kept_vectors:
        return Row(0.0, 0, spent, took)
    paths = task.to_paths(np.array(kept_vectors)[-20_000:])
    path_objectives = task.objectives(task.values(paths))
    # Keep five times the required number, those that contribute most to the hypervolume. They are chosen in parts, so
    # that the tables fit in memory.
    covering: list[int] = []
    for first in range(0, len(paths), 2000):
        part = path_objectives[first : first + 2000]
        covering += (first + covering_order(part, contest.reference, 5 * COUNT)).tolist()
    order = covering_order(path_objectives[covering], contest.reference, 5 * COUNT)
    chosen = contest.certified(np.asarray(paths[np.array(covering)[order]]))
    return Row(contest.share(chosen), len(chosen), spent, took)


def _engine(algorithm: str, seeds: Floats, low: Floats, high: Floats, seed: int) -> Any:
    """Make one of pymoo's algorithms, ready for its setup."""
    from pymoo.algorithms.moo.moead import MOEAD
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.util.ref_dirs import get_reference_directions

    first = np.random.default_rng(seed).uniform(low, high, (POPULATION, low.size))
    first[: min(POPULATION, len(seeds))] = seeds[:POPULATION]
    if algorithm == "MOEA/D":
        towards = get_reference_directions("uniform", 4, n_partitions=PARTITIONS)
        return MOEAD(towards, n_neighbors=NEIGHBOUR_COUNT, sampling=first)
    return NSGA2(pop_size=POPULATION, sampling=first)


def measure(name: str, seeds: range, *, whole: bool, alone: bool = True) -> dict[str, Any]:
    """Run all algorithms on a problem.

    Print a line per seed and the medians. alone: also without planfly's paths.
    """
    print(f"\n{name}: hypervolume as a share of the box; CPU s")
    record: dict[str, list[dict[str, Any]]] = {}
    for seed in seeds:
        rows, front = _rows(name, seed, whole=whole, alone=alone)
        mine = rows["planfly"]
        for key, row in rows.items():
            record.setdefault(key, []).append(asdict(row))
        text = "  ".join(f"{key}: {row.hypervolume:.4f}" for key, row in rows.items())
        spent = f"{mine.evaluations} evaluations, {mine.seconds:.1f} s"
        print(f"  seed {seed}: {len(front.plans)} plans, {spent};  {text}", flush=True)
    # Medians, and the ratio of planfly's median to each.
    own_share = np.array([row["hypervolume"] for row in record["planfly"]])
    for key, found in record.items():
        shares = np.array([row["hypervolume"] for row in found])
        none_found = int((shares == 0.0).sum())
        middle = float(np.median(shares))
        ratio = f"{np.median(own_share) / middle:.2f}" if middle > 0.0 else "no front to divide by"
        seconds = np.median([row["seconds"] for row in found])
        print(
            f"  {key:<36} median {middle:.4f}, least {shares.min():.4f}; ours / this {ratio};"
            f" {none_found} of {len(shares)} without a plan; CPU {seconds:.1f} s"
        )
    return record


def _rows(name: str, seed: int, *, whole: bool, alone: bool) -> tuple[dict[str, Row], Front]:
    """Return the row of each algorithm on a problem with one seed, and planfly's front."""
    front, contest, mine = ours(name, seed)
    if not front.plans:
        return {"planfly": mine}, front
    task = contest.task
    own = task.to_vectors(np.array(list(seed_paths(task, np.array(front.default.plan.waypoints)))))
    start = contest.certified(task.to_paths(own))
    rows = {"planfly": mine, "our seeds alone": Row(contest.share(start), len(start), len(own), 0.0)}
    none = own[:0]
    # Seeds in the order of their contributions to the hypervolume, infeasible ones last.
    objectives, violations = task.scores(task.to_paths(own))
    met = np.flatnonzero((violations <= 0.0).all(axis=1))
    first = met[covering_order(objectives[met], contest.reference, len(met))]
    covering_first = np.concatenate([own[first], np.delete(own, first, axis=0)])
    for algorithm in ("NSGA-II", "MOEA/D"):
        for suffix, given in [("", none)] * alone + [(" from our seeds", covering_first)]:
            rows[f"{algorithm}{suffix}, equal CPU"] = theirs(contest, algorithm, seed, None, mine.seconds, given)
            if algorithm == "NSGA-II" or whole:
                key = f"{algorithm}{suffix}, equal evaluations"
                rows[key] = theirs(contest, algorithm, seed, mine.evaluations, None, given)
    return rows, front


def main() -> None:
    """Measure every problem."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.fronts")
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--from", dest="first", type=int, default=FIRST_SEED)
    parser.add_argument("--whole", action="store_true", help="MOEA/D at equal evaluations, too: half a minute a seed")
    parser.add_argument("--fresh", action="store_true", help="twelve random instances, too")
    parser.add_argument("--json", type=Path, help="file for the rows")
    args = parser.parse_args()
    seeds = range(args.first, args.first + args.seeds)
    record = {name: measure(name, seeds, whole=args.whole) for name in args.problems.split(",")}
    if args.fresh:
        record |= {name: measure(name, seeds[:1], whole=args.whole, alone=False) for name in FRESH}
    if args.json:
        args.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
