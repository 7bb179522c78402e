"""Rank `planfly.optimise` and outside optimisers on the problems of Shehadeh and Kudela.

``python -m benchmarks.planning.public_ranking [--seed SEED] [--instances N] [--runs N] [--budgets B,...] [--methods
NAME,...]`` gives every method the same number of evaluations on each instance of
`benchmarks.planning.public_instances` and prints, for each budget, three figures of the paper: the number of instances
on which a method found the best value of all methods, the mean relative error to that value, and the mean of Friedman's
ranks (1 is best, ties share their mean rank).  The value of a method on an instance is the mean of its runs.

The outside methods are SciPy's, cmaes with restarts, and minionpy's (L-SHADE, jSO and others); install ``cmaes
minionpy`` for them.  SciPy's shgo is left out: its complex in 30 variables does not end within minutes.  Start it with
``OPENBLAS_NUM_THREADS=1``: the triangulation solves thousands of tiny systems, which threads slow down a hundredfold.
Every result is stored in ``--kept FILE``, and not computed again.
"""

import argparse
import contextlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy import optimize
from scipy.stats import rankdata

import planfly
from benchmarks.planning.public_instances import INSTANCE_COUNT, PACKAGE_SEED, PublicInstance, make_instances
from benchmarks.planning.public_planner import plan_public
from planfly.api.optimising import Model
from world.arrays import Floats

# Evaluations of a run: 2,500 is the budget of metaevobox for these problems.
BUDGETS = (2_500, 20_000)
# Default folder of generated instances.
INSTANCES = Path("runs") / "public-instances"
# Default file of stored results.
KEPT = Path("runs") / "public-ranking.json"
# First seed of the runs.
FIRST_SEED = 100
# Relative difference below which a value equals the best one.
EQUAL = 1e-9
MODELS: tuple[Model, ...] = ("umda", "emna", "multistart", "partial", "differential")
# Names in minionpy of its methods.
MINION = ("LSHADE", "jSO", "NLSHADE_RSP", "j2020", "AGSK", "IMODE", "LSRTDE", "ARRDE", "JADE", "ABC", "SPSO2011")


class BudgetSpentError(Exception):
    """All evaluations of the budget have been used."""


@dataclass
class CountedCost:
    """Cost of an instance that counts evaluations and keeps the smallest value within the budget."""

    instance: PublicInstance
    budget: int
    spent: int = 0
    least: float = field(default=math.inf)

    def __call__(self, vectors: Any) -> Floats:
        """Return the costs (n,) of vectors (n, 30); raise BudgetSpentError if there were no evaluations left."""
        if self.spent >= self.budget:
            raise BudgetSpentError
        points = np.clip(np.asarray(vectors, dtype=np.float64), self.instance.lower, self.instance.upper)
        values = self.instance.costs(points)
        self.least = min(self.least, float(values[: self.budget - self.spent].min()))
        self.spent += len(points)
        return values

    def one(self, vector: Any) -> float:
        """Return the cost of one vector (30,)."""
        return float(self(np.asarray(vector)[None])[0])


Method = Callable[[CountedCost, int], object]


def by_model(model: Model, cost: CountedCost, seed: int) -> None:
    """Run `planfly.optimise`."""
    search = planfly.optimise(cost.instance.lower, cost.instance.upper, model=model, seed=seed)
    search.minimise(cost, evaluations=cost.budget)


def by_planner(cost: CountedCost, seed: int) -> None:
    """Plan with the parts of planfly's planner, which read threats and ground."""
    plan_public(cost.instance, cost, cost.budget, np.random.default_rng(seed))


def by_cmaes(cost: CountedCost, seed: int) -> None:
    """Run cmaes from the centre, a sixth of the box wide, with restarts from random points."""
    from cmaes import CMA

    lower, width = cost.instance.lower, cost.instance.upper - cost.instance.lower
    bounds, rng = np.tile([0.0, 1.0], (lower.size, 1)), np.random.default_rng(seed)
    mean = np.full(lower.size, 0.5)
    while True:
        search = CMA(mean=mean, sigma=1.0 / 6.0, bounds=bounds, seed=int(rng.integers(2**31)))
        while not search.should_stop():
            points = np.array([search.ask() for _ in range(search.population_size)])
            values = cost(lower + points * width)
            search.tell(list(zip(points, values.tolist(), strict=True)))
        mean = rng.random(lower.size)


