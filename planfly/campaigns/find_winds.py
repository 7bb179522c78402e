"""Find the strongest wind from each direction in which a mission flies, by rounds of the most informative flights."""

import math
from collections.abc import Callable, Hashable
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from logs.verdict.conditions import Conditions
from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.dispersions import standard_draws, standard_population
from planfly.campaigns.failure_counts import RuleFailures, count_failures
from planfly.campaigns.flight_requests import FlightRequest, FlyOne, code_hash
from planfly.campaigns.flight_row import FlightRow, fly_one
from planfly.campaigns.statistics.wind_boundary import Direction, DrawnNumbers, WindBoundary, needs_more, next_flights
from planfly.campaigns.tables import WINDS_DATABASE, AskedFlight, FlownFlight, StoreError, WindsStore, kept_settings
from planfly.campaigns.worker_pool import FlightRate, WorkerPool, Workers, worker_pool

# Target for half the width of a boundary's interval, m/s.
ACCURACY = 0.25
# Minimum number of flights of a direction.  If all of them are flyable, at most one in fifty fails (95 %).  With fewer
# flights the fit gives intervals that are too narrow.
FEWEST = 150
# Number of points that represent the distribution of all drawn quantities.
_POPULATION = 4096
# Approximate number of flights of a round; workers wait for the end of each round.
_FLIGHTS_PER_ROUND = 48
# Minimum number of flights of one direction in a round.
_MIN_EACH = 3
# Maximum number of flights of one direction in a round.
_MAX_EACH = 6
# Growth of the number of flights between two checks of an open direction, because the posterior is slow to compute.
_CHECK_GROWTH_RATIO = 1.04
# Dispersed quantities that the wind of the search replaces.
SEARCHED_QUANTITIES = ("wind_speed", "wind_from")

Advance = Callable[[float, float, str], None]


@dataclass(frozen=True)
class WindsGoal:
    """Goal of a search: probability, number of directions, maximum wind, m/s, and maximum number of flights."""

    target: float
    confidence: float
    directions: int
    most: float
    flights: int


# Default number of flights of a search.
USUAL_WIND_FLIGHTS = 5000


def flight_limit(asked: int | None, folder: Path, *, resume: bool) -> int:
    """Return the requested maximum number of flights; without a request, that of the folder's search, or the default.

    Raises StoreError for a file that planfly did not write, or that another process has locked.
    """
    kept = kept_settings(folder / WINDS_DATABASE) if resume else {}
    return int(kept.get("flights", USUAL_WIND_FLIGHTS)) if asked is None else asked


# Boundary below which a mission does not fly with the target probability even in calm air, m/s; it is printed as 0.0.
CALM_MPS = 0.05


@dataclass(frozen=True)
class CalmFailures:
    """Failures in the weakest wind flown, in directions in which the mission fails even in calm air.

    speed: speed of this wind, m/s.
    flights: number of flights in this wind.
    failed: number of these flights that failed.
    by_rule: rules and places that these flights failed; empty if none failed or none could be flown.
    """

    speed: float
    flights: int
    failed: int
    by_rule: tuple[RuleFailures, ...]


@dataclass(frozen=True, repr=False)
class WindsFound:
    """Boundary of each direction, and the flights from which it is estimated.

    flights: direction, wind speed, m/s, and True if flyable, of each flight.
    lost: indices, from 0, of the flights that could not be flown; they are treated as not flyable.
    conditions: conditions of the flights, without the wind, which depends on the direction.
    calm: failures in calm air, if the mission does not fly in it with the target probability; None otherwise.
    """

    goal: WindsGoal
    boundaries: tuple[WindBoundary, ...]
    flights: tuple[tuple[int, float, bool], ...]
    lost: tuple[int, ...] = ()
    conditions: Conditions | None = None
    calm: CalmFailures | None = None

    def from_deg(self, direction: int) -> float:
        """Return the direction from which the wind blows, degrees.  direction: index of the direction."""
        return 360.0 * direction / self.goal.directions

    def __repr__(self) -> str:
        least = min(one.estimate for one in self.boundaries)
        return (
            f"<WindsFound {len(self.boundaries)} directions, {least:.1f} m/s the lowest; {len(self.flights)} flights>"
        )


