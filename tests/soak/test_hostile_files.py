"""1,000 hostile files a format in a soak: each is judged or refused in one line, and none takes a process down.

A file is its format and its number: ``python -m tests.soak.meet_hostile_files wpl 17 1`` meets one again, in a folder
that `make_valid` has filled.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from flight.mission_files.formats import mission_text, read_mission
from tests.clients import ROOT
from tests.logs.made_flight import make_setup, make_track, record
from tests.planfly.conftest import FIELD
from tests.soak import SOAK, note, only_in_soak, scaled
from tests.soak.hostile_files import DAMAGE, JSON_VALUES, hostile

# Exit codes of a command that has read what it was given, or refused it.
ANSWERS = (0, 2, 3, 4)
# One process for all, outside a soak.
KINDS = tuple(DAMAGE) if SOAK else (",".join(DAMAGE),)
WPL = "\n".join(
    [
        "QGC WPL 110",
        *(
            "\t".join(line.split())
            for line in (
                "0 1 0 16 0 0 0 0 46.0 8.0 0 1",
                "1 0 3 22 0 0 0 0 46.0 8.0 100 1",
                "2 0 3 16 0 0 0 0 46.004 8.0 110 1",
                "3 0 3 18 2 0 200 0 46.008 8.004 110 1",
                "4 0 2 178 0 24 -1 0 0 0 0 1",
                "5 0 3 16 0 0 0 0 46.004 8.006 110 1",
                "6 0 2 177 2 1 0 0 0 0 0 1",
                "7 0 3 16 0 0 0 0 46.0 8.006 100 1",
            )
        ),
        "",
    ]
)


def make_valid(folder: Path) -> None:
    """A valid file of each format."""
    (folder / "m.waypoints").write_text(WPL, encoding="ascii")
    (folder / "m.plan").write_text(mission_text(read_mission(folder / "m.waypoints"), "plan"), encoding="utf-8")
    (folder / "field.toml").write_text(FIELD, encoding="utf-8")
    profile = {"driver": "GTiff", "width": 60, "height": 60, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    with rasterio.open(folder / "m.tif", "w", transform=Affine(1e-3, 0, 7.98, 0, -1e-3, 46.03), **profile) as file:
        file.write(np.zeros((1, 60, 60), np.float32))
    record(folder / "m.mcap", make_setup(), make_track(4.0))
    shutil.copytree(ROOT / "aircraft" / "aerosonde", folder / "own")
    for old, new in (("aerosonde.xml", "own.xml"), ("aerosonde.toml", "own.toml")):
        (folder / "own" / old).rename(folder / "own" / new)
    shutil.copytree(folder / "own", folder / "bad" / "own")
    shutil.copy(ROOT / "aircraft" / "aerosonde" / "ardupilot.parm", folder / "m.parm")


@only_in_soak
@pytest.mark.parametrize("kind", KINDS)
def test_hostile_files_are_judged_or_refused(kind: str, tmp_path: Path) -> None:
    make_valid(tmp_path)
    count = scaled(1000, 3)
    found, first, crashes = [], 0, []
    while first < count:
        done = subprocess.run(
            [sys.executable, "-m", "tests.soak.meet_hostile_files", kind, str(first), str(count - first)],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"},
            capture_output=True,
            text=True,
            check=False,
            timeout=7200,
        )
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        # Of a valid file that is refused, damaged copies would say nothing.
        assert [line["valid"] for line in lines if "valid" in line and line["valid"]["code"] == 2] == []
        found += [line for line in lines if "code" in line]
        begun = [line["begun"] for line in lines if "begun" in line]
        if done.returncode == 0:
            assert lines[-1] == {"left": []}
            break
        assert begun, done.stderr[-3000:]
        crashes.append((begun[-1], done.returncode, done.stderr[-300:]))
        first = begun[-1] + 1
    wrong = [
        line
        for line in found
        if line["trace"] or line["code"] not in ANSWERS or (line["code"] == 2 and _lines(line["said"]) != 1)
    ]
    note(
        f"hostile {kind}",
        count=len(found),
        refused=sum(line["code"] == 2 for line in found),
        judged=sum(line["code"] in (0, 3, 4) for line in found),
        slowest_s=max(line["seconds"] for line in found),
        wrong=len(wrong),
        crashes=len(crashes),
    )
    for line in wrong[:5]:
        print(kind, line)
    assert crashes == []
    # Seconds of a core, of which nothing else on the machine takes any.
    assert [(line["seed"], line["seconds"]) for line in found if line["seconds"] > 60.0] == []
    assert [(line["seed"], line["code"], line["said"][:300], line["trace"][-600:]) for line in wrong] == []
    assert any(line["code"] == 2 for line in found) or count < 5


def test_a_number_makes_the_same_file_whatever_was_made_before(tmp_path: Path) -> None:
    make_valid(tmp_path)
    for kind, name in (("plan", "m.plan"), ("wpl", "m.waypoints"), ("mcap", "m.mcap")):
        valid = (tmp_path / name).read_bytes()
        first = hostile(kind, valid, 60)
        for seed in range(60):
            hostile(kind, valid, seed)
        assert hostile(kind, valid, 60) == first
        assert JSON_VALUES[-6:] == ([], {}, [[]], [None] * 7, {"a": {"a": {}}}, [0] * 5000)


def _lines(said: str) -> int:
    """Lines of an error; warnings and the progress of work stand before it."""
    return sum(line.startswith("planfly: ") for line in said.splitlines())
