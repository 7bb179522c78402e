"""Fly a campaign in parallel, store its flights by index, and decide its answer."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_requests import FlightRequest, FlyOne, code_hash
from planfly.campaigns.flight_row import OUTCOMES, fly_one
from planfly.campaigns.statistics.decision import Estimate, Estimator, Goal, Tally
from planfly.campaigns.tables import CAMPAIGN_DATABASE, Store, StoreError, read_stored_settings
from planfly.campaigns.worker_pool import FlightRate, Workers, worker_pool
from world.wording import count_text

Advance = Callable[[float, float, str], None]


@dataclass
class _FlightTally:
    """Known flights of a campaign, which are tallied in the order of their indices.

    tally: outcomes of the flights before the first missing index.
    later_outcomes: outcomes of the known flights after the first missing index.
    next_index: index of the next flight to request.
    is_decided: True if the tally decides the goal.
    """

    estimator: Estimator
    goal: Goal
    tally: Tally = field(default_factory=lambda: Tally(0, 0))
    later_outcomes: dict[int, str] = field(default_factory=dict)
    next_index: int = 0
    is_decided: bool = False

    def add(self, index: int, outcome: str) -> None:
        """Add the outcome of a flight, and tally all flights before the first missing index.

        Set `is_decided`, and tally no further flights, as soon as the tally decides the goal.
        """
        self.later_outcomes[index] = outcome
        while not self.is_decided and (next_outcome := self.later_outcomes.pop(self.tally.flown, None)) is not None:
            self.tally = Tally(
                *(count + (next_outcome == name) for count, name in zip(self.tally, OUTCOMES, strict=True))
            )
            self.is_decided = self.goal.stops and self.estimator.decides(self.tally)

    def next_request(self) -> FlightRequest | None:
        """Return the request of the next missing flight.

        Return None if the goal is decided, or if all flights have been requested.
        """
        self.next_index = max(self.next_index, self.tally.flown)
        while self.next_index in self.later_outcomes:
            self.next_index += 1
        if self.is_decided or self.next_index >= self.goal.flights:
            return None
        self.next_index += 1
        return FlightRequest(self.next_index - 1)


def resumed_goal(
    requested: Goal,
    folder: Path,
    confidence: float | None = None,
    *,
    keeps_target: bool = False,
    keeps_flights: bool = False,
) -> Goal:
    """Return the goal of a resumed campaign: the requested goal, with parts of the stored goal.

    Its `changed` is set if the number of flights, or the rule to stop, differs from the stored goal.

    confidence: confidence of the goal; None keeps the stored confidence.
    keeps_target: True keeps the stored target and `stops`.
    keeps_flights: True keeps the stored number of flights, if both goals have a fixed number or both stop by
        themselves.
    Raises StoreError for a folder without a campaign.
    """
    path = folder / CAMPAIGN_DATABASE
    settings = read_stored_settings(path)
    if not settings:
        raise StoreError(f"{path}: there is no campaign to continue", file=path)
    old_goal = Goal(**{setting.name: settings[setting.name] for setting in fields(Goal) if setting.name in settings})
    goal = replace(requested, target=old_goal.target, stops=old_goal.stops) if keeps_target else requested
    if keeps_flights and goal.stops == old_goal.stops:
        goal = replace(goal, flights=old_goal.flights)
    is_same = (goal.stops, goal.flights) == (old_goal.stops, old_goal.flights)
    return replace(goal, confidence=confidence or old_goal.confidence, changed=old_goal.changed or not is_same)


def open_store(
    base: CampaignBase, goal: Goal, folder: Path, *, resume: bool, options: Mapping[str, object] | None = None
) -> Store:
    """Create the table of a campaign in a folder, or open it to resume the campaign.

    options: options of the flights, which a new table stores for `planfly.campaign` with ``resume``.
    Raises StoreError for a table that cannot be used, or that has more flights than the goal.
    """
    path = folder / CAMPAIGN_DATABASE
    stored = read_stored_settings(path) if resume else {}
    settings = {**base.settings_to_store(stored, options), **asdict(goal)}
    return Store(path, f"{base.inputs_hash()}-{code_hash()}", settings, resume=resume)


def fly_campaign(
    base: CampaignBase,
    goal: Goal,
    workers: Workers,
    store: Store,
    advance: Advance | None = None,
    fly: FlyOne = fly_one,
) -> Estimate:
    """Fly the flights missing from the table until their number is reached or the goal is decided.

    Return the estimate of the probability of a flyable flight.  Flights are tallied in the order of their indices, and
    flights after the deciding flight are deleted.  Answer and table therefore do not depend on the speed of the
    workers.  Flights completed before an error or Ctrl-C stay in the table.

    store: the campaign's table, which may already hold flights.
    advance: function called with the progress; None if it is not reported.
    fly: function that flies one flight of the campaign.
    """
    estimator = Estimator(goal)
    flight_tally = _FlightTally(estimator, goal)
    for index, outcome in store.outcomes().items():
        if index < goal.flights:
            flight_tally.add(index, outcome)
    if not flight_tally.is_decided and flight_tally.tally.flown < goal.flights:
        progress = _ProgressReport(goal, estimator, flight_tally.tally, advance)
        with worker_pool(workers, base, fly) as pool:
            progress.start_timing(flight_tally.tally)
            for _, row in pool.fly(flight_tally.next_request):
                store.add(row)
                flight_tally.add(row.draw.index, row.outcome)
                progress.report(flight_tally.tally)
                if flight_tally.is_decided:
                    break
            progress.report(flight_tally.tally, force=True)
    store.delete_later_flights(flight_tally.tally.flown)
    return estimator.estimate(store.tally())


class _ProgressReport:
    """Periodic progress report of a campaign.

    stored_tally: tally of the flights in the table at the start.
    advance: function called with each report; None if nothing is reported.
    """

    def __init__(self, goal: Goal, estimator: Estimator, stored_tally: Tally, advance: Advance | None) -> None:
        self._goal, self._estimator, self._advance = goal, estimator, advance
        self.start_timing(stored_tally)
        if advance is not None:
            # Report before the workers start, because the start takes seconds.
            total = self._min_total_flights(stored_tally)
            remark = f"{stored_tally.flown} of {count_text(total, 'flight')}" + (" at least" if goal.stops else "")
            advance(float(stored_tally.flown), float(total), remark)

    def start_timing(self, stored_tally: Tally) -> None:
        """Start measuring the rate of new flights, once the workers are ready.

        stored_tally: tally of the flights flown before, which are not part of the rate.
        """
        self._rate = FlightRate(stored_tally.flown)

    def _min_total_flights(self, tally: Tally) -> int:
        """Return the smallest number of flights with which the campaign can end.

        It is the requested number, unless the campaign stops as soon as its goal is decided.
        """
        return max(self._estimator.min_flights, tally.flown) if self._goal.stops else self._goal.flights

    def report(self, tally: Tally, force: bool = False) -> None:
        """Report the number of flights, and the fraction of flyable flights with its bounds.

        Also report the remaining time.

        force: True to report even if no report is due.
        """
        if self._advance is None or not tally.flown or not (self._rate.is_due() or force):
            return
        estimate = self._estimator.estimate(tally)
        flights_per_second = self._rate.flights_per_second(tally.flown)
        total = self._min_total_flights(tally)
        seconds_left = (total - tally.flown) / flights_per_second if flights_per_second > 0.0 else 0.0
        remark = (
            f"{count_text(tally.flown, 'flight')}, probability {tally.share:.4f} ({estimate.lower:.4f} to"
            f" {estimate.upper:.4f}), {60.0 * flights_per_second:.0f} flights a minute, {seconds_left:.0f} s left"
        )
        self._advance(float(tally.flown), float(total), remark)
