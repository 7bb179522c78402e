"""The algorithms that a scenario or a command may name."""

from dataclasses import dataclass

from world.errors import ScenarioError


@dataclass(frozen=True, slots=True)
class Algorithm:
    """One way to search: its encoding and what it adds to the paper's planner.

    graded: constraints by how far they are missed, along the whole path, and kill exposure ahead of length.
    smooth: marginals along the eigenvectors of the Brownian-bridge kernel.  seeded: starts from grid routes.
    """

    name: str
    summary: str
    encoding: str = "rotated"
    graded: bool = False
    smooth: bool = False
    seeded: bool = False


ALGORITHMS: dict[str, Algorithm] = {
    item.name: item
    for item in (
        Algorithm(
            "umda-seeded",
            "the default: smooth UMDA in the rotated frame, started from grid routes over terrain and threats",
            graded=True,
            smooth=True,
            seeded=True,
        ),
        Algorithm(
            "umda-smooth",
            "UMDA in the rotated frame, graded violations, sampled in a smooth basis, no seeds",
            graded=True,
            smooth=True,
        ),
        Algorithm("umda-graded", "the paper's UMDA with graded violations along the whole path", graded=True),
        Algorithm("umda", "the paper's UMDA in the rotated frame: counts on six points a leg, no seeds"),
        Algorithm("umda-cartesian", "the paper's baseline: the same UMDA on absolute waypoints", encoding="cartesian"),
        Algorithm("umda-polar", "the paper's baseline: the same UMDA on relative polar waypoints", encoding="polar"),
    )
}
DEFAULT = "umda-seeded"


def find_algorithm(name: str | None, source: str) -> Algorithm:
    """Look up an algorithm by name, the default for None.  Raises ScenarioError for a name that is none."""
    found = ALGORITHMS.get(DEFAULT if name is None else name)
    if found is None:
        raise ScenarioError(f"{source}: planner.algorithm: {name!r}: not known; allowed: {', '.join(ALGORITHMS)}")
    return found
