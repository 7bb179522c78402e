"""Compare fronts of planfly's optimisers and of pymoo's on the environments of Darlan and others.

``python -m benchmarks.planning.public_fronts [--maps FOLDER] [--seeds N] [--methods NAME;...]`` lets every method
search length and mean height (`benchmarks.planning.public_environments`) with the published budget: 10,020 evaluations,
which are 500 generations of 20.  ``--maps`` is the folder ``problems`` of the published repository; without it, six
environments are generated with ``--map-seed``.

The methods of planfly are `planner.optimisers.front_sampling`, which `planfly plan --front` uses, and
`planfly.optimise`, once with both objectives and once with a weighted sum for each of 20 weights.  pymoo's NSGA-II and
MOEA/D have the published operators: crossover and mutation with an index of 20, a third of the variables mutated, and
the control points of each child sorted by east or by north.  "From our paths" and "reads the ground" mean that the
search begins with 20 routes over the cells, the cheapest for 20 weights of height (`route_vectors`).  "plan --front"
plans a front over the map as a scenario (`make_scenario`); its own budget is larger, and its objectives are not these.

Of all paths that a method evaluates, the 20 that together cover most are its front.  Two figures are printed, both as
the median over the seeds: the published hypervolume, whose box ends at 4,400 for both objectives, so that all methods
look alike; and the share of the gain, which is 0 for the straight path alone and 1 for all fronts of all methods
together.  Every front is stored in ``--kept FILE``, and not computed again.
"""

import argparse
import contextlib
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.stats import rankdata

import planfly
from benchmarks.planning.public_environments import (
    MAP_CELLS,
    PLACE_COUNT,
    Environment,
    make_environments,
    read_environment,
    spline_basis,
)
from benchmarks.planning.public_ranking import MODELS, BudgetSpentError
from planfly.api.optimising import Model
from planfly.workflow.uav import load_uav
from planner.optimisers.front_sampling import FrontSampling
from planner.optimisers.hypervolume import covering_order, hypervolume
from planner.search.plan_front import POPULATION_SIZE, noise_directions, plan_front
from world.arrays import Floats
from world.scenario import Scenario, scenario_from_spec
from world.terrain import make_gridded_terrain

# Generations after the first population, as published.
GENERATION_COUNT = 500
# Population, as published, and number of paths of a front.
FRONT_SIZE = 20
# Evaluations of each method.
BUDGET = (GENERATION_COUNT + 1) * FRONT_SIZE
# Corner of the published hypervolume, for both objectives.
PUBLISHED_REFERENCE = 1.1 * 4000.0
# Length of the box that a front's paths are chosen for, relative to the range of their values.
BOX_FACTOR = 1.1
# Objectives beyond this multiple of those of the straight line are ignored by the front search.
REFERENCE_RATIO = 1.5
# Largest deviation of the front search's noise, in cells.
NOISE_CELLS = 20.0
# Size of the archive of the front search.
ARCHIVE_SIZE = 100
# Samples of the first generation of the front search: what the budget leaves of whole populations.
FIRST_SIZE = BUDGET % POPULATION_SIZE
# Side of a cell of a scenario, m.
CELL_M = 20.0
# Cells of ground around the area of a scenario.
EDGE_CELLS = 10
# Height of a scenario's ends above the safe height, m.
END_MARGIN_M = 30.0
# Waypoints of a scenario's plan, both ends included.
WAYPOINT_COUNT = 12
# Weights of height of the routes, per cell of height.
HEIGHT_WEIGHTS = np.geomspace(1e-4, 1.0, FRONT_SIZE)
# Neighbours of a weight in MOEA/D.
NEIGHBOUR_COUNT = 2
# Weight of violations in MOEA/D's objectives, which are relative to those of the straight line.
PENALTY = 100.0
# First seed of the runs.
FIRST_SEED = 100
# Seed of the generated environments.
MAP_SEED = 3900
# Default file of stored fronts.
KEPT = Path("runs") / "public-fronts.json"


