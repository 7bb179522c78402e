"""A plan that is not feasible has a verdict without a flight."""

from dataclasses import replace

from flight.simulation.setup import FlightSetup
from logs.recording.example_log import example_log
from logs.verdict.judge_flight import judge_plan_only
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.places import PLAN
from logs.verdict.rules.registry import RULES, run_rules
from logs.verdict.verdict import verdict_json
from tests.logs.verdict.judging import bad_plan, failing


def test_a_plan_that_is_not_feasible(setup: FlightSetup) -> None:
    verdict = judge_plan_only(bad_plan(setup))
    verdict_json(verdict)
    assert not verdict.complete
    assert not verdict.flyable
    assert failing(verdict) == {("slope", PLAN), ("completion", PLAN)}
    assert "slope" in verdict.summary.split("\n")[0]
    assert "leg 2: slope 16.6 deg" in verdict.summary


def test_a_leg_that_is_too_short_for_its_turns_is_named_instead_of_the_margin_that_turns_keep(
    setup: FlightSetup,
) -> None:
    plan = bad_plan(setup)
    short = replace(plan, certificate=replace(plan.certificate, available_length=-31.2))
    finding = next(item for item in judge_plan_only(short).findings if item.rule == "turn")
    assert not finding.ok
    assert finding.reason == "the plan turns too sharply; a leg is 31 m too short for its turns"


def test_rules_come_in_the_verdicts_order() -> None:
    log = example_log()
    requirements = route_requirements(log.setup)
    findings = run_rules(requirements, align_track(requirements, log.track), end_reason="completed")
    order = list(RULES)
    assert [order.index(item.rule) for item in findings] == sorted(order.index(item.rule) for item in findings)


def test_without_the_envelope_nothing_is_said_of_the_stall() -> None:
    log = example_log()
    requirements = route_requirements(log.setup, envelope=False)
    findings = run_rules(requirements, align_track(requirements, log.track), end_reason="completed")
    assert not [item for item in findings if item.rule == "stall"]
