"""``planfly plan``: a real Ctrl-C leaves the best plan so far."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from planfly.cli import main
from tests.instances import make_instance, scenario_text

# Without seeds a search goes on for all its generations: hours.
# Each generation ends well within what a command is given after Ctrl-C, on a loaded machine, too.
PLANNER = 'algorithm = "umda-smooth"\nwaypoints = 10\npopulation = 200\ngenerations = 100000\n'


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    text = scenario_text("endless", make_instance(0, 7), "a search that does not end")
    head, tail = text.split("[planner]\n")
    file = tmp_path / "endless.toml"
    file.write_text(f"{head}[planner]\n{PLANNER}\n[flight]{tail.split('[flight]')[1]}", encoding="utf-8")
    return file


def test_ctrl_c_leaves_the_best_plan_so_far(endless: Path, tmp_path: Path) -> None:
    out = tmp_path / "plan.json"
    command = [sys.executable, "-m", "planfly", "plan", str(endless), "--out", str(out)]
    # Before the search, while kernels are compiled or read, Ctrl-C ends the command without a plan.
    for pause in (0.0, 4.0, 16.0, 64.0):
        process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert process.stderr is not None
        line = process.stderr.readline()
        while line.startswith(("compiling", "planning endless ...")):
            line = process.stderr.readline()
        assert line.startswith("planning endless: "), line
        time.sleep(pause)
        process.send_signal(signal.SIGINT)
        text, error = process.communicate(timeout=120.0)
        if process.returncode != 130:
            break
    # A few generations without seeds may not have found a safe path yet.
    assert process.returncode in (0, 4), error
    assert "ended by Ctrl-C" in text
    plan = json.loads(out.read_text(encoding="utf-8"))
    assert plan["ended"] == "interrupted"
    assert plan["evaluations"] >= 200
    assert len(plan["waypoints_east_north_amsl_m"]) == 10


FIELD = """\
name = "field"
[terrain]
kind = "flat"
amsl_m = 100
[area]
east_m = [0, 8000]
north_m = [0, 8000]
ceiling_amsl_m = 900
[home]
place = "start"
[start]
east_m = 1500
north_m = 1500
height_m = 120
[destination]
east_m = 5500
north_m = 5500
height_m = 120
[landing]
east_m = 4000
north_m = 6000
slope_deg = {slope}
"""


def test_a_landing_that_cannot_be_flown_is_said_and_ends_with_4(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "field.toml", tmp_path / "plan.json"
    for slope, code in ((4.0, 0), (12.0, 4)):
        file.write_text(FIELD.format(slope=slope), encoding="utf-8")
        assert main(["plan", str(file), "--out", str(out), "--overwrite"]) == code
        text = capsys.readouterr().out
        assert ("failed  landing: on a course of 0°, the approach needs a descent angle of 12" in text) is (code == 4)
        assert ("descent" in json.loads(out.read_text())["ground_ways"]) is (code == 0)