def by_minion(name: str, cost: CountedCost, seed: int) -> None:
    """Run a method of minionpy with its defaults."""
    from minionpy import Minimizer

    bounds = list(zip(cost.instance.lower.tolist(), cost.instance.upper.tolist(), strict=True))

    def costs(vectors: Any) -> list[float]:
        """Return the costs of vectors; inf once the budget is spent."""
        # An exception must not pass through the package's compiled loop.
        return [math.inf] * len(vectors) if cost.spent >= cost.budget else cost(vectors).tolist()

    Minimizer(costs, bounds, algo=name, maxevals=cost.budget, seed=seed).optimize()


def by_scipy(name: str, cost: CountedCost, seed: int) -> None:
    """Run a method of SciPy with its defaults, and no limit but the budget."""
    bounds = optimize.Bounds(cost.instance.lower, cost.instance.upper)
    endless = 10**9
    if name == "differential_evolution":
        optimize.differential_evolution(
            lambda x: cost(x.T), bounds, rng=seed, maxiter=endless, tol=0.0, vectorized=True, updating="deferred"
        )
    elif name == "dual_annealing":
        optimize.dual_annealing(cost.one, bounds, rng=seed, maxiter=endless)
    else:
        # SciPy allocates its tables by the number of iterations, each of which takes at least two evaluations.
        limits = {"maxfun": cost.budget, "maxiter": cost.budget // 2, "vol_tol": 0.0, "len_tol": 0.0}
        optimize.direct(cost.one, bounds, locally_biased=name == "DIRECT-L", **limits)


def make_methods() -> dict[str, Method]:
    """Return all methods by name."""
    methods: dict[str, Method] = {f"planfly {model}": partial(by_model, model) for model in MODELS}
    methods |= {"planfly planner": by_planner, "cmaes": by_cmaes}
    methods |= {f"minionpy {name}": partial(by_minion, name) for name in MINION}
    names = ("differential_evolution", "dual_annealing", "DIRECT", "DIRECT-L")
    return methods | {f"scipy {name}": partial(by_scipy, name) for name in names}


def run(method: Method, instance: PublicInstance, budget: int, seed: int) -> float:
    """Return the smallest cost that a method finds within a budget."""
    cost = CountedCost(instance, budget)
    with contextlib.suppress(BudgetSpentError):
        method(cost, seed)
    return cost.least


def rank_methods(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Return wins, mean relative errors and mean ranks (m,) of methods with values (instances, m)."""
    best = values.min(axis=1, keepdims=True)
    errors = values / best - 1.0
    return (errors <= EQUAL).sum(axis=0), errors.mean(axis=0), rankdata(values, axis=1).mean(axis=0)


def print_table(names: list[str], values: Floats) -> None:
    """Print the figures of all methods, the smallest mean rank first."""
    wins, errors, ranks = rank_methods(values)
    medians = np.median(values / values.min(axis=1, keepdims=True) - 1.0, axis=0)
    print(f"{'method':32s}{'best':>6s}{'mean error':>12s}{'median':>9s}{'rank':>7s}")
    for k in np.argsort(ranks):
        print(f"{names[k]:32s}{wins[k]:6d}{errors[k]:12.4f}{medians[k]:9.4f}{ranks[k]:7.2f}")


def main() -> None:
    """Measure the requested methods, and print a table for each budget."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.public_ranking")
    parser.add_argument("--seed", type=int, default=PACKAGE_SEED, help="seed of the generated instances")
    parser.add_argument("--instances", type=int, default=INSTANCE_COUNT)
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--budgets", default=",".join(map(str, BUDGETS)))
    parser.add_argument("--methods", default=",".join(make_methods()))
    parser.add_argument("--folder", type=Path, default=INSTANCES, help="folder of the generated instances")
    parser.add_argument("--kept", type=Path, default=KEPT, help="file of the stored results")
    args = parser.parse_args()
    instances = make_instances(args.seed, args.instances, args.folder)
    methods, names = make_methods(), args.methods.split(",")
    known: dict[str, float] = json.loads(args.kept.read_text(encoding="utf-8")) if args.kept.exists() else {}
    args.kept.parent.mkdir(parents=True, exist_ok=True)
    for budget in map(int, args.budgets.split(",")):
        values = np.zeros((len(instances), len(names)))
        for column, name in enumerate(names):
            for row, instance in enumerate(instances):
                for seed in range(FIRST_SEED, FIRST_SEED + args.runs):
                    key = f"{args.seed}, {row} of {args.instances}, {name}, {budget}, {seed}"
                    if key not in known:
                        known[key] = run(methods[name], instance, budget, seed)
                    values[row, column] += known[key] / args.runs
            args.kept.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
        print(f"\n{budget:,} evaluations, {len(instances)} instances of seed {args.seed}, {args.runs} run(s) each")
        print_table(names, values)


if __name__ == "__main__":
    main()
