"""A climb over a hill that the aircraft clears and ArduPlane does not, for it follows a slope three seconds late."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from flight.ardupilot.parameters import default_parameters, load_parameters
from flight.simulation.flight_setup import FlightSetup
from logs.recording.reader import read_log
from logs.verdict.findings import verdict_json
from logs.verdict.wording import deciding_text
from planfly.airframe import load_airframe
from planfly.flights_beside import airframe_answer, find_deciding_parameter
from planfly.pipeline import JudgedFlight, fly_and_judge
from planfly.served_flights import ServedLog
from planfly.terminal.stored_logs import judge_log
from tests.setups import setup_maker

AIRCRAFT = load_aircraft("aerosonde")
SLOPE = 0.1
REQUIRED = 100.0


def over_a_hill(spare: float) -> FlightSetup:
    """A climb of 1 in 10 over a hill under its middle, that clears it by what is required and ``spare`` m more.

    Line less Gaussian is least 0.1 sigma^2 / height before the peak, by half of 0.1 of that less than over the peak.
    """
    sigma = 300.0
    height = 450.0 - REQUIRED - spare
    height -= 0.5 * SLOPE * SLOPE * sigma**2 / height
    points = [[0, 0, 300], [0, 2000, 300], [0, 5000, 600], [0, 7000, 600]]
    peak = {"east_m": 0.0, "north_m": 3500.0, "height_m": height, "sigma_m": sigma}
    made = setup_maker(AIRCRAFT)(
        points, terrain={"kind": "peaks", "peak": [peak]}, limits={"min_clearance_m": REQUIRED}
    )
    return replace(made, parameters=load_parameters(AIRCRAFT))


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[JudgedFlight, Path]:
    setup, log = over_a_hill(4.7), tmp_path_factory.mktemp("hill") / "flight.mcap"
    return fly_and_judge(setup, load_airframe(setup.scenario), log), log


def test_the_aircraft_can_and_arduplane_cannot(flown: tuple[JudgedFlight, Path]) -> None:
    """2.5 m/s of climb, three seconds late, are 7.5 m: too low by 3 m; a lag of 4.7 / 2.5 = 1.9 s would pass."""
    judged, _ = flown
    climb = 25.0 * math.sin(math.atan(SLOPE))
    assert [(level.name, level.flyable) for level in judged.verdict.levels] == [
        ("geometry", True),
        ("airframe", True),
        ("autopilot", False),
    ]
    deciding = judged.verdict.deciding
    assert deciding is not None
    assert (deciding.name, deciding.current, deciding.rule, deciding.place.index) == (
        "TECS_HDEM_TCONST", 3.0, "clearance", 1,
    )  # fmt: skip
    assert deciding.passing == pytest.approx(4.7 / climb, abs=0.4)
    # And what the start of the climb takes.
    assert deciding.off == pytest.approx(-3.0 * climb, abs=2.5)
    second = judged.verdict.lines[1]
    assert second.startswith("The aircraft can, ArduPlane with these parameters cannot: TECS_HDEM_TCONST 3 puts it ")
    assert second.endswith(f"m low on leg 1, to item 2; {deciding.passing:g} would pass")


def test_a_served_flight_tells_stations_which_parameter_decides(
    flown: tuple[JudgedFlight, Path], tmp_path: Path
) -> None:
    judged, _ = flown
    served = ServedLog(tmp_path / "flight-001.mcap", judged.setup, AIRCRAFT)
    served.write(judged.track)
    told = served.finish(judged.ended, lambda: False)
    deciding = judged.verdict.deciding
    assert deciding is not None
    assert not told.flyable
    assert deciding_text(deciding) in [text.text for text in told.texts]


@pytest.mark.parametrize("patience", [0, 400])
def test_in_a_hurry_flights_beside_are_given_up_and_the_verdict_is_not(
    patience: int, flown: tuple[JudgedFlight, Path], tmp_path: Path
) -> None:
    """At once, and after the airframe's flight of some 280 s: nothing is lost but what was not known yet."""
    judged, _ = flown
    asked = itertools.count()
    served = ServedLog(tmp_path / "flight-001.mcap", judged.setup, AIRCRAFT)
    served.write(judged.track)
    told = served.finish(judged.ended, lambda: next(asked) >= patience)
    assert not told.flyable
    assert next(asked) == patience + 1
    log = read_log(tmp_path / "flight-001.mcap")
    assert log.complete
    assert log.recorded_verdict is not None
    assert log.recorded_verdict["flyable"] is False
    assert judged.beside is not None
    assert log.beside == (None if patience == 0 else replace(judged.beside, deciding=None))


def test_its_log_repeats_the_verdict_byte_for_byte(flown: tuple[JudgedFlight, Path]) -> None:
    judged, path = flown
    log = read_log(path)
    assert log.beside == judged.beside
    assert verdict_json(judge_log(log)) == verdict_json(judged.verdict)


def test_nothing_is_looked_for_where_nothing_failed() -> None:
    setup = over_a_hill(30.0)
    judged = fly_and_judge(setup, load_airframe(setup.scenario), None)
    assert judged.verdict.flyable
    assert judged.beside is not None
    assert judged.beside.airframe == airframe_answer(setup, AIRCRAFT)
    assert judged.beside.deciding is None
    assert find_deciding_parameter(setup, AIRCRAFT, judged.verdict) is None


def test_planflys_guidance_has_no_flight_beside_it() -> None:
    setup = replace(over_a_hill(30.0), parameters=None)
    judged = fly_and_judge(setup, load_airframe(setup.scenario), None)
    assert judged.beside is None
    assert [level.name for level in judged.verdict.levels] == ["geometry", "airframe"]


def test_the_airframe_knows_where_it_is_whatever_the_autopilot_does() -> None:
    lost = replace(over_a_hill(30.0), nav="gnss", parameters=default_parameters())
    assert airframe_answer(lost, AIRCRAFT) == airframe_answer(replace(lost, nav="perfect"), AIRCRAFT)
