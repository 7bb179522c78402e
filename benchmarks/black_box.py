"""Compare `planfly.optimise` on published black-box problems with the defaults of pymoo and cmaes.

``python -m benchmarks.black_box [--seeds N] functions``: functions of the CEC 2005 kind (Suganthan et al., Nanyang
Technological University 2005) in 20 variables, each shifted and rotated by its own seed; the median error of each
method.  Three seeds take four minutes of CPU time.  Each result is stored in ``--kept FILE`` at once, and not computed
again; a line of progress for each function is written to the standard error.

``python -m benchmarks.black_box [--seeds N] bbob``: the same for the 24 functions of BBOB in 20 variables, as the
package coco-experiment computes them (Hansen and others, "COCO: a platform for comparing continuous optimizers in a
black-box setting", Optimization Methods and Software 36, 2021); each seed is a different instance.

``python -m benchmarks.black_box paths TERRAIN [--seeds N]``: the cost of Phung and Ha, "Safety-enhanced UAV path
planning with spherical vector-based particle swarm optimization", Applied Soft Computing 107, 2021, on the scenario
of their program SPSO.  TERRAIN is its elevation file, ChrismasTerrain.tif, which is public with that program.  Ten
waypoints are encoded in three ways: distances and bearings, as in the paper, at a height of 150 m (20 variables); the
same with climb angles (30); and offsets from the straight line, with heights (20).
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

import planfly
from planfly.api.optimising import Model
from world.arrays import Floats
from world.kernels import compiled

Cost = Callable[[Floats], Floats]

# Number of variables of a function.
VARIABLES = 20
# Evaluations of each method on a path.
EVALUATIONS = 100_000
# Functions of BBOB, by number.
BBOB = {
    1: "sphere",
    2: "ellipsoid",
    3: "Rastrigin",
    4: "Büche-Rastrigin",
    5: "linear slope",
    6: "attractive sector",
    7: "step ellipsoid",
    8: "Rosenbrock",
    9: "Rosenbrock, turned",
    10: "ellipsoid, turned",
    11: "discus",
    12: "bent cigar",
    13: "sharp ridge",
    14: "different powers",
    15: "Rastrigin, turned",
    16: "Weierstrass",
    17: "Schaffers F7",
    18: "Schaffers F7, ill-conditioned",
    19: "Griewank-Rosenbrock",
    20: "Schwefel",
    21: "Gallagher, 101 peaks",
    22: "Gallagher, 21 peaks",
    23: "Katsuura",
    24: "Lunacek, two funnels",
}
# Evaluations of each method on a function.
ON_FUNCTIONS = 50_000
# Default file of stored results.
KEPT = Path("runs") / "black-box-functions.json"
MODELS: tuple[Model, ...] = ("multistart", "umda", "emna", "differential")
# First seed; nothing was tuned on seeds from here on.
FIRST_SEED = 100

# The paper's scenario, in cells of its terrain, counted from 1.  Start: east, north, m above ground.
START = (200.0, 100.0, 150.0)
# End: east, north, m above ground.
END = (800.0, 800.0, 150.0)
# Cylinders: east, north, radius.
CYLINDERS = np.array(
    [
        [400.0, 500.0, 80.0],
        [600.0, 200.0, 70.0],
        [500.0, 350.0, 80.0],
        [350.0, 200.0, 70.0],
        [700.0, 550.0, 70.0],
        [650.0, 750.0, 80.0],
    ]
)
# Lowest height of a path, m above ground.
LOW = 100.0
# Highest height of a path, m above ground.
HIGH = 200.0
# Number of waypoints between the ends.
NODES = 10
# Size of the vehicle, in cells.
SIZE = 1.0
# Margin around a cylinder, in cells.
MARGIN = 10.0
# Weight of the length.
PER_LENGTH = 5.0
# Weight of the height.
PER_HEIGHT = 10.0
# Turn, and change of climb angle, above which a cost is added, degrees.
STEEP = 45.0


@compiled
def path_cost(nodes: Floats, ground: Floats, cylinders: Floats) -> float:
    """Return the cost of a path (w, 3), in cells and m above ground: length, cylinders, heights and turns.

    The cost is infinite for a path through a cylinder.
    """
    count = nodes.shape[0]
    up = np.empty(count)
    for i in range(count):
        up[i] = nodes[i, 2] + ground[int(nodes[i, 1] + 0.5) - 1, int(nodes[i, 0] + 0.5) - 1]
    length, danger, heights, turns = 0.0, 0.0, 0.0, 0.0
    for i in range(count - 1):
        east, north = nodes[i + 1, 0] - nodes[i, 0], nodes[i + 1, 1] - nodes[i, 1]
        length += math.sqrt(east * east + north * north + (up[i + 1] - up[i]) ** 2)
        for k in range(cylinders.shape[0]):
            to_east, to_north = cylinders[k, 0] - nodes[i, 0], cylinders[k, 1] - nodes[i, 1]
            squared = east * east + north * north
            share = min(1.0, max(0.0, (to_east * east + to_north * north) / squared)) if squared > 0.0 else 0.0
            away = math.hypot(to_east - share * east, to_north - share * north) - cylinders[k, 2] - SIZE
            if away < 0.0:
                return math.inf
            danger += max(0.0, MARGIN - away)
    for i in range(1, count - 1):
        heights += abs(nodes[i, 2] - 0.5 * (LOW + HIGH))
        a_east, a_north = nodes[i, 0] - nodes[i - 1, 0], nodes[i, 1] - nodes[i - 1, 1]
        b_east, b_north = nodes[i + 1, 0] - nodes[i, 0], nodes[i + 1, 1] - nodes[i, 1]
        turn = math.degrees(math.atan2(abs(a_east * b_north - a_north * b_east), a_east * b_east + a_north * b_north))
        before = math.atan2(up[i] - up[i - 1], math.hypot(a_east, a_north))
        bend = abs(math.degrees(math.atan2(up[i + 1] - up[i], math.hypot(b_east, b_north)) - before))
        turns += (turn if turn > STEEP else 0.0) + (bend if bend > STEEP else 0.0)
    return PER_LENGTH * length + danger + PER_HEIGHT * heights + turns


@compiled
def path_costs(paths: Floats, ground: Floats, cylinders: Floats) -> Floats:
    """Return the costs (n,) of paths (n, w, 3)."""
    out = np.empty(paths.shape[0])
    for k in range(out.size):
        out[k] = path_cost(paths[k], ground, cylinders)
    return out


def by_bearing(rows: Floats, ground: Floats) -> Floats:
    """Decode paths (n, 12, 3) from distances, [climb angles,] and bearings (n, 20 or 30).

    The decoding is that of `SphericalToCart.m`.
    """
    distance, bearing = rows[:, :NODES], rows[:, -NODES:]
    climb = rows[:, NODES:-NODES] if rows.shape[1] > 2 * NODES else np.zeros_like(distance)
    steps = (distance * np.cos(climb) * np.sin(bearing), distance * np.cos(climb) * np.cos(bearing))
    paths = np.empty((len(rows), NODES + 2, 3))
    paths[:, 0], paths[:, -1] = START, END
    limits = (1.0, ground.shape[1]), (1.0, ground.shape[0]), (LOW, HIGH)
    for k in range(NODES):
        for axis, step in enumerate((*steps, distance * np.sin(climb))):
            paths[:, k + 1, axis] = np.clip(paths[:, k, axis] + step[:, k], *limits[axis])
    return paths


def by_offset(rows: Floats, ground: Floats) -> Floats:
    """Decode paths (n, 12, 3) from offsets to the left of the straight line, and heights (n, 20).

    The points are at equal steps along the line.
    """
    start, displacement = np.array(START), np.array(END) - np.array(START)
    left = np.array([-displacement[1], displacement[0]]) / math.hypot(displacement[0], displacement[1])
    paths = np.empty((len(rows), NODES + 2, 3))
    paths[:, 0], paths[:, -1] = START, END
    along = start[:2] + np.linspace(0.0, 1.0, NODES + 2)[1:-1, None] * displacement[:2]
    paths[:, 1:-1, :2] = np.clip(along + rows[:, :NODES, None] * left, 1.0, (ground.shape[1], ground.shape[0]))
    paths[:, 1:-1, 2] = rows[:, NODES:]
    return paths


def path_boxes() -> dict[str, tuple[Callable[[Floats, Floats], Floats], Floats, Floats]]:
    """Return the decoder of a path and the box of its variables, by name of the encoding."""
    displacement = np.array(END[:2]) - np.array(START[:2])
    ahead, reach = math.atan2(displacement[1], displacement[0]), 2.0 * math.hypot(*displacement) / NODES
    distance, quarter = (np.zeros(NODES), np.full(NODES, reach)), np.full(NODES, 0.25 * math.pi)
    low, high = (distance[0], ahead - quarter), (distance[1], ahead + quarter)
    offset = np.full(NODES, 450.0)
    return {
        "distances and bearings (20)": (by_bearing, np.concatenate(low), np.concatenate(high)),
        "with climb angles (30)": (
            by_bearing,
            np.concatenate([low[0], -quarter, low[1]]),
            np.concatenate([high[0], quarter, high[1]]),
        ),
        "offsets and heights (20)": (
            by_offset,
            np.concatenate([-offset, np.full(NODES, LOW)]),
            np.concatenate([offset, np.full(NODES, HIGH)]),
        ),
    }


def measure_paths(terrain: Path, seeds: int) -> None:
    """Print the median and the worst cost of each model, for each encoding of a path."""
    with Image.open(terrain) as picture:
        ground = np.maximum(np.asarray(picture, dtype=np.float64), 0.0)
    for name, (decode, low, high) in path_boxes().items():
        print(f"paths by {name}: {EVALUATIONS:,} evaluations, {seeds} seeds; median, worst")

        def cost(rows: Floats, decode: Callable[[Floats, Floats], Floats] = decode) -> Floats:
            """Return the costs of paths, decoded from rows of variables."""
            return np.asarray(path_costs(decode(rows, ground), ground, CYLINDERS))

        for model in MODELS:
            values = [
                planfly.optimise(low, high, model=model, seed=seed).minimise(cost, evaluations=EVALUATIONS).value
                for seed in range(FIRST_SEED, FIRST_SEED + seeds)
            ]
            print(f"  {model:14s} {np.median(values):9.1f} {max(values):9.1f}", flush=True)


def functions(seed: int) -> dict[str, Cost]:
    """Make functions of points (n, d) in [-5, 5], each with a minimum of 0, shifted and rotated by a seed."""
    rng = np.random.default_rng(seed)
    bottom = rng.uniform(-4.0, 4.0, VARIABLES)
    turn = np.linalg.qr(rng.standard_normal((VARIABLES, VARIABLES)))[0]
    scales = 10.0 ** (6.0 * np.arange(VARIABLES) / (VARIABLES - 1))

    def turned(points: Floats) -> Floats:
        """Shift and rotate points."""
        return np.asarray((points - bottom) @ turn)

    def rosenbrock(points: Floats) -> Floats:
        """Return Rosenbrock's function of points."""
        z = turned(points) * 0.4 + 1.0
        return np.asarray((100.0 * (z[:, 1:] - z[:, :-1] ** 2) ** 2 + (z[:, :-1] - 1.0) ** 2).sum(axis=1))

    def rastrigin(points: Floats) -> Floats:
        """Return Rastrigin's function of points."""
        z = turned(points)
        return np.asarray((z**2 + 10.0 * (1.0 - np.cos(2.0 * np.pi * z))).sum(axis=1))

    def ackley(points: Floats) -> Floats:
        """Return Ackley's function of points."""
        z = turned(points) * 6.0
        ripples = np.exp(np.cos(2.0 * np.pi * z).mean(axis=1))
        return np.asarray(20.0 * (1.0 - np.exp(-0.2 * np.sqrt((z**2).mean(axis=1)))) + math.e - ripples)

    def griewank(points: Floats) -> Floats:
        """Return Griewank's function of points."""
        z = turned(points) * 120.0
        waves = np.cos(z / np.sqrt(np.arange(1, VARIABLES + 1))).prod(axis=1)
        return np.asarray((z**2).sum(axis=1) / 4000.0 - waves + 1.0)

    return {
        "sphere": lambda points: ((points - bottom) ** 2).sum(axis=1),
        "ellipsoid": lambda points: (scales * turned(points) ** 2).sum(axis=1),
        "Rosenbrock": rosenbrock,
        "Rastrigin": rastrigin,
        "Ackley": ackley,
        "Griewank": griewank,
    }


