"""``planfly winds``: the chart of a short mission, gone on with where it was stopped."""

import json
import shutil
import signal
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aircraft.data_sheet import DataSheet
from aircraft.uncertainty import draws_text, read_draws
from planfly.api import campaigns
from planfly.campaigns import find_winds, report
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.find_winds import WindsGoal
from planfly.campaigns.tables import WINDS_DATABASE, RequestedFlight, WindsStore
from planfly.cli import main
from planfly.workflow.data_sheets import make_data_sheet_folder
from tests.planfly.campaigns.made_campaigns import made_flight, table, write_short
from tests.planfly.campaigns.made_searches import flying_here
from tests.planfly.terminal.answers.checked_answers import answered
from world.interruption import Interrupted

pytestmark = pytest.mark.filterwarnings("default")


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    mission, scenario = write_short(tmp_path_factory.mktemp("winds"))
    return ["winds", str(mission), "--scenario", str(scenario), "--workers", "1", "--directions", "4"]


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the charts' pictures empty: tests/planfly/campaigns/test_report.py has them drawn."""
    monkeypatch.setattr(report, "png_bytes", lambda _: b"")
    monkeypatch.setattr("planfly.campaigns.page.page_svg", lambda *_: "")


@pytest.fixture
def flown_here() -> Iterator[None]:
    """Fly in this process: that processes fly the same is tested in tests/planfly/campaigns."""
    with flying_here():
        yield


@pytest.mark.usefixtures("flown_here", "undrawn")
def test_a_short_mission_has_its_chart_stopped_or_not(
    line: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(find_winds, "MIN_FLIGHTS_PER_DIRECTION", 8)
    out = tmp_path / "out"
    answer = answered(capsys, 3, *line, "--flights", "8", "--out", str(out))
    assert {path.name for path in out.iterdir()} == {"winds.html", "winds.json", "winds.png", WINDS_DATABASE}
    data = json.loads((out / "winds.json").read_text())
    assert data | {"exit_code": 3} == answer
    assert answer["answer"] == "not judged"
    assert (data["flights"], len(data["directions"])) == (8, 4)
    assert "wind_speed" not in data["spread"]
    assert main([*line, "--out", str(out)]) == 2
    assert "--resume continues it" in capsys.readouterr().err
    # As a kill leaves it: a round with gaps, and no chart.
    again = tmp_path / "again"
    again.mkdir()
    shutil.copy(out / WINDS_DATABASE, again)
    with closing(sqlite3.connect(again / WINDS_DATABASE)) as connection, connection:
        connection.execute("DELETE FROM flights WHERE flight IN (1, 4) OR flight > 5")
    # Neither the goal nor the flights' options are stated again.
    assert answered(capsys, 3, *line[:2], "--workers", "1", "--out", str(again), "--resume") == answer
    assert table(again / WINDS_DATABASE) == table(out / WINDS_DATABASE)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_says_what_is_kept_and_how_to_go_on(
    line: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], number: int
) -> None:
    def interrupted(base: CampaignBase, _goal: WindsGoal, _workers: object, store: WindsStore, *_: object) -> None:
        for index in range(3):
            store.add(RequestedFlight(index, 0, 5.0, index), made_flight(base, index))
        raise Interrupted(number)

    monkeypatch.setattr(campaigns, "find_winds", interrupted)
    assert main([*line, "--out", str(tmp_path / "out")]) == 128 + number
    told = capsys.readouterr().err.splitlines()
    assert told[-1] == f"planfly: interrupted; 3 flights kept in {tmp_path / 'out'}: continue with --resume"
    assert [path.name for path in (tmp_path / "out").iterdir()] == [WINDS_DATABASE]
    assert len(table(tmp_path / "out" / WINDS_DATABASE)) == 3


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--resume", "--seed", "2"], "other settings: seed 2 instead of "),
        (["--resume", "--prove", "0.9"], "target 0.9: the campaign in this file has 0.99"),
        (["--resume", "--most", "30"], "most 30.0: the campaign in this file has"),
        (["--resume", "--out", "campaign"], "there is no campaign to continue"),
        (["--out", "campaign"], "contains another campaign; --overwrite replaces it"),
        ([], "--resume continues it"),
        (["--resume"], "locked by another process"),
        (["--overwrite"], "locked by another process"),
    ],
)
def test_one_line_and_nothing_lost(
    line: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    more: list[str],
    words: str,
) -> None:
    def left(base: CampaignBase, _goal: WindsGoal, _workers: object, store: WindsStore, *_: object) -> None:
        store.add(RequestedFlight(0, 0, 5.0, 0), made_flight(base, 0))
        raise Interrupted(signal.SIGINT)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(campaigns, "find_winds", left)
    assert main([*line, "--out", "out"]) == 130
    Path("campaign").mkdir()
    Path("campaign", "campaign.sqlite").write_bytes(b"another one's")
    before = table(Path("out", WINDS_DATABASE))
    holder = sqlite3.connect(Path("out", WINDS_DATABASE), isolation_level=None)
    if words == "locked by another process":
        holder.execute("BEGIN IMMEDIATE")
    capsys.readouterr()
    assert main([*line, "--out", "out", *more]) == 2
    holder.close()
    told = [one for one in capsys.readouterr().err.splitlines() if one.startswith("planfly: ")]
    assert len(told) == 1
    assert words in told[0]
    assert table(Path("out", WINDS_DATABASE)) == before
    assert Path("campaign", "campaign.sqlite").read_bytes() == b"another one's"


@pytest.mark.usefixtures("flown_here", "undrawn")
def test_winds_fly_the_draws_of_an_aircraft(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The whole of it: another aircraft each flight, by its seed, in place of factors on drag and control power."""
    monkeypatch.setattr(find_winds, "MIN_FLIGHTS_PER_DIRECTION", 4)
    monkeypatch.chdir(tmp_path)
    made = make_data_sheet_folder(tmp_path / "foam", DataSheet(2.1, 1.6, 15.0, 10.0))
    rows = [f"{k}\t0\t0\t16\t0\t0\t0\t0\t{46.0 + 0.002 * k:.6f}\t8.0\t500.0\t1" for k in range(3)]
    Path("hop.waypoints").write_text("QGC WPL 110\n" + "\n".join(rows) + "\n")
    line = ["winds", "hop.waypoints", "--aircraft", "./foam", "--workers", "1", "--directions", "4", "--flights", "4"]
    data = answered(capsys, 3, *line, "--most", "6", "--out", "drawn")
    assert data["flights"] == 4
    assert "mass" in data["spread"]
    assert not {"drag", "control_power"} & set(data["spread"])
    # With aircraft that hardly have thrust, none of the same flights flies.
    file = made.folder / "draws.csv"
    draws = read_draws(file)
    weak = np.where(np.array(draws.names) == "ident/thrust", 0.05, draws.values)
    file.write_text(draws_text(replace(draws, values=weak)), encoding="utf-8")
    assert main([*line, "--most", "6", "--out", "weak"]) == 4
    assert outcomes(tmp_path / "drawn" / WINDS_DATABASE) == ["flyable"] * 4
    assert "flyable" not in outcomes(tmp_path / "weak" / WINDS_DATABASE)


def outcomes(file: Path) -> list[str]:
    """Of each flight of a table."""
    with closing(sqlite3.connect(file)) as connection:
        return [str(outcome) for (outcome,) in connection.execute("SELECT outcome FROM flights")]