@dataclass
class CountedScores:
    """Objectives of an environment that count evaluations, and keep the allowed values within the budget."""

    environment: Environment
    spent: int = 0
    kept: list[Floats] = field(default_factory=list)

    def __call__(self, vectors: Any) -> tuple[Floats, Floats]:
        """Return objectives (n, 2) and violations (n,).

        Raises BudgetSpentError if no evaluations are left.
        """
        return self.count(self.environment.tracks(np.asarray(vectors, dtype=np.float64)))

    def count(self, tracks: Floats) -> tuple[Floats, Floats]:
        """Return the same for paths with places (n, 201, 2)."""
        if self.spent >= BUDGET:
            raise BudgetSpentError
        objectives, violations = self.environment.score(tracks)
        is_counted = (violations <= 0.0) & (np.arange(len(violations)) < BUDGET - self.spent)
        self.kept.append(objectives[is_counted])
        self.spent += len(objectives)
        return objectives, violations

    def allowed(self, vectors: Any) -> Floats:
        """Return objectives (n, 2), infinite for paths that turn too sharply."""
        objectives, violations = self(vectors)
        return np.where(violations[:, None] > 0.0, np.inf, objectives)

    def front(self) -> Floats:
        """Return the objectives (n, 2) of the 20 non-dominated paths that together cover most."""
        values = np.unique(np.concatenate(self.kept), axis=0)
        values = values[values[:, 1] < np.minimum.accumulate(np.append(np.inf, values[:-1, 1]))]
        if len(values) <= FRONT_SIZE:
            return np.asarray(values)
        reference = values.min(axis=0) + BOX_FACTOR * np.ptp(values, axis=0)
        return np.asarray(values[np.sort(covering_order(values, reference, FRONT_SIZE))])


Method = Callable[[CountedScores, int], object]


def straight_values(environment: Environment) -> Floats:
    """Return the objectives (2,) of the path along the straight line."""
    inner = np.linspace(1.0, MAP_CELLS, environment.control_count)[1:-1]
    return environment.scores(np.repeat(inner, 2)[None])[0][0]


