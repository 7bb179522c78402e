"""``planfly plan``: a real Ctrl-C leaves the best plan so far."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.instances import make_instance, scenario_text

# Without seeds a search goes on for all its generations: hours.
PLANNER = 'algorithm = "umda-smooth"\nwaypoints = 10\npopulation = 2000\ngenerations = 100000\n'


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    text = scenario_text("endless", make_instance(0, 7), "a search that does not end")
    head, tail = text.split("[planner]\n")
    file = tmp_path / "endless.toml"
    file.write_text(f"{head}[planner]\n{PLANNER}\n[flight]{tail.split('[flight]')[1]}", encoding="utf-8")
    return file


def interrupted(endless: Path, out: Path) -> tuple[int, str, str]:
    """Exit code, output and errors of a search that Ctrl-C ends."""
    command = [sys.executable, "-m", "planfly", "plan", str(endless), "--out", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stderr is not None
    line = process.stderr.readline()
    # Before it, where its kernels are not in the cache.
    while line.startswith("compiling"):
        line = process.stderr.readline()
    assert line.startswith("planning"), line
    # The search has begun, or is about to, while compiled code is read.
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    text, error = process.communicate(timeout=120.0)
    return process.returncode, text, error


def test_ctrl_c_leaves_the_best_plan_so_far(endless: Path, tmp_path: Path) -> None:
    """Or ends the command, where that is not done within a second: on a loaded machine it is tried again."""
    out = tmp_path / "plan.json"
    code, text, error = interrupted(endless, out)
    while code == 128 + signal.SIGINT:
        assert not out.exists()
        code, text, error = interrupted(endless, out)
    # A few generations without seeds may not have found a safe path yet.
    assert code in (0, 4), error
    assert "ended by Ctrl-C" in text
    plan = json.loads(out.read_text(encoding="utf-8"))
    assert plan["ended"] == "interrupted"
    assert plan["evaluations"] >= 2000
    assert len(plan["waypoints_east_north_amsl_m"]) == 10
