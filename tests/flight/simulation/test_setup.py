"""Which real autopilot flew: data that a setup carries and that compares by value."""

import math
from typing import Any

import pytest

from aircraft.path_limits import Limits
from flight.autopilots.autopilot import AutopilotProgram
from flight.simulation.setup import Damage, ImportedLog, make_limits
from tests.setups import falling_envelope, route_along, setup_along, small_scenario
from world.wind import Wind


def test_two_records_of_one_program_are_one() -> None:
    first = AutopilotProgram("ArduPlane V4.6.0", "ab" * 32, {"WP_RADIUS": 90.0}, {})
    assert first == AutopilotProgram("ArduPlane V4.6.0", "ab" * 32, {"WP_RADIUS": 90.0}, {}, ())
    assert first != AutopilotProgram("ArduPlane V4.6.0", "ab" * 32, {"WP_RADIUS": 60.0}, {})


def test_a_cut_end_is_no_loss() -> None:
    """Every log that ends with the power ends within a message."""
    assert not Damage(cut=True).lossy
    assert Damage(places=1).lossy
    assert Damage(unreadable=1).lossy


def test_a_source_holds_nothing_that_is_not_stated() -> None:
    source = ImportedLog("a.BIN", "", "")
    assert (source.holds, source.stretches, source.heights.datum, source.aircraft_known) == ((), (), "unstated", False)


# ----------------------------------------------------------------------
# A setup's limits: the scenario's degrees in radians, each in its own place, and the lesser bank.


def limits_of(bank_deg: float = 20.0, **tables: Any) -> Limits:
    return make_limits(small_scenario(**tables), falling_envelope(), 26.0, math.radians(bank_deg))


def test_degrees_become_radians_and_climb_and_dive_are_not_swapped() -> None:
    limits = limits_of(limits={"max_turn_deg": 60, "max_climb_deg": 9, "max_dive_deg": 12, "min_clearance_m": 45})
    assert limits.max_turn == pytest.approx(math.pi / 3)
    assert limits.max_climb == pytest.approx(math.pi / 20)
    assert limits.max_dive == pytest.approx(math.pi / 15)
    assert limits.min_clearance == 45.0
    assert limits.airspeed == 26.0


@pytest.mark.parametrize("name", ["turn", "climb", "dive"])
def test_what_is_left_to_the_aircraft_has_no_number(name: str) -> None:
    numbers: dict[str, Any] = {"max_turn_deg": 60, "max_climb_deg": 9, "max_dive_deg": 12}
    limits = limits_of(limits=numbers | {f"max_{name}_deg": "aircraft"})
    without = [other for other in ("turn", "climb", "dive") if getattr(limits, f"max_{other}") is None]
    assert without == [name]


def test_the_bank_is_the_lesser_of_the_asked_and_the_aircrafts() -> None:
    # The hand-written aircraft banks 45 degrees.
    assert limits_of(20.0).max_bank == pytest.approx(math.radians(20.0))
    assert limits_of(45.0).max_bank == pytest.approx(math.radians(45.0))
    assert limits_of(60.0).max_bank == pytest.approx(math.radians(45.0))


def test_the_wind_is_the_scenarios() -> None:
    limits = limits_of(wind={"speed_mps": 7, "from_deg": 90, "gradient": 0.01, "turbulence": "light", "seed": 3})
    # It is stated at the height of the start.
    assert limits.wind == Wind(7.0, pytest.approx(math.pi / 2), 0.01, "light", 3, 150.0)


def test_a_setup_answers_from_its_limits() -> None:
    scenario, envelope = small_scenario(), falling_envelope()
    route = route_along([[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]], 27.0)
    setup = setup_along(scenario, route, envelope, airspeed=27.0, bank_deg=60.0)
    assert setup.envelope is envelope
    assert setup.airspeed == 27.0
    assert setup.max_bank == pytest.approx(math.radians(45.0))
