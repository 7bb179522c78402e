"""``planfly window``: exit codes, the chart and the answer, with flights in a wind that is too strong for a while."""

from pathlib import Path
from typing import Any

import pytest

import planfly
from planfly.cli import main
from tests.planfly.campaigns.made_campaigns import MISSION, SCENARIO
from tests.planfly.campaigns.test_find_window import hourly_winds, without_wind
from tests.planfly.misuse.test_bad_input import refused
from tests.planfly.terminal.answers.checked_answers import answered
from tests.world.made.forecast_files import write_netcdf

DAY = "2026-05-01T"
WORDS = ("window", "short.waypoints", "--scenario", "short.toml", "--forecast", "winds.nc", "--flights", "10")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A short mission to the east, in a head wind that exceeds the airspeed of 25 m/s at 8 and 9 o'clock."""
    monkeypatch.chdir(tmp_path)
    Path("short.toml").write_text(without_wind(SCENARIO), encoding="utf-8")
    Path("short.waypoints").write_text(MISSION, encoding="ascii")
    dataset = hourly_winds(3.0, 3.0, 33.0, 33.0, 3.0, 3.0)
    write_netcdf(tmp_path / "winds.nc", dataset.assign(u=-dataset.u))
    return tmp_path


def departures(answer: dict[str, Any]) -> list[tuple[str, bool | None, int]]:
    return [(one["time"][11:16], one["is_open"], one["flyable"]) for one in answer["departures"]]


def test_a_window_around_a_storm(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = (*WORDS, "--seed", "1", "--from", f"{DAY}06:00Z", "--to", f"{DAY}11:00Z", "--workers", "2", "--out", "out")
    answer = answered(capsys, 0, *words)
    assert departures(answer) == [
        ("06:00", True, 10),
        ("07:00", True, 10),
        ("08:00", False, 0),
        ("09:00", False, 0),
        ("10:00", True, 10),
        ("11:00", None, 0),
    ]
    assert answer["windows"] == [
        {"first": f"{DAY}06:00:00+00:00", "last": f"{DAY}07:00:00+00:00"},
        {"first": f"{DAY}10:00:00+00:00", "last": f"{DAY}10:00:00+00:00"},
    ]
    assert (answer["is_go"], answer["asked"]) == (True, None)
    storm = answer["departures"][2]
    assert storm["rules"][0] == storm["by_rule"][0]["rule"]
    assert storm["wind_mps"] == pytest.approx(33.0, abs=0.01)
    assert "the forecast ends at 2026-05-01 11:00 UTC" in answer["departures"][5]["not_judged"]
    assert answer["not_judged"] == ""
    assert [Path(file).name for file in answer["files"]] == ["window.png", "report.html"]
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "planfly window short.waypoints --from 2026-05-01T06:00Z --to 2026-05-01T11:00Z --every 1h" in page
    assert (folder / "out" / "window.png").read_bytes().startswith(b"\x89PNG")
    assert "forecast winds.nc" in answer["conditions"]["forecast"]


@pytest.mark.parametrize(
    ("at", "code", "words"),
    [
        (
            "07:00",
            0,
            "take-off at 2026-05-01 07:00 UTC: go, 10 of 10 flights are flyable; take-off windows (UTC):"
            " 2026-05-01 06:",
        ),
        (
            "08:00",
            4,
            "take-off at 2026-05-01 08:00 UTC: no go, 0 of 10 flights are flyable, less than the required 90 %; take",
        ),
        ("11:00", 3, "take-off at 2026-05-01 11:00 UTC: not judged: "),
    ],
)
def test_the_exit_code_answers_for_the_time_that_is_asked_about(
    at: str, code: int, words: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times = ("--at", f"{DAY}{at}Z", "--from", f"{DAY}06:00Z", "--to", f"{DAY}08:00Z", "--every", "1h")
    assert main([*WORDS, *times, "--workers", "1"]) == code
    printed = capsys.readouterr().out
    assert printed.startswith(f"window    {words}")
    assert "wind from forecast winds.nc" in printed


def test_no_open_departure(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times = ("--from", f"{DAY}08:00Z", "--to", f"{DAY}09:00Z", "--every", "30 min")
    answer = answered(capsys, 4, *WORDS, *times, "--workers", "1")
    assert answer["headline"] == "no take-off time is flyable"
    assert [one["time"][11:16] for one in answer["departures"]] == ["08:00", "08:30", "09:00"]


def test_the_first_departures_may_be_before_the_forecast(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times = ("--from", f"{DAY}05:00Z", "--to", f"{DAY}06:00Z")
    answer = answered(capsys, 0, *WORDS, *times, "--workers", "1")
    assert departures(answer) == [("05:00", None, 0), ("06:00", True, 10)]


def test_the_result_in_python(folder: Path) -> None:
    result = planfly.window(
        "short.waypoints",
        scenario="short.toml",
        forecast="winds.nc",
        earliest=f"{DAY}10:30+00:00",
        flights=10,
        workers=1,
    )
    assert repr(result) == "<WindowResult short: 1 departures open>"
    assert result.files == ()
    # The default end is the last time from which the forecast covers the flight of a minute.
    assert [f"{departure.time:%H:%M}" for departure in result.departures] == ["10:30"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ((), "--from: missing; state the first time of take-off, or --at TIME"),
        (("--from", "06:00"), "--from 06:00: expected a time in ISO 8601 format with its offset from UTC"),
        (("--from", f"{DAY}06:00"), f"--from {DAY}06:00: expected a time in ISO 8601 format with its offset from UTC"),
        (("--at", f"{DAY}06:00Z/{DAY}07:00Z"), f"--at {DAY}06:00Z/{DAY}07:00Z: expected a time in ISO 8601"),
        (("--from", f"{DAY}06:00Z", "--to", f"{DAY}05:00Z"), f"--to {DAY}05:00Z: expected a time after"),
        (("--from", f"{DAY}06:00Z", "--every", "0min"), "--every 0min: expected a time such as 30min or 1h"),
        (("--from", f"{DAY}06:00Z", "--every", "25h"), "--every 25h: expected a time such as 30min or 1h"),
        (
            ("--from", f"{DAY}06:00Z", "--to", "2026-06-01T06:00Z", "--every", "1h"),
            "--every 1h: expected at most 400 departures",
        ),
        (
            ("--from", "2026-06-01T06:00Z"),
            "winds.nc: time: take-off 2026-06-01 06:00 UTC: the forecast covers 2026-05-01",
        ),
        (("--from", f"{DAY}06:00Z", "--wind", "3,270"), "--wind: not allowed with a forecast, which states the wind"),
    ],
)
def test_bad_questions(words: tuple[str, ...], line: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert line in refused([*WORDS, *words, "--out", "out"], folder, capsys)


@pytest.mark.parametrize("option", [("--probability", "1.5"), ("--flights", "3"), ("--flights", "many")])
def test_numbers_out_of_range(option: tuple[str, str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([*WORDS, "--from", f"{DAY}06:00Z", *option])
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_window_needs_a_forecast(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["window", "short.waypoints", "--scenario", "short.toml", "--from", f"{DAY}06:00Z"]
    assert "--forecast: missing; a window needs a forecast" in refused(words, folder, capsys)
