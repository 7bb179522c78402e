"""What is answered to a target, just inside and just outside of it."""

import pytest

from planfly.campaigns.statistics.decision import Estimator, Goal
from planfly.campaigns.statistics.proportions import Tally


@pytest.mark.parametrize(
    ("flyable", "failed", "answer"),
    [(59, 0, "reached"), (58, 0, "undecided"), (0, 4, "missed"), (93, 11, "missed"), (99, 8, "undecided")],
)
@pytest.mark.parametrize("stops", [False, True])
def test_the_answer_to_95_percent(flyable: int, failed: int, answer: str, stops: bool) -> None:
    found = Estimator(Goal(0.95, stops, 1000)).estimate(Tally(flyable, failed))
    if stops and (flyable, failed) == (93, 11):
        # The bound that holds at every number of flights is wider.
        assert found.answer == "undecided"
    else:
        assert found.answer == answer


def test_nothing_is_answered_where_nothing_was_asked() -> None:
    found = Estimator(Goal(None, False, 10)).estimate(Tally(10, 0))
    assert found.answer == "none asked"
    # Two-sided: 0.025^(1/10); one-sided: 0.05^(1/10).
    assert found.interval.low == pytest.approx(0.025**0.1)
    assert found.lower == pytest.approx(0.05**0.1)


def test_a_lost_flight_keeps_a_target_from_being_reached_and_from_being_missed() -> None:
    estimator = Estimator(Goal(0.95, False, 100))
    assert estimator.estimate(Tally(59, 0, 1)).answer == "undecided"
    assert estimator.estimate(Tally(0, 1, 3)).answer == "undecided"
    assert estimator.estimate(Tally(0, 5, 0)).answer == "missed"


def test_a_lost_flight_counts_against_either_answer() -> None:
    prove = Estimator(Goal(0.99, True, 5000))
    assert prove.decides(Tally(299, 0))
    assert not prove.decides(Tally(299, 0, 1))
    # Twenty failures of a hundred miss it; twenty that were lost may all have flown.
    assert prove.decides(Tally(80, 20))
    assert not prove.decides(Tally(80, 0, 20))
