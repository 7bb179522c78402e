"""Searches for winds with made flights: without workers, stopped in the middle, and held against each other."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from planfly.campaigns import find_winds as find_winds_module
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.find_winds import WindsGoal, WindsResult, find_winds, open_winds_store
from planfly.campaigns.flight_requests import FinishedFlight, FlightRequest, FlyOne
from planfly.campaigns.fly_campaign import Advance
from planfly.campaigns.tables import WINDS_DATABASE, WINDS_KIND, RequestedFlight, make_flight_row, parse_marginal_passes
from planfly.campaigns.worker_pool import Workers
from tests.planfly.campaigns.made_campaigns import made_flight, table
from tests.soak import SOAK

GOAL = WindsGoal(0.9, 0.95, 4, 20.0, 400)


class HerePilots:
    """WorkerPool in this process: three at a time, the last to be sent the first to be back."""

    def __init__(self, base: CampaignBase, fly: FlyOne) -> None:
        self._base, self._fly = base, fly

    def fly(self, next_request: Callable[[], FlightRequest | None]) -> Iterator[FinishedFlight]:
        while orders := [one for one in (next_request() for _ in range(3)) if one is not None]:
            for order in reversed(orders):
                yield FinishedFlight(order, self._fly(self._base, order.index, order.wind))


@contextmanager
def hire_here(_workers: Workers, base: CampaignBase, fly: FlyOne) -> Iterator[HerePilots]:
    """Make a pool in this process, in place of `planfly.campaigns.worker_pool.worker_pool`."""
    yield HerePilots(base, fly)


@contextmanager
def flying_here() -> Iterator[None]:
    """Fly without workers; outside the soak, fewer points stand for all that may be drawn, and rounds are of more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(find_winds_module, "worker_pool", hire_here)
        if not SOAK:
            patch.setattr(find_winds_module, "_POPULATION_SIZE", 512)
            patch.setattr(find_winds_module, "_MAX_FLIGHTS_EACH", 12)
        yield


def searched(
    base: CampaignBase,
    folder: Path,
    goal: WindsGoal = GOAL,
    workers: int = 2,
    fly: FlyOne = made_flight,
    advance: Advance | None = None,
) -> WindsResult:
    """Search in a folder, or go on there."""
    folder.mkdir(exist_ok=True)
    resume = (folder / WINDS_DATABASE).exists()
    with open_winds_store(base, goal, folder, resume=resume) as store:
        return find_winds(base, goal, Workers(workers), store, advance, fly)


def keep_part(base: CampaignBase, whole: Path, part: Path, numbers: set[int], goal: WindsGoal = GOAL) -> None:
    """A folder with some of the flights of another, as one who was stopped leaves it."""
    part.mkdir()
    with open_winds_store(base, goal, part, resume=False) as store:
        for values in table(whole / WINDS_DATABASE):
            if values[0] in numbers:
                known = dict(zip(WINDS_KIND.columns, (*values, 0.0, ""), strict=True))
                row = replace(
                    make_flight_row(known["draw"], known), marginal_passes=parse_marginal_passes(known["narrow"])
                )
                store.add(RequestedFlight(*values[:4]), row)


def same(one: tuple[WindsResult, Path], other: tuple[WindsResult, Path]) -> bool:
    """Whether two searches found the same, by the same table."""
    found, rows = zip(*((found, table(folder / WINDS_DATABASE)) for found, folder in (one, other)), strict=True)
    return bool(found[0] == found[1] and rows[0] == rows[1])
