"""Find the strongest wind from each direction in which a mission is flyable.

The flights are chosen in rounds by the information that they give.
"""

import math
from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from logs.verdict.conditions import Conditions
from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.dispersions import standard_draws, standard_population
from planfly.campaigns.failure_counts import RuleFailures, count_failures
from planfly.campaigns.flight_requests import FlightRequest, FlyOne, code_hash
from planfly.campaigns.flight_row import FlightRow, fly_one
from planfly.campaigns.statistics.decision import wilson
from planfly.campaigns.statistics.wind_boundary import (
    Direction,
    DrawnNumbers,
    WindBoundary,
    needs_more_flights,
    next_flights,
)
from planfly.campaigns.tables import (
    WINDS_DATABASE,
    FlownFlight,
    RequestedFlight,
    StoreError,
    WindsStore,
    read_stored_settings,
)
from planfly.campaigns.worker_pool import FlightRate, WorkerPool, Workers, worker_pool
from world.errors import ArgumentError
from world.wording import count_text

# Largest half-width of the interval of an accurate boundary, m/s.
BOUNDARY_ACCURACY_MPS = 0.25
# Minimum number of flights in each direction.  If all of them are flyable, at most one flight in fifty fails, with 95 %
# confidence.  With fewer flights the intervals of the fit are too narrow.
MIN_FLIGHTS_PER_DIRECTION = 150
# Number of points that represent the distribution of all drawn quantities.
_POPULATION_SIZE = 4096
# Approximate number of flights of a round; workers wait for the end of each round.
_FLIGHTS_PER_ROUND = 48
# Minimum number of flights of one direction in a round.
_MIN_FLIGHTS_EACH = 3
# Maximum number of flights of one direction in a round.
_MAX_FLIGHTS_EACH = 6
# Ratio of the numbers of flights at two checks of an open direction; each check computes the slow posterior.
_CHECK_GROWTH_RATIO = 1.04
# Minimum number of flights in calm air, none of which may be flyable, for a search to end without a flight in wind.
_MIN_CALM_FLIGHTS = 3
# Dispersed quantities that the wind of the search replaces.
SEARCHED_QUANTITIES = ("wind_speed", "wind_from")

Advance = Callable[[float, float, str], None]


@dataclass(frozen=True)
class WindsGoal:
    """Goal of a search for winds.

    target: required probability of a flyable flight.
    confidence: confidence of each boundary's interval.
    directions: number of directions.
    most: maximum wind of the search, m/s.
    flights: maximum number of flights.
    """

    target: float
    confidence: float
    directions: int
    most: float
    flights: int

    @property
    def judging_flights(self) -> int:
        """Number of flights with which all directions can be judged."""
        return MIN_FLIGHTS_PER_DIRECTION * self.directions

    def check_flights(self) -> None:
        """Raise ArgumentError if the flights are too few to judge any direction."""
        if self.flights < MIN_FLIGHTS_PER_DIRECTION:
            allowed = (
                f"expected at least {MIN_FLIGHTS_PER_DIRECTION}, or no direction can be judged; all {self.directions}"
                f" directions need {self.judging_flights:,} flights"
            )
            raise ArgumentError.of_argument("flights", self.flights, allowed)


# Goal of a search without any of its options.
DEFAULT_WINDS_GOAL = WindsGoal(target=0.99, confidence=0.95, directions=16, most=20.0, flights=5000)


def make_winds_goal(requested: Mapping[str, float | None], folder: Path, *, resume: bool) -> WindsGoal:
    """Return the goal of a search for winds.

    requested: values of the goal's fields by name; for None, a resumed search keeps its stored value, and a new search
        has the default.
    folder: folder of the search, which is read only to resume it.
    Raises StoreError for a file that planfly did not write, or that another process has locked.
    """
    settings = read_stored_settings(folder / WINDS_DATABASE) if resume else {}
    stored = {name: settings[name] for name in asdict(DEFAULT_WINDS_GOAL) if name in settings}
    stated = {name: value for name, value in requested.items() if value is not None}
    values: dict[str, Any] = {**asdict(DEFAULT_WINDS_GOAL), **stored, **stated}
    return WindsGoal(**values)


# Boundary below which a mission is not flyable with the target probability even in calm air, m/s; printed as 0.0.
CALM_MPS = 0.05
# Maximum wind that is treated as calm air, m/s: boundaries are not known more accurately than this.
NEARLY_CALM_MPS = 2.0 * BOUNDARY_ACCURACY_MPS


