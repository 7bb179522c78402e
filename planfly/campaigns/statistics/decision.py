"""What a campaign's flights say of its target: reached, missed, or neither yet."""

from dataclasses import dataclass
from typing import Literal

from planfly.campaigns.statistics.proportions import Interval, Tally, clopper_pearson, lower_bound, upper_bound
from planfly.campaigns.statistics.stopping_bound import StoppingBound

Answer = Literal["reached", "missed", "undecided", "none asked"]

# Of a bound that nobody asked another of.
USUAL_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Goal:
    """What is asked of a campaign.

    target: the probability to reach; None where it is only to be told.
    stops: whether flying stops as soon as the answer is known (`--prove`); otherwise the number of flights is fixed.
    flights: fixed number, or the most where it stops.
    changed: whether another number was to be fixed first, and some of its flights were flown.
    """

    target: float | None
    stops: bool
    flights: int
    confidence: float = USUAL_CONFIDENCE
    changed: bool = False

    @property
    def method(self) -> str:
        """By which the bounds are had, for a person."""
        if self.stops:
            return "beta-binomial mixture, valid at every number of flights"
        if self.changed:
            return "Clopper-Pearson, one-sided, but the number of flights was changed after some: it holds less often"
        return "Clopper-Pearson, one-sided, for the number of flights fixed beforehand"


@dataclass(frozen=True)
class Estimate:
    """What is known of the probability.

    lower, upper: each holds with the goal's confidence; of a goal that stops, both at once and at all times.
    interval: two-sided, with the goal's confidence.
    """

    tally: Tally
    lower: float
    upper: float
    interval: Interval
    answer: Answer


class Estimator:
    """Estimates of one goal, as flights come in."""

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._bound = StoppingBound(goal.target, goal.confidence) if goal.stops and goal.target is not None else None

    @property
    def fewest(self) -> int:
        """Flights that may answer, at the least."""
        return self._bound.fewest if self._bound is not None else self._goal.flights

    def decides(self, tally: Tally) -> bool:
        """Whether this many flights answer a goal that stops."""
        target, bound = self._goal.target, self._bound
        if bound is None or target is None:
            return False
        reached = bound.excludes(tally.flyable, tally.failed + tally.lost, target, above=True)
        return reached or bound.excludes(tally.flyable + tally.lost, tally.failed, target, above=False)

    def estimate(self, tally: Tally) -> Estimate:
        """What this many flights say."""
        confidence = self._goal.confidence
        if self._bound is not None:
            interval = self._bound.bounds(tally)
            lower, upper = interval
        else:
            lower, upper = lower_bound(tally, confidence), upper_bound(tally, confidence)
            low = clopper_pearson(tally.flyable, tally.flown, confidence).low
            interval = Interval(low, clopper_pearson(tally.flyable + tally.lost, tally.flown, confidence).high)
        return Estimate(tally, lower, upper, interval, self._answer(lower, upper))

    def _answer(self, lower: float, upper: float) -> Answer:
        target = self._goal.target
        if target is None:
            return "none asked"
        if lower >= target:
            return "reached"
        return "missed" if upper < target else "undecided"
