"""One trial: what is flown once, and what is not flown at all."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from logs.recording.example_log import example_log
from logs.verdict.measures import route_requirements
from planfly.workflow import suggestion_trials
from planfly.workflow.suggestion_trials import Trial, TrialAborted, max_explaining_flights
from tests.synthetic import make_setup
from world.errors import StartError

SETUP = example_log().setup
AIRCRAFT = load_aircraft("aerosonde")


def test_a_trial_is_flown_when_it_is_asked_for_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    flown = []

    def fly(setup: object, aircraft: object) -> None:
        flown.append(setup)
        raise StartError("f", "no trim")

    monkeypatch.setattr(suggestion_trials, "Flight", fly)
    trial = Trial(SETUP, AIRCRAFT)
    assert trial.geometry_verdict.level == "geometric"
    assert flown == []
    assert trial.flight_verdict is trial.flight_verdict
    assert flown == [SETUP]
    assert trial.flight[1] == "not started: no trim"
    assert [item.reason for item in trial.flight_verdict.failed if item.rule == "completion"] == [
        "not started: no trim"
    ]


@pytest.mark.parametrize(
    ("ratio", "end_reason"),
    [(1.99, "not started: no trim"), (2.01, "not started: the mission needs 2 times the energy carried")],
)
def test_a_flight_of_more_than_twice_the_energy_carried_is_not_begun(
    ratio: float, end_reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kilowatt all the way takes more than the battery of 0.01 Wh."""
    envelope = replace(SETUP.limits.envelope, power_full=np.array([1000.0]))
    setup = replace(SETUP, battery=0.01, limits=replace(SETUP.limits, envelope=envelope))
    monkeypatch.setattr(route_requirements, "predicted_energy", lambda _: (ratio * 0.01, 0.0))

    def fly(setup: object, aircraft: object) -> None:
        raise StartError("f", "no trim")

    monkeypatch.setattr(suggestion_trials, "Flight", fly)
    assert Trial(setup, AIRCRAFT).flight[1] == end_reason


def test_flights_that_explain_a_verdict_last_six_hours_in_all() -> None:
    """At 20 m/s; a path of 72 km takes an hour, so that six of its flights are allowed, and of 450 km none."""
    for kilometres, flights in ((72.0, 6), (71.0, 6), (73.0, 5), (450.0, 0)):
        way = np.array([[0.0, 0.0, 300.0], [0.0, 1000.0 * kilometres, 300.0]])
        assert max_explaining_flights(make_setup(way, airspeed=20.0)) == flights


def test_a_trial_in_a_hurry_is_aborted() -> None:
    asked = itertools.count()
    with pytest.raises(TrialAborted):
        _ = Trial(SETUP, AIRCRAFT, lambda: next(asked) == 1).flight_verdict
    assert next(asked) == 2