@dataclass(frozen=True)
class CalmFailures:
    """Failures in calm or nearly calm air, for directions in which the mission fails even there.

    speed: speed of the weakest wind flown, m/s, at most `NEARLY_CALM_MPS`.
    flights: number of flights in this wind.
    failed_count: number of failed flights among them.
    by_rule: failures by rule and place; empty if no flight failed or could be flown.
    """

    speed: float
    flights: int
    failed_count: int
    by_rule: tuple[RuleFailures, ...]


# Answer of a search for winds.
WindsAnswer = Literal["judged", "not flyable", "not judged in full", "not judged"]


@dataclass(frozen=True, repr=False)
class WindsResult:
    """Result of a search: the boundary of each direction, and the flights that determine it.

    boundaries: boundary of each direction; `judged` and `reasons` state which of them are only estimates, and why.
    flights: for each flight, the index of its direction, the wind speed, m/s, and True if it was flyable.
    lost: indices, from 0, of the flights that could not be flown; they are treated as not flyable.
    conditions: conditions of the flights, without the wind, which depends on the direction.
    calm: failures in calm air if the mission is not flyable in calm air with the target probability; None otherwise.
    failures: for each direction, the failures, by rule and place, of its flights in winds up to the upper bound of its
        boundary; () if no wind was searched.
    undecided: index of each undecided flight, with the rules that are not judged and the reasons.  An undecided flight
        has no failure, but is not known to be flyable.
    """

    goal: WindsGoal
    boundaries: tuple[WindBoundary, ...]
    flights: tuple[tuple[int, float, bool], ...]
    lost: tuple[int, ...] = ()
    conditions: Conditions | None = None
    calm: CalmFailures | None = None
    failures: tuple[tuple[RuleFailures, ...], ...] = ()
    undecided: tuple[tuple[int, str], ...] = ()

    def from_deg(self, direction: int) -> float:
        """Return the bearing from which the wind of a direction blows, degrees.

        direction: index of the direction.
        """
        return 360.0 * direction / self.goal.directions

    def flight_counts(self) -> list[int]:
        """Return the number of flights for each direction."""
        counts = Counter(direction for direction, _, _ in self.flights)
        return [counts[direction] for direction in range(len(self.boundaries))]

    def undecided_counts(self) -> list[int]:
        """Return the number of undecided flights for each direction."""
        counts = Counter(self.flights[number][0] for number, _ in self.undecided)
        return [counts[direction] for direction in range(len(self.boundaries))]

    @property
    def flown_bounds(self) -> tuple[tuple[float | None, float | None], ...]:
        """Strongest flyable wind below any failure, and weakest wind with a failure, by direction, m/s.

        Each is None if there is no such wind.  Lost and undecided flights are left out.
        """
        left_out = {*self.lost, *(number for number, _ in self.undecided)}
        bounds = []
        for index in range(len(self.boundaries)):
            outcomes = [
                (speed, is_flyable)
                for number, (direction, speed, is_flyable) in enumerate(self.flights)
                if direction == index and number not in left_out
            ]
            failed = min((speed for speed, is_flyable in outcomes if not is_flyable), default=None)
            flyable = [speed for speed, is_flyable in outcomes if is_flyable and (failed is None or speed < failed)]
            bounds.append((max(flyable, default=None), failed))
        return tuple(bounds)

    @property
    def is_only_calm(self) -> bool:
        """True if all flights were in calm air and none was flyable, so that no wind was searched."""
        return self.calm is not None and self.calm.flights == len(self.flights)

    @property
    def fails_in_calm_air(self) -> bool:
        """True if the flights in calm air show that the mission misses the target probability in calm air."""
        calm = self.calm
        if calm is None:
            return False
        if self.is_only_calm and calm.failed_count == calm.flights:
            return True
        return wilson(calm.flights - calm.failed_count, calm.flights).high < self.goal.target

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reason why the boundary of each direction is not judged; "" if it is judged.

        A direction whose boundary is calm air is judged if its flights prove this.
        """
        fails_in_calm_air, max_width = self.fails_in_calm_air, 2.0 * BOUNDARY_ACCURACY_MPS
        counts = zip(self.flight_counts(), self.undecided_counts(), strict=True)
        reasons = []
        for boundary, (count, undecided_count) in zip(self.boundaries, counts, strict=True):
            is_calm = fails_in_calm_air and boundary.estimate < CALM_MPS
            if undecided_count and not is_calm:
                reasons.append(f"{undecided_count} of {count_text(count, 'flight')} not judged in full")
            elif is_calm or not needs_more_flights(boundary, count, BOUNDARY_ACCURACY_MPS, MIN_FLIGHTS_PER_DIRECTION):
                reasons.append("")
            elif count < MIN_FLIGHTS_PER_DIRECTION:
                reasons.append(f"{count} of at least {count_text(MIN_FLIGHTS_PER_DIRECTION, 'flight')}")
            else:
                reasons.append(f"interval {boundary.width:.2f} m/s wide; at most {max_width:g} m/s is required")
        return tuple(reasons)

    @property
    def judged(self) -> tuple[bool, ...]:
        """True for each direction whose boundary is judged; `reasons` states why the others are not."""
        return tuple(not reason for reason in self.reasons)

    @property
    def estimated(self) -> tuple[bool, ...]:
        """True for each direction whose boundary is stated.

        Such a direction is judged, or only its interval is too wide.

        Otherwise there are too few flights, so that boundary and interval depend mostly on assumptions, or some flights
        are not judged in full and may lie on either side of the boundary.
        """
        counts = zip(self.flight_counts(), self.undecided_counts(), strict=True)
        return tuple(
            is_judged or (count >= MIN_FLIGHTS_PER_DIRECTION and not undecided_count)
            for is_judged, (count, undecided_count) in zip(self.judged, counts, strict=True)
        )

    @property
    def answer(self) -> WindsAnswer:
        """Answer: "judged", "not flyable", "not judged in full" or "not judged".

        It is "not flyable" if the mission does not reach the target probability even in calm air.  It is "not judged"
        if no direction has a judged boundary, "not judged in full" if only some directions have one, and otherwise
        "judged".
        """
        are_judged = self.judged
        if self.fails_in_calm_air or (self.calm is not None and all(are_judged)):
            return "not flyable"
        if not any(are_judged):
            return "not judged"
        return "judged" if all(are_judged) else "not judged in full"

    def __repr__(self) -> str:
        speeds = [
            boundary.estimate
            for boundary, is_estimated in zip(self.boundaries, self.estimated, strict=True)
            if is_estimated
        ]
        speed_text = f", {min(speeds):.1f} m/s the lowest" if speeds else ""
        unjudged_count = self.judged.count(False)
        unjudged_text = f", {unjudged_count} of them not judged" if unjudged_count else ""
        subject = f"{count_text(len(self.boundaries), 'direction')}{unjudged_text}{speed_text}"
        return f"<WindsResult {subject}; {count_text(len(self.flights), 'flight')}>"


def open_winds_store(
    base: CampaignBase, goal: WindsGoal, folder: Path, *, resume: bool, options: Mapping[str, object] | None = None
) -> WindsStore:
    """Create the table of a search in a folder, or open it to resume the search.

    The number of flights may change when a search is resumed.  If it is smaller, the surplus flights stay in the table.

    base: campaign base, whose dispersions must not contain `SEARCHED_QUANTITIES`.
    options: options of the flights, which a new table stores for `planfly.winds` with ``resume``.
    Raises StoreError for a table that cannot be used, such as the table of a search with another goal.
    """
    path = folder / WINDS_DATABASE
    stored = read_stored_settings(path) if resume else {}
    settings = {**base.settings_to_store(stored, options), **asdict(goal)}
    return WindsStore(path, f"{base.inputs_hash()}-{code_hash()}", settings, resume=resume)


def find_winds(
    base: CampaignBase,
    goal: WindsGoal,
    workers: Workers,
    store: WindsStore,
    advance: Advance | None = None,
    fly: FlyOne = fly_one,
) -> WindsResult:
    """Fly rounds of flights until the boundary of each direction is accurate enough.

    Return the boundaries.

    At most `goal.flights` flights are flown.

    A new search starts with a few flights in calm air.  If none of them is flyable, the search ends there: the result
    contains only these flights, and the table stays empty.  Flights in the table are not flown again.  The winds of a
    round depend only on the earlier rounds, so the result is the same for any number of workers and interruptions.
    Flights completed before an error or Ctrl-C stay in the table.

    base: campaign base, whose dispersions must not contain `SEARCHED_QUANTITIES`.
    store: table of the search, which may already contain flights.
    advance: called with the progress; None if it is not reported.
    fly: function that flies one flight of the campaign.
    """
    search, stored_flights = _Search(goal, base), _StoredFlights(store)
    progress = _ProgressReport(search, len(stored_flights.flown), advance)
    with ExitStack() as stack:
        pool: WorkerPool | None = None
        while requests := search.next_round():
            if missing_requests := stored_flights.missing(requests):
                if pool is None:
                    # Report before the workers start, because the start takes seconds.
                    progress.report_start(len(stored_flights.flown))
                    pool = stack.enter_context(worker_pool(workers, base, fly))
                    calm_rows = [] if stored_flights.flown else _fly_in_calm_air(pool, goal)
                    if calm_rows:
                        progress.report_calm(len(calm_rows))
                        return search.result_in_calm_air(calm_rows)
                # Fly the missing flights of the round, and write each to the table as soon as it is done.
                flight_requests = [search.make_request(requested) for requested in missing_requests]
                requested_by_request = dict(zip(flight_requests, missing_requests, strict=True))
                unsent_requests = iter(flight_requests)
                for request, row in pool.fly(partial(next, unsent_requests, None)):
                    stored_flights.add(requested_by_request[request], row)
                    progress.report(len(stored_flights.flown))
            for requested in requests:
                search.add_result(requested, stored_flights.flown[requested.number])
    progress.report(len(search.flown), force=True)
    return search.result()


class _Search:
    """State of a search for winds: the flights of all rounds, and their results.

    A round is a group of flights that are flown in parallel; their winds depend on the results of earlier rounds.  A
    direction is open as long as its boundary needs more flights.
    """

    def __init__(self, goal: WindsGoal, base: CampaignBase) -> None:
        self.goal, self._base = goal, base
        drawn_numbers = DrawnNumbers(
            standard_population(base.dispersions, _POPULATION_SIZE),
            partial(standard_draws, base.dispersions, base.seed),
        )
        self.directions = [
            Direction(goal.most, goal.target, drawn_numbers, goal.confidence) for _ in range(goal.directions)
        ]
        self.open_directions = list(range(goal.directions))
        # Number of flights of each direction at which it is checked next.
        self._next_check = [MIN_FLIGHTS_PER_DIRECTION] * goal.directions
        self.flown: list[tuple[int, float, bool]] = []
        self.lost: list[int] = []
        # Flights that are not judged in full, with rules and reasons.
        self.undecided: list[tuple[int, str]] = []
        # Failed rules and places of each flight.
        self._failed: list[tuple[tuple[str, Place], ...]] = []

    def next_round(self) -> list[RequestedFlight]:
        """Close the directions that need no more flights.

        Return the requests of the next round for the others.

        The list is empty if all directions are closed, or if `goal.flights` flights were flown.
        """
        remaining_directions = []
        for number in self.open_directions:
            direction = self.directions[number]
            count = len(direction.speeds)
            # The boundary takes long to compute, so it is computed only at some numbers of flights; between them the
            # direction stays open.
            is_open = count < self._next_check[number]
            if not is_open:
                self._next_check[number] = math.ceil(_CHECK_GROWTH_RATIO * count)
                is_open = needs_more_flights(
                    direction.boundary(), count, BOUNDARY_ACCURACY_MPS, MIN_FLIGHTS_PER_DIRECTION
                )
            if is_open:
                remaining_directions.append(number)
        self.open_directions = remaining_directions
        flights_each = max(
            _MIN_FLIGHTS_EACH, min(_MAX_FLIGHTS_EACH, _FLIGHTS_PER_ROUND // max(1, len(self.open_directions)))
        )
        requests: list[RequestedFlight] = []
        for number in self.open_directions:
            for speed, draw in next_flights(self.directions[number], flights_each):
                requests.append(RequestedFlight(len(self.flown) + len(requests), number, speed, draw))
        return requests[: max(0, self.goal.flights - len(self.flown))]

    def add_result(self, request: RequestedFlight, flight: FlownFlight) -> None:
        """Add the result of a flight; flights must be added in the order in which they were requested."""
        is_flyable = flight.outcome == "flyable"
        failure_keys: set[Hashable] = {_failure_key(rule, place) for rule, place in flight.failed} or {flight.outcome}
        failed_keys = frozenset() if is_flyable else frozenset(failure_keys)
        margins: dict[Hashable, float] | None = {
            _failure_key(rule, place): fraction for rule, place, fraction in flight.marginal_passes
        }
        if flight.outcome == "lost" or any(rule == "completion" for rule, _ in flight.failed):
            # The rules that the flight would have passed if it had continued are unknown.
            margins = None
        self.directions[request.direction].add(request.speed, request.draw, failed_keys, margins)
        self.flown.append((request.direction, request.speed, is_flyable))
        self._failed.append(() if flight.undecided else flight.failed)
        if flight.undecided:
            self.undecided.append((request.number, flight.undecided))
        if flight.outcome == "lost":
            self.lost.append(request.number)

    def make_request(self, requested_flight: RequestedFlight) -> FlightRequest:
        """Return the request that a worker receives for a flight of the search."""
        return FlightRequest(
            requested_flight.draw,
            GivenWind(requested_flight.speed, 360.0 * requested_flight.direction / self.goal.directions),
        )

    def min_remaining_flights(self) -> int:
        """Return the number of flights still needed to reach the minimum number in each open direction.

        It is at most the number of flights that the goal still permits.
        """
        remaining = sum(
            max(0, MIN_FLIGHTS_PER_DIRECTION - len(self.directions[number].speeds)) for number in self.open_directions
        )
        return min(remaining, self.goal.flights - len(self.flown))

    def result(self) -> WindsResult:
        """Return the result of the flights so far: boundaries, flights and the failures of each direction."""
        boundaries = tuple(direction.boundary() for direction in self.directions)
        conditions = replace(self._base.conditions(), wind_mps=None, wind_from_deg=None)
        # Failures in the weakest flown wind of the directions whose boundary is calm air.
        calm_failures = None
        calm_directions = {number for number, boundary in enumerate(boundaries) if boundary.estimate < CALM_MPS}
        numbered_speeds = [
            (number, speed)
            for number, (direction, speed, _) in enumerate(self.flown)
            if direction in calm_directions and speed <= NEARLY_CALM_MPS
        ]
        if numbered_speeds:
            min_speed = min(speed for _, speed in numbered_speeds)
            numbers = [number for number, speed in numbered_speeds if speed == min_speed]
            undecided_numbers = {number for number, _ in self.undecided}
            failed_findings = [
                self._failed[number]
                for number in numbers
                if not self.flown[number][2] and number not in undecided_numbers
            ]
            calm_failures = CalmFailures(min_speed, len(numbers), len(failed_findings), count_failures(failed_findings))
        # Failures of each direction in winds up to the upper bound of its boundary. If no flight failed in such a
        # wind, they are those in the weakest wind in which a flight failed.
        failures_by_direction = []
        for number, boundary in enumerate(boundaries):
            # After a search that ended in calm air, `_failed` is shorter than `flown`.
            failed_flights = [
                (speed, failed)
                for (direction, speed, _), failed in zip(self.flown, self._failed, strict=False)
                if direction == number and failed
            ]
            max_speed = max(boundary.high, min((speed for speed, _ in failed_flights), default=0.0))
            failures_by_direction.append(
                count_failures(failed for speed, failed in failed_flights if speed <= max_speed)
            )
        failures = tuple(failures_by_direction)
        return WindsResult(
            self.goal,
            boundaries,
            tuple(self.flown),
            tuple(self.lost),
            conditions,
            calm_failures,
            failures,
            tuple(self.undecided),
        )

    def result_in_calm_air(self, rows: Sequence[FlightRow]) -> WindsResult:
        """Return the result of a search that ends after its flights in calm air.

        rows: these flights, none of which was flyable.
        """
        # In each direction, the boundary and both ends of its interval are calm air.
        boundaries = (WindBoundary(0.0, 0.0, 0.0, is_beyond_search=False),) * self.goal.directions
        self.flown = [(0, 0.0, False)] * len(rows)
        self.undecided = [(number, row.undecided_text) for number, row in enumerate(rows) if row.undecided_text]
        failed = [row.failures for row in rows if row.outcome != "undecided"]
        calm = CalmFailures(0.0, len(rows), len(failed), count_failures(failed))
        return replace(self.result(), boundaries=boundaries, calm=calm, failures=())


def _fly_in_calm_air(pool: WorkerPool, goal: WindsGoal) -> list[FlightRow]:
    """Fly the first draws in calm air; return their rows if no flight is flyable, otherwise [].

    The number of flights is large enough to disprove the target: a mission with the target probability fails all of
    them with a probability of at most 1 minus the confidence.  [] is also returned if a flight could not be flown, or
    if the goal permits fewer flights than this number.
    """
    count = max(_MIN_CALM_FLIGHTS, math.ceil(math.log(1.0 - goal.confidence) / math.log(1.0 - goal.target)))
    if count > goal.flights:
        return []
    draws, rows = iter(range(count)), dict[int, FlightRow]()

    def next_request() -> FlightRequest | None:
        """Return the request of the next flight in calm air.

        None if a flight was flyable or could not be flown, or if all flights are requested.
        """
        can_disprove_target = not any(row.outcome in ("flyable", "lost") for row in rows.values())
        draw = next(draws, None) if can_disprove_target else None
        return None if draw is None else FlightRequest(draw, GivenWind(0.0, 0.0))

    for request, row in pool.fly(next_request):
        rows[request.index] = row
    if any(row.outcome in ("flyable", "lost") for row in rows.values()):
        return []
    return [rows[draw] for draw in range(count)]


def _failure_key(rule: str, place: Place) -> Hashable:
    """Return the failure mode of a failed rule: a key of the rule and the place.

    The key has no item numbers and names.
    """
    return rule, place.kind, place.index


class _StoredFlights:
    """Flights in the table, with their requests and outcomes keyed by number."""

    def __init__(self, store: WindsStore) -> None:
        requests_and_outcomes = store.stored_flights()
        self._store = store
        self._requests = {number: request for number, (request, _) in requests_and_outcomes.items()}
        self.flown = {number: flight for number, (_, flight) in requests_and_outcomes.items()}

    def missing(self, requests: list[RequestedFlight]) -> list[RequestedFlight]:
        """Return the requests that must be flown, because their flights are not in the table.

        Raises StoreError if the table has another request with the same number.
        """
        for request in requests:
            if self._requests.get(request.number, request) != request:
                path = self._store.path
                raise StoreError(
                    f"{path}: flight {request.number} belongs to a search with other settings, so this search cannot"
                    " continue with this table",
                    file=path,
                )
        return [request for request in requests if request.number not in self.flown]

    def add(self, request: RequestedFlight, row: FlightRow) -> None:
        """Write a flown flight to the table, and add it to `flown`."""
        self._store.add(request, row)
        self.flown[request.number] = FlownFlight(row.outcome, row.failed, row.marginal_passes, row.undecided_text)


class _ProgressReport:
    """Periodic progress report of a search.

    stored_count: number of flights in the table at the start.
    advance: function called with each report; None if nothing is reported.
    """

    def __init__(self, search: _Search, stored_count: int, advance: Advance | None) -> None:
        self._search, self._advance, self._rate = search, advance, FlightRate(stored_count)

    def report_start(self, flight_count: int) -> None:
        """Report, before the first flight, the number of flights in the table.

        Also report the minimum number of flights.
        """
        if self._advance is not None:
            total = max(len(self._search.flown) + self._search.min_remaining_flights(), flight_count + 1)
            remark = f"{flight_count} of {count_text(total, 'flight')} at least"
            self._advance(float(flight_count), float(total), remark)

    def report_calm(self, flight_count: int) -> None:
        """Report the number of flights in calm air, if a search ends after them."""
        if self._advance is not None:
            text = f"{count_text(flight_count, 'flight')} in calm air, none of them flyable"
            self._advance(float(flight_count), float(flight_count), text)

    def report(self, flight_count: int, force: bool = False) -> None:
        """Report the number of closed directions, and the number and rate of flights.

        Also report the least remaining time.

        No remaining time is given once each open direction has `MIN_FLIGHTS_PER_DIRECTION` flights, because the number
        of further flights is then unknown.

        force: True to report even if no report is due.
        """
        if self._advance is None or not (self._rate.is_due() or force):
            return
        search, flights_per_second = self._search, self._rate.flights_per_second(flight_count)
        remaining = len(search.flown) + search.min_remaining_flights() - flight_count
        settled_count, total = search.goal.directions - len(search.open_directions), search.goal.directions
        remark = (
            f"{settled_count} of {total} directions settled, {count_text(flight_count, 'flight')},"
            f" {60.0 * flights_per_second:.0f} flights a minute"
        )
        if remaining > 0 and flights_per_second > 0.0:
            remark += f", {remaining / flights_per_second:.0f} s left at least"
        self._advance(float(flight_count), float(flight_count + max(remaining, 1)), remark)
