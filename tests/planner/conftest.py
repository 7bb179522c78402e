"""Scenarios and limits for the planner's tests, with an envelope written by hand."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from planner.evaluation.problem import Problem, make_problem
from world.scenario import Scenario, from_spec


def make_envelope() -> Envelope:
    """About an Aerosonde: 13.7 degrees of climb at 25 m/s and 500 m, falling with height; 7.8 of descent."""
    speeds, heights = np.array([20.0, 25.0, 30.0]), np.array([0.0, 1000.0, 3000.0])
    fall = np.array([0.0, 2.4, 7.2])
    climb = np.radians(np.array([17.0, 14.9, 6.0])[:, None] - fall[None, :])
    descent = np.radians(np.array([6.5, 7.8, 10.0])[:, None] + 0.0 * heights[None, :])
    return Envelope(
        aircraft="by hand",
        model_hash="",
        motor_braking=False,
        airspeed=speeds,
        amsl=heights,
        climb=climb,
        descent=descent,
        level_speed_min=np.full(3, 18.0),
        level_speed_max=np.full(3, 33.0),
        max_bank=math.radians(45.0),
    )


def limits_of(scenario: Scenario) -> Limits:
    def number(value: float | str) -> float | None:
        return None if isinstance(value, str) else math.radians(value)

    table = scenario.limits
    return Limits(
        number(table.max_turn_deg),
        number(table.max_climb_deg),
        number(table.max_dive_deg),
        table.min_clearance_m,
        make_envelope(),
        scenario.flight.airspeed_mps or 25.0,
        math.radians(scenario.flight.max_bank_deg),
        scenario.wind,
    )


def small_scenario(**changes: Any) -> Scenario:
    """A small scenario: one hill and one missile on a 6 km line; tables of the file may be replaced."""
    spec: dict[str, Any] = {
        "name": "small",
        "terrain": {"kind": "peaks", "peak": [{"east_m": 2000, "north_m": 200, "height_m": 500, "sigma_m": 400}]},
        "area": {"east_m": [-500, 6500], "north_m": [-3000, 3000], "ceiling_amsl_m": 450},
        "start": {"east_m": 0, "north_m": 0, "amsl_m": 150},
        "destination": {"east_m": 6000, "north_m": 0, "amsl_m": 150},
        "threats": [
            {
                "east_m": 4200,
                "north_m": -200,
                "kill_radius_m": 700,
                "kill_scale_m": 200,
                "detection_radius_m": 1200,
                "detection_scale_m": 400,
            }
        ],
        "planner": {"waypoints": 8, "population": 60, "generations": 25},
    }
    return from_spec(spec | changes, "small")


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    return small_scenario()


@pytest.fixture(scope="session")
def limits(scenario: Scenario) -> Limits:
    return limits_of(scenario)


@pytest.fixture(scope="session")
def problem(scenario: Scenario, limits: Limits) -> Problem:
    return make_problem(scenario, limits)


@pytest.fixture(scope="session")
def make_limits() -> Callable[[Scenario], Limits]:
    return limits_of


@pytest.fixture(scope="session")
def small() -> Callable[..., Scenario]:
    return small_scenario
