"""Find the departures at which a mission is flyable in a weather forecast.

Each departure is judged by many flights.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta, tzinfo
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.failure_counts import RuleFailures, count_failures, deciding_rules
from planfly.campaigns.flight_requests import FlightRequest
from planfly.campaigns.flight_row import FlightRow, fly_one
from planfly.campaigns.statistics.decision import Interval, clopper_pearson
from planfly.campaigns.worker_pool import Workers, worker_pool
from planfly.runtime.stages import Advance
from planfly.workflow.open_flight import planned_duration
from world.errors import ForecastError
from world.scenario import Scenario, read_scenario_forecast, with_flight_time, with_forecast_member

# Largest number of departures in one search.
MAX_DEPARTURES = 400
# Default probability of a flyable flight at which a departure is open.
DEFAULT_PROBABILITY = 0.9
# Time after the first departure at which a search ends by default.
DEFAULT_SPAN = timedelta(hours=24)


@dataclass(frozen=True, slots=True)
class WindowGoal:
    """Goal of a search for a departure window.

    A departure is open if its fraction of flyable flights is at least `probability`.

    departures: times of take-off, ascending.
    asked: requested time of take-off; None if any departure will do.
    probability: required probability of a flyable flight.
    flights: number of flights of each departure.
    zone: offset from UTC in which the user stated the times.
    """

    departures: tuple[datetime, ...]
    asked: datetime | None
    probability: float
    flights: int
    zone: tzinfo = UTC


@dataclass(frozen=True)
class Departure:
    """Flights that take off at one time.

    time: time of take-off.
    scenarios: scenario at this time in each member of the forecast; () if the forecast does not cover the flight.
    rows: the flights, in the order of their draws.
    not_judged: reason why the departure was not flown; "" if it was flown.
    """

    time: datetime
    scenarios: tuple[Scenario, ...] = ()
    rows: tuple[FlightRow, ...] = ()
    not_judged: str = ""

    @property
    def flyable(self) -> int:
        """Number of flyable flights."""
        return sum(row.outcome == "flyable" for row in self.rows)

    @property
    def share(self) -> float:
        """Fraction of flyable flights; NaN if the departure was not flown."""
        return self.flyable / len(self.rows) if self.rows else math.nan

    @cached_property
    def interval(self) -> Interval:
        """Clopper-Pearson interval of the probability of a flyable flight, with 95 % confidence."""
        return clopper_pearson(self.flyable, len(self.rows))

    @cached_property
    def failures(self) -> tuple[RuleFailures, ...]:
        """Failed flights by rule and place."""
        return count_failures(row.failed for row in self.rows)

    @property
    def rules(self) -> tuple[str, ...]:
        """Rules that fail the most flights (ties included); () without failures."""
        return deciding_rules(self.failures)

    @property
    def undecided(self) -> int:
        """Number of flights in which some rule is not judged."""
        return sum(row.undecided for row in self.rows)

    def is_judged_in_full(self, probability: float) -> bool:
        """Return True if flights that are not judged in full cannot change whether the departure is open.

        probability: probability of a flyable flight at which a departure is open.
        """
        if not self.rows:
            return False
        min_flyable = sum(row.outcome == "flyable" and not row.undecided for row in self.rows)
        max_flyable = sum(row.outcome == "flyable" or row.undecided for row in self.rows)
        return min_flyable / len(self.rows) >= probability or max_flyable / len(self.rows) < probability

    @property
    def energy_left(self) -> float:
        """Lowest energy left at the end of a flight, Wh; NaN if it is not known."""
        energies = [row.energy_left for row in self.rows if row.energy_left is not None]
        return float(np.min(energies)) if energies else math.nan

    @property
    def wind(self) -> tuple[float, float]:
        """Mean wind at the start: speed, m/s, and direction from which it blows, deg; NaN if not flown.

        In an ensemble forecast it is the mean over the members.
        """
        if not self.scenarios:
            return math.nan, math.nan
        winds = [scenario.wind_velocity(scenario.start.tolist()) for scenario in self.scenarios]
        east, north = np.mean(winds, axis=0)
        return math.hypot(east, north), math.degrees(math.atan2(-east, -north)) % 360.0


@dataclass(frozen=True, repr=False)
class WindowResult:
    """Result of `planfly.window`.

    departures: the departures, in the order of time.
    files: written files.
    """

    goal: WindowGoal
    base: CampaignBase
    departures: tuple[Departure, ...]
    files: tuple[Path, ...] = ()

    def __repr__(self) -> str:
        return f"<WindowResult {self.base.name}: {sum(map(bool, map(self.is_open, self.departures)))} departures open>"

    def is_open(self, departure: Departure) -> bool | None:
        """Return True if a departure's fraction of flyable flights reaches the goal; None if it was not flown."""
        return None if not departure.rows else departure.share >= self.goal.probability

    @property
    def windows(self) -> tuple[tuple[datetime, datetime], ...]:
        """Times of the first and the last departure of each uninterrupted series of open departures."""
        open_windows: list[tuple[datetime, datetime]] = []
        was_open = False
        for departure in self.departures:
            opens = bool(self.is_open(departure))
            if opens and was_open:
                open_windows[-1] = open_windows[-1][0], departure.time
            elif opens:
                open_windows.append((departure.time, departure.time))
            was_open = opens
        return tuple(open_windows)

    @property
    def asked(self) -> Departure | None:
        """Requested departure; None if any departure will do."""
        return next((departure for departure in self.departures if departure.time == self.goal.asked), None)

    @property
    def is_go(self) -> bool | None:
        """True if the requested departure is open, or if any departure is open when none was requested.

        None if the result depends on flights that are not judged in full.
        """
        departures = self.departures if self.asked is None else (self.asked,)
        probability = self.goal.probability
        results = [
            self.is_open(departure) if departure.is_judged_in_full(probability) else None for departure in departures
        ]
        if any(results):
            return True
        return None if None in results else False

    @property
    def best(self) -> Departure | None:
        """Departure with the most flyable flights, the earliest in a tie; None if no departure was flown."""
        flown_departures = [departure for departure in self.departures if departure.rows]
        return max(flown_departures, key=lambda departure: departure.share, default=None)


