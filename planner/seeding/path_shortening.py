"""Shortening: a path pulled taut under its constraints, all waypoints at once and free of their intervals.

A grid, a population or a moving of places finds the side of the obstacles on which to pass; how short a path is there
is a smooth problem in all coordinates, which Newton's steps solve in a millisecond or two
(`planner.seeding.shortening_kernels`).
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.shortening_kernels import HALVINGS, ROUNDS, STEPS, Shortening, begin_shortening, shorten_on

Floats = NDArray[np.float64]

# Samples of the ground on a leg: one every so many m of the mean leg, within these.
SAMPLE_PITCH, FEWEST_SAMPLES, MOST_SAMPLES = 30.0, 6, 48
# What it keeps further from spheres and ground than is asked, m: what its last steps leave undecided.
SPARE = 0.1
# Models that one shortening makes at most.
MOST_MODELS = ROUNDS * (2 + STEPS * HALVINGS)
# Pairs of leg and missile that are looked at before the caller may end the work: some 5 ms.
PAIRS_AT_ONCE = 400_000


def shorten_path(
    data: ProblemArrays, path: Floats, *, spare: float = SPARE, pause: Callable[[], None] = lambda: None
) -> tuple[Floats, int]:
    """A path (w, 3) world m that is shorter or breaks less than this one, and the models made: each is an evaluation.

    spare: m by which it keeps further from spheres and ground than is asked.  pause: called after some milliseconds'
    work; what it raises ends the work.  Zones, and a greatest height above ground, are not looked at.

    >>> from planfly.airframe import load_airframe
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> data = make_problem(scenario, load_airframe(scenario).limits).search
    >>> high = np.array([scenario.start, [5000.0, 5000.0, 590.0], scenario.destination])
    >>> path, _ = shorten_path(data, evenly(high, 10))
    >>> path.shape, bool(np.array_equal(path[-1], scenario.destination))
    ((10, 3), True)
    """
    mean = math.dist(path[0], path[-1]) / (len(path) - 1)
    samples = int(min(MOST_SAMPLES, max(FEWEST_SAMPLES, math.ceil(mean / SAMPLE_PITCH))))
    rounds = max(1, PAIRS_AT_ONCE // (len(path) * max(1, len(data.missiles.missiles))))
    start = np.array(path, dtype=np.float64)
    # A grid's route ends at a grid's height.
    start[0], start[-1] = data.start, data.destination
    under_way: Shortening = begin_shortening(data, start, samples, spare)
    while under_way.rounds < ROUNDS:
        under_way = shorten_on(data, under_way, spare, min(ROUNDS, rounds))
        pause()
    return under_way.path, int(under_way.models)


def evenly(way: Floats, count: int) -> Floats:
    """Waypoints (count, 3) at equal distances along a way (k, 3).

    >>> evenly(np.array([[0.0, 0.0, 5.0], [30.0, 40.0, 5.0], [30.0, 90.0, 5.0]]), 5).tolist()
    [[0.0, 0.0, 5.0], [15.0, 20.0, 5.0], [30.0, 40.0, 5.0], [30.0, 65.0, 5.0], [30.0, 90.0, 5.0]]
    """
    runs = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(way, axis=0) ** 2).sum(axis=1)))])
    at = np.linspace(0.0, runs[-1], count)
    return np.column_stack([np.interp(at, runs, way[:, axis]) for axis in range(3)])
