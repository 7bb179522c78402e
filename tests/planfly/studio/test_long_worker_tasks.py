"""The studio's questions of many flights answer as the commands do, with a few flights on a short mission."""

from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import planfly
from aircraft.data_sheet import DataSheet
from flight.mission.items import Mission
from logs.verdict.places import FLIGHT
from planfly.campaigns.campaign_base import open_campaign
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.worker_pool import Workers
from planfly.flight_options import MissionOptions
from planfly.studio import long_worker_tasks
from planfly.studio.documents import open_document
from planfly.studio.edit_context import EditContext
from planfly.workflow.data_sheets import make_data_sheet_folder
from world.errors import MissionError

ROOT = Path(__file__).parents[3]
FORECAST = ROOT / "examples" / "jacksboro-forecast.json"
# Two waypoints 2 km apart, 300 m above the ground west of Jacksboro.
MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t36.30\t-84.25\t400\t1
1\t0\t3\t16\t0\t0\t0\t0\t36.30\t-84.25\t500\t1
2\t0\t3\t16\t0\t0\t0\t0\t36.318\t-84.25\t500\t1
3\t0\t3\t17\t0\t0\t0\t0\t36.318\t-84.25\t500\t1
"""


@pytest.fixture
def few_flights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long_worker_tasks, "FLIGHT_COUNT", 3)
    monkeypatch.setattr(long_worker_tasks, "_WINDOW_FLIGHTS", 2)
    monkeypatch.setattr(long_worker_tasks, "_WINDOW_SPAN", timedelta(hours=1))
    assert Workers(count=1) == long_worker_tasks._WORKERS


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the aircraft of a data sheet, of which 512 draws are known."""
    folder = tmp_path_factory.mktemp("sheet") / "foam"
    make_data_sheet_folder(folder, DataSheet(mass=2.1, span=1.6, cruise=15.0, stall=10.0))
    return folder


def opened(folder: Path, **options: Any) -> tuple[EditContext, Mission]:
    file = folder / "short.waypoints"
    file.write_text(MISSION, encoding="utf-8")
    setup = open_document(str(file), MissionOptions(**({"terrain": "jacksboro"} | options))).setup
    return EditContext.from_setup(setup), setup.mission


def test_the_departures_are_those_of_the_forecast(few_flights: None, tmp_path: Path) -> None:
    payload = opened(tmp_path, forecast=str(FORECAST), at="2026-12-01T14:00Z")
    shares: list[float] = []
    answer = long_worker_tasks.run_window_task(payload, lambda done, total, remark: shares.append(done / total))
    assert shares == [0.25, 0.5, 0.75, 1.0]
    assert [line[:16] for line in answer["lines"][1:]] == ["2026-12-01 14:00", "2026-12-01 15:00"]
    assert "take-off at 2026-12-01 14:00 UTC" in answer["headline"]
    assert answer["state"] in ("ok", "fail")


def test_without_a_forecast_there_are_no_departures(tmp_path: Path) -> None:
    with pytest.raises(MissionError, match=r"departures need a forecast: planfly studio --forecast FILE --at TIME"):
        long_worker_tasks.run_window_task(opened(tmp_path), lambda *_: None)


def test_a_campaign_names_what_fails_as_the_verdict_does(
    few_flights: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = SimpleNamespace(outcome="not flyable", failures=(("departure", FLIGHT),))
    monkeypatch.setattr(long_worker_tasks, "fly_one", lambda base, index: row)
    answer = long_worker_tasks.run_campaign_task(opened(tmp_path), lambda *_: None)
    assert answer["lines"][0] == "loss of control fails in 3"
    # As the command states it: 0.025 ** (1 / 3) is 0.292 (Clopper and Pearson).
    assert answer["headline"] == "0 of 3 flights are flyable (probability 0% to 71% at 95 % confidence)"


def test_a_battery_is_found(few_flights: None, tmp_path: Path) -> None:
    answer = long_worker_tasks.run_battery_task(opened(tmp_path), lambda *_: None)
    assert " Wh (" in answer["headline"]
    assert any(line.startswith("3 of 3 flights complete the mission") for line in answer["lines"])


def test_the_aircraft_of_a_data_sheet_varies_as_in_the_commands(sheet: Path, tmp_path: Path) -> None:
    """By its draws: all inputs of the flights are those of the command, but the code."""
    options: MissionOptions = {"aircraft": sheet, "wind": (4.0, 300.0), "seed": 5, "terrain": "jacksboro"}
    own = long_worker_tasks._campaign_base(*opened(tmp_path, **options))
    base = open_campaign(str(tmp_path / "short.waypoints"), default_dispersions(), options)
    assert own.dispersions.draws is not None
    assert own.inputs() == base.inputs()
    assert own.uav.battery == base.uav.battery


def test_the_flights_of_a_data_sheets_aircraft_are_those_of_the_api(
    few_flights: None, sheet: Path, tmp_path: Path
) -> None:
    options: dict[str, Any] = {"aircraft": sheet, "wind": (4.0, 300.0), "seed": 5, "terrain": "jacksboro"}
    answer = long_worker_tasks.run_campaign_task(opened(tmp_path, **options), lambda *_: None)
    flown = planfly.campaign(
        tmp_path / "short.waypoints", flights=3, workers=1, out=tmp_path / "campaign", **options
    ).summary.estimate.tally
    assert flown.flown == 3
    assert answer["headline"].startswith(f"{flown.flyable} of 3 flights are flyable")
