"""An aircraft of one's own, the Aerosonde with one change, in a folder of the test, and a mission to fly it with."""

import shutil
from pathlib import Path

import pytest

from aircraft.catalog import load_aircraft
from planfly.cli import main

HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1\n"
ROW = "{}\t0\t0\t16\t0\t0\t0\t0\t{:.6f}\t8.0\t{:.1f}\t1\n"
SCENARIO = """\
name = "pit"
origin = { lat_deg = 46.0, lon_deg = 8.0 }
[terrain]
kind = "peaks"
[[terrain.peak]]
east_m = 0
north_m = 3000
height_m = 600
sigma_m = 400
[area]
east_m = [-4000, 4000]
north_m = [-2000, 8000]
ceiling_amsl_m = 3000
[start]
east_m = 0
north_m = -1000
amsl_m = 1000
[destination]
east_m = 0
north_m = 7000
amsl_m = 1000
"""


def write_mission(*heights: float) -> None:
    """Due north, a point every 2 km from 1 km south of the origin, at these heights AMSL."""
    rows = [ROW.format(k + 1, 46.0 + (2000.0 * k - 1000.0) / 111_170.0, up) for k, up in enumerate(heights)]
    Path("m.waypoints").write_text(HEAD + "".join(rows), encoding="utf-8")


def write_scenario(more: str = "") -> None:
    Path("s.toml").write_text(SCENARIO + more, encoding="utf-8")


def fly() -> int:
    return main(["fly", "m.waypoints", "--scenario", "s.toml", "--log", "f.mcap"])


def assert_refused(capsys: pytest.CaptureFixture[str], *said: str) -> None:
    """Both ways in refuse the model in one line, with exit code 2, and nothing is written."""
    before = sorted(Path().rglob("*"))
    for command in (["fly", "m.waypoints", "--scenario", "s.toml", "--log", "f.mcap"], ["aircraft", "./own"]):
        assert main(command) == 2
        captured = capsys.readouterr()
        lines = [line for line in captured.err.splitlines() if line.startswith("planfly: ")]
        assert len(lines) == 1, captured.err
        assert "Traceback" not in captured.err
        for part in said:
            assert part in lines[0]
    assert sorted(Path().rglob("*")) == before


def copy_aerosonde(folder: Path) -> None:
    """Make ./own of this folder, the Aerosonde under another name."""
    shutil.copytree(load_aircraft("aerosonde").folder, folder / "own")
    for file in (folder / "own").glob("aerosonde.*"):
        file.rename(file.with_stem("own"))


def change_model(folder: Path, old: str, new: str) -> None:
    """Make ./own of this folder, the Aerosonde with one change, and a scenario and a mission that fly it there."""
    copy_aerosonde(folder)
    model = folder / "own" / "own.xml"
    text = model.read_text(encoding="utf-8")
    assert old in text
    model.write_text(text.replace(old, new, 1), encoding="utf-8")
    write_scenario('[flight]\naircraft = "./own"\n')
    write_mission(1000.0, 1000.0, 1000.0)
