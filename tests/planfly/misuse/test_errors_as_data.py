"""What an error says of a file, a field and a value stands in its attributes, too."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flight.autopilots.parameter_files import parse_parameters
from flight.mission_files.formats import HEADER, parse_mission, read_mission
from flight.mission_files.qgc_plan import parse_plan_file
from logs.recording.reader import read_log
from planfly.workflow.uav import load_uav
from planner.plan import read_plan
from planner.search.algorithms import find_algorithm
from tests.world.made.made_scenario import SMALL
from world.errors import PlanflyError
from world.raster import open_raster
from world.scenario import load_scenario, with_flight, with_wind
from world.scenario_file import parse_scenario

_ITEM = "0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t500\t1"
_PARAMETERS = "WP_RADIUS\t90\nROLL_LIMIT_DEG\t{}\n"


def _params(folder: Path, text: str) -> object:
    file = folder / "my.parm"
    file.write_text(text)
    return load_uav(with_flight(load_scenario("tight"), params=str(file)))


# What is refused, and the file, field, value and words of it.
CASES: dict[str, tuple[Callable[[Path], object], str, str, Any, str]] = {
    "a number out of its range": (
        lambda _: parse_scenario(SMALL + "\n[wind]\nspeed_mps = 41.0\n", "a.toml"),
        *("a.toml", "wind.speed_mps", 41.0, "allowed 0..40"),
    ),
    "an unknown key": (
        lambda _: parse_scenario("colour = 1\n" + SMALL, "a.toml"),
        *("a.toml", "colour", 1, "unknown key"),
    ),
    "a missing key": (lambda _: parse_scenario("", "a.toml"), "a.toml", "name", None, "missing"),
    "no such scenario": (lambda _: load_scenario("nowhere"), "nowhere", "", None, ""),
    "an option of Python's": (
        lambda _: with_wind(load_scenario("tight"), 50.0, 0.0, None),
        *("tight: wind", "speed_mps", 50.0, "allowed 0..40"),
    ),
    "an algorithm": (lambda _: find_algorithm("ga", "a.toml"), "a.toml", "planner.algorithm", "ga", "unknown"),
    "a whole number of a mission": (
        lambda _: parse_mission(f"{HEADER}\n{_ITEM.replace('16', '1.5', 1)}\n", "a.waypoints"),
        *("a.waypoints", "command", "1.5", "expected a whole number 0..65535"),
    ),
    "a number of a mission": (
        lambda _: parse_mission(f"{HEADER}\n{_ITEM.replace('8.0', '8,0')}\n", "a.waypoints"),
        *("a.waypoints", "longitude", "8,0", "expected a finite number (a decimal comma?)"),
    ),
    "the header of a mission": (
        lambda _: parse_mission("QGC WPL 999\n", "a.waypoints"),
        *("a.waypoints", "header", "QGC WPL 999", HEADER),
    ),
    "a suffix": (
        lambda folder: read_mission(folder / "a.doc"),
        *("a.doc", "suffix", ".doc", ".waypoints"),
    ),
    "a key of a plan file": (
        lambda _: parse_plan_file('{"fileType": "Plan", "version": "x", "mission": {}}', "a.plan"),
        *("a.plan", "version", "x", "expected"),
    ),
    "a parameter's text": (
        lambda _: parse_parameters("WP_RADIUS wide\n", "a.parm"),
        *("a.parm", "WP_RADIUS", "wide", "expected a finite number"),
    ),
    "a parameter's range": (
        lambda folder: _params(folder, _PARAMETERS.format("200")),
        *("my.parm", "ROLL_LIMIT_DEG", 200.0, "allowed "),
    ),
    "no such plan": (lambda folder: read_plan(folder / "plan.json"), "plan.json", "", None, ""),
    "no such log": (lambda folder: read_log(folder / "a.mcap"), "a.mcap", "", None, ""),
    "no such terrain": (lambda folder: open_raster(str(folder / "a.tif")), "a.tif", "", None, ""),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_known_stands_in_the_attributes(case: str, tmp_path: Path) -> None:
    fault, file, field, value, allowed = CASES[case]
    with pytest.raises(PlanflyError) as caught:
        fault(tmp_path)
    error = caught.value
    assert Path(error.file).name == file
    assert (error.field, error.value) == (field, value)
    assert error.allowed.startswith(allowed)
    assert bool(error.allowed) == bool(allowed)


@pytest.mark.parametrize("case", CASES)
def test_the_line_says_what_the_attributes_hold(case: str, tmp_path: Path) -> None:
    with pytest.raises(PlanflyError) as caught:
        CASES[case][0](tmp_path)
    error, line = caught.value, str(caught.value)
    assert "\n" not in line
    assert line.startswith(error.file)
    assert error.field in line
    assert error.allowed in line