def open_winds_store(base: CampaignBase, goal: WindsGoal, folder: Path, *, resume: bool) -> WindsStore:
    """Create the table of a search in a folder, or open it to resume the search.

    The number of flights may be changed; if it is smaller, the other flights stay in the table.

    base: campaign base, whose dispersions must not contain `SEARCHED_QUANTITIES`.
    Raises StoreError, also for the table of a search with another goal.
    """
    settings = {"name": base.name, "seed": base.seed, "spread": base.dispersions.to_json(), **asdict(goal)}
    return WindsStore(folder / WINDS_DATABASE, f"{base.world_hash()}-{code_hash()}", settings, resume=resume)


def find_winds(
    base: CampaignBase,
    goal: WindsGoal,
    workers: Workers,
    store: WindsStore,
    advance: Advance | None = None,
    fly: FlyOne = fly_one,
) -> WindsFound:
    """Fly rounds of flights until each boundary is known well enough or all flights are used.

    Flights in the table are not flown again.  The winds of a round depend on the earlier rounds alone, so that the
    result is the same for any number of workers and of interruptions.  Flights completed before an error or Ctrl-C stay
    in the table.

    base: campaign base, whose dispersions must not contain `SEARCHED_QUANTITIES`.
    """
    search, known = _Search(goal, base), _Known(store)
    pace = _Pace(search, len(known.flown), advance)
    with ExitStack() as stack:
        pool: WorkerPool | None = None
        while asked := search.next_round():
            if missing := known.missing(asked):
                if pool is None:
                    # Report before the workers start, because the start takes seconds.
                    pace.begin(len(known.flown))
                pool = pool or stack.enter_context(worker_pool(workers, base, fly))
                _fly_round(pool, search, missing, known, pace)
            for one in asked:
                search.take(one, known.flown[one.number])
    pace.tell(len(search.flown), last=True)
    return search.found()