def departure_times(
    first: datetime, last: datetime, step: timedelta, asked: datetime | None = None
) -> tuple[datetime, ...]:
    """Return departure times, ascending: every `step` from `first` up to `last`, and the requested time.

    asked: requested time of take-off; None if any departure will do.

    >>> day = datetime(2026, 5, 1, tzinfo=UTC)
    >>> [time.hour for time in departure_times(day, day + timedelta(hours=5), timedelta(hours=2))]
    [0, 2, 4]
    """
    count = max(0, math.floor((last - first) / step)) + 1
    times = {first + k * step for k in range(count)}
    return tuple(sorted(times | ({asked} if asked is not None else set())))


def find_window(base: CampaignBase, goal: WindowGoal, workers: Workers, advance: Advance) -> WindowResult:
    """Fly a campaign for each departure; the draws of flight k are the same at every departure.

    If the forecast is an ensemble, flight k flies in member k modulo the number of members.  A departure that the
    forecast does not cover is not flown, and states the reason.

    advance: called after each flight with the number of flights done, their total and a text.
    """
    departures = []
    for time in goal.departures:
        try:
            # The scenario once for each member of its forecast, with the wind of that member.
            scenario = with_flight_time(base.scenario, time.isoformat())
            forecast = read_scenario_forecast(scenario)
            members = (
                (scenario,)
                if forecast.members == 1
                else tuple(with_forecast_member(scenario, forecast, member) for member in range(forecast.members))
            )
            replace(base, scenario=members[0]).nominal_setup()
            departures.append(Departure(time, members))
        except ForecastError as error:
            departures.append(Departure(time, not_judged=str(error)))
    scenarios = [departure.scenarios for departure in departures if departure.scenarios]
    total = len(scenarios) * goal.flights
    indices: Iterator[int] = iter(range(total))

    def next_request() -> FlightRequest | None:
        """Return the request of the next flight; None if all flights are requested."""
        index = next(indices, None)
        return None if index is None else FlightRequest(index)

    rows: dict[int, FlightRow] = {}
    if scenarios:
        fly = partial(fly_departure, scenarios=tuple(scenarios), flights=goal.flights)
        with worker_pool(workers, base, fly) as pool:
            for count, finished in enumerate(pool.fly(next_request), 1):
                advance(count, total, f"{count} of {total} flights")
                rows[finished.request.index] = finished.row
    scenario_numbers = iter(range(len(scenarios)))
    results = []
    for departure in departures:
        if not departure.scenarios:
            results.append(departure)
            continue
        start = next(scenario_numbers) * goal.flights
        results.append(replace(departure, rows=tuple(rows[start + k] for k in range(goal.flights))))
    return WindowResult(goal, base, tuple(results))


def fly_departure(
    base: CampaignBase,
    index: int,
    wind: GivenWind | None = None,
    *,
    scenarios: Sequence[Sequence[Scenario]],
    flights: int,
) -> FlightRow:
    """Fly one flight of one departure.

    index: number of the departure multiplied by `flights`, plus the number of the flight; both numbers are from 0.
    wind: always None, because the forecast states the wind of a departure.
    scenarios: for each departure, its scenario in each member of the forecast.
    flights: number of flights of each departure.
    """
    departure, flight = divmod(index, flights)
    members = scenarios[departure]
    return fly_one(replace(base, scenario=members[flight % len(members)]), flight, wind)


def last_departure(base: CampaignBase, first: datetime) -> datetime:
    """Return the default end of a search: `DEFAULT_SPAN` after the first departure.

    If the forecast ends earlier, it is the last departure whose flight the forecast covers, but never before the first.
    """
    forecast_end = first + DEFAULT_SPAN
    if base.scenario.wind.forecast is not None:
        setup = base.nominal_setup()
        duration = planned_duration(setup.route, setup.mission)
        forecast_end = base.scenario.wind.forecast.last_time - timedelta(seconds=duration)
    return max(first, min(first + DEFAULT_SPAN, forecast_end.astimezone(UTC)))
