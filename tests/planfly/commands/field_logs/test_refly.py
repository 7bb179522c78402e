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
    assert "AUTO from 20.0 s to 111.8 s, legs 0 to 1: flown / simulated" in out
    blown = "Model aerosonde in 3.0 m/s of wind, no gusts, against the flight, median (95 %): cross-track"
    assert blown in out
    files = sorted(path.name for path in (tmp_path / "a-refly").iterdir())
    assert files == [*(f"refly-{name}.png" for name in ("bank", "cross-track", "energy", "ground-speed", "height")),
                     "simulated.mcap"]  # fmt: skip
    simulated = read_log(tmp_path / "a-refly" / "simulated.mcap")
    assert (simulated.complete, simulated.setup.source) == (True, None)
    assert main(["refly", str(flight), "--out", str(tmp_path / "a-refly")]) == 2
    assert "not empty" in capsys.readouterr().err


def test_each_stretch_has_its_tables_and_files_and_what_is_left_is_named(tmp_path: Path, capsys: Output) -> None:
    """AUTO to waypoint 2, by hand, AUTO from before it to the end; and half a second of AUTO between."""
    modes = ((20.0, 10), (40.0, 5), (60.0, 10), (60.5, 5), (68.0, 10))
    flight = tmp_path / "a.mcap"
    main(["import", str(dataflash(tmp_path / "a.BIN", modes=modes)), str(flight), "--aircraft", "aerosonde"])
    capsys.readouterr()
    assert main(["refly", str(flight), "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert "AUTO from 20.0 s to 40.0 s, legs 0 to 0: flown / simulated" in out
    assert "AUTO from 68.0 s to 111.8 s, legs 1 to 1: flown / simulated" in out
    assert "Not flown again: AUTO from 60.0 s to 60.5 s: it passed no two waypoints in order" in out
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"simulated.mcap", "simulated-2.mcap", "refly-height.png", "refly-height-2.png"} <= files
    assert main(["refly", str(flight), "--out", str(tmp_path / "out"), "--overwrite"]) == 0


def test_a_flight_of_planflys_own_is_refused(tmp_path: Path, capsys: Output) -> None:
    log = write_example_log(tmp_path / "a.mcap")
    assert main(["refly", str(log)]) == 2
    assert "flown by planfly itself" in capsys.readouterr().err