class _Search:
    """Flights requested in each round, and their results."""

    def __init__(self, goal: WindsGoal, base: CampaignBase) -> None:
        self.goal, self._base = goal, base
        numbers = DrawnNumbers(
            standard_population(base.dispersions, _POPULATION), partial(standard_draws, base.dispersions, base.seed)
        )
        self.directions = [Direction(goal.most, goal.target, numbers, goal.confidence) for _ in range(goal.directions)]
        self.open = list(range(goal.directions))
        # Number of flights of each direction at which it is checked next.
        self._next_check = [FEWEST] * goal.directions
        self.flown: list[tuple[int, float, bool]] = []
        self.lost: list[int] = []
        # Failed rules and places of each flight.
        self._failed: list[tuple[tuple[str, Place], ...]] = []

    def next_round(self) -> list[AskedFlight]:
        """Return the flights to fly next; empty if all boundaries are known or all flights are used."""
        self.open = [number for number in self.open if self._is_open(number)]
        each = max(_MIN_EACH, min(_MAX_EACH, _FLIGHTS_PER_ROUND // max(1, len(self.open))))
        asked: list[AskedFlight] = []
        for number in self.open:
            for speed, draw in next_flights(self.directions[number], each):
                asked.append(AskedFlight(len(self.flown) + len(asked), number, speed, draw))
        return asked[: max(0, self.goal.flights - len(self.flown))]

    def _is_open(self, number: int) -> bool:
        direction = self.directions[number]
        count = len(direction.speeds)
        if count < self._next_check[number]:
            return True
        self._next_check[number] = math.ceil(_CHECK_GROWTH_RATIO * count)
        return needs_more(direction.boundary(), count, ACCURACY, FEWEST)

    def take(self, asked: AskedFlight, flown: FlownFlight) -> None:
        """Add the result of a flight; flights must be added in the order in which they were requested."""
        flyable = flown.outcome == "flyable"
        failures: set[Hashable] = {_failure_key(rule, place) for rule, place in flown.failed} or {flown.outcome}
        failed = frozenset() if flyable else frozenset(failures)
        margin: dict[Hashable, float] | None = {_failure_key(rule, place): share for rule, place, share in flown.narrow}
        if flown.outcome == "lost" or any(rule == "completion" for rule, _ in flown.failed):
            # The rules that the flight would have passed if it had continued are unknown.
            margin = None
        self.directions[asked.direction].add(asked.speed, asked.draw, failed, margin)
        self.flown.append((asked.direction, asked.speed, flyable))
        self._failed.append(flown.failed)
        if flown.outcome == "lost":
            self.lost.append(asked.number)

    def request(self, asked: AskedFlight) -> FlightRequest:
        """Return the flight as a request to a worker."""
        return FlightRequest(asked.draw, GivenWind(asked.speed, 360.0 * asked.direction / self.goal.directions))

    def at_least(self) -> int:
        """Return the number of flights until all open directions have the minimum number of flights."""
        to_come = sum(max(0, FEWEST - len(self.directions[number].speeds)) for number in self.open)
        return min(to_come, self.goal.flights - len(self.flown))

    def found(self) -> WindsFound:
        """Return the result of the search."""
        boundaries = tuple(one.boundary() for one in self.directions)
        conditions = replace(self._base.conditions(), wind_mps=None, wind_from_deg=None)
        calm = self._calm_failures(boundaries)
        return WindsFound(self.goal, boundaries, tuple(self.flown), tuple(self.lost), conditions, calm)

    def _calm_failures(self, boundaries: tuple[WindBoundary, ...]) -> CalmFailures | None:
        """Return the failures in the weakest wind flown, for directions whose boundary is calm air, or None."""
        calm = {number for number, one in enumerate(boundaries) if one.estimate < CALM_MPS}
        numbered = [(number, one) for number, one in enumerate(self.flown) if one[0] in calm]
        if not numbered:
            return None
        weakest = min(speed for _, (_, speed, _) in numbered)
        numbers = [number for number, (_, speed, _) in numbered if speed == weakest]
        failed = [self._failed[number] for number in numbers if not self.flown[number][2]]
        return CalmFailures(weakest, len(numbers), len(failed), count_failures(failed))


def _failure_key(rule: str, place: Place) -> Hashable:
    """Return the key of a failure, which is its rule and place."""
    return rule, place.kind, place.index


class _Known:
    """Flights in the table, and their outcomes by number."""

    def __init__(self, store: WindsStore) -> None:
        known = store.known()
        self._store = store
        self._asked = {number: asked for number, (asked, _) in known.items()}
        self.flown = {number: flown for number, (_, flown) in known.items()}

    def missing(self, asked: list[AskedFlight]) -> list[AskedFlight]:
        """Return the requested flights that the table lacks.  Raises StoreError if a number has another request."""
        for one in asked:
            if self._asked.get(one.number, one) != one:
                path = self._store.path
                raise StoreError(f"{path}: flight {one.number} does not follow from those before it", file=path)
        return [one for one in asked if one.number not in self.flown]

    def add(self, asked: AskedFlight, row: FlightRow) -> None:
        """Write a flight to the table."""
        self._store.add(asked, row)
        self.flown[asked.number] = FlownFlight(row.outcome, row.failed, row.narrow)


def _fly_round(pool: WorkerPool, search: _Search, missing: list[AskedFlight], known: _Known, pace: "_Pace") -> None:
    left = iter(missing)
    asked: dict[FlightRequest, AskedFlight] = {}

    def following() -> FlightRequest | None:
        one = next(left, None)
        if one is None:
            return None
        request = search.request(one)
        asked[request] = one
        return request

    for request, row in pool.fly(following):
        known.add(asked[request], row)
        pace.tell(len(known.flown))


class _Pace:
    """Periodic progress report.  known: number of flights in the table at the start."""

    def __init__(self, search: _Search, known: int, advance: Advance | None) -> None:
        self._search, self._advance, self._rate = search, advance, FlightRate(known)

    def begin(self, flights: int) -> None:
        """Report the minimum amount of work before the first flight."""
        if self._advance is not None:
            total = max(len(self._search.flown) + self._search.at_least(), flights + 1)
            remark = f"{flights} of {total} flights at least"
            self._advance(float(flights), float(total), remark)

    def tell(self, flights: int, last: bool = False) -> None:
        """Report the settled directions, the flights, the flights per minute, and the remaining time if it is known.

        The number of flights beyond `FEWEST` is not known in advance; then no remaining time is given.
        last: True reports even if no report is due.
        """
        if self._advance is None or not (self._rate.due() or last):
            return
        search, rate = self._search, self._rate.a_second(flights)
        to_come = len(search.flown) + search.at_least() - flights
        settled, total = search.goal.directions - len(search.open), search.goal.directions
        remark = f"{settled} of {total} directions settled, {flights} flights, {60.0 * rate:.0f} a minute"
        if to_come > 0 and rate > 0.0:
            remark += f", {to_come / rate:.0f} s left at least"
        self._advance(float(flights), float(flights + max(to_come, 1)), remark)