def list_routes(environment: Environment) -> Iterator[Floats]:
    """Yield the places (k, 2) of the cheapest route over the cells for each weight of height."""
    heights = environment.ground + environment.safe_height
    cells = np.arange(MAP_CELLS**2).reshape(MAP_CELLS, MAP_CELLS)
    pairs = [(cells[:, :-1], cells[:, 1:]), (cells[:-1], cells[1:])]
    pairs += [(cells[:-1, :-1], cells[1:, 1:]), (cells[:-1, 1:], cells[1:, :-1])]
    froms, tos = (np.concatenate([pair[side].ravel() for pair in pairs]) for side in (0, 1))
    level = np.hypot(froms % MAP_CELLS - tos % MAP_CELLS, froms // MAP_CELLS - tos // MAP_CELLS)
    low, high = heights.ravel()[froms], heights.ravel()[tos]
    for weight in HEIGHT_WEIGHTS:
        costs = np.hypot(level, high - low) * (1.0 + weight * 0.5 * (low + high))
        _, previous = dijkstra(
            csr_array((costs, (froms, tos)), shape=(cells.size, cells.size)),
            directed=False,
            indices=0,
            return_predecessors=True,
        )
        route = [cells.size - 1]
        while route[-1] != 0:
            route.append(int(previous[route[-1]]))
        cell = np.array(route[::-1])
        yield np.column_stack([cell % MAP_CELLS, cell // MAP_CELLS]) + 1.0


def route_vectors(environment: Environment) -> Floats:
    """Return the vectors (20, d) of the splines that are nearest to the cheapest routes."""
    basis = spline_basis(environment.control_count)
    vectors = []
    for route in list_routes(environment):
        rest = even_places(route) - basis[:, :1] * route[0] - basis[:, -1:] * route[-1]
        inner = np.linalg.lstsq(basis[:, 1:-1], rest, rcond=None)[0]
        vectors.append(np.clip(inner.ravel(), environment.lower, environment.upper))
    return np.array(vectors)


def first_population(environment: Environment, size: int, seed: int, *, reads_ground: bool) -> Floats:
    """Return the first vectors (size, d) of a search: routes if it reads the ground, and random vectors."""
    first = environment.first_vectors(size, np.random.default_rng(seed))
    if reads_ground:
        first[:FRONT_SIZE] = route_vectors(environment)
    return first


def search_front(scores: CountedScores, seed: int, *, reads_ground: bool) -> None:
    """Run the search of `planfly plan --front` on the control points."""
    environment = scores.environment
    inner_count = environment.control_count - 2
    noise = noise_directions(inner_count, np.full(3, NOISE_CELLS)).reshape(-1, 3, inner_count, 3)
    search = FrontSampling(
        environment.lower,
        environment.upper,
        noise[:, :2, :, :2].reshape(-1, 2 * inner_count),
        REFERENCE_RATIO * straight_values(environment),
        2,
        ARCHIVE_SIZE,
        POPULATION_SIZE,
        np.random.default_rng(seed),
    )
    vectors = first_population(environment, FIRST_SIZE, seed, reads_ground=reads_ground)
    while True:
        objectives, violations = scores(vectors)
        search.tell(vectors, objectives, violations[:, None])
        # Before the first path within the reference, only random vectors can be drawn.
        if len(search.vectors):
            vectors = search.ask()
        else:
            vectors = environment.first_vectors(FIRST_SIZE, np.random.default_rng([seed, scores.spent]))


def make_scenario(environment: Environment) -> Scenario:
    """Return an environment as a scenario for the Aerosonde.

    Its cells are stretched to 20 m; its heights are in m.
    """
    side = (MAP_CELLS - 1) * CELL_M
    axis = np.arange(-EDGE_CELLS, MAP_CELLS + EDGE_CELLS) * CELL_M
    ground = np.pad(environment.ground, EDGE_CELLS, mode="edge")
    terrain = make_gridded_terrain(ground, axis, axis, source=environment.name, sha256="", datum="mean sea level")
    height = environment.safe_height + END_MARGIN_M
    spec = {
        "name": environment.name,
        "terrain": {"kind": "flat", "amsl_m": 0.0},
        "area": {"east_m": [0.0, side], "north_m": [0.0, side], "ceiling_amsl_m": ground.max() + 2.0 * height},
        "limits": {"min_clearance_m": environment.safe_height},
        "planner": {"waypoints": WAYPOINT_COUNT},
        "flight": {"aircraft": "aerosonde"},
        "start": {"east_m": 0.0, "north_m": 0.0, "height_m": height},
        "destination": {"east_m": side, "north_m": side, "height_m": height},
    }
    return scenario_from_spec(spec, environment.name, ground=terrain)


def plan_and_score(scores: CountedScores, seed: int) -> None:
    """Plan a front of 20 as `planfly plan --front` does, and score the routes of its plans.

    The routes are scored at the published heights.
    """
    scenario = make_scenario(scores.environment)
    front = plan_front(scenario, load_uav(scenario).limits.with_margin(), FRONT_SIZE, seed=seed)
    routes = [np.asarray(one.plan.waypoints)[:, :2] / CELL_M + 1.0 for one in front.plans]
    scores.count(np.clip([even_places(route) for route in routes], 1.0, float(MAP_CELLS)))


def even_places(route: Floats) -> Floats:
    """Return 201 places at equal steps along a route (k, 2)."""
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(route, axis=0).T)))
    at = np.linspace(0.0, lengths[-1], PLACE_COUNT)
    return np.column_stack([np.interp(at, lengths, route[:, axis]) for axis in range(2)])


def optimise_both(model: Model, scores: CountedScores, seed: int) -> None:
    """Run `planfly.optimise` with both objectives, which are compared by dominance."""
    environment = scores.environment
    initial = first_population(environment, 100, seed, reads_ground=False)
    search = planfly.optimise(environment.lower, environment.upper, model=model, seed=seed, initial=initial)
    search.minimise(scores.allowed, evaluations=BUDGET)


