"""What every optimiser asks for first: samples in its box, those it is given or uniform ones."""

import numpy as np
import pytest

from planner.optimisers.box_search import BoxSearch
from planner.optimisers.differential_evolution import DifferentialEvolution
from planner.optimisers.umda import Umda

LOWER, UPPER = np.array([-1.0, 10.0]), np.array([1.0, 40.0])


def first_samples(kind: type[Umda] | type[DifferentialEvolution], initial: np.ndarray | None) -> BoxSearch:
    return kind(LOWER, UPPER, lambda scores: scores[:, 0], 400, np.random.default_rng(3), initial=initial)


@pytest.mark.parametrize("kind", [Umda, DifferentialEvolution])
def test_the_first_samples_fill_the_box_evenly(kind: type[Umda] | type[DifferentialEvolution]) -> None:
    search = first_samples(kind, None)
    asked = search.ask()
    assert asked.shape == (400, 2)
    assert len(search.samples) == len(search.scores) == 0
    shares = (asked - LOWER) / (UPPER - LOWER)
    assert (shares >= 0.0).all()
    assert (shares <= 1.0).all()
    # A uniform share has mean 1/2 and standard deviation 0.289; of 400, within four standard errors.
    assert shares.mean(axis=0) == pytest.approx([0.5, 0.5], abs=4 * 0.289 / 20)


@pytest.mark.parametrize("kind", [Umda, DifferentialEvolution])
def test_given_samples_are_asked_for_as_they_are_or_cut_at_the_wall(
    kind: type[Umda] | type[DifferentialEvolution],
) -> None:
    asked = first_samples(kind, np.array([[0.5, 20.0], [3.0, 5.0]])).ask()
    assert asked.tolist() == [[0.5, 20.0], [1.0, 10.0]]
