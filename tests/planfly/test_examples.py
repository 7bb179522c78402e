"""The example scripts run, as they stand, and leave what they say."""

import runpy
from pathlib import Path

import pytest

from tests.soak import SOAK

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.skipif(not SOAK, reason="README's lines, nearly the same, run in the tests of the pages; in make soak")
def test_from_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / "from_python.py"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("flyable")
    assert lines[-1] == str(Path("report") / "report.html")
    assert {file.name for file in tmp_path.iterdir()} == {
        *("flight.mcap", "map.png", "mission.waypoints", "mission.kml", "track.csv", "report"),
    }


def test_the_script_is_short() -> None:
    lines = (EXAMPLES / "from_python.py").read_text().splitlines()
    assert sum(bool(line) and not line.startswith(('"""', "import")) for line in lines) <= 10
