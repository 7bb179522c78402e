"""EMNA finds the bottom of a turned valley, the same way from the same seed."""

from planner.optimisers.emna import Emna
from tests.planner.optimisers.valley import check_finds_the_bottom, check_same_seed_same_samples


def test_finds_the_bottom_of_a_turned_valley() -> None:
    check_finds_the_bottom(Emna)


def test_same_seed_same_samples() -> None:
    check_same_seed_same_samples(Emna)
