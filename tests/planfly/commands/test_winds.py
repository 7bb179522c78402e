"""``planfly winds``: the chart of a short mission."""

import json
from pathlib import Path

import pytest

from planfly.cli import main
from tests.planfly.campaigns.made_campaigns import write_short
from tests.planfly.terminal.answers.checked_answers import answered


@pytest.mark.filterwarnings("default")
def test_a_short_mission_has_its_chart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission, scenario = write_short(tmp_path)
    line = ["winds", str(mission), "--scenario", str(scenario), "--workers", "1", "--directions", "4"]
    answer = answered(capsys, 0, *line, "--flights", "12", "--out", str(tmp_path / "out"))
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"winds.html", "winds.json", "winds.png"}
    data = json.loads((tmp_path / "out" / "winds.json").read_text())
    assert data == answer
    assert (data["flights"], len(data["directions"])) == (12, 4)
    assert "wind_speed" not in data["spread"]
    assert main([*line, "--out", str(tmp_path / "out")]) == 2
    assert "not empty" in capsys.readouterr().err