def bbob_functions(seed: int) -> dict[str, Cost]:
    """Make functions for the errors of points (n, d) in [-5, 5] on BBOB, in the instance of a seed."""
    from cocoex import BareProblem

    def cost(number: int) -> Cost:
        """Make the function of a BBOB problem: the error of points."""
        problem = BareProblem("bbob", number, VARIABLES, seed)
        least = float(problem.best_value())
        return lambda points: np.array([problem(point) for point in points]) - least

    return {f"{number} {name}": cost(number) for number, name in BBOB.items()}


def by_model(model: Model, cost: Cost, seed: int) -> float:
    """Return the smallest value found by `planfly.optimise`."""
    search = planfly.optimise([-5.0] * VARIABLES, [5.0] * VARIABLES, model=model, seed=seed)
    return search.minimise(cost, evaluations=ON_FUNCTIONS).value


def by_cmaes(cost: Cost, seed: int) -> float:
    """Return the smallest value that `cmaes.CMA` finds, starting at the centre, with random restarts.

    The initial distribution is a sixth of the box wide.
    """
    from cmaes import CMA

    bounds, rng = np.tile([-5.0, 5.0], (VARIABLES, 1)), np.random.default_rng(seed)
    search = CMA(mean=np.zeros(VARIABLES), sigma=10.0 / 6.0, bounds=bounds, seed=seed)
    least, evaluations = math.inf, 0
    while evaluations < ON_FUNCTIONS:
        if search.should_stop():
            mean = rng.uniform(-5.0, 5.0, VARIABLES)
            search = CMA(mean=mean, sigma=10.0 / 6.0, bounds=bounds, seed=int(rng.integers(2**31)))
        points = np.array([search.ask() for _ in range(search.population_size)])
        values = cost(points)
        search.tell(list(zip(points, values.tolist(), strict=True)))
        least, evaluations = min(least, float(values.min())), evaluations + len(points)
    return least


