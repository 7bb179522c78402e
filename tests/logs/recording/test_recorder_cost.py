"""Recording, checking and reporting stay within their bounds of time and bytes; `make bench` prints the figures."""

from pathlib import Path

import pytest

from benchmarks.chain import in_child, long_flight, recording
from flight.mission.from_plan import plan_mission
from logs.recording.reader import read_log
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from tests.soak import SOAK, only_in_soak
from world.scenario import load_scenario

# Of some 3 minutes each.
LEGS = 20 if SOAK else 2


@pytest.mark.skipif(not SOAK, reason="a ratio of times, which other tests disturb: in make soak and make bench")
def test_recording_costs_a_fraction_of_the_flight(tmp_path: Path) -> None:
    scenario = load_scenario("jacksboro-air")
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, 1)
    mission = plan_mission(plan, uav.airspeed, uav.max_bank)
    setup = make_setup(scenario, uav, mission, 1, plan=plan)
    # The first round compiles what is not compiled yet.  Of each the least of all rounds counts, and more are flown
    # while another test on the next core makes one of them slow.
    spent = recording(setup, uav, tmp_path, rounds=10)
    for _ in range(4):
        if spent["flight, recorded at 20 Hz"] < 1.20 * spent["flight"]:
            break
        again = recording(setup, uav, tmp_path, rounds=2)
        spent = {label: min(spent[label], again[label]) for label in spent}
    assert spent["flight, recorded at 20 Hz"] < 1.20 * spent["flight"]
    assert spent["flight, recorded at 60 Hz"] < 1.60 * spent["flight"]


@pytest.fixture(scope="module")
def hour(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    """An hour (outside the full count a twentieth of it) in wind and turbulence, and how many hours it is."""
    return long_flight(tmp_path_factory.mktemp("hour"), LEGS)


@only_in_soak
def test_an_hour_takes_less_than_45_megabytes(hour: tuple[Path, float]) -> None:
    log, hours = hour
    assert hours > (1.0 if SOAK else 0.04)
    assert log.stat().st_size < 45e6 * hours
    assert read_log(log).complete


@pytest.mark.skipif(not SOAK, reason="seconds, which other tests disturb: in make soak and make bench")
def test_an_hour_is_checked_in_5_seconds_and_reported_in_15(hour: tuple[Path, float], tmp_path: Path) -> None:
    log, _ = hour
    assert in_child("check", str(log), rounds=1) < 5.0
    assert in_child("report", str(log), "--out", str(tmp_path / "out"), rounds=1) < 15.0
    assert (tmp_path / "out" / "report.html").stat().st_size < 8e6
