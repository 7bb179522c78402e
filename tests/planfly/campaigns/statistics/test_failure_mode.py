"""Whether by how little flights passed is taken to tell of failing."""

import numpy as np
import pytest
from numpy.typing import NDArray

from planfly.campaigns.statistics.censored_regression import Outcomes, fit_regression
from planfly.campaigns.statistics.failure_mode import fit_mode
from planfly.campaigns.statistics.links import LINKS, PROBIT, BinaryLink

Floats = NDArray[np.float64]


def made(count: int, seed: int, *, one_law: bool) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Terms, who failed and by how much the others passed.

    One law: a flight fails where its room is below 0.  Two: it fails by its first draw, in a wind that suffices, and
    the others' room is what gusts leave of it, which no failing follows from.
    """
    random = np.random.default_rng(seed)
    terms = np.column_stack((np.ones(count), random.uniform(-4.0, 4.0, count), random.normal(size=(count, 2))))
    wind, first, gust = terms[:, 1], terms[:, 2], random.normal(size=count)
    if one_law:
        room = 0.6 * (2.0 - 0.4 * wind - 0.8 * first + gust)
        return terms, room < 0.0, room.clip(0.0, 1.0)
    room = np.abs(0.8 + 0.2 * gust)
    return terms, first + 0.2 * gust > 2.0 - 0.2 * wind, room.clip(0.0, 1.0)


@pytest.mark.parametrize("seed", range(5))
def test_room_counts_where_failing_is_of_its_law(seed: int) -> None:
    """By a normal law as the flights were made: 1/0.6 of the room, and 0.4 and 0.8 of the wind and the first draw."""
    mode = fit_mode(*made(400, seed, one_law=True), PROBIT)
    assert mode.by_room == pytest.approx(1.0 / 0.6, rel=0.25)
    assert mode.mean == pytest.approx([-2.0, 0.4, 0.8, 0.0], abs=0.4)


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("seed", range(5))
def test_room_counts_for_nothing_where_failing_is_of_another(link: BinaryLink, seed: int) -> None:
    """One law would have the first draw, which alone decides, as of little account: it leaves the room as it is."""
    terms, failed, room = made(400, seed, one_law=False)
    mode, bare = fit_mode(terms, failed, room, link), fit_mode(terms, failed, np.zeros(400), link)
    assert mode.by_room == 0.0
    assert mode.mean == pytest.approx(bare.mean)
    assert mode.mean[2] > 2.0


def test_the_rooms_own_law_says_nothing_for_a_link() -> None:
    """The links differ in evidence by as much as without the room: to each comes that of the room's own law."""
    terms, failed, room = made(400, 1, one_law=False)
    told, bare = (
        [fit_mode(terms, failed, some, link).log_evidence for link in LINKS] for some in (room, np.zeros(400))
    )
    assert told[0] - told[1] == pytest.approx(bare[0] - bare[1])
    passes = Outcomes(terms, failed, np.where(failed, 0.0, room)).only_room()
    by_itself = max(fit_regression(passes, link).log_evidence for link in LINKS)
    assert told[0] == pytest.approx(bare[0] + by_itself)


def test_the_depth_of_failing_counts_for_nothing() -> None:
    terms, failed, room = made(400, 1, one_law=True)
    deep = np.where(failed, 0.5, room)
    assert fit_mode(terms, failed, deep, PROBIT).mean == pytest.approx(fit_mode(terms, failed, room, PROBIT).mean)
