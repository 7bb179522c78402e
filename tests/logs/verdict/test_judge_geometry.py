"""A plan that is not feasible has a verdict without a flight."""

from flight.simulation.flight_setup import FlightSetup
from logs.verdict.findings import verdict_json
from logs.verdict.judge_flight import judge_plan_only
from logs.verdict.places import PLAN
from tests.logs.verdict.judging import bad_plan, failing


def test_a_plan_that_is_not_feasible(setup: FlightSetup) -> None:
    verdict = judge_plan_only(bad_plan(setup))
    verdict_json(verdict)
    assert not verdict.complete
    assert not verdict.flyable
    assert failing(verdict) == {("slope", PLAN), ("completion", PLAN)}
    assert "slope" in verdict.summary.split("\n")[0]
    assert "leg 2: slope 16.6 deg" in verdict.summary
