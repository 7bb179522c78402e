"""The base alone: its commands work where no extra is installed, and what needs one says so in one line.

All run in one new process, which refuses every module of an extra from its start.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from logs.recording.example_log import write_example_log
from planfly.cli import COMMANDS, main
from tests.logs.importers.written_logs import dataflash, gpx, telemetry
from tests.world.made.elevation_files import write_geotiff
from world.extras import EXTRAS

ROOT = Path(__file__).parents[2]
MODULES = sorted({module for extra in EXTRAS.values() for module in extra.modules})
# Runs command lines, and tells of each its exit code, what it printed to standard error, and the files that it made.
_RUN = """
import contextlib, io, json, sys
from pathlib import Path

class Refusing:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in REFUSED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

REFUSED = set(json.loads(sys.argv[1]))
sys.meta_path.insert(0, Refusing())
from logs.views import drawing
from planfly.cli import main

# The film's frames are rendered; blank pictures will do for a page.
drawing.png_bytes = lambda _: b"PNG"
told = []
for words in json.loads(sys.argv[2]):
    before = set(Path().rglob("*"))
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        try:
            code = main(words)
        except SystemExit as stop:
            code = stop.code
    made = sorted(str(one) for one in set(Path().rglob("*")) - before)
    told.append([code, errors.getvalue(), made])
