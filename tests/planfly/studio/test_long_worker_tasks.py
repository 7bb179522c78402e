"""The studio's questions of many flights answer as the commands do, with a few flights on a short mission."""

from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from flight.mission.items import Mission
from planfly.campaigns.worker_pool import Workers
from planfly.flight_options import MissionOptions
from planfly.studio import long_worker_tasks
from planfly.studio.documents import open_document
from planfly.studio.edit_context import EditContext
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


def test_a_battery_is_found(few_flights: None, tmp_path: Path) -> None:
    answer = long_worker_tasks.run_battery_task(opened(tmp_path), lambda *_: None)
    assert " Wh (" in answer["headline"]
    assert any(line.startswith("3 flights") for line in answer["lines"])
