from pathlib import Path

import pytest

from logs.recording.example_log import write_example_log
from logs.recording.reader import read_log
from planfly.cli import main
from tests.logs.field_logs.written_logs import dataflash

Output = pytest.CaptureFixture[str]


def test_tables_pictures_and_a_log_of_the_models_flight(tmp_path: Path, capsys: Output) -> None:
    flight = tmp_path / "a.mcap"
    assert main(["import", str(dataflash(tmp_path / "a.BIN")), str(flight), "--aircraft", "aerosonde"]) == 0
    capsys.readouterr()
    assert main(["refly", str(flight)]) == 0
    out = capsys.readouterr().out
    assert "Model aerosonde against the flight, median (95 %): cross-track" in out
    files = sorted(path.name for path in (tmp_path / "a-refly").iterdir())
    assert files == [*(f"refly-{name}.png" for name in ("bank", "cross-track", "energy", "ground-speed", "height")),
                     "simulated.mcap"]  # fmt: skip
    simulated = read_log(tmp_path / "a-refly" / "simulated.mcap")
    assert (simulated.complete, simulated.setup.source) == (True, None)
    assert main(["refly", str(flight), "--out", str(tmp_path / "a-refly")]) == 2
    assert "not empty" in capsys.readouterr().err


def test_a_flight_of_planflys_own_is_refused(tmp_path: Path, capsys: Output) -> None:
    log = write_example_log(tmp_path / "a.mcap")
    assert main(["refly", str(log)]) == 2
    assert "flown by planfly itself" in capsys.readouterr().err