print(json.dumps([told, sorted(REFUSED & {name.partition(".")[0] for name in sys.modules})]))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the commands are given."""
    made = tmp_path_factory.mktemp("base")
    whole = write_example_log(made / "flight.mcap").read_bytes()
    (made / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    dataflash(made / "flight.BIN")
    gpx(made / "flight.gpx")
    telemetry(made / "flight.tlog")
    (made / "flight.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))
    (made / "flight.csv").write_text("t,roll\n0,1\n")
    (made / "flight.columns.toml").write_text("[columns]\n")
    (made / "winds.nc").write_bytes(b"\x89HDF\r\n\x1a\n")
    (made / "winds.grib2").write_bytes(b"GRIB")
    (made / "arduplane").write_text("#!/bin/sh\n")
    (made / "arduplane").chmod(0o755)
    write_geotiff(made / "dem.tif", compress="lzw", predictor=3)
    lines = ["QGC WPL 110", "0 1 0 16 0 0 0 0 46.06 8.04 900 1"]
    places = [(46.055, 8.04), (46.059, 8.042), (46.063, 8.044)]
    lines += [f"{k} 0 0 16 0 0 0 0 {lat} {lon} 1500 1" for k, (lat, lon) in enumerate(places, 1)]
    (made / "mission.waypoints").write_text("\n".join(lines) + "\n")
    return made


# Of a verdict the code may be any.
VERDICT = (0, 3, 4)
BASE: dict[str, tuple[tuple[int, ...], str]] = {
    "plan paper-07 --seed 1 --out plan.json": ((0,), "plan.json"),
    "fly mission.waypoints --terrain dem.tif --log flown.mcap --autopilot px4": (VERDICT, "flown.mcap"),
    "check mission.waypoints --terrain dem.tif": (VERDICT, ""),
    "check flight.mcap": (VERDICT, ""),
    "compare flight.mcap flight.mcap --out compared": ((0,), "compared"),
    "export flight.mcap a.csv a.kml a.gpx a.ulg a.waypoints": ((0,), "a.ulg"),
    "recover cut.mcap --out whole.mcap": (VERDICT, "whole.mcap"),
    "import flight.BIN imported.mcap": (VERDICT, "imported.mcap"),
    "check flight.gpx": (VERDICT, ""),
    "replay flight.mcap --at-once": ((0,), ""),
    "replay flight.mcap --movie a.gif --speed 100": ((0,), "a.gif"),
    "terrain --box 46.04,8.02,46.05,8.04 --source dem.tif --margin 0.1 --out cut.tif": ((0,), "cut.tif"),
    "aircraft --new ./foam --mass 2.1 --span 1.6 --cruise 15 --stall 10": ((0,), "foam/foam.xml"),
    "scenarios": ((0,), ""),
}


MISSED = {
    "campaign paper-07": ("campaigns", "campaigns need"),
    "campaign paper-07 --out c --refly 3": ("campaigns", "campaigns need"),
    "winds paper-07": ("campaigns", "campaigns need"),
    "window paper-07 --from 2026-05-01T06:00Z": ("campaigns", "campaigns need"),
    "check mission.waypoints --terrain dem.tif --forecast winds.nc --at 2026-05-01T06:00Z": (
        "forecast",
        "a forecast as NetCDF needs",
    ),
    "check mission.waypoints --terrain dem.tif --forecast winds.grib2 --at 2026-05-01T06:00Z": (
        "grib",
        "a forecast as GRIB needs",
    ),
    "studio": ("studio", "the studio needs"),
    "serve": ("live", "serve needs"),
    "replay flight.mcap --to 127.0.0.1:9": ("live", "playing to ground stations needs"),
    "fly mission.waypoints --terrain dem.tif --sitl ./arduplane --log l.mcap": ("live", "--sitl needs"),
    "run paper-07 --sitl ./arduplane": ("live", "--sitl needs"),
    "export flight.mcap b.csv b.tlog": ("live", ".tlog needs"),
    "import flight.tlog b.mcap": ("live", "flight.tlog: reading .tlog needs"),
    "check flight.tlog": ("live", "flight.tlog: reading .tlog needs"),
    "replay flight.mcap --foxglove": ("foxglove", "--foxglove needs"),
    "replay flight.mcap --movie b.mp4": (
        "films",
        "b.mp4: an .mp4 needs ffmpeg (a .gif or a folder does not), or",
    ),
    "export flight.mcap b.csv b.parquet": ("tables", ".parquet needs"),
    "check flight.ulg": ("px4-logs", "flight.ulg: reading .ulg needs"),
    "check flight.csv": ("data-logs", "flight.csv: reading .csv needs"),
    "import flight.columns.toml b.mcap": ("data-logs", "flight.columns.toml: reading .columns.toml needs"),
    "import flight.ulg b.mcap": ("px4-logs", "flight.ulg: reading .ulg needs"),
    "aircraft --identify flight.BIN --mass 13 --span 2.9 --out ./mine": (
        "identification",
        "identifying an aircraft needs",
    ),
}


class Told(NamedTuple):
    """What came of a command line: its exit code, its errors, and the files that it made."""

    code: int
    errors: str
    made: list[str]


@pytest.fixture(scope="module")
def told(folder: Path) -> dict[str, Told]:
    """By each line, what came of it; and that no module of an extra was imported by then."""
    lines = [*BASE, *MISSED]
    command = [sys.executable, "-c", _RUN, json.dumps(MODULES), json.dumps([line.split() for line in lines])]
    # Without ffmpeg, whatever this machine has.
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PATH": "/nowhere"}
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, env=environment)
    found, imported = json.loads(done.stdout)
    assert imported == []
    return {line: Told(*one) for line, one in zip(lines, found, strict=True)}


@pytest.mark.parametrize("line", BASE)
def test_the_base_does_its_work_without_any_extra(line: str, told: dict[str, Told]) -> None:
    codes, file = BASE[line]
    assert told[line].code in codes, told[line].errors
    assert "Traceback" not in told[line].errors
    assert not file or file in told[line].made


@pytest.mark.parametrize("line", MISSED)
def test_what_is_missing_is_named_in_one_line_and_nothing_is_written(line: str, told: dict[str, Told]) -> None:
    extra, needs = MISSED[line]
    said = f"planfly: {needs} the extra '{extra}': pip install 'planfly[{extra}]'\n"
    assert told[line] == (2, said, [])


def test_each_extra_is_missed_by_a_command() -> None:
    # A cluster's is missed where that of campaigns is there: tests/planfly/campaigns/test_worker_pool.py.
    assert {extra for extra, _ in MISSED.values()} == set(EXTRAS) - {"cluster"}


def test_help_names_each_extra_where_it_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    for command in COMMANDS:
        with pytest.raises(SystemExit) as stopped:
            main([command.name, "--help"])
        assert stopped.value.code == 0
    named = set(re.findall(r"planfly\[([\w-]+)\]", re.sub(r"\s+", " ", capsys.readouterr().out)))
    assert named == set(EXTRAS)
