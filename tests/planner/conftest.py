"""A small scenario, and limits of scenarios with an envelope written by hand."""

import math
from collections.abc import Callable

import pytest

from aircraft.path_limits import Limits
from flight.simulation.setup import make_limits as limits_with
from planner.evaluation.problem import Problem, make_problem
from tests.setups import falling_envelope, small_scenario
from world.scenario import Scenario


def _limits_of(scenario: Scenario) -> Limits:
    flight = scenario.flight
    return limits_with(
        scenario, falling_envelope(), flight.airspeed_mps or 25.0, math.radians(flight.max_bank_deg or 30.0)
    )


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    return small_scenario()


@pytest.fixture(scope="session")
def limits(scenario: Scenario) -> Limits:
    return _limits_of(scenario)


@pytest.fixture(scope="session")
def problem(scenario: Scenario, limits: Limits) -> Problem:
    return make_problem(scenario, limits)


@pytest.fixture(scope="session")
def make_limits() -> Callable[[Scenario], Limits]:
    return _limits_of


@pytest.fixture(scope="session")
def small() -> Callable[..., Scenario]:
    return small_scenario