def optimise_weighted(model: Model, scores: CountedScores, seed: int) -> None:
    """Run `planfly.optimise` once for each of 20 weights of length and height.

    Length and height are relative to the straight line's.
    """
    environment, scale = scores.environment, straight_values(scores.environment)
    for number in range(FRONT_SIZE):
        weight = (number + 0.5) / FRONT_SIZE
        weights = np.array([weight, 1.0 - weight]) / scale
        first = first_population(environment, FRONT_SIZE, FRONT_SIZE * seed + number, reads_ground=False)
        search = planfly.optimise(
            environment.lower, environment.upper, model=model, population=FRONT_SIZE, seed=seed, initial=first
        )
        search.minimise(lambda x, weights=weights: scores.allowed(x) @ weights, evaluations=BUDGET // FRONT_SIZE)


def by_pymoo(name: str, scores: CountedScores, seed: int, *, reads_ground: bool) -> None:
    """Run pymoo's NSGA-II or MOEA/D with the published operators."""
    from pymoo.algorithms.moo.moead import MOEAD
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem
    from pymoo.core.repair import Repair
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM
    from pymoo.util.ref_dirs import get_reference_directions

    environment, scale = scores.environment, straight_values(scores.environment)
    sorting_rng = np.random.default_rng(seed)

    class Paths(Problem):  # type: ignore[misc, unused-ignore]
        def _evaluate(self, x: Floats, out: dict[str, Floats], *_args: object, **_more: object) -> None:
            objectives, violations = scores(x)
            out["F"] = objectives / scale
            if name == "NSGA-II":
                out["G"] = violations[:, None]
            else:
                # MOEA/D compares forbidden paths, too.
                out["F"] = out["F"] + PENALTY * violations[:, None]

    class Sorting(Repair):  # type: ignore[misc, unused-ignore]
        def _do(self, _problem: object, x: Floats, **_more: object) -> Floats:
            points = x.reshape(len(x), -1, 2)
            order = np.argsort(points[np.arange(len(x)), :, sorting_rng.integers(2, size=len(x))], axis=1)
            return np.take_along_axis(points, order[:, :, None], axis=1).reshape(x.shape)

    settings: dict[str, Any] = {
        "sampling": first_population(environment, FRONT_SIZE, seed, reads_ground=reads_ground),
        "crossover": SBX(prob=1.0, eta=20),
        "mutation": PM(prob=1.0, prob_var=1.0 / 3.0, eta=20),
        "repair": Sorting(),
    }
    if name == "NSGA-II":
        engine = NSGA2(pop_size=FRONT_SIZE, **settings)
    else:
        towards = get_reference_directions("uniform", 2, n_partitions=FRONT_SIZE - 1)
        engine = MOEAD(towards, n_neighbors=NEIGHBOUR_COUNT, **settings)
    count = 0 if name == "NSGA-II" else 1
    problem = Paths(
        n_var=environment.lower.size, n_obj=2, n_ieq_constr=1 - count, xl=environment.lower, xu=environment.upper
    )
    engine.setup(problem, termination=("n_eval", 10**9), seed=seed, verbose=False)
    while True:
        engine.next()


def make_methods() -> dict[str, Method]:
    """Return all methods by name."""
    methods: dict[str, Method] = {
        "front, reads the ground": partial(search_front, reads_ground=True),
        "front": partial(search_front, reads_ground=False),
    }
    methods |= {f"optimise {model}, both": partial(optimise_both, model) for model in MODELS}
    methods |= {f"optimise {model}, 20 weights": partial(optimise_weighted, model) for model in MODELS}
    for name in ("NSGA-II", "MOEA/D"):
        methods[name] = partial(by_pymoo, name, reads_ground=False)
        methods[f"{name} from our paths"] = partial(by_pymoo, name, reads_ground=True)
    methods["our paths alone"] = lambda scores, _seed: scores(route_vectors(scores.environment))
    return methods | {"plan --front": plan_and_score}


def run(method: Method, environment: Environment, seed: int) -> dict[str, Any]:
    """Return the front of a method on an environment, its evaluations and its CPU time, s."""
    scores = CountedScores(environment)
    began = time.process_time()
    with contextlib.suppress(BudgetSpentError):
        method(scores, seed)
    seconds = time.process_time() - began
    return {"front": scores.front().tolist(), "evaluations": min(scores.spent, BUDGET), "seconds": seconds}


def published_hypervolume(front: Floats) -> float:
    """Return the published hypervolume of a front (n, 2): the part of a square of 4,400 that it covers."""
    return hypervolume(front / PUBLISHED_REFERENCE, np.ones(2))


def gain_shares(fronts: list[Floats], straight: Floats) -> list[float]:
    """Return the gain of each front (n, 2) over the straight path (2,).

    It is relative to the gain of all fronts together.
    """
    least, most = published_hypervolume(straight[None]), published_hypervolume(np.concatenate(fronts))
    return [(published_hypervolume(front) - least) / (most - least) for front in fronts]


def print_tables(
    names: list[str], environments: list[Environment], fronts: dict[tuple[str, str], list[Floats]]
) -> None:
    """Print both figures of each method on each environment, and each method's wins and mean rank."""
    published = np.zeros((len(environments), len(names)))
    shares = np.zeros_like(published)
    for row, environment in enumerate(environments):
        every = [front for name in names for front in fronts[environment.name, name]]
        gains = iter(gain_shares(every, straight_values(environment)))
        for column, name in enumerate(names):
            found = fronts[environment.name, name]
            shares[row, column] = np.median([next(gains) for _ in found])
            published[row, column] = np.median([published_hypervolume(front) for front in found])
    for title, table in (("published hypervolume", published), ("share of the gain", shares)):
        print(f"\n{title}, median of the seeds")
        for name, values in zip(names, table.T, strict=True):
            print(f"{name:32s}" + "".join(f"{value:9.4f}" for value in values))
    ranks = rankdata(-shares, axis=1)
    wins, order = (shares >= shares.max(axis=1, keepdims=True)).sum(axis=0), np.argsort(ranks.mean(axis=0))
    print(f"\n{'method':32s}{'most':>6s}{'median share':>14s}{'least':>8s}{'rank':>7s}")
    for k in order:
        middle, least = np.median(shares[:, k]), shares[:, k].min()
        print(f"{names[k]:32s}{wins[k]:6d}{middle:14.3f}{least:8.3f}{ranks[:, k].mean():7.2f}")


def main() -> None:
    """Measure the requested methods, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.public_fronts")
    parser.add_argument("--maps", type=Path, help="folder of the published maps; otherwise six are generated")
    parser.add_argument("--map-seed", type=int, default=MAP_SEED, help="seed of the generated environments")
    parser.add_argument("--environments", help="names of environments; all by default", default="")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--methods", default=";".join(make_methods()), help="names, separated by semicolons")
    parser.add_argument("--kept", type=Path, default=KEPT, help="file of the stored fronts")
    args = parser.parse_args()
    if args.maps is None:
        environments = make_environments(args.map_seed)
    else:
        environments = [read_environment(path) for path in sorted(args.maps.glob("terrainStruct_*.mat"))]
    if args.environments:
        environments = [one for one in environments if one.name in args.environments.split(";")]
    methods, names = make_methods(), args.methods.split(";")
    known: dict[str, Any] = json.loads(args.kept.read_text(encoding="utf-8")) if args.kept.exists() else {}
    args.kept.parent.mkdir(parents=True, exist_ok=True)
    source = f"seed {args.map_seed}" if args.maps is None else "published"
    fronts: dict[tuple[str, str], list[Floats]] = {}
    seconds: dict[str, list[float]] = {name: [] for name in names}
    for environment in environments:
        for name in names:
            for seed in range(FIRST_SEED, FIRST_SEED + args.seeds):
                key = f"{source}, {environment.name}, {name}, {seed}"
                if key not in known:
                    known[key] = run(methods[name], environment, seed)
                fronts.setdefault((environment.name, name), []).append(np.array(known[key]["front"]))
                seconds[name].append(known[key]["seconds"])
            args.kept.write_text(json.dumps(known) + "\n", encoding="utf-8")
    print(", ".join(environment.name for environment in environments))
    print_tables(names, environments, fronts)
    for name in names:
        print(f"{name:32s} CPU {np.median(seconds[name]):.2f} s")


if __name__ == "__main__":
    main()
