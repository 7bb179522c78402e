"""List the planning algorithms by name, and choose the limits that each algorithm plans within.

An `Algorithm` combines an encoding, a kind of scores, seeding and an optimiser; `ALGORITHMS` lists all that a scenario
or a command may name.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from world.errors import ScenarioError
from world.files import did_you_mean

# The help of commands lists the algorithms without importing the aircraft's limits.
if TYPE_CHECKING:
    from aircraft.path_limits import Limits

Optimiser = Literal["umda", "emna", "chain", "differential", "waypoints"]


@dataclass(frozen=True, slots=True)
class Algorithm:
    """Search method: its encoding and its extensions of the planner of Yang, Tang and Lozano (CEC 2014).

    name, summary: texts in commands and their help.
    encoding: a name of `planner.evaluation.encoding.ENCODINGS`.
    graded: scores violations by amount along the whole path, and ranks kill exposure before length.
    smooth: draws first samples, and the marginals of UMDA, along the eigenvectors of the Brownian-bridge kernel, so
        that neighbouring waypoints move together.
    seeded: starts from routes over grids of the map, improved by a pattern search.
    final_shortening: shortens the best path at the end; if there are zones, or if shortening fails, moves all its
        waypoints at once instead.
    optimiser: name of an optimiser in `planner.optimisers`; "waypoints" is
        `planner.search.generations.run_waypoint_generations`.
    """

    name: str
    summary: str
    encoding: str = "rotated"
    graded: bool = False
    smooth: bool = False
    seeded: bool = False
    final_shortening: bool = False
    optimiser: Optimiser = "umda"


ALGORITHMS: dict[str, Algorithm] = {
    algorithm.name: algorithm
    for algorithm in (
        Algorithm(
            "fda-seeded",
            "the default: grid routes on all sides of obstacles, shortened; evolutionary search only if none is safe",
            graded=True,
            seeded=True,
            final_shortening=True,
            optimiser="waypoints",
        ),
        Algorithm(
            "fda",
            "evolutionary search of waypoints, each ranked by its best path; without initial paths and grids",
            graded=True,
            final_shortening=True,
            optimiser="waypoints",
        ),
        Algorithm(
            "umda-seeded",
            "smooth UMDA in the rotated frame, started from grid routes over terrain and threats",
            graded=True,
            smooth=True,
            seeded=True,
            final_shortening=True,
        ),
        Algorithm(
            "umda-smooth",
            "UMDA in the rotated frame, graded violations, sampled in a smooth basis, without initial paths",
            graded=True,
            smooth=True,
        ),
        Algorithm(
            "emna-seeded",
            "full covariance of all variables (EMNA), started from grid routes",
            graded=True,
            smooth=True,
            seeded=True,
            final_shortening=True,
            optimiser="emna",
        ),
        Algorithm(
            "emna",
            "full covariance of all variables (EMNA), without initial paths",
            graded=True,
            smooth=True,
            optimiser="emna",
        ),
        Algorithm(
            "chain-seeded",
            "each waypoint depends on the one before it (Markov chain), started from grid routes",
            graded=True,
            smooth=True,
            seeded=True,
            final_shortening=True,
            optimiser="chain",
        ),
        Algorithm(
            "chain",
            "each waypoint depends on the one before it (Markov chain), without initial paths",
            graded=True,
            smooth=True,
            optimiser="chain",
        ),
        Algorithm(
            "de-seeded",
            "a classical evolutionary algorithm (differential evolution), started from grid routes",
            graded=True,
            smooth=True,
            seeded=True,
            final_shortening=True,
            optimiser="differential",
        ),
        Algorithm(
            "de",
            "a classical evolutionary algorithm (differential evolution), without initial paths",
            graded=True,
            smooth=True,
            optimiser="differential",
        ),
        Algorithm(
            "de-paper",
            "differential evolution in the paper's frame, with the paper's encoding, violation counts and preference",
            optimiser="differential",
        ),
        Algorithm("umda-graded", "the paper's UMDA with graded violations along the whole path", graded=True),
        Algorithm(
            "umda", "UMDA as in the paper (Yang et al., 2014): rotated frame, six points per leg, without initial paths"
        ),
        Algorithm("umda-cartesian", "a baseline of the paper: UMDA on Cartesian waypoints", encoding="cartesian"),
        Algorithm(
            "umda-polar",
            "a baseline of the paper: UMDA on step lengths and turn angles of up to 180 degrees",
            encoding="polar",
        ),
        Algorithm("umda-polar-45", "UMDA on step lengths and turn angles of up to 45 degrees", encoding="polar-45"),
        Algorithm("umda-bearing", "UMDA on step lengths and angles from the straight line", encoding="bearing"),
    )
}
DEFAULT = "fda-seeded"


def algorithm_lines() -> str:
    """Return the name and the summary of each algorithm as text, one line per algorithm.

    >>> print(algorithm_lines().splitlines()[3])
      umda-smooth     UMDA in the rotated frame, graded violations, sampled in a smooth basis, without initial paths
    """
    width = max(len(name) for name in ALGORITHMS)
    return "\n".join(f"  {algorithm.name:<{width}}  {algorithm.summary}" for algorithm in ALGORITHMS.values())


def find_algorithm(name: str | None, source: str) -> Algorithm:
    """Return the algorithm with a name, or the default algorithm for None.

    source: where the name comes from, for the error message, e.g. the name of the scenario or "--algorithm".

    Raises ScenarioError for an unknown name.

    >>> find_algorithm(None, "example.toml").name, find_algorithm("umda-polar", "example.toml").encoding
    ('fda-seeded', 'polar')
    """
    algorithm = ALGORITHMS.get(DEFAULT if name is None else name)
    if algorithm is None:
        problem = f"unknown; allowed: {', '.join(ALGORITHMS)}{did_you_mean(str(name), ALGORITHMS)}"
        raise ScenarioError.at(source, "planner.algorithm", name, problem, shown=f"{name!r}")
    return algorithm


def limits_for(algorithm: Algorithm, limits: "Limits") -> "Limits":
    """Return the limits within which an algorithm plans.

    An algorithm that counts violations, as in the paper, ignores the tracking error of the autopilot.
    """
    return limits if algorithm.graded else replace(limits, tracking=None)
