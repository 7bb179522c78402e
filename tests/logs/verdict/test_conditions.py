"""What a verdict says it is for: an aircraft that somebody named or nobody did, its speed, the weather, the ground."""

from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.conditions import condition_lines, corridor_line, least_gap
from tests.logs.made_flight import make_setup
from world.errors import FlightError
from world.scenario import with_flight, with_wind
from world.scenario_tables import FlightTable


def test_an_aircraft_that_nobody_named_is_said_to_be_the_default() -> None:
    setup = make_setup()
    unnamed = replace(setup.scenario, flight=FlightTable(aircraft_by_default=True))
    line, _ = condition_lines(setup.in_scenario(unnamed))
    assert line.startswith("Aircraft: aerosonde, 11 kg, ")
    assert line.endswith("; nobody named an aircraft, so it is the default (--aircraft names yours)")
    # An option that says nothing of the aircraft names none either.
    line, _ = condition_lines(setup.in_scenario(with_flight(unnamed, airspeed_mps=24.0)))
    assert "nobody named" in line
    assert "(as stated)" in line
    line, _ = condition_lines(setup.in_scenario(with_flight(unnamed, aircraft="aerosonde")))
    assert "nobody" not in line


def test_weather_and_ground() -> None:
    setup = make_setup()
    windy = with_wind(setup.scenario, 8.04, 3.0 * 3.14159265 / 2.0, "moderate")
    _, line = condition_lines(setup.in_scenario(windy))
    assert line.startswith("Conditions: wind 8.04 m/s from 270 degrees, moderate turbulence; terrain ")
    assert "heights above " in line
    calm = replace(with_wind(setup.scenario, 0.0, 0.0, "none"), terrain=None)
    _, line = condition_lines(setup.in_scenario(calm))
    assert line == "Conditions: no wind, no turbulence; no terrain"


def test_a_logs_aircraft_need_not_be_on_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise FlightError(f"{name}: no such folder")

    monkeypatch.setattr("logs.verdict.conditions.find_aircraft", missing)
    line, _ = condition_lines(make_setup())
    assert " kg" not in line


def lines(gap: float, *, overlap: float = 1.0) -> np.ndarray:
    """Two lines of 900 m side by side, flown to and fro."""
    end = 900.0 * (1.0 - overlap)
    return np.array([[0, 0, 300], [0, 900, 300], [gap, 900, 300], [gap, end, 300]], dtype=float)


@pytest.mark.parametrize(
    ("waypoints", "gap"),
    [
        (lines(40.0), 40.0),
        (lines(-40.0), 40.0),
        # A line that leads away, and one that is flown back, are none beside each other.
        (np.array([[0, 0, 300], [0, 900, 300], [40, 900, 300], [40, 1800, 300]], dtype=float), None),
        (np.array([[0, 0, 300], [0, 900, 300], [40, 900, 300], [900, 900, 300]], dtype=float), None),
        (lines(0.5), None),
    ],
)
def test_the_gap_between_lines_of_a_survey(waypoints: np.ndarray, gap: float | None) -> None:
    found = least_gap(waypoints)
    assert (None if found is None else found[0]) == pytest.approx(gap)


def test_a_corridor_wider_than_the_gap_between_lines_is_told() -> None:
    setup = make_setup()
    survey = replace(setup, route=replace(setup.route, waypoints=lines(20.0)))
    assert setup.corridor == 30.0
    assert corridor_line(survey) == (
        "Corridor: 30 m to either side, planfly's default, is wider than the 20 m between legs 0 and 2: keeping to it"
        " does not show that the lines were flown ([limits] corridor_m states one)"
    )
    assert corridor_line(replace(setup, route=replace(setup.route, waypoints=lines(31.0)))) == ""
    assert corridor_line(setup) == ""
    stated = setup.scenario.limits.model_copy(update={"corridor_m": 30.0})
    assert corridor_line(survey.in_scenario(replace(setup.scenario, limits=stated))) == ""
