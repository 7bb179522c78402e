"""The largest wind from each direction in which a mission flies: flights put where they tell most, in rounds."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

from planfly.campaigns.engine.cluster import Workers, connected
from planfly.campaigns.engine.flight_loop import Flown, Order, Pilots
from planfly.campaigns.engine.flight_tasks import FlyOne
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import fly_one
from planfly.campaigns.flights.varied_flight import GivenWind
from planfly.campaigns.statistics.wind_boundary import Direction, WindBoundary, needs_more

# Half of the interval's width that is flown for, m/s, and the fewest flights of a direction.
ACCURACY, FEWEST = 0.4, 30
# Of a spread, what the wind that is asked about takes the place of.
ASKED = ("wind_speed", "wind_from")

Advance = Callable[[float, float, str], None]


@dataclass(frozen=True)
class WindsGoal:
    """What is asked: the probability, the directions, how far to look (m/s), the most flights of all directions."""

    target: float
    confidence: float
    directions: int
    most: float
    flights: int


@dataclass(frozen=True, repr=False)
class WindsFound:
    """The boundary of each direction, and the flights it rests on: direction, speed, and whether flyable."""

    goal: WindsGoal
    boundaries: tuple[WindBoundary, ...]
    flights: tuple[tuple[int, float, bool], ...]

    def from_deg(self, direction: int) -> float:
        """Where the wind of a direction comes from, degrees."""
        return 360.0 * direction / self.goal.directions

    def __repr__(self) -> str:
        least = min(one.estimate for one in self.boundaries)
        return f"<WindsFound {len(self.boundaries)} directions, {least:.1f} m/s the least; {len(self.flights)} flights>"


def find_winds(
    base: CampaignBase, goal: WindsGoal, workers: Workers, advance: Advance | None = None, fly: FlyOne = fly_one
) -> WindsFound:
    """Fly in rounds until each boundary is known well enough, or the flights are used up.

    A round's winds follow from the rounds before it alone, so that the result is the same for any number of workers.
    base: of a spread without the quantities of `ASKED`.
    """
    directions = [Direction(goal.most, goal.target, goal.confidence) for _ in range(goal.directions)]
    flown: list[tuple[int, float, bool]] = []
    with connected(workers) as client:
        pilots = Pilots(client, base, fly)
        try:
            while orders := _round(goal, directions, len(flown)):
                done = sorted(_fly_round(pilots, goal, orders, len(flown), advance))
                for number, speed, _, flyable in done:
                    directions[number].add(speed, flyable)
                    flown.append((number, speed, flyable))
        finally:
            pilots.close()
    return WindsFound(goal, tuple(one.boundary() for one in directions), tuple(flown))


def _round(goal: WindsGoal, directions: list[Direction], flown: int) -> list[tuple[int, float, int]]:
    """Direction, speed and flight's index of the next round; none where all is known or used up."""
    wanted = []
    for number, direction in enumerate(directions):
        count = len(direction.speeds)
        if not count or needs_more(direction.boundary(), count, ACCURACY, FEWEST):
            wanted += [(number, speed, count + k) for k, speed in enumerate(direction.next_speeds())]
    return wanted[: max(0, goal.flights - flown)]


def _fly_round(
    pilots: Pilots, goal: WindsGoal, orders: list[tuple[int, float, int]], before: int, advance: Advance | None
) -> list[tuple[int, float, int, bool]]:
    left = itertools.chain(orders)
    asked: dict[Order, tuple[int, float, int]] = {}

    def following() -> Order | None:
        entry = next(left, None)
        if entry is None:
            return None
        number, speed, index = entry
        order = Order(index, GivenWind(speed, 360.0 * number / goal.directions))
        asked[order] = entry
        return order

    done = []
    for one in pilots.fly(following):
        done.append((*asked[one.order], _flyable(one)))
        if advance is not None:
            count = before + len(done)
            advance(
                float(count), float(goal.flights), f"{count} flights, {len({n for n, _, _ in orders})} directions open"
            )
    return done


def _flyable(one: Flown) -> bool:
    return one.row.outcome == "flyable"