def by_pymoo(name: str, cost: Cost, seed: int) -> float:
    """Return the smallest value of an algorithm of pymoo with its defaults."""
    from pymoo.algorithms.soo.nonconvex.de import DE
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.algorithms.soo.nonconvex.pso import PSO
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Box(Problem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=VARIABLES, n_obj=1, xl=-5.0, xu=5.0)

        def _evaluate(self, x: Floats, out: dict[str, Floats], *_: object, **__: object) -> None:
            out["F"] = cost(x)

    found = minimize(Box(), {"DE": DE, "GA": GA, "PSO": PSO}[name](), ("n_eval", ON_FUNCTIONS), seed=seed)
    return float(found.F[0])


def measure_functions(made: Callable[[int], dict[str, Cost]], seeds: int, kept: Path) -> None:
    """Print the median error of every method on every function, with the stored results of earlier runs."""
    methods: dict[str, Callable[[Cost, int], float]] = {model: partial(by_model, model) for model in MODELS}
    methods |= {"cmaes": by_cmaes} | {f"pymoo {name}": partial(by_pymoo, name) for name in ("DE", "GA", "PSO")}
    kept.parent.mkdir(exist_ok=True)
    known: dict[str, float] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    print(f"functions in {VARIABLES} variables: median error after {ON_FUNCTIONS:,} evaluations, {seeds} seeds")
    print(f"{'':32s}" + "".join(f"{name:>13s}" for name in methods), flush=True)
    for function in made(FIRST_SEED):
        row, began = [], time.process_time()
        for name, method in methods.items():
            values = []
            for seed in range(FIRST_SEED, FIRST_SEED + seeds):
                key = f"{function}, {name}, {ON_FUNCTIONS}, {seed}"
                if key not in known:
                    known[key] = method(made(seed)[function], seed)
                    kept.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
                values.append(known[key])
            row.append(float(np.median(values)))
        print(f"{function:32s}" + "".join(f"{value:13.2g}" for value in row), flush=True)
        print(f"  {function}: {time.process_time() - began:.0f} s of CPU", file=sys.stderr, flush=True)


def main() -> None:
    """Measure the requested part."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.black_box")
    parser.add_argument("--seeds", type=int, default=10)
    parts = parser.add_subparsers(dest="part", required=True)
    for name in ("functions", "bbob"):
        parts.add_parser(name).add_argument("--kept", type=Path, default=KEPT, help="file that keeps the results")
    parts.add_parser("paths").add_argument("terrain", type=Path)
    args = parser.parse_args()
    if args.part == "paths":
        measure_paths(args.terrain, args.seeds)
    else:
        measure_functions(bbob_functions if args.part == "bbob" else functions, args.seeds, args.kept)


if __name__ == "__main__":
    main()
