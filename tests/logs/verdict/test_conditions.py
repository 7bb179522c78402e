"""What a verdict says it is for: an aircraft that somebody named or nobody did, its speed, the weather, the ground."""

from dataclasses import replace

import pytest

from logs.verdict.conditions import condition_lines
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
