"""``planfly link``: a flight's link by options and by a scenario; what it prints and answers; bad input."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

import planfly
from logs.recording.example_log import example_log, write_example_log
from logs.verdict.judge_flight import judge_flight
from planfly.cli import main
from world.errors import PlanflyError
from world.scenario import with_link

RADIO = {"frequency": 1000.0, "power": 20.0, "sensitivity": -100.0}


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return write_example_log(tmp_path / "flight.mcap")


def test_options_and_a_scenario_give_the_same_answer() -> None:
    flight = example_log()
    origin = flight.setup.scenario.origin
    by_options = planfly.link(flight, **RADIO, station=(origin.lat_deg, origin.lon_deg), antenna=20.0, fade_margin=5.0)
    entries = {"frequency_mhz": 1000.0, "power_dbm": 20.0, "sensitivity_dbm": -100.0, "antenna_m": 20.0}
    scenario = with_link(
        flight.setup.scenario, **entries, lat_deg=origin.lat_deg, lon_deg=origin.lon_deg, fade_margin_db=5.0
    )
    linked = replace(flight, setup=flight.setup.in_scenario(scenario))
    assert planfly.link(linked).finding == by_options.finding
    verdict = judge_flight(linked.setup, linked.track, "completed")
    assert by_options.finding in verdict.findings


def test_a_weaker_receiver_keeps_less_margin() -> None:
    """10 dB less sensitivity are 10 dB less margin at every point."""
    flight = example_log()
    origin = flight.setup.scenario.origin
    station = (origin.lat_deg, origin.lon_deg)
    strong, weak = (
        planfly.link(flight, **{**RADIO, "sensitivity": sensitivity}, station=station).along
        for sensitivity in (-100.0, -90.0)
    )
    assert strong is not None
    assert weak is not None
    assert (strong.points.margin - weak.points.margin) == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frequency": 900.0, "power": 20.0}, r"sensitivity missing: expected a number, or a scenario with \[link\]"),
        ({**RADIO, "frequency": 5.0}, "frequency 5.0: expected a frequency from 30 to 100,000 MHz"),
        ({**RADIO, "station": (99.0, 0.0)}, "link"),
    ],
)
def test_bad_input_is_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(PlanflyError, match=message):
        planfly.link(example_log(), **options)


@pytest.mark.usefixtures("blank_pictures")
def test_the_command_prints_answers_and_draws(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    origin = example_log().setup.scenario.origin
    radio = ["--frequency", "1000", "--power", "-30", "--sensitivity", "-30"]
    place = ["--station", f"{origin.lat_deg},{origin.lon_deg}"]
    assert main(["link", str(log), *radio, *place, "--out", "drawn", "--json", "answer.json"]) == 4
    out = capsys.readouterr().out
    assert "dB below the fade margin" in out
    answer = json.loads(Path("answer.json").read_text(encoding="utf-8"))
    assert (answer["ok"], answer["exit_code"]) == (False, 4)
    assert answer["files"] == [str(Path("drawn") / name) for name in ("link.png", "link-map.png")]
    assert all(Path(name).exists() for name in answer["files"])
    assert main(["link", str(log), *radio[:4]]) == 2
    assert "--sensitivity missing: expected a number, or a scenario with [link]" in capsys.readouterr().err
