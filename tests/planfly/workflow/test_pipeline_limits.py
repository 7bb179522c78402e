"""A flight cannot run away: its simulated time and its log have limits, and what it comes to is told before."""

import contextlib
import dataclasses
import math
from pathlib import Path

import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.simulation.setup import FlightSetup
from logs.recording.example_log import example_log
from logs.recording.reader import read_log
from planfly.cli import main
from planfly.runtime.stages import Advance, Receiver, send_progress_to
from planfly.workflow.open_flight import open_flight
from planfly.workflow.pipeline import fly_and_judge, flying_stage
from planfly.workflow.suggestion_trials import predicted_seconds
from tests.planfly.conftest import FIELD
from tests.planfly.misuse.test_interruptions import LONG
from tests.synthetic import make_setup


@pytest.fixture
def long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A mission of 3 rounds, 14 km: some 10 minutes."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    (tmp_path / "long.waypoints").write_text(LONG.replace("177 1 12", "177 1 2"), encoding="ascii")
    return tmp_path / "long.waypoints"


def test_simulated_time_has_a_limit(long: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = [
        "fly",
        long.name,
        "--scenario",
        "field.toml",
        "--guidance",
        "path",
        "--log",
        "f.mcap",
        "--max-hours",
        "0.02",
    ]
    assert main(argv) == 4
    # 0.02 h are 72 s.
    assert "time limit of 72 s reached" in capsys.readouterr().out
    log = read_log(Path("f.mcap"))
    assert log.complete
    assert log.track.time[-1] == pytest.approx(72.0, abs=1.0 / 30.0)


def test_a_log_has_a_limit(long: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["fly", long.name, "--scenario", "field.toml", "--guidance", "path", "--log", "f.mcap"]
    argv += ["--max-log", "1.5"]
    assert main(argv) == 4
    assert "log limit: the log has reached 1.5 MB; --max-log raises the limit" in capsys.readouterr().out
    log = read_log(Path("f.mcap"))
    assert log.complete
    assert 1.5e6 < Path("f.mcap").stat().st_size < 2.5e6


def test_what_a_flight_comes_to_is_told_before(long: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its predicted time is that of the flight, within a twentieth."""
    opened = opened_calm(long)
    told = told_of(opened)
    flown = fly_and_judge(opened)
    assert flown.ended == "completed"
    assert predicted_seconds(opened) == pytest.approx(float(flown.track.time[-1]), rel=0.05)
    assert (
        told == f"flying {opened.path.length / 1e3:.1f} km, about {predicted_seconds(opened) / 60:.0f} min in the air"
    )


def test_energy_ends_a_flight(long: Path) -> None:
    """At what is carried, where that is more than half of what the way takes by prediction; else it does not begin."""
    opened = opened_calm(long)
    flown = fly_and_judge(opened)
    used = float(flown.track.energy[-1])
    less = dataclasses.replace(opened, battery=0.7 * used)
    short = fly_and_judge(less)
    assert short.ended == "nothing is left in the battery or the tank"
    assert float(short.track.energy[-1]) == pytest.approx(0.7 * used, rel=1e-3)
    none = fly_and_judge(dataclasses.replace(opened, battery=0.1 * used))
    assert (len(none.track), none.ended) == (0, "not started: the mission needs 10 times the energy carried")


def opened_calm(path: Path) -> FlightSetup:
    """Opened for planfly's own guidance in still air."""
    return open_flight(path, {"scenario": "field.toml", "guidance": "path", "wind": (0.0, 0.0), "turbulence": "none"})


def told_of(setup: FlightSetup) -> str:
    """The title of the stage in which it is flown."""
    titles: list[str] = []

    def begin(title: str, _kind: str) -> contextlib.AbstractContextManager[Advance]:
        titles.append(title)
        return contextlib.nullcontext(lambda *_: None)

    with send_progress_to(Receiver(begin, titles.append)), flying_stage(setup):
        (title,) = titles
        return title


def test_a_short_flight_is_told_in_seconds() -> None:
    assert told_of(example_log().setup).endswith(" s in the air")


def test_a_speed_that_the_autopilot_ignores_lengthens_no_predicted_flight() -> None:
    """ArduPlane takes no DO_CHANGE_SPEED below AIRSPEED_MIN."""
    setup = dataclasses.replace(example_log().setup, autopilot=ArduPlane(ArduPilotParameters.defaults()))
    slow = setup.route.with_fields(airspeed=0.001)
    assert predicted_seconds(dataclasses.replace(setup, route=slow)) == pytest.approx(predicted_seconds(setup))


def test_a_flight_at_an_equivalent_airspeed_is_predicted_at_the_true_one() -> None:
    """At 3,000 m: 4 km at 25 m/s times the root of 1.2250 kg/m^3 at sea level by 0.9093 (ISO 2533)."""
    made = make_setup([[0, 0, 3000], [0, 4000, 3000]], terrain={"kind": "flat", "amsl_m": 2500.0})
    assert predicted_seconds(made) == pytest.approx(160.0)
    setup = dataclasses.replace(made, autopilot=ArduPlane(ArduPilotParameters.defaults()))
    assert predicted_seconds(setup) == pytest.approx(160.0 / math.sqrt(1.2250 / 0.9093), rel=1e-3)
