"""Missions beyond one limit, and inside all of them, by 20 % and by 10 %: what both levels say of each.

100 and 100 of either with PLANFLY_SOAK=1, the first few otherwise.
"""

import pytest

from flight.simulation.simulate import Flight, fly_to_end
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.verdict import Verdict
from tests.logs.verdict.judging import bare
from tests.missions import KINDS, MadeMission, feasible, infeasible
from tests.soak import SOAK, scaled

MARGINS = (0.2, 0.1) if SOAK else (0.2,)
BEYOND, INSIDE = range(scaled(100, len(KINDS))), range(scaled(100, 4))


def levels(made: MadeMission) -> dict[str, Verdict]:
    """Verdicts by geometry, of the flight, and of the flight without the aircraft's envelope."""
    flown = fly_to_end(Flight(made.setup, made.uav.aircraft))
    return {
        "geometric": judge_geometry(made.setup),
        "flown": judge_flight(made.setup, flown.track, flown.ended),
        "flown alone": judge_flight(made.setup, flown.track, flown.ended, envelope=False),
    }


def limits_agree_with_results(verdict: Verdict) -> None:
    """Assert that the printed number of each finding is within its printed limit exactly where its margin says so."""
    for item in verdict.findings:
        value, limit = item.value, item.effective_limit
        if value is None or limit is None or item.margin is None or item.rule == "threat":
            continue
        inside = value >= limit - 1e-5 if item.at_least else value <= limit + 1e-5
        assert inside is (item.margin + (item.tolerance or 0.0) >= -1e-5), item
        assert inside or item.ok is not True, item
        if not inside:
            shown, passes = item.compared_texts()
            assert shown != passes[2:], item


@pytest.mark.parametrize("margin", MARGINS)
@pytest.mark.parametrize("number", BEYOND)
def test_beyond_one_limit_is_not_flyable_and_the_rule_is_named(number: int, margin: float) -> None:
    made = infeasible(number, margin)
    for level, verdict in levels(made).items():
        limits_agree_with_results(verdict)
        named = [item for item in verdict.findings if item.ok is False and item.rule == made.rule]
        assert not verdict.flyable, (made.kind, level)
        assert {bare(item.place) for item in named} & set(made.places), (made.kind, level, verdict.summary)


@pytest.mark.parametrize("margin", MARGINS)
@pytest.mark.parametrize("number", INSIDE)
def test_inside_every_limit_is_flyable(number: int, margin: float) -> None:
    for level, verdict in levels(feasible(number, margin)).items():
        limits_agree_with_results(verdict)
        assert verdict.flyable, (level, verdict.summary)


def test_the_missions_are_what_they_say() -> None:
    """Every kind is there, each from its number alone."""
    kinds = [infeasible(number, 0.2).kind for number in range(len(KINDS))]
    assert kinds == list(KINDS)
    one, two = infeasible(3, 0.2), infeasible(3, 0.2)
    assert (one.setup.route.positions == two.setup.route.positions).all()
    assert not feasible(3, 0.2).kind
